//! Normals, tangents and UV gradients of the deformed surface: two dispatches a frame.
//!
//! Reads the positions; owns and writes the normals, tangents and gradients that the light-path and
//! surface passes bind.

use super::mesh_buffers::MeshBuffers;
use crate::geom::SurfaceMesh;
use crate::geom::tangent::{Fans, gradient_max_per_m, rest_normals};
use crate::gpu::{
    Binding, Entry, Gpu, GpuError, Kernel, Table, Timer, Wgsl, join, storage, uniform, workgroups,
};
use crate::wgsl;
use glam::Vec3;

const WORKGROUP_SIZE: u32 = 64;

/// Mirror of `Params` in `shaders/normals.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub struct NormalsParams {
    pub point_count: u32,
    pub pad0: u32,
    pub pad1: u32,
    pub pad2: u32,
}

/// Mirror of `Params` in `shaders/tangents.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub struct TangentsParams {
    pub vertex_count: u32,
    pub gradient_max_per_m: f32,
    pub pad0: u32,
    pub pad1: u32,
}

/// The pass that follows the surface's shape. Immutable once made.
pub struct Tangents {
    normals_kernel: Kernel,
    tangents_kernel: Kernel,
    point_workgroups: u32,
    vertex_workgroups: u32,
    /// Unit normals, `[vec4f; points]`, `w` is 0.
    pub normals: wgpu::Buffer,
    /// Unit tangents towards growing u, `[vec4f; vertices]`, handedness in `w`: `w (n × t)` points
    /// towards growing v.
    pub tangents: wgpu::Buffer,
    /// Gradients of u and of v along the surface [1/m], `[array<vec4f, 2>; vertices]`, `w` is 0.
    pub uv_gradients: wgpu::Buffer,
}

impl Tangents {
    /// What the pass is called in logs.
    pub const NAME: &'static str = "tangents";
    /// The WGSL of the normals, joined in this order.
    pub const NORMALS_WGSL: &'static [Wgsl] = wgsl!["common.wgsl", "normals.wgsl"];
    /// The WGSL of the tangents and gradients, joined in this order.
    pub const TANGENTS_WGSL: &'static [Wgsl] = wgsl!["common.wgsl", "tangents.wgsl"];

    /// Builds the pass for `mesh`, reading positions from `buffers`.
    ///
    /// # Errors
    ///
    /// [`GpuError`] if the WGSL does not compile here or the mesh is too large for this adapter.
    pub fn new(gpu: &Gpu, mesh: &SurfaceMesh, buffers: &MeshBuffers) -> Result<Self, GpuError> {
        let sources = [join(Self::NORMALS_WGSL), join(Self::TANGENTS_WGSL)];
        Self::with_sources(gpu, mesh, buffers, &sources)
    }

    /// As [`Tangents::new`] with other WGSL for the normals and the tangents: lets a test sabotage a
    /// kernel and see the check fail.
    ///
    /// # Errors
    ///
    /// As [`Tangents::new`].
    pub fn with_sources(
        gpu: &Gpu,
        mesh: &SurfaceMesh,
        buffers: &MeshBuffers,
        [normals_source, tangents_source]: &[String; 2],
    ) -> Result<Self, GpuError> {
        let fans = Fans::new(mesh);
        let rest = rest_normals(mesh, &fans);
        let rest_buffer = storage(gpu, "rest normals", &directions(&rest))?;
        let normals = storage(gpu, "normals", &directions(&rest))?;
        let vertices = vec![[0.0_f32; 4]; mesh.uvs.len()];
        let tangents = storage(gpu, "tangents", &vertices)?;
        let uv_gradients = storage(gpu, "UV gradients", &[vertices.clone(), vertices].concat())?;

        let corners = |label, list: &[[u32; 2]]| Table::new(gpu, label, Entry::Pairs, list);
        let point_corners = corners("point fans", &fans.point_corners)?;
        let vertex_corners = corners("vertex fans", &fans.vertex_corners)?;
        let uv_inverse = Table::new(gpu, "inverse UV edges", Entry::Floats, &fans.uv_inverse)?;

        let normals_kernel = Kernel::new(
            gpu,
            Self::NAME,
            Self::NORMALS_WGSL,
            normals_source,
            "main",
            &[
                Binding::Uniform(&uniform(
                    gpu,
                    "normals",
                    &NormalsParams {
                        point_count: buffers.point_count,
                        pad0: 0,
                        pad1: 0,
                        pad2: 0,
                    },
                )),
                Binding::Unfiltered(&buffers.position_table.view),
                Binding::Read(&storage(gpu, "point fans", &fans.point_start)?),
                Binding::Integers(&point_corners.view),
                Binding::Read(&rest_buffer),
                Binding::Write(&normals),
            ],
        )?;
        let tangents_kernel = Kernel::new(
            gpu,
            Self::NAME,
            Self::TANGENTS_WGSL,
            tangents_source,
            "main",
            &[
                Binding::Uniform(&uniform(
                    gpu,
                    "tangents",
                    &TangentsParams {
                        vertex_count: buffers.vertex_count,
                        gradient_max_per_m: gradient_max_per_m(mesh, &fans, &rest),
                        pad0: 0,
                        pad1: 0,
                    },
                )),
                Binding::Unfiltered(&buffers.position_table.view),
                Binding::Read(&normals),
                Binding::Read(&buffers.point_of),
                Binding::Read(&storage(gpu, "vertex fans", &fans.vertex_start)?),
                Binding::Integers(&vertex_corners.view),
                Binding::Unfiltered(&uv_inverse.view),
                Binding::Write(&tangents),
                Binding::Write(&uv_gradients),
            ],
        )?;
        Ok(Self {
            normals_kernel,
            tangents_kernel,
            point_workgroups: workgroups(gpu, Self::NAME, mesh.points.len(), WORKGROUP_SIZE)?,
            vertex_workgroups: workgroups(gpu, Self::NAME, mesh.uvs.len(), WORKGROUP_SIZE)?,
            normals,
            tangents,
            uv_gradients,
        })
    }

    /// Adds both dispatches to `encoder`.
    pub fn record(&self, encoder: &mut wgpu::CommandEncoder, timer: &mut Timer) {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some(Self::NAME),
            timestamp_writes: timer.compute(Self::NAME),
        });
        self.normals_kernel
            .dispatch(&mut pass, self.point_workgroups);
        self.tangents_kernel
            .dispatch(&mut pass, self.vertex_workgroups);
    }
}

fn directions(vectors: &[Vec3]) -> Vec<[f32; 4]> {
    vectors.iter().map(|v| [v.x, v.y, v.z, 0.0]).collect()
}
