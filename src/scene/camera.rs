//! `[camera]`: where the scene is seen from.

use super::check::Checker;
use super::place::RestBox;
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// Width over height of the picture that a camera is fitted to.
const ASPECT: f32 = 4.0 / 3.0;

/// A camera that looks at a place of the body.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields, default)]
pub struct CameraSection {
    /// What it looks at, as shares of the body's box.
    pub target_share: Vec3,
    /// From there to the camera; only the direction counts.
    pub direction: Vec3,
    /// Distance between them, in longest extents of the body. Left out, the body's box fills the
    /// picture.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub distance_share: Option<f32>,
    /// What is upwards in the picture.
    pub up: Vec3,
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
            distance_share: None,
            up: Vec3::Y,
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
        let distance_m = rest
            .length(None, self.distance_share)
            .unwrap_or_else(|| self.fitting_distance_m(rest, target, back));
        (target + distance_m * back, target)
    }

    /// Smallest distance [m] at which every corner of `rest` is inside a 4 : 3 picture, with a margin.
    fn fitting_distance_m(&self, rest: &RestBox, target: Vec3, back: Vec3) -> f32 {
        let right = self
            .up
            .cross(back)
            .normalize_or(back.any_orthonormal_vector());
        let up = back.cross(right);
        let half_height = (0.5 * self.fov_y_deg.to_radians()).tan();
        let size = rest.high - rest.low;
        (0..8)
            .map(|corner| {
                let share = Vec3::new(
                    f32::from(corner & 1 != 0),
                    f32::from(corner & 2 != 0),
                    f32::from(corner & 4 != 0),
                );
                let offset = rest.low + share * size - target;
                let needed = (offset.dot(right).abs() / ASPECT).max(offset.dot(up).abs());
                offset.dot(back) + needed / half_height
            })
            .fold(0.0, f32::max)
    }

    pub(super) fn check(&self, c: &mut Checker) {
        c.range("camera.fov_y_deg", self.fov_y_deg, 1.0, 150.0);
        if let Some(distance) = self.distance_share {
            c.range("camera.distance_share", distance, 0.1, 1000.0);
        }
        c.range3("camera.target_share", self.target_share, -100.0, 100.0);
        c.range3("camera.direction", self.direction, -1e6, 1e6);
        if self.direction.length() < 1e-6 {
            c.problem("camera.direction", "it must not be zero");
        }
        c.range3("camera.up", self.up, -1e6, 1e6);
        if self.up.length() < 1e-6 {
            c.problem("camera.up", "it must not be zero");
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

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_camera_without_a_distance_sees_the_whole_box_and_little_more() {
        let rest = RestBox {
            low: Vec3::new(-0.1, 0.0, -0.02),
            high: Vec3::new(0.1, 0.3, 0.08),
        };
        let camera = CameraSection::default();
        let (eye, target) = camera.eye_and_target(&rest);
        let forward = (target - eye).normalize();
        let up_limit = (0.5 * camera.fov_y_deg.to_radians()).tan();
        let mut highest = 0.0_f32;
        for y in [rest.low.y, rest.high.y] {
            for x in [rest.low.x, rest.high.x] {
                for z in [rest.low.z, rest.high.z] {
                    let offset = Vec3::new(x, y, z) - eye;
                    let depth = offset.dot(forward);
                    let side = forward.cross(Vec3::Y).normalize();
                    let up = side.cross(forward);
                    let shares = [
                        offset.dot(up).abs() / (depth * up_limit),
                        offset.dot(side).abs() / (depth * up_limit * ASPECT),
                    ];
                    highest = highest.max(shares[0]).max(shares[1]);
                }
            }
        }
        assert!(
            (0.9..=1.0 + 1e-4).contains(&highest),
            "{highest} of the picture"
        );
    }
}
