//! A small symmetric matrix, factored: the coarsest level of the multigrid.

use super::matrix::BlockMatrix;
use glam::Vec4;

/// A pivot below this share of its diagonal number is rounding: the unknown depends on others.
const PIVOT_SHARE_MIN: f32 = 1e-5;

/// Cholesky factor UᵀU of a matrix that is zero far from its diagonal.
#[derive(Clone, Debug)]
pub struct BandFactor {
    /// Unknowns.
    count: usize,
    /// Numbers kept of each row, from the diagonal on; a multiple of eight.
    width: usize,
    /// Rows of U.
    rows: Vec<f32>,
    /// One over the diagonal of U, 0 for an unknown that is left out.
    inverse_diagonal: Vec<f32>,
    /// Right side, then solution.
    values: Vec<f32>,
}

impl BandFactor {
    /// A factor of zeros for matrices with the pattern of `matrix`.
    pub fn new(matrix: &BlockMatrix) -> Self {
        let reach = |row: usize| {
            let last = matrix.columns()[matrix.row(row).end - 1] as usize;
            3 * (last - row) + 3
        };
        let width = (0..matrix.len()).map(reach).max().unwrap_or(1);
        let (count, width) = (3 * matrix.len(), width.next_multiple_of(8));
        Self {
            count,
            width,
            rows: vec![0.0; count * width],
            inverse_diagonal: vec![0.0; count],
            values: vec![0.0; count + width],
        }
    }

    /// Factors `matrix`, which has the pattern this was made for. Unknowns that depend on others
    /// are left out.
    #[inline(always)]
    pub fn factor(&mut self, matrix: &BlockMatrix) {
        self.load(matrix);
        let width = self.width;
        for pivot in 0..self.count {
            let (head, tail) = self.rows.split_at_mut((pivot + 1) * width);
            let row = &mut head[pivot * width..];
            // `load` leaves the diagonal of the matrix here.
            let least = PIVOT_SHARE_MIN * self.inverse_diagonal[pivot];
            if row[0] <= least || !row[0].is_finite() {
                self.inverse_diagonal[pivot] = 0.0;
                row.fill(0.0);
                continue;
            }
            let scale = 1.0 / row[0].sqrt();
            self.inverse_diagonal[pivot] = scale;
            row.iter_mut().for_each(|value| *value *= scale);
            let below = (self.count - pivot).min(width);
            for offset in 1..below {
                let factor = row[offset];
                if factor != 0.0 {
                    let target = &mut tail[(offset - 1) * width..offset * width];
                    subtract(&mut target[..width - offset], factor, &row[offset..]);
                }
            }
        }
    }

    /// Copies the matrix into the rows, and its diagonal into `inverse_diagonal`.
    #[inline(always)]
    fn load(&mut self, matrix: &BlockMatrix) {
        self.rows.fill(0.0);
        for row in 0..matrix.len() {
            for place in matrix.diagonal(row)..matrix.row(row).end {
                let column = matrix.columns()[place] as usize;
                let block = &matrix.blocks()[place];
                for (i, j) in (0..9).map(|k| (k / 3, k % 3)) {
                    let (y, x) = (3 * row + i, 3 * column + j);
                    if x >= y {
                        self.rows[y * self.width + (x - y)] = block[j][i];
                    }
                }
            }
        }
        for (row, diagonal) in self.inverse_diagonal.iter_mut().enumerate() {
            *diagonal = self.rows[row * self.width];
        }
    }

    /// Solves for one right side.
    ///
    /// # Panics
    ///
    /// If right side or solution is not as long as the matrix.
    #[inline(always)]
    pub fn solve(&mut self, right: &[Vec4], solution: &mut [Vec4]) {
        assert!(
            3 * right.len() == self.count && solution.len() == right.len(),
            "one vector a node"
        );
        for (triple, vector) in self.values.chunks_exact_mut(3).zip(right.iter()) {
            triple.copy_from_slice(&vector.to_array()[..3]);
        }
        self.values[self.count..].fill(0.0);
        for pivot in 0..self.count {
            let row = &self.rows[pivot * self.width..(pivot + 1) * self.width];
            let value = self.values[pivot] * self.inverse_diagonal[pivot];
            self.values[pivot] = value;
            subtract(
                &mut self.values[pivot + 1..pivot + self.width],
                value,
                &row[1..],
            );
        }
        for pivot in (0..self.count).rev() {
            let row = &self.rows[pivot * self.width..(pivot + 1) * self.width];
            // The diagonal itself is no part of the sum.
            let value = self.values[pivot];
            self.values[pivot] = 0.0;
            let sum = dot(row, &self.values[pivot..pivot + self.width]);
            self.values[pivot] = (value - sum) * self.inverse_diagonal[pivot];
        }
        for (vector, triple) in solution.iter_mut().zip(self.values.chunks_exact(3)) {
            *vector = Vec4::new(triple[0], triple[1], triple[2], 0.0);
        }
    }
}

/// `target -= factor · source`, number by number.
#[inline(always)]
fn subtract(target: &mut [f32], factor: f32, source: &[f32]) {
    for (target, source) in target.iter_mut().zip(source) {
        *target -= factor * source;
    }
}

/// Sum of products, in eight sums: of lengths that are a multiple of eight.
#[inline(always)]
fn dot(a: &[f32], b: &[f32]) -> f32 {
    let mut sums = [0.0_f32; 8];
    for (a, b) in a.chunks_exact(8).zip(b.chunks_exact(8)) {
        for lane in 0..8 {
            sums[lane] += a[lane] * b[lane];
        }
    }
    sums.iter().sum()
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A chain of `count` nodes, each held to the next by a spring and to the ground by a weaker
    /// one.
    fn chain(count: usize, ground: f32) -> BlockMatrix {
        let links = (1..count as u32).map(|node| (node - 1, node));
        let mut matrix = BlockMatrix::new(count, links.clone());
        for node in 0..count {
            matrix.add_to_diagonal(node, ground);
        }
        for (a, b) in links {
            matrix.add_to_diagonal(a as usize, 1.0);
            matrix.add_to_diagonal(b as usize, 1.0);
            let place = matrix.place(a, b) as usize;
            matrix.blocks_mut()[place] = [-Vec4::X, -Vec4::Y, -Vec4::Z];
        }
        matrix.mirror_upper();
        matrix
    }

    #[test]
    fn solution_gives_the_right_side_back() {
        let matrix = chain(11, 0.1);
        let mut factor = BandFactor::new(&matrix);
        factor.factor(&matrix);
        let right: Vec<Vec4> = (0..11)
            .map(|i| Vec4::new(i as f32, 1.0, -0.5 * i as f32, 0.0))
            .collect();
        let mut x = vec![Vec4::ZERO; 11];
        factor.solve(&right, &mut x);
        for (row, right) in right.iter().enumerate() {
            let found = matrix.product(matrix.row(row), &x);
            // Condition 40, in f32.
            assert!((found - *right).length() < 1e-4, "{found} {right}");
        }
    }

    #[test]
    fn a_body_that_nothing_holds_still_gives_a_finite_solution() {
        let matrix = chain(5, 0.0);
        let mut factor = BandFactor::new(&matrix);
        factor.factor(&matrix);
        let mut x = vec![Vec4::ZERO; 5];
        factor.solve(&[Vec4::X; 5], &mut x);
        assert!(x.iter().all(|x| x.is_finite() && x.length() < 1e3), "{x:?}");
    }
}
