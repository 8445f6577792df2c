//! Which parts of a file close into a watertight surface together.
//!
//! A part's border is the set of edges that it uses an odd number of times. A selection of parts is
//! closed only if its borders cancel: each edge occurs in an even number of them. So the closed
//! selections are the kernel of the matrix of borders over the field of two elements, and Gaussian
//! elimination lists them without trying subsets.

use super::topology::{Sets, edge_uses, same_edge};
use super::weld::{Union, odd_parts};

/// Kernels up to this dimension are listed in full, larger ones by their basis only.
const DIMENSION_MAX: usize = 6;
/// Files with more parts are tried as a whole and part by part only.
const PARTS_MAX: usize = 2000;

/// Selections of at least two parts whose borders cancel, each sorted. They still may have edges with
/// more than two triangles. Parts that are closed by themselves are not in any of them.
pub(super) fn closing_selections(union: &Union, part_count: usize) -> Vec<Vec<u32>> {
    if part_count > PARTS_MAX {
        return Vec::new();
    }
    let borders = border_kinds(union);
    let mut clusters = Sets::new(part_count);
    for parts in &borders {
        for pair in parts.windows(2) {
            clusters.join(pair[0], pair[1]);
        }
    }
    let mut members: Vec<Vec<u32>> = vec![Vec::new(); part_count];
    let mut has_border = vec![false; part_count];
    for &part in borders.iter().flatten() {
        has_border[part as usize] = true;
    }
    for part in (0..part_count as u32).filter(|&part| has_border[part as usize]) {
        members[clusters.root(part) as usize].push(part);
    }
    let mut selections = Vec::new();
    for cluster in members.iter().filter(|cluster| cluster.len() > 1) {
        let inside = borders.iter().filter(|parts| cluster.contains(&parts[0]));
        selections.extend(kernel(cluster, &inside.collect::<Vec<_>>()));
    }
    selections
}

/// The distinct sets of parts whose border some edge is on.
fn border_kinds(union: &Union) -> Vec<Vec<u32>> {
    let uses = edge_uses(&union.point_triangles());
    let mut kinds: Vec<Vec<u32>> = uses
        .chunk_by(same_edge)
        .map(|uses| {
            odd_parts(
                uses.iter()
                    .map(|edge| union.faces[edge.triangle as usize].part),
            )
        })
        .filter(|parts| !parts.is_empty())
        .collect();
    kinds.sort_unstable();
    kinds.dedup();
    kinds
}

/// A set of small numbers under addition without carry.
#[derive(Clone)]
struct Bits(Vec<u64>);

impl Bits {
    fn new(count: usize) -> Self {
        Self(vec![0; count.div_ceil(64)])
    }

    fn set(&mut self, bit: usize) {
        self.0[bit / 64] |= 1 << (bit % 64);
    }

    fn has(&self, bit: usize) -> bool {
        self.0[bit / 64] >> (bit % 64) & 1 == 1
    }

    fn add(&mut self, other: &Self) {
        for (word, other) in self.0.iter_mut().zip(&other.0) {
            *word ^= other;
        }
    }

    fn first(&self) -> Option<usize> {
        let word = self.0.iter().position(|&word| word != 0)?;
        Some(64 * word + self.0[word].trailing_zeros() as usize)
    }
}

/// Selections of `parts` in which every one of `borders` occurs an even number of times.
fn kernel(parts: &[u32], borders: &[&Vec<u32>]) -> Vec<Vec<u32>> {
    let mut pivots: Vec<(usize, Bits, Bits)> = Vec::new();
    let mut basis: Vec<Bits> = Vec::new();
    for (row, part) in parts.iter().enumerate() {
        let (mut border, mut selection) = (Bits::new(borders.len()), Bits::new(parts.len()));
        selection.set(row);
        for (column, parts) in borders.iter().enumerate() {
            if parts.contains(part) {
                border.set(column);
            }
        }
        for (pivot, pivot_border, pivot_selection) in &pivots {
            if border.has(*pivot) {
                border.add(pivot_border);
                selection.add(pivot_selection);
            }
        }
        match border.first() {
            Some(pivot) => pivots.push((pivot, border, selection)),
            None => basis.push(selection),
        }
    }
    let sums: Vec<Bits> = if basis.len() <= DIMENSION_MAX {
        (1..1_usize << basis.len())
            .map(|choice| {
                let mut sum = Bits::new(parts.len());
                for (k, vector) in basis.iter().enumerate() {
                    if choice >> k & 1 == 1 {
                        sum.add(vector);
                    }
                }
                sum
            })
            .collect()
    } else {
        basis
    };
    let named = |sum: &Bits| {
        let rows = (0..parts.len()).filter(|&row| sum.has(row));
        rows.map(|row| parts[row]).collect()
    };
    sums.iter().map(named).collect()
}
