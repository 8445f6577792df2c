//! Solids as fields: negative inside, about the distance to the surface outside. Lengths are in
//! centimetres, in which organs have handy numbers.
//!
//! Source: Quilez, "Distance Functions" (ellipsoid bound, round cone, polynomial smooth minimum).

use glam::Vec3;

/// Metres in a unit of the fields.
pub const METRES_PER_UNIT: f32 = 0.01;

/// An organ as a field in a box.
#[derive(Clone, Copy)]
pub struct Shape {
    /// The field [cm], negative inside.
    pub field: fn(Vec3) -> f32,
    /// A box that holds the organ [cm].
    pub low: Vec3,
    pub high: Vec3,
    /// Side of the cells in which the surface is sought [cm]; also about the length of the edges.
    pub cell: f32,
}

/// Ellipsoid with its centre at `centre` and half axes `radii`.
pub fn ellipsoid(p: Vec3, centre: Vec3, radii: Vec3) -> f32 {
    let q = p - centre;
    let k0 = (q / radii).length();
    let k1 = (q / (radii * radii)).length();
    if k1 < 1e-6 {
        return -radii.min_element();
    }
    k0 * (k0 - 1.0) / k1
}

/// Ellipsoid whose first axis points along the unit vector `axis`; the second is as near to y as
/// can be.
pub fn ellipsoid_along(p: Vec3, centre: Vec3, axis: Vec3, radii: Vec3) -> f32 {
    let second = (Vec3::Y - axis * axis.y).normalize();
    let third = axis.cross(second);
    let q = p - centre;
    ellipsoid(
        Vec3::new(q.dot(axis), q.dot(second), q.dot(third)),
        Vec3::ZERO,
        radii,
    )
}

/// A tube with round ends from `a` to `b`, whose radius runs from `radius_a` to `radius_b`.
pub fn tube(p: Vec3, a: Vec3, b: Vec3, radius_a: f32, radius_b: f32) -> f32 {
    let (distance, t) = along(p, a, b);
    distance - (radius_a + (radius_b - radius_a) * t)
}

/// Distance to the segment from `a` to `b`, and where on it (0 to 1) the nearest place lies.
pub fn along(p: Vec3, a: Vec3, b: Vec3) -> (f32, f32) {
    let axis = b - a;
    let t = ((p - a).dot(axis) / axis.length_squared()).clamp(0.0, 1.0);
    (p.distance(a + axis * t), t)
}

/// Distance to a line of straight pieces.
pub fn polyline(p: Vec3, path: &[[f32; 3]]) -> f32 {
    path.windows(2)
        .map(|piece| along(p, Vec3::from(piece[0]), Vec3::from(piece[1])).0)
        .fold(f32::MAX, f32::min)
}

/// End of a path and the direction in which it ends.
pub fn cut(path: &[[f32; 3]]) -> (Vec3, Vec3) {
    let end = Vec3::from(path[path.len() - 1]);
    (end, (end - Vec3::from(path[path.len() - 2])).normalize())
}

/// Union of two solids, blended over `width`.
pub fn join(a: f32, b: f32, width: f32) -> f32 {
    let h = (width - (a - b).abs()).max(0.0) / width;
    a.min(b) - 0.25 * h * h * width
}

/// What two solids share, with the edge rounded over `width`.
pub fn meet(a: f32, b: f32, width: f32) -> f32 {
    -join(-a, -b, width)
}

/// The first solid without the second, with the edge rounded over `width`.
pub fn carve(a: f32, b: f32, width: f32) -> f32 {
    meet(a, -b, width)
}

/// A smooth hump: 1 at 0, 1/4 at 1, fading like x⁻⁴.
pub fn hump(x: f32) -> f32 {
    let d = 1.0 + x * x;
    1.0 / (d * d)
}

/// 1 deep inside a solid, 0 outside it, fading over `width` round its surface.
pub fn inside(field: f32, width: f32) -> f32 {
    crate::geom::noise::smoothstep(width, -width, field)
}
