//! The replay: a scene's script without a window, and the files it leaves.

use super::record::Recording;
use super::renderer::{Frame, Renderer};
use super::{AppError, Outcome, Session, dump, load, thread_count};
use crate::gpu::Gpu;
use crate::measure::against::compare_runs;
use crate::measure::files::{create_folder, encode_png, write};
use crate::measure::pictures::PictureTolerance;
use crate::measure::preview::Preview;
use crate::measure::states::{Nearness, States};
use crate::scene::Scene;
use indicatif::{ProgressBar, ProgressStyle};
use std::path::{Path, PathBuf};
use std::time::Instant;

/// Positions may differ by this much between machines: their fused multiply-adds differ, and a contact
/// that closes a substep later moves a point by microns. A frame too late differs by a hundred times more.
const NEARNESS: Nearness = Nearness::Within(2e-5);

/// Software rasterizers of other versions round otherwise by a level or two, and move an outline by a pixel.
const PICTURE_TOLERANCE: PictureTolerance = PictureTolerance {
    channel: 8,
    share: 0.002,
};

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
        return Err(AppError::Usage(format!(
            "--dump {late} is past the last frame, {frames}"
        )));
    }
    if !options.render && !options.dumps.is_empty() {
        return Err(AppError::Usage(
            "--dump writes what the shaders made, so it can't go with --no-render".to_owned(),
        ));
    }
    if let Some(recorded) = &options.against {
        check_recording(recorded, &options.out)?;
    }
    let mut run = Run::new(scene, thread_count(options.threads), options)?;
    run.all_frames(options)?;
    let output = &run.session.scene.output;
    let picture_s = f64::from(output.png_every) * f64::from(run.session.scene.solver.timestep_s);
    run.preview
        .write(&options.out.join("preview.apng"), picture_s)?;
    run.recording.write(
        &options.out,
        &options.sets,
        &run.session,
        run.renderer.as_ref(),
    )?;
    match &options.against {
        None => Ok(Outcome::Done),
        Some(recorded) => compare(recorded, &options.out),
    }
}

/// Refuses, before anything runs, a recording that can't be compared with what goes into `out`.
fn check_recording(recorded: &Path, out: &Path) -> Result<(), AppError> {
    States::read(recorded)?;
    let real = |folder: &Path| folder.canonicalize().ok();
    if real(recorded) == real(out) {
        return Err(AppError::Usage(format!(
            "--against and --out are both {}, so the run would replace what it is compared with: \
             give --out another folder",
            out.display()
        )));
    }
    Ok(())
}

/// Says how the run in `now` differs from the one in `recorded`.
fn compare(recorded: &Path, now: &Path) -> Result<Outcome, AppError> {
    let verdict = compare_runs(recorded, now, NEARNESS, PICTURE_TOLERANCE)?;
    for line in &verdict.failures {
        eprintln!("differs: {line}");
    }
    for line in &verdict.agreements {
        eprintln!("agrees: {line}");
    }
    Ok(if verdict.agrees() {
        Outcome::Done
    } else {
        Outcome::Differs
    })
}

/// A replay under way.
struct Run {
    session: Session,
    renderer: Option<Renderer>,
    recording: Recording,
    preview: Preview,
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
        create_folder(&options.out)?;
        remove_leftovers(&options.out)?;
        Ok(Self {
            recording: Recording::new(options.scene.clone(), threads),
            preview: Preview::default(),
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
        self.rest_frame(options)?;
        for frame in 1..=output.frames {
            let start = Instant::now();
            let told = self.session.notes.len();
            let tick = self.session.tick();
            for note in &self.session.notes[told..] {
                bar.suspend(|| eprintln!("{}: {note}", options.scene));
            }
            let drawn = self.draw()?;
            self.recording.add(&self.session, start, &tick, drawn);
            let is_last = frame == output.frames;
            if is_last || frame % sample_every(output.frames) == 0 {
                self.recording.sample(&self.session);
            }
            if is_last || (output.png_every > 0 && frame % output.png_every == 0) {
                self.picture(&options.out)?;
            }
            if options.dumps.contains(&frame) {
                self.dump(&options.out)?;
            }
            bar.inc(1);
        }
        bar.finish_and_clear();
        Ok(())
    }

    /// Frame 0, the body at rest: sampled, drawn, dumped where asked for, but not logged. It is the warm-up:
    /// what an adapter puts off until it first draws is done here.
    fn rest_frame(&mut self, options: &ReplayOptions) -> Result<(), AppError> {
        self.recording.sample(&self.session);
        let wants_picture = self.session.scene.output.png_every > 0;
        let wants_dump = options.dumps.contains(&0);
        if self.renderer.is_some() {
            self.draw()?;
            self.recording.first_frame_done();
        }
        if wants_picture {
            self.picture(&options.out)?;
        }
        if wants_dump {
            self.dump(&options.out)?;
        }
        Ok(())
    }

    fn draw(&mut self) -> Result<Frame, AppError> {
        let Some(renderer) = &mut self.renderer else {
            return Ok(Frame::default());
        };
        let orbit = renderer.scene_orbit(&self.session);
        renderer.draw(
            self.session.points(),
            self.session.simulation().point_volumes(),
            &orbit,
            &self.session.visible_tools(),
        )
    }

    fn picture(&mut self, out: &Path) -> Result<(), AppError> {
        if let Some(renderer) = &self.renderer {
            let file = out.join(format!("frame-{:04}.png", self.session.frame()));
            let picture = renderer.picture()?;
            let png = encode_png(&file, &picture)?;
            write(&file, &png)?;
            self.preview.add(&picture);
            self.recording.add_picture(self.session.frame(), png);
        }
        Ok(())
    }

    fn dump(&self, out: &Path) -> Result<(), AppError> {
        match &self.renderer {
            Some(renderer) => {
                let folder = out.join(format!("dump-{:04}", self.session.frame()));
                dump::write_dump(&folder, &self.session, renderer)
            }
            None => Ok(()),
        }
    }
}

/// Takes away the pictures of an earlier run, which would stand beside this one's files as if they were
/// its own, and what a run that was killed had not finished.
fn remove_leftovers(out: &Path) -> Result<(), AppError> {
    let failed = |source| AppError::Read {
        path: out.display().to_string(),
        source,
    };
    for entry in std::fs::read_dir(out).map_err(failed)? {
        let path = entry.map_err(failed)?.path();
        let is_leftover = path
            .file_name()
            .and_then(|name| name.to_str())
            .is_some_and(|name| is_run_picture(name) || is_unfinished(name));
        if is_leftover {
            std::fs::remove_file(&path).map_err(failed)?;
        }
    }
    Ok(())
}

/// Whether a replay gives its pictures such names.
fn is_run_picture(name: &str) -> bool {
    let number = name
        .strip_prefix("frame-")
        .and_then(|rest| rest.strip_suffix(".png"));
    name == "preview.apng"
        || number.is_some_and(|number| number.bytes().all(|b| b.is_ascii_digit()))
}

/// Whether a file that was being written has such a name.
fn is_unfinished(name: &str) -> bool {
    let process = (name.strip_suffix(".partial")).and_then(|rest| Some(rest.rsplit_once('.')?.1));
    process.is_some_and(|process| process.bytes().all(|b| b.is_ascii_digit()))
}

/// Frames between two samples of the states: about ten samples a replay, whatever its length.
fn sample_every(frames: u32) -> u32 {
    frames.div_ceil(10).max(1)
}
