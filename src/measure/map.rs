//! Maps as SVG text: panels of tiles over two knobs, each tile fine, degraded or failed. States differ
//! by colour and by glyph, for print and for colour-blind readers.

use super::chart::{AXIS_COLOR, TEXT_COLOR, escape};
use std::fmt::Write;

/// Height of a tile and its least width, and what lies round the tiles of a panel [px].
const TILE_PX: f64 = 24.0;
const RIGHT_PX: f64 = 14.0;
/// Room left of the tiles, the names of the rows apart.
const LABEL_PX: f64 = 24.0;
/// Width of a letter of names and titles: there are no font metrics here.
const NAME_LETTER_PX: f64 = 5.6;
const TITLE_LETTER_PX: f64 = 7.2;
const PANEL_TOP_PX: f64 = 20.0;
const PANEL_BOTTOM_PX: f64 = 34.0;
/// Title and legend above all panels.
const HEAD_PX: f64 = 44.0;
const TEXT_EXPECT: &str = "a string takes all that is written to it";

/// The state of a tile, in the order of the legend; the worst of its points.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Tile {
    Fine,
    Degraded,
    Failed,
}

impl Tile {
    const ALL: [Self; 3] = [Self::Fine, Self::Degraded, Self::Failed];

    fn name(self) -> &'static str {
        match self {
            Self::Fine => "fine",
            Self::Degraded => "degraded",
            Self::Failed => "failed",
        }
    }

    fn fill(self) -> &'static str {
        match self {
            Self::Fine => "#d3e8ee",
            Self::Degraded => "#f3c56b",
            Self::Failed => "#a32a24",
        }
    }

    /// A dot, a bar or a cross about the middle of the tile.
    fn glyph(self, (x, y): (f64, f64)) -> String {
        let path = |d: String, color: &str| {
            format!("<path d=\"{d}\" stroke=\"{color}\" stroke-width=\"2\" fill=\"none\"/>")
        };
        match self {
            Self::Fine => format!("<circle cx=\"{x:.1}\" cy=\"{y:.1}\" r=\"2\" fill=\"#1f6f8b\"/>"),
            Self::Degraded => path(format!("M{:.1} {y:.1}h9", x - 4.5), "#5b4310"),
            Self::Failed => path(
                format!("M{:.1} {:.1}l8 8m0 -8l-8 8", x - 4.0, y - 4.0),
                "#fff",
            ),
        }
    }

    /// The tile with its upper left corner at a place.
    fn svg(self, (x, y): (f64, f64), width: f64) -> String {
        let (width, height) = (width - 1.5, TILE_PX - 1.5);
        format!(
            "<g class=\"{}\"><rect x=\"{x:.1}\" y=\"{y:.1}\" width=\"{width:.1}\" height=\"{height:.1}\" \
             fill=\"{}\"/>{}</g>",
            self.name(),
            self.fill(),
            self.glyph((x + width / 2.0, y + height / 2.0))
        )
    }
}

/// Tiles over two knobs.
#[derive(Clone, Debug, PartialEq)]
pub struct Panel {
    pub title: String,
    /// Column and row of each point, from 0; the worst at a place is shown.
    pub points: Vec<(usize, usize, Tile)>,
}

/// Panels that share their knobs.
#[derive(Clone, Debug, PartialEq)]
pub struct MapChart {
    pub title: String,
    /// The knob along x and its values.
    pub x_label: String,
    pub columns: Vec<String>,
    /// The knob along y and its values, from the bottom.
    pub y_label: String,
    pub rows: Vec<String>,
    pub panels: Vec<Panel>,
    /// Panels beside each other.
    pub panels_across: usize,
}

impl MapChart {
    /// Width and height [px].
    pub fn size_px(&self) -> (f64, f64) {
        let (width, height) = self.panel_px();
        let across = self.panels_across.max(1);
        let down = self.panels.len().div_ceil(across).max(1);
        let title = 8.0 * self.title.chars().count() as f64;
        (
            (across as f64 * width).max(title),
            HEAD_PX + down as f64 * height,
        )
    }

    fn panel_px(&self) -> (f64, f64) {
        let tiles = self.tile_px() * self.columns.len() as f64;
        let titles = self.panels.iter().map(|panel| panel.title.as_str());
        let title = LABEL_PX + TITLE_LETTER_PX * longest(titles);
        (
            (self.left_px() + tiles + RIGHT_PX).max(title),
            PANEL_TOP_PX + PANEL_BOTTOM_PX + TILE_PX * self.rows.len() as f64,
        )
    }

    /// Room left of the tiles.
    fn left_px(&self) -> f64 {
        LABEL_PX + NAME_LETTER_PX * longest(self.rows.iter().map(String::as_str))
    }

    /// Width of a tile, with room for its name.
    fn tile_px(&self) -> f64 {
        let names = longest(self.columns.iter().map(String::as_str));
        (4.0 + NAME_LETTER_PX * names).max(TILE_PX)
    }

    /// The chart as an `<svg>` element.
    pub fn svg(&self) -> String {
        let (width, height) = self.size_px();
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" \
             width=\"{width}\" height=\"{height}\" role=\"img\" font-size=\"10.5\" fill=\"{TEXT_COLOR}\" \
             font-family=\"'Helvetica Neue', Arial, sans-serif\">\
             <text x=\"6\" y=\"14\" font-size=\"12.5\" font-weight=\"600\">{}</text>",
            escape(&self.title)
        );
        let mut x = 6.0;
        for tile in Tile::ALL {
            write!(
                svg,
                "<g class=\"legend\" transform=\"translate({x} 20) scale(0.75)\">{}</g>\
                 <text x=\"{}\" y=\"33\">{}</text>",
                tile.svg((0.0, 0.0), TILE_PX),
                x + 22.0,
                tile.name()
            )
            .expect(TEXT_EXPECT);
            x += 90.0;
        }
        let (panel_width, panel_height) = self.panel_px();
        for (index, panel) in self.panels.iter().enumerate() {
            let across = self.panels_across.max(1);
            let left = (index % across) as f64 * panel_width + self.left_px();
            let top = HEAD_PX + (index / across) as f64 * panel_height + PANEL_TOP_PX;
            svg += &self.panel(panel, (left, top));
        }
        svg + "</svg>"
    }

    fn panel(&self, panel: &Panel, (left, top): (f64, f64)) -> String {
        let (columns, rows) = (self.columns.len(), self.rows.len());
        let width = self.tile_px();
        let edge = left - self.left_px();
        let bottom = top + TILE_PX * rows as f64;
        let mut svg = format!(
            "<text x=\"{:.1}\" y=\"{:.1}\" font-weight=\"600\">{}</text>",
            edge + LABEL_PX - 8.0,
            top - 6.0,
            escape(&panel.title)
        );
        for (column, name) in self.columns.iter().enumerate() {
            write!(
                svg,
                "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\" font-size=\"9\">{}</text>",
                left + width * (column as f64 + 0.5),
                bottom + 11.0,
                escape(name)
            )
            .expect(TEXT_EXPECT);
        }
        for (row, name) in self.rows.iter().enumerate() {
            write!(
                svg,
                "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\" font-size=\"9\">{}</text>",
                left - 4.0,
                bottom - TILE_PX * (row as f64 + 0.5) + 3.0,
                escape(name)
            )
            .expect(TEXT_EXPECT);
        }
        write!(
            svg,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>\
             <text transform=\"translate({:.1} {:.1}) rotate(-90)\" text-anchor=\"middle\">{}</text>\
             <rect x=\"{:.1}\" y=\"{:.1}\" width=\"{:.1}\" height=\"{:.1}\" fill=\"none\" \
             stroke=\"{AXIS_COLOR}\" stroke-width=\"0.6\"/>",
            left + width * columns as f64 / 2.0,
            bottom + 24.0,
            escape(&self.x_label),
            edge + 12.0,
            (top + bottom) / 2.0,
            escape(&self.y_label),
            left - 1.5,
            top - 1.5,
            width * columns as f64 + 1.5,
            TILE_PX * rows as f64 + 1.5,
        )
        .expect(TEXT_EXPECT);
        for column in 0..columns {
            for row in 0..rows {
                let here = |point: &&(usize, usize, Tile)| (point.0, point.1) == (column, row);
                let worst = panel.points.iter().filter(here).map(|point| point.2).max();
                if let Some(tile) = worst {
                    let place = (
                        left + width * column as f64,
                        bottom - TILE_PX * (row as f64 + 1.0),
                    );
                    svg += &tile.svg(place, width);
                }
            }
        }
        svg
    }
}

/// Letters of the longest name.
fn longest<'a>(names: impl Iterator<Item = &'a str>) -> f64 {
    names.map(|name| name.chars().count()).max().unwrap_or(0) as f64
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(points: Vec<(usize, usize, Tile)>) -> MapChart {
        MapChart {
            title: "xpbd <springs>".to_owned(),
            x_label: "substep [ms]".to_owned(),
            columns: vec!["1".to_owned(), "10".to_owned()],
            y_label: "E [Pa]".to_owned(),
            rows: vec!["10³".to_owned(), "10⁴".to_owned(), "10⁵".to_owned()],
            panels: vec![Panel {
                title: "beam".to_owned(),
                points,
            }],
            panels_across: 1,
        }
    }

    /// Tiles of a state, without the one of the legend.
    fn tiles(svg: &str, state: &str) -> usize {
        svg.matches(&format!("<g class=\"{state}\">")).count() - 1
    }

    #[test]
    fn tile_shows_the_worst_of_its_points_and_none_where_nothing_was_measured() {
        let svg = chart(vec![
            (0, 0, Tile::Fine),
            (0, 0, Tile::Failed),
            (0, 0, Tile::Degraded),
            (1, 2, Tile::Fine),
        ])
        .svg();
        assert_eq!(tiles(&svg, "failed"), 1);
        assert_eq!(tiles(&svg, "degraded"), 0);
        assert_eq!(tiles(&svg, "fine"), 1);
    }

    #[test]
    fn states_differ_by_more_than_colour() {
        let glyphs = Tile::ALL.map(|tile| {
            let glyph = tile.glyph((0.0, 0.0));
            glyph.split("stroke=").next().unwrap_or_default().to_owned()
        });
        assert!(glyphs[0] != glyphs[1] && glyphs[1] != glyphs[2] && glyphs[0] != glyphs[2]);
    }

    #[test]
    fn panels_stand_in_rows_inside_the_picture() {
        let mut map = chart(Vec::new());
        map.panels = vec![map.panels[0].clone(); 5];
        map.panels_across = 2;
        let (width, height) = map.size_px();
        assert_eq!(width, 2.0 * map.panel_px().0);
        assert_eq!(
            height,
            HEAD_PX + 3.0 * (PANEL_TOP_PX + PANEL_BOTTOM_PX + 3.0 * TILE_PX)
        );
        assert!(map.svg().contains("xpbd &lt;springs&gt;"));
        // A long name makes room for itself.
        map.columns[1] = "millimetre".to_owned();
        assert!(map.size_px().0 > width);
    }
}
