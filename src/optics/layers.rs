//! The way of sight through an outer layer to an inner one.
//!
//! Twin of `shaders/layers.wgsl`. Source: Oat 2006, listing 1; Norberg 2010, eqs. 15 to 18.

use glam::{Vec2, Vec3};

/// From the surface to the inner layer [m], and the length of that way [m].
///
/// `relief` is the normal with the detail of the normal map, `normal` that of the surface; the layers are
/// `distance_m` apart. Grazing ways are cut at four distances.
pub fn transmission(to_eye: Vec3, relief: Vec3, normal: Vec3, distance_m: f32) -> (Vec3, f32) {
    let mirrored = 2.0 * to_eye.dot(relief) * relief - to_eye;
    let along = mirrored - 2.0 * mirrored.dot(normal) * normal;
    let way = distance_m / along.dot(normal).abs().max(0.25);
    (way * along, way)
}

/// Shift of the texture coordinate for a step [m] from the surface, by the gradients of u and v [1/m].
pub fn shift(step: Vec3, gradient_u: Vec3, gradient_v: Vec3) -> Vec2 {
    Vec2::new(step.dot(gradient_u), step.dot(gradient_v))
}

/// Share of the inner layer in the picture.
///
/// Oat's listing 3 takes the outer layer's alpha for transparency, his text for opacity; here it is opacity.
/// N · V prefers the outer layer at grazing views (Norberg 2010, eq. 19).
pub fn inner_share(opacity: f32, cos_eye: f32) -> f32 {
    (1.0 - opacity.clamp(0.0, 1.0)) * cos_eye.clamp(0.0, 1.0)
}

/// Share of the light that a layer of `opacity` lets through to those below (Oat 2006, 4.7).
pub fn let_through(opacity: f32, layer_shadow: f32) -> f32 {
    1.0 - layer_shadow * opacity.clamp(0.0, 1.0)
}

/// What is seen of layers so far, from above.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Seen {
    /// Radiance of what was seen.
    pub radiance: Vec3,
    /// Share of what lies below that is not hidden.
    pub left: f32,
    /// Share of the light that reaches what lies below.
    pub lit: f32,
}

impl Seen {
    /// Before the first layer.
    pub const NOTHING: Self = Self {
        radiance: Vec3::ZERO,
        left: 1.0,
        lit: 1.0,
    };
}

/// What is seen once a layer of `color` and `opacity` has been added below.
pub fn layered(before: Seen, color: Vec3, opacity: f32, layer_shadow: f32) -> Seen {
    Seen {
        radiance: before.radiance + before.left * before.lit * opacity * color,
        left: before.left * (1.0 - opacity),
        lit: before.lit * let_through(opacity, layer_shadow),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    #[test]
    fn a_smooth_surface_is_looked_through_straight() {
        let to_eye = Vec3::new(0.6, 0.0, 0.8);
        let (step, way) = transmission(to_eye, Vec3::Z, Vec3::Z, 0.002);
        // Straight on along the line of sight, 2 mm deep.
        assert!((step + way * to_eye).length() < 1e-9, "{step}");
        assert!((way - 0.0025).abs() < 1e-9, "{way}");
        assert!((step.z + 0.002).abs() < 1e-9, "{step}");
    }

    #[test]
    fn stretched_tissue_shows_its_inner_layer_at_the_same_depth() {
        let (step, _) = transmission(Vec3::new(0.6, 0.0, 0.8), Vec3::Z, Vec3::Z, 0.002);
        // A map with 10 units a metre at rest; after a stretch by 1.8 a metre holds 10 / 1.8.
        let at_rest = shift(step, 10.0 * Vec3::X, 10.0 * Vec3::Y);
        let stretched = shift(step, 10.0 / 1.8 * Vec3::X, 10.0 * Vec3::Y);
        let apparent_m = stretched.x / (10.0 / 1.8);
        assert!((apparent_m - step.x).abs() < 1e-9);
        // With unit tangents, as printed, the shift would stay and the layer lie 1.8 times too deep.
        assert!((at_rest.x / (10.0 / 1.8) - 1.8 * step.x).abs() < 1e-8);
    }

    #[test]
    fn an_opaque_outer_layer_hides_the_inner_one() {
        assert_eq!(inner_share(1.0, 1.0), 0.0);
        assert_eq!(inner_share(0.0, 1.0), 1.0);
        assert_eq!(inner_share(0.0, -0.2), 0.0);
    }

    #[test]
    fn layers_of_one_color_look_as_one_and_shadows_darken_the_deeper_ones() {
        let seen = |opacities: &[f32], shadow| {
            opacities.iter().fold(Seen::NOTHING, |seen, &a| {
                layered(seen, Vec3::ONE, a, shadow)
            })
        };
        for opacities in [&[1.0][..], &[0.3, 1.0], &[0.2, 0.7, 0.1, 1.0]] {
            let all = seen(opacities, 0.0);
            assert!(
                (all.radiance.x - 1.0).abs() < 1e-6 && all.left == 0.0,
                "{all:?}"
            );
        }
        // 0.3 of the light is seen on the first; of what is left, 0.7, the second has 1 - 0.5 * 0.3.
        let shaded = seen(&[0.3, 1.0], 0.5).radiance.x;
        assert!((shaded - (0.3 + 0.7 * 0.85)).abs() < 1e-6, "{shaded}");
    }

    proptest! {
        #[test]
        fn the_way_is_at_most_four_distances_from_any_view(
            eye in prop::array::uniform3(-1.0f32..1.0),
            lean in prop::array::uniform2(-0.8f32..0.8),
        ) {
            let to_eye = Vec3::from(eye).normalize_or(Vec3::Z);
            let relief = Vec3::new(lean[0], lean[1], 1.0).normalize();
            let (step, way) = transmission(to_eye, relief, Vec3::Z, 0.001);
            prop_assert!(way <= 0.004 * 1.0001 && step.length() <= 0.0041, "{step} {way}");
        }
    }
}
