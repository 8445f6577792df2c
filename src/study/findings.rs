//! What a study shows: text and tables for the terminal, the same with charts for the report.

use crate::measure::chart::three_digits;
use crate::measure::page::{Block, Section};
use crate::measure::scatter::{ScatterChart, sheet};

/// What the rows of a study say.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Findings {
    /// Paragraphs, tables and charts, in order.
    pub blocks: Vec<Block>,
    /// All charts in one picture: `NAME.svg`.
    pub svg: String,
}

impl Findings {
    /// What a terminal can show of it.
    pub fn text(&self) -> String {
        let mut text = String::new();
        for block in &self.blocks {
            match block {
                Block::Paragraph(paragraph) => text += &format!("{}\n\n", wrapped(paragraph)),
                Block::Table(table) => text += &format!("{}\n", table.text()),
                Block::Chart { .. } | Block::Charts(_) | Block::Pictures(_) => {}
            }
        }
        text
    }

    /// The section of the report.
    pub fn section(self, title: String) -> Section {
        Section {
            title,
            blocks: self.blocks,
        }
    }
}

/// The chart of each of `scenes`: all in one picture, in two columns, and as a block with their names.
pub fn scene_charts(scenes: &[&str], chart: impl Fn(&str) -> ScatterChart) -> (String, Block) {
    let drawn: Vec<ScatterChart> = scenes.iter().map(|scene| chart(scene)).collect();
    let size_px = drawn.first().map_or((0.0, 0.0), |chart| chart.size_px);
    let charts: Vec<String> = drawn.iter().map(ScatterChart::svg).collect();
    let svg = sheet(&charts, size_px, 2);
    let captions = scenes.iter().map(|scene| (*scene).to_owned());
    (
        svg,
        Block::Charts(charts.into_iter().zip(captions).collect()),
    )
}

/// A number of a table to three digits; a dash where nothing was measured.
pub fn told(value: Option<f64>) -> String {
    value.map_or_else(|| "-".to_owned(), three_digits)
}

/// `text` in lines of a width that reads well.
fn wrapped(text: &str) -> String {
    const WIDTH: usize = 100;
    let mut lines = vec![String::new()];
    for word in text.split_whitespace() {
        let line = lines.last_mut().expect("there is always a line");
        if line.is_empty() {
            line.push_str(word);
        } else if line.chars().count() + 1 + word.chars().count() <= WIDTH {
            line.push(' ');
            line.push_str(word);
        } else {
            lines.push(word.to_owned());
        }
    }
    lines.join("\n")
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::measure::page::Table;

    #[test]
    fn text_holds_paragraphs_and_tables_in_order_and_no_chart() {
        let findings = Findings {
            blocks: vec![
                Block::Paragraph("word ".repeat(30)),
                Block::Chart {
                    svg: "<svg/>".to_owned(),
                    caption: String::new(),
                },
                Block::Table(Table {
                    head: vec!["method".to_owned(), "ms".to_owned()],
                    rows: vec![vec!["xpbd".to_owned(), "1.5".to_owned()]],
                }),
            ],
            svg: String::new(),
        };
        let text = findings.text();
        assert!(!text.contains("<svg"));
        assert!(text.find("word").unwrap() < text.find("xpbd").unwrap());
        assert!(text.lines().all(|line| line.chars().count() <= 100));
    }
}
