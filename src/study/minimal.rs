//! The study `minimal`: every optional feature of the bundled scenes on and off: what it costs, and what it changes.
//!
//! Each scene is simulated once to the middle of its script; then one frame is drawn as the scene has it and once with
//! a single feature the other way. What changes nothing should be off.

use super::Study;
use super::findings::{Findings, told};
use super::sweep::{Cost, Row, State, Sweep, Verdict, finite};
use crate::app::{AppError, Renderer, Session, load_scene};
use crate::geom::plane::LightPathMethod;
use crate::gpu::Gpu;
use crate::measure::page::{Block, Table};
use crate::measure::scatter::{Cloud, Point, ScatterChart, sheet};
use crate::measure::stats::Stats;
use crate::scene::{InnerLight, InnerTaps, Noise, Scene, SurfaceKind, UvMetric};
use glam::Vec3;
use image::RgbaImage;
use serde::{Deserialize, Serialize};
use std::path::Path;
use std::sync::{Mutex, PoisonError};

/// A change of the picture below this is none [share of the range, RMS over covered pixels]: a third of a level of 8 bits.
const NOTHING: f64 = 0.0013;
/// A share of the frame below this is no cost: what the timing can't tell.
const NO_COST_SHARE: f64 = 0.03;
/// A channel that differs by so many levels is seen.
const SEEN_LEVELS: u8 = 3;
/// The shadow between layers that a scene without one is given: that of the scene `heart`.
const LAYER_SHADOW: f32 = 0.3;
/// Frames before those that are timed.
const WARM_UP: u32 = 2;
const CHART_PX: (f64, f64) = (620.0, 400.0);
const CHANGE_RANGE: (f64, f64) = (0.01, 100.0);
const MS_RANGE: (f64, f64) = (0.01, 100.0);

/// What can be left out of a scene.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Feature {
    /// The shadow of the key light.
    Shadow,
    /// All lights but the first.
    FillLights,
    /// The scene's light-path primitive, or the tangent plane.
    LightPath,
    /// Texture coordinates by the metric of the deformed surface.
    UvMetric,
    /// Layers that thin where the surface stretches.
    LayerVolume,
    /// Light that scattered more than once.
    MultipleScattering,
    /// That light round the terminator.
    Wrap,
    /// Layers tinted by the colour maps.
    ColorBlend,
    /// The normal map.
    Relief,
    /// Highlights and mirrored room.
    Wetness,
    /// Twice the samples.
    MoreSamples,
    /// What moves the places where the layers are read.
    Noise,
    /// The light map of the inner layers, or light on the smooth normal.
    LightMap,
    /// The blur of the light map.
    Blur,
    /// The blur of the inner layers' colour.
    InnerBlur,
    /// What an opaque layer keeps from those below.
    LayerShadow,
    /// The opacity map over the inner layer.
    Parallax,
}

impl Feature {
    const ALL: [Self; 17] = [
        Self::Shadow,
        Self::FillLights,
        Self::LightPath,
        Self::UvMetric,
        Self::LayerVolume,
        Self::MultipleScattering,
        Self::Wrap,
        Self::ColorBlend,
        Self::Relief,
        Self::Wetness,
        Self::MoreSamples,
        Self::Noise,
        Self::LightMap,
        Self::Blur,
        Self::InnerBlur,
        Self::LayerShadow,
        Self::Parallax,
    ];

    fn name(self) -> &'static str {
        match self {
            Self::Shadow => "shadow",
            Self::FillLights => "fill-lights",
            Self::LightPath => "light-path",
            Self::UvMetric => "uv-metric",
            Self::LayerVolume => "layer-volume",
            Self::MultipleScattering => "multiple-scattering",
            Self::Wrap => "wrap",
            Self::ColorBlend => "color-blend",
            Self::Relief => "relief",
            Self::Wetness => "wetness",
            Self::MoreSamples => "more-samples",
            Self::Noise => "noise",
            Self::LightMap => "light-map",
            Self::Blur => "blur",
            Self::InnerBlur => "inner-blur",
            Self::LayerShadow => "layer-shadow",
            Self::Parallax => "parallax",
        }
    }

    /// Whether `scene` has it; `None` where its surface has no use for it.
    fn is_on(self, scene: &Scene) -> Option<bool> {
        let surface = &scene.surface;
        let layered = surface.kind == SurfaceKind::Subsurface;
        let gooey = surface.kind == SurfaceKind::Gooey;
        let below = layered || gooey;
        let if_has = |has: bool, on: bool| has.then_some(on);
        match self {
            Self::Shadow => Some(scene.lights.iter().any(|light| light.shadow)),
            Self::FillLights => if_has(scene.lights.len() > 1, true),
            Self::LightPath => if_has(layered, scene.light_path.method != LightPathMethod::Tangent),
            Self::UvMetric => if_has(below, surface.uv_metric == UvMetric::Deformed),
            Self::LayerVolume => if_has(below, surface.thickness_follows_volume),
            Self::MultipleScattering => if_has(layered, surface.multiple_scattering > 0.0),
            Self::Wrap => if_has(layered, surface.wrap > 0.0),
            Self::ColorBlend => if_has(layered, surface.color_blend > 0.0),
            Self::Relief => Some(surface.relief > 0.0),
            Self::Wetness => Some(surface.wetness > 0.0),
            Self::MoreSamples => if_has(layered, false),
            Self::Noise => if_has(layered, surface.noise != Noise::None),
            Self::LightMap => if_has(gooey, surface.has_light_map()),
            Self::Blur => if_has(surface.has_light_map(), surface.blur_passes > 0),
            Self::InnerBlur => if_has(gooey, surface.inner_taps != InnerTaps::One),
            Self::LayerShadow => if_has(gooey, surface.layer_shadow > 0.0),
            Self::Parallax => if_has(gooey, surface.layer_distance_m > 0.0),
        }
    }

    /// `scene` with the feature the other way.
    fn toggled(self, scene: &Scene) -> Scene {
        let mut scene = scene.clone();
        let is_on = self.is_on(&scene) == Some(true);
        let surface = &mut scene.surface;
        let standard = crate::scene::SurfaceSection::default();
        let knob = |value: &mut f32, default: f32| *value = if is_on { 0.0 } else { default };
        match self {
            Self::Shadow => {
                // At most one light may cast one: the first.
                for (index, light) in scene.lights.iter_mut().enumerate() {
                    light.shadow = !is_on && index == 0 && light.toward.is_some();
                }
            }
            Self::FillLights => scene.lights.truncate(1),
            Self::LightPath => {
                scene.light_path.method = if is_on {
                    LightPathMethod::Tangent
                } else {
                    crate::scene::LightPathSection::default().method
                };
            }
            Self::UvMetric => {
                surface.uv_metric = if is_on {
                    UvMetric::Unit
                } else {
                    UvMetric::Deformed
                };
            }
            Self::LayerVolume => surface.thickness_follows_volume = !is_on,
            Self::MultipleScattering => {
                knob(
                    &mut surface.multiple_scattering,
                    standard.multiple_scattering,
                );
            }
            Self::Wrap => knob(&mut surface.wrap, standard.wrap),
            Self::ColorBlend => knob(&mut surface.color_blend, standard.color_blend),
            Self::Relief => knob(&mut surface.relief, standard.relief),
            Self::Wetness => knob(&mut surface.wetness, standard.wetness),
            Self::MoreSamples => surface.samples *= 2,
            Self::Noise => {
                surface.noise = if is_on { Noise::None } else { Noise::Gradient };
            }
            Self::LightMap => {
                surface.inner_light = if is_on {
                    InnerLight::SmoothNormal
                } else {
                    InnerLight::Map
                };
            }
            Self::InnerBlur => {
                surface.inner_taps = if is_on {
                    InnerTaps::One
                } else {
                    InnerTaps::Three
                };
            }
            Self::LayerShadow => knob(&mut surface.layer_shadow, LAYER_SHADOW),
            Self::Blur => {
                surface.blur_passes = if is_on { 0 } else { standard.blur_passes };
            }
            Self::Parallax => knob(&mut surface.layer_distance_m, standard.layer_distance_m),
        }
        scene
    }
}

/// What is swept.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    /// Bundled scenes, or paths of scene files.
    pub scene: Vec<String>,
    pub feature: Vec<Feature>,
    /// Timed frames each.
    pub frames: u32,
    /// Width and height of the pictures [px].
    pub size: [u32; 2],
    /// How far into its script each scene is simulated [s].
    pub at_s: f64,
}

/// One feature of one scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    pub scene: String,
    pub feature: Feature,
    pub frames: u32,
    pub size: [u32; 2],
    pub at_s: f64,
}

/// What it costs and changes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measures {
    /// Whether the scene has it; null where its surface has no use for it.
    pub is_on: Option<bool>,
    /// GPU time of the frame with and without it, and the difference [ms].
    pub on_ms_p50: Option<f64>,
    pub off_ms_p50: Option<f64>,
    pub cost_ms: Option<f64>,
    /// RMS of what changes in the picture, as a share of the range, over covered pixels.
    pub change_rms: Option<f64>,
    /// Share of the covered pixels in which it is seen.
    pub changed_share: Option<f64>,
    pub oracle: String,
}

/// The study, with the last scene that it drew.
pub struct Minimal {
    threads: usize,
    shown: Mutex<Option<(String, Shown)>>,
}

/// A scene in the middle of its script.
struct Shown {
    session: Session,
    renderer: Renderer,
    points: Vec<Vec3>,
}

impl Sweep for Minimal {
    const STUDY: Study = Study::Minimal;
    const SIDE_BY_SIDE: bool = false;
    type Plan = Plan;
    type Cell = Cell;
    type Measures = Measures;

    fn plan(quick: bool) -> Plan {
        let scenes: &[&str] = if quick {
            &["spleen", "liver-gooey"]
        } else {
            &["liver", "liver-gooey", "heart", "kidney", "spleen"]
        };
        Plan {
            scene: scenes.iter().map(|&name| name.to_owned()).collect(),
            feature: Feature::ALL.to_vec(),
            frames: if quick { 3 } else { 31 },
            size: if quick { [320, 240] } else { [800, 600] },
            at_s: 1.2,
        }
    }

    fn cells(plan: &Plan) -> Result<Vec<Cell>, String> {
        if !(1..=10_000).contains(&plan.frames) {
            return Err(format!("frames = {}: choose from 1 to 10000", plan.frames));
        }
        if let Some(side) = plan.size.iter().find(|side| !(8..=8192).contains(*side)) {
            return Err(format!(
                "size = {side} is out of range: choose from 8 to 8192"
            ));
        }
        if !(0.0..=1000.0).contains(&plan.at_s) {
            return Err(format!("at_s = {}: choose from 0 to 1000", plan.at_s));
        }
        let of_scene = |scene: &String| -> Vec<Cell> {
            let cell = |&feature: &Feature| Cell {
                scene: scene.clone(),
                feature,
                frames: plan.frames,
                size: plan.size,
                at_s: plan.at_s,
            };
            plan.feature.iter().map(cell).collect()
        };
        Ok(plan.scene.iter().flat_map(of_scene).collect())
    }

    fn adapter() -> Result<String, AppError> {
        Ok(Gpu::headless().map_err(AppError::Gpu)?.adapter)
    }

    fn new(_plan: &Plan, _out: &Path, threads: usize) -> Result<Self, AppError> {
        Ok(Self {
            threads,
            shown: Mutex::default(),
        })
    }

    fn measure(&self, cell: &Cell) -> Result<Row<Cell, Measures>, AppError> {
        let mut slot = self.shown.lock().unwrap_or_else(PoisonError::into_inner);
        let key = format!(
            "{} {:?} {} {}",
            cell.scene, cell.size, cell.at_s, cell.frames
        );
        let mut shown = match slot.take().filter(|(there, _)| *there == key) {
            Some((_, shown)) => shown,
            None => Shown::new(cell, self.threads)?,
        };
        let row = shown.row(cell);
        *slot = Some((key, shown));
        row
    }

    fn findings(rows: &[Row<Cell, Measures>]) -> Findings {
        findings(rows)
    }
}

impl Shown {
    fn new(cell: &Cell, threads: usize) -> Result<Self, AppError> {
        let mut session = Session::new(load_scene(&cell.scene, &[])?, threads)?;
        while f64::from(session.time_s()) < cell.at_s {
            session.tick();
        }
        let gpu = Gpu::headless().map_err(AppError::Gpu)?;
        Ok(Self {
            renderer: Renderer::new(gpu, &session, cell.size)?,
            points: session.points().to_vec(),
            session,
        })
    }

    fn row(&mut self, cell: &Cell) -> Result<Row<Cell, Measures>, AppError> {
        let is_on = cell.feature.is_on(&self.session.scene);
        let Some(on) = is_on else {
            return Ok(unused(cell));
        };
        let scene = self.session.scene.clone();
        self.session.scene = cell.feature.toggled(&scene);
        let rebuilt = self.renderer.rebuilt(&self.session);
        self.session.scene = scene;
        let mut other = rebuilt?;
        // By turns, so that a busy machine is as busy for both.
        let (mut with, mut without, mut costs) = (Vec::new(), Vec::new(), Vec::new());
        for frame in 0..WARM_UP + cell.frames {
            let [plain_ms, other_ms] = [&mut self.renderer, &mut other]
                .map(|renderer| draw(renderer, &self.session, &self.points, Some(frame)));
            let (plain_ms, other_ms) = (plain_ms?, other_ms?);
            let (on_ms, off_ms) = if on {
                (plain_ms, other_ms)
            } else {
                (other_ms, plain_ms)
            };
            if frame >= WARM_UP && on_ms > 0.0 {
                with.push(on_ms);
                without.push(off_ms);
                costs.push(on_ms - off_ms);
            }
        }
        draw(&mut self.renderer, &self.session, &self.points, None)?;
        draw(&mut other, &self.session, &self.points, None)?;
        let depth = self.renderer.depth()?;
        let (change_rms, changed_share) =
            change(&self.renderer.picture()?, &other.picture()?, &depth);
        let (with, without) = (Stats::of(with), Stats::of(without));
        let measures = Measures {
            is_on,
            on_ms_p50: with.map(|stats| stats.p50),
            off_ms_p50: without.map(|stats| stats.p50),
            cost_ms: Stats::of(costs).map(|stats| stats.p50),
            change_rms: finite(change_rms),
            changed_share: finite(changed_share),
            oracle: "its own picture".to_owned(),
        };
        Ok(Row {
            cell: cell.clone(),
            verdict: verdict(&measures),
            cost: Cost {
                ms_p50: with.map(|stats| stats.p50),
                ms_p95: with.map(|stats| stats.p95),
            },
            measures,
        })
    }
}

fn unused(cell: &Cell) -> Row<Cell, Measures> {
    Row {
        cell: cell.clone(),
        measures: Measures {
            is_on: None,
            on_ms_p50: None,
            off_ms_p50: None,
            cost_ms: None,
            change_rms: None,
            changed_share: None,
            oracle: "none".to_owned(),
        },
        cost: Cost::default(),
        verdict: Verdict::of(Vec::new()),
    }
}

/// GPU time [ms] of one frame of the body where it lies; nearby with a number of the frame.
fn draw(
    renderer: &mut Renderer,
    session: &Session,
    points: &[Vec3],
    frame: Option<u32>,
) -> Result<f32, AppError> {
    let orbit = renderer.scene_orbit(session);
    // All of it moves all the time, by less than is seen: the cost is that of prodding, not of sleep.
    let away = frame.map_or(0.0, |frame| 1e-5 * (1.3 * frame as f32).sin());
    let moved: Vec<Vec3> = (points.iter().enumerate())
        .map(|(i, &p)| {
            let wave = 1.0 + 0.5 * (0.1 * i as f32).sin();
            p + away * wave * Vec3::new(0.6, 0.64, 0.48)
        })
        .collect();
    // The shadow of a tool is part of what a scene's shadow is for.
    let drawn = renderer.draw(
        &moved,
        session.simulation().point_volumes(),
        &orbit,
        &session.visible_tools(),
    )?;
    Ok(drawn.passes.iter().map(|pass| pass.gpu_ms).sum())
}

/// RMS of the difference as a share of the range, and the share of covered pixels in which it is seen.
fn change(plain: &RgbaImage, other: &RgbaImage, depth: &[f32]) -> (f64, f64) {
    let (mut sum, mut seen, mut covered) = (0.0, 0_u32, 0_u32);
    let pixels = plain.pixels().zip(other.pixels());
    for ((a, b), _) in pixels.zip(depth).filter(|(_, depth)| **depth < 1.0) {
        let apart = [0, 1, 2].map(|k| a.0[k].abs_diff(b.0[k]));
        covered += 1;
        seen += u32::from(apart.into_iter().max() >= Some(SEEN_LEVELS));
        sum += apart
            .map(|d| (f64::from(d) / 255.0).powi(2))
            .iter()
            .sum::<f64>()
            / 3.0;
    }
    let all = f64::from(covered.max(1));
    ((sum / all).sqrt(), f64::from(seen) / all)
}

fn verdict(measures: &Measures) -> Verdict {
    let mut faults = Vec::new();
    let changes_nothing = measures.change_rms.is_some_and(|change| change < NOTHING);
    let share = measures
        .cost_ms
        .zip(measures.on_ms_p50)
        .map(|(cost, on)| cost / on);
    let costs = share.is_none_or(|share| share > NO_COST_SHARE);
    if measures.is_on == Some(true) && changes_nothing && costs {
        let problem = "it is on, costs time and changes nothing".to_owned();
        faults.push((State::Degraded, problem));
    }
    Verdict::of(faults)
}

fn findings(rows: &[Row<Cell, Measures>]) -> Findings {
    let used: Vec<&Row<Cell, Measures>> =
        rows.iter().filter(|r| r.measures.is_on.is_some()).collect();
    let wasted: Vec<String> = used
        .iter()
        .filter(|row| row.verdict.state != State::Fine)
        .map(|row| format!("{} of {}", row.cell.feature.name(), row.cell.scene))
        .collect();
    let lead = if wasted.is_empty() {
        "Everything that is on and costs time changes the picture.".to_owned()
    } else {
        format!(
            "On, at a cost, without changing the picture: {}.",
            wasted.join(", ")
        )
    };
    let head = [
        "scene",
        "feature",
        "by default",
        "with ms",
        "without ms",
        "cost ms",
        "change % RMS",
        "pixels %",
    ];
    let line = |row: &&Row<Cell, Measures>| {
        let percent = |value: Option<f64>| told(value.map(|v| 100.0 * v));
        let m = &row.measures;
        vec![
            row.cell.scene.clone(),
            row.cell.feature.name().to_owned(),
            if m.is_on == Some(true) { "on" } else { "off" }.to_owned(),
            told(m.on_ms_p50),
            told(m.off_ms_p50),
            told(m.cost_ms),
            percent(m.change_rms),
            percent(m.changed_share),
        ]
    };
    let svg = chart(&used).svg();
    Findings {
        svg: sheet(std::slice::from_ref(&svg), CHART_PX, 1),
        blocks: vec![
            Block::Paragraph(lead),
            Block::Chart {
                svg,
                caption: "What a feature costs against what it changes in the picture; hollow ones are off. What costs \
                          less than the timing can tell stands at the left edge."
                    .to_owned(),
            },
            Block::Table(Table {
                head: head.map(str::to_owned).to_vec(),
                rows: used.iter().map(line).collect(),
            }),
        ],
    }
}

fn chart(rows: &[&Row<Cell, Measures>]) -> ScatterChart {
    let mut clouds: Vec<Cloud> = Vec::new();
    for row in rows {
        let hollow = row.measures.is_on == Some(false);
        let label = if hollow {
            format!("{}, off", row.cell.scene)
        } else {
            row.cell.scene.clone()
        };
        let point = Point {
            x: row.measures.cost_ms.unwrap_or(0.0).max(MS_RANGE.0),
            y: row
                .measures
                .change_rms
                .map(|c| (100.0 * c).max(CHANGE_RANGE.0)),
            label: row.cell.feature.name().to_owned(),
            scale: 1.0,
        };
        match clouds.iter_mut().find(|cloud| cloud.label == label) {
            Some(cloud) => cloud.points.push(point),
            None => clouds.push(Cloud {
                label,
                look: clouds.len(),
                hollow,
                joined: false,
                points: vec![point],
            }),
        }
    }
    ScatterChart {
        size_px: CHART_PX,
        title: "What features cost and change".to_owned(),
        x_label: "GPU time of a frame, with less without [ms]".to_owned(),
        y_label: "change of the picture [% RMS]".to_owned(),
        x_range: MS_RANGE,
        y_range: CHANGE_RANGE,
        clouds,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_feature_toggled_twice_is_as_before_and_once_is_not() {
        for name in ["spleen", "liver-gooey", "heart"] {
            let scene = load_scene(name, &[]).expect("it is bundled");
            for feature in Feature::ALL {
                let Some(on) = feature.is_on(&scene) else {
                    continue;
                };
                let once = feature.toggled(&scene);
                assert_ne!(once, scene, "{name}: {feature:?}");
                // Twice is more, and lights that are gone are not made up.
                if !matches!(feature, Feature::MoreSamples | Feature::FillLights) {
                    assert_eq!(feature.is_on(&once), Some(!on), "{name}: {feature:?}");
                    assert_eq!(feature.is_on(&feature.toggled(&once)), Some(on));
                }
            }
        }
    }

    #[test]
    fn change_counts_covered_pixels_alone_and_what_changes_nothing_should_be_off() {
        let grey = |level| RgbaImage::from_pixel(2, 1, image::Rgba([level, level, level, 255]));
        let (plain, depth) = (grey(100), [0.5, 1.0]);
        let mut other = grey(100);
        other.put_pixel(1, 0, image::Rgba([0; 4]));
        assert_eq!(change(&plain, &other, &depth), (0.0, 0.0));
        other.put_pixel(0, 0, image::Rgba([151, 100, 100, 255]));
        let (rms, seen) = change(&plain, &other, &depth);
        assert!((rms - (0.04_f64 / 3.0).sqrt()).abs() < 1e-12 && seen == 1.0);
        let measures = |is_on, change_rms| Measures {
            is_on,
            on_ms_p50: None,
            off_ms_p50: None,
            cost_ms: None,
            change_rms: Some(change_rms),
            changed_share: None,
            oracle: String::new(),
        };
        assert_eq!(verdict(&measures(Some(true), 0.0)).state, State::Degraded);
        assert_eq!(verdict(&measures(Some(false), 0.0)).state, State::Fine);
        assert_eq!(verdict(&measures(Some(true), 0.01)).state, State::Fine);
    }
}
