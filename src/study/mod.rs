//! Studies: speed against accuracy, one command each.
//!
//! A study is a `Sweep`: a plan gives cells, each cell is measured to a row, and the rows alone
//! give tables, charts and text. So a part of a study can run anywhere, an interrupted one goes on
//! where it was, and parts join to the very result of one run. To add a study, write its `Sweep` in
//! a file of its own and give it a place in [`Study`].

mod contender;
mod document;
mod findings;
mod held_body;
mod journal;
mod march;
mod merge;
mod minimal;
mod oracle;
mod output;
mod peers;
mod plan;
pub(crate) mod planes;
mod pokes;
mod random;
mod run;
mod shard;
mod solver;
mod stability;
mod stretch;
mod surfaces;
mod sweep;
mod table2;
mod timing;

pub use shard::Shard;

use crate::app::{AppError, Outcome};
use crate::measure::page::Section;
use march::March;
use minimal::Minimal;
use planes::Planes;
use pokes::Pokes;
use serde::{Deserialize, Serialize};
use solver::Solver;
use stability::Stability;
use std::path::{Path, PathBuf};
use stretch::Stretch;
use surfaces::Surfaces;
use table2::Table2;

/// Version and commit, as rows are marked with.
const VERSION: (&str, &str) = (env!("CARGO_PKG_VERSION"), env!("PALPATE_COMMIT"));

/// The studies there are.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Study {
    /// Light below a moving surface: what each method costs, and how wrong it is.
    Planes,
    /// How far the march below the surface is off, by quadrature and samples.
    March,
    /// Every surface against light of all orders, and what it costs.
    Surfaces,
    /// François' Table 2, on surfaces of our own.
    Table2,
    /// How deep layers seem where the surface is stretched.
    Stretch,
    /// What each optional feature costs and changes.
    Minimal,
    /// How far off each method is, and what it costs.
    Solver,
    /// Where each method fails, and why.
    Stability,
    /// Whether pokes of any speed leave the bundled organs whole.
    Pokes,
}

impl Study {
    /// Every study.
    pub const ALL: [Self; 9] = [
        Self::Planes,
        Self::March,
        Self::Surfaces,
        Self::Table2,
        Self::Stretch,
        Self::Minimal,
        Self::Solver,
        Self::Stability,
        Self::Pokes,
    ];

    /// The name on the command line and of the files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Planes => "planes",
            Self::March => "march",
            Self::Surfaces => "surfaces",
            Self::Table2 => "table2",
            Self::Stretch => "stretch",
            Self::Minimal => "minimal",
            Self::Solver => "solver",
            Self::Stability => "stability",
            Self::Pokes => "pokes",
        }
    }

    /// The study of that name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|study| study.name() == name)
    }

    /// The heading of its section in the report.
    fn title(self) -> &'static str {
        match self {
            Self::Planes => "Light below a moving surface: time a frame against error",
            Self::March => "The march below the surface: time against error",
            Self::Surfaces => "Every surface: time against error",
            Self::Table2 => "The published table of frame rates",
            Self::Stretch => "Layers under stretch",
            Self::Minimal => "What each feature costs and changes",
            Self::Solver => "The solver: time a frame against error",
            Self::Stability => "Stability: where each method fails",
            Self::Pokes => "Pokes: many, anywhere, at any speed",
        }
    }

    fn run(self, options: &StudyOptions) -> Result<Outcome, AppError> {
        match self {
            Self::Planes => run::run::<Planes>(options),
            Self::March => run::run::<March>(options),
            Self::Surfaces => run::run::<Surfaces>(options),
            Self::Table2 => run::run::<Table2>(options),
            Self::Stretch => run::run::<Stretch>(options),
            Self::Minimal => run::run::<Minimal>(options),
            Self::Solver => run::run::<Solver>(options),
            Self::Stability => run::run::<Stability>(options),
            Self::Pokes => run::run::<Pokes>(options),
        }
    }

    fn merge(self, out: &Path, parts: &[PathBuf]) -> Result<Outcome, AppError> {
        match self {
            Self::Planes => merge::merge::<Planes>(out, parts),
            Self::March => merge::merge::<March>(out, parts),
            Self::Surfaces => merge::merge::<Surfaces>(out, parts),
            Self::Table2 => merge::merge::<Table2>(out, parts),
            Self::Stretch => merge::merge::<Stretch>(out, parts),
            Self::Minimal => merge::merge::<Minimal>(out, parts),
            Self::Solver => merge::merge::<Solver>(out, parts),
            Self::Stability => merge::merge::<Stability>(out, parts),
            Self::Pokes => merge::merge::<Pokes>(out, parts),
        }
    }

    fn section(self, out: &Path) -> Result<Section, AppError> {
        match self {
            Self::Planes => output::section::<Planes>(out),
            Self::March => output::section::<March>(out),
            Self::Surfaces => output::section::<Surfaces>(out),
            Self::Table2 => output::section::<Table2>(out),
            Self::Stretch => output::section::<Stretch>(out),
            Self::Minimal => output::section::<Minimal>(out),
            Self::Solver => output::section::<Solver>(out),
            Self::Stability => output::section::<Stability>(out),
            Self::Pokes => output::section::<Pokes>(out),
        }
    }
}

/// What `palpate study` was told.
#[derive(Clone, Debug)]
pub struct StudyOptions {
    /// Which one.
    pub study: Study,
    /// Folder that is written into; `None` for one below `out`.
    pub out: Option<PathBuf>,
    /// Less than a minute instead of minutes.
    pub quick: bool,
    /// Only a part of the cells.
    pub shard: Option<Shard>,
    /// `--set` overrides of the plan.
    pub sets: Vec<String>,
    /// Threads it may use.
    pub threads: usize,
}

/// Runs a study, or goes on with one that was interrupted.
///
/// # Errors
///
/// [`AppError`] naming the setting or file that can't be used.
pub fn study(options: &StudyOptions) -> Result<Outcome, AppError> {
    options.study.run(options)
}

/// Joins the parts of a study, each in a folder of its own, into `out`.
///
/// # Errors
///
/// [`AppError`] naming the part that does not fit, or the cells that are missing or there twice.
///
/// # Panics
///
/// If there are no parts.
pub fn merge(out: &Path, parts: &[PathBuf]) -> Result<Outcome, AppError> {
    for study in merge::studies_in(out, parts)? {
        study.merge(out, parts)?;
    }
    Ok(Outcome::Done)
}
