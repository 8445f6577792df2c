//! Planes fitted at rest and turned with the tangent frames: one cheap dispatch a frame.

use super::tangents::Tangents;
use crate::geom::SurfaceMesh;
use crate::geom::plane::{Plane, plane_in_frame};
use crate::geom::tangent::{Fans, tangent_frames};
use crate::gpu::{Binding, Gpu, GpuError, Kernel, Timer, Wgsl, join, storage, uniform, workgroups};
use crate::wgsl;
use glam::Vec3;

const WORKGROUP_SIZE: u32 = 64;

/// Mirror of `Params` in `shaders/plane_carried.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Params {
    pub point_count: u32,
    pub pad0: u32,
    pub pad1: u32,
    pub pad2: u32,
}

/// The pass that turns planes with their points. Immutable once made.
pub struct PlaneCarried {
    kernel: Kernel,
    workgroups: u32,
    /// Unit normal and signed offset [m], `[vec4f; points]`.
    pub planes: wgpu::Buffer,
}

impl PlaneCarried {
    /// What the pass is called in logs.
    pub const NAME: &'static str = "planes-carried";
    /// The WGSL of the pass.
    pub const WGSL: &'static [Wgsl] = wgsl!["plane_carried.wgsl"];

    /// Builds the pass from the planes and normals of the points at rest.
    ///
    /// # Errors
    ///
    /// [`GpuError`] if the WGSL does not compile here or the mesh is too large for this adapter.
    pub fn new(
        gpu: &Gpu,
        mesh: &SurfaceMesh,
        rest_planes: &[Plane],
        rest_normals: &[Vec3],
        tangents: &Tangents,
    ) -> Result<Self, GpuError> {
        let local = planes_in_frames(mesh, rest_planes, rest_normals);
        Self::with_source(gpu, mesh, &local, tangents, &join(Self::WGSL))
    }

    /// As [`PlaneCarried::new`] with other WGSL, and planes that are already written in the tangent
    /// frames: lets a test sabotage the kernel and see the check fail.
    ///
    /// # Errors
    ///
    /// As [`PlaneCarried::new`].
    pub fn with_source(
        gpu: &Gpu,
        mesh: &SurfaceMesh,
        planes_in_frames: &[Plane],
        tangents: &Tangents,
        source: &str,
    ) -> Result<Self, GpuError> {
        let point_count = mesh.points.len();
        let local: Vec<[f32; 4]> = planes_in_frames.iter().map(|p| p.to_array()).collect();
        let planes = storage(gpu, "planes", &vec![[0.0_f32; 4]; point_count])?;
        let kernel = Kernel::new(
            gpu,
            Self::NAME,
            Self::WGSL,
            source,
            "main",
            &[
                Binding::Uniform(&uniform(
                    gpu,
                    Self::NAME,
                    &Params {
                        point_count: point_count as u32,
                        pad0: 0,
                        pad1: 0,
                        pad2: 0,
                    },
                )),
                Binding::Read(&storage(gpu, "planes at rest", &local)?),
                Binding::Read(&storage(
                    gpu,
                    "vertex of each point",
                    &mesh.first_vertex_of_point(),
                )?),
                Binding::Read(&tangents.normals),
                Binding::Read(&tangents.tangents),
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

/// `rest_planes` with their normals written in the tangent frame of each point's first vertex.
pub fn planes_in_frames(
    mesh: &SurfaceMesh,
    rest_planes: &[Plane],
    rest_normals: &[Vec3],
) -> Vec<Plane> {
    let fans = Fans::new(mesh);
    let frames = tangent_frames(&fans, &mesh.point_of, &mesh.points, rest_normals, f32::MAX);
    mesh.first_vertex_of_point()
        .iter()
        .zip(rest_planes)
        .zip(rest_normals)
        .map(|((&vertex, &plane), &normal)| {
            let frame = frames[vertex as usize];
            plane_in_frame(plane, frame.tangent, frame.handedness, normal)
        })
        .collect()
}
