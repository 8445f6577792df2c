//! A coarse lattice laid over nodes, and how values travel between the two.
//!
//! Values at a node are the trilinear mean of those at the corners of its cell, so that every shift,
//! rotation and uniform strain of the nodes is one of the lattice.

use glam::DVec3;
use std::collections::BTreeMap;

/// Corners with less weight than this do not take part.
const WEIGHT_MIN: f64 = 1e-3;

/// Weights between nodes and the lattice points around them.
#[derive(Clone, Debug)]
pub struct Interpolation {
    /// The lattice points and weights of each node.
    down: Weights,
    /// The nodes and weights of each lattice point.
    up: Weights,
}

/// Rows of indices and weights.
#[derive(Clone, Debug, Default)]
struct Weights {
    start: Vec<u32>,
    index: Vec<u32>,
    weight: Vec<f32>,
}

impl Weights {
    fn new(rows: &[Vec<(u32, f32)>]) -> Self {
        let mut weights = Self {
            start: vec![0],
            ..Self::default()
        };
        for row in rows {
            weights.index.extend(row.iter().map(|&(index, _)| index));
            weights.weight.extend(row.iter().map(|&(_, weight)| weight));
            weights.start.push(weights.index.len() as u32);
        }
        weights
    }

    #[inline(always)]
    fn row(&self, row: usize) -> (&[u32], &[f32]) {
        let range = self.start[row] as usize..self.start[row + 1] as usize;
        (&self.index[range.clone()], &self.weight[range])
    }

    #[inline(always)]
    fn pairs(&self, row: usize) -> impl Iterator<Item = (usize, f32)> {
        let (index, weight) = self.row(row);
        (index.iter().zip(weight)).map(|(&index, &weight)| (index as usize, weight))
    }
}

impl Interpolation {
    /// Lays a lattice of about `spacing` over `places` and returns the places of its points that
    /// have a node near them, in an order that keeps neighbours near.
    ///
    /// # Panics
    ///
    /// If there are no places or the spacing is not positive.
    pub fn new(places: &[DVec3], spacing: f64) -> (Self, Vec<DVec3>) {
        assert!(!places.is_empty() && spacing > 0.0, "nodes to lay it over");
        let low = places.iter().copied().fold(DVec3::INFINITY, DVec3::min);
        let high = places.iter().copied().fold(DVec3::NEG_INFINITY, DVec3::max);
        let size = (high - low).max(DVec3::splat(1e-3 * spacing));
        let cells = (size / spacing).round().max(DVec3::ONE);
        let cell = size / cells;
        // The longest axis is the slowest, so that the band of the matrix is narrow.
        let mut axes = [0, 1, 2];
        axes.sort_by(|&a, &b| cells[b].total_cmp(&cells[a]));

        let corners_of = |place: DVec3| {
            let at = (place - low) / cell;
            let first = at.floor().clamp(DVec3::ZERO, cells - 1.0);
            let share = (at - first).clamp(DVec3::ZERO, DVec3::ONE);
            (0..8).filter_map(move |corner: u32| {
                let mut weight = 1.0;
                let mut key = [0_u32; 3];
                for (slot, axis) in axes.into_iter().enumerate() {
                    let upper = corner >> axis & 1;
                    weight *= if upper == 1 {
                        share[axis]
                    } else {
                        1.0 - share[axis]
                    };
                    key[slot] = first[axis] as u32 + upper;
                }
                (weight >= WEIGHT_MIN).then_some((key, weight))
            })
        };
        let mut points = BTreeMap::new();
        for &place in places {
            points.extend(corners_of(place).map(|(key, _)| (key, 0_u32)));
        }
        let mut point_places = Vec::with_capacity(points.len());
        for (number, (key, value)) in points.iter_mut().enumerate() {
            *value = number as u32;
            let mut at = DVec3::ZERO;
            for (slot, axis) in axes.into_iter().enumerate() {
                at[axis] = f64::from(key[slot]);
            }
            point_places.push(low + at * cell);
        }
        let mut up = vec![Vec::new(); points.len()];
        let mut down = Vec::with_capacity(places.len());
        for (node, &place) in places.iter().enumerate() {
            let sum: f64 = corners_of(place).map(|(_, weight)| weight).sum();
            let mut row: Vec<(u32, f32)> = corners_of(place)
                .map(|(key, weight)| (points[&key], (weight / sum) as f32))
                .collect();
            row.sort_unstable_by_key(|&(point, _)| point);
            for &(point, weight) in &row {
                up[point as usize].push((node as u32, weight));
            }
            down.push(row);
        }
        let weights = Self {
            down: Weights::new(&down),
            up: Weights::new(&up),
        };
        (weights, point_places)
    }

    /// Number of lattice points.
    pub fn point_count(&self) -> usize {
        self.up.start.len() - 1
    }

    /// Lattice points of a node, ascending, and their weights.
    #[inline(always)]
    pub fn points_of(&self, node: usize) -> impl Iterator<Item = (usize, f32)> {
        self.down.pairs(node)
    }

    /// Lattice points of a node, ascending, and their weights, as lists.
    #[inline(always)]
    pub fn row(&self, node: usize) -> (&[u32], &[f32]) {
        self.down.row(node)
    }

    /// Nodes of a lattice point, ascending, and its weight at each.
    #[inline(always)]
    pub fn nodes_of(&self, point: usize) -> impl Iterator<Item = (usize, f32)> {
        self.up.pairs(point)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DMat3;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn every_uniform_strain_is_one_of_the_lattice(
            places in prop::collection::vec(prop::array::uniform3(-1.0..1.0), 1..60),
            strain in prop::array::uniform9(-1.0..1.0),
            spacing in 0.1..3.0,
        ) {
            let places: Vec<DVec3> = places.into_iter().map(DVec3::from).collect();
            let strain = DMat3::from_cols_array(&strain);
            let (weights, points) = Interpolation::new(&places, spacing);
            prop_assert_eq!(points.len(), weights.point_count());
            for (node, &place) in places.iter().enumerate() {
                let mean: DVec3 = weights
                    .points_of(node)
                    .map(|(point, weight)| f64::from(weight) * (strain * points[point]))
                    .sum();
                // Corners left out weigh up to 8 · 0.001, and are no farther off than the spacing
                // or the size, 3 at most, times a strain of 3.
                prop_assert!((mean - strain * place).length() < 8e-3 * 9.0);
            }
        }
    }
}
