//! How far light wanders in tissue before it comes out again, as a sum of three Gaussians, and the blur by it.
//!
//! A thin beam falls straight on an even half-space; what comes out at a distance is its profile. Over its mean
//! distance profiles of all tissues look nearly alike, so one shape serves, and a formula gives the mean distance.
//!
//! Twin of `shaders/diffuse.wgsl` and of the metric in `shaders/diffusion_map.wgsl`. Source: Green 2004, 16.4; sums of
//! Gaussians after d'Eon and Luebke, GPU Gems 3, ch. 14, 2007; widths and weights fitted to Monte Carlo walks by us.

use super::{Layer, medium};
use glam::{IVec2, Vec2, Vec3, Vec4};

/// Gaussians of a profile.
pub const GAUSSIANS: usize = 3;

/// Standard deviations along one axis, as shares of the mean distance at which light comes out.
const SIGMA_SHARES: [f32; GAUSSIANS] = [0.107, 0.563, 1.64];
/// Share of the light in each; they add up to one.
const WEIGHTS: [f32; GAUSSIANS] = [0.23, 0.46, 0.31];

/// Taps on each side of a texel, at most, for each Gaussian: those of the last are spread over what the one before
/// has smoothed.
pub const TAPS: [u32; GAUSSIANS] = [16, 16, 9];

/// Width at which half of a Gaussian is told from a spot in a map [texels].
const SPOT_TEXELS: f32 = 0.4;

/// The light that comes out of a tissue about the place where it went in.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Profile {
    /// Standard deviation of each Gaussian along one axis [m], red, green, blue; the narrowest first.
    pub sigmas_m: [Vec3; GAUSSIANS],
    /// Share of the light in each.
    pub weights: [Vec3; GAUSSIANS],
}

impl Profile {
    /// The profile of an even half-space of `layer`.
    pub fn of(layer: &Layer) -> Self {
        let mean_m = mean_distance_m(layer);
        Self {
            sigmas_m: SIGMA_SHARES.map(|share| share * mean_m),
            weights: WEIGHTS.map(Vec3::splat),
        }
    }

    /// Widths of the blurs [m] that make each Gaussian from the one before.
    pub fn steps_m(&self) -> [Vec3; GAUSSIANS] {
        let mut before = Vec3::ZERO;
        self.sigmas_m.map(|sigma| {
            let step = (sigma * sigma - before * before)
                .max(Vec3::ZERO)
                .map(f32::sqrt);
            before = sigma;
            step
        })
    }

    /// Share of each Gaussian that a map of `texels_per_m` can't tell from a spot, so that it is better lit at the
    /// pixel: 2^−(σ/0.4 texels)².
    pub fn spots(&self, texels_per_m: f32) -> [Vec3; GAUSSIANS] {
        self.sigmas_m
            .map(|sigma| (sigma * texels_per_m / SPOT_TEXELS).map(|t| (-t * t).exp2()))
    }

    /// Light at `x` [m] where half of the surface, x > 0, is lit by 1; in one colour.
    pub fn edge(&self, x: f32, channel: usize) -> f32 {
        let mut sum = 0.0;
        for (sigma, weight) in self.sigmas_m.iter().zip(&self.weights) {
            let t = x / (sigma[channel] * std::f32::consts::SQRT_2);
            sum += weight[channel] * 0.5 * (1.0 + error_function(t));
        }
        sum
    }
}

/// erf to 1.5e-7.
///
/// Source: Abramowitz and Stegun, Handbook of Mathematical Functions, 7.1.26.
fn error_function(x: f32) -> f32 {
    let t = 1.0 / (1.0 + 0.327_591_1 * x.abs());
    let poly = t
        * (0.254_829_6
            + t * (-0.284_496_74 + t * (1.421_413_7 + t * (-1.453_152 + t * 1.061_405_4))));
    x.signum() * (1.0 - poly * (-x * x).exp())
}

/// Mean distance from where light goes in to where it comes out [m], red, green, blue.
///
/// Fitted to our walks: with σ' = σ_a + (1 − g) σ_s, α' = (1 − g) σ_s / σ' and g the mean cosine, it is
/// (0.462 + 0.29 x + 0.036 x²)(1 + 0.44 g + 0.27 g²) / σ', x = −ln(1 − α').
pub fn mean_distance_m(layer: &Layer) -> Vec3 {
    let g = medium::mean_cosine(layer.asymmetry);
    let reduced = (1.0 - g) * layer.scattering_per_m;
    let extinction = (layer.absorption_per_m + reduced).max(Vec3::splat(1e-6));
    // Tissue that absorbs nothing lets light wander without end: it is cut.
    let x = -(layer.absorption_per_m / extinction)
        .max(Vec3::splat(1e-3))
        .map(f32::ln);
    (0.462 + 0.29 * x + 0.036 * x * x) * (1.0 + 0.44 * g + 0.27 * g * g) / extinction
}

/// Lower triangle (a, b, c) of the metric of a texture map: with L = [a 0; b c], L Lᵀ holds the products of the
/// gradients of u and v [1/m²].
pub fn metric(gradient_u: Vec3, gradient_v: Vec3) -> Vec3 {
    let a = gradient_u.length();
    let b = gradient_u.dot(gradient_v) / a.max(1e-20);
    let c = (gradient_v.length_squared() - b * b).max(0.0).sqrt();
    Vec3::new(a, b, c)
}

/// Which of the two directions of a metric is blurred along.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Axis {
    /// (0, c)
    Second,
    /// (a, b)
    First,
}

/// One blur of a square map of `width` texels, light in red, green, blue and the number of the chart in alpha, by
/// widths of `sigma_m` [m] on the surface, with at most `taps` on each side.
pub fn diffused(
    map: &[Vec4],
    metrics: &[Vec3],
    width: usize,
    axis: Axis,
    sigma_m: Vec3,
    taps: u32,
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
    let size = width as f32;
    (0..map.len() as i32)
        .map(|i| {
            let place = covered_near(IVec2::new(i % side, i / side), texel);
            let here = texel(place);
            if here.w == 0.0 {
                return Vec4::ZERO;
            }
            let metric = metrics[(place.y * side + place.x) as usize];
            let step = size
                * match axis {
                    Axis::Second => Vec2::new(0.0, metric.z),
                    Axis::First => Vec2::new(metric.x, metric.y),
                };
            let longest = step.abs().max_element().max(1e-9);
            let sigma = (sigma_m * longest).min(Vec3::splat(0.125 * size));
            let reach = 3.0 * sigma.max_element();
            let stride = (reach / taps as f32).ceil().max(1.0);
            let narrow = -0.5 / (sigma * sigma).max(Vec3::splat(1e-4));
            let mut sum = here.truncate();
            let mut weight = Vec3::ONE;
            for i in 1..=(reach / stride).ceil() as i32 {
                let x = i as f32 * stride;
                let offset = (x * step / longest).map(f32::round_ties_even).as_ivec2();
                let w = (x * x * narrow).exp();
                let (p, q) = (texel(place + offset), texel(place - offset));
                let pair = if p.w == here.w && q.w == here.w {
                    p + q
                } else {
                    2.0 * here
                };
                sum += w * pair.truncate();
                weight += 2.0 * w;
            }
            (sum / weight).extend(here.w)
        })
        .collect()
}

/// The texel itself, or where it is empty a neighbour that is not: sides first, then corners.
pub(super) fn covered_near(at: IVec2, texel: impl Fn(IVec2) -> Vec4) -> IVec2 {
    const BESIDE: [[i32; 2]; 9] = [
        [0, 0],
        [1, 0],
        [-1, 0],
        [0, 1],
        [0, -1],
        [1, 1],
        [-1, 1],
        [1, -1],
        [-1, -1],
    ];
    BESIDE
        .into_iter()
        .map(|beside| at + IVec2::from_array(beside))
        .find(|&near| texel(near).w != 0.0)
        .unwrap_or(at)
}

#[cfg(test)]
#[path = "diffusion/tests.rs"]
mod tests;
