//! The study `surfaces`: every surface against light of all orders, and what it costs at 800 × 600.
//!
//! Reference scenes are compared with their pictures, a ball of one tissue lit from three sides with our own random walks.
//! Surfaces after Green and Oat have no scale of their own, so the headline is the error after the one factor that makes it
//! smallest. There is neither room light nor film.

use super::Study;
use super::findings::{Findings, scene_charts, told};
use super::sweep::{Cost, Row, Sweep, Verdict, finite};
use crate::app::{AppError, ReferenceScene, Still, folder_scenes, load_scene, read_full_reference};
use crate::geom::SurfaceMesh;
use crate::geom::lattice::sphere;
use crate::geom::paint::TissueMaps;
use crate::geom::plane::LightPathMethod;
use crate::geom::unwrap::unwrap;
use crate::gpu::Gpu;
use crate::measure::page::{Block, Table};
use crate::measure::radiance::eroded;
use crate::measure::scatter::{Cloud, Point, ScatterChart};
use crate::measure::stats::Stats;
use crate::optics::diffusion::mean_distance_m;
use crate::optics::multiple::reflectance;
use crate::optics::tone::srgb_from_linear;
use crate::optics::{Layer, OpticalTissue};
use crate::passes::geometry::Geometry;
use crate::passes::tangents::Tangents;
use crate::passes::view::View;
use crate::reference::{HalfLine, Rays, WalkTissue, walked};
use crate::scene::{LightSection, Multiple, Quadrature, Scene, SurfaceKind};
use glam::{DVec3, Vec3};
use image::{DynamicImage, Rgba, RgbaImage};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

/// Pictures are timed at this size [px].
const TIMED_PX: [u32; 2] = [800, 600];
const FRAMES: usize = 7;
/// Side of the picture that is walked [px].
const WALKED_PX: u32 = 48;
/// Errors up to which a point is fine, and degraded.
const FINE: f64 = 0.1;
const DEGRADED: f64 = 0.3;
/// Below this share of its brightest a reference counts as dim: the terminator and beyond.
const DIM: f64 = 0.25;
const CHART_PX: (f64, f64) = (560.0, 340.0);
/// Passes that every surface has.
const SHARED_PASSES: [&str; 2] = [Tangents::NAME, Geometry::NAME];
/// How deep a march may go that ends by itself [m].
const DEEPEST_M: f32 = 1.0;

/// What is swept.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    pub surface: Vec<Method>,
    pub ball: BallPlan,
    /// A folder of reference scenes; "" for none.
    pub truth: String,
}

/// The ball of one tissue.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BallPlan {
    pub light: Vec<LitFrom>,
    pub tissue: OpticalTissue,
    pub radius_m: f32,
    /// Random walks a pixel and colour.
    pub walks: u32,
}

/// Where the ball's light comes from, seen from the eye.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LitFrom {
    Front,
    Side,
    Back,
}

impl LitFrom {
    const ALL: [Self; 3] = [Self::Front, Self::Side, Self::Back];

    fn scene(self) -> &'static str {
        match self {
            Self::Front => "ball-front",
            Self::Side => "ball-side",
            Self::Back => "ball-back",
        }
    }

    fn to_light(self) -> Vec3 {
        match self {
            Self::Front => Vec3::new(0.2, 0.3, 1.0),
            Self::Side => Vec3::new(1.0, 0.1, 0.15),
            Self::Back => Vec3::new(0.25, 0.2, -1.0),
        }
        .normalize()
    }
}

/// The surfaces.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    Plain,
    Wrap,
    Absorption,
    Diffusion,
    Gooey,
    /// `subsurface`, light scattered once: as the papers march, 100 samples by planes.
    Published,
    /// Nine samples by depth maps.
    ClosedForm,
    /// Eight.
    ByLayer,
    /// The same, with what scatters more often from the layers.
    Calibrated,
}

impl Method {
    const ALL: [Self; 9] = [
        Self::Plain,
        Self::Wrap,
        Self::Absorption,
        Self::Diffusion,
        Self::Gooey,
        Self::Published,
        Self::ClosedForm,
        Self::ByLayer,
        Self::Calibrated,
    ];

    fn name(self) -> &'static str {
        match self {
            Self::Plain => "plain",
            Self::Wrap => "wrap",
            Self::Absorption => "absorption",
            Self::Diffusion => "diffusion",
            Self::Gooey => "gooey",
            Self::Published => "published",
            Self::ClosedForm => "closed-form",
            Self::ByLayer => "by-layer",
            Self::Calibrated => "calibrated",
        }
    }

    fn kind(self) -> SurfaceKind {
        match self {
            Self::Plain => SurfaceKind::Plain,
            Self::Wrap => SurfaceKind::Wrap,
            Self::Absorption => SurfaceKind::Absorption,
            Self::Diffusion => SurfaceKind::Diffusion,
            Self::Gooey => SurfaceKind::Gooey,
            Self::Published | Self::ClosedForm | Self::ByLayer | Self::Calibrated => {
                SurfaceKind::Subsurface
            }
        }
    }
}

/// One surface on one scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    pub surface: Method,
    pub scene: String,
    /// The file, of a reference scene.
    pub file: Option<PathBuf>,
}

/// What is measured of it; errors are RMS of the difference over RMS of the reference, less the reference's noise.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measures {
    /// After the best factor.
    pub picture_error_rel: Option<f64>,
    /// The same where the reference is below a quarter of its brightest: terminator, rim, far side.
    pub dim_error_rel: Option<f64>,
    /// Without a factor, of surfaces that tell radiance.
    pub absolute_error_rel: Option<f64>,
    /// Standard error of the reference over its RMS.
    pub oracle_noise_rel: Option<f64>,
    /// GPU time of the whole frame, median [ms].
    pub frame_ms_p50: Option<f64>,
    pub oracle: String,
}

/// The study.
pub struct Surfaces {
    gpu: Gpu,
    plan: Plan,
    threads: usize,
    walked: Mutex<HashMap<String, Arc<Oracle>>>,
}

/// A picture of light of all orders.
struct Oracle {
    name: &'static str,
    rgb: Vec<f32>,
    /// Standard error of each number.
    error: Vec<f32>,
    /// Where it is compared.
    mask: Vec<bool>,
}

impl Sweep for Surfaces {
    const STUDY: Study = Study::Surfaces;
    const SIDE_BY_SIDE: bool = false;
    type Plan = Plan;
    type Cell = Cell;
    type Measures = Measures;

    fn plan(quick: bool) -> Plan {
        let truth = std::env::var("PALPATE_SHARED").map(|shared| format!("{shared}/truth"));
        Plan {
            surface: Method::ALL.to_vec(),
            ball: BallPlan {
                light: LitFrom::ALL.to_vec(),
                tissue: OpticalTissue::Heart,
                radius_m: 0.008,
                walks: if quick { 12 } else { 96 },
            },
            truth: if quick {
                String::new()
            } else {
                truth.unwrap_or_default()
            },
        }
    }

    fn cells(plan: &Plan) -> Result<Vec<Cell>, String> {
        let ball = &plan.ball;
        if !(2..=100_000).contains(&ball.walks) {
            return Err(format!(
                "ball.walks = {}: choose from 2 to 100000",
                ball.walks
            ));
        }
        if !(1e-3..=1.0).contains(&ball.radius_m) {
            return Err(format!(
                "ball.radius_m = {}: choose from 0.001 to 1",
                ball.radius_m
            ));
        }
        let own = ball
            .light
            .iter()
            .map(|side| (side.scene().to_owned(), None));
        let mut scenes: Vec<(String, Option<PathBuf>)> = own.collect();
        if !plan.truth.is_empty() {
            let files = folder_scenes(Path::new(&plan.truth)).map_err(|e| e.to_string())?;
            scenes.extend(files.into_iter().map(|file| {
                let name = file.file_stem().unwrap_or_default();
                (name.to_string_lossy().into_owned(), Some(file))
            }));
        }
        let cell = |(scene, file): &(String, Option<PathBuf>), surface| Cell {
            surface,
            scene: scene.clone(),
            file: file.clone(),
        };
        Ok(scenes
            .iter()
            .flat_map(|scene| plan.surface.iter().map(move |&method| cell(scene, method)))
            .collect())
    }

    fn adapter() -> Result<String, AppError> {
        Ok(Gpu::headless().map_err(AppError::Gpu)?.adapter)
    }

    fn new(plan: &Plan, _out: &Path, threads: usize) -> Result<Self, AppError> {
        Ok(Self {
            gpu: Gpu::headless().map_err(AppError::Gpu)?,
            plan: plan.clone(),
            threads: threads.max(1),
            walked: Mutex::default(),
        })
    }

    fn measure(&self, cell: &Cell) -> Result<Row<Cell, Measures>, AppError> {
        let (stage, oracle) = self.stage(cell)?;
        let scene = drawn_by(&stage.scene, cell.surface);
        let maps = painted(&stage.maps, &scene);
        let still = |size| Still::new(&self.gpu, &scene, &stage.mesh, &maps, stage.view, size);
        let mut small = still(stage.size)?;
        small.draw()?;
        let got = small.radiance()?;
        drop(small);
        let mut large = still(TIMED_PX)?;
        let (mut own_ms, mut frame_ms) = (Vec::new(), Vec::new());
        for _ in 0..FRAMES {
            let passes = large.draw()?;
            frame_ms.push(passes.iter().map(|pass| pass.gpu_ms).sum::<f32>());
            let own = passes
                .iter()
                .filter(|pass| !SHARED_PASSES.contains(&pass.name));
            own_ms.push(own.map(|pass| pass.gpu_ms).sum::<f32>());
        }
        let own = Stats::of(own_ms);
        let off = off(&got, &oracle);
        let is_absolute = cell.surface.kind() == SurfaceKind::Subsurface;
        let measures = Measures {
            picture_error_rel: finite(off.picture),
            dim_error_rel: finite(off.dim),
            absolute_error_rel: finite(off.absolute).filter(|_| is_absolute),
            oracle_noise_rel: finite(off.noise),
            frame_ms_p50: Stats::of(frame_ms).map(|stats| stats.p50),
            oracle: oracle.name.to_owned(),
        };
        Ok(Row {
            cell: cell.clone(),
            verdict: verdict(&measures),
            measures,
            cost: Cost {
                ms_p50: own.as_ref().map(|stats| stats.p50),
                ms_p95: own.as_ref().map(|stats| stats.p95),
            },
        })
    }

    fn findings(rows: &[Row<Cell, Measures>]) -> Findings {
        findings(rows)
    }
}

/// A scene that stands ready to be drawn by any surface.
struct Stage {
    scene: Scene,
    mesh: SurfaceMesh,
    maps: TissueMaps,
    view: View,
    size: [u32; 2],
}

impl Surfaces {
    fn stage(&self, cell: &Cell) -> Result<(Stage, Arc<Oracle>), AppError> {
        let Some(file) = &cell.file else {
            let side = LitFrom::ALL
                .into_iter()
                .find(|side| side.scene() == cell.scene);
            let side = side.ok_or_else(|| AppError::Usage(format!("no scene {}", cell.scene)))?;
            let stage = ball(&self.plan.ball, side, cell.surface)?;
            let mut walked = self.walked.lock().expect("no cell panics");
            let oracle = walked
                .entry(cell.scene.clone())
                .or_insert_with(|| Arc::new(walked_picture(&stage, &self.plan.ball, self.threads)));
            return Ok((stage, Arc::clone(oracle)));
        };
        let mut sets = Vec::new();
        if cell.surface == Method::Published {
            // So that it is made ready as the papers' march wants it.
            sets.push("surface.quadrature=published".to_owned());
        }
        let read = ReferenceScene::read(Path::new(&self.plan.truth), file, &sets)?;
        let Some((reference, error)) = read_full_reference(&read)? else {
            return Err(AppError::Usage(format!(
                "{}: it has no reference picture of all orders (arrays `full`, `full_se`)",
                file.display()
            )));
        };
        let oracle = Oracle {
            name: "reference picture",
            mask: eroded(&reference.mask, reference.size),
            rgb: reference.rgb,
            error,
        };
        let stage = Stage {
            scene: read.scene,
            mesh: read.mesh,
            maps: read.maps,
            view: read.view,
            size: read.size,
        };
        Ok((stage, Arc::new(oracle)))
    }
}

/// `scene` drawn by `method`, whose lengths follow from the tissue.
fn drawn_by(scene: &Scene, method: Method) -> Scene {
    let mut scene = scene.clone();
    let first = Layer::from(scene.surface.layers[0]);
    let wander_m = mean_distance_m(&first).max_element();
    let surface = &mut scene.surface;
    surface.kind = method.kind();
    surface.room_light = 0.0;
    surface.wetness = 0.0;
    surface.relief = 0.0;
    surface.color_blend = 0.0;
    (surface.multiple, surface.multiple_scattering) = match method {
        Method::Calibrated => (Multiple::Calibrated, 1.0),
        _ => (Multiple::Wrapped, 0.0),
    };
    surface.diffusion.layer = 1;
    surface.absorption.disc_radius_m = 0.5 * wander_m;
    surface.absorption.grow_m = 0.1 * wander_m;
    surface.blur_radius_m = wander_m;
    surface.layer_distance_m = 0.5 * wander_m;
    (surface.quadrature, surface.samples) = match method {
        Method::Published => (Quadrature::Published, 100),
        Method::ClosedForm => (Quadrature::ClosedForm, 9),
        _ => (Quadrature::ByLayer, 8),
    };
    scene.light_path.method = match method {
        Method::Published => LightPathMethod::Full,
        _ => LightPathMethod::DepthMap,
    };
    scene
}

/// The layers of `maps`, and for surfaces that take their colour from a map what the tissue throws back.
fn painted(maps: &TissueMaps, scene: &Scene) -> TissueMaps {
    let layers = &scene.surface.layers;
    let sum: Vec3 = layers.iter().map(|&layer| reflectance(&layer.into())).sum();
    let [r, g, b] = (sum / layers.len() as f32)
        .to_array()
        .map(|v| (255.0 * srgb_from_linear(v)).round() as u8);
    let even = || RgbaImage::from_pixel(4, 4, Rgba([r, g, b, 255]));
    TissueMaps {
        outer: even(),
        inner: even(),
        ..maps.clone()
    }
}

fn ball(plan: &BallPlan, side: LitFrom, method: Method) -> Result<Stage, AppError> {
    let mut scene = load_scene("slab", &[])?;
    let layer = plan.tissue.layer();
    scene.surface.layers = vec![layer.into()];
    scene.surface.layer_depth_max_m = match method {
        // Where a hundredth of the light is left in the clearest colour.
        Method::Published => 100_f32.ln() / layer.extinction_per_m().min_element(),
        _ => DEEPEST_M,
    };
    scene.light_path.radius_m = Some(10_f32.ln() / layer.extinction_per_m().max_element());
    scene.lights = vec![LightSection {
        toward: Some(side.to_light()),
        at_m: None,
        at_share: None,
        irradiance_w_m2: [1.0; 3],
        shadow: false,
    }];
    let (points, triangles) = sphere(plan.radius_m);
    let blank = || RgbaImage::from_pixel(4, 4, Rgba([128, 128, 255, 255]));
    Ok(Stage {
        scene,
        mesh: unwrap(&points, &triangles),
        maps: TissueMaps {
            size_px: 4,
            outer: blank(),
            normal: blank(),
            inner: blank(),
            layers: vec![DynamicImage::ImageRgba8(RgbaImage::from_pixel(
                4,
                4,
                Rgba([255; 4]),
            ))],
        },
        view: View {
            eye: 4.4 * plan.radius_m * Vec3::Z,
            target: Vec3::ZERO,
            up: Vec3::Y,
            fov_y: 0.5,
        },
        size: [WALKED_PX; 2],
    })
}

/// The picture of a stage of one layer by random walks.
fn walked_picture(stage: &Stage, plan: &BallPlan, threads: usize) -> Oracle {
    eprintln!("walking {} times a pixel and colour", plan.walks);
    let mesh = &stage.mesh;
    let points: Vec<DVec3> = mesh.points.iter().map(|p| p.as_dvec3()).collect();
    let rays = Rays::new(&points, &mesh.point_triangles());
    let eye = stage.view.eye.as_dvec3();
    let entry = |far: Vec3| -> Option<HalfLine> {
        let along = (far.as_dvec3() - eye).normalize();
        let (distance, _) = rays.first((eye, along))?;
        Some((eye + distance * along, along))
    };
    let pixels = stage.view.behind_pixels(stage.size);
    let entries: Vec<Option<HalfLine>> = pixels.into_iter().map(entry).collect();
    let covered: Vec<bool> = entries.iter().map(Option::is_some).collect();
    let lines: Vec<HalfLine> = entries.iter().flatten().copied().collect();
    let light = &stage.scene.lights[0];
    let to_light = light
        .toward
        .expect("the ball's light is far")
        .as_dvec3()
        .normalize();
    let layer = Layer::from(stage.scene.surface.layers[0]);
    let pixels = entries.len();
    let (mut rgb, mut error) = (vec![0.0; 3 * pixels], vec![0.0; 3 * pixels]);
    for channel in 0..3 {
        let tissue = WalkTissue {
            scattering_per_m: f64::from(layer.scattering_per_m[channel]),
            extinction_per_m: f64::from(layer.extinction_per_m()[channel]),
            asymmetry: f64::from(layer.asymmetry),
        };
        let found = walked(&rays, &tissue, to_light, &lines, plan.walks, threads);
        let places = (0..pixels).filter(|&i| covered[i]);
        for (i, walked) in places.zip(found) {
            rgb[3 * i + channel] = walked.full as f32;
            error[3 * i + channel] = walked.error as f32;
        }
    }
    Oracle {
        name: "random walks",
        mask: eroded(&covered, stage.size.map(|side| side as usize)),
        rgb,
        error,
    }
}

/// Errors of a picture.
struct Off {
    picture: f64,
    dim: f64,
    absolute: f64,
    noise: f64,
}

fn off(got: &[f32], oracle: &Oracle) -> Off {
    let places: Vec<usize> = (0..got.len()).filter(|i| oracle.mask[i / 3]).collect();
    let value = |list: &[f32], i: usize| f64::from(list[i]);
    let sum =
        |places: &[usize], f: &dyn Fn(usize) -> f64| places.iter().map(|&i| f(i)).sum::<f64>();
    let exact = |i: usize| value(&oracle.rgb, i);
    let test = |i: usize| value(got, i);
    let noise = |i: usize| value(&oracle.error, i).powi(2);
    let gain =
        sum(&places, &|i| test(i) * exact(i)) / sum(&places, &|i| test(i).powi(2)).max(1e-300);
    let error = |places: &[usize], gain: f64| {
        let difference = sum(places, &|i| (gain * test(i) - exact(i)).powi(2) - noise(i));
        (difference.max(0.0) / sum(places, &|i| exact(i).powi(2)).max(1e-300)).sqrt()
    };
    let bright = |i: usize| (0..3).map(|c| exact(i / 3 * 3 + c)).sum::<f64>();
    let mut sorted: Vec<f64> = places.iter().map(|&i| bright(i)).collect();
    sorted.sort_by(f64::total_cmp);
    // The brightest pixel may be a lucky walk.
    let white = crate::measure::stats::percentile(&sorted, 0.98).unwrap_or(0.0);
    let dim: Vec<usize> = places
        .iter()
        .copied()
        .filter(|&i| bright(i) < DIM * white)
        .collect();
    Off {
        picture: error(&places, gain),
        dim: if dim.is_empty() {
            f64::NAN
        } else {
            error(&dim, gain)
        },
        absolute: error(&places, 1.0),
        noise: (sum(&places, &noise) / sum(&places, &|i| exact(i).powi(2)).max(1e-300)).sqrt(),
    }
}

fn verdict(measures: &Measures) -> Verdict {
    let error_rel = measures.absolute_error_rel.or(measures.picture_error_rel);
    let told = |error| format!("{:.0} % off", 100.0 * error);
    Verdict::of_radiance(error_rel, [FINE, DEGRADED], told)
}

fn findings(rows: &[Row<Cell, Measures>]) -> Findings {
    let head = [
        "scene",
        "surface",
        "error after gain",
        "dim part",
        "absolute",
        "noise",
        "ms",
        "frame ms",
        "state",
    ];
    let line = |row: &Row<Cell, Measures>| {
        vec![
            row.cell.scene.clone(),
            row.cell.surface.name().to_owned(),
            told(row.measures.picture_error_rel),
            told(row.measures.dim_error_rel),
            told(row.measures.absolute_error_rel),
            told(row.measures.oracle_noise_rel),
            told(row.cost.ms_p50),
            told(row.measures.frame_ms_p50),
            row.verdict.state.name().to_owned(),
        ]
    };
    let mut scenes: Vec<&str> = rows.iter().map(|row| row.cell.scene.as_str()).collect();
    scenes.dedup();
    let (svg, charts) = scene_charts(&scenes, |scene| chart(rows, scene));
    Findings {
        svg,
        blocks: vec![
            Block::Paragraph(
                "Every surface against light of all orders, over the GPU time of what it draws at 800 × 600 beyond tangents \
                 and geometry. Errors are after the one factor that makes them smallest; those of `subsurface` without it \
                 stand in the table."
                    .to_owned(),
            ),
            charts,
            Block::Table(Table {
                head: head.map(str::to_owned).to_vec(),
                rows: rows.iter().map(line).collect(),
            }),
        ],
    }
}

const ERROR_RANGE: (f64, f64) = (0.001, 10.0);
const MS_RANGE: (f64, f64) = (1.0, 5000.0);

fn chart(rows: &[Row<Cell, Measures>], scene: &str) -> ScatterChart {
    let cloud = |(look, method): (usize, Method)| Cloud {
        label: method.name().to_owned(),
        look,
        hollow: false,
        joined: false,
        points: (rows.iter())
            .filter(|row| row.cell.scene == scene && row.cell.surface == method)
            .filter_map(|row| {
                Some(Point {
                    x: row.cost.ms_p50?,
                    y: row.measures.picture_error_rel.map(|e| e.max(ERROR_RANGE.0)),
                    label: String::new(),
                    scale: 1.0,
                })
            })
            .collect(),
    };
    ScatterChart {
        size_px: CHART_PX,
        title: scene.to_owned(),
        x_label: "GPU time of the surface [ms]".to_owned(),
        y_label: "relative RMS error after gain".to_owned(),
        x_range: MS_RANGE,
        y_range: ERROR_RANGE,
        clouds: Method::ALL.into_iter().enumerate().map(cloud).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn oracle() -> Oracle {
        let rgb: Vec<f32> = (0..300).map(|i| 0.001 * i as f32).collect();
        Oracle {
            name: "made up",
            error: vec![0.0; rgb.len()],
            mask: vec![true; 100],
            rgb,
        }
    }

    #[test]
    fn a_factor_is_no_error_of_the_picture_and_one_of_the_radiance() {
        let oracle = oracle();
        let twice: Vec<f32> = oracle.rgb.iter().map(|v| 2.0 * v).collect();
        let found = off(&twice, &oracle);
        // Rounding of f32.
        assert!(
            found.picture < 1e-6 && found.dim < 1e-6,
            "{}",
            found.picture
        );
        assert!((found.absolute - 1.0).abs() < 1e-6);
    }

    #[test]
    fn what_is_wrong_in_the_dim_part_alone_is_told_there() {
        let oracle = oracle();
        let wrong: Vec<f32> = (oracle.rgb.iter())
            .map(|&v| if v < 0.05 { 0.0 } else { v })
            .collect();
        let found = off(&wrong, &oracle);
        assert!(
            found.dim > 4.0 * found.picture,
            "{} {}",
            found.dim,
            found.picture
        );
    }
}
