//! Charts as SVG text: lines over an axis, and stacked bars. No script, no font file.

use std::fmt::Write;

/// Told apart in grey print and by colour-blind readers; a ninth series starts over.
pub const COLORS: [&str; 8] = [
    "#1f6f8b", "#e08e45", "#6a994e", "#9b4f96", "#8d99ae", "#c9a227", "#bc4749", "#3d5a80",
];
pub(super) const AXIS_COLOR: &str = "#8a8f98";
pub(super) const GRID_COLOR: &str = "#e4e6ea";
pub(super) const TEXT_COLOR: &str = "#3c4048";
pub(super) const MARK_COLOR: &str = "#b3261e";
const LEFT_PX: f64 = 68.0;
const RIGHT_PX: f64 = 12.0;
/// Room at the right for the names of levels.
const LEVEL_NAMES_PX: f64 = 74.0;
/// Lines of text are this far apart.
const LINE_PX: f64 = 13.0;
const BOTTOM_PX: f64 = 38.0;
const TOP_PX: f64 = 14.0;
/// Height of the row of names above a chart of several series.
const LEGEND_PX: f64 = 20.0;
/// Bars beyond this are gathered: each then shows the mean of its neighbours.
pub const BARS_MAX: usize = 150;
const TEXT_EXPECT: &str = "a string takes all that is written to it";

/// A named line.
#[derive(Clone, Debug, PartialEq)]
pub struct Series {
    /// What it shows.
    pub label: String,
    /// Colour; the same number is the same colour in every chart.
    pub look: usize,
    /// Points in ascending x; a value that is not finite breaks the line.
    pub points: Vec<(f64, f64)>,
}

/// A horizontal line with its name at the right end.
#[derive(Clone, Debug, PartialEq)]
pub struct Level {
    /// What it marks.
    pub label: String,
    /// Where on the y axis.
    pub value: f64,
}

/// Lines over a common x axis, from zero on the y axis.
#[derive(Clone, Debug, PartialEq)]
pub struct LineChart {
    /// Width and height [px].
    pub size_px: (f64, f64),
    /// Quantity and unit of x.
    pub x_label: String,
    /// Quantity and unit of y.
    pub y_label: String,
    /// The lines.
    pub series: Vec<Series>,
    /// Horizontal marks.
    pub levels: Vec<Level>,
    /// Larger values are marked at the top edge, with the largest written there, so that one
    /// stalled frame does not flatten all others. `None` shows everything to scale.
    pub ceiling: Option<f64>,
}

/// Bars of stacked layers, one bar a position.
#[derive(Clone, Debug, PartialEq)]
pub struct StackedChart {
    /// Width and height [px].
    pub size_px: (f64, f64),
    /// Quantity and unit of x.
    pub x_label: String,
    /// Quantity and unit of y.
    pub y_label: String,
    /// The layers from the bottom, each with a value a bar.
    pub layers: Vec<(String, Vec<f64>)>,
}

impl LineChart {
    /// The chart as an `<svg>` element.
    pub fn svg(&self) -> String {
        let finite = |&(_, y): &(f64, f64)| y.is_finite();
        let points = || self.series.iter().flat_map(|s| s.points.iter().copied());
        let values = points().filter(finite).map(|(_, y)| y);
        let (low, high) = values
            .chain(self.levels.iter().map(|level| level.value))
            .filter(|y| y.is_finite() && self.ceiling.is_none_or(|ceiling| *y <= ceiling))
            .fold((0.0_f64, 0.0_f64), |(low, high), y| {
                (low.min(y), high.max(y))
            });
        let xs = points().map(|(x, _)| x).filter(|x| x.is_finite());
        let (first, last) = xs.fold((f64::MAX, f64::MIN), |(low, high), x| {
            (low.min(x), high.max(x))
        });
        let names: Vec<(&str, usize)> = (self.series.iter())
            .map(|s| (s.label.as_str(), s.look))
            .collect();
        let mut axes = Axes::new(self.size_px, (first, last), (low, high), names.len() > 1);
        if !self.levels.is_empty() {
            axes.right -= LEVEL_NAMES_PX;
        }
        let mut svg = axes.open(&self.x_label, &self.y_label);
        if names.len() > 1 {
            svg += &legend(&names);
        }
        for series in &self.series {
            let color = COLORS[series.look % COLORS.len()];
            write!(
                svg,
                "<path d=\"{}\" fill=\"none\" stroke=\"{color}\" stroke-width=\"1.3\" \
                 stroke-linejoin=\"round\"/>",
                axes.path(&series.points)
            )
            .expect(TEXT_EXPECT);
        }
        svg += &self.level_marks(&axes);
        svg += &self.over_ceiling(&axes);
        svg + "</svg>"
    }

    fn level_marks(&self, axes: &Axes) -> String {
        let mut svg = String::new();
        let mut ordered: Vec<&Level> = self.levels.iter().collect();
        ordered.sort_by(|a, b| a.value.total_cmp(&b.value));
        // Names of neighbouring levels are pushed apart, upwards.
        let mut text_floor = f64::MAX;
        for level in ordered {
            let y = axes.y(level.value);
            let text_y = (y + 4.0).min(text_floor);
            text_floor = text_y - LINE_PX;
            write!(
                svg,
                "<line x1=\"{LEFT_PX}\" x2=\"{right:.1}\" y1=\"{y:.1}\" y2=\"{y:.1}\" \
                 stroke=\"{MARK_COLOR}\" stroke-width=\"1\" stroke-dasharray=\"5 3\"/>\
                 <text x=\"{:.1}\" y=\"{text_y:.1}\" fill=\"{MARK_COLOR}\">{}</text>",
                axes.right + 6.0,
                escape(&level.label),
                right = axes.right,
            )
            .expect(TEXT_EXPECT);
        }
        svg
    }

    /// A triangle at the top edge for each point above the ceiling, the largest with its value.
    fn over_ceiling(&self, axes: &Axes) -> String {
        let Some(ceiling) = self.ceiling else {
            return String::new();
        };
        let points = self.series.iter().flat_map(|s| &s.points);
        let over: Vec<_> = points.filter(|(_, y)| *y > ceiling).collect();
        let mut svg = String::new();
        for (x, _) in &over {
            let x = axes.x(*x);
            write!(
                svg,
                "<path d=\"M{:.1} {:.1}l3.5 6h-7z\" fill=\"{MARK_COLOR}\"/>",
                x, axes.top
            )
            .expect(TEXT_EXPECT);
        }
        if let Some((x, y)) = over.iter().max_by(|a, b| a.1.total_cmp(&b.1)) {
            let (x, anchor) = if axes.x(*x) > (axes.right + LEFT_PX) / 2.0 {
                (axes.x(*x) - 7.0, "end")
            } else {
                (axes.x(*x) + 7.0, "start")
            };
            write!(
                svg,
                "<text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"{anchor}\" fill=\"{MARK_COLOR}\">{}</text>",
                axes.top + 7.0,
                number(*y)
            )
            .expect(TEXT_EXPECT);
        }
        svg
    }
}

impl StackedChart {
    /// The chart as an `<svg>` element.
    pub fn svg(&self) -> String {
        let count = self
            .layers
            .iter()
            .map(|(_, values)| values.len())
            .max()
            .unwrap_or(0);
        let group = count.div_ceil(BARS_MAX).max(1);
        let layers: Vec<Vec<f64>> = self
            .layers
            .iter()
            .map(|(_, values)| values.chunks(group).map(mean).collect())
            .collect();
        let bars = count.div_ceil(group);
        let height = |bar: usize| {
            layers
                .iter()
                .map(|layer| layer.get(bar).unwrap_or(&0.0))
                .sum()
        };
        let high = (0..bars).map(height).fold(0.0_f64, f64::max);
        let names: Vec<(&str, usize)> = (self.layers.iter().zip(0..))
            .map(|((name, _), layer)| (name.as_str(), layer))
            .collect();
        let axes = Axes::new(self.size_px, (0.0, count as f64), (0.0, high), true);
        let mut svg = axes.open(&self.x_label, &self.y_label);
        svg += &legend(&names);
        let mut floor = vec![0.0; bars];
        for (k, layer) in layers.iter().enumerate() {
            let mut path = String::new();
            for (bar, value) in layer.iter().enumerate() {
                let (left, right) = (
                    axes.x((bar * group) as f64),
                    axes.x(((bar + 1) * group) as f64),
                );
                let (bottom, top) = (axes.y(floor[bar]), axes.y(floor[bar] + value));
                floor[bar] += value;
                // A hair of white between bars, unless they are too thin to spare it.
                let width = (right - left - if right - left > 4.0 { 0.6 } else { 0.0 }).max(0.3);
                write!(
                    path,
                    "M{left:.1} {bottom:.1}V{top:.1}h{width:.1}V{bottom:.1}z"
                )
                .expect(TEXT_EXPECT);
            }
            let color = COLORS[k % COLORS.len()];
            write!(svg, "<path d=\"{path}\" fill=\"{color}\"/>").expect(TEXT_EXPECT);
        }
        svg + "</svg>"
    }
}

/// Mean of the finite values, 0 if there are none.
fn mean(values: &[f64]) -> f64 {
    let finite: Vec<f64> = values
        .iter()
        .copied()
        .filter(|value| value.is_finite())
        .collect();
    finite.iter().sum::<f64>() / finite.len().max(1) as f64
}

/// The plot area and the scales of both axes.
struct Axes {
    size: (f64, f64),
    top: f64,
    right: f64,
    bottom: f64,
    x_range: (f64, f64),
    y_range: (f64, f64),
    x_step: f64,
    y_step: f64,
}

impl Axes {
    fn new(size: (f64, f64), x: (f64, f64), y: (f64, f64), with_legend: bool) -> Self {
        let top = TOP_PX + if with_legend { LEGEND_PX } else { 0.0 };
        let x_range = if x.1 > x.0 { x } else { (0.0, 1.0) };
        let y = if y.1 > y.0 { y } else { (y.0, y.0 + 1.0) };
        let x_step = tick_step(x_range.1 - x_range.0, 8.0);
        let y_step = tick_step(y.1 - y.0, (size.1 - top - BOTTOM_PX) / 34.0);
        Self {
            size,
            top,
            right: size.0 - RIGHT_PX,
            bottom: size.1 - BOTTOM_PX,
            x_range,
            y_range: (
                (y.0 / y_step).floor() * y_step,
                (y.1 / y_step).ceil() * y_step,
            ),
            x_step,
            y_step,
        }
    }

    fn x(&self, value: f64) -> f64 {
        let share = (value - self.x_range.0) / (self.x_range.1 - self.x_range.0);
        LEFT_PX + share * (self.right - LEFT_PX)
    }

    fn y(&self, value: f64) -> f64 {
        let share = (value - self.y_range.0) / (self.y_range.1 - self.y_range.0);
        self.bottom - share * (self.bottom - self.top)
    }

    /// The opening tag, the grid, both axes with their numbers and labels.
    fn open(&self, x_label: &str, y_label: &str) -> String {
        let (width, height) = self.size;
        let mut svg = format!(
            "<svg xmlns=\"http://www.w3.org/2000/svg\" viewBox=\"0 0 {width} {height}\" \
             width=\"{width}\" height=\"{height}\" role=\"img\" font-size=\"11\" fill=\"{TEXT_COLOR}\" \
             font-family=\"'Helvetica Neue', Arial, sans-serif\">"
        );
        for value in ticks(self.y_range, self.y_step) {
            let y = self.y(value);
            write!(
                svg,
                "<line x1=\"{LEFT_PX}\" x2=\"{:.1}\" y1=\"{y:.1}\" y2=\"{y:.1}\" stroke=\"{}\"/>\
                 <text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"end\">{}</text>",
                self.right,
                if value == 0.0 { AXIS_COLOR } else { GRID_COLOR },
                LEFT_PX - 6.0,
                y + 4.0,
                number(value)
            )
            .expect(TEXT_EXPECT);
        }
        for value in ticks(self.x_range, self.x_step) {
            let x = self.x(value);
            write!(
                svg,
                "<line x1=\"{x:.1}\" x2=\"{x:.1}\" y1=\"{:.1}\" y2=\"{:.1}\" stroke=\"{AXIS_COLOR}\"/>\
                 <text x=\"{x:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>",
                self.bottom,
                self.bottom + 4.0,
                self.bottom + 16.0,
                number(value)
            )
            .expect(TEXT_EXPECT);
        }
        let middle = (self.top + self.bottom) / 2.0;
        write!(
            svg,
            "<text x=\"{:.1}\" y=\"{:.1}\" text-anchor=\"middle\">{}</text>\
             <text transform=\"translate(12 {middle:.1}) rotate(-90)\" text-anchor=\"middle\">{}</text>",
            (LEFT_PX + self.right) / 2.0,
            self.size.1 - 5.0,
            escape(x_label),
            escape(y_label)
        )
        .expect(TEXT_EXPECT);
        svg
    }

    /// The path through `points`. Where there are more than pixels, each pixel column shows its
    /// smallest and largest value, so that no peak is lost.
    fn path(&self, points: &[(f64, f64)]) -> String {
        let columns = self.right - LEFT_PX;
        let per_column = (points.len() as f64 / columns / 2.0).ceil().max(1.0) as usize;
        let mut path = String::new();
        let mut pen_down = false;
        for group in points.chunks(per_column) {
            let mut shown: Vec<(f64, f64)> = group.to_vec();
            if per_column > 1 && group.iter().all(|(_, y)| y.is_finite()) {
                let order = |a: &&(f64, f64), b: &&(f64, f64)| a.1.total_cmp(&b.1);
                let ends = group.iter().min_by(order).into_iter();
                shown = ends.chain(group.iter().max_by(order)).copied().collect();
                shown.sort_by(|a, b| a.0.total_cmp(&b.0));
            }
            for (x, y) in shown {
                if !y.is_finite() {
                    pen_down = false;
                    continue;
                }
                let y = y.min(self.y_range.1);
                let command = if pen_down { 'L' } else { 'M' };
                write!(path, "{command}{:.1} {:.1}", self.x(x), self.y(y)).expect(TEXT_EXPECT);
                pen_down = true;
            }
        }
        path
    }
}

/// Names of the series in a row above the plot, each behind a patch of its colour.
fn legend(names: &[(&str, usize)]) -> String {
    let mut svg = String::new();
    let mut x = LEFT_PX;
    for (name, look) in names {
        write!(
            svg,
            "<rect x=\"{x:.1}\" y=\"5\" width=\"10\" height=\"10\" rx=\"2\" fill=\"{}\"/>\
             <text x=\"{:.1}\" y=\"14\">{}</text>",
            COLORS[look % COLORS.len()],
            x + 14.0,
            escape(name)
        )
        .expect(TEXT_EXPECT);
        // Without font metrics: letters of 11 px are near 6.4 px wide.
        x += 34.0 + 6.4 * name.chars().count() as f64;
    }
    svg
}

/// 1, 2 or 5 times a power of ten, so that `range` holds about `count` steps.
fn tick_step(range: f64, count: f64) -> f64 {
    let rough = range / count.max(1.0);
    let power = 10.0_f64.powf(rough.log10().floor());
    let factor = [1.0, 2.0, 5.0]
        .into_iter()
        .find(|f| f * power >= rough * 0.999);
    factor.unwrap_or(10.0) * power
}

/// The multiples of `step` in `range`.
fn ticks((low, high): (f64, f64), step: f64) -> impl Iterator<Item = f64> {
    let first = (low / step - 1e-6).ceil() as i64;
    let last = (high / step + 1e-6).floor() as i64;
    // Ranges come from data and may be absurd; a hundred ticks are none.
    (first..=last.min(first.saturating_add(100))).map(move |k| k as f64 * step)
}

/// A number to three digits, with the zeros at its end: columns of them line up.
pub fn three_digits(value: f64) -> String {
    let magnitude = value.abs().log10().floor();
    if !(-2.0..2.0).contains(&magnitude) {
        return number(value);
    }
    let decimals = (2.0 - magnitude) as usize;
    format!("{value:.decimals$}").replace('-', "−")
}

/// A number in as few characters as tell it: three digits, powers of ten for the far ends.
pub fn number(value: f64) -> String {
    if value == 0.0 {
        return "0".to_owned();
    }
    if !value.is_finite() {
        return "not finite".to_owned();
    }
    let magnitude = value.abs().log10().floor() as i32;
    if (-3..5).contains(&magnitude) {
        let decimals = (2 - magnitude).max(0) as usize;
        let text = format!("{value:.decimals$}");
        if !text.contains('.') {
            return text.replace('-', "−");
        }
        let text = text.trim_end_matches('0').trim_end_matches('.');
        return text.replace('-', "−");
    }
    let text = format!("{value:.2e}");
    let (digits, exponent) = text.split_once('e').expect("an exponent was asked for");
    let digits = if digits.contains('.') {
        digits.trim_end_matches('0').trim_end_matches('.')
    } else {
        digits
    };
    let exponent: String = exponent
        .chars()
        .map(|c| match c {
            '-' => '⁻',
            digit => ['⁰', '¹', '²', '³', '⁴', '⁵', '⁶', '⁷', '⁸', '⁹']
                [digit.to_digit(10).expect("exponents are digits") as usize],
        })
        .collect();
    format!("{}·10{exponent}", digits.replace('-', "−"))
}

/// `text` with what HTML and SVG give a meaning to replaced.
pub fn escape(text: &str) -> String {
    let mut escaped = String::with_capacity(text.len());
    for letter in text.chars() {
        match letter {
            '&' => escaped += "&amp;",
            '<' => escaped += "&lt;",
            '>' => escaped += "&gt;",
            '"' => escaped += "&quot;",
            other => escaped.push(other),
        }
    }
    escaped
}

#[cfg(test)]
mod tests {
    use super::*;

    fn chart(values: &[f64], ceiling: Option<f64>) -> String {
        let points = values.iter().enumerate().map(|(k, &y)| (k as f64, y));
        LineChart {
            size_px: (400.0, 200.0),
            x_label: "frame".to_owned(),
            y_label: "ms".to_owned(),
            series: vec![Series {
                label: "wall".to_owned(),
                look: 0,
                points: points.collect(),
            }],
            levels: Vec::new(),
            ceiling,
        }
        .svg()
    }

    #[test]
    fn numbers_are_short_and_keep_three_digits() {
        let cases = [
            (0.0, "0"),
            (12.0, "12"),
            (0.05, "0.05"),
            (-0.25, "−0.25"),
            (1234.0, "1234"),
            (16.6667, "16.7"),
            (2e-6, "2·10⁻⁶"),
            (1.5e7, "1.5·10⁷"),
            (f64::NAN, "not finite"),
        ];
        for (value, text) in cases {
            assert_eq!(number(value), text);
        }
    }

    #[test]
    fn numbers_in_columns_keep_their_zeros() {
        let texts = [20.0, 4.1, 0.7, 0.05, 159.0, -1.5].map(three_digits);
        assert_eq!(texts, ["20.0", "4.10", "0.700", "0.0500", "159", "−1.50"]);
        assert_eq!([0.0, 2e-6].map(three_digits), ["0", "2·10⁻⁶"]);
    }

    #[test]
    fn line_breaks_where_a_value_is_missing() {
        let svg = chart(&[1.0, f64::NAN, 2.0, 3.0], None);
        let path = svg.split("<path d=\"").nth(1).unwrap();
        let path = &path[..path.find('"').unwrap()];
        assert_eq!(path.matches('M').count(), 2, "{path}");
        assert!(!svg.contains("NaN") && !svg.contains("inf"));
    }

    #[test]
    fn peak_among_many_points_is_drawn() {
        let mut values = vec![1.0; 100_000];
        values[31_415] = 10.0;
        let svg = chart(&values, None);
        // The axis ends at the peak, at the top edge of the plot.
        assert!(svg.contains(&format!(" {TOP_PX:.1}L")), "the peak is gone");
        assert!(svg.len() < 60_000, "{} bytes", svg.len());
    }

    #[test]
    fn value_above_the_ceiling_is_marked_and_written() {
        let svg = chart(&[10.0, 11.0, 500.0], Some(20.0));
        assert!(svg.contains(">500</text>"));
        assert!(!chart(&[10.0, 11.0, 12.0], Some(20.0)).contains("l3.5 6h-7z"));
    }

    #[test]
    fn charts_of_nothing_and_of_one_value_hold_no_bad_number() {
        for values in [&[][..], &[3.0], &[0.0, 0.0], &[f64::INFINITY]] {
            let svg = chart(values, None);
            assert!(!svg.contains("NaN") && !svg.contains("inf"), "{svg}");
        }
        let empty = StackedChart {
            size_px: (400.0, 200.0),
            x_label: String::new(),
            y_label: String::new(),
            layers: Vec::new(),
        };
        assert!(!empty.svg().contains("NaN"));
    }

    #[test]
    fn names_cannot_break_out_of_the_picture() {
        assert_eq!(escape("a<b> & \"c\""), "a&lt;b&gt; &amp; &quot;c&quot;");
    }
}
