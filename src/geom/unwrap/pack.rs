//! Charts put side by side in the unit square, all at one scale, with empty gutters between.
//!
//! Charts fall one by one, tall ones first, each where it comes to rest lowest over the horizon of
//! those before it.
//!
//! Source: Lévy, Petitjean, Ray, Maillot, "Least Squares Conformal Maps for Automatic Texture
//! Atlas Generation", SIGGRAPH 2002, section 4.3 (packing by horizons).

use super::GUTTER_SHARE;
use super::flatten::Flat;
use glam::DVec2;

/// Columns of the horizon. One column is a quarter of the gutter, so rounding outlines outwards
/// to columns costs little.
const COLUMNS: usize = 512;
/// Quarters of this many directions are tried for the smallest box around a chart.
const DIRECTIONS: usize = 16;
/// Up to so many charts are tried in diagonal positions too; more fill the gaps anyway.
const FEW_CHARTS: usize = 24;
/// Halvings of the range of scales: the scale is found to 1/1000.
const HALVINGS: usize = 10;

/// A chart's outline in one orientation: lowest and highest y in every column, at scale 1.
struct Turned {
    /// Cosine and sine of the rotation.
    axis: DVec2,
    low: DVec2,
    high: DVec2,
}

/// Where a chart goes: rotate by `axis`, scale, then shift.
#[derive(Clone, Copy)]
struct Placed {
    axis: DVec2,
    shift: DVec2,
}

/// Moves all charts into the unit square at the largest common scale that this method finds.
pub fn pack(flats: &mut [Flat]) {
    let area: f64 = flats.iter().map(|flat| flat.area).sum();
    if flats.is_empty() {
        return;
    }
    let turned: Vec<Vec<Turned>> = flats
        .iter()
        .map(|flat| orientations(flat, flats.len() <= FEW_CHARTS))
        .collect();
    let borders: Vec<Vec<[u32; 2]>> = flats.iter().map(border).collect();
    let longest = turned
        .iter()
        .flatten()
        .map(|t| (t.high - t.low).max_element())
        .fold(0.0, f64::max);
    if longest <= 0.0 {
        // Nothing has an extent: every chart is one spot.
        for flat in flats {
            flat.places.fill(DVec2::splat(0.5));
        }
        return;
    }
    let mut order: Vec<usize> = (0..flats.len()).collect();
    order.sort_by(|&a, &b| {
        let height = |i: usize| (turned[i][0].high - turned[i][0].low).y;
        height(b).total_cmp(&height(a)).then(a.cmp(&b))
    });
    // A scale at which the charts would fill the square without any gap is surely too large.
    let mut too_large = 1.0 / area.sqrt().max(longest * 0.5);
    let mut fits = 0.0;
    let mut best = None;
    let mut scale = 0.75 * too_large;
    for _ in 0..HALVINGS {
        match try_scale(flats, &borders, &turned, &order, scale) {
            Some(placed) => {
                fits = scale;
                best = Some((scale, placed));
            }
            None => too_large = scale,
        }
        scale = 0.5 * (fits + too_large);
    }
    // Thousands of charts can leave no room for gutters at any of these scales: shrink on.
    while best.is_none() {
        scale *= 0.5;
        best = if scale * longest < 1e-6 {
            Some((
                0.0,
                vec![
                    Placed {
                        axis: DVec2::X,
                        shift: DVec2::splat(0.5)
                    };
                    flats.len()
                ],
            ))
        } else {
            try_scale(flats, &borders, &turned, &order, scale).map(|placed| (scale, placed))
        };
    }
    let (scale, placed) = best.expect("the loop above ends with a result");
    for (flat, placed) in flats.iter_mut().zip(placed) {
        for place in &mut flat.places {
            *place = rotate(*place, placed.axis) * scale + placed.shift;
        }
    }
}

/// Edges of a chart that only one of its triangles has; all edges of a chart of few triangles,
/// since one without area may have no such edge.
fn border(flat: &Flat) -> Vec<[u32; 2]> {
    let mut edges: Vec<[u32; 2]> = flat
        .corners
        .iter()
        .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
        .map(|[a, b]| [a.min(b), a.max(b)])
        .collect();
    edges.sort_unstable();
    edges
        .chunk_by(|x, y| x == y)
        .filter(|same| same.len() == 1 || flat.corners.len() <= 8)
        .map(|same| same[0])
        .collect()
}

fn rotate(p: DVec2, axis: DVec2) -> DVec2 {
    DVec2::new(axis.x * p.x - axis.y * p.y, axis.y * p.x + axis.x * p.y)
}

/// The four upright positions of the smallest box around a chart, and the four diagonal ones if
/// wanted, those that stand first.
fn orientations(flat: &Flat, diagonal: bool) -> Vec<Turned> {
    let at = |axis: DVec2| {
        let first = rotate(flat.places[0], axis);
        let (low, high) = flat
            .places
            .iter()
            .map(|&p| rotate(p, axis))
            .fold((first, first), |(low, high), p| (low.min(p), high.max(p)));
        Turned { axis, low, high }
    };
    let mut best: Option<(f64, Turned)> = None;
    for k in 0..DIRECTIONS {
        let t = k as f64 / DIRECTIONS as f64;
        let candidate = at(DVec2::new(1.0 - t * t, 2.0 * t) / (1.0 + t * t));
        let size = candidate.high - candidate.low;
        let area = size.x * size.y;
        if best.as_ref().is_none_or(|(least, _)| area < *least) {
            best = Some((area, candidate));
        }
    }
    // Upright, lying, and both upside down.
    let mut axis = best.expect("at least one direction").1.axis;
    let mut all = Vec::new();
    for _ in 0..4 {
        all.push(at(axis));
        if diagonal {
            all.push(at(rotate(axis, DVec2::ONE / 2.0_f64.sqrt())));
        }
        axis = DVec2::new(-axis.y, axis.x);
    }
    let wide = |t: &Turned| (t.high - t.low).x > (t.high - t.low).y;
    all.sort_by_key(wide);
    all
}

/// Packs at one scale; `None` if the pile grows out of the square.
fn try_scale(
    flats: &[Flat],
    borders: &[Vec<[u32; 2]>],
    turned: &[Vec<Turned>],
    order: &[usize],
    scale: f64,
) -> Option<Vec<Placed>> {
    let column = 1.0 / COLUMNS as f64;
    let pad = 0.5 * GUTTER_SHARE;
    let mut horizon = vec![pad; COLUMNS];
    let mut placed = vec![
        Placed {
            axis: DVec2::X,
            shift: DVec2::ZERO
        };
        flats.len()
    ];
    for &chart in order {
        let mut best: Option<(f64, usize, usize, f64, Outline)> = None;
        for (which, turned) in turned[chart].iter().enumerate() {
            let outline = Outline::new(&flats[chart], &borders[chart], turned, scale);
            let width = outline.low.len();
            if width + 2 > COLUMNS {
                continue;
            }
            for x in (1..COLUMNS - width).step_by(2) {
                let under = &horizon[x..x + width];
                let rest = under
                    .iter()
                    .zip(&outline.low)
                    .fold(f64::MIN, |most, (h, low)| most.max(h - low));
                let top = rest + outline.top;
                if top > 1.0 - pad || best.as_ref().is_some_and(|b| top >= b.0 + 0.2) {
                    continue;
                }
                let waste: f64 = under
                    .iter()
                    .zip(&outline.low)
                    .map(|(h, low)| rest + low - h)
                    .sum::<f64>()
                    * column;
                let cost = top + waste / (width as f64 * column);
                if best.as_ref().is_none_or(|b| cost < b.0) {
                    best = Some((cost, which, x, rest, outline.clone()));
                }
            }
        }
        let (_, which, x, rest, outline) = best?;
        for (k, high) in outline.high.iter().enumerate() {
            horizon[x + k] = horizon[x + k].max(rest + high);
        }
        let turned = &turned[chart][which];
        placed[chart] = Placed {
            axis: turned.axis,
            shift: DVec2::new(
                x as f64 * column + pad - turned.low.x * scale,
                rest - turned.low.y * scale,
            ),
        };
    }
    Some(placed)
}

/// Lowest and highest y over each column, measured from the chart's own lowest point and widened
/// by half a gutter on all sides.
#[derive(Clone)]
struct Outline {
    low: Vec<f64>,
    high: Vec<f64>,
    top: f64,
}

impl Outline {
    fn new(flat: &Flat, border: &[[u32; 2]], turned: &Turned, scale: f64) -> Self {
        let pad = 0.5 * GUTTER_SHARE;
        let size = (turned.high - turned.low) * scale;
        let columns = COLUMNS as f64;
        let width = ((size.x + 2.0 * pad) * columns).ceil() as usize + 1;
        let mut low = vec![f64::MAX; width];
        let mut high = vec![f64::MIN; width];
        let place = |p: u32| (rotate(flat.places[p as usize], turned.axis) - turned.low) * scale;
        for edge in border {
            let [a, b] = edge.map(place);
            let (a, b) = if a.x <= b.x { (a, b) } else { (b, a) };
            // Shifted by `pad`, the chart begins half a gutter inside its first column.
            let first = (a.x * columns) as usize;
            let last = (((b.x + 2.0 * pad) * columns) as usize).min(width - 1);
            for column in first..=last {
                let edge = column as f64 / columns - pad;
                let (from, to) = (edge - pad, edge + 1.0 / columns + pad);
                let at = |x: f64| {
                    let t = if b.x > a.x {
                        (x - a.x) / (b.x - a.x)
                    } else {
                        0.0
                    };
                    a.y + (b.y - a.y) * t.clamp(0.0, 1.0)
                };
                let (y0, y1) = (at(from), at(to));
                let whole = b.x <= a.x;
                let least = if whole { a.y.min(b.y) } else { y0.min(y1) };
                let most = if whole { a.y.max(b.y) } else { y0.max(y1) };
                low[column] = low[column].min(least - pad);
                high[column] = high[column].max(most + pad);
            }
        }
        for column in 0..width {
            if low[column] > high[column] {
                // A rounding column at the end that nothing touches.
                low[column] = f64::MAX;
            }
        }
        while low.len() > 1 && low[low.len() - 1] == f64::MAX {
            low.pop();
            high.pop();
        }
        for column in 0..low.len() {
            if low[column] == f64::MAX {
                (low[column], high[column]) = (0.0, size.y);
            }
        }
        Self {
            low,
            high,
            top: size.y + pad,
        }
    }
}
