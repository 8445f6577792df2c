//! Named tissues: coefficients from published measurements, as layers.
//!
//! Reduced scattering σ_s′ and absorption σ_a at 630, 540 and 450 nm stand for red, green and blue. Absorption is that
//! of the blood in the tissue, and of no other pigment, so it is a lower bound.
//!
//! The march takes a scattering σ_s and Schlick's k. Tissue scatters within a few degrees of straight on (g of 0.9), and
//! what is turned by so little goes on as if it had met nothing. The forward peak, a share g² of all, is therefore
//! counted as light that was not scattered: σ_s = (1 − g²) σ_s′ / (1 − g) = (1 + g) σ_s′, with the mean cosine g / (1 + g).
//!
//! Sources: S. L. Jacques, "Optical properties of biological tissues: a review", Phys. Med. Biol. 58, 2013 (σ_s′, blood
//! volume, g); haemoglobin as compiled by S. Prahl, 150 g a litre of blood; J. H. Joseph, W. J. Wiscombe, J. A. Weinman,
//! "The Delta-Eddington Approximation for Radiative Flux Transfer", J. Atmos. Sci. 33, 1976 (the forward peak).

use super::{Layer, medium};
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// Tissues that are known by name.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum OpticalTissue {
    /// Liver.
    Liver,
    /// Spleen.
    Spleen,
    /// Kidney.
    Kidney,
    /// The muscle of the heart's wall.
    Heart,
    /// Fat.
    Fat,
    /// A vessel full of blood.
    Vessel,
}

/// What was measured of a tissue.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Measured {
    /// σ_s′ [1/cm].
    pub reduced_scattering_per_cm: [f32; 3],
    /// σ_a [1/cm].
    pub absorption_per_cm: [f32; 3],
    /// g.
    pub mean_cosine: f32,
}

impl OpticalTissue {
    /// Every tissue.
    pub const ALL: [Self; 6] = [
        Self::Liver,
        Self::Spleen,
        Self::Kidney,
        Self::Heart,
        Self::Fat,
        Self::Vessel,
    ];

    /// Name in scene files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Liver => "liver",
            Self::Spleen => "spleen",
            Self::Kidney => "kidney",
            Self::Heart => "heart",
            Self::Fat => "fat",
            Self::Vessel => "vessel",
        }
    }

    /// The published numbers; rows are those of Jacques 2013. g is 0.9, which he takes for soft tissue, and 0.98 for blood.
    pub fn measured(self) -> Measured {
        let (reduced_scattering_per_cm, absorption_per_cm, mean_cosine) = match self {
            // Table 1, row 28 (Parsa 1989, rat). Blood is 30 % of the volume, as Alexandrakis 2005 takes it; table 3, row 32
            // (Weaver 1989) has 49.5 %, which is unusually much.
            Self::Liver => ([7.8, 8.6, 9.6], [2.8, 83.0, 117.0], 0.9),
            // Table 1, row 38 (Alexandrakis 2005, liver and spleen), and his 30 % of blood.
            Self::Spleen => ([7.2, 8.5, 10.3], [2.8, 83.0, 117.0], 0.9),
            // Table 1, row 37 (Alexandrakis 2005); table 3, row 22 (Solonenko 2002, dog), 14.6 % of blood.
            Self::Kidney => ([24.8, 31.2, 41.2], [1.4, 40.0, 57.0], 0.9),
            // Table 1, row 36 (Alexandrakis 2005); table 3, row 30 (Weaver 1989), 6.9 % of blood, myoglobin left out.
            Self::Heart => ([10.5, 13.1, 17.0], [0.6, 19.0, 27.0], 0.9),
            // Table 2, mean of six fatty tissues; table 3, row 40 (Weaver 1989, omental fat), 2.6 % of blood.
            Self::Fat => ([15.8, 17.5, 19.7], [0.2, 7.0, 10.0], 0.9),
            // Table 1, row 42 (Alexandrakis 2005); whole blood, three quarters of it with oxygen.
            Self::Vessel => ([18.9, 20.9, 23.6], [9.3, 276.2, 390.6], 0.98),
        };
        Measured {
            reduced_scattering_per_cm,
            absorption_per_cm,
            mean_cosine,
        }
    }

    /// An even layer of it.
    pub fn layer(self) -> Layer {
        const PER_M: f32 = 100.0;
        let measured = self.measured();
        let g = measured.mean_cosine;
        Layer {
            absorption_per_m: PER_M * Vec3::from(measured.absorption_per_cm),
            scattering_per_m: PER_M * (1.0 + g) * Vec3::from(measured.reduced_scattering_per_cm),
            asymmetry: medium::asymmetry_of(g / (1.0 + g)),
        }
    }

    /// The four layers that the maps of an organ tell: its surface, what lies below, its vessels, and what lies below
    /// those. No membrane has been measured, so the surface is the tissue itself.
    pub fn layers(self) -> [Layer; 4] {
        let own = self.layer();
        [own, own, Self::Vessel.layer(), own]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn layers_hold_the_published_numbers_in_metres() {
        let liver = OpticalTissue::Liver.layer();
        assert_eq!(liver.absorption_per_m, Vec3::new(280.0, 8300.0, 11700.0));
        for tissue in OpticalTissue::ALL {
            let (layer, measured) = (tissue.layer(), tissue.measured());
            // What counts deep inside is (1 − g) σ_s, whatever share of the peak is left out.
            let reduced =
                (1.0 - medium::mean_cosine(layer.asymmetry)) * layer.scattering_per_m / 100.0;
            let error = (reduced / Vec3::from(measured.reduced_scattering_per_cm) - 1.0).abs();
            assert!(error.max_element() < 1e-3, "{}: {reduced}", tissue.name());
        }
    }

    #[test]
    fn every_tissue_scatters_blue_most_and_keeps_red_best() {
        for tissue in OpticalTissue::ALL {
            let layer = tissue.layer();
            let (a, s, albedo) = (
                layer.absorption_per_m,
                layer.scattering_per_m,
                layer.albedo(),
            );
            let name = tissue.name();
            assert!(s.x < s.y && s.y < s.z, "{name}: {s}");
            assert!(5.0 * a.x < a.y && a.y < a.z, "{name}: {a}");
            assert!(
                albedo.x > albedo.y && albedo.y >= albedo.z,
                "{name}: {albedo}"
            );
            assert!((0.5..0.75).contains(&layer.asymmetry), "{name}");
        }
        // Fat is the palest, blood the darkest.
        let green = |tissue: OpticalTissue| tissue.layer().albedo().y;
        for tissue in OpticalTissue::ALL {
            assert!(
                green(OpticalTissue::Fat) >= green(tissue),
                "{}",
                tissue.name()
            );
            assert!(
                green(OpticalTissue::Vessel) <= green(tissue),
                "{}",
                tissue.name()
            );
        }
    }

    #[test]
    fn names_are_those_of_scene_files() {
        for tissue in OpticalTissue::ALL {
            let text = serde_json::to_string(&tissue).expect("a name");
            assert_eq!(text, format!("\"{}\"", tissue.name()));
        }
    }
}
