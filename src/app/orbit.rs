//! The window's camera: it orbits a place, and turns a cursor into a ray.

use crate::passes::view::View;
use crate::scene::{CameraSection, RestBox};
use glam::{Quat, Vec2, Vec3};

/// How steeply a camera looks up or down at most [rad]: short of the poles, where up is undefined.
const PITCH_MAX: f32 = 1.5;

/// How many times further back a camera stands where the picture is narrower than it is meant for, 4 : 3.
fn moved_back(aspect: f32) -> f32 {
    (4.0 / 3.0 / aspect).max(1.0)
}

/// A half-line in the scene.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where it starts [m].
    pub origin: Vec3,
    /// Unit direction.
    pub direction: Vec3,
}

/// Sides that a body is looked at from.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Side {
    /// Against the direction that a camera without other words looks in.
    Front,
    /// From its right.
    Right,
    /// From above.
    Top,
    /// As now.
    Kept,
}

/// A camera that looks at a place from a distance.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Orbit {
    /// What it looks at [m].
    pub target: Vec3,
    /// Distance to it [m].
    pub distance_m: f32,
    /// Unit vector upwards.
    pub up: Vec3,
    /// Angle about the vertical; 0 looks along −z where y is up [rad].
    pub yaw: f32,
    /// Angle above the horizon [rad].
    pub pitch: f32,
    /// Vertical view angle [rad].
    pub fov_y: f32,
}

impl Orbit {
    /// The orbit of a camera at `eye` that looks at `target`, with `up` upwards in the picture.
    pub fn new(eye: Vec3, target: Vec3, up: Vec3, fov_y: f32) -> Self {
        let up = up.normalize_or(Vec3::Y);
        let back = Quat::from_rotation_arc(up, Vec3::Y) * (eye - target);
        let distance_m = back.length();
        Self {
            target,
            distance_m,
            up,
            yaw: back.x.atan2(back.z),
            pitch: (back.y / distance_m).clamp(-1.0, 1.0).asin(),
            fov_y,
        }
    }

    /// Where the camera is [m].
    pub fn eye(&self) -> Vec3 {
        self.target + self.distance_m * self.back()
    }

    /// Unit direction from what it looks at to the camera.
    fn back(&self) -> Vec3 {
        let (sin_yaw, cos_yaw) = self.yaw.sin_cos();
        let (sin_pitch, cos_pitch) = self.pitch.sin_cos();
        let back = Vec3::new(cos_pitch * sin_yaw, sin_pitch, cos_pitch * cos_yaw);
        Quat::from_rotation_arc(Vec3::Y, self.up) * back
    }

    /// Unit direction to the right of the picture.
    pub fn right(&self) -> Vec3 {
        self.up.cross(self.back()).normalize_or(Vec3::X)
    }

    /// The camera as the passes take it.
    pub fn view(&self) -> View {
        View {
            eye: self.eye(),
            target: self.target,
            up: self.up,
            fov_y: self.fov_y,
        }
    }

    /// All of a body in a box, from one side, in a picture of this width over height.
    pub fn seen_from(&self, side: Side, body: &RestBox, aspect: f32) -> Self {
        let half_turn = std::f32::consts::PI;
        let (yaw, pitch) = match side {
            Side::Front => (0.0, 0.0),
            Side::Right => (0.5 * half_turn, 0.0),
            Side::Top => (0.0, PITCH_MAX),
            Side::Kept => (self.yaw, self.pitch),
        };
        let turned = Self {
            yaw,
            pitch,
            ..*self
        };
        let camera = CameraSection {
            direction: turned.back(),
            up: self.up,
            fov_y_deg: self.fov_y.to_degrees(),
            ..CameraSection::default()
        };
        let (eye, target) = camera.eye_and_target(body);
        Self {
            target,
            distance_m: eye.distance(target),
            ..turned
        }
        .fitted(aspect)
    }

    /// What a scene says of this camera, as seen in a picture of this width over height.
    pub fn section(&self, aspect: f32) -> CameraSection {
        let meant = Self {
            distance_m: self.distance_m / moved_back(aspect),
            ..*self
        };
        CameraSection {
            eye_m: Some(meant.eye()),
            target_m: Some(self.target),
            up: self.up,
            fov_y_deg: self.fov_y.to_degrees(),
            ..CameraSection::default()
        }
    }

    /// Turns by a mouse movement in shares of the window's height.
    pub fn turn(&mut self, by: Vec2) {
        self.yaw -= 3.5 * by.x;
        self.pitch = (self.pitch + 3.5 * by.y).clamp(-PITCH_MAX, PITCH_MAX);
    }

    /// Moves the target sideways by a mouse movement in shares of the window's height.
    pub fn pan(&mut self, by: Vec2) {
        let forward = (self.target - self.eye()).normalize_or(Vec3::NEG_Z);
        let right = forward.cross(self.up).normalize_or(Vec3::X);
        let up = right.cross(forward);
        let metres = 2.0 * self.distance_m * (0.5 * self.fov_y).tan();
        self.target += metres * (up * by.y - right * by.x);
    }

    /// Comes nearer by wheel notches; `body_m` bounds the distance.
    pub fn zoom(&mut self, notches: f32, body_m: f32) {
        self.distance_m =
            (self.distance_m * (-0.12 * notches).exp()).clamp(0.3 * body_m, 20.0 * body_m);
    }

    /// The same view from further back where the picture is narrower than it is meant for (4 : 3), so that its
    /// sides are not cut off.
    pub fn fitted(&self, aspect: f32) -> Self {
        Self {
            distance_m: self.distance_m * moved_back(aspect),
            ..*self
        }
    }

    /// The ray through a place of the picture: (0, 0) is its top left corner, (1, 1) its bottom right.
    pub fn ray(&self, at: Vec2, aspect: f32) -> Ray {
        let eye = self.eye();
        let world_from_view =
            glam::camera::rh::view::look_at_mat4(eye, self.target, self.up).inverse();
        let half_height = (0.5 * self.fov_y).tan();
        let in_view = Vec3::new(
            (2.0 * at.x - 1.0) * half_height * aspect,
            (1.0 - 2.0 * at.y) * half_height,
            -1.0,
        );
        Ray {
            origin: eye,
            direction: world_from_view
                .transform_vector3(in_view)
                .normalize_or(Vec3::NEG_Z),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn orbit() -> Orbit {
        orbit_with(Vec3::Y)
    }

    fn orbit_with(up: Vec3) -> Orbit {
        Orbit::new(Vec3::new(1.0, 2.0, 3.0), Vec3::new(0.0, 0.5, 0.0), up, 0.6)
    }

    #[test]
    fn an_orbit_is_where_it_was_made() {
        for up in [Vec3::Y, Vec3::Z, Vec3::NEG_Y, Vec3::new(2.0, 1.0, -1.0)] {
            let eye = orbit_with(up).eye();
            assert!((eye - Vec3::new(1.0, 2.0, 3.0)).length() < 1e-5, "{up}");
        }
    }

    #[test]
    fn tilting_the_mouse_goes_towards_what_is_up() {
        let mut orbit = orbit_with(Vec3::Z);
        let before = orbit.eye();
        orbit.turn(Vec2::new(0.0, 0.05));
        assert!(orbit.eye().z > before.z + 0.1);
    }

    #[test]
    fn the_ray_through_the_middle_meets_the_target() {
        let ray = orbit().ray(Vec2::splat(0.5), 4.0 / 3.0);
        let to_target = (orbit().target - ray.origin).normalize();
        assert!(ray.direction.dot(to_target) > 1.0 - 1e-5, "{ray:?}");
    }

    #[test]
    fn a_corner_ray_leaves_by_half_the_view_angle() {
        let straight = orbit().ray(Vec2::splat(0.5), 1.0).direction;
        let top = orbit().ray(Vec2::new(0.5, 0.0), 1.0).direction;
        assert!((straight.angle_between(top) - 0.3).abs() < 1e-4);
    }

    #[test]
    fn a_narrow_picture_is_seen_from_further_back() {
        assert_eq!(orbit().fitted(4.0 / 3.0), orbit());
        assert_eq!(orbit().fitted(2.0), orbit());
        let narrow = orbit().fitted(2.0 / 3.0);
        assert!((narrow.distance_m - 2.0 * orbit().distance_m).abs() < 1e-5);
    }

    #[test]
    fn each_side_shows_all_of_the_body_from_where_it_says() {
        let body = RestBox {
            low: Vec3::new(-0.1, 0.0, -0.02),
            high: Vec3::new(0.1, 0.3, 0.08),
        };
        for (side, from) in [
            (Side::Front, Vec3::Z),
            (Side::Right, Vec3::X),
            (Side::Top, Vec3::Y),
        ] {
            let seen = orbit().seen_from(side, &body, 1.0);
            assert!(seen.back().dot(from) > 0.99, "{side:?}: {}", seen.back());
            let clip_from_world = seen.view().clip_from_world(1.0);
            for corner in 0..8_u32 {
                let share = Vec3::from_array([0, 1, 2].map(|k| ((corner >> k) & 1) as f32));
                let place =
                    clip_from_world.project_point3(body.low + share * (body.high - body.low));
                assert!(
                    place.x.abs() <= 1.0 && place.y.abs() <= 1.0,
                    "{side:?}: {place}"
                );
            }
        }
        let kept = orbit().seen_from(Side::Kept, &body, 1.0);
        assert_eq!((kept.yaw, kept.pitch), (orbit().yaw, orbit().pitch));
    }

    #[test]
    fn a_saved_camera_is_the_same_when_it_is_read_in_a_picture_of_any_shape() {
        let body = RestBox {
            low: Vec3::ZERO,
            high: Vec3::ONE,
        };
        for aspect in [0.5, 4.0 / 3.0, 2.5] {
            let camera = orbit().section(aspect);
            let (eye, target) = camera.eye_and_target(&body);
            let fov = camera.fov_y_deg.to_radians();
            let read = Orbit::new(eye, target, camera.up, fov).fitted(aspect);
            assert!((read.eye() - orbit().eye()).length() < 1e-5, "{aspect}");
            assert!((read.fov_y - orbit().fov_y).abs() < 1e-6);
        }
    }

    #[test]
    fn turning_keeps_the_distance_and_stays_off_the_poles() {
        let mut orbit = orbit();
        let distance_m = orbit.distance_m;
        orbit.turn(Vec2::new(0.3, 9.0));
        assert!((orbit.eye().distance(orbit.target) - distance_m).abs() < 1e-5);
        assert_eq!(orbit.pitch, PITCH_MAX);
    }
}
