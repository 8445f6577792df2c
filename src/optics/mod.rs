//! Light in layers of tissue, as pure functions: the CPU twins of the shading, and closed forms to test both.
//!
//! Directions point away from the place that scatters: `to_light` to the light, `to_eye` to the eye.

pub mod absorption;
pub mod blur;
pub mod closed_form;
pub mod diffusion;
pub mod film;
pub mod layers;
pub mod light_entry;
pub mod light_plane;
pub mod light_quadric;
pub mod march;
pub mod medium;
pub mod multiple;
pub mod noise;
pub mod pack;
#[cfg(test)]
mod photon;
pub mod stack;
mod tissue;
pub mod tone;
pub mod wrap_lookup;

pub use tissue::{Measured, OpticalTissue};

use glam::Vec3;

/// Layers that one RGBA texture holds.
pub const LAYERS: usize = 4;

/// Layers that the shaders have room for: of two textures.
pub const LAYERS_MAX: usize = 8;

/// One layer of tissue; red, green, blue.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Layer {
    /// σ_a [1/m].
    pub absorption_per_m: Vec3,
    /// σ_s [1/m].
    pub scattering_per_m: Vec3,
    /// Schlick's k: above 0 light is scattered forwards.
    pub asymmetry: f32,
}

impl Layer {
    /// σ_t = σ_a + σ_s [1/m].
    pub fn extinction_per_m(&self) -> Vec3 {
        self.absorption_per_m + self.scattering_per_m
    }

    /// ϖ = σ_s / σ_t.
    pub fn albedo(&self) -> Vec3 {
        self.scattering_per_m / self.extinction_per_m().max(Vec3::splat(1e-9))
    }

    /// How fast diffuse light dies away deep inside [1/m]: √(3 σ_a (σ_a + (1 − g) σ_s)).
    ///
    /// Source: Jensen et al., "A Practical Model for Subsurface Light Transport", SIGGRAPH 2001, with g the
    /// mean cosine of Schlick's phase function.
    pub fn diffuse_attenuation_per_m(&self) -> Vec3 {
        let reduced = (1.0 - medium::mean_cosine(self.asymmetry)) * self.scattering_per_m;
        let absorption = self.absorption_per_m;
        (3.0 * absorption * (absorption + reduced)).map(f32::sqrt)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn diffuse_light_dies_faster_the_more_is_absorbed_and_slower_the_more_goes_forwards() {
        let attenuation = |absorption: f32, asymmetry: f32| {
            Layer {
                absorption_per_m: Vec3::splat(absorption),
                scattering_per_m: Vec3::splat(1000.0),
                asymmetry,
            }
            .diffuse_attenuation_per_m()
            .x
        };
        assert!(attenuation(20.0, 0.0) > attenuation(10.0, 0.0));
        assert!(attenuation(10.0, 0.8) < attenuation(10.0, 0.0));
        // √(3 · 10 · 1010)
        assert!((attenuation(10.0, 0.0) - 174.069).abs() < 0.01);
    }
}
