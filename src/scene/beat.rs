//! `[body.beat]`: muscle that shortens, over and over.

use super::body::Region;
use super::check::Checker;
use crate::sim::Beat;
use serde::{Deserialize, Serialize};

/// How a body beats. Tools prod it all the same.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields, default)]
pub struct BeatSection {
    /// Whether it beats; switched off while it runs, it ends the beat that it is in.
    pub runs: bool,
    /// Beats a minute.
    pub rate_per_min: f32,
    /// By how much muscle shortens at most, as a share of its length at rest.
    pub strain: f32,
    /// Where the muscle is. Left out, all of the body is muscle.
    #[serde(skip_serializing_if = "Vec::is_empty")]
    pub muscle: Vec<Region>,
}

impl Default for BeatSection {
    fn default() -> Self {
        Self {
            runs: true,
            rate_per_min: 70.0,
            strain: 0.1,
            muscle: Vec::new(),
        }
    }
}

impl BeatSection {
    /// The beat of a section, if there is one that runs.
    pub fn beat(section: Option<&Self>) -> Option<Beat> {
        section.filter(|section| section.runs).map(|section| Beat {
            rate_per_min: section.rate_per_min,
            strain: section.strain,
        })
    }

    pub(super) fn check(&self, c: &mut Checker) {
        c.range("body.beat.rate_per_min", self.rate_per_min, 1.0, 300.0);
        c.range("body.beat.strain", self.strain, 0.0, 0.3);
        for (index, region) in self.muscle.iter().enumerate() {
            region.check(&format!("body.beat.muscle.{index}"), c);
        }
    }
}
