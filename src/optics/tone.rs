//! The tone curve and the sRGB encoding.
//!
//! Twin of `shaders/tone.wgsl`. Source: Narkowicz, "ACES Filmic Tone Mapping Curve", 2015; IEC 61966-2-1.

use glam::Vec3;

/// What a screen shows of linear radiance, 0 to 1.
pub fn displayed(radiance: Vec3) -> Vec3 {
    let x = 0.8 * radiance.max(Vec3::ZERO);
    let curve = x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14);
    curve.clamp(Vec3::ZERO, Vec3::ONE).map(srgb_by_roots)
}

/// As [`srgb_from_linear`], its power by a sum of the 0th to 3rd powers of the fourth root: off by 2.2e-4 at most.
fn srgb_by_roots(linear: f32) -> f32 {
    if linear < 0.003_130_8 {
        return 12.92 * linear;
    }
    let half = linear.sqrt();
    let quarter = half.sqrt();
    half * (0.952_575_5 - 0.136_825_6 * quarter) + 0.255_796_5 * quarter - 0.071_761_2
}

/// sRGB encoding of a linear value, both 0 to 1.
pub fn srgb_from_linear(linear: f32) -> f32 {
    if linear < 0.003_130_8 {
        12.92 * linear
    } else {
        1.055 * linear.powf(1.0 / 2.4) - 0.055
    }
}

/// The linear value of an sRGB one, both 0 to 1.
pub fn linear_from_srgb(encoded: f32) -> f32 {
    if encoded <= 0.040_45 {
        encoded / 12.92
    } else {
        ((encoded + 0.055) / 1.055).powf(2.4)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn srgb_survives_there_and_back() {
        for byte in 0..=255 {
            let encoded = byte as f32 / 255.0;
            let back = srgb_from_linear(linear_from_srgb(encoded));
            // The two halves of the standard meet within 1e-6.
            assert!((back - encoded).abs() < 1e-5, "{byte}: {back}");
        }
    }

    #[test]
    fn roots_stand_for_the_power_within_an_eighteenth_of_a_step_of_eight_bits() {
        let worst = (0..=100_000)
            .map(|step| step as f32 / 1e5)
            .map(|linear| (srgb_by_roots(linear) - srgb_from_linear(linear)).abs())
            .fold(0.0, f32::max);
        // Measured: 2.16e-4; where the two halves meet, 2.1e-4.
        assert!(worst < 2.2e-4, "off by {worst}");
    }

    #[test]
    fn more_light_is_never_shown_darker_and_nothing_is_black() {
        assert_eq!(displayed(Vec3::ZERO), Vec3::ZERO);
        assert_eq!(displayed(Vec3::splat(-3.0)), Vec3::ZERO);
        let mut last = 0.0;
        for step in 0..2000 {
            let shown = displayed(Vec3::splat(1e-4 * 1.01_f32.powi(step))).x;
            assert!(
                shown >= last && shown <= 1.0,
                "step {step}: {shown} after {last}"
            );
            last = shown;
        }
        // The fit ends 2.2e-4 below white.
        assert!(last > 0.9997, "{last}");
    }
}
