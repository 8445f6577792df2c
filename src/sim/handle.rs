//! Handles: places between particles, and how a push at such a place moves the particles.

use crate::geom::Embedding;
use glam::{Vec3, Vec4};

/// Carriers of a place in a triangle: three points of four particles each.
pub const CARRIERS_MAX: usize = 12;
/// No particle is moved by more than this many times what is asked of its place: beside held
/// particles a place has little that can move, and a push through it would fling that away.
const LEVER_MAX: f32 = 4.0;

/// A place of which less than this share can move counts as held.
const MOVING_SHARE_MIN: f32 = 0.1;

/// Particles that carry a place, and what they are worth together.
#[derive(Clone, Copy, Debug)]
pub struct Handle {
    count: u8,
    particles: [u32; CARRIERS_MAX],
    weights: [f32; CARRIERS_MAX],
    /// Σ weight² · inverse mass [1/kg]; 0 for a place that is held.
    pub inverse_mass: f32,
    /// A compliance that adds to it where only a small share of the place can move [1/kg]: what is
    /// asked of the place is then done in part.
    pub give: f32,
}

impl Handle {
    /// The handle at surface point `point`.
    pub fn of_point(embedding: &Embedding, point: usize, places: &[Vec4]) -> Self {
        let (particles, weights) = (embedding.particles[point], embedding.weights[point]);
        let mut handle = Self::EMPTY;
        for k in 0..4 {
            handle.add(particles[k], weights[k]);
        }
        handle.weigh(places);
        handle
    }

    /// Carried by nothing yet.
    const EMPTY: Self = Self {
        count: 0,
        particles: [0; CARRIERS_MAX],
        weights: [0.0; CARRIERS_MAX],
        inverse_mass: 0.0,
        give: 0.0,
    };

    /// Lets `particle` carry `weight` more.
    fn add(&mut self, particle: u32, weight: f32) {
        if weight == 0.0 {
            return;
        }
        let known = (0..self.count as usize).find(|&k| self.particles[k] == particle);
        let k = known.unwrap_or(self.count as usize);
        self.particles[k] = particle;
        self.weights[k] += weight;
        self.count += u8::from(known.is_none());
    }

    fn weigh(&mut self, places: &[Vec4]) {
        let (mut sum, mut largest, mut moving) = (0.0_f32, 0.0_f32, 0.0_f32);
        for (particle, weight) in self.carriers() {
            let moved = places[particle as usize].w * weight;
            sum += moved * weight;
            largest = largest.max(moved.abs());
            if moved != 0.0 {
                moving += weight;
            }
        }
        if moving.abs() < MOVING_SHARE_MIN {
            return;
        }
        self.inverse_mass = sum;
        self.give = (largest / LEVER_MAX - sum).max(0.0);
    }

    /// Where the place is now [m].
    #[inline]
    pub fn place(&self, places: &[Vec4]) -> Vec3 {
        let mut sum = Vec4::ZERO;
        for (particle, weight) in self.carriers() {
            sum += weight * places[particle as usize];
        }
        sum.truncate()
    }

    /// Moves the particles as an impulse times the substep, `multiplier` [kg m], at the place.
    #[inline]
    pub fn push(&self, places: &mut [Vec4], multiplier: Vec3) {
        let multiplier = multiplier.extend(0.0);
        for (particle, weight) in self.carriers() {
            let place = &mut places[particle as usize];
            *place += place.w * weight * multiplier;
        }
    }

    /// The particles that carry the place, each with its weight, which is not 0.
    #[inline]
    pub fn carriers(&self) -> impl Iterator<Item = (u32, f32)> {
        let count = usize::from(self.count);
        (self.particles[..count].iter().copied()).zip(self.weights[..count].iter().copied())
    }
}

/// The particles that carry a triangle, merged, for making a [`Handle`] at any place in it.
#[derive(Clone, Copy, Debug)]
pub struct TriangleCarriers {
    handle: Handle,
    /// Weight of each carrier in each corner.
    corners: [[f32; CARRIERS_MAX]; 3],
}

impl TriangleCarriers {
    /// Of the triangle whose corners hang in these particles with these weights.
    pub fn new(corners: [([u32; 4], [f32; 4]); 3]) -> Self {
        let mut carriers = Self {
            handle: Handle::EMPTY,
            corners: [[0.0; CARRIERS_MAX]; 3],
        };
        for (corner, (particles, weights)) in corners.iter().enumerate() {
            for k in (0..4).filter(|&k| weights[k] != 0.0) {
                let handle = &mut carriers.handle;
                let count = usize::from(handle.count);
                let known = (0..count).find(|&j| handle.particles[j] == particles[k]);
                let j = known.unwrap_or(count);
                handle.particles[j] = particles[k];
                handle.count += u8::from(known.is_none());
                carriers.corners[corner][j] += weights[k];
            }
        }
        carriers
    }

    /// What the slope of the triangle, as it lies with its corners at `places` [m], changes by for
    /// each metre that a carrier moves along its normal [1/m]; zeros for one without an area.
    pub fn slopes(&self, places: [Vec3; 3]) -> [Vec3; CARRIERS_MAX] {
        let [a, b, c] = places;
        let normal = (b - a).cross(c - a);
        // Gradient of the barycentric coordinate of the corner across from an edge.
        let per_area = normal / normal.length_squared().max(f32::MIN_POSITIVE);
        let corners = [c - b, a - c, b - a].map(|edge| per_area.cross(edge));
        std::array::from_fn(|j| {
            (0..3)
                .map(|corner| self.corners[corner][j] * corners[corner])
                .sum()
        })
    }

    /// The handle at the place with barycentric `weights`.
    pub fn at(&self, weights: Vec3, places: &[Vec4]) -> Handle {
        let mut handle = self.handle;
        for j in 0..usize::from(handle.count) {
            handle.weights[j] = weights.x * self.corners[0][j]
                + weights.y * self.corners[1][j]
                + weights.z * self.corners[2][j];
        }
        handle.weigh(places);
        handle
    }
}
