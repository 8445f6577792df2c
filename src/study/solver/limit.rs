//! The longest substep with which a method holds on to a body, found on the run.

use super::super::held_body::HeldBody;
use crate::sim::{Simulation, SolverParams};

/// Frames of undamped release that a stable setting survives: half a second. An unstable one grows
/// by a factor every substep and is gone long before.
const FRAMES: u32 = 30;
/// A particle this many body sizes from its rest was thrown there: a hanging body can't reach it.
const THROWN_SIZES: f64 = 3.0;
/// More substeps than this are not tried.
const SUBSTEPS_MAX: u32 = 8192;

/// How long a substep may be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Limit {
    /// The longest that keeps the body together [s]; `None` if one substep a step does, and if none of
    /// [`SUBSTEPS_MAX`] does: what is so soft hangs as far down as an exploding body is thrown.
    pub found_s: Option<f64>,
    /// What the method itself says, of the body at rest [s].
    pub estimate_s: Option<f64>,
}

impl Limit {
    /// Finds the limit of a body with a method and material, in steps of `timestep_s`.
    pub fn of(body: &HeldBody, params: SolverParams, timestep_s: f64) -> Self {
        let is_stable = |substeps| {
            let iterations = 1;
            holds(
                body,
                SolverParams {
                    substeps,
                    iterations,
                    ..params
                },
            )
        };
        let at_rest = Simulation::new(body.setup.clone(), params);
        Self {
            found_s: fewest(is_stable).map(|substeps| timestep_s / f64::from(substeps)),
            estimate_s: at_rest.stable_substep_s().map(f64::from),
        }
    }
}

/// The fewest substeps that are stable, by bisection; `None` if one is, or not even [`SUBSTEPS_MAX`].
fn fewest(is_stable: impl Fn(u32) -> bool) -> Option<u32> {
    if is_stable(1) {
        return None;
    }
    let mut unstable = 1;
    while !is_stable(2 * unstable) {
        unstable *= 2;
        if unstable >= SUBSTEPS_MAX {
            return None;
        }
    }
    let mut stable = 2 * unstable;
    while stable - unstable > 1 {
        let middle = u32::midpoint(stable, unstable);
        if is_stable(middle) {
            stable = middle;
        } else {
            unstable = middle;
        }
    }
    Some(stable)
}

fn holds(body: &HeldBody, params: SolverParams) -> bool {
    let mut simulation = Simulation::new(body.setup.clone(), params);
    simulation.set_threads(Some(1));
    let far = THROWN_SIZES * body.size_m;
    (0..FRAMES).all(|_| {
        let frozen = simulation.step(&[]).frozen_particles;
        frozen == 0 && body.farthest_m(simulation.particles()) < far
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::Method;
    use crate::study::held_body::{Hold, beam};

    #[test]
    fn bisection_finds_the_edge() {
        for edge in [2, 3, 17, 64, 1000] {
            assert_eq!(fewest(|substeps| substeps >= edge), Some(edge));
        }
        assert_eq!(fewest(|_| true), None);
    }

    #[test]
    fn search_for_what_is_never_stable_ends_and_asks_for_no_more_substeps_than_it_may() {
        let is_stable = |substeps| {
            assert!(substeps <= SUBSTEPS_MAX, "{substeps}");
            false
        };
        assert_eq!(fewest(is_stable), None);
    }

    #[test]
    fn springs_explode_beyond_a_limit_near_the_estimate_and_constraints_do_not() {
        let beam = HeldBody::new(beam(2), 1000.0, Hold::End);
        let params = SolverParams {
            method: Method::MassSpring,
            youngs_modulus_pa: 1e5,
            ..SolverParams::default()
        };
        let limit = |params: SolverParams| Limit::of(&beam, params, 1.0 / 60.0);
        let found = limit(params)
            .found_s
            .expect("one substep a frame is too long");
        let estimate = limit(params).estimate_s.expect("springs have an estimate");
        // The estimate is a bound on the stiffest mode from below the limit; a motion of half a
        // length stiffens and softens springs, and may take longer than 30 frames to blow up.
        assert!(
            (0.9..4.0).contains(&(found / estimate)),
            "{found} s against {estimate} s"
        );
        let constraints = SolverParams {
            method: Method::XpbdNeoHookean,
            ..params
        };
        assert_eq!(limit(constraints).found_s, None);
    }
}
