//! Where everything meets: sessions, the replay, the window, and the commands that read and list.

mod assets;
mod cache;
mod changes;
mod check;
mod dump;
mod error;
mod green_knobs;
mod hand;
mod heat;
mod history;
mod knobs;
mod light_error;
mod load;
mod orbit;
mod overlay;
mod panel;
mod push;
mod record;
mod renderer;
mod replay;
pub mod say;
mod script;
mod section;
mod session;
mod slider;
mod still;
mod take;
mod validate;
mod window;

pub use assets::DEFAULT_SCENE;
pub use check::check;
pub use error::AppError;
pub use load::{LoadedBody, body as load_body, scene as load_scene};
pub use record::start_clock;
pub use renderer::Renderer;
pub use replay::{ReplayOptions, replay};
pub use session::{Marker, Session, Tick};
pub use still::Still;
pub use validate::{
    ReferenceScene, ValidateOptions, folder_scenes, read_full_reference, read_reference, validate,
};
pub use window::{WindowOptions, window};

use crate::measure::versus::{TimedRun, told};
use std::path::Path;

/// Version number.
const VERSION_NUMBER: &str = env!("CARGO_PKG_VERSION");
/// Commit that was built.
const VERSION_COMMIT: &str = env!("PALPATE_COMMIT");
/// Version and commit.
pub const VERSION: &str = concat!(env!("CARGO_PKG_VERSION"), " (", env!("PALPATE_COMMIT"), ")");

/// How a command ended when nothing went wrong with it.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Outcome {
    /// It did what it was asked.
    Done,
    /// A comparison found a difference.
    Differs,
}

/// Prints the bundled scenes, a line each.
///
/// # Errors
///
/// [`AppError::Scene`] if a bundled scene is broken.
pub fn list_scenes() -> Result<Outcome, AppError> {
    for (name, _) in assets::scenes() {
        let scene = load::scene(name, &[])?;
        say::say(&format!("{name:<14} {}\n", scene.title));
    }
    Ok(Outcome::Done)
}

/// Prints how long the stages of two runs took, one beside the other.
///
/// # Errors
///
/// [`AppError::File`] naming the file of a run that can't be read.
pub fn compare(a: &Path, b: &Path) -> Result<Outcome, AppError> {
    let runs = [TimedRun::read(a)?, TimedRun::read(b)?];
    let names = [a, b].map(|folder| folder.display().to_string());
    say::say(&told(names.each_ref().map(String::as_str), runs.each_ref()));
    Ok(Outcome::Done)
}

/// Threads to use: as told, or as many as the machine has.
pub fn thread_count(told: Option<u32>) -> usize {
    told.map_or_else(
        || std::thread::available_parallelism().map_or(1, usize::from),
        |threads| threads as usize,
    )
}
