//! Active muscle: tissue whose shape at rest shrinks and grows.
//!
//! A tetrahedron of muscle that has shortened by c wants to be the scale s = 1 − a c of its own shape, in all
//! directions, where a, its activity, is the mean of those of its corners: 1 in muscle, 0 in what does not beat.
//! Its energy is that of the shape it wants, V s³ ψ(F/s), and so its stress over the shape as it was made is
//! s² P(F/s) (the active strain of Nardinocchi, Teresi, "On the Active Response of Soft Living Tissues", Journal of
//! Elasticity 88, 2007, here the same in all directions).

use super::lanes::{Corners, Lanes, ParticleAccess, add_spare};
use glam::Vec4;

/// How much of each particle is muscle, and how far it has shortened.
#[derive(Clone, Debug)]
pub struct Muscle {
    /// Activity in the first number, and spare places of none.
    activity: Vec<Vec4>,
    /// Shortening of full muscle, as a share of its length.
    pub shortening: f32,
}

/// The same, for the kernels to read.
#[derive(Clone, Copy)]
pub struct Pull {
    activity: ParticleAccess,
    shortening: f32,
}

impl Muscle {
    /// Muscle at rest, with one activity a particle.
    pub fn new(activity: &[f32]) -> Self {
        let mut places: Vec<Vec4> = activity.iter().map(|&a| Vec4::X * a).collect();
        add_spare(&mut places);
        Self {
            activity: places,
            shortening: 0.0,
        }
    }

    /// Access for kernels that work on the same particles.
    pub fn pull(&mut self) -> Pull {
        Pull {
            activity: ParticleAccess::new(&mut self.activity),
            shortening: self.shortening,
        }
    }

    /// Scale of the rest length between two particles.
    pub fn between(&self, a: usize, b: usize) -> f32 {
        1.0 - 0.5 * self.shortening * (self.activity[a].x + self.activity[b].x)
    }
}

impl Pull {
    /// Scale s of the rest shapes of eight constraints.
    ///
    /// # Safety
    ///
    /// See [`ParticleAccess`]; nothing is written.
    #[inline(always)]
    pub unsafe fn scale<const WIDE: bool, const N: usize>(self, corners: &Corners<N>) -> Lanes {
        let mut sum = Lanes::default();
        for corner in corners {
            // SAFETY: the caller keeps the contract.
            sum = sum + unsafe { self.activity.gather::<WIDE>(corner) }.position.x;
        }
        Lanes::splat(1.0) - sum.times(self.shortening / N as f32)
    }
}
