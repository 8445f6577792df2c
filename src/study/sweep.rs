//! What a study is made of: a plan, the cells that follow from it, and a row for each.

use super::Study;
use super::findings::Findings;
use crate::app::AppError;
use serde::de::DeserializeOwned;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// A study: a list of cells, how one is measured, and how the rows are shown.
pub trait Sweep: Sync + Sized {
    /// Which one it is.
    const STUDY: Study;
    /// Whether cells may be measured side by side: true where their times are not the point.
    const SIDE_BY_SIDE: bool;
    /// Lists of values, from which the cells follow. `--set` replaces values by their dotted key.
    type Plan: Serialize + DeserializeOwned + Clone + PartialEq;
    /// The knobs of one point, fit to be told apart by their JSON.
    type Cell: Serialize + DeserializeOwned + Clone + Sync + Send;
    /// What is measured of it. A value that could not be measured is `None`.
    type Measures: Serialize + DeserializeOwned + Send;

    /// The plan of a run: of a few minutes, or of less than one.
    fn plan(quick: bool) -> Self::Plan;

    /// The cells of a plan, in the order of the rows.
    ///
    /// # Errors
    ///
    /// The value that can't be used, with the allowed range.
    fn cells(plan: &Self::Plan) -> Result<Vec<Self::Cell>, String>;

    /// The GPU adapter that times and results depend on; `"none"` for a study that needs no GPU.
    ///
    /// # Errors
    ///
    /// [`AppError::Gpu`] if it needs one and there is none.
    fn adapter() -> Result<String, AppError> {
        Ok("none".to_owned())
    }

    /// Reads and makes what all cells share. `out` is where costly oracles are kept.
    ///
    /// # Errors
    ///
    /// [`AppError`] naming a file of the plan that can't be used.
    fn new(plan: &Self::Plan, out: &Path, threads: usize) -> Result<Self, AppError>;

    /// Measures one cell.
    ///
    /// # Errors
    ///
    /// [`AppError`] if a file can't be read or written; a method that fails is a row, not an error.
    fn measure(&self, cell: &Self::Cell) -> Result<RowOf<Self>, AppError>;

    /// Writes what is no row, such as pictures, into `out` once all cells are measured: at the end of a run of the
    /// whole, or where its parts are joined.
    ///
    /// # Errors
    ///
    /// [`AppError`] naming the file that can't be written.
    fn finish(plan: &Self::Plan, out: &Path, threads: usize) -> Result<(), AppError> {
        let _ = (plan, out, threads);
        Ok(())
    }

    /// Tables, charts and what they say, from the rows alone.
    fn findings(rows: &[RowOf<Self>]) -> Findings;
}

/// A row of the study `S`.
pub type RowOf<S> = Row<<S as Sweep>::Cell, <S as Sweep>::Measures>;

/// One row: the knobs of its cell, what was measured, what it cost, and the verdict.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Row<C, M> {
    #[serde(flatten)]
    pub cell: C,
    #[serde(flatten)]
    pub measures: M,
    #[serde(flatten)]
    pub cost: Cost,
    #[serde(flatten)]
    pub verdict: Verdict,
}

/// Wall time of one frame [ms].
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Cost {
    /// Median.
    pub ms_p50: Option<f64>,
    /// 95th percentile.
    pub ms_p95: Option<f64>,
}

/// How a point fared.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum State {
    Fine,
    Degraded,
    Failed,
}

impl State {
    /// The word the rows use.
    pub fn name(self) -> &'static str {
        match self {
            Self::Fine => "fine",
            Self::Degraded => "degraded",
            Self::Failed => "failed",
        }
    }
}

/// How a point fared, and why it is not fine.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Verdict {
    pub state: State,
    /// Reasons, worst first, separated by semicolons; empty where all is fine.
    pub why: String,
}

impl Verdict {
    /// The verdict of a list of faults.
    pub fn of(mut faults: Vec<(State, String)>) -> Self {
        faults.sort_by_key(|(state, _)| std::cmp::Reverse(*state));
        let state = faults.first().map_or(State::Fine, |(state, _)| *state);
        let reasons: Vec<String> = faults.into_iter().map(|(_, reason)| reason).collect();
        Self {
            state,
            why: reasons.join("; "),
        }
    }

    /// The verdict of one relative error: fine up to the first of `limits`, degraded up to the second; `told` says it.
    pub fn of_radiance(
        error_rel: Option<f64>,
        [fine, degraded]: [f64; 2],
        told: impl Fn(f64) -> String,
    ) -> Self {
        Self::of(match error_rel {
            None => vec![(State::Failed, "radiance is not finite".to_owned())],
            Some(error) if error > degraded => vec![(State::Failed, told(error))],
            Some(error) if error > fine => vec![(State::Degraded, told(error))],
            Some(_) => Vec::new(),
        })
    }
}

/// The JSON of a cell, by which it is known in part files and messages.
pub fn key<C: Serialize>(cell: &C) -> String {
    serde_json::to_string(cell).expect("a cell has string keys")
}

/// A number as rows hold it: `None` for what is not finite, which JSON has no word for.
pub fn finite(value: f64) -> Option<f64> {
    value.is_finite().then_some(value)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn verdict_is_that_of_the_worst_fault_which_is_told_first() {
        let degraded = (State::Degraded, "sags 4 % too far".to_owned());
        let failed = (State::Failed, "12 tetrahedra inverted".to_owned());
        let verdict = Verdict::of(vec![degraded, failed]);
        assert_eq!(verdict.state, State::Failed);
        assert_eq!(verdict.why, "12 tetrahedra inverted; sags 4 % too far");
        assert_eq!(Verdict::of(Vec::new()).state, State::Fine);
    }

    #[test]
    fn row_is_one_flat_object_that_reads_back_to_the_last_bit() {
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        struct Cell {
            substeps: u32,
        }
        #[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
        struct Measures {
            tip_error_rel: Option<f64>,
        }
        let row = Row {
            cell: Cell { substeps: 20 },
            // A number whose shortest text needs a correctly rounded reader.
            measures: Measures {
                tip_error_rel: Some(0.000_123_456_789_012_345_67),
            },
            cost: Cost::default(),
            verdict: Verdict::of(Vec::new()),
        };
        let text = serde_json::to_string(&row).expect("a row is plain data");
        assert_eq!(
            text,
            "{\"substeps\":20,\"tip_error_rel\":0.00012345678901234567,\"ms_p50\":null,\
             \"ms_p95\":null,\"state\":\"fine\",\"why\":\"\"}"
        );
        let back: Row<Cell, Measures> = serde_json::from_str(&text).expect("it reads back");
        assert_eq!(back, row);
    }
}
