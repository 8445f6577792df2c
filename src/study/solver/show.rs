//! Tables, charts and text of the study, from its rows alone.

use super::super::contender::Contender;
use super::super::findings::Findings;
use super::super::peers::{Peer, peers};
use super::super::sweep::Row;
use super::{Cell, Measures};
use crate::measure::chart::{number, three_digits};
use crate::measure::page::{Block, Table};
use crate::measure::scatter::{Cloud, Point, ScatterChart, range_around, sheet};
use crate::sim::SolverParams;

type SolverRow = Row<Cell, Measures>;

/// Size of one chart [px].
const CHART_PX: (f64, f64) = (520.0, 400.0);
const COLUMNS: usize = 2;
/// What the charts show of the settled and of the swing error [%].
const SETTLED_RANGE: (f64, f64) = (1e-5, 200.0);
const SWING_RANGE: (f64, f64) = (0.05, 200.0);
/// Room before the shortest time and beyond the longest.
const ROOM: [f64; 2] = [1.5, 1.8];
/// Errors that a user may ask for, of which the cheapest setting is told.
const BOUNDS: [f64; 4] = [0.02, 0.005, 0.001, 0.0001];
/// Speed that is rest [m/s].
const STILL_M_S: f64 = 1e-3;

/// What the rows say.
pub fn findings(rows: &[SolverRow]) -> Findings {
    let bodies = bodies(rows);
    let peers = peers();
    let mut charts = Vec::new();
    for body in &bodies {
        charts.push(settled_chart(body, &peers));
    }
    for body in bodies.iter().filter(|body| body.has_swing()) {
        charts.push(swing_chart(body, &peers));
    }
    let pictures: Vec<String> = charts.iter().map(|(svg, _)| svg.clone()).collect();
    let mut blocks = vec![
        Block::Paragraph(lead(&bodies)),
        Block::Charts(charts),
        Block::Paragraph(
            "The cheapest setting whose settled tip is within a bound of the oracle, that comes to rest \
             and leaves no tetrahedron inverted; processor time on one core. Other programs were measured \
             on another day, on two cores of an AMD EPYC of the Zen 5 class."
                .to_owned(),
        ),
        Block::Table(cheapest(&bodies, &peers)),
        Block::Table(all_rows(rows)),
    ];
    let limits = limits(rows);
    if !limits.rows.is_empty() {
        blocks.push(Block::Paragraph(
            "The longest substep with which a method keeps the body together through half a second of \
             undamped release, found by bisection, and the estimate that the method gives itself. A \
             method that holds with one substep a frame has no limit here and no line."
                .to_owned(),
        ));
        blocks.push(Block::Table(limits));
    }
    Findings {
        svg: sheet(&pictures, CHART_PX, COLUMNS),
        blocks,
    }
}

/// The rows of one mesh and modulus.
struct Body<'a> {
    mesh: &'a str,
    youngs_modulus_pa: f64,
    rows: Vec<&'a SolverRow>,
}

impl Body<'_> {
    fn name(&self) -> String {
        format!(
            "{}, E = {} kPa",
            self.mesh,
            number(self.youngs_modulus_pa / 1e3)
        )
    }

    fn has_swing(&self) -> bool {
        self.rows
            .iter()
            .any(|row| row.measures.swing_oracle_m.is_some())
    }

    fn peers<'p>(&self, peers: &'p [Peer]) -> Vec<&'p Peer> {
        let same = |peer: &&Peer| {
            peer.mesh == self.mesh && peer.youngs_modulus_pa == self.youngs_modulus_pa
        };
        peers.iter().filter(same).collect()
    }
}

fn bodies(rows: &[SolverRow]) -> Vec<Body<'_>> {
    let mut bodies: Vec<Body> = Vec::new();
    for row in rows {
        let (mesh, modulus) = (row.cell.mesh.as_str(), row.cell.youngs_modulus_pa);
        let same = |body: &&mut Body| body.mesh == mesh && body.youngs_modulus_pa == modulus;
        match bodies.iter_mut().find(same) {
            Some(body) => body.rows.push(row),
            None => bodies.push(Body {
                mesh,
                youngs_modulus_pa: modulus,
                rows: vec![row],
            }),
        }
    }
    bodies
}

/// Processor time of a frame on one core [ms]; by the wall where there is none.
fn ms(row: &SolverRow) -> Option<f64> {
    row.measures.cpu_ms_p50.or(row.cost.ms_p50)
}

fn setting(cell: &Cell) -> String {
    format!("{}×{}", cell.substeps, cell.iterations)
}

fn percent(error: Option<f64>) -> String {
    error.map_or_else(String::new, |error| three_digits(100.0 * error))
}

/// What the default setting does on each body.
fn lead(bodies: &[Body]) -> String {
    let default = SolverParams::default();
    let is_default = |row: &&&SolverRow| {
        let cell = &row.cell;
        (cell.method, cell.substeps, cell.iterations)
            == (Contender::AsAScene, default.substeps, default.iterations)
    };
    let mut text = format!(
        "Settled and swinging beams against a Newton solve and an implicit midpoint motion of the same \
         mesh in double precision. The default setting, {} {}×{} as a scene runs it:",
        default.method.name(),
        default.substeps,
        default.iterations
    );
    let told: Vec<String> = bodies
        .iter()
        .filter_map(|body| {
            let row = body.rows.iter().find(is_default)?;
            Some(format!(
                " {} {} % off in {} ms",
                body.name(),
                percent(row.measures.tip_error_rel),
                ms(row).map_or_else(|| "?".to_owned(), three_digits)
            ))
        })
        .collect();
    if told.is_empty() {
        text += " not among these rows";
    }
    text + &told.join(";") + "."
}

/// Settled error against time.
fn settled_chart(body: &Body, peers: &[Peer]) -> (String, String) {
    let error = |row: &SolverRow| settled_error(row);
    let peer_error = |peer: &Peer| peer.tip_error_rel.filter(|_| peer.inverted_tets == Some(0));
    let chart = chart(
        body,
        peers,
        ("settled tip error [%]", SETTLED_RANGE),
        &error,
        &peer_error,
    );
    let caption = format!(
        "Settled tip of {}: error against processor time of a frame of 1/60 s on one core. Labels are \
         substeps × iterations; lines join settings of one iteration. Hollow: other programs. Errors \
         below the axis stand on it; crosses at the top left tetrahedra inverted, exploded, or are off \
         the chart.",
        body.name()
    );
    (chart.svg(), caption)
}

/// First swing error against time.
fn swing_chart(body: &Body, peers: &[Peer]) -> (String, String) {
    let error = |row: &SolverRow| row.measures.swing_error_rel.filter(|_| !has_burst(row));
    let peer_error = |peer: &Peer| peer.swing_error_rel;
    let swung: Vec<Peer> = (peers.iter().filter(|peer| peer.swing_error_rel.is_some()))
        .cloned()
        .collect();
    let chart = chart(
        body,
        &swung,
        ("first swing error [%]", SWING_RANGE),
        &error,
        &peer_error,
    );
    let caption = format!(
        "Depth of the first undamped swing of {}: error against processor time of a frame on one core.",
        body.name()
    );
    (chart.svg(), caption)
}

/// Whether nothing is left of the body that an error could be told of.
fn has_burst(row: &SolverRow) -> bool {
    row.measures.tip_error_rel.is_none()
}

/// The error of a body that came to rest as a body.
fn settled_error(row: &SolverRow) -> Option<f64> {
    let is_whole = row.measures.inverted_tets == 0 && !has_burst(row);
    row.measures.tip_error_rel.filter(|_| is_whole)
}

fn chart(
    body: &Body,
    peers: &[Peer],
    (y_label, y_range): (&str, (f64, f64)),
    error: &dyn Fn(&SolverRow) -> Option<f64>,
    peer_error: &dyn Fn(&Peer) -> Option<f64>,
) -> ScatterChart {
    let mut clouds = Vec::new();
    for (look, method) in Contender::ALL.into_iter().enumerate() {
        let of_method = body.rows.iter().filter(|row| row.cell.method == method);
        let (single, more): (Vec<&SolverRow>, Vec<&SolverRow>) =
            of_method.partition(|row| row.cell.iterations == 1);
        let points = |rows: Vec<&SolverRow>| -> Vec<Point> {
            let point = |row: &&SolverRow| {
                Some(Point {
                    x: ms(row)?,
                    y: error(row).map(|e| 100.0 * e),
                    label: setting(&row.cell),
                    scale: 1.0,
                })
            };
            rows.iter().filter_map(point).collect()
        };
        let (single, more) = (points(single), points(more));
        if !single.is_empty() || !more.is_empty() {
            clouds.push(Cloud {
                label: method.name().to_owned(),
                look,
                hollow: false,
                joined: true,
                points: single,
            });
            clouds.push(Cloud {
                label: String::new(),
                look,
                hollow: false,
                joined: false,
                points: more,
            });
        }
    }
    let others: Vec<Point> = (body.peers(peers).into_iter())
        .map(|peer| Point {
            x: peer.ms,
            y: peer_error(peer).map(|e| 100.0 * e),
            label: peer.label(),
            scale: 1.0,
        })
        .collect();
    if !others.is_empty() {
        clouds.push(Cloud {
            label: "other programs".to_owned(),
            look: Contender::ALL.len(),
            hollow: true,
            joined: false,
            points: others,
        });
    }
    let times = clouds
        .iter()
        .flat_map(|cloud| &cloud.points)
        .map(|point| point.x);
    ScatterChart {
        size_px: CHART_PX,
        title: body.name(),
        x_label: "processor time of a frame, one core [ms]".to_owned(),
        y_label: y_label.to_owned(),
        x_range: range_around(times, ROOM),
        y_range,
        clouds,
    }
}

/// The cheapest setting for each bound, ours and that of another program.
fn cheapest(bodies: &[Body], peers: &[Peer]) -> Table {
    let mut rows = Vec::new();
    for body in bodies {
        for bound in BOUNDS {
            let within = |error: Option<f64>| error.is_some_and(|error| error <= bound);
            let still = |speed: Option<f64>| speed.is_none_or(|speed| speed <= STILL_M_S);
            let ours = (body.rows.iter())
                .filter(|row| within(settled_error(row)) && still(row.measures.speed_left_m_s))
                .filter_map(|row| Some((ms(row)?, row)))
                .min_by(|a, b| a.0.total_cmp(&b.0));
            let theirs = (body.peers(peers).into_iter())
                .filter(|peer| within(peer.tip_error_rel) && still(peer.speed_left_m_s))
                .filter(|peer| peer.inverted_tets == Some(0))
                .min_by(|a, b| a.ms.total_cmp(&b.ms));
            let ratio = ours.zip(theirs).map(|((ms, _), peer)| peer.ms / ms);
            let (our_name, our_ms) = ours.map_or_else(none, |(ms, row)| {
                let name = format!("{} {}", row.cell.method.name(), setting(&row.cell));
                (name, three_digits(ms))
            });
            let (their_name, their_ms) = theirs.map_or_else(none, |peer| {
                (
                    format!("{} ({})", peer.label(), peer.precision),
                    three_digits(peer.ms),
                )
            });
            rows.push(vec![
                body.name(),
                format!("{} %", number(100.0 * bound)),
                our_name,
                our_ms,
                their_name,
                their_ms,
                ratio.map_or_else(String::new, three_digits),
            ]);
        }
    }
    table(
        &[
            "body",
            "within",
            "cheapest of ours (f32)",
            "ms",
            "cheapest of others",
            "ms",
            "ratio",
        ],
        rows,
    )
}

fn none() -> (String, String) {
    ("none".to_owned(), String::new())
}

fn all_rows(rows: &[SolverRow]) -> Table {
    let cells = |row: &SolverRow| {
        let (cell, m) = (&row.cell, &row.measures);
        let optional = |value: Option<f64>| value.map_or_else(String::new, three_digits);
        vec![
            cell.mesh.clone(),
            number(cell.youngs_modulus_pa / 1e3),
            cell.method.name().to_owned(),
            setting(cell),
            optional(m.cpu_ms_p50),
            optional(row.cost.ms_p50),
            optional(m.ms_p50_two_threads),
            percent(m.tip_error_rel),
            percent(m.field_rms_error_rel),
            percent(m.swing_error_rel),
            m.swing_frame
                .map_or_else(String::new, |frame| frame.to_string()),
            optional(m.fifth_swing_ratio),
            m.inverted_tets.to_string(),
            optional(m.speed_left_m_s.map(|speed| 1e3 * speed)),
            row.verdict.state.name().to_owned(),
            row.verdict.why.clone(),
        ]
    };
    table(
        &[
            "mesh",
            "E kPa",
            "method",
            "setting",
            "cpu ms",
            "ms",
            "ms, 2 threads",
            "tip %",
            "field %",
            "swing %",
            "at frame",
            "fifth/first",
            "inverted",
            "left mm/s",
            "state",
            "why",
        ],
        rows.iter().map(cells).collect(),
    )
}

/// Stability limits that were found: a line a body and method.
fn limits(rows: &[SolverRow]) -> Table {
    let mut lines: Vec<Vec<String>> = Vec::new();
    for row in rows {
        let Some(found) = row.measures.stable_substep_s else {
            continue;
        };
        if row.cell.method == Contender::AsAScene {
            continue;
        }
        let estimate = row.measures.stable_substep_estimate_s;
        let line = vec![
            row.cell.mesh.clone(),
            number(row.cell.youngs_modulus_pa / 1e3),
            row.cell.method.name().to_owned(),
            three_digits(1e3 * found),
            estimate.map_or_else(String::new, |estimate| three_digits(1e3 * estimate)),
        ];
        if !lines.contains(&line) {
            lines.push(line);
        }
    }
    table(
        &["mesh", "E kPa", "method", "found ms", "estimate ms"],
        lines,
    )
}

fn table(head: &[&str], rows: Vec<Vec<String>>) -> Table {
    Table {
        head: head.iter().map(|&word| word.to_owned()).collect(),
        rows,
    }
}
