//! A sparse symmetric matrix whose pattern is known beforehand, and its Cholesky factorisation.

use faer::Conj;
use faer::{
    Side,
    linalg::solvers::SolveCore,
    mat::MatMut,
    sparse::{
        SparseColMatRef, SymbolicSparseColMat,
        linalg::{
            LltError,
            solvers::{Llt, SymbolicLlt},
        },
    },
};

/// Pattern of the lower triangle and its symbolic factorisation (approximate minimum degree order).
#[derive(Debug)]
pub struct Pattern {
    lower: SymbolicSparseColMat<u32>,
    symbolic: SymbolicLlt<u32>,
    /// Where each diagonal entry is among the values.
    diagonal: Vec<u32>,
}

impl Pattern {
    /// The matrix of `dofs` rows in which two rows that share a node of a group meet: `groups` are
    /// the nodes of each element, a node owns three rows.
    pub fn of_nodes(groups: impl Iterator<Item = Vec<u32>>, node_count: usize) -> Self {
        // Nodes at or after each node that it meets, itself among them.
        let mut later: Vec<Vec<u32>> = (0..node_count as u32).map(|node| vec![node]).collect();
        for group in groups {
            for &a in &group {
                later[a as usize].extend(group.iter().filter(|&&b| b > a));
            }
        }
        let mut starts = vec![0];
        let mut rows = Vec::new();
        let mut diagonal = Vec::new();
        for nodes in &mut later {
            nodes.sort_unstable();
            nodes.dedup();
            for axis in 0..3 {
                diagonal.push(rows.len() as u32);
                let all = nodes
                    .iter()
                    .flat_map(|&node| [3 * node, 3 * node + 1, 3 * node + 2]);
                rows.extend(all.skip(axis));
                starts.push(rows.len() as u32);
            }
        }
        let dofs = 3 * node_count;
        let lower = SymbolicSparseColMat::new_checked(dofs, dofs, starts, None, rows);
        let symbolic = SymbolicLlt::try_new(lower.as_ref(), Side::Lower)
            .expect("a factor of this mesh fits into memory");
        Self {
            lower,
            symbolic,
            diagonal,
        }
    }

    /// Number of values in the lower triangle.
    pub fn value_count(&self) -> usize {
        self.lower.row_idx().len()
    }

    /// Place of each diagonal entry among the values.
    pub fn diagonal(&self) -> &[u32] {
        &self.diagonal
    }

    /// Place of the entry (`row`, `column`) among the values, `row` not above `column`.
    ///
    /// # Panics
    ///
    /// If the pattern has no such entry.
    pub fn place(&self, row: u32, column: u32) -> u32 {
        let start = self.lower.col_ptr()[column as usize];
        let end = self.lower.col_ptr()[column as usize + 1];
        let rows = &self.lower.row_idx()[start as usize..end as usize];
        let found = rows.binary_search(&row);
        start + found.expect("two dofs of an element meet in the pattern") as u32
    }

    /// Rows of the entries of a column, and their places among the values.
    #[cfg(test)]
    pub fn column(&self, column: usize) -> impl Iterator<Item = (usize, usize)> {
        let starts = self.lower.col_ptr();
        let places = starts[column] as usize..starts[column + 1] as usize;
        places.map(|place| (self.lower.row_idx()[place] as usize, place))
    }

    /// The solution of `A x = b` in `b`'s place, for `A` of these values of its lower triangle.
    /// `false` if `A` is not positive definite; `b` is then as it was.
    pub fn solve(&self, values: &[f64], b: &mut [f64]) -> bool {
        let matrix = SparseColMatRef::new(self.lower.as_ref(), values);
        match Llt::try_new_with_symbolic(self.symbolic.clone(), matrix, Side::Lower) {
            Ok(factor) => {
                let rows = b.len();
                factor.solve_in_place_with_conj(
                    Conj::No,
                    MatMut::from_column_major_slice_mut(b, rows, 1),
                );
                true
            }
            Err(LltError::Numeric(_)) => false,
            Err(LltError::Generic(error)) => {
                panic!("a factor of this mesh fits into memory: {error}")
            }
        }
    }
}
