//! Which leaves of 32 neighbouring points moved, and which are to be fitted anew: one small dispatch, on which the
//! size of the next one hangs.

use super::light_path::RefitCounts;
use super::mesh_buffers::MeshBuffers;
use super::tangents::Tangents;
use crate::geom::sample::{Samples, half_tolerance_m};
use crate::gpu::{
    Binding, Entry, Gpu, GpuError, Kernel, Table, Wgsl, read_buffer, storage, uniform, workgroups,
};
use crate::wgsl;
use glam::Vec3;

/// A thread a leaf: small, since there are few leaves to share out.
const WORKGROUP_SIZE: u32 = 8;

/// Mirror of `Params` in `shaders/leaf_moved.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub struct MovedParams {
    pub slot_count: u32,
    pub tolerance_squared_m2: f32,
    pub pad0: u32,
    pub pad1: u32,
}

/// Mirror of `Params` in `shaders/leaf_listed.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub struct ListedParams {
    pub slot_count: u32,
    pub per_m: f32,
    pub skip_m: f32,
    pub pad0: u32,
}

/// The kernel that lists leaves, and what a kernel over the listed ones reads.
pub struct MovedLeaves {
    kernel: Kernel,
    workgroups: u32,
    /// Points moved, slots listed and leaves listed in the frame, then a mark for each leaf.
    frame: wgpu::Buffer,
    /// How large the next dispatch is to be.
    listed_workgroups: wgpu::Buffer,
    listed: wgpu::Buffer,
    moved_leaves: wgpu::Buffer,
    committed: Table,
    samples: Table,
    order: wgpu::Buffer,
    params: wgpu::Buffer,
}

/// The patches of a surface as sixteen samples each, and what a look at them needs to know.
pub struct SampledPatches<'a> {
    /// The samples.
    pub samples: &'a Samples,
    /// Leaves to be fitted anew when one moves.
    pub dependents: &'a [Vec<u32>],
    /// Radius of the patches [m].
    pub radius_m: f32,
    /// How far a fit may lag behind its samples [m].
    pub tolerance_m: f32,
    /// Of planes: how near to the tangent plane a patch's mean lies that takes it without a fit [m].
    pub skip_m: f32,
}

impl MovedLeaves {
    /// The WGSL, joined in this order.
    pub const WGSL: &'static [Wgsl] = wgsl!["common.wgsl", "leaf_moved.wgsl"];

    /// Builds the kernel for `points` at rest from `source`, [`MovedLeaves::WGSL`] joined or a changed copy, as a
    /// part of the pass called `pass`.
    ///
    /// # Errors
    ///
    /// [`GpuError`] if the WGSL does not compile here or the lists are too long for this adapter.
    pub fn with_source(
        gpu: &Gpu,
        pass: &'static str,
        points: &[Vec3],
        patches: &SampledPatches<'_>,
        buffers: &MeshBuffers,
        source: &str,
    ) -> Result<Self, GpuError> {
        let samples = patches.samples;
        let slot_count = samples.order.len();
        let leaf_count = patches.dependents.len();
        let places: Vec<[f32; 4]> = samples
            .order
            .iter()
            // Whole numbers are exact in f32 up to 2^24, more than a table has entries.
            .map(|&point| points[point as usize].extend(point as f32).to_array())
            .collect();
        let committed = Table::new(gpu, "committed places", Entry::Floats, &places)?;
        let mut start = vec![0_u32];
        for list in patches.dependents {
            start.push(start[start.len() - 1] + list.len() as u32);
        }
        let frame = storage(gpu, "listed leaves", &vec![0_u32; 3 + leaf_count])?;
        let listed = storage(gpu, "list of leaves", &vec![0_u32; leaf_count])?;
        let moved_leaves = storage(gpu, "moved leaves", &vec![0_u32; leaf_count])?;
        let listed_workgroups = storage(gpu, "leaf workgroups", &[0_u32, 1, 1])?;
        // The next dispatch is sent to at most this many: refused here, not in a frame.
        workgroups(gpu, pass, leaf_count, 1)?;
        let half_m = half_tolerance_m(patches.tolerance_m);
        let moved_params = MovedParams {
            slot_count: slot_count as u32,
            tolerance_squared_m2: half_m * half_m,
            pad0: 0,
            pad1: 0,
        };
        let kernel = Kernel::new(
            gpu,
            pass,
            Self::WGSL,
            source,
            "main",
            &[
                Binding::Uniform(&uniform(gpu, pass, &moved_params)),
                Binding::Unfiltered(&buffers.position_table.view),
                Binding::Unfiltered(&committed.view),
                Binding::Read(&storage(gpu, "dependent leaves", &start)?),
                Binding::Read(&storage(gpu, "dependents", &patches.dependents.concat())?),
                Binding::Write(&frame),
                Binding::Write(&listed),
                Binding::Write(&moved_leaves),
                Binding::Write(&listed_workgroups),
            ],
        )?;
        let params = ListedParams {
            slot_count: slot_count as u32,
            per_m: 1.0 / patches.radius_m,
            skip_m: patches.skip_m,
            pad0: 0,
        };
        Ok(Self {
            kernel,
            workgroups: workgroups(gpu, pass, leaf_count, WORKGROUP_SIZE)?,
            frame,
            listed_workgroups,
            listed,
            moved_leaves,
            committed,
            samples: Table::new(gpu, "samples", Entry::Quads, &samples.packed())?,
            order: storage(gpu, "slot order", &samples.order)?,
            params: uniform(gpu, pass, &params),
        })
    }

    /// The bindings of `shaders/leaf_listed.wgsl`, in its order, and the kernel's own result.
    pub fn bindings<'a>(
        &'a self,
        buffers: &'a MeshBuffers,
        tangents: &'a Tangents,
        result: &'a wgpu::Buffer,
    ) -> [Binding<'a>; 9] {
        [
            Binding::Uniform(&self.params),
            Binding::Unfiltered(&buffers.position_table.view),
            Binding::Integers(&self.samples.view),
            Binding::Read(&self.order),
            Binding::Read(&self.listed),
            Binding::Read(&self.moved_leaves),
            Binding::Image(&self.committed.view, Entry::Floats.format()),
            Binding::Read(&tangents.normals),
            Binding::Write(result),
        ]
    }

    /// Empties the list; before the pass.
    pub fn clear(&self, encoder: &mut wgpu::CommandEncoder) {
        encoder.clear_buffer(&self.frame, 0, None);
        encoder.clear_buffer(&self.listed_workgroups, 0, Some(4));
    }

    /// Adds the dispatch that lists, and `fit` over what it lists.
    pub fn dispatch(&self, pass: &mut wgpu::ComputePass<'_>, fit: &Kernel) {
        self.kernel.dispatch(pass, self.workgroups);
        fit.dispatch_indirect(pass, &self.listed_workgroups, 0);
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
