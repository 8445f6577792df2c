//! The replay: a scene's script without a window, and the files it leaves.

use super::renderer::{Frame, Renderer};
use super::session::{Session, Tick};
use super::{AppError, Outcome, dump, load, record, thread_count};
use crate::gpu::Gpu;
use crate::measure::{FrameRecord, write_png};
use crate::scene::Scene;
use indicatif::{ProgressBar, ProgressStyle};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// What `palpate replay` was told.
#[derive(Clone, Debug)]
pub struct ReplayOptions {
    /// Bundled scene or file.
    pub scene: String,
    /// `--set` overrides.
    pub sets: Vec<String>,
    /// Folder that is written into.
    pub out: PathBuf,
    /// Frames, instead of the scene's.
    pub frames: Option<u32>,
    /// Picture size [px], instead of the scene's.
    pub size: Option<[u32; 2]>,
    /// A picture every so many frames, instead of the scene's.
    pub png_every: Option<u32>,
    /// Frames to dump.
    pub dumps: Vec<u32>,
    /// Threads of the simulation.
    pub threads: Option<u32>,
    /// Whether to draw; without, no GPU is needed.
    pub render: bool,
    /// Recording to compare with.
    pub against: Option<PathBuf>,
}

impl Default for ReplayOptions {
    fn default() -> Self {
        Self {
            scene: super::DEFAULT_SCENE.to_owned(),
            sets: Vec::new(),
            out: PathBuf::from("out"),
            frames: None,
            size: None,
            png_every: None,
            dumps: Vec::new(),
            threads: None,
            render: true,
            against: None,
        }
    }
}

/// Runs a scene's script and writes what it did. Frame `n` is the state after `n` time steps.
///
/// # Errors
///
/// [`AppError`] naming the file, the place in it and the remedy.
pub fn replay(options: &ReplayOptions) -> Result<Outcome, AppError> {
    let mut scene = load::scene(&options.scene, &options.sets)?;
    scene.output.frames = options.frames.unwrap_or(scene.output.frames);
    scene.output.size = options.size.unwrap_or(scene.output.size);
    scene.output.png_every = options.png_every.unwrap_or(scene.output.png_every);
    let frames = scene.output.frames;
    if let Some(late) = options.dumps.iter().find(|&&frame| frame > frames) {
        return Err(AppError::Body(format!(
            "--dump {late} is past the last frame, {frames}"
        )));
    }
    if !options.render && !options.dumps.is_empty() {
        return Err(AppError::Body(
            "--dump writes what the shaders made, so it can't go with --no-render".to_owned(),
        ));
    }
    let threads = thread_count(options.threads);
    let mut run = Run::new(scene, threads, options)?;
    run.all_frames(options)?;
    let recording = run.finish(options)?;
    match &options.against {
        None => Ok(Outcome::Done),
        Some(folder) => record::compare(&recording, &options.out, folder),
    }
}

/// A replay under way.
struct Run {
    session: Session,
    renderer: Option<Renderer>,
    recording: record::Recording,
}

impl Run {
    fn new(scene: Scene, threads: usize, options: &ReplayOptions) -> Result<Self, AppError> {
        let session = Session::new(scene, threads)?;
        for note in &session.notes {
            eprintln!("{}: {note}", options.scene);
        }
        let renderer = if options.render {
            let gpu = Gpu::headless()?;
            eprintln!("drawing on {}", gpu.adapter);
            Some(Renderer::new(gpu, &session, session.scene.output.size)?)
        } else {
            None
        };
        crate::measure::create_folder(&options.out)?;
        Ok(Self {
            recording: record::Recording::new(&options.scene, &session, renderer.as_ref(), threads),
            session,
            renderer,
        })
    }

    fn all_frames(&mut self, options: &ReplayOptions) -> Result<(), AppError> {
        let output = self.session.scene.output.clone();
        let bar = ProgressBar::new(u64::from(output.frames)).with_style(
            ProgressStyle::with_template("{bar:40} {pos}/{len} frames, {eta} left")
                .expect("a sound template"),
        );
        if output.png_every > 0 || options.dumps.contains(&0) {
            self.rest_frame(options)?;
        }
        let triangles = self.session.mesh.point_triangles();
        self.recording.sample(&self.session, &triangles);
        for frame in 1..=output.frames {
            let start = Instant::now();
            let tick = self.session.tick();
            let drawn = self.draw(&tick)?;
            let wall_ms = start.elapsed().as_secs_f32() * 1e3;
            self.recording.add(self.record(frame, wall_ms, &tick, drawn.as_ref()));
            if self.recording.wants_sample(frame, output.frames) {
                self.recording.sample(&self.session, &triangles);
            }
            let is_last = frame == output.frames;
            if is_last || (output.png_every > 0 && frame % output.png_every == 0) {
                self.picture(&options.out, frame)?;
            }
            if options.dumps.contains(&frame) {
                self.dump(&options.out, frame)?;
            }
            bar.inc(1);
        }
        bar.finish_and_clear();
        Ok(())
    }

    /// Frame 0, the body at rest: drawn and dumped, but not logged.
    fn rest_frame(&mut self, options: &ReplayOptions) -> Result<(), AppError> {
        if let Some(renderer) = &mut self.renderer {
            let orbit = renderer.scene_orbit(&self.session);
            renderer.draw(self.session.points(), &orbit, &self.session.tools_now())?;
            if self.session.scene.output.png_every > 0 {
                self.picture(&options.out, 0)?;
            }
            if options.dumps.contains(&0) {
                self.dump(&options.out, 0)?;
            }
        }
        Ok(())
    }

    fn draw(&mut self, tick: &Tick) -> Result<Option<Frame>, AppError> {
        let Some(renderer) = &mut self.renderer else {
            return Ok(None);
        };
        let orbit = renderer.scene_orbit(&self.session);
        Ok(Some(renderer.draw(
            self.session.points(),
            &orbit,
            &tick.tools,
        )?))
    }

    fn record(
        &self,
        frame: u32,
        wall_ms: f32,
        tick: &Tick,
        drawn: Option<&Frame>,
    ) -> record::Row {
        record::Row {
            frame: FrameRecord::default(),
            wall_ms,
            tick: tick.clone(),
            drawn: drawn.cloned(),
            number: frame,
        }
    }

    fn picture(&mut self, out: &Path, frame: u32) -> Result<(), AppError> {
        if let Some(renderer) = &self.renderer {
            let name = format!("frame-{frame:04}.png");
            write_png(&out.join(&name), &renderer.picture()?)?;
            self.recording.add_picture(name);
        }
        Ok(())
    }

    fn dump(&self, out: &Path, frame: u32) -> Result<(), AppError> {
        match &self.renderer {
            Some(renderer) => dump::write(
                &out.join(format!("dump-{frame:04}")),
                frame,
                &self.session,
                renderer,
            ),
            None => Ok(()),
        }
    }
}
