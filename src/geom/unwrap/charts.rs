//! Which triangle belongs to which chart: regions grown from seeds, cut, and joined.
//!
//! Sources: Cohen-Steiner, Alliez, Desbrun, "Variational Shape Approximation", SIGGRAPH 2004 (seeds
//! that move to the middle of their region); Julius, Kraevoy, Sheffer, "D-Charts", 2005 (compact,
//! nearly developable regions).

use super::flatten::Flat;
use glam::DVec3;
use std::cmp::Reverse;
use std::collections::BinaryHeap;

/// No neighbour across this edge.
const NONE: u32 = u32::MAX;

/// A chart is split while more than this share of its area turns away from its mean normal by more
/// than 68 degrees (cosine 0.375).
const TURNED_SHARE_MAX: f64 = 0.01;
const TURNED_COSINE: f64 = 0.375;

/// A pass adds one seed to every chart that needs it, so 24 passes are enough for 2^24 charts; a
/// surface that still is not smooth then is cut later, where it overlaps itself.
const PASSES_MAX: usize = 24;

/// How much farther a triangle seems that looks the other way, as a multiple of its distance.
const TURN_COST: f64 = 6.0;

/// Triangles as the charts see them.
pub struct Faces {
    pub centres: Vec<DVec3>,
    /// Unit normals, smoothed over the neighbours so that one crooked triangle starts no chart.
    pub normals: Vec<DVec3>,
    /// Areas [m²].
    pub areas: Vec<f64>,
    /// The triangle across each edge (corner k to corner k + 1), if there is exactly one.
    pub neighbours: Vec<[u32; 3]>,
    /// Lengths of these edges [m].
    pub edges: Vec<[f64; 3]>,
}

impl Faces {
    pub fn new(positions: &[DVec3], triangles: &[[u32; 3]]) -> Self {
        let corners = |t: &[u32; 3]| t.map(|p| positions[p as usize]);
        let neighbours = neighbours(triangles);
        let crosses: Vec<DVec3> = triangles
            .iter()
            .map(|t| {
                let [a, b, c] = corners(t);
                (b - a).cross(c - a)
            })
            .collect();
        let mut smooth = crosses.clone();
        for _ in 0..4 {
            let before = smooth.clone();
            for (t, across) in neighbours.iter().enumerate() {
                smooth[t] = across
                    .iter()
                    .filter(|&&n| n != NONE)
                    .fold(before[t], |sum, &n| sum + 0.5 * before[n as usize]);
            }
        }
        Self {
            centres: triangles
                .iter()
                .map(|t| corners(t).iter().sum::<DVec3>() / 3.0)
                .collect(),
            normals: smooth.iter().map(|n| n.normalize_or_zero()).collect(),
            areas: crosses.iter().map(|n| 0.5 * n.length()).collect(),
            neighbours,
            edges: triangles
                .iter()
                .map(|t| {
                    let [a, b, c] = corners(t);
                    [a.distance(b), b.distance(c), c.distance(a)]
                })
                .collect(),
        }
    }

    /// Area-weighted mean normal of some triangles, or zero if they cancel out.
    pub fn mean_normal(&self, chart: &[u32]) -> DVec3 {
        self.normal_sum(chart).normalize_or_zero()
    }

    /// Sum of the normals of some triangles, each as long as its area.
    pub fn normal_sum(&self, chart: &[u32]) -> DVec3 {
        chart
            .iter()
            .map(|&t| self.areas[t as usize] * self.normals[t as usize])
            .sum()
    }
}

/// The triangle across each edge; an edge with one, three or more triangles has none.
fn neighbours(triangles: &[[u32; 3]]) -> Vec<[u32; 3]> {
    let mut sides: Vec<(u32, u32, u32, u8)> = Vec::with_capacity(3 * triangles.len());
    for (t, corners) in triangles.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (corners[k], corners[(k + 1) % 3]);
            if a != b {
                sides.push((a.min(b), a.max(b), t as u32, k as u8));
            }
        }
    }
    sides.sort_unstable();
    let mut across = vec![[NONE; 3]; triangles.len()];
    for same in sides.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)) {
        if let [(_, _, t, i), (_, _, u, j)] = *same
            && t != u
        {
            across[t as usize][i as usize] = u;
            across[u as usize][j as usize] = t;
        }
    }
    across
}

/// Charts of the whole surface: connected, compact, and each turned one way.
pub fn grow(faces: &Faces) -> Vec<Vec<u32>> {
    let all: Vec<u32> = (0..faces.areas.len() as u32).collect();
    let mut regions = Regions::new(faces, &all);
    regions.seed_components(&all);
    for _ in 0..PASSES_MAX {
        regions.settle(3);
        if !regions.split_turned() {
            break;
        }
    }
    regions.settle(4);
    regions.charts()
}

/// Two or more smaller charts in place of one.
pub fn cut(faces: &Faces, chart: &[u32]) -> Vec<Vec<u32>> {
    let mut regions = Regions::new(faces, chart);
    // The two triangles farthest apart, nearly: from anywhere to the farthest, twice.
    let mut seed = chart[0];
    for _ in 0..2 {
        regions.seeds = vec![seed];
        regions.means = vec![DVec3::ZERO];
        regions.flood();
        seed = regions.farthest(chart);
    }
    regions.seeds.push(seed);
    regions.means.push(DVec3::ZERO);
    regions.settle(3);
    let mut parts = regions.charts();
    if parts.len() < 2 {
        // All its triangles lie on one spot: nothing to measure, so one half and the other.
        let half = chart.len() / 2;
        parts = vec![chart[..half].to_vec(), chart[half..].to_vec()];
    }
    parts
}

/// The two charts to try to join next: the smallest that has a neighbour not yet refused, and the
/// neighbour with which it shares the longest border.
pub fn next_merge(faces: &Faces, flats: &[Flat], refused: &[(u32, u32)]) -> Option<(usize, usize)> {
    let mut chart_of = vec![usize::MAX; faces.areas.len()];
    for (chart, flat) in flats.iter().enumerate() {
        for &t in &flat.triangles {
            chart_of[t as usize] = chart;
        }
    }
    let mut borders: Vec<(usize, usize, f64)> = Vec::new();
    for (t, across) in faces.neighbours.iter().enumerate() {
        for k in 0..3 {
            if across[k] != NONE && chart_of[t] != chart_of[across[k] as usize] {
                borders.push((chart_of[t], chart_of[across[k] as usize], faces.edges[t][k]));
            }
        }
    }
    borders.sort_by_key(|&(a, b, _)| (a, b));
    let mut best: Option<(f64, f64, usize, usize)> = None;
    for same in borders.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)) {
        let (a, b) = (same[0].0, same[0].1);
        let (x, y) = (flats[a].triangles[0], flats[b].triangles[0]);
        if refused.contains(&(x, y)) || refused.contains(&(y, x)) {
            continue;
        }
        let length: f64 = same.iter().map(|s| s.2).sum();
        let area = flats[a].area;
        let better = best.is_none_or(|(least, longest, _, _)| {
            area < least || (area == least && length > longest)
        });
        if better {
            best = Some((area, length, a, b));
        }
    }
    best.map(|(_, _, a, b)| (a.min(b), a.max(b)))
}

/// Regions that grow over some of the triangles.
struct Regions<'a> {
    faces: &'a Faces,
    /// Whether a triangle takes part.
    inside: Vec<bool>,
    seeds: Vec<u32>,
    /// Mean normal of each region, zero while unknown.
    means: Vec<DVec3>,
    region_of: Vec<u32>,
    cost: Vec<f64>,
}

impl<'a> Regions<'a> {
    fn new(faces: &'a Faces, chart: &[u32]) -> Self {
        let mut inside = vec![false; faces.areas.len()];
        for &t in chart {
            inside[t as usize] = true;
        }
        Self {
            faces,
            inside,
            seeds: Vec::new(),
            means: Vec::new(),
            region_of: vec![NONE; faces.areas.len()],
            cost: vec![f64::MAX; faces.areas.len()],
        }
    }

    /// One seed in each connected component.
    fn seed_components(&mut self, chart: &[u32]) {
        let mut seen = vec![false; self.inside.len()];
        for &first in chart {
            if seen[first as usize] {
                continue;
            }
            self.seeds.push(first);
            self.means.push(DVec3::ZERO);
            seen[first as usize] = true;
            let mut stack = vec![first];
            while let Some(t) = stack.pop() {
                for n in self.faces.neighbours[t as usize] {
                    if n != NONE && self.inside[n as usize] && !seen[n as usize] {
                        seen[n as usize] = true;
                        stack.push(n);
                    }
                }
            }
        }
    }

    /// Gives each triangle to the seed from which it is the cheapest to reach.
    fn flood(&mut self) {
        self.region_of.fill(NONE);
        self.cost.fill(f64::MAX);
        let mut queue = BinaryHeap::new();
        for (region, &seed) in self.seeds.iter().enumerate() {
            self.cost[seed as usize] = 0.0;
            queue.push(Reverse((0_u64, seed, region as u32)));
        }
        while let Some(Reverse((bits, t, region))) = queue.pop() {
            // Bits of positive floats sort as the floats do.
            let cost = f64::from_bits(bits);
            if self.region_of[t as usize] != NONE {
                continue;
            }
            self.region_of[t as usize] = region;
            self.cost[t as usize] = cost;
            let mean = self.means[region as usize];
            for n in self.faces.neighbours[t as usize] {
                if n == NONE || !self.inside[n as usize] || self.region_of[n as usize] != NONE {
                    continue;
                }
                let far = self.faces.centres[n as usize].distance(self.faces.centres[t as usize]);
                let turned = if mean == DVec3::ZERO {
                    0.0
                } else {
                    1.0 - self.faces.normals[n as usize].dot(mean)
                };
                let next = cost + far * (1.0 + TURN_COST * turned.max(0.0));
                if next < self.cost[n as usize] {
                    self.cost[n as usize] = next;
                    queue.push(Reverse((next.to_bits(), n, region)));
                }
            }
        }
    }

    /// Floods, moves every seed to the middle of its region, and again.
    fn settle(&mut self, rounds: usize) {
        for round in 0..rounds {
            self.flood();
            let charts = self.charts_by_region();
            for (region, chart) in charts.iter().enumerate() {
                if chart.is_empty() {
                    continue;
                }
                self.means[region] = self.faces.mean_normal(chart);
                if round + 1 < rounds {
                    self.seeds[region] = self.middle(chart);
                }
            }
        }
    }

    /// The triangle nearest to the centre of mass of a region.
    fn middle(&self, chart: &[u32]) -> u32 {
        let area: f64 = chart.iter().map(|&t| self.faces.areas[t as usize]).sum();
        if area <= 0.0 {
            return chart[0];
        }
        let centre = chart
            .iter()
            .map(|&t| self.faces.areas[t as usize] * self.faces.centres[t as usize])
            .sum::<DVec3>()
            / area;
        let distance = |t: &u32| self.faces.centres[*t as usize].distance_squared(centre);
        *chart
            .iter()
            .min_by(|a, b| distance(a).total_cmp(&distance(b)))
            .expect("a region is not empty")
    }

    /// The triangle of `chart` that was the dearest to reach; unreached ones count as such.
    fn farthest(&self, chart: &[u32]) -> u32 {
        *chart
            .iter()
            .max_by(|a, b| self.cost[**a as usize].total_cmp(&self.cost[**b as usize]))
            .expect("a chart is not empty")
    }

    /// Adds a seed to every region that turns too far; says whether there was one.
    fn split_turned(&mut self) -> bool {
        let charts = self.charts_by_region();
        let before = self.seeds.len();
        for (region, chart) in charts.iter().enumerate() {
            let mean = self.means[region];
            let cosine = |t: u32| self.faces.normals[t as usize].dot(mean);
            let area: f64 = chart.iter().map(|&t| self.faces.areas[t as usize]).sum();
            let turned: f64 = chart
                .iter()
                .filter(|&&t| cosine(t) < TURNED_COSINE)
                .map(|&t| self.faces.areas[t as usize])
                .sum();
            if turned <= TURNED_SHARE_MAX * area || chart.len() < 2 {
                continue;
            }
            let worst = chart
                .iter()
                .filter(|&&t| self.faces.areas[t as usize] > 0.0)
                .min_by(|&&a, &&b| cosine(a).total_cmp(&cosine(b)));
            if let Some(&worst) = worst
                && worst != self.seeds[region]
            {
                self.seeds.push(worst);
                self.means.push(self.faces.normals[worst as usize]);
            }
        }
        self.seeds.len() > before
    }

    fn charts_by_region(&self) -> Vec<Vec<u32>> {
        let mut charts = vec![Vec::new(); self.seeds.len()];
        for (t, &region) in self.region_of.iter().enumerate() {
            if region != NONE {
                charts[region as usize].push(t as u32);
            }
        }
        charts
    }

    /// The regions that have triangles, and what no seed reached as charts of one triangle.
    fn charts(&self) -> Vec<Vec<u32>> {
        let mut charts = self.charts_by_region();
        charts.retain(|chart| !chart.is_empty());
        for (t, &region) in self.region_of.iter().enumerate() {
            if region == NONE && self.inside[t] {
                charts.push(vec![t as u32]);
            }
        }
        charts
    }
}
