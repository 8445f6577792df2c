//! The visible surface as packed numbers, one set a pixel: one draw a frame.
//!
//! Triangles of an organ are a few pixels wide, and a rasterizer shades whole blocks of pixels for each: the
//! surface model would run 2.6 times for every pixel. So this pass draws the triangles with next to no work, and
//! the model reads what it left, once a pixel.

use super::draw::{DepthUse, Draw, DrawKind, Target, cleared_depth, kept};
use super::light_path::Primitives;
use super::mesh_buffers::MeshBuffers;
use super::tangents::Tangents;
use crate::geom::SurfaceMesh;
use crate::geom::tangent::rest_gradients;
use crate::gpu::{Binding, Gpu, GpuError, Timer, Wgsl, join, storage};
use crate::scene::{SurfaceKind, SurfaceSection, UvMetric};

/// Four words a pixel.
const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba32Uint;

/// What lies at each covered pixel.
pub struct GeometryTargets {
    /// Texture coordinate, normal, tangent.
    pub base: Target,
    /// Light-path primitive, gradients of the texture coordinate; a texel where the model needs neither.
    pub detail: Target,
    /// Depth, 0 near to 1 far.
    pub depth: Target,
}

impl GeometryTargets {
    /// Targets of `size` [px] for a model of `kind`. What is not covered is never written.
    pub fn new(gpu: &Gpu, kind: SurfaceKind, size: [u32; 2]) -> Self {
        let detail_size = if kind.looks_below() { size } else { [1; 2] };
        Self {
            base: Target::new(gpu, "base", size, FORMAT),
            detail: Target::new(gpu, "detail", detail_size, FORMAT),
            depth: Target::new(gpu, "depth", size, super::DEPTH_FORMAT),
        }
    }
}

/// The pass that draws the triangles.
pub struct Geometry {
    draw: Draw,
    has_detail: bool,
}

/// What a vertex has to itself: its point, texture coordinate, tangent, and gradients of the texture coordinate.
const ATTRIBUTES: [(u64, &[wgpu::VertexAttribute]); 4] = [
    (4, &wgpu::vertex_attr_array![0 => Uint32]),
    (8, &wgpu::vertex_attr_array![1 => Float32x2]),
    (16, &wgpu::vertex_attr_array![2 => Float32x4]),
    (
        32,
        &[
            wgpu::VertexAttribute {
                format: wgpu::VertexFormat::Float32x3,
                offset: 0,
                shader_location: 3,
            },
            wgpu::VertexAttribute {
                format: wgpu::VertexFormat::Float32x3,
                offset: 16,
                shader_location: 4,
            },
        ],
    ),
];

impl Geometry {
    /// Name in logs.
    pub const NAME: &'static str = "geometry";
    /// The WGSL files of this pass, joined in this order.
    pub const WGSL: &'static [Wgsl] = crate::wgsl!["frame.wgsl", "pack.wgsl", "geometry.wgsl"];

    /// Builds the pass for the model of `section`; without primitives the tangent plane is written for them.
    ///
    /// # Errors
    ///
    /// [`GpuError::Shader`] if the WGSL does not compile on this adapter.
    #[allow(clippy::too_many_arguments, reason = "each is another pass's result")]
    pub fn new(
        gpu: &Gpu,
        section: &SurfaceSection,
        frame: &wgpu::Buffer,
        surface_mesh: &SurfaceMesh,
        mesh: &MeshBuffers,
        tangents: &Tangents,
        primitives: Primitives<'_>,
    ) -> Result<Self, GpuError> {
        // Only what lies below the surface is looked for with planes and gradients.
        let has_detail = section.kind.looks_below();
        let unit_frames = section.uv_metric == UvMetric::Unit;
        let rest_gradients = if unit_frames || section.thickness_follows_volume {
            Some(storage(
                gpu,
                "gradients at rest",
                &rest_gradients(surface_mesh),
            )?)
        } else {
            None
        };
        let flag = |on: bool| f64::from(u8::from(on));
        let fragment: (&str, &[wgpu::TextureFormat]) = if has_detail {
            ("detail_fragment", &[FORMAT; 2])
        } else {
            ("base_fragment", &[FORMAT])
        };
        let primitive = match primitives {
            // Layers seen through a shift read none.
            _ if section.kind == SurfaceKind::Gooey => 3.0,
            Primitives::Tangent | Primitives::DepthMaps => 0.0,
            Primitives::Planes(_) => 1.0,
            Primitives::Quadrics(_) => 2.0,
        };
        let draw = Draw::new(
            gpu,
            &DrawKind {
                pass: Self::NAME,
                parts: Self::WGSL,
                source: &join(Self::WGSL),
                vertex: "geometry_vertex",
                attributes: &ATTRIBUTES,
                fragment: Some(fragment),
                blend: None,
                depth: DepthUse::Nearest,
                cull: Some(wgpu::Face::Back),
                constants: &[
                    ("PRIMITIVE", primitive),
                    ("UNIT_FRAMES", flag(unit_frames)),
                    ("FOLLOWS_VOLUME", flag(section.thickness_follows_volume)),
                ],
            },
            &[
                Binding::Uniform(frame),
                Binding::Read(&mesh.positions),
                Binding::Read(&tangents.normals),
                // Bound but never read where there are none.
                Binding::Read(primitives.buffer().unwrap_or(&tangents.normals)),
                Binding::Read(rest_gradients.as_ref().unwrap_or(&tangents.normals)),
            ],
        )?;
        Ok(Self { draw, has_detail })
    }

    /// Adds the draw to `encoder`.
    pub fn record(
        &self,
        mesh: &MeshBuffers,
        tangents: &Tangents,
        targets: &GeometryTargets,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut Timer,
    ) {
        let colors = [kept(&targets.base.view), kept(&targets.detail.view)];
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some(Self::NAME),
            color_attachments: &colors[..if self.has_detail { 2 } else { 1 }],
            depth_stencil_attachment: Some(cleared_depth(&targets.depth.view)),
            timestamp_writes: timer.render(Self::NAME),
            ..Default::default()
        });
        self.draw.set(&mut pass);
        let buffers = [
            &mesh.point_of,
            &mesh.uvs,
            &tangents.tangents,
            &tangents.uv_gradients,
        ];
        for (slot, buffer) in (0u32..).zip(buffers) {
            pass.set_vertex_buffer(slot, buffer.slice(..));
        }
        mesh.draw(&mut pass);
    }
}
