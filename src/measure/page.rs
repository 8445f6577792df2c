//! One self-contained HTML page: headings, paragraphs, charts, tables and pictures. No script, light,
//! and fit for print.

use super::chart::escape;
use super::files::{FileError, write};
use base64::Engine;
use std::fmt::Write;
use std::path::Path;

const STYLE: &str = include_str!("page.css");
const TEXT_EXPECT: &str = "a string takes all that is written to it";

/// A page.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Page {
    /// Heading, and the name of the browser's tab.
    pub title: String,
    /// One line under the heading.
    pub subtitle: String,
    /// The result in a few sentences.
    pub lead: String,
    /// The numbers to see first.
    pub figures: Vec<KeyFigure>,
    /// What follows.
    pub sections: Vec<Section>,
}

/// A number to see first.
#[derive(Clone, Debug, PartialEq)]
pub struct KeyFigure {
    /// What it is.
    pub label: String,
    /// The number.
    pub value: String,
    /// Its unit.
    pub unit: String,
}

/// A part of a page under a heading.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Section {
    /// The heading.
    pub title: String,
    /// What it holds, in order.
    pub blocks: Vec<Block>,
}

/// A piece of a section.
#[derive(Clone, Debug, PartialEq)]
pub enum Block {
    /// Plain text.
    Paragraph(String),
    /// A chart over the whole width.
    Chart {
        /// An `<svg>` element.
        svg: String,
        /// What it shows.
        caption: String,
    },
    /// Charts side by side, two in a row: an `<svg>` element and what it shows.
    Charts(Vec<(String, String)>),
    /// A table; columns of numbers are set to the right.
    Table(Table),
    /// Pictures as PNG files, each with what it shows.
    Pictures(Vec<(Vec<u8>, String)>),
}

/// A table.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Table {
    /// Heads of the columns; none are shown if all are empty.
    pub head: Vec<String>,
    /// Cells, row by row.
    pub rows: Vec<Vec<String>>,
}

impl Page {
    /// The page as HTML.
    pub fn html(&self) -> String {
        let title = escape(&self.title);
        let mut html = format!(
            "<!doctype html>\n<html lang=\"en\">\n<head>\n<meta charset=\"utf-8\">\n\
             <meta name=\"viewport\" content=\"width=device-width, initial-scale=1\">\n\
             <title>{title}</title>\n<style>\n{STYLE}</style>\n</head>\n<body>\n<main>\n\
             <header>\n<h1>{title}</h1>\n<p class=\"subtitle\">{}</p>\n</header>\n",
            escape(&self.subtitle)
        );
        if !self.lead.is_empty() {
            writeln!(html, "<p class=\"lead\">{}</p>", escape(&self.lead)).expect(TEXT_EXPECT);
        }
        if !self.figures.is_empty() {
            html += "<dl class=\"figures\">\n";
            for figure in &self.figures {
                writeln!(
                    html,
                    "<div><dt>{}</dt><dd>{} <span>{}</span></dd></div>",
                    escape(&figure.label),
                    escape(&figure.value),
                    escape(&figure.unit)
                )
                .expect(TEXT_EXPECT);
            }
            html += "</dl>\n";
        }
        for section in &self.sections {
            writeln!(html, "<section>\n<h2>{}</h2>", escape(&section.title)).expect(TEXT_EXPECT);
            for block in &section.blocks {
                html += &block.html();
            }
            html += "</section>\n";
        }
        html + "</main>\n</body>\n</html>\n"
    }

    /// Writes the page.
    ///
    /// # Errors
    ///
    /// [`FileError::Write`].
    pub fn write(&self, file: &Path) -> Result<(), FileError> {
        write(file, self.html().as_bytes())
    }
}

impl Block {
    fn html(&self) -> String {
        match self {
            Self::Paragraph(text) => format!("<p>{}</p>\n", escape(text)),
            Self::Chart { svg, caption } => figure(svg, caption),
            Self::Charts(charts) => {
                let charts = charts.iter().map(|(svg, caption)| figure(svg, caption));
                format!(
                    "<div class=\"pair\">\n{}</div>\n",
                    charts.collect::<String>()
                )
            }
            Self::Table(table) => table.html(),
            Self::Pictures(pictures) => {
                let pictures = pictures.iter().map(|(png, caption)| {
                    let data = base64::engine::general_purpose::STANDARD.encode(png);
                    let alt = escape(caption);
                    figure(
                        &format!("<img src=\"data:image/png;base64,{data}\" alt=\"{alt}\">"),
                        caption,
                    )
                });
                format!(
                    "<div class=\"pictures\">\n{}</div>\n",
                    pictures.collect::<String>()
                )
            }
        }
    }
}

fn figure(content: &str, caption: &str) -> String {
    let caption = escape(caption);
    format!("<figure>{content}<figcaption>{caption}</figcaption></figure>\n")
}

impl Table {
    /// The table as text, its columns lined up.
    pub fn text(&self) -> String {
        let lines: Vec<&Vec<String>> = std::iter::once(&self.head).chain(&self.rows).collect();
        let cell =
            |line: &[String], column: usize| line.get(column).map_or(0, |c| c.chars().count());
        let columns = lines.iter().map(|line| line.len()).max().unwrap_or(0);
        let widths: Vec<usize> = (0..columns)
            .map(|column| {
                lines
                    .iter()
                    .map(|line| cell(line, column))
                    .max()
                    .unwrap_or(0)
            })
            .collect();
        let mut text = String::new();
        for line in lines.iter().filter(|line| !line.is_empty()) {
            let cells = line.iter().zip(&widths).enumerate();
            let cells: Vec<String> = cells
                .map(|(column, (cell, &width))| {
                    if self.holds_numbers(column) {
                        format!("{cell:>width$}")
                    } else {
                        format!("{cell:<width$}")
                    }
                })
                .collect();
            text += cells.join("  ").trim_end();
            text.push('\n');
        }
        text
    }

    /// Whether every cell of a column is a number or empty.
    fn holds_numbers(&self, column: usize) -> bool {
        let mut cells = self.rows.iter().filter_map(|row| row.get(column));
        cells.all(|cell| {
            cell.is_empty() || cell.starts_with(|c: char| c.is_ascii_digit() || c == '−')
        })
    }

    fn html(&self) -> String {
        let class = |column: usize| {
            if self.holds_numbers(column) {
                " class=\"number\""
            } else {
                ""
            }
        };
        let row = |tag: &str, cells: &[String]| {
            let cells = cells
                .iter()
                .enumerate()
                .map(|(column, cell)| format!("<{tag}{}>{}</{tag}>", class(column), escape(cell)));
            format!("<tr>{}</tr>\n", cells.collect::<String>())
        };
        let mut html = "<table>\n".to_owned();
        if self.head.iter().any(|head| !head.is_empty()) {
            html += &format!("<thead>{}</thead>\n", row("th", &self.head));
        }
        html += "<tbody>\n";
        for cells in &self.rows {
            html += &row("td", cells);
        }
        html + "</tbody>\n</table>\n"
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn page_needs_no_other_file_and_no_script() {
        let page = Page {
            title: "liver <replay>".to_owned(),
            sections: vec![Section {
                title: "Pictures".to_owned(),
                blocks: vec![Block::Pictures(vec![(vec![1, 2, 3], "frame 7".to_owned())])],
            }],
            ..Page::default()
        };
        let html = page.html();
        assert!(html.contains("<h1>liver &lt;replay&gt;</h1>"));
        assert!(html.contains("data:image/png;base64,AQID"));
        for outside in ["<script", "<link", "src=\"http", "url(http", "@import"] {
            assert!(!html.contains(outside), "{outside}");
        }
    }

    #[test]
    fn text_of_a_table_lines_its_columns_up() {
        let table = Table {
            head: vec!["pass".to_owned(), "ms".to_owned()],
            rows: vec![
                vec!["refit".to_owned(), "1.5".to_owned()],
                vec!["surface, µ".to_owned(), "12.0".to_owned()],
            ],
        };
        assert_eq!(
            table.text(),
            "pass          ms\nrefit        1.5\nsurface, µ  12.0\n"
        );
    }

    #[test]
    fn columns_of_numbers_stand_to_the_right() {
        let table = Table {
            head: vec!["pass".to_owned(), "ms".to_owned()],
            rows: vec![vec!["refit".to_owned(), "1.5".to_owned()]],
        };
        let html = table.html();
        assert!(
            html.contains("<td>refit</td><td class=\"number\">1.5</td>"),
            "{html}"
        );
    }
}
