//! The state of the particles.

use glam::{Vec3, Vec4};
use rayon::prelude::*;

/// Positions, velocities and inverse masses of a body.
#[derive(Clone, Debug)]
pub struct Particles {
    /// Position [m] and inverse mass [1/kg] of each particle, and one place that no particle owns
    /// (see `lanes::Corners`).
    pub places: Vec<Vec4>,
    /// Where each was when the substep started.
    pub previous: Vec<Vec4>,
    /// Velocities [m/s].
    pub velocities: Vec<Vec3>,
    /// Where each was when the step started: the last state known to be finite.
    finite: Vec<Vec4>,
}

/// Particles a task; fewer are not worth another thread.
const PARTICLES_PER_TASK: usize = 4096;

impl Particles {
    /// Particles at `rest`, still.
    pub fn new(rest: &[Vec3], inverse_masses: &[f32]) -> Self {
        let mut places: Vec<Vec4> = (rest.iter().zip(inverse_masses))
            .map(|(&x, &w)| x.extend(w))
            .collect();
        places.push(Vec4::ZERO);
        Self {
            previous: places.clone(),
            finite: places.clone(),
            velocities: vec![Vec3::ZERO; rest.len()],
            places,
        }
    }

    /// Remembers this state as the last finite one.
    pub fn keep_finite(&mut self) {
        self.finite.copy_from_slice(&self.places);
    }

    /// Moves every free particle by its velocity, after gravity and `accelerations` (one each, or
    /// none at all) have changed that.
    pub fn predict(&mut self, gravity_m_s2: Vec3, accelerations: Option<&[Vec3]>, substep_s: f32) {
        let count = self.velocities.len();
        self.places
            .par_chunks_mut(PARTICLES_PER_TASK)
            .zip(self.previous.par_chunks_mut(PARTICLES_PER_TASK))
            .zip(self.velocities.par_chunks_mut(PARTICLES_PER_TASK))
            .with_min_len(1 + (2 * PARTICLES_PER_TASK).saturating_sub(count))
            .enumerate()
            .for_each(|(task, ((places, previous), velocities))| {
                for (offset, velocity) in velocities.iter_mut().enumerate() {
                    let place = &mut places[offset];
                    previous[offset] = *place;
                    if place.w > 0.0 {
                        let own = accelerations
                            .map_or(Vec3::ZERO, |a| a[task * PARTICLES_PER_TASK + offset]);
                        *velocity += substep_s * (gravity_m_s2 + own);
                        *place += (substep_s * *velocity).extend(0.0);
                    }
                }
            });
    }

    /// Velocities from what the substep did to the positions.
    pub fn update_velocities(&mut self, substep_s: f32) {
        let per_s = 1.0 / substep_s;
        let count = self.velocities.len();
        self.velocities
            .par_iter_mut()
            .zip(&self.places)
            .zip(&self.previous)
            .with_min_len((2 * PARTICLES_PER_TASK).min(count + 1))
            .for_each(|((velocity, place), previous)| {
                *velocity = per_s * (place.truncate() - previous.truncate());
            });
    }

    /// Rolls every particle that is not finite back to where the step found it and holds it there.
    /// Returns how many of them were free before.
    pub fn freeze_if_not_finite(&mut self) -> usize {
        let mut frozen = 0;
        for (index, velocity) in self.velocities.iter_mut().enumerate() {
            if !(self.places[index].is_finite() && velocity.is_finite()) {
                let last = self.finite[index];
                self.places[index] = last.truncate().extend(0.0);
                *velocity = Vec3::ZERO;
                frozen += usize::from(last.w > 0.0);
            }
        }
        frozen
    }

    /// Fastest particle [m/s].
    pub fn speed_max_m_s(&self) -> f32 {
        self.velocities
            .iter()
            .map(|v| v.length_squared())
            .fold(0.0, f32::max)
            .sqrt()
    }
}
