//! Newton's method on the energy of a body in a substep.
//!
//! E(u) = Σ mᵢ/(2τ²) |uᵢ − ûᵢ|² + elastic energy, where û is where the nodes would go without
//! elasticity and τ the implicit share of the substep. Each step is the solution of a positive
//! definite system, as exact as the step is worth, and is shortened until the energy falls; so the
//! energy never rises, whatever the start.
//!
//! Sources: Nocedal, Wright, "Numerical Optimization", 2nd ed., 2006 (inexact Newton, backtracking);
//! Hager, Zhang, SIAM J. Optim. 16, 2005 (accepting a step by its slope where the change of the
//! energy is below rounding).

use super::{
    cg::{ConjugateGradients, Stop, dot},
    element::Strain,
    elements::Elements,
    grip::Grip,
    matrix::BlockMatrix,
    multigrid::Multigrid,
};
use crate::sim::Lame;
use glam::{DVec4, Vec4};

/// Error at which a linear system is solved well enough, over its solution, both by energy.
const FORCING: f64 = 0.2;
/// Residual at which a body is at rest, over the load.
const REST_SHARE: f64 = 1e-5;
/// The same over the elastic forces: the rounding of those.
const ROUNDING_SHARE: f64 = 3e-7;
const CG_ITERATIONS_MAX: usize = 2000;
/// Times a step is shortened.
const CUTS_MAX: usize = 10;
/// Share of the fall of the energy that its slope promises, which is asked for (Armijo).
const FALL_SHARE: f64 = 1e-4;
/// Changes of the energy below this share of it may be rounding.
const ENERGY_ROUNDING: f64 = 1e-6;
/// Shares of the nodes' own stiffness that are added to a matrix, one after the other, where no step
/// is found without.
const LIFTS: [f32; 3] = [0.03, 0.3, 3.0];
/// Nearer to rest than this many times its residual, a step that is not found is not missed.
const LIFTED_ABOVE: f64 = 100.0;
/// With the sweeps alone CG converges well while the stiffness of a node is below so many times
/// its inertia.
const SWEEPS_SUFFICE: f64 = 5.0;

/// What a substep strives for.
#[derive(Clone, Debug, Default)]
pub struct Goal {
    /// Displacement without elasticity, û [m].
    pub free: Vec<DVec4>,
    /// m/τ² of each free node [N/m].
    pub inertia: Vec<f64>,
    /// Norm of the forces that move the body, gravity and inertia [N].
    pub load_n: f64,
    /// What holds the body from outside.
    pub grip: Grip,
}

/// The energy and what comes with it at one state.
#[derive(Clone, Copy, Debug, Default)]
pub struct State {
    pub energy_j: f64,
    /// Norm of the residual [N].
    pub residual_n: f64,
    pub strain: Strain,
}

/// The matrix of a body and all that solves with it.
#[derive(Clone, Debug)]
pub struct Newton {
    pub elements: Elements,
    pub matrix: BlockMatrix,
    pub multigrid: Multigrid,
    pub cg: ConjugateGradients,
    /// Elastic force on each node, and on the unused one [N].
    forces: Vec<Vec4>,
    /// Minus the gradient of the energy at each free node [N].
    pub residual: Vec<Vec4>,
    trial: Vec<DVec4>,
    /// How each free node resists by itself, without what holds it from outside; nothing before the
    /// first step [N/m].
    body_stiffness: Vec<f32>,
    /// Whether the lattices are of a matrix of this time step.
    lattices_are_fresh: bool,
}

impl Newton {
    /// For `elements` with `matrix`.
    pub fn new(
        elements: Elements,
        matrix: BlockMatrix,
        multigrid: Multigrid,
        node_count: usize,
    ) -> Self {
        let free = matrix.len();
        Self {
            elements,
            multigrid,
            cg: ConjugateGradients::new(free),
            matrix,
            forces: vec![Vec4::ZERO; node_count + 1],
            residual: vec![Vec4::ZERO; free],
            trial: vec![DVec4::ZERO; node_count + 1],
            body_stiffness: Vec::new(),
            lattices_are_fresh: false,
        }
    }

    /// The energy at `at`; its residual goes to `self.residual`.
    pub fn evaluate(&mut self, at: &[DVec4], goal: &Goal, lame: Lame) -> State {
        let strain = self.elements.forces(at, lame, &mut self.forces);
        let mut inertial_j = 0.0;
        for (node, residual) in self.residual.iter_mut().enumerate() {
            let away = at[node] - goal.free[node];
            let force = goal.inertia[node] * away;
            inertial_j += 0.5 * force.dot(away);
            *residual = self.forces[node] - force.as_vec4();
        }
        let mut held_j = 0.0;
        for hold in goal.grip.holds() {
            held_j += hold.add_forces(at, &mut self.residual);
        }
        State {
            energy_j: strain.energy_j + inertial_j + held_j,
            residual_n: dot(&self.residual, &self.residual).sqrt(),
            strain,
        }
    }

    /// Goes from `at`, where the energy is `state`, downhill by at most `steps` steps. The residual
    /// belongs to `at`, before and after.
    pub fn descend(
        &mut self,
        at: &mut Vec<DVec4>,
        mut state: State,
        goal: &Goal,
        lame: Lame,
        steps: u32,
    ) -> State {
        for _ in 0..steps {
            let rest_n = rest_n(&state, goal);
            if state.residual_n <= rest_n {
                break;
            }
            self.assemble(at, goal, lame);
            let stop = Stop {
                error: FORCING,
                residual: 0.5 * rest_n,
                iterations_max: CG_ITERATIONS_MAX,
            };
            self.solve(stop, self.is_stiff(goal));
            let mut found = self.step_along(at, &state, goal, lame);
            // Many crushed tetrahedra together can leave a matrix that is not positive.
            for lift in LIFTS {
                if found.is_some() || state.residual_n <= LIFTED_ABOVE * rest_n {
                    break;
                }
                self.lift(lift);
                self.lattices_are_fresh = false;
                self.solve(stop, self.is_stiff(goal));
                found = self.step_along(at, &state, goal, lame);
            }
            match found {
                Some(next) => state = next,
                None => break,
            }
        }
        state
    }

    /// Adds a share of each free node's own stiffness to the diagonal.
    fn lift(&mut self, share: f32) {
        for (node, &stiffness) in self.body_stiffness.iter().enumerate() {
            self.matrix.add_to_diagonal(node, share * stiffness);
        }
    }

    /// Solves matrix times step = residual. With `lattices`, those of an earlier matrix of this
    /// time step will do: they are only to help.
    fn solve(&mut self, stop: Stop, lattices: bool) {
        self.multigrid.refresh(&self.matrix);
        if lattices && !std::mem::replace(&mut self.lattices_are_fresh, true) {
            self.multigrid.refresh_lattices(&self.matrix);
        }
        self.cg.solve(
            &self.matrix,
            &mut self.multigrid,
            lattices,
            &self.residual,
            stop,
        );
    }

    /// Solves matrix times step = residual, for a matrix unlike those before and after.
    pub fn solve_anew(&mut self, stop: Stop) {
        self.lattices_are_fresh = false;
        self.solve(stop, true);
        self.lattices_are_fresh = false;
    }

    /// Has the lattices take over the next matrix: a time step starts.
    pub fn begin_step(&mut self) {
        self.lattices_are_fresh = false;
    }

    /// How each free node resists by itself, in this state or an earlier one [N/m].
    pub fn body_stiffness(&mut self, at: &[DVec4], goal: &Goal, lame: Lame) -> &[f32] {
        if self.body_stiffness.is_empty() {
            self.assemble(at, goal, lame);
        }
        &self.body_stiffness
    }

    /// Sets the matrix to the second derivative of the energy at `at`, made positive.
    fn assemble(&mut self, at: &[DVec4], goal: &Goal, lame: Lame) {
        self.body_stiffness.resize(self.matrix.len(), 0.0);
        self.matrix.clear();
        self.elements.add_stiffness(at, lame, &mut self.matrix);
        for (node, &inertia) in goal.inertia.iter().enumerate() {
            self.matrix.add_to_diagonal(node, inertia as f32);
        }
        for (node, stiffness) in self.body_stiffness.iter_mut().enumerate() {
            let block = &self.matrix.blocks()[self.matrix.diagonal(node)];
            *stiffness = (block[0].x + block[1].y + block[2].z) / 3.0;
        }
        for hold in goal.grip.holds() {
            hold.add_stiffness(at, &mut self.matrix);
        }
        self.matrix.mirror_upper();
    }

    /// Whether stiffness so outweighs inertia that the sweeps need the lattices' help.
    fn is_stiff(&self, goal: &Goal) -> bool {
        let stiffness: f64 = self.body_stiffness.iter().map(|&x| f64::from(x)).sum();
        stiffness > SWEEPS_SUFFICE * goal.inertia.iter().sum::<f64>()
    }

    /// Goes along the solution of the linear system as far as the energy falls. `None` if it falls
    /// nowhere; the residual is then that of `at` again.
    fn step_along(
        &mut self,
        at: &mut Vec<DVec4>,
        state: &State,
        goal: &Goal,
        lame: Lame,
    ) -> Option<State> {
        let slope = -dot(&self.residual, &self.cg.solution);
        if slope >= 0.0 {
            return None;
        }
        let mut trial = std::mem::take(&mut self.trial);
        // Nodes that are held have no step, but may be held elsewhere than last time.
        let free = self.cg.solution.len();
        trial[free..].copy_from_slice(&at[free..]);
        let mut share = 1.0;
        let mut found = None;
        for _ in 0..CUTS_MAX {
            let steps = self.cg.solution.iter();
            for ((trial, at), step) in trial.iter_mut().zip(at.iter()).zip(steps) {
                *trial = *at + share * step.as_dvec4();
            }
            let next = self.evaluate(&trial, goal, lame);
            let change_j = next.energy_j - state.energy_j;
            let slope_there = -dot(&self.residual, &self.cg.solution);
            let falls = change_j <= FALL_SHARE * share * slope;
            let is_rounding = change_j.abs() <= ENERGY_ROUNDING * state.energy_j.abs();
            if falls || (is_rounding && slope_there <= -0.8 * slope) {
                std::mem::swap(at, &mut trial);
                found = Some(next);
                break;
            }
            // The lowest point of the parabola through both energies and the slope.
            let lowest = -slope * share * share / (2.0 * (change_j - slope * share));
            share = if lowest.is_finite() {
                lowest.clamp(0.1 * share, 0.5 * share)
            } else {
                0.1 * share
            };
        }
        self.trial = trial;
        if found.is_none() {
            self.evaluate(at, goal, lame);
        }
        found
    }
}

/// Norm of the residual at which the body is as good as at rest [N].
fn rest_n(state: &State, goal: &Goal) -> f64 {
    (REST_SHARE * goal.load_n).max(ROUNDING_SHARE * state.strain.force_squared_n2.sqrt())
}

#[cfg(test)]
mod tests;
