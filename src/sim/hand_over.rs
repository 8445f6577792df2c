//! When `xpbd-neo-hookean` is not fit for a body, and `implicit` takes its place.

use super::{Method, Simulation, SolverParams};

/// Substeps of `implicit` for a body that it is handed: the swing is then within 0.2 %, and fast tools stay out.
const SUBSTEPS_MAX: u32 = 4;

/// Why a body is handed over.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum HandOver {
    /// With the substeps that it has it would carry only a part of its stress over, and sag too far.
    TooStiff,
    /// Waves have grown in it, and it would sag from then on.
    WavesGrew,
    /// Poor tetrahedra of it go back and forth.
    Trembled,
    /// Tetrahedra of it stay inside out.
    Folded,
}

impl HandOver {
    /// Hands a body that has not moved yet to `implicit` where `xpbd-neo-hookean` would need more substeps than it has
    /// to be as stiff as it is said to be. More substeps would do as well, but cost more.
    pub fn at_start(simulation: &mut Simulation) -> Option<Self> {
        let is_stiff = simulation.faithful_substeps().is_some();
        is_stiff.then(|| Self::TooStiff.take(simulation))
    }

    /// The same after a step, by what the body has shown.
    pub fn after_step(simulation: &mut Simulation) -> Option<Self> {
        let sags = simulation.sags() && simulation.faithful_substeps().is_some();
        if sags || simulation.waves_grow_on() {
            Some(Self::WavesGrew.take(simulation))
        } else if simulation.trembles() {
            Some(Self::Trembled.take(simulation))
        } else if simulation.is_folded() {
            Some(Self::Folded.take(simulation))
        } else {
            None
        }
    }

    /// Hands the body over for this reason.
    pub fn take(self, simulation: &mut Simulation) -> Self {
        let asked = simulation.params();
        simulation.set_params(SolverParams {
            method: Method::Implicit,
            substeps: asked.substeps.min(SUBSTEPS_MAX),
            ..asked
        });
        self
    }
}
