//! How a body moves: the implicit midpoint rule, of second order and without damping of its own.

use super::{
    Fem,
    newton::{Inertia, Potential},
};
use glam::DVec3;
use std::fmt;

/// Forces left at a midpoint, over all there are: far less than what a step gets wrong.
const TOLERANCE: f64 = 1e-9;

/// Positions and velocities of all particles.
#[derive(Clone, Debug, PartialEq)]
pub struct State {
    /// [m]
    pub positions: Vec<DVec3>,
    /// [m/s]
    pub velocities: Vec<DVec3>,
}

/// How long to let a body move, and in how small steps.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Swing {
    pub frames: usize,
    /// Time from frame to frame [s].
    pub frame_s: f64,
    pub steps_per_frame: usize,
    /// Velocities are multiplied by exp(−damping · frame) once a frame, as the simulation does [1/s].
    pub damping_per_s: f64,
}

/// Newton's method found no end of a midpoint step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoStep {
    /// Length of the step [s].
    pub step_s: f64,
    /// Norm of the forces left on free particles [N].
    pub residual_n: f64,
}

impl fmt::Display for NoStep {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "a midpoint step of {:.1e} s was not solved: {:.1e} N are left; use a stiffer material or more steps a frame",
            self.step_s, self.residual_n
        )
    }
}

impl std::error::Error for NoStep {}

impl Fem {
    /// The body at rest, as it is before any load.
    pub fn at_rest(&self) -> State {
        State {
            positions: self.rest().to_vec(),
            velocities: vec![DVec3::ZERO; self.rest().len()],
        }
    }

    /// Kinetic, elastic and load energy [J]; 0 at rest.
    pub fn energy_j(&self, state: &State) -> f64 {
        let kinetic: f64 = (self.masses_kg().iter().zip(&state.velocities))
            .map(|(mass, v)| 0.5 * mass * v.length_squared())
            .sum();
        kinetic + self.elastic_energy_j(&state.positions) + self.load_energy_j(&state.positions)
    }

    /// Lets the body move from `state` and calls `seen` with the state at the end of each frame,
    /// counted from 1.
    ///
    /// # Errors
    ///
    /// [`NoStep`] if a step has no solution: it is far too long for this body.
    pub fn swing(
        &self,
        mut state: State,
        swing: &Swing,
        mut seen: impl FnMut(usize, &State),
    ) -> Result<(), NoStep> {
        let step_s = swing.frame_s / swing.steps_per_frame as f64;
        let damping = (-swing.damping_per_s * swing.frame_s).exp();
        for frame in 1..=swing.frames {
            for _ in 0..swing.steps_per_frame {
                self.midpoint_step(&mut state, step_s)?;
            }
            for velocity in &mut state.velocities {
                *velocity *= damping;
            }
            seen(frame, &state);
        }
        Ok(())
    }

    /// One step of the implicit midpoint rule.
    ///
    /// The midpoint y is where (4/h²) M (y − x − h/2 v) = force(y), the minimum of a potential; the
    /// step ends at 2y − x with the velocity 2 (2y − 2x)/h − v.
    ///
    /// # Errors
    ///
    /// [`NoStep`] if the step has no solution: it is far too long for this body. The state is as before it.
    pub fn midpoint_step(&self, state: &mut State, step_s: f64) -> Result<(), NoStep> {
        let predicted: Vec<DVec3> = (state.positions.iter().zip(&state.velocities))
            .map(|(x, v)| *x + 0.5 * step_s * *v)
            .collect();
        let mut midpoint = predicted.clone();
        self.put_held(&mut midpoint, 1.0);
        let potential = Potential {
            fem: self,
            load_share: 1.0,
            inertia: Some(Inertia {
                per_s2: 4.0 / (step_s * step_s),
                predicted,
            }),
        };
        let elastic = self.elastic_forces_n(&midpoint);
        let forces: f64 = (elastic.iter().zip(self.forces_n()))
            .map(|(elastic, outer)| elastic.length() + outer.length())
            .sum();
        let tolerance_n = TOLERANCE * forces + self.rounding_n(&midpoint);
        let ended = potential.minimise(&mut midpoint, tolerance_n);
        if ended.residual_n.is_nan() || ended.residual_n > 1e2 * tolerance_n {
            let residual_n = ended.residual_n;
            return Err(NoStep { step_s, residual_n });
        }
        for (i, y) in midpoint.into_iter().enumerate() {
            let moved = 2.0 * (y - state.positions[i]);
            state.positions[i] += moved;
            state.velocities[i] = if self.is_held(i) {
                DVec3::ZERO
            } else {
                2.0 / step_s * moved - state.velocities[i]
            };
        }
        Ok(())
    }
}
