//! The elastic model of a body, one of a closed set.

use super::{
    Method, SolverParams, implicit::Implicit, mass_spring::MassSpring, muscle::Muscle,
    neo_hookean::NeoHookean, springs::Springs, team::Team,
};
use crate::geom::TetMesh;
use glam::Vec4;

/// What resists deformation.
#[derive(Clone, Debug)]
pub enum Model {
    MassSpring(MassSpring),
    Springs(Springs),
    NeoHookean(NeoHookean),
    /// Solves substeps as a whole, tools and all.
    Implicit(Box<Implicit>),
}

impl Model {
    /// The model of `method` for the tetrahedra `sound` of `mesh`, of which `fill` is tissue, and
    /// particles with the inverse masses in `places`.
    pub fn new(
        method: Method,
        mesh: &TetMesh,
        sound: &[u32],
        fill: &[f32],
        places: &[Vec4],
    ) -> Self {
        match method {
            Method::MassSpring => Self::MassSpring(MassSpring::new(mesh, sound, fill)),
            Method::XpbdSprings => Self::Springs(Springs::new(mesh, sound, fill)),
            Method::Implicit => Self::Implicit(Box::new(Implicit::new(mesh, sound, fill, places))),
            Method::XpbdNeoHookean => Self::NeoHookean(NeoHookean::new(mesh, sound, fill)),
        }
    }

    /// Takes over how much of each particle is muscle, which is at rest.
    pub fn set_activity(&mut self, activity: &[f32]) {
        let muscle = match self {
            Self::Implicit(model) => return model.set_activity(activity),
            Self::MassSpring(model) => &mut model.muscle,
            Self::Springs(model) => &mut model.muscle,
            Self::NeoHookean(model) => &mut model.muscle,
        };
        *muscle = Some(Muscle::new(activity));
    }

    /// Has muscle shorten from now on, as a share of its length.
    pub fn shorten(&mut self, shortening: f32) {
        let muscle = match self {
            Self::Implicit(model) => return model.shorten(shortening),
            Self::MassSpring(model) => &mut model.muscle,
            Self::Springs(model) => &mut model.muscle,
            Self::NeoHookean(model) => &mut model.muscle,
        };
        if let Some(muscle) = muscle {
            muscle.shortening = shortening;
        }
    }

    /// Starts a substep. Returns the accelerations that act before the particles move [m/s²], one
    /// each at least, or `None` for a model of constraints that starts from nothing.
    pub fn begin_substep(
        &mut self,
        team: &Team,
        particles: &mut [Vec4],
        params: &SolverParams,
    ) -> Option<&[Vec4]> {
        match self {
            Self::MassSpring(model) => {
                Some(model.accelerations(team, particles, params.youngs_modulus_pa))
            }
            Self::Springs(model) => {
                model.begin_substep();
                None
            }
            Self::NeoHookean(model) => Some(model.begin_substep(team, particles, params)),
            Self::Implicit(_) => None,
        }
    }

    /// Forgets what the last substeps left: the body was put somewhere else.
    pub fn forget(&mut self, particles: &mut [Vec4], params: &SolverParams) {
        match self {
            Self::MassSpring(_) | Self::Springs(_) => {}
            Self::NeoHookean(model) => model.forget(particles, params),
            Self::Implicit(model) => model.forget(),
        }
    }

    /// Whether the body is wrecked and is led back to its last sound shape.
    pub fn is_restoring(&self) -> bool {
        match self {
            Self::MassSpring(_) | Self::Springs(_) => false,
            Self::Implicit(model) => model.is_restoring(),
            Self::NeoHookean(model) => model.is_restoring(),
        }
    }

    /// Starts a time step.
    pub fn begin_step(&mut self) {
        if let Self::Implicit(model) = self {
            model.begin_step();
        }
    }

    /// Takes over that all velocities were set to zero.
    pub fn stand_still(&mut self) {
        if let Self::Implicit(model) = self {
            model.forget();
        }
    }

    /// One sweep over all constraints.
    pub fn project(&mut self, team: &Team, particles: &mut [Vec4], params: &SolverParams) {
        let (lame, substep_s) = (params.lame(), params.substep_s());
        match self {
            Self::MassSpring(_) | Self::Implicit(_) => {}
            Self::Springs(model) => model.project(team, particles, lame, substep_s),
            Self::NeoHookean(model) => model.project(team, particles),
        }
    }

    /// RMS of what is left of the constraints after a step, free of units: C + α̃λ over rest length
    /// or volume, or the misfit of stress and deformation over Young's modulus; 0 for a model
    /// without constraints.
    pub fn residual_rms(
        &mut self,
        team: &Team,
        particles: &mut [Vec4],
        params: &SolverParams,
    ) -> f32 {
        let (sum, count) = match self {
            Self::Implicit(model) => return model.residual_share(),
            Self::MassSpring(_) => (0.0, 0),
            Self::Springs(model) => model.residual(particles, params.lame(), params.substep_s()),
            Self::NeoHookean(model) => {
                let residual = model.assess(team, particles, params);
                (residual.squared_sum, residual.count)
            }
        };
        (sum / count.max(1) as f64).sqrt() as f32
    }
}
