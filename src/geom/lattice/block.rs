//! A box by formula: slabs and beams.

use super::{
    super::{Embedding, SurfaceMesh, TetMesh},
    Lattice, LatticeError, TETS_MAX, boundary_triangles,
    inside::Grid,
    masses_kg, tets_of_cubes,
};
use glam::{DVec3, Vec2, Vec3};
use std::collections::HashMap;

/// Space between two charts, as a share of the atlas.
const GUTTER: f32 = 0.02;

/// A box from the origin to `size_m` of tissue of `density_kg_m3`, with its own skin as surface, in
/// cells of about `cell_m`: as many a side as fit best.
///
/// # Errors
///
/// [`LatticeError`] for a cell that gives too many tetrahedra or is longer than the box, and for a
/// box or a density that is not positive.
pub fn block(
    size_m: Vec3,
    cell_m: f32,
    density_kg_m3: f32,
) -> Result<(SurfaceMesh, Lattice), LatticeError> {
    if !(size_m.is_finite() && size_m.min_element() > 0.0) {
        return Err(LatticeError::NoVolume);
    }
    if !(density_kg_m3.is_finite() && density_kg_m3 > 0.0) {
        return Err(LatticeError::DensityOutOfRange { density_kg_m3 });
    }
    let longest = size_m.max_element();
    let counts = (size_m / cell_m).round().max(Vec3::ONE);
    let tets = 5.0 * counts.as_dvec3().element_product();
    if !(cell_m > 0.0 && cell_m <= 1.0001 * longest && tets <= TETS_MAX as f64) {
        return Err(LatticeError::CellOutOfRange {
            cell_m,
            // A quarter more than fits on average: counts are rounded.
            min_m: 1.25 * (5.0 * size_m.element_product() / TETS_MAX as f32).cbrt(),
            max_m: longest,
        });
    }
    let (surface, mut lattice) = block_of_cells(size_m, counts.to_array().map(|n| n as usize));
    for mass in &mut lattice.masses_kg {
        *mass *= density_kg_m3;
    }
    Ok((surface, lattice))
}

/// A box from the origin to `size_m` in `cells` cells a side, of density 1 kg/m³.
///
/// The surface has six charts that do not overlap and share one scale; each of its points is a
/// particle.
///
/// # Panics
///
/// If a side is not a positive number, or a count is 0.
pub fn block_of_cells(size_m: Vec3, cells: [usize; 3]) -> (SurfaceMesh, Lattice) {
    assert!(
        size_m.is_finite() && size_m.min_element() > 0.0,
        "a box has three positive sides, not {size_m}"
    );
    assert!(cells.iter().all(|&n| n > 0), "a box has at least one cell");
    let grid = Grid::of_size(cells);
    let all: Vec<usize> = (0..grid.cubes()).collect();
    let (mut tets, _) = tets_of_cubes(&grid, &all);
    let cell = size_m.as_dvec3() / DVec3::from_array(cells.map(|n| n as f64));
    for particle in &mut tets.particles {
        *particle = (particle.as_dvec3() * cell).as_vec3();
    }
    let (surface, carriers) = skin(&tets, Vec3::ZERO, size_m);
    let fill = vec![1.0; tets.tets.len()];
    let lattice = Lattice {
        masses_kg: masses_kg(&tets, &fill, size_m.as_dvec3().element_product()),
        fill,
        embedding: Embedding {
            particles: carriers.iter().map(|&carrier| [carrier; 4]).collect(),
            weights: vec![[1.0, 0.0, 0.0, 0.0]; carriers.len()],
        },
        cell_m: cell.max_element() as f32,
        tets,
    };
    (surface, lattice)
}

/// The surface of a box from `low` on, and the particle of each of its points.
pub(super) fn skin(tets: &TetMesh, low: Vec3, size_m: Vec3) -> (SurfaceMesh, Vec<u32>) {
    let mut surface = SurfaceMesh::default();
    let mut carriers = Vec::new();
    let mut point_of_particle = HashMap::new();
    let mut vertex_of = HashMap::new();
    for triangle in boundary_triangles(tets) {
        let [a, b, c] = triangle.map(|particle| tets.particles[particle as usize]);
        let side = Side::facing((b - a).cross(c - a));
        surface.triangles.push(triangle.map(|particle| {
            *vertex_of.entry((particle, side)).or_insert_with(|| {
                let place = tets.particles[particle as usize];
                let point = *point_of_particle.entry(particle).or_insert_with(|| {
                    surface.points.push(place);
                    carriers.push(particle);
                    surface.points.len() as u32 - 1
                });
                surface.point_of.push(point);
                surface.uvs.push(side.uv(place - low, size_m));
                surface.uvs.len() as u32 - 1
            })
        }));
    }
    (surface, carriers)
}

/// One of the six sides of a box.
#[derive(Clone, Copy, PartialEq, Eq, Hash)]
struct Side {
    axis: usize,
    towards_positive: bool,
}

impl Side {
    fn facing(normal: Vec3) -> Self {
        let axis = normal.abs().max_position();
        Self {
            axis,
            towards_positive: normal[axis] > 0.0,
        }
    }

    /// Place in the atlas: a row for each axis, the two sides of that axis beside each other.
    fn uv(self, place: Vec3, size: Vec3) -> Vec2 {
        // Columns and rows of a chart: x wherever the side has it, so that the atlas is compact.
        let (across, down) = [(1, 2), (0, 2), (0, 1)][self.axis];
        let width = 2.0 * size.x.max(size.y);
        let height = 2.0 * size.z + size.y;
        let gutter = GUTTER * width.max(height);
        let scale = 1.0 / (width + 3.0 * gutter).max(height + 4.0 * gutter);
        // The charts of one axis are equally high: z, z, y.
        let top = [0.0, size.z, 2.0 * size.z][self.axis] + (self.axis + 1) as f32 * gutter;
        // Seen from outside, the coordinate grows to the right on one side and to the left on the
        // other.
        let rightwards = self.towards_positive == (self.axis != 1);
        let along = if rightwards {
            place[across]
        } else {
            size[across] - place[across]
        };
        let left = if self.towards_positive {
            gutter
        } else {
            2.0 * gutter + size[across]
        };
        scale * Vec2::new(left + along, top + (size[down] - place[down]))
    }
}
