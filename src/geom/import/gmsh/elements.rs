//! The cells of a Gmsh file, with the numbers of their nodes.

use super::super::error::ImportFault;
use super::super::tets::{Cell, Corners};
use super::Format;
use super::cell::{Kind, kind};
use super::lines::{Line, Lines, Words};
use crate::geom::lattice::TETS_MAX;

/// What an element section holds.
#[derive(Default)]
pub(super) struct Elements {
    /// Tetrahedra and hexahedra, their corners as numbers of nodes.
    pub cells: Vec<Cell>,
    /// Points, lines and faces passed over.
    pub ignored: usize,
}

/// Reads the section `$name` up to its end.
pub(super) fn read(
    lines: &mut Lines<'_>,
    format: Format,
    name: &str,
) -> Result<Elements, ImportFault> {
    let mut elements = Elements::default();
    let line = lines.within(name)?;
    match format {
        Format::One | Format::Two => {
            let count = line.words().count("the number of elements")?;
            lines.check_count(&line, count, "elements")?;
            for _ in 0..count {
                let line = lines.within(name)?;
                elements.add_line(&line, format)?;
            }
        }
        Format::FourOne => {
            let mut words = line.words();
            let blocks = words.count("the number of blocks")?;
            let count = words.count("the number of elements")?;
            lines.check_count(&line, count, "elements")?;
            let mut found = 0_usize;
            for _ in 0..blocks {
                found += elements.read_block(lines, name)?;
            }
            if found != count {
                return Err(line.fault(format!(
                    "{count} elements are announced and {found} are there"
                )));
            }
        }
    }
    Ok(elements)
}

impl Elements {
    /// A line of format 1 or 2: number, type, tags, nodes.
    fn add_line(&mut self, line: &Line<'_>, format: Format) -> Result<(), ImportFault> {
        let mut words = line.words();
        let number = words.whole("an element's number")?;
        let kind = kind_of(words.whole("an element's type")?)?;
        if kind == Kind::Boundary {
            self.ignored += 1;
            return Ok(());
        }
        let tags = match format {
            // Two regions and the number of nodes, which follows from the type.
            Format::One => 3,
            Format::Two | Format::FourOne => words.count("the number of tags")?,
        };
        for _ in 0..tags {
            words.next("a tag")?;
        }
        self.add(line, number, kind, words)
    }

    /// One block of format 4.1, of one type; returns how many elements it has.
    fn read_block(&mut self, lines: &mut Lines<'_>, name: &str) -> Result<usize, ImportFault> {
        let head = lines.within(name)?;
        let mut words = head.words();
        for what in ["a dimension", "an entity"] {
            words.next(what)?;
        }
        let kind = kind_of(words.whole("an element's type")?)?;
        let count = words.count("the number of elements in the block")?;
        lines.check_count(&head, count, "elements")?;
        for _ in 0..count {
            let line = lines.within(name)?;
            let mut words = line.words();
            let number = words.whole("an element's number")?;
            self.add(&line, number, kind, words)?;
        }
        Ok(count)
    }

    /// Adds an element whose corners are the words that are left.
    fn add(
        &mut self,
        line: &Line<'_>,
        number: u64,
        kind: Kind,
        corners: Words<'_>,
    ) -> Result<(), ImportFault> {
        let corners = match kind {
            Kind::Tetrahedron => Corners::Tetrahedron(corners.rest("a tetrahedron")?),
            Kind::Hexahedron => Corners::Hexahedron(corners.rest("a hexahedron")?),
            Kind::Boundary => {
                self.ignored += 1;
                return Ok(());
            }
            Kind::Unread(name) => return Err(unread(name.to_owned())),
        };
        if self.cells.len() == TETS_MAX {
            return Err(ImportFault::TooLarge {
                what: format!("more than {TETS_MAX} tetrahedra are over the limit"),
            });
        }
        self.cells.push(Cell {
            number,
            line: line.number,
            corners,
        });
        Ok(())
    }
}

/// The kind of the type `number`, refused where it is a volume that is not read.
fn kind_of(number: u64) -> Result<Kind, ImportFault> {
    match kind(number) {
        Some(Kind::Unread(name)) => Err(unread(name.to_owned())),
        Some(kind) => Ok(kind),
        None => Err(unread(format!("element type {number}"))),
    }
}

fn unread(feature: String) -> ImportFault {
    ImportFault::Unsupported {
        feature,
        remedy: "mesh the body with tetrahedra of 4 nodes or hexahedra of 8 (in Gmsh: \
                 Mesh.ElementOrder = 1)",
    }
}
