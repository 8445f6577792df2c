//! Eight numbers side by side, and how eight constraints reach their particles.
//!
//! The operators are plain loops over arrays, which the compiler turns into vector instructions;
//! no instruction is contracted or reordered, so the bits do not depend on the instruction set.

#![expect(
    clippy::needless_range_loop,
    reason = "one counter for several arrays of the same fixed length"
)]

use super::team::{SharedSlice, Team};
use glam::{Mat4, Vec4};
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

/// Corners of the eight constraints of a batch; a lane that is not used has `UNUSED` in all.
///
/// `UNUSED` is the last place of the particle array, which no constraint owns and nothing moves.
pub type Corners<const N: usize> = [[u32; LANES]; N];

/// Positions and inverse masses of one corner of eight constraints.
#[derive(Clone, Copy, Default)]
pub struct Corner {
    pub position: Lanes3,
    pub inverse_mass: Lanes,
}

/// The particles, for the batches of one colour to read and write at the same time.
///
/// Sound as long as no two batches that run together name the same particle and every index is
/// inside: [`Colored`] alone makes batches' corners and accesses, and sees to both.
#[derive(Clone, Copy)]
pub struct ParticleAccess {
    first: *mut Vec4,
}

// SAFETY: the batches of one colour touch disjoint particles (see `for_each_colored`).
unsafe impl Send for ParticleAccess {}
// SAFETY: as above.
unsafe impl Sync for ParticleAccess {}

impl ParticleAccess {
    /// Access for code that only gathers and runs alone.
    pub fn reading(particles: &mut [Vec4]) -> Self {
        Self {
            first: particles.as_mut_ptr(),
        }
    }

    /// Reads one corner of eight constraints.
    #[inline(always)]
    pub fn gather(self, corner: &[u32; LANES]) -> Corner {
        // SAFETY: indices were checked when the batches were made, and no other batch that runs now
        // writes these particles.
        let rows = corner.map(|index| unsafe { *self.first.add(index as usize) });
        let [x, y, z, inverse_mass] = columns_of(rows);
        Corner {
            position: Lanes3 { x, y, z },
            inverse_mass,
        }
    }

    /// Writes one corner of eight constraints back.
    #[inline(always)]
    pub fn scatter(self, corner: &[u32; LANES], value: Corner) {
        for lane in 0..LANES {
            let particle = Vec4::new(
                value.position.x.0[lane],
                value.position.y.0[lane],
                value.position.z.0[lane],
                value.inverse_mass.0[lane],
            );
            // SAFETY: as in `gather`. Unused lanes all write the value they read, one batch a
            // colour.
            unsafe { *self.first.add(corner[lane] as usize) = particle };
        }
    }
}

impl ParticleAccess {
    /// Adds `change` to one corner of eight constraints and `factor` times it to the same corner
    /// in `other`; the fourth numbers stay.
    #[inline(always)]
    pub fn add(self, corner: &[u32; LANES], change: Lanes3, other: Self, factor: f32) {
        let rows = rows_of(change);
        for lane in 0..LANES {
            let index = corner[lane] as usize;
            // SAFETY: as in `gather`.
            unsafe {
                *self.first.add(index) += rows[lane];
                *other.first.add(index) += factor * rows[lane];
            }
        }
    }
}

/// Four columns of eight from eight rows of four.
#[inline(always)]
fn columns_of(rows: [Vec4; LANES]) -> [Lanes; 4] {
    let low = transposed([rows[0], rows[1], rows[2], rows[3]]);
    let high = transposed([rows[4], rows[5], rows[6], rows[7]]);
    [
        joined(low[0], high[0]),
        joined(low[1], high[1]),
        joined(low[2], high[2]),
        joined(low[3], high[3]),
    ]
}

/// Eight rows of four, the fourth 0, from three columns of eight.
#[inline(always)]
fn rows_of(columns: Lanes3) -> [Vec4; LANES] {
    let [x, y, z] = [columns.x, columns.y, columns.z].map(halves);
    let low = transposed([x[0], y[0], z[0], Vec4::ZERO]);
    let high = transposed([x[1], y[1], z[1], Vec4::ZERO]);
    [
        low[0], low[1], low[2], low[3], high[0], high[1], high[2], high[3],
    ]
}

/// The transpose of a 4×4 matrix of rows: glam has it in the shuffles of the machine, where loops
/// over single numbers compile to one insertion each.
#[inline(always)]
fn transposed(rows: [Vec4; 4]) -> [Vec4; 4] {
    let matrix = Mat4::from_cols(rows[0], rows[1], rows[2], rows[3]).transpose();
    [matrix.x_axis, matrix.y_axis, matrix.z_axis, matrix.w_axis]
}

#[inline(always)]
fn joined(low: Vec4, high: Vec4) -> Lanes {
    let ([a, b, c, d], [e, f, g, h]) = (low.to_array(), high.to_array());
    Lanes([a, b, c, d, e, f, g, h])
}

#[inline(always)]
fn halves(lanes: Lanes) -> [Vec4; 2] {
    let [a, b, c, d, e, f, g, h] = lanes.0;
    [Vec4::new(a, b, c, d), Vec4::new(e, f, g, h)]
}

/// Batches of constraints sorted by colour.
#[derive(Clone, Debug, Default)]
pub struct Colored<B> {
    batches: Vec<B>,
    /// Where each colour ends in `batches`.
    ends: Vec<usize>,
    /// Particles the corners point into, the unused place not counted.
    particle_count: usize,
}

/// Batches a chunk: some microseconds, against the tenth of one that it costs to claim it.
const BATCHES_PER_CHUNK: usize = 12;

impl<B: Send + Sync> Colored<B> {
    /// Colours the constraints and packs each colour into batches.
    ///
    /// `pack` is given up to eight constraint numbers and their corners, unused lanes filled up.
    pub fn new<const N: usize>(
        constraints: &[[u32; N]],
        particle_count: usize,
        pack: impl Fn(&[u32], Corners<N>) -> B,
    ) -> Self {
        let unused = particle_count as u32;
        assert!(
            constraints.iter().flatten().all(|&i| i < unused),
            "every corner is a particle"
        );
        let mut colored = Self {
            batches: Vec::new(),
            ends: Vec::new(),
            particle_count,
        };
        for color in super::coloring::color(constraints, particle_count) {
            for members in color.chunks(LANES) {
                let mut corners = [[unused; LANES]; N];
                for (lane, &constraint) in members.iter().enumerate() {
                    for corner in 0..N {
                        corners[corner][lane] = constraints[constraint as usize][corner];
                    }
                }
                colored.batches.push(pack(members, corners));
            }
            colored.ends.push(colored.batches.len());
        }
        colored
    }

    /// All batches, colour after colour.
    pub fn batches(&self) -> &[B] {
        &self.batches
    }

    /// All batches, to be changed one by one.
    pub fn batches_mut(&mut self) -> &mut [B] {
        &mut self.batches
    }

    /// Runs `f` over runs of batches, colour after colour; the runs of one colour run together.
    ///
    /// # Panics
    ///
    /// If `particles` is not as long as when the batches were made, and the unused place.
    pub fn for_each_colored(
        &mut self,
        team: &Team,
        particles: &mut [Vec4],
        f: impl Fn(&mut [B], ParticleAccess) + Sync,
    ) {
        assert_eq!(
            particles.len(),
            self.particle_count + 1,
            "the particles the batches were made for"
        );
        let access = ParticleAccess {
            first: particles.as_mut_ptr(),
        };
        let batches = SharedSlice::new(&mut self.batches);
        let mut start = 0;
        for &end in &self.ends {
            team.run((end - start).div_ceil(BATCHES_PER_CHUNK), |chunk| {
                let from = start + chunk * BATCHES_PER_CHUNK;
                // SAFETY: chunks are told apart by their number, each is run once.
                let run = unsafe { batches.run(from, end.min(from + BATCHES_PER_CHUNK)) };
                f(run, access);
            });
            start = end;
        }
    }
}
