//! The right answer at length: the tissue's equations on the same mesh, solved to rounding in f64.
//!
//! [`Fem`] is a body of linear tetrahedra of stable neo-Hookean tissue, the material of
//! `xpbd-neo-hookean`. [`Fem::statics`] finds where it comes to rest by Newton's method,
//! [`Fem::swing`] how it moves by the implicit midpoint rule. Slow, exact and without any part in
//! common with the solvers, so that tests and studies can hold those to it.
//!
//! [`Rays`] is a surface to cast rays at, and [`EvenTissue`] sums the light along them: the answer that light paths
//! below a deformed surface are held to. [`walked`] is light of all orders, which surfaces are held to.
//!
//! Sources: Smith, de Goes, Kim, "Stable Neo-Hookean Flesh Simulation", ACM TOG 37, 2018 (energy);
//! Nocedal, Wright, "Numerical Optimization", 2006, ch. 3 (line search, shifted Hessian); Hairer,
//! Lubich, Wanner, "Geometric Numerical Integration", 2006, ch. VI (midpoint rule).

mod dynamics;
mod fem;
mod glow;
mod material;
mod newton;
mod rays;
mod sparse;
mod statics;
mod walk;

pub use dynamics::{NoStep, State, Swing};
pub use fem::{Fem, FemSetup};
pub use glow::EvenTissue;
pub use material::Material;
pub use rays::{HalfLine, Rays, all_by};
pub use statics::{NoEquilibrium, Statics};
pub use walk::{WalkTissue, Walked, walked};

#[cfg(test)]
mod tests;
