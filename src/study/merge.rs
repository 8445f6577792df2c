//! `palpate study merge OUT DIR…`: the parts of a study joined to the very result of one run.

use super::Study;
use super::document::{Document, Header};
use super::output::{self, json_file};
use super::run::{DocumentOf, cells_of};
use super::shard::Shard;
use super::sweep::{RowOf, Sweep, key};
use crate::app::{AppError, Outcome, thread_count};
use crate::measure::files::create_folder;
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// Cells named in a message; the rest are counted.
const NAMED_MAX: usize = 4;

/// The studies that all of `parts` hold, in order.
///
/// # Errors
///
/// [`AppError::Usage`] naming a folder without a finished study, one that holds others than the
/// first, and a part that would be replaced by the result.
pub fn studies_in(out: &Path, parts: &[PathBuf]) -> Result<Vec<Study>, AppError> {
    let held = |part: &PathBuf| -> Vec<Study> {
        let finished = |study: &Study| json_file(part, *study).is_file();
        Study::ALL.into_iter().filter(finished).collect()
    };
    let names = |studies: &[Study]| -> String {
        let names: Vec<&str> = studies.iter().map(|study| study.name()).collect();
        names.join(" and ")
    };
    let first = held(&parts[0]);
    let real = |folder: &Path| folder.canonicalize().ok();
    for part in parts {
        let studies = held(part);
        if studies.is_empty() {
            return Err(AppError::Usage(format!(
                "{} holds no finished study: run its part again to finish it",
                part.display()
            )));
        }
        if studies != first {
            return Err(AppError::Usage(format!(
                "the parts are of different studies: {} holds {}, {} holds {}",
                parts[0].display(),
                names(&first),
                part.display(),
                names(&studies)
            )));
        }
        if real(part).is_some_and(|part| real(out) == Some(part)) {
            return Err(AppError::Usage(format!(
                "the result would replace the part in {}: give another folder for it",
                part.display()
            )));
        }
    }
    Ok(first)
}

/// Joins the parts of one study.
///
/// # Errors
///
/// [`AppError`] naming the part that does not fit, or the cells that are missing or there twice.
pub fn merge<S: Sweep>(out: &Path, parts: &[PathBuf]) -> Result<Outcome, AppError> {
    let documents: Vec<(&PathBuf, DocumentOf<S>)> = parts
        .iter()
        .map(|part| Ok((part, Document::read(&json_file(part, S::STUDY))?)))
        .collect::<Result<_, AppError>>()?;
    let (first_part, first) = &documents[0];
    for (part, document) in &documents[1..] {
        let differences = first.header.differences(&document.header);
        if !differences.is_empty() {
            return Err(AppError::Usage(format!(
                "{} and {} can't be joined: they differ in {}",
                first_part.display(),
                part.display(),
                differences.join(" and ")
            )));
        }
    }
    let header = joined(documents.iter().map(|(_, document)| &document.header));
    let cells = cells_of::<S>(&header.plan)?;
    let of = first.header.shard.map(Shard::of);
    let mut rows = gathered::<S>(documents)?;
    let missing: Vec<usize> = (0..cells.len())
        .filter(|&cell| !rows.contains_key(&key(&cells[cell])))
        .collect();
    if !missing.is_empty() {
        return Err(missing_cells::<S>(&cells, &missing, of));
    }
    let document = Document {
        header,
        rows: cells
            .iter()
            .map(|cell| rows.remove(&key(cell)).expect("no cell is missing"))
            .collect(),
    };
    if let Some(stray) = rows.keys().next() {
        return Err(AppError::Usage(format!(
            "a part holds {stray}, which is no cell of this study"
        )));
    }
    create_folder(out)?;
    S::finish(&document.header.plan, out, thread_count(None))?;
    output::write::<S>(out, &document)?;
    Ok(Outcome::Done)
}

/// The header of the whole, with every machine named once.
fn joined<'a, P: Clone + 'a>(headers: impl Iterator<Item = &'a Header<P>>) -> Header<P> {
    headers
        .map(|header| Header {
            shard: None,
            ..header.clone()
        })
        .reduce(|mut whole, part| {
            if !whole.cpu.split(" + ").any(|cpu| cpu == part.cpu) {
                whole.cpu = format!("{} + {}", whole.cpu, part.cpu);
            }
            whole.threads = whole.threads.max(part.threads);
            whole
        })
        .expect("at least one part is merged")
}

/// All rows by their cell.
fn gathered<S: Sweep>(
    documents: Vec<(&PathBuf, DocumentOf<S>)>,
) -> Result<HashMap<String, RowOf<S>>, AppError> {
    let mut rows = HashMap::new();
    let mut homes: HashMap<String, &PathBuf> = HashMap::new();
    for (part, document) in documents {
        for row in document.rows {
            let cell = key(&row.cell);
            if let Some(home) = homes.insert(cell.clone(), part) {
                return Err(AppError::Usage(format!(
                    "{} and {} both hold the cell {cell}: leave one of them out",
                    home.display(),
                    part.display()
                )));
            }
            rows.insert(cell, row);
        }
    }
    Ok(rows)
}

fn missing_cells<S: Sweep>(cells: &[S::Cell], missing: &[usize], of: Option<usize>) -> AppError {
    let named: Vec<String> = missing
        .iter()
        .take(NAMED_MAX)
        .map(|&cell| key(&cells[cell]))
        .collect();
    let more = missing.len() - named.len();
    let more = if more > 0 {
        format!(" and {more} more")
    } else {
        String::new()
    };
    let remedy = of.map_or_else(String::new, |of| {
        let mut shards: Vec<Shard> = missing
            .iter()
            .map(|&cell| Shard::holding(cell, of))
            .collect();
        shards.sort_unstable();
        shards.dedup();
        let shards: Vec<String> = shards.iter().map(Shard::to_string).collect();
        format!("; add the folder of --shard {}", shards.join(", "))
    });
    AppError::Usage(format!(
        "{} of {} cells are missing: {}{more}{remedy}",
        missing.len(),
        cells.len(),
        named.join(" ")
    ))
}
