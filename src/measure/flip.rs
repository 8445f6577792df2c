//! LDR-FLIP: how different two pictures look when one is put in place of the other.
//!
//! Source: Andersson, Nilsson, Akenine-Möller, Oskarsson, Åström, Fairchild, "FLIP: A Difference Evaluator for
//! Alternating Images", HPG 2020; equation numbers are of that paper. Input is linear light, 0 to 1, where the paper
//! starts from sRGB.

use std::f64::consts::PI;

/// Pixels a degree of sight: a picture 0.7 m wide of 3840 pixels, seen from 0.7 m.
const PIXELS_PER_DEGREE: f64 = 0.7 * (3840.0 / 0.7) * PI / 180.0;
/// Terms of the contrast sensitivity of each channel, a1, b1, a2, b2 (table 1).
const SENSITIVITY: [[f64; 4]; 3] = [
    [1.0, 0.0047, 0.0, 1e-5],
    [1.0, 0.0053, 0.0, 1e-5],
    [34.1, 0.04, 13.5, 0.025],
];
const COLOR_EXPONENT: f64 = 0.7;
const COLOR_SHARE: f64 = 0.4;
const COLOR_ERROR_AT_SHARE: f64 = 0.95;
const FEATURE_EXPONENT: f64 = 0.5;
/// Width of the features that are looked for [degrees].
const FEATURE_WIDTH_DEG: f64 = 0.082;

/// One number a pixel, 0 to 1, for two pictures of linear red, green and blue of `size` [px].
///
/// # Panics
///
/// Unless both hold three numbers for each pixel.
pub fn ldr_flip(size: [usize; 2], reference: &[f64], test: &[f64]) -> Vec<f64> {
    let count = 3 * size[0] * size[1];
    assert!(
        reference.len() == count && test.len() == count,
        "three numbers a pixel"
    );
    let (reference, test) = (Seen::new(size, reference), Seen::new(size, test));
    let (green, blue) = (hunt([0.0, 1.0, 0.0]), hunt([0.0, 0.0, 1.0]));
    let largest = hyab(green, blue).powf(COLOR_EXPONENT);
    let turn = COLOR_SHARE * largest;
    (0..size[0] * size[1])
        .map(|i| {
            let color = hyab(reference.color[i], test.color[i]).powf(COLOR_EXPONENT);
            let color = if color < turn {
                COLOR_ERROR_AT_SHARE / turn * color
            } else {
                COLOR_ERROR_AT_SHARE
                    + (color - turn) / (largest - turn) * (1.0 - COLOR_ERROR_AT_SHARE)
            };
            let edge = (reference.edges[i] - test.edges[i]).abs();
            let point = (reference.points[i] - test.points[i]).abs();
            let feature = (edge.max(point) / 2f64.sqrt()).powf(FEATURE_EXPONENT);
            color.powf(1.0 - feature)
        })
        .collect()
}

/// A picture as the eye takes it in.
struct Seen {
    /// L*a*b* of what is left after the eye's blur, after the Hunt effect.
    color: Vec<[f64; 3]>,
    edges: Vec<f64>,
    points: Vec<f64>,
}

impl Seen {
    fn new(size: [usize; 2], rgb: &[f64]) -> Self {
        let opponent: Vec<[f64; 3]> = rgb
            .chunks_exact(3)
            .map(|p| opponent_from_xyz(xyz_from_rgb([p[0], p[1], p[2]])))
            .collect();
        let channel = |c: usize| -> Vec<f64> { opponent.iter().map(|p| p[c]).collect() };
        let filtered: Vec<Vec<f64>> = (0..3)
            .map(|c| contrast_filtered(&channel(c), size, SENSITIVITY[c]))
            .collect();
        let color = (0..opponent.len())
            .map(|i| {
                let rgb = rgb_from_xyz(xyz_from_opponent([
                    filtered[0][i],
                    filtered[1][i],
                    filtered[2][i],
                ]));
                hunt(rgb.map(|v| v.clamp(0.0, 1.0)))
            })
            .collect();
        let grey: Vec<f64> = opponent.iter().map(|p| (p[0] + 16.0) / 116.0).collect();
        Self {
            color,
            edges: features(&grey, size, |x, _| -x),
            points: features(&grey, size, |x, deviation| (x / deviation).powi(2) - 1.0),
        }
    }
}

/// Eqs. 2 to 5: a sum of two Gaussians, each of which separates.
fn contrast_filtered(values: &[f64], size: [usize; 2], [a1, b1, a2, b2]: [f64; 4]) -> Vec<f64> {
    let widest = SENSITIVITY
        .iter()
        .flat_map(|row| [row[1], row[3]])
        .fold(0.0, f64::max);
    let radius = (3.0 * (widest / (2.0 * PI * PI)).sqrt() * PIXELS_PER_DEGREE).ceil() as i64;
    let gaussian = |b: f64| -> Vec<f64> {
        (-radius..=radius)
            .map(|x| (-(PI * x as f64 / PIXELS_PER_DEGREE).powi(2) / b).exp())
            .collect()
    };
    let mut sum = vec![0.0; values.len()];
    let mut weight = 0.0;
    for (a, b) in [(a1, b1), (a2, b2)].into_iter().filter(|(a, _)| *a > 0.0) {
        let kernel = gaussian(b);
        let strength = a * (PI / b).sqrt();
        let filtered = separable(values, size, &kernel, &kernel);
        for (sum, value) in sum.iter_mut().zip(filtered) {
            *sum += strength * value;
        }
        weight += strength * kernel.iter().sum::<f64>().powi(2);
    }
    sum.iter().map(|v| v / weight).collect()
}

/// Strength of what `shape` times a Gaussian finds, along both axes (eqs. 8 to 10).
fn features(grey: &[f64], size: [usize; 2], shape: impl Fn(f64, f64) -> f64) -> Vec<f64> {
    let deviation = 0.5 * FEATURE_WIDTH_DEG * PIXELS_PER_DEGREE;
    let radius = (3.0 * deviation).ceil() as i64;
    let gaussian: Vec<f64> = (-radius..=radius)
        .map(|x| (-0.5 * (x as f64 / deviation).powi(2)).exp())
        .collect();
    let norm: f64 = gaussian.iter().sum();
    let smooth: Vec<f64> = gaussian.iter().map(|g| g / norm).collect();
    let raw: Vec<f64> = (-radius..=radius)
        .zip(&gaussian)
        .map(|(x, g)| shape(x as f64, deviation) * g)
        .collect();
    // What rises and what falls each weigh one.
    let of_sign = |sign: f64| -> f64 { raw.iter().map(|v| (sign * v).max(0.0)).sum() };
    let (rising, falling) = (of_sign(1.0), of_sign(-1.0));
    let kernel: Vec<f64> = raw
        .iter()
        .map(|v| v / if *v > 0.0 { rising } else { falling })
        .collect();
    let along = separable(grey, size, &kernel, &smooth);
    let across = separable(grey, size, &smooth, &kernel);
    along.iter().zip(across).map(|(x, y)| x.hypot(y)).collect()
}

/// Filters by `along` in rows and `down` in columns; the picture goes on beyond its edges as it is there.
fn separable(values: &[f64], [width, height]: [usize; 2], along: &[f64], down: &[f64]) -> Vec<f64> {
    let radius = along.len() as i64 / 2;
    let at = |i: usize, k: usize, last: usize| (i as i64 + k as i64 - radius).clamp(0, last as i64);
    let mut rows = vec![0.0; values.len()];
    for y in 0..height {
        for x in 0..width {
            rows[y * width + x] = (along.iter().enumerate())
                .map(|(k, w)| w * values[y * width + at(x, k, width - 1) as usize])
                .sum();
        }
    }
    let mut out = vec![0.0; values.len()];
    for y in 0..height {
        for x in 0..width {
            out[y * width + x] = (down.iter().enumerate())
                .map(|(k, w)| w * rows[at(y, k, height - 1) as usize * width + x])
                .sum();
        }
    }
    out
}

/// sRGB primaries, white of D65.
const XYZ_FROM_RGB: [[f64; 3]; 3] = [
    [
        10135552.0 / 24577794.0,
        8788810.0 / 24577794.0,
        4435075.0 / 24577794.0,
    ],
    [
        2613072.0 / 12288897.0,
        8788810.0 / 12288897.0,
        887015.0 / 12288897.0,
    ],
    [
        1425312.0 / 73733382.0,
        8788810.0 / 73733382.0,
        70074185.0 / 73733382.0,
    ],
];

fn xyz_from_rgb(rgb: [f64; 3]) -> [f64; 3] {
    XYZ_FROM_RGB.map(|row| (0..3).map(|c| row[c] * rgb[c]).sum())
}

fn white() -> [f64; 3] {
    xyz_from_rgb([1.0; 3])
}

fn rgb_from_xyz(xyz: [f64; 3]) -> [f64; 3] {
    let m = glam::DMat3::from_cols_array_2d(&XYZ_FROM_RGB).transpose();
    (m.inverse() * glam::DVec3::from(xyz)).to_array()
}

/// Y C_x C_z, linear in light.
fn opponent_from_xyz(xyz: [f64; 3]) -> [f64; 3] {
    let white = white();
    let [x, y, z] = [0, 1, 2].map(|c| xyz[c] / white[c]);
    [116.0 * y - 16.0, 500.0 * (x - y), 200.0 * (y - z)]
}

fn xyz_from_opponent([y, cx, cz]: [f64; 3]) -> [f64; 3] {
    let white = white();
    let y = (y + 16.0) / 116.0;
    [
        (y + cx / 500.0) * white[0],
        y * white[1],
        (y - cz / 200.0) * white[2],
    ]
}

/// L*a*b* of linear light, its colours weakened where it is dark (eq. 6).
fn hunt(rgb: [f64; 3]) -> [f64; 3] {
    let white = white();
    let xyz = xyz_from_rgb(rgb);
    let delta = 6.0_f64 / 29.0;
    let [x, y, z] = [0, 1, 2].map(|c| {
        let t = xyz[c] / white[c];
        if t > delta.powi(3) {
            t.cbrt()
        } else {
            t / (3.0 * delta * delta) + 4.0 / 29.0
        }
    });
    let lightness = 116.0 * y - 16.0;
    let strength = 0.01 * lightness;
    [
        lightness,
        strength * 500.0 * (x - y),
        strength * 200.0 * (y - z),
    ]
}

/// Distance of two colours, large ones too (eq. 7).
fn hyab(a: [f64; 3], b: [f64; 3]) -> f64 {
    (a[0] - b[0]).abs() + (a[1] - b[1]).hypot(a[2] - b[2])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn equal_pictures_differ_by_nothing_and_black_from_white_by_all() {
        let size = [9, 7];
        let grey = vec![0.3; 3 * 63];
        assert!(ldr_flip(size, &grey, &grey).iter().all(|v| *v == 0.0));
        let [black, white] = [vec![0.0; 3 * 63], vec![1.0; 3 * 63]];
        let map = ldr_flip(size, &white, &black);
        // The published figure for white against black is 0.967 to three digits.
        assert!(map.iter().all(|v| (v - 0.967).abs() < 0.02), "{}", map[31]);
    }

    #[test]
    fn an_edge_that_moves_is_seen_and_one_that_is_fainter_less() {
        let size = [32, 16];
        let half = |from: usize, light: f64| -> Vec<f64> {
            (0..32 * 16)
                .flat_map(|i| [if i % 32 >= from { light } else { 0.1 }; 3])
                .collect()
        };
        let mean =
            |test: &[f64]| ldr_flip(size, &half(16, 0.5), test).iter().sum::<f64>() / (32.0 * 16.0);
        let (moved, faint) = (mean(&half(20, 0.5)), mean(&half(16, 0.48)));
        assert!(
            moved > 0.05 && faint > 0.0 && faint < moved,
            "{moved} {faint}"
        );
    }
}
