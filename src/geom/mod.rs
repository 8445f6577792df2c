//! Shapes: the surface that is drawn and the tetrahedra that are simulated.
//!
//! Nothing here knows of time, of the GPU or of scene files.

pub mod chart;
pub mod export;
pub mod import;
pub mod lattice;
pub mod moments;
pub mod noise;
pub mod organ;
pub mod paint;
pub mod patch;
pub mod plane;
pub mod quadric;
pub mod ray;
pub mod sample;
pub mod specimen;
pub mod tangent;
pub mod tet;
pub mod unwrap;

#[cfg(test)]
#[path = "../../tests/support/surfaces.rs"]
mod surfaces;

use glam::{Vec2, Vec3};

/// A closed triangle surface with texture coordinates.
///
/// A *point* is a position on the surface; it is what moves, has a normal and owns a patch. A
/// *vertex* is a point with a texture coordinate: where the UV map has a seam, one point has
/// several vertices. A mesh without seams has as many vertices as points.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct SurfaceMesh {
    /// Unique positions at rest [m].
    pub points: Vec<Vec3>,
    /// The point of each vertex.
    pub point_of: Vec<u32>,
    /// Texture coordinate of each vertex; v grows downwards in the image, as in glTF.
    pub uvs: Vec<Vec2>,
    /// Corners are vertices, counter-clockwise seen from outside.
    pub triangles: Vec<[u32; 3]>,
}

impl SurfaceMesh {
    /// Corners of `triangle` as points.
    pub fn point_triangle(&self, triangle: usize) -> [u32; 3] {
        self.triangles[triangle].map(|vertex| self.point_of[vertex as usize])
    }

    /// All triangles with their corners as points.
    pub fn point_triangles(&self) -> Vec<[u32; 3]> {
        (0..self.triangles.len())
            .map(|triangle| self.point_triangle(triangle))
            .collect()
    }

    /// One point of each vertex, chosen as the first vertex that uses it: `[vertex; points]`.
    ///
    /// # Panics
    ///
    /// If a point has no vertex.
    pub fn first_vertex_of_point(&self) -> Vec<u32> {
        let mut first = vec![u32::MAX; self.points.len()];
        for (vertex, &point) in self.point_of.iter().enumerate().rev() {
            first[point as usize] = vertex as u32;
        }
        assert!(
            first.iter().all(|&vertex| vertex != u32::MAX),
            "every point has a vertex"
        );
        first
    }

    /// Smallest and largest corner of the box around the points [m].
    pub fn bounds(&self) -> (Vec3, Vec3) {
        bounds(&self.points)
    }

    /// Volume inside the surface [m³]; positive if the triangles face outwards.
    pub fn volume_m3(&self) -> f64 {
        volume_m3(&self.points, &self.point_triangles())
    }
}

/// Tetrahedra of a body; corners are particles, ordered so that a sound tetrahedron has a positive
/// volume `(x1 - x0) · ((x2 - x0) × (x3 - x0)) / 6`.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct TetMesh {
    /// Particle positions at rest [m].
    pub particles: Vec<Vec3>,
    /// Corners of each tetrahedron.
    pub tets: Vec<[u32; 4]>,
}

/// Where each surface point lies in a [`TetMesh`]: `x = Σ weight · particle`.
///
/// Weights sum to 1. A point outside every tetrahedron is extrapolated from the nearest one, so
/// some of its weights are negative.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Embedding {
    /// The four particles that carry each point.
    pub particles: Vec<[u32; 4]>,
    /// Their barycentric weights.
    pub weights: Vec<[f32; 4]>,
}

impl Embedding {
    /// Writes the position of every point [m], given the particles' positions.
    ///
    /// # Panics
    ///
    /// If `points` has another length than the embedding.
    pub fn apply(&self, particles: &[Vec3], points: &mut [Vec3]) {
        assert_eq!(points.len(), self.particles.len(), "one place a point");
        for ((point, tet), weight) in points.iter_mut().zip(&self.particles).zip(&self.weights) {
            *point = (0..4)
                .map(|k| weight[k] * particles[tet[k] as usize])
                .sum::<Vec3>();
        }
    }
}

/// Smallest and largest corner of the box around `points`; zeros if there are none.
pub fn bounds(points: &[Vec3]) -> (Vec3, Vec3) {
    let Some(&first) = points.first() else {
        return (Vec3::ZERO, Vec3::ZERO);
    };
    points
        .iter()
        .fold((first, first), |(low, high), &p| (low.min(p), high.max(p)))
}

/// Volume inside a closed surface [m³], by the divergence theorem, in f64.
pub fn volume_m3(points: &[Vec3], triangles: &[[u32; 3]]) -> f64 {
    triangles
        .iter()
        .map(|t| {
            let [a, b, c] = t.map(|i| points[i as usize].as_dvec3());
            a.dot(b.cross(c)) / 6.0
        })
        .sum()
}
