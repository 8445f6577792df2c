//! The heart as the surgeon sees it: ventricles with the apex down to the patient's left, auricles
//! on both sides, aorta and pulmonary trunk cut off above, grooves in which the arteries lie.

use super::Features;
use super::field::{
    Shape, along, carve, cut, ellipsoid, ellipsoid_along, hump, inside, join, meet, polyline, tube,
};
use crate::geom::noise::{gradient, smoothstep};
use glam::Vec3;

pub const SHAPE: Shape = Shape {
    field,
    low: Vec3::new(-6.2, -7.2, -5.6),
    high: Vec3::new(6.2, 7.2, 5.2),
    cell: 0.29,
};

/// Arteries from their roots at the aorta: down the front groove, round the right side, round the
/// left side and down the back.
pub const VESSELS: &[&[[f32; 3]]] = &[FRONT_GROOVE, RIGHT_GROOVE, LEFT_GROOVE, BACK_GROOVE];

const FRONT_GROOVE: &[[f32; 3]] = &[
    [1.7, 2.2, 1.9],
    [1.7, 1.2, 2.9],
    [1.9, -0.4, 3.3],
    [2.2, -2.0, 3.4],
    [2.7, -3.8, 3.1],
    [3.0, -5.2, 2.2],
];
const RIGHT_GROOVE: &[[f32; 3]] = &[
    [-0.9, 2.0, 2.0],
    [-1.8, 1.3, 2.3],
    [-2.6, 0.3, 2.2],
    [-3.2, -1.0, 1.3],
    [-3.1, -1.8, -0.2],
    [-2.3, -1.7, -1.6],
    [-1.0, -1.2, -2.6],
];
const LEFT_GROOVE: &[[f32; 3]] = &[
    [1.8, 2.1, 1.7],
    [2.7, 1.9, 0.6],
    [3.0, 1.3, -0.9],
    [2.4, 0.6, -2.2],
    [1.0, -0.2, -2.9],
];
const BACK_GROOVE: &[[f32; 3]] = &[
    [-1.0, -1.2, -2.6],
    [0.2, -2.4, -2.3],
    [1.4, -3.8, -1.2],
    [2.5, -5.2, 0.4],
];

/// From the middle of the base to the apex.
const BASE: Vec3 = Vec3::new(-0.2, 1.0, -0.4);
const APEX: Vec3 = Vec3::new(3.2, -5.9, 2.0);

const AORTA: &[[f32; 3]] = &[
    [0.1, 1.0, 0.2],
    [-0.5, 2.8, 0.7],
    [-0.75, 4.2, 0.5],
    [-0.45, 5.2, -0.1],
];
const TRUNK: &[[f32; 3]] = &[
    [0.5, 0.8, 2.2],
    [0.95, 2.4, 2.1],
    [1.35, 3.8, 1.1],
    [1.5, 4.7, 0.2],
];
const CAVA: &[[f32; 3]] = &[[-2.3, 1.6, -0.7], [-2.35, 3.4, -0.6], [-2.3, 5.0, -0.5]];
const LOWER_CAVA: &[[f32; 3]] = &[[-2.0, -0.5, -1.6], [-2.1, -2.6, -2.3]];

const AORTA_RADIUS: f32 = 1.22;
const TRUNK_RADIUS: f32 = 1.16;
const CAVA_RADIUS: f32 = 0.92;
/// Thickness of a vessel's wall where it is cut.
const WALL: f32 = 0.42;
/// How deep one can look into a cut vessel.
const LUMEN_DEPTH: f32 = 0.65;

pub fn field(p: Vec3) -> f32 {
    let mut f = muscle(p);
    f = join(f, atria(p), 0.5);
    // What lies between the roots of the vessels leaves no gap to look through.
    let roots = join(
        ellipsoid(p, Vec3::new(-0.9, 1.9, 0.1), Vec3::new(1.5, 1.6, 1.5)),
        ellipsoid(p, Vec3::new(1.5, 1.8, 0.3), Vec3::new(1.4, 1.3, 1.5)),
        0.4,
    );
    f = join(f, roots, 0.5);
    f = join(f, vessel(p, CAVA, CAVA_RADIUS), 0.35);
    f = join(f, vessel(p, LOWER_CAVA, CAVA_RADIUS), 0.35);
    f = join(f, vessel(p, AORTA, AORTA_RADIUS), 0.3);
    f = join(f, vessel(p, TRUNK, TRUNK_RADIUS), 0.35);
    for (path, radius) in OPEN {
        f = carve(f, lumen(p, path, radius), 0.12);
    }
    f + 0.05 * gradient(p / 1.9, 21) + 0.02 * gradient(p / 0.9, 22)
}

/// Vessels that end in a cut.
const OPEN: [(&[[f32; 3]], f32); 4] = [
    (AORTA, AORTA_RADIUS),
    (TRUNK, TRUNK_RADIUS),
    (CAVA, CAVA_RADIUS),
    (LOWER_CAVA, CAVA_RADIUS),
];

/// Both ventricles, with the grooves between them.
fn muscle(p: Vec3) -> f32 {
    let axis = (APEX - BASE).normalize();
    let middle = BASE.lerp(APEX, 0.42);
    let left = join(
        ellipsoid_along(
            p,
            middle + Vec3::new(0.25, 0.25, -0.3),
            axis,
            Vec3::new(4.2, 2.75, 2.7),
        ),
        tube(p, BASE.lerp(APEX, 0.3), APEX - 0.95 * axis, 2.2, 0.95),
        0.8,
    );
    // The right ventricle is wrapped round the front and tapers up into the pulmonary trunk.
    let right = join(
        ellipsoid_along(
            p,
            Vec3::new(-0.35, -1.3, 1.15),
            Vec3::new(0.62, -0.72, 0.31).normalize(),
            Vec3::new(3.6, 2.35, 2.0),
        ),
        tube(
            p,
            Vec3::new(0.1, -0.8, 1.7),
            Vec3::new(0.8, 1.7, 2.0),
            1.7,
            1.15,
        ),
        0.9,
    );
    let f = join(left, right, 0.7);
    let front = polyline(p, FRONT_GROOVE);
    let back = polyline(p, BACK_GROOVE);
    f + 0.3 * hump(front / 0.45) + 0.26 * hump(back / 0.45)
}

/// Both atria with their auricles, and the groove between them and the ventricles.
fn atria(p: Vec3) -> f32 {
    let right = join(
        ellipsoid(p, Vec3::new(-2.55, 1.0, -0.4), Vec3::new(1.55, 2.0, 1.75)),
        // The right auricle reaches over the root of the aorta.
        ellipsoid_along(
            p,
            Vec3::new(-1.75, 2.05, 1.25),
            Vec3::new(0.75, 0.25, 0.6).normalize(),
            Vec3::new(1.35, 0.85, 0.75),
        ),
        0.5,
    );
    let left = join(
        ellipsoid(p, Vec3::new(0.6, 1.7, -2.3), Vec3::new(2.5, 1.75, 1.7)),
        // The left auricle looks out beside the pulmonary trunk.
        ellipsoid_along(
            p,
            Vec3::new(2.35, 2.1, 0.25),
            Vec3::new(0.1, -0.2, 0.97).normalize(),
            Vec3::new(1.35, 0.75, 0.7),
        ),
        0.6,
    );
    let veins = [
        ([2.0, 2.4, -2.6], [3.6, 3.0, -3.0]),
        ([2.0, 1.4, -2.8], [3.6, 1.3, -3.4]),
        ([-0.8, 2.4, -2.6], [-2.6, 2.9, -3.0]),
        ([-0.8, 1.4, -2.8], [-2.6, 1.4, -3.4]),
    ]
    .iter()
    .map(|&(a, b)| tube(p, Vec3::from(a), Vec3::from(b), 0.62, 0.55))
    .fold(f32::MAX, f32::min);
    let f = join(join(right, left, 0.5), veins, 0.4);
    // Auricles are lobed at their rim.
    f + 0.07 * gradient(p / 0.55, 23) * smoothstep(-0.6, 0.8, p.y)
        + 0.12 * hump(polyline(p, RIGHT_GROOVE) / 0.4)
        + 0.12 * hump(polyline(p, LEFT_GROOVE) / 0.4)
}

/// A vessel along `path`, cut off square at its end.
fn vessel(p: Vec3, path: &[[f32; 3]], radius: f32) -> f32 {
    let (end, way) = cut(path);
    meet(polyline(p, path) - radius, (p - end).dot(way), 0.14)
}

/// The hollow of a vessel, from a little below its cut to beyond it.
fn lumen(p: Vec3, path: &[[f32; 3]], radius: f32) -> f32 {
    let (end, way) = cut(path);
    let (distance, _) = along(p, end - LUMEN_DEPTH * way, end + way);
    distance - (radius - WALL)
}

pub fn features(p: Vec3) -> Features {
    let front = polyline(p, FRONT_GROOVE);
    let right = polyline(p, RIGHT_GROOVE);
    let left = polyline(p, LEFT_GROOVE);
    let back = polyline(p, BACK_GROOVE);
    let groove = (hump(front / 0.75) * 0.85)
        .max(hump(right / 0.95))
        .max(hump(left / 0.9))
        .max(hump(back / 0.7) * 0.85);
    let root = hump(p.distance(Vec3::new(0.4, 2.4, 1.6)) / 1.3);
    let other = muscle(p).min(atria(p));
    let wall = |path: &[[f32; 3]], radius: f32| {
        let own = vessel(p, path, radius);
        smoothstep(-0.12, 0.22, other - own) * inside(own - 0.25, 0.15)
    };
    let hollow = OPEN
        .iter()
        .map(|(path, radius)| inside(lumen(p, path, *radius) - 0.03, 0.07))
        .fold(0.0, f32::max);
    Features {
        fat: groove.max(0.8 * root),
        artery: wall(AORTA, AORTA_RADIUS),
        // The trunk grows out of the muscle without a border.
        vein: (wall(TRUNK, TRUNK_RADIUS) * smoothstep(1.3, 2.7, p.y + 0.5 * gradient(p / 0.6, 24)))
            .max(wall(CAVA, CAVA_RADIUS))
            .max(wall(LOWER_CAVA, CAVA_RADIUS)),
        lumen: hollow,
        atrium: smoothstep(-0.2, 0.3, muscle(p) - atria(p)),
        ..Features::default()
    }
}
