//! Where a body comes to rest and how it swings, solved at length in f64 and kept on disk.

use super::held_body::HeldBody;
use super::random::Random;
use crate::app::AppError;
use crate::measure::files;
use crate::reference::{Fem, FemSetup, Material, NoEquilibrium, Swing};
use glam::DVec3;
use serde::{Deserialize, Serialize};
use sha2::{Digest, Sha256};
use std::path::Path;

/// Tissue of the oracle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Tissue {
    pub youngs_modulus_pa: f64,
    pub poisson_ratio: f64,
}

/// How far the motion is followed; a frame is as long as the studies' time step.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Motion {
    pub frames: usize,
    pub frame_s: f64,
    pub steps_per_frame: usize,
}

/// The answer.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Oracle {
    /// What it is the answer to.
    inputs_sha256: String,
    /// Particles at rest under gravity [m].
    pub settled_m: Vec<DVec3>,
    /// Height of the tip over its rest [m] at the end of each frame of the undamped release, the
    /// start included; empty where that is too much work.
    pub swing_m: Vec<f64>,
}

impl Oracle {
    /// The oracle for `body`, from `file` if it is there and of the same inputs.
    ///
    /// # Errors
    ///
    /// [`AppError::Body`] if the body has no equilibrium, or a step of its motion no solution;
    /// [`AppError::File`] if the file can't be written.
    pub fn kept(
        file: &Path,
        body: &HeldBody,
        tissue: Tissue,
        motion: Option<Motion>,
    ) -> Result<Self, AppError> {
        let inputs_sha256 = hash(body, tissue, motion);
        let kept = std::fs::read(file).ok();
        let kept = kept.and_then(|bytes| serde_json::from_slice::<Self>(&bytes).ok());
        if let Some(kept) = kept.filter(|kept| kept.inputs_sha256 == inputs_sha256) {
            return Ok(kept);
        }
        let fem = fem(body, tissue);
        let settled_m = fem
            .statics()
            .map_err(|error| AppError::Body(error.to_string()))?
            .positions;
        let mut swing_m = Vec::new();
        if let Some(motion) = motion {
            let height = |positions: &[DVec3]| body.tip_of_oracle_m(positions).z;
            let start = fem.at_rest();
            swing_m.push(height(&start.positions));
            let swing = Swing {
                frames: motion.frames,
                frame_s: motion.frame_s,
                steps_per_frame: motion.steps_per_frame,
                damping_per_s: 0.0,
            };
            fem.swing(start, &swing, |_, state| {
                swing_m.push(height(&state.positions))
            })
            .map_err(|error| AppError::Body(error.to_string()))?;
        }
        let oracle = Self {
            inputs_sha256,
            settled_m,
            swing_m,
        };
        let text = serde_json::to_string(&oracle).expect("an oracle is plain data");
        files::write(file, text.as_bytes())?;
        Ok(oracle)
    }
}

/// Where `body` comes to rest [m].
///
/// # Errors
///
/// [`NoEquilibrium`] if Newton's method finds none.
pub fn settled_m(body: &HeldBody, tissue: Tissue) -> Result<Vec<DVec3>, NoEquilibrium> {
    Ok(fem(body, tissue).statics()?.positions)
}

/// Elastic energy of `body` at rest with each free coordinate off by up to half its last digit in f32, as
/// it is once rounded [J].
pub fn rounding_j(body: &HeldBody, tissue: Tissue) -> f64 {
    let mut random = Random::new(1);
    let mut off = |x: f32| {
        let digit = f64::from(x.abs().next_up()) - f64::from(x.abs());
        f64::from(x) + digit * f64::from(random.between(-0.5, 0.5))
    };
    let mut places: Vec<DVec3> = Vec::new();
    for (x, fixed) in body.setup.tets.particles.iter().zip(&body.setup.fixed) {
        places.push(match fixed {
            true => x.as_dvec3(),
            false => DVec3::new(off(x.x), off(x.y), off(x.z)),
        });
    }
    fem(body, tissue).elastic_energy_j(&places)
}

fn fem(body: &HeldBody, tissue: Tissue) -> Fem {
    let setup = &body.setup;
    Fem::new(&FemSetup {
        tets: &setup.tets,
        masses_kg: &setup.masses_kg,
        fixed: &setup.fixed,
        fill: &setup.fill,
        material: Material::new(tissue.youngs_modulus_pa, tissue.poisson_ratio),
        gravity_m_s2: setup.gravity_m_s2.as_dvec3(),
    })
}

fn hash(body: &HeldBody, tissue: Tissue, motion: Option<Motion>) -> String {
    let setup = &body.setup;
    let mut hash = Sha256::new();
    hash.update(bytemuck::cast_slice(&setup.tets.particles));
    hash.update(bytemuck::cast_slice(&setup.tets.tets));
    hash.update(bytemuck::cast_slice(&setup.masses_kg));
    hash.update(bytemuck::cast_slice(&setup.fill));
    hash.update(setup.fixed.iter().map(|&f| u8::from(f)).collect::<Vec<_>>());
    hash.update(format!("{:?} {tissue:?} {motion:?}", setup.gravity_m_s2));
    hash.finalize()
        .iter()
        .map(|byte| format!("{byte:02x}"))
        .collect()
}
