//! Tables and charts of the study, from its rows alone.

use super::super::findings::{Findings, told};
use super::super::sweep::Row;
use super::deform::Deformation;
use super::{Cell, Measures};
use crate::geom::plane::LightPathMethod;
use crate::measure::chart::{number, three_digits};
use crate::measure::page::{Block, Table};
use crate::measure::scatter::{Cloud, Point, ScatterChart, range_around, sheet};
use crate::measure::stats::Stats;

type PlanesRow = Row<Cell, Measures>;

const CHART_PX: (f64, f64) = (470.0, 340.0);
const COLUMNS: usize = 2;
/// Stale planes by the kinder reading of the thesis: they keep their place in the body, and do not turn with it.
pub const MOVED_ALONG: &str = "stale, moved along";
/// Where a method without a pass stands [ms].
const NO_PASS_MS: f64 = 0.004;
/// Room beyond the smallest and the largest value of the charts.
const ROOM: [f64; 2] = [1.6; 2];
/// The size of mesh that charts show, or what is nearest to it.
const SHOWN_VERTICES: u32 = 10_000;

/// What the rows say.
pub fn findings(rows: &[PlanesRow]) -> Findings {
    let Some(shown) = shown_body(rows) else {
        return Findings {
            svg: sheet(&[], CHART_PX, 1),
            blocks: vec![Block::Table(drifts(rows))],
        };
    };
    let shown: Vec<&PlanesRow> = rows.iter().filter(|row| of_body(row, &shown)).collect();
    let mut charts = charts(&shown);
    let points = || {
        let clouds = charts.iter().flat_map(|(_, chart)| &chart.clouds);
        clouds.flat_map(|cloud| &cloud.points)
    };
    let x_range = range_around(points().map(|point| point.x), ROOM);
    let y_range = range_around(points().filter_map(|point| point.y), ROOM);
    for (_, chart) in &mut charts {
        (chart.x_range, chart.y_range) = (x_range, y_range);
    }
    let charts: Vec<(String, String)> = (charts.into_iter())
        .map(|(title, chart)| (title, chart.svg()))
        .collect();
    let mut blocks = vec![Block::Paragraph(lead(&shown))];
    blocks.push(Block::Charts(
        charts
            .iter()
            .map(|(title, svg)| (svg.clone(), format!("{title}: {}", name_of(&shown))))
            .collect(),
    ));
    blocks.push(Block::Paragraph(
        "Error of radiance [%] by deformation, method and radius of the patches as a share of the size; \
         front and grazing light."
            .to_owned(),
    ));
    blocks.push(Block::Table(errors(&shown)));
    blocks.push(Block::Paragraph(
        "The same by light, where the body is poked, with planes blended as published, with stale planes \
         moved along but not turned, and the error of the way itself: means over all deformations but rest and ripples, at the third radius or the last."
            .to_owned(),
    ));
    blocks.push(Block::Table(kinds(&shown)));
    blocks.push(Block::Paragraph(
        "GPU time of a frame by the share of points that moves, in a poke; points to a patch; how far fits are from \
         f64."
        .to_owned(),
    ));
    blocks.push(Block::Table(costs(rows)));
    blocks.push(Block::Paragraph(
        "Every body: error of radiance [%], mean over all deformations but rest and ripples."
            .to_owned(),
    ));
    blocks.push(Block::Table(bodies(rows)));
    let drifts = drifts(rows);
    if !drifts.rows.is_empty() {
        blocks.push(Block::Paragraph(
            "Long runs: how far fits are from f64 at the end.".to_owned(),
        ));
        blocks.push(Block::Table(drifts));
    }
    let svgs: Vec<String> = charts.into_iter().map(|(_, svg)| svg).collect();
    Findings {
        svg: sheet(&svgs, CHART_PX, COLUMNS),
        blocks,
    }
}

/// Name and points of a body.
type BodyOf = (String, u32);

fn body_of(row: &PlanesRow) -> BodyOf {
    (row.cell.body.clone(), row.measures.vertices)
}

fn of_body(row: &PlanesRow, body: &BodyOf) -> bool {
    is_short(row) && row.cell.body == body.0 && row.measures.vertices == body.1
}

/// Not one of the long runs.
fn is_short(row: &PlanesRow) -> bool {
    row.cell.sights > 0
}

/// The first body, as near to the shown size as it comes.
fn shown_body(rows: &[PlanesRow]) -> Option<BodyOf> {
    let first = rows.iter().find(|row| is_short(row))?;
    let same = rows
        .iter()
        .filter(|row| is_short(row) && row.cell.body == first.cell.body);
    same.map(body_of)
        .min_by_key(|(_, vertices)| vertices.abs_diff(SHOWN_VERTICES))
}

fn name_of(shown: &[&PlanesRow]) -> String {
    shown.first().map_or_else(String::new, |row| {
        let name = row.cell.body.rsplit(['/', '\\']).next().unwrap_or_default();
        format!("{name}, {} points", row.measures.vertices)
    })
}

/// Values in the order in which they first appear.
fn distinct<T: PartialEq>(values: impl Iterator<Item = T>) -> Vec<T> {
    let mut found = Vec::new();
    for value in values {
        if !found.contains(&value) {
            found.push(value);
        }
    }
    found
}

fn methods(rows: &[&PlanesRow]) -> Vec<LightPathMethod> {
    distinct(rows.iter().map(|row| row.cell.method))
}

fn radii(rows: &[&PlanesRow]) -> Vec<f64> {
    distinct(rows.iter().map(|row| row.cell.radius_share))
}

/// The row of a point with the largest share that moves.
fn row_of<'a>(
    rows: &[&'a PlanesRow],
    method: LightPathMethod,
    deformation: Deformation,
    radius_share: f64,
) -> Option<&'a PlanesRow> {
    let matching = rows.iter().filter(|row| {
        row.cell.method == method
            && row.cell.skip_optical_depth == 0.0
            && row.cell.deformation == deformation
            && row.cell.radius_share == radius_share
    });
    matching
        .max_by(|a, b| a.cell.moved_share.total_cmp(&b.cell.moved_share))
        .copied()
}

fn percent(error: Option<f64>) -> String {
    error.map_or_else(|| "-".to_owned(), |error| three_digits(100.0 * error))
}

fn share_name(share: f64) -> String {
    format!("{} %", number(100.0 * share))
}

/// A chart of all deformations together and one of each: title and itself.
fn charts(rows: &[&PlanesRow]) -> Vec<(String, ScatterChart)> {
    let deformations = distinct(rows.iter().map(|row| row.cell.deformation));
    let together = chart(rows, "moved, mean", |method, radius, measure| {
        Some((
            median_ms(rows, method, radius),
            mean(rows, method, radius, measure)?,
        ))
    });
    let each = deformations.into_iter().map(|deformation| {
        chart(rows, deformation.name(), |method, radius, measure| {
            let measures = &row_of(rows, method, deformation, radius)?.measures;
            Some((measures.refit_ms_p50, measure(measures)?))
        })
    });
    std::iter::once(together).chain(each).collect()
}

/// A number of a row's measures.
type Measure = fn(&Measures) -> Option<f64>;

/// Cost [ms], if there is a pass, and error of radiance by `of`, a method and a radius: a point a radius, the larger the
/// farther the patches reach.
fn chart(
    rows: &[&PlanesRow],
    title: &str,
    of: impl Fn(LightPathMethod, f64, Measure) -> Option<(Option<f64>, f64)>,
) -> (String, ScatterChart) {
    let radii = radii(rows);
    let points = |method, measure: Measure| -> Vec<Point> {
        let indexed = radii.iter().enumerate();
        indexed
            .filter_map(|(index, &radius)| {
                let (ms, error) = of(method, radius, measure)?;
                Some(Point {
                    x: ms.unwrap_or(0.0).max(NO_PASS_MS),
                    y: Some(100.0 * error),
                    label: String::new(),
                    scale: 0.6 + 0.2 * index as f64,
                })
            })
            .collect()
    };
    let mut clouds: Vec<Cloud> = LightPathMethod::ALL
        .into_iter()
        .enumerate()
        .filter(|(_, method)| methods(rows).contains(method))
        .map(|(look, method)| Cloud {
            label: method.name().to_owned(),
            look,
            hollow: false,
            joined: true,
            points: points(method, |m| m.radiance_error_rel),
        })
        .collect();
    let along = points(LightPathMethod::Stale, |m| m.radiance_error_unturned_rel);
    if !along.is_empty() {
        clouds.push(Cloud {
            label: MOVED_ALONG.to_owned(),
            look: LightPathMethod::ALL.len(),
            hollow: true,
            joined: true,
            points: along,
        });
    }
    let chart = ScatterChart {
        size_px: CHART_PX,
        title: format!("{title}; {}", sizes(rows)),
        x_label: format!("GPU time of the refit [ms]; at {NO_PASS_MS}: no pass"),
        y_label: "error of radiance [%]".to_owned(),
        x_range: (1.0, 10.0),
        y_range: (1.0, 10.0),
        clouds,
    };
    (title.to_owned(), chart)
}

/// Time of a method's pass [ms] in the middle of the deformations that [`mean`] is over: a single one may have been
/// measured in a busy moment.
fn median_ms(rows: &[&PlanesRow], method: LightPathMethod, radius: f64) -> Option<f64> {
    let times = moved().filter_map(|deformation| {
        row_of(rows, method, deformation, radius)?
            .measures
            .refit_ms_p50
    });
    Some(Stats::of(times.map(|ms| ms as f32))?.p50)
}

/// What the sizes of the markers mean.
fn sizes(rows: &[&PlanesRow]) -> String {
    let radii: Vec<String> = radii(rows).into_iter().map(|r| number(100.0 * r)).collect();
    format!("radius {} %, small to large", radii.join(", "))
}

fn errors(rows: &[&PlanesRow]) -> Table {
    let radii = radii(rows);
    let mut head = vec!["deformation".to_owned(), "method".to_owned()];
    head.extend(radii.iter().map(|&radius| share_name(radius)));
    let mut lines = Vec::new();
    for deformation in distinct(rows.iter().map(|row| row.cell.deformation)) {
        for method in methods(rows) {
            let mut line = vec![deformation.name().to_owned(), method.name().to_owned()];
            line.extend(radii.iter().map(|&radius| {
                let row = row_of(rows, method, deformation, radius);
                percent(row.and_then(|row| row.measures.radiance_error_rel))
            }));
            lines.push(line);
            if method == LightPathMethod::Stale {
                let mut line = vec![deformation.name().to_owned(), MOVED_ALONG.to_owned()];
                line.extend(radii.iter().map(|&radius| {
                    let row = row_of(rows, method, deformation, radius);
                    percent(row.and_then(|row| row.measures.radiance_error_unturned_rel))
                }));
                lines.push(line);
            }
        }
    }
    Table { head, rows: lines }
}

/// The deformations that a single primitive can follow.
fn moved() -> impl Iterator<Item = Deformation> {
    let follows = |d: &Deformation| !matches!(d, Deformation::Rest | Deformation::Ripple);
    Deformation::ALL.into_iter().filter(follows)
}

/// Mean of a measure over [`moved`].
fn mean(
    rows: &[&PlanesRow],
    method: LightPathMethod,
    radius: f64,
    measure: impl Fn(&Measures) -> Option<f64>,
) -> Option<f64> {
    let values: Vec<f64> = moved()
        .filter_map(|deformation| measure(&row_of(rows, method, deformation, radius)?.measures))
        .collect();
    (!values.is_empty()).then(|| values.iter().sum::<f64>() / values.len() as f64)
}

fn middle_radius(rows: &[&PlanesRow]) -> f64 {
    let radii = radii(rows);
    radii.get(2).or(radii.last()).copied().unwrap_or(0.0)
}

fn kinds(rows: &[&PlanesRow]) -> Table {
    let radius = middle_radius(rows);
    let poke = |method, measure: fn(&Measures) -> Option<f64>| {
        row_of(rows, method, Deformation::Poke, radius).and_then(|row| measure(&row.measures))
    };
    let rest = |method| {
        row_of(rows, method, Deformation::Rest, radius)
            .and_then(|row| row.measures.radiance_error_rel)
    };
    let head = [
        "method",
        "rest",
        "moved",
        "front",
        "graze",
        "back",
        "poked part",
        "with shadows",
        "published",
        "moved along",
        "‖KM‖",
    ];
    let lines = methods(rows).into_iter().map(|method| {
        let of =
            |measure: fn(&Measures) -> Option<f64>| percent(mean(rows, method, radius, measure));
        vec![
            method.name().to_owned(),
            percent(rest(method)),
            of(|m| m.radiance_error_rel),
            of(|m| m.radiance_error_front_rel),
            of(|m| m.radiance_error_graze_rel),
            of(|m| m.radiance_error_back_rel),
            percent(poke(method, |m| m.radiance_error_poked_rel)),
            of(|m| m.radiance_error_with_shadows_rel),
            of(|m| m.radiance_error_published_rel),
            of(|m| m.radiance_error_unturned_rel),
            of(|m| m.km_error_rel),
        ]
    });
    Table {
        head: head.map(str::to_owned).to_vec(),
        rows: lines.collect(),
    }
}

fn costs(rows: &[PlanesRow]) -> Table {
    let head = [
        "body",
        "points",
        "radius",
        "to a patch",
        "moving",
        "method",
        "passed over",
        "refitted",
        "ms p50",
        "of full %",
        "p99 degrees",
        "kernel p99.9",
    ];
    let poked = rows
        .iter()
        .filter(|row| is_short(row) && row.cell.deformation == Deformation::Poke);
    let poked: Vec<&PlanesRow> = poked.collect();
    let full_ms = |row: &PlanesRow| {
        let same = poked.iter().find(|other| {
            other.cell.method == LightPathMethod::Full
                && body_of(other) == body_of(row)
                && other.cell.radius_share == row.cell.radius_share
                && other.cell.moved_share == row.cell.moved_share
        });
        same.and_then(|row| row.measures.refit_ms_p50)
    };
    let line = |row: &&PlanesRow| {
        let measures = &row.measures;
        let ms = measures.refit_ms_p50;
        let share = ms.zip(full_ms(row)).map(|(ms, full)| 100.0 * ms / full);
        vec![
            name_of(&[row]),
            measures.vertices.to_string(),
            share_name(row.cell.radius_share),
            three_digits(measures.patch_members),
            share_name(row.cell.moved_share),
            row.cell.method.name().to_owned(),
            number(row.cell.skip_optical_depth),
            measures.refitted.to_string(),
            told(ms),
            told(share),
            told(measures.normal_error_deg_p99),
            told(measures.kernel_error_deg_p999),
        ]
    };
    let has_pass = |row: &&&PlanesRow| row.cell.method != LightPathMethod::Tangent;
    Table {
        head: head.map(str::to_owned).to_vec(),
        rows: poked.iter().filter(has_pass).map(line).collect(),
    }
}

fn bodies(rows: &[PlanesRow]) -> Table {
    let short: Vec<&PlanesRow> = rows.iter().filter(|row| is_short(row)).collect();
    let methods = methods(&short);
    let mut head = vec!["body".to_owned(), "radius".to_owned()];
    head.extend(methods.iter().map(|method| method.name().to_owned()));
    head.push(MOVED_ALONG.to_owned());
    let mut lines = Vec::new();
    for body in distinct(short.iter().map(|row| body_of(row))) {
        let own: Vec<&PlanesRow> = short
            .iter()
            .copied()
            .filter(|row| of_body(row, &body))
            .collect();
        for radius in radii(&own) {
            let mut line = vec![name_of(&own), share_name(radius)];
            line.extend(
                methods
                    .iter()
                    .map(|&method| percent(mean(&own, method, radius, |m| m.radiance_error_rel))),
            );
            let stale = LightPathMethod::Stale;
            line.push(percent(mean(&own, stale, radius, |m| {
                m.radiance_error_unturned_rel
            })));
            lines.push(line);
        }
    }
    Table { head, rows: lines }
}

fn drifts(rows: &[PlanesRow]) -> Table {
    let head = [
        "method",
        "frames",
        "from the origin [m]",
        "kernel p99.9 degrees",
        "p99 degrees",
    ];
    let line = |row: &PlanesRow| {
        vec![
            row.cell.method.name().to_owned(),
            row.cell.frames.to_string(),
            number(row.cell.origin_m),
            told(row.measures.kernel_error_deg_p999),
            told(row.measures.normal_error_deg_p99),
        ]
    };
    Table {
        head: head.map(str::to_owned).to_vec(),
        rows: rows.iter().filter(|row| !is_short(row)).map(line).collect(),
    }
}

/// The answer in a few sentences.
fn lead(rows: &[&PlanesRow]) -> String {
    let radius = middle_radius(rows);
    let moved = |method| mean(rows, method, radius, |m| m.radiance_error_rel);
    let mut ranked: Vec<(LightPathMethod, f64)> = methods(rows)
        .into_iter()
        .filter_map(|method| Some((method, moved(method)?)))
        .collect();
    ranked.sort_by(|a, b| a.1.total_cmp(&b.1));
    let order: Vec<String> = ranked
        .iter()
        .map(|(method, error)| format!("{} {} %", method.name(), three_digits(100.0 * error)))
        .collect();
    let poked = |method| {
        row_of(rows, method, Deformation::Poke, radius)
            .and_then(|row| row.measures.radiance_error_poked_rel)
    };
    let mut text = format!(
        "{}, patches of {} of the size. Error of radiance over poke, twist, bend, stretch and fold, best first: {}.",
        name_of(rows),
        share_name(radius),
        order.join(", ")
    );
    if let (Some((best, _)), Some(stale)) = (ranked.first(), poked(LightPathMethod::Stale))
        && let Some(error) = poked(*best)
    {
        text += &format!(
            " Where the body is poked, {} is {} times as good as stale planes.",
            best.name(),
            three_digits(stale / error)
        );
        let along = row_of(rows, LightPathMethod::Stale, Deformation::Poke, radius)
            .and_then(|row| row.measures.radiance_error_unturned_poked_rel);
        if let Some(along) = along {
            text += &format!(
                " If those moved along with their points, unturned, it would be {} times.",
                three_digits(along / error)
            );
        }
    }
    text
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::sweep::{Cost, Verdict};

    fn row(method: LightPathMethod, deformation: Deformation, ms: f64, error: f64) -> PlanesRow {
        Row {
            cell: Cell {
                method,
                body: "blob".to_owned(),
                size_m: 0.15,
                vertices_asked: Some(2500),
                deformation,
                radius_share: 0.1,
                skip_optical_depth: 0.0,
                moved_share: 1.0,
                frames: 3,
                origin_m: 0.0,
                sights: 10,
            },
            measures: Measures {
                vertices: 2562,
                patch_members: 52.0,
                moved: 2562,
                refitted: 2562,
                refit_ms_p50: Some(ms),
                refit_ms_p95: Some(ms),
                normal_error_deg_p99: Some(0.1),
                kernel_error_deg_p999: Some(0.01),
                km_error_rel: Some(error),
                radiance_error_rel: Some(error),
                radiance_error_front_rel: None,
                radiance_error_graze_rel: None,
                radiance_error_back_rel: None,
                radiance_error_poked_rel: Some(error),
                radiance_error_with_shadows_rel: None,
                radiance_error_published_rel: None,
                radiance_error_unturned_rel: None,
                radiance_error_unturned_poked_rel: None,
                oracle: String::new(),
            },
            cost: Cost::default(),
            verdict: Verdict::of(Vec::new()),
        }
    }

    #[test]
    fn findings_rank_methods_by_their_error_and_tell_cost_as_a_share_of_full() {
        let rows = [
            row(LightPathMethod::Tangent, Deformation::Poke, 0.0, 0.2),
            row(LightPathMethod::Stale, Deformation::Poke, 0.02, 0.4),
            row(LightPathMethod::Full, Deformation::Poke, 4.0, 0.1),
            row(LightPathMethod::Incremental, Deformation::Poke, 1.0, 0.11),
        ];
        let findings = findings(&rows);
        let text = findings.text().replace('\n', " ");
        assert!(
            text.contains("full 10.0 %, incremental 11.0 %, tangent 20.0 %, stale 40.0 %"),
            "{text}"
        );
        assert!(
            text.contains("full is 4.00 times as good as stale"),
            "{text}"
        );
        let costs = costs(&rows);
        assert_eq!(costs.rows.len(), 3, "tangent planes have no pass");
        assert_eq!(costs.rows[2][9], "25.0");
        assert_eq!(findings.svg.matches("error of radiance").count(), 2);
        assert!(
            findings.svg.contains("tangent"),
            "a method without a pass is shown"
        );
    }
}
