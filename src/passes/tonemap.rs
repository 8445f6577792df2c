//! From linear radiance to the picture: one draw a frame, over the part of it that holds something.

use super::draw::{Draw, DrawKind, Target, cleared, kept};
use crate::gpu::{Binding, Gpu, GpuError, Timer, Wgsl, join, uniform};

/// Exposure, tone curve, sRGB. The backdrop is drawn once and copied from then on.
pub struct ToneMap {
    draw: Draw,
    exposure: wgpu::Buffer,
    backdrop: Target,
}

/// Left, top, width and height of a part of the picture [px].
pub type PartPx = [u32; 4];

impl ToneMap {
    /// Name in logs.
    pub const NAME: &'static str = "tonemap";
    /// The WGSL files of this pass, joined in this order.
    pub const WGSL: &'static [Wgsl] = crate::wgsl!["tone.wgsl", "tonemap.wgsl"];

    /// Builds the pass that reads `radiance`.
    ///
    /// # Errors
    ///
    /// [`GpuError::Shader`] if the WGSL does not compile on this adapter.
    pub fn new(gpu: &Gpu, radiance: &Target) -> Result<Self, GpuError> {
        let exposure = uniform(gpu, Self::NAME, &[1.0f32; 4]);
        let draw = Draw::new(
            gpu,
            &DrawKind {
                pass: Self::NAME,
                parts: Self::WGSL,
                source: &join(Self::WGSL),
                vertex: "tonemap_vertex",
                fragment: Some(("tonemap_fragment", super::PICTURE_FORMAT)),
                depth: None,
                cull: None,
                constants: &[],
            },
            &[
                Binding::Uniform(&exposure),
                Binding::Unfiltered(&radiance.view),
            ],
        )?;
        let size = [radiance.texture.width(), radiance.texture.height()];
        let tone_map = Self {
            draw,
            exposure,
            backdrop: Target::new(gpu, "backdrop", size, super::PICTURE_FORMAT),
        };
        tone_map.draw_backdrop(gpu, radiance);
        Ok(tone_map)
    }

    /// Draws what an empty picture shows.
    fn draw_backdrop(&self, gpu: &Gpu, radiance: &Target) {
        let mut encoder = gpu.encoder();
        drop(encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some("no radiance"),
            color_attachments: &[cleared(&radiance.view)],
            ..Default::default()
        }));
        {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("backdrop"),
                color_attachments: &[cleared(&self.backdrop.view)],
                ..Default::default()
            });
            self.draw.set(&mut pass);
            pass.draw(0..3, 0..1);
        }
        gpu.queue.submit([encoder.finish()]);
    }

    /// Adds the draw to `encoder`; nothing is drawn outside `part`.
    pub fn record(
        &self,
        gpu: &Gpu,
        exposure: f32,
        part: PartPx,
        picture: &Target,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut Timer,
    ) {
        let value = [exposure; 4];
        gpu.queue
            .write_buffer(&self.exposure, 0, bytemuck::bytes_of(&value));
        encoder.copy_texture_to_texture(
            self.backdrop.texture.as_image_copy(),
            picture.texture.as_image_copy(),
            picture.texture.size(),
        );
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some(Self::NAME),
            color_attachments: &[kept(&picture.view)],
            timestamp_writes: timer.render(Self::NAME),
            ..Default::default()
        });
        let [left, top, width, height] = part;
        pass.set_scissor_rect(left, top, width, height);
        self.draw.set(&mut pass);
        pass.draw(0..3, 0..1);
    }
}
