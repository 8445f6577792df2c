//! Planes fitted where something moved, from running moments: two dispatches, the second of which
//! does nothing for a patch in which nothing moved.

use super::light_path::RefitCounts;
use super::mesh_buffers::MeshBuffers;
use super::tangents::Tangents;
use crate::geom::moments::RunningPlanes;
use crate::geom::patch::{LEAF_SLOTS, Patches};
use crate::gpu::{
    Binding, Gpu, GpuError, Kernel, Timer, Wgsl, join, read_buffer, storage, uniform, workgroups,
};
use crate::wgsl;
use glam::Vec3;

const WORKGROUP_SIZE: u32 = 64;

/// Mirror of `Params` in `shaders/plane_moved.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub struct MovedParams {
    pub slot_count: u32,
    pub tolerance_squared_m2: f32,
    pub pad0: u32,
    pub pad1: u32,
}

/// Mirror of `Params` in `shaders/plane_incremental.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub struct UpdateParams {
    pub slot_count: u32,
    pub quanta: f32,
    pub rest_per_m: f32,
    pub pad0: u32,
}

/// The pass that keeps planes up to date.
pub struct PlaneIncremental {
    moved_kernel: Kernel,
    update_kernel: Kernel,
    leaf_workgroups: u32,
    slot_workgroups: u32,
    /// Counts of the frame, then a mark for each slot.
    frame: wgpu::Buffer,
    /// Sums of every patch, `[PatchSums; slots]`.
    pub sums: wgpu::Buffer,
    /// Unit normal and signed offset [m], `[vec4f; points]`.
    pub planes: wgpu::Buffer,
}

impl PlaneIncremental {
    /// What the pass is called in logs.
    pub const NAME: &'static str = "planes-incremental";
    /// The WGSL that finds moved points.
    pub const MOVED_WGSL: &'static [Wgsl] = wgsl!["plane_moved.wgsl"];
    /// The WGSL that updates and fits, joined in this order.
    pub const UPDATE_WGSL: &'static [Wgsl] = wgsl!["plane_fit.wgsl", "plane_incremental.wgsl"];

    /// Builds the pass with the sums and planes of `points` at rest.
    ///
    /// # Errors
    ///
    /// [`GpuError`] if the WGSL does not compile here or the lists are too long for this adapter.
    pub fn new(
        gpu: &Gpu,
        tolerance_m: f32,
        points: &[Vec3],
        normals: &[Vec3],
        patches: &Patches,
        buffers: &MeshBuffers,
        tangents: &Tangents,
    ) -> Result<Self, GpuError> {
        let rest = RunningPlanes::new(points, normals, patches);
        let sources = [join(Self::MOVED_WGSL), join(Self::UPDATE_WGSL)];
        Self::with_sources(
            gpu,
            tolerance_m,
            &rest,
            patches,
            buffers,
            tangents,
            &sources,
        )
    }

    /// As [`PlaneIncremental::new`] from sums that are already made and with other WGSL for finding
    /// and updating: lets a test sabotage a kernel and see the check fail.
    ///
    /// # Errors
    ///
    /// As [`PlaneIncremental::new`].
    pub fn with_sources(
        gpu: &Gpu,
        tolerance_m: f32,
        rest: &RunningPlanes,
        patches: &Patches,
        buffers: &MeshBuffers,
        tangents: &Tangents,
        [moved_source, update_source]: &[String; 2],
    ) -> Result<Self, GpuError> {
        let slot_count = patches.order.len();
        let leaf_count = patches.leaf_count();
        let slots = storage(gpu, "places by slot", &rest.slots)?;
        let moved = storage(gpu, "moved slots", &rest.moved)?;
        let frame = storage(gpu, "marked patches", &vec![0_u32; 2 + leaf_count])?;
        let sums = storage(gpu, "patch sums", &rest.patches)?;
        let planes: Vec<[f32; 4]> = rest.planes.iter().map(|plane| plane.to_array()).collect();
        let planes = storage(gpu, "planes", &planes)?;
        let of_leaves = patches.patches_of_leaves();
        let moved_kernel = Kernel::new(
            gpu,
            Self::NAME,
            Self::MOVED_WGSL,
            moved_source,
            "main",
            &[
                Binding::Uniform(&uniform(
                    gpu,
                    Self::NAME,
                    &MovedParams {
                        slot_count: slot_count as u32,
                        tolerance_squared_m2: tolerance_m * tolerance_m,
                        pad0: 0,
                        pad1: 0,
                    },
                )),
                Binding::Read(&buffers.positions),
                Binding::Read(&storage(gpu, "slot order", &patches.order)?),
                Binding::Read(&storage(gpu, "patches of leaves", &of_leaves.start)?),
                Binding::Read(&storage(gpu, "patches of leaves", &of_leaves.blocks)?),
                Binding::Write(&slots),
                Binding::Write(&moved),
                Binding::Write(&frame),
            ],
        )?;
        let update_kernel = Kernel::new(
            gpu,
            Self::NAME,
            Self::UPDATE_WGSL,
            update_source,
            "main",
            &[
                Binding::Uniform(&uniform(
                    gpu,
                    Self::NAME,
                    &UpdateParams {
                        slot_count: slot_count as u32,
                        quanta: rest.quanta,
                        rest_per_m: rest.rest_per_m,
                        pad0: 0,
                    },
                )),
                Binding::Read(&slots),
                Binding::Read(&moved),
                Binding::Read(&storage(gpu, "patch members", &patches.lists.blocks)?),
                Binding::Read(&tangents.normals),
                Binding::Write(&sums),
                Binding::Write(&frame),
                Binding::Write(&planes),
            ],
        )?;
        Ok(Self {
            moved_kernel,
            update_kernel,
            leaf_workgroups: workgroups(
                gpu,
                Self::NAME,
                slot_count.div_ceil(LEAF_SLOTS),
                WORKGROUP_SIZE,
            )?,
            slot_workgroups: workgroups(gpu, Self::NAME, slot_count, WORKGROUP_SIZE)?,
            frame,
            sums,
            planes,
        })
    }

    /// Adds both dispatches to `encoder`.
    pub fn record(&self, encoder: &mut wgpu::CommandEncoder, timer: &mut Timer) {
        encoder.clear_buffer(&self.frame, 0, None);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some(Self::NAME),
            timestamp_writes: timer.compute(Self::NAME),
        });
        self.moved_kernel.dispatch(&mut pass, self.leaf_workgroups);
        self.update_kernel.dispatch(&mut pass, self.slot_workgroups);
    }

    /// What the last submitted frame found and fitted, waited for.
    ///
    /// # Errors
    ///
    /// [`GpuError::ReadBack`] if the counts can't be read.
    pub fn counts(&self, gpu: &Gpu) -> Result<RefitCounts, GpuError> {
        let frame: Vec<u32> = read_buffer(gpu, &self.frame)?;
        Ok(RefitCounts {
            moved: frame[0],
            refitted: frame[1],
        })
    }
}
