//! What holds the surface from outside: tools that are in the way, friction, and grips.
//!
//! Each acts at a place s = Σ weight · displacement of a few nodes, by an energy that is convex and
//! has a continuous gradient. A tool in the way is the inequality gap ≥ 0, treated as an augmented
//! Lagrangian: k/2 max(0, λ/k − gap)², whose force max(0, λ − k gap) becomes the multiplier λ of the
//! next round, so that the gap closes although k is no stiffer than Newton's method likes. Friction
//! and grips pull towards an anchor, like a spring up to a largest force and with just that force
//! beyond (Huber): for friction the anchor is where the place stuck, and the force Coulomb's.
//!
//! Source: Nocedal, Wright, "Numerical Optimization", 2nd ed., 2006, ch. 17.

use super::matrix::BlockMatrix;
use glam::{DMat3, DVec3, DVec4, Vec4};

/// A place between nodes.
#[derive(Clone, Debug)]
pub struct Place {
    /// Nodes and their weights.
    pub carriers: Vec<(u32, f64)>,
}

impl Place {
    /// Displacement of the place [m].
    pub fn displacement(&self, displacements: &[DVec4]) -> DVec3 {
        let carried = |&(node, weight): &(u32, f64)| weight * displacements[node as usize];
        self.carriers.iter().map(carried).sum::<DVec4>().truncate()
    }

    /// Stiffness of the body at the place, about, with that of each free node [N/m]; 0 if none of
    /// its nodes is free.
    pub fn stiffness(&self, of_nodes: &[f32]) -> f64 {
        let give = |(node, weight): (usize, f64)| weight * weight / f64::from(of_nodes[node]);
        let give: f64 = self.free(of_nodes.len()).map(give).sum();
        if give > 0.0 { 1.0 / give } else { 0.0 }
    }

    fn free(&self, count: usize) -> impl Iterator<Item = (usize, f64)> {
        let carriers = self
            .carriers
            .iter()
            .map(|&(node, weight)| (node as usize, weight));
        carriers.filter(move |&(node, _)| node < count)
    }
}

/// A tool in the way.
#[derive(Clone, Debug)]
pub struct Barrier {
    /// Out of the tool, of length 1.
    pub normal: DVec3,
    /// Gap at displacement 0 of the place [m].
    pub gap_m: f64,
    /// Multiplier [N].
    pub force_n: f64,
    /// k [N/m].
    pub stiffness: f64,
    /// For each carrier of the place, how the slope of the surface follows it, times the root of the
    /// tool's radius [1/√m].
    pub slopes: Vec<DVec3>,
}

impl Barrier {
    /// Force at displacement `s` of the place, along the normal [N].
    fn force_at(&self, s: DVec3) -> f64 {
        (self.force_n - self.stiffness * self.gap_at(s)).max(0.0)
    }

    /// Gap at displacement `s` of the place [m].
    fn gap_at(&self, s: DVec3) -> f64 {
        self.gap_m + self.normal.dot(s)
    }
}

/// A pull towards an anchor.
#[derive(Clone, Debug)]
pub struct Pull {
    /// The directions in which it pulls.
    pub across: DMat3,
    /// Displacement of the place at which it pulls with nothing but `force_n` [m].
    pub anchor_m: DVec3,
    /// Force there [N].
    pub force_n: DVec3,
    /// [N/m]
    pub stiffness: f64,
    pub force_max_n: f64,
}

impl Pull {
    /// Force at displacement `s` of the place if there were no largest one [N].
    fn spring_at(&self, s: DVec3) -> DVec3 {
        self.force_n - self.stiffness * (self.across * (s - self.anchor_m))
    }

    fn force_at(&self, s: DVec3) -> DVec3 {
        self.spring_at(s).clamp_length_max(self.force_max_n)
    }

    fn energy_at(&self, s: DVec3) -> f64 {
        let force_n = self.spring_at(s).length();
        let within_n = force_n.min(self.force_max_n);
        within_n * (force_n - 0.5 * within_n) / self.stiffness
    }

    /// Second derivative of a parabola that touches the energy at `s` and is nowhere below it: with
    /// it a step never goes too far, which with the second derivative itself it does where a place
    /// begins or ceases to slip.
    fn stiffness_at(&self, s: DVec3) -> DMat3 {
        let force_n = self.spring_at(s).length();
        let share = if force_n > self.force_max_n {
            self.force_max_n / force_n
        } else {
            1.0
        };
        share * self.stiffness * self.across
    }
}

/// A place that is held.
#[derive(Clone, Debug)]
pub struct Hold {
    pub place: Place,
    pub barrier: Option<Barrier>,
    /// Friction, or a grip.
    pub pull: Option<Pull>,
    /// Coulomb's coefficient of friction, with a barrier.
    pub friction: f64,
}

impl Hold {
    /// Force on the place [N].
    pub fn force_n(&self, displacements: &[DVec4]) -> DVec3 {
        let s = self.place.displacement(displacements);
        let pushed = (self.barrier.as_ref()).map_or(DVec3::ZERO, |b| b.force_at(s) * b.normal);
        pushed
            + self
                .pull
                .as_ref()
                .map_or(DVec3::ZERO, |pull| pull.force_at(s))
    }

    /// Energy [J]; adds the forces on free nodes to `residual` [N].
    pub fn add_forces(&self, displacements: &[DVec4], residual: &mut [Vec4]) -> f64 {
        let s = self.place.displacement(displacements);
        let mut energy_j = 0.0;
        let mut force = DVec3::ZERO;
        if let Some(barrier) = &self.barrier {
            let pushed = barrier.force_at(s);
            energy_j += 0.5 * pushed * pushed / barrier.stiffness;
            force += pushed * barrier.normal;
        }
        if let Some(pull) = &self.pull {
            energy_j += pull.energy_at(s);
            force += pull.force_at(s);
        }
        for (node, weight) in self.place.free(residual.len()) {
            residual[node] += (weight * force).as_vec3().extend(0.0);
        }
        energy_j
    }

    /// Takes the forces for the multipliers of the next round. How much the one of the barrier has
    /// changed [N].
    pub fn update_multipliers(&mut self, displacements: &[DVec4]) -> f64 {
        let s = self.place.displacement(displacements);
        let Some(barrier) = &mut self.barrier else {
            // The pull of a grip is that of a spring: it has no multiplier.
            return 0.0;
        };
        let force_n = barrier.force_at(s);
        let before_n = std::mem::replace(&mut barrier.force_n, force_n);
        if let Some(pull) = &mut self.pull {
            pull.force_n = pull.force_at(s);
            pull.force_max_n = self.friction * force_n;
        }
        (force_n - before_n).abs()
    }

    /// Adds the second derivative of the energy to the blocks on and right of the diagonal.
    ///
    /// Where the matrix has no block for a pair of nodes, as much is added to both diagonals as
    /// keeps the sum positive.
    pub fn add_stiffness(&self, displacements: &[DVec4], matrix: &mut BlockMatrix) {
        let s = self.place.displacement(displacements);
        let mut stiffness = DMat3::ZERO;
        if let Some(barrier) = self.barrier.as_ref().filter(|b| b.force_at(s) > 0.0) {
            stiffness += barrier.stiffness * outer(barrier.normal, barrier.normal);
        }
        if let Some(pull) = &self.pull {
            stiffness += pull.stiffness_at(s);
        }
        if stiffness == DMat3::ZERO {
            return;
        }
        let count = matrix.len();
        let tilting = self.tilting(s);
        for (a, weight_a, slope_a) in self.free(count) {
            for (b, weight_b, slope_b) in self.free(count).filter(|&(b, ..)| b >= a) {
                let value = weight_a * weight_b * stiffness + slope_a.dot(slope_b) * tilting;
                match matrix.find(a as u32, b as u32) {
                    Some(place) => add(matrix, place as usize, value),
                    None => {
                        let value = (weight_a * weight_b).abs() * stiffness
                            + slope_a.dot(slope_b).abs() * tilting;
                        for node in [a, b] {
                            add(matrix, matrix.diagonal(node), value);
                        }
                    }
                }
            }
        }
    }

    /// What a tilt of the surface adds to the stiffness: the place wanders on a surface that tilts,
    /// which the gap, being linear in the place, does not know. Without it the place is found on one
    /// side and on the other in turn.
    fn tilting(&self, s: DVec3) -> DMat3 {
        (self.barrier.as_ref()).map_or(DMat3::ZERO, |barrier| {
            barrier.force_at(s) * outer(barrier.normal, barrier.normal)
        })
    }

    /// Free carriers of the place, with their weights and slopes.
    fn free(&self, count: usize) -> impl Iterator<Item = (usize, f64, DVec3)> {
        let slopes = self
            .barrier
            .as_ref()
            .map_or(&[][..], |barrier| &barrier.slopes);
        let slopes = slopes.iter().copied().chain(std::iter::repeat(DVec3::ZERO));
        let carriers = self.place.carriers.iter().zip(slopes);
        let carriers = carriers.map(|(&(node, weight), slope)| (node as usize, weight, slope));
        carriers.filter(move |&(node, ..)| node < count)
    }
}

fn add(matrix: &mut BlockMatrix, place: usize, stiffness: DMat3) {
    let block = &mut matrix.blocks_mut()[place];
    let columns = [stiffness.x_axis, stiffness.y_axis, stiffness.z_axis];
    for (sum, column) in block.iter_mut().zip(columns) {
        *sum += column.as_vec3().extend(0.0);
    }
}

/// a ⊗ b.
pub fn outer(a: DVec3, b: DVec3) -> DMat3 {
    DMat3::from_cols(b.x * a, b.y * a, b.z * a)
}

#[cfg(test)]
mod tests;
