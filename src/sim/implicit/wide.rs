//! Eight numbers side by side, as the kernels of the tetrahedra compute with them.
//!
//! There are two kinds, plain arrays and the registers of AVX2. Both do the same arithmetic in the
//! same order, one rounding an operation, so the bits are the same. (Plain arrays alone would do if
//! the compiler turned code of this length into vector instructions; it does so in parts only.)

#![expect(
    clippy::needless_range_loop,
    reason = "one counter for several arrays of the same fixed length"
)]

use super::matrix::Block;
use glam::{DVec4, Vec4};
use std::ops::{Add, Div, Mul, Neg, Sub};

/// Tetrahedra a batch.
pub const LANES: usize = 8;

/// One number for each tetrahedron of a batch, as it is stored.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
#[repr(C, align(32))]
pub struct Lanes(pub [f32; LANES]);

/// Eight numbers to compute with.
pub trait Wide:
    Copy
    + Add<Output = Self>
    + Sub<Output = Self>
    + Mul<Output = Self>
    + Div<Output = Self>
    + Neg<Output = Self>
{
    fn splat(value: f32) -> Self;

    fn load(lanes: &Lanes) -> Self;

    fn store(self) -> Lanes;

    fn sqrt(self) -> Self;

    /// The smaller of the two; `other` if one is no number.
    fn min(self, other: Self) -> Self;

    /// The larger of the two; `other` if one is no number.
    fn max(self, other: Self) -> Self;

    /// 1 where this is below `limit`, else 0.
    fn is_below(self, limit: Self) -> Self;

    /// Displacements of corners 1 to 3 of eight tetrahedra less that of corner 0, taken in f64.
    ///
    /// # Safety
    ///
    /// Every corner is an index into `displacements`.
    unsafe fn edge_changes(
        displacements: &[DVec4],
        corners: &[[u32; LANES]; 4],
    ) -> [Vector<Self>; 3];

    /// Adds the vector of each lane to `targets[index]`, one lane after the other.
    ///
    /// # Safety
    ///
    /// `targets` is valid for every index, and nobody else reads or writes those places now.
    unsafe fn add_vector(vector: Vector<Self>, targets: *mut Vec4, index: &[u32; LANES]);

    /// Adds the block of each lane, given by its columns, to the block `offsets` bytes from
    /// `blocks`, one lane after the other.
    ///
    /// # Safety
    ///
    /// There is a block at each of those offsets, and nobody else reads or writes them now.
    unsafe fn add_block(columns: [Vector<Self>; 3], blocks: *mut Block, offsets: &[u32; LANES]);
}

/// One vector for each tetrahedron of a batch.
#[derive(Clone, Copy)]
pub struct Vector<W> {
    pub x: W,
    pub y: W,
    pub z: W,
}

impl<W: Wide> Vector<W> {
    #[inline(always)]
    pub fn splat(value: f32) -> Self {
        Self {
            x: W::splat(value),
            y: W::splat(value),
            z: W::splat(value),
        }
    }

    #[inline(always)]
    pub fn load([x, y, z]: &[Lanes; 3]) -> Self {
        Self {
            x: W::load(x),
            y: W::load(y),
            z: W::load(z),
        }
    }

    #[inline(always)]
    pub fn dot(self, other: Self) -> W {
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

    #[inline(always)]
    pub fn times(self, factor: W) -> Self {
        Self {
            x: self.x * factor,
            y: self.y * factor,
            z: self.z * factor,
        }
    }
}

impl<W: Wide> Add for Vector<W> {
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

impl<W: Wide> Sub for Vector<W> {
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

impl<W: Wide> Neg for Vector<W> {
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

/// For any machine.
#[derive(Clone, Copy)]
pub struct Plain([f32; LANES]);

macro_rules! lanewise {
    ($op:ident, $fn:ident, $sign:tt) => {
        impl $op for Plain {
            type Output = Self;
            #[inline(always)]
            fn $fn(self, other: Self) -> Self {
                Self(std::array::from_fn(|lane| self.0[lane] $sign other.0[lane]))
            }
        }
    };
}
lanewise!(Add, add, +);
lanewise!(Sub, sub, -);
lanewise!(Mul, mul, *);
lanewise!(Div, div, /);

impl Neg for Plain {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        Self(self.0.map(|value| -value))
    }
}

impl Wide for Plain {
    #[inline(always)]
    fn splat(value: f32) -> Self {
        Self([value; LANES])
    }

    #[inline(always)]
    fn load(lanes: &Lanes) -> Self {
        Self(lanes.0)
    }

    #[inline(always)]
    fn store(self) -> Lanes {
        Lanes(self.0)
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        Self(self.0.map(f32::sqrt))
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        let pick = |a: f32, b: f32| if a < b { a } else { b };
        Self(std::array::from_fn(|lane| {
            pick(self.0[lane], other.0[lane])
        }))
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        let pick = |a: f32, b: f32| if a > b { a } else { b };
        Self(std::array::from_fn(|lane| {
            pick(self.0[lane], other.0[lane])
        }))
    }

    #[inline(always)]
    fn is_below(self, limit: Self) -> Self {
        let below = |lane| f32::from(u8::from(self.0[lane] < limit.0[lane]));
        Self(std::array::from_fn(below))
    }

    #[inline(always)]
    unsafe fn edge_changes(
        displacements: &[DVec4],
        corners: &[[u32; LANES]; 4],
    ) -> [Vector<Self>; 3] {
        let at = |corner: usize, lane: usize| {
            // SAFETY: the caller answers for the corners.
            unsafe { *displacements.get_unchecked(corners[corner][lane] as usize) }
        };
        [1, 2, 3].map(|end| {
            let changes: [Vec4; LANES] =
                std::array::from_fn(|lane| (at(end, lane) - at(0, lane)).as_vec4());
            Vector {
                x: Self(changes.map(|change| change.x)),
                y: Self(changes.map(|change| change.y)),
                z: Self(changes.map(|change| change.z)),
            }
        })
    }

    #[inline(always)]
    unsafe fn add_vector(vector: Vector<Self>, targets: *mut Vec4, index: &[u32; LANES]) {
        let Vector { x, y, z } = vector;
        for lane in 0..LANES {
            // SAFETY: the caller answers for the places.
            unsafe {
                *targets.add(index[lane] as usize) +=
                    Vec4::new(x.0[lane], y.0[lane], z.0[lane], 0.0);
            }
        }
    }

    #[inline(always)]
    unsafe fn add_block(columns: [Vector<Self>; 3], blocks: *mut Block, offsets: &[u32; LANES]) {
        for lane in 0..LANES {
            // SAFETY: the caller answers for the offsets.
            let block = unsafe { &mut *blocks.byte_add(offsets[lane] as usize) };
            for (sum, Vector { x, y, z }) in block.iter_mut().zip(columns) {
                *sum += Vec4::new(x.0[lane], y.0[lane], z.0[lane], 0.0);
            }
        }
    }
}
