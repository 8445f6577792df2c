//! The parts of a file as they are written there: one a mesh, before anything is joined.

use super::error::{ImportError, ImportFault};
use super::{gltf, obj};
use glam::{Vec2, Vec3};
use std::path::{Path, PathBuf};

/// Files beyond this are refused unread [bytes].
const FILE_BYTES_MAX: u64 = 1 << 28;
/// Vertices and triangles beyond this are refused: a node may repeat a mesh, so the size of the
/// file is no bound by itself.
pub(super) const ELEMENTS_MAX: usize = 1 << 24;
/// Coordinates beyond this [m] leave f32 without room for products of three.
pub(super) const COORDINATE_MAX: f32 = 1e9;

/// One mesh of a file, placed where the file's transforms put it.
#[derive(Clone, Debug, Default)]
pub struct Part {
    /// The name in the file, or its number where it has none.
    pub name: String,
    /// Positions, finite [m].
    pub positions: Vec<Vec3>,
    /// One texture coordinate a position, v downwards; `None` where a vertex has none. They are
    /// not checked yet and may be non-finite.
    pub uvs: Option<Vec<Vec2>>,
    /// Corners as indices of `positions`, all in range.
    pub triangles: Vec<[u32; 3]>,
    /// The picture of its material's colour, if it names one.
    pub base_color: Option<TextureSource>,
    /// The picture of its material's normals in tangent space, as glTF has them.
    pub normal: Option<TextureSource>,
}

/// Where the picture of a material is.
#[derive(Clone, Debug, PartialEq)]
pub enum TextureSource {
    /// A file beside the surface's file.
    File(PathBuf),
    /// The bytes of a PNG or JPEG inside the surface's file.
    Embedded(Vec<u8>),
}

/// All parts of a file, and what a user should know about them.
#[derive(Clone, Debug, Default)]
pub struct FileParts {
    /// The parts in the order of the file.
    pub parts: Vec<Part>,
    /// What was skipped or changed on reading.
    pub notes: Vec<String>,
}

/// How much of the room for vertices and triangles is taken.
#[derive(Debug, Default)]
pub(super) struct Room {
    vertices: usize,
    triangles: usize,
}

impl Room {
    /// Takes room for one more mesh.
    ///
    /// # Errors
    ///
    /// [`ImportFault::TooLarge`] if there is none; call before memory is taken.
    pub fn take(&mut self, vertices: usize, triangles: usize) -> Result<(), ImportFault> {
        self.vertices = self.vertices.saturating_add(vertices);
        self.triangles = self.triangles.saturating_add(triangles);
        if self.vertices.max(self.triangles) <= ELEMENTS_MAX {
            return Ok(());
        }
        Err(ImportFault::TooLarge {
            what: format!(
                "{} or more vertices and {} or more triangles are over the limit of {ELEMENTS_MAX}",
                self.vertices, self.triangles
            ),
        })
    }
}

/// Reads every mesh of a `.glb`, `.gltf` or `.obj` file as it is, open or closed.
///
/// Every index is in range and every position is finite. At least one part has a triangle.
///
/// # Errors
///
/// [`ImportError`] names the place in the file: see [`ImportFault`].
pub fn read_parts(path: &Path) -> Result<FileParts, ImportError> {
    read_bytes(path)
        .and_then(|bytes| parts_of(path, &bytes))
        .map_err(|fault| fault.of(path))
}

/// As [`read_parts`] for `bytes` that are at hand; `path` gives the ending and the folder of other files.
pub(super) fn parts_of(path: &Path, bytes: &[u8]) -> Result<FileParts, ImportFault> {
    let ending = path.extension().and_then(|ending| ending.to_str());
    let read = match ending.map(str::to_ascii_lowercase).as_deref() {
        Some("glb" | "gltf") => gltf::read,
        Some("obj") => obj::read,
        _ => return Err(ImportFault::Ending),
    };
    let mut file = read(bytes, path)?;
    for part in &file.parts {
        check_positions(part)?;
    }
    file.parts.retain(|part| !part.triangles.is_empty());
    if file.parts.is_empty() {
        return Err(ImportFault::NoTriangles);
    }
    Ok(file)
}

/// The bytes of an ordinary file of bearable size.
///
/// # Errors
///
/// What the system says, or why this file is not read.
pub fn read_file(path: &Path) -> std::io::Result<Vec<u8>> {
    let about = std::fs::metadata(path)?;
    if !about.is_file() {
        return Err(std::io::Error::other("not an ordinary file"));
    }
    if about.len() > FILE_BYTES_MAX {
        let bytes = about.len();
        let what = format!("{bytes} bytes are over the limit of {FILE_BYTES_MAX}");
        return Err(std::io::Error::new(std::io::ErrorKind::FileTooLarge, what));
    }
    std::fs::read(path)
}

/// The same, with an error that names the file.
pub(super) fn read_bytes(path: &Path) -> Result<Vec<u8>, ImportFault> {
    read_file(path).map_err(|source| {
        if source.kind() == std::io::ErrorKind::FileTooLarge {
            return ImportFault::TooLarge {
                what: source.to_string(),
            };
        }
        ImportFault::Io {
            needed: path.to_owned(),
            source,
        }
    })
}

fn check_positions(part: &Part) -> Result<(), ImportFault> {
    let fits = |p: &Vec3| p.abs().max_element() <= COORDINATE_MAX;
    match part
        .positions
        .iter()
        .position(|p| !p.is_finite() || !fits(p))
    {
        None => Ok(()),
        Some(vertex) => Err(ImportFault::malformed(
            format!("mesh `{}`, vertex {vertex}", part.name),
            format!(
                "position {} is not a number within ±{COORDINATE_MAX:e} m",
                part.positions[vertex]
            ),
        )),
    }
}
