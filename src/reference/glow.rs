//! Light scattered once in one even tissue, summed in f64 along a view ray of given light ways.
//!
//! `L = σ_s / 4π Σ exp(-σ_t (t_i + s_i)) Δt` for a unit irradiance, with t the way from the eye's side and s the
//! way to the light: the same samples for a method and for the truth, so that they differ by the ways alone.
//! Source: François et al., "Subsurface Texture Mapping", INRIA 2006, eq. 4, in one layer.

use glam::DVec3;
use std::f64::consts::PI;

/// One even tissue; red, green, blue.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct EvenTissue {
    /// σ_s [1/m].
    pub scattering_per_m: DVec3,
    /// σ_t [1/m].
    pub extinction_per_m: DVec3,
}

impl EvenTissue {
    /// Radiance [1/sr] per irradiance of light that scatters within `step_m` round a place `t_m` below the eye's
    /// entry, with a way of `way_m` to the light; none where no light comes.
    pub fn glow(&self, t_m: f64, way_m: Option<f64>, step_m: f64) -> DVec3 {
        way_m.map_or(DVec3::ZERO, |s| {
            let left = (-self.extinction_per_m * (t_m + s)).exp();
            self.scattering_per_m * left * (step_m / (4.0 * PI))
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn glow_of_a_slab_sums_to_its_closed_form() {
        let tissue = EvenTissue {
            scattering_per_m: DVec3::new(120.0, 800.0, 1000.0),
            extinction_per_m: DVec3::new(200.0, 900.0, 1500.0),
        };
        // Seen from straight above, lit at 60 degrees: s = 2 t, L = σ_s / 4π (1 - exp(-3 σ_t T)) / (3 σ_t).
        let (depth, steps) = (0.004, 4000);
        let step = depth / f64::from(steps);
        let sum: DVec3 = (0..steps)
            .map(|i| (f64::from(i) + 0.5) * step)
            .map(|t| tissue.glow(t, Some(2.0 * t), step))
            .sum();
        let way = 3.0 * tissue.extinction_per_m;
        let closed = tissue.scattering_per_m / (4.0 * PI) * (1.0 - (-way * depth).exp()) / way;
        // The midpoint rule errs by (σ_t Δt)²/24, 1e-6 here.
        assert!(
            (sum / closed - 1.0).abs().max_element() < 2e-6,
            "{sum} and {closed}"
        );
        assert_eq!(tissue.glow(0.001, None, step), DVec3::ZERO);
    }
}
