//! The light-path primitive of the scene: one of a closed set of methods.

use super::mesh_buffers::MeshBuffers;
use super::moved_leaves::SampledPatches;
use super::plane_carried::PlaneCarried;
use super::plane_full::PlaneFull;
use super::plane_incremental::PlaneIncremental;
use super::plane_stale::PlaneStale;
use super::sampled_fit::{Fit, SampledFit};
use super::tangents::Tangents;
use crate::geom::SurfaceMesh;
use crate::geom::patch::Patches;
use crate::geom::plane::{LightPathMethod, fit_planes};
use crate::geom::sample::Samples;
use crate::geom::tangent::{Fans, rest_normals};
use crate::gpu::{Gpu, GpuError, Timer};

/// How much of a frame's planes had to be made anew.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct RefitCounts {
    /// Planes fitted in the frame.
    pub refitted: u32,
    /// Points that moved by more than the tolerance.
    pub moved: u32,
}

/// The passes that bring the light-path planes up to date.
pub enum LightPath {
    /// Nothing: the surface shader takes the tangent plane.
    Tangent,
    /// Nothing here: the depth maps of the lights are drawn with the shadows ([`super::depth_maps`]).
    DepthMap,
    /// The planes at rest, where they were in space.
    Stale(PlaneStale),
    /// The planes at rest, turned.
    Carried(PlaneCarried),
    /// All planes anew.
    Full(PlaneFull),
    /// The planes near moved points anew.
    Incremental(PlaneIncremental),
    /// The same from sixteen samples each, or paraboloids from those.
    Sampled(Box<SampledFit>),
}

/// Radius of the patches of a method as a share of how far light is followed: a paraboloid, which passes through its
/// point and is tangent there, errs a quarter less over half of the radius (`palpate study planes`).
pub fn patch_share(method: LightPathMethod) -> f32 {
    match method {
        LightPathMethod::Quadric => 0.5,
        _ => 1.0,
    }
}

/// What a scene says of its light path.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct LightPathKnobs {
    /// How the primitives follow the surface.
    pub method: LightPathMethod,
    /// Reach of a patch at rest [m].
    pub radius_m: f32,
    /// How far a point may lie from where its patches last saw it [m]; only methods that pass over what is still ask.
    pub tolerance_m: f32,
    /// `sampled`: a patch whose mean lies nearer to the tangent plane than this takes that plane, without a fit
    /// [m]; 0 fits all.
    pub skip_m: f32,
}

/// What the shaders read of a light path.
#[derive(Clone, Copy, Debug)]
pub enum Primitives<'a> {
    /// Nothing: the tangent plane is meant.
    Tangent,
    /// Nothing a point: the depth maps of the lights.
    DepthMaps,
    /// Unit normal and signed offset [m] of each point's plane, `[vec4f; points]`.
    Planes(&'a wgpu::Buffer),
    /// The matrix of each point's paraboloid [1/m], `[[vec4f; 2]; points]`.
    Quadrics(&'a wgpu::Buffer),
}

/// The shader text that finds a light's way by the primitives of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum CoverKind {
    /// `light_plane.wgsl`: the tangent plane, and one that was fitted.
    Planes,
    /// `light_quadric.wgsl`.
    Quadrics,
    /// `light_depth.wgsl`.
    DepthMaps,
}

impl<'a> Primitives<'a> {
    /// How the surface shader reads them.
    pub fn cover(self) -> CoverKind {
        match self {
            Self::Tangent | Self::Planes(_) => CoverKind::Planes,
            Self::Quadrics(_) => CoverKind::Quadrics,
            Self::DepthMaps => CoverKind::DepthMaps,
        }
    }

    /// The buffer, if there is one.
    pub fn buffer(self) -> Option<&'a wgpu::Buffer> {
        match self {
            Self::Tangent | Self::DepthMaps => None,
            Self::Planes(buffer) | Self::Quadrics(buffer) => Some(buffer),
        }
    }
}

impl LightPath {
    /// Builds what the method needs and nothing else.
    ///
    /// # Errors
    ///
    /// [`GpuError::BufferTooLarge`] if the patches of this radius are longer than the adapter binds,
    /// and those of the kernels.
    pub fn new(
        gpu: &Gpu,
        knobs: LightPathKnobs,
        mesh: &SurfaceMesh,
        buffers: &MeshBuffers,
        tangents: &Tangents,
    ) -> Result<Self, GpuError> {
        let LightPathKnobs {
            method,
            radius_m,
            tolerance_m,
            skip_m,
        } = knobs;
        match method {
            LightPathMethod::Tangent => return Ok(Self::Tangent),
            LightPathMethod::DepthMap => return Ok(Self::DepthMap),
            _ => {}
        }
        let normals = rest_normals(mesh, &Fans::new(mesh));
        let patches = Patches::new(&mesh.points, &normals, radius_m);
        Ok(match method {
            LightPathMethod::Tangent => Self::Tangent,
            LightPathMethod::DepthMap => Self::DepthMap,
            LightPathMethod::Stale => {
                let planes = fit_planes(&mesh.points, &normals, &patches);
                Self::Stale(PlaneStale::new(gpu, &mesh.points, &planes, buffers)?)
            }
            LightPathMethod::Carried => {
                let planes = fit_planes(&mesh.points, &normals, &patches);
                Self::Carried(PlaneCarried::new(gpu, mesh, &planes, &normals, tangents)?)
            }
            LightPathMethod::Full => Self::Full(PlaneFull::new(gpu, &patches, buffers, tangents)?),
            LightPathMethod::Incremental => Self::Incremental(PlaneIncremental::new(
                gpu,
                tolerance_m,
                &mesh.points,
                &normals,
                &patches,
                buffers,
                tangents,
            )?),
            LightPathMethod::Sampled | LightPathMethod::Quadric => {
                let samples = Samples::new(&mesh.points, &patches);
                let dependents = samples.dependents(&mesh.point_triangles());
                let points = &mesh.points[..];
                let (fit, samples) = match method {
                    LightPathMethod::Sampled => (Fit::Plane, samples),
                    _ => (Fit::Quadric, samples.weighted_to_the_middle(points)),
                };
                let patches = SampledPatches {
                    samples: &samples,
                    dependents: &dependents,
                    radius_m,
                    tolerance_m,
                    skip_m,
                };
                let rest = [points, &normals[..]];
                Self::Sampled(Box::new(SampledFit::new(
                    gpu, fit, rest, &patches, buffers, tangents,
                )?))
            }
        })
    }

    /// Adds this frame's passes to `encoder`, after the tangents.
    pub fn record(&self, encoder: &mut wgpu::CommandEncoder, timer: &mut Timer) {
        match self {
            Self::Tangent | Self::DepthMap => {}
            Self::Stale(pass) => pass.record(encoder, timer),
            Self::Carried(pass) => pass.record(encoder, timer),
            Self::Full(pass) => pass.record(encoder, timer),
            Self::Incremental(pass) => pass.record(encoder, timer),
            Self::Sampled(pass) => pass.record(encoder, timer),
        }
    }

    /// What the shaders read.
    pub fn primitives(&self) -> Primitives<'_> {
        match self {
            Self::Tangent => Primitives::Tangent,
            Self::DepthMap => Primitives::DepthMaps,
            Self::Stale(pass) => Primitives::Planes(&pass.planes),
            Self::Carried(pass) => Primitives::Planes(&pass.planes),
            Self::Full(pass) => Primitives::Planes(&pass.planes),
            Self::Incremental(pass) => Primitives::Planes(&pass.planes),
            Self::Sampled(pass) => match pass.fit {
                Fit::Plane => Primitives::Planes(&pass.primitives),
                Fit::Quadric => Primitives::Quadrics(&pass.primitives),
            },
        }
    }

    /// Unit normal and signed offset [m] of each point's plane, `[vec4f; points]`; `None` where there are none.
    pub fn planes(&self) -> Option<&wgpu::Buffer> {
        match self.primitives() {
            Primitives::Planes(planes) => Some(planes),
            Primitives::Tangent | Primitives::DepthMaps | Primitives::Quadrics(_) => None,
        }
    }

    /// Names of the passes it records, as the timer knows them.
    pub fn pass_names(&self) -> &'static [&'static str] {
        match self {
            Self::Tangent | Self::DepthMap => &[],
            Self::Stale(_) => &[PlaneStale::NAME],
            Self::Carried(_) => &[PlaneCarried::NAME],
            Self::Full(_) => &[PlaneFull::NAME],
            Self::Incremental(_) => &[PlaneIncremental::NAME],
            Self::Sampled(pass) => pass.fit.names(),
        }
    }

    /// What the last submitted frame fitted, waited for. Only methods that pass over what is still have to ask
    /// the GPU; `full` fits all points and looks at none.
    ///
    /// # Errors
    ///
    /// [`GpuError::ReadBack`] if the counts can't be read.
    pub fn counts(&self, gpu: &Gpu) -> Result<RefitCounts, GpuError> {
        match self {
            Self::Tangent | Self::DepthMap | Self::Stale(_) | Self::Carried(_) => {
                Ok(RefitCounts::default())
            }
            Self::Full(pass) => Ok(RefitCounts {
                refitted: pass.point_count,
                moved: pass.point_count,
            }),
            Self::Incremental(pass) => pass.counts(gpu),
            Self::Sampled(pass) => pass.leaves.counts(gpu),
        }
    }
}
