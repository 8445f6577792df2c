//! The surface of the scene: one draw a frame, by the one model the scene has.

use super::draw::{Draw, DrawKind, Target, cleared, cleared_depth};
use super::maps::Maps;
use super::mesh_buffers::MeshBuffers;
use super::shadow::Shadow;
use super::tangents::Tangents;
use crate::gpu::{Binding, Gpu, GpuError, Timer, Wgsl, join};
use crate::scene::{Quadrature, SurfaceKind, SurfaceSection};

/// What a surface reads, made by other passes.
pub struct SurfaceInputs<'a> {
    /// Camera, lights, knobs.
    pub frame: &'a wgpu::Buffer,
    /// The mesh.
    pub mesh: &'a MeshBuffers,
    /// Its frames.
    pub tangents: &'a Tangents,
    /// Its texture maps.
    pub maps: &'a Maps,
    /// Light-path planes; the normals again where there are none.
    pub planes: &'a wgpu::Buffer,
    /// Whether `planes` are planes.
    pub has_planes: bool,
    /// Shadow map and its sampler; any depth texture where there is none.
    pub shadow_view: &'a wgpu::TextureView,
    /// Compares with it.
    pub shadow_sampler: &'a wgpu::Sampler,
    /// Whether it is one.
    pub has_shadow: bool,
    /// Lights of the scene.
    pub light_count: usize,
}

/// The bindings of `shaders/surface_vertex.wgsl`, in its order.
pub fn surface_bindings<'a>(
    inputs: &SurfaceInputs<'a>,
    light_map: &'a wgpu::TextureView,
) -> [Binding<'a>; 16] {
    [
        Binding::Uniform(inputs.frame),
        Binding::Read(&inputs.mesh.positions),
        Binding::Read(&inputs.mesh.point_of),
        Binding::Read(&inputs.mesh.uvs),
        Binding::Read(&inputs.tangents.normals),
        Binding::Read(&inputs.tangents.tangents),
        Binding::Read(&inputs.tangents.uv_gradients),
        Binding::Sampler(&inputs.maps.sampler),
        Binding::Texture(&inputs.maps.outer),
        Binding::Texture(&inputs.maps.normal),
        Binding::Texture(&inputs.maps.inner),
        Binding::Texture(&inputs.maps.layers),
        Binding::Texture(light_map),
        Binding::Read(inputs.planes),
        Binding::Depth(inputs.shadow_view),
        Binding::Comparison(inputs.shadow_sampler),
    ]
}

/// The draw of the tissue.
pub struct Surface {
    kind: SurfaceKind,
    draw: Draw,
}

impl Surface {
    /// The WGSL files of a model, joined in this order.
    pub fn wgsl(kind: SurfaceKind) -> &'static [Wgsl] {
        match kind {
            SurfaceKind::Plain => {
                crate::wgsl!["shading.wgsl", "surface_vertex.wgsl", "plain.wgsl"]
            }
            SurfaceKind::Subsurface => crate::wgsl![
                "medium.wgsl",
                "shading.wgsl",
                "surface_vertex.wgsl",
                "subsurface.wgsl"
            ],
            SurfaceKind::Gooey => crate::wgsl![
                "layers.wgsl",
                "shading.wgsl",
                "surface_vertex.wgsl",
                "gooey.wgsl"
            ],
        }
    }

    /// Builds the model that `section` names; `light_map` is read by the gooey one alone.
    ///
    /// # Errors
    ///
    /// [`GpuError::Shader`] if the WGSL does not compile on this adapter.
    pub fn new(
        gpu: &Gpu,
        section: &SurfaceSection,
        inputs: &SurfaceInputs<'_>,
        light_map: &wgpu::TextureView,
    ) -> Result<Self, GpuError> {
        let parts = Self::wgsl(section.kind);
        let flag = |on: bool| f64::from(u8::from(on));
        let mut constants = vec![("HAS_SHADOW", flag(inputs.has_shadow))];
        if section.kind == SurfaceKind::Subsurface {
            constants.extend([
                ("HAS_PLANES", flag(inputs.has_planes)),
                ("SAMPLES", f64::from(section.samples)),
                ("LIGHTS", inputs.light_count as f64),
                (
                    "PUBLISHED",
                    flag(section.quadrature == Quadrature::Published),
                ),
            ]);
        }
        let draw = Draw::new(
            gpu,
            &DrawKind {
                pass: section.kind.name(),
                parts,
                source: &join(parts),
                vertex: "vertex",
                fragment: Some(("fragment", super::RADIANCE_FORMAT)),
                depth: Some(super::DEPTH_FORMAT),
                cull: Some(wgpu::Face::Back),
                constants: &constants,
            },
            &surface_bindings(inputs, light_map),
        )?;
        Ok(Self {
            kind: section.kind,
            draw,
        })
    }

    /// Name in logs.
    pub fn name(&self) -> &'static str {
        self.kind.name()
    }

    /// Adds the draw to `encoder`, over cleared targets.
    pub fn record(
        &self,
        mesh: &MeshBuffers,
        radiance: &Target,
        depth: &Target,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut Timer,
    ) {
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some(self.name()),
            color_attachments: &[cleared(&radiance.view)],
            depth_stencil_attachment: Some(cleared_depth(&depth.view)),
            timestamp_writes: timer.render(self.name()),
            ..Default::default()
        });
        self.draw.set(&mut pass);
        mesh.draw(&mut pass);
    }
}

/// The shadow inputs of a scene without shadows: a depth texture of one texel that is never read.
pub struct NoShadow {
    /// The texel.
    pub target: Target,
    /// A sampler for it.
    pub sampler: wgpu::Sampler,
}

impl NoShadow {
    /// Makes the texel.
    pub fn new(gpu: &Gpu) -> Self {
        Self {
            target: Target::new(gpu, "no shadow", [1; 2], wgpu::TextureFormat::Depth32Float),
            sampler: super::shadow::comparison_sampler(gpu),
        }
    }
}

/// View and sampler of a shadow map, or of nothing.
pub fn shadow_inputs<'a>(
    shadow: Option<&'a Shadow>,
    nothing: &'a NoShadow,
) -> (&'a wgpu::TextureView, &'a wgpu::Sampler) {
    shadow.map_or((&nothing.target.view, &nothing.sampler), |shadow| {
        (&shadow.target.view, &shadow.sampler)
    })
}
