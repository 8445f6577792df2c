//! Whether a place or a tool's axis is inside a closed surface, and the way out.

use super::{
    near::Surface,
    nearest::{Axis, nearest},
};
use glam::{DVec3, Vec3, Vec4};

/// Three directions that no made surface has an edge along.
const DIRECTIONS: [DVec3; 3] = [
    DVec3::new(0.573_1, 0.211_7, 0.791_7),
    DVec3::new(-0.337_9, 0.871_3, 0.355_9),
    DVec3::new(0.291_1, -0.617_3, -0.731_1),
];
/// Directions square to an axis in which a way out is looked for.
const WAYS_ASIDE: u16 = 16;

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

/// Whether any part of `axis` is inside the surface: an end of it, or what is between two ends outside.
pub fn reaches_inside(axis: Axis, points: &[Vec3], triangles: &[[u32; 3]]) -> bool {
    let crosses = || {
        axis[0] != axis[1]
            && (triangles.iter()).any(|corners| {
                nearest(axis, corners.map(|k| points[k as usize])).offset == Vec3::ZERO
            })
    };
    is_inside(axis[0], points, triangles) || crosses()
}

/// The shortest way on which `axis`, of which a part is inside, leaves the surface without being
/// turned [m], past parts of the surface that can move; `None` if nothing can.
///
/// A place leaves by the nearest part of the surface. An axis with two ends is tried along itself,
/// aside in a fan of directions, and as its ends and middle would leave, which is at most 2 % longer
/// than the best way aside.
pub fn way_out(axis: Axis, surface: Surface, places: &[Vec4]) -> Option<Vec3> {
    let moves = |corners: &&[u32; 3]| {
        (corners.iter())
            .flat_map(|&point| surface.embedding.particles[point as usize])
            .any(|particle| places[particle as usize].w > 0.0)
    };
    let corners_of = |triangle: &[u32; 3]| triangle.map(|k| surface.points[k as usize]);
    let from_place = |x: Vec3| {
        (surface.triangles.iter().filter(moves))
            .map(|triangle| nearest([x; 2], corners_of(triangle)).offset)
            .min_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))
    };
    let Some(along) = (axis[1] - axis[0]).try_normalize() else {
        return from_place(axis[0]);
    };
    let (right, up) = along.any_orthonormal_pair();
    let aside = (0..WAYS_ASIDE).map(|k| {
        let (sine, cosine) =
            (std::f32::consts::TAU * f32::from(k) / f32::from(WAYS_ASIDE)).sin_cos();
        cosine * right + sine * up
    });
    let middle = axis[0].midpoint(axis[1]);
    let as_places = [axis[0], middle, axis[1]]
        .into_iter()
        .filter_map(|x| from_place(x)?.try_normalize());
    ([along, -along].into_iter().chain(aside).chain(as_places))
        .filter_map(|direction| {
            let last = (surface.triangles.iter())
                .map(|triangle| (clearance_m(axis, direction, corners_of(triangle)), triangle))
                .max_by(|a, b| a.0.total_cmp(&b.0))
                .filter(|(clear_m, triangle)| *clear_m > 0.0 && moves(triangle))?;
            Some(last.0 * direction)
        })
        .min_by(|a, b| a.length_squared().total_cmp(&b.length_squared()))
}

/// How far `axis` must go in a unit `direction` until it has left the triangle behind for good [m];
/// −∞ if it never meets it.
fn clearance_m(axis: Axis, direction: Vec3, corners: [Vec3; 3]) -> f32 {
    let along = axis[1] - axis[0];
    let aside = along.reject_from_normalized(direction);
    let (length_m, sheer) = (aside.length(), along.dot(direction));
    if length_m <= 1e-4 * along.length() {
        // It goes along itself: its last end leaves last.
        let first = if sheer < 0.0 { axis[1] } else { axis[0] };
        let far = first + (reach_m(first, corners) + along.length()) * direction;
        let hit = nearest([first, far], corners);
        return if hit.offset == Vec3::ZERO {
            (hit.foot - first).dot(direction)
        } else {
            f32::NEG_INFINITY
        };
    }
    // In the strip that the axis sweeps: how far off its plane, how far along the axis (0 to 1), and
    // how far ahead of it.
    let across = aside / length_m;
    let off = direction.cross(across);
    let flat = corners.map(|corner| {
        let x = corner - axis[0];
        let share = x.dot(across) / length_m;
        (x.dot(off), share, x.dot(direction) - share * sheer)
    });
    let mut ends = [(0.0, 0.0); 3];
    let mut count = 0;
    for k in 0..3 {
        let (p, q) = (flat[k], flat[(k + 1) % 3]);
        if (p.0 > 0.0) != (q.0 > 0.0) {
            let t = p.0 / (p.0 - q.0);
            ends[count] = (p.1 + t * (q.1 - p.1), p.2 + t * (q.2 - p.2));
            count += 1;
        }
    }
    let [p, q, _] = ends;
    if count < 2 || p.0.max(q.0) < 0.0 || p.0.min(q.0) > 1.0 {
        return f32::NEG_INFINITY;
    }
    // The cut is straight: it is farthest ahead at an end of what the axis spans of it.
    let ahead_at = |share: f32| {
        if p.0 == q.0 {
            p.1.max(q.1)
        } else {
            p.1 + (share.clamp(p.0.min(q.0), p.0.max(q.0)) - p.0) / (q.0 - p.0) * (q.1 - p.1)
        }
    };
    ahead_at(0.0).max(ahead_at(1.0))
}

/// Farthest that a corner is from `x` [m].
fn reach_m(x: Vec3, corners: [Vec3; 3]) -> f32 {
    (corners.iter())
        .map(|corner| corner.distance(x))
        .fold(0.0, f32::max)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::{Embedding, bounds, lattice::sphere};
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

    proptest! {
        #[test]
        fn axis_reaches_into_a_ball_as_its_distance_from_the_centre_says(
            ends in prop::array::uniform6(-2.0_f32..2.0),
        ) {
            let (points, triangles) = sphere(1.0);
            let axis = [Vec3::from_slice(&ends[..3]), Vec3::from_slice(&ends[3..])];
            let distance = from_centre(axis);
            prop_assume!((distance - 0.97).abs() > 0.04);
            prop_assert_eq!(reaches_inside(axis, &points, &triangles), distance < 1.0);
        }

        #[test]
        fn way_out_of_a_ball_ends_outside_and_is_hardly_longer_than_the_shortest(
            ends in prop::array::uniform6(-2.0_f32..2.0),
        ) {
            let (points, triangles) = sphere(1.0);
            let axis = [Vec3::from_slice(&ends[..3]), Vec3::from_slice(&ends[3..])];
            prop_assume!(from_centre(axis) < 0.93);
            let embedding = Embedding {
                particles: (0..points.len() as u32).map(|k| [k; 4]).collect(),
                weights: vec![[1.0, 0.0, 0.0, 0.0]; points.len()],
            };
            let surface = Surface {
                triangles: &triangles,
                points: &points,
                bounds: bounds(&points),
                embedding: &embedding,
            };
            let free: Vec<Vec4> = points.iter().map(|x| x.extend(1.0)).collect();
            let way = way_out(axis, surface, &free).expect("all of it can move");
            let over = way + 1e-3 * way.normalize();
            prop_assert!(!reaches_inside(axis.map(|x| x + over), &points, &triangles));
            // Shortest of a thousand directions, by where the axis is 0.95 from the centre.
            let shortest = shortest_way(axis, 0.95);
            prop_assert!(way.length() < 1.03 * shortest + 0.06, "{} for {shortest}", way.length());
            let held: Vec<Vec4> = points.iter().map(|x| x.extend(0.0)).collect();
            prop_assert_eq!(way_out(axis, surface, &held), None);
        }
    }

    fn from_centre(axis: Axis) -> f32 {
        let along = axis[1] - axis[0];
        let share = -axis[0].dot(along) / along.length_squared().max(f32::MIN_POSITIVE);
        (axis[0] + share.clamp(0.0, 1.0) * along).length()
    }

    /// Length of the shortest way of a thousand on which `axis` leaves a ball round the origin.
    fn shortest_way(axis: Axis, radius: f32) -> f32 {
        let ways = (0..1000_u16).map(|k| {
            // Fibonacci's directions.
            let z = 1.0 - (2.0 * f32::from(k) + 1.0) / 1000.0;
            let (sine, cosine) = (2.399_963_2 * f32::from(k)).sin_cos();
            let r = (1.0 - z * z).sqrt();
            let direction = Vec3::new(r * cosine, r * sine, z);
            let is_out = |way: f32| from_centre(axis.map(|x| x + way * direction)) >= radius;
            let mut bounds = (0.0, 8.0);
            for _ in 0..30 {
                let middle = f32::midpoint(bounds.0, bounds.1);
                if is_out(middle) {
                    bounds.1 = middle
                } else {
                    bounds.0 = middle
                }
            }
            bounds.1
        });
        ways.fold(f32::INFINITY, f32::min)
    }
}
