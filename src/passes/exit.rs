//! Where view rays leave the body again: the nearest back faces, one draw a frame.

use super::draw::{DepthUse, Draw, DrawKind, Target, cleared_depth};
use super::mesh_buffers::{MeshBuffers, PointTriangles};
use crate::geom::SurfaceMesh;
use crate::gpu::{Binding, Gpu, GpuError, Timer, Wgsl, join};

/// Depth of the back faces as the eye sees them.
pub struct Exit {
    draw: Draw,
    triangles: PointTriangles,
    /// Depth of the nearest back face at each pixel, 1 where there is none.
    pub target: Target,
}

impl Exit {
    /// Name in logs.
    pub const NAME: &'static str = "exit";
    /// The WGSL files of this pass, joined in this order.
    pub const WGSL: &'static [Wgsl] = crate::wgsl!["frame.wgsl", "exit.wgsl"];

    /// Builds the pass for `mesh` and pictures of `size` [px].
    ///
    /// # Errors
    ///
    /// [`GpuError::Shader`] if the WGSL does not compile on this adapter.
    pub fn new(
        gpu: &Gpu,
        mesh: &SurfaceMesh,
        frame: &wgpu::Buffer,
        size: [u32; 2],
    ) -> Result<Self, GpuError> {
        let draw = Draw::new(
            gpu,
            &DrawKind {
                pass: Self::NAME,
                parts: Self::WGSL,
                source: &join(Self::WGSL),
                vertex: "exit_vertex",
                attributes: &[(16, &wgpu::vertex_attr_array![0 => Float32x3])],
                fragment: None,
                blend: None,
                depth: DepthUse::Nearest,
                cull: Some(wgpu::Face::Front),
                constants: &[],
            },
            &[Binding::Uniform(frame)],
        )?;
        Ok(Self {
            draw,
            triangles: PointTriangles::new(gpu, mesh)?,
            target: Target::new(gpu, Self::NAME, size, super::DEPTH_FORMAT),
        })
    }

    /// Makes the picture another size.
    pub fn resize(&mut self, gpu: &Gpu, size: [u32; 2]) {
        self.target = Target::new(gpu, Self::NAME, size, super::DEPTH_FORMAT);
    }

    /// Adds the draw to `encoder`.
    pub fn record(
        &self,
        mesh: &MeshBuffers,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut Timer,
    ) {
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some(Self::NAME),
            depth_stencil_attachment: Some(cleared_depth(&self.target.view)),
            timestamp_writes: timer.render(Self::NAME),
            ..Default::default()
        });
        self.draw.set(&mut pass);
        self.triangles.draw(&mesh.positions, &mut pass);
    }
}
