//! Every plane fitted from all members of its patch, every frame: two dispatches.

use super::mesh_buffers::MeshBuffers;
use super::tangents::Tangents;
use crate::geom::patch::Patches;
use crate::gpu::{
    Binding, Entry, Gpu, GpuError, Kernel, Table, Timer, Wgsl, join, storage, uniform, workgroups,
};
use crate::wgsl;

const WORKGROUP_SIZE: u32 = 64;

/// Mirror of `Params` in `shaders/plane_sort.wgsl` and `shaders/plane_full.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Params {
    pub slot_count: u32,
    pub pad0: u32,
    pub pad1: u32,
    pub pad2: u32,
}

/// The pass that fits every plane anew. Immutable once made.
pub struct PlaneFull {
    sort_kernel: Kernel,
    fit_kernel: Kernel,
    workgroups: u32,
    /// Planes it fits.
    pub point_count: u32,
    /// Unit normal and signed offset [m], `[vec4f; points]`.
    pub planes: wgpu::Buffer,
}

impl PlaneFull {
    /// What the pass is called in logs.
    pub const NAME: &'static str = "planes-full";
    /// The WGSL that sorts positions into slots.
    pub const SORT_WGSL: &'static [Wgsl] = wgsl!["common.wgsl", "plane_sort.wgsl"];
    /// The WGSL that fits, joined in this order.
    pub const FIT_WGSL: &'static [Wgsl] = wgsl!["common.wgsl", "plane_fit.wgsl", "plane_full.wgsl"];

    /// Builds the pass over `patches`.
    ///
    /// # Errors
    ///
    /// [`GpuError`] if the WGSL does not compile here or the lists are too long for this adapter.
    pub fn new(
        gpu: &Gpu,
        patches: &Patches,
        buffers: &MeshBuffers,
        tangents: &Tangents,
    ) -> Result<Self, GpuError> {
        let sources = [join(Self::SORT_WGSL), join(Self::FIT_WGSL)];
        Self::with_sources(gpu, patches, buffers, tangents, &sources)
    }

    /// As [`PlaneFull::new`] with other WGSL for sorting and fitting: lets a test sabotage a kernel
    /// and see the check fail.
    ///
    /// # Errors
    ///
    /// As [`PlaneFull::new`].
    pub fn with_sources(
        gpu: &Gpu,
        patches: &Patches,
        buffers: &MeshBuffers,
        tangents: &Tangents,
        [sort_source, fit_source]: &[String; 2],
    ) -> Result<Self, GpuError> {
        let slot_count = patches.order.len();
        let params = uniform(
            gpu,
            Self::NAME,
            &Params {
                slot_count: slot_count as u32,
                pad0: 0,
                pad1: 0,
                pad2: 0,
            },
        );
        let empty = vec![[0.0_f32; 4]; slot_count];
        let slots = Table::new(gpu, "positions by slot", Entry::Floats, &empty)?;
        let blocks = Table::new(gpu, "patch members", Entry::Pairs, &patches.lists.blocks)?;
        let planes = storage(gpu, "planes", &empty)?;
        let order = storage(gpu, "slot order", &patches.order)?;
        let sort_kernel = Kernel::new(
            gpu,
            Self::NAME,
            Self::SORT_WGSL,
            sort_source,
            "main",
            &[
                Binding::Uniform(&params),
                Binding::Unfiltered(&buffers.position_table.view),
                Binding::Read(&order),
                Binding::Image(&slots.view, Entry::Floats.format()),
            ],
        )?;
        let fit_kernel = Kernel::new(
            gpu,
            Self::NAME,
            Self::FIT_WGSL,
            fit_source,
            "main",
            &[
                Binding::Uniform(&params),
                Binding::Unfiltered(&slots.view),
                Binding::Read(&order),
                Binding::Read(&storage(gpu, "patches", &patches.lists.start)?),
                Binding::Integers(&blocks.view),
                Binding::Read(&tangents.normals),
                Binding::Write(&planes),
            ],
        )?;
        Ok(Self {
            sort_kernel,
            fit_kernel,
            workgroups: workgroups(gpu, Self::NAME, slot_count, WORKGROUP_SIZE)?,
            point_count: slot_count as u32,
            planes,
        })
    }

    /// Adds both dispatches to `encoder`.
    pub fn record(&self, encoder: &mut wgpu::CommandEncoder, timer: &mut Timer) {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some(Self::NAME),
            timestamp_writes: timer.compute(Self::NAME),
        });
        self.sort_kernel.dispatch(&mut pass, self.workgroups);
        self.fit_kernel.dispatch(&mut pass, self.workgroups);
    }
}
