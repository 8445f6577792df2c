//! Where a body comes to rest under its load.

use super::{Fem, newton::Potential};
use glam::DVec3;
use std::fmt;

/// The load is put on in so many equal parts; a bent beam is too far from rest for one.
const LOAD_STEPS: usize = 8;
/// Forces left on free particles, over the load, that count as none.
const TOLERANCE: f64 = 1e-11;
/// More than this left is no equilibrium: what rounding leaves of a stiff body under a small load
/// is still below.
const TOLERANCE_FAILED: f64 = 1e-9;
/// The same, of the parts of the load before the last.
const TOLERANCE_ON_THE_WAY: f64 = 1e-4;

/// A body at rest under its load.
#[derive(Clone, Debug)]
pub struct Statics {
    /// Particle positions [m].
    pub positions: Vec<DVec3>,
    /// Norm of the forces left on free particles, over the load.
    pub residual: f64,
    /// Newton iterations, over all parts of the load.
    pub iterations: usize,
}

/// Newton's method found no equilibrium.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct NoEquilibrium {
    /// Norm of the forces left on free particles, over the load.
    pub residual: f64,
}

impl fmt::Display for NoEquilibrium {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(
            f,
            "no equilibrium was found: {:.1e} of the load is left; hold more of the body or load it \
             less",
            self.residual
        )
    }
}

impl std::error::Error for NoEquilibrium {}

impl Fem {
    /// Where the body comes to rest under its weight, the forces pushed on it, and where it is held,
    /// all put on part by part.
    ///
    /// # Errors
    ///
    /// [`NoEquilibrium`] if more than 10⁻⁹ of the load is left unbalanced.
    pub fn statics(&self) -> Result<Statics, NoEquilibrium> {
        self.load_up(self.rest().to_vec(), LOAD_STEPS)
    }

    /// As [`Fem::statics`], from a guess of the answer: all the load at once.
    ///
    /// # Errors
    ///
    /// As [`Fem::statics`].
    ///
    /// # Panics
    ///
    /// If there is not one position a particle.
    pub fn statics_from(&self, guess: Vec<DVec3>) -> Result<Statics, NoEquilibrium> {
        assert_eq!(guess.len(), self.rest().len(), "one position a particle");
        self.load_up(guess, 1)
    }

    fn load_up(&self, mut positions: Vec<DVec3>, steps: usize) -> Result<Statics, NoEquilibrium> {
        let mut iterations = 0;
        let mut residual = 0.0;
        let mut previous = positions.clone();
        for step in 1..=steps {
            let share = step as f64 / steps as f64;
            if step > 2 {
                // As far again as the part before went: nearer than where that ended.
                let start: Vec<DVec3> = (positions.iter().zip(&previous))
                    .map(|(x, before)| 2.0 * *x - *before)
                    .collect();
                previous = std::mem::replace(&mut positions, start);
            } else {
                previous.clone_from(&positions);
            }
            self.put_held(&mut positions, share);
            let potential = Potential {
                fem: self,
                load_share: share,
                inertia: None,
            };
            let floor = self.rounding_n(&positions);
            let load = self.load_n(&positions);
            let wanted = if step == steps {
                TOLERANCE
            } else {
                TOLERANCE_ON_THE_WAY
            };
            let ended = potential.minimise(&mut positions, wanted * load + floor);
            iterations += ended.iterations;
            // Held elsewhere, the load is known only once the body has yielded to it.
            let load = self.load_n(&positions).max(floor / TOLERANCE_FAILED);
            residual = ended.residual_n / load;
        }
        if residual <= TOLERANCE_FAILED {
            Ok(Statics {
                positions,
                residual,
                iterations,
            })
        } else {
            Err(NoEquilibrium { residual })
        }
    }

    /// Sum of all outer forces and of what holds the held particles at `positions` [N].
    fn load_n(&self, positions: &[DVec3]) -> f64 {
        let outer: f64 = self.forces_n().iter().map(|force| force.length()).sum();
        let elastic = self.elastic_forces_n(positions);
        let held: f64 = (0..elastic.len())
            .filter(|&i| self.is_held(i))
            .map(|i| elastic[i].length())
            .sum();
        outer + held
    }
}
