//! The part of the surface that a tool may touch in a step.

use super::{
    ToolShape,
    nearest::{Axis, nearest},
};
use crate::geom::Embedding;
use crate::sim::handle::TriangleCarriers;
use glam::{Vec3, Vec4};

/// Most that a triangle may dip into a tool, over its radius.
const DIP_RADII_MAX: f32 = 0.005;

/// How far a triangle may dip into a tool of this radius [m].
///
/// Triangles are flat where a tool is round. One of edges e that rests on its corners dips into the
/// tool by Σ e²/24R in the mean and by about Σ e²/16R at most. So that the surface is in its right
/// place on average, and the force does not depend on the mesh, corners are held off by the mean;
/// the rest, Σ e²/48R, is what the deepest place may dip. But little: a triangle that is large for
/// the tool is held where it dips.
fn dip_m(radius_m: f32, [a, b, c]: [Vec3; 3]) -> f32 {
    let squares = (b - a).length_squared() + (c - b).length_squared() + (a - c).length_squared();
    (squares / (48.0 * radius_m)).min(DIP_RADII_MAX * radius_m)
}

/// The surface of the body as a step finds it.
#[derive(Clone, Copy)]
pub struct Surface<'a> {
    /// Corners are points, counter-clockwise seen from outside.
    pub triangles: &'a [[u32; 3]],
    /// Places of the points [m].
    pub points: &'a [Vec3],
    /// Smallest and largest corner of the box round them [m].
    pub bounds: (Vec3, Vec3),
    pub embedding: &'a Embedding,
}

/// The box that a tool sweeps in a step, with room for the way of the body.
#[derive(Clone, Copy, Debug)]
pub struct SweptBox {
    low: Vec3,
    high: Vec3,
    /// What is farther than this from the tool at the start of the step stays out of its reach [m].
    reach_m: f32,
}

impl SweptBox {
    /// Of a tool of `shape` between two places, with room round it.
    pub fn new(shape: ToolShape, ends: [Vec3; 2], room_m: f32) -> Self {
        let axis = shape.axis_m();
        let room = Vec3::splat(shape.radius_m() + room_m);
        Self {
            low: ends[0].min(ends[1]) + axis.min(Vec3::ZERO) - room,
            high: ends[0].max(ends[1]) + axis.max(Vec3::ZERO) + room,
            reach_m: room_m + ends[0].distance(ends[1]),
        }
    }

    /// Whether it has nothing in common with the box between two corners.
    pub fn misses(self, (low, high): (Vec3, Vec3)) -> bool {
        self.low.cmpgt(high).any() || self.high.cmplt(low).any()
    }

    /// The sides of the box beyond which `x` lies, a bit each.
    fn beyond(self, x: Vec3) -> u8 {
        (x.cmplt(self.low).bitmask() | (x.cmpgt(self.high).bitmask() << 3)) as u8
    }
}

/// A point of the surface near the tool.
#[derive(Clone, Copy, Debug)]
pub struct NearPoint {
    /// Its index in the surface.
    pub point: u32,
    particles: [u32; 4],
    weights: [f32; 4],
    /// Where it was when the substep started, in the frame of the tool [m].
    pub start: Vec3,
    /// Where it is now [m].
    pub end: Vec3,
    /// From start to end [m].
    pub way_m: f32,
    /// How far it is held off the tool for the sake of its triangles [m].
    off_m: f32,
}

impl NearPoint {
    /// Where it is in the world [m].
    #[inline]
    pub fn place(&self, places: &[Vec4]) -> Vec3 {
        let mut sum = Vec4::ZERO;
        for k in 0..4 {
            sum += self.weights[k] * places[self.particles[k] as usize];
        }
        sum.truncate()
    }
}

/// What of the surface touches what of the tool.
///
/// A flat part of the surface under a large tool rests on its points: of a triangle only one place
/// is held, and on that alone it would rock. Triangles come in where the tool is smaller. A capsule
/// touches a triangle along a line, and on one place of that the triangle would rock about it: it
/// meets the sides of the triangle, and the face with its ends only.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub enum Feature {
    /// A point of the surface and the whole axis.
    Point { point: u32 },
    /// A side of triangles, from the point of the lower index to the other, and the whole axis of a
    /// capsule.
    Side { points: [u32; 2] },
    /// A triangle and one end of the axis; the other end is that of a capsule.
    Triangle { other: bool, triangle: u32 },
}

impl Feature {
    /// Its part of the axis, in the frame of the tool [m].
    #[inline]
    pub fn axis(self, shape: ToolShape) -> Axis {
        let axis = shape.axis_m();
        match self {
            Self::Point { .. } | Self::Side { .. } => [Vec3::ZERO, axis],
            Self::Triangle { other: false, .. } => [Vec3::ZERO; 2],
            Self::Triangle { other: true, .. } => [axis; 2],
        }
    }
}

/// A feature of the surface near the tool.
#[derive(Clone, Copy, Debug)]
pub struct Near {
    pub feature: Feature,
    /// Its corners, as indices of near points; for a point three times the same, for a side one
    /// twice.
    pub corners: [u32; 3],
    /// How near it may come to the axis [m].
    pub radius_m: f32,
    /// At least so much farther it was when the substep started [m].
    pub clear_m: f32,
    /// Its touch in this substep.
    pub touch: Option<u32>,
    /// Its carriers, once they have been needed.
    carriers: Option<u32>,
}

impl Near {
    /// Its carriers, from `all` that have been needed so far.
    pub fn carriers(
        &mut self,
        all: &mut Vec<TriangleCarriers>,
        corners: [&NearPoint; 3],
    ) -> TriangleCarriers {
        let index = *self.carriers.get_or_insert_with(|| {
            let carried = corners.map(|corner| (corner.particles, corner.weights));
            all.push(TriangleCarriers::new(carried));
            all.len() as u32 - 1
        });
        all[index as usize]
    }
}

/// All features near a tool.
#[derive(Clone, Debug, Default)]
pub struct Vicinity {
    /// In the order of their features.
    pub near: Vec<Near>,
    pub points: Vec<NearPoint>,
    pub carriers: Vec<TriangleCarriers>,
    /// Sides of the box beyond which each point of the surface lies.
    beyond: Vec<u8>,
    /// The near point of each point of the surface, or none.
    near_of: Vec<u32>,
}

const NONE: u32 = u32::MAX;

impl Vicinity {
    pub fn clear(&mut self) {
        self.near.clear();
        self.points.clear();
        self.carriers.clear();
    }

    /// Lists the features that a tool can reach in a step in which it goes from `from_m` on and
    /// sweeps `swept`.
    pub fn find(&mut self, shape: ToolShape, from_m: Vec3, swept: SweptBox, surface: Surface) {
        self.clear();
        self.beyond.clear();
        self.beyond
            .extend(surface.points.iter().map(|&x| swept.beyond(x)));
        for (index, &corners) in surface.triangles.iter().enumerate() {
            let [a, b, c] = corners.map(|point| self.beyond[point as usize]);
            if a & b & c != 0 {
                continue;
            }
            let mut add = |feature, corners| {
                self.add(feature, corners, shape, from_m, swept.reach_m, surface);
            };
            let triangle = index as u32;
            let at_end = |other| Feature::Triangle { other, triangle };
            add(at_end(false), corners);
            if let ToolShape::Capsule { .. } = shape {
                add(at_end(true), corners);
                for k in 0..3 {
                    let (from, to) = (corners[k], corners[(k + 1) % 3]);
                    let points = [from.min(to), from.max(to)];
                    add(Feature::Side { points }, [points[0], points[1], points[1]]);
                }
            }
        }
        for k in 0..self.points.len() {
            let point = self.points[k].point;
            let feature = Feature::Point { point };
            self.add(feature, [point; 3], shape, from_m, swept.reach_m, surface);
        }
        self.close();
    }

    /// Takes a feature if it is within `reach_m` of the tool.
    fn add(
        &mut self,
        feature: Feature,
        corners: [u32; 3],
        shape: ToolShape,
        from_m: Vec3,
        reach_m: f32,
        surface: Surface,
    ) {
        let places = corners.map(|point| surface.points[point as usize] - from_m);
        let dip_m = dip_m(shape.radius_m(), places);
        let off_m = match feature {
            Feature::Point { point } => self.points[self.near_of[point as usize] as usize].off_m,
            Feature::Side { .. } | Feature::Triangle { .. } => -dip_m,
        };
        let radius_m = shape.radius_m() + off_m;
        let clear_m = nearest(feature.axis(shape), places).distance_m() - radius_m;
        if clear_m > reach_m {
            return;
        }
        self.near_of.resize(surface.points.len(), NONE);
        let corners = corners.map(|point| {
            let known = &mut self.near_of[point as usize];
            if *known == NONE {
                *known = self.points.len() as u32;
                let start = surface.points[point as usize] - from_m;
                self.points.push(NearPoint {
                    point,
                    particles: surface.embedding.particles[point as usize],
                    weights: surface.embedding.weights[point as usize],
                    start,
                    end: start,
                    way_m: 0.0,
                    off_m: 0.0,
                });
            }
            let near = &mut self.points[*known as usize];
            near.off_m = near.off_m.max(2.0 * dip_m);
            *known
        });
        self.near.push(Near {
            feature,
            corners,
            radius_m,
            clear_m,
            touch: None,
            carriers: None,
        });
    }

    /// Sorts what has been added.
    fn close(&mut self) {
        self.near.sort_unstable_by_key(|near| near.feature);
        // Two triangles have each side.
        self.near.dedup_by_key(|near| near.feature);
        for point in &self.points {
            self.near_of[point.point as usize] = NONE;
        }
    }

    /// Longest way of a point in this substep in the frame of a tool that ends it at `to_m` [m].
    pub fn way_max_m(&self, to_m: Vec3, places: &[Vec4]) -> f32 {
        (self.points.iter())
            .map(|point| point.start.distance_squared(point.place(places) - to_m))
            .fold(0.0, f32::max)
            .sqrt()
    }

    /// The particles that carry the points, each once.
    pub fn movers(&self) -> Vec<u32> {
        let mut movers: Vec<u32> = (self.points.iter())
            .flat_map(|point| point.particles)
            .collect();
        movers.sort_unstable();
        movers.dedup();
        movers
    }

    /// Takes over where the points are at the start of a substep.
    pub fn begin_substep(&mut self, from_m: Vec3, previous: &[Vec4]) {
        for point in &mut self.points {
            let start = point.place(previous) - from_m;
            point.way_m = point.start.distance(start);
            point.start = start;
        }
        for near in &mut self.near {
            let ways = near.corners.map(|k| self.points[k as usize].way_m);
            near.clear_m -= ways.into_iter().fold(0.0, f32::max);
            near.touch = None;
        }
    }
}
