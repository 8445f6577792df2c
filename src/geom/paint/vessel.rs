//! Vessels that branch over a surface, and how near a place is to one.
//!
//! Trees grow towards places that have no vessel yet, from given roots, along the surface. Radii
//! follow from what a branch feeds.
//!
//! Sources: Runions et al., "Modeling and Visualization of Leaf Venation Patterns", SIGGRAPH 2005
//! (growth towards auxin sources); Murray, PNAS 12 (1926) (radii; he has exponent 3, here 4, whose
//! root is two square roots).

use crate::geom::noise::{gradient, lerp, mix, smoothstep, unit};
use glam::Vec3;

/// How a tree grows. Lengths in cm.
#[derive(Clone, Copy, Debug)]
pub struct Habit {
    /// Distance between places that want a vessel: sets how fine the tree is.
    pub spacing: f32,
    /// Length of one step of growth.
    pub step: f32,
    /// How far a branch feels such a place.
    pub reach: f32,
    /// A vessel this near satisfies it.
    pub enough: f32,
    /// Radius of the finest branches.
    pub tip_radius: f32,
    /// Radii are cut here.
    pub radius_max: f32,
    /// How much branches wander, as a share of a step.
    pub wander: f32,
    /// Half widths of [`Cover::core`] and [`Cover::halo`], in radii.
    pub core: f32,
    pub halo: f32,
    pub seed: u32,
}

/// How much of a place vessels take, each 0 to 1 and continuous over the surface.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Cover {
    /// 1 on the axis of a vessel, 0 from a little outside its wall on.
    pub core: f32,
    /// The same over a wider band beside it.
    pub halo: f32,
    /// The band beside large vessels only.
    pub stem: f32,
}

/// Places on a surface with their normals.
pub struct Samples {
    pub places: Vec<Vec3>,
    pub normals: Vec<Vec3>,
    grid: Grid,
}

/// A grown tree, ready to be asked for the nearest vessel.
pub struct Tree {
    nodes: Vec<Vec3>,
    parents: Vec<u32>,
    radii: Vec<f32>,
    habit: Habit,
    grid: Grid,
}

const NONE: u32 = u32::MAX;
/// Rounds of growth at most: 600 steps of 1.5 mm go round any organ.
const ROUNDS_MAX: usize = 600;

impl Samples {
    /// About `count` places spread over the triangles by area.
    pub fn new(places: &[Vec3], normals: &[Vec3], triangles: &[[u32; 3]], count: usize) -> Self {
        let area = |t: &[u32; 3]| {
            let [a, b, c] = t.map(|p| places[p as usize]);
            0.5 * (b - a).cross(c - a).length()
        };
        let whole: f32 = triangles.iter().map(area).sum();
        let mut samples = (Vec::new(), Vec::new());
        let mut owed = 0.5;
        let mut state = 1_u32;
        for t in triangles {
            if whole <= 0.0 {
                break;
            }
            owed += area(t) / whole * count as f32;
            while owed >= 1.0 {
                owed -= 1.0;
                state = mix(state.wrapping_add(0x9e37_79b9));
                let (mut u, mut v) = (unit(state), unit(mix(state ^ 0x5bd1_e995)));
                if u + v > 1.0 {
                    (u, v) = (1.0 - u, 1.0 - v);
                }
                let blend = |of: &[Vec3]| {
                    let [a, b, c] = t.map(|p| of[p as usize]);
                    a + (b - a) * u + (c - a) * v
                };
                samples.0.push(blend(places));
                samples.1.push(blend(normals).normalize_or(Vec3::Y));
            }
        }
        let grid = Grid::of_points(&samples.0, 0.5);
        Self {
            places: samples.0,
            normals: samples.1,
            grid,
        }
    }

    /// The sample nearest to `p`, among those not much farther than `reach`.
    fn nearest(&self, p: Vec3, reach: f32) -> Option<usize> {
        let mut best = (f32::MAX, NONE);
        self.grid.visit(p, reach, |sample| {
            let squared = self.places[sample as usize].distance_squared(p);
            if squared < best.0 {
                best = (squared, sample);
            }
        });
        (best.1 != NONE).then_some(best.1 as usize)
    }

    /// `p` moved onto the surface, with the normal there.
    fn onto(&self, p: Vec3) -> Option<(Vec3, Vec3)> {
        let sample = [0.4, 1.2, 4.0]
            .into_iter()
            .find_map(|reach| self.nearest(p, reach))?;
        let normal = self.normals[sample];
        Some((p - normal * (p - self.places[sample]).dot(normal), normal))
    }

    /// Samples at least `spacing` apart, in a random order.
    fn thinned(&self, spacing: f32, seed: u32) -> Vec<u32> {
        let mut order: Vec<u32> = (0..self.places.len() as u32).collect();
        order.sort_by_key(|&sample| (mix(sample ^ mix(seed)), sample));
        let mut taken = vec![false; self.places.len()];
        order.retain(|&sample| {
            let p = self.places[sample as usize];
            let mut free = true;
            self.grid.visit(p, spacing, |other| {
                let near = self.places[other as usize].distance_squared(p) < spacing * spacing;
                free &= !(taken[other as usize] && near);
            });
            taken[sample as usize] = free;
            free
        });
        order
    }
}

impl Tree {
    /// Grows from `guides`: each is a path that a large vessel follows, from its root on.
    pub fn grow(samples: &Samples, guides: &[Vec<Vec3>], habit: &Habit) -> Self {
        let mut growth = Growth::start(samples, guides, habit);
        for _ in 0..ROUNDS_MAX {
            if !growth.round() {
                break;
            }
        }
        growth.finish()
    }

    /// How much of the place `p` the vessels take.
    pub fn cover(&self, p: Vec3) -> Cover {
        let mut cover = Cover::default();
        self.grid.visit(p, 0.0, |node| {
            let node = node as usize;
            let parent = self.parents[node] as usize;
            let (a, b) = (self.nodes[parent], self.nodes[node]);
            let axis = b - a;
            let squared = axis.length_squared();
            let t = if squared > 0.0 {
                ((p - a).dot(axis) / squared).clamp(0.0, 1.0)
            } else {
                0.0
            };
            let distance = p.distance(a + axis * t);
            // Branches start at their own width, not at that of the stem.
            let start = self.radii[parent].min(1.3 * self.radii[node]);
            let radius = lerp(start, self.radii[node], t);
            let core = smoothstep(self.habit.core * radius, 0.0, distance);
            let halo = smoothstep(self.habit.halo * radius, 0.0, distance);
            let large = smoothstep(0.4, 0.8, radius / self.habit.radius_max);
            cover.core = cover.core.max(core);
            cover.halo = cover.halo.max(halo);
            cover.stem = cover.stem.max(halo * large);
        });
        cover
    }
}

/// A tree while it grows.
struct Growth<'a> {
    samples: &'a Samples,
    habit: &'a Habit,
    nodes: Vec<Vec3>,
    normals: Vec<Vec3>,
    parents: Vec<u32>,
    /// Places that want a vessel, with the nearest node and its squared distance.
    wants: Vec<(u32, u32, f32)>,
}

impl<'a> Growth<'a> {
    fn start(samples: &'a Samples, guides: &[Vec<Vec3>], habit: &'a Habit) -> Self {
        let mut growth = Self {
            samples,
            habit,
            nodes: Vec::new(),
            normals: Vec::new(),
            parents: Vec::new(),
            wants: samples
                .thinned(habit.spacing, habit.seed)
                .into_iter()
                .map(|sample| (sample, NONE, f32::MAX))
                .collect(),
        };
        for guide in guides {
            growth.follow(guide);
        }
        growth.claim(0);
        growth
    }

    /// Adds the nodes of a guide.
    fn follow(&mut self, guide: &[Vec3]) {
        let mut last = NONE;
        for piece in guide.windows(2) {
            let steps = (piece[0].distance(piece[1]) / self.habit.step)
                .ceil()
                .max(1.0) as u32;
            for k in 0..steps {
                let straight = piece[0].lerp(piece[1], k as f32 / steps as f32);
                last = self.add(self.wandering(straight), last);
            }
        }
        if let Some(&end) = guide.last() {
            self.add(end, last);
        }
    }

    /// A place moved a little, the same way for places near it.
    fn wandering(&self, p: Vec3) -> Vec3 {
        let at = p / (6.0 * self.habit.step);
        let seed = self.habit.seed;
        p + Vec3::new(
            gradient(at, seed),
            gradient(at, seed ^ 1),
            gradient(at, seed ^ 2),
        ) * (2.0 * self.habit.wander * self.habit.step)
    }

    /// Adds a node on the surface; gives its number, or that of the parent if there is no surface.
    fn add(&mut self, p: Vec3, parent: u32) -> u32 {
        let Some((place, normal)) = self.samples.onto(p) else {
            return parent;
        };
        let node = self.nodes.len() as u32;
        self.nodes.push(place);
        self.normals.push(normal);
        self.parents
            .push(if parent == NONE { node } else { parent });
        node
    }

    /// Lets the nodes from `first` on claim the places nearest to them; satisfied places go.
    fn claim(&mut self, first: usize) {
        let enough = self.habit.enough * self.habit.enough;
        for want in &mut self.wants {
            let place = self.samples.places[want.0 as usize];
            let normal = self.samples.normals[want.0 as usize];
            for node in first..self.nodes.len() {
                let squared = self.nodes[node].distance_squared(place);
                // What lies on the other side of a thin margin is far along the surface.
                if squared < want.2 && self.normals[node].dot(normal) > -0.2 {
                    (want.1, want.2) = (node as u32, squared);
                }
            }
        }
        self.wants.retain(|want| want.2 > enough);
    }

    /// One step of every branch that feels a place in want; says whether there was one.
    fn round(&mut self) -> bool {
        let reach = self.habit.reach * self.habit.reach;
        let mut pulls = vec![Vec3::ZERO; self.nodes.len()];
        for &(sample, node, squared) in &self.wants {
            if node != NONE && squared < reach {
                let way = self.samples.places[sample as usize] - self.nodes[node as usize];
                pulls[node as usize] += way.normalize_or_zero();
            }
        }
        let first = self.nodes.len();
        for (node, pull) in pulls.into_iter().enumerate() {
            if pull == Vec3::ZERO {
                continue;
            }
            let here = self.nodes[node];
            let onward = (here - self.nodes[self.parents[node] as usize]).normalize_or_zero();
            let way = (pull.normalize_or_zero() + 0.5 * onward).normalize_or_zero();
            let next = self.wandering(here + way * self.habit.step);
            let crowded = self.nodes[first..]
                .iter()
                .any(|n| n.distance_squared(next) < 0.04 * self.habit.step * self.habit.step);
            if !crowded {
                self.add(next, node as u32);
            }
        }
        if self.nodes.len() == first {
            return false;
        }
        let before = self.wants.len();
        self.claim(first);
        // Branches that circle round a place they cannot reach must not grow for ever.
        self.wants.len() < before || self.nodes.len() < 40 * (before + 100)
    }

    fn finish(mut self) -> Tree {
        // Straighten what the steps left crooked; ends and forks stay.
        let mut children = vec![0_u32; self.nodes.len()];
        for (node, &parent) in self.parents.iter().enumerate() {
            if parent as usize != node {
                children[parent as usize] += 1;
            }
        }
        for _ in 0..2 {
            let before = self.nodes.clone();
            for node in 0..before.len() {
                let parent = self.parents[node] as usize;
                let above = self.parents[parent] as usize;
                if parent != node && above != parent && children[parent] == 1 {
                    self.nodes[parent] =
                        0.5 * before[parent] + 0.25 * (before[node] + before[above]);
                }
            }
        }
        // Children come after their parents, so one way back sums what each branch feeds.
        let tip = self.habit.tip_radius;
        let mut fed = vec![0.0_f32; self.nodes.len()];
        for node in (0..self.nodes.len()).rev() {
            if children[node] == 0 {
                fed[node] = 1.0;
            }
            let parent = self.parents[node] as usize;
            if parent != node {
                fed[parent] += fed[node];
            }
        }
        let radii: Vec<f32> = fed
            .iter()
            .zip(&children)
            .map(|(fed, &children)| {
                // The last piece of a branch tapers.
                let share = if children == 0 { 0.4 } else { 1.0 };
                (share * tip * fed.sqrt().sqrt()).min(self.habit.radius_max)
            })
            .collect();
        let boxes: Vec<(Vec3, Vec3)> = (0..self.nodes.len())
            .map(|node| {
                let (a, b) = (self.nodes[node], self.nodes[self.parents[node] as usize]);
                let wide = self.habit.halo.max(self.habit.core) * 1.3 * radii[node];
                (a.min(b) - wide, a.max(b) + wide)
            })
            .collect();
        Tree {
            habit: *self.habit,
            grid: Grid::of_boxes(&boxes, 0.25),
            nodes: self.nodes,
            parents: self.parents,
            radii,
        }
    }
}

/// Things in the cells of a dense grid.
struct Grid {
    low: Vec3,
    cell: f32,
    size: [i32; 3],
    start: Vec<u32>,
    things: Vec<u32>,
}

impl Grid {
    fn of_points(points: &[Vec3], cell: f32) -> Self {
        let boxes: Vec<(Vec3, Vec3)> = points.iter().map(|&p| (p, p)).collect();
        Self::of_boxes(&boxes, cell)
    }

    fn of_boxes(boxes: &[(Vec3, Vec3)], cell: f32) -> Self {
        let low = boxes
            .iter()
            .fold(Vec3::splat(f32::MAX), |low, b| low.min(b.0));
        let high = boxes
            .iter()
            .fold(Vec3::splat(f32::MIN), |high, b| high.max(b.1));
        let size = if boxes.is_empty() {
            [0; 3]
        } else {
            ((high - low) / cell).to_array().map(|n| n as i32 + 1)
        };
        let mut grid = Self {
            low,
            cell,
            size,
            start: vec![0; (size[0] * size[1] * size[2]) as usize + 1],
            things: Vec::new(),
        };
        let mut filled = grid.start.clone();
        for b in boxes {
            grid.cells(b.0, b.1, |c| filled[c + 1] += 1);
        }
        for c in 1..filled.len() {
            filled[c] += filled[c - 1];
        }
        grid.start = filled.clone();
        grid.things = vec![0; *filled.last().expect("there is a first entry") as usize];
        for (thing, b) in boxes.iter().enumerate() {
            let mut places = Vec::new();
            grid.cells(b.0, b.1, |c| places.push(c));
            for c in places {
                grid.things[filled[c] as usize] = thing as u32;
                filled[c] += 1;
            }
        }
        grid
    }

    /// Visits the cells of a box.
    fn cells(&self, low: Vec3, high: Vec3, mut visit: impl FnMut(usize)) {
        let first = ((low - self.low) / self.cell).floor().to_array();
        let last = ((high - self.low) / self.cell).floor().to_array();
        let range = |d: usize| (first[d] as i32).max(0)..=(last[d] as i32).min(self.size[d] - 1);
        for z in range(2) {
            for y in range(1) {
                for x in range(0) {
                    visit(((z * self.size[1] + y) * self.size[0] + x) as usize);
                }
            }
        }
    }

    /// Visits what lies in the cells within `reach` of `p`.
    fn visit(&self, p: Vec3, reach: f32, mut visit: impl FnMut(u32)) {
        self.cells(p - reach, p + reach, |c| {
            for &thing in &self.things[self.start[c] as usize..self.start[c + 1] as usize] {
                visit(thing);
            }
        });
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const HABIT: Habit = Habit {
        spacing: 0.6,
        step: 0.15,
        reach: 4.0,
        enough: 0.35,
        tip_radius: 0.03,
        radius_max: 0.2,
        wander: 0.4,
        core: 1.2,
        halo: 3.0,
        seed: 1,
    };

    /// Places on a ball of 3 cm.
    fn ball() -> Samples {
        let turn = |k: u32| std::f32::consts::TAU * k as f32 / 48.0;
        let at = |ring: u32, side: u32| {
            let (polar, turn) = (0.5 * turn(ring), turn(side));
            Vec3::new(
                polar.sin() * turn.cos(),
                polar.cos(),
                polar.sin() * turn.sin(),
            )
        };
        let normals: Vec<Vec3> = (0..49 * 48).map(|k| at(k / 48, k % 48)).collect();
        let places: Vec<Vec3> = normals.iter().map(|n| *n * 3.0).collect();
        let triangles: Vec<[u32; 3]> = (0..48 * 48)
            .flat_map(|k| {
                let (ring, side) = (k / 48, k % 48);
                let v = |r: u32, s: u32| r * 48 + s % 48;
                [
                    [v(ring, side), v(ring, side + 1), v(ring + 1, side)],
                    [v(ring, side + 1), v(ring + 1, side + 1), v(ring + 1, side)],
                ]
            })
            .collect();
        Samples::new(&places, &normals, &triangles, 8000)
    }

    #[test]
    fn tree_reaches_everywhere_along_the_surface() {
        let samples = ball();
        let tree = Tree::grow(&samples, &[vec![Vec3::Y * 3.0]], &HABIT);
        for node in &tree.nodes {
            // Nodes lie on tangent planes of samples 2 mm apart, then are smoothed.
            assert!((node.length() - 3.0).abs() < 0.05, "{node}");
        }
        for place in &samples.places {
            let nearest = tree.nodes.iter().map(|n| n.distance(*place));
            let nearest = nearest.fold(f32::MAX, f32::min);
            // A place is at most a spacing from one that wanted a vessel.
            assert!(
                nearest < HABIT.spacing + HABIT.enough + HABIT.step,
                "{nearest}"
            );
        }
    }

    #[test]
    fn vessels_never_widen_away_from_the_root() {
        let tree = Tree::grow(&ball(), &[vec![Vec3::Y * 3.0]], &HABIT);
        for (node, &parent) in tree.parents.iter().enumerate() {
            assert!(tree.radii[node] <= tree.radii[parent as usize]);
        }
        let root = tree.radii[0];
        assert!(root > 2.0 * HABIT.tip_radius, "the stem is thick: {root}");
    }

    #[test]
    fn cover_is_full_on_an_axis_and_nothing_far_from_it() {
        let tree = Tree::grow(&ball(), &[vec![Vec3::Y * 3.0]], &HABIT);
        let inner = tree.nodes[tree.nodes.len() / 2];
        let cover = tree.cover(inner);
        assert!(cover.core > 0.999 && cover.halo > 0.999, "{cover:?}");
        assert_eq!(tree.cover(inner * 2.0), Cover::default());
    }

    #[test]
    fn surface_without_places_has_no_vessels() {
        let none = Samples::new(&[], &[], &[], 100);
        let tree = Tree::grow(&none, &[vec![Vec3::ZERO]], &HABIT);
        assert_eq!(tree.cover(Vec3::ZERO), Cover::default());
    }
}
