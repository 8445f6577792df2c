//! Light that comes through the body, by what depth maps hold of it: the tissue on its way, a disc of looks, and how
//! it dies away.
//!
//! Twin of `shaders/body_light.wgsl`. Source: Green 2004, 16.3 and 16.4.1.

use super::{LAYERS, Layer};
use glam::{Vec2, Vec3};

/// Colours of a ramp.
pub const RAMP_LENGTH: usize = 256;

/// Looks on a unit disc, the first in the middle where their number is odd: pairs about the middle, so that the light
/// is not moved, on a spiral of golden angles.
///
/// Source: Vogel, "A Better Way to Construct the Sunflower Head", Mathematical Biosciences 44, 1979.
pub fn disc(samples: usize) -> Vec<Vec2> {
    let pairs = samples / 2;
    let mut looks = vec![Vec2::ZERO; samples % 2];
    for pair in 0..pairs {
        let radius = ((pair as f32 + 0.5) / pairs as f32).sqrt();
        let angle = 2.399_963 * pair as f32;
        let look = radius * Vec2::from_angle(angle);
        looks.extend([look, -look]);
    }
    looks
}

/// Depth that a place's tangent plane falls, a metre across the light, for each metre that a look lies towards where
/// its normal leans: 1/N·L, bounded, and nothing on the side away from the light, where the surface is not entered.
pub fn lean(cosine: f32) -> f32 {
    cosine.max(0.0) / (cosine * cosine).max(0.1)
}

/// Tissue before depth `at` along the light, in the unit of the depths: from the first `entry`, and with the first
/// `exit` and the `second` entry that lie on the way, without the gap between them. Negative before the entry.
pub fn tissue_before(at: f32, entry: f32, gap: Option<[f32; 2]>) -> f32 {
    match gap {
        None => at - entry,
        Some([exit, second]) => at.min(exit) - entry + (at - second).max(0.0),
    }
}

/// What is left of light after each of [`RAMP_LENGTH`] ways from 0 to `length_m`: in through the layers and out
/// again, each half of the way, with the diffuse attenuation of each layer times `way_share`.
///
/// `bottoms_m` are the mean lower boundaries of the layers; the last layer has no end.
pub fn layered_ramp(
    layers: &[Layer; LAYERS],
    bottoms_m: Vec3,
    length_m: f32,
    way_share: f32,
) -> Vec<Vec3> {
    let attenuation = layers.map(|layer| layer.diffuse_attenuation_per_m());
    (0..RAMP_LENGTH)
        .map(|i| {
            let half_way = 0.5 * length_m * i as f32 / (RAMP_LENGTH - 1) as f32;
            let depth = super::medium::optical_depth(half_way, 1.0, bottoms_m, &attenuation);
            (-2.0 * way_share * depth).exp()
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn looks_are_about_the_middle_and_fill_the_disc() {
        for samples in 1..=32 {
            let looks = disc(samples);
            assert_eq!(looks.len(), samples);
            let centroid = looks.iter().sum::<Vec2>() / samples as f32;
            assert!(centroid.length() < 1e-6, "{samples}: {centroid}");
            assert!(looks.iter().all(|look| look.length() <= 1.0));
            if samples >= 8 {
                let square: f32 = looks.iter().map(|look| look.length_squared()).sum();
                // Half for an even disc; the odd one's middle takes its share.
                assert!((square / samples as f32 - 0.5).abs() < 0.08, "{samples}");
            }
        }
    }

    #[test]
    fn a_gap_between_two_parts_is_no_tissue() {
        // A part from 1 to 3, air to 6, a part to 10.
        let gap = Some([3.0, 6.0]);
        for (at, tissue) in [(0.5, -0.5), (2.0, 1.0), (3.0, 2.0), (5.0, 2.0), (8.0, 4.0)] {
            assert_eq!(tissue_before(at, 1.0, gap), tissue);
        }
        assert_eq!(tissue_before(8.0, 1.0, None), 7.0, "one layer counts it");
        // Where there is no second part its map is at the far end.
        assert_eq!(tissue_before(2.5, 1.0, Some([3.0, 1e9])), 1.5);
    }

    #[test]
    fn the_lean_is_that_of_the_tangent_plane_where_light_does_not_graze() {
        for cosine in [0.4, 0.7, 1.0] {
            assert!((lean(cosine) - 1.0 / cosine).abs() < 1e-6);
        }
        assert_eq!(lean(-0.3), 0.0);
        assert!((0..=1000).all(|i| lean(i as f32 / 1000.0) < 3.2));
    }

    #[test]
    fn a_ramp_of_one_layer_is_an_exponential_and_of_many_starts_as_the_first() {
        let layer = |absorption: f32| Layer {
            absorption_per_m: Vec3::new(absorption, 2.0 * absorption, 3.0 * absorption),
            scattering_per_m: Vec3::splat(400.0),
            asymmetry: 0.3,
        };
        let length = 0.03;
        let one = layered_ramp(
            &[layer(40.0); LAYERS],
            Vec3::new(0.001, 0.002, 0.003),
            length,
            0.5,
        );
        let sigma = layer(40.0).diffuse_attenuation_per_m();
        for (i, color) in one.iter().enumerate() {
            let s = length * i as f32 / (RAMP_LENGTH - 1) as f32;
            let exact = (-0.5 * sigma * s).exp();
            assert!((*color - exact).abs().max_element() < 1e-6);
        }
        let many = [layer(10.0), layer(300.0), layer(300.0), layer(300.0)];
        let ramp = layered_ramp(&many, Vec3::splat(0.002), length, 0.5);
        assert_eq!(ramp[0], Vec3::ONE);
        assert!(ramp.windows(2).all(|pair| pair[1].cmple(pair[0]).all()));
        let clear = layered_ramp(&[layer(10.0); LAYERS], Vec3::splat(0.002), length, 0.5);
        // Both halves of a way of 3.5 mm lie in the first layer, those of 12 mm do not.
        assert_eq!(ramp[29], clear[29]);
        assert!(ramp[102].x < 0.8 * clear[102].x);
    }
}
