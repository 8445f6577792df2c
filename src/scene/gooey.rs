//! Choices of the surfaces after Oat (2006) and Norberg (2010): inner layers, their light and blur; noise.

use serde::{Deserialize, Serialize};

/// Inner layers of the gooey surface, at most.
pub const INNER_MAX: usize = 4;

/// One inner layer of the gooey surface. All share the inner map, each at its own depth.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields, default)]
pub struct InnerSection {
    /// How far below the surface it lies, in multiples of `surface.layer_distance_m`.
    pub distance: f32,
    /// Multiplies the opacity of the inner map; the deepest layer is opaque all the same.
    pub opacity: f32,
    /// Multiplies the colour of the inner map, red, green, blue.
    pub color: [f32; 3],
}

impl Default for InnerSection {
    fn default() -> Self {
        Self {
            distance: 1.0,
            opacity: 1.0,
            color: [1.0; 3],
        }
    }
}

/// How the colour of an inner layer is blurred on its way to the eye.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum InnerTaps {
    /// Not at all.
    One,
    /// By three taps about the place.
    #[default]
    Three,
    /// By the growable disc (Oat 2006, 4.5).
    Disc,
}

/// What lights the inner layers of the gooey surface.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum InnerLight {
    /// The light map, blurred.
    #[default]
    Map,
    /// The mean over the bumps of the normal map (the first cheaper variant of Oat 2006, 4.6).
    NormalMap,
    /// The smooth normal (the second).
    SmoothNormal,
}

/// What moves the places where the march reads the layers.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum Noise {
    /// Nothing.
    #[default]
    None,
    /// Difference clouds on the surface, read several times over (Norberg 2010, 3.1.2).
    Clouds,
    /// Interleaved gradients on the picture (Jimenez 2014): neighbours differ as much as they can.
    Gradient,
}
