//! Scatter charts as SVG text: both axes logarithmic, a marker a point, lines where points belong
//! together. Points that failed stand as crosses on the upper edge instead of being left out.

use super::chart::{AXIS_COLOR, COLORS, GRID_COLOR, MARK_COLOR, TEXT_COLOR, escape, number};
use std::fmt::Write;

const LEFT_PX: f64 = 56.0;
const RIGHT_PX: f64 = 14.0;
const BOTTOM_PX: f64 = 38.0;
/// Room above the plot: the title, then a legend of so many rows.
const TITLE_PX: f64 = 22.0;
const LEGEND_ROW_PX: f64 = 16.0;
/// Band of the failed points and their labels, between legend and plot.
const FAILED_PX: f64 = 30.0;
/// Half the width of a marker.
const MARKER_PX: f64 = 3.6;
/// Points of other programs and notes.
const HOLLOW_COLOR: &str = "#3c4048";
const LABEL_PX: f64 = 9.5;
/// Width of a letter as a share of the height of its font; there are no font metrics here.
const LETTER: f64 = 0.62;
const TEXT_EXPECT: &str = "a string takes all that is written to it";

/// Points of one kind.
#[derive(Clone, Debug, PartialEq)]
pub struct Cloud {
    /// What they are; in the legend unless it is empty.
    pub label: String,
    /// Colour and marker; the same number is the same look in every chart.
    pub look: usize,
    /// Hollow and grey: what was measured elsewhere.
    pub hollow: bool,
    /// Whether a line joins the points in their order.
    pub joined: bool,
    pub points: Vec<Point>,
}

/// A point.
#[derive(Clone, Debug, PartialEq)]
pub struct Point {
    pub x: f64,
    /// `None` if there is nothing to show because it failed.
    pub y: Option<f64>,
    /// Written beside it where there is room.
    pub label: String,
    /// Width of its marker, as a multiple of the common one.
    pub scale: f64,
}

/// A range that holds all positive values, with so much room before and beyond them, as factors.
pub fn range_around(values: impl Iterator<Item = f64>, room: [f64; 2]) -> (f64, f64) {
    let positive = values.filter(|value| *value > 0.0 && value.is_finite());
    let (low, high) = positive.fold((f64::MAX, 0.0_f64), |(low, high), value| {
        (low.min(value), high.max(value))
    });
    if low > high {
        return (0.1, 10.0);
    }
    (low / room[0], high * room[1])
}

/// Points over two logarithmic axes.
#[derive(Clone, Debug, PartialEq)]
pub struct ScatterChart {
    /// Width and height [px].
    pub size_px: (f64, f64),
    pub title: String,
    /// Quantity and unit of x.
    pub x_label: String,
    /// Quantity and unit of y.
    pub y_label: String,
    /// Smallest and largest x; charts beside each other share them.
    pub x_range: (f64, f64),
    /// Smallest and largest y. Smaller values stand on the lower edge, larger ones on the upper.
    pub y_range: (f64, f64),
    pub clouds: Vec<Cloud>,
}

impl ScatterChart {
    /// The chart as an `<svg>` element.
    pub fn svg(&self) -> String {
        let legend = self.legend();
        let frame = Frame::new(self, legend.rows);
        let mut svg = frame.open(self);
        svg += &legend.svg;
        let mut taken = Taken::default();
        for cloud in &self.clouds {
            for point in cloud.points.iter().filter_map(|point| frame.place(point)) {
                taken.add_marker(point);
            }
        }
        for cloud in self.clouds.iter().filter(|cloud| cloud.joined) {
            svg += &frame.line(cloud);
        }
        // What is ours is drawn over what is not.
        let (hollow, filled): (Vec<_>, Vec<_>) = self.clouds.iter().partition(|c| c.hollow);
        for cloud in hollow.into_iter().chain(filled) {
            svg += &frame.markers(cloud);
        }
        for cloud in &self.clouds {
            svg += &frame.labels(cloud, &mut taken);
        }
        svg + "</svg>"
    }

    fn has_failed(&self) -> bool {
        self.clouds
            .iter()
            .flat_map(|cloud| &cloud.points)
            .any(|point| point.y.is_none_or(|y| y > self.y_range.1))
    }

    fn legend(&self) -> Legend {
        let mut entries: Vec<(String, String)> = self
            .clouds
            .iter()
            .filter(|cloud| !cloud.label.is_empty())
            .map(|cloud| (marker(cloud, (0.0, 0.0), 1.0), cloud.label.clone()))
            .collect();
        if self.has_failed() {
            let beyond = number(self.y_range.1);
            entries.push((
                cross((0.0, 0.0), MARK_COLOR),
                format!("failed, or beyond {beyond}"),
            ));
        }
        let (mut x, mut rows) = (LEFT_PX, 1);
        let mut svg = String::new();
        for (marker, label) in entries {
            let width = 28.0 + 11.0 * LETTER * label.chars().count() as f64;
            if x + width > self.size_px.0 && x > LEFT_PX {
                (x, rows) = (LEFT_PX, rows + 1);
            }
            let y = TITLE_PX + LEGEND_ROW_PX * (rows as f64 - 0.5);
            write!(
                svg,
                "<g transform=\"translate({:.1} {y:.1})\">{marker}<text x=\"8\" y=\"4\">{}</text></g>",
                x + 4.0,
                escape(&label)
            )
            .expect(TEXT_EXPECT);
            x += width;
        }
        Legend { svg, rows }
    }
}

struct Legend {
    svg: String,
    rows: usize,
}

/// The plot area and the scales of both axes.
struct Frame {
    left: f64,
    right: f64,
    top: f64,
    bottom: f64,
    x_range: (f64, f64),
    y_range: (f64, f64),
}

impl Frame {
    fn new(chart: &ScatterChart, legend_rows: usize) -> Self {
        Self {
            left: LEFT_PX,
            right: chart.size_px.0 - RIGHT_PX,
            top: TITLE_PX + LEGEND_ROW_PX * legend_rows as f64 + FAILED_PX,
            bottom: chart.size_px.1 - BOTTOM_PX,
            x_range: usable(chart.x_range),
            y_range: usable(chart.y_range),
        }
    }

    fn x(&self, value: f64) -> f64 {
        self.left + share(value, self.x_range) * (self.right - self.left)
    }

    fn y(&self, value: f64) -> f64 {
        self.bottom - share(value, self.y_range) * (self.bottom - self.top)
    }

    /// Height of the failed points.
    fn failed_y(&self) -> f64 {
        self.top - FAILED_PX / 3.0
    }

    /// Where a point is drawn; nowhere without an x.
    fn place(&self, point: &Point) -> Option<(f64, f64)> {
        let x = (point.x > 0.0 && point.x.is_finite()).then(|| self.x(point.x))?;
        Some(match point.y.filter(|&y| y <= self.y_range.1) {
            Some(y) => (x, self.y(y)),
            None => (x, self.failed_y()),
        })
    }

    fn fails(&self, point: &Point) -> bool {
        // NaN is no better than what lies beyond the chart.
        !point.y.is_some_and(|y| y <= self.y_range.1)
    }

    /// The opening tag, the title, the grid and both axes.
    fn open(&self, chart: &ScatterChart) -> String {
        let (width, height) = chart.size_px;
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" \
             width=\"{width}\" height=\"{height}\" role=\"img\" font-size=\"11\" fill=\"{TEXT_COLOR}\" \
             font-family=\"'Helvetica Neue', Arial, sans-serif\">\
             <text x=\"{LEFT_PX}\" y=\"14\" font-size=\"12.5\" font-weight=\"600\">{}</text>",
            escape(&chart.title)
        );
        for value in ticks(self.y_range) {
            let y = self.y(value);
            write!(
                svg,
                "<line x1=\"{}\" x2=\"{}\" y1=\"{y:.1}\" y2=\"{y:.1}\" stroke=\"{GRID_COLOR}\"/>\
                 <text x=\"{}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                self.left,
                self.right,
                self.left - 6.0,
                y + 4.0,
                number(value)
            )
            .expect(TEXT_EXPECT);
        }
        for value in ticks(self.x_range) {
            let x = self.x(value);
            write!(
                svg,
                "<line x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{:.1}\" y2=\"{:.1}\" stroke=\"{GRID_COLOR}\"/>\
                 <text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
                self.top,
                self.bottom,
                self.bottom + 15.0,
                number(value)
            )
            .expect(TEXT_EXPECT);
        }
        let (middle_x, middle_y) = (
            (self.left + self.right) / 2.0,
            (self.top + self.bottom) / 2.0,
        );
        write!(
            svg,
            "<path d=\"M{} {}V{}H{}\" fill=\"none\" stroke=\"{AXIS_COLOR}\"/>\
             <text x=\"{middle_x:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>\
             <text transform=\"translate(12 {middle_y:.1}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
            self.left,
            self.top,
            self.bottom,
            self.right,
            height - 5.0,
            escape(&chart.x_label),
            escape(&chart.y_label)
        )
        .expect(TEXT_EXPECT);
        svg
    }

    /// The line through the points that did not fail.
    fn line(&self, cloud: &Cloud) -> String {
        let mut path = String::new();
        let mut pen_down = false;
        for point in &cloud.points {
            match self.place(point) {
                Some((x, y)) if !self.fails(point) => {
                    let command = if pen_down { 'L' } else { 'M' };
                    write!(path, "{command}{x:.1} {y:.1}").expect(TEXT_EXPECT);
                    pen_down = true;
                }
                _ => pen_down = false,
            }
        }
        format!(
            "<path d=\"{path}\" fill=\"none\" stroke=\"{}\" stroke-width=\"1.2\" opacity=\"0.6\"/>",
            color(cloud)
        )
    }

    fn markers(&self, cloud: &Cloud) -> String {
        let mut svg = String::new();
        for point in &cloud.points {
            let Some(place) = self.place(point) else {
                continue;
            };
            if self.fails(point) {
                svg += &cross(place, color(cloud));
            } else {
                svg += &marker(cloud, place, point.scale);
            }
        }
        svg
    }

    fn labels(&self, cloud: &Cloud, taken: &mut Taken) -> String {
        let mut svg = String::new();
        for point in cloud.points.iter().filter(|point| !point.label.is_empty()) {
            let Some((x, y)) = self.place(point) else {
                continue;
            };
            let width = LABEL_PX * LETTER * point.label.chars().count() as f64;
            let gap = MARKER_PX + 3.0;
            // Right, left, above, below, and the corners; the first place that is free.
            let places = [
                (x + gap, y + 3.0),
                (x - gap - width, y + 3.0),
                (x - width / 2.0, y - gap),
                (x - width / 2.0, y + gap + 7.0),
                (x + gap, y - gap + 1.0),
                (x + gap, y + gap + 5.0),
                (x - gap - width, y - gap + 1.0),
                (x - gap - width, y + gap + 5.0),
            ];
            let fits = |&(x, y): &(f64, f64)| {
                x > self.left
                    && x + width < self.right + RIGHT_PX
                    && y < self.bottom
                    && y - LABEL_PX > self.top - FAILED_PX
                    && taken.is_free([x, y - LABEL_PX + 1.5, x + width, y + 1.5])
            };
            let Some((x, y)) = places.into_iter().find(fits) else {
                continue;
            };
            taken.add([x, y - LABEL_PX + 1.5, x + width, y + 1.5]);
            write!(
                svg,
                "<text x=\"{x:.1}\" y=\"{y:.1}\" font-size=\"{LABEL_PX}\" fill=\"{}\">{}</text>",
                color(cloud),
                escape(&point.label)
            )
            .expect(TEXT_EXPECT);
        }
        svg
    }
}

/// Boxes in which no label can stand: left, top, right, bottom.
#[derive(Default)]
struct Taken(Vec<[f64; 4]>);

impl Taken {
    fn add(&mut self, place: [f64; 4]) {
        self.0.push(place);
    }

    fn add_marker(&mut self, (x, y): (f64, f64)) {
        self.add([x - MARKER_PX, y - MARKER_PX, x + MARKER_PX, y + MARKER_PX]);
    }

    fn is_free(&self, [left, top, right, bottom]: [f64; 4]) -> bool {
        !self
            .0
            .iter()
            .any(|b| left < b[2] && b[0] < right && top < b[3] && b[1] < bottom)
    }
}

fn color(cloud: &Cloud) -> &'static str {
    if cloud.hollow {
        HOLLOW_COLOR
    } else {
        COLORS[cloud.look % COLORS.len()]
    }
}

/// A marker: shapes differ as well as colours, for print and for colour-blind readers.
fn marker(cloud: &Cloud, (x, y): (f64, f64), scale: f64) -> String {
    let r = scale * MARKER_PX;
    let path = match cloud.look % 5 {
        0 => format!(
            "M{:.1} {y:.1}a{r} {r} 0 1 0 {} 0a{r} {r} 0 1 0 -{} 0z",
            x - r,
            2.0 * r,
            2.0 * r
        ),
        1 => format!(
            "M{:.1} {:.1}h{w}v{w}h-{w}z",
            x - 0.9 * r,
            y - 0.9 * r,
            w = 1.8 * r
        ),
        2 => format!(
            "M{x:.1} {:.1}l{w} {h}h-{d}z",
            y - 1.2 * r,
            w = 1.2 * r,
            h = 2.1 * r,
            d = 2.4 * r
        ),
        3 => format!(
            "M{x:.1} {:.1}l{w} {w}l-{w} {w}l-{w} -{w}z",
            y - 1.25 * r,
            w = 1.25 * r
        ),
        _ => format!(
            "M{x:.1} {:.1}l{w} -{h}h-{d}z",
            y + 1.2 * r,
            w = 1.2 * r,
            h = 2.1 * r,
            d = 2.4 * r
        ),
    };
    let color = color(cloud);
    if cloud.hollow {
        format!("<path d=\"{path}\" fill=\"#fff\" fill-opacity=\"0.7\" stroke=\"{color}\"/>")
    } else {
        format!("<path d=\"{path}\" fill=\"{color}\" stroke=\"#fff\" stroke-width=\"0.6\"/>")
    }
}

fn cross((x, y): (f64, f64), color: &str) -> String {
    let r = MARKER_PX;
    format!(
        "<path class=\"failed\" d=\"M{:.1} {:.1}l{d} {d}m-{d} 0l{d} -{d}\" stroke=\"{color}\" \
         stroke-width=\"1.8\" fill=\"none\"/>",
        x - r,
        y - r,
        d = 2.0 * r
    )
}

/// The range if it can be one, else a decade.
fn usable((low, high): (f64, f64)) -> (f64, f64) {
    if low > 0.0 && high > low && high.is_finite() {
        (low, high)
    } else {
        (1.0, 10.0)
    }
}

/// Where `value` lies in a logarithmic range, from 0 to 1.
fn share(value: f64, (low, high): (f64, f64)) -> f64 {
    ((value.max(f64::MIN_POSITIVE) / low).ln() / (high / low).ln()).clamp(0.0, 1.0)
}

/// Powers of ten in the range, and 2 and 5 times them if there are few.
fn ticks((low, high): (f64, f64)) -> Vec<f64> {
    let decades = (high / low).log10();
    let factors: &[f64] = if decades <= 2.2 {
        &[1.0, 2.0, 5.0]
    } else {
        &[1.0]
    };
    let first = low.log10().floor() as i32;
    let last = high.log10().ceil() as i32;
    // Every second power where there would be more than ten.
    let step = if decades > 10.0 { 2 } else { 1 };
    (first..=last)
        .step_by(step)
        .flat_map(|power| factors.iter().map(move |f| f * 10_f64.powi(power)))
        .filter(|value| (low * 0.999..=high * 1.001).contains(value))
        .collect()
}

/// Charts of one size in rows of `columns`, as one picture.
pub fn sheet(charts: &[String], size_px: (f64, f64), columns: usize) -> String {
    let columns = columns.clamp(1, charts.len().max(1));
    let mut svg = opened((
        columns as f64 * size_px.0,
        charts.len().div_ceil(columns) as f64 * size_px.1,
    ));
    for (index, chart) in charts.iter().enumerate() {
        let (x, y) = (
            (index % columns) as f64 * size_px.0,
            (index / columns) as f64 * size_px.1,
        );
        svg += &chart.replacen("<svg ", &format!("<svg x=\"{x}\" y=\"{y}\" "), 1);
    }
    svg + "</svg>\n"
}

/// Charts of their own sizes below each other, as one picture.
pub fn stack(charts: &[(String, (f64, f64))]) -> String {
    let width = charts.iter().map(|(_, size)| size.0).fold(1.0, f64::max);
    let height: f64 = charts.iter().map(|(_, size)| size.1).sum();
    let mut svg = opened((width, height.max(1.0)));
    let mut top = 0.0;
    for (chart, size) in charts {
        svg += &chart.replacen("<svg ", &format!("<svg x=\"0\" y=\"{top}\" "), 1);
        top += size.1;
    }
    svg + "</svg>\n"
}

/// The opening tag of a picture on white.
fn opened((width, height): (f64, f64)) -> String {
    format!(
        "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" \
         width=\"{width}\" height=\"{height}\">\
         <rect width=\"{width}\" height=\"{height}\" fill=\"#fff\"/>"
    )
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(points: &[(f64, Option<f64>)]) -> ScatterChart {
        let point = |&(x, y): &(f64, Option<f64>)| Point {
            x,
            y,
            label: "20 × 1".to_owned(),
            scale: 1.0,
        };
        ScatterChart {
            size_px: (420.0, 300.0),
            title: "a beam <10k>".to_owned(),
            x_label: "ms a frame".to_owned(),
            y_label: "error [%]".to_owned(),
            x_range: (0.1, 100.0),
            y_range: (0.01, 100.0),
            clouds: vec![Cloud {
                label: "xpbd".to_owned(),
                look: 0,
                hollow: false,
                joined: true,
                points: points.iter().map(point).collect(),
            }],
        }
    }

    /// Crosses in the plot, without the one of the legend.
    fn crosses(svg: &str) -> usize {
        svg.matches("class=\"failed\"").count().saturating_sub(1)
    }

    #[test]
    fn failed_points_and_those_beyond_the_axis_stand_as_crosses_and_in_the_legend() {
        let svg = chart(&[(1.0, Some(1.0)), (2.0, None), (3.0, Some(500.0))]).svg();
        assert_eq!(crosses(&svg), 2);
        assert!(svg.contains("failed, or beyond 100"));
        let fine = chart(&[(1.0, Some(1.0)), (2.0, Some(0.5))]).svg();
        assert!(!fine.contains("class=\"failed\""));
    }

    #[test]
    fn point_ten_times_better_is_one_decade_lower() {
        let chart = chart(&[]);
        let frame = Frame::new(&chart, 1);
        let decade = frame.y(1.0) - frame.y(10.0);
        assert!((frame.y(0.1) - frame.y(1.0) - decade).abs() < 1e-9);
        assert_eq!(frame.y(0.0), frame.bottom);
        assert_eq!(frame.y(0.01), frame.bottom);
        assert_eq!(frame.y(100.0), frame.top);
    }

    #[test]
    fn hostile_values_leave_no_bad_number_in_the_picture() {
        let bad = [f64::NAN, f64::INFINITY, -1.0, 0.0];
        let points: Vec<(f64, Option<f64>)> = bad
            .iter()
            .flat_map(|&x| bad.iter().map(move |&y| (x, Some(y))))
            .chain([(1.0, Some(f64::NAN))])
            .collect();
        for range in [(0.1, 100.0), (0.0, 0.0), (f64::NAN, 1.0)] {
            let svg = ScatterChart {
                x_range: range,
                y_range: range,
                ..chart(&points)
            }
            .svg();
            assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
        }
    }

    #[test]
    fn labels_do_not_lie_on_each_other() {
        let points: Vec<(f64, Option<f64>)> = (0..20).map(|_| (1.0, Some(1.0))).collect();
        let svg = chart(&points).svg();
        let labels = svg.matches("20 × 1").count();
        assert!((1..=8).contains(&labels), "{labels} labels round one point");
    }

    #[test]
    fn sheet_places_charts_in_rows() {
        let one = chart(&[]).svg();
        let sheet = sheet(&[one.clone(), one.clone(), one], (420.0, 300.0), 2);
        assert!(sheet.contains("viewBox=\"0 0 840 600\""));
        assert!(sheet.contains("<svg x=\"420\" y=\"0\""));
        assert!(sheet.contains("<svg x=\"0\" y=\"300\""));
    }
}
