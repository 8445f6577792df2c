//! A place of the surface that touches a tool in a substep.

use super::{Handle, Motion, near::Feature};
use crate::sim::handle::CARRIERS_MAX;
use glam::{Vec3, Vec4};

/// One inequality: the place stays outside the tangent plane of the tool, and friction holds it
/// back along that plane.
#[derive(Clone, Copy, Debug)]
pub struct Touch {
    pub feature: Feature,
    /// The feature's index in the vicinity.
    pub near: u32,
    pub handle: Handle,
    /// From the axis towards the place, of length 1.
    pub normal: Vec3,
    /// Nearest place on the axis, in the frame of the tool [m].
    pub foot: Vec3,
    /// The place at the start of the substep, in the frame of the tool [m].
    pub start: Vec3,
    /// How near the place may come to the tangent plane of the axis [m].
    pub radius_m: f32,
    /// How the slope of its triangle follows the carriers; zeros for a point of the surface [1/m].
    pub slopes: [Vec3; CARRIERS_MAX],
    /// What has been pushed so far [kg m]: never towards the tool, and along the tangent plane no
    /// more than friction allows.
    pub multiplier: Vec3,
    /// The multiplier of the last substep, until it is pushed [kg m].
    pub guess: Vec3,
}

impl Touch {
    /// How far the place is outside the tool, less what is asked for [m].
    pub fn gap_m(&self, tool: Motion, places: &[Vec4]) -> f32 {
        self.gap_at(self.handle.place(places) - tool.to_m)
    }

    #[inline]
    fn gap_at(&self, end: Vec3) -> f32 {
        self.normal.dot(end - self.foot) - self.radius_m
    }

    /// How far the place has slid along the tool in this substep [m].
    pub fn slip_m(&self, tool: Motion, places: &[Vec4]) -> Vec3 {
        let slip = self.handle.place(places) - tool.to_m - self.start;
        slip - self.normal.dot(slip) * self.normal
    }

    /// Whether it has pushed in this substep.
    pub fn presses(&self) -> bool {
        self.multiplier != Vec3::ZERO
    }

    /// Sets the multiplier to 0, as a substep starts. Whether it pushed in the last.
    pub fn begin_substep(&mut self) -> bool {
        self.guess = std::mem::take(&mut self.multiplier);
        self.guess != Vec3::ZERO
    }

    /// Pushes by a share of what was pushed in the last substep.
    pub fn push_guess(&mut self, share: f32, friction: f32, places: &mut [Vec4]) {
        let guess = share * std::mem::take(&mut self.guess);
        let (pushed, held) = self.split(guess);
        let held = held.clamp_length_max(friction * pushed.max(0.0));
        if pushed > 0.0 {
            self.push_to(pushed * self.normal + held, places);
        }
    }

    /// One projection. How far it moves the place [m].
    pub fn solve(&mut self, tool: Motion, places: &mut [Vec4]) -> f32 {
        let end = self.handle.place(places) - tool.to_m;
        let (pushed, held) = self.split(self.multiplier);
        let (give, inverse) = (self.handle.give, self.inverse());
        let pushed = (pushed - inverse * (self.gap_at(end) + give * pushed)).max(0.0);
        // Coulomb: stick if the force of friction allows it. The push leaves the tangent alone.
        let slip = end - self.start;
        let slip = slip - self.normal.dot(slip) * self.normal;
        let held = (held - inverse * (slip + give * held)).clamp_length_max(tool.friction * pushed);
        self.push_to(pushed * self.normal + held, places)
    }

    /// What a multiplier grows by for each metre that is missing [kg].
    #[inline]
    fn inverse(&self) -> f32 {
        1.0 / (self.handle.inverse_mass + self.handle.give)
    }

    /// A multiplier along the normal and across it.
    #[inline]
    fn split(&self, multiplier: Vec3) -> (f32, Vec3) {
        let pushed = multiplier.dot(self.normal);
        (pushed, multiplier - pushed * self.normal)
    }

    #[inline]
    fn push_to(&mut self, multiplier: Vec3, places: &mut [Vec4]) -> f32 {
        let change = multiplier - self.multiplier;
        self.multiplier = multiplier;
        self.handle.push(places, change);
        change.length() * self.handle.inverse_mass
    }
}
