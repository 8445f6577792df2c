//! The heart.
use super::Features;
use super::field::{Shape, ellipsoid};
use glam::Vec3;
pub const SHAPE: Shape = Shape {
    field,
    low: Vec3::new(-6.0, -7.0, -5.0),
    high: Vec3::new(6.0, 7.0, 5.0),
    cell: 0.25,
};
pub const VESSELS: &[&[[f32; 3]]] = &[];
pub fn field(p: Vec3) -> f32 {
    ellipsoid(p, Vec3::ZERO, Vec3::new(4.0, 5.5, 3.8))
}
pub fn features(_p: Vec3) -> Features {
    Features::default()
}
