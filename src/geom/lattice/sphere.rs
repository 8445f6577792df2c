//! A sphere by formula.

use glam::Vec3;
use std::collections::HashMap;

/// Times every triangle of the octahedron is cut in four: 4,098 points, 8,192 triangles.
const CUTS: usize = 5;

/// Points [m] and triangles of a sphere about the origin, an octahedron cut finer and finer.
/// Triangles face outwards; the points lie on the sphere, so the volume is a little below its.
pub fn sphere(radius_m: f32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let mut points = vec![
        Vec3::X,
        Vec3::NEG_X,
        Vec3::Y,
        Vec3::NEG_Y,
        Vec3::Z,
        Vec3::NEG_Z,
    ];
    let mut triangles: Vec<[u32; 3]> = vec![
        [0, 2, 4],
        [2, 1, 4],
        [1, 3, 4],
        [3, 0, 4],
        [2, 0, 5],
        [1, 2, 5],
        [3, 1, 5],
        [0, 3, 5],
    ];
    for _ in 0..CUTS {
        let mut middles = HashMap::new();
        let mut middle = |a: u32, b: u32| {
            *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
                points.push((points[a as usize] + points[b as usize]).normalize());
                points.len() as u32 - 1
            })
        };
        triangles = triangles
            .into_iter()
            .flat_map(|[a, b, c]| {
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
            })
            .collect();
    }
    for point in &mut points {
        *point *= radius_m;
    }
    (points, triangles)
}
