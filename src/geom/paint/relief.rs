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
