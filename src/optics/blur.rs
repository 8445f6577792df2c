//! The growable disc that blurs the light map.
//!
//! Source: Oat 2006, listing 2, whose twelve taps have their centroid at (0.03, −0.10) R, so that every pass moves
//! the light. Ours come in pairs about the middle: the centroid is 0, also after rounding to texels.

/// Pairs of taps; with the middle that makes thirteen.
pub const TAP_PAIRS: usize = 6;

/// Rings of the disc: pairs, radius as a share of the disc's, angle of the first pair [rad].
///
/// The mean square radius of the thirteen taps is half of R², that of an even disc.
const RINGS: [(usize, f32, f32); 2] = [(2, 0.46, 0.4), (4, 0.84, 0.0)];

/// Offsets [texels] of one tap of each pair, on a disc of `radius_px` turned by `turn` [rad].
pub fn taps(radius_px: f32, turn: f32) -> [[i32; 2]; TAP_PAIRS] {
    let mut taps = [[0; 2]; TAP_PAIRS];
    let mut next = 0;
    for (pairs, share, first) in RINGS {
        for pair in 0..pairs {
            let angle = turn + first + std::f32::consts::PI * pair as f32 / pairs as f32;
            let (sin, cos) = angle.sin_cos();
            let radius = share * radius_px;
            taps[next] = [(radius * cos).round() as i32, (radius * sin).round() as i32];
            next += 1;
        }
    }
    taps
}

/// One pass over a map of `width` texels a row, as `shaders/blur.wgsl` does it: its edge goes on beyond it.
pub fn blurred(map: &[f32], width: usize, taps: &[[i32; 2]; TAP_PAIRS]) -> Vec<f32> {
    let height = map.len() / width;
    let at = |x: i32, y: i32| {
        let x = x.clamp(0, width as i32 - 1) as usize;
        let y = y.clamp(0, height as i32 - 1) as usize;
        map[y * width + x]
    };
    (0..map.len())
        .map(|i| {
            let (x, y) = ((i % width) as i32, (i / width) as i32);
            let mut sum = at(x, y);
            for [dx, dy] in taps {
                sum += at(x + dx, y + dy) + at(x - dx, y - dy);
            }
            sum / (1 + 2 * TAP_PAIRS) as f32
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 65;

    /// A point of light in the middle of a square map.
    fn point() -> Vec<f32> {
        let mut map = vec![0.0; WIDTH * WIDTH];
        map[WIDTH * WIDTH / 2] = 1.0;
        map
    }

    /// Energy, centroid and mean square radius [texels²] of a map about its middle.
    fn moments(map: &[f32]) -> (f32, f32, f32, f32) {
        let mut sums = (0.0, 0.0, 0.0, 0.0);
        for (i, &light) in map.iter().enumerate() {
            let x = (i % WIDTH) as f32 - (WIDTH / 2) as f32;
            let y = (i / WIDTH) as f32 - (WIDTH / 2) as f32;
            sums.0 += light;
            sums.1 += light * x;
            sums.2 += light * y;
            sums.3 += light * (x * x + y * y);
        }
        sums
    }

    fn blurred_point(radius: f32, passes: usize) -> Vec<f32> {
        (0..passes).fold(point(), |map, pass| {
            blurred(&map, WIDTH, &taps(radius, 0.5 * pass as f32))
        })
    }

    #[test]
    fn a_blur_keeps_the_energy_and_does_not_move_the_light() {
        for radius in [1.0, 2.5, 7.0, 13.0] {
            let (energy, x, y, _) = moments(&blurred_point(radius, 2));
            // Sums of f32.
            assert!((energy - 1.0).abs() < 1e-5, "{radius}: {energy}");
            assert!(x.abs() < 1e-4 && y.abs() < 1e-4, "{radius}: ({x}, {y})");
        }
    }

    #[test]
    fn the_drift_check_sees_the_published_taps() {
        // Heights of the twelve taps of Oat's listing 2, at a radius of 10 texels.
        let heights = [
            -0.40581, -0.07358, 0.457137, 0.620716, -0.194983, -0.480026, 0.767022, -0.893124,
            0.064425, 0.412458, -0.932615, -0.59771,
        ];
        let drift = 10.0 * heights.iter().sum::<f32>() / 13.0;
        assert!(drift < -0.9, "a pass moves the light by {drift} texels");
    }

    #[test]
    fn a_pass_spreads_as_an_even_disc_does_and_two_spread_twice_as_far_in_the_square() {
        let spread = |passes: usize| moments(&blurred_point(9.0, passes)).3;
        // R²/2 is 40.5; rounding to texels moves a tap by up to 0.7 of its 7.6.
        assert!((spread(1) - 40.5).abs() < 6.0, "{}", spread(1));
        assert!(
            (spread(2) / spread(1) - 2.0).abs() < 0.15,
            "{} {}",
            spread(1),
            spread(2)
        );
    }
}
