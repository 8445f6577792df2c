//! One chart laid flat: a start without folds, then as rigid as possible, then checked.
//!
//! Sources: Liu, Zhang, Xu, Gotsman, Gortler, "A Local/Global Approach to Mesh Parameterization",
//! SGP 2008 (ARAP); Tutte, "How to Draw a Graph", 1963 (the start for charts that bend too far to
//! be projected).

use super::charts::Faces;
use glam::{DVec2, DVec3};

/// Rounds of fitting rotations and solving for places. 12 leave 1 % of the stretch that 60 do on
/// organs.
const ROUNDS: usize = 12;
/// After so many rounds, a chart stretched so much more than allowed is given up.
const EARLY_ROUNDS: usize = 3;
const EARLY_FACTOR: f64 = 1.4;
/// Steps of conjugate gradients in a round; each starts from the round before.
const SOLVER_STEPS: usize = 30;
/// Texels along the longer side of a chart when it is searched for overlap.
const CHECK_TEXELS: f64 = 384.0;
/// The mean normal of a chart shrinks as it bends: below this share of full length it goes round
/// too far to lie flat, and is not tried.
const BENT_SHARE_MIN: f64 = 0.45;
/// A projected start is used where no triangle turns farther than this cosine from the plane.
const PROJECT_COSINE: f64 = 0.15;

/// A chart in the plane.
#[derive(Clone, Debug)]
pub struct Flat {
    /// Its triangles, ascending.
    pub triangles: Vec<u32>,
    /// Its points, ascending.
    pub points: Vec<u32>,
    /// Place of each of these points; metres before packing, shares of the square after. Seen
    /// from outside triangles are counter-clockwise with y upwards.
    pub places: Vec<DVec2>,
    /// Corners of each triangle as positions in `points`.
    pub corners: Vec<[u32; 3]>,
    /// Area on the surface [m²].
    pub area: f64,
    /// Stretch below which 98 % of the area lies; 1 is none.
    pub stretch_p98: f64,
}

impl Flat {
    /// Position of `point` in the chart's list.
    pub fn local(&self, point: u32) -> usize {
        self.points
            .binary_search(&point)
            .expect("a chart holds the points of its triangles")
    }
}

/// Lays a chart flat at its true area. `None` if it would overlap itself, or stretch more than
/// `stretch_max` (98th percentile).
pub fn flatten(
    positions: &[DVec3],
    triangles: &[[u32; 3]],
    faces: &Faces,
    chart: &[u32],
    stretch_max: f64,
) -> Option<Flat> {
    let whole: f64 = chart.iter().map(|&t| faces.areas[t as usize]).sum();
    let single = chart.len() == 1;
    if !single && faces.normal_sum(chart).length() < BENT_SHARE_MIN * whole {
        return None;
    }
    let mut points: Vec<u32> = chart.iter().flat_map(|&t| triangles[t as usize]).collect();
    points.sort_unstable();
    points.dedup();
    let mut sorted = chart.to_vec();
    sorted.sort_unstable();
    let mut flat = Flat {
        triangles: sorted,
        places: Vec::new(),
        corners: Vec::new(),
        area: whole,
        stretch_p98: 1.0,
        points,
    };
    flat.corners = flat
        .triangles
        .iter()
        .map(|&t| triangles[t as usize].map(|p| flat.local(p) as u32))
        .collect();
    let rest: Vec<DVec3> = flat.points.iter().map(|&p| positions[p as usize]).collect();

    let mean = faces.mean_normal(chart);
    let least = chart
        .iter()
        .map(|&t| faces.normals[t as usize].dot(mean))
        .fold(1.0, f64::min);
    flat.places = project(&rest, mean);
    if !single {
        if least < PROJECT_COSINE
            && let Some(start) = tutte(&flat.corners, &rest, flat.area)
        {
            flat.places = start;
        }
        let corners = flat.corners.clone();
        let shapes = Shapes::new(&corners, &rest);
        shapes.relax(&mut flat.places, EARLY_ROUNDS);
        flat.rescale();
        if flat.stretch(&rest) > EARLY_FACTOR * stretch_max {
            return None;
        }
        shapes.relax(&mut flat.places, ROUNDS - EARLY_ROUNDS);
        if !flat.settle(&rest, stretch_max) {
            // A chart that turns little has a projection without folds, if a more stretched one.
            flat.places = project(&rest, mean);
            if !flat.settle(&rest, stretch_max) {
                return None;
            }
        }
    }
    Some(flat)
}

impl Flat {
    /// Scales to true area, measures, and says whether the chart can stay as it lies.
    fn settle(&mut self, rest: &[DVec3], stretch_max: f64) -> bool {
        self.rescale();
        self.stretch_p98 = self.stretch(rest);
        self.stretch_p98 <= stretch_max && self.is_sound()
    }

    /// Stretch below which 98 % of the area lies.
    fn stretch(&self, rest: &[DVec3]) -> f64 {
        let mut stretches: Vec<(f64, f64)> = self
            .corners
            .iter()
            .filter_map(|c| {
                stretch(
                    c.map(|p| rest[p as usize]),
                    c.map(|p| self.places[p as usize]),
                )
                .map(|(area, stretch)| (stretch, area))
            })
            .collect();
        weighted_percentile(&mut stretches, 0.98)
    }

    /// Whether nothing is folded over and no texel is covered twice.
    fn is_sound(&self) -> bool {
        let (mut front, mut back) = (0.0, 0.0);
        for c in &self.corners {
            let doubled = doubled_area(c.map(|p| self.places[p as usize]));
            if doubled > 0.0 {
                front += doubled;
            } else {
                back -= doubled;
            }
        }
        // Folds of rounding size in triangles without area are none.
        if !(front + back).is_finite() || back > 1e-9 * front {
            return false;
        }
        let (low, high) = self.bounds();
        let extent = (high - low).max_element();
        if extent <= 0.0 {
            return true;
        }
        let scale = CHECK_TEXELS / extent;
        let places: Vec<DVec2> = self.places.iter().map(|p| (*p - low) * scale).collect();
        coverage(&places, &self.corners, 1.0).1 == 0
    }

    /// Smallest and largest corner of the box around the chart.
    pub fn bounds(&self) -> (DVec2, DVec2) {
        let first = self.places[0];
        self.places
            .iter()
            .fold((first, first), |(low, high), &p| (low.min(p), high.max(p)))
    }

    /// Scales the chart to its area on the surface.
    fn rescale(&mut self) {
        let area: f64 = self
            .corners
            .iter()
            .map(|c| 0.5 * doubled_area(c.map(|p| self.places[p as usize])))
            .sum();
        if area > 0.0 {
            let factor = (self.area / area).sqrt();
            for place in &mut self.places {
                *place *= factor;
            }
        }
    }
}

/// Twice the signed area, positive if counter-clockwise with y upwards.
fn doubled_area([a, b, c]: [DVec2; 3]) -> f64 {
    (b - a).perp_dot(c - a)
}

/// The chart seen along its mean normal.
fn project(rest: &[DVec3], mean: DVec3) -> Vec<DVec2> {
    let normal = if mean == DVec3::ZERO { DVec3::Z } else { mean };
    let across = if normal.x.abs() < 0.6 {
        DVec3::X
    } else {
        DVec3::Y
    };
    let x = (across - normal * normal.dot(across)).normalize();
    let y = normal.cross(x);
    rest.iter()
        .map(|p| DVec2::new(p.dot(x), p.dot(y)))
        .collect()
}

/// A start without folds: the longest border on a circle, the rest in the mean of its neighbours.
/// `None` if the chart has no border.
fn tutte(corners: &[[u32; 3]], rest: &[DVec3], area: f64) -> Option<Vec<DVec2>> {
    let border = longest_border(corners, rest)?;
    let length: f64 = (0..border.len()).map(|k| step(rest, &border, k)).sum();
    let radius = (area / std::f64::consts::PI).sqrt();
    let mut places = vec![DVec2::ZERO; rest.len()];
    let mut fixed = vec![false; rest.len()];
    let mut walked = 0.0;
    for k in 0..border.len() {
        // A quarter of the circle at a time, by its rational form, since sine and cosine need not
        // have the same bits everywhere.
        let turn = (4.0 * walked / length).clamp(0.0, 4.0 - 1e-12);
        let t = turn.fract();
        let quarter = DVec2::new(1.0 - t * t, 2.0 * t) / (1.0 + t * t);
        places[border[k] as usize] = radius
            * match turn as u32 {
                0 => quarter,
                1 => DVec2::new(-quarter.y, quarter.x),
                2 => -quarter,
                _ => DVec2::new(quarter.y, -quarter.x),
            };
        fixed[border[k] as usize] = true;
        walked += step(rest, &border, k);
    }
    let edges: Vec<(u32, u32, f64)> = corners
        .iter()
        .flat_map(|c| [(c[0], c[1], 1.0), (c[1], c[2], 1.0), (c[2], c[0], 1.0)])
        .collect();
    let system = System::new(&edges, rest.len(), &fixed);
    // From nothing to a harmonic map takes as many steps as the chart is triangles wide, and more.
    let steps = 2 * (corners.len() as f64).sqrt() as usize + 50;
    system.solve(&vec![DVec2::ZERO; rest.len()], &mut places, steps);
    Some(places)
}

/// Length of the border's edge that starts at its `k`-th point.
fn step(rest: &[DVec3], border: &[u32], k: usize) -> f64 {
    let next = border[(k + 1) % border.len()];
    rest[border[k] as usize].distance(rest[next as usize])
}

/// The longest loop of edges that only one triangle uses, in the direction of that triangle.
fn longest_border(corners: &[[u32; 3]], rest: &[DVec3]) -> Option<Vec<u32>> {
    let mut sides: Vec<(u32, u32)> = corners
        .iter()
        .flat_map(|c| [(c[0], c[1]), (c[1], c[2]), (c[2], c[0])])
        .collect();
    sides.sort_unstable();
    let mut open: Vec<(u32, u32)> = sides
        .iter()
        .copied()
        .filter(|&(a, b)| a != b && sides.binary_search(&(b, a)).is_err())
        .collect();
    let mut best: Option<(f64, Vec<u32>)> = None;
    while let Some(&(first, _)) = open.first() {
        let mut at = first;
        let mut border = Vec::new();
        loop {
            let k = open.partition_point(|side| side.0 < at);
            if k >= open.len() || open[k].0 != at {
                break;
            }
            border.push(at);
            at = open.remove(k).1;
        }
        let length: f64 = (0..border.len()).map(|k| step(rest, &border, k)).sum();
        let closed = at == first && border.len() >= 3;
        if closed && best.as_ref().is_none_or(|(longest, _)| length > *longest) {
            best = Some((length, border));
        }
    }
    best.filter(|(length, _)| *length > 0.0)
        .map(|(_, border)| border)
}

/// Rest shapes of a chart's triangles, and the weights with which they pull.
struct Shapes<'a> {
    corners: &'a [[u32; 3]],
    /// Each triangle in its own plane.
    flat: Vec<[DVec2; 3]>,
    /// Weight of the edge opposite to each corner.
    weights: Vec<[f64; 3]>,
    points: usize,
}

impl<'a> Shapes<'a> {
    fn new(corners: &'a [[u32; 3]], rest: &[DVec3]) -> Self {
        let flat: Vec<[DVec2; 3]> = corners
            .iter()
            .map(|c| in_plane(c.map(|p| rest[p as usize])))
            .collect();
        let weights = flat
            .iter()
            .map(|shape| {
                std::array::from_fn(|k| {
                    let (u, v) = (shape[(k + 1) % 3] - shape[k], shape[(k + 2) % 3] - shape[k]);
                    let area = u.perp_dot(v).abs().max(1e-9 * u.length() * v.length());
                    // Half the cotangent. Obtuse corners would pull backwards and triangles
                    // without area without bound, so both are cut.
                    if area > 0.0 {
                        (0.5 * u.dot(v) / area).clamp(0.02, 10.0)
                    } else {
                        0.02
                    }
                })
            })
            .collect();
        Self {
            corners,
            flat,
            weights,
            points: rest.len(),
        }
    }

    /// Moves the places so that each triangle is as near to its rest shape as the others allow.
    fn relax(&self, places: &mut [DVec2], rounds: usize) {
        let mut edges = Vec::with_capacity(3 * self.corners.len());
        for (c, w) in self.corners.iter().zip(&self.weights) {
            for k in 0..3 {
                edges.push((c[(k + 1) % 3], c[(k + 2) % 3], w[k]));
            }
        }
        let mut fixed = vec![false; self.points];
        fixed[0] = true;
        let system = System::new(&edges, self.points, &fixed);
        let mut pull = vec![DVec2::ZERO; self.points];
        for _ in 0..rounds {
            pull.fill(DVec2::ZERO);
            for ((c, shape), w) in self.corners.iter().zip(&self.flat).zip(&self.weights) {
                let (cosine, sine) = rotation(c.map(|p| places[p as usize]), shape, w);
                for (k, &weight) in w.iter().enumerate() {
                    let (i, j) = ((k + 1) % 3, (k + 2) % 3);
                    let edge = shape[i] - shape[j];
                    let turned = weight
                        * DVec2::new(
                            cosine * edge.x - sine * edge.y,
                            sine * edge.x + cosine * edge.y,
                        );
                    pull[c[i] as usize] += turned;
                    pull[c[j] as usize] -= turned;
                }
            }
            system.solve(&pull, places, SOLVER_STEPS);
        }
    }
}

/// Cosine and sine of the rotation that carries a rest shape best to its places.
fn rotation(places: [DVec2; 3], shape: &[DVec2; 3], weights: &[f64; 3]) -> (f64, f64) {
    let (mut along, mut across) = (0.0, 0.0);
    for (k, &weight) in weights.iter().enumerate() {
        let (i, j) = ((k + 1) % 3, (k + 2) % 3);
        let (from, to) = (shape[i] - shape[j], places[i] - places[j]);
        along += weight * from.dot(to);
        across += weight * from.perp_dot(to);
    }
    let length = (along * along + across * across).sqrt();
    if length > 0.0 {
        (along / length, across / length)
    } else {
        (1.0, 0.0)
    }
}

/// A triangle in its own plane, counter-clockwise.
fn in_plane([a, b, c]: [DVec3; 3]) -> [DVec2; 3] {
    let x = (b - a).normalize_or_zero();
    let along = (c - a).dot(x);
    let height = ((c - a) - x * along).length();
    [
        DVec2::ZERO,
        DVec2::new(a.distance(b), 0.0),
        DVec2::new(along, height),
    ]
}

/// The weighted graph Laplacian of a chart; some points are held.
struct System {
    start: Vec<u32>,
    entries: Vec<(u32, f64)>,
    diagonal: Vec<f64>,
    held: Vec<bool>,
}

impl System {
    fn new(edges: &[(u32, u32, f64)], points: usize, held: &[bool]) -> Self {
        let mut start = vec![0_u32; points + 1];
        for &(a, b, _) in edges {
            start[a as usize + 1] += 1;
            start[b as usize + 1] += 1;
        }
        for p in 0..points {
            start[p + 1] += start[p];
        }
        let mut next = start.clone();
        let mut doubled = vec![(0, 0.0); 2 * edges.len()];
        let mut diagonal = vec![0.0; points];
        for &(a, b, weight) in edges {
            for (from, to) in [(a, b), (b, a)] {
                doubled[next[from as usize] as usize] = (to, weight);
                next[from as usize] += 1;
                diagonal[from as usize] += weight;
            }
        }
        // The two triangles of an edge name it twice: one entry is enough.
        let mut entries: Vec<(u32, f64)> = Vec::with_capacity(edges.len() + points);
        let mut merged = vec![0_u32; points + 1];
        for p in 0..points {
            let row = &mut doubled[start[p] as usize..start[p + 1] as usize];
            row.sort_by_key(|entry| entry.0);
            for same in row.chunk_by(|x, y| x.0 == y.0) {
                entries.push((same[0].0, same.iter().map(|entry| entry.1).sum()));
            }
            merged[p + 1] = entries.len() as u32;
        }
        Self {
            start: merged,
            entries,
            diagonal,
            held: held.to_vec(),
        }
    }

    /// `L x` at the free points, 0 at the held ones.
    fn apply(&self, x: &[DVec2], out: &mut [DVec2]) {
        for p in 0..x.len() {
            out[p] = if self.held[p] {
                DVec2::ZERO
            } else {
                let range = self.start[p] as usize..self.start[p + 1] as usize;
                self.entries[range]
                    .iter()
                    .fold(x[p] * self.diagonal[p], |sum, &(q, weight)| {
                        sum - weight * x[q as usize]
                    })
            };
        }
    }

    /// Steps of conjugate gradients, preconditioned by the diagonal, towards `L x = b` from the
    /// `x` given; held points stay.
    fn solve(&self, b: &[DVec2], x: &mut [DVec2], steps: usize) {
        let n = x.len();
        let mut image = vec![DVec2::ZERO; n];
        self.apply(x, &mut image);
        let mut residual: Vec<DVec2> = (0..n)
            .map(|p| {
                if self.held[p] {
                    DVec2::ZERO
                } else {
                    b[p] - image[p]
                }
            })
            .collect();
        let scaled = |residual: &[DVec2]| -> Vec<DVec2> {
            (0..n)
                .map(|p| residual[p] / self.diagonal[p].max(f64::MIN_POSITIVE))
                .collect()
        };
        let dot = |a: &[DVec2], b: &[DVec2]| a.iter().zip(b).map(|(a, b)| a.dot(*b)).sum::<f64>();
        let mut z = scaled(&residual);
        let mut direction = z.clone();
        let mut rho = dot(&residual, &z);
        let goal = 1e-12 * rho;
        for _ in 0..steps {
            if rho <= goal || rho <= f64::MIN_POSITIVE {
                return;
            }
            self.apply(&direction, &mut image);
            let curvature = dot(&direction, &image);
            if curvature <= 0.0 {
                return;
            }
            let length = rho / curvature;
            for p in 0..n {
                x[p] += length * direction[p];
                residual[p] -= length * image[p];
            }
            z = scaled(&residual);
            let before = rho;
            rho = dot(&residual, &z);
            let keep = rho / before;
            for p in 0..n {
                direction[p] = z[p] + keep * direction[p];
            }
        }
    }
}

/// Texel centres that at least one triangle covers, and those that more than one does, at
/// `scale` texels a unit. Triangles that share an edge never both cover a centre on it. Texels
/// more than 8192 from the origin are not looked at.
pub fn coverage(places: &[DVec2], corners: &[[u32; 3]], scale: f64) -> (u64, u64) {
    /// Places are rounded to this share of a texel, so that all that follows is exact.
    const STEPS: f64 = 4096.0;
    const STEP: i64 = STEPS as i64;
    const FARTHEST: f64 = 8192.0;
    let snapped: Vec<[i64; 2]> = places
        .iter()
        .map(|p| *p * scale)
        .map(|p| p.clamp(DVec2::splat(-FARTHEST), DVec2::splat(FARTHEST)) * STEPS)
        .map(|p| [p.x.round() as i64, p.y.round() as i64])
        .collect();
    let used = || corners.iter().flatten().map(|&p| snapped[p as usize]);
    let low: [i64; 2] = std::array::from_fn(|d| used().map(|p| p[d]).min().unwrap_or(0));
    let high: [i64; 2] = std::array::from_fn(|d| used().map(|p| p[d]).max().unwrap_or(0));
    let first = low.map(|x| x.div_euclid(STEP));
    let width = (high[0].div_euclid(STEP) - first[0] + 1).max(1);
    let height = (high[1].div_euclid(STEP) - first[1] + 1).max(1);
    let mut count = vec![0_u8; (width * height) as usize];
    for c in corners {
        let mut p = c.map(|p| snapped[p as usize]);
        let edge = |a: [i64; 2], b: [i64; 2], q: [i64; 2]| {
            (b[0] - a[0]) * (q[1] - a[1]) - (b[1] - a[1]) * (q[0] - a[0])
        };
        let doubled = edge(p[0], p[1], p[2]);
        if doubled == 0 {
            continue;
        }
        if doubled < 0 {
            p.swap(1, 2);
        }
        // A centre on an edge belongs to the triangle on one fixed side of it.
        let owns = |a: [i64; 2], b: [i64; 2]| b[1] > a[1] || (b[1] == a[1] && b[0] < a[0]);
        let own: [bool; 3] = std::array::from_fn(|k| owns(p[k], p[(k + 1) % 3]));
        let right: [i64; 3] = std::array::from_fn(|k| (p[k][1] - p[(k + 1) % 3][1]) * STEP);
        let centre = |texel: i64| texel * STEP + STEP / 2;
        let range = |d: usize| {
            let least = p.iter().map(|p| p[d]).min().expect("three corners");
            let most = p.iter().map(|p| p[d]).max().expect("three corners");
            (least - STEP / 2).div_euclid(STEP)..=most.div_euclid(STEP)
        };
        let (columns, rows) = (range(0), range(1));
        for y in rows {
            let row = (y - first[1]) * width - first[0];
            let start = [centre(*columns.start()), centre(y)];
            // A centre on an edge, where the value is 0, is inside for one of the two triangles.
            let mut values: [i64; 3] =
                std::array::from_fn(|k| edge(p[k], p[(k + 1) % 3], start) - i64::from(!own[k]));
            for x in columns.clone() {
                if values.iter().all(|&value| value >= 0) {
                    let texel = &mut count[(row + x) as usize];
                    *texel = texel.saturating_add(1);
                }
                for (value, right) in values.iter_mut().zip(right) {
                    *value += right;
                }
            }
        }
    }
    let covered = count.iter().filter(|&&n| n > 0).count() as u64;
    let twice = count.iter().filter(|&&n| n > 1).count() as u64;
    (covered, twice)
}

/// Area [m²] of a triangle and the larger of σ₁ and 1/σ₂ of its map to the plane; `None` where
/// it has no area.
pub fn stretch(corners: [DVec3; 3], uvs: [DVec2; 3]) -> Option<(f64, f64)> {
    let [_, b, c] = in_plane(corners);
    let doubled = b.x * c.y;
    if doubled <= 1e-12 * b.length() * c.length() {
        return None;
    }
    let (u, v) = (uvs[1] - uvs[0], uvs[2] - uvs[0]);
    let along_x = u / b.x;
    let along_y = (v - along_x * c.x) / c.y;
    let (e, f, g) = (
        along_x.length_squared(),
        along_x.dot(along_y),
        along_y.length_squared(),
    );
    let middle = 0.5 * (e + g);
    let spread = (0.25 * (e - g) * (e - g) + f * f).sqrt();
    let largest = (middle + spread).sqrt();
    let smallest = (middle - spread).max(0.0).sqrt();
    Some((0.5 * doubled, largest.max(1.0 / smallest.max(1e-9))))
}

/// The value below which `share` of the weight lies; `values` are (value, weight). 1 if empty.
pub fn weighted_percentile(values: &mut [(f64, f64)], share: f64) -> f64 {
    values.sort_by(|a, b| a.0.total_cmp(&b.0));
    let total: f64 = values.iter().map(|v| v.1).sum();
    let mut sum = 0.0;
    for &(value, weight) in values.iter() {
        sum += weight;
        if sum >= share * total {
            return value;
        }
    }
    1.0
}
