//! A box by formula: slabs and beams.

use super::{
    super::{Embedding, SurfaceMesh, TetMesh},
    boundary_triangles,
    inside::Grid,
    tet_volume_m3, tets_of_cubes,
};
use glam::{DVec3, Vec2, Vec3};
use std::collections::HashMap;

/// Space between two charts, as a share of the atlas.
const GUTTER: f32 = 0.02;

/// A box of tetrahedra with its own skin as surface.
#[derive(Clone, Debug)]
pub struct Block {
    /// Five tetrahedra a cell, all positive.
    pub tets: TetMesh,
    /// The skin, in six charts that do not overlap and share one scale.
    pub surface: SurfaceMesh,
    /// Each surface point is a particle.
    pub embedding: Embedding,
}

impl Block {
    /// Mass of each particle [kg]: a quarter of each of its tetrahedra.
    pub fn masses_kg(&self, density_kg_m3: f32) -> Vec<f32> {
        let mut masses = vec![0.0_f64; self.tets.particles.len()];
        for &tet in &self.tets.tets {
            let quarter = tet_volume_m3(&self.tets, tet) * f64::from(density_kg_m3) / 4.0;
            for particle in tet {
                masses[particle as usize] += quarter;
            }
        }
        masses.into_iter().map(|mass| mass as f32).collect()
    }
}

/// A box from the origin to `size_m` in `cells` cells a side.
///
/// # Panics
///
/// If a side is not a positive number, or a count is 0.
pub fn block(size_m: Vec3, cells: [usize; 3]) -> Block {
    assert!(
        size_m.is_finite() && size_m.min_element() > 0.0,
        "a box has three positive sides, not {size_m}"
    );
    assert!(cells.iter().all(|&n| n > 0), "a box has at least one cell");
    let grid = Grid::of_size(cells);
    let all: Vec<usize> = (0..grid.cubes()).collect();
    let (mut tets, _) = tets_of_cubes(&grid, &all);
    let scale = size_m.as_dvec3() / DVec3::from_array(cells.map(|n| n as f64));
    for particle in &mut tets.particles {
        *particle = (particle.as_dvec3() * scale).as_vec3();
    }
    let (surface, carriers) = skin(&tets, size_m);
    let embedding = Embedding {
        particles: carriers.iter().map(|&carrier| [carrier; 4]).collect(),
        weights: vec![[1.0, 0.0, 0.0, 0.0]; carriers.len()],
    };
    Block {
        tets,
        surface,
        embedding,
    }
}

/// The surface of a box, and the particle of each of its points.
fn skin(tets: &TetMesh, size_m: Vec3) -> (SurfaceMesh, Vec<u32>) {
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
                surface.uvs.push(side.uv(place, size_m));
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
