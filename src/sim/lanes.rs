//! Eight numbers side by side, and how eight constraints reach their particles.
//!
//! The operators are plain loops over arrays, which the compiler turns into vector instructions;
//! no instruction is contracted or reordered, so the bits do not depend on the instruction set.

#![expect(
    clippy::needless_range_loop,
    reason = "one counter for several arrays of the same fixed length"
)]

use super::{
    coloring::color,
    parts::{self, PARTS_MAX},
    team::{SharedSlice, Team},
};
use glam::{Vec3, Vec4};
use std::ops::{Add, Div, Mul, Neg, Sub};

/// Constraints a batch.
pub const LANES: usize = 8;

/// One number for each constraint of a batch.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C, align(32))]
pub struct Lanes(pub [f32; LANES]);

macro_rules! lanewise {
    ($op:ident, $fn:ident, $sign:tt) => {
        impl $op for Lanes {
            type Output = Self;
            #[inline(always)]
            fn $fn(self, other: Self) -> Self {
                let mut out = self.0;
                for lane in 0..LANES {
                    out[lane] = self.0[lane] $sign other.0[lane];
                }
                Self(out)
            }
        }
    };
}
lanewise!(Add, add, +);
lanewise!(Sub, sub, -);
lanewise!(Mul, mul, *);
lanewise!(Div, div, /);

impl Neg for Lanes {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        self.map(|x| -x)
    }
}

impl Lanes {
    #[inline(always)]
    pub fn splat(value: f32) -> Self {
        Self([value; LANES])
    }

    #[inline(always)]
    pub fn map(self, f: impl Fn(f32) -> f32) -> Self {
        let mut out = self.0;
        for value in &mut out {
            *value = f(*value);
        }
        Self(out)
    }

    #[inline(always)]
    pub fn zip(self, other: Self, f: impl Fn(f32, f32) -> f32) -> Self {
        let mut out = self.0;
        for lane in 0..LANES {
            out[lane] = f(self.0[lane], other.0[lane]);
        }
        Self(out)
    }

    /// Every lane times one number.
    #[inline(always)]
    pub fn times(self, factor: f32) -> Self {
        self * Self::splat(factor)
    }

    /// `if_true` where `value < limit`, else `if_false`.
    #[inline(always)]
    pub fn where_below(value: Self, limit: f32, if_true: Self, if_false: Self) -> Self {
        let mut out = if_false.0;
        for lane in 0..LANES {
            out[lane] = if value.0[lane] < limit {
                if_true.0[lane]
            } else {
                if_false.0[lane]
            };
        }
        Self(out)
    }
}

/// One vector for each constraint of a batch.
#[derive(Clone, Copy, Debug, Default)]
pub struct Lanes3 {
    pub x: Lanes,
    pub y: Lanes,
    pub z: Lanes,
}

impl Lanes3 {
    #[inline(always)]
    pub fn dot(self, other: Self) -> Lanes {
        self.x * other.x + self.y * other.y + self.z * other.z
    }

    #[inline(always)]
    pub fn cross(self, other: Self) -> Self {
        Self {
            x: self.y * other.z - self.z * other.y,
            y: self.z * other.x - self.x * other.z,
            z: self.x * other.y - self.y * other.x,
        }
    }

    /// Every vector times one number.
    #[inline(always)]
    pub fn times(self, factor: f32) -> Self {
        self.scaled(Lanes::splat(factor))
    }

    #[inline(always)]
    pub fn scaled(self, factor: Lanes) -> Self {
        Self {
            x: self.x * factor,
            y: self.y * factor,
            z: self.z * factor,
        }
    }
}

impl Add for Lanes3 {
    type Output = Self;
    #[inline(always)]
    fn add(self, other: Self) -> Self {
        Self {
            x: self.x + other.x,
            y: self.y + other.y,
            z: self.z + other.z,
        }
    }
}

impl Sub for Lanes3 {
    type Output = Self;
    #[inline(always)]
    fn sub(self, other: Self) -> Self {
        Self {
            x: self.x - other.x,
            y: self.y - other.y,
            z: self.z - other.z,
        }
    }
}

impl Neg for Lanes3 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self {
            x: -self.x,
            y: -self.y,
            z: -self.z,
        }
    }
}

/// Corners of the eight constraints of a batch; a lane that is not used has a spare place in all.
pub type Corners<const N: usize> = [[u32; LANES]; N];

/// Spare places of a part, of which it uses the first: a cache line of its own.
const SPARE_A_PART: usize = 4;
/// Places behind those of the particles, which no particle owns and nothing moves: the unused lanes
/// of a batch read and write one of them.
const SPARE: usize = SPARE_A_PART * PARTS_MAX;

/// Adds the spare places to one place a particle.
pub fn add_spare(places: &mut Vec<Vec4>) {
    places.resize(places.len() + SPARE, Vec4::ZERO);
}

/// Positions and inverse masses of one corner of eight constraints.
#[derive(Clone, Copy, Default)]
pub struct Corner {
    pub position: Lanes3,
    pub inverse_mass: Lanes,
}

/// One number four times a particle, for the parts of one round to read and write at the same time.
///
/// Nothing is checked in a release: what reads and writes through it is unsafe, with one contract. The
/// corner is of [`Batches`] made for as many particles as the access is of, and no other thread touches
/// particles of that corner meanwhile. [`Batches::for_each_part`] sees to both for the batches that it
/// hands out, and for any other access of the same length that only they use meanwhile.
#[derive(Clone, Copy)]
pub struct ParticleAccess {
    first: *mut Vec4,
    length: usize,
}

// SAFETY: the parts of one round touch disjoint particles (see `for_each_part`).
unsafe impl Send for ParticleAccess {}
// SAFETY: as above.
unsafe impl Sync for ParticleAccess {}

impl ParticleAccess {
    /// Access to `particles`, spare places and all.
    pub fn new(particles: &mut [Vec4]) -> Self {
        Self {
            first: particles.as_mut_ptr(),
            length: particles.len(),
        }
    }

    /// Where a particle is kept.
    ///
    /// # Safety
    ///
    /// There is one of that index.
    #[inline(always)]
    unsafe fn at(self, index: u32) -> *mut Vec4 {
        debug_assert!(
            (index as usize) < self.length,
            "corners are of these particles"
        );
        // SAFETY: inside the slice, says the caller.
        unsafe { self.first.add(index as usize) }
    }

    /// Reads one corner of eight constraints. `WIDE` is for code compiled for AVX.
    ///
    /// # Safety
    ///
    /// See [`ParticleAccess`].
    #[inline(always)]
    pub unsafe fn gather<const WIDE: bool>(self, corner: &[u32; LANES]) -> Corner {
        // SAFETY: the caller keeps the contract.
        let rows = corner.map(|index| unsafe { *self.at(index) });
        let [x, y, z, inverse_mass] = columns_of::<WIDE>(rows);
        Corner {
            position: Lanes3 { x, y, z },
            inverse_mass,
        }
    }

    /// Writes one corner of eight constraints back.
    ///
    /// # Safety
    ///
    /// See [`ParticleAccess`].
    #[inline(always)]
    pub unsafe fn scatter(self, corner: &[u32; LANES], value: Corner) {
        for lane in 0..LANES {
            let particle = Vec4::new(
                value.position.x.0[lane],
                value.position.y.0[lane],
                value.position.z.0[lane],
                value.inverse_mass.0[lane],
            );
            // SAFETY: the caller keeps the contract. Unused lanes all write the value they read.
            unsafe { *self.at(corner[lane]) = particle };
        }
    }

    /// Adds `change` to one corner of eight constraints; the fourth numbers stay.
    ///
    /// # Safety
    ///
    /// See [`ParticleAccess`].
    #[inline(always)]
    pub unsafe fn add<const WIDE: bool>(self, corner: &[u32; LANES], change: Lanes3) {
        let rows = rows_of::<WIDE>(change);
        for lane in 0..LANES {
            // SAFETY: the caller keeps the contract.
            unsafe { *self.at(corner[lane]) += rows[lane] };
        }
    }

    /// The same, and adds `factor` times as much to the same corner in `other`.
    ///
    /// # Safety
    ///
    /// See [`ParticleAccess`], for both.
    #[inline(always)]
    pub unsafe fn add_to_both<const WIDE: bool>(
        self,
        corner: &[u32; LANES],
        change: Lanes3,
        other: Self,
        factor: f32,
    ) {
        let rows = rows_of::<WIDE>(change);
        for lane in 0..LANES {
            // SAFETY: the caller keeps the contract.
            unsafe {
                *self.at(corner[lane]) += rows[lane];
                *other.at(corner[lane]) += factor * rows[lane];
            }
        }
    }
}

/// Four columns of eight from eight rows of four.
#[inline(always)]
fn columns_of<const WIDE: bool>(rows: [Vec4; LANES]) -> [Lanes; 4] {
    #[cfg(target_arch = "x86_64")]
    if WIDE {
        // SAFETY: `WIDE` is for code that runs where AVX is.
        return unsafe { wide::columns_of(rows) };
    }
    let mut columns = [Lanes::default(); 4];
    for lane in 0..LANES {
        for column in 0..4 {
            columns[column].0[lane] = rows[lane][column];
        }
    }
    columns
}

/// Eight rows of four, the fourth 0, from three columns of eight.
#[inline(always)]
fn rows_of<const WIDE: bool>(columns: Lanes3) -> [Vec4; LANES] {
    #[cfg(target_arch = "x86_64")]
    if WIDE {
        // SAFETY: `WIDE` is for code that runs where AVX is.
        return unsafe { wide::rows_of(columns) };
    }
    let Lanes3 { x, y, z } = columns;
    std::array::from_fn(|lane| Vec4::new(x.0[lane], y.0[lane], z.0[lane], 0.0))
}

/// The two transposes in the shuffles of AVX; left to the compiler they are an insertion a number.
#[cfg(target_arch = "x86_64")]
mod wide {
    use super::{LANES, Lanes, Lanes3, Vec4};
    use std::arch::x86_64::*;

    #[inline]
    #[target_feature(enable = "avx")]
    pub fn columns_of(rows: [Vec4; LANES]) -> [Lanes; 4] {
        let r = rows.map(__m128::from);
        let a = _mm256_set_m128(r[4], r[0]);
        let b = _mm256_set_m128(r[5], r[1]);
        let c = _mm256_set_m128(r[6], r[2]);
        let d = _mm256_set_m128(r[7], r[3]);
        let (ab_low, ab_high) = (_mm256_unpacklo_ps(a, b), _mm256_unpackhi_ps(a, b));
        let (cd_low, cd_high) = (_mm256_unpacklo_ps(c, d), _mm256_unpackhi_ps(c, d));
        [
            lanes(_mm256_shuffle_ps::<0x44>(ab_low, cd_low)),
            lanes(_mm256_shuffle_ps::<0xEE>(ab_low, cd_low)),
            lanes(_mm256_shuffle_ps::<0x44>(ab_high, cd_high)),
            lanes(_mm256_shuffle_ps::<0xEE>(ab_high, cd_high)),
        ]
    }

    #[inline]
    #[target_feature(enable = "avx")]
    pub fn rows_of(columns: Lanes3) -> [Vec4; LANES] {
        let Lanes3 { x, y, z } = columns;
        let (x, y, z, zero) = (vector(x), vector(y), vector(z), _mm256_setzero_ps());
        let (xy_low, xy_high) = (_mm256_unpacklo_ps(x, y), _mm256_unpackhi_ps(x, y));
        let (z_low, z_high) = (_mm256_unpacklo_ps(z, zero), _mm256_unpackhi_ps(z, zero));
        let r = [
            _mm256_shuffle_ps::<0x44>(xy_low, z_low),
            _mm256_shuffle_ps::<0xEE>(xy_low, z_low),
            _mm256_shuffle_ps::<0x44>(xy_high, z_high),
            _mm256_shuffle_ps::<0xEE>(xy_high, z_high),
        ];
        // SAFETY: both are 32 f32.
        let [[a, e], [b, f], [c, g], [d, h]] =
            unsafe { std::mem::transmute::<[__m256; 4], [[Vec4; 2]; 4]>(r) };
        [a, b, c, d, e, f, g, h]
    }

    #[inline]
    #[target_feature(enable = "avx")]
    fn lanes(vector: __m256) -> Lanes {
        // SAFETY: both are eight f32.
        unsafe { std::mem::transmute::<__m256, Lanes>(vector) }
    }

    #[inline]
    #[target_feature(enable = "avx")]
    fn vector(lanes: Lanes) -> __m256 {
        // SAFETY: both are eight f32.
        unsafe { std::mem::transmute::<Lanes, __m256>(lanes) }
    }
}

/// Batches of constraints in rounds of parts that can be worked on at the same time.
#[derive(Clone, Debug, Default)]
pub struct Batches<B> {
    batches: Vec<B>,
    /// Where each part of each round ends in `batches`.
    rounds: Vec<Vec<usize>>,
    /// Particles the corners point into, spare places not counted.
    particle_count: usize,
}

impl<B: Send + Sync> Batches<B> {
    /// Splits the constraints of `particles` [m] into parts, and packs the constraints of a part,
    /// colour after colour.
    ///
    /// `pack` is given up to eight constraint numbers and their corners, unused lanes filled up.
    ///
    /// # Panics
    ///
    /// If a constraint names a particle beyond the last.
    pub fn new<const N: usize>(
        constraints: &[[u32; N]],
        particles: &[Vec3],
        pack: impl Fn(&[u32], Corners<N>) -> B,
    ) -> Self {
        let mut packed = Self {
            batches: Vec::new(),
            rounds: Vec::new(),
            particle_count: particles.len(),
        };
        for round in parts::rounds(constraints, particles) {
            let mut ends = Vec::with_capacity(round.len());
            for (part, members) in round.iter().enumerate() {
                let unused = (particles.len() + part * SPARE_A_PART) as u32;
                for color in color(constraints, members, particles.len()) {
                    for members in color.chunks(LANES) {
                        let mut corners = [[unused; LANES]; N];
                        for (lane, &constraint) in members.iter().enumerate() {
                            for corner in 0..N {
                                corners[corner][lane] = constraints[constraint as usize][corner];
                            }
                        }
                        packed.batches.push(pack(members, corners));
                    }
                }
                ends.push(packed.batches.len());
            }
            packed.rounds.push(ends);
        }
        packed
    }

    /// All batches, in the order in which one thread works on them.
    pub fn as_slice(&self) -> &[B] {
        &self.batches
    }

    /// All batches, to be changed one by one.
    pub fn as_mut_slice(&mut self) -> &mut [B] {
        &mut self.batches
    }

    /// Runs `f` over the batches of each part, round after round; the parts of a round run together.
    ///
    /// # Panics
    ///
    /// If `particles` is not as long as when the batches were made, and the spare places.
    pub fn for_each_part(
        &mut self,
        team: &Team,
        particles: &mut [Vec4],
        f: impl Fn(&mut [B], ParticleAccess) + Sync,
    ) {
        assert_eq!(
            particles.len(),
            self.particle_count + SPARE,
            "the particles the batches were made for"
        );
        let access = ParticleAccess::new(particles);
        let batches = SharedSlice::new(&mut self.batches);
        let mut first = 0;
        for ends in &self.rounds {
            team.run(ends.len(), |part| {
                let start = part.checked_sub(1).map_or(first, |before| ends[before]);
                // SAFETY: parts do not overlap, and each is run once.
                f(unsafe { batches.run(start, ends[part]) }, access);
            });
            first = ends.last().copied().unwrap_or(first);
        }
    }
}
