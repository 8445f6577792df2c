//! Rays against triangles: picking with the mouse, and where a scripted tool meets the surface.

use glam::Vec3;

/// Where a ray first meets a surface.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// Distance along the ray, in lengths of its direction.
    pub distance: f32,
    /// The triangle that was met.
    pub triangle: usize,
    /// Its outward normal, unit length.
    pub normal: Vec3,
}

/// First triangle that `origin + t · direction` meets with t ≥ 0, from either side.
///
/// Every triangle is tried: a pick a mouse event needs no tree. Triangles are corners in `points`.
/// Source: Möller and Trumbore, "Fast, Minimum Storage Ray/Triangle Intersection", 1997.
pub fn first_hit(
    origin: Vec3,
    direction: Vec3,
    points: &[Vec3],
    triangles: &[[u32; 3]],
) -> Option<Hit> {
    let mut best: Option<Hit> = None;
    for (triangle, corners) in triangles.iter().enumerate() {
        let [a, b, c] = corners.map(|i| points[i as usize]);
        let (e1, e2) = (b - a, c - a);
        let p = direction.cross(e2);
        let determinant = e1.dot(p);
        if determinant == 0.0 {
            continue;
        }
        let s = (origin - a) / determinant;
        let u = s.dot(p);
        let q = s.cross(e1);
        let v = direction.dot(q);
        let distance = e2.dot(q);
        if u < 0.0 || v < 0.0 || u + v > 1.0 || distance < 0.0 {
            continue;
        }
        if best.is_none_or(|hit| distance < hit.distance) {
            best = Some(Hit {
                distance,
                triangle,
                normal: e1.cross(e2).normalize_or_zero(),
            });
        }
    }
    best
}

/// Index of the point nearest to `place`; `None` without points.
pub fn nearest_point(place: Vec3, points: &[Vec3]) -> Option<usize> {
    (0..points.len()).min_by(|&a, &b| {
        let distance = |i: usize| points[i].distance_squared(place);
        distance(a).total_cmp(&distance(b))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    const POINTS: [Vec3; 4] = [
        Vec3::new(0.0, 0.0, 0.0),
        Vec3::new(1.0, 0.0, 0.0),
        Vec3::new(0.0, 1.0, 0.0),
        Vec3::new(0.0, 0.0, -1.0),
    ];

    #[test]
    fn the_nearer_of_two_triangles_is_met_first() {
        let triangles = [[3, 1, 2], [0, 1, 2]];
        let hit = first_hit(Vec3::new(0.2, 0.2, 2.0), -Vec3::Z, &POINTS, &triangles).unwrap();
        assert_eq!(hit.triangle, 1);
        assert!((hit.distance - 2.0).abs() < 1e-6, "{hit:?}");
        assert_eq!(hit.normal, Vec3::Z);
    }

    #[test]
    fn a_ray_beside_or_behind_the_triangle_misses() {
        let triangles = [[0, 1, 2]];
        let beside = Vec3::new(0.9, 0.9, 1.0);
        assert_eq!(first_hit(beside, -Vec3::Z, &POINTS, &triangles), None);
        let behind = Vec3::new(0.2, 0.2, -1.0);
        assert_eq!(first_hit(behind, -Vec3::Z, &POINTS, &triangles), None);
    }

    #[test]
    fn the_nearest_point_is_found() {
        assert_eq!(nearest_point(Vec3::new(0.1, 0.8, 0.0), &POINTS), Some(2));
        assert_eq!(nearest_point(Vec3::ZERO, &[]), None);
    }
}
