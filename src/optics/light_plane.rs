//! The way of light to a point below the surface, by the planes that stand for the surface.
//!
//! Twin of `shaders/light_plane.wgsl`. Source: François 2006, eqs. 9, 10 and 14, with the sign of the offset;
//! Norberg 2010, eq. 11.

/// Tangent plane and fitted plane at P, as cosines with the view.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlanePair {
    /// N · n.
    pub normals: f32,
    /// N · to_eye.
    pub tangent_eye: f32,
    /// n · to_eye.
    pub plane_eye: f32,
    /// Signed offset of the fitted plane from P along n [m].
    pub offset_m: f32,
}

impl PlanePair {
    /// The tangent plane in both places.
    pub fn tangent(cos_eye: f32) -> Self {
        Self {
            normals: 1.0,
            tangent_eye: cos_eye,
            plane_eye: cos_eye,
            offset_m: 0.0,
        }
    }
}

/// Length [m] of the light's way to the point `t` [m] along the view ray, and its cosine with the plane there.
///
/// `blend` is 0 for the tangent plane and 1 for the fitted one; the others are the cosines of their normals with
/// the direction to the light. `None` where the plane faces away: no light comes straight.
pub fn way_to_light(
    pair: &PlanePair,
    t: f32,
    blend: f32,
    tangent_light: f32,
    plane_light: f32,
) -> Option<(f32, f32)> {
    let rest = 1.0 - blend;
    let squared = rest * rest + blend * blend + 2.0 * rest * blend * pair.normals;
    let height = blend * pair.offset_m * (rest * pair.normals + blend)
        + t * (rest * pair.tangent_eye + blend * pair.plane_eye);
    let facing = rest * tangent_light + blend * plane_light;
    let cosine = facing / squared.max(1e-6).sqrt();
    (cosine > 1e-3).then(|| (height.max(0.0) / facing.max(1e-3), cosine))
}

/// The same as François' eq. 10 prints it: absolute values, and so no plane that faces away. The shader has it where
/// `MIRRORED` is set.
///
/// Norberg's eq. 11 drops the value bars of the denominator; then ways are negative and light grows on them.
pub fn way_as_printed(
    pair: &PlanePair,
    t: f32,
    blend: f32,
    tangent_light: f32,
    plane_light: f32,
) -> (f32, f32) {
    let rest = 1.0 - blend;
    let squared = rest * rest + blend * blend + 2.0 * rest * blend * pair.normals;
    let height = blend * pair.offset_m * (rest * pair.normals + blend)
        + t * (rest * pair.tangent_eye + blend * pair.plane_eye);
    let facing = rest * tangent_light + blend * plane_light;
    let cosine = facing / squared.max(1e-6).sqrt();
    (
        height.abs() / facing.abs().max(1e-3),
        cosine.abs().max(1e-3),
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Vec3;

    #[test]
    fn the_way_ends_on_the_blended_plane() {
        let normal = Vec3::new(0.1, 0.2, 1.0).normalize();
        let plane = Vec3::new(-0.2, 0.1, 1.0).normalize();
        let to_eye = Vec3::new(0.5, 0.1, 0.8).normalize();
        let to_light = Vec3::new(-0.4, 0.3, 0.7).normalize();
        let (offset_m, t, blend) = (-0.0004, 0.003, 0.36);
        let pair = PlanePair {
            normals: normal.dot(plane),
            tangent_eye: normal.dot(to_eye),
            plane_eye: plane.dot(to_eye),
            offset_m,
        };
        let (s, cosine) =
            way_to_light(&pair, t, blend, normal.dot(to_light), plane.dot(to_light)).unwrap();
        // P is the origin; eq. 9.
        let blended = (1.0 - blend) * normal + blend * plane;
        let on_plane = blend * offset_m * plane;
        let entry = -t * to_eye + s * to_light;
        // 3 mm with a rounding of 1e-7.
        assert!((entry - on_plane).dot(blended).abs() < 1e-8);
        assert!((cosine - blended.normalize().dot(to_light)).abs() < 1e-6);
    }

    #[test]
    fn as_printed_a_body_lit_from_behind_is_as_bright_as_one_lit_from_the_front() {
        let pair = PlanePair::tangent(0.8);
        let front = way_as_printed(&pair, 0.002, 0.3, 0.6, 0.6);
        let back = way_as_printed(&pair, 0.002, 0.3, -0.6, -0.6);
        assert_eq!(front, back);
        assert_eq!(Some(front), way_to_light(&pair, 0.002, 0.3, 0.6, 0.6));
    }

    #[test]
    fn a_plane_that_faces_away_is_unlit() {
        let pair = PlanePair::tangent(0.8);
        assert_eq!(way_to_light(&pair, 0.002, 0.0, -0.3, -0.3), None);
    }

    #[test]
    fn an_offset_inside_the_body_shortens_the_way_and_one_outside_lengthens_it() {
        let way = |offset_m: f32| {
            let pair = PlanePair {
                offset_m,
                ..PlanePair::tangent(0.9)
            };
            way_to_light(&pair, 0.002, 0.5, 0.7, 0.7).unwrap().0
        };
        assert!(way(-0.0005) < way(0.0));
        assert!(way(0.0005) > way(0.0));
    }
}
