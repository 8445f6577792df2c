//! All tetrahedra of a body, in strips: every other one shares no node. One thread works on them, as
//! on all of the implicit method; the strips fix the order of its sums.

use super::{
    element::{self, Batch, Contraction, Element, Moduli, Strain},
    matrix::BlockMatrix,
    strips::strips,
    wide::{LANES, Lanes},
};
use crate::sim::Lame;
use glam::{DVec3, DVec4, Vec4};
use std::ops::Range;

/// Tetrahedra, cut into strips of which every other one shares no node.
#[derive(Clone, Debug)]
pub struct Elements {
    elements: Vec<Element>,
    batches: Vec<Batch>,
    /// Batches of each strip: first the even strips, then the odd ones.
    strips: Vec<Range<usize>>,
    /// Activity of each batch of a body that beats; nothing where it has never beaten.
    activity: Vec<Lanes>,
    /// Shortening of full muscle, as a share of its length.
    pub shortening: f32,
    /// Nodes the batches know, the unused one not counted.
    node_count: usize,
    /// Blocks the batches know, the unused one not counted.
    block_count: usize,
}

impl Elements {
    /// `elements` at rest at `rest`, for a matrix whose pattern has their pairs of free nodes.
    /// Nodes beyond the matrix are held. Elements next to each other in the list are near.
    pub fn new(elements: &[Element], rest: &[DVec3], matrix: &BlockMatrix) -> Self {
        let node_count = rest.len();
        let free = matrix.len() as u32;
        let place = |a: u32, b: u32| {
            if a.max(b) < free {
                matrix.place(a, b)
            } else {
                matrix.unused_place()
            }
        };
        let mut all = Self {
            elements: Vec::with_capacity(elements.len()),
            batches: Vec::new(),
            strips: Vec::new(),
            activity: Vec::new(),
            shortening: 0.0,
            node_count,
            block_count: matrix.block_count(),
        };
        let nodes: Vec<[u32; 4]> = elements.iter().map(|element| element.nodes).collect();
        let strips = strips(&nodes, node_count);
        let (even, odd) = (strips.iter().step_by(2), strips.iter().skip(1).step_by(2));
        for strip in even.chain(odd) {
            let first = all.batches.len();
            let members: Vec<Element> = strip.iter().map(|&i| elements[i as usize]).collect();
            for lanes in members.chunks(LANES) {
                let unused = (node_count as u32, matrix.unused_place());
                let batch = Batch::new(lanes, rest, place, unused.0, unused.1);
                all.batches.push(batch);
            }
            all.elements.extend(members);
            all.strips.push(first..all.batches.len());
        }
        all
    }

    /// The tetrahedra, in the order of the batches.
    pub fn elements(&self) -> &[Element] {
        &self.elements
    }

    /// Takes over how much of each node is muscle.
    pub fn set_activity(&mut self, activity: &[f32]) {
        let of = |element: &Element| -> f32 {
            element
                .nodes
                .iter()
                .map(|&n| activity[n as usize])
                .sum::<f32>()
                / 4.0
        };
        let mut elements = self.elements.iter();
        let lanes = self.batches.iter().map(|batch| {
            let unused = self.node_count as u32;
            let used = batch.corners[0].map(|node| node != unused);
            Lanes(used.map(|used| {
                if used {
                    elements.next().map_or(0.0, of)
                } else {
                    0.0
                }
            }))
        });
        self.activity = lanes.collect();
    }

    fn muscle(&self, strip: &Range<usize>) -> Option<Contraction<'_>> {
        self.activity
            .get(strip.clone())
            .map(|activity| Contraction {
                activity,
                shortening: self.shortening,
            })
    }

    /// Sets `forces` to the elastic forces on the nodes at `displacements` [N].
    ///
    /// # Panics
    ///
    /// If there is not one force and one displacement a node, and one of each for the unused node.
    pub fn forces(&self, displacements: &[DVec4], lame: Lame, forces: &mut [Vec4]) -> Strain {
        assert!(
            displacements.len() == self.node_count + 1 && forces.len() == self.node_count + 1,
            "one force and one displacement a node"
        );
        forces.fill(Vec4::ZERO);
        let (moduli, forces) = (Moduli::from(lame), forces.as_mut_ptr());
        let mut strain = Strain::default();
        for strip in &self.strips {
            let batches = &self.batches[strip.clone()];
            // SAFETY: corners are nodes, or the unused node.
            let part = unsafe {
                let muscle = self.muscle(strip);
                element::add_forces(batches, displacements, moduli, muscle, forces)
            };
            strain = strain.and(part);
        }
        strain
    }

    /// Adds the stiffness at `displacements` to `matrix`, the left half of which is to be mirrored
    /// then.
    ///
    /// # Panics
    ///
    /// If `matrix` is not the one the elements were made for, or a displacement is missing.
    pub fn add_stiffness(&self, displacements: &[DVec4], lame: Lame, matrix: &mut BlockMatrix) {
        assert!(
            displacements.len() == self.node_count + 1 && matrix.block_count() == self.block_count,
            "one displacement a node, and the matrix the elements were made for"
        );
        let (moduli, blocks) = (Moduli::from(lame), matrix.blocks_mut().as_mut_ptr());
        for strip in &self.strips {
            let batches = &self.batches[strip.clone()];
            // SAFETY: corners are nodes and offsets are in the matrix, the unused ones too.
            unsafe {
                let muscle = self.muscle(strip);
                element::add_stiffness(batches, displacements, moduli, muscle, blocks);
            }
        }
    }
}
