//! Paraboloids fitted to sixteen samples of each patch, where something moved: two dispatches, the second of which
//! is empty where nothing did.

use super::mesh_buffers::MeshBuffers;
use super::moved_leaves::{MovedLeaves, SampledPatches};
use super::tangents::Tangents;
use crate::geom::quadric::fit_quadrics;
use crate::gpu::{Gpu, GpuError, Kernel, Timer, Wgsl, join, storage};
use crate::wgsl;
use glam::Vec3;

/// The pass that keeps paraboloids up to date.
pub struct Quadrics {
    /// Which leaves it fits.
    pub leaves: MovedLeaves,
    kernel: Kernel,
    /// xx, yy, zz, 0 and xy, xz, yz, 0 of each point's matrix [1/m], `[[vec4f; 2]; points]`.
    pub quadrics: wgpu::Buffer,
}

impl Quadrics {
    /// What the pass is called in logs.
    pub const NAME: &'static str = "quadrics";
    /// The WGSL that fits, joined in this order.
    pub const WGSL: &'static [Wgsl] = wgsl!["common.wgsl", "leaf_listed.wgsl", "quadric.wgsl"];

    /// Builds the pass with the paraboloids of `points` at rest; weights of the samples are those of
    /// [`Samples::weighted_to_the_middle`](crate::geom::sample::Samples::weighted_to_the_middle).
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

    /// As [`Quadrics::new`] with other WGSL for listing and fitting: lets a test sabotage a kernel and see the
    /// check fail.
    ///
    /// # Errors
    ///
    /// As [`Quadrics::new`].
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
        let per_m = 1.0 / patches.radius_m;
        let rest: Vec<[[f32; 4]; 2]> = fit_quadrics(points, normals, patches.samples, per_m)
            .into_iter()
            .map(|quadric| quadric.to_arrays())
            .collect();
        let quadrics = storage(gpu, "quadrics", &rest)?;
        let kernel = Kernel::new(
            gpu,
            Self::NAME,
            Self::WGSL,
            fit_source,
            "main",
            &leaves.bindings(buffers, tangents, &quadrics),
        )?;
        Ok(Self {
            leaves,
            kernel,
            quadrics,
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
