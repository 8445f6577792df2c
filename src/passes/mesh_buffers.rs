//! The surface on the GPU: what every pass reads, and the one upload a frame.

use crate::geom::SurfaceMesh;
use crate::gpu::{Gpu, GpuError, storage};
use glam::Vec3;

/// Buffers of a surface. Only the positions change.
pub struct MeshBuffers {
    /// Where each point lies now [m], `[vec4f; points]`, `w` is 1.
    pub positions: wgpu::Buffer,
    /// The point of each vertex, `[u32; vertices]`.
    pub point_of: wgpu::Buffer,
    /// Texture coordinate of each vertex, `[vec2f; vertices]`.
    pub uvs: wgpu::Buffer,
    /// Vertices of the triangle list, `[u32; 3 * triangles]`; also an index buffer.
    pub indices: wgpu::Buffer,
    /// Places that move.
    pub point_count: u32,
    /// Points with a texture coordinate.
    pub vertex_count: u32,
    /// Entries of `indices`.
    pub index_count: u32,
}

impl MeshBuffers {
    /// Uploads `mesh` as it lies at rest.
    ///
    /// # Errors
    ///
    /// [`GpuError::BufferTooLarge`] if the adapter can't bind one of the lists.
    pub fn new(gpu: &Gpu, mesh: &SurfaceMesh) -> Result<Self, GpuError> {
        Ok(Self {
            positions: storage(gpu, "positions", &places(&mesh.points))?,
            point_of: storage(gpu, "point of each vertex", &mesh.point_of)?,
            uvs: storage(gpu, "texture coordinates", &mesh.uvs)?,
            indices: storage(gpu, "triangles", mesh.triangles.as_flattened())?,
            point_count: mesh.points.len() as u32,
            vertex_count: mesh.uvs.len() as u32,
            index_count: 3 * mesh.triangles.len() as u32,
        })
    }

    /// Replaces the positions [m] before the next submitted frame.
    ///
    /// # Panics
    ///
    /// If `points` does not have one position a point.
    pub fn upload(&self, gpu: &Gpu, points: &[Vec3]) {
        assert_eq!(
            points.len(),
            self.point_count as usize,
            "one position a point"
        );
        gpu.queue
            .write_buffer(&self.positions, 0, bytemuck::cast_slice(&places(points)));
    }
}

fn places(points: &[Vec3]) -> Vec<[f32; 4]> {
    points.iter().map(|p| [p.x, p.y, p.z, 1.0]).collect()
}
