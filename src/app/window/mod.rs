//! The window: winit events in, frames out. Everything that is computed lives in the session.

mod input;
mod opening;
mod saving;
mod screen;
mod shown;

use super::replay::{ReplayOptions, replay};
use super::{AppError, Outcome, Session, load, thread_count};
use shown::Shown;
use std::path::PathBuf;
use std::time::{Duration, Instant};
use winit::application::ApplicationHandler;
use winit::event::WindowEvent;
use winit::event_loop::{ActiveEventLoop, ControlFlow, EventLoop};
use winit::window::WindowId;

/// How often a sleeping window looks whether something has come in that it waits for.
const LOOK_AGAIN: Duration = Duration::from_millis(100);

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
        if options.log.is_some() {
            eprintln!("palpate: --log is of a window; out/frames.csv has the frames of the replay");
        }
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
        logs: options.log.is_some(),
        shown: None,
        failed: None,
    };
    event_loop
        .run_app(&mut app)
        .map_err(|e| AppError::Window(e.to_string()))?;
    if let Some(shown) = &mut app.shown
        && shown.end_take()
    {
        eprintln!("palpate: {}", shown.last_said());
    }
    if let (Some(shown), Some(log)) = (&app.shown, &options.log) {
        shown.write_log(log)?;
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
    logs: bool,
    shown: Option<Shown>,
    failed: Option<AppError>,
}

impl ApplicationHandler for App {
    fn resumed(&mut self, event_loop: &ActiveEventLoop) {
        let Some(session) = self.session.take() else {
            return;
        };
        match Shown::new(
            event_loop,
            session,
            &self.scene_name,
            self.threads,
            self.logs,
        ) {
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
                let drawn = shown.frame();
                if shown.wants_to_close || drawn.is_err() {
                    self.failed = drawn.err();
                    event_loop.exit();
                }
            }
            WindowEvent::Resized(size) => shown.resize(size),
            event => shown.input(&event),
        }
    }

    fn about_to_wait(&mut self, event_loop: &ActiveEventLoop) {
        if let Some(shown) = &mut self.shown {
            if shown.idle() {
                event_loop.set_control_flow(ControlFlow::WaitUntil(Instant::now() + LOOK_AGAIN));
            } else {
                event_loop.set_control_flow(ControlFlow::Poll);
                shown.wake();
            }
        }
    }
}
