//! A symmetric sparse matrix of 3×3 blocks, one row of blocks a node.

use glam::{Mat3, Vec4, Vec4Swizzles};
use std::ops::Range;

/// The columns of a 3×3 block; the fourth number of each is 0.
pub type Block = [Vec4; 3];

/// A block of zeros.
pub const ZERO: Block = [Vec4::ZERO; 3];

/// Block times vector.
#[inline(always)]
pub fn times(block: &Block, x: Vec4) -> Vec4 {
    block[0] * x.xxxx() + block[1] * x.yyyy() + block[2] * x.zzzz()
}

/// The transposed block.
#[inline(always)]
fn transposed([x, y, z]: Block) -> Block {
    [
        Vec4::new(x.x, y.x, z.x, 0.0),
        Vec4::new(x.y, y.y, z.y, 0.0),
        Vec4::new(x.z, y.z, z.z, 0.0),
    ]
}

/// Inverse of a symmetric positive block; of one that is singular to within rounding, the inverse
/// of its mean diagonal, and zero where that is zero too.
pub fn inverse(block: &Block) -> Block {
    let m = Mat3::from_cols(
        block[0].truncate(),
        block[1].truncate(),
        block[2].truncate(),
    )
    .as_dmat3();
    let mean = (m.x_axis.x + m.y_axis.y + m.z_axis.z) / 3.0;
    if m.determinant() > 1e-9 * mean.powi(3) {
        let inverse = m.inverse();
        return [inverse.x_axis, inverse.y_axis, inverse.z_axis]
            .map(|column| column.as_vec3().extend(0.0));
    }
    let inverse = if mean > 0.0 { 1.0 / mean as f32 } else { 0.0 };
    [Vec4::X, Vec4::Y, Vec4::Z].map(|axis| inverse * axis)
}

/// Rows of blocks, both halves stored, and one block that no place owns.
#[derive(Clone, Debug)]
pub struct BlockMatrix {
    /// Where each row starts in `columns` and `blocks`, and where the last ends.
    start: Vec<u32>,
    columns: Vec<u32>,
    /// Where the diagonal block of each row is.
    diagonal: Vec<u32>,
    /// For each block left of the diagonal, row by row, where its mirror image is.
    mirror: Vec<u32>,
    blocks: Vec<Block>,
}

impl BlockMatrix {
    /// A matrix of zeros with a diagonal block for each of `count` nodes and one for each pair, in
    /// both halves.
    ///
    /// # Panics
    ///
    /// If a pair names a node beyond `count`.
    pub fn new(count: usize, pairs: impl IntoIterator<Item = (u32, u32)>) -> Self {
        let mut places: Vec<(u32, u32)> = (0..count as u32).map(|node| (node, node)).collect();
        for (a, b) in pairs {
            assert!(
                (a as usize) < count && (b as usize) < count,
                "a pair is of nodes of the matrix"
            );
            places.extend([(a, b), (b, a)]);
        }
        places.sort_unstable();
        places.dedup();
        let mut start = vec![0; count + 1];
        let mut diagonal = vec![0; count];
        for (place, &(row, column)) in places.iter().enumerate() {
            start[row as usize + 1] = place as u32 + 1;
            if row == column {
                diagonal[row as usize] = place as u32;
            }
        }
        let mut matrix = Self {
            start,
            columns: places.iter().map(|&(_, column)| column).collect(),
            diagonal,
            mirror: Vec::new(),
            blocks: vec![ZERO; places.len() + 1],
        };
        matrix.mirror = places
            .iter()
            .filter(|(row, column)| column < row)
            .map(|&(row, column)| matrix.place(column, row))
            .collect();
        matrix
    }

    /// Number of nodes.
    pub fn len(&self) -> usize {
        self.diagonal.len()
    }

    /// Number of blocks.
    pub fn block_count(&self) -> usize {
        self.columns.len()
    }

    /// Where the block of `row` and `column` is.
    ///
    /// # Panics
    ///
    /// If the pattern has no such block.
    pub fn place(&self, row: u32, column: u32) -> u32 {
        self.find(row, column)
            .expect("the pattern has a block for the pair")
    }

    /// Where the block of `row` and `column` is; `None` if the pattern has none.
    pub fn find(&self, row: u32, column: u32) -> Option<u32> {
        let places = self.row(row as usize);
        let found = self.columns[places.clone()].binary_search(&column).ok()?;
        Some((places.start + found) as u32)
    }

    /// The place that belongs to no row, for what is to be dropped.
    pub fn unused_place(&self) -> u32 {
        self.columns.len() as u32
    }

    /// Places of a row.
    #[inline(always)]
    pub fn row(&self, row: usize) -> Range<usize> {
        self.start[row] as usize..self.start[row + 1] as usize
    }

    /// Column of each place.
    pub fn columns(&self) -> &[u32] {
        &self.columns
    }

    /// Place of the diagonal block of a row.
    #[inline(always)]
    pub fn diagonal(&self, row: usize) -> usize {
        self.diagonal[row] as usize
    }

    /// All blocks, the unused place last.
    pub fn blocks(&self) -> &[Block] {
        &self.blocks
    }

    /// All blocks, the unused place last. The two halves must agree again before the matrix is
    /// used: see [`BlockMatrix::mirror_upper`].
    pub fn blocks_mut(&mut self) -> &mut [Block] {
        &mut self.blocks
    }

    /// Sets all blocks to zero.
    pub fn clear(&mut self) {
        self.blocks.fill(ZERO);
    }

    /// Adds a multiple of the unit matrix to the diagonal block of `row`.
    pub fn add_to_diagonal(&mut self, row: usize, value: f32) {
        let block = &mut self.blocks[self.diagonal[row] as usize];
        block[0].x += value;
        block[1].y += value;
        block[2].z += value;
    }

    /// Copies the half right of the diagonal to the left.
    pub fn mirror_upper(&mut self) {
        let mut mirrors = self.mirror.iter();
        for row in 0..self.len() {
            let lower = self.start[row] as usize..self.diagonal[row] as usize;
            for (place, &mirror) in lower.zip(&mut mirrors) {
                self.blocks[place] = transposed(self.blocks[mirror as usize]);
            }
        }
    }

    /// Sum over the blocks at `places`, all of one row, of block times the vector of its column.
    ///
    /// # Panics
    ///
    /// If there are fewer vectors than nodes, or a place is beyond the matrix.
    #[inline(always)]
    pub fn product(&self, places: Range<usize>, x: &[Vec4]) -> Vec4 {
        assert!(x.len() >= self.len(), "one vector a node");
        let (mut a, mut b, mut c) = (Vec4::ZERO, Vec4::ZERO, Vec4::ZERO);
        let blocks = &self.blocks[places.clone()];
        for (block, &column) in blocks.iter().zip(&self.columns[places]) {
            // SAFETY: columns are nodes of the matrix, and there is a vector for each.
            let x = unsafe { *x.get_unchecked(column as usize) };
            a += block[0] * x.xxxx();
            b += block[1] * x.yyyy();
            c += block[2] * x.zzzz();
        }
        a + b + c
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DMat3;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn product_is_that_of_the_dense_matrix(
            pairs in prop::collection::vec((0_u32..9, 0_u32..9), 0..30),
            values in prop::collection::vec(-1.0_f32..1.0, 9 * 81),
            x in prop::collection::vec(-1.0_f32..1.0, 27),
        ) {
            let mut matrix = BlockMatrix::new(9, pairs);
            let x: Vec<Vec4> = x.chunks(3).map(|v| Vec4::new(v[0], v[1], v[2], 0.0)).collect();
            let mut dense = vec![[DMat3::ZERO; 9]; 9];
            for row in 0..9_u32 {
                for column in row..9 {
                    let Some(place) = matrix.find(row, column) else { continue };
                    let k = 9 * (9 * row + column) as usize;
                    let mut m = glam::Mat3::from_cols_slice(&values[k..k + 9]);
                    if row == column {
                        m += m.transpose();
                    }
                    matrix.blocks_mut()[place as usize] =
                        [m.x_axis, m.y_axis, m.z_axis].map(|v| v.extend(0.0));
                    dense[row as usize][column as usize] = m.as_dmat3();
                    dense[column as usize][row as usize] = m.transpose().as_dmat3();
                }
            }
            matrix.mirror_upper();
            for (row, dense) in dense.iter().enumerate() {
                let found = matrix.product(matrix.row(row), &x).xyz().as_dvec3();
                let expected: glam::DVec3 =
                    dense.iter().zip(&x).map(|(block, x)| *block * x.xyz().as_dvec3()).sum();
                // 27 products of numbers below 2, in f32.
                prop_assert!((found - expected).length() < 1e-5);
            }
        }
    }

    #[test]
    fn inverse_of_a_singular_block_is_finite() {
        for block in [ZERO, [Vec4::X, Vec4::ZERO, Vec4::ZERO], [Vec4::X; 3]] {
            assert!(inverse(&block).iter().all(|column| column.is_finite()));
        }
    }
}
