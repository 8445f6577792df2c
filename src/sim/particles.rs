//! The state of the particles.

use super::{
    lanes::add_spare,
    team::{SharedSlice, Team},
};
use glam::{Vec3, Vec3A, Vec4};

/// Positions, velocities and inverse masses of a body.
#[derive(Clone, Debug)]
pub struct Particles {
    /// Position [m] and inverse mass [1/kg] of each particle, and the spare places that
    /// `lanes::Batches` want.
    pub places: Vec<Vec4>,
    /// Where each was when the substep started.
    pub previous: Vec<Vec4>,
    /// Velocities [m/s].
    pub velocities: Vec<Vec3>,
    /// Where each was when the step started: the last state known to be finite.
    finite: Vec<Vec4>,
}

/// Particles a chunk: about half a microsecond.
const PARTICLES_PER_CHUNK: usize = 256;

impl Particles {
    /// Particles at `rest`, still.
    pub fn new(rest: &[Vec3], inverse_masses: &[f32]) -> Self {
        let mut places: Vec<Vec4> = (rest.iter().zip(inverse_masses))
            .map(|(&x, &w)| x.extend(w))
            .collect();
        add_spare(&mut places);
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

    /// Moves every free particle by its velocity, after gravity and `accelerations` (one each at
    /// least, or none at all) have changed that.
    pub fn predict(
        &mut self,
        team: &Team,
        gravity_m_s2: Vec3,
        accelerations: Option<&[Vec4]>,
        substep_s: f32,
    ) {
        let places = SharedSlice::new(&mut self.places);
        let previous = SharedSlice::new(&mut self.previous);
        team.for_runs(&mut self.velocities, PARTICLES_PER_CHUNK, |start, run| {
            let end = start + run.len();
            // SAFETY: as the runs of velocities, those of places do not overlap.
            let (places, previous) = unsafe { (places.run(start, end), previous.run(start, end)) };
            previous.copy_from_slice(places);
            for (offset, (velocity, place)) in run.iter_mut().zip(places).enumerate() {
                if place.w > 0.0 {
                    let own = accelerations.map_or(Vec3::ZERO, |a| a[start + offset].truncate());
                    *velocity += substep_s * (gravity_m_s2 + own);
                    *place += (substep_s * *velocity).extend(0.0);
                }
            }
        });
    }

    /// Velocities from what the substep did to the positions.
    pub fn update_velocities(&mut self, team: &Team, substep_s: f32) {
        let per_s = 1.0 / substep_s;
        let (places, previous) = (&self.places, &self.previous);
        team.for_runs(&mut self.velocities, PARTICLES_PER_CHUNK, |start, run| {
            for (offset, velocity) in run.iter_mut().enumerate() {
                let way = places[start + offset] - previous[start + offset];
                *velocity = per_s * way.truncate();
            }
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

    /// Farthest that a particle is from its place in `others` [m].
    pub fn farthest_m(&self, others: &[Vec4]) -> f32 {
        (self.places.iter().zip(others))
            .map(|(place, other)| (*place - *other).truncate().length_squared())
            .fold(0.0, f32::max)
            .sqrt()
    }

    /// Volume of tetrahedra [m³] and the number of negative ones. Each in f32, with an error of less
    /// than 10⁻⁶ of the cube of its longest edge, the sum in f64.
    pub fn volume_and_inverted(&self, tets: &[[u32; 4]]) -> (f64, usize) {
        let (mut sum, mut inverted) = (0.0, 0);
        for tet in tets {
            let [a, b, c, d] = tet.map(|i| Vec3A::from_vec4(self.places[i as usize]));
            let volume = (b - a).dot((c - a).cross(d - a)) / 6.0;
            sum += f64::from(volume);
            inverted += usize::from(volume < 0.0);
        }
        (sum, inverted)
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
