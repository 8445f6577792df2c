//! Planes or paraboloids fitted to sixteen samples of each patch, where something moved: two dispatches, the second of
//! which is empty where nothing did.

use super::mesh_buffers::MeshBuffers;
use super::moved_leaves::{MovedLeaves, SampledPatches};
use super::tangents::Tangents;
use crate::geom::plane::fit_sampled_planes;
use crate::geom::quadric::fit_quadrics;
use crate::gpu::{Gpu, GpuError, Kernel, Timer, Wgsl, join, storage};
use crate::wgsl;
use glam::Vec3;

/// What is fitted.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Fit {
    /// Unit normal and signed offset [m] of a point's plane, a `vec4f`.
    Plane,
    /// xx, yy, zz, 0 and xy, xz, yz, 0 of the matrix of a point's paraboloid [1/m], `[vec4f; 2]`; weights of the samples
    /// are those of [`Samples::weighted_to_the_middle`](crate::geom::sample::Samples::weighted_to_the_middle).
    Quadric,
}

impl Fit {
    /// What the pass is called in logs.
    pub const fn name(self) -> &'static str {
        self.names()[0]
    }

    /// The same as a list.
    pub const fn names(self) -> &'static [&'static str; 1] {
        match self {
            Self::Plane => &["planes-sampled"],
            Self::Quadric => &["quadrics"],
        }
    }

    /// The WGSL that fits, joined in this order.
    pub const fn wgsl(self) -> &'static [Wgsl] {
        match self {
            Self::Plane => wgsl![
                "common.wgsl",
                "leaf_listed.wgsl",
                "plane_fit.wgsl",
                "plane_sampled.wgsl"
            ],
            Self::Quadric => wgsl!["common.wgsl", "leaf_listed.wgsl", "quadric.wgsl"],
        }
    }

    /// The fits of `points` at rest.
    fn at_rest(
        self,
        gpu: &Gpu,
        [points, normals]: [&[Vec3]; 2],
        patches: &SampledPatches<'_>,
    ) -> Result<wgpu::Buffer, GpuError> {
        match self {
            Self::Plane => {
                let planes = fit_sampled_planes(points, normals, patches.samples, patches.skip_m);
                let planes: Vec<[f32; 4]> = planes.into_iter().map(|p| p.to_array()).collect();
                storage(gpu, "planes", &planes)
            }
            Self::Quadric => {
                let per_m = 1.0 / patches.radius_m;
                let quadrics = fit_quadrics(points, normals, patches.samples, per_m);
                let quadrics: Vec<[[f32; 4]; 2]> =
                    quadrics.into_iter().map(|q| q.to_arrays()).collect();
                storage(gpu, "quadrics", &quadrics)
            }
        }
    }
}

/// The pass that keeps them up to date.
pub struct SampledFit {
    /// What it fits.
    pub fit: Fit,
    /// Which leaves it fits.
    pub leaves: MovedLeaves,
    kernel: Kernel,
    /// What [`Fit`] says, of each point.
    pub primitives: wgpu::Buffer,
}

impl SampledFit {
    /// Builds the pass with the fits of `points` at rest.
    ///
    /// # Errors
    ///
    /// [`GpuError`] if the WGSL does not compile here or the lists are too long for this adapter.
    pub fn new(
        gpu: &Gpu,
        fit: Fit,
        rest: [&[Vec3]; 2],
        patches: &SampledPatches<'_>,
        buffers: &MeshBuffers,
        tangents: &Tangents,
    ) -> Result<Self, GpuError> {
        let sources = [MovedLeaves::WGSL, fit.wgsl()].map(join);
        Self::with_sources(gpu, fit, rest, patches, buffers, tangents, &sources)
    }

    /// As [`SampledFit::new`] with other WGSL for listing and fitting: lets a test sabotage a kernel and see the check
    /// fail.
    ///
    /// # Errors
    ///
    /// As [`SampledFit::new`].
    pub fn with_sources(
        gpu: &Gpu,
        fit: Fit,
        [points, normals]: [&[Vec3]; 2],
        patches: &SampledPatches<'_>,
        buffers: &MeshBuffers,
        tangents: &Tangents,
        [moved_source, fit_source]: &[String; 2],
    ) -> Result<Self, GpuError> {
        let name = fit.name();
        let leaves = MovedLeaves::with_source(gpu, name, points, patches, buffers, moved_source)?;
        let primitives = fit.at_rest(gpu, [points, normals], patches)?;
        let kernel = Kernel::new(
            gpu,
            name,
            fit.wgsl(),
            fit_source,
            "main",
            &leaves.bindings(buffers, tangents, &primitives),
        )?;
        Ok(Self {
            fit,
            leaves,
            kernel,
            primitives,
        })
    }

    /// Adds the dispatches to `encoder`.
    pub fn record(&self, encoder: &mut wgpu::CommandEncoder, timer: &mut Timer) {
        self.leaves.clear(encoder);
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor {
            label: Some(self.fit.name()),
            timestamp_writes: timer.compute(self.fit.name()),
        });
        self.leaves.dispatch(&mut pass, &self.kernel);
    }
}
