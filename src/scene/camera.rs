//! `[camera]`: where the scene is seen from.

use super::check::Checker;
use super::place::RestBox;
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// A camera that looks at a place of the body.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields, default)]
pub struct CameraSection {
    /// What it looks at, as shares of the body's box.
    pub target_share: Vec3,
    /// From there to the camera; only the direction counts.
    pub direction: Vec3,
    /// Distance between them, in longest extents of the body.
    pub distance_share: f32,
    /// Vertical view angle.
    pub fov_y_deg: f32,
    /// Instead of target and direction: where the camera is [m].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub eye_m: Option<Vec3>,
    /// With it: what it looks at [m].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub target_m: Option<Vec3>,
}

impl Default for CameraSection {
    fn default() -> Self {
        Self {
            target_share: Vec3::splat(0.5),
            direction: Vec3::new(0.1, 0.28, 1.0),
            distance_share: 1.75,
            fov_y_deg: 30.0,
            eye_m: None,
            target_m: None,
        }
    }
}

impl CameraSection {
    /// Camera and what it looks at [m], for a body that fills `rest`.
    pub fn eye_and_target(&self, rest: &RestBox) -> (Vec3, Vec3) {
        if let (Some(eye), Some(target)) = (self.eye_m, self.target_m) {
            return (eye, target);
        }
        let target = rest
            .place(None, Some(self.target_share))
            .expect("a share was given");
        let back = self.direction.normalize_or(Vec3::Z);
        (
            target + self.distance_share * rest.longest_m() * back,
            target,
        )
    }

    pub(super) fn check(&self, c: &mut Checker) {
        c.range("camera.fov_y_deg", self.fov_y_deg, 1.0, 150.0);
        c.range("camera.distance_share", self.distance_share, 0.1, 1000.0);
        c.range3("camera.target_share", self.target_share, -100.0, 100.0);
        c.range3("camera.direction", self.direction, -1e6, 1e6);
        if self.direction.length() < 1e-6 {
            c.problem("camera.direction", "it must not be zero");
        }
        if self.eye_m.is_some() != self.target_m.is_some() {
            c.problem("camera", "eye_m and target_m go together");
        }
        for place in [self.eye_m, self.target_m].into_iter().flatten() {
            c.range3("camera.eye_m and target_m", place, -1e6, 1e6);
        }
        if self.eye_m.is_some() && self.eye_m == self.target_m {
            c.problem("camera", "eye_m and target_m are the same place");
        }
    }
}
