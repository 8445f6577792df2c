//! The shadow map of the light that casts shadows: the surface and the tools before it, a draw each.

use super::draw::{DepthUse, Draw, DrawKind, Target, cleared_depth};
use super::mesh_buffers::{MeshBuffers, PointTriangles};
use super::tools::Tools;
use crate::geom::SurfaceMesh;
use crate::gpu::{Binding, Gpu, GpuError, Timer, Wgsl, join, uniform};
use glam::Mat4;

/// Side of the map [px].
pub const SIZE_PX: u32 = 768;

/// Depth of surface and tools as the light sees them.
pub struct Shadow {
    draw: Draw,
    draw_tools: Draw,
    matrix: wgpu::Buffer,
    triangles: PointTriangles,
    /// The map.
    pub target: Target,
}

impl Shadow {
    /// Name in logs.
    pub const NAME: &'static str = "shadow";
    /// The WGSL files of this pass, joined in this order.
    pub const WGSL: &'static [Wgsl] = crate::wgsl!["shadow.wgsl"];

    /// The WGSL files by which it draws the tools.
    pub const TOOLS_WGSL: &'static [Wgsl] = crate::wgsl!["capsule.wgsl", "tool_shadow.wgsl"];

    /// Builds the pass for `mesh` and what `tools` draws.
    ///
    /// # Errors
    ///
    /// [`GpuError::Shader`] if the WGSL does not compile on this adapter.
    pub fn new(gpu: &Gpu, mesh: &SurfaceMesh, tools: &Tools) -> Result<Self, GpuError> {
        let matrix = uniform(gpu, Self::NAME, &Mat4::IDENTITY.to_cols_array());
        let draw = Draw::new(
            gpu,
            &DrawKind {
                pass: Self::NAME,
                parts: Self::WGSL,
                source: &join(Self::WGSL),
                vertex: "shadow_vertex",
                attributes: &[(16, &wgpu::vertex_attr_array![0 => Float32x3])],
                fragment: None,
                blend: None,
                depth: DepthUse::Nearest,
                // The side towards the light: where it enters the body.
                cull: Some(wgpu::Face::Back),
                constants: &[],
            },
            &[Binding::Uniform(&matrix)],
        )?;
        let [places, directions] = tools.bindings();
        let draw_tools = Draw::new(
            gpu,
            &DrawKind {
                pass: Self::NAME,
                parts: Self::TOOLS_WGSL,
                source: &join(Self::TOOLS_WGSL),
                vertex: "tool_shadow_vertex",
                attributes: &[],
                fragment: None,
                blend: None,
                depth: DepthUse::Nearest,
                cull: Some(wgpu::Face::Back),
                constants: &[],
            },
            &[Binding::Uniform(&matrix), places, directions],
        )?;
        Ok(Self {
            draw,
            draw_tools,
            matrix,
            triangles: PointTriangles::new(gpu, mesh)?,
            target: Target::new(gpu, Self::NAME, [SIZE_PX; 2], super::DEPTH_FORMAT),
        })
    }

    /// Adds the draws to `encoder`, of so many of `tools`, which says where they are before the frame is submitted.
    #[allow(clippy::too_many_arguments)]
    pub fn record(
        &self,
        gpu: &Gpu,
        shadow_from_world: Mat4,
        mesh: &MeshBuffers,
        tools: &Tools,
        tool_count: usize,
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
        self.triangles.draw(&mesh.positions, &mut pass);
        if tool_count > 0 {
            self.draw_tools.set(&mut pass);
            tools.draw(&mut pass, tool_count);
        }
    }
}
