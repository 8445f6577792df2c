//! Newton's method on the potential of a body: line search, and a shift where the stiffness is not
//! positive definite.

use super::Fem;
use glam::DVec3;

/// Iterations at most; a swing takes 3 or 4, a large load step 10.
const ITERATIONS_MAX: usize = 200;
/// A step has to bring this share of what its slope promises (Armijo's condition).
const DECREASE_SHARE: f64 = 1e-4;
/// Steps below this share of Newton's step get nowhere.
const STEP_SHARE_MIN: f64 = 1e-10;
/// Rounding of an energy, as a share of its parts.
const ENERGY_ROUNDING: f64 = 1e-14;

/// Kinetic part of a time step: ½ `per_s2` Σ m |x − predicted|².
#[derive(Clone, Debug)]
pub struct Inertia {
    pub per_s2: f64,
    pub predicted: Vec<DVec3>,
}

/// What is minimised: elastic energy, the potential of `load_share` of the load, and inertia.
#[derive(Debug)]
pub struct Potential<'a> {
    pub fem: &'a Fem,
    pub load_share: f64,
    pub inertia: Option<Inertia>,
}

/// Where Newton's method ended.
#[derive(Clone, Copy, Debug)]
pub struct Ended {
    /// Norm of the forces that are left on free particles [N].
    pub residual_n: f64,
    pub iterations: usize,
}

impl Potential<'_> {
    /// The potential [J], and the size of the terms it is the sum of.
    fn value(&self, positions: &[DVec3]) -> (f64, f64) {
        let elastic = self.fem.elastic_energy_j(positions);
        let load = self.load_share * self.fem.load_energy_j(positions);
        let kinetic = self.inertia.as_ref().map_or(0.0, |inertia| {
            let places = positions.iter().zip(&inertia.predicted);
            let sum: f64 = (places.zip(self.fem.masses_kg()))
                .map(|((x, predicted), mass)| mass * x.distance_squared(*predicted))
                .sum();
            0.5 * inertia.per_s2 * sum
        });
        // Near rest an elastic energy is a small difference of terms of the size of the modulus.
        let terms = elastic.abs() + load.abs() + kinetic + self.fem.modulus_times_volume_j();
        (elastic + load + kinetic, terms)
    }

    /// Derivative by the free particles [N].
    fn gradient(&self, positions: &[DVec3]) -> Vec<f64> {
        let elastic = self.fem.elastic_forces_n(positions);
        (self.fem.free_particles().iter())
            .flat_map(|&particle| {
                let i = particle as usize;
                let mut slope = -elastic[i] - self.load_share * self.fem.forces_n()[i];
                if let Some(inertia) = &self.inertia {
                    let away = positions[i] - inertia.predicted[i];
                    slope += inertia.per_s2 * self.fem.masses_kg()[i] * away;
                }
                slope.to_array()
            })
            .collect()
    }

    /// Second derivative by the free particles [N/m].
    fn hessian(&self, positions: &[DVec3], values: &mut Vec<f64>) {
        self.fem.stiffness(positions, values);
        if let Some(inertia) = &self.inertia {
            for (row, &place) in self.fem.pattern().diagonal().iter().enumerate() {
                let particle = self.fem.free_particles()[row / 3] as usize;
                values[place as usize] += inertia.per_s2 * self.fem.masses_kg()[particle];
            }
        }
    }

    /// The direction to go in, −(H + shift)⁻¹ gradient, with the smallest shift that makes the
    /// matrix positive definite.
    fn direction(&self, positions: &[DVec3], gradient: &[f64], values: &mut Vec<f64>) -> Vec<f64> {
        self.hessian(positions, values);
        let diagonal = self.fem.pattern().diagonal();
        let sum: f64 = diagonal.iter().map(|&d| values[d as usize].abs()).sum();
        let mean = sum / diagonal.len() as f64;
        let mut direction: Vec<f64> = gradient.iter().map(|g| -g).collect();
        let mut shift = 1e-3 * mean;
        while !self.fem.pattern().solve(values, &mut direction) {
            for &place in diagonal {
                values[place as usize] += shift;
            }
            shift *= 4.0;
        }
        direction
    }

    /// Moves the free particles to a minimum: until the forces left are below `tolerance_n`, or
    /// nothing that can be told from rounding is gained any more.
    pub fn minimise(&self, positions: &mut Vec<DVec3>, tolerance_n: f64) -> Ended {
        let mut values = Vec::new();
        let mut gradient = self.gradient(positions);
        let mut iterations = 0;
        while norm(&gradient) > tolerance_n && iterations < ITERATIONS_MAX {
            let direction = self.direction(positions, &gradient, &mut values);
            let slope = dot(&direction, &gradient);
            let (before, size) = self.value(positions);
            let mut share = 1.0;
            let moved = loop {
                let moved = self.moved(positions, &direction, share);
                let after = self.value(&moved).0;
                // NaN and infinities are no decrease.
                if after <= before + DECREASE_SHARE * share * slope + ENERGY_ROUNDING * size {
                    break Some(moved);
                }
                share *= 0.5;
                if share < STEP_SHARE_MIN {
                    break None;
                }
            };
            let Some(moved) = moved else { break };
            *positions = moved;
            gradient = self.gradient(positions);
            iterations += 1;
        }
        Ended {
            residual_n: norm(&gradient),
            iterations,
        }
    }

    fn moved(&self, positions: &[DVec3], direction: &[f64], share: f64) -> Vec<DVec3> {
        let mut moved = positions.to_vec();
        for (&particle, d) in self.fem.free_particles().iter().zip(direction.chunks(3)) {
            moved[particle as usize] += share * DVec3::new(d[0], d[1], d[2]);
        }
        moved
    }
}

fn dot(a: &[f64], b: &[f64]) -> f64 {
    a.iter().zip(b).map(|(a, b)| a * b).sum()
}

fn norm(a: &[f64]) -> f64 {
    dot(a, a).sqrt()
}
