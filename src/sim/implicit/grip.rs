//! From the tools of a body to what holds its places, and back to the forces on the tools.

use super::{
    hold::{Barrier, Hold, Place, Pull, outer},
    order::Order,
};
use crate::sim::{contact::ActiveContact, handle::Handle, particles::Particles, tools::Tools};
use glam::{DMat3, DVec3, DVec4, Vec3};

/// Stiffness of a barrier over that of the body where it pushes. The body's is mostly against a change of volume, and many
/// places of a fine surface share nodes: at ten times as much the nodes of nearly incompressible tissue rattle between
/// tool and tissue, round after round, and what the tool feels is off by any factor.
const OVER_BODY: f64 = 2.0;
/// Stiffness of friction, until it slips, over that of the body. Ten times as stiff it throws the
/// force of a tool that comes in 3 % too high, since it slips and sticks in turn; with a tenth the
/// rounds take hold more slowly, and nothing is gained.
const FRICTION_OVER_BODY: f64 = 1.0;
/// Change of a force over the largest at which another round is worth it.
const SETTLED_SHARE: f64 = 0.02;

/// The substep, as the tools see it.
#[derive(Clone, Copy, Debug)]
pub struct Span {
    /// Shares of the time step at which the substep starts and ends.
    pub shares: (f32, f32),
    /// Length of the substep [s].
    pub substep_s: f32,
}

/// All that holds a body in a substep.
#[derive(Clone, Debug, Default)]
pub struct Grip {
    holds: Vec<Hold>,
    /// How many of them, from the first on, are of tools in the way; the others are places held.
    touches: usize,
    /// How deep a place was in a tool in the last look, at most, in radii of the tool.
    depth_radii: f64,
}

impl Span {
    /// The same as far as a share of it, where tools are still on their way.
    pub fn until(self, share: f32) -> Self {
        let (from, to) = self.shares;
        Self {
            shares: (
                from,
                if share < 1.0 {
                    from + share * (to - from)
                } else {
                    to
                },
            ),
            ..self
        }
    }
}

impl Grip {
    /// Lets go of everything.
    pub fn clear(&mut self) {
        *self = Self::default();
    }

    pub fn holds(&self) -> &[Hold] {
        &self.holds
    }

    /// Those of tools in the way.
    pub fn touches(&self) -> &[Hold] {
        &self.holds[..self.touches]
    }

    /// How deep a place was in a tool in the last look, at most, in radii of the tool.
    pub fn depth_radii(&self) -> f64 {
        self.depth_radii
    }

    /// Looks what the tools do to the body if it ends the substep at `displacements`, which is also
    /// where `particles` are.
    pub fn look(
        &mut self,
        tools: &mut Tools,
        particles: &Particles,
        span: Span,
        order: &Order,
        body_stiffness: &[f32],
        displacements: &[DVec4],
    ) {
        self.holds.clear();
        self.depth_radii = 0.0;
        let per_h2 = 1.0 / f64::from(span.substep_s).powi(2);
        for touch in tools.look(particles, span.shares, span.substep_s) {
            let depth_radii = f64::from(-touch.gap_m / touch.tool_radius_m);
            self.depth_radii = self.depth_radii.max(depth_radii);
            let place = Place::new(&touch.handle, order);
            let stiffness = place.stiffness(body_stiffness);
            let s = place.displacement(displacements);
            self.holds
                .push(in_the_way(place, &touch, s, stiffness, per_h2));
        }
        self.touches = self.holds.len();
        for hold in tools.holds(span.shares.1) {
            let place = Place::new(&hold.handle, order);
            let s = place.displacement(displacements);
            let stretch_m = hold.handle.place(&particles.places) - hold.target_m;
            self.holds.push(Hold {
                barrier: None,
                pull: Some(Pull {
                    across: DMat3::IDENTITY,
                    anchor_m: s - stretch_m.as_dvec3(),
                    force_n: DVec3::ZERO,
                    stiffness: f64::from(hold.stiffness_n_per_m),
                    force_max_n: f64::from(hold.force_max_n),
                }),
                friction: 0.0,
                place,
            });
        }
    }

    /// Norm of the forces on the body [N].
    pub fn load_n(&self, displacements: &[DVec4]) -> f64 {
        let squared = |hold: &Hold| hold.force_n(displacements).length_squared();
        self.holds.iter().map(squared).sum::<f64>().sqrt()
    }

    /// Gives the forces at `displacements` to the tools, and takes them for the multipliers of the
    /// next round. Whether they have settled.
    pub fn settle(&mut self, tools: &mut Tools, span: Span, displacements: &[DVec4]) -> bool {
        let h2 = f64::from(span.substep_s).powi(2);
        let forces_n: Vec<DVec3> = self
            .holds
            .iter()
            .map(|h| h.force_n(displacements))
            .collect();
        let multipliers: Vec<Vec3> = forces_n.iter().map(|&f| (h2 * f).as_vec3()).collect();
        let (pushes, pulls) = multipliers.split_at(self.touches);
        tools.set_multipliers(pushes);
        tools.set_hold_multipliers(pulls);
        let largest_n = forces_n.iter().map(|f| f.length()).fold(0.0, f64::max);
        let mut change_n = 0.0_f64;
        for hold in &mut self.holds[..self.touches] {
            change_n = change_n.max(hold.update_multipliers(displacements));
        }
        change_n <= SETTLED_SHARE * largest_n
    }
}

/// A tool in the way of a place at displacement `s`, with friction; `stiffness` is the body's there.
fn in_the_way(place: Place, touch: &ActiveContact, s: DVec3, stiffness: f64, per_h2: f64) -> Hold {
    let normal = touch.normal.as_dvec3();
    let force_n = per_h2 * touch.multiplier.as_dvec3();
    let pushed = force_n.dot(normal).max(0.0);
    let across = DMat3::IDENTITY - outer(normal, normal);
    let friction = f64::from(touch.friction);
    let carriers = place.carriers.len();
    Hold {
        barrier: Some(Barrier {
            normal,
            gap_m: f64::from(touch.gap_m) - normal.dot(s),
            force_n: pushed,
            stiffness: OVER_BODY * stiffness,
            slopes: touch.slopes[..carriers]
                .iter()
                .map(|slope| f64::from(touch.radius_m.max(0.0)).sqrt() * slope.as_dvec3())
                .collect(),
        }),
        pull: (friction > 0.0).then(|| Pull {
            across,
            anchor_m: s - touch.slip_m.as_dvec3(),
            force_n: across * force_n,
            stiffness: FRICTION_OVER_BODY * stiffness,
            force_max_n: friction * pushed,
        }),
        friction,
        place,
    }
}

impl Place {
    fn new(handle: &Handle, order: &Order) -> Self {
        let carriers = handle.carriers();
        Self {
            carriers: carriers
                .map(|(particle, weight)| (order.node[particle as usize], f64::from(weight)))
                .collect(),
        }
    }
}
