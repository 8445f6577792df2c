//! Planes fitted at rest and left where they were in space: the offset from the point that moved away, a frame.

use super::mesh_buffers::MeshBuffers;
use crate::geom::plane::Plane;
use crate::gpu::{Binding, Gpu, GpuError, Kernel, Timer, Wgsl, join, storage, uniform, workgroups};
use crate::wgsl;
use glam::Vec3;

const WORKGROUP_SIZE: u32 = 64;

/// Mirror of `Params` in `shaders/plane_stale.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Params {
    pub point_count: u32,
    pub pad0: u32,
    pub pad1: u32,
    pub pad2: u32,
}

/// The pass that tells how far each point has gone from its plane. Immutable once made.
pub struct PlaneStale {
    kernel: Kernel,
    workgroups: u32,
    /// Unit normal and signed offset [m], `[vec4f; points]`.
    pub planes: wgpu::Buffer,
}

impl PlaneStale {
    /// What the pass is called in logs.
    pub const NAME: &'static str = "planes-stale";
    /// The WGSL of the pass.
    pub const WGSL: &'static [Wgsl] = wgsl!["plane_stale.wgsl"];

    /// Builds the pass from the planes and places [m] of the points at rest.
    ///
    /// # Errors
    ///
    /// [`GpuError`] if the WGSL does not compile here or the mesh is too large for this adapter.
    pub fn new(
        gpu: &Gpu,
        rest_places: &[Vec3],
        rest_planes: &[Plane],
        buffers: &MeshBuffers,
    ) -> Result<Self, GpuError> {
        Self::with_source(gpu, rest_places, rest_planes, buffers, &join(Self::WGSL))
    }

    /// As [`PlaneStale::new`] with other WGSL: lets a test sabotage the kernel and see the check fail.
    ///
    /// # Errors
    ///
    /// As [`PlaneStale::new`].
    pub fn with_source(
        gpu: &Gpu,
        rest_places: &[Vec3],
        rest_planes: &[Plane],
        buffers: &MeshBuffers,
        source: &str,
    ) -> Result<Self, GpuError> {
        let point_count = rest_places.len();
        let at_rest: Vec<[f32; 4]> = rest_planes.iter().map(|p| p.to_array()).collect();
        let places: Vec<[f32; 4]> = rest_places.iter().map(|p| [p.x, p.y, p.z, 1.0]).collect();
        let planes = storage(gpu, "planes", &at_rest)?;
        let params = Params {
            point_count: point_count as u32,
            pad0: 0,
            pad1: 0,
            pad2: 0,
        };
        let kernel = Kernel::new(
            gpu,
            Self::NAME,
            Self::WGSL,
            source,
            "main",
            &[
                Binding::Uniform(&uniform(gpu, Self::NAME, &params)),
                Binding::Read(&storage(gpu, "planes at rest", &at_rest)?),
                Binding::Read(&storage(gpu, "places at rest", &places)?),
                Binding::Read(&buffers.positions),
                Binding::Write(&planes),
            ],
        )?;
        Ok(Self {
            kernel,
            workgroups: workgroups(gpu, Self::NAME, point_count, WORKGROUP_SIZE)?,
            planes,
        })
    }

    /// Adds the dispatch to `encoder`.
    pub fn record(&self, encoder: &mut wgpu::CommandEncoder, timer: &mut Timer) {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some(Self::NAME),
            timestamp_writes: timer.compute(Self::NAME),
        });
        self.kernel.dispatch(&mut pass, self.workgroups);
    }
}
