//! Preconditioned conjugate gradients, in f32 with sums in f64.

use super::{matrix::BlockMatrix, multigrid::Multigrid};
use glam::Vec4;

/// Rows a partial sum is taken over in f32.
const SUM_ROWS: usize = 64;

/// The product of matrix and direction is summed up along with the direction; after so many
/// iterations it is taken afresh.
const PRODUCTS_BEFORE_FRESH: usize = 20;

/// Work space of the solver, and its solution.
#[derive(Clone, Debug, Default)]
pub struct ConjugateGradients {
    /// The solution.
    pub solution: Vec<Vec4>,
    residual: Vec<Vec4>,
    preconditioned: Vec<Vec4>,
    /// Matrix times that.
    preconditioned_product: Vec<Vec4>,
    direction: Vec<Vec4>,
    /// Matrix times direction.
    product: Vec<Vec4>,
}

/// When to stop.
#[derive(Clone, Copy, Debug)]
pub struct Stop {
    /// Error over the solution, in the norm of the matrix, that is small enough.
    pub error: f64,
    /// Norm of the residual that is small enough.
    pub residual: f64,
    pub iterations_max: usize,
}

impl ConjugateGradients {
    /// For `count` unknown vectors.
    pub fn new(count: usize) -> Self {
        let zeros = vec![Vec4::ZERO; count];
        Self {
            solution: zeros.clone(),
            residual: zeros.clone(),
            preconditioned: zeros.clone(),
            preconditioned_product: zeros.clone(),
            direction: zeros.clone(),
            product: zeros,
        }
    }

    /// Solves `matrix` times solution = `right`, from zero. Returns the iterations done.
    ///
    /// The solution is always one along which the quadratic energy has fallen: if the matrix shows
    /// itself as not positive, what was found until then is kept.
    pub fn solve(
        &mut self,
        matrix: &BlockMatrix,
        preconditioner: &mut Multigrid,
        lattices: bool,
        right: &[Vec4],
        stop: Stop,
    ) -> usize {
        #[cfg(target_arch = "x86_64")]
        if std::arch::is_x86_feature_detected!("avx2") {
            // SAFETY: the machine has AVX2.
            return unsafe { self.solve_avx2(matrix, preconditioner, lattices, right, stop) };
        }
        self.solve_of(matrix, preconditioner, lattices, right, stop)
    }

    /// The same code, compiled for instructions of AVX2. No fused multiply-add: bits stay.
    #[cfg(target_arch = "x86_64")]
    #[target_feature(enable = "avx2")]
    fn solve_avx2(
        &mut self,
        matrix: &BlockMatrix,
        preconditioner: &mut Multigrid,
        lattices: bool,
        right: &[Vec4],
        stop: Stop,
    ) -> usize {
        self.solve_of(matrix, preconditioner, lattices, right, stop)
    }

    #[inline(always)]
    fn solve_of(
        &mut self,
        matrix: &BlockMatrix,
        preconditioner: &mut Multigrid,
        lattices: bool,
        right: &[Vec4],
        stop: Stop,
    ) -> usize {
        self.solution.fill(Vec4::ZERO);
        self.residual.copy_from_slice(right);
        let (mut power, mut share, mut gained) = (f64::INFINITY, 0.0, 0.0);
        for iteration in 0..stop.iterations_max {
            let (z, product_z) = (&mut self.preconditioned, &mut self.preconditioned_product);
            preconditioner.apply(matrix, &self.residual, z, product_z, lattices);
            let next = dot(&self.residual, z);
            if iteration > 0 {
                share = (next / power) as f32;
            }
            power = next;
            advance(&mut self.direction, share, z);
            advance(&mut self.product, share, product_z);
            if iteration % PRODUCTS_BEFORE_FRESH == PRODUCTS_BEFORE_FRESH - 1 {
                self.multiply(matrix);
            }
            let curvature = dot(&self.direction, &self.product);
            if !(curvature > 0.0 && power > 0.0) {
                return iteration;
            }
            // Each step lowers the square of the error by this much (Hestenes, Stiefel).
            let gain = power * power / curvature;
            gained += gain;
            let residual = self.step((power / curvature) as f32);
            if residual <= stop.residual.powi(2) || gain <= stop.error.powi(2) * gained {
                return iteration + 1;
            }
        }
        stop.iterations_max
    }

    /// Multiplies the direction afresh.
    fn multiply(&mut self, matrix: &BlockMatrix) {
        for (row, product) in self.product.iter_mut().enumerate() {
            *product = matrix.product(matrix.row(row), &self.direction);
        }
    }

    /// Goes `step` along the direction; returns the square of the residual's norm.
    #[inline(always)]
    fn step(&mut self, step: f32) -> f64 {
        for (value, direction) in self.solution.iter_mut().zip(&self.direction) {
            *value += step * *direction;
        }
        for (residual, product) in self.residual.iter_mut().zip(&self.product) {
            *residual -= step * *product;
        }
        dot(&self.residual, &self.residual)
    }
}

/// `values` = `share` · `values` + `new`.
#[inline(always)]
fn advance(values: &mut [Vec4], share: f32, new: &[Vec4]) {
    for (value, new) in values.iter_mut().zip(new) {
        *value = share * *value + *new;
    }
}

/// Sum of products, in an order that depends on nothing.
#[inline(always)]
pub fn dot(a: &[Vec4], b: &[Vec4]) -> f64 {
    let part = |(a, b): (&[Vec4], &[Vec4])| -> f64 {
        let sum: Vec4 = a.iter().zip(b).map(|(&a, &b)| a * b).sum();
        f64::from(sum.x + sum.y + sum.z)
    };
    a.chunks(SUM_ROWS).zip(b.chunks(SUM_ROWS)).map(part).sum()
}
