//! A place of the surface that touches a tool in a substep.

use super::{Handle, Motion};
use glam::{Vec3, Vec4};

/// One inequality: the place stays outside the tangent plane of the tool, and friction holds it
/// back along that plane.
#[derive(Clone, Copy, Debug)]
pub struct Touch {
    /// Its triangle and piece of the axis.
    pub key: (u32, u8),
    /// The same as an index in the vicinity.
    pub near: u32,
    pub handle: Handle,
    /// From the axis towards the place, of length 1.
    pub normal: Vec3,
    /// Nearest place on the axis, in the frame of the tool [m].
    pub foot: Vec3,
    /// The place at the start of the substep, in the frame of the tool [m].
    pub start: Vec3,
    /// The gap that is asked for [m]: 0, or less for a place that was deep inside.
    pub target_m: f32,
    /// What has been pushed so far [kg m]: never towards the tool, and along the tangent plane no
    /// more than friction allows.
    pub multiplier: Vec3,
    /// The multiplier of the last substep, until it is pushed [kg m].
    pub guess: Vec3,
}

impl Touch {
    /// How far the place is outside the tool, less what is asked for [m].
    #[allow(dead_code, reason = "for solvers that find all multipliers at once")]
    pub fn gap_m(&self, tool: Motion, places: &[Vec4]) -> f32 {
        self.gap_at(tool, self.handle.place(places) - tool.to_m)
    }

    #[inline]
    fn gap_at(&self, tool: Motion, end: Vec3) -> f32 {
        self.normal.dot(end - self.foot) - tool.shape.radius_m() - self.target_m
    }

    /// How far the place has slid along the tool in this substep [m].
    #[allow(dead_code, reason = "for solvers that find all multipliers at once")]
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
        let pushed = (pushed - self.gap_at(tool, end) / self.handle.inverse_mass).max(0.0);
        // Coulomb: stick if the force of friction allows it. The push leaves the tangent alone.
        let slip = end - self.start;
        let slip = slip - self.normal.dot(slip) * self.normal;
        let held =
            (held - slip / self.handle.inverse_mass).clamp_length_max(tool.friction * pushed);
        self.push_to(pushed * self.normal + held, places)
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
