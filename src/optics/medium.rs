//! Phase function, optical depth through layers, and what one segment of the view ray sends to the eye.
//!
//! Twin of `shaders/medium.wgsl`, function by function.

use super::LAYERS;
use glam::Vec3;

/// Optical depth of an unlit place: beyond any eye's reach.
pub const UNLIT: f32 = 60.0;

/// Schlick's phase function [1/sr] for the cosine of the angle between `to_light` and `to_eye`.
///
/// François 2006 and Norberg 2010 (eq. 3) print 1 + g cos θ. With both directions away from the place, cos θ = 1
/// is light thrown back, and k > 0 scatters forwards. k is not the mean cosine: see [`mean_cosine`].
pub fn phase(cosine: f32, k: f32) -> f32 {
    let base = 1.0 + k * cosine;
    (1.0 - k * k) / (4.0 * std::f32::consts::PI) / (base * base).max(1e-6)
}

/// Mean cosine between the directions of travel before and after: 1/k − (1 − k²)/(2k²) ln((1 + k)/(1 − k)).
pub fn mean_cosine(k: f32) -> f32 {
    let k = f64::from(k);
    if k.abs() < 1e-2 {
        // The first term of the series: the closed form loses its digits here.
        return (2.0 / 3.0 * k) as f32;
    }
    (1.0 / k - (1.0 - k * k) / (2.0 * k * k) * ((1.0 + k) / (1.0 - k)).ln()) as f32
}

/// Schlick's k whose [`mean_cosine`] is `g`, from 0 to 0.9.
pub fn asymmetry_of(g: f32) -> f32 {
    let (mut low, mut high) = (0.0, 0.98);
    // Each step halves what is left of an interval of length one: 1e-7.
    for _ in 0..24 {
        let middle = 0.5 * (low + high);
        if mean_cosine(middle) < g {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// Lengths of a path of `s` [m] in each layer, from the surface inwards, at an angle of `cosine` with the
/// normal; `bottoms` are the lower boundaries of the first three layers [m], ascending.
///
/// Norberg 2010, eq. 14. The last layer has no end, so the lengths add up to `s`.
pub fn path_lengths(s: f32, cosine: f32, bottoms: Vec3) -> [f32; LAYERS] {
    let ends = (bottoms / cosine.max(1e-3)).min(Vec3::splat(s));
    [ends.x, ends.y - ends.x, ends.z - ends.y, s - ends.z]
}

/// Optical depth of that path, in layers of `extinction` [1/m].
pub fn optical_depth(s: f32, cosine: f32, bottoms: Vec3, extinction: &[Vec3; LAYERS]) -> Vec3 {
    path_lengths(s, cosine, bottoms)
        .iter()
        .zip(extinction)
        .map(|(&length, &sigma_t)| length * sigma_t)
        .sum()
}

/// Mean of e^−A over a piece of one layer along which A goes evenly from `a0` to `a1`.
pub fn mean_transmittance(a0: Vec3, a1: Vec3) -> Vec3 {
    let mut mean = Vec3::ZERO;
    for c in 0..3 {
        let (e0, e1) = ((-a0[c]).exp(), (-a1[c]).exp());
        let change = a1[c] - a0[c];
        // Where A hardly changes the quotient loses its digits; there the mean of the ends errs by change²/12.
        mean[c] = if change.abs() < 0.02 {
            0.5 * (e0 + e1)
        } else {
            (e0 - e1) / change
        };
    }
    mean
}

/// Share of a segment that lies above each boundary; `start` and `end` are how far its ends lie below them [m].
pub fn above(start: Vec3, end: Vec3) -> Vec3 {
    let below = start.max(Vec3::ZERO) + end.max(Vec3::ZERO);
    1.0 - below / (start.abs() + end.abs()).max(Vec3::splat(1e-12))
}

/// Optical depth from the eye at the start of a segment, at the ends of the layers in it, and at its end.
pub fn segment(
    a0: Vec3,
    length: f32,
    shares: Vec3,
    extinction: &[Vec3; LAYERS],
) -> [Vec3; LAYERS + 1] {
    let ends = [0.0, shares.x, shares.y, shares.z, 1.0];
    let mut a = [a0; LAYERS + 1];
    for layer in 0..LAYERS {
        a[layer + 1] = a[layer] + length * (ends[layer + 1] - ends[layer]) * extinction[layer];
    }
    a
}

/// What each layer of a segment sends to the eye per irradiance [1/sr].
///
/// `a` is from [`segment`], `before` and `after` are the light's optical depths at its ends, `sources` albedo
/// times phase. The light's depth grows as the eye's does, so that one segment is exact for parallel layers.
pub fn gather(
    a: &[Vec3; LAYERS + 1],
    before: Vec3,
    after: Vec3,
    sources: &[Vec3; LAYERS],
) -> [Vec3; LAYERS] {
    let growth = a[LAYERS] - a[0];
    let r = 1.0 + (after - before) / growth.max(Vec3::splat(1e-12));
    let start = a[0] + before;
    let mut e = a.map(|a_j| (-(start + r * (a_j - a[0]))).exp());
    e[LAYERS] = (-(a[LAYERS] + after)).exp();
    let mean = 0.5 * (e[0] + e[LAYERS]);
    std::array::from_fn(|j| {
        let mut light = Vec3::ZERO;
        for c in 0..3 {
            // Where the exponent hardly changes the differences lose their digits.
            light[c] = if (r[c] * growth[c]).abs() < 0.02 {
                (a[j + 1][c] - a[j][c]) * mean[c]
            } else {
                (e[j][c] - e[j + 1][c]) / r[c]
            };
        }
        light * sources[j]
    })
}

/// The papers' step (François 2006, Algorithm 1): its start stands for all of it.
///
/// `below` is how far the start lies below each boundary [m].
pub fn gather_at_start(
    a: &[Vec3; LAYERS + 1],
    before: Vec3,
    below: Vec3,
    sources: &[Vec3; LAYERS],
) -> [Vec3; LAYERS] {
    let layer = below.to_array().iter().filter(|&&b| b > 0.0).count();
    let mut got = [Vec3::ZERO; LAYERS];
    got[layer] = (a[LAYERS] - a[0]) * (-(a[0] + before)).exp() * sources[layer];
    got
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// ∫ f(cos θ) p dω over the sphere, by the midpoint rule in f64.
    fn over_sphere(k: f32, f: impl Fn(f64) -> f64) -> f64 {
        const STEPS: usize = 20_000;
        (0..STEPS)
            .map(|i| {
                let cosine = -1.0 + 2.0 * (i as f64 + 0.5) / STEPS as f64;
                let p = f64::from(phase(cosine as f32, k));
                f(cosine) * p * 4.0 * std::f64::consts::PI / STEPS as f64
            })
            .sum()
    }

    #[test]
    fn phase_function_integrates_to_one_over_the_sphere() {
        for k in [-0.9, -0.4, 0.0, 0.25, 0.8, 0.9] {
            // The midpoint rule errs by 1e-5 at |k| = 0.9, f32 by less.
            let total = over_sphere(k, |_| 1.0);
            assert!((total - 1.0).abs() < 1e-3, "k {k}: {total}");
        }
    }

    #[test]
    fn positive_asymmetry_scatters_forwards() {
        // Light behind the tissue: to_light and to_eye are opposite.
        assert!(phase(-1.0, 0.5) > phase(1.0, 0.5));
        assert!(mean_cosine(0.5) > 0.0);
    }

    #[test]
    fn mean_cosine_matches_the_phase_function() {
        for k in [-0.8, -0.25, 0.005, 0.25, 0.4, 0.8] {
            // The cosine between directions of travel is the opposite of that between the outward ones.
            let mean = over_sphere(k, |cosine| -cosine);
            let error = (mean - f64::from(mean_cosine(k))).abs();
            assert!(error < 1e-3, "k {k}: {mean} against {}", mean_cosine(k));
        }
    }

    #[test]
    fn asymmetry_gives_back_the_mean_cosine_it_was_made_for() {
        for g in [0.0, 0.2, 0.474, 0.9] {
            // Near 0 the series takes over, with a step of 2e-6.
            assert!((mean_cosine(asymmetry_of(g)) - g).abs() < 1e-5, "{g}");
        }
    }

    #[test]
    fn a_segment_crosses_a_boundary_where_linear_interpolation_does() {
        let share = above(Vec3::new(-1.0, -3.0, 2.0), Vec3::new(3.0, -1.0, 4.0));
        assert_eq!(share, Vec3::new(0.25, 1.0, 0.0));
        // Leaving a layer upwards counts the same.
        assert_eq!(
            above(Vec3::splat(3.0), Vec3::splat(-1.0)),
            Vec3::splat(0.25)
        );
    }

    proptest! {
        #[test]
        fn lengths_in_layers_are_not_negative_and_add_up_to_the_path(
            s in 0.0f32..0.1,
            cosine in -0.5f32..1.0,
            depths in prop::array::uniform3(0.0f32..0.01),
        ) {
            let bottoms = Vec3::new(depths[0], depths[0] + depths[1], depths.iter().sum());
            let lengths = path_lengths(s, cosine, bottoms);
            prop_assert!(lengths.iter().all(|&d| d >= 0.0), "{lengths:?}");
            // Rounding of four sums.
            prop_assert!((lengths.iter().sum::<f32>() - s).abs() <= 1e-6 * s + 1e-9);
        }

        #[test]
        fn a_segment_sends_no_more_than_its_optical_depth_and_its_brighter_end_allow(
            a0 in 0.0f32..20.0,
            lengths in prop::array::uniform4(0.0f32..0.01),
            before in 0.0f32..UNLIT,
            after in 0.0f32..UNLIT,
        ) {
            let extinction = [100.0, 900.0, 2000.0, 500.0].map(Vec3::splat);
            let total: f32 = lengths.iter().sum::<f32>() + 1e-9;
            let mut end = 0.0;
            let mut shares = Vec3::ZERO;
            for j in 0..3 {
                end += lengths[j];
                shares[j] = end / total;
            }
            let a = segment(Vec3::splat(a0), total, shares, &extinction);
            let got = gather(&a, Vec3::splat(before), Vec3::splat(after), &[Vec3::ONE; 4]);
            let brightest = (-(a[0].x + before).min(a[4].x + after)).exp();
            for (j, light) in got.iter().enumerate() {
                let depth = a[j + 1].x - a[j].x;
                // Differences of exponentials are rounded to 1e-7 of the larger, and the quotient r may be small:
                // 1e-4 of the brighter end was never reached.
                prop_assert!(light.x >= -1e-4 * brightest, "{light}");
                prop_assert!(light.x <= 1.02 * depth * brightest + 1e-4 * brightest, "{light}");
            }
        }
    }

    #[test]
    fn the_bound_on_lengths_sees_the_missing_maximum() {
        // François' eq. 12 without Norberg's max(…, 0): what is left after the layers above, at most the layer.
        let (s, thicknesses) = (0.001, [0.0008, 0.0012, 0.001]);
        let mut above = 0.0;
        let lengths = thicknesses.map(|thickness| {
            let length = f32::min(s - above, thickness);
            above += thickness;
            length
        });
        assert!(lengths.iter().any(|&d| d < 0.0), "{lengths:?}");
    }
}
