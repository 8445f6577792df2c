//! Springs along the edges of the mesh, semi-implicit Euler: the baseline of every chart.
//!
//! A spring of stiffness k = E Σ V / L² (V: the tetrahedra round the edge) makes, on average over
//! directions, a body of Young's modulus E and Poisson's ratio 1/4: the energy of springs in all
//! directions is E/5 (2 ε:ε + tr² ε), that of a body with λ = μ = 2E/5.
//!
//! Source of the stiffness: Van Gelder, "Approximate Simulation of Elastic Membranes by
//! Triangulated Spring Meshes", JGT 3, 1998; the average is derived here.

use super::{muscle::Muscle, team::Team};
use crate::geom::TetMesh;
use glam::{Vec3, Vec4};
use std::collections::BTreeMap;

/// An edge of the mesh.
#[derive(Clone, Copy, Debug)]
pub struct Edge {
    pub particles: [u32; 2],
    pub rest_length_m: f32,
    /// Stiffness over modulus, Σ V / L² [m].
    pub stiffness_per_modulus_m: f32,
}

/// All edges of the tetrahedra `sound`, ordered by their particles.
pub fn edges_of(mesh: &TetMesh, sound: &[u32], fill: &[f32]) -> Vec<Edge> {
    let mut volumes: BTreeMap<[u32; 2], f64> = BTreeMap::new();
    for &tet in sound {
        let volume = super::diagnose::rest_volume_m3(mesh, tet as usize);
        let [a, b, c, d] = mesh.tets[tet as usize];
        for [i, j] in [[a, b], [a, c], [a, d], [b, c], [b, d], [c, d]] {
            let share = volumes.entry([i.min(j), i.max(j)]).or_default();
            *share += volume * f64::from(fill[tet as usize]);
        }
    }
    volumes
        .into_iter()
        .map(|(particles, volume)| {
            let [a, b] = particles.map(|i| mesh.particles[i as usize].as_dvec3());
            Edge {
                particles,
                rest_length_m: a.distance(b) as f32,
                stiffness_per_modulus_m: (volume / a.distance_squared(b)) as f32,
            }
        })
        .collect()
}

/// A spring as seen from one of its ends.
#[derive(Clone, Copy, Debug)]
struct Spring {
    other: u32,
    rest_length_m: f32,
    stiffness_per_modulus_m: f32,
}

/// All springs of a body, gathered at each particle: every sum has one order, whoever computes it.
#[derive(Clone, Debug)]
pub struct MassSpring {
    springs: Vec<Spring>,
    /// Where the springs of each particle start; one more at the end.
    starts: Vec<u32>,
    /// What of the body is muscle; nothing where it has never beaten.
    pub muscle: Option<Muscle>,
    accelerations: Vec<Vec4>,
}

/// Particles a chunk: some microseconds.
const PARTICLES_PER_CHUNK: usize = 64;

impl MassSpring {
    /// Springs along the edges of the tetrahedra `sound` of `mesh`, of which `fill` is tissue.
    pub fn new(mesh: &TetMesh, sound: &[u32], fill: &[f32]) -> Self {
        let mut at = vec![Vec::new(); mesh.particles.len()];
        for edge in edges_of(mesh, sound, fill) {
            let [a, b] = edge.particles;
            for (end, other) in [(a, b), (b, a)] {
                at[end as usize].push(Spring {
                    other,
                    rest_length_m: edge.rest_length_m,
                    stiffness_per_modulus_m: edge.stiffness_per_modulus_m,
                });
            }
        }
        let mut starts = vec![0];
        for springs in &at {
            starts.push(starts[starts.len() - 1] + springs.len() as u32);
        }
        Self {
            springs: at.concat(),
            starts,
            muscle: None,
            accelerations: vec![Vec4::ZERO; mesh.particles.len()],
        }
    }

    /// Acceleration of each particle [m/s²] by its springs, of Young's modulus `modulus_pa`.
    pub fn accelerations(&mut self, team: &Team, particles: &[Vec4], modulus_pa: f32) -> &[Vec4] {
        let (springs, starts, muscle) = (&self.springs, &self.starts, self.muscle.as_ref());
        let at = |index: usize| {
            let here = particles[index];
            let mut force = Vec3::ZERO;
            for spring in &springs[starts[index] as usize..starts[index + 1] as usize] {
                let edge = particles[spring.other as usize].truncate() - here.truncate();
                let length = edge.length();
                // Coincident particles have no direction to be pushed apart in.
                if length > super::constraint::LENGTH_MIN_M {
                    let rest_m = match muscle {
                        Some(muscle) => {
                            spring.rest_length_m * muscle.between(index, spring.other as usize)
                        }
                        None => spring.rest_length_m,
                    };
                    let stretch = (length - rest_m) / length;
                    force += edge * (modulus_pa * spring.stiffness_per_modulus_m * stretch);
                }
            }
            (here.w * force).extend(0.0)
        };
        team.for_runs(
            &mut self.accelerations,
            PARTICLES_PER_CHUNK,
            |start, run| {
                for (offset, acceleration) in run.iter_mut().enumerate() {
                    *acceleration = at(start + offset);
                }
            },
        );
        &self.accelerations
    }

    /// A substep [s] that is sure to be stable, 2/ω: by Gershgorin's bound ω² ≤ max 2 w Σ k. The
    /// true edge is higher by up to √3, since springs pull along their own direction only.
    pub fn stable_substep_s(&self, particles: &[Vec4], modulus_pa: f32) -> f32 {
        let highest = (0..self.starts.len() - 1)
            .map(|i| {
                let own = &self.springs[self.starts[i] as usize..self.starts[i + 1] as usize];
                // Mass-scaled rows: w_i Σ k + Σ √(w_i w_j) k, at most the row's own part plus what
                // the lighter end makes of it.
                own.iter()
                    .map(|spring| {
                        let k = modulus_pa * spring.stiffness_per_modulus_m;
                        let (wi, wj) = (particles[i].w, particles[spring.other as usize].w);
                        k * (wi + (wi * wj).sqrt())
                    })
                    .sum::<f32>()
            })
            .fold(0.0, f32::max);
        2.0 / highest.sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::lanes::add_spare;
    use crate::{geom::lattice::block_of_cells, sim::constraint};

    #[test]
    fn accelerations_are_the_negative_gradient_of_the_energy_over_the_mass() {
        let (_, lattice) = block_of_cells(Vec3::new(0.02, 0.01, 0.01), [2, 1, 1]);
        let mesh = &lattice.tets;
        let all: Vec<u32> = (0..mesh.tets.len() as u32).collect();
        let fill = vec![1.0; mesh.tets.len()];
        let edges = edges_of(mesh, &all, &fill);
        let modulus_pa = 1e4_f32;
        let inverse_mass = 500.0_f32;
        let mut places: Vec<Vec4> = (mesh.particles.iter().enumerate())
            .map(|(i, &x)| {
                let shake = Vec3::new((i % 3) as f32 - 1.0, (i % 5) as f32 - 2.0, (i % 2) as f32);
                (x + 5e-4 * shake).extend(inverse_mass)
            })
            .collect();
        add_spare(&mut places);
        let mut gradient = vec![Vec3::ZERO; mesh.particles.len()];
        for edge in &edges {
            let x = edge.particles.map(|i| places[i as usize].truncate());
            let c = constraint::distance(x, edge.rest_length_m).expect("the ends are apart");
            for (end, particle) in edge.particles.into_iter().enumerate() {
                let k = modulus_pa * edge.stiffness_per_modulus_m;
                gradient[particle as usize] += k * c.value * c.gradient[end];
            }
        }
        let mut model = MassSpring::new(mesh, &all, &fill);
        let found = model.accelerations(&Team::alone(), &places, modulus_pa);
        for (found, gradient) in found.iter().zip(&gradient) {
            let expected = -inverse_mass * *gradient;
            // Sums of some fifteen forces in f32.
            let size = expected.length().max(1.0);
            assert!(
                found.truncate().distance(expected) < 1e-4 * size,
                "{found} is not {expected}"
            );
        }
    }

    #[test]
    fn coincident_particles_have_no_acceleration_that_is_not_finite() {
        let (_, lattice) = block_of_cells(Vec3::splat(0.01), [1, 1, 1]);
        let all: Vec<u32> = (0..5).collect();
        let mut model = MassSpring::new(&lattice.tets, &all, &[1.0; 5]);
        let places = vec![Vec3::ONE.extend(1.0); 9];
        let found = model.accelerations(&Team::alone(), &places, 1e4);
        assert!(found.iter().all(|a| *a == Vec4::ZERO));
    }
}
