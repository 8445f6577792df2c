//! One run of a study: its cells measured, its rows kept on the way, its files written.

use super::document::{Document, Header};
use super::journal::Journal;
use super::output;
use super::plan::with_sets;
use super::shard::Shard;
use super::sweep::{RowOf, Sweep, key};
use super::{StudyOptions, VERSION};
use crate::app::{AppError, Outcome};
use crate::measure::files::create_folder;
use crate::measure::report::machine;
use indicatif::{ProgressBar, ProgressStyle};
use std::collections::{HashMap, HashSet};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicUsize, Ordering};
use std::sync::mpsc;

/// The file of a study as it is written.
pub type DocumentOf<S> = Document<<S as Sweep>::Plan, RowOf<S>>;

/// Measures the cells that are left, and writes the files of the study.
///
/// # Errors
///
/// [`AppError`] naming the setting or file that can't be used.
pub fn run<S: Sweep>(options: &StudyOptions) -> Result<Outcome, AppError> {
    let plan = with_sets(S::plan(options.quick), &options.sets)?;
    let cells = cells_of::<S>(&plan)?;
    let cells = options
        .shard
        .map_or(cells.clone(), |shard| shard.deal(cells));
    let out = options
        .out
        .clone()
        .unwrap_or_else(|| default_out(options.shard));
    let header = Header {
        study: S::STUDY,
        version: VERSION.0.to_owned(),
        commit: VERSION.1.to_owned(),
        adapter: S::adapter()?,
        cpu: machine(),
        threads: options.threads,
        shard: options.shard,
        plan,
    };
    create_folder(&out)?;
    refuse_other_part::<S>(&out, &header)?;
    let journal_path = out.join(format!("{}.partial.jsonl", S::STUDY.name()));
    let (mut journal, done): (Journal, Vec<RowOf<S>>) = Journal::open(&journal_path, &header)?;
    let mut rows: HashMap<String, RowOf<S>> =
        done.into_iter().map(|row| (key(&row.cell), row)).collect();
    if !rows.is_empty() {
        eprintln!(
            "{} of {} cells were measured before",
            rows.len(),
            cells.len()
        );
    }
    let left: Vec<&S::Cell> = cells
        .iter()
        .filter(|cell| !rows.contains_key(&key(cell)))
        .collect();
    if !left.is_empty() {
        let sweep = S::new(&header.plan, &out, options.threads)?;
        let at_once = if S::SIDE_BY_SIDE { options.threads } else { 1 };
        let bar = progress_bar(cells.len() as u64).with_position(rows.len() as u64);
        measure_all(&sweep, &left, at_once, |row| {
            journal.add(&row)?;
            rows.insert(key(&row.cell), row);
            bar.inc(1);
            Ok(())
        })?;
        bar.finish_and_clear();
    }
    if options.shard.is_none() {
        S::finish(&header.plan, &out, options.threads)?;
    }
    let in_order = |cell: &S::Cell| rows.remove(&key(cell)).expect("every cell has its row");
    let document = Document {
        header,
        rows: cells.iter().map(in_order).collect(),
    };
    output::write::<S>(&out, &document)?;
    journal.remove()?;
    Ok(Outcome::Done)
}

/// The cells of a plan, each once.
///
/// # Errors
///
/// [`AppError::Usage`] if a value is out of range or nothing is left to measure.
pub fn cells_of<S: Sweep>(plan: &S::Plan) -> Result<Vec<S::Cell>, AppError> {
    let refuse = |problem: String| AppError::Usage(format!("study {}: {problem}", S::STUDY.name()));
    let mut cells = S::cells(plan).map_err(refuse)?;
    let mut seen = HashSet::new();
    cells.retain(|cell| seen.insert(key(cell)));
    if cells.is_empty() {
        let problem = "no cell is left by these settings: a list is empty or its values don't meet";
        return Err(refuse(problem.to_owned()));
    }
    Ok(cells)
}

fn default_out(shard: Option<Shard>) -> PathBuf {
    PathBuf::from("out").join(match shard {
        None => "study".to_owned(),
        Some(shard) => format!("study-{}", shard.to_string().replace('/', "-of-")),
    })
}

/// Refuses a folder in which this part would replace another part of a study.
fn refuse_other_part<S: Sweep>(out: &Path, header: &Header<S::Plan>) -> Result<(), AppError> {
    let file = output::json_file(out, S::STUDY);
    let Ok(found) = DocumentOf::<S>::read(&file) else {
        return Ok(());
    };
    match (found.header.shard, header.shard) {
        (Some(there), here) if here != Some(there) => Err(AppError::Usage(format!(
            "{} holds part {there}: give each part a folder of its own with --out",
            file.display()
        ))),
        _ => Ok(()),
    }
}

fn progress_bar(cells: u64) -> ProgressBar {
    ProgressBar::new(cells).with_style(
        ProgressStyle::with_template("{bar:40} {pos}/{len} cells, {eta} left")
            .expect("a sound template"),
    )
}

/// Measures `cells`, so many `at_once`, and hands each row to `keep` as it comes. Stops at the
/// first error.
fn measure_all<S: Sweep>(
    sweep: &S,
    cells: &[&S::Cell],
    at_once: usize,
    mut keep: impl FnMut(RowOf<S>) -> Result<(), AppError>,
) -> Result<(), AppError> {
    let next = AtomicUsize::new(0);
    std::thread::scope(|scope| {
        let (send, receive) = mpsc::channel();
        for _ in 0..at_once.min(cells.len()) {
            let (send, next) = (send.clone(), &next);
            scope.spawn(move || {
                while let Some(cell) = cells.get(next.fetch_add(1, Ordering::Relaxed)) {
                    // The receiver goes away at the first error: nothing more is wanted.
                    if send.send(sweep.measure(cell)).is_err() {
                        break;
                    }
                }
            });
        }
        drop(send);
        receive.into_iter().try_for_each(|row| keep(row?))
    })
}
