//! The meshes and answers that were recorded with other programs, in the folder of shared data.

#![allow(dead_code)] // Each test binary asks for a part of it.

use glam::DVec3;
use palpate::geom::TetMesh;
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
    /// Particles at rest as the file has them, before they are rounded to f32 [m].
    pub rest_m: Vec<DVec3>,
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
        let text = std::fs::read_to_string(path).expect("the mesh can be read");
        let (rest_m, tets) = gmsh_2_tets(&text);
        let tets = TetMesh {
            particles: rest_m.iter().map(|x| x.as_vec3()).collect(),
            tets,
        };
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
            rest_m,
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

    /// Mean displacement of the tip of a body that rests at `rest` [m].
    pub fn tip_m(&self, positions: &[DVec3], rest: &[DVec3]) -> DVec3 {
        let sum: DVec3 = self.tip.iter().map(|&i| positions[i] - rest[i]).sum();
        sum / self.tip.len() as f64
    }
}

/// Nodes [m] and tetrahedra of a Gmsh 2.2 ASCII file of nodes 1, 2, 3 … and nothing else.
fn gmsh_2_tets(text: &str) -> (Vec<DVec3>, Vec<[u32; 4]>) {
    let section = |name: &str| -> Vec<Vec<f64>> {
        (text.lines())
            .skip_while(|line| line.trim() != format!("${name}"))
            .skip(2)
            .take_while(|line| !line.starts_with('$'))
            .map(|line| {
                let words = line.split_whitespace();
                words.map(|word| word.parse().expect("a number")).collect()
            })
            .collect()
    };
    let nodes = section("Nodes")
        .iter()
        .map(|n| DVec3::from_slice(&n[1..]))
        .collect();
    let tets = (section("Elements").iter())
        .filter(|e| e[1] == 4.0)
        .map(|e| std::array::from_fn(|k| e[e.len() - 4 + k] as u32 - 1))
        .collect();
    (nodes, tets)
}

/// A quarter of each tetrahedron's mass for each of its corners [kg].
pub fn lumped_masses_kg(tets: &TetMesh, density_kg_m3: f64) -> Vec<f32> {
    let mut masses = vec![0.0; tets.particles.len()];
    for tet in &tets.tets {
        let [a, b, c, d] = tet.map(|i| tets.particles[i as usize].as_dvec3());
        let volume = (b - a).dot((c - a).cross(d - a)) / 6.0;
        for &corner in tet {
            masses[corner as usize] += density_kg_m3 * volume / 4.0;
        }
    }
    masses.iter().map(|&mass| mass as f32).collect()
}
