//! The study `table2`: François' Table 2 again, on surfaces of our own with as many vertices as his models.
//!
//! His march and ours draw a lobed body at his picture size with three layers of his Table 1; his frame rates, of a
//! graphics card of 2006, stand beside ours. What can be compared are ratios.

use super::Study;
use super::findings::{Findings, told};
use super::march::evaluations;
use super::sweep::{Cost, Row, Sweep, Verdict};
use crate::app::{AppError, Still, load_scene};
use crate::geom::SurfaceMesh;
use crate::geom::paint::TissueMaps;
use crate::geom::plane::LightPathMethod;
use crate::gpu::Gpu;
use crate::measure::page::{Block, Table};
use crate::measure::scatter::{Cloud, Point, ScatterChart, sheet};
use crate::measure::stats::Stats;
use crate::passes::view::View;
use crate::scene::{LayerSection, LightSection, Quadrature, Scene, SurfaceKind};
use glam::Vec3;
use image::{Rgba, RgbaImage};
use serde::{Deserialize, Serialize};
use std::collections::BinaryHeap;
use std::path::Path;

/// His pictures.
const PICTURE_PX: [u32; 2] = [800, 600];
const CHART_PX: (f64, f64) = (560.0, 340.0);
/// Frames a second that he prints, by vertices and samples; his third model has none.
const PRINTED: [(usize, u32, f64); 6] = [
    (1396, 10, 126.0),
    (1396, 50, 51.0),
    (1396, 100, 20.0),
    (9774, 10, 120.0),
    (9774, 50, 33.0),
    (9774, 100, 16.0),
];

/// What is swept.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// Of the surfaces.
    pub vertices: Vec<usize>,
    /// Of his march.
    pub published_samples: Vec<u32>,
    /// Of ours, by each of its rules.
    pub samples: Vec<u32>,
    /// Frames a point.
    pub frames: usize,
}

/// One setting on one surface.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    pub vertices: usize,
    pub quadrature: Quadrature,
    pub samples: u32,
    pub frames: usize,
}

/// What is measured of it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measures {
    pub evaluations: u32,
    pub light_path: String,
    pub triangles: usize,
    /// GPU time of the pass that gathers light, median [ms].
    pub surface_ms_p50: Option<f64>,
    /// Frames a second by the GPU time of all passes.
    pub frames_per_s: Option<f64>,
    /// What François prints.
    pub printed_frames_per_s: Option<f64>,
}

/// The study.
pub struct Table2 {
    gpu: Gpu,
}

impl Sweep for Table2 {
    const STUDY: Study = Study::Table2;
    const SIDE_BY_SIDE: bool = false;
    type Plan = Plan;
    type Cell = Cell;
    type Measures = Measures;

    fn plan(quick: bool) -> Plan {
        Plan {
            vertices: vec![1396, 9774, 36572],
            published_samples: vec![10, 50, 100],
            samples: if quick { vec![9] } else { vec![4, 9] },
            frames: if quick { 3 } else { 15 },
        }
    }

    fn cells(plan: &Plan) -> Result<Vec<Cell>, String> {
        if let Some(vertices) = plan.vertices.iter().find(|v| !(50..=500_000).contains(*v)) {
            return Err(format!(
                "vertices = {vertices} is out of range: choose from 50 to 500000"
            ));
        }
        let all = plan.published_samples.iter().chain(&plan.samples);
        if let Some(samples) = all.into_iter().find(|s| !(1..=256).contains(*s)) {
            return Err(format!(
                "samples = {samples} is out of range: choose from 1 to 256"
            ));
        }
        if plan.frames == 0 {
            return Err("frames = 0 is out of range: choose from 1".to_owned());
        }
        let mut cells = Vec::new();
        for &vertices in &plan.vertices {
            for (quadrature, samples) in [
                (Quadrature::Published, &plan.published_samples),
                (Quadrature::ClosedForm, &plan.samples),
                (Quadrature::ByLayer, &plan.samples),
            ] {
                cells.extend(samples.iter().map(|&samples| Cell {
                    vertices,
                    quadrature,
                    samples,
                    frames: plan.frames,
                }));
            }
        }
        Ok(cells)
    }

    fn adapter() -> Result<String, AppError> {
        Ok(Gpu::headless().map_err(AppError::Gpu)?.adapter)
    }

    fn new(_plan: &Plan, _out: &Path, _threads: usize) -> Result<Self, AppError> {
        Ok(Self {
            gpu: Gpu::headless().map_err(AppError::Gpu)?,
        })
    }

    fn measure(&self, cell: &Cell) -> Result<Row<Cell, Measures>, AppError> {
        let mesh = lobe(cell.vertices);
        let scene = scene(cell)?;
        let view = View {
            eye: Vec3::new(0.0, 0.0, 0.11),
            target: Vec3::ZERO,
            up: Vec3::Y,
            fov_y: 0.6,
        };
        let mut still = Still::new(&self.gpu, &scene, &mesh, &maps(), view, PICTURE_PX)?;
        let (mut surface_ms, mut frame_ms) = (Vec::new(), Vec::new());
        for _ in 0..cell.frames {
            let passes = still.draw()?;
            frame_ms.push(passes.iter().map(|pass| pass.gpu_ms).sum::<f32>());
            let own = passes.iter().find(|pass| pass.name == "subsurface");
            surface_ms.extend(own.map(|pass| pass.gpu_ms));
        }
        let frame = Stats::of(frame_ms);
        let printed = PRINTED.iter().find(|(vertices, samples, _)| {
            cell.quadrature == Quadrature::Published
                && (*vertices, *samples) == (cell.vertices, cell.samples)
        });
        Ok(Row {
            cell: cell.clone(),
            measures: Measures {
                evaluations: evaluations(&scene),
                light_path: scene.light_path.method.name().to_owned(),
                triangles: mesh.triangles.len(),
                surface_ms_p50: Stats::of(surface_ms).map(|stats| stats.p50),
                frames_per_s: frame.as_ref().map(|stats| 1e3 / stats.p50),
                printed_frames_per_s: printed.map(|(_, _, rate)| *rate),
            },
            verdict: Verdict::of(Vec::new()),
            cost: Cost {
                ms_p50: frame.as_ref().map(|stats| stats.p50),
                ms_p95: frame.as_ref().map(|stats| stats.p95),
            },
        })
    }

    fn findings(rows: &[Row<Cell, Measures>]) -> Findings {
        findings(rows)
    }
}

/// Three layers and one far light, as his models have; his planes stand still with the surface.
fn scene(cell: &Cell) -> Result<Scene, AppError> {
    let mut scene = load_scene("slab", &[])?;
    let layer = |scattering: [f32; 3], absorption: f32, asymmetry| LayerSection {
        absorption_per_m: [1e3 * absorption; 3],
        scattering_per_m: scattering.map(|s| 1e3 * s),
        asymmetry,
    };
    let surface = &mut scene.surface;
    surface.kind = SurfaceKind::Subsurface;
    surface.layers = vec![
        layer([2.0, 1.0, 1.0], 0.6, 0.25),
        layer([6.0, 3.0, 2.0], 0.6, 0.40),
        layer([1.0, 1.0, 2.0], 0.5, 0.80),
    ];
    surface.layer_depth_max_m = 0.003;
    surface.quadrature = cell.quadrature;
    surface.samples = cell.samples;
    scene.light_path.method = match cell.quadrature {
        Quadrature::Published => LightPathMethod::Stale,
        Quadrature::ClosedForm | Quadrature::ByLayer => LightPathMethod::DepthMap,
    };
    scene.lights = vec![LightSection {
        toward: Some(Vec3::new(-0.4, 0.6, 0.7)),
        at_m: None,
        at_share: None,
        irradiance_w_m2: [3.0; 3],
        shadow: false,
    }];
    Ok(scene)
}

fn maps() -> TissueMaps {
    let blank = || RgbaImage::from_pixel(64, 64, Rgba([128, 128, 255, 255]));
    TissueMaps {
        size_px: 64,
        outer: blank(),
        normal: blank(),
        inner: blank(),
        layers: vec![RgbaImage::from_pixel(64, 64, Rgba([40, 90, 255, 255])).into()],
    }
}

/// A lobed body 5 cm long of exactly so many vertices: an octahedron whose longest edges are cut in two until there
/// are as many, each carried to the surface.
///
/// Texture coordinates are those of a view from the front, so that no vertex is there twice.
pub fn lobe(vertices: usize) -> SurfaceMesh {
    let mut points = [
        Vec3::X,
        Vec3::NEG_X,
        Vec3::Y,
        Vec3::NEG_Y,
        Vec3::Z,
        Vec3::NEG_Z,
    ]
    .to_vec();
    let mut triangles: Vec<[u32; 3]> = vec![
        [0, 2, 4],
        [2, 1, 4],
        [1, 3, 4],
        [3, 0, 4],
        [2, 0, 5],
        [1, 2, 5],
        [3, 1, 5],
        [0, 3, 5],
    ];
    // Triangles at each directed edge.
    let mut at: std::collections::HashMap<(u32, u32), usize> = std::collections::HashMap::new();
    let mut edges: BinaryHeap<(u32, u32, u32)> = BinaryHeap::new();
    // Lengths of positive floats are ordered as their bits.
    let length =
        |points: &[Vec3], a: u32, b: u32| points[a as usize].distance(points[b as usize]).to_bits();
    for (t, corners) in triangles.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            at.insert((a, b), t);
            if a < b {
                edges.push((length(&points, a, b), a, b));
            }
        }
    }
    while points.len() < vertices {
        let (_, a, b) = edges.pop().expect("a closed surface has edges");
        // An edge that was cut is no longer there.
        let (Some(&left), Some(&right)) = (at.get(&(a, b)), at.get(&(b, a))) else {
            continue;
        };
        let m = points.len() as u32;
        points.push((points[a as usize] + points[b as usize]).normalize());
        for (t, from, to) in [(left, a, b), (right, b, a)] {
            let top = *triangles[t]
                .iter()
                .find(|corner| **corner != a && **corner != b)
                .expect("a triangle has three corners");
            let new = triangles.len();
            triangles[t] = [from, m, top];
            triangles.push([m, to, top]);
            at.remove(&(from, to));
            for (t, corners) in [(t, triangles[t]), (new, triangles[new])] {
                for k in 0..3 {
                    at.insert((corners[k], corners[(k + 1) % 3]), t);
                }
            }
            edges.push((
                length(&points, m.min(top), m.max(top)),
                m.min(top),
                m.max(top),
            ));
        }
        for end in [a, b] {
            edges.push((
                length(&points, m.min(end), m.max(end)),
                m.min(end),
                m.max(end),
            ));
        }
    }
    let place = |p: &Vec3| {
        let swell =
            1.0 + 0.18 * (5.0 * p.x).sin() * (4.0 * p.y + 1.0).cos() + 0.1 * (6.0 * p.z).sin();
        0.02 * swell * *p * Vec3::new(1.25, 0.9, 0.7)
    };
    let places: Vec<Vec3> = points.iter().map(place).collect();
    SurfaceMesh {
        uvs: places.iter().map(|p| p.truncate() / 0.08 + 0.5).collect(),
        point_of: (0..places.len() as u32).collect(),
        points: places,
        triangles,
    }
}

fn findings(rows: &[Row<Cell, Measures>]) -> Findings {
    let of = |vertices: usize, quadrature: Quadrature, samples: u32| {
        rows.iter().find(move |row| {
            row.cell.vertices == vertices
                && row.cell.quadrature == quadrature
                && row.cell.samples == samples
        })
    };
    let head = [
        "vertices",
        "march",
        "evaluations",
        "pass ms",
        "frame ms",
        "frames/s",
        "printed frames/s",
        "time to that of 10",
        "printed",
        "time to published 100",
    ];
    let line = |row: &Row<Cell, Measures>| {
        let ms = |row: &Row<Cell, Measures>| row.cost.ms_p50;
        let ten = of(row.cell.vertices, Quadrature::Published, 10);
        let hundred = of(row.cell.vertices, Quadrature::Published, 100);
        let ratio = |a: Option<f64>, b: Option<f64>| told(a.zip(b).map(|(a, b)| a / b));
        let rate = |row: &Row<Cell, Measures>| row.measures.printed_frames_per_s;
        vec![
            row.cell.vertices.to_string(),
            name(row.cell.quadrature).to_owned(),
            row.measures.evaluations.to_string(),
            told(row.measures.surface_ms_p50),
            told(ms(row)),
            told(row.measures.frames_per_s),
            told(rate(row)),
            ratio(ms(row), ten.and_then(ms)),
            ratio(ten.and_then(rate), rate(row)),
            ratio(ms(row), hundred.and_then(ms)),
        ]
    };
    let svg = chart(rows).svg();
    Findings {
        svg: sheet(std::slice::from_ref(&svg), CHART_PX, 1),
        blocks: vec![
            Block::Paragraph(
                "Frames of 800 x 600 pixels of a lobed body with as many vertices as the models of François' Table 2 \
                 (Subsurface Texture Mapping, 2006, on a graphics card of its day). His march takes planes that were \
                 fitted once and stand still, as his do; ours takes the depth map of the light, drawn every frame. Times \
                 are of the GPU, all passes. His third model has no figures."
                    .to_owned(),
            ),
            Block::Chart {
                svg,
                caption: "Labels are light evaluations a ray.".to_owned(),
            },
            Block::Table(Table {
                head: head.map(str::to_owned).to_vec(),
                rows: rows.iter().map(line).collect(),
            }),
        ],
    }
}

fn name(quadrature: Quadrature) -> &'static str {
    match quadrature {
        Quadrature::Published => "published",
        Quadrature::ClosedForm => "closed-form",
        Quadrature::ByLayer => "by-layer",
    }
}

fn chart(rows: &[Row<Cell, Measures>]) -> ScatterChart {
    let kinds = [
        Quadrature::Published,
        Quadrature::ClosedForm,
        Quadrature::ByLayer,
    ];
    let cloud = |(look, quadrature): (usize, Quadrature)| Cloud {
        label: name(quadrature).to_owned(),
        look,
        hollow: false,
        joined: false,
        points: (rows.iter())
            .filter(|row| row.cell.quadrature == quadrature)
            .map(|row| Point {
                x: row.cell.vertices as f64,
                y: row.cost.ms_p50,
                label: row.measures.evaluations.to_string(),
                scale: 1.0,
            })
            .collect(),
    };
    ScatterChart {
        size_px: CHART_PX,
        title: "Frames of 800 x 600 pixels".to_owned(),
        x_label: "vertices".to_owned(),
        y_label: "GPU time of a frame [ms]".to_owned(),
        x_range: (1e3, 1e5),
        y_range: (0.1, 2e3),
        clouds: kinds.into_iter().enumerate().map(cloud).collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn surfaces_have_as_many_vertices_as_the_printed_models_and_are_closed() {
        for vertices in [1396, 9774] {
            let mesh = lobe(vertices);
            assert_eq!(mesh.points.len(), vertices);
            // Euler: a closed surface without handles.
            assert_eq!(mesh.triangles.len(), 2 * vertices - 4);
            assert!(mesh.volume_m3() > 1e-5, "it faces outwards");
        }
    }
}
