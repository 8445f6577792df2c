//! A tool that holds part of the surface.

use super::handle::Handle;
use crate::geom::Embedding;
use glam::{Vec3, Vec4};
use std::collections::BTreeSet;

/// The pull is limited to what stretches the grabbed part to about this strain by itself.
const STRAIN_MAX: f32 = 2.0;
/// Stiffness of the hold over that of the tissue it holds.
const STIFFNESS_OVER_TISSUE: f32 = 20.0;
/// What is pulled beforehand, as in the last substep, moves no point by more than this share of the
/// radius.
const PULL_ON_RADII: f32 = 0.5;
/// If the tool reaches no point, the nearest one within this many radii is held.
const REACH_RADII: f32 = 3.0;

/// Surface points held by a tool.
#[derive(Clone, Debug)]
pub struct Grab {
    holds: Vec<Hold>,
    /// Compliance of each hold [m/N].
    compliance_m_per_n: f32,
    /// Largest force of each hold [N].
    force_max_n: f32,
    /// Radius of the tool [m].
    radius_m: f32,
}

/// One point held.
#[derive(Clone, Debug)]
struct Hold {
    handle: Handle,
    /// From the tool to the point when the tool closed [m].
    offset: Vec3,
    /// Multiplier of this substep [kg m].
    multiplier: Vec3,
}

/// A place held, as it is seen by a solver that solves for all positions at once.
#[derive(Clone, Copy, Debug)]
pub struct ActiveHold {
    pub handle: Handle,
    /// Where it is pulled to [m].
    pub target_m: Vec3,
    /// Of the pull [N/m].
    pub stiffness_n_per_m: f32,
    /// Largest pull [N].
    pub force_max_n: f32,
}

/// The tissue that is grabbed, for limits that follow it.
#[derive(Clone, Copy, Debug)]
pub struct Tissue {
    pub youngs_modulus_pa: f32,
    pub density_kg_m3: f32,
    /// Mean edge of the tetrahedra [m].
    pub edge_m: f32,
}

impl Grab {
    /// Closes the tool at `position_m`. `None` if no surface point is near or none can move.
    ///
    /// The limit on the pull is one on acceleration, 2 E / (ρ L), with L the radius of the grabbed
    /// part: a wave needs L/c to cross it, and pulling harder than that stretches what is held
    /// before the rest has felt it.
    pub fn close(
        position_m: Vec3,
        radius_m: f32,
        points: &[Vec3],
        embedding: &Embedding,
        places: &[Vec4],
        tissue: Tissue,
    ) -> Option<Self> {
        let mut held: Vec<usize> = (0..points.len())
            .filter(|&i| points[i].distance(position_m) <= radius_m)
            .collect();
        if held.is_empty() {
            let nearest = (0..points.len()).min_by(|&a, &b| {
                let distance = |i: usize| points[i].distance(position_m);
                distance(a).total_cmp(&distance(b))
            })?;
            if points[nearest].distance(position_m) <= REACH_RADII * radius_m {
                held.push(nearest);
            }
        }
        let holds: Vec<Hold> = held
            .into_iter()
            .map(|point| Hold {
                handle: Handle::of_point(embedding, point, places),
                offset: points[point] - position_m,
                multiplier: Vec3::ZERO,
            })
            .filter(|hold| hold.handle.inverse_mass > 0.0)
            .collect();
        if holds.is_empty() {
            return None;
        }
        let carriers: BTreeSet<u32> = holds
            .iter()
            .flat_map(|hold| hold.handle.carriers())
            .map(|(particle, _)| particle)
            .collect();
        let mass_kg: f32 = carriers
            .into_iter()
            .map(|particle| places[particle as usize].w)
            .filter(|&inverse_mass| inverse_mass > 0.0)
            .map(|inverse_mass| 1.0 / inverse_mass)
            .sum();
        let length_m = radius_m.max(tissue.edge_m);
        let acceleration_max =
            STRAIN_MAX * tissue.youngs_modulus_pa / (tissue.density_kg_m3 * length_m);
        let stiffness = STIFFNESS_OVER_TISSUE * tissue.youngs_modulus_pa * length_m;
        let share = 1.0 / holds.len() as f32;
        Some(Self {
            holds,
            compliance_m_per_n: 1.0 / (share * stiffness),
            force_max_n: share * mass_kg * acceleration_max,
            radius_m,
        })
    }

    /// Starts a substep by pulling as in the last one, before anything answers: a body that hangs
    /// still is pulled by the right amount then. `scale` is h² over that of the last substep.
    pub fn pull_on(&mut self, scale: f32, places: &mut [Vec4]) {
        let farthest_m = (self.holds.iter())
            .map(|hold| scale * hold.multiplier.length() * hold.handle.inverse_mass)
            .fold(0.0, f32::max);
        let share = scale * (PULL_ON_RADII * self.radius_m / farthest_m).min(1.0);
        for hold in &mut self.holds {
            hold.multiplier *= share;
            hold.handle.push(places, hold.multiplier);
        }
    }

    /// Pulls every held point towards its place at the tool, which is at `position_m`.
    pub fn solve(&mut self, position_m: Vec3, places: &mut [Vec4], substep_s: f32) {
        let h2 = substep_s * substep_s;
        let alpha_tilde = self.compliance_m_per_n / h2;
        for hold in &mut self.holds {
            let stretch = hold.handle.place(places) - (position_m + hold.offset);
            let residual = stretch + alpha_tilde * hold.multiplier;
            let multiplier = (hold.multiplier
                - residual / (hold.handle.inverse_mass + alpha_tilde))
                .clamp_length_max(self.force_max_n * h2);
            hold.handle.push(places, multiplier - hold.multiplier);
            hold.multiplier = multiplier;
        }
    }

    /// The particles that carry what is held.
    pub fn carriers(&self) -> impl Iterator<Item = u32> {
        let handles = self.holds.iter().map(|hold| &hold.handle);
        handles.flat_map(|handle| handle.carriers().map(|(particle, _)| particle))
    }

    /// Number of places held.
    pub fn len(&self) -> usize {
        self.holds.len()
    }

    /// The places held by the tool at `position_m`.
    pub fn active(&self, position_m: Vec3) -> impl Iterator<Item = ActiveHold> {
        self.holds.iter().map(move |hold| ActiveHold {
            handle: hold.handle,
            target_m: position_m + hold.offset,
            stiffness_n_per_m: 1.0 / self.compliance_m_per_n,
            force_max_n: self.force_max_n,
        })
    }

    /// Takes over the multiplier of each place held, force on the body times h² [kg m].
    pub fn set_multipliers(&mut self, multipliers: &[Vec3]) {
        for (hold, &multiplier) in self.holds.iter_mut().zip(multipliers) {
            hold.multiplier = multiplier;
        }
    }

    /// Force on the body times h² [kg m].
    pub fn multiplier(&self) -> Vec3 {
        self.holds.iter().map(|hold| hold.multiplier).sum()
    }
}
