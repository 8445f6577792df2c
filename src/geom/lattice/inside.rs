//! What of a grid of cubes is inside a surface.
//!
//! Columns of sample points run through the grid along each axis; a column is inside where the
//! signed crossings with the surface do not cancel. A sample counts as inside when two of the three
//! axes say so, which bridges small holes. The edge functions that decide whether a column meets a
//! triangle are evaluated once an edge, whichever triangle asks, so no column slips between two.

use super::{super::SurfaceMesh, FILL_MIN, tet_at};
use glam::{DVec2, DVec3};

/// Sample points along each edge of a cube: 4³ = 64, a bit each.
const SAMPLES: usize = 4;

/// Cubes in rows along x, rows in layers along y, layers along z.
#[derive(Debug)]
pub(super) struct Grid {
    origin: DVec3,
    cell_m: f64,
    size: [usize; 3],
}

impl Grid {
    /// The grid of edge `cell_m`, centred on the box from `low` to `high`.
    pub(super) fn around(low: DVec3, high: DVec3, cell_m: f64) -> Self {
        // A box of whole cubes stays that many cubes in spite of rounding.
        let size = ((high - low) / cell_m - 1e-4)
            .to_array()
            .map(|n| n.ceil().max(1.0));
        let origin = (low + high - cell_m * DVec3::from_array(size)) / 2.0;
        Self {
            origin,
            cell_m,
            size: size.map(|n| n as usize),
        }
    }

    /// A grid of `size` cubes whose first corner is the origin.
    pub(super) fn of_size(size: [usize; 3]) -> Self {
        Self {
            origin: DVec3::ZERO,
            cell_m: 1.0,
            size,
        }
    }

    pub(super) fn cubes_f64(&self) -> f64 {
        self.size.iter().map(|&n| n as f64).product()
    }

    pub(super) fn cubes(&self) -> usize {
        self.size.iter().product()
    }

    pub(super) fn nodes(&self) -> usize {
        self.size.iter().map(|n| n + 1).product()
    }

    fn cube(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.size[1] + y) * self.size[0] + x
    }

    fn place_of(&self, cube: usize) -> [usize; 3] {
        let [nx, ny, _] = self.size;
        [cube % nx, cube / nx % ny, cube / (nx * ny)]
    }

    /// 0 or 1, as the fields of a chess board.
    pub(super) fn parity(&self, cube: usize) -> usize {
        self.place_of(cube).iter().sum::<usize>() % 2
    }

    /// Node at a corner `x + 2y + 4z` of a cube.
    pub(super) fn corner_node(&self, cube: usize, corner: usize) -> usize {
        let [x, y, z] = self.place_of(cube);
        let [dx, dy, dz] = super::corner_offset(corner);
        ((z + dz) * (self.size[1] + 1) + y + dy) * (self.size[0] + 1) + x + dx
    }

    /// Where a node lies [m].
    pub(super) fn node_place(&self, node: usize) -> DVec3 {
        let [nx, ny] = [self.size[0] + 1, self.size[1] + 1];
        let place = [node % nx, node / nx % ny, node / (nx * ny)].map(|n| n as f64);
        self.origin + self.cell_m * DVec3::from_array(place)
    }

    /// The cube that holds `x` (the nearest one if none does), and where in it, from 0 to 1.
    pub(super) fn locate(&self, x: DVec3) -> (usize, DVec3) {
        let scaled = (x - self.origin) / self.cell_m;
        let place: [usize; 3] =
            std::array::from_fn(|k| (scaled[k].max(0.0) as usize).min(self.size[k] - 1));
        let corner = DVec3::from_array(place.map(|n| n as f64));
        (self.cube(place), scaled - corner)
    }
}

/// The outcome of the inside test.
pub(super) struct Inside {
    /// Sample points inside, a bit each, `x + 4y + 16z`; one mask a cube.
    pub(super) samples: Vec<u64>,
    /// Volume inside [m³]: three column integrals, the smallest first.
    pub(super) volumes_m3: [f64; 3],
}

impl Inside {
    /// Tests the samples of every cube of `grid`.
    pub(super) fn of(surface: &SurfaceMesh, grid: &Grid) -> Self {
        let triangles: Vec<([u32; 3], [DVec3; 3])> = surface
            .point_triangles()
            .into_iter()
            .map(|t| {
                let places = t.map(|i| {
                    // In sample steps from the grid's corner.
                    (surface.points[i as usize].as_dvec3() - grid.origin)
                        * (SAMPLES as f64 / grid.cell_m)
                });
                (t, places)
            })
            .collect();
        let votes = [0, 1, 2].map(|axis| vote(&triangles, grid, axis));
        let [a, b, c] = &votes;
        let samples = (0..grid.cubes())
            .map(|i| (a.0[i] & b.0[i]) | (b.0[i] & c.0[i]) | (a.0[i] & c.0[i]))
            .collect();
        let mut volumes_m3 = [a.1, b.1, c.1];
        volumes_m3.sort_by(f64::total_cmp);
        Self {
            samples,
            volumes_m3,
        }
    }

    /// Share of each tetrahedron of the `kept` cubes that is inside.
    pub(super) fn fill(&self, grid: &Grid, kept: &[usize]) -> Vec<f32> {
        let masks = [0, 1].map(sample_masks);
        kept.iter()
            .flat_map(|&cube| {
                masks[grid.parity(cube)].map(|mask| {
                    let inside = (self.samples[cube] & mask).count_ones() as f32;
                    (inside / mask.count_ones() as f32).max(FILL_MIN)
                })
            })
            .collect()
    }
}

/// Which sample points of a cube lie in each of its tetrahedra.
fn sample_masks(parity: usize) -> [u64; 5] {
    let mut masks = [0; 5];
    for bit in 0..SAMPLES.pow(3) {
        let place = [
            bit % SAMPLES,
            bit / SAMPLES % SAMPLES,
            bit / SAMPLES / SAMPLES,
        ];
        let local = (DVec3::from_array(place.map(|n| n as f64)) + 0.5) / SAMPLES as f64;
        masks[tet_at(parity, local).0] |= 1 << bit;
    }
    masks
}

/// Samples inside and the volume [m³], by columns along `axis`.
///
/// A column whose crossings do not cancel runs through a hole and has no vote.
fn vote(triangles: &[([u32; 3], [DVec3; 3])], grid: &Grid, axis: usize) -> (Vec<u64>, f64) {
    let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
    let size = grid.size.map(|n| n * SAMPLES);
    // Columns stand a little beside the middle of their cell: meshes made by formula like to have
    // their corners there.
    let column_at = |index: usize, shift: f64| index as f64 + 0.5 + shift;
    const SHIFT_U: f64 = 1.234_567e-4;
    const SHIFT_V: f64 = -2.345_671e-4;

    let mut crossings: Vec<(usize, f64, i32)> = Vec::new();
    for (ids, corners) in triangles {
        let flat = corners.map(|corner| DVec2::new(corner[u], corner[v]));
        let low = flat[0].min(flat[1]).min(flat[2]);
        let high = flat[0].max(flat[1]).max(flat[2]);
        let range = |low: f64, high: f64, n: usize| {
            let first = (low - 0.51).floor().max(0.0) as usize;
            let last = ((high - 0.49).ceil().max(-1.0) + 1.0) as usize;
            first..last.min(n)
        };
        for row in range(low.y, high.y, size[v]) {
            for column in range(low.x, high.x, size[u]) {
                let at = DVec2::new(column_at(column, SHIFT_U), column_at(row, SHIFT_V));
                if let Some((sign, weights)) = crossing(*ids, flat, at) {
                    let height = (0..3).map(|k| weights[k] * corners[k][axis]).sum();
                    crossings.push((row * size[u] + column, height, sign));
                }
            }
        }
    }
    crossings.sort_by(|a, b| {
        (a.0.cmp(&b.0))
            .then(a.1.total_cmp(&b.1))
            .then(a.2.cmp(&b.2))
    });

    let mut samples = vec![0_u64; grid.cubes()];
    let mut length = 0.0;
    for column in crossings.chunk_by(|a, b| a.0 == b.0) {
        if column.iter().map(|crossing| crossing.2).sum::<i32>() != 0 {
            continue;
        }
        let (column_u, column_v) = (column[0].0 % size[u], column[0].0 / size[u]);
        let mut winding = 0;
        for pair in column.windows(2) {
            winding += pair[0].2;
            if winding == 0 {
                continue;
            }
            let (from, to) = (pair[0].1, pair[1].1);
            length += to - from;
            let first = (from - 0.5).ceil().max(0.0) as usize;
            let end = ((to - 0.5).ceil().max(0.0) as usize).min(size[axis]);
            for height in first..end {
                let mut place = [0; 3];
                (place[u], place[v], place[axis]) = (column_u, column_v, height);
                let bit = place[0] % SAMPLES
                    + SAMPLES * (place[1] % SAMPLES + SAMPLES * (place[2] % SAMPLES));
                samples[grid.cube(place.map(|n| n / SAMPLES))] |= 1 << bit;
            }
        }
    }
    (samples, length * (grid.cell_m / SAMPLES as f64).powi(3))
}

/// Whether the column `at` meets the triangle: the sign of its winding and the weights of its
/// corners there.
fn crossing(ids: [u32; 3], corners: [DVec2; 3], at: DVec2) -> Option<(i32, [f64; 3])> {
    // Twice the area of (edge, at). Both triangles of an edge compute it from the same end, so
    // they agree on the side to the last bit.
    let side = |i: usize, j: usize| {
        let ascending = ids[i] < ids[j];
        let (from, to) = if ascending { (i, j) } else { (j, i) };
        let area = (corners[to] - corners[from]).perp_dot(at - corners[from]);
        let positive = area >= 0.0;
        if ascending {
            (area, positive)
        } else {
            (-area, !positive)
        }
    };
    let (area_0, left_0) = side(1, 2);
    let (area_1, left_1) = side(2, 0);
    let (area_2, left_2) = side(0, 1);
    if left_0 != left_1 || left_1 != left_2 {
        return None;
    }
    let area = area_0 + area_1 + area_2;
    if area == 0.0 {
        return None;
    }
    let sign = if left_0 { 1 } else { -1 };
    Some((sign, [area_0 / area, area_1 / area, area_2 / area]))
}

/// Which cubes a triangle of the surface touches.
pub(super) fn touched_cubes(surface: &SurfaceMesh, grid: &Grid) -> Vec<bool> {
    let mut touched = vec![false; grid.cubes()];
    for triangle in surface.point_triangles() {
        let corners =
            triangle.map(|i| (surface.points[i as usize].as_dvec3() - grid.origin) / grid.cell_m);
        let low = corners[0].min(corners[1]).min(corners[2]);
        let high = corners[0].max(corners[1]).max(corners[2]);
        let [xs, ys, zs] = [0, 1, 2].map(|k| {
            let first = (low[k] - 1e-9).max(0.0) as usize;
            first..=((high[k] + 1e-9).max(0.0) as usize).min(grid.size[k] - 1)
        });
        for z in zs {
            for y in ys.clone() {
                for x in xs.clone() {
                    let centre = DVec3::new(x as f64, y as f64, z as f64) + 0.5;
                    if !touched[grid.cube([x, y, z])]
                        && touches_unit_cube(corners.map(|corner| corner - centre))
                    {
                        touched[grid.cube([x, y, z])] = true;
                    }
                }
            }
        }
    }
    // A point on the outermost face of the grid may lie a rounding error outside every cube.
    for &point in &surface.points {
        let cube = grid.locate(point.as_dvec3()).0;
        touched[cube] = true;
    }
    touched
}

/// Whether a triangle touches the cube of edge 1 about the origin, by separating axes.
///
/// Source: Akenine-Möller, "Fast 3D Triangle-Box Overlap Testing", JGT 6, 2001.
fn touches_unit_cube(corners: [DVec3; 3]) -> bool {
    const HALF: f64 = 0.5 + 1e-9;
    let edges = [
        corners[1] - corners[0],
        corners[2] - corners[1],
        corners[0] - corners[2],
    ];
    let separates = |axis: DVec3| {
        let along = corners.map(|corner| corner.dot(axis));
        let reach = HALF * axis.abs().element_sum();
        along.iter().all(|&d| d > reach) || along.iter().all(|&d| d < -reach)
    };
    if DVec3::AXES.into_iter().any(separates) || separates(edges[0].cross(edges[1])) {
        return false;
    }
    !edges.iter().any(|edge| {
        DVec3::AXES
            .into_iter()
            .any(|axis| separates(axis.cross(*edge)))
    })
}
