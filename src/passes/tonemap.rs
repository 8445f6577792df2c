//! From linear radiance to the picture: the backdrop, and one draw over the covered pixels.

use super::backdrop::backdrop;
use super::draw::{DepthUse, Draw, DrawKind, Target, kept, read_depth};
use crate::gpu::{Binding, Gpu, GpuError, Timer, Wgsl, join, uniform};

/// Exposure, tone curve, sRGB, outline.
pub struct ToneMap {
    draw: Draw,
    exposure: wgpu::Buffer,
    backdrop: Target,
}

impl ToneMap {
    /// Name in logs.
    pub const NAME: &'static str = "tonemap";
    /// The WGSL files of this pass, joined in this order.
    pub const WGSL: &'static [Wgsl] = crate::wgsl!["tone.wgsl", "tonemap.wgsl"];

    /// Builds the pass that reads `radiance` where `depth` is covered.
    ///
    /// # Errors
    ///
    /// [`GpuError::Shader`] if the WGSL does not compile on this adapter.
    pub fn new(gpu: &Gpu, radiance: &Target, depth: &Target) -> Result<Self, GpuError> {
        let exposure = uniform(gpu, Self::NAME, &[1.0f32; 4]);
        let draw = Draw::new(
            gpu,
            &DrawKind {
                pass: Self::NAME,
                parts: Self::WGSL,
                source: &join(Self::WGSL),
                vertex: "tonemap_vertex",
                attributes: &[],
                fragment: Some(("tonemap_fragment", &[super::PICTURE_FORMAT])),
                blend: Some(wgpu::BlendState::ALPHA_BLENDING),
                depth: DepthUse::Covered,
                cull: None,
                constants: &[],
            },
            &[
                Binding::Uniform(&exposure),
                Binding::Unfiltered(&radiance.view),
                Binding::Depth(&depth.view),
            ],
        )?;
        Ok(Self {
            draw,
            exposure,
            backdrop: backdrop(gpu, radiance.size()),
        })
    }

    /// Adds the copy of the backdrop and the draw to `encoder`.
    pub fn record(
        &self,
        gpu: &Gpu,
        exposure: f32,
        depth: &Target,
        picture: &Target,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut Timer,
    ) {
        gpu.queue
            .write_buffer(&self.exposure, 0, bytemuck::bytes_of(&[exposure; 4]));
        encoder.copy_texture_to_texture(
            self.backdrop.texture.as_image_copy(),
            picture.texture.as_image_copy(),
            picture.texture.size(),
        );
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some(Self::NAME),
            color_attachments: &[kept(&picture.view)],
            depth_stencil_attachment: Some(read_depth(&depth.view)),
            timestamp_writes: timer.render(Self::NAME),
            ..Default::default()
        });
        self.draw.set(&mut pass);
        pass.draw(0..3, 0..1);
    }
}
