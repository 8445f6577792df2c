//! How deep a ball is in a closed surface: the judge of the study, in f64 and without a line in common
//! with what is judged.

use glam::{DVec3, Vec3};
use std::f64::consts::PI;

/// How deep the ball of `radius_m` round `middle` reaches into the surface [m], negative where it does
/// not: by every triangle, not only by their corners. A ball whose middle is inside is deeper than its
/// radius.
pub fn depth_m(middle: Vec3, radius_m: f32, points: &[Vec3], triangles: &[[u32; 3]]) -> f64 {
    let x = middle.as_dvec3();
    let (mut nearest_m2, mut solid_angle) = (f64::INFINITY, 0.0);
    for triangle in triangles {
        let corners = triangle.map(|point| points[point as usize].as_dvec3() - x);
        nearest_m2 = nearest_m2.min(nearest_squared(corners));
        solid_angle += solid_angle_of(corners);
    }
    // Once round for a place inside, also where the surface is folded.
    let side = if solid_angle > 2.0 * PI { -1.0 } else { 1.0 };
    f64::from(radius_m) - side * nearest_m2.sqrt()
}

/// Squared distance of a triangle from the origin.
fn nearest_squared([a, b, c]: [DVec3; 3]) -> f64 {
    let normal = (b - a).cross(c - a);
    let is_over = |p: DVec3, q: DVec3| normal.dot((q - p).cross(-p)) >= 0.0;
    if normal != DVec3::ZERO && is_over(a, b) && is_over(b, c) && is_over(c, a) {
        return normal.dot(a).powi(2) / normal.length_squared();
    }
    let to_edge = |p: DVec3, q: DVec3| {
        let edge = q - p;
        let share = -edge.dot(p) / edge.length_squared().max(f64::MIN_POSITIVE);
        (p + share.clamp(0.0, 1.0) * edge).length_squared()
    };
    to_edge(a, b).min(to_edge(b, c)).min(to_edge(c, a))
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
            let found = depth_m(x, radius, &points, &triangles);
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
        let over = |y: f32| depth_m(Vec3::new(0.0, y, -0.3), 0.1, &points, &triangles);
        assert!((over(0.09) - 0.01).abs() < 1e-6);
        assert!((over(0.2) + 0.1).abs() < 1e-6);
        assert!((over(-0.05) - 0.15).abs() < 1e-6);
    }
}
