//! Why a mesh could not be read, in words that name the file, the place in it and the remedy.

use std::fmt;
use std::io;
use std::path::{Path, PathBuf};

/// Why `file` gave no mesh.
#[derive(Debug)]
pub struct ImportError {
    /// The file that was asked for.
    pub file: PathBuf,
    /// What is wrong with it.
    pub fault: ImportFault,
}

/// What can be wrong with a mesh file.
#[derive(Debug)]
pub enum ImportFault {
    /// The file, or a file beside it that it names, cannot be read.
    Io {
        /// The file that cannot be read.
        needed: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// The name's ending is none that is read here.
    Ending,
    /// More than this program takes in.
    TooLarge {
        /// What is too large and what the limit is.
        what: String,
    },
    /// The content breaks the rules of its format.
    Malformed {
        /// Where: chunk, accessor, mesh, primitive, vertex or line.
        place: String,
        /// What is wrong there.
        problem: String,
    },
    /// The content is sound but needs something that is not built here.
    Unsupported {
        /// The feature by the name its format gives it.
        feature: String,
        /// What to do about it.
        remedy: &'static str,
    },
    /// There is no triangle to use.
    NoTriangles,
    /// There is no tetrahedron to use.
    NoTetrahedra,
    /// Every tetrahedron is flat.
    FlatTetrahedra {
        /// How many there are.
        count: usize,
    },
    /// Tetrahedra fill some space more than once, whichever way they are turned.
    Overlap {
        /// Which ones, and how.
        problem: String,
    },
    /// A mesh that was asked for by name is not in the file.
    NoSuchMesh {
        /// The name asked for.
        wanted: String,
        /// The names that are there.
        known: Vec<String>,
    },
    /// No part of the file closes into a watertight surface, even after small repairs.
    Open {
        /// Edges with one triangle, after welding.
        border_edges: usize,
        /// Edges with more than two triangles, after welding.
        crowded_edges: usize,
        /// Number of meshes that were tried.
        meshes: usize,
    },
    /// The surface closes but has one side only, as a Klein bottle has.
    OneSided,
    /// The surface closes but encloses nothing.
    Flat,
}

impl ImportFault {
    /// Names the file that has the fault.
    pub(super) fn of(self, file: &Path) -> ImportError {
        ImportError {
            file: file.to_owned(),
            fault: self,
        }
    }

    /// Shorthand for [`ImportFault::Malformed`].
    pub(super) fn malformed(place: impl Into<String>, problem: impl Into<String>) -> Self {
        Self::Malformed {
            place: place.into(),
            problem: problem.into(),
        }
    }
}

impl fmt::Display for ImportError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match &self.fault {
            ImportFault::Io { needed, .. } if *needed == self.file => self.fault.fmt(f),
            fault => write!(f, "{}: {fault}", self.file.display()),
        }
    }
}

impl fmt::Display for ImportFault {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Io { needed, source } => write!(
                f,
                "cannot read {}: {source}; check the path and the permissions",
                needed.display()
            ),
            Self::Ending => write!(
                f,
                "not a kind of file that is read: a surface is a .glb, .gltf or .obj file, tetrahedra are a \
                 .msh file"
            ),
            Self::TooLarge { what } => {
                write!(f, "{what}; simplify the mesh in a modelling program first")
            }
            Self::Malformed { place, problem } => {
                write!(f, "{place}: {problem}; export the file again or mend it")
            }
            Self::Unsupported { feature, remedy } => {
                write!(f, "it uses {feature}, which is not supported; {remedy}")
            }
            Self::NoTriangles => write!(
                f,
                "holds no mesh with triangles; export the surface as triangles"
            ),
            Self::NoTetrahedra => write!(
                f,
                "holds neither tetrahedra nor hexahedra; mesh the volume, not its surface alone"
            ),
            Self::FlatTetrahedra { count } => write!(
                f,
                "all {count} tetrahedra are flat, so they hold no tissue; check the coordinates"
            ),
            Self::Overlap { problem } => {
                write!(f, "the tetrahedra overlap: {problem}; mesh the volume anew")
            }
            Self::NoSuchMesh { wanted, known } => {
                write!(f, "no mesh has `{wanted}` in its name; there are: ")?;
                write!(f, "{}", known.join(", "))
            }
            Self::Open {
                border_edges,
                crowded_edges,
                meshes,
            } => write!(
                f,
                "the surface is not closed: {border_edges} border edges and {crowded_edges} edges \
                 with more than two triangles, and no selection of its {meshes} mesh(es) closes; \
                 fill the holes in a modelling program, or name the meshes that close together"
            ),
            Self::OneSided => write!(
                f,
                "the surface has one side only, so it has no inside; cut it open and close it again"
            ),
            Self::Flat => write!(
                f,
                "the closed surface encloses no volume; give the sheet a thickness first"
            ),
        }
    }
}

impl std::error::Error for ImportError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match &self.fault {
            ImportFault::Io { source, .. } => Some(source),
            _ => None,
        }
    }
}
