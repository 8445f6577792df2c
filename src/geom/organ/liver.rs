//! The liver: a dome under the diaphragm, cut off below by the hollow visceral surface, so that
//! the sharp lower margin is where the two meet.
//!
//! Proportions after the usual anatomical plates: 22 cm wide, large right lobe, left lobe tapering
//! to a thin tongue, the ligaments' notch between them, the gallbladder's fundus just below the
//! margin.

use super::Features;
use super::field::{
    Shape, along, carve, ellipsoid, ellipsoid_along, hump, inside, join, meet, tube,
};
use crate::geom::noise::{gradient, smoothstep};
use glam::{Vec2, Vec3};

pub const SHAPE: Shape = Shape {
    field,
    low: Vec3::new(-12.5, -9.5, -8.0),
    high: Vec3::new(12.5, 9.5, 8.0),
    cell: 0.46,
};

/// Roots of the vessels that run over the liver: from the porta hepatis and from the ligament.
pub const VESSELS: &[&[[f32; 3]]] = &[
    &[[0.2, 1.2, -1.0], [-2.5, 0.5, -0.5], [-5.0, -0.5, 0.0]],
    &[[0.6, 1.2, -1.0], [3.0, 2.2, 0.0], [5.5, 2.8, 0.6]],
    &[[1.2, 5.5, 3.0], [1.1, 3.0, 5.2]],
];

const NECK: Vec3 = Vec3::new(-1.0, 0.4, -0.4);
const FUNDUS: Vec3 = Vec3::new(-3.1, -3.15, 4.5);
const NOTCH: Vec3 = Vec3::new(1.5, -2.3, 4.9);
const PORTA_IN: Vec3 = Vec3::new(0.4, 2.0, -1.0);
const PORTA_OUT: Vec3 = Vec3::new(0.9, -0.5, -1.9);

pub fn field(p: Vec3) -> f32 {
    let right = cushion(p, Vec3::new(-4.2, -0.6, -0.6), Vec3::new(6.9, 7.3, 5.7));
    let axis = Vec3::new(0.98, 0.12, 0.16).normalize();
    let left = ellipsoid_along(p, Vec3::new(2.6, 1.5, 0.6), axis, Vec3::new(9.0, 4.5, 4.5));
    let dome = join(right, left, 3.0);
    let mut f = meet(dome, visceral(p), 0.55);

    // The bed of the vena cava along the back.
    let cava = tube(
        p,
        Vec3::new(0.6, -4.0, -6.6),
        Vec3::new(0.2, 9.0, -5.8),
        1.5,
        1.5,
    );
    f = carve(f, cava, 0.8);
    // The notch of the round ligament, and its fissure on the visceral side.
    let notch = ellipsoid(p, NOTCH, Vec3::new(0.5, 2.3, 2.6));
    let fissure = tube(
        p,
        Vec3::new(1.5, -2.4, 4.5),
        Vec3::new(1.3, 1.0, -1.0),
        0.5,
        0.35,
    );
    f = carve(f, join(notch, fissure, 0.4), 0.6);
    // The line of the falciform ligament over the dome.
    f += 0.14 * hump((p.x - ligament_x(p)) / 0.36) * smoothstep(-1.0, 1.5, p.z);
    // No organ is as smooth as its formula.
    f += 0.13 * gradient(p / 3.7, 11) + 0.05 * gradient(p / 1.6, 12);
    f = join(f, gallbladder(p), 0.25);
    join(f, porta(p), 0.4)
}

/// A body between an ellipsoid and a box, as organs are that lie against walls.
fn cushion(p: Vec3, centre: Vec3, radii: Vec3) -> f32 {
    let q = (p - centre) / radii;
    let squares = q * q;
    let round = squares.element_sum().sqrt();
    let square = (squares * squares).element_sum().sqrt().sqrt();
    (0.45 * round + 0.55 * square - 1.0) * radii.min_element()
}

/// Negative above the visceral surface: a tilted, hollow sheet.
fn visceral(p: Vec3) -> f32 {
    let front = -2.3 + 0.38 * p.x - 0.014 * p.x * p.x;
    let rise = 0.48 + 0.012 * p.x;
    let hollow = |x: f32, z: f32, wide: f32, deep: f32| {
        hump(Vec2::new((p.x - x) / wide, (p.z - z) / deep).length())
    };
    let stomach = 1.3 * hollow(5.4, 0.6, 4.2, 3.0);
    let kidney = 1.4 * hollow(-6.3, -2.5, 3.0, 2.8);
    let colon = 0.8 * hollow(-7.0, 3.0, 2.6, 2.0);
    let level = front + rise * (5.0 - p.z) + stomach + kidney + colon;
    (level - p.y) / 1.2
}

fn ligament_x(p: Vec3) -> f32 {
    1.3 - 0.05 * (p.y + 2.0)
}

fn gallbladder(p: Vec3) -> f32 {
    let (distance, t) = along(p, NECK, FUNDUS);
    // Pear-shaped: a thin neck, the widest place before the end.
    distance - (0.5 + 0.6 * smoothstep(0.0, 0.8, t))
}

fn porta(p: Vec3) -> f32 {
    let vein = tube(p, PORTA_IN, PORTA_OUT, 0.75, 0.62);
    let lumen = tube(
        p,
        PORTA_OUT,
        PORTA_OUT + 0.6 * (PORTA_OUT - PORTA_IN),
        0.38,
        0.38,
    );
    // Cut off flat, and hollow.
    let end = (p - PORTA_OUT).dot((PORTA_OUT - PORTA_IN).normalize());
    carve(meet(vein, end, 0.15), lumen, 0.12)
}

pub fn features(p: Vec3) -> Features {
    let below = 1.0 - inside(visceral(p), 0.25);
    let near_porta = hump(p.distance(0.5 * (PORTA_IN + PORTA_OUT)) / 2.0);
    let line = hump((p.x - ligament_x(p)) / 0.16) * smoothstep(0.5, 2.0, p.z) * (1.0 - below);
    Features {
        fat: (1.6 * near_porta * below).clamp(0.0, 1.0),
        gallbladder: inside(gallbladder(p) - 0.06, 0.08),
        vein: inside(porta(p) - 0.05, 0.08),
        ligament: line,
        ..Features::default()
    }
}
