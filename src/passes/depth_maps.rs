//! Where each light enters the body: a depth map a light, side by side, with the surface's normal at each entry. One
//! draw a light, in frames in which the surface or a light has moved.
//!
//! The first map is the shadow map of the light that casts shadows: a scene with both draws it once.

use super::draw::{DepthUse, Draw, DrawKind, Target, cleared_depth, kept};
use super::mesh_buffers::{MeshBuffers, PointTriangles};
use super::shadow::SIZE_PX;
use super::tangents::Tangents;
use super::view::light_from_world;
use crate::geom::SurfaceMesh;
use crate::gpu::{Binding, Gpu, GpuError, Timer, Wgsl, join, uniform};
use crate::scene::{LIGHTS_MAX, PlacedLight};
use glam::{Mat4, Vec3};
use std::cell::RefCell;

/// Mirror of `LightViews` in `shaders/light_depth.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct LightViews {
    pub clip_from_world: [[f32; 16]; LIGHTS_MAX],
    pub world_from_clip: [[f32; 16]; LIGHTS_MAX],
    pub slack_m: [f32; LIGHTS_MAX],
}

/// The maps of all lights.
pub struct DepthMaps {
    /// A draw and its matrix for each light.
    draws: Vec<(Draw, wgpu::Buffer)>,
    triangles: PointTriangles,
    /// Depth, 0 near the light to 1 far, a square for each light.
    pub depth: Target,
    /// Packed normal of the surface at each entry; never written where nothing is entered.
    pub normals: Target,
    /// What the surface shader needs to read them, [`LightViews`].
    pub views: wgpu::Buffer,
    /// What they were last drawn of.
    drawn: RefCell<(Vec<PlacedLight>, Vec<Vec3>)>,
}

impl DepthMaps {
    /// Name in logs.
    pub const NAME: &'static str = "depth-maps";
    /// The WGSL files of this pass, joined in this order.
    pub const WGSL: &'static [Wgsl] = crate::wgsl!["pack.wgsl", "depth_map.wgsl"];

    /// Builds the pass for `mesh` and that many lights.
    ///
    /// # Errors
    ///
    /// [`GpuError::Shader`] if the WGSL does not compile on this adapter.
    pub fn new(
        gpu: &Gpu,
        mesh: &SurfaceMesh,
        light_count: usize,
        tangents: &Tangents,
    ) -> Result<Self, GpuError> {
        Self::with_source(gpu, mesh, light_count, tangents, &join(Self::WGSL))
    }

    /// As [`DepthMaps::new`] with other WGSL: lets a test sabotage the pass and see the check fail.
    ///
    /// # Errors
    ///
    /// As [`DepthMaps::new`].
    pub fn with_source(
        gpu: &Gpu,
        mesh: &SurfaceMesh,
        light_count: usize,
        tangents: &Tangents,
        source: &str,
    ) -> Result<Self, GpuError> {
        let draws = (0..light_count)
            .map(|_| {
                let matrix = uniform(gpu, Self::NAME, &Mat4::IDENTITY.to_cols_array());
                let draw = Draw::new(
                    gpu,
                    &DrawKind {
                        pass: Self::NAME,
                        parts: Self::WGSL,
                        source,
                        vertex: "depth_vertex",
                        attributes: &[(16, &wgpu::vertex_attr_array![0 => Float32x3])],
                        fragment: Some(("depth_fragment", &[NORMAL_FORMAT])),
                        blend: None,
                        depth: DepthUse::Nearest,
                        // The side towards the light: where it enters the body.
                        cull: Some(wgpu::Face::Back),
                        constants: &[],
                    },
                    &[Binding::Uniform(&matrix), Binding::Read(&tangents.normals)],
                )?;
                Ok((draw, matrix))
            })
            .collect::<Result<Vec<_>, GpuError>>()?;
        let size = [SIZE_PX * light_count.max(1) as u32, SIZE_PX];
        Ok(Self {
            draws,
            triangles: PointTriangles::new(gpu, mesh)?,
            depth: Target::new(gpu, Self::NAME, size, super::DEPTH_FORMAT),
            normals: Target::new(gpu, "entry normals", size, NORMAL_FORMAT),
            views: uniform(gpu, Self::NAME, &views(&[], &[])),
            drawn: RefCell::default(),
        })
    }

    /// Adds the draws to `encoder`, with the surface at `points`; none where the maps are those of these lights and
    /// points already.
    pub fn record(
        &self,
        gpu: &Gpu,
        lights: &[PlacedLight],
        points: &[Vec3],
        mesh: &MeshBuffers,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut Timer,
    ) {
        {
            let (of_lights, of_points) = &mut *self.drawn.borrow_mut();
            if of_lights == lights && of_points == points {
                return;
            }
            (*of_lights, *of_points) = (lights.to_vec(), points.to_vec());
        }
        let views = views(lights, points);
        gpu.queue
            .write_buffer(&self.views, 0, bytemuck::bytes_of(&views));
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some(Self::NAME),
            color_attachments: &[kept(&self.normals.view)],
            depth_stencil_attachment: Some(cleared_depth(&self.depth.view)),
            timestamp_writes: timer.render(Self::NAME),
            ..Default::default()
        });
        let side = SIZE_PX as f32;
        for (k, (draw, matrix)) in self.draws.iter().enumerate() {
            gpu.queue
                .write_buffer(matrix, 0, bytemuck::bytes_of(&views.clip_from_world[k]));
            pass.set_viewport(k as f32 * side, 0.0, side, side, 0.0, 1.0);
            draw.set(&mut pass);
            self.triangles.draw(&mesh.positions, &mut pass);
        }
    }
}

/// An octahedral normal in one word.
const NORMAL_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::R32Uint;

/// Matrices of `lights`, fitted round the surface at `points` [m].
pub fn views(lights: &[PlacedLight], points: &[Vec3]) -> LightViews {
    let mut views = LightViews {
        clip_from_world: [Mat4::IDENTITY.to_cols_array(); LIGHTS_MAX],
        world_from_clip: [Mat4::IDENTITY.to_cols_array(); LIGHTS_MAX],
        slack_m: [0.0; LIGHTS_MAX],
    };
    if points.is_empty() {
        return views;
    }
    let (low, high) = crate::geom::bounds(points);
    for (k, light) in lights.iter().take(LIGHTS_MAX).enumerate() {
        let clip_from_world = light_from_world(light, points);
        views.clip_from_world[k] = clip_from_world.to_cols_array();
        views.world_from_clip[k] = clip_from_world.inverse().to_cols_array();
        // About two texels, across a map that the whole body fills.
        views.slack_m[k] = 2.0 * (high - low).length() / SIZE_PX as f32;
    }
    views
}
