//! A window that is open: the session it shows, and what turns both into a frame.

use super::input::keys;
use super::opening::{Opened, Opening, Wanted};
use super::screen::{Presented, Screen};
use crate::app::hand::Hand;
use crate::app::heat;
use crate::app::history::{History, Sample};
use crate::app::light_error::LightError;
use crate::app::orbit::{Orbit, Side};
use crate::app::overlay;
use crate::app::panel::{self, PanelAsk, PanelState};
use crate::app::push::PushCurve;
use crate::app::record::Recording;
use crate::app::renderer::Renderer;
use crate::app::section::{Layered, Section};
use crate::app::take::Take;
use crate::app::{AppError, Session};
use crate::geom::bounds;
use crate::scene::RestBox;
use egui::epaint::ClippedShape;
use glam::Vec2;
use std::time::{Duration, Instant};
use winit::dpi::PhysicalSize;
use winit::event_loop::ActiveEventLoop;

/// Time steps that one drawn frame may catch up with; beyond that the scene runs slower than the clock.
const STEPS_A_FRAME_MAX: u32 = 4;

/// Everything that exists once there is a window.
pub struct Shown {
    pub(super) screen: Screen,
    pub(super) session: Session,
    pub(super) renderer: Renderer,
    pub(super) orbit: Orbit,
    /// Whether the user has moved the camera; until then it fits the picture.
    pub(super) camera_moved: bool,
    pub(super) hand: Option<Hand>,
    pub(super) drag: Drag,
    pub(super) state: PanelState,
    history: History,
    push: PushCurve,
    /// The layers below the cursor, while they are shown.
    section: Option<Section>,
    light_error: LightError,
    /// The map of it, once there is one.
    light_error_picture: Option<egui::TextureHandle>,
    /// Every frame since the window opened, where a log was asked for.
    pub(super) recording: Option<Recording>,
    /// What the hand does, while it is recorded.
    pub(super) take: Option<Take>,
    /// What will take the place of the session.
    opening: Option<Opening>,
    /// What changed knobs ask for once the mouse has let go of them: each takes longer than a frame.
    awaited: Awaited,
    threads: usize,
    /// Where the scene is drawn [physical px]: left, top, width, height.
    pub(super) view_px: [u32; 4],
    pub(super) cursor_px: Vec2,
    last_frame: Instant,
    owed_s: f32,
    pub(super) wants_to_close: bool,
    /// How many of the session's notes have been said.
    notes_said: usize,
}

/// What a moving mouse does.
#[derive(Clone, Copy, PartialEq, Eq)]
pub enum Drag {
    Nothing,
    Tool,
    Orbit,
    Pan,
}

/// What waits for the mouse to let go.
#[derive(Clone, Copy, Default)]
struct Awaited {
    /// Other passes.
    rebuild: bool,
    /// Another body.
    reload: bool,
}

impl Shown {
    /// Opens a window on `session`.
    ///
    /// # Errors
    ///
    /// [`AppError`] if there can be no window, or the scene can't be drawn in it.
    pub fn new(
        event_loop: &ActiveEventLoop,
        mut session: Session,
        scene_name: &str,
        threads: usize,
        logs: bool,
    ) -> Result<Self, AppError> {
        let mut screen = Screen::new(event_loop)?;
        session.script_plays = false;
        for note in &session.notes {
            eprintln!("{scene_name}: {note}");
        }
        let notes_said = session.notes.len();
        let renderer = Renderer::new(screen.gpu.clone(), &session, screen.size())?;
        screen.show_picture(renderer.picture_view());
        let orbit = renderer.scene_orbit(&session);
        Ok(Self {
            state: PanelState::new(scene_name, &session),
            screen,
            session,
            renderer,
            orbit,
            camera_moved: false,
            hand: None,
            drag: Drag::Nothing,
            history: History::default(),
            push: PushCurve::default(),
            section: None,
            light_error: LightError::default(),
            light_error_picture: None,
            recording: logs.then(|| Recording::of_log(scene_name.to_owned(), threads)),
            take: None,
            opening: None,
            awaited: Awaited::default(),
            threads,
            view_px: [0, 0, 1, 1],
            cursor_px: Vec2::ZERO,
            last_frame: Instant::now(),
            owed_s: 0.0,
            wants_to_close: false,
            notes_said,
        })
    }

    /// Whether nothing moves and nobody does anything, or nobody can see it.
    pub fn idle(&mut self) -> bool {
        !self.screen.has_extent()
            || (self.state.asleep || self.state.paused && !self.state.step_once)
                && self.drag == Drag::Nothing
                && !self.state.wants_frame
                && !self.light_error.has_news()
                && !self.opening.as_mut().is_some_and(Opening::has_arrived)
    }

    /// The window has another size.
    pub fn resize(&mut self, size: PhysicalSize<u32>) {
        self.screen.resize(size);
        self.wake();
    }

    /// Asks for a frame.
    pub fn wake(&mut self) {
        self.state.wants_frame = true;
        self.screen.window.request_redraw();
    }

    /// Back to rest.
    pub fn reset(&mut self) {
        self.session.reset();
        self.session.script_plays = false;
        self.history = History::default();
        self.push = PushCurve::default();
        self.state.asleep = false;
        self.begin_take_again();
    }

    /// Back to the scene's camera.
    pub fn reset_camera(&mut self) {
        self.orbit = self.renderer.scene_orbit(&self.session);
        self.camera_moved = false;
    }

    /// Takes over the scene's camera: its view angle, where the user has moved it.
    fn take_camera(&mut self) {
        if self.camera_moved {
            self.orbit.fov_y = self.session.scene.camera.fov_y_deg.to_radians();
        } else {
            self.reset_camera();
        }
    }

    /// Looks at all of the body from a side.
    pub fn look(&mut self, side: Side) {
        let (low, high) = bounds(self.session.points());
        let [width, height] = self.renderer.size();
        let aspect = width as f32 / height as f32;
        self.orbit = self.orbit.seen_from(side, &RestBox { low, high }, aspect);
        self.camera_moved = true;
    }

    /// Plays the scene's script from its start.
    pub fn play_script(&mut self) {
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

    /// Runs the time steps that came due, and draws.
    ///
    /// # Errors
    ///
    /// [`AppError::Gpu`] if the adapter fails.
    pub fn frame(&mut self) -> Result<(), AppError> {
        if !self.screen.has_extent() {
            return Ok(());
        }
        let start = Instant::now();
        let seconds = (start - self.last_frame).as_secs_f32();
        self.last_frame = start;
        self.state.wants_frame = false;
        self.take_opened();

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
            self.push.add(self.pushed_m(), tick.force_max_n());
            if let Some(take) = &mut self.take {
                take.add(&self.session);
            }
            self.state.asleep = tick.report.asleep;
            self.state.frozen_particles = tick.report.frozen_particles;
            last_tick = Some(tick);
        }

        self.say_new_notes();
        self.take_light_error();
        self.cut_open();
        let (panel, view, scale) = self.panel()?;
        let tools = self.session.visible_tools();
        let volumes = self.session.simulation().point_volumes();
        let drawn = self
            .renderer
            .draw(self.session.points(), volumes, &self.orbit, &tools)?;
        if let Some(tick) = last_tick {
            sample.passes.clone_from(&drawn.passes);
            self.history.push(sample);
            if let Some(recording) = &mut self.recording {
                recording.add(&self.session, start, &tick, drawn);
            }
        }
        self.ask_light_error()?;
        if std::mem::take(&mut self.state.screenshot) {
            self.screenshot()?;
        }
        let mut jobs = self.over_the_picture(view, scale)?;
        jobs.extend(panel);
        if self.screen.present(&jobs, scale)? == Presented::TryAgain {
            self.state.wants_frame = true;
        }
        Ok(())
    }

    /// Says what the session has come to say since the frame before.
    fn say_new_notes(&mut self) {
        let notes = &self.session.notes[self.notes_said..];
        for note in notes {
            eprintln!("{}: {note}", self.state.scene_name);
        }
        if let Some(last) = notes.last() {
            self.state.message.clone_from(last);
        }
        self.notes_said = self.session.notes.len();
    }

    /// How deep a tool is pushed in, if one is: the hand's, or the script's.
    fn pushed_m(&self) -> Option<f32> {
        match &self.hand {
            Some(hand) => hand.depth_m(),
            None if self.session.script_plays => {
                self.session.tool_depth_m().filter(|&depth| depth >= 0.0)
            }
            None => None,
        }
    }

    /// Cuts the layers open below the cursor, if that is shown.
    fn cut_open(&mut self) {
        if !self.state.overlays.section {
            self.section = None;
        } else if self.cursor_in_view() {
            let layered = Layered {
                points: self.session.points(),
                mesh: &self.session.mesh,
                maps: self.renderer.tissue(),
                surface: &self.session.scene.surface,
            };
            self.section = Section::at(&layered, &self.cursor_ray(), self.orbit.right());
        }
    }

    /// The picture, and what is switched on to lie over it.
    fn over_the_picture(
        &self,
        view: egui::Rect,
        scale: f32,
    ) -> Result<Vec<egui::ClippedPrimitive>, AppError> {
        let whole = egui::Rect::from_min_max(egui::Pos2::ZERO, egui::pos2(1.0, 1.0));
        let picture = egui::Shape::image(self.screen.picture, view, whole, egui::Color32::WHITE);
        let mut shapes = vec![ClippedShape::new(view, picture)];
        shapes.extend(overlay::shapes(
            self.state.overlays,
            &self.session,
            &self.renderer,
            &self.orbit,
            view,
            self.section.as_ref(),
        )?);
        Ok(self.screen.egui.egui_ctx().tessellate(shapes, scale))
    }

    /// Runs the panel and does what it asks for; says what is drawn of it, where the picture is and how many pixels a
    /// point has.
    fn panel(&mut self) -> Result<(Vec<egui::ClippedPrimitive>, egui::Rect, f32), AppError> {
        let mut input = self.screen.egui.take_egui_input(&self.screen.window);
        let context = self.screen.egui.egui_ctx().clone();
        let panel_listens =
            || context.egui_wants_keyboard_input() || egui::Popup::is_any_open(&context);
        let listened = panel_listens();
        let keys = keys(&mut input.events, !listened);
        let error = self
            .light_error_picture
            .as_ref()
            .zip(self.light_error.map());
        let shown = panel::Shown {
            error: error.map(|(picture, map)| (picture.id(), map)),
            opening: self.opening.as_ref().map(Opening::name),
            section: self.section.as_ref(),
            history: &self.history,
            push: &self.push,
        };
        let mut asks = Vec::new();
        let mut view = egui::Rect::ZERO;
        let output = context.run_ui(input, |ui| {
            view = panel::show(ui, &mut self.state, &mut self.session, shown, &mut asks);
        });
        self.screen.take_textures(output.textures_delta);
        self.screen
            .egui
            .handle_platform_output(&self.screen.window, output.platform_output);
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
        self.wants_to_close |= keys.iter().any(|pressed| pressed.closes());
        // A field that was left by a key had its use for it, and so has one that was clicked in the same frame.
        if !listened && !panel_listens() {
            keys.into_iter().for_each(|pressed| self.key(pressed));
        }
        if !context.input(|input| input.pointer.any_down()) {
            self.do_awaited();
        }
        self.fit_picture();
        let repaint_soon = output
            .viewport_output
            .values()
            .any(|viewport| viewport.repaint_delay < Duration::from_millis(50));
        self.state.wants_frame |= repaint_soon;
        let jobs = context.tessellate(output.shapes, scale);
        Ok((jobs, view, scale))
    }

    /// Makes the picture as large as the place it is shown in.
    fn fit_picture(&mut self) {
        let size = [self.view_px[2], self.view_px[3]];
        if self.renderer.size() != size {
            self.renderer.resize(size);
            self.screen.show_picture(self.renderer.picture_view());
            if !self.camera_moved {
                self.reset_camera();
            }
        }
    }

    fn answer(&mut self, ask: PanelAsk) {
        match ask {
            PanelAsk::Open(path) => self.open(&path),
            PanelAsk::Rebuild => self.awaited.rebuild = true,
            PanelAsk::Reload => self.awaited.reload = true,
            PanelAsk::SurfaceKnobs => {
                self.renderer.set_knobs(&self.session.scene);
                self.light_error.forget();
            }
            PanelAsk::Lights => {
                self.renderer.set_lights(&self.session);
                self.light_error.forget();
            }
            PanelAsk::Camera => self.take_camera(),
            PanelAsk::Look(side) => self.look(side),
            PanelAsk::Solver => {
                self.session.set_solver();
                // A script has one solver from its start on.
                if self.take.is_some() {
                    self.reset();
                }
            }
            PanelAsk::Beat => {
                self.session.set_beat();
                // Nor has it another heartbeat later on.
                if self.take.is_some() {
                    self.reset();
                }
            }
            PanelAsk::Record => self.record_or_stop(),
            PanelAsk::SaveScene => self.save_scene(),
            PanelAsk::Reset => self.reset(),
            PanelAsk::PlayScript => self.play_script(),
            PanelAsk::ResetCamera => self.reset_camera(),
        }
        self.state.wants_frame = true;
    }

    /// Does what waited for the mouse to let go.
    fn do_awaited(&mut self) {
        let awaited = std::mem::take(&mut self.awaited);
        if awaited.reload {
            self.begin_opening(Wanted::Changed(Box::new(self.session.scene.clone())));
        } else if awaited.rebuild
            && let Err(error) = self.rebuild()
        {
            // What fails here leaves the old passes running and says why.
            self.state.error = Some(error.to_string());
        }
    }

    /// Begins to open a scene, or a body in place of that of the running scene.
    pub fn open(&mut self, path: &str) {
        match Wanted::of(path, &self.session.scene) {
            Ok(wanted) => self.begin_opening(wanted),
            Err(error) => self.state.error = Some(error.to_string()),
        }
    }

    fn begin_opening(&mut self, wanted: Wanted) {
        let (gpu, size) = (self.screen.gpu.clone(), self.renderer.size());
        self.opening = Some(Opening::begin(wanted, gpu, size, self.threads));
        self.state.wants_frame = true;
    }

    /// Goes on with what was being opened, if it has come in; if it can't be opened, says why.
    fn take_opened(&mut self) {
        match self.opening.as_mut().and_then(Opening::take) {
            None => return,
            Some(Err(message)) => self.state.error = Some(message),
            Some(Ok(opened)) => self.show_opened(opened),
        }
        self.opening = None;
        self.state.wants_frame = true;
    }

    fn show_opened(&mut self, opened: Opened) {
        let kept_take = self.end_take().then(|| self.last_said().to_owned());
        self.session = opened.session;
        self.renderer = opened.renderer;
        self.notes_said = self.session.notes.len();
        self.hand = None;
        self.drag = Drag::Nothing;
        self.reset_camera();
        self.state.begin(opened.name.as_deref(), &self.session);
        if let Some(kept) = kept_take {
            self.state.message = format!("{kept}\n{}", self.state.message);
        }
        self.history = History::default();
        self.push = PushCurve::default();
        self.section = None;
        self.light_error.forget();
        self.screen.show_picture(self.renderer.picture_view());
    }

    fn rebuild(&mut self) -> Result<(), AppError> {
        self.renderer = self.renderer.rebuilt(&self.session)?;
        self.light_error.forget();
        self.screen.show_picture(self.renderer.picture_view());
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
            let context = self.screen.egui.egui_ctx();
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
}
