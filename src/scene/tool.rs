//! `[[tool]]`: what prods the body, and when.

use super::check::Checker;
use crate::sim::ToolAction;
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// A rigid tool that follows key frames.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct ToolSection {
    /// Name in messages and read-outs.
    #[serde(default, skip_serializing_if = "String::is_empty")]
    pub name: String,
    /// Its form.
    #[serde(default)]
    pub shape: ToolShapeName,
    /// Radius of the sphere, or of the capsule [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius_m: Option<f32>,
    /// The same, as a share of the body's longest extent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub radius_share: Option<f32>,
    /// From the capsule's tip to its other end [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub axis_m: Option<Vec3>,
    /// The same, in longest extents of the body.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub axis_share: Option<Vec3>,
    /// Coulomb friction coefficient.
    #[serde(default)]
    pub friction: f32,
    /// A line to the surface along which keys may give a depth.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub approach: Option<Approach>,
    /// Where the tool is, and what it does, from each time on; in between it moves evenly.
    pub keys: Vec<Key>,
}

/// Forms of a tool.
#[derive(Clone, Copy, Debug, Default, Deserialize, Serialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum ToolShapeName {
    /// A ball.
    #[default]
    Sphere,
    /// A rod with round ends.
    Capsule,
}

/// A ray; where it first meets the surface at rest, the depth is 0.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Approach {
    /// Start, as shares of the body's box.
    pub from_share: Vec3,
    /// A place further on, as shares of the body's box.
    pub toward_share: Vec3,
}

/// A key frame. The place is `at_m`, `at_share`, or a depth along the tool's approach.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Key {
    /// Time from the start of the scene [s].
    pub at_s: f32,
    /// What the tool does from here on; left out, it pushes.
    #[serde(default = "push")]
    pub action: ToolAction,
    /// Middle of the tool [m].
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_m: Option<Vec3>,
    /// The same, as shares of the body's box.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub at_share: Option<Vec3>,
    /// How deep the tool's front is below the surface at rest [m]; negative above it.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth_m: Option<f32>,
    /// The same, as a share of the body's longest extent.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub depth_share: Option<f32>,
    /// Added to the place, in longest extents of the body.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shift_share: Option<Vec3>,
}

fn push() -> ToolAction {
    ToolAction::Push
}

impl ToolSection {
    pub(super) fn check(&self, index: usize, c: &mut Checker) {
        let key = |name: &str| format!("tool.{index}.{name}");
        c.exactly_one(
            &format!("tool.{index}"),
            &[self.radius_m.is_some(), self.radius_share.is_some()],
            "radius_m, radius_share",
        );
        for (name, radius) in [
            ("radius_m", self.radius_m),
            ("radius_share", self.radius_share),
        ] {
            if let Some(radius) = radius {
                c.range(&key(name), radius, 1e-5, 10.0);
            }
        }
        let axes = [self.axis_m.is_some(), self.axis_share.is_some()];
        match self.shape {
            ToolShapeName::Capsule => {
                c.exactly_one(&format!("tool.{index}"), &axes, "axis_m, axis_share");
            }
            ToolShapeName::Sphere if axes != [false, false] => {
                c.problem(
                    &key("shape"),
                    "a sphere has no axis; say shape = \"capsule\"",
                );
            }
            ToolShapeName::Sphere => {}
        }
        for axis in [self.axis_m, self.axis_share].into_iter().flatten() {
            c.range3(&key("axis"), axis, -100.0, 100.0);
        }
        c.range(&key("friction"), self.friction, 0.0, 10.0);
        if self.keys.is_empty() {
            c.problem(&key("keys"), "a tool needs at least one key");
        }
        if let Some(approach) = self.approach {
            c.range3(
                &key("approach.from_share"),
                approach.from_share,
                -100.0,
                100.0,
            );
            c.range3(
                &key("approach.toward_share"),
                approach.toward_share,
                -100.0,
                100.0,
            );
            if approach.from_share == approach.toward_share {
                c.problem(
                    &key("approach"),
                    "from_share and toward_share are the same place",
                );
            }
        }
        for (k, pair) in self.keys.windows(2).enumerate() {
            if pair[1].at_s <= pair[0].at_s {
                c.problem(
                    &key(&format!("keys.{}.at_s", k + 1)),
                    "keys must follow in time",
                );
            }
        }
        for (k, frame) in self.keys.iter().enumerate() {
            let place = key(&format!("keys.{k}"));
            c.range(&format!("{place}.at_s"), frame.at_s, 0.0, 1e6);
            let depths = [frame.depth_m, frame.depth_share];
            c.exactly_one(
                &place,
                &[
                    frame.at_m.is_some(),
                    frame.at_share.is_some(),
                    depths[0].is_some(),
                    depths[1].is_some(),
                ],
                "at_m, at_share, depth_m, depth_share",
            );
            if depths != [None, None] && self.approach.is_none() {
                c.problem(&place, "a depth needs the tool's approach");
            }
            for depth in depths.into_iter().flatten() {
                c.range(&format!("{place}.depth"), depth, -100.0, 100.0);
            }
            for at in [frame.at_m, frame.at_share, frame.shift_share]
                .into_iter()
                .flatten()
            {
                c.range3(&place, at, -1e4, 1e4);
            }
        }
    }
}
