//! Maps, envelope and tables of the study, from its rows alone.

use super::super::contender::Contender;
use super::super::findings::Findings;
use super::super::sweep::{Row, State, Sweep};
use super::fault::Fault;
use super::{Cell, Deed, Kind, Measures, Mesh, Stability, Start, base, departures};
use crate::measure::chart::{number, three_digits};
use crate::measure::map::{MapChart, Panel, Tile};
use crate::measure::page::{Block, Table};
use crate::measure::scatter::stack;

type StabilityRow = Row<Cell, Measures>;

/// Failed cells of the default method that are listed; the rest are counted.
const LISTED_MAX: usize = 40;

/// What the rows say.
pub fn findings(rows: &[StabilityRow]) -> Findings {
    let maps = [
        map_of_moduli_and_substeps(rows),
        map_of_touches(rows),
        map_of_starts(rows),
        map_of_ratios(rows),
    ];
    let maps: Vec<&MapChart> = maps.iter().flatten().collect();
    let pictures: Vec<_> = maps.iter().map(|map| (map.svg(), map.size_px())).collect();
    let mut blocks = vec![Block::Paragraph(lead(rows))];
    blocks.extend(maps.iter().map(|map| Block::Chart {
        svg: map.svg(),
        caption: "Each tile is the worst of the cells at its two values; tools and wrecks with nothing else \
                  changed. Nothing was measured where there is no tile."
            .to_owned(),
    }));
    blocks.push(Block::Paragraph(
        "The envelope: the largest modulus up to which no cell failed, for so many substeps or more, whatever \
         the other knobs (mesh, Poisson's ratio, time step, damping, tool, start); with the number of cells in \
         it."
            .to_owned(),
    ));
    blocks.push(Block::Table(envelope(rows)));
    blocks.push(Block::Paragraph(
        "The same as one number: h² (λ+2μ) / (ρ dx²), with h the substep and dx the edge of a mean tetrahedron, \
         below which no hanging or standing body failed."
            .to_owned(),
    ));
    blocks.push(Block::Table(stiffness(rows)));
    let recovery = recovery(rows);
    if !recovery.rows.is_empty() {
        blocks.push(Block::Paragraph(
            "Frames until a wrecked body stays within 2 % of its size (RMS) of its settled state without a \
             newly inverted tetrahedron, with nothing but the start changed."
                .to_owned(),
        ));
        blocks.push(Block::Table(recovery));
    }
    blocks.push(Block::Paragraph(
        "Failed cells by their worst fault.".to_owned(),
    ));
    blocks.push(Block::Table(faults(rows)));
    let listed = failed_of_default(rows);
    if !listed.rows.is_empty() {
        blocks.push(Block::Paragraph(format!(
            "What failed with the default method, {}, at most {LISTED_MAX} of them; NAME.csv has all.",
            Contender::AsAScene.name()
        )));
        blocks.push(Block::Table(listed));
    }
    Findings {
        svg: stack(&pictures),
        blocks,
    }
}

fn lead(rows: &[StabilityRow]) -> String {
    let methods = methods(rows).into_iter().map(|method| {
        let of = |state| {
            let here =
                |row: &&StabilityRow| row.cell.method == method && row.verdict.state == state;
            rows.iter().filter(here).count()
        };
        format!(
            "{}: {} fine, {} degraded, {} failed",
            method.name(),
            of(State::Fine),
            of(State::Degraded),
            of(State::Failed)
        )
    });
    format!(
        "{} cells on bodies of a thousand to five thousand tetrahedra. Fine means: it sags by less than 10 % \
         more or less than the static solution, is left with less than 1 mm/s, 5 % of volume, 1 % of the thickness \
         inside the tool; degraded: sags by less than twice as much or half as much, is left with less than 0.1 m/s, \
         20 %, 10 %. Bodies are kept awake. {}.",
        rows.len(),
        methods.collect::<Vec<_>>().join("; ")
    )
}

/// Values in the order of a list, each once.
fn distinct<T: PartialEq>(values: impl Iterator<Item = T>) -> Vec<T> {
    let mut all = Vec::new();
    for value in values {
        if !all.contains(&value) {
            all.push(value);
        }
    }
    all
}

fn ascending(values: impl Iterator<Item = f64>) -> Vec<f64> {
    let mut values = distinct(values);
    values.sort_by(f64::total_cmp);
    values
}

fn methods(rows: &[StabilityRow]) -> Vec<Contender> {
    distinct(rows.iter().map(|row| row.cell.method))
}

fn meshes(rows: &[StabilityRow]) -> Vec<Mesh> {
    let mut meshes = distinct(rows.iter().map(|row| row.cell.mesh));
    meshes.sort_unstable();
    meshes
}

fn tile(row: &StabilityRow) -> Tile {
    match row.verdict.state {
        State::Fine => Tile::Fine,
        State::Degraded => Tile::Degraded,
        State::Failed => Tile::Failed,
    }
}

/// A panel of the rows that pass `filter`, placed by the index of two of their values.
fn panel<X: PartialEq, Y: PartialEq>(
    title: String,
    rows: &[&StabilityRow],
    filter: impl Fn(&StabilityRow) -> bool,
    (columns, x): (&[X], impl Fn(&StabilityRow) -> X),
    (lines, y): (&[Y], impl Fn(&StabilityRow) -> Y),
) -> Panel {
    let place = |row: &&StabilityRow| {
        let column = columns.iter().position(|value| *value == x(row))?;
        let line = lines.iter().position(|value| *value == y(row))?;
        Some((column, line, tile(row)))
    };
    let here = rows.iter().copied().filter(|row| filter(row));
    Panel {
        title,
        points: here.filter_map(|row| place(&row)).collect(),
    }
}

fn of_kind(rows: &[StabilityRow], kind: Kind) -> Vec<&StabilityRow> {
    rows.iter().filter(|row| row.cell.kind() == kind).collect()
}

/// Rows of a kind in which only what `reset` sets back is not as in the base setting.
fn nothing_else_changed(
    rows: &[StabilityRow],
    kind: Kind,
    reset: impl Fn(&mut Cell, &Cell),
) -> Vec<&StabilityRow> {
    let base = base(&Stability::plan(false));
    let is_plain = |row: &&StabilityRow| {
        let mut cell = row.cell.clone();
        reset(&mut cell, &base);
        departures(&cell, &base) == 0
    };
    of_kind(rows, kind).into_iter().filter(is_plain).collect()
}

fn moduli(rows: &[&StabilityRow]) -> Vec<f64> {
    ascending(rows.iter().map(|row| row.cell.youngs_modulus_pa))
}

fn words(values: &[f64]) -> Vec<String> {
    values.iter().map(|&value| number(value)).collect()
}

/// Modulus against substep, a panel a method and mesh.
fn map_of_moduli_and_substeps(rows: &[StabilityRow]) -> Option<MapChart> {
    let hanging = of_kind(rows, Kind::Hang);
    let substeps = distinct(hanging.iter().map(|row| row.cell.substep_s()));
    let mut substeps = substeps;
    substeps.sort_by(|a, b| b.total_cmp(a));
    let moduli = moduli(&hanging);
    let meshes = meshes(rows);
    let panels = methods(rows).into_iter().flat_map(|method| {
        let (hanging, substeps, moduli) = (&hanging, &substeps, &moduli);
        meshes.iter().map(move |&mesh| {
            panel(
                format!("{}, {}", method.name(), mesh.name()),
                hanging,
                |row| (row.cell.method, row.cell.mesh) == (method, mesh),
                (substeps, |row| row.cell.substep_s()),
                (moduli, |row| row.cell.youngs_modulus_pa),
            )
        })
    });
    let panels: Vec<Panel> = panels.collect();
    let milliseconds = |s: &f64| number((1e5 * s).round() / 1e2);
    (!hanging.is_empty()).then(|| MapChart {
        title: "Hanging and standing bodies: modulus against substep".to_owned(),
        x_label: "substep [ms]".to_owned(),
        columns: substeps.iter().map(milliseconds).collect(),
        y_label: "E [Pa]".to_owned(),
        rows: words(&moduli),
        panels_across: meshes.len(),
        panels,
    })
}

/// Modulus against the speed of the tool, a row of panels for each thing it does.
fn map_of_touches(rows: &[StabilityRow]) -> Option<MapChart> {
    let touched = nothing_else_changed(rows, Kind::Touch, |cell, base| {
        cell.tool_speed_m_s = base.tool_speed_m_s;
        cell.youngs_modulus_pa = base.youngs_modulus_pa;
    });
    let speeds = ascending(touched.iter().map(|row| row.cell.tool_speed_m_s));
    let mut deeds: Vec<Deed> = distinct(touched.iter().map(|row| row.cell.deed));
    deeds.sort_unstable();
    let moduli = moduli(&touched);
    let methods = methods(rows);
    let panels = deeds.into_iter().flat_map(|deed| {
        let (touched, speeds, moduli) = (&touched, &speeds, &moduli);
        methods.iter().map(move |&method| {
            panel(
                format!("{}, {}", method.name(), deed.name()),
                touched,
                |row| (row.cell.method, row.cell.deed) == (method, deed),
                (speeds, |row| row.cell.tool_speed_m_s),
                (moduli, |row| row.cell.youngs_modulus_pa),
            )
        })
    });
    let panels: Vec<Panel> = panels.collect();
    (!touched.is_empty()).then(|| MapChart {
        title: "Bodies under a tool: modulus against its speed".to_owned(),
        x_label: "speed [m/s]".to_owned(),
        columns: words(&speeds),
        y_label: "E [Pa]".to_owned(),
        rows: words(&moduli),
        panels_across: methods.len(),
        panels,
    })
}

/// Start against mesh.
fn map_of_starts(rows: &[StabilityRow]) -> Option<MapChart> {
    let wrecked = nothing_else_changed(rows, Kind::Wreck, |cell, base| {
        cell.mesh = base.mesh;
        cell.start = base.start;
    });
    let meshes = meshes(rows);
    let mut starts: Vec<Start> = distinct(wrecked.iter().map(|row| row.cell.start));
    starts.sort_unstable();
    let panels = |method: Contender| {
        panel(
            method.name().to_owned(),
            &wrecked,
            |row| row.cell.method == method,
            (&meshes, |row| row.cell.mesh),
            (&starts, |row| row.cell.start),
        )
    };
    let methods = methods(rows);
    (!wrecked.is_empty()).then(|| MapChart {
        title: "Wrecked bodies: start against mesh".to_owned(),
        x_label: "mesh".to_owned(),
        columns: meshes.iter().map(|mesh| mesh.name().to_owned()).collect(),
        y_label: "start".to_owned(),
        rows: starts.iter().map(|start| start.name().to_owned()).collect(),
        panels_across: methods.len(),
        panels: methods.into_iter().map(panels).collect(),
    })
}

/// Modulus against Poisson's ratio.
fn map_of_ratios(rows: &[StabilityRow]) -> Option<MapChart> {
    let hanging = nothing_else_changed(rows, Kind::Hang, |cell, base| {
        cell.poisson_ratio = base.poisson_ratio;
        cell.youngs_modulus_pa = base.youngs_modulus_pa;
    });
    let ratios = ascending(hanging.iter().map(|row| row.cell.poisson_ratio));
    let moduli = moduli(&hanging);
    let substeps = base(&Stability::plan(false)).substeps;
    let panels = |method: Contender| {
        panel(
            method.name().to_owned(),
            &hanging,
            |row| row.cell.method == method,
            (&ratios, |row| row.cell.poisson_ratio),
            (&moduli, |row| row.cell.youngs_modulus_pa),
        )
    };
    let methods = methods(rows);
    (ratios.len() > 1).then(|| MapChart {
        title: format!(
            "Hanging and standing bodies, {substeps} substeps: modulus against Poisson's ratio"
        ),
        x_label: "ν".to_owned(),
        columns: words(&ratios),
        y_label: "E [Pa]".to_owned(),
        rows: words(&moduli),
        panels_across: methods.len(),
        panels: methods.into_iter().map(panels).collect(),
    })
}

/// For each method and number of substeps, the largest modulus up to which nothing failed.
fn envelope(rows: &[StabilityRow]) -> Table {
    let mut substeps = distinct(rows.iter().map(|row| row.cell.substeps));
    substeps.sort_unstable();
    let kinds = [Kind::Hang, Kind::Touch, Kind::Wreck];
    let mut lines = Vec::new();
    for method in methods(rows) {
        for &at_least in &substeps {
            let mut line = vec![method.name().to_owned(), at_least.to_string()];
            for kind in kinds {
                let inside: Vec<&StabilityRow> = rows
                    .iter()
                    .filter(|row| row.cell.method == method && row.cell.kind() == kind)
                    .filter(|row| row.cell.substeps >= at_least)
                    .collect();
                line.push(match largest_safe_modulus(&inside) {
                    Some((modulus, cells)) => format!("E ≤ {} Pa ({cells})", number(modulus)),
                    None if inside.is_empty() => String::new(),
                    None => "none".to_owned(),
                });
            }
            lines.push(line);
        }
    }
    table(
        &[
            "method",
            "substeps ≥",
            "hangs or stands",
            "under a tool",
            "wrecked",
        ],
        lines,
    )
}

/// The largest modulus of the rows such that no row of it or a smaller one failed, and how many rows
/// that are.
fn largest_safe_modulus(rows: &[&StabilityRow]) -> Option<(f64, usize)> {
    let failed = rows.iter().filter(|row| row.verdict.state == State::Failed);
    let softest_failed = failed
        .map(|row| row.cell.youngs_modulus_pa)
        .fold(f64::INFINITY, f64::min);
    let safe = || {
        let moduli = rows.iter().map(|row| row.cell.youngs_modulus_pa);
        moduli.filter(|modulus| *modulus < softest_failed)
    };
    safe()
        .reduce(f64::max)
        .map(|modulus| (modulus, safe().count()))
}

/// h² (λ+2μ) / (ρ dx²) below which no hanging body failed.
fn stiffness(rows: &[StabilityRow]) -> Table {
    let lines = methods(rows).into_iter().map(|method| {
        let mut hanging: Vec<&StabilityRow> = of_kind(rows, Kind::Hang)
            .into_iter()
            .filter(|row| row.cell.method == method)
            .collect();
        hanging.sort_by(|a, b| {
            let number = |row: &StabilityRow| row.measures.stiffness_number;
            number(a).total_cmp(&number(b))
        });
        let safe = hanging
            .iter()
            .take_while(|row| row.verdict.state != State::Failed)
            .count();
        let number_of = |row: &&StabilityRow| three_digits(row.measures.stiffness_number);
        vec![
            method.name().to_owned(),
            safe.checked_sub(1)
                .map_or("none".to_owned(), |last| number_of(&hanging[last])),
            safe.to_string(),
            hanging.get(safe).map_or_else(String::new, |row| {
                format!("at {}: {}", number_of(row), row.verdict.why)
            }),
        ]
    });
    table(
        &["method", "none failed up to", "cells", "the next"],
        lines.collect(),
    )
}

/// Frames to recover for each method and start, with nothing else changed.
fn recovery(rows: &[StabilityRow]) -> Table {
    let wrecked = nothing_else_changed(rows, Kind::Wreck, |cell, base| {
        cell.mesh = base.mesh;
        cell.start = base.start;
    });
    let mut starts: Vec<Start> = distinct(wrecked.iter().map(|row| row.cell.start));
    starts.sort_unstable();
    let mut lines = Vec::new();
    for method in methods(rows) {
        for mesh in meshes(rows) {
            for &start in &starts {
                let frames: Vec<Option<u32>> = wrecked
                    .iter()
                    .filter(|row| {
                        let cell = &row.cell;
                        (cell.method, cell.mesh, cell.start) == (method, mesh, start)
                    })
                    .map(|row| row.measures.frames_to_recover)
                    .collect();
                if frames.is_empty() {
                    continue;
                }
                let mut back: Vec<u32> = frames.iter().copied().flatten().collect();
                back.sort_unstable();
                let at = |index: usize| back.get(index).map_or_else(String::new, u32::to_string);
                lines.push(vec![
                    method.name().to_owned(),
                    mesh.name().to_owned(),
                    start.name().to_owned(),
                    format!("{} of {}", back.len(), frames.len()),
                    at(back.len() / 2),
                    at(back.len().saturating_sub(1)),
                ]);
            }
        }
    }
    table(
        &[
            "method",
            "mesh",
            "start",
            "recovered",
            "median frame",
            "latest",
        ],
        lines,
    )
}

/// Failed cells, counted by fault and method.
fn faults(rows: &[StabilityRow]) -> Table {
    let methods = methods(rows);
    let head: Vec<&str> = std::iter::once("fault")
        .chain(methods.iter().map(|method| method.name()))
        .collect();
    let failed = |fault: Fault, method: Contender| {
        let here = |row: &&StabilityRow| {
            row.cell.method == method
                && row.measures.fault == Some(fault)
                && row.verdict.state == State::Failed
        };
        rows.iter().filter(here).count()
    };
    let lines = Fault::ALL.into_iter().map(|fault| {
        let counts = methods
            .iter()
            .map(|&method| failed(fault, method).to_string());
        std::iter::once(fault.name().to_owned())
            .chain(counts)
            .collect()
    });
    table(&head, lines.collect())
}

fn failed_of_default(rows: &[StabilityRow]) -> Table {
    let default = Contender::AsAScene;
    let failed =
        |row: &&StabilityRow| row.cell.method == default && row.verdict.state == State::Failed;
    let line = |row: &StabilityRow| {
        let cell = &row.cell;
        let tool = match cell.tool_speed_m_s {
            0.0 => String::new(),
            speed => format!("{} at {} m/s", cell.deed.name(), number(speed)),
        };
        vec![
            cell.mesh.name().to_owned(),
            number(cell.youngs_modulus_pa),
            number(cell.poisson_ratio),
            three_digits(1e3 * cell.timestep_s),
            cell.substeps.to_string(),
            number(cell.damping_per_s),
            tool,
            cell.start.name().to_owned(),
            row.verdict.why.clone(),
        ]
    };
    table(
        &[
            "mesh",
            "E Pa",
            "ν",
            "dt ms",
            "substeps",
            "damping 1/s",
            "tool",
            "start",
            "why",
        ],
        rows.iter()
            .filter(failed)
            .take(LISTED_MAX)
            .map(line)
            .collect(),
    )
}

fn table(head: &[&str], rows: Vec<Vec<String>>) -> Table {
    Table {
        head: head.iter().map(|&word| word.to_owned()).collect(),
        rows,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::sweep::{Cost, Verdict};

    fn row(youngs_modulus_pa: f64, substeps: u32, state: State) -> StabilityRow {
        Row {
            cell: Cell {
                method: Contender::XpbdNeoHookean,
                mesh: Mesh::Regular,
                youngs_modulus_pa,
                poisson_ratio: 0.45,
                timestep_s: 1.0 / 60.0,
                substeps,
                iterations: 1,
                damping_per_s: 10.0,
                tool_speed_m_s: 0.0,
                deed: Deed::Poke,
                start: Start::Rest,
                seed: 0,
            },
            measures: Measures {
                stiffness_number: youngs_modulus_pa / f64::from(substeps).powi(2),
                fault: (state == State::Failed).then_some(Fault::Explodes),
                ..Measures::default()
            },
            cost: Cost::default(),
            verdict: Verdict {
                state,
                why: state.name().to_owned(),
            },
        }
    }

    #[test]
    fn envelope_ends_below_the_softest_failure_and_grows_with_substeps() {
        let rows = [
            row(1e3, 1, State::Fine),
            row(1e4, 1, State::Failed),
            row(1e5, 1, State::Fine),
            row(1e3, 20, State::Fine),
            row(1e4, 20, State::Degraded),
            row(1e5, 20, State::Fine),
        ];
        let table = envelope(&rows);
        assert_eq!(table.rows[0][1..3], ["1", "E ≤ 1000 Pa (2)"]);
        assert_eq!(table.rows[1][1..3], ["20", "E ≤ 1·10⁵ Pa (3)"]);
        // Sabotage: with the softest cell failed there is no envelope.
        let mut worse = rows.to_vec();
        worse[0] = row(1e3, 1, State::Failed);
        assert_eq!(envelope(&worse).rows[0][2], "none");
    }

    #[test]
    fn stiffness_number_ends_at_the_first_failure() {
        let rows = [
            row(1e5, 1, State::Fine),
            row(1e4, 1, State::Failed),
            row(1e3, 1, State::Fine),
        ];
        let table = stiffness(&rows);
        assert_eq!(table.rows[0][1..3], ["1000", "1"]);
        assert!(table.rows[0][3].contains("failed"));
    }

    #[test]
    fn maps_and_tables_of_any_rows_can_be_drawn() {
        for rows in [vec![], vec![row(1e3, 1, State::Failed)]] {
            let findings = findings(&rows);
            assert!(!findings.svg.contains("NaN"));
            assert!(!findings.text().is_empty());
        }
    }
}
