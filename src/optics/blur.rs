//! The growable disc that blurs the light map and what is seen of inner layers.
//!
//! Source: Oat 2006, listing 2, whose twelve taps have their centroid at (0.03, −0.10) R, so that every pass moves
//! the light. Ours come in pairs about the middle: the centroid is 0, also after rounding to texels. The radius is
//! in metres on the deformed surface, where the listing's is in texels.

use super::diffusion::covered_near;
use glam::{IVec2, Vec2, Vec3, Vec4};

/// Pairs of taps; with the middle that makes thirteen.
pub const TAP_PAIRS: usize = 6;

/// Rings of the disc: pairs, radius as a share of the disc's, angle of the first pair [rad].
///
/// The mean square radius of the thirteen taps is half of R², that of an even disc.
const RINGS: [(usize, f32, f32); 2] = [(2, 0.46, 0.4), (4, 0.84, 0.0)];

/// The radius is at most this share of the map.
const RADIUS_SHARE_MAX: f32 = 0.25;

/// One tap of each pair, on the unit disc turned by `turn` [rad].
pub fn taps(turn: f32) -> [[f32; 2]; TAP_PAIRS] {
    let mut taps = [[0.0; 2]; TAP_PAIRS];
    let mut next = 0;
    for (pairs, share, first) in RINGS {
        for pair in 0..pairs {
            let angle = turn + first + std::f32::consts::PI * pair as f32 / pairs as f32;
            taps[next] = (share * Vec2::from_angle(angle)).to_array();
            next += 1;
        }
    }
    taps
}

/// One pass over a square map of `width` texels, light in red, green, blue and the number of the chart in alpha, as
/// `shaders/blur.wgsl` does it; `metrics` hold the metric (a, b, c) [1/m] and the thickness that the radius is times.
pub fn blurred(
    map: &[Vec4],
    metrics: &[Vec4],
    width: usize,
    taps: &[[f32; 2]; TAP_PAIRS],
    radius_m: f32,
) -> Vec<Vec4> {
    let side = width as i32;
    let texel = |at: IVec2| {
        let is_inside = at.min_element() >= 0 && at.max_element() < side;
        if is_inside {
            map[(at.y * side + at.x) as usize]
        } else {
            Vec4::ZERO
        }
    };
    (0..map.len() as i32)
        .map(|i| {
            let place = covered_near(IVec2::new(i % side, i / side), texel);
            let here = texel(place);
            if here.w == 0.0 {
                return Vec4::ZERO;
            }
            let metric = metrics[(place.y * side + place.x) as usize];
            let longest = Vec2::new(metric.x, metric.y).length().max(metric.z);
            let radius = (radius_m * metric.w).min(RADIUS_SHARE_MAX / longest.max(1e-9));
            let texels = radius * width as f32;
            let sum: Vec3 = taps
                .iter()
                .map(|&[x, y]| {
                    let offset = texels * Vec2::new(x * metric.x, x * metric.y + y * metric.z);
                    let offset = offset.map(f32::round_ties_even).as_ivec2();
                    let (p, q) = (texel(place + offset), texel(place - offset));
                    let is_inside = p.w == here.w && q.w == here.w;
                    (if is_inside { p + q } else { 2.0 * here }).truncate()
                })
                .sum();
            ((here.truncate() + sum) / (1 + 2 * TAP_PAIRS) as f32).extend(here.w)
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const WIDTH: usize = 65;

    /// A metre is as wide as the map.
    fn even() -> Vec<Vec4> {
        vec![Vec4::new(1.0, 0.0, 1.0, 1.0); WIDTH * WIDTH]
    }

    /// A point of light in the middle of a square map of one chart.
    fn point() -> Vec<Vec4> {
        let mut map = vec![Vec4::W; WIDTH * WIDTH];
        map[WIDTH * WIDTH / 2] = Vec4::ONE;
        map
    }

    /// Energy, centroid and mean squares [texels²] of a map about its middle.
    fn moments(map: &[Vec4]) -> (f32, Vec2, Vec2) {
        let mut sums = (0.0, Vec2::ZERO, Vec2::ZERO);
        for (i, light) in map.iter().enumerate() {
            let x = (i % WIDTH) as f32 - (WIDTH / 2) as f32;
            let y = (i / WIDTH) as f32 - (WIDTH / 2) as f32;
            let at = Vec2::new(x, y);
            sums.0 += light.x;
            sums.1 += light.x * at;
            sums.2 += light.x * at * at;
        }
        sums
    }

    fn blurred_point(radius: f32, passes: usize, metrics: &[Vec4]) -> Vec<Vec4> {
        (0..passes).fold(point(), |map, pass| {
            let taps = taps(0.5 * pass as f32);
            blurred(&map, metrics, WIDTH, &taps, radius / WIDTH as f32)
        })
    }

    #[test]
    fn a_blur_keeps_the_energy_and_does_not_move_the_light() {
        for radius in [1.0, 2.5, 7.0, 13.0] {
            let (energy, at, _) = moments(&blurred_point(radius, 2, &even()));
            // Sums of f32.
            assert!((energy - 1.0).abs() < 1e-5, "{radius}: {energy}");
            assert!(at.abs().max_element() < 1e-4, "{radius}: {at}");
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
        let spread = |passes: usize| {
            moments(&blurred_point(9.0, passes, &even()))
                .2
                .element_sum()
        };
        // R²/2 is 40.5; rounding to texels moves a tap by up to 0.7 of its 7.6.
        assert!((spread(1) - 40.5).abs() < 6.0, "{}", spread(1));
        assert!(
            (spread(2) / spread(1) - 2.0).abs() < 0.15,
            "{} {}",
            spread(1),
            spread(2)
        );
    }

    #[test]
    fn a_stretched_metric_narrows_the_blur_in_texels_that_way_and_a_thick_layer_widens_it() {
        let spread =
            |metric: Vec4| moments(&blurred_point(16.0, 1, &vec![metric; WIDTH * WIDTH])).2;
        let even = spread(Vec4::new(1.0, 0.0, 1.0, 1.0));
        let stretched = spread(Vec4::new(0.5, 0.0, 1.0, 1.0));
        // Rounding to texels moves a tap by up to half of one of its 7.
        assert!(
            (stretched.x / even.x - 0.25).abs() < 0.04,
            "{stretched} {even}"
        );
        assert!(
            (stretched.y / even.y - 1.0).abs() < 1e-4,
            "{stretched} {even}"
        );
        let thin = spread(Vec4::new(1.0, 0.0, 1.0, 0.5));
        assert!(
            (thin / even - 0.25).abs().max_element() < 0.04,
            "{thin} {even}"
        );
    }

    #[test]
    fn nothing_leaks_from_chart_to_chart_and_a_gutter_takes_what_lies_beside_it() {
        // Chart 1 in the light, a texel of nothing, chart 2 in the dark.
        let map: Vec<Vec4> = (0..WIDTH * WIDTH)
            .map(|i| match (i % WIDTH).cmp(&32) {
                std::cmp::Ordering::Less => Vec4::ONE,
                std::cmp::Ordering::Equal => Vec4::ZERO,
                std::cmp::Ordering::Greater => Vec4::new(0.0, 0.0, 0.0, 2.0),
            })
            .collect();
        let got = blurred(&map, &even(), WIDTH, &taps(0.0), 9.0 / WIDTH as f32);
        for (i, texel) in got.iter().enumerate() {
            let expected = if i % WIDTH <= 32 && texel.w == 1.0 {
                1.0
            } else {
                0.0
            };
            assert_eq!(texel.x, expected, "column {}", i % WIDTH);
            assert!(texel.w > 0.0, "the gutter is filled");
        }
    }
}
