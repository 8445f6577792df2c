//! Planes fitted where something moved, from running moments: two dispatches, the second of which
//! is empty where nothing moved.

use super::light_path::RefitCounts;
use super::mesh_buffers::MeshBuffers;
use super::tangents::Tangents;
use crate::geom::moments::RunningPlanes;
use crate::geom::patch::{LEAF_SLOTS, Patches};
use crate::gpu::{
    Binding, Entry, Gpu, GpuError, Kernel, Table, Timer, Wgsl, join, read_buffer, storage, uniform,
    workgroups,
};
use crate::wgsl;
use glam::Vec3;

/// Of the update, a thread a patch; the same in `plane_moved.wgsl`, which counts workgroups.
const PATCH_WORKGROUP_SIZE: u32 = 64;
/// Of the other, a thread a leaf: small, since there are few leaves to share out.
const LEAF_WORKGROUP_SIZE: u32 = 8;

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
    pub quanta: f32,
    pub rest_per_m: f32,
    pub pad0: u32,
    pub pad1: u32,
}

/// The pass that keeps planes up to date.
pub struct PlaneIncremental {
    moved_kernel: Kernel,
    update_kernel: Kernel,
    leaf_workgroups: u32,
    /// Points moved, planes fitted and patches listed in the frame, then a mark for each slot.
    frame: wgpu::Buffer,
    /// How large the update is to be, as the first kernel found.
    update_workgroups: wgpu::Buffer,
    /// Sums of every patch, `[PatchSums; slots]`.
    pub sums: wgpu::Buffer,
    /// Unit normal and signed offset [m], `[vec4f; points]`.
    pub planes: wgpu::Buffer,
}

impl PlaneIncremental {
    /// What the pass is called in logs.
    pub const NAME: &'static str = "planes-incremental";
    /// The WGSL that finds moved points.
    pub const MOVED_WGSL: &'static [Wgsl] = wgsl!["common.wgsl", "plane_moved.wgsl"];
    /// The WGSL that updates and fits, joined in this order.
    pub const UPDATE_WGSL: &'static [Wgsl] =
        wgsl!["common.wgsl", "plane_fit.wgsl", "plane_incremental.wgsl"];

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
        let sources = [Self::MOVED_WGSL, Self::UPDATE_WGSL].map(join);
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
        let places: Vec<[f32; 4]> = rest
            .now
            .iter()
            .zip(&patches.order)
            // Whole numbers are exact in f32 up to 2^24, more than a table has entries.
            .map(|(p, &point)| [p.x, p.y, p.z, point as f32])
            .collect();
        let now = Table::new(gpu, "places by slot", Entry::Floats, &places)?;
        let before = Table::new(gpu, "places before", Entry::Floats, &places)?;
        let committed = Table::new(gpu, "committed places", Entry::Floats, &places)?;
        let blocks = Table::new(gpu, "patch members", Entry::Pairs, &patches.lists.blocks)?;
        let moved = Table::new(gpu, "moved slots", Entry::Words, &rest.moved)?;
        let frame = storage(gpu, "marked patches", &vec![0_u32; 3 + leaf_count])?;
        let listed = storage(gpu, "listed patches", &vec![0_u32; slot_count])?;
        let update_workgroups = storage(gpu, "patch workgroups", &[0_u32, 1, 1])?;
        // The update is sent to at most this many: refused here, not in a frame.
        workgroups(gpu, Self::NAME, slot_count, PATCH_WORKGROUP_SIZE)?;
        let sums = storage(gpu, "patch sums", &rest.sums)?;
        let starts = patches.lists.start.windows(2);
        let ranges: Vec<[u32; 2]> = starts.map(|pair| [pair[0], pair[1]]).collect();
        let ranges = Table::new(gpu, "patch blocks", Entry::Pairs, &ranges)?;
        let planes: Vec<[f32; 4]> = rest.planes.iter().map(|plane| plane.to_array()).collect();
        let planes = storage(gpu, "planes", &planes)?;
        let of_runs = patches.patches_of_runs();
        let run_blocks = Table::new(gpu, "patches of runs", Entry::Pairs, &of_runs.blocks)?;
        let moved_params = uniform(
            gpu,
            Self::NAME,
            &MovedParams {
                slot_count: slot_count as u32,
                tolerance_squared_m2: tolerance_m * tolerance_m,
                pad0: 0,
                pad1: 0,
            },
        );
        let moved_kernel = Kernel::new(
            gpu,
            Self::NAME,
            Self::MOVED_WGSL,
            moved_source,
            "main",
            &[
                Binding::Uniform(&moved_params),
                Binding::Unfiltered(&buffers.position_table.view),
                Binding::Unfiltered(&committed.view),
                Binding::Read(&storage(gpu, "patches of runs", &of_runs.start)?),
                Binding::Integers(&run_blocks.view),
                Binding::Image(&now.view, Entry::Floats.format()),
                Binding::Image(&before.view, Entry::Floats.format()),
                Binding::Image(&moved.view, Entry::Words.format()),
                Binding::Write(&frame),
                Binding::Write(&listed),
                Binding::Write(&update_workgroups),
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
                        quanta: rest.quanta,
                        rest_per_m: rest.rest_per_m,
                        pad0: 0,
                        pad1: 0,
                    },
                )),
                Binding::Unfiltered(&before.view),
                Binding::Unfiltered(&now.view),
                Binding::Integers(&moved.view),
                Binding::Integers(&ranges.view),
                Binding::Integers(&blocks.view),
                Binding::Read(&listed),
                Binding::Read(&tangents.normals),
                Binding::Write(&sums),
                Binding::Write(&frame),
                Binding::Write(&planes),
                Binding::Image(&committed.view, Entry::Floats.format()),
            ],
        )?;
        Ok(Self {
            moved_kernel,
            update_kernel,
            leaf_workgroups: workgroups(
                gpu,
                Self::NAME,
                slot_count.div_ceil(LEAF_SLOTS),
                LEAF_WORKGROUP_SIZE,
            )?,
            frame,
            update_workgroups,
            sums,
            planes,
        })
    }

    /// Adds the dispatches to `encoder`.
    pub fn record(&self, encoder: &mut wgpu::CommandEncoder, timer: &mut Timer) {
        encoder.clear_buffer(&self.frame, 0, None);
        encoder.clear_buffer(&self.update_workgroups, 0, Some(4));
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some(Self::NAME),
            timestamp_writes: timer.compute(Self::NAME),
        });
        self.moved_kernel.dispatch(&mut pass, self.leaf_workgroups);
        self.update_kernel
            .dispatch_indirect(&mut pass, &self.update_workgroups, 0);
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
