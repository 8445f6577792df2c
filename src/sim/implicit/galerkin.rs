//! The matrix of a lattice from that of the nodes: PᵀAP, with P the interpolation.

use super::{
    lattice::Interpolation,
    matrix::{Block, BlockMatrix, ZERO},
};

/// Lattice points that the neighbours of one node may hang on.
const POINTS_MAX: usize = 256;

/// Where each product goes, found once.
#[derive(Clone, Debug)]
pub struct Galerkin {
    /// For each block of the nodes' matrix and each point of its column: which of the points that
    /// the row's neighbours hang on.
    local: Vec<u8>,
    rows: Vec<Row>,
    /// For each point of a row's node, and each of those points that does not come before it: the
    /// place in the lattice's matrix.
    target: Vec<u32>,
}

/// A row of the nodes' matrix.
#[derive(Clone, Debug)]
struct Row {
    /// Points that its neighbours hang on.
    near: u32,
    /// For each point of its own node: which of those it is, zeros beyond them.
    own: [u8; 8],
}

impl Galerkin {
    /// The products for matrices with the pattern of `matrix`, and the lattice's matrix, all zeros.
    ///
    /// # Panics
    ///
    /// If the neighbours of a node hang on more than 256 points.
    pub fn new(matrix: &BlockMatrix, weights: &Interpolation) -> (Self, BlockMatrix) {
        let points_near = |row: usize| {
            let columns = &matrix.columns()[matrix.row(row)];
            let mut points: Vec<u32> = columns
                .iter()
                .flat_map(|&column| weights.points_of(column as usize))
                .map(|(point, _)| point as u32)
                .collect();
            points.sort_unstable();
            points.dedup();
            assert!(
                points.len() <= POINTS_MAX,
                "a lattice is coarser than its nodes"
            );
            points
        };
        let near: Vec<Vec<u32>> = (0..matrix.len()).map(points_near).collect();
        let pairs = near.iter().enumerate().flat_map(|(row, near)| {
            let own = weights.points_of(row).map(|(point, _)| point as u32);
            own.flat_map(|a| near.iter().map(move |&b| (a, b)))
        });
        let coarse = BlockMatrix::new(weights.point_count(), pairs);
        let mut products = Self {
            local: Vec::new(),
            rows: Vec::with_capacity(near.len()),
            target: Vec::new(),
        };
        for (row, near) in near.iter().enumerate() {
            let local = |point: usize| {
                let found = near.binary_search(&(point as u32));
                found.expect("the points of a neighbour are near") as u8
            };
            for &column in &matrix.columns()[matrix.row(row)] {
                let points = weights.points_of(column as usize);
                products.local.extend(points.map(|(point, _)| local(point)));
            }
            let mut own = [0; 8];
            for (own, (point, _)) in own.iter_mut().zip(weights.points_of(row)) {
                *own = local(point);
                let others = &near[usize::from(*own)..];
                let places = others.iter().map(|&b| coarse.place(point as u32, b));
                products.target.extend(places);
            }
            products.rows.push(Row {
                near: near.len() as u32,
                own,
            });
        }
        (products, coarse)
    }

    /// Sets `coarse` to PᵀAP of `matrix`; both and `weights` are those this was made with.
    ///
    /// # Panics
    ///
    /// If they are not.
    #[inline(always)]
    pub fn project(&self, matrix: &BlockMatrix, weights: &Interpolation, coarse: &mut BlockMatrix) {
        coarse.clear();
        let targets = coarse.blocks_mut();
        let mut sums = [ZERO; POINTS_MAX];
        let (mut local, mut target) = (self.local.as_slice(), self.target.as_slice());
        for (number, row) in self.rows.iter().enumerate() {
            let near = row.near as usize;
            sums[..near].fill(ZERO);
            for place in matrix.row(number) {
                let block = &matrix.blocks()[place];
                let (points, factors) = weights.row(matrix.columns()[place] as usize);
                let (here, rest) = local.split_at(points.len());
                local = rest;
                for (&local, &factor) in here.iter().zip(factors) {
                    add_times(&mut sums[usize::from(local)], block, factor);
                }
            }
            let (points, factors) = weights.row(number);
            for (&own, &factor) in row.own[..points.len()].iter().zip(factors) {
                let sums = &sums[usize::from(own)..near];
                let (here, rest) = target.split_at(sums.len());
                target = rest;
                for (&place, sum) in here.iter().zip(sums) {
                    add_times(&mut targets[place as usize], sum, factor);
                }
            }
        }
        coarse.mirror_upper();
    }
}

#[inline(always)]
fn add_times(target: &mut Block, block: &Block, factor: f32) {
    // As twelve numbers they fill wide registers better than as three vectors of four.
    let target: &mut [f32; 12] = bytemuck::cast_mut(target);
    let block: &[f32; 12] = bytemuck::cast_ref(block);
    for (sum, value) in target.iter_mut().zip(block) {
        *sum += value * factor;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{DVec3, Vec3, Vec4};

    /// A block of nodes tied to their neighbours by springs of various stiffness.
    fn nodes() -> (BlockMatrix, Vec<DVec3>) {
        let places: Vec<DVec3> = (0..60)
            .map(|i| DVec3::new((i % 5) as f64, (i / 5 % 4) as f64, (i / 20) as f64))
            .collect();
        let near = |a: usize, b: usize| places[a].distance(places[b]) < 1.5;
        let pairs: Vec<(u32, u32)> = (0..60_usize)
            .flat_map(|a| (0..a).map(move |b| (b, a)))
            .filter(|&(a, b)| near(a, b))
            .map(|(a, b)| (a as u32, b as u32))
            .collect();
        let mut matrix = BlockMatrix::new(60, pairs.iter().copied());
        for &(a, b) in &pairs {
            let along = (places[a as usize] - places[b as usize]).as_vec3();
            let block = [along.x, along.y, along.z]
                .map(|x| ((1.0 + 0.1 * a as f32) * x * along).extend(0.0));
            let minus = block.map(|column| -column);
            for (row, column, value) in [(a, a, block), (b, b, block), (a, b, minus)] {
                let place = matrix.place(row, column) as usize;
                for (sum, value) in matrix.blocks_mut()[place].iter_mut().zip(value) {
                    *sum += value;
                }
            }
        }
        matrix.mirror_upper();
        (matrix, places)
    }

    #[test]
    fn coarse_energy_is_that_of_the_interpolated_nodes() {
        let (matrix, places) = nodes();
        let (weights, points) = Interpolation::new(&places, 2.0);
        let (products, mut coarse) = Galerkin::new(&matrix, &weights);
        products.project(&matrix, &weights, &mut coarse);
        let at_points: Vec<Vec4> = (0..points.len())
            .map(|i| Vec3::new((i * 7 % 5) as f32, (i * 3 % 4) as f32, 1.0).extend(0.0))
            .collect();
        let at_nodes: Vec<Vec4> = (0..places.len())
            .map(|node| weights.points_of(node).map(|(p, w)| w * at_points[p]).sum())
            .collect();
        let energy = |matrix: &BlockMatrix, x: &[Vec4]| -> f32 {
            (0..x.len())
                .map(|row| x[row].dot(matrix.product(matrix.row(row), x)))
                .sum()
        };
        let (fine, coarse) = (energy(&matrix, &at_nodes), energy(&coarse, &at_points));
        // A few thousand products in f32.
        assert!((fine - coarse).abs() < 1e-4 * fine, "{fine} {coarse}");
    }
}
