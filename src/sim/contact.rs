//! Rigid spheres and capsules against surface points: swept, one-sided, with friction.
//!
//! A point is looked at in the frame of the tool, where the tool stands still and the point moves
//! along a segment in a substep. If that segment reaches the tool, the tangent plane where it first
//! does so holds the point back for the rest of the substep, however fast the tool is. The
//! multiplier of that constraint, over h², is the force.

use super::{ToolShape, particles::Handle};
use glam::{Vec3, Vec4};

/// A point found inside the tool leaves it no faster than this [m/s]: a tool that appears inside
/// the body must not fling it away.
const DEPENETRATION_SPEED_M_S: f32 = 0.5;
/// Sweeps over the contacts each time the elastic constraints have been swept once: neighbouring
/// points share particles.
const CONTACT_SWEEPS: usize = 3;

/// Where a point touches a tool, in the frame of the tool.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Hit {
    /// From the axis towards the point, of length 1.
    pub normal: Vec3,
    /// The nearest place on the axis [m].
    pub foot: Vec3,
    /// How far the point was outside the tool at the start [m], negative inside.
    pub start_gap_m: f32,
}

/// Whether a point that moves from `start` to `end` in the frame of a tool comes to it, and where
/// it first does.
///
/// The distance to an axis is a convex function of the way, so Newton's method from the start never
/// oversteps the first contact.
pub fn sweep(shape: ToolShape, start: Vec3, end: Vec3) -> Option<Hit> {
    let (axis, radius) = (shape.axis(), shape.radius_m());
    let way = end - start;
    let nearest = |share: f32| {
        let at = start + share * way;
        let along = at.dot(axis) / axis.length_squared().max(f32::MIN_POSITIVE);
        let foot = along.clamp(0.0, 1.0) * axis;
        (foot, at - foot)
    };
    let (_, offset) = nearest(0.0);
    let start_gap_m = offset.length() - radius;
    let mut share = 0.0_f32;
    // Convex and piecewise smooth: six steps reach a thousandth of the radius.
    for _ in 0..12 {
        let (foot, offset) = nearest(share);
        let distance = offset.length();
        // A point on the axis itself has no side; it leaves against its motion, or upwards.
        let normal = offset
            .try_normalize()
            .or((-way).try_normalize())
            .unwrap_or(Vec3::Y);
        let gap = distance - radius;
        if gap <= 1e-3 * radius {
            return Some(Hit {
                normal,
                foot,
                start_gap_m,
            });
        }
        let closing = -normal.dot(way);
        if closing <= 0.0 {
            return None;
        }
        share += gap / closing;
        if share > 1.0 {
            return None;
        }
    }
    None
}

/// A surface point that may touch the tool in this step.
#[derive(Clone, Debug)]
pub struct Contact {
    pub point: u32,
    handle: Handle,
    touch: Option<Touch>,
}

/// A point that touches the tool in this substep.
#[derive(Clone, Copy, Debug)]
struct Touch {
    hit: Hit,
    /// The point at the start of the substep, in the frame of the tool [m].
    start: Vec3,
    /// The gap that is asked for [m]: 0, or less for a point that was deep inside.
    gap_m: f32,
    /// Multiplier of the gap, never negative [kg m].
    normal_multiplier: f32,
    /// Multiplier of friction, along the tangent plane [kg m].
    tangent_multiplier: Vec3,
}

/// The tool in a substep.
#[derive(Clone, Copy, Debug)]
pub struct Motion {
    pub shape: ToolShape,
    pub friction: f32,
    /// Position at the start of the substep [m].
    pub from_m: Vec3,
    /// Position at its end [m].
    pub to_m: Vec3,
}

impl Contact {
    /// `point` by its handle, not touching yet.
    pub fn new(point: u32, handle: Handle) -> Self {
        Self {
            point,
            handle,
            touch: None,
        }
    }

    /// Forgets the contact of the last substep.
    pub fn begin_substep(&mut self) {
        self.touch = None;
    }

    /// Force on the body times h² [kg m].
    pub fn multiplier(&self) -> Vec3 {
        self.touch.map_or(Vec3::ZERO, |touch| {
            touch.normal_multiplier * touch.hit.normal + touch.tangent_multiplier
        })
    }
}

/// Finds which of `contacts` touch the tool and pushes them out, with friction.
pub fn solve(
    contacts: &mut [Contact],
    tool: Motion,
    places: &mut [Vec4],
    previous: &[Vec4],
    substep_s: f32,
) {
    let mut touching = 0;
    for contact in contacts.iter_mut() {
        if contact.touch.is_none() && contact.handle.inverse_mass > 0.0 {
            let start = contact.handle.place(previous) - tool.from_m;
            let end = contact.handle.place(places) - tool.to_m;
            contact.touch = sweep(tool.shape, start, end).map(|hit| Touch {
                hit,
                start,
                gap_m: (hit.start_gap_m + DEPENETRATION_SPEED_M_S * substep_s).min(0.0),
                normal_multiplier: 0.0,
                tangent_multiplier: Vec3::ZERO,
            });
        }
        touching += usize::from(contact.touch.is_some());
    }
    let sweeps = if touching > 1 {
        CONTACT_SWEEPS
    } else {
        touching
    };
    for _ in 0..sweeps {
        for contact in contacts.iter_mut() {
            let handle = contact.handle;
            if let Some(touch) = &mut contact.touch {
                touch.solve(handle, tool, places);
            }
        }
    }
}

impl Touch {
    fn solve(&mut self, handle: Handle, tool: Motion, places: &mut [Vec4]) {
        let normal = self.hit.normal;
        let end = handle.place(places) - tool.to_m;
        let gap = normal.dot(end - self.hit.foot) - tool.shape.radius_m() - self.gap_m;
        let pushed = (self.normal_multiplier - gap / handle.inverse_mass).max(0.0);
        let push = (pushed - self.normal_multiplier) * normal;
        self.normal_multiplier = pushed;

        // Coulomb: stick if the force of friction allows it. The push leaves the tangent alone.
        let slip = end - self.start;
        let slip = slip - normal.dot(slip) * normal;
        let held = (self.tangent_multiplier - slip / handle.inverse_mass)
            .clamp_length_max(tool.friction * pushed);
        let drag = held - self.tangent_multiplier;
        self.tangent_multiplier = held;

        handle.push(places, push + drag);
    }
}

/// How deep `point` is inside the tool at `position` [m]; negative outside.
pub fn depth_m(shape: ToolShape, position_m: Vec3, point: Vec3) -> f32 {
    let axis = shape.axis();
    let offset = point - position_m;
    let along = offset.dot(axis) / axis.length_squared().max(f32::MIN_POSITIVE);
    shape.radius_m() - (offset - along.clamp(0.0, 1.0) * axis).length()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const BALL: ToolShape = ToolShape::Sphere { radius_m: 0.01 };

    #[test]
    fn point_that_passes_through_the_whole_ball_is_stopped_where_it_came_in() {
        let hit = sweep(BALL, Vec3::X * 0.5, Vec3::X * -0.5).expect("the ball is in the way");
        assert!((hit.normal - Vec3::X).length() < 1e-6, "{hit:?}");
    }

    #[test]
    fn point_that_passes_beside_the_ball_is_not_touched() {
        let aside = Vec3::Y * 0.0101;
        assert_eq!(sweep(BALL, Vec3::X + aside, -Vec3::X + aside), None);
    }

    #[test]
    fn point_on_the_axis_leaves_to_a_side_that_is_finite() {
        let hit = sweep(BALL, Vec3::ZERO, Vec3::ZERO).expect("the point is inside");
        assert_eq!(hit.normal.length(), 1.0);
    }

    proptest! {
        #[test]
        fn sweep_agrees_with_ten_thousand_small_steps(
            start in prop::array::uniform3(-0.1_f32..0.1),
            end in prop::array::uniform3(-0.1_f32..0.1),
            axis in prop::array::uniform3(-0.05_f32..0.05),
        ) {
            let shape = ToolShape::Capsule { radius_m: 0.01, axis: Vec3::from(axis) };
            let (start, end) = (Vec3::from(start), Vec3::from(end));
            let deepest = (0..=10_000)
                .map(|k| depth_m(shape, Vec3::ZERO, start.lerp(end, k as f32 / 1e4)))
                .fold(f32::NEG_INFINITY, f32::max);
            let found = sweep(shape, start, end).is_some();
            // Contact is declared a thousandth of the radius early; beyond twice that the two
            // must agree.
            if deepest > 0.0 {
                prop_assert!(found, "depth {deepest}");
            } else if deepest < -2e-5 {
                prop_assert!(!found, "gap {deepest}");
            }
        }
    }
}
