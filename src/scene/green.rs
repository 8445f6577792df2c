//! Knobs of the surfaces after Green (2004): wrapped light, absorption by depth maps, diffusion in texture space.

use super::check::Checker;
use crate::optics::LAYERS;
use serde::{Deserialize, Serialize};
use std::path::PathBuf;

/// Samples of a disc that the shader has room for.
pub const DISC_SAMPLES_MAX: u32 = 32;

/// `[surface.lookup]`: the table of `wrap`, over N·L and N·H (Green 2004, listing 16-1).
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields, default)]
pub struct LookupSection {
    /// Width of the band past the terminator in which the light changes its colour, in units of wrapped light.
    pub scatter_width: f32,
    /// What is added in the middle of that band: red, green, blue.
    pub scatter_color: [f32; 3],
    /// Exponent of the highlight that alpha holds.
    pub shininess: f32,
    /// Whether wrapped light, with its colour shift, sums up over a sphere to what falls on it, and a highlight to
    /// what a wet film throws back. Off, both are as the listing has them.
    pub conserves_energy: bool,
}

impl Default for LookupSection {
    fn default() -> Self {
        Self {
            scatter_width: 0.3,
            scatter_color: [0.15, 0.02, 0.01],
            shininess: 500.0,
            conserves_energy: true,
        }
    }
}

impl LookupSection {
    pub(super) fn check(&self, c: &mut Checker) {
        c.range(
            "surface.lookup.scatter_width",
            self.scatter_width,
            0.01,
            1.0,
        );
        c.range3(
            "surface.lookup.scatter_color",
            self.scatter_color,
            0.0,
            10.0,
        );
        c.range("surface.lookup.shininess", self.shininess, 1.0, 2000.0);
    }
}

/// How light dies away on its way through the body.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum Falloff {
    /// exp(−σ s), with the diffuse attenuation of the deepest layer.
    #[default]
    Exp,
    /// By a row of colours over the distance, made from all layers or read from a picture.
    Ramp,
}

/// `[surface.absorption]`: light that comes through the body, by depth maps of the lights (Green 2004, 16.3).
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields, default)]
pub struct AbsorptionSection {
    /// How light dies away.
    pub falloff: Falloff,
    /// A picture whose first row is the colour left after a way of 0 (left) to `ramp_length_m` (right), sRGB. Left
    /// out, the row is made from the layers.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub ramp: Option<PathBuf>,
    /// Length of way that the ramp ends at [m].
    pub ramp_length_m: f32,
    /// Share of the straight way that counts: diffuse light finds a shorter one round a limb.
    pub way_share: f32,
    /// Share of a light that comes through a body without absorption.
    pub glow: f32,
    /// Looks into the depth map, on a disc.
    pub samples: u32,
    /// Radius of that disc [m].
    pub disc_radius_m: f32,
    /// 1: all between the first entry and the place counts as tissue. 2: a gap between two parts counts as air.
    pub depth_layers: u32,
    /// How far vertices are pushed out along their normals for the maps, so that no empty texel lies on the body [m].
    pub grow_m: f32,
}

impl Default for AbsorptionSection {
    fn default() -> Self {
        Self {
            falloff: Falloff::default(),
            ramp: None,
            ramp_length_m: 0.04,
            way_share: 0.5,
            glow: 0.35,
            samples: 4,
            disc_radius_m: 0.002,
            depth_layers: 1,
            grow_m: 0.0005,
        }
    }
}

impl AbsorptionSection {
    pub(super) fn check(&self, c: &mut Checker) {
        for (name, value, low, high) in [
            ("ramp_length_m", self.ramp_length_m, 1e-5, 10.0),
            ("way_share", self.way_share, 0.0, 10.0),
            ("glow", self.glow, 0.0, 1.0),
            ("samples", self.samples as f32, 1.0, DISC_SAMPLES_MAX as f32),
            ("disc_radius_m", self.disc_radius_m, 0.0, 0.1),
            ("depth_layers", self.depth_layers as f32, 1.0, 2.0),
            ("grow_m", self.grow_m, 0.0, 0.1),
        ] {
            c.range(&format!("surface.absorption.{name}"), value, low, high);
        }
    }
}

/// Where the narrowest of the three Gaussians is found.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum DiffusionCore {
    /// Lit at the pixel: on an organ it is narrower than a texel, and two blurs are saved.
    #[default]
    Pixel,
    /// Blurred in the light map like the others, as far as its texels are fine enough.
    Map,
}

/// `[surface.diffusion]`: a light map in texture space, blurred by as much as light wanders (Green 2004, 16.4).
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields, default)]
pub struct DiffusionSection {
    /// The layer whose coefficients say how far light wanders, 1 to 4.
    pub layer: u32,
    /// Multiplies all widths.
    pub radius_scale: f32,
    /// Where the narrowest Gaussian is found.
    pub core: DiffusionCore,
    /// Power of the colour map that is taken into the light map, and so is blurred too: 0 none, 1 all.
    pub color_in_map: f32,
    /// Strength of light that comes through the body, by `[surface.absorption]`; 0 leaves its passes out.
    pub translucency: f32,
}

impl Default for DiffusionSection {
    fn default() -> Self {
        Self {
            layer: 2,
            radius_scale: 1.0,
            core: DiffusionCore::default(),
            color_in_map: 0.0,
            translucency: 0.0,
        }
    }
}

impl DiffusionSection {
    pub(super) fn check(&self, c: &mut Checker) {
        for (name, value, low, high) in [
            ("layer", self.layer as f32, 1.0, LAYERS as f32),
            ("radius_scale", self.radius_scale, 0.0, 100.0),
            ("color_in_map", self.color_in_map, 0.0, 1.0),
            ("translucency", self.translucency, 0.0, 10.0),
        ] {
            c.range(&format!("surface.diffusion.{name}"), value, low, high);
        }
    }
}
