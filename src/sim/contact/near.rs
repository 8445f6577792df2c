//! The part of the surface that a tool may touch in a step.

use super::{
    ToolShape,
    nearest::{Axis, nearest},
};
use crate::geom::Embedding;
use crate::sim::handle::TriangleCarriers;
use glam::{Vec3, Vec4};

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

/// A triangle near a piece of the tool.
#[derive(Clone, Copy, Debug)]
pub struct Near {
    /// Its index in the surface, and which half of a capsule's axis it is near.
    pub key: (u32, u8),
    /// Its corners, as indices of near points.
    pub corners: [u32; 3],
    /// At least so far outside the tool when the substep started [m].
    pub clear_m: f32,
    /// Its touch in this substep.
    pub touch: Option<u32>,
    /// Its carriers, once they have been needed.
    carriers: Option<u32>,
}

impl Near {
    /// Its piece of the axis, in the frame of the tool [m].
    ///
    /// A capsule has two: it can lie along a triangle larger than itself, and one place would let it
    /// rock.
    #[inline]
    pub fn axis(&self, shape: ToolShape) -> Axis {
        piece_axis(shape, self.key.1)
    }

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

fn piece_axis(shape: ToolShape, piece: u8) -> Axis {
    let half = 0.5 * shape.axis_m();
    match shape {
        ToolShape::Sphere { .. } => [Vec3::ZERO; 2],
        ToolShape::Capsule { .. } => [f32::from(piece) * half, f32::from(piece + 1) * half],
    }
}

/// All triangles near a tool.
#[derive(Clone, Debug, Default)]
pub struct Vicinity {
    /// In the order of their keys.
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

    /// Lists the triangles whose boxes meet `swept` and that it can reach.
    pub fn find(&mut self, shape: ToolShape, from_m: Vec3, swept: SweptBox, surface: Surface) {
        self.clear();
        self.beyond.clear();
        self.beyond
            .extend(surface.points.iter().map(|&x| swept.beyond(x)));
        self.near_of.resize(surface.points.len(), NONE);
        let pieces = match shape {
            ToolShape::Sphere { .. } => 1,
            ToolShape::Capsule { .. } => 2,
        };
        for (index, triangle) in surface.triangles.iter().enumerate() {
            let [a, b, c] = triangle.map(|point| self.beyond[point as usize]);
            if a & b & c != 0 {
                continue;
            }
            for piece in 0..pieces {
                self.add((index as u32, piece), shape, from_m, surface);
                if self
                    .near
                    .last()
                    .is_some_and(|near| near.clear_m > swept.reach_m)
                {
                    self.near.pop();
                }
            }
        }
        for point in &self.points {
            self.near_of[point.point as usize] = NONE;
        }
    }

    fn add(
        &mut self,
        (triangle, piece): (u32, u8),
        shape: ToolShape,
        from_m: Vec3,
        surface: Surface,
    ) {
        let corners = surface.triangles[triangle as usize].map(|point| {
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
                });
            }
            *known
        });
        let places = corners.map(|k| self.points[k as usize].start);
        let near = nearest(piece_axis(shape, piece), places);
        self.near.push(Near {
            key: (triangle, piece),
            corners,
            clear_m: near.distance_m() - shape.radius_m(),
            touch: None,
            carriers: None,
        });
    }

    /// Lists only the triangle that is nearest to a tip inside the body and can move.
    pub fn find_way_out(&mut self, tip_m: Vec3, surface: Surface, places: &[Vec4]) {
        self.clear();
        let moves = |triangle: &[u32; 3]| {
            let carriers = triangle
                .iter()
                .flat_map(|&point| surface.embedding.particles[point as usize]);
            carriers
                .into_iter()
                .any(|particle| places[particle as usize].w > 0.0)
        };
        let squared_m2 = |triangle: &[u32; 3]| {
            let corners = triangle.map(|point| surface.points[point as usize]);
            nearest([tip_m; 2], corners).offset.length_squared()
        };
        let way_out = (surface.triangles.iter().enumerate())
            .filter(|(_, triangle)| moves(triangle))
            .map(|(index, triangle)| (index, squared_m2(triangle)))
            .min_by(|(_, a), (_, b)| a.total_cmp(b));
        if let Some((index, _)) = way_out {
            self.near_of.resize(surface.points.len(), NONE);
            let shape = ToolShape::Sphere { radius_m: 0.0 };
            self.add((index as u32, 0), shape, tip_m, surface);
            self.near[0].clear_m = f32::NEG_INFINITY;
            for point in &self.points {
                self.near_of[point.point as usize] = NONE;
            }
        }
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
