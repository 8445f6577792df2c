//! A tetrahedral lattice round a closed surface: cubes of one size, each cut into five tetrahedra.
//!
//! Cubes that touch the surface or its inside are kept. Two mirrored cuts alternate like the
//! colours of a chess board, so that the diagonals of shared faces meet. Masses follow the volume
//! that is really inside the surface, and so does the stiffness share of each tetrahedron.

mod block;
mod embed;
mod graded;
mod inside;
mod sphere;
mod thickness;

pub use block::{block, block_of_cells};
pub use embed::{boundary_triangles, embed};
pub use graded::graded_block;
pub use sphere::sphere;

use super::{Embedding, SurfaceMesh, TetMesh};
use glam::DVec3;
use inside::{Grid, Inside};
use std::fmt;

/// More tetrahedra than this are refused: no machine this runs on would finish a frame.
pub const TETS_MAX: usize = 2_000_000;
/// Tetrahedra inside a body if nothing else is asked for: what one core steps 20 times in a frame.
const TETS_DEFAULT: f64 = 5_000.0;
/// Tetrahedra that a thin body may have if nothing else is asked for.
const TETS_THIN_MAX: f64 = 20_000.0;
/// Cubes of the grid round the surface, kept or not; bounds the memory of the inside test.
const GRID_CUBES_MAX: f64 = 8e6;
/// A tetrahedron counts as at least this full. With less at the surface, its outermost tetrahedra
/// are so soft that a push folds them over.
const FILL_MIN: f32 = 0.2;

/// A lattice and how the surface hangs in it.
#[derive(Clone, Debug)]
pub struct Lattice {
    /// Particles and tetrahedra, all of them positive.
    pub tets: TetMesh,
    /// Mass of each particle [kg]; all positive, together density times enclosed volume.
    pub masses_kg: Vec<f32>,
    /// Share of each tetrahedron that is inside the surface, 0.2 to 1.
    pub fill: Vec<f32>,
    /// Where each surface point lies.
    pub embedding: Embedding,
    /// Edge of the cubes [m].
    pub cell_m: f32,
}

/// Why a lattice could not be made.
#[derive(Clone, Debug, PartialEq)]
pub enum LatticeError {
    /// The cube edge is not a positive number, or gives too many tetrahedra, or less than a cube.
    CellOutOfRange {
        /// What was asked for [m].
        cell_m: f32,
        /// Smallest edge for this surface [m].
        min_m: f32,
        /// Largest edge for this surface [m].
        max_m: f32,
    },
    /// The density is not a positive number.
    DensityOutOfRange {
        /// What was asked for [kg/m³].
        density_kg_m3: f32,
    },
    /// A point of the surface is not a finite number.
    NotFinite {
        /// Its index.
        point: usize,
    },
    /// The surface has no triangles, is flat, or is so open that nothing is inside.
    NoVolume,
}

impl fmt::Display for LatticeError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::CellOutOfRange {
                cell_m,
                min_m,
                max_m,
            } => write!(
                f,
                "a lattice cell of {cell_m} m does not fit this surface: choose from {min_m:.2e} m \
                 to {max_m:.2e} m"
            ),
            Self::DensityOutOfRange { density_kg_m3 } => write!(
                f,
                "a density of {density_kg_m3} kg/m³ is no density: choose a number above 0"
            ),
            Self::NotFinite { point } => {
                write!(f, "point {point} of the surface is not a finite number")
            }
            Self::NoVolume => write!(
                f,
                "the surface encloses no volume: it is empty, flat or wide open; close it first"
            ),
        }
    }
}

impl std::error::Error for LatticeError {}

impl Lattice {
    /// Builds the lattice of cubes of edge `cell_m` [m] round `surface`, for tissue of
    /// `density_kg_m3`.
    ///
    /// The surface should be closed; small holes and overlapping parts are bridged by a vote of
    /// three directions. Every surface point lies in a kept cube.
    ///
    /// # Errors
    ///
    /// [`LatticeError`], each with what would do instead.
    pub fn around(
        surface: &SurfaceMesh,
        cell_m: f32,
        density_kg_m3: f32,
    ) -> Result<Self, LatticeError> {
        if !(density_kg_m3.is_finite() && density_kg_m3 > 0.0) {
            return Err(LatticeError::DensityOutOfRange { density_kg_m3 });
        }
        if let Some(point) = surface.points.iter().position(|p| !p.is_finite()) {
            return Err(LatticeError::NotFinite { point });
        }
        let (low, high) = surface.bounds();
        let extent = high.as_dvec3() - low.as_dvec3();
        let longest = extent.max_element();
        if surface.triangles.is_empty() || longest <= 0.0 {
            return Err(LatticeError::NoVolume);
        }
        let out_of_range = || LatticeError::CellOutOfRange {
            cell_m,
            min_m: smallest_cell_m(surface) as f32,
            max_m: longest as f32,
        };
        // A surface that is exactly as long as its cell stands for one cube.
        if !(cell_m.is_finite() && cell_m > 0.0) || f64::from(cell_m) > 1.0001 * longest {
            return Err(out_of_range());
        }
        let grid = Grid::around(low.as_dvec3(), high.as_dvec3(), f64::from(cell_m));
        if grid.cubes_f64() > GRID_CUBES_MAX {
            return Err(out_of_range());
        }

        let inside = Inside::of(surface, &grid);
        let volume_m3 = enclosed_volume_m3(surface, inside.volumes_m3, f64::from(cell_m) / longest);
        // Thinner than a millionth of its box: rounding, no tissue.
        if volume_m3 <= 1e-6 * longest.powi(3) {
            return Err(LatticeError::NoVolume);
        }
        let touched = inside::touched_cubes(surface, &grid);
        let kept: Vec<usize> = (0..grid.cubes())
            .filter(|&cube| touched[cube] || inside.samples[cube] != 0)
            .collect();
        if 5 * kept.len() > TETS_MAX {
            return Err(out_of_range());
        }

        let (tets, first_tet) = tets_of_cubes(&grid, &kept);
        let fill = inside.fill(&grid, &kept);
        let masses_kg = masses_kg(&tets, &fill, f64::from(density_kg_m3) * volume_m3);
        let embedding = embed_in_cubes(surface, &grid, &first_tet, &tets);
        Ok(Self {
            tets,
            masses_kg,
            fill,
            embedding,
            cell_m,
        })
    }
}

/// The cubes that a surface gets if nothing else is asked for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cells {
    /// Their edge [m].
    pub cell_m: f32,
    /// Thickness of the body under the thinnest quarter of its surface [m].
    pub thin_m: f32,
}

/// Cubes for `surface`: 5,000 tetrahedra inside; smaller cubes where it is thinner than one, until there
/// are about 20,000 tetrahedra; and larger ones where its surface alone would cut more.
///
/// Zero for an empty surface.
pub fn cells_for(surface: &SurfaceMesh) -> Cells {
    let thin_m = thickness::thin_m(surface);
    let by_volume_m = cell_for_volume_m(surface.volume_m3().abs() as f32);
    let by_budget_m = cell_for_tets_m(surface, TETS_THIN_MAX).max(smallest_cell_m(surface));
    let (low, high) = surface.bounds();
    Cells {
        cell_m: (by_volume_m.min(thin_m))
            .max(by_budget_m as f32)
            .min((high - low).max_element()),
        thin_m,
    }
}

/// A cube edge [m] that fills `volume_m3` with about 5,000 tetrahedra, for shapes that need no cubes
/// beyond their surface, such as boxes.
pub fn cell_for_volume_m(volume_m3: f32) -> f32 {
    (5.0 * volume_m3 / TETS_DEFAULT as f32).cbrt()
}

/// The edge [m] at which the lattice of `surface` has about `tets` tetrahedra.
///
/// Cubes inside number V/c³; half the cubes that the surface cuts come on top, and a surface of
/// random direction cuts 1.5 A/c² of them.
fn cell_for_tets_m(surface: &SurfaceMesh, tets: f64) -> f64 {
    let (low, high) = surface.bounds();
    let longest = f64::from((high - low).max_element());
    let volume = surface.volume_m3().abs();
    let area: f64 = surface
        .point_triangles()
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|i| surface.points[i as usize].as_dvec3());
            (b - a).cross(c - a).length() / 2.0
        })
        .sum();
    let expected = |cell: f64| 5.0 * (volume / cell.powi(3) + 0.75 * area / cell.powi(2));
    let (mut fine, mut coarse) = (longest * 1e-4, longest);
    for _ in 0..60 {
        let middle = (fine * coarse).sqrt();
        if expected(middle) > tets {
            fine = middle;
        } else {
            coarse = middle;
        }
    }
    coarse
}

/// Smallest edge [m] that is sure to be taken: room for the guess to be wrong by a quarter.
fn smallest_cell_m(surface: &SurfaceMesh) -> f64 {
    let (low, high) = surface.bounds();
    let extent = (high - low).as_dvec3();
    let by_tets = cell_for_tets_m(surface, 0.75 * TETS_MAX as f64);
    // A flat box has a layer of cubes of its own, so no side counts for less than one cube.
    let mut by_grid = (extent.x * extent.y * extent.z / GRID_CUBES_MAX).cbrt();
    while Grid::around(DVec3::ZERO, extent, by_grid.max(1e-30)).cubes_f64() > GRID_CUBES_MAX {
        by_grid = (by_grid * 1.05).max(extent.max_element() / GRID_CUBES_MAX);
    }
    by_tets.max(by_grid)
}

/// Volume inside the surface [m³].
///
/// The divergence theorem is exact for a closed surface without overlaps; where the columns of the
/// inside test see another volume along every axis the surface is neither, and they are the better
/// answer. Columns are a quarter of a cell wide, `cell_share` of the longest extent, and no better than
/// that; along a sheet that is thinner they see nothing, but through it they do.
fn enclosed_volume_m3(surface: &SurfaceMesh, columns_m3: [f64; 3], cell_share: f64) -> f64 {
    let exact = surface.volume_m3().abs();
    let agrees = |seen_m3: f64| (seen_m3 - exact).abs() < (0.02 + 0.2 * cell_share) * exact;
    if columns_m3.into_iter().any(agrees) {
        exact
    } else {
        columns_m3[1]
    }
}

/// The five tetrahedra of a cube as corner numbers `x + 2y + 4z`, all positive.
///
/// The two parities are mirror images: on a shared face both use the same diagonal.
fn cube_tets(parity: usize) -> [[usize; 4]; 5] {
    // The middle one spans every second corner, the others cut off the corners between them.
    if parity == 0 {
        [
            [0, 3, 6, 5],
            [1, 3, 0, 5],
            [2, 0, 3, 6],
            [4, 0, 6, 5],
            [7, 6, 3, 5],
        ]
    } else {
        [
            [1, 2, 4, 7],
            [0, 1, 2, 4],
            [3, 2, 1, 7],
            [5, 1, 4, 7],
            [6, 4, 2, 7],
        ]
    }
}

/// Place of a cube corner in the unit cube.
fn corner_offset(corner: usize) -> [usize; 3] {
    [corner & 1, (corner >> 1) & 1, (corner >> 2) & 1]
}

/// Barycentric weights of `x` in the tetrahedron `corners`; `None` if it is flat.
fn barycentric(corners: [DVec3; 4], x: DVec3) -> Option<[f64; 4]> {
    let [a, b, c] = [1, 2, 3].map(|k| corners[k] - corners[0]);
    let six_volumes = a.dot(b.cross(c));
    if six_volumes.abs() < f64::MIN_POSITIVE {
        return None;
    }
    let d = x - corners[0];
    let w1 = d.dot(b.cross(c)) / six_volumes;
    let w2 = d.dot(c.cross(a)) / six_volumes;
    let w3 = d.dot(a.cross(b)) / six_volumes;
    Some([1.0 - w1 - w2 - w3, w1, w2, w3])
}

/// Which of a cube's five tetrahedra holds the place `local` in the unit cube, and its weights.
/// Outside the cube it is the tetrahedron that is left by the least.
fn tet_at(parity: usize, local: DVec3) -> (usize, [f64; 4]) {
    let mut best = (0, [f64::NEG_INFINITY; 4]);
    let smallest = |weights: [f64; 4]| weights.into_iter().fold(f64::INFINITY, f64::min);
    for (index, tet) in cube_tets(parity).into_iter().enumerate() {
        let corners = tet.map(|corner| {
            let [x, y, z] = corner_offset(corner).map(|offset| offset as f64);
            DVec3::new(x, y, z)
        });
        let weights = barycentric(corners, local).expect("the tetrahedra of a cube have volume");
        if smallest(weights) > smallest(best.1) {
            best = (index, weights);
        }
    }
    best
}

/// Particles and tetrahedra of the `kept` cubes, and the first tetrahedron of each cube
/// (`usize::MAX` for those left out).
fn tets_of_cubes(grid: &Grid, kept: &[usize]) -> (TetMesh, Vec<usize>) {
    let mut first_tet = vec![usize::MAX; grid.cubes()];
    let mut particle_at = vec![u32::MAX; grid.nodes()];
    let mut mesh = TetMesh::default();
    // Nodes are numbered in grid order, so that neighbours in space are neighbours in memory.
    for &cube in kept {
        for corner in 0..8 {
            particle_at[grid.corner_node(cube, corner)] = 0;
        }
    }
    for (node, particle) in particle_at.iter_mut().enumerate() {
        if *particle == 0 {
            *particle = mesh.particles.len() as u32;
            mesh.particles.push(grid.node_place(node).as_vec3());
        }
    }
    for &cube in kept {
        first_tet[cube] = mesh.tets.len();
        for tet in cube_tets(grid.parity(cube)) {
            mesh.tets
                .push(tet.map(|corner| particle_at[grid.corner_node(cube, corner)]));
        }
    }
    (mesh, first_tet)
}

/// Particle masses [kg] that add up to `total_kg`, a quarter of each tetrahedron's share a corner.
fn masses_kg(mesh: &TetMesh, fill: &[f32], total_kg: f64) -> Vec<f32> {
    let mut shares = vec![0.0_f64; mesh.particles.len()];
    for (tet, &fill) in mesh.tets.iter().zip(fill) {
        let share = tet_volume_m3(mesh, *tet) * f64::from(fill);
        for &particle in tet {
            shares[particle as usize] += share;
        }
    }
    let sum: f64 = shares.iter().sum();
    shares
        .iter()
        .map(|share| (share * total_kg / sum) as f32)
        .collect()
}

/// Signed volume of a tetrahedron [m³].
fn tet_volume_m3(mesh: &TetMesh, tet: [u32; 4]) -> f64 {
    let [a, b, c, d] = tet.map(|particle| mesh.particles[particle as usize].as_dvec3());
    (b - a).dot((c - a).cross(d - a)) / 6.0
}

/// Each surface point in the cube that holds it.
fn embed_in_cubes(
    surface: &SurfaceMesh,
    grid: &Grid,
    first_tet: &[usize],
    mesh: &TetMesh,
) -> Embedding {
    let mut embedding = Embedding::default();
    for &point in &surface.points {
        let (cube, local) = grid.locate(point.as_dvec3());
        if first_tet[cube] == usize::MAX {
            // Only a point that no triangle uses can lie in a cube that was not kept.
            let lone = embed(mesh, &[point]);
            embedding.particles.extend(lone.particles);
            embedding.weights.extend(lone.weights);
            continue;
        }
        let (tet, weights) = tet_at(grid.parity(cube), local);
        embedding.particles.push(mesh.tets[first_tet[cube] + tet]);
        embedding.weights.push(weights.map(|w| w as f32));
    }
    embedding
}

#[cfg(test)]
mod tests;
