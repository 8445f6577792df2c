//! Whether tetrahedra fill space once: their orientation, their shared faces, their parts.

use super::super::error::ImportFault;
use super::named;
use crate::geom::TetMesh;
use crate::geom::tet::volume_m3;
use glam::Vec3;
use std::fmt;

/// A tetrahedron with a volume below this share of its longest edge cubed is flat; a regular one
/// has 0.118. It is the share below which the simulation would leave it out.
const FLAT_SHARE: f64 = 1e-6;

/// A tetrahedron and where it comes from.
#[derive(Clone, Copy, Debug)]
pub(super) struct Numbered {
    pub corners: [u32; 4],
    /// The number of its cell in the file.
    pub number: u64,
    /// The line of its cell.
    pub line: usize,
}

impl fmt::Display for Numbered {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "number {} (line {})", self.number, self.line)
    }
}

/// Turns the negative tetrahedra and leaves out the flat ones.
pub(super) fn orient(
    nodes: &[Vec3],
    tets: &mut Vec<Numbered>,
    notes: &mut Vec<String>,
) -> Result<(), ImportFault> {
    let total = tets.len();
    if total == 0 {
        return Err(ImportFault::NoTetrahedra);
    }
    let (mut flat, mut turned) = (Vec::new(), Vec::new());
    tets.retain_mut(|tet| {
        let corners = tet.corners.map(|node| nodes[node as usize].as_dvec3());
        let longest = (0..4)
            .flat_map(|a| (0..a).map(move |b| (a, b)))
            .map(|(a, b)| corners[a].distance(corners[b]))
            .fold(0.0, f64::max);
        let volume = volume_m3(corners);
        if volume.abs() <= FLAT_SHARE * longest.powi(3) {
            flat.push(*tet);
            return false;
        }
        if volume < 0.0 {
            tet.corners.swap(2, 3);
            turned.push(*tet);
        }
        true
    });
    if tets.is_empty() {
        return Err(ImportFault::FlatTetrahedra { count: total });
    }
    if !flat.is_empty() {
        notes.push(format!(
            "{} flat tetrahedra left out: {}",
            flat.len(),
            named(flat.iter())
        ));
    }
    if turned.len() == tets.len() {
        notes.push("all tetrahedra were ordered the other way round and have been turned".into());
    } else if !turned.is_empty() {
        notes.push(format!(
            "{} inverted tetrahedra mended by swapping two corners: {}",
            turned.len(),
            named(turned.iter())
        ));
    }
    Ok(())
}

/// One face of one tetrahedron.
struct Face {
    /// The corners in ascending order.
    key: [u32; 3],
    tet: u32,
    /// Whether the corners, counter-clockwise seen from outside, are an even permutation of the key.
    even: bool,
}

/// Refuses tetrahedra of positive volume that fill the space beside a face twice.
pub(super) fn check(tets: &[Numbered]) -> Result<(), ImportFault> {
    let mut faces: Vec<Face> = (tets.iter().enumerate())
        .flat_map(|(tet, numbered)| {
            let [a, b, c, d] = numbered.corners;
            [[b, c, d], [a, d, c], [a, b, d], [a, c, b]].map(|face| Face::new(face, tet as u32))
        })
        .collect();
    faces.sort_unstable_by_key(|face| (face.key, face.tet));
    for uses in faces.chunk_by(|a, b| a.key == b.key) {
        let numbered = |k: usize| tets[uses[k].tet as usize];
        let problem = match uses {
            [_] => continue,
            [a, b] if a.even != b.even => continue,
            [_, _] => format!(
                "{} and {} lie on the same side of the face that they share",
                numbered(0),
                numbered(1)
            ),
            _ => format!(
                "{} tetrahedra share one face: {}",
                uses.len(),
                named((0..uses.len()).map(numbered))
            ),
        };
        return Err(ImportFault::Overlap { problem });
    }
    Ok(())
}

impl Face {
    fn new(face: [u32; 3], tet: u32) -> Self {
        let [a, b, c] = face;
        let mut key = face;
        key.sort_unstable();
        let even = [[a, b, c], [b, c, a], [c, a, b]].contains(&key);
        Self { key, tet, even }
    }
}

/// Pieces of `mesh` that share no particle; a particle that no tetrahedron uses counts as one.
pub(super) fn parts(mesh: &TetMesh) -> usize {
    let mut parent: Vec<u32> = (0..mesh.particles.len() as u32).collect();
    fn root(parent: &mut [u32], mut at: u32) -> u32 {
        while parent[at as usize] != at {
            parent[at as usize] = parent[parent[at as usize] as usize];
            at = parent[at as usize];
        }
        at
    }
    let mut parts = mesh.particles.len();
    for &[a, rest @ ..] in &mesh.tets {
        for other in rest {
            let (a, b) = (root(&mut parent, a), root(&mut parent, other));
            if a != b {
                parent[b as usize] = a;
                parts -= 1;
            }
        }
    }
    parts
}
