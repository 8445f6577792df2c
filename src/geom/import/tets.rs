//! From the cells of a file to tetrahedra that can be simulated: cut, turned, checked, counted.

mod hexahedra;
mod partition;

use super::error::{ImportError, ImportFault};
use super::gmsh;
use super::part::read_bytes;
use crate::geom::TetMesh;
use crate::geom::tet::{self, SLIVER_BELOW, TetQuality};
use glam::DVec3;
use partition::{Numbered, parts};
use std::collections::HashSet;
use std::path::Path;

/// Tetrahedra farther from the origin of their file than this many times their extent are moved there:
/// so far out f32 loses digits of every edge.
const FAR_EXTENTS: f64 = 100.0;

/// Items that a note names before it says how many more there are.
const NAMED_MAX: usize = 8;

/// The corners of a cell: numbers of nodes in the file, then their places in the list of nodes.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) enum Corners {
    Tetrahedron([u64; 4]),
    Hexahedron([u64; 8]),
}

/// A cell of a file.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Cell {
    /// Its number in the file; nothing says that there is only one of it.
    pub number: u64,
    /// The line that it stands in.
    pub line: usize,
    pub corners: Corners,
}

/// What a file says, before it is judged. Corners are places in `nodes`.
#[derive(Clone, Debug)]
pub(super) struct RawTets {
    /// The format and its version.
    pub format: String,
    /// In the unit of the file, finite.
    pub nodes: Vec<DVec3>,
    /// The number of each node in the file.
    pub node_numbers: Vec<u64>,
    pub cells: Vec<Cell>,
    /// Points, lines and faces that were passed over.
    pub ignored: usize,
}

/// Tetrahedra from a file, all positive and none overlapping a neighbour.
#[derive(Clone, Debug)]
pub struct ImportedTets {
    /// The format and its version.
    pub format: String,
    /// Nodes in the order of the file without those that no tetrahedron uses, in the file's unit; about
    /// the origin, if they lie far from that in the file.
    pub mesh: TetMesh,
    /// Shape of the tetrahedra.
    pub quality: TetQuality,
    /// Pieces that share no particle.
    pub parts: usize,
    /// Points, lines and faces of the file, which say nothing of the inside.
    pub ignored: usize,
    /// What was cut, turned or left out; a sentence each.
    pub notes: Vec<String>,
}

/// Reads the tetrahedra of a Gmsh file (`.msh`, ASCII, format 1, 2 to 2.2 or 4.1).
///
/// Tetrahedra are taken as they are, hexahedra cut. Tetrahedra whose corners are in the wrong order
/// are turned, flat ones and copies left out; every such step leaves a note.
///
/// # Errors
///
/// [`ImportError`] if the file cannot be read, holds no tetrahedra, or they overlap.
pub fn read_tets(path: &Path) -> Result<ImportedTets, ImportError> {
    read_bytes(path)
        .and_then(|bytes| tets_of(&bytes))
        .map_err(|fault| fault.of(path))
}

/// As [`read_tets`] for the `bytes` of a file that is inside the binary; `path` is its name.
///
/// # Errors
///
/// As [`read_tets`].
pub fn read_tets_bytes(path: &Path, bytes: &[u8]) -> Result<ImportedTets, ImportError> {
    tets_of(bytes).map_err(|fault| fault.of(path))
}

fn tets_of(bytes: &[u8]) -> Result<ImportedTets, ImportFault> {
    sound(gmsh::read(bytes)?)
}

/// Cuts, turns and checks the cells of a file.
fn sound(raw: RawTets) -> Result<ImportedTets, ImportFault> {
    let mut notes = Vec::new();
    let mut tets = cut(&raw, &mut notes)?;
    drop_copies(&mut tets, &mut notes);
    let origin = origin(&raw.nodes, &tets, &mut notes);
    let mut mesh = TetMesh {
        particles: (raw.nodes.iter()).map(|x| (x - origin).as_vec3()).collect(),
        tets: Vec::new(),
    };
    partition::orient(&mesh.particles, &mut tets, &mut notes)?;
    partition::check(&tets)?;
    mesh.tets = tets.iter().map(|tet| tet.corners).collect();
    drop_unused(&mut mesh, &raw.node_numbers, &mut notes);
    say_coincident(&mesh, &mut notes);
    let parts = parts(&mesh);
    if parts > 1 {
        notes.push(format!("{parts} parts that share no node move apart"));
    }
    let quality = tet::quality(&mesh);
    if quality.slivers > 0 {
        notes.push(format!(
            "{} of {} tetrahedra are slivers (radius ratio below {SLIVER_BELOW}); the worst has \
             {:.2e}, {}",
            quality.slivers,
            mesh.tets.len(),
            quality.worst,
            tets[quality.worst_tet]
        ));
    }
    Ok(ImportedTets {
        format: raw.format,
        mesh,
        quality,
        parts,
        ignored: raw.ignored,
        notes,
    })
}

/// What is taken from all `nodes` before they are rounded: nothing, or the middle of `tets` that lie far
/// out, which then come to lie about the origin.
fn origin(nodes: &[DVec3], tets: &[Numbered], notes: &mut Vec<String>) -> DVec3 {
    let used = || (tets.iter()).flat_map(|tet| tet.corners.map(|node| nodes[node as usize]));
    let low = used().fold(DVec3::INFINITY, DVec3::min);
    let high = used().fold(DVec3::NEG_INFINITY, DVec3::max);
    let middle = 0.5 * (low + high);
    let is_far = middle.length() > FAR_EXTENTS * (high - low).max_element();
    if !is_far {
        return DVec3::ZERO;
    }
    notes.push(format!(
        "the mesh lies {:.3e} from the origin of its file, in the file's unit: moved there",
        middle.length()
    ));
    middle
}

/// The tetrahedra of the cells: their own, or those that hexahedra are cut into.
fn cut(raw: &RawTets, notes: &mut Vec<String>) -> Result<Vec<Numbered>, ImportFault> {
    let mut tets = Vec::new();
    let mut hexahedra = Vec::new();
    for cell in &raw.cells {
        let repeated = match cell.corners {
            Corners::Tetrahedron(corners) => repeated(&corners),
            Corners::Hexahedron(corners) => repeated(&corners),
        };
        if let Some(place) = repeated {
            return Err(ImportFault::malformed(
                format!("line {}", cell.line),
                format!(
                    "element {} names node {} twice",
                    cell.number, raw.node_numbers[place as usize]
                ),
            ));
        }
        match cell.corners {
            Corners::Tetrahedron(corners) => tets.push(Numbered {
                corners: corners.map(|place| place as u32),
                number: cell.number,
                line: cell.line,
            }),
            Corners::Hexahedron(corners) => {
                hexahedra.push((*cell, corners.map(|place| place as u32)));
            }
        }
    }
    match (tets.is_empty(), hexahedra.is_empty()) {
        (_, true) => Ok(tets),
        (true, false) => hexahedra::cut(&hexahedra, raw.nodes.len(), notes),
        (false, false) => Err(ImportFault::Unsupported {
            feature: "hexahedra beside tetrahedra".to_owned(),
            remedy: "their faces do not meet: mesh the body with one of the two",
        }),
    }
}

/// A corner that is there twice.
fn repeated(corners: &[u64]) -> Option<u64> {
    (1..corners.len())
        .find(|&k| corners[..k].contains(&corners[k]))
        .map(|k| corners[k])
}

/// Leaves out tetrahedra that are there already, as Gmsh writes them for each physical group.
fn drop_copies(tets: &mut Vec<Numbered>, notes: &mut Vec<String>) {
    let mut met = HashSet::new();
    let before = tets.len();
    tets.retain(|tet| {
        let mut key = tet.corners;
        key.sort_unstable();
        met.insert(key)
    });
    if tets.len() < before {
        notes.push(format!(
            "{} tetrahedra with the corners of another left out",
            before - tets.len()
        ));
    }
}

/// Leaves out particles that no tetrahedron uses; the others keep their order.
fn drop_unused(mesh: &mut TetMesh, numbers: &[u64], notes: &mut Vec<String>) {
    let mut used = vec![false; mesh.particles.len()];
    for &corner in mesh.tets.as_flattened() {
        used[corner as usize] = true;
    }
    let unused: Vec<u64> = (used.iter().zip(numbers))
        .filter(|(used, _)| !**used)
        .map(|(_, &number)| number)
        .collect();
    if unused.is_empty() {
        return;
    }
    let mut next = 0;
    let place: Vec<u32> = used
        .iter()
        .map(|&used| {
            let place = next;
            next += u32::from(used);
            place
        })
        .collect();
    for corner in mesh.tets.as_flattened_mut() {
        *corner = place[*corner as usize];
    }
    let mut keep = used.iter();
    mesh.particles
        .retain(|_| *keep.next().expect("a flag a node"));
    notes.push(format!(
        "{} nodes of no tetrahedron left out: {}",
        unused.len(),
        named(unused.iter())
    ));
}

/// Says how many particles lie where another does: what meets there is not joined.
fn say_coincident(mesh: &TetMesh, notes: &mut Vec<String>) {
    // Adding 0 makes one of the two zeros.
    let places: HashSet<[u32; 3]> = (mesh.particles.iter())
        .map(|x| (x + 0.0).to_array().map(f32::to_bits))
        .collect();
    let doubled = mesh.particles.len() - places.len();
    if doubled > 0 {
        notes.push(format!(
            "{doubled} nodes lie exactly where another does: what meets there is not joined"
        ));
    }
}

/// The first of `items`, and how many more there are.
fn named<T: ToString>(items: impl ExactSizeIterator<Item = T>) -> String {
    let count = items.len();
    let mut text = items
        .take(NAMED_MAX)
        .map(|item| item.to_string())
        .collect::<Vec<_>>()
        .join(", ");
    if count > NAMED_MAX {
        text.push_str(&format!(" and {} more", count - NAMED_MAX));
    }
    text
}
