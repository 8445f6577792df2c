//! The window: winit events in, frames out. Everything that is computed lives in the session.

use super::hand::{Hand, HandKnobs};
use super::heat;
use super::history::{History, Sample};
use super::light_error::LightError;
use super::load;
use super::orbit::{Orbit, Ray};
use super::panel::{self, PanelAsk, PanelState};
use super::record::Recording;
use super::renderer::Renderer;
use super::replay::{ReplayOptions, replay};
use super::take::Take;
use super::{AppError, Outcome, Session, thread_count};
use crate::gpu::{Gpu, GpuError};
use crate::measure::files::write;
use crate::measure::write_png;
use crate::scene::Scene;
use crate::sim::ToolAction;
use egui_wgpu::ScreenDescriptor;
use glam::Vec2;
use std::path::PathBuf;
use std::sync::Arc;
use std::time::{Duration, Instant};
use winit::application::ApplicationHandler;
use winit::dpi::{LogicalSize, PhysicalSize};
use winit::event::{ElementState, MouseButton, MouseScrollDelta, WindowEvent};
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop};
use winit::keyboard::{KeyCode, PhysicalKey};
use winit::window::{Window, WindowId};

/// Time steps that one drawn frame may catch up with; beyond that the scene runs slower than the clock.
const STEPS_A_FRAME_MAX: u32 = 4;

/// What `palpate window` was told.
#[derive(Clone, Debug)]
pub struct WindowOptions {
    /// Bundled scene or file.
    pub scene: String,
    /// `--set` overrides.
    pub sets: Vec<String>,
    /// Threads of the simulation.
    pub threads: Option<u32>,
    /// Where the frame log goes when the window closes.
    pub log: Option<PathBuf>,
}

impl Default for WindowOptions {
    fn default() -> Self {
        Self {
            scene: super::DEFAULT_SCENE.to_owned(),
            sets: Vec::new(),
            threads: None,
            log: None,
        }
    }
}

/// Opens the window on a scene. Without a display it says so and replays the scene into `out`.
///
/// # Errors
///
/// [`AppError`] if the scene can't be loaded, the GPU can't be opened or the log can't be written.
pub fn window(options: &WindowOptions) -> Result<Outcome, AppError> {
    let event_loop = if has_display() {
        EventLoop::new().ok()
    } else {
        None
    };
    let Some(event_loop) = event_loop else {
        eprintln!("palpate: no display, so the scene's script runs as a replay into out/");
        return replay(&ReplayOptions {
            scene: options.scene.clone(),
            sets: options.sets.clone(),
            threads: options.threads,
            ..ReplayOptions::default()
        });
    };
    let threads = thread_count(options.threads);
    let session = Session::new(load::scene(&options.scene, &options.sets)?, threads)?;
    let mut app = App {
        session: Some(session),
        scene_name: options.scene.clone(),
        threads,
        shown: None,
        failed: None,
    };
    event_loop
        .run_app(&mut app)
        .map_err(|e| AppError::Window(e.to_string()))?;
    if let (Some(shown), Some(log)) = (&app.shown, &options.log) {
        shown.recording.write_log(log)?;
    }
    match app.failed {
        Some(error) => Err(error),
        None => Ok(Outcome::Done),
    }
}

/// On systems where a display has a name in the environment, whether it is there.
fn has_display() -> bool {
    let named = ["DISPLAY", "WAYLAND_DISPLAY", "WAYLAND_SOCKET"];
    !cfg!(all(unix, not(target_os = "macos")))
        || named
            .iter()
            .any(|name| std::env::var_os(name).is_some_and(|value| !value.is_empty()))
}

struct App {
    /// Taken when the window is made.
    session: Option<Session>,
    scene_name: String,
    threads: usize,
    shown: Option<Shown>,
    failed: Option<AppError>,
}

/// Everything that exists once there is a window.
struct Shown {
    window: Arc<Window>,
    surface: wgpu::Surface<'static>,
    config: wgpu::SurfaceConfiguration,
    gpu: Gpu,
    egui: egui_winit::State,
    egui_renderer: egui_wgpu::Renderer,
    picture: egui::TextureId,
    /// Textures of the panel that go after the frame.
    unused_textures: Vec<egui::TextureId>,
    session: Session,
    renderer: Renderer,
    orbit: Orbit,
    /// Whether the user has moved the camera; until then it fits the picture.
    camera_moved: bool,
    hand: Option<Hand>,
    drag: Drag,
    state: PanelState,
    history: History,
    light_error: LightError,
    /// The map of it, once there is one.
    light_error_picture: Option<egui::TextureHandle>,
    /// Every frame since the window opened, for the log.
    recording: Recording,
    /// What the hand does, while it is recorded.
    take: Option<Take>,
    threads: usize,
    /// Where the scene is drawn [physical px]: left, top, width, height.
    view_px: [u32; 4],
    cursor_px: Vec2,
    last_frame: Instant,
    owed_s: f32,
    wants_to_close: bool,
    control_held: bool,
}

/// What a moving mouse does.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Drag {
    Nothing,
    Tool,
    Orbit,
    Pan,
}

impl ApplicationHandler for App {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        let Some(session) = self.session.take() else {
            return;
        };
        match Shown::new(event_loop, session, &self.scene_name, self.threads) {
            Ok(shown) => self.shown = Some(shown),
            Err(error) => {
                self.failed = Some(error);
                event_loop.exit();
            }
        }
    }

    fn window_event(&mut self, event_loop: &ActiveEventLoop, _: WindowId, event: WindowEvent) {
        let Some(shown) = &mut self.shown else {
            return;
        };
        match event {
            WindowEvent::CloseRequested => event_loop.exit(),
            WindowEvent::RedrawRequested => {
                if let Err(error) = shown.frame() {
                    self.failed = Some(error);
                    event_loop.exit();
                }
            }
            WindowEvent::Resized(size) => shown.resize(size),
            event => {
                shown.input(&event);
                if shown.wants_to_close {
                    event_loop.exit();
                }
            }
        }
    }

    fn about_to_wait(&mut self, event_loop: &ActiveEventLoop) {
        if let Some(shown) = &mut self.shown {
            if shown.idle() {
                // Asleep: look again a few times a second, in case a knob was turned by a script.
                event_loop.set_control_flow(ControlFlow::WaitUntil(
                    Instant::now() + Duration::from_millis(250),
                ));
            } else {
                event_loop.set_control_flow(ControlFlow::Poll);
                shown.window.request_redraw();
            }
        }
    }
}

/// The first of `stem-001.ending`, `stem-002.ending` … that is not there yet.
fn unused_name(stem: &str, ending: &str) -> PathBuf {
    (1_u32..)
        .map(|number| PathBuf::from(format!("{stem}-{number:03}.{ending}")))
        .find(|path| !path.exists())
        .expect("a folder has a bound on its files")
}

impl Shown {
    fn new(
        event_loop: &ActiveEventLoop,
        mut session: Session,
        scene_name: &str,
        threads: usize,
    ) -> Result<Self, AppError> {
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

        let context = egui::Context::default();
        let egui = egui_winit::State::new(
            context,
            egui::ViewportId::ROOT,
            &window,
            Some(window.scale_factor() as f32),
            None,
            Some(gpu.device.limits().max_texture_dimension_2d as usize),
        );
        let mut egui_renderer =
            egui_wgpu::Renderer::new(&gpu.device, format, egui_wgpu::RendererOptions::default());
        session.script_plays = false;
        let renderer = Renderer::new(gpu.clone(), &session, [config.width, config.height])?;
        let picture = egui_renderer.register_native_texture(
            &gpu.device,
            renderer.picture_view(),
            wgpu::FilterMode::Nearest,
        );
        let orbit = renderer.scene_orbit(&session);
        let state = PanelState::new(scene_name, HandKnobs::for_size(session.rest.longest_m()));
        Ok(Self {
            window,
            surface,
            config,
            gpu,
            egui,
            egui_renderer,
            picture,
            unused_textures: Vec::new(),
            session,
            renderer,
            orbit,
            camera_moved: false,
            hand: None,
            drag: Drag::Nothing,
            state,
            history: History::default(),
            light_error: LightError::default(),
            light_error_picture: None,
            recording: Recording::new(scene_name.to_owned(), threads),
            take: None,
            threads,
            view_px: [0, 0, 1, 1],
            cursor_px: Vec2::ZERO,
            last_frame: Instant::now(),
            owed_s: 0.0,
            wants_to_close: false,
            control_held: false,
        })
    }

    /// Nothing moves and nobody does anything.
    fn idle(&mut self) -> bool {
        self.state.asleep
            && self.drag == Drag::Nothing
            && !self.state.wants_frame
            && !self.light_error.has_news()
    }

    fn resize(&mut self, size: PhysicalSize<u32>) {
        let limit = self.gpu.device.limits().max_texture_dimension_2d;
        self.config.width = size.width.clamp(1, limit);
        self.config.height = size.height.clamp(1, limit);
        self.surface.configure(&self.gpu.device, &self.config);
        self.wake();
    }

    fn wake(&mut self) {
        self.state.wants_frame = true;
        self.window.request_redraw();
    }

    fn input(&mut self, event: &WindowEvent) {
        let response = self.egui.on_window_event(&self.window, event);
        self.wake();
        match event {
            WindowEvent::CursorMoved { position, .. } => {
                let to = Vec2::new(position.x as f32, position.y as f32);
                let by = (to - self.cursor_px) / self.view_px[3] as f32;
                self.cursor_px = to;
                self.moved(by);
            }
            WindowEvent::MouseInput { state, button, .. } => match state {
                ElementState::Pressed if self.cursor_in_view() => self.pressed(*button),
                ElementState::Pressed => {}
                ElementState::Released => {
                    self.drag = Drag::Nothing;
                    self.hand = None;
                }
            },
            WindowEvent::MouseWheel { delta, .. } if self.cursor_in_view() => {
                let notches = match delta {
                    MouseScrollDelta::LineDelta(_, y) => *y,
                    MouseScrollDelta::PixelDelta(at) => at.y as f32 / 50.0,
                };
                self.scrolled(notches);
            }
            WindowEvent::ModifiersChanged(now) => self.control_held = now.state().control_key(),
            WindowEvent::CursorLeft { .. } if self.drag != Drag::Tool => self.drag = Drag::Nothing,
            WindowEvent::KeyboardInput { event, .. }
                if event.state == ElementState::Pressed && !response.consumed =>
            {
                if let PhysicalKey::Code(code) = event.physical_key {
                    self.key(code);
                }
            }
            _ => {}
        }
    }

    fn cursor_in_view(&self) -> bool {
        let at = self.cursor_px - Vec2::new(self.view_px[0] as f32, self.view_px[1] as f32);
        let size = Vec2::new(self.view_px[2] as f32, self.view_px[3] as f32);
        at.cmpge(Vec2::ZERO).all() && at.cmplt(size).all()
    }

    fn cursor_ray(&self) -> Ray {
        let [left, top, width, height] = self.view_px.map(|px| px as f32);
        let at = (self.cursor_px - Vec2::new(left, top)) / Vec2::new(width, height);
        self.orbit.ray(at, width / height)
    }

    fn pressed(&mut self, button: MouseButton) {
        let action = match button {
            MouseButton::Left => ToolAction::Push,
            MouseButton::Right => ToolAction::Grab,
            MouseButton::Middle => {
                self.drag = Drag::Orbit;
                return;
            }
            _ => return,
        };
        let triangles = self.session.mesh.point_triangles();
        self.hand = Hand::press(action, self.cursor_ray(), self.session.points(), &triangles);
        self.drag = match (self.hand, button) {
            (Some(_), _) => Drag::Tool,
            // Beside the organ a drag moves the camera, for mice without a middle button.
            (None, MouseButton::Left) => Drag::Orbit,
            (None, _) => Drag::Pan,
        };
    }

    fn moved(&mut self, by: Vec2) {
        match self.drag {
            Drag::Nothing => {}
            Drag::Orbit => {
                self.orbit.turn(by);
                self.camera_moved = true;
            }
            Drag::Pan => {
                self.orbit.pan(by);
                self.camera_moved = true;
            }
            Drag::Tool => {
                let ray = self.cursor_ray();
                if let Some(hand) = &mut self.hand {
                    hand.drag(ray);
                }
            }
        }
    }

    fn scrolled(&mut self, notches: f32) {
        let longest_m = self.session.rest.longest_m();
        if self.drag == Drag::Tool {
            let knobs = &mut self.state.hand;
            knobs.depth_m =
                (knobs.depth_m + 0.01 * longest_m * notches).clamp(0.0, 0.3 * longest_m);
        } else {
            self.orbit.zoom(notches, longest_m);
            self.camera_moved = true;
        }
    }

    fn key(&mut self, code: KeyCode) {
        match code {
            KeyCode::Space => self.state.paused = !self.state.paused,
            KeyCode::Period | KeyCode::KeyN => self.state.step_once = true,
            KeyCode::KeyR => self.reset(),
            KeyCode::KeyP => self.play_script(),
            KeyCode::KeyS | KeyCode::F12 => self.state.screenshot = true,
            KeyCode::KeyC => self.reset_camera(),
            KeyCode::KeyO => self.record_or_stop(),
            KeyCode::KeyK => self.save_scene(),
            KeyCode::KeyE => self.state.light_error_shown = !self.state.light_error_shown,
            KeyCode::Escape => self.wants_to_close = true,
            KeyCode::KeyQ if self.control_held => self.wants_to_close = true,
            KeyCode::Tab => self.state.panel_open = !self.state.panel_open,
            KeyCode::F1 | KeyCode::KeyH => self.state.help_open = !self.state.help_open,
            _ => {}
        }
    }

    fn reset(&mut self) {
        self.session.reset();
        self.session.script_plays = false;
        self.history = History::default();
        self.begin_take_again();
    }

    /// A take that is under way goes on from rest.
    fn begin_take_again(&mut self) {
        if let Some(take) = &mut self.take {
            *take = Take::default();
        }
    }

    /// Starts a take from rest, or ends one and saves it.
    fn record_or_stop(&mut self) {
        match self.take.take() {
            None => {
                self.hand = None;
                self.drag = Drag::Nothing;
                self.reset();
                self.take = Some(Take::default());
                self.state.paused = false;
                self.state.message = "recording from rest".to_owned();
            }
            Some(take) if take.is_empty() => self.state.message = "nothing was recorded".to_owned(),
            Some(take) => {
                let about = format!(
                    "# Recorded by hand in palpate's window. Its replay ends in the state\n# {}\n\n",
                    self.session.state_sha256()
                );
                self.save(&take.scene(&self.session), &about);
            }
        }
        self.state.records = self.take.is_some();
    }

    /// Saves the scene as it is now, with the knobs as they were turned.
    fn save_scene(&mut self) {
        self.save(&self.session.scene.clone(), "");
    }

    /// Saves a scene below the comment `about`.
    fn save(&mut self, scene: &Scene, about: &str) {
        let path = unused_name("palpate", "toml");
        let saved = scene.to_toml().map_err(AppError::from);
        let saved = saved.and_then(|text| Ok(write(&path, (about.to_owned() + &text).as_bytes())?));
        match saved {
            Ok(()) => self.state.message = format!("saved {}", path.display()),
            Err(error) => self.state.error = Some(error.to_string()),
        }
    }

    fn reset_camera(&mut self) {
        self.orbit = self.renderer.scene_orbit(&self.session);
        self.camera_moved = false;
    }

    fn play_script(&mut self) {
        self.reset();
        self.session.script_plays = true;
        self.state.paused = false;
    }

    /// Steps that came due since the frame before.
    fn due_steps(&mut self, seconds: f32) -> u32 {
        if self.state.paused {
            self.owed_s = 0.0;
            return u32::from(std::mem::take(&mut self.state.step_once));
        }
        self.owed_s += seconds;
        let step_s = self.session.scene.solver.timestep_s;
        let due = (self.owed_s / step_s) as u32;
        if due > STEPS_A_FRAME_MAX {
            self.owed_s = 0.0;
            return STEPS_A_FRAME_MAX;
        }
        self.owed_s -= due as f32 * step_s;
        due
    }

    fn frame(&mut self) -> Result<(), AppError> {
        let start = Instant::now();
        let seconds = (start - self.last_frame).as_secs_f32();
        self.last_frame = start;
        self.state.wants_frame = false;

        let mut sample = Sample {
            wall_ms: 1e3 * seconds,
            ..Sample::default()
        };
        let mut last_tick = None;
        for _ in 0..self.due_steps(seconds) {
            if let Some(hand) = &mut self.hand {
                hand.sink(&self.state.hand, self.session.scene.solver.timestep_s);
            }
            self.session.hand = self.hand.map(|hand| hand.tool(&self.state.hand));
            let tick = self.session.tick();
            sample.add_tick(&tick);
            if let Some(take) = &mut self.take {
                take.add(&self.session);
            }
            self.state.asleep = tick.report.asleep;
            self.state.frozen_particles = tick.report.frozen_particles;
            last_tick = Some(tick);
        }

        self.take_light_error();
        let (jobs, pixels_per_point) = self.panel()?;
        let tools = self.session.visible_tools();
        let volumes = self.session.simulation().point_volumes();
        let drawn = self
            .renderer
            .draw(self.session.points(), volumes, &self.orbit, &tools)?;
        if let Some(tick) = last_tick {
            sample.passes.clone_from(&drawn.passes);
            self.history.push(sample);
            self.recording.add(&self.session, start, &tick, drawn);
        }
        self.ask_light_error()?;
        if std::mem::take(&mut self.state.screenshot) {
            self.screenshot()?;
        }
        let presented = self.present(&jobs, pixels_per_point);
        for id in self.unused_textures.drain(..) {
            self.egui_renderer.free_texture(&id);
        }
        presented
    }

    /// Runs the panel and does what it asks for.
    fn panel(&mut self) -> Result<(Vec<egui::ClippedPrimitive>, f32), AppError> {
        let input = self.egui.take_egui_input(&self.window);
        let context = self.egui.egui_ctx().clone();
        let error = self
            .light_error_picture
            .as_ref()
            .zip(self.light_error.map());
        let shown = panel::Shown {
            picture: self.picture,
            error: error.map(|(picture, map)| (picture.id(), map)),
        };
        let mut asks = Vec::new();
        let mut view = egui::Rect::ZERO;
        let output = context.run_ui(input, |ui| {
            view = panel::show(
                ui,
                &mut self.state,
                &mut self.session,
                &self.history,
                shown,
                &mut asks,
            );
        });
        self.take_textures(output.textures_delta);
        self.egui
            .handle_platform_output(&self.window, output.platform_output);
        let scale = output.pixels_per_point;
        self.view_px = [
            (view.left() * scale).round() as u32,
            (view.top() * scale).round() as u32,
            ((view.width() * scale).round() as u32).max(8),
            ((view.height() * scale).round() as u32).max(8),
        ];
        for ask in asks {
            self.answer(ask);
        }
        self.fit_picture();
        let repaint_soon = output
            .viewport_output
            .values()
            .any(|viewport| viewport.repaint_delay < Duration::from_millis(50));
        self.state.wants_frame |= repaint_soon;
        let jobs = context.tessellate(output.shapes, scale);
        Ok((jobs, scale))
    }

    /// Takes over changed textures of the panel at once: egui tells each change only one time, whether
    /// or not the window can be drawn to.
    fn take_textures(&mut self, mut textures: egui::TexturesDelta) {
        for (id, deltas) in &textures.set {
            for delta in deltas {
                self.egui_renderer
                    .update_texture(&self.gpu.device, &self.gpu.queue, *id, delta);
            }
        }
        self.unused_textures.extend(&textures.free);
        textures.clear();
    }

    /// Makes the picture as large as the place it is shown in.
    fn fit_picture(&mut self) {
        let size = [self.view_px[2], self.view_px[3]];
        if self.renderer.size() != size {
            self.renderer.resize(size);
            self.show_new_picture();
            if !self.camera_moved {
                self.reset_camera();
            }
        }
    }

    fn show_new_picture(&mut self) {
        self.egui_renderer.update_egui_texture_from_wgpu_texture(
            &self.gpu.device,
            self.renderer.picture_view(),
            wgpu::FilterMode::Nearest,
            self.picture,
        );
    }

    fn answer(&mut self, ask: PanelAsk) {
        let result = match ask {
            PanelAsk::Scene(name) => self.load(&name),
            PanelAsk::Rebuild => self.rebuild(),
            PanelAsk::SurfaceKnobs => {
                self.renderer.set_knobs(&self.session.scene);
                Ok(())
            }
            PanelAsk::Solver => {
                self.session.set_solver();
                // A script has one solver from its start on.
                if self.take.is_some() {
                    self.reset();
                }
                Ok(())
            }
            PanelAsk::Beat => {
                self.session.set_beat();
                // Nor has it another heartbeat later on.
                if self.take.is_some() {
                    self.reset();
                }
                Ok(())
            }
            PanelAsk::Record => {
                self.record_or_stop();
                Ok(())
            }
            PanelAsk::SaveScene => {
                self.save_scene();
                Ok(())
            }
            PanelAsk::Reset => {
                self.reset();
                Ok(())
            }
            PanelAsk::PlayScript => {
                self.play_script();
                Ok(())
            }
            PanelAsk::ResetCamera => {
                self.reset_camera();
                Ok(())
            }
        };
        // What fails here leaves the old scene running and says why.
        if let Err(error) = result {
            self.state.error = Some(error.to_string());
        }
        self.state.wants_frame = true;
    }

    fn load(&mut self, name: &str) -> Result<(), AppError> {
        let mut session = Session::new(load::scene(name, &[])?, self.threads)?;
        session.script_plays = false;
        let renderer = Renderer::new(self.gpu.clone(), &session, self.renderer.size())?;
        self.session = session;
        self.renderer = renderer;
        self.hand = None;
        self.drag = Drag::Nothing;
        self.reset_camera();
        self.state.hand = HandKnobs::for_size(self.session.rest.longest_m());
        self.state.scene_name = name.to_owned();
        self.history = History::default();
        (self.take, self.state.records) = (None, false);
        self.light_error.forget();
        self.show_new_picture();
        Ok(())
    }

    fn rebuild(&mut self) -> Result<(), AppError> {
        self.renderer = self.renderer.rebuilt(&self.session)?;
        self.light_error.forget();
        self.show_new_picture();
        Ok(())
    }

    /// Shows the error of the light path that has come in; forgets it when it is switched off or the camera has moved.
    fn take_light_error(&mut self) {
        let came = self.light_error.take_news();
        let map = self.light_error.map();
        if !self.state.light_error_shown || map.is_some_and(|map| map.orbit != self.orbit) {
            self.light_error.clear();
            self.light_error_picture = None;
        } else if came && let Some(map) = map {
            let picture = heat::picture(map);
            let options = egui::TextureOptions::NEAREST;
            let context = self.egui.egui_ctx();
            self.light_error_picture = Some(context.load_texture("light error", picture, options));
            self.state.wants_frame = true;
        }
    }

    /// Has the frame that was just drawn compared with cast rays, if that is shown, nothing else is being compared
    /// and it differs from what is shown.
    fn ask_light_error(&mut self) -> Result<(), AppError> {
        if !self.state.light_error_shown || !self.light_error.is_free() {
            return Ok(());
        }
        let time_s = self.session.time_s();
        let is_known = self
            .light_error
            .map()
            .is_some_and(|map| map.time_s == time_s);
        if !is_known && let Some(snapshot) = self.renderer.snapshot(&self.session, &self.orbit)? {
            self.light_error.ask(snapshot, self.threads);
        }
        Ok(())
    }

    fn screenshot(&mut self) -> Result<(), AppError> {
        let path = unused_name("palpate", "png");
        match write_png(&path, &self.renderer.picture()?) {
            Ok(()) => self.state.message = format!("saved {}", path.display()),
            Err(error) => self.state.error = Some(error.to_string()),
        }
        Ok(())
    }

    fn present(
        &mut self,
        jobs: &[egui::ClippedPrimitive],
        pixels_per_point: f32,
    ) -> Result<(), AppError> {
        let frame = match self.surface.get_current_texture() {
            wgpu::CurrentSurfaceTexture::Success(frame)
            | wgpu::CurrentSurfaceTexture::Suboptimal(frame) => frame,
            wgpu::CurrentSurfaceTexture::Outdated | wgpu::CurrentSurfaceTexture::Lost => {
                self.surface.configure(&self.gpu.device, &self.config);
                self.state.wants_frame = true;
                return Ok(());
            }
            wgpu::CurrentSurfaceTexture::Timeout | wgpu::CurrentSurfaceTexture::Occluded => {
                return Ok(());
            }
            wgpu::CurrentSurfaceTexture::Validation => {
                return Err(AppError::Gpu(GpuError::Pass {
                    pass: "present",
                    message: "the window's surface can't be drawn to".to_owned(),
                }));
            }
        };
        let screen = ScreenDescriptor {
            size_in_pixels: [self.config.width, self.config.height],
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
        Ok(())
    }
}
