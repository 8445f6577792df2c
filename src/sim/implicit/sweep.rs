//! Gauss–Seidel sweeps over the rows of a matrix, forwards and backwards.
//!
//! Rows are cut into domains, swept each for itself with what the others had before, so that they
//! may be swept together. Both sweeps after one another are a symmetric operator.

use super::{
    matrix::{Block, BlockMatrix, ZERO, inverse, times},
    order::domains,
};
use glam::Vec4;
use std::ops::Range;

/// What sweeps over matrices of one pattern need to know.
#[derive(Clone, Debug)]
pub struct Sweep {
    domains: Vec<Range<usize>>,
    /// Places of each row that are in its own domain.
    inner: Vec<Range<u32>>,
    inverse_diagonal: Vec<Block>,
    /// What is left of the right side after the sweep forwards.
    pub left: Vec<Vec4>,
    /// The solution before the sweep backwards; then the change since.
    before: Vec<Vec4>,
}

impl Sweep {
    /// For matrices with the pattern of `matrix`.
    pub fn new(matrix: &BlockMatrix) -> Self {
        let count = matrix.len();
        let domains = domains(count);
        let inner = |row: usize| {
            let domain = &domains[domains.partition_point(|domain| domain.end <= row)];
            let (first, last) = (domain.start as u32, domain.end as u32);
            let places = matrix.row(row);
            let columns = &matrix.columns()[places.clone()];
            let start = places.start + columns.partition_point(|&column| column < first);
            let end = places.start + columns.partition_point(|&column| column < last);
            start as u32..end as u32
        };
        Self {
            inner: (0..count).map(inner).collect(),
            inverse_diagonal: vec![ZERO; count],
            left: vec![Vec4::ZERO; count],
            before: vec![Vec4::ZERO; count],
            domains,
        }
    }

    /// Takes over new values of the matrix.
    pub fn refresh(&mut self, matrix: &BlockMatrix) {
        for (row, block) in self.inverse_diagonal.iter_mut().enumerate() {
            *block = inverse(&matrix.blocks()[matrix.diagonal(row)]);
        }
    }

    /// Solves row after row, as if what comes after, and other domains, were zero.
    #[inline(always)]
    pub fn forwards(&self, matrix: &BlockMatrix, right: &[Vec4], solution: &mut [Vec4]) {
        for domain in &self.domains {
            for row in domain.clone() {
                let before = self.inner[row].start as usize..matrix.diagonal(row);
                let known = matrix.product(before, solution);
                solution[row] = times(&self.inverse_diagonal[row], right[row] - known);
            }
        }
    }

    /// Sets `left` to what `solution`, swept forwards, leaves of the right side.
    #[inline(always)]
    pub fn subtract(&mut self, matrix: &BlockMatrix, solution: &[Vec4]) {
        for domain in &self.domains {
            for row in domain.clone() {
                let all = matrix.row(row);
                let mut known = matrix.product(matrix.diagonal(row) + 1..all.end, solution);
                let outer = all.start..self.inner[row].start as usize;
                if !outer.is_empty() {
                    known += matrix.product(outer, solution);
                }
                self.left[row] = -known;
            }
        }
    }

    /// Solves row after row from the last, with what there is in `solution`.
    #[inline(always)]
    pub fn backwards(&mut self, matrix: &BlockMatrix, right: &[Vec4], solution: &mut [Vec4]) {
        self.before.copy_from_slice(solution);
        for domain in &self.domains {
            for row in domain.clone().rev() {
                let (all, diagonal) = (matrix.row(row), matrix.diagonal(row));
                let inner_end = self.inner[row].end as usize;
                let mut known = matrix.product(all.start..diagonal, &self.before)
                    + matrix.product(diagonal + 1..inner_end, solution);
                if inner_end < all.end {
                    known += matrix.product(inner_end..all.end, &self.before);
                }
                solution[row] = times(&self.inverse_diagonal[row], right[row] - known);
            }
        }
    }

    /// Sets `product` to `matrix` times `solution`, which was just swept backwards.
    ///
    /// That left each row at right = upper half · new + lower half · old values, so the product
    /// differs from the right side by the lower half of the change alone.
    #[inline(always)]
    pub fn product(
        &mut self,
        matrix: &BlockMatrix,
        right: &[Vec4],
        solution: &[Vec4],
        product: &mut [Vec4],
    ) {
        for (before, after) in self.before.iter_mut().zip(solution) {
            *before = *after - *before;
        }
        for domain in &self.domains {
            for row in domain.clone() {
                let all = matrix.row(row);
                let lower = all.start..matrix.diagonal(row);
                let mut sum = right[row] + matrix.product(lower, &self.before);
                let outer = self.inner[row].end as usize..all.end;
                if !outer.is_empty() {
                    sum += matrix.product(outer, &self.before);
                }
                product[row] = sum;
            }
        }
    }
}
