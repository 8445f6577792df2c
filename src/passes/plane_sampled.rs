//! Planes fitted to sixteen samples of each patch, where something moved: two dispatches, the second of which is
//! empty where nothing did.

use super::mesh_buffers::MeshBuffers;
use super::moved_leaves::{MovedLeaves, SampledPatches};
use super::tangents::Tangents;
use crate::geom::plane::fit_sampled_planes;
use crate::gpu::{Gpu, GpuError, Kernel, Timer, Wgsl, join, storage};
use crate::wgsl;
use glam::Vec3;

/// The pass that keeps planes up to date.
pub struct PlaneSampled {
    /// Which leaves it fits.
    pub leaves: MovedLeaves,
    kernel: Kernel,
    /// Unit normal and signed offset [m], `[vec4f; points]`.
    pub planes: wgpu::Buffer,
}

impl PlaneSampled {
    /// What the pass is called in logs.
    pub const NAME: &'static str = "planes-sampled";
    /// The WGSL that fits, joined in this order.
    pub const WGSL: &'static [Wgsl] = wgsl![
        "common.wgsl",
        "leaf_listed.wgsl",
        "plane_fit.wgsl",
        "plane_sampled.wgsl"
    ];

    /// Builds the pass with the planes of `points` at rest.
    ///
    /// # Errors
    ///
    /// [`GpuError`] if the WGSL does not compile here or the lists are too long for this adapter.
    pub fn new(
        gpu: &Gpu,
        points: &[Vec3],
        normals: &[Vec3],
        patches: &SampledPatches<'_>,
        buffers: &MeshBuffers,
        tangents: &Tangents,
    ) -> Result<Self, GpuError> {
        let sources = [MovedLeaves::WGSL, Self::WGSL].map(join);
        Self::with_sources(gpu, [points, normals], patches, buffers, tangents, &sources)
    }

    /// As [`PlaneSampled::new`] with other WGSL for listing and fitting: lets a test sabotage a kernel and see
    /// the check fail.
    ///
    /// # Errors
    ///
    /// As [`PlaneSampled::new`].
    pub fn with_sources(
        gpu: &Gpu,
        [points, normals]: [&[Vec3]; 2],
        patches: &SampledPatches<'_>,
        buffers: &MeshBuffers,
        tangents: &Tangents,
        [moved_source, fit_source]: &[String; 2],
    ) -> Result<Self, GpuError> {
        let leaves =
            MovedLeaves::with_source(gpu, Self::NAME, points, patches, buffers, moved_source)?;
        let rest: Vec<[f32; 4]> =
            fit_sampled_planes(points, normals, patches.samples, patches.skip_m)
                .into_iter()
                .map(|plane| plane.to_array())
                .collect();
        let planes = storage(gpu, "planes", &rest)?;
        let kernel = Kernel::new(
            gpu,
            Self::NAME,
            Self::WGSL,
            fit_source,
            "main",
            &leaves.bindings(buffers, tangents, &planes),
        )?;
        Ok(Self {
            leaves,
            kernel,
            planes,
        })
    }

    /// Adds the dispatches to `encoder`.
    pub fn record(&self, encoder: &mut wgpu::CommandEncoder, timer: &mut Timer) {
        self.leaves.clear(encoder);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some(Self::NAME),
            timestamp_writes: timer.compute(Self::NAME),
        });
        self.leaves.dispatch(&mut pass, &self.kernel);
    }
}
