//! `[[light]]`: what lights the scene.

use super::check::Checker;
use super::place::RestBox;
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// Lights a scene may have: what the shaders have room for.
pub const LIGHTS_MAX: usize = 4;

/// A directional or a point light; exactly one of the forms.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct LightSection {
    /// A light far away: the direction from the scene to it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub toward: Option<Vec3>,
    /// A light in the scene [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_m: Option<Vec3>,
    /// The same, as shares of the body's box.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_share: Option<Vec3>,
    /// Irradiance on a plane that faces the light [W/m²], red, green, blue; of a point light at the
    /// distance of the body's longest extent, so that a script lights organs of any size alike.
    pub irradiance_w_m2: [f32; 3],
    /// Whether it casts shadows. At most one light may.
    #[serde(default)]
    pub shadow: bool,
}

/// A light as the shaders take it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PlacedLight {
    /// Unit direction to a far light, or the place of a near one [m].
    pub place: Vec3,
    /// Whether `place` is a place.
    pub is_point: bool,
    /// Irradiance [W/m²] of a far light; of a near one intensity [W/sr].
    pub power: Vec3,
    /// Whether it casts shadows.
    pub shadow: bool,
}

/// A warm lamp above, and a cooler one from behind the other side.
pub(super) fn default_lights() -> Vec<LightSection> {
    vec![
        LightSection {
            toward: Some(Vec3::new(-0.45, 0.75, 0.6)),
            at_m: None,
            at_share: None,
            irradiance_w_m2: [3.3, 3.15, 2.95],
            shadow: true,
        },
        LightSection {
            toward: Some(Vec3::new(0.85, 0.25, -0.6)),
            at_m: None,
            at_share: None,
            irradiance_w_m2: [1.3, 1.45, 1.7],
            shadow: false,
        },
    ]
}

impl LightSection {
    /// Direction or place, and power, for a body that fills `rest`.
    pub fn placed(&self, rest: &RestBox) -> PlacedLight {
        let irradiance = Vec3::from_array(self.irradiance_w_m2);
        match rest.place(self.at_m, self.at_share) {
            Some(place) => PlacedLight {
                place,
                is_point: true,
                power: irradiance * rest.longest_m() * rest.longest_m(),
                shadow: false,
            },
            None => PlacedLight {
                place: self.toward.unwrap_or(Vec3::Y).normalize_or(Vec3::Y),
                is_point: false,
                power: irradiance,
                shadow: self.shadow,
            },
        }
    }

    pub(super) fn check(&self, index: usize, c: &mut Checker) {
        let key = format!("light.{index}");
        c.exactly_one(
            &key,
            &[
                self.toward.is_some(),
                self.at_m.is_some(),
                self.at_share.is_some(),
            ],
            "toward, at_m, at_share",
        );
        if index >= LIGHTS_MAX {
            c.problem(&key, &format!("a scene has at most {LIGHTS_MAX} lights"));
        }
        c.range3(
            &format!("{key}.irradiance_w_m2"),
            self.irradiance_w_m2,
            0.0,
            1e6,
        );
        for place in [self.toward, self.at_m, self.at_share]
            .into_iter()
            .flatten()
        {
            c.range3(&key, place, -1e6, 1e6);
        }
        if self.toward.is_some_and(|d| d.length() < 1e-6) {
            c.problem(&format!("{key}.toward"), "it must not be zero");
        }
        if self.shadow && self.toward.is_none() {
            c.problem(
                &format!("{key}.shadow"),
                "only a far light (toward) casts shadows",
            );
        }
    }
}
