//! A prodding that was simulated: how far off each method is while a bundled organ is pushed and pulled by its script.

use super::body::Body;
use super::estimate::{Blend, Drawn, errors_of};
use super::show::MOVED_ALONG;
use super::sight::{Truth, all_lights};
use super::trial::Bench;
use crate::app::{AppError, Session, load_scene};
use crate::geom::plane::LightPathMethod;
use crate::measure::chart::{LineChart, Series};
use crate::measure::files;
use crate::passes::frame::light_radius_m;
use glam::{DVec3, Vec3};
use std::fmt::Write;
use std::path::Path;

/// The organs whose scripts are followed.
const SCENES: [&str; 2] = ["spleen", "liver"];
/// Frames between two looks, and the last that is looked at: push, slide, pull and release.
const FRAMES_BETWEEN: u32 = 12;
const FRAMES: u32 = 168;
/// What the charts show: all other planes lie on `full`.
const SHOWN: [LightPathMethod; 5] = [
    LightPathMethod::Tangent,
    LightPathMethod::Stale,
    LightPathMethod::Full,
    LightPathMethod::Quadric,
    LightPathMethod::DepthMap,
];
/// Pressed or pulled is what has gone at least this share of the farthest way of any point.
const PRODDED_SHARE: f32 = 0.5;
/// Nobody is prodded yet where nothing has gone farther than this share of the organ.
const PRODDED_SIZES_MIN: f32 = 0.005;
const CHART_PX: (f64, f64) = (720.0, 360.0);

/// How far off a method is at one time of a script.
struct Look {
    scene: &'static str,
    time_s: f64,
    method: String,
    radiance_error_rel: Option<f64>,
    /// Where the organ is pressed or pulled; nothing while it is not.
    prodded_error_rel: Option<f64>,
    with_shadows_error_rel: Option<f64>,
}

/// Writes `planes-prod.csv` and a chart of it for each organ into `out`.
///
/// # Errors
///
/// [`AppError`] if an organ can't be loaded, the GPU fails or a file can't be written.
pub fn write(bench: &Bench, sights: u32, out: &Path) -> Result<(), AppError> {
    let mut looks = Vec::new();
    for scene in SCENES {
        looks.extend(follow(bench, scene, sights)?);
    }
    files::write(&out.join("planes-prod.csv"), csv(&looks).as_bytes())?;
    for scene in SCENES {
        let own: Vec<&Look> = looks.iter().filter(|look| look.scene == scene).collect();
        let file = out.join(format!("planes-prod-{scene}.svg"));
        files::write(&file, chart(&own).svg().as_bytes())?;
    }
    Ok(())
}

fn follow(bench: &Bench, name: &'static str, sights: u32) -> Result<Vec<Look>, AppError> {
    let scene = load_scene(name, &[])?;
    let radius_m = light_radius_m(&scene);
    let mut session = Session::new(scene, bench.threads())?;
    let body = Body::as_it_lies(session.mesh.clone());
    let lights = all_lights(&body);
    let mut stages = LightPathMethod::ALL
        .into_iter()
        .map(|method| Ok((method, bench.stage(&body, method, radius_m)?)))
        .collect::<Result<Vec<_>, AppError>>()?;
    let mut looks = Vec::new();
    for frame in 0..=FRAMES {
        let points = session.points().to_vec();
        // Every frame, since some fits follow what has moved since the last.
        for (_, stage) in &mut stages {
            stage.untimed_frame(&points);
        }
        if frame % FRAMES_BETWEEN == 0 {
            let pose: Vec<DVec3> = points.iter().map(|p| p.as_dvec3()).collect();
            let reach_m = f64::from(radius_m);
            let mut truth = Truth::new(&body, &pose, reach_m, sights as usize, bench.threads());
            let ways_m: Vec<f32> = (points.iter().zip(&body.mesh.points))
                .map(|(now, rest)| now.distance(*rest))
                .collect();
            let farthest_m = ways_m.iter().copied().fold(0.0, f32::max);
            let is_prodded = farthest_m > PRODDED_SIZES_MIN * body.size_m;
            for sight in &mut truth.sights {
                let way_m = sight.corners.map(|corner| ways_m[corner as usize]);
                let way_m = Vec3::from_array(way_m).dot(sight.shares);
                sight.is_poked = is_prodded && way_m > PRODDED_SHARE * farthest_m;
            }
            let time_s = f64::from((100.0 * session.time_s()).round()) / 100.0;
            let mut look = |method: &str, drawn: &Drawn| {
                let errors = errors_of(&truth, drawn, Blend::Squared);
                looks.push(Look {
                    scene: name,
                    time_s,
                    method: method.to_owned(),
                    radiance_error_rel: errors.radiance,
                    prodded_error_rel: errors.poked,
                    with_shadows_error_rel: errors.shadowed,
                });
            };
            for (method, stage) in &mut stages {
                let drawn = stage.drawn(&points, &lights)?;
                look(method.name(), &drawn);
                if *method == LightPathMethod::Stale {
                    let rest: &[Vec3] = &body.mesh.points;
                    look(MOVED_ALONG, &drawn.moved_along(rest, &points));
                }
            }
        }
        session.tick();
    }
    Ok(looks)
}

fn csv(looks: &[Look]) -> String {
    let told = |error: Option<f64>| error.map_or_else(String::new, |error| error.to_string());
    let mut csv =
        "scene,time_s,method,radiance_error_rel,prodded_error_rel,with_shadows_error_rel\n"
            .to_owned();
    for look in looks {
        writeln!(
            csv,
            "{},{},\"{}\",{},{},{}",
            look.scene,
            look.time_s,
            look.method,
            told(look.radiance_error_rel),
            told(look.prodded_error_rel),
            told(look.with_shadows_error_rel)
        )
        .expect("a string takes all that is written to it");
    }
    csv
}

/// Error of radiance over time, a line a method.
fn chart(looks: &[&Look]) -> LineChart {
    let mut series: Vec<Series> = Vec::new();
    for look in looks {
        let method = SHOWN.iter().find(|method| method.name() == look.method);
        let Some((method, error)) = method.zip(look.radiance_error_rel) else {
            continue;
        };
        let point = (look.time_s, 100.0 * error);
        match series.iter_mut().find(|line| line.label == look.method) {
            Some(line) => line.points.push(point),
            None => series.push(Series {
                label: look.method.clone(),
                // As in the other charts of the study.
                look: LightPathMethod::ALL
                    .iter()
                    .position(|m| m == method)
                    .unwrap_or(0),
                points: vec![point],
            }),
        }
    }
    LineChart {
        size_px: CHART_PX,
        x_label: "time of the script [s]".to_owned(),
        y_label: "error of radiance [%]".to_owned(),
        series,
        levels: Vec::new(),
        ceiling: None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn looks_are_told_a_line_each_and_drawn_a_line_a_method() {
        let look = |time_s: f64, method: &str, error| Look {
            scene: "spleen",
            time_s,
            method: method.to_owned(),
            radiance_error_rel: error,
            prodded_error_rel: None,
            with_shadows_error_rel: None,
        };
        let looks = [
            look(0.0, "full", Some(0.1)),
            look(0.2, "full", Some(0.12)),
            look(0.2, "stale, moved along", None),
        ];
        let csv = csv(&looks);
        assert_eq!(csv.lines().count(), 4);
        assert!(
            csv.contains("spleen,0.2,\"stale, moved along\",,,"),
            "{csv}"
        );
        let chart = chart(&looks.iter().collect::<Vec<_>>());
        assert_eq!(chart.series.len(), 1);
        assert_eq!(chart.series[0].points, [(0.0, 10.0), (0.2, 12.0)]);
    }
}
