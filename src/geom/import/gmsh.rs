//! Gmsh's ASCII `.msh`, formats 1, 2 to 2.2 and 4.1: nodes, tetrahedra and hexahedra.
//!
//! Lines are read one by one and nothing is believed before it is there: a count alone allocates
//! nothing. Sections that say nothing of shape are passed over.
//!
//! Source: Gmsh 4 reference manual, chapters "File formats: MSH file format" and "Legacy formats:
//! MSH file format version 1, version 2".

mod cell;
mod elements;
mod lines;
mod nodes;

use super::error::ImportFault;
use super::tets::{Cell, RawTets};
use lines::{Line, Lines, shortened};
use nodes::Nodes;

/// The layouts that are read.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Format {
    /// `$NOD` and `$ELM`, without a header.
    One,
    /// Versions 2, 2.1 and 2.2.
    Two,
    /// Version 4.1.
    FourOne,
}

impl Format {
    /// The format by its header, `$MeshFormat`.
    fn of_header(line: &Line<'_>) -> Result<(Self, String), ImportFault> {
        let mut words = line.words();
        let version = words.next("a version")?;
        if words.whole("a file type")? != 0 {
            return Err(ImportFault::Unsupported {
                feature: "binary content".to_owned(),
                remedy: "save it as ASCII (in Gmsh: Mesh.Binary = 0)",
            });
        }
        let format = match version {
            "2" | "2.0" | "2.1" | "2.2" => Self::Two,
            "4.1" => Self::FourOne,
            other => {
                return Err(ImportFault::Unsupported {
                    feature: format!("version `{}` of Gmsh's format", shortened(other)),
                    remedy: "save it as version 2.2 or 4.1 (in Gmsh: Mesh.MshFileVersion = 4.1)",
                });
            }
        };
        Ok((format, format!("Gmsh {version}")))
    }
}

/// Reads the nodes and cells of a `.msh` file whose content is `bytes`.
pub(super) fn read(bytes: &[u8]) -> Result<RawTets, ImportFault> {
    let mut reader = Reader::new(bytes);
    while let Some(line) = reader.lines.next()? {
        // What stands between sections is a comment.
        if let Some(name) = line.text.strip_prefix('$') {
            reader.section(&line, name.trim_end())?;
        }
    }
    reader.finish()
}

struct Reader<'a> {
    lines: Lines<'a>,
    format: Option<(Format, String)>,
    nodes: Option<Nodes>,
    cells: Option<Vec<Cell>>,
    ignored: usize,
}

impl<'a> Reader<'a> {
    fn new(bytes: &'a [u8]) -> Self {
        Self {
            lines: Lines::new(bytes),
            format: None,
            nodes: None,
            cells: None,
            ignored: 0,
        }
    }

    /// Reads the section `$name` that `head` opens.
    fn section(&mut self, head: &Line<'_>, name: &str) -> Result<(), ImportFault> {
        match name {
            "MeshFormat" => {
                let line = self.lines.within(name)?;
                self.format = Some(Format::of_header(&line)?);
                self.lines.close(name)
            }
            "NOD" | "Nodes" => {
                let format = self.format_of(head, name == "NOD")?;
                if self.nodes.is_some() {
                    return Err(head.fault(format!("a second section ${name}")));
                }
                self.nodes = Some(Nodes::read(&mut self.lines, format, name)?);
                self.lines.close(name)
            }
            "ELM" | "Elements" => {
                let format = self.format_of(head, name == "ELM")?;
                if self.cells.is_some() {
                    return Err(head.fault(format!("a second section ${name}")));
                }
                let read = elements::read(&mut self.lines, format, name)?;
                self.ignored = read.ignored;
                self.cells = Some(read.cells);
                self.lines.close(name)
            }
            "ParametricNodes" => Err(ImportFault::Unsupported {
                feature: "the section $ParametricNodes".to_owned(),
                remedy: "save the mesh without parametric coordinates",
            }),
            _ if name.starts_with("End") || name.starts_with("END") => {
                let name = shortened(name);
                Err(head.fault(format!("${name} closes a section that is not open")))
            }
            _ => self.lines.skip(name),
        }
    }

    /// The format of a section, whose name is that of format 1 or not.
    fn format_of(&mut self, head: &Line<'_>, named_as_one: bool) -> Result<Format, ImportFault> {
        match (&self.format, named_as_one) {
            (None | Some((Format::One, _)), true) => {
                self.format = Some((Format::One, "Gmsh 1".to_owned()));
                Ok(Format::One)
            }
            (Some((format, _)), false) if *format != Format::One => Ok(*format),
            (None, false) => Err(head.fault("no $MeshFormat stands before this section")),
            _ => Err(head.fault("sections of format 1 and of later ones are mixed")),
        }
    }

    fn finish(self) -> Result<RawTets, ImportFault> {
        let missing = |section: &str| {
            ImportFault::malformed(
                "the whole file",
                format!("it has no section {section}, so it is no Gmsh mesh or is cut short"),
            )
        };
        let (_, format) = self.format.ok_or_else(|| missing("$MeshFormat"))?;
        let nodes = self.nodes.ok_or_else(|| missing("$Nodes"))?;
        let cells = self.cells.ok_or_else(|| missing("$Elements"))?;
        let cells = cells
            .into_iter()
            .map(|cell| nodes.resolve(cell))
            .collect::<Result<_, _>>()?;
        Ok(RawTets {
            format,
            nodes: nodes.positions,
            node_numbers: nodes.numbers,
            cells,
            ignored: self.ignored,
        })
    }
}
