//! What can go wrong, as the user is told it.

use crate::geom::import::ImportError;
use crate::geom::lattice::LatticeError;
use crate::gpu::GpuError;
use crate::measure::FileError;
use crate::scene::SceneError;
use std::fmt;

/// Why a command stopped. Its message names the file, the place in it and the remedy.
#[derive(Debug)]
pub enum AppError {
    /// The scene file, or an override of it.
    Scene(SceneError),
    /// Neither a bundled scene nor a file.
    UnknownScene { name: String, known: String },
    /// A file that can't be read.
    Read {
        path: String,
        source: std::io::Error,
    },
    /// A surface mesh.
    Import(ImportError),
    /// The lattice around a surface.
    Lattice(LatticeError),
    /// A texture map.
    Map { path: String, message: String },
    /// Options that don't go together.
    Usage(String),
    /// The body or its script can't be used as the scene describes it.
    Body(String),
    /// The GPU or a pass.
    Gpu(GpuError),
    /// A file that can't be written, or a recording that can't be read.
    File(FileError),
    /// The window or its event loop.
    Window(String),
    /// Some of the files that `check` read are wrong; it has said which.
    Check { wrong: usize },
}

impl fmt::Display for AppError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Scene(e) => e.fmt(f),
            Self::UnknownScene { name, known } => write!(
                f,
                "no scene {name}: it is neither a file nor a bundled scene; bundled are {known}"
            ),
            Self::Read { path, source } => write!(f, "{path} can't be read: {source}"),
            Self::Import(e) => e.fmt(f),
            Self::Lattice(e) => e.fmt(f),
            Self::Map { path, message } => write!(f, "texture {path}: {message}"),
            Self::Usage(message) => f.write_str(message),
            Self::Body(message) => write!(f, "body: {message}"),
            Self::Gpu(e) => e.fmt(f),
            Self::File(e) => e.fmt(f),
            Self::Window(message) => write!(f, "window: {message}"),
            Self::Check { wrong } => write!(f, "{wrong} of the files can't be used"),
        }
    }
}

impl std::error::Error for AppError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Gpu(e) => e.source(),
            _ => None,
        }
    }
}

macro_rules! from {
    ($($source:ty => $variant:ident),*) => {
        $(impl From<$source> for AppError {
            fn from(source: $source) -> Self {
                Self::$variant(source)
            }
        })*
    };
}

from!(SceneError => Scene, ImportError => Import, LatticeError => Lattice, GpuError => Gpu, FileError => File);
