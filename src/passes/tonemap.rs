//! From linear radiance to the picture: one full-screen draw a frame.

use super::draw::{Draw, DrawKind, Target, cleared};
use crate::gpu::{Binding, Gpu, GpuError, Timer, Wgsl, join, uniform};

/// Exposure, tone curve, sRGB, backdrop.
pub struct ToneMap {
    draw: Draw,
    exposure: wgpu::Buffer,
}

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
        Ok(Self { draw, exposure })
    }

    /// Adds the draw to `encoder`.
    pub fn record(
        &self,
        gpu: &Gpu,
        exposure: f32,
        picture: &Target,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut Timer,
    ) {
        let value = [exposure; 4];
        gpu.queue
            .write_buffer(&self.exposure, 0, bytemuck::bytes_of(&value));
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some(Self::NAME),
            color_attachments: &[cleared(&picture.view)],
            timestamp_writes: timer.render(Self::NAME),
            ..Default::default()
        });
        self.draw.set(&mut pass);
        pass.draw(0..3, 0..1);
    }
}
