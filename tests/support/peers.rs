//! The meshes and answers that were recorded with other programs, in the folder of shared data.

#![allow(dead_code)] // Each test binary asks for a part of it.

use glam::DVec3;
use palpate::geom::TetMesh;
use palpate::geom::import::read_tets;
use palpate::geom::tet::lumped_masses_kg;
use palpate::reference::{Fem, FemSetup, Material};
use std::path::{Path, PathBuf};

/// What `PALPATE_SHARED` names (`../shared` beside the project if it is not set), or `None` and a
/// line that says so.
pub fn shared(inside: &str) -> Option<PathBuf> {
    let root = std::env::var_os("PALPATE_SHARED").map_or_else(
        || Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared"),
        PathBuf::from,
    );
    let path = root.join(inside);
    if path.exists() {
        return Some(path);
    }
    println!(
        "{} is absent; set PALPATE_SHARED to test against it",
        path.display()
    );
    None
}

/// A beam or an organ of the comparison: density 1000 kg/m³, gravity along −z.
pub struct Peer {
    pub tets: TetMesh,
    pub masses_kg: Vec<f32>,
    /// The face x = min of a beam, the lowest 15 % of an organ.
    pub fixed: Vec<bool>,
    /// The face x = max of a beam, the highest particle of an organ.
    pub tip: Vec<usize>,
}

impl Peer {
    /// The mesh of this name; `None` where the shared data are absent.
    pub fn load(name: &str) -> Option<Self> {
        let path = shared(&format!("peers/solver/meshes/{name}.msh"))?;
        let tets = read_tets(&path).expect("the mesh can be read").mesh;
        let axis = |axis: usize| tets.particles.iter().map(move |x| x[axis]);
        let low = |k| axis(k).fold(f32::INFINITY, f32::min);
        let high = |k| axis(k).fold(f32::NEG_INFINITY, f32::max);
        let (fixed, tip): (Vec<bool>, Vec<bool>) = if name.starts_with("organ") {
            let limit = low(2) + 0.15 * (high(2) - low(2));
            let top = high(2);
            (tets.particles.iter())
                .map(|x| (x.z <= limit, x.z >= top))
                .unzip()
        } else {
            let (near, far) = (low(0), high(0));
            let edge = 1e-6 * (far - near);
            (tets.particles.iter())
                .map(|x| (x.x <= near + edge, x.x >= far - edge))
                .unzip()
        };
        Some(Self {
            masses_kg: lumped_masses_kg(&tets, 1000.0),
            tip: (0..tip.len()).filter(|&i| tip[i]).collect(),
            fixed,
            tets,
        })
    }

    /// The body of the reference.
    pub fn fem(&self, youngs_modulus_pa: f64) -> Fem {
        Fem::new(&FemSetup {
            tets: &self.tets,
            masses_kg: &self.masses_kg,
            fixed: &self.fixed,
            fill: &[],
            material: Material::new(youngs_modulus_pa, 0.45),
            gravity_m_s2: DVec3::new(0.0, 0.0, -9.81),
        })
    }

    /// Mean displacement of the tip [m].
    pub fn tip_m(&self, positions: &[DVec3]) -> DVec3 {
        let sum: DVec3 = (self.tip.iter())
            .map(|&i| positions[i] - self.tets.particles[i].as_dvec3())
            .sum();
        sum / self.tip.len() as f64
    }
}
