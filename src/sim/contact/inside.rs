//! Whether a place is inside a closed surface, and the way out.

use super::{near::Surface, nearest::nearest};
use glam::{DVec3, Vec3, Vec4};

/// Three directions that no made surface has an edge along.
const DIRECTIONS: [DVec3; 3] = [
    DVec3::new(0.573_1, 0.211_7, 0.791_7),
    DVec3::new(-0.337_9, 0.871_3, 0.355_9),
    DVec3::new(0.291_1, -0.617_3, -0.731_1),
];

/// Whether `x` is inside the surface of `triangles`, by the vote of three rays: one leaves the body
/// once more than it enters it. Works where the surface has small holes or folds.
pub fn is_inside(x: Vec3, points: &[Vec3], triangles: &[[u32; 3]]) -> bool {
    let votes = DIRECTIONS
        .iter()
        .filter(|&&direction| leaves_minus_enters(x.as_dvec3(), direction, points, triangles) > 0)
        .count();
    votes >= 2
}

/// How often the ray from `x` leaves the surface, less how often it enters it.
fn leaves_minus_enters(x: DVec3, direction: DVec3, points: &[Vec3], triangles: &[[u32; 3]]) -> i32 {
    let (across, up) = direction.normalize().any_orthonormal_pair();
    let mut count = 0;
    for triangle in triangles {
        let corners = triangle.map(|point| points[point as usize].as_dvec3() - x);
        let flat = corners.map(|corner| (corner.dot(across), corner.dot(up)));
        let turn = |k: usize| {
            let ((px, py), (qx, qy)) = (flat[k], flat[(k + 1) % 3]);
            px * qy - py * qx
        };
        let turns = [turn(0), turn(1), turn(2)];
        if turns.iter().all(|&t| t > 0.0) || turns.iter().all(|&t| t < 0.0) {
            let [a, b, c] = corners;
            let normal = (b - a).cross(c - a);
            let (ahead, leaving) = (normal.dot(a), normal.dot(direction));
            if ahead * leaving > 0.0 {
                count += if leaving > 0.0 { 1 } else { -1 };
            }
        }
    }
    count
}

/// The way from a place inside to the nearest place of the surface that can move [m]; `None` if
/// none can.
pub fn way_out(x: Vec3, surface: Surface, places: &[Vec4]) -> Option<Vec3> {
    let moves = |corners: &&[u32; 3]| {
        (corners.iter())
            .flat_map(|&point| surface.embedding.particles[point as usize])
            .any(|particle| places[particle as usize].w > 0.0)
    };
    (surface.triangles.iter().filter(moves))
        .map(|corners| nearest([x; 2], corners.map(|k| surface.points[k as usize])).offset)
        .min_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::lattice::sphere;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn place_in_a_ball_is_inside_as_its_distance_from_the_centre_says(
            x in prop::array::uniform3(-1.5_f32..1.5),
        ) {
            let (points, triangles) = sphere(1.0);
            let x = Vec3::from(x);
            // The facets lie within 5 % of the ball.
            prop_assume!((x.length() - 0.97).abs() > 0.04);
            prop_assert_eq!(is_inside(x, &points, &triangles), x.length() < 1.0);
        }
    }

    #[test]
    fn nothing_is_inside_a_surface_that_faces_inwards_or_has_no_triangles() {
        let (points, mut triangles) = sphere(1.0);
        assert!(is_inside(Vec3::ZERO, &points, &triangles));
        triangles.iter_mut().for_each(|triangle| triangle.reverse());
        assert!(!is_inside(Vec3::ZERO, &points, &triangles));
        assert!(!is_inside(Vec3::ZERO, &points, &[]));
    }
}
