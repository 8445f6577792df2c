//! What the window draws to: its surface, the panel's textures and the place of the scene's picture among them.

use crate::app::AppError;
use crate::gpu::{Gpu, GpuError};
use egui_wgpu::ScreenDescriptor;
use std::sync::Arc;
use winit::dpi::{LogicalSize, PhysicalSize};
use winit::event_loop::ActiveEventLoop;
use winit::window::Window;

/// A window with a surface that can be drawn to.
pub struct Screen {
    /// The window itself.
    pub window: Arc<Window>,
    /// The adapter that presents to it.
    pub gpu: Gpu,
    /// What the panel knows of keys and mouse.
    pub egui: egui_winit::State,
    /// The scene's picture, as the panel calls it.
    pub picture: egui::TextureId,
    surface: wgpu::Surface<'static>,
    config: wgpu::SurfaceConfiguration,
    egui_renderer: egui_wgpu::Renderer,
    /// Textures of the panel that go after the frame.
    unused_textures: Vec<egui::TextureId>,
    /// A window without extent, as one that is minimised, is not drawn to.
    has_extent: bool,
}

/// Whether a frame reached the window.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Presented {
    /// It did, or nobody can see the window.
    Yes,
    /// The surface had to be made anew: draw again.
    TryAgain,
}

impl Screen {
    /// Opens a window.
    ///
    /// # Errors
    ///
    /// [`AppError`] if there can be no window, or no adapter presents to it.
    pub fn new(event_loop: &ActiveEventLoop) -> Result<Self, AppError> {
        let window_error = |e: &dyn std::fmt::Display| AppError::Window(e.to_string());
        let attributes = Window::default_attributes()
            .with_title("palpate")
            .with_inner_size(LogicalSize::new(1180.0, 720.0))
            .with_min_inner_size(LogicalSize::new(480.0, 320.0));
        let window = Arc::new(
            event_loop
                .create_window(attributes)
                .map_err(|e| window_error(&e))?,
        );
        let instance = Gpu::instance(Some(Box::new(event_loop.owned_display_handle())));
        let surface = instance
            .create_surface(window.clone())
            .map_err(|e| window_error(&e))?;
        let gpu = Gpu::open(&instance, Some(&surface))?;
        let capabilities = surface.get_capabilities(&gpu.raw_adapter);
        // egui blends in gamma space, so it wants a format that is not sRGB.
        let format = capabilities
            .formats
            .iter()
            .copied()
            .find(|format| !format.is_srgb())
            .or_else(|| capabilities.formats.first().copied())
            .ok_or_else(|| window_error(&"the adapter can't present to this window"))?;
        let size = window.inner_size();
        let config = wgpu::SurfaceConfiguration {
            format,
            ..surface
                .get_default_config(&gpu.raw_adapter, size.width.max(1), size.height.max(1))
                .ok_or_else(|| window_error(&"the adapter can't present to this window"))?
        };
        surface.configure(&gpu.device, &config);
        let egui = egui_winit::State::new(
            egui::Context::default(),
            egui::ViewportId::ROOT,
            &window,
            Some(window.scale_factor() as f32),
            None,
            Some(gpu.device.limits().max_texture_dimension_2d as usize),
        );
        let egui_renderer =
            egui_wgpu::Renderer::new(&gpu.device, format, egui_wgpu::RendererOptions::default());
        Ok(Self {
            window,
            gpu,
            egui,
            picture: egui::TextureId::default(),
            surface,
            config,
            egui_renderer,
            unused_textures: Vec::new(),
            has_extent: true,
        })
    }

    /// Width and height [physical px].
    pub fn size(&self) -> [u32; 2] {
        [self.config.width, self.config.height]
    }

    /// Whether there is anything to draw to.
    pub fn has_extent(&self) -> bool {
        self.has_extent
    }

    /// The window has another size; none at all when it is minimised.
    pub fn resize(&mut self, size: PhysicalSize<u32>) {
        self.has_extent = size.width > 0 && size.height > 0;
        if self.has_extent {
            let limit = self.gpu.device.limits().max_texture_dimension_2d;
            self.config.width = size.width.min(limit);
            self.config.height = size.height.min(limit);
            self.surface.configure(&self.gpu.device, &self.config);
        }
    }

    /// Gives a new picture of the scene the place of the one before.
    pub fn show_picture(&mut self, view: &wgpu::TextureView) {
        let (device, filter) = (&self.gpu.device, wgpu::FilterMode::Nearest);
        if self.picture == egui::TextureId::default() {
            self.picture = self
                .egui_renderer
                .register_native_texture(device, view, filter);
        } else {
            let (renderer, picture) = (&mut self.egui_renderer, self.picture);
            renderer.update_egui_texture_from_wgpu_texture(device, view, filter, picture);
        }
    }

    /// Takes over changed textures of the panel at once: egui tells each change only one time, whether
    /// or not the window can be drawn to.
    pub fn take_textures(&mut self, mut textures: egui::TexturesDelta) {
        for (id, deltas) in &textures.set {
            for delta in deltas {
                self.egui_renderer
                    .update_texture(&self.gpu.device, &self.gpu.queue, *id, delta);
            }
        }
        self.unused_textures.extend(&textures.free);
        textures.clear();
    }

    /// Draws the panel's `jobs` and shows them.
    ///
    /// # Errors
    ///
    /// [`AppError::Gpu`] if the surface can't be drawn to.
    pub fn present(
        &mut self,
        jobs: &[egui::ClippedPrimitive],
        pixels_per_point: f32,
    ) -> Result<Presented, AppError> {
        let presented = self.draw(jobs, pixels_per_point);
        for id in self.unused_textures.drain(..) {
            self.egui_renderer.free_texture(&id);
        }
        presented
    }

    fn draw(
        &mut self,
        jobs: &[egui::ClippedPrimitive],
        pixels_per_point: f32,
    ) -> Result<Presented, AppError> {
        let frame = match self.surface.get_current_texture() {
            wgpu::CurrentSurfaceTexture::Success(frame)
            | wgpu::CurrentSurfaceTexture::Suboptimal(frame) => frame,
            wgpu::CurrentSurfaceTexture::Outdated | wgpu::CurrentSurfaceTexture::Lost => {
                self.surface.configure(&self.gpu.device, &self.config);
                return Ok(Presented::TryAgain);
            }
            wgpu::CurrentSurfaceTexture::Timeout | wgpu::CurrentSurfaceTexture::Occluded => {
                return Ok(Presented::Yes);
            }
            wgpu::CurrentSurfaceTexture::Validation => {
                return Err(AppError::Gpu(GpuError::Pass {
                    pass: "present",
                    message: "the window's surface can't be drawn to".to_owned(),
                }));
            }
        };
        let screen = ScreenDescriptor {
            size_in_pixels: self.size(),
            pixels_per_point,
        };
        let mut encoder = self.gpu.encoder();
        let before = self.egui_renderer.update_buffers(
            &self.gpu.device,
            &self.gpu.queue,
            &mut encoder,
            jobs,
            &screen,
        );
        let view = frame.texture.create_view(&Default::default());
        {
            let pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some("panel"),
                color_attachments: &[Some(wgpu::RenderPassColorAttachment {
                    view: &view,
                    depth_slice: None,
                    resolve_target: None,
                    ops: wgpu::Operations {
                        load: wgpu::LoadOp::Clear(wgpu::Color::BLACK),
                        store: wgpu::StoreOp::Store,
                    },
                })],
                ..Default::default()
            });
            self.egui_renderer
                .render(&mut pass.forget_lifetime(), jobs, &screen);
        }
        self.gpu
            .queue
            .submit(before.into_iter().chain([encoder.finish()]));
        self.window.pre_present_notify();
        self.gpu.queue.present(frame);
        Ok(Presented::Yes)
    }
}
