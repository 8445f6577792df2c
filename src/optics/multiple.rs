//! Light that scattered more than once, in closed form from the medium alone.
//!
//! In an even half-space whose particles scatter alike in all directions, light of all orders is that scattered once
//! times H(μ₀) H(μ) (Chandrasekhar 1960). Where they do not, the first order keeps its phase function and the others
//! are taken as even (Hapke 1981): beside ϖ p stands ϖ′ (H H − 1) / 4π. So it is gathered along the view ray by the same
//! march, layer by layer, and needs no look below the surface of its own. Our part is ϖ′, and what a body that curves
//! away leaks round its terminator.
//!
//! Twin of `shaders/multiple.wgsl`. Sources: S. Chandrasekhar, Radiative Transfer, 1960; B. Hapke, "Bidirectional
//! Reflectance Spectroscopy 1", J. Geophys. Res. 86, 1981, and 5, Icarus 157, 2002 (H in closed form).

use super::diffusion::mean_distance_m;
use super::{Layer, medium};
use glam::Vec3;
use std::f32::consts::PI;

/// Share of the light scattered more than once that leaves beyond where it fell, per mean distance over the radius of
/// the body; and how far round the terminator it comes. Fitted to the ball of the reference pictures.
const LEAK: f32 = 1.5;
const AROUND: f32 = 4.0;
/// All of it never leaks.
const LEAK_MAX: f32 = 0.9;

/// What an endless depth of a layer throws back of even light that scatters evenly, r₀ = (1 − γ) / (1 + γ), γ² = 1 − ϖ′.
///
/// ϖ′ = ϖ (1 − g²) / (1 − ϖ g²): a share g² of what is scattered goes on as if it had not been. Against walks of photons
/// in a half-space it is right within a tenth up to k = 0.65 unless light and eye graze.
pub fn reflectance(layer: &Layer) -> Vec3 {
    let g2 = medium::mean_cosine(layer.asymmetry).powi(2);
    let albedo = layer.albedo();
    let similar = albedo * (1.0 - g2) / (1.0 - g2 * albedo);
    let gamma = (1.0 - similar).max(Vec3::ZERO).map(f32::sqrt);
    (1.0 - gamma) / (1.0 + gamma)
}

/// ϖ′ of r₀.
pub fn albedo_of(r0: Vec3) -> Vec3 {
    4.0 * r0 / ((1.0 + r0) * (1.0 + r0))
}

/// Chandrasekhar's H at cosines above 0, within 1 % (Hapke 2002, eq. 13).
pub fn h(cosine: Vec3, r0: Vec3) -> Vec3 {
    let c = cosine.max(Vec3::splat(1e-4));
    let log = ((1.0 + c) / c).map(f32::ln);
    1.0 / (1.0 - albedo_of(r0) * c * (r0 + (0.5 - r0 * c) * log))
}

/// What stands beside albedo times phase function for light that scattered more than once [1/sr].
///
/// `around` softens the light's cosine on bodies that curve away: 0 on flat ones, 1 where all of it comes from anywhere.
pub fn often(cos_light: f32, cos_eye: f32, r0: Vec3, around: Vec3) -> Vec3 {
    let soft = (cos_light + around) / (1.0 + around);
    let both = h(soft, r0) * h(Vec3::splat(cos_eye), r0);
    0.25 / PI * albedo_of(r0) * (both - 1.0)
}

/// What of the light scattered more than once leaves a body elsewhere than where it fell.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Leak {
    /// Share that stays where it fell.
    pub kept: Vec3,
    /// How far round the terminator the rest comes, 0 to 1.
    pub around: Vec3,
    /// Radiance of the rest per irradiance, fully lit [1/sr].
    pub radiance: Vec3,
}

impl Leak {
    /// Of a flat body: none.
    pub const NONE: Self = Self {
        kept: Vec3::ONE,
        around: Vec3::ZERO,
        radiance: Vec3::ZERO,
    };

    /// Of a body of `layer` that is as thick as a ball of `radius_m` [m].
    pub fn of(layer: &Layer, radius_m: f32) -> Self {
        let share = mean_distance_m(layer) / radius_m.max(1e-9);
        let leaks = (LEAK * share).min(Vec3::splat(LEAK_MAX));
        Self {
            kept: 1.0 - leaks,
            around: (AROUND * share).min(Vec3::ONE),
            radiance: leaks * thrown_back(reflectance(layer)) / PI,
        }
    }
}

/// Share of light from everywhere that is thrown back after more than one scattering.
fn thrown_back(r0: Vec3) -> Vec3 {
    let gamma = (1.0 - r0) / (1.0 + r0);
    // Spherical albedo (Hapke 1981), less what is scattered once and evenly, 2/3 (1 − ln 2) ϖ′.
    let all = r0 * (1.0 - gamma / (3.0 * (1.0 + gamma)));
    (all - 0.204_6 * albedo_of(r0)).max(Vec3::ZERO)
}

#[cfg(test)]
#[path = "multiple/tests.rs"]
mod tests;
