//! The surface on the GPU: what every pass reads, and the one upload a frame.

use crate::geom::SurfaceMesh;
use crate::gpu::{Entry, Gpu, GpuError, Table, storage};
use glam::Vec3;

/// Buffers of a surface. Only the positions change.
pub struct MeshBuffers {
    /// Where each point lies now [m], `[vec4f; points]`; `w` is what its tissue would fill if nothing pressed it, over that
    /// at rest: 1 unless muscle has shortened.
    pub positions: wgpu::Buffer,
    /// The same, as a table for kernels that look up many.
    pub position_table: Table,
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
    /// The `w` of each position; nothing where all are 1.
    volumes: Vec<f32>,
}

impl MeshBuffers {
    /// Uploads `mesh` as it lies at rest.
    ///
    /// # Errors
    ///
    /// [`GpuError::BufferTooLarge`] if the adapter can't bind one of the lists.
    pub fn new(gpu: &Gpu, mesh: &SurfaceMesh) -> Result<Self, GpuError> {
        let places = places(&mesh.points, &[]);
        Ok(Self {
            positions: storage(gpu, "positions", &places)?,
            position_table: Table::new(gpu, "positions", Entry::Floats, &places)?,
            point_of: storage(gpu, "point of each vertex", &mesh.point_of)?,
            uvs: storage(gpu, "texture coordinates", &mesh.uvs)?,
            indices: storage(gpu, "triangles", mesh.triangles.as_flattened())?,
            point_count: mesh.points.len() as u32,
            vertex_count: mesh.uvs.len() as u32,
            index_count: 3 * mesh.triangles.len() as u32,
            volumes: Vec::new(),
        })
    }

    /// Says what the tissue at each point would fill if nothing pressed it, over that at rest, from the next upload on.
    ///
    /// # Panics
    ///
    /// If there is not one volume a point.
    pub fn set_volumes(&mut self, volumes: &[f32]) {
        assert_eq!(
            volumes.len(),
            self.point_count as usize,
            "one volume a point"
        );
        self.volumes.clear();
        self.volumes.extend_from_slice(volumes);
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
        let places = places(points, &self.volumes);
        gpu.queue
            .write_buffer(&self.positions, 0, bytemuck::cast_slice(&places));
        self.position_table.write(gpu, &places);
    }
}

impl MeshBuffers {
    /// Draws every triangle with the pipeline that `pass` has set.
    pub fn draw(&self, pass: &mut wgpu::RenderPass<'_>) {
        pass.set_index_buffer(self.indices.slice(..), wgpu::IndexFormat::Uint32);
        pass.draw_indexed(0..self.index_count, 0, 0..1);
    }
}

/// The surface as triangles of points: for maps of depth, which need no texture coordinates.
pub struct PointTriangles {
    indices: wgpu::Buffer,
    count: u32,
}

impl PointTriangles {
    /// The triangles of `mesh`.
    ///
    /// # Errors
    ///
    /// [`GpuError::BufferTooLarge`] if the adapter can't bind the list.
    pub fn new(gpu: &Gpu, mesh: &SurfaceMesh) -> Result<Self, GpuError> {
        let triangles = mesh.point_triangles();
        Ok(Self {
            indices: storage(gpu, "triangles of points", triangles.as_flattened())?,
            count: 3 * triangles.len() as u32,
        })
    }

    /// Draws every triangle with the pipeline that `pass` has set, whose first attribute is read from `positions`.
    pub fn draw(&self, positions: &wgpu::Buffer, pass: &mut wgpu::RenderPass<'_>) {
        pass.set_vertex_buffer(0, positions.slice(..));
        pass.set_index_buffer(self.indices.slice(..), wgpu::IndexFormat::Uint32);
        pass.draw_indexed(0..self.count, 0, 0..1);
    }
}

fn places(points: &[Vec3], volumes: &[f32]) -> Vec<[f32; 4]> {
    let volumes = volumes.iter().copied().chain(std::iter::repeat(1.0));
    (points.iter().zip(volumes))
        .map(|(p, volume)| [p.x, p.y, p.z, volume])
        .collect()
}
