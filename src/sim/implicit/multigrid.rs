//! What brings the conjugate gradients home: sweeps over the nodes and corrections from ever coarser
//! lattices, one symmetric V-cycle.
//!
//! Source: Briggs, Henson, McCormick, "A Multigrid Tutorial", 2nd ed., 2000.

use super::{
    band::BandFactor, galerkin::Galerkin, lattice::Interpolation, matrix::BlockMatrix, sweep::Sweep,
};
use glam::{DVec3, Vec4};

/// Spacing of the first lattice over that of the nodes. Two and four cost more, by iterations or by
/// the lattice.
const FIRST_COARSENING: f64 = 3.0;
/// Spacing of each further lattice over that of the one before.
const COARSENING: f64 = 2.0;
/// A lattice of so few points is solved outright.
const POINTS_MAX: usize = 40;

/// An approximate inverse of a matrix, symmetric and positive.
#[derive(Clone, Debug)]
pub struct Multigrid {
    /// Of the nodes, and of each lattice but the last.
    sweeps: Vec<Sweep>,
    lattices: Vec<Lattice>,
    /// Of the last lattice.
    factor: Option<BandFactor>,
}

/// A lattice and its problem.
#[derive(Clone, Debug)]
struct Lattice {
    /// To the nodes, or the lattice before.
    weights: Interpolation,
    products: Galerkin,
    matrix: BlockMatrix,
    right: Vec<Vec4>,
    solution: Vec<Vec4>,
}

impl Multigrid {
    /// For matrices with the pattern of `matrix`, whose nodes are at `places` at rest [m], about
    /// `spacing` apart.
    pub fn new(matrix: &BlockMatrix, places: &[DVec3], spacing: f64) -> Self {
        let mut sweeps = vec![Sweep::new(matrix)];
        let mut lattices: Vec<Lattice> = Vec::new();
        let (mut places, mut spacing) = (places.to_vec(), FIRST_COARSENING * spacing);
        while places.len() > POINTS_MAX {
            let (weights, points) = Interpolation::new(&places, spacing);
            if 2 * points.len() > places.len() {
                break;
            }
            let finer = lattices.last().map_or(matrix, |lattice| &lattice.matrix);
            let (products, coarse) = Galerkin::new(finer, &weights);
            if !lattices.is_empty() {
                sweeps.push(Sweep::new(finer));
            }
            lattices.push(Lattice {
                weights,
                products,
                matrix: coarse,
                right: vec![Vec4::ZERO; points.len()],
                solution: vec![Vec4::ZERO; points.len()],
            });
            (places, spacing) = (points, COARSENING * spacing);
        }
        Self {
            factor: lattices.last().map(|last| BandFactor::new(&last.matrix)),
            sweeps,
            lattices,
        }
    }

    /// Takes over new values of the matrix, for the sweeps over the nodes.
    pub fn refresh(&mut self, matrix: &BlockMatrix) {
        self.sweeps[0].refresh(matrix);
    }

    /// Takes over new values of the matrix, for the lattices.
    pub fn refresh_lattices(&mut self, matrix: &BlockMatrix) {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: the machine has AVX2.
            return unsafe { self.refresh_lattices_avx2(matrix) };
        }
        self.refresh_lattices_of(matrix);
    }

    /// The same code, compiled for instructions of AVX2. No fused multiply-add: bits stay.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn refresh_lattices_avx2(&mut self, matrix: &BlockMatrix) {
        self.refresh_lattices_of(matrix);
    }

    #[inline(always)]
    fn refresh_lattices_of(&mut self, matrix: &BlockMatrix) {
        for level in 0..self.lattices.len() {
            let (finer, coarser) = self.lattices.split_at_mut(level);
            let finer = finer.last().map_or(matrix, |lattice| &lattice.matrix);
            if level > 0 {
                self.sweeps[level].refresh(finer);
            }
            let Lattice {
                weights,
                products,
                matrix,
                ..
            } = &mut coarser[0];
            products.project(finer, weights, matrix);
        }
        if let (Some(factor), Some(last)) = (&mut self.factor, self.lattices.last()) {
            factor.factor(&last.matrix);
        }
    }

    /// Sets `solution` to about the inverse of `matrix` times `right`, and `product` to `matrix`
    /// times that. Without `lattices` it is that of two sweeps over the nodes alone.
    #[inline(always)]
    pub fn apply(
        &mut self,
        matrix: &BlockMatrix,
        right: &[Vec4],
        solution: &mut [Vec4],
        product: &mut [Vec4],
        lattices: bool,
    ) {
        let depth = if lattices { self.lattices.len() } else { 0 };
        self.sweeps[0].forwards(matrix, right, solution);
        if depth > 0 {
            self.sweeps[0].subtract(matrix, solution);
            self.lattices[0].restrict(&self.sweeps[0].left);
            for level in 1..depth {
                let (finer, coarser) = self.lattices.split_at_mut(level);
                let (finer, sweep) = (&mut finer[level - 1], &mut self.sweeps[level]);
                sweep.forwards(&finer.matrix, &finer.right, &mut finer.solution);
                sweep.subtract(&finer.matrix, &finer.solution);
                coarser[0].restrict(&sweep.left);
            }
            if let (Some(factor), Some(last)) = (&mut self.factor, self.lattices.last_mut()) {
                factor.solve(&last.right, &mut last.solution);
            }
            for level in (1..depth).rev() {
                let (finer, coarser) = self.lattices.split_at_mut(level);
                let (finer, sweep) = (&mut finer[level - 1], &mut self.sweeps[level]);
                coarser[0].correct(&mut finer.solution);
                sweep.backwards(&finer.matrix, &finer.right, &mut finer.solution);
            }
            self.lattices[0].correct(solution);
        }
        self.sweeps[0].backwards(matrix, right, solution);
        self.sweeps[0].product(matrix, right, solution, product);
    }
}

impl Lattice {
    /// Takes over what is left of the right side of the finer level.
    #[inline(always)]
    fn restrict(&mut self, left: &[Vec4]) {
        for (point, right) in self.right.iter_mut().enumerate() {
            let mut sum = Vec4::ZERO;
            for (node, weight) in self.weights.nodes_of(point) {
                sum += weight * left[node];
            }
            *right = sum;
        }
    }

    /// Adds the solution here to that of the finer level.
    #[inline(always)]
    fn correct(&self, solution: &mut [Vec4]) {
        for (node, value) in solution.iter_mut().enumerate() {
            let mut sum = *value;
            for (point, weight) in self.weights.points_of(node) {
                sum += weight * self.solution[point];
            }
            *value = sum;
        }
    }
}
