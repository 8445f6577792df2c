//! The spleen: a wedge of the size of a fist, domed towards the ribs, notched along its upper edge,
//! hollow towards the stomach, the kidney and the colon.

use super::Features;
use super::field::{
    Shape, carve, cut, ellipsoid, ellipsoid_along, hump, inside, join, meet, polyline,
};
use crate::geom::noise::{gradient, smoothstep};
use glam::{Vec2, Vec3};

pub const SHAPE: Shape = Shape {
    field,
    low: Vec3::new(-4.6, -6.6, -4.8),
    high: Vec3::new(4.4, 6.6, 4.8),
    cell: 0.235,
};

/// Vessels of the capsule come from the hilum on the hollow side.
pub const VESSELS: &[&[[f32; 3]]] = &[
    &[[-1.2, 0.6, 0.4], [-0.8, 2.4, 0.8]],
    &[[-1.2, -0.4, 0.2], [-0.8, -2.4, -0.2]],
];

const ARTERY: &[[f32; 3]] = &[[-0.3, 1.1, 0.3], [-1.7, 1.5, 0.5], [-2.8, 2.0, 0.6]];
const VEIN: &[[f32; 3]] = &[[-0.3, -0.5, 0.3], [-1.7, -0.7, 0.4], [-2.8, -0.6, 0.5]];
const RADIUS: f32 = 0.48;

/// The wedge alone.
fn wedge(p: Vec3) -> f32 {
    let axis = Vec3::new(0.1, 0.93, -0.35).normalize();
    let dome = ellipsoid_along(p, Vec3::new(0.2, 0.0, 0.0), axis, Vec3::new(5.9, 3.7, 2.9));
    // Towards the stomach in front and the kidney behind, with a ridge between.
    let hollow =
        |y: f32, z: f32, wide: f32| hump(Vec2::new((p.y - y) / 3.2, (p.z - z) / wide).length());
    let level = -0.85
        + 1.0 * hollow(0.6, 2.0, 1.9)
        + 0.8 * hollow(-0.6, -2.0, 1.7)
        + 0.7 * hollow(-4.0, 0.6, 2.0);
    let mut f = meet(dome, level - p.x, 0.7);
    // Notches of the upper, front edge.
    for (y, z) in [(2.9, 2.0), (0.9, 3.2), (-1.4, 3.7)] {
        let notch = ellipsoid(p, Vec3::new(-0.8, y, z), Vec3::new(0.9, 0.2, 0.8));
        f = carve(f, notch, 0.5);
    }
    f + 0.08 * gradient(p / 1.8, 41) + 0.03 * gradient(p / 0.8, 42)
}

fn branch(p: Vec3, path: &[[f32; 3]]) -> f32 {
    let (end, way) = cut(path);
    meet(polyline(p, path) - RADIUS, (p - end).dot(way), 0.15)
}

fn field(p: Vec3) -> f32 {
    let f = join(wedge(p), branch(p, ARTERY), 0.35);
    join(f, branch(p, VEIN), 0.35)
}

pub fn features(p: Vec3) -> Features {
    let wall = |own: f32| smoothstep(-0.1, 0.15, wedge(p) - own) * inside(own - 0.2, 0.15);
    let open = |path: &[[f32; 3]]| {
        let (end, way) = cut(path);
        inside(p.distance(end) - 0.3, 0.06) * smoothstep(-0.1, 0.0, (p - end).dot(way))
    };
    Features {
        fat: 1.1 * hump(p.distance(Vec3::new(-1.3, 0.3, 0.4)) / 1.5),
        artery: wall(branch(p, ARTERY)),
        vein: wall(branch(p, VEIN)),
        lumen: open(ARTERY).max(open(VEIN)),
        ..Features::default()
    }
}
