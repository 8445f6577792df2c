//! Table and chart of the study, from its rows alone.

use super::super::findings::Findings;
use super::super::sweep::{Row, State};
use super::{Cell, Measures, Shape};
use crate::measure::chart::{number, three_digits};
use crate::measure::page::{Block, Table};
use crate::measure::scatter::{Cloud, Point, ScatterChart, sheet};

type PokesRow = Row<Cell, Measures>;

const CHART_PX: (f64, f64) = (640.0, 380.0);
/// What the chart shows of the penetration [%].
const DEPTH_RANGE: (f64, f64) = (0.01, 100.0);

/// What the rows say.
pub fn findings(rows: &[PokesRow]) -> Findings {
    let groups = groups(rows);
    let svg = chart(&groups).svg();
    Findings {
        svg: sheet(std::slice::from_ref(&svg), CHART_PX, 1),
        blocks: vec![
            Block::Paragraph(lead(rows)),
            Block::Chart {
                svg,
                caption: "Deepest that the tool reached into the surface over all pokes of a speed, as a share of the \
                          thickness under the tool. The goal is 1 %. Crosses at the top: speeds at which a \
                          poke was not finite, left tetrahedra inverted, or had a part of the tool's axis inside."
                    .to_owned(),
            },
            Block::Table(table(&groups)),
        ],
    }
}

/// All rows of one organ, method and speed.
struct Group<'a> {
    scene: &'a str,
    method: &'static str,
    shape: Shape,
    speed_m_s: f64,
    rows: Vec<&'a PokesRow>,
}

impl Group<'_> {
    fn sum(&self, count: impl Fn(&Measures) -> u32) -> u32 {
        self.rows.iter().map(|row| count(&row.measures)).sum()
    }

    fn pokes(&self) -> u32 {
        self.rows.iter().map(|row| row.cell.pokes).sum()
    }

    /// Deepest penetration, as a share; infinite if it is unknown.
    fn deepest(&self) -> f64 {
        let depth = |row: &&PokesRow| row.measures.penetration_share_max.unwrap_or(f64::INFINITY);
        self.rows.iter().map(depth).fold(0.0, f64::max)
    }

    fn has_failed(&self) -> bool {
        self.sum(|m| m.not_finite + m.lasting_inversions + m.tunnelled) > 0
    }
}

fn groups(rows: &[PokesRow]) -> Vec<Group<'_>> {
    let mut groups: Vec<Group> = Vec::new();
    for row in rows {
        let (scene, method) = (row.cell.scene.as_str(), row.cell.method.name());
        let (shape, speed_m_s) = (row.cell.shape, row.cell.speed_m_s);
        let same = |group: &&mut Group| {
            (group.scene, group.method, group.shape, group.speed_m_s)
                == (scene, method, shape, speed_m_s)
        };
        match groups.iter_mut().find(same) {
            Some(group) => group.rows.push(row),
            None => groups.push(Group {
                scene,
                method,
                shape,
                speed_m_s,
                rows: vec![row],
            }),
        }
    }
    groups
}

fn lead(rows: &[PokesRow]) -> String {
    let sum = |count: &dyn Fn(&Measures) -> u32| -> u32 {
        rows.iter().map(|row| count(&row.measures)).sum()
    };
    let pokes: u32 = rows.iter().map(|row| row.cell.pokes).sum();
    let failed = rows
        .iter()
        .filter(|row| row.verdict.state == State::Failed)
        .count();
    format!(
        "{pokes} pokes in {} simulations: {} not finite, {} left tetrahedra inverted, {} had a part of the \
         tool's axis inside, {} reached deeper into the surface than 1 % of the thickness. {failed} simulations failed.",
        rows.len(),
        sum(&|m| m.not_finite),
        sum(&|m| m.lasting_inversions),
        sum(&|m| m.tunnelled),
        sum(&|m| m.too_deep),
    )
}

fn chart(groups: &[Group]) -> ScatterChart {
    let mut clouds: Vec<Cloud> = Vec::new();
    for group in groups {
        let label = format!("{}, {}, {}", group.scene, group.method, group.shape.name());
        let point = Point {
            x: group.speed_m_s,
            y: (!group.has_failed()).then(|| 100.0 * group.deepest()),
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
    }
    let speeds = groups.iter().map(|group| group.speed_m_s);
    let (low, high) = speeds.fold((f64::MAX, 0.0_f64), |(low, high), speed| {
        (low.min(speed), high.max(speed))
    });
    ScatterChart {
        size_px: CHART_PX,
        title: "Depth of the tool in the tissue".to_owned(),
        x_label: "speed of the tool [m/s]".to_owned(),
        y_label: "share of the thickness [%]".to_owned(),
        x_range: (low / 1.5, high * 1.5),
        y_range: DEPTH_RANGE,
        clouds,
    }
}

fn table(groups: &[Group]) -> Table {
    let head = [
        "organ",
        "method",
        "tool",
        "m/s",
        "pokes",
        "not finite",
        "inverted after",
        "tool inside",
        "over 1 %",
        "deepest %",
        "off rest %",
        "force N",
        "ms p50",
        "ms p95",
    ];
    let line = |group: &Group| {
        let largest = |value: &dyn Fn(&PokesRow) -> Option<f64>| {
            let values = group.rows.iter().filter_map(|row| value(row));
            values
                .reduce(f64::max)
                .map_or_else(String::new, three_digits)
        };
        vec![
            group.scene.to_owned(),
            group.method.to_owned(),
            group.shape.name().to_owned(),
            number(group.speed_m_s),
            group.pokes().to_string(),
            group.sum(|m| m.not_finite).to_string(),
            group.sum(|m| m.lasting_inversions).to_string(),
            group.sum(|m| m.tunnelled).to_string(),
            group.sum(|m| m.too_deep).to_string(),
            three_digits(100.0 * group.deepest()),
            largest(&|row| row.measures.off_rest_share.map(|share| 100.0 * share)),
            largest(&|row| row.measures.force_max_n),
            largest(&|row| row.cost.ms_p50),
            largest(&|row| row.cost.ms_p95),
        ]
    };
    Table {
        head: head.map(str::to_owned).to_vec(),
        rows: groups.iter().map(line).collect(),
    }
}
