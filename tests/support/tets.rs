//! Small tetrahedral meshes, written in every format that Gmsh has.

#![allow(dead_code)] // Each test binary asks for a part of it.

use std::fmt::Write;

/// Nodes and cells with the numbers that a file gives them.
#[derive(Clone, Debug)]
pub struct Written {
    /// Number and place of each node.
    pub nodes: Vec<(u64, [f64; 3])>,
    /// Number, Gmsh's type and the nodes of each element.
    pub elements: Vec<(u64, u64, Vec<u64>)>,
}

/// A cube of side 1 in five tetrahedra, its nodes numbered 10, 20, … by x, then y, then z.
pub fn cube() -> Written {
    let nodes = (0..8)
        .map(|k| {
            let place = [k & 1, k >> 1 & 1, k >> 2].map(|c| c as f64);
            (10 * (k + 1) as u64, place)
        })
        .collect();
    let tets = [
        [0, 3, 6, 5],
        [1, 3, 0, 5],
        [2, 0, 3, 6],
        [4, 0, 6, 5],
        [7, 6, 3, 5],
    ];
    let elements = (tets.iter().enumerate())
        .map(|(k, tet)| (k as u64 + 1, 4, tet.map(|c: u64| 10 * (c + 1)).to_vec()))
        .collect();
    Written { nodes, elements }
}

impl Written {
    /// A mesh of tetrahedra over `places`, everything numbered from 1.
    pub fn of_tets(places: &[[f64; 3]], tets: &[[u64; 4]]) -> Self {
        Self {
            nodes: (places.iter().enumerate())
                .map(|(k, &place)| (k as u64 + 1, place))
                .collect(),
            elements: (tets.iter().enumerate())
                .map(|(k, tet)| (k as u64 + 1, 4, tet.map(|c| c + 1).to_vec()))
                .collect(),
        }
    }

    /// Format 1.
    pub fn format_1(&self) -> String {
        let mut text = format!("$NOD\n{}\n", self.nodes.len());
        for (number, [x, y, z]) in &self.nodes {
            writeln!(text, "{number} {x} {y} {z}").unwrap();
        }
        write!(text, "$ENDNOD\n$ELM\n{}\n", self.elements.len()).unwrap();
        for (number, kind, nodes) in &self.elements {
            writeln!(
                text,
                "{number} {kind} 1 1 {} {}",
                nodes.len(),
                joined(nodes)
            )
            .unwrap();
        }
        text + "$ENDELM\n"
    }

    /// Format 2.2.
    pub fn format_2(&self) -> String {
        let mut text = "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n$Nodes\n".to_owned();
        writeln!(text, "{}", self.nodes.len()).unwrap();
        for (number, [x, y, z]) in &self.nodes {
            writeln!(text, "{number} {x} {y} {z}").unwrap();
        }
        write!(text, "$EndNodes\n$Elements\n{}\n", self.elements.len()).unwrap();
        for (number, kind, nodes) in &self.elements {
            writeln!(text, "{number} {kind} 2 1 1 {}", joined(nodes)).unwrap();
        }
        text + "$EndElements\n"
    }

    /// Format 4.1, with two blocks of nodes, an empty one, and a block for each element.
    pub fn format_4(&self) -> String {
        let count = self.nodes.len();
        let mut text = "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n".to_owned();
        text += "$Entities\n0 0 0 1\n1 0 0 0 1 1 1 0 0\n$EndEntities\n";
        writeln!(text, "$Nodes\n3 {count} 1 {}", self.nodes[count - 1].0).unwrap();
        let (first, second) = self.nodes.split_at(count / 2);
        for block in [first, &[], second] {
            writeln!(text, "3 1 0 {}", block.len()).unwrap();
            for (number, _) in block {
                writeln!(text, "{number}").unwrap();
            }
            for (_, [x, y, z]) in block {
                writeln!(text, "{x} {y} {z}").unwrap();
            }
        }
        let elements = self.elements.len();
        writeln!(
            text,
            "$EndNodes\n$Elements\n{elements} {elements} 1 {elements}"
        )
        .unwrap();
        for (number, kind, nodes) in &self.elements {
            writeln!(text, "3 1 {kind} 1\n{number} {}", joined(nodes)).unwrap();
        }
        text + "$EndElements\n"
    }

    /// The name and text of all three formats.
    pub fn formats(&self) -> [(&'static str, String); 3] {
        [
            ("Gmsh 1", self.format_1()),
            ("Gmsh 2.2", self.format_2()),
            ("Gmsh 4.1", self.format_4()),
        ]
    }
}

fn joined(numbers: &[u64]) -> String {
    let words: Vec<String> = numbers.iter().map(u64::to_string).collect();
    words.join(" ")
}
