//! The normal map of a relief.
//!
//! Heights are known at texels; their slope over the surface follows from the map between texels
//! and the surface, so that stretched charts get the right normals too.

use super::Dab;
use super::canvas::Canvas;
use crate::geom::SurfaceMesh;
use glam::Vec3;
use rayon::prelude::*;

/// Slopes above this are cut: 0.6 is 31 degrees, beyond which tissue would look like bark.
const SLOPE_MAX: f32 = 0.6;

/// Tangent-space normal of every texel: x towards growing u, y towards smaller v, z out.
pub fn normals(canvas: &Canvas, mesh: &SurfaceMesh, dabs: &[Option<Dab>]) -> Vec<Vec3> {
    let size = canvas.size_px;
    let relief = |x: u32, y: u32| dabs[(y * size + x) as usize].as_ref().map(|dab| dab.relief);
    (0..size * size)
        .into_par_iter()
        .map(|texel| {
            let (x, y) = (texel % size, texel / size);
            let (Some(triangle), Some(here)) = (canvas.triangle(texel), relief(x, y)) else {
                return Vec3::Z;
            };
            let slope = |before: Option<f32>, after: Option<f32>| match (before, after) {
                (Some(before), Some(after)) => 0.5 * (after - before),
                (Some(before), None) => here - before,
                (None, Some(after)) => after - here,
                (None, None) => 0.0,
            };
            let left = x.checked_sub(1).and_then(|x| relief(x, y));
            let right = Some(x + 1).filter(|&x| x < size).and_then(|x| relief(x, y));
            let above = y.checked_sub(1).and_then(|y| relief(x, y));
            let below = Some(y + 1).filter(|&y| y < size).and_then(|y| relief(x, y));
            tilt(
                canvas,
                mesh,
                triangle,
                slope(left, right),
                slope(above, below),
            )
        })
        .collect()
}

/// Normal from the change of height per texel along u and v.
fn tilt(canvas: &Canvas, mesh: &SurfaceMesh, triangle: u32, along_u: f32, along_v: f32) -> Vec3 {
    let [a, b, c] = mesh
        .point_triangle(triangle as usize)
        .map(|p| canvas.places[p as usize]);
    let [p, q, r] = canvas.corners_px(mesh, triangle);
    let (d1, d2) = (q - p, r - p);
    let det = d1.perp_dot(d2);
    let normal = (b - a).cross(c - a).normalize_or_zero();
    if det.abs() < 1e-9 || normal == Vec3::ZERO {
        return Vec3::Z;
    }
    // The surface's steps for one texel in u and in v, and their dual basis.
    let step_u = ((b - a) * d2.y - (c - a) * d1.y) / det;
    let step_v = ((c - a) * d1.x - (b - a) * d2.x) / det;
    let area = step_u.cross(step_v).dot(normal);
    if area.abs() < 1e-12 {
        return Vec3::Z;
    }
    let gradient = (along_u * step_v.cross(normal) + along_v * normal.cross(step_u)) / area;
    let tangent = step_u.normalize();
    let mut bitangent = normal.cross(tangent);
    if bitangent.dot(step_v) > 0.0 {
        // The image has v downwards, the normal map has green upwards.
        bitangent = -bitangent;
    }
    let mut slope = Vec3::new(gradient.dot(tangent), gradient.dot(bitangent), 0.0);
    let steep = slope.length();
    if steep > SLOPE_MAX {
        slope *= SLOPE_MAX / steep;
    }
    (Vec3::Z - slope).normalize()
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec2;

    /// A square of 1 cm seen from +z, u to the right, v downwards, drawn out along u by `stretch`.
    fn square(stretch: f32) -> SurfaceMesh {
        let corner = |x: f32, y: f32| Vec3::new(0.01 * x * stretch, 0.01 * y, 0.0);
        SurfaceMesh {
            points: vec![
                corner(0.0, 0.0),
                corner(1.0, 0.0),
                corner(1.0, 1.0),
                corner(0.0, 1.0),
            ],
            point_of: vec![0, 1, 2, 3],
            uvs: vec![
                Vec2::new(0.0, 1.0),
                Vec2::new(1.0, 1.0),
                Vec2::new(1.0, 0.0),
                Vec2::new(0.0, 0.0),
            ],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        }
    }

    /// Normal in the middle of a ramp that rises by `rise` [cm] from one side to the other.
    fn on_ramp(stretch: f32, rise: Vec2) -> Vec3 {
        const SIZE: u32 = 16;
        let mesh = square(stretch);
        let canvas = Canvas::new(&mesh, SIZE, stretch.max(1.0));
        let dabs: Vec<Option<Dab>> = (0..SIZE * SIZE)
            .map(|texel| {
                let uv = Vec2::new((texel % SIZE) as f32, (texel / SIZE) as f32) / SIZE as f32;
                Some(Dab {
                    relief: uv.dot(rise),
                    ..Dab::default()
                })
            })
            .collect();
        normals(&canvas, &mesh, &dabs)[(SIZE * SIZE / 2 + SIZE / 2) as usize]
    }

    #[test]
    fn ramp_that_rises_with_u_tilts_the_normal_back_by_its_slope() {
        let expected = Vec3::new(-0.1, 0.0, 1.0).normalize();
        assert!(on_ramp(1.0, Vec2::X * 0.1).distance(expected) < 1e-5);
        // Drawn out to twice the length, the same rise is half as steep.
        let expected = Vec3::new(-0.05, 0.0, 1.0).normalize();
        assert!(on_ramp(2.0, Vec2::X * 0.1).distance(expected) < 1e-5);
    }

    #[test]
    fn ramp_that_rises_with_v_tilts_the_normal_towards_smaller_v() {
        let expected = Vec3::new(0.0, 0.1, 1.0).normalize();
        assert!(on_ramp(1.0, Vec2::Y * 0.1).distance(expected) < 1e-5);
    }

    #[test]
    fn flat_relief_has_the_normal_of_the_surface() {
        assert_eq!(on_ramp(1.0, Vec2::ZERO), Vec3::Z);
    }
}
