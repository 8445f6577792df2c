//! Noise that moves the places where the march reads the layers: difference clouds and interleaved gradients.
//!
//! Twin of `shaders/noise.wgsl`. Source: Norberg 2010, 3.1.2 and eq. 21; Jimenez 2014.

use glam::Vec2;

/// Side of the clouds [px].
pub const SIZE: usize = 128;

/// Repeats of the clouds over the texture map.
const TILES: f32 = 16.0;

/// Difference clouds that repeat without a seam, `SIZE²` texels of two bytes.
///
/// Each is the difference of two sums of smooth noise, and then evened out: of the byte's 256 values each is as
/// frequent as each other, since dark clouds would move what they are added to.
pub fn clouds() -> Vec<[u8; 2]> {
    let [x, y] = [1, 3].map(|seed| {
        let difference: Vec<f32> = (0..SIZE * SIZE)
            .map(|i| {
                let at = Vec2::new((i % SIZE) as f32, (i / SIZE) as f32) / SIZE as f32;
                (smooth(at, seed) - smooth(at, seed + 1)).abs()
            })
            .collect();
        evened(&difference)
    });
    x.into_iter().zip(y).map(|(x, y)| [x, y]).collect()
}

/// Rank of each value, as bytes.
fn evened(values: &[f32]) -> Vec<u8> {
    let mut order: Vec<usize> = (0..values.len()).collect();
    order.sort_by(|&a, &b| values[a].total_cmp(&values[b]));
    let mut bytes = vec![0; values.len()];
    for (rank, index) in order.into_iter().enumerate() {
        bytes[index] = (256 * rank / values.len()) as u8;
    }
    bytes
}

/// Noise of four octaves at `at` in the unit square, whose sides meet.
fn smooth(at: Vec2, seed: u32) -> f32 {
    (0..4)
        .map(|octave| {
            let cells = 8 << octave;
            let scaled = at * cells as f32;
            let low = scaled.floor();
            let share = scaled - low;
            let share = share * share * (3.0 - 2.0 * share);
            let value = |dx: u32, dy: u32| {
                let x = (low.x as u32 + dx) % cells;
                let y = (low.y as u32 + dy) % cells;
                hashed(x + 4099 * y + 7919 * (seed + 16 * octave))
            };
            let row = |dy| value(0, dy) + share.x * (value(1, dy) - value(0, dy));
            (row(0) + share.y * (row(1) - row(0))) / (1 << octave) as f32
        })
        .sum()
}

/// A number in [0, 1) for each `key`.
///
/// Source: the mixing steps of MurmurHash3 (Appleby 2011).
fn hashed(key: u32) -> f32 {
    let mut h = key.wrapping_mul(0x9e37_79b9);
    h = (h ^ h >> 16).wrapping_mul(0x85eb_ca6b);
    h = (h ^ h >> 13).wrapping_mul(0xc2b2_ae35);
    (h ^ h >> 16) as f32 / 4_294_967_296.0
}

/// What `lookups` look-ups of `clouds` end at from the texture coordinate `uv`: each at the texel that the one before names.
pub fn chained(clouds: &[[u8; 2]], uv: Vec2, lookups: u32) -> Vec2 {
    let size = SIZE as f32;
    let tile = (uv * TILES) - (uv * TILES).floor();
    let mut at = (tile * size).min(Vec2::splat(size - 1.0));
    let mut bytes = Vec2::ZERO;
    for _ in 0..lookups {
        let [x, y] = clouds[at.y as usize * SIZE + at.x as usize];
        bytes = Vec2::new(f32::from(x), f32::from(y));
        at = bytes * size / 256.0;
    }
    (2.0 * bytes + 1.0) / 256.0 - 1.0
}

/// Interleaved gradients at the pixel `at`.
pub fn gradient(at: Vec2) -> Vec2 {
    let ramp = |p: Vec2| 0.067_110_56 * p.x + 0.005_837_15 * p.y;
    let [x, y] = [ramp(at), ramp(at + Vec2::new(47.0, 17.0))]
        .map(|ramp: f32| (52.982_92 * (ramp - ramp.floor())).rem_euclid(1.0));
    2.0 * Vec2::new(x, y) - 1.0
}

#[cfg(test)]
mod tests {
    use super::*;

    fn offsets(lookups: u32) -> Vec<Vec2> {
        let clouds = clouds();
        (0..4096)
            .map(|i| {
                let uv = Vec2::new((i % 64) as f32, (i / 64) as f32) / 2048.0;
                chained(&clouds, uv, lookups)
            })
            .collect()
    }

    fn mean(values: impl Iterator<Item = f32>) -> f32 {
        let all: Vec<f32> = values.collect();
        all.iter().sum::<f32>() / all.len() as f32
    }

    #[test]
    fn noise_moves_nothing_in_the_mean() {
        for lookups in [1, 3] {
            let offsets = offsets(lookups);
            let centre = [
                mean(offsets.iter().map(|o| o.x)),
                mean(offsets.iter().map(|o| o.y)),
            ];
            // A quarter of a tile of clouds, whose features are an eighth of it wide, is not yet even.
            assert!(
                centre.iter().all(|c| c.abs() < 0.2),
                "{lookups}: {centre:?}"
            );
        }
        let gradient =
            mean((0..4096).map(|i| gradient(Vec2::new((i % 64) as f32, (i / 64) as f32)).x));
        assert!(gradient.abs() < 0.03, "{gradient}");
    }

    #[test]
    fn chained_look_ups_tell_neighbours_apart_where_one_does_not() {
        let step = |lookups| {
            let offsets = offsets(lookups);
            mean(offsets.windows(2).map(|pair| (pair[1].x - pair[0].x).abs()))
        };
        // Independent even numbers differ by 2/3 in the mean.
        assert!(step(1) < 0.2, "{}", step(1));
        assert!(step(3) > 0.45, "{}", step(3));
    }

    #[test]
    fn plain_difference_clouds_are_dark() {
        let plain: Vec<f32> = (0..SIZE * SIZE)
            .map(|i| {
                let at = Vec2::new((i % SIZE) as f32, (i / SIZE) as f32) / SIZE as f32;
                (smooth(at, 1) - smooth(at, 2)).abs()
            })
            .collect();
        let brightest = plain.iter().copied().fold(0.0, f32::max);
        let centre = 2.0 * mean(plain.into_iter()) / brightest - 1.0;
        assert!(
            centre < -0.3,
            "they would move all layers by {centre} of the amount"
        );
    }
}
