//! The visible surface as packed numbers, one set a pixel: one draw a frame.
//!
//! Triangles of an organ are a few pixels wide, and a rasterizer shades whole blocks of pixels for each: the
//! surface model would run 2.6 times for every pixel. So this pass draws the triangles with next to no work, and
//! the model reads what it left, once a pixel.

use super::draw::{DepthUse, Draw, DrawKind, Target, cleared_depth, kept};
use super::mesh_buffers::MeshBuffers;
use super::tangents::Tangents;
use crate::gpu::{Binding, Gpu, GpuError, Timer, Wgsl, join};

/// Four words a pixel.
const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Uint;

/// What lies at each covered pixel.
pub struct GeometryTargets {
    /// Texture coordinate, normal, tangent.
    pub base: Target,
    /// Light-path plane, gradients of the texture coordinate.
    pub detail: Target,
    /// Depth, 0 near to 1 far.
    pub depth: Target,
}

impl GeometryTargets {
    /// Targets of `size` [px]. What is not covered is never written.
    pub fn new(gpu: &Gpu, size: [u32; 2]) -> Self {
        Self {
            base: Target::new(gpu, "base", size, FORMAT),
            detail: Target::new(gpu, "detail", size, FORMAT),
            depth: Target::new(gpu, "depth", size, super::DEPTH_FORMAT),
        }
    }
}

/// The pass that draws the triangles.
pub struct Geometry {
    draw: Draw,
}

impl Geometry {
    /// Name in logs.
    pub const NAME: &'static str = "geometry";
    /// The WGSL files of this pass, joined in this order.
    pub const WGSL: &'static [Wgsl] = crate::wgsl!["frame.wgsl", "pack.wgsl", "geometry.wgsl"];

    /// Builds the pass; without `planes` the tangent plane is written for them.
    ///
    /// # Errors
    ///
    /// [`GpuError::Shader`] if the WGSL does not compile on this adapter.
    pub fn new(
        gpu: &Gpu,
        frame: &wgpu::Buffer,
        mesh: &MeshBuffers,
        tangents: &Tangents,
        planes: Option<&wgpu::Buffer>,
    ) -> Result<Self, GpuError> {
        let draw = Draw::new(
            gpu,
            &DrawKind {
                pass: Self::NAME,
                parts: Self::WGSL,
                source: &join(Self::WGSL),
                vertex: "geometry_vertex",
                fragment: Some(("geometry_fragment", &[FORMAT, FORMAT])),
                blend: None,
                depth: DepthUse::Nearest,
                cull: Some(wgpu::Face::Back),
                constants: &[("HAS_PLANES", f64::from(u8::from(planes.is_some())))],
            },
            &[
                Binding::Uniform(frame),
                Binding::Read(&mesh.positions),
                Binding::Read(&mesh.point_of),
                Binding::Read(&mesh.uvs),
                Binding::Read(&tangents.normals),
                Binding::Read(&tangents.tangents),
                Binding::Read(&tangents.uv_gradients),
                // Bound but never read where there are no planes.
                Binding::Read(planes.unwrap_or(&tangents.normals)),
            ],
        )?;
        Ok(Self { draw })
    }

    /// Adds the draw to `encoder`.
    pub fn record(
        &self,
        mesh: &MeshBuffers,
        targets: &GeometryTargets,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut Timer,
    ) {
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some(Self::NAME),
            color_attachments: &[kept(&targets.base.view), kept(&targets.detail.view)],
            depth_stencil_attachment: Some(cleared_depth(&targets.depth.view)),
            timestamp_writes: timer.render(Self::NAME),
            ..Default::default()
        });
        self.draw.set(&mut pass);
        mesh.draw(&mut pass);
    }
}
