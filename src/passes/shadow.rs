//! The shadow map of the light that casts shadows: one draw a frame.

use super::draw::{DepthUse, Draw, DrawKind, Target, cleared_depth};
use super::mesh_buffers::MeshBuffers;
use crate::gpu::{Binding, Gpu, GpuError, Timer, Wgsl, join, uniform};
use glam::Mat4;

/// Side of the map [px].
pub const SIZE_PX: u32 = 768;

/// Depth of the surface as the light sees it.
pub struct Shadow {
    draw: Draw,
    matrix: wgpu::Buffer,
    /// The map.
    pub target: Target,
}

impl Shadow {
    /// Name in logs.
    pub const NAME: &'static str = "shadow";
    /// The WGSL files of this pass, joined in this order.
    pub const WGSL: &'static [Wgsl] = crate::wgsl!["shadow.wgsl"];

    /// Builds the pass for the surface in `mesh`.
    ///
    /// # Errors
    ///
    /// [`GpuError::Shader`] if the WGSL does not compile on this adapter.
    pub fn new(gpu: &Gpu, mesh: &MeshBuffers) -> Result<Self, GpuError> {
        let matrix = uniform(gpu, Self::NAME, &Mat4::IDENTITY.to_cols_array());
        let draw = Draw::new(
            gpu,
            &DrawKind {
                pass: Self::NAME,
                parts: Self::WGSL,
                source: &join(Self::WGSL),
                vertex: "shadow_vertex",
                fragment: None,
                blend: None,
                depth: DepthUse::Nearest,
                // The side towards the light: where it enters the body.
                cull: Some(wgpu::Face::Back),
                constants: &[],
            },
            &[
                Binding::Uniform(&matrix),
                Binding::Read(&mesh.positions),
                Binding::Read(&mesh.point_of),
            ],
        )?;
        Ok(Self {
            draw,
            matrix,
            target: Target::new(gpu, Self::NAME, [SIZE_PX; 2], super::DEPTH_FORMAT),
        })
    }

    /// Adds the draw to `encoder`.
    pub fn record(
        &self,
        gpu: &Gpu,
        shadow_from_world: Mat4,
        mesh: &MeshBuffers,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut Timer,
    ) {
        let matrix = shadow_from_world.to_cols_array();
        gpu.queue
            .write_buffer(&self.matrix, 0, bytemuck::bytes_of(&matrix));
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some(Self::NAME),
            depth_stencil_attachment: Some(cleared_depth(&self.target.view)),
            timestamp_writes: timer.render(Self::NAME),
            ..Default::default()
        });
        self.draw.set(&mut pass);
        mesh.draw(&mut pass);
    }
}
