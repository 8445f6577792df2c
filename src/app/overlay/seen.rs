//! Where a place of the scene is in the window, and whether the surface hides it.

use crate::app::AppError;
use crate::app::orbit::Orbit;
use crate::app::renderer::Renderer;
use egui::{Pos2, Rect};
use glam::{Mat4, Vec3};

/// The picture as the camera sees it.
pub struct Seen {
    rect: Rect,
    clip_from_world: Mat4,
    eye: Vec3,
    drawn: Option<Drawn>,
}

/// What is nearest at each pixel.
struct Drawn {
    depths: Vec<f32>,
    size: [u32; 2],
    clip_from_world: Mat4,
    slack_m: f32,
}

impl Seen {
    /// Through everything: nothing is hidden.
    pub fn through(orbit: &Orbit, rect: Rect) -> Self {
        Self {
            rect,
            clip_from_world: orbit.view().clip_from_world(rect.width() / rect.height()),
            eye: orbit.eye(),
            drawn: None,
        }
    }

    /// With what lies more than `slack_m` behind the drawn picture hidden.
    ///
    /// # Errors
    ///
    /// [`AppError::Gpu`] if the depths can't be read back.
    pub fn behind(
        orbit: &Orbit,
        rect: Rect,
        renderer: &Renderer,
        slack_m: f32,
    ) -> Result<Self, AppError> {
        let size = renderer.size();
        Ok(Self {
            drawn: Some(Drawn {
                depths: renderer.depth()?,
                size,
                clip_from_world: orbit
                    .view()
                    .clip_from_world(size[0] as f32 / size[1] as f32),
                slack_m,
            }),
            ..Self::through(orbit, rect)
        })
    }

    /// Where `x` [m] is in the window, in points; nowhere behind the camera.
    pub fn place(&self, x: Vec3) -> Option<Pos2> {
        let clip = self.clip_from_world * x.extend(1.0);
        if clip.w <= 1e-6 {
            return None;
        }
        let share = egui::vec2(0.5 + 0.5 * clip.x / clip.w, 0.5 - 0.5 * clip.y / clip.w);
        let at = self.rect.min + share * self.rect.size();
        at.is_finite().then_some(at)
    }

    /// Whether `x` [m] of a surface with this normal can be seen.
    pub fn shows(&self, x: Vec3, normal: Vec3) -> bool {
        normal.dot(self.eye - x) > 0.0
            && self
                .drawn
                .as_ref()
                .is_none_or(|drawn| drawn.shows(x, self.eye))
    }
}

impl Drawn {
    fn shows(&self, x: Vec3, eye: Vec3) -> bool {
        // A little nearer than it is: hidden is what even then lies behind the picture.
        let nearer = x + self.slack_m * (eye - x).normalize_or_zero();
        let clip = self.clip_from_world * nearer.extend(1.0);
        if clip.w <= 1e-6 {
            return false;
        }
        let [width, height] = self.size;
        let column = (0.5 + 0.5 * clip.x / clip.w) * width as f32;
        let row = (0.5 - 0.5 * clip.y / clip.w) * height as f32;
        let inside = (0.0..width as f32).contains(&column) && (0.0..height as f32).contains(&row);
        inside && clip.z / clip.w <= self.depths[row as usize * width as usize + column as usize]
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use egui::pos2;

    fn orbit() -> Orbit {
        Orbit::new(Vec3::new(0.0, 0.0, 2.0), Vec3::ZERO, Vec3::Y, 0.6)
    }

    #[test]
    fn the_target_is_in_the_middle_and_what_is_behind_the_camera_nowhere() {
        let rect = Rect::from_min_max(pos2(10.0, 20.0), pos2(210.0, 120.0));
        let seen = Seen::through(&orbit(), rect);
        let middle = seen.place(Vec3::ZERO).expect("it is before the camera");
        assert!((middle - pos2(110.0, 70.0)).length() < 1e-3, "{middle}");
        assert!(seen.place(0.1 * Vec3::Y).expect("before it").y < 69.0);
        assert_eq!(seen.place(3.0 * Vec3::Z), None);
        assert!(seen.shows(Vec3::ZERO, Vec3::Z) && !seen.shows(Vec3::ZERO, Vec3::NEG_Z));
    }

    #[test]
    fn what_lies_behind_the_picture_is_hidden() {
        let clip_from_world = orbit().view().clip_from_world(1.0);
        // A wall at z = 0.5.
        let depth = clip_from_world.project_point3(0.5 * Vec3::Z).z;
        let drawn = Drawn {
            depths: vec![depth; 16],
            size: [4, 4],
            clip_from_world,
            slack_m: 0.01,
        };
        let eye = orbit().eye();
        for (z, is_seen) in [(0.6, true), (0.495, true), (0.48, false), (0.0, false)] {
            assert_eq!(drawn.shows(z * Vec3::Z, eye), is_seen, "at {z} m");
        }
        assert!(!drawn.shows(5.0 * Vec3::X, eye), "beside the picture");
    }
}
