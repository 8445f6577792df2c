//! One rigid tool against the surface of the body: swept, one-sided, with friction.
//!
//! Everything is looked at in the frame of the tool, where the tool stands still and the triangles
//! of the surface move. Of each point, side and face the place that is nearest to the tool's axis is
//! kept out of the tool; one that goes far in a substep is swept, and held where it first comes to
//! the tool ([`sweep`]). Such a [`Touch`] is an inequality with a multiplier that is never negative and
//! Coulomb friction. Multiplier over h² is force.
//!
//! Two kinds of solver use it. One that alternates calls [`Contacts::solve`] after its own sweep. One
//! that solves for all positions at once calls [`Contacts::resume`], then [`Contacts::look`] at its
//! guess of them, reads [`Contacts::active`], and hands the multipliers that it found to
//! [`Contacts::set_multipliers`]; `Tools` offers the same for all tools together.

mod inside;
mod near;
mod nearest;
mod sweep;
mod touch;

pub use inside::{reaches_inside, way_out};
pub use near::{Surface, SweptBox};

use super::{
    ToolShape,
    handle::{CARRIERS_MAX, Handle},
};
use glam::{Vec3, Vec4};
use near::{Feature, Near, Vicinity};
use nearest::{Axis, Nearest, blend, nearest};
use sweep::sweep;
use touch::Touch;

/// A place found inside a tool leaves it no faster than this [m/s], and a tool found inside the body
/// comes in from outside no faster: it must not fling the body away.
pub const DEPENETRATION_SPEED_M_S: f32 = 0.5;
/// Sweeps over the touches between two looks at the surface, if they do not settle before.
const SWEEPS_MAX: usize = 100;
/// A tool goes this many of its radii in one piece.
const PIECE_RADII: f32 = 0.5;
/// Pieces of a substep at most; longer ones are swept.
const PIECES_MAX: u32 = 500;
/// Touches have settled when none moves its place by more than this share of the largest move.
const SETTLED_SHARE: f32 = 0.001;
/// Looks at the surface in one solve, if it does not settle before.
const LOOKS_MAX: usize = 8;
/// The surface is looked at again when a place was moved by more than this share of the radius.
const LOOK_AGAIN_RADII: f32 = 0.02;
/// No guess moves a place by more than this share of the radius.
const PRESS_ON_RADII: f32 = 0.5;
/// A triangle that moves by less than this share of its distance from the axis cannot have
/// passed it.
const PASSING_SHARE: f32 = 0.9;
/// Within this share of the radius a tool that moves is as good as one that stands still.
const SLOW_RADII: f32 = 0.1;
/// A normal that turns by more than this cosine from one substep to the next has changed sides.
const OTHER_SIDE_COSINE: f32 = -0.2;

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

/// A contact as it is seen by a solver that solves for all positions at once.
#[derive(Clone, Copy, Debug)]
pub struct ActiveContact {
    /// Where on the body.
    pub handle: Handle,
    /// From the tool into the body, of length 1.
    pub normal: Vec3,
    /// How far the place is outside the tool, less what is asked for [m]: not negative when the
    /// contact holds. Its gradient with respect to the place is the normal.
    pub gap_m: f32,
    /// How far the place has slid along the tool since the start of the substep [m].
    pub slip_m: Vec3,
    /// Coulomb friction coefficient.
    pub friction: f32,
    /// What it was last known to push with, force on the body times h² [kg m].
    pub multiplier: Vec3,
    /// How the slope of the surface at the place follows each carrier of the handle [1/m]: where it
    /// tilts, the place wanders by the tool's radius times the change.
    pub slopes: [Vec3; CARRIERS_MAX],
    /// Radius of the tool there [m].
    pub radius_m: f32,
    /// Radius of the tool [m].
    pub tool_radius_m: f32,
}

/// How far apart the axes of two tools are [m], and the direction from the first to the second; zero
/// where they meet.
pub fn between(first: (ToolShape, Vec3), second: (ToolShape, Vec3)) -> (f32, Vec3) {
    let axis = [Vec3::ZERO, first.0.axis_m()];
    let start = second.1 - first.1;
    let end = start + second.0.axis_m();
    let found = nearest(axis, [start, end, end]);
    let way = blend(found.weights, [start, end, end]) - found.foot;
    (way.length(), way.normalize_or_zero())
}

/// What one tool touches.
#[derive(Clone, Debug, Default)]
pub struct Contacts {
    vicinity: Vicinity,
    touches: Vec<Touch>,
    /// What earlier pieces of this substep have pushed [kg m].
    pushed: Vec3,
    /// Whether it pressed on the body when the last step began.
    pressed_before: bool,
    /// Touches are swept to and fro, so that none is always the last.
    backwards: bool,
}

impl Contacts {
    /// Forgets everything: the tool was lifted.
    pub fn clear(&mut self) {
        *self = Self::default();
    }

    /// Whether the tool pressed on the body in the last substep.
    pub fn pressed(&self) -> bool {
        self.touches.iter().any(Touch::presses)
    }

    /// Whether the tool may touch the body in this step.
    pub fn is_near(&self) -> bool {
        !self.vicinity.near.is_empty()
    }

    /// The particles that carry what the tool touches.
    pub fn carriers(&self) -> impl Iterator<Item = u32> {
        let handles = self.touches.iter().map(|touch| &touch.handle);
        handles.flat_map(|handle| handle.carriers().map(|(particle, _)| particle))
    }

    /// Number of active contacts.
    pub fn len(&self) -> usize {
        self.touches.len()
    }

    /// Whether the tool has let go of the body since the step before: it may have slipped in.
    pub fn lets_go(&mut self) -> bool {
        let pressed = self.pressed();
        std::mem::replace(&mut self.pressed_before, pressed) && !pressed
    }

    /// Finds the features that the tool may touch in a step in which it goes from `from_m` on and
    /// sweeps `swept`.
    pub fn begin_step(
        &mut self,
        shape: ToolShape,
        from_m: Vec3,
        swept: SweptBox,
        surface: Surface,
    ) {
        if swept.misses(surface.bounds) {
            self.vicinity.clear();
            self.touches.clear();
            return;
        }
        self.vicinity.find(shape, from_m, swept, surface);
        // Both lists are in the order of the surface.
        let mut near = (self.vicinity.near.iter().zip(0..)).peekable();
        self.touches.sort_unstable_by_key(|touch| touch.feature);
        self.touches.retain_mut(|touch| {
            while near
                .next_if(|(near, _)| near.feature < touch.feature)
                .is_some()
            {}
            let found = near.next_if(|(near, _)| near.feature == touch.feature);
            touch.near = found.map_or(0, |(_, index)| index);
            found.is_some()
        });
    }

    /// Takes over where the surface is at the start of a substep.
    pub fn begin_substep(&mut self, from_m: Vec3, previous: &[Vec4]) {
        self.pushed = Vec3::ZERO;
        self.begin_substep_at(from_m, previous);
    }

    fn begin_substep_at(&mut self, from_m: Vec3, previous: &[Vec4]) {
        self.vicinity.begin_substep(from_m, previous);
        // What pressed goes on with what it pressed with.
        self.touches.retain_mut(Touch::begin_substep);
        for (touch, index) in self.touches.iter().zip(0..) {
            self.vicinity.near[touch.near as usize].touch = Some(index);
        }
    }

    /// Pushes as in the last substep, before anything else does: what rests is pushed by the right
    /// amount then, and the elastic constraints answer to it as they do to gravity. `scale` is h²
    /// over that of the last substep.
    pub fn press_on(&mut self, tool: Motion, scale: f32, places: &mut [Vec4]) {
        let farthest_m = (self.touches.iter())
            .map(|touch| scale * touch.guess.length() * touch.handle.inverse_mass)
            .fold(0.0, f32::max);
        // In long substeps the guess is no small push, and what it moves far is not at rest.
        let share = scale * (PRESS_ON_RADII * tool.shape.radius_m() / farthest_m).min(1.0);
        for touch in &mut self.touches {
            touch.push_guess(share, tool.friction, places);
        }
    }

    /// Whether the tool would touch a body that stands still, on the way of `tool`.
    pub fn would_touch(&mut self, tool: Motion, places: &[Vec4]) -> bool {
        self.begin_substep(tool.from_m, places);
        self.look(tool, places, f32::MAX, 0.0);
        !std::mem::take(&mut self.touches).is_empty()
    }

    /// Finds what touches the tool, and pushes it out, with friction. How far a place was moved at
    /// most [m].
    ///
    /// A tool that goes farther than its own size goes in pieces: in one it would meet the tissue
    /// from too many sides at once.
    pub fn solve(
        &mut self,
        tool: Motion,
        places: &mut [Vec4],
        previous: &[Vec4],
        substep_s: f32,
    ) -> f32 {
        let longest_m = self.vicinity.way_max_m(tool.to_m, places);
        let pieces = longest_m / (PIECE_RADII * tool.shape.radius_m());
        if pieces <= 1.0 {
            return self.solve_piece(tool, places, substep_s);
        }
        let pieces = (pieces.ceil() as u32).min(PIECES_MAX);
        let share = 1.0 / pieces as f32;
        let way = share * (tool.to_m - tool.from_m);
        // Back to where the substep started, and on in equal parts of the way from there.
        let movers = self.vicinity.movers();
        let parts: Vec<Vec4> = (movers.iter())
            .map(|&mover| {
                let mover = mover as usize;
                let part = share * (places[mover] - previous[mover]);
                places[mover] = previous[mover];
                part
            })
            .collect();
        let mut most_m = 0.0_f32;
        for piece in 0..pieces {
            let piece = Motion {
                from_m: tool.from_m + piece as f32 * way,
                to_m: tool.from_m + (piece + 1) as f32 * way,
                ..tool
            };
            self.begin_piece(piece.from_m, places);
            for (&mover, &part) in movers.iter().zip(&parts) {
                places[mover as usize] += part;
            }
            most_m = most_m.max(self.solve_piece(piece, places, share * substep_s));
        }
        most_m
    }

    /// Starts a piece: what the last one pushed stays pushed.
    fn begin_piece(&mut self, from_m: Vec3, places: &[Vec4]) {
        self.pushed += self
            .touches
            .iter()
            .map(|touch| touch.multiplier)
            .sum::<Vec3>();
        self.begin_substep_at(from_m, places);
        for touch in &mut self.touches {
            touch.guess = Vec3::ZERO;
        }
    }

    fn solve_piece(&mut self, tool: Motion, places: &mut [Vec4], substep_s: f32) -> f32 {
        // What is nearer than places are moved before the next look is kept an eye on.
        let margin_m = LOOK_AGAIN_RADII * tool.shape.radius_m();
        let mut most_m = 0.0_f32;
        for _ in 0..LOOKS_MAX {
            self.look(tool, places, substep_s, margin_m);
            let moved_m = self.push(tool, places);
            most_m = most_m.max(moved_m);
            if moved_m <= margin_m {
                break;
            }
        }
        most_m
    }

    /// Has what pressed in the last substep press as it did. `scale` is h² over that of the last
    /// substep.
    pub fn resume(&mut self, scale: f32) {
        for touch in &mut self.touches {
            touch.multiplier = scale * std::mem::take(&mut touch.guess);
        }
    }

    /// The contacts that the last look found.
    pub fn active<'a>(
        &'a self,
        tool: Motion,
        places: &'a [Vec4],
    ) -> impl Iterator<Item = ActiveContact> + 'a {
        self.touches.iter().map(move |touch| ActiveContact {
            handle: touch.handle,
            normal: touch.normal,
            gap_m: touch.gap_m(tool, places),
            slip_m: touch.slip_m(tool, places),
            friction: tool.friction,
            multiplier: touch.multiplier,
            slopes: touch.slopes,
            radius_m: touch.radius_m,
            tool_radius_m: tool.shape.radius_m(),
        })
    }

    /// Takes over the multiplier of each active contact, force on the body times h² [kg m].
    ///
    /// # Panics
    ///
    /// If there is not one for each.
    pub fn set_multipliers(&mut self, multipliers: &[Vec3]) {
        assert_eq!(multipliers.len(), self.touches.len(), "one a contact");
        for (touch, &multiplier) in self.touches.iter_mut().zip(multipliers) {
            touch.multiplier = multiplier;
        }
    }

    /// Force on the body times h² in this substep [kg m].
    pub fn multiplier(&self) -> Vec3 {
        self.pushed
            + self
                .touches
                .iter()
                .map(|touch| touch.multiplier)
                .sum::<Vec3>()
    }

    /// Looks where the surface is now, and brings the touches up to date. Places up to `margin_m`
    /// away are taken too.
    pub fn look(&mut self, tool: Motion, places: &[Vec4], substep_s: f32, margin_m: f32) {
        let leave_m = DEPENETRATION_SPEED_M_S * substep_s;
        let Vicinity {
            near,
            points,
            carriers,
            ..
        } = &mut self.vicinity;
        for point in points.iter_mut() {
            point.end = point.place(places) - tool.to_m;
            point.way_m = point.start.distance(point.end);
        }
        for (index, near) in near.iter_mut().enumerate() {
            let corners = near.corners.map(|k| &points[k as usize]);
            let way_m = corners
                .iter()
                .map(|corner| corner.way_m)
                .fold(0.0, f32::max);
            if near.touch.is_none() && near.clear_m > way_m + margin_m {
                continue;
            }
            let start = corners.map(|corner| corner.start);
            let end = corners.map(|corner| corner.end);
            let seen = Seen {
                axis: near.feature.axis(tool.shape),
                is_side: matches!(near.feature, Feature::Side { .. }),
                radius_m: near.radius_m,
                start,
                end,
                way_m,
                margin_m,
            };
            let known = near.touch.map(|touch| self.touches[touch as usize].normal);
            let Some(found) = seen.find(near, known) else {
                continue;
            };
            // Corners are held for themselves.
            let at_corner = found.weights.max_element() == 1.0;
            let is_point = matches!(near.feature, Feature::Point { .. });
            if at_corner && !is_point && near.touch.is_none() {
                continue;
            }
            let carriers = near.carriers(carriers, corners);
            let handle = carriers.at(found.weights, places);
            if handle.inverse_mass <= 0.0 {
                continue;
            }
            let touch = Touch {
                feature: near.feature,
                near: index as u32,
                handle,
                normal: found.normal,
                foot: found.foot,
                start: blend(found.weights, start),
                slopes: if is_point {
                    [Vec3::ZERO; CARRIERS_MAX]
                } else {
                    carriers.slopes(end)
                },
                radius_m: near.radius_m + (found.start_gap_m + leave_m).min(0.0),
                multiplier: Vec3::ZERO,
                guess: Vec3::ZERO,
            };
            match near.touch {
                None => {
                    near.touch = Some(self.touches.len() as u32);
                    self.touches.push(touch);
                }
                // What was pushed stays pushed; from now on it is held here.
                Some(known) => {
                    let known = &mut self.touches[known as usize];
                    *known = Touch {
                        multiplier: known.multiplier,
                        ..touch
                    };
                }
            }
        }
    }

    /// Sweeps over the touches until they settle. How far a place was moved at most [m].
    fn push(&mut self, tool: Motion, places: &mut [Vec4]) -> f32 {
        let pressed_m = |touch: &Touch| touch.multiplier.length() * touch.handle.inverse_mass;
        let mut scale_m = self.touches.iter().map(pressed_m).fold(0.0, f32::max);
        let mut moved_m = 0.0;
        for _ in 0..SWEEPS_MAX {
            let mut worst_m = 0.0_f32;
            self.backwards = !self.backwards;
            if self.backwards {
                for touch in self.touches.iter_mut().rev() {
                    worst_m = worst_m.max(touch.solve(tool, places));
                }
            } else {
                for touch in &mut self.touches {
                    worst_m = worst_m.max(touch.solve(tool, places));
                }
            }
            moved_m += worst_m;
            scale_m = scale_m.max(worst_m);
            if worst_m <= SETTLED_SHARE * scale_m || self.touches.len() == 1 {
                break;
            }
        }
        moved_m
    }

    /// How far a tool at `position_m` reaches into the surface at most [m], if its axis is outside.
    pub fn penetration_m(&self, shape: ToolShape, position_m: Vec3, points: &[Vec3]) -> f32 {
        let depth_m = |near: &Near| {
            let corners = near.corners.map(|k| {
                let index = self.vicinity.points[k as usize].point;
                points[index as usize] - position_m
            });
            shape.radius_m() - nearest(near.feature.axis(shape), corners).distance_m()
        };
        self.vicinity.near.iter().map(depth_m).fold(0.0, f32::max)
    }
}

/// A triangle that may touch, in the frame of the tool.
struct Seen {
    axis: Axis,
    is_side: bool,
    radius_m: f32,
    start: [Vec3; 3],
    end: [Vec3; 3],
    /// The longest way of a corner [m].
    way_m: f32,
    margin_m: f32,
}

/// Where a triangle is to be held.
struct Found {
    normal: Vec3,
    foot: Vec3,
    weights: Vec3,
    /// How far the triangle was outside the tool at the start [m], negative inside.
    start_gap_m: f32,
}

impl Seen {
    /// Where it comes to the tool, if it does. It was outside, or nearly so, when the substep
    /// started.
    fn find(&self, near: &mut Near, known: Option<Vec3>) -> Option<Found> {
        let slow = self.way_m < PASSING_SHARE * (near.clear_m + self.radius_m);
        if slow && self.way_m < SLOW_RADII * self.radius_m {
            let found = nearest(self.axis, self.end);
            let gap_m = found.distance_m() - self.radius_m;
            near.clear_m = near.clear_m.max(gap_m - self.way_m);
            if gap_m >= self.margin_m && known.is_none() {
                return None;
            }
            let (normal, _) = self.on_its_side(&found, self.end, known);
            let start = blend(found.weights, self.start) - found.foot;
            return Some(self.found(found, normal, normal.dot(start) - self.radius_m));
        }
        let at_start = nearest(self.axis, self.start);
        let (start_normal, side) = self.on_its_side(&at_start, self.start, known);
        let start_gap_m = side * at_start.distance_m() - self.radius_m;
        near.clear_m = start_gap_m;
        if side < 0.0 {
            return Some(self.found(at_start, start_normal, start_gap_m));
        }
        if self.way_m < PASSING_SHARE * at_start.distance_m() {
            let found = nearest(self.axis, self.end);
            if found.distance_m() - self.radius_m >= self.margin_m && known.is_none() {
                return None;
            }
            let normal = found.normal(self.end);
            return Some(self.found(found, normal, start_gap_m));
        }
        let reach_m = self.radius_m + self.margin_m;
        match sweep(self.axis, reach_m, self.start, self.end) {
            Some(hit) => Some(Found {
                normal: hit.normal,
                foot: hit.foot,
                weights: hit.weights,
                start_gap_m,
            }),
            // It never comes to the tool: what pressed may let go.
            None => known.map(|_| {
                let found = nearest(self.axis, self.end);
                self.found(found, found.normal(self.end), start_gap_m)
            }),
        }
    }

    /// The normal of the nearest place, and whether the place is on the side of the axis where it
    /// was in the last substep: 1 if so, −1 if the axis has gone through the face or side since.
    fn on_its_side(&self, found: &Nearest, corners: [Vec3; 3], known: Option<Vec3>) -> (Vec3, f32) {
        let normal = found.normal(corners);
        let within = if self.is_side {
            found.weights.max_element() < 1.0
        } else {
            found.weights.min_element() > 0.0
        };
        if within && known.is_some_and(|known| normal.dot(known) < OTHER_SIDE_COSINE) {
            (-normal, -1.0)
        } else {
            (normal, 1.0)
        }
    }

    fn found(&self, nearest: Nearest, normal: Vec3, start_gap_m: f32) -> Found {
        Found {
            normal,
            foot: nearest.foot,
            weights: nearest.weights,
            start_gap_m,
        }
    }
}

#[cfg(test)]
mod tests;
