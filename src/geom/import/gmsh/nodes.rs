//! The nodes of a Gmsh file, and cells that name them.

use super::super::error::ImportFault;
use super::super::part::ELEMENTS_MAX;
use super::super::tets::{Cell, Corners};
use super::Format;
use super::lines::{Line, Lines};
use glam::DVec3;
use std::collections::HashMap;
use std::collections::hash_map::Entry;

/// Nodes in the order of the file.
#[derive(Default)]
pub(super) struct Nodes {
    /// Where each is, in the unit of the file.
    pub positions: Vec<DVec3>,
    /// The number each has in the file.
    pub numbers: Vec<u64>,
    /// The place in these lists by number.
    places: HashMap<u64, u32>,
}

impl Nodes {
    /// Reads the section `$name` up to its end.
    pub fn read(lines: &mut Lines<'_>, format: Format, name: &str) -> Result<Self, ImportFault> {
        let mut nodes = Self::default();
        let line = lines.within(name)?;
        match format {
            Format::One | Format::Two => {
                let count = line.words().count("the number of nodes")?;
                check_room(lines, &line, count)?;
                for _ in 0..count {
                    let line = lines.within(name)?;
                    let number = line.words().whole("a node's number")?;
                    nodes.add(&line, number, position(&line, 1)?)?;
                }
            }
            Format::FourOne => {
                let mut words = line.words();
                let blocks = words.count("the number of blocks")?;
                let count = words.count("the number of nodes")?;
                check_room(lines, &line, count)?;
                for _ in 0..blocks {
                    nodes.read_block(lines, name)?;
                }
                if nodes.numbers.len() != count {
                    return Err(line.fault(format!(
                        "{count} nodes are announced and {} are there",
                        nodes.numbers.len()
                    )));
                }
            }
        }
        Ok(nodes)
    }

    /// One block of format 4.1: its head, all numbers, all positions.
    fn read_block(&mut self, lines: &mut Lines<'_>, name: &str) -> Result<(), ImportFault> {
        let head = lines.within(name)?;
        let mut words = head.words();
        for what in ["a dimension", "an entity", "a parametric flag"] {
            words.next(what)?;
        }
        let count = words.count("the number of nodes in the block")?;
        check_room(lines, &head, count)?;
        let numbers = (0..count)
            .map(|_| {
                let line = lines.within(name)?;
                Ok((line, line.words().whole("a node's number")?))
            })
            .collect::<Result<Vec<_>, ImportFault>>()?;
        for (named_in, number) in numbers {
            let line = lines.within(name)?;
            self.add(&named_in, number, position(&line, 0)?)?;
        }
        Ok(())
    }

    fn add(&mut self, line: &Line<'_>, number: u64, position: DVec3) -> Result<(), ImportFault> {
        match self.places.entry(number) {
            Entry::Occupied(_) => {
                return Err(line.fault(format!("node {number} is there already")));
            }
            Entry::Vacant(vacant) => vacant.insert(self.numbers.len() as u32),
        };
        self.numbers.push(number);
        self.positions.push(position);
        Ok(())
    }

    /// `cell` with the places of its nodes instead of their numbers.
    pub fn resolve(&self, cell: Cell) -> Result<Cell, ImportFault> {
        let place = |number: u64| {
            let place = self.places.get(&number).copied().map(u64::from);
            place.ok_or_else(|| {
                ImportFault::malformed(
                    format!("line {}", cell.line),
                    format!(
                        "element {} names node {number}, which is not there",
                        cell.number
                    ),
                )
            })
        };
        Ok(Cell {
            corners: match cell.corners {
                Corners::Tetrahedron(corners) => Corners::Tetrahedron(each(corners, place)?),
                Corners::Hexahedron(corners) => Corners::Hexahedron(each(corners, place)?),
            },
            ..cell
        })
    }
}

fn each<const N: usize>(
    numbers: [u64; N],
    place: impl Fn(u64) -> Result<u64, ImportFault>,
) -> Result<[u64; N], ImportFault> {
    let mut places = [0; N];
    for (slot, number) in places.iter_mut().zip(numbers) {
        *slot = place(number)?;
    }
    Ok(places)
}

/// The three coordinates of a line behind `skipped` words; parametric ones may follow.
fn position(line: &Line<'_>, skipped: usize) -> Result<DVec3, ImportFault> {
    let mut words = line.words();
    for _ in 0..skipped {
        words.next("a node's number")?;
    }
    Ok(DVec3::new(
        words.coordinate("x")?,
        words.coordinate("y")?,
        words.coordinate("z")?,
    ))
}

fn check_room(lines: &Lines<'_>, line: &Line<'_>, count: usize) -> Result<(), ImportFault> {
    lines.check_count(line, count, "nodes")?;
    if count <= ELEMENTS_MAX {
        return Ok(());
    }
    Err(ImportFault::TooLarge {
        what: format!("{count} nodes are over the limit of {ELEMENTS_MAX}"),
    })
}
