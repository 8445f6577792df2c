//! Where each light enters the body, and with two depth layers where it leaves it and enters it again: depth maps,
//! a square a light side by side. One to three draws a light and frame.
//!
//! The entries of the first light are the shadow map of the light that casts shadows.

use super::draw::{DepthUse, Draw, DrawKind, Target, cleared_depth};
use super::mesh_buffers::{MeshBuffers, PointTriangles};
use super::shadow::SIZE_PX;
use super::tangents::Tangents;
use crate::geom::SurfaceMesh;
use crate::gpu::{Binding, Gpu, GpuError, Timer, Wgsl, join, uniform};
use glam::Mat4;

/// Mirror of `BodyDepth` in `shaders/body_depth.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct BodyDepthUniform {
    pub clip_from_world: [f32; 16],
    pub grow_m: f32,
    pub pad0: f32,
    pub pad1: f32,
    pub pad2: f32,
}

/// One map of all lights.
struct Layer {
    draws: Vec<Draw>,
    target: Target,
}

/// The maps of all lights.
pub struct BodyDepths {
    uniforms: Vec<wgpu::Buffer>,
    layers: Vec<Layer>,
    /// Stands for maps that are not asked for; never read.
    none: Target,
    triangles: PointTriangles,
}

impl BodyDepths {
    /// Name in logs.
    pub const NAME: &'static str = "body-depths";
    /// The WGSL files of this pass, joined in this order.
    pub const WGSL: &'static [Wgsl] = crate::wgsl!["body_depth.wgsl"];

    /// Draws a frame of that many lights and depth layers.
    pub fn draws(light_count: usize, depth_layers: u32) -> u32 {
        light_count as u32 * if depth_layers > 1 { 3 } else { 1 }
    }

    /// Builds the pass for `mesh`.
    ///
    /// # Errors
    ///
    /// [`GpuError::Shader`] if the WGSL does not compile on this adapter.
    pub fn new(
        gpu: &Gpu,
        mesh: &SurfaceMesh,
        light_count: usize,
        depth_layers: u32,
        tangents: &Tangents,
    ) -> Result<Self, GpuError> {
        Self::with_source(
            gpu,
            mesh,
            light_count,
            depth_layers,
            tangents,
            &join(Self::WGSL),
        )
    }

    /// As [`BodyDepths::new`] with other WGSL: lets a test sabotage the pass and see the check fail.
    ///
    /// # Errors
    ///
    /// As [`BodyDepths::new`].
    pub fn with_source(
        gpu: &Gpu,
        mesh: &SurfaceMesh,
        light_count: usize,
        depth_layers: u32,
        tangents: &Tangents,
        source: &str,
    ) -> Result<Self, GpuError> {
        let size = [SIZE_PX * light_count.max(1) as u32, SIZE_PX];
        let uniforms: Vec<_> = (0..light_count)
            .map(|_| uniform(gpu, Self::NAME, &view(Mat4::IDENTITY, 0.0)))
            .collect();
        let none = Target::new(gpu, "no depths", [1; 2], super::DEPTH_FORMAT);
        let mut layers: Vec<Layer> = Vec::new();
        // The sides towards the light: entries; those away from it: exits; entries again.
        let kinds = [
            (wgpu::Face::Back, None),
            (wgpu::Face::Front, None),
            (wgpu::Face::Back, Some(("second_fragment", &[][..]))),
        ];
        for (cull, fragment) in &kinds[..if depth_layers > 1 { 3 } else { 1 }] {
            let exits = layers.get(1).map_or(&none, |layer| &layer.target);
            let exits = if fragment.is_some() { exits } else { &none };
            let draws = uniforms
                .iter()
                .map(|uniform| {
                    Draw::new(
                        gpu,
                        &DrawKind {
                            pass: Self::NAME,
                            parts: Self::WGSL,
                            source,
                            vertex: "body_depth_vertex",
                            attributes: &[(16, &wgpu::vertex_attr_array![0 => Float32x3])],
                            fragment: *fragment,
                            blend: None,
                            depth: DepthUse::Nearest,
                            cull: Some(*cull),
                            constants: &[],
                        },
                        &[
                            Binding::Uniform(uniform),
                            Binding::Read(&tangents.normals),
                            Binding::Depth(&exits.view),
                        ],
                    )
                })
                .collect::<Result<Vec<_>, GpuError>>()?;
            layers.push(Layer {
                draws,
                target: Target::new(gpu, Self::NAME, size, super::DEPTH_FORMAT),
            });
        }
        Ok(Self {
            uniforms,
            layers,
            none,
            triangles: PointTriangles::new(gpu, mesh)?,
        })
    }

    /// Depth of the first entries, 0 near the light to 1 far.
    pub fn entries(&self) -> &Target {
        &self.layers[0].target
    }

    /// Depth of the first exits; a texel without meaning with one depth layer.
    pub fn exits(&self) -> &Target {
        self.layers.get(1).map_or(&self.none, |layer| &layer.target)
    }

    /// Depth of the second entries, 1 where there are none; a texel without meaning with one depth layer.
    pub fn second_entries(&self) -> &Target {
        self.layers.get(2).map_or(&self.none, |layer| &layer.target)
    }

    /// Adds the draws to `encoder`; a matrix from the world to its clip space for each light.
    pub fn record(
        &self,
        gpu: &Gpu,
        clip_from_world: &[Mat4],
        grow_m: f32,
        mesh: &MeshBuffers,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut Timer,
    ) {
        for (uniform, &matrix) in self.uniforms.iter().zip(clip_from_world) {
            gpu.queue
                .write_buffer(uniform, 0, bytemuck::bytes_of(&view(matrix, grow_m)));
        }
        let side = SIZE_PX as f32;
        for layer in &self.layers {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some(Self::NAME),
                depth_stencil_attachment: Some(cleared_depth(&layer.target.view)),
                timestamp_writes: timer.render(Self::NAME),
                ..Default::default()
            });
            for (k, draw) in layer.draws.iter().enumerate() {
                pass.set_viewport(k as f32 * side, 0.0, side, side, 0.0, 1.0);
                draw.set(&mut pass);
                self.triangles.draw(&mesh.positions, &mut pass);
            }
        }
    }
}

fn view(clip_from_world: Mat4, grow_m: f32) -> BodyDepthUniform {
    BodyDepthUniform {
        clip_from_world: clip_from_world.to_cols_array(),
        grow_m,
        pad0: 0.0,
        pad1: 0.0,
        pad2: 0.0,
    }
}
