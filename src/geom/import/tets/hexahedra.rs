//! Hexahedra cut into tetrahedra so that the cuts of a shared face meet.
//!
//! Where the nodes can be told apart like the fields of a chess board, every hexahedron gets five
//! tetrahedra, with the diagonals between the nodes of one colour. Where they cannot (a ring of an
//! odd number of cells), it gets six round its first node, with diagonals through the first node of
//! each face.
//!
//! Source for the second cut: Dompierre, Labbé, Vallet, Camarero, "How to Subdivide Pyramids,
//! Prisms and Hexahedra into Tetrahedra", 8th International Meshing Roundtable, 1999.

use super::super::error::ImportFault;
use super::Cell;
use super::partition::Numbered;
use crate::geom::lattice::TETS_MAX;

/// Corners of a hexahedron in Gmsh's order: round the bottom, then round the top. These are its
/// edges.
const EDGES: [[usize; 2]; 12] = [
    [0, 1],
    [1, 2],
    [2, 3],
    [3, 0],
    [4, 5],
    [5, 6],
    [6, 7],
    [7, 4],
    [0, 4],
    [1, 5],
    [2, 6],
    [3, 7],
];

/// Its faces, counter-clockwise seen from outside.
const FACES: [[usize; 4]; 6] = [
    [0, 3, 2, 1],
    [4, 5, 6, 7],
    [0, 1, 5, 4],
    [1, 2, 6, 5],
    [2, 3, 7, 6],
    [3, 0, 4, 7],
];

/// Five tetrahedra whose diagonals run between corners 0, 2, 5, 7, and the mirrored five.
const FIVE: [[[usize; 4]; 5]; 2] = [
    [
        [0, 2, 7, 5],
        [1, 2, 0, 5],
        [3, 0, 2, 7],
        [4, 7, 5, 0],
        [6, 2, 5, 7],
    ],
    [
        [1, 3, 4, 6],
        [0, 1, 3, 4],
        [2, 3, 1, 6],
        [5, 1, 4, 6],
        [7, 4, 3, 6],
    ],
];

/// The tetrahedra of `hexahedra` over `nodes` nodes.
pub(super) fn cut(
    hexahedra: &[(Cell, [u32; 8])],
    nodes: usize,
    notes: &mut Vec<String>,
) -> Result<Vec<Numbered>, ImportFault> {
    let colours = colours(hexahedra, nodes);
    let each = if colours.is_some() { 5 } else { 6 };
    if each * hexahedra.len() > TETS_MAX {
        return Err(ImportFault::TooLarge {
            what: format!(
                "{} tetrahedra of {} hexahedra are over the limit of {TETS_MAX}",
                each * hexahedra.len(),
                hexahedra.len()
            ),
        });
    }
    let mut tets = Vec::with_capacity(each * hexahedra.len());
    for (cell, corners) in hexahedra {
        let numbered = |corners: [u32; 4]| Numbered {
            corners,
            number: cell.number,
            line: cell.line,
        };
        match &colours {
            Some(colours) => {
                let five = FIVE[usize::from(colours[corners[0] as usize])];
                tets.extend(five.map(|tet| numbered(tet.map(|k| corners[k]))));
            }
            None => tets.extend(six(*corners).map(numbered)),
        }
    }
    notes.push(format!(
        "{} hexahedra cut into {each} tetrahedra each",
        hexahedra.len()
    ));
    Ok(tets)
}

/// A colour a node, so that every edge joins two colours; `None` if there is no such colouring.
fn colours(hexahedra: &[(Cell, [u32; 8])], nodes: usize) -> Option<Vec<bool>> {
    let mut neighbours: Vec<Vec<u32>> = vec![Vec::new(); nodes];
    for (_, corners) in hexahedra {
        for [a, b] in EDGES.map(|edge| edge.map(|k| corners[k])) {
            neighbours[a as usize].push(b);
            neighbours[b as usize].push(a);
        }
    }
    let mut colours: Vec<Option<bool>> = vec![None; nodes];
    let mut waiting = Vec::new();
    for start in 0..nodes {
        if colours[start].is_none() {
            colours[start] = Some(false);
            waiting.push(start);
        }
        while let Some(node) = waiting.pop() {
            let other = colours[node].map(|colour| !colour);
            for &next in &neighbours[node] {
                let next = next as usize;
                if colours[next].is_none() {
                    colours[next] = other;
                    waiting.push(next);
                } else if colours[next] != other {
                    return None;
                }
            }
        }
    }
    colours.into_iter().collect()
}

/// The three faces away from the first corner, each in two triangles, joined to that corner.
fn six(corners: [u32; 8]) -> [[u32; 4]; 6] {
    let first = *corners.iter().min().expect("there are eight");
    let mut tets = [[first; 4]; 6];
    let mut next = tets.iter_mut();
    for face in FACES {
        let mut face = face.map(|k| corners[k]);
        if face.contains(&first) {
            continue;
        }
        let least = (0..4)
            .min_by_key(|&k| face[k])
            .expect("a face has four corners");
        face.rotate_left(least);
        let [a, b, c, d] = face;
        for triangle in [[a, b, c], [a, c, d]] {
            let tet = next.next().expect("three faces do not hold a corner");
            // The face turns counter-clockwise seen from outside, so the volume is positive.
            tet[1..].copy_from_slice(&triangle);
        }
    }
    tets
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::tet::volume_m3;
    use glam::DVec3;

    const CUBE: [DVec3; 8] = [
        DVec3::ZERO,
        DVec3::X,
        DVec3::new(1.0, 1.0, 0.0),
        DVec3::Y,
        DVec3::Z,
        DVec3::new(1.0, 0.0, 1.0),
        DVec3::ONE,
        DVec3::new(0.0, 1.0, 1.0),
    ];

    fn volumes(tets: impl IntoIterator<Item = [usize; 4]>) -> Vec<f64> {
        tets.into_iter()
            .map(|tet| volume_m3(tet.map(|k| CUBE[k])))
            .collect()
    }

    #[test]
    fn five_positive_tetrahedra_fill_a_cube_either_way() {
        for five in FIVE {
            let volumes = volumes(five);
            assert!(volumes.iter().all(|&v| v > 0.1), "{volumes:?}");
            assert!((volumes.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        }
    }

    #[test]
    fn six_positive_tetrahedra_fill_a_cube_whatever_its_first_node_is() {
        for first in 0..8 {
            // The corner `first` gets the smallest number.
            let numbers: [u32; 8] = std::array::from_fn(|k| ((k + 8 - first) % 8) as u32);
            let corner_of = |number: u32| (number as usize + first) % 8;
            let volumes = volumes(six(numbers).map(|tet| tet.map(corner_of)));
            assert!(volumes.iter().all(|&v| v > 0.1), "{first}: {volumes:?}");
            assert!((volumes.iter().sum::<f64>() - 1.0).abs() < 1e-12);
        }
    }
}
