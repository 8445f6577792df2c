//! How deep a tool is in a closed surface: the judge of the study, in f64 and without a line in common
//! with what is judged.

use glam::{DVec3, Vec3};
use std::f64::consts::PI;

/// Places on an axis that is inside at which its depth is looked at.
const LOOKS: u32 = 9;

/// How deep the tool of `radius_m` round `axis` reaches into the surface [m], negative where it does
/// not: by every triangle, not only by their corners, and by every place of the axis. A tool with a
/// part of its axis inside is at least as deep as its radius, and as the deepest of nine places says.
pub fn depth_m(axis: [Vec3; 2], radius_m: f32, points: &[Vec3], triangles: &[[u32; 3]]) -> f64 {
    let radius_m = f64::from(radius_m);
    let axis = axis.map(|x| x.as_dvec3());
    let corners_of = |triangle: &[u32; 3]| triangle.map(|point| points[point as usize].as_dvec3());
    let apart_m = (triangles.iter())
        .map(|triangle| segment_to_triangle(axis, corners_of(triangle)))
        .fold(f64::INFINITY, f64::min);
    // How deep a place is, negative outside.
    let inside_m = |x: DVec3| {
        let (mut nearest_m2, mut solid_angle) = (f64::INFINITY, 0.0);
        for triangle in triangles {
            let corners = corners_of(triangle).map(|corner| corner - x);
            nearest_m2 = nearest_m2.min(nearest_squared(corners));
            solid_angle += solid_angle_of(corners);
        }
        // Once round for a place inside, also where the surface is folded.
        let side = if solid_angle > 2.0 * PI { 1.0 } else { -1.0 };
        side * nearest_m2.sqrt()
    };
    let tip_m = inside_m(axis[0]);
    if axis[0] == axis[1] {
        return radius_m + tip_m;
    }
    if tip_m <= 0.0 && apart_m > 0.0 {
        return radius_m - apart_m;
    }
    let deepest_m = (1..LOOKS)
        .map(|look| inside_m(axis[0].lerp(axis[1], f64::from(look) / f64::from(LOOKS - 1))))
        .fold(tip_m, f64::max);
    radius_m + deepest_m.max(0.0)
}

/// Distance between a segment and a triangle; zero if one goes through the other.
fn segment_to_triangle(axis: [DVec3; 2], corners: [DVec3; 3]) -> f64 {
    // A plane between the two would show that they do not meet: six volumes say on which side of
    // triangle and sides the ends lie.
    let [a, b, c] = corners.map(|corner| corner - axis[0]);
    let way = axis[1] - axis[0];
    let normal = (b - a).cross(c - a);
    let ends_apart = normal.dot(a) * normal.dot(a - way) <= 0.0;
    let turns = [b.cross(a), c.cross(b), a.cross(c)].map(|side| side.dot(way));
    let within = turns.iter().all(|&t| t >= 0.0) || turns.iter().all(|&t| t <= 0.0);
    if ends_apart && within && normal.dot(way) != 0.0 {
        return 0.0;
    }
    let from_end = axis.map(|end| nearest_squared(corners.map(|corner| corner - end)).sqrt());
    let from_side = |k: usize| segments_apart(axis, [corners[k], corners[(k + 1) % 3]]);
    (from_end.into_iter())
        .chain((0..3).map(from_side))
        .fold(f64::INFINITY, f64::min)
}

/// Distance between two segments: where their lines are nearest if that is on both, else at an end.
fn segments_apart([p, q]: [DVec3; 2], [r, s]: [DVec3; 2]) -> f64 {
    let (u, v, w) = (q - p, s - r, p - r);
    let across = u.cross(v);
    let size = across.length_squared();
    if size > 0.0 {
        let (at_first, at_second) = (v.cross(w).dot(across) / size, u.cross(w).dot(across) / size);
        if (0.0..=1.0).contains(&at_first) && (0.0..=1.0).contains(&at_second) {
            return w.dot(across).abs() / size.sqrt();
        }
    }
    let to_second = [p, q].map(|end| to_segment([r - end, s - end]));
    let to_first = [r, s].map(|end| to_segment([p - end, q - end]));
    (to_second.into_iter().chain(to_first)).fold(f64::INFINITY, f64::min)
}

/// Distance of a segment from the origin.
fn to_segment([p, q]: [DVec3; 2]) -> f64 {
    let edge = q - p;
    let share = -edge.dot(p) / edge.length_squared().max(f64::MIN_POSITIVE);
    (p + share.clamp(0.0, 1.0) * edge).length()
}

/// Squared distance of a triangle from the origin.
fn nearest_squared([a, b, c]: [DVec3; 3]) -> f64 {
    let normal = (b - a).cross(c - a);
    let is_over = |p: DVec3, q: DVec3| normal.dot((q - p).cross(-p)) >= 0.0;
    if normal != DVec3::ZERO && is_over(a, b) && is_over(b, c) && is_over(c, a) {
        return normal.dot(a).powi(2) / normal.length_squared();
    }
    let sides = [[a, b], [b, c], [c, a]].map(|side| to_segment(side).powi(2));
    sides[0].min(sides[1]).min(sides[2])
}

/// Solid angle under which a triangle is seen from the origin, positive from its inner side.
///
/// Source: Van Oosterom and Strackee, "The solid angle of a plane triangle", 1983, eq. 8.
fn solid_angle_of([a, b, c]: [DVec3; 3]) -> f64 {
    let (la, lb, lc) = (a.length(), b.length(), c.length());
    let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
    2.0 * a.dot(b.cross(c)).atan2(below)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::lattice::sphere;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn ball_in_a_ball_is_as_deep_as_their_middles_say(
            x in prop::array::uniform3(-2.0_f32..2.0), radius in 0.01_f32..1.0,
        ) {
            let (points, triangles) = sphere(1.0);
            let x = Vec3::from(x);
            let expected = f64::from(radius + 1.0 - x.length());
            // The facets lie within 5 % of the ball.
            let found = depth_m([x; 2], radius, &points, &triangles);
            prop_assert!((found - expected).abs() < 0.06, "{found}, not {expected}");
        }
    }

    #[test]
    fn ball_that_dips_into_the_middle_of_a_face_is_found_though_it_reaches_no_corner() {
        let low = Vec3::new(-1.0, 0.0, -1.0);
        let points = [
            low,
            Vec3::new(0.0, 0.0, 1.0),
            Vec3::new(1.0, 0.0, -1.0),
            Vec3::NEG_Y,
        ];
        let triangles = [[0, 1, 2], [1, 0, 3], [2, 1, 3], [0, 2, 3]];
        let over = |y: f32| depth_m([Vec3::new(0.0, y, -0.3); 2], 0.1, &points, &triangles);
        assert!((over(0.09) - 0.01).abs() < 1e-6);
        assert!((over(0.2) + 0.1).abs() < 1e-6);
        assert!((over(-0.05) - 0.15).abs() < 1e-6);
    }

    proptest! {
        #[test]
        fn rod_in_a_ball_is_as_deep_as_the_place_of_its_axis_nearest_to_the_centre(
            ends in prop::array::uniform6(-2.0_f32..2.0), radius in 0.01_f32..1.0,
        ) {
            let (points, triangles) = sphere(1.0);
            let axis = [Vec3::from_slice(&ends[..3]), Vec3::from_slice(&ends[3..])];
            let nearest = to_segment(axis.map(|x| x.as_dvec3()));
            let expected = f64::from(radius) + 1.0 - nearest;
            let found = depth_m(axis, radius, &points, &triangles);
            // As above; and what is inside lies up to 1/16 of 7 off a place that is looked at.
            let off = if nearest < 0.95 { 0.45 } else { 0.06 };
            prop_assert!(found < expected + 0.06 && found > expected - off, "{found}, not {expected}");
        }

        #[test]
        fn distance_of_segment_and_triangle_is_that_of_their_nearest_samples(
            corners in prop::array::uniform9(-1.0_f64..1.0),
            ends in prop::array::uniform6(-1.0_f64..1.0),
        ) {
            let v = |s: &[f64]| DVec3::from_slice(s);
            let triangle = [v(&corners[0..]), v(&corners[3..]), v(&corners[6..])];
            let axis = [v(&ends[0..]), v(&ends[3..])];
            let found = segment_to_triangle(axis, triangle);
            // A triangle is the segments from its first corner to the side across from it.
            let share = |k: u32| f64::from(k) / 100.0;
            let sampled = (0..=100)
                .map(|k| triangle[1].lerp(triangle[2], share(k)))
                .flat_map(|far| (0..=100).map(move |k| triangle[0].lerp(far, share(k))))
                .map(|x| to_segment(axis.map(|end| end - x)))
                .fold(f64::INFINITY, f64::min);
            prop_assert!(found <= sampled + 1e-12, "{found} but {sampled} was sampled");
            // Sides of up to 3.5 in a hundred parts, either way.
            prop_assert!(sampled <= found + 0.06, "{found} but only {sampled} was sampled");
        }
    }

    #[test]
    fn rod_that_dips_between_the_places_of_a_coarse_look_is_found() {
        // A ridge of 0.02 across the rod, a quarter of the way from one eighth to the next.
        let (points, triangles) = sphere(0.02);
        let points: Vec<Vec3> = points
            .iter()
            .map(|x| *x + Vec3::new(0.06, 0.0, 0.0))
            .collect();
        let axis = [Vec3::new(0.0, 0.04, 0.0), Vec3::new(2.0, 0.04, 0.0)];
        let radius_m = 0.021_f32;
        let found = depth_m(axis, radius_m, &points, &triangles);
        assert!((found - 0.001).abs() < 1e-3, "{found}");
        let through = axis.map(|x| x.with_y(0.015));
        assert!(depth_m(through, radius_m, &points, &triangles) >= f64::from(radius_m));
    }
}
