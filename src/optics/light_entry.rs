//! The way of light from where it enters to a point below the surface.
//!
//! Twin of `shaders/light_entry.wgsl`. Source: Green 2004, 16.3.

use glam::Vec3;

/// Entries that light grazes by less are cut as if by this cosine; the same in `light_entry.wgsl`.
const MIN_ENTRY_COSINE: f32 = 0.05;

/// Length [m] of the way to `at` and its cosine with the surface's normal where it enters, near `entry`, where the
/// surface's normal is `normal`.
///
/// `None` for a point that lies before the entry and above the surface there by more than `slack_m`: it is outside
/// the body.
pub fn way_from_entry(
    entry: Vec3,
    normal: Vec3,
    at: Vec3,
    to_light: Vec3,
    slack_m: f32,
) -> Option<(f32, f32)> {
    let cosine = normal.dot(to_light).max(MIN_ENTRY_COSINE);
    let way = entry - at;
    let along = way.dot(to_light);
    let s = along + (way - along * to_light).dot(normal) / cosine;
    let below = s.max(way.dot(normal));
    (below > -slack_m).then_some((s.max(0.0), cosine))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn an_entry_beside_the_ray_is_cut_by_its_plane() {
        let normal = Vec3::new(0.2, -0.1, 1.0).normalize();
        let to_light = Vec3::new(0.5, 0.1, 0.8).normalize();
        let at = Vec3::new(0.01, 0.02, -0.003);
        let on_ray = at + 0.004 * to_light;
        let beside = on_ray + 0.001 * normal.any_orthonormal_vector();
        for entry in [on_ray, beside] {
            let (s, cosine) = way_from_entry(entry, normal, at, to_light, 1e-4).unwrap();
            // Rounding of places 2 cm from the origin.
            assert!((s - 0.004).abs() < 1e-8, "{s}");
            assert!((cosine - normal.dot(to_light)).abs() < 1e-6);
        }
    }

    #[test]
    fn a_point_before_its_entry_is_outside_and_one_just_before_it_is_on_it() {
        let way =
            |height: f32| way_from_entry(Vec3::ZERO, Vec3::Z, height * Vec3::Z, Vec3::Z, 1e-3);
        assert_eq!(way(0.002), None);
        assert_eq!(way(0.0005), Some((0.0, 1.0)));
        assert_eq!(way(-0.0005), Some((0.0005, 1.0)));
    }

    #[test]
    fn an_entry_that_light_grazes_has_a_finite_way() {
        let (s, cosine) =
            way_from_entry(0.001 * Vec3::Z, Vec3::Z, Vec3::ZERO, Vec3::X, 0.0).unwrap();
        assert_eq!(cosine, 0.05);
        assert!((s - 0.02).abs() < 1e-7, "{s}");
    }

    #[test]
    fn an_entry_on_the_ray_has_its_own_way_however_the_normal_is_turned_from_the_light() {
        let to_light = Vec3::new(0.3, -0.4, 0.6).normalize();
        for normal in [Vec3::X, Vec3::Z, -to_light, Vec3::new(0.8, 0.6, 0.0)] {
            let (s, _) =
                way_from_entry(0.004 * to_light, normal, Vec3::ZERO, to_light, 0.0).unwrap();
            assert!((s - 0.004).abs() < 1e-8, "{normal}: {s}");
        }
    }
}
