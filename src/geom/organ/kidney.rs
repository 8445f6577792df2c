//! The left kidney: a bean whose hollow side, towards the middle of the body, lets the vessels and
//! the ureter in.

use super::Features;
use super::field::{Shape, carve, cut, ellipsoid, hump, inside, join, meet, polyline};
use crate::geom::noise::{gradient, smoothstep};
use glam::Vec3;

pub const SHAPE: Shape = Shape {
    field,
    low: Vec3::new(-5.2, -6.8, -3.6),
    high: Vec3::new(4.4, 6.8, 3.6),
    cell: 0.245,
};

/// The capsule's vessels come over the lips of the hollow.
pub const VESSELS: &[&[[f32; 3]]] = &[
    &[[-1.2, 0.8, 1.2], [0.2, 1.6, 2.0]],
    &[[-1.2, -0.6, -1.2], [0.2, -1.5, -2.0]],
];

const ARTERY: &[[f32; 3]] = &[[-0.4, 0.9, -0.1], [-2.2, 1.2, 0.0], [-4.0, 1.6, 0.2]];
const VEIN: &[[f32; 3]] = &[[-0.4, 0.1, 0.5], [-2.2, 0.2, 0.9], [-4.0, 0.5, 1.0]];
const URETER: &[[f32; 3]] = &[
    [-0.3, -0.8, -0.3],
    [-2.0, -1.6, -0.5],
    [-2.8, -3.4, -0.4],
    [-3.0, -5.4, -0.3],
];
const ARTERY_RADIUS: f32 = 0.46;
const VEIN_RADIUS: f32 = 0.62;
const URETER_RADIUS: f32 = 0.4;

/// The bean alone.
fn bean(p: Vec3) -> f32 {
    // Bent round the hollow: the poles lean inwards.
    let bent = Vec3::new(p.x + 0.040 * p.y * p.y, p.y, p.z);
    let body = ellipsoid(bent, Vec3::new(0.4, 0.15, 0.0), Vec3::new(2.75, 5.6, 2.25));
    let hollow = ellipsoid(p, Vec3::new(-2.6, 0.0, 0.0), Vec3::new(2.1, 2.0, 1.2));
    // The lobes of the child's kidney still show as shallow waves.
    carve(body, hollow, 1.0) + 0.09 * gradient(p / 1.7, 31) + 0.03 * gradient(p / 0.8, 32)
}

/// A tube along `path`, cut off square.
fn branch(p: Vec3, path: &[[f32; 3]], radius: f32) -> f32 {
    let (end, way) = cut(path);
    meet(polyline(p, path) - radius, (p - end).dot(way), 0.12)
}

/// The renal pelvis: the funnel from which the ureter comes.
fn pelvis(p: Vec3) -> f32 {
    ellipsoid(p, Vec3::new(-1.2, -0.5, -0.1), Vec3::new(1.1, 1.3, 0.75))
}

fn field(p: Vec3) -> f32 {
    let mut f = join(bean(p), pelvis(p), 0.5);
    f = join(f, branch(p, ARTERY, ARTERY_RADIUS), 0.3);
    f = join(f, branch(p, VEIN, VEIN_RADIUS), 0.3);
    join(f, branch(p, URETER, URETER_RADIUS), 0.3)
}

/// The dark middle of a vessel's cut end.
fn lumen(p: Vec3, path: &[[f32; 3]]) -> f32 {
    p.distance(cut(path).0) - 0.26
}

pub fn features(p: Vec3) -> Features {
    let wall = |own: f32| smoothstep(-0.1, 0.15, bean(p) - own) * inside(own - 0.2, 0.15);
    let ureter = branch(p, URETER, URETER_RADIUS).min(pelvis(p));
    let hollow = hump(p.distance(Vec3::new(-1.3, 0.0, 0.0)) / 1.9);
    let lumen = lumen(p, ARTERY).min(lumen(p, VEIN));
    Features {
        fat: 1.3 * hollow,
        artery: wall(branch(p, ARTERY, ARTERY_RADIUS)),
        vein: wall(branch(p, VEIN, VEIN_RADIUS)),
        ligament: wall(ureter),
        lumen: inside(lumen, 0.06),
        ..Features::default()
    }
}
