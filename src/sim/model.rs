//! The elastic model of a body, one of a closed set.

use super::{
    Method, SolverParams, mass_spring::MassSpring, neo_hookean::NeoHookean, springs::Springs,
};
use crate::geom::TetMesh;
use glam::{Vec3, Vec4};

/// What resists deformation.
#[derive(Clone, Debug)]
pub enum Model {
    MassSpring(MassSpring),
    Springs(Springs),
    NeoHookean(NeoHookean),
}

impl Model {
    /// The model of `method` for the tetrahedra `sound` of `mesh`, of which `fill` is tissue.
    pub fn new(method: Method, mesh: &TetMesh, sound: &[u32], fill: &[f32]) -> Self {
        match method {
            Method::MassSpring => Self::MassSpring(MassSpring::new(mesh, sound, fill)),
            Method::XpbdSprings => Self::Springs(Springs::new(mesh, sound, fill)),
            Method::XpbdNeoHookean => Self::NeoHookean(NeoHookean::new(mesh, sound, fill)),
        }
    }

    /// Accelerations that act before the particles move [m/s²]; `None` for models of constraints.
    pub fn accelerations(&mut self, particles: &[Vec4], params: &SolverParams) -> Option<&[Vec3]> {
        match self {
            Self::MassSpring(model) => {
                Some(model.accelerations(particles, params.youngs_modulus_pa))
            }
            Self::Springs(_) | Self::NeoHookean(_) => None,
        }
    }

    /// Sets all multipliers to 0, as a substep starts.
    pub fn begin_substep(&mut self) {
        match self {
            Self::MassSpring(_) => {}
            Self::Springs(model) => model.begin_substep(),
            Self::NeoHookean(model) => model.begin_substep(),
        }
    }

    /// One sweep over all constraints.
    pub fn project(&mut self, particles: &mut [Vec4], params: &SolverParams) {
        let (lame, substep_s) = (params.lame(), params.substep_s());
        match self {
            Self::MassSpring(_) => {}
            Self::Springs(model) => model.project(particles, lame, substep_s),
            Self::NeoHookean(model) => model.project(particles, lame, substep_s),
        }
    }

    /// RMS of C + α̃λ over all constraints, each free of units; 0 for a model without constraints.
    pub fn residual_rms(&self, particles: &mut [Vec4], params: &SolverParams) -> f32 {
        let (lame, substep_s) = (params.lame(), params.substep_s());
        let (sum, count) = match self {
            Self::MassSpring(_) => (0.0, 0),
            Self::Springs(model) => model.residual(particles, lame, substep_s),
            Self::NeoHookean(model) => model.residual(particles, lame, substep_s),
        };
        (sum / count.max(1) as f64).sqrt() as f32
    }
}
