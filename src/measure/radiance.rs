//! How far a radiance picture is from a reference.
//!
//! Scored over the object less its outermost pixels, whose radiance depends on what share of them is covered.

use super::flip;
use super::stats::percentile;

/// A picture of linear radiance, red, green and blue, row by row from the top.
#[derive(Clone, Copy, Debug)]
pub struct Picture<'a> {
    /// Width and height [px].
    pub size: [usize; 2],
    /// Three numbers a pixel.
    pub rgb: &'a [f32],
}

/// What a picture is compared with.
#[derive(Clone, Debug, PartialEq)]
pub struct Reference {
    /// Width and height [px].
    pub size: [usize; 2],
    /// Three numbers a pixel.
    pub rgb: Vec<f32>,
    /// Whether the object is at a pixel.
    pub mask: Vec<bool>,
    /// The same without the veins, where the reference has them.
    pub without_veins: Option<Vec<f32>>,
}

/// How far a picture is off.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Scores {
    /// RMS of the difference over RMS of the reference.
    pub rel_rmse: f64,
    /// Mean over mean, less one.
    pub bias: f64,
    /// As `rel_rmse`, after the one factor that makes it smallest.
    pub rel_rmse_after_gain: f64,
    /// Mean LDR-FLIP at 67 pixels a degree, exposed so that the 99.5th percentile of the reference is 0.8.
    pub flip: f64,
    /// RMS of the difference after that factor over what the veins change; 1: they might as well be missing.
    pub vein: Option<f64>,
    /// Pixels that one of them covers and the other does not.
    pub coverage_mismatch_px: usize,
    /// Pixels that are no number.
    pub nonfinite_px: usize,
}

/// Scores `picture` against `reference`.
///
/// # Panics
///
/// Unless both are of one size.
pub fn scores(picture: Picture<'_>, reference: &Reference) -> Scores {
    assert_eq!(picture.size, reference.size, "pictures of one size");
    let inner = eroded(&reference.mask, reference.size);
    let finite = |v: f32| if v.is_finite() { v } else { 0.0 };
    let got: Vec<f32> = picture.rgb.iter().map(|&v| finite(v)).collect();
    let nonfinite_px = (picture.rgb.chunks_exact(3))
        .filter(|pixel| pixel.iter().any(|v| !v.is_finite()))
        .count();
    let coverage_mismatch_px = (got.chunks_exact(3).zip(&reference.mask))
        .filter(|(pixel, covered)| (pixel.iter().sum::<f32>() > 0.0) != **covered)
        .count();
    let pairs = |f: &mut dyn FnMut(f64, f64)| {
        for (i, (&test, &exact)) in got.iter().zip(&reference.rgb).enumerate() {
            if inner[i / 3] {
                f(f64::from(test), f64::from(exact));
            }
        }
    };
    let (mut difference, mut square, mut test_square, mut product) = (0.0, 0.0, 0.0, 0.0);
    let (mut test_sum, mut exact_sum) = (0.0, 0.0);
    pairs(&mut |test, exact| {
        difference += (test - exact).powi(2);
        square += exact * exact;
        test_square += test * test;
        product += test * exact;
        test_sum += test;
        exact_sum += exact;
    });
    let gain = product / test_square.max(1e-300);
    let mut after_gain = 0.0;
    pairs(&mut |test, exact| after_gain += (gain * test - exact).powi(2));
    let vein = reference.without_veins.as_ref().map(|without| {
        let signal: f64 = (without.iter().zip(&reference.rgb).enumerate())
            .filter(|(i, _)| inner[i / 3])
            .map(|(_, (&a, &b))| f64::from(a - b).powi(2))
            .sum();
        (after_gain / signal.max(1e-300)).sqrt()
    });
    Scores {
        rel_rmse: (difference / square.max(1e-300)).sqrt(),
        bias: test_sum / exact_sum - 1.0,
        rel_rmse_after_gain: (after_gain / square.max(1e-300)).sqrt(),
        flip: mean_flip(&got, reference, &inner),
        vein,
        coverage_mismatch_px,
        nonfinite_px,
    }
}

/// RMS of the difference between `picture` and `reference` over RMS of the reference, with the variance of a reference
/// whose pixels have the standard errors `noise` taken out.
///
/// # Panics
///
/// Unless all are of one size.
pub fn rel_rmse_beyond_noise(picture: Picture<'_>, reference: &Reference, noise: &[f32]) -> f64 {
    assert_eq!(picture.size, reference.size, "pictures of one size");
    assert_eq!(picture.rgb.len(), noise.len(), "an error for each number");
    let inner = eroded(&reference.mask, reference.size);
    let (mut difference, mut square) = (0.0, 0.0);
    for (i, (&test, &exact)) in picture.rgb.iter().zip(&reference.rgb).enumerate() {
        if inner[i / 3] {
            let (test, exact) = (f64::from(test), f64::from(exact));
            difference += (test - exact).powi(2) - f64::from(noise[i]).powi(2);
            square += exact * exact;
        }
    }
    (difference.max(0.0) / square.max(1e-300)).sqrt()
}

/// Pixels whose four neighbours are in the mask too; those at the edge of the picture have none beyond it.
pub fn eroded(mask: &[bool], [width, height]: [usize; 2]) -> Vec<bool> {
    (0..mask.len())
        .map(|i| {
            let (x, y) = (i % width, i / width);
            let within = x > 0 && y > 0 && x + 1 < width && y + 1 < height;
            within && mask[i] && mask[i - 1] && mask[i + 1] && mask[i - width] && mask[i + width]
        })
        .collect()
}

fn mean_flip(got: &[f32], reference: &Reference, inner: &[bool]) -> f64 {
    let covered = |values: &[f32]| -> Vec<f32> {
        let pixels = values.chunks_exact(3).zip(&reference.mask);
        pixels
            .flat_map(|(pixel, &covered)| pixel.iter().map(move |&v| if covered { v } else { 0.0 }))
            .collect()
    };
    let exact = covered(&reference.rgb);
    let within = exact
        .iter()
        .enumerate()
        .filter(|(i, _)| reference.mask[i / 3]);
    let mut bright: Vec<f64> = within.map(|(_, &v)| f64::from(v)).collect();
    bright.sort_by(f64::total_cmp);
    let white = percentile(&bright, 0.995).unwrap_or(1.0).max(1e-30);
    let exposed = |values: &[f32]| -> Vec<f64> {
        let exposure = 0.8 / white;
        values
            .iter()
            .map(|&v| (exposure * f64::from(v)).clamp(0.0, 1.0))
            .collect()
    };
    let map = flip::ldr_flip(reference.size, &exposed(&exact), &exposed(&covered(got)));
    let scored: Vec<f64> = (map.iter().zip(inner))
        .filter(|(_, inner)| **inner)
        .map(|(v, _)| *v)
        .collect();
    scored.iter().sum::<f64>() / scored.len().max(1) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A ball of light on black.
    fn ball() -> Reference {
        let size = [24, 20];
        let mut rgb = Vec::new();
        let mut mask = Vec::new();
        for i in 0..size[0] * size[1] {
            let (x, y) = ((i % size[0]) as f32 - 11.5, (i / size[0]) as f32 - 9.5);
            let inside = x.hypot(y) < 8.0;
            mask.push(inside);
            let light = if inside { 0.1 + 0.01 * x } else { 0.0 };
            rgb.extend([light, 0.5 * light, 0.4 * light]);
        }
        Reference {
            size,
            rgb,
            mask,
            without_veins: None,
        }
    }

    fn of(rgb: &[f32]) -> Scores {
        let reference = ball();
        let size = reference.size;
        scores(Picture { size, rgb }, &reference)
    }

    #[test]
    fn a_picture_scores_nothing_against_itself_and_a_gain_is_a_bias_alone() {
        let reference = ball();
        let same = of(&reference.rgb);
        assert_eq!((same.rel_rmse, same.bias, same.flip), (0.0, 0.0, 0.0));
        assert_eq!(same.coverage_mismatch_px, 0);
        let brighter: Vec<f32> = reference.rgb.iter().map(|v| 1.1 * v).collect();
        let scored = of(&brighter);
        assert!((scored.rel_rmse - 0.1).abs() < 1e-6 && (scored.bias - 0.1).abs() < 1e-6);
        assert!(scored.rel_rmse_after_gain < 1e-6 && scored.flip > 0.01);
    }

    #[test]
    fn noise_of_the_reference_is_no_error_and_a_gain_is_one() {
        let clean = ball().rgb;
        let mut reference = ball();
        for (i, v) in reference.rgb.iter_mut().enumerate() {
            *v += if i % 2 == 0 { 0.01 } else { -0.01 };
        }
        let size = reference.size;
        let error = |rgb: &[f32], noise: f32| {
            let noise = vec![noise; rgb.len()];
            rel_rmse_beyond_noise(Picture { size, rgb }, &reference, &noise)
        };
        // Rounding of sums of squares.
        assert!(error(&clean, 0.01) < 1e-3);
        assert!(error(&clean, 0.0) > 0.05);
        let brighter: Vec<f32> = clean.iter().map(|v| 1.2 * v).collect();
        assert!((error(&brighter, 0.01) - 0.2).abs() < 0.03);
    }

    #[test]
    fn what_is_no_number_and_what_is_not_covered_is_counted() {
        let mut rgb = ball().rgb;
        rgb[3 * (24 * 10 + 12)] = f32::NAN;
        rgb[0] = 1.0;
        let scored = of(&rgb);
        assert_eq!(scored.nonfinite_px, 1);
        assert_eq!(scored.coverage_mismatch_px, 1);
    }

    #[test]
    fn veins_that_are_missing_score_one() {
        let mut reference = ball();
        let without: Vec<f32> = (reference.rgb.iter().enumerate())
            .map(|(i, v)| if i / 3 % 24 == 12 { 0.8 * v } else { *v })
            .collect();
        reference.without_veins = Some(without.clone());
        let size = reference.size;
        let missing = scores(
            Picture {
                size,
                rgb: &without,
            },
            &reference,
        )
        .vein
        .unwrap();
        // The best gain makes up for a little of them.
        assert!((0.9..=1.0).contains(&missing), "{missing}");
        let there = scores(
            Picture {
                size,
                rgb: &reference.rgb,
            },
            &reference,
        );
        assert_eq!(there.vein, Some(0.0));
    }
}
