//! The study `stretch`: how deep layers seem, how wide light spreads and how thick layers are where a surface is
//! stretched, with and without the metric of the texture map.
//!
//! A flat sheet is pulled to a length by formula and drawn by the product; what its shader would read at the middle
//! pixel is read back and compared with the geometry.

use super::Study;
use super::findings::{Findings, told};
use super::sweep::{Cost, Row, State, Sweep, Verdict, finite};
use crate::app::{AppError, load_scene};
use crate::geom::SurfaceMesh;
use crate::geom::paint::TissueMaps;
use crate::gpu::{Gpu, Timer, read_texture_rgba16f, read_texture_words};
use crate::measure::chart::number;
use crate::measure::page::{Block, Table};
use crate::measure::scatter::{Cloud, Point, ScatterChart, sheet};
use crate::measure::stats::Stats;
use crate::optics::pack::from_octahedral;
use crate::passes::draw::Output;
use crate::passes::frame::FramePasses;
use crate::passes::geometry::Geometry;
use crate::passes::view::View;
use crate::scene::{RestBox, Scene, SurfaceKind, UvMetric};
use glam::{Vec2, Vec3};
use half::f16;
use image::RgbaImage;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// Points a side of the sheet, and its side [m].
const SIDE: usize = 17;
const SIDE_M: f32 = 0.1;
const PICTURE_PX: u32 = 64;
const FRAMES: u32 = 9;
/// A layer's depth further off than this is not fine.
const DEPTH_ERROR_MAX: f64 = 0.05;
const CHART_PX: (f64, f64) = (560.0, 340.0);

/// What is swept.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    pub surface: SurfacePlan,
    /// Lengths over the length at rest.
    pub stretch: Vec<f64>,
}

/// The settings, as scenes name them.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SurfacePlan {
    pub kind: Vec<SurfaceKind>,
    pub uv_metric: Vec<UvMetric>,
    pub thickness_follows_volume: Vec<bool>,
}

/// One setting at one length.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    pub kind: SurfaceKind,
    pub uv_metric: UvMetric,
    pub thickness_follows_volume: bool,
    pub stretch: f64,
}

/// What is measured of it: shares of what the geometry says, less one.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measures {
    /// Of the depth that parallax shows, in the direction of the pull.
    pub depth_error_rel: Option<f64>,
    /// The same across it.
    pub depth_across_error_rel: Option<f64>,
    /// Of the radius of the light map's blur, in the direction of the pull; gooey surfaces alone.
    pub blur_error_rel: Option<f64>,
    /// Of the thickness of a layer that keeps its volume.
    pub thickness_error_rel: Option<f64>,
    pub oracle: String,
}

/// The study.
pub struct Stretch {
    gpu: Gpu,
    sheet: SurfaceMesh,
}

impl Sweep for Stretch {
    const STUDY: Study = Study::Stretch;
    const SIDE_BY_SIDE: bool = false;
    type Plan = Plan;
    type Cell = Cell;
    type Measures = Measures;

    fn plan(quick: bool) -> Plan {
        Plan {
            surface: SurfacePlan {
                kind: vec![SurfaceKind::Subsurface, SurfaceKind::Gooey],
                uv_metric: vec![UvMetric::Deformed, UvMetric::Unit],
                thickness_follows_volume: vec![false, true],
            },
            stretch: if quick {
                vec![1.0, 1.5, 2.0]
            } else {
                vec![1.0, 1.1, 1.25, 1.5, 1.75, 2.0]
            },
        }
    }

    fn cells(plan: &Plan) -> Result<Vec<Cell>, String> {
        if let Some(stretch) = plan.stretch.iter().find(|s| !(0.25..=4.0).contains(*s)) {
            return Err(format!(
                "stretch = {stretch} is out of range: choose from 0.25 to 4"
            ));
        }
        let mut cells = Vec::new();
        for &kind in &plan.surface.kind {
            for &uv_metric in &plan.surface.uv_metric {
                for &thickness_follows_volume in &plan.surface.thickness_follows_volume {
                    cells.extend(plan.stretch.iter().map(|&stretch| Cell {
                        kind,
                        uv_metric,
                        thickness_follows_volume,
                        stretch,
                    }));
                }
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
            sheet: flat_sheet(),
        })
    }

    fn measure(&self, cell: &Cell) -> Result<Row<Cell, Measures>, AppError> {
        let mut scene = load_scene("slab", &[])?;
        scene.surface.kind = cell.kind;
        scene.surface.uv_metric = cell.uv_metric;
        scene.surface.thickness_follows_volume = cell.thickness_follows_volume;
        let along = cell.stretch as f32;
        let across = 1.0 / along.sqrt();
        let points: Vec<Vec3> = (self.sheet.points.iter())
            .map(|&p| p * Vec3::new(along, across, 1.0))
            .collect();
        let (read, ms) = self.middle(&scene, &points)?;
        // Texture coordinates a metre of the pulled sheet.
        let exact = Vec2::new(1.0 / (along * SIDE_M), 1.0 / (across * SIDE_M));
        let off = |got: f32, exact: f32| finite(f64::from(got / exact) - 1.0);
        let measures = Measures {
            depth_error_rel: off(read.u_per_m.x, exact.x),
            depth_across_error_rel: off(read.v_per_m.y, exact.y),
            blur_error_rel: (read.blur_u_per_m).and_then(|blur| off(blur, exact.x)),
            thickness_error_rel: off(read.thickness * along * across, 1.0),
            oracle: "geometry of the pulled sheet".to_owned(),
        };
        Ok(Row {
            cell: cell.clone(),
            verdict: verdict(&measures),
            measures,
            cost: Cost {
                ms_p50: ms.map(|(p50, _)| p50),
                ms_p95: ms.map(|(_, p95)| p95),
            },
        })
    }

    fn findings(rows: &[Row<Cell, Measures>]) -> Findings {
        findings(rows)
    }
}

/// What the surface shader reads at a pixel.
struct Read {
    /// Texture coordinates a metre to the right and upwards.
    u_per_m: Vec2,
    v_per_m: Vec2,
    thickness: f32,
    /// What the light map's blur takes for the first.
    blur_u_per_m: Option<f32>,
}

impl Stretch {
    /// Draws the sheet from above and reads its middle; with the time of the geometry pass [ms].
    fn middle(
        &self,
        scene: &Scene,
        points: &[Vec3],
    ) -> Result<(Read, Option<(f64, f64)>), AppError> {
        let (low, high) = self.sheet.bounds();
        let blank = || RgbaImage::from_pixel(8, 8, image::Rgba([128, 128, 255, 255]));
        let maps = TissueMaps {
            size_px: 8,
            outer: blank(),
            normal: blank(),
            inner: blank(),
            layers: vec![blank().into()],
        };
        let rest = RestBox { low, high };
        let size = [PICTURE_PX; 2];
        let gpu = &self.gpu;
        let passes =
            FramePasses::new(gpu, scene, &rest, &self.sheet, &maps, size, Output::Picture)?;
        let view = View {
            eye: 2.0 * SIDE_M * Vec3::Z,
            target: Vec3::ZERO,
            up: Vec3::Y,
            fov_y: 0.3,
        };
        let mut timer = Timer::new(gpu, 16);
        let mut times = Vec::new();
        for _ in 0..FRAMES {
            timer.begin_frame();
            let mut encoder = gpu.encoder();
            passes.record(gpu, points, &view, &[], &mut encoder, &mut timer);
            timer.resolve(&mut encoder);
            gpu.submit_and_wait(encoder);
            let passes = timer.read(gpu)?;
            let own = passes.iter().find(|pass| pass.name == Geometry::NAME);
            times.extend(own.map(|pass| pass.gpu_ms));
        }
        let at = (PICTURE_PX * PICTURE_PX / 2 + PICTURE_PX / 2) as usize;
        let base = read_texture_words(gpu, &passes.targets.base.texture)?[at];
        let detail = read_texture_words(gpu, &passes.targets.detail.texture)?[at];
        let mut read = decoded(base, detail);
        if let Some(light_map) = passes.light_map() {
            let metric = &light_map.metric().texture;
            let middle = (metric.width() * (metric.height() / 2) + metric.width() / 2) as usize;
            read.blur_u_per_m = Some(read_texture_rgba16f(gpu, metric)?[4 * middle]);
        }
        Ok((read, Stats::of(times).map(|s| (s.p50, s.p95))))
    }
}

/// The words of `shaders/geometry.wgsl`, as `shaders/pixel.wgsl` reads them.
fn decoded(base: [u32; 4], detail: [u32; 4]) -> Read {
    let halves = |word: u32| {
        Vec2::new(
            f16::from_bits(word as u16).to_f32(),
            f16::from_bits((word >> 16) as u16).to_f32(),
        )
    };
    let normal = from_octahedral(base[2]);
    let tangent = from_octahedral(base[3] & !1);
    let handedness = if base[3] & 1 == 1 { -1.0 } else { 1.0 };
    let bitangent = handedness * normal.cross(tangent);
    let in_world = |g: Vec2| (g.x * tangent + g.y * bitangent).truncate();
    Read {
        u_per_m: in_world(halves(detail[2])),
        v_per_m: in_world(halves(detail[3])),
        thickness: halves(detail[1]).y,
        blur_u_per_m: None,
    }
}

/// A square about the origin that faces +z, u to the right and v upwards.
fn flat_sheet() -> SurfaceMesh {
    let mut sheet = SurfaceMesh::default();
    for row in 0..SIDE {
        for column in 0..SIDE {
            let uv = Vec2::new(column as f32, row as f32) / (SIDE - 1) as f32;
            sheet.point_of.push(sheet.points.len() as u32);
            sheet.points.push((SIDE_M * (uv - 0.5)).extend(0.0));
            sheet.uvs.push(uv);
        }
    }
    let at = |row: usize, column: usize| (row * SIDE + column) as u32;
    for row in 0..SIDE - 1 {
        for column in 0..SIDE - 1 {
            let [a, b] = [at(row, column), at(row, column + 1)];
            let [c, d] = [at(row + 1, column), at(row + 1, column + 1)];
            sheet.triangles.push([a, b, d]);
            sheet.triangles.push([a, d, c]);
        }
    }
    sheet
}

fn verdict(measures: &Measures) -> Verdict {
    let mut faults = Vec::new();
    for (what, error) in [
        ("layers seem", measures.depth_error_rel),
        (
            "across the pull layers seem",
            measures.depth_across_error_rel,
        ),
        ("the blur is", measures.blur_error_rel),
        ("layers are", measures.thickness_error_rel),
    ] {
        if let Some(error) = error.filter(|error| error.abs() > DEPTH_ERROR_MAX) {
            let percent = 100.0 * error;
            faults.push((State::Degraded, format!("{what} {percent:+.0} % off")));
        }
    }
    Verdict::of(faults)
}

fn findings(rows: &[Row<Cell, Measures>]) -> Findings {
    let percent =
        |value: Option<f64>| value.map_or_else(|| "-".to_owned(), |v| format!("{:+.1}", 100.0 * v));
    let head = [
        "surface",
        "metric",
        "volume kept",
        "stretch",
        "depth %",
        "across %",
        "blur %",
        "thickness %",
        "ms",
    ];
    let line = |row: &Row<Cell, Measures>| {
        vec![
            row.cell.kind.name().to_owned(),
            row.cell.uv_metric.name().to_owned(),
            if row.cell.thickness_follows_volume {
                "yes"
            } else {
                "no"
            }
            .to_owned(),
            number(row.cell.stretch),
            percent(row.measures.depth_error_rel),
            percent(row.measures.depth_across_error_rel),
            percent(row.measures.blur_error_rel),
            percent(row.measures.thickness_error_rel),
            told(row.cost.ms_p50),
        ]
    };
    let svg = chart(rows).svg();
    Findings {
        svg: sheet(std::slice::from_ref(&svg), CHART_PX, 1),
        blocks: vec![
            Block::Paragraph(
                "A sheet is pulled to a length and narrows so that it keeps its volume. How far the depth at which \
                 parallax shows a layer, the radius of the light map's blur, and the thickness of the layers are \
                 from the geometry."
                    .to_owned(),
            ),
            Block::Chart {
                svg,
                caption: "Errors below a tenth of a percent stand on the lower edge.".to_owned(),
            },
            Block::Table(Table {
                head: head.map(str::to_owned).to_vec(),
                rows: rows.iter().map(line).collect(),
            }),
        ],
    }
}

fn chart(rows: &[Row<Cell, Measures>]) -> ScatterChart {
    let mut clouds: Vec<Cloud> = Vec::new();
    let mut add = |label: String, stretch: f64, error: Option<f64>| {
        let Some(error) = error else {
            return;
        };
        let point = Point {
            x: stretch,
            y: Some((100.0 * error.abs()).max(ERROR_RANGE.0)),
            label: String::new(),
            scale: 1.0,
        };
        match clouds.iter_mut().find(|cloud| cloud.label == label) {
            Some(cloud) => cloud.points.push(point),
            None => clouds.push(Cloud {
                label,
                look: clouds.len(),
                hollow: false,
                joined: true,
                points: vec![point],
            }),
        }
    };
    for row in rows.iter().filter(|row| row.cell.thickness_follows_volume) {
        let (kind, metric) = (row.cell.kind.name(), row.cell.uv_metric.name());
        let measures = &row.measures;
        let label = format!("depth, {kind}, {metric}");
        add(label, row.cell.stretch, measures.depth_error_rel);
        let label = format!("blur, {kind}, {metric}");
        add(label, row.cell.stretch, measures.blur_error_rel);
    }
    ScatterChart {
        size_px: CHART_PX,
        title: "Layers under stretch".to_owned(),
        x_label: "length over length at rest".to_owned(),
        y_label: "error [%]".to_owned(),
        x_range: (0.95, 2.1),
        y_range: ERROR_RANGE,
        clouds,
    }
}

const ERROR_RANGE: (f64, f64) = (0.1, 200.0);

#[cfg(test)]
mod tests {
    use super::*;

    fn row(
        uv_metric: UvMetric,
        thickness_follows_volume: bool,
        stretch: f64,
    ) -> Row<Cell, Measures> {
        let study = Stretch::new(&Stretch::plan(true), Path::new("."), 1).expect("an adapter");
        let cell = Cell {
            kind: SurfaceKind::Gooey,
            uv_metric,
            thickness_follows_volume,
            stretch,
        };
        study.measure(&cell).expect("it is drawn")
    }

    #[test]
    fn the_blur_keeps_its_radius_with_the_metric_and_grows_with_the_stretch_without() {
        let blur = |metric| row(metric, false, 1.5).measures.blur_error_rel.unwrap();
        // Half floats: a thousandth.
        let deformed = blur(UvMetric::Deformed);
        assert!(deformed.abs() < 2e-3, "{deformed}");
        let unit = blur(UvMetric::Unit);
        assert!((unit - 0.5).abs() < 2e-3, "{unit}");
    }

    #[test]
    fn layers_keep_their_depth_with_the_metric_and_sink_by_the_stretch_without() {
        let depth = |metric, stretch| row(metric, true, stretch).measures.depth_error_rel.unwrap();
        // Gradients are packed in halves: a thousandth.
        assert!(depth(UvMetric::Deformed, 1.5).abs() < 2e-3);
        assert!((depth(UvMetric::Unit, 1.5) - 0.5).abs() < 2e-3);
        assert!(depth(UvMetric::Unit, 1.0).abs() < 2e-3);
    }

    #[test]
    fn layers_that_keep_their_volume_thin_as_the_sheet_grows() {
        let thickness = |follows| {
            row(UvMetric::Deformed, follows, 2.0)
                .measures
                .thickness_error_rel
        };
        assert!(thickness(true).unwrap().abs() < 2e-3);
        let grown = 2.0_f64.sqrt() - 1.0;
        assert!((thickness(false).unwrap() - grown).abs() < 2e-3);
        let told = row(UvMetric::Unit, false, 2.0).verdict;
        assert_eq!(told.state, State::Degraded);
        assert!(told.why.contains("layers seem +100 % off"), "{}", told.why);
    }
}
