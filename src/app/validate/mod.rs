//! `palpate validate`: reference scenes rendered by the passes of a frame, and how far they are from the truth.

mod format;
mod scene;
mod score;

pub use scene::ReferenceScene;
pub use score::{full_reference as read_full_reference, reference as read_reference};

use super::{AppError, Outcome, Still, VERSION_COMMIT, VERSION_NUMBER, say::say};
use crate::gpu::Gpu;
use crate::measure::files::{create_folder, write, write_npy};
use crate::measure::page::{Block, Page, Section, Table};
use crate::measure::radiance::{Picture, rel_rmse_beyond_noise};
use crate::measure::stats::Stats;
use crate::scene::{Multiple, SurfaceSection};
use score::{FullErrors, Goals, Scored};
use serde_json::json;
use std::path::{Path, PathBuf};

/// Pictures of a scene that are timed.
const TIMED_FRAMES: usize = 5;

/// What `palpate validate` was told.
#[derive(Clone, Debug)]
pub struct ValidateOptions {
    /// Folder with `scenes/*.json`.
    pub dir: PathBuf,
    /// Folder that is written into.
    pub out: PathBuf,
    /// Overrides of the surface and the light path.
    pub sets: Vec<String>,
}

/// Renders all scenes of the folder, writes their pictures and scores, and checks them against its goals.
///
/// # Errors
///
/// [`AppError`] naming the file, the place in it and what to do, or the GPU.
pub fn validate(options: &ValidateOptions) -> Result<Outcome, AppError> {
    let files = folder_scenes(&options.dir)?;
    let goals = Goals::of_folder(&options.dir)?;
    // Everything is read before anything is drawn, so that a broken file costs no time.
    let scenes = files
        .iter()
        .map(|file| ReferenceScene::read(&options.dir, file, &options.sets))
        .collect::<Result<Vec<_>, _>>()?;
    let gpu = Gpu::headless()?;
    create_folder(&options.out)?;
    let mut rows = Vec::new();
    for scene in &scenes {
        eprintln!("{}", scene.name);
        rows.push(rendered(&gpu, scene, &goals, &options.out)?);
    }
    let surface = &scenes[0].scene.surface;
    write_all(&options.out, &gpu.adapter, surface, &rows)?;
    let missed = rows.iter().filter(|row| row.missed()).count();
    let met = rows.iter().filter(|row| row.goal.is_some()).count() - missed;
    let absent = goals.without_scene(&rows);
    for name in &absent {
        let scenes = options.dir.join("scenes");
        say(&format!(
            "{name}: a goal without a scene: add {} or take the goal out\n",
            scenes.join(format!("{name}.json")).display()
        ));
    }
    let missed = missed + absent.len();
    say(&format!("{met} goals met, {missed} missed\n"));
    Ok(if missed == 0 {
        Outcome::Done
    } else {
        Outcome::Differs
    })
}

/// The scene files of `dir`, by name.
///
/// # Errors
///
/// [`AppError::Usage`] if there are none.
pub fn folder_scenes(dir: &Path) -> Result<Vec<PathBuf>, AppError> {
    let folder = dir.join("scenes");
    let listed = std::fs::read_dir(&folder).map_err(|source| AppError::Read {
        path: folder.display().to_string(),
        source,
    })?;
    let mut files: Vec<PathBuf> = listed
        .filter_map(Result::ok)
        .map(|entry| entry.path())
        .filter(|path| path.extension().is_some_and(|ending| ending == "json"))
        .collect();
    files.sort();
    if files.is_empty() {
        return Err(AppError::Usage(format!(
            "{} holds no scenes: name a folder that has scenes/*.json",
            folder.display()
        )));
    }
    Ok(files)
}

fn rendered(
    gpu: &Gpu,
    scene: &ReferenceScene,
    goals: &Goals,
    out: &Path,
) -> Result<Scored, AppError> {
    let mut still = Still::new(
        gpu,
        &scene.scene,
        &scene.mesh,
        &scene.maps,
        scene.view,
        scene.size,
    )?;
    let (mut surface_ms, mut frame_ms) = (Vec::new(), Vec::new());
    for _ in 0..TIMED_FRAMES {
        let passes = still.draw()?;
        frame_ms.push(passes.iter().map(|pass| pass.gpu_ms).sum::<f32>());
        let own = passes.iter().find(|pass| pass.name == "subsurface");
        surface_ms.extend(own.map(|pass| pass.gpu_ms));
    }
    let rgb = still.radiance()?;
    let [width, height] = scene.size;
    write_npy(
        &out.join(format!("{}.npy", scene.name)),
        &[u64::from(height), u64::from(width), 3],
        &rgb,
    )?;
    let full = full_errors(gpu, scene, &rgb, out)?;
    let median = |values: Vec<f32>| Stats::of(values).map(|stats| stats.p50);
    Ok(Scored {
        name: scene.name.clone(),
        scores: score::scores(scene, &rgb)?,
        goal: goals.of(&scene.name),
        full,
        surface_ms: median(surface_ms),
        frame_ms: median(frame_ms),
    })
}

/// How far the picture `once` is from light of all orders, and one with what scattered more often, which is written into
/// `full` below `out`; `None` where there is no such reference.
fn full_errors(
    gpu: &Gpu,
    scene: &ReferenceScene,
    once: &[f32],
    out: &Path,
) -> Result<Option<FullErrors>, AppError> {
    let Some((reference, noise)) = score::full_reference(scene)? else {
        return Ok(None);
    };
    let mut often = scene.scene.clone();
    often.surface.multiple = Multiple::Calibrated;
    often.surface.multiple_scattering = 1.0;
    let mut still = Still::new(
        gpu,
        &often,
        &scene.mesh,
        &scene.maps,
        scene.view,
        scene.size,
    )?;
    still.draw()?;
    let rgb = still.radiance()?;
    let folder = out.join("full");
    create_folder(&folder)?;
    let [width, height] = scene.size;
    write_npy(
        &folder.join(format!("{}.npy", scene.name)),
        &[u64::from(height), u64::from(width), 3],
        &rgb,
    )?;
    let error = |rgb: &[f32]| {
        let size = scene.size.map(|side| side as usize);
        rel_rmse_beyond_noise(Picture { size, rgb }, &reference, &noise)
    };
    Ok(Some(FullErrors {
        once: error(once),
        calibrated: error(&rgb),
    }))
}

fn write_all(
    out: &Path,
    adapter: &str,
    surface: &SurfaceSection,
    rows: &[Scored],
) -> Result<(), AppError> {
    let table = Table {
        head: score::HEAD.map(str::to_owned).to_vec(),
        rows: rows.iter().map(Scored::cells).collect(),
    };
    say(&table.text());
    let mut csv = csv::Writer::from_writer(Vec::new());
    let lines = std::iter::once(&table.head).chain(&table.rows);
    for line in lines {
        csv.write_record(line).expect("memory takes every record");
    }
    let csv = csv.into_inner().expect("memory takes every record");
    write(&out.join("validate.csv"), &csv)?;
    let document = json!({
        "version": VERSION_NUMBER,
        "commit": VERSION_COMMIT,
        "adapter": adapter,
        "quadrature": surface.quadrature,
        "samples": surface.samples,
        "scenes": rows.iter().map(Scored::json).collect::<Vec<_>>(),
    });
    let text = serde_json::to_string_pretty(&document).expect("it has string keys");
    write(&out.join("validate.json"), text.as_bytes())?;
    let page = Page {
        title: "Radiance against reference pictures".to_owned(),
        subtitle: format!("palpate {VERSION_NUMBER} ({VERSION_COMMIT}), {adapter}"),
        lead: "Light that is scattered once, rendered by the passes of a frame without film, room light and tone \
               map, against reference pictures. Errors are relative RMS over the object less its outermost pixels. The columns \
               \"all\" compare with light of all orders, less the noise of that reference: light scattered once, and with \
               what scattered more often from the coefficients of the layers."
            .to_owned(),
        figures: Vec::new(),
        sections: vec![Section {
            title: "Scenes".to_owned(),
            blocks: vec![Block::Table(table)],
        }],
    };
    Ok(page.write(&out.join("report.html"))?)
}
