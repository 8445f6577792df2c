//! The study `march`: how far light gathered along the view ray is off, by quadrature and samples, and what that costs.
//!
//! A flat sheet whose light has a closed form, a sheet with a vein and a ball against 4096 samples, and whatever
//! reference scenes are at hand. All are drawn by the passes of a frame.

use super::Study;
use super::findings::{Findings, scene_charts, told};
use super::sweep::{Cost, Row, Sweep, Verdict, finite};
use crate::app::{AppError, ReferenceScene, Still, folder_scenes, load_scene, read_reference};
use crate::geom::SurfaceMesh;
use crate::geom::lattice::sphere;
use crate::geom::paint::TissueMaps;
use crate::geom::plane::LightPathMethod;
use crate::geom::unwrap::unwrap;
use crate::gpu::Gpu;
use crate::measure::chart::three_digits;
use crate::measure::page::{Block, Table};
use crate::measure::radiance::eroded;
use crate::measure::scatter::{Cloud, Point, ScatterChart};
use crate::measure::stats::Stats;
use crate::optics::closed_form::parallel_layers;
use crate::passes::view::View;
use crate::scene::{LayerSection, LightSection, Quadrature, Scene, SurfaceKind};
use glam::{Vec2, Vec3};
use image::{DynamicImage, Rgba, Rgba32FImage, RgbaImage};
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

const PICTURE_PX: u32 = 96;
const FRAMES: usize = 9;
/// Errors of the picture up to which a point is fine, and degraded.
const FINE: f64 = 0.05;
const DEGRADED: f64 = 0.25;
/// Samples of an oracle that has no closed form.
const ORACLE_SAMPLES: u32 = 4096;
const CHART_PX: (f64, f64) = (560.0, 340.0);
/// Half the side of the sheet, and how deep a march may go that ends by itself [m].
const SHEET_M: f32 = 0.012;
const DEEPEST_M: f32 = 1.0;

/// What is swept.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    pub surface: SurfacePlan,
    /// Scenes of our own.
    pub scene: Vec<Specimen>,
    /// A folder of reference scenes; "" for none.
    pub truth: String,
}

/// The settings, as scenes name them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SurfacePlan {
    pub quadrature: Vec<Quadrature>,
    /// Of the published march.
    pub published_samples: Vec<u32>,
    /// Of the others.
    pub samples: Vec<u32>,
}

/// Scenes of our own.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Specimen {
    /// One layer without an end.
    HalfSpace,
    /// Three parallel layers.
    Slab,
    /// Three layers, the second swollen by a vein.
    Vein,
    /// A ball of one layer, lit from the side.
    Ball,
}

impl Specimen {
    fn name(self) -> &'static str {
        match self {
            Self::HalfSpace => "half-space",
            Self::Slab => "slab",
            Self::Vein => "vein",
            Self::Ball => "ball",
        }
    }
}

/// One setting on one scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    pub quadrature: Quadrature,
    pub samples: u32,
    pub scene: String,
    /// The file, of a reference scene.
    pub file: Option<PathBuf>,
}

/// What is measured of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measures {
    /// Places a ray where the way of light is looked for.
    pub evaluations: u32,
    /// How it is looked for.
    pub light_path: String,
    /// RMS of the difference over RMS of the exact radiance.
    pub radiance_error_rel: Option<f64>,
    /// Mean over mean, less one.
    pub radiance_bias_rel: Option<f64>,
    /// GPU time of the whole frame, median [ms].
    pub frame_ms_p50: Option<f64>,
    pub oracle: String,
}

/// The study.
pub struct March {
    gpu: Gpu,
    truth: String,
}

impl Sweep for March {
    const STUDY: Study = Study::March;
    const SIDE_BY_SIDE: bool = false;
    type Plan = Plan;
    type Cell = Cell;
    type Measures = Measures;

    fn plan(quick: bool) -> Plan {
        let truth = std::env::var("PALPATE_SHARED").map(|shared| format!("{shared}/truth"));
        let list = |few: &[u32], many: &[u32]| if quick { few.to_vec() } else { many.to_vec() };
        Plan {
            surface: SurfacePlan {
                quadrature: vec![
                    Quadrature::Published,
                    Quadrature::ClosedForm,
                    Quadrature::ByLayer,
                ],
                published_samples: list(&[10, 100], &[4, 10, 20, 50, 100, 200]),
                samples: list(&[4, 9], &[1, 2, 4, 6, 9, 16, 32, 64]),
            },
            scene: vec![
                Specimen::HalfSpace,
                Specimen::Slab,
                Specimen::Vein,
                Specimen::Ball,
            ],
            truth: truth.unwrap_or_default(),
        }
    }

    fn cells(plan: &Plan) -> Result<Vec<Cell>, String> {
        let surface = &plan.surface;
        let all = surface.published_samples.iter().chain(&surface.samples);
        if let Some(samples) = all.into_iter().find(|s| !(1..=256).contains(*s)) {
            return Err(format!(
                "surface.samples = {samples} is out of range: choose from 1 to 256"
            ));
        }
        let own = plan.scene.iter().map(|s| (s.name().to_owned(), None));
        let mut scenes: Vec<(String, Option<PathBuf>)> = own.collect();
        if !plan.truth.is_empty() {
            let files = folder_scenes(Path::new(&plan.truth)).map_err(|e| e.to_string())?;
            scenes.extend(files.into_iter().map(|file| {
                let name = file.file_stem().unwrap_or_default();
                (name.to_string_lossy().into_owned(), Some(file))
            }));
        }
        let mut cells = Vec::new();
        for (scene, file) in &scenes {
            for &quadrature in &surface.quadrature {
                let samples = match quadrature {
                    Quadrature::Published => &surface.published_samples,
                    Quadrature::ClosedForm | Quadrature::ByLayer => &surface.samples,
                };
                cells.extend(samples.iter().map(|&samples| Cell {
                    quadrature,
                    samples,
                    scene: scene.clone(),
                    file: file.clone(),
                }));
            }
        }
        Ok(cells)
    }

    fn adapter() -> Result<String, AppError> {
        Ok(Gpu::headless().map_err(AppError::Gpu)?.adapter)
    }

    fn new(plan: &Plan, _out: &Path, _threads: usize) -> Result<Self, AppError> {
        Ok(Self {
            gpu: Gpu::headless().map_err(AppError::Gpu)?,
            truth: plan.truth.clone(),
        })
    }

    fn measure(&self, cell: &Cell) -> Result<Row<Cell, Measures>, AppError> {
        let stage = self.stage(cell)?;
        let scene = with_quadrature(&stage.scene, cell.quadrature, cell.samples);
        let mut still = stage.still(&self.gpu, &scene)?;
        let (mut own_ms, mut frame_ms) = (Vec::new(), Vec::new());
        for _ in 0..FRAMES {
            let passes = still.draw()?;
            frame_ms.push(passes.iter().map(|pass| pass.gpu_ms).sum::<f32>());
            let own = passes.iter().find(|pass| pass.name == "subsurface");
            own_ms.extend(own.map(|pass| pass.gpu_ms));
        }
        let got = still.radiance()?;
        let (exact, oracle) = stage.exact(&self.gpu)?;
        let (error, bias) = off(&got, &exact);
        let own = Stats::of(own_ms);
        let measures = Measures {
            evaluations: evaluations(&scene),
            light_path: scene.light_path.method.name().to_owned(),
            radiance_error_rel: finite(error),
            radiance_bias_rel: finite(bias),
            frame_ms_p50: Stats::of(frame_ms).map(|stats| stats.p50),
            oracle,
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

/// Places a ray where a scene's march looks for the way of light.
pub fn evaluations(scene: &Scene) -> u32 {
    let samples = scene.surface.samples;
    let layers = scene.surface.layers.len() as u32;
    match scene.surface.quadrature {
        Quadrature::Published => samples,
        Quadrature::ClosedForm => samples + 1,
        Quadrature::ByLayer => samples.div_ceil(layers) * layers + 1,
    }
}

/// `scene` with a quadrature, and the light path that goes with it: the papers' planes, or depth maps.
fn with_quadrature(scene: &Scene, quadrature: Quadrature, samples: u32) -> Scene {
    let mut scene = scene.clone();
    scene.surface.quadrature = quadrature;
    scene.surface.samples = samples;
    scene.light_path.method = LightPathMethod::DepthMap;
    if quadrature == Quadrature::Published {
        scene.light_path.method = LightPathMethod::Full;
    }
    scene
}

/// Where a hundredth of the light is left in the clearest colour of dermis [m]: the papers' march ends there.
const PRINTED_DEPTH_M: f32 = 0.002_88;

/// A scene that stands ready to be drawn.
struct Stage {
    scene: Scene,
    mesh: SurfaceMesh,
    maps: TissueMaps,
    view: View,
    size: [u32; 2],
    exact: Exact,
}

/// What its radiance is compared with.
enum Exact {
    /// Parallel layers, seen and lit from afar or near.
    Closed { bottoms_m: Vec<f32> },
    /// The scene with 4096 samples.
    Fine(Specimen),
    /// A picture, and where the object is in it, less its outermost pixels.
    Picture { rgb: Vec<f32>, mask: Vec<bool> },
}

impl Stage {
    fn still(&self, gpu: &Gpu, scene: &Scene) -> Result<Still, AppError> {
        Still::new(gpu, scene, &self.mesh, &self.maps, self.view, self.size)
    }

    /// The exact radiance, NaN where it is not compared; and the oracle's name.
    fn exact(&self, gpu: &Gpu) -> Result<(Vec<f32>, String), AppError> {
        match &self.exact {
            Exact::Closed { bottoms_m } => {
                Ok((self.closed_form(bottoms_m), "closed form".to_owned()))
            }
            Exact::Fine(specimen) => {
                let fine = own(*specimen, Quadrature::ClosedForm)?;
                let scene = with_quadrature(&fine.scene, Quadrature::ClosedForm, ORACLE_SAMPLES);
                let mut still = fine.still(gpu, &scene)?;
                still.draw()?;
                let rgb = still.radiance()?;
                Ok((rgb, format!("closed form with {ORACLE_SAMPLES} samples")))
            }
            Exact::Picture { rgb, mask } => {
                let told = rgb.iter().enumerate().map(|(i, &v)| {
                    let inner = mask[i / 3];
                    if inner { v } else { f32::NAN }
                });
                Ok((told.collect(), "reference picture".to_owned()))
            }
        }
    }

    /// Radiance of parallel layers below the plane z = 0 at the middle of each pixel.
    fn closed_form(&self, bottoms_m: &[f32]) -> Vec<f32> {
        let layers: Vec<_> = (self.scene.surface.layers.iter())
            .map(|&layer| layer.into())
            .collect();
        let light = &self.scene.lights[0];
        let to_light = light.toward.expect("the sheet's light is far").normalize();
        let pixel = |far: Vec3| {
            let to_eye = (self.view.eye - far).normalize();
            let between = to_light.dot(to_eye);
            (parallel_layers(&layers, bottoms_m, to_light.z, to_eye.z, between)
                * Vec3::from(light.irradiance_w_m2))
            .to_array()
        };
        let pixels = self.view.behind_pixels(self.size);
        pixels.into_iter().flat_map(pixel).collect()
    }
}

impl March {
    fn stage(&self, cell: &Cell) -> Result<Stage, AppError> {
        let Some(file) = &cell.file else {
            let known = [
                Specimen::HalfSpace,
                Specimen::Slab,
                Specimen::Vein,
                Specimen::Ball,
            ];
            let specimen = known.into_iter().find(|s| s.name() == cell.scene);
            return specimen.map_or_else(
                || Err(AppError::Usage(format!("no scene {}", cell.scene))),
                |specimen| own(specimen, cell.quadrature),
            );
        };
        let mut sets = Vec::new();
        if cell.quadrature == Quadrature::Published {
            // So that it is made ready as the papers' march wants it.
            sets.push("surface.quadrature=published".to_owned());
        }
        let read = ReferenceScene::read(Path::new(&self.truth), file, &sets)?;
        let Some(reference) = read_reference(&read)? else {
            return Err(AppError::Usage(format!(
                "{}: it has no reference picture",
                file.display()
            )));
        };
        Ok(Stage {
            scene: read.scene,
            mesh: read.mesh,
            maps: read.maps,
            view: read.view,
            size: read.size,
            exact: Exact::Picture {
                rgb: reference.rgb,
                mask: eroded(&reference.mask, reference.size),
            },
        })
    }
}

/// Dermis, blood and organs of François' Table 1.
fn table_1() -> Vec<LayerSection> {
    let layer = |scattering: [f32; 3], absorption: f32, asymmetry| LayerSection {
        absorption_per_m: [1e3 * absorption; 3],
        scattering_per_m: scattering.map(|s| 1e3 * s),
        asymmetry,
    };
    vec![
        layer([2.0, 1.0, 1.0], 0.6, 0.25),
        layer([6.0, 3.0, 2.0], 0.6, 0.40),
        layer([1.0, 1.0, 2.0], 0.5, 0.80),
    ]
}

fn own(specimen: Specimen, quadrature: Quadrature) -> Result<Stage, AppError> {
    let deepest_m = match quadrature {
        Quadrature::Published => PRINTED_DEPTH_M,
        Quadrature::ClosedForm | Quadrature::ByLayer => DEEPEST_M,
    };
    let mut scene = load_scene("slab", &[])?;
    let surface = &mut scene.surface;
    surface.kind = SurfaceKind::Subsurface;
    surface.layers = table_1();
    surface.color_blend = 0.0;
    surface.multiple_scattering = 0.0;
    surface.wetness = 0.0;
    surface.relief = 0.0;
    surface.layer_depth_max_m = deepest_m;
    if matches!(specimen, Specimen::HalfSpace | Specimen::Ball) {
        surface.layers.truncate(1);
    }
    scene.light_path.radius_m = Some(0.000_886);
    let toward = match specimen {
        Specimen::Ball => Vec3::new(0.9, 0.1, 0.3),
        _ => Vec3::new(-0.65, -0.2, 0.73),
    };
    scene.lights = vec![LightSection {
        toward: Some(toward.normalize()),
        at_m: None,
        at_share: None,
        irradiance_w_m2: [1.0; 3],
        shadow: false,
    }];
    let bottoms = |_: f32| [0.00025_f32, 0.00045];
    let vein = |x: f32| {
        let swell = 0.0004 * (-(x / 0.0008).powi(2)).exp();
        [0.00025 - 0.3 * swell, 0.0003 + swell]
    };
    let side = 256;
    let depths = |of: &dyn Fn(f32) -> [f32; 2]| {
        DynamicImage::ImageRgba32F(Rgba32FImage::from_fn(side, 4, |x, _| {
            let at = ((x as f32 + 0.5) / side as f32 * 2.0 - 1.0) * SHEET_M;
            let [first, second] = of(at);
            Rgba([first / deepest_m, second / deepest_m, 1.0, 1.0])
        }))
    };
    let blank = || RgbaImage::from_pixel(4, 4, Rgba([128, 128, 255, 255]));
    let maps = TissueMaps {
        size_px: 4,
        outer: blank(),
        normal: blank(),
        inner: blank(),
        layers: vec![match specimen {
            Specimen::Vein => depths(&vein),
            _ => depths(&bottoms),
        }],
    };
    let (mesh, eye, target) = match specimen {
        Specimen::Ball => {
            let (points, triangles) = sphere(0.002);
            (
                unwrap(&points, &triangles),
                Vec3::new(0.0, 0.0, 0.008),
                Vec3::ZERO,
            )
        }
        _ => (flat_sheet(), Vec3::new(0.0, -0.010, 0.008), Vec3::ZERO),
    };
    Ok(Stage {
        scene,
        mesh,
        maps,
        view: View {
            eye,
            target,
            up: Vec3::Y,
            fov_y: 0.5,
        },
        size: [PICTURE_PX; 2],
        exact: match specimen {
            Specimen::HalfSpace => Exact::Closed {
                bottoms_m: Vec::new(),
            },
            Specimen::Slab => Exact::Closed {
                bottoms_m: bottoms(0.0).to_vec(),
            },
            Specimen::Vein | Specimen::Ball => Exact::Fine(specimen),
        },
    })
}

/// A square in the plane z = 0.
fn flat_sheet() -> SurfaceMesh {
    const SIDE: u32 = 25;
    let mut sheet = SurfaceMesh::default();
    for i in 0..SIDE * SIDE {
        let uv = Vec2::new((i % SIDE) as f32, (i / SIDE) as f32) / (SIDE - 1) as f32;
        sheet.points.push(SHEET_M * (2.0 * uv - 1.0).extend(0.0));
        sheet.point_of.push(i);
        sheet.uvs.push(uv);
    }
    for i in (0..SIDE * (SIDE - 1)).filter(|i| i % SIDE + 1 < SIDE) {
        let [a, b, c, d] = [i, i + 1, i + SIDE, i + SIDE + 1];
        sheet.triangles.extend([[a, b, d], [a, d, c]]);
    }
    sheet
}

/// Relative RMS and bias of `got` where `exact` is a number above zero.
fn off(got: &[f32], exact: &[f32]) -> (f64, f64) {
    let (mut difference, mut square, mut sum, mut exact_sum) = (0.0, 0.0, 0.0, 0.0);
    for (&got, &exact) in got.iter().zip(exact) {
        if exact > 0.0 {
            let (got, exact) = (f64::from(got), f64::from(exact));
            difference += (got - exact).powi(2);
            square += exact * exact;
            sum += got;
            exact_sum += exact;
        }
    }
    ((difference / square).sqrt(), sum / exact_sum - 1.0)
}

fn verdict(measures: &Measures) -> Verdict {
    let told = |error| format!("{:.1} % off", 100.0 * error);
    Verdict::of_radiance(measures.radiance_error_rel, [FINE, DEGRADED], told)
}

fn quadrature_name(quadrature: Quadrature) -> &'static str {
    match quadrature {
        Quadrature::Published => "published",
        Quadrature::ClosedForm => "closed-form",
        Quadrature::ByLayer => "by-layer",
    }
}

fn findings(rows: &[Row<Cell, Measures>]) -> Findings {
    let head = [
        "scene",
        "quadrature",
        "light path",
        "evaluations",
        "error",
        "bias",
        "ms",
        "frame ms",
        "state",
    ];
    let line = |row: &Row<Cell, Measures>| {
        vec![
            row.cell.scene.clone(),
            quadrature_name(row.cell.quadrature).to_owned(),
            row.measures.light_path.clone(),
            row.measures.evaluations.to_string(),
            told(row.measures.radiance_error_rel),
            told(row.measures.radiance_bias_rel),
            told(row.cost.ms_p50),
            told(row.measures.frame_ms_p50),
            row.verdict.state.name().to_owned(),
        ]
    };
    let mut scenes: Vec<&str> = rows.iter().map(|row| row.cell.scene.as_str()).collect();
    scenes.dedup();
    let (svg, charts) = scene_charts(&scenes, |scene| chart(rows, scene));
    let mut blocks = vec![
        Block::Paragraph(
            "Radiance of light scattered once against what is exact, over the GPU time of the pass that gathers it. \
             The published march takes the papers' planes, the others take depth maps and end where the view ray \
             leaves the body. Points are labelled by their light evaluations a ray; those below the chart's range \
             stand on its edge."
                .to_owned(),
        ),
        charts,
    ];
    blocks.extend(comparison(rows, &scenes).map(Block::Paragraph));
    blocks.push(Block::Table(Table {
        head: head.map(str::to_owned).to_vec(),
        rows: rows.iter().map(line).collect(),
    }));
    Findings { svg, blocks }
}

/// Ten evaluations of ours against a hundred of the papers'.
fn comparison(rows: &[Row<Cell, Measures>], scenes: &[&str]) -> Option<String> {
    let best = |scene: &str, quadrature: Quadrature, most: u32| {
        let fits = |row: &&Row<Cell, Measures>| {
            row.cell.scene == scene
                && row.cell.quadrature == quadrature
                && row.measures.evaluations <= most
        };
        let row = rows
            .iter()
            .filter(fits)
            .max_by_key(|row| row.measures.evaluations)?;
        Some((row.measures.radiance_error_rel?, row.cost.ms_p50?))
    };
    let mut text = String::new();
    for scene in scenes {
        let Some(papers) = best(scene, Quadrature::Published, 100) else {
            continue;
        };
        for quadrature in [Quadrature::ClosedForm, Quadrature::ByLayer] {
            if let Some((error, ms)) = best(scene, quadrature, 10) {
                text += &format!(
                    "{scene}: {} with at most 10 evaluations has {} of the error and {} of the time of the published \
                     march with 100. ",
                    quadrature_name(quadrature),
                    three_digits(error / papers.0),
                    three_digits(ms / papers.1)
                );
            }
        }
    }
    (!text.is_empty()).then_some(text)
}

const ERROR_RANGE: (f64, f64) = (1e-4, 20.0);
const MS_RANGE: (f64, f64) = (0.02, 200.0);

fn chart(rows: &[Row<Cell, Measures>], scene: &str) -> ScatterChart {
    let quadratures = [
        Quadrature::Published,
        Quadrature::ClosedForm,
        Quadrature::ByLayer,
    ];
    let cloud = |(look, quadrature): (usize, Quadrature)| Cloud {
        label: quadrature_name(quadrature).to_owned(),
        look,
        hollow: false,
        joined: true,
        points: (rows.iter())
            .filter(|row| row.cell.scene == scene && row.cell.quadrature == quadrature)
            .filter_map(|row| {
                Some(Point {
                    x: row.cost.ms_p50?,
                    y: row
                        .measures
                        .radiance_error_rel
                        .map(|e| e.max(ERROR_RANGE.0)),
                    label: row.measures.evaluations.to_string(),
                    scale: 1.0,
                })
            })
            .collect(),
    };
    ScatterChart {
        size_px: CHART_PX,
        title: scene.to_owned(),
        x_label: "GPU time of the pass [ms]".to_owned(),
        y_label: "relative RMS error".to_owned(),
        x_range: MS_RANGE,
        y_range: ERROR_RANGE,
        clouds: quadratures.into_iter().enumerate().map(cloud).collect(),
    }
}
