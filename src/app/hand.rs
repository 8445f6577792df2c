//! The user's hand: from the mouse to a tool in the scene.
//!
//! A press on the organ sets the tool on the spot that was hit. While the button is held the tool follows
//! the cursor in the plane through that spot that faces the viewer, and a push sinks in at a steady
//! speed until it has reached its depth: no press, however sudden, is a jump.

use super::orbit::Ray;
use crate::geom::ray::first_hit;
use crate::sim::{ToolAction, ToolInput, ToolShape};
use glam::Vec3;

/// How a hand prods. Lengths in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct HandKnobs {
    /// Radius of the ball.
    pub radius_m: f32,
    /// How deep a push sinks below the spot that was hit.
    pub depth_m: f32,
    /// How fast it sinks.
    pub speed_m_s: f32,
    /// Coulomb friction.
    pub friction: f32,
}

impl HandKnobs {
    /// Knobs that suit a body of this size.
    pub fn for_size(longest_m: f32) -> Self {
        Self {
            radius_m: 0.05 * longest_m,
            depth_m: 0.08 * longest_m,
            speed_m_s: 0.4 * longest_m,
            friction: 0.3,
        }
    }
}

/// A drag that is going on.
#[derive(Clone, Copy, Debug)]
pub struct Hand {
    action: ToolAction,
    /// What was hit [m].
    spot_m: Vec3,
    /// Viewing direction at the press: the way a push sinks.
    forward: Vec3,
    /// How deep the tool's front is [m]; below 0 it has not touched yet.
    sunk_m: f32,
}

impl Hand {
    /// A press: `None` if the ray misses the organ.
    pub fn press(
        action: ToolAction,
        ray: Ray,
        points: &[Vec3],
        triangles: &[[u32; 3]],
    ) -> Option<Self> {
        let hit = first_hit(ray.origin, ray.direction, points, triangles)?;
        Some(Self {
            action,
            spot_m: ray.origin + hit.distance * ray.direction,
            forward: ray.direction,
            sunk_m: 0.0,
        })
    }

    /// The cursor moved: the tool follows in the plane through the spot.
    pub fn drag(&mut self, ray: Ray) {
        let along = ray.direction.dot(self.forward);
        if along > 1e-3 {
            let distance = (self.spot_m - ray.origin).dot(self.forward) / along;
            self.spot_m = ray.origin + distance * ray.direction;
        }
    }

    /// `seconds` went by: a push comes nearer to its depth, from above or from below.
    pub fn sink(&mut self, knobs: &HandKnobs, seconds: f32) {
        let way_m = knobs.speed_m_s * seconds;
        self.sunk_m += (knobs.depth_m - self.sunk_m).clamp(-way_m, way_m);
    }

    /// How deep a push is below the spot that was hit [m]; nothing for a grab.
    pub fn depth_m(&self) -> Option<f32> {
        (self.action == ToolAction::Push).then_some(self.sunk_m)
    }

    /// The tool as it is now.
    pub fn tool(&self, knobs: &HandKnobs) -> ToolInput {
        let position_m = match self.action {
            ToolAction::Push => self.spot_m + (self.sunk_m - knobs.radius_m) * self.forward,
            _ => self.spot_m,
        };
        ToolInput {
            shape: ToolShape::Sphere {
                radius_m: knobs.radius_m,
            },
            position_m,
            action: self.action,
            friction: knobs.friction,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const POINTS: [Vec3; 3] = [
        Vec3::new(-1.0, -1.0, 0.0),
        Vec3::new(1.0, -1.0, 0.0),
        Vec3::new(0.0, 1.0, 0.0),
    ];
    const KNOBS: HandKnobs = HandKnobs {
        radius_m: 0.1,
        depth_m: 0.05,
        speed_m_s: 0.1,
        friction: 0.0,
    };

    fn ray(x: f32) -> Ray {
        Ray {
            origin: Vec3::new(x, 0.0, 2.0),
            direction: Vec3::NEG_Z,
        }
    }

    fn press(action: ToolAction) -> Hand {
        Hand::press(action, ray(0.0), &POINTS, &[[0, 1, 2]]).expect("the triangle is hit")
    }

    #[test]
    fn a_push_starts_touching_and_sinks_no_deeper_than_its_depth() {
        let mut hand = press(ToolAction::Push);
        assert!((hand.tool(&KNOBS).position_m.z - 0.1).abs() < 1e-6);
        hand.sink(&KNOBS, 0.1);
        assert!((hand.tool(&KNOBS).position_m.z - 0.09).abs() < 1e-6);
        hand.sink(&KNOBS, 100.0);
        assert!((hand.tool(&KNOBS).position_m.z - 0.05).abs() < 1e-6);
        // And out again no faster, when less depth is wanted.
        let shallow = HandKnobs {
            depth_m: 0.0,
            ..KNOBS
        };
        hand.sink(&shallow, 0.1);
        assert!((hand.depth_m().expect("a push") - 0.04).abs() < 1e-6);
    }

    #[test]
    fn a_drag_follows_the_cursor_in_the_plane_of_the_spot() {
        let mut hand = press(ToolAction::Grab);
        hand.drag(ray(0.4));
        assert!((hand.tool(&KNOBS).position_m - Vec3::new(0.4, 0.0, 0.0)).length() < 1e-6);
    }

    #[test]
    fn a_press_beside_the_organ_takes_nothing_in_hand() {
        assert!(Hand::press(ToolAction::Push, ray(5.0), &POINTS, &[[0, 1, 2]]).is_none());
    }
}
