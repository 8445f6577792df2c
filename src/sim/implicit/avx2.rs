//! Eight numbers in a register of AVX2.
//!
//! Values of [`Avx2`] may be made and used only in code that runs on a machine with AVX2: the
//! kernels see to that, each under one function with the feature enabled, into which all of this is
//! inlined. No fused multiply-add: the bits are those of `wide::Plain`.

use super::{
    matrix::Block,
    wide::{LANES, Lanes, Vector, Wide},
};
use glam::{DVec4, Vec4};
use std::{
    arch::x86_64::*,
    ops::{Add, Div, Mul, Neg, Sub},
};

#[derive(Clone, Copy)]
pub struct Avx2(__m256);

macro_rules! lanewise {
    ($op:ident, $fn:ident, $instruction:ident) => {
        impl $op for Avx2 {
            type Output = Self;
            #[inline(always)]
            fn $fn(self, other: Self) -> Self {
                // SAFETY: the machine has AVX2.
                Self(unsafe { $instruction(self.0, other.0) })
            }
        }
    };
}
lanewise!(Add, add, _mm256_add_ps);
lanewise!(Sub, sub, _mm256_sub_ps);
lanewise!(Mul, mul, _mm256_mul_ps);
lanewise!(Div, div, _mm256_div_ps);

impl Neg for Avx2 {
    type Output = Self;
    #[inline(always)]
    fn neg(self) -> Self {
        // SAFETY: the machine has AVX2.
        Self(unsafe { _mm256_xor_ps(self.0, _mm256_set1_ps(-0.0)) })
    }
}

impl Wide for Avx2 {
    #[inline(always)]
    fn splat(value: f32) -> Self {
        // SAFETY: the machine has AVX2.
        Self(unsafe { _mm256_set1_ps(value) })
    }

    #[inline(always)]
    fn load(lanes: &Lanes) -> Self {
        // SAFETY: the machine has AVX2; eight numbers, aligned to 32 bytes.
        Self(unsafe { _mm256_load_ps(lanes.0.as_ptr()) })
    }

    #[inline(always)]
    fn store(self) -> Lanes {
        let mut lanes = Lanes::default();
        // SAFETY: as in `load`.
        unsafe { _mm256_store_ps(lanes.0.as_mut_ptr(), self.0) };
        lanes
    }

    #[inline(always)]
    fn sqrt(self) -> Self {
        // SAFETY: the machine has AVX2.
        Self(unsafe { _mm256_sqrt_ps(self.0) })
    }

    #[inline(always)]
    fn min(self, other: Self) -> Self {
        // SAFETY: the machine has AVX2.
        Self(unsafe { _mm256_min_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn max(self, other: Self) -> Self {
        // SAFETY: the machine has AVX2.
        Self(unsafe { _mm256_max_ps(self.0, other.0) })
    }

    #[inline(always)]
    fn is_below(self, limit: Self) -> Self {
        // SAFETY: the machine has AVX2.
        Self(unsafe {
            let below = _mm256_cmp_ps::<_CMP_LT_OQ>(self.0, limit.0);
            _mm256_and_ps(below, _mm256_set1_ps(1.0))
        })
    }

    #[inline(always)]
    unsafe fn edge_changes(
        displacements: &[DVec4],
        corners: &[[u32; LANES]; 4],
    ) -> [Vector<Self>; 3] {
        let mut out = [Vector::splat(0.0); 3];
        for (end, out) in out.iter_mut().enumerate() {
            // SAFETY: the machine has AVX2; the caller answers for the corners.
            unsafe {
                let a = pair_of_changes(displacements, corners, end + 1, 0);
                let b = pair_of_changes(displacements, corners, end + 1, 1);
                let c = pair_of_changes(displacements, corners, end + 1, 2);
                let d = pair_of_changes(displacements, corners, end + 1, 3);
                let (low_ab, low_cd) = (_mm256_unpacklo_ps(a, b), _mm256_unpacklo_ps(c, d));
                let (high_ab, high_cd) = (_mm256_unpackhi_ps(a, b), _mm256_unpackhi_ps(c, d));
                out.x = Self(_mm256_shuffle_ps::<0x44>(low_ab, low_cd));
                out.y = Self(_mm256_shuffle_ps::<0xEE>(low_ab, low_cd));
                out.z = Self(_mm256_shuffle_ps::<0x44>(high_ab, high_cd));
            }
        }
        out
    }

    #[inline(always)]
    unsafe fn add_vector(vector: Vector<Self>, targets: *mut Vec4, index: &[u32; LANES]) {
        let pairs = pairs(vector);
        for lane in 0..LANES {
            // SAFETY: the machine has AVX2; the caller answers for the places, of 16 bytes each.
            unsafe {
                let change = if lane < 4 {
                    _mm256_castps256_ps128(pairs[lane])
                } else {
                    _mm256_extractf128_ps::<1>(pairs[lane - 4])
                };
                let place: *mut f32 = targets.add(index[lane] as usize).cast();
                _mm_store_ps(place, _mm_add_ps(_mm_load_ps(place), change));
            }
        }
    }

    #[inline(always)]
    unsafe fn add_block(columns: [Vector<Self>; 3], blocks: *mut Block, offsets: &[u32; LANES]) {
        let (x, y, z) = (pairs(columns[0]), pairs(columns[1]), pairs(columns[2]));
        for lane in 0..LANES {
            // SAFETY: the machine has AVX2; the caller answers for the offsets; a block is twelve
            // numbers, aligned to 16 bytes.
            unsafe {
                let (xy, last) = if lane < 4 {
                    let xy = _mm256_permute2f128_ps::<0x20>(x[lane], y[lane]);
                    (xy, _mm256_castps256_ps128(z[lane]))
                } else {
                    let xy = _mm256_permute2f128_ps::<0x31>(x[lane - 4], y[lane - 4]);
                    (xy, _mm256_extractf128_ps::<1>(z[lane - 4]))
                };
                let block: *mut f32 = blocks.byte_add(offsets[lane] as usize).cast();
                _mm256_storeu_ps(block, _mm256_add_ps(_mm256_loadu_ps(block), xy));
                let block = block.add(8);
                _mm_store_ps(block, _mm_add_ps(_mm_load_ps(block), last));
            }
        }
    }
}

/// Displacement of corner `end` less that of corner 0 in lanes `lane` and `lane` + 4.
///
/// # Safety
///
/// The machine has AVX2, and every corner is an index into `displacements`.
#[inline(always)]
unsafe fn pair_of_changes(
    displacements: &[DVec4],
    corners: &[[u32; LANES]; 4],
    end: usize,
    lane: usize,
) -> __m256 {
    // SAFETY: as the caller's; a displacement is four numbers.
    unsafe {
        let first: *const f64 = displacements.as_ptr().cast();
        let origin = _mm256_loadu_pd(first.add(4 * corners[0][lane] as usize));
        let place = _mm256_loadu_pd(first.add(4 * corners[end][lane] as usize));
        let low = _mm256_cvtpd_ps(_mm256_sub_pd(place, origin));
        let origin = _mm256_loadu_pd(first.add(4 * corners[0][lane + 4] as usize));
        let place = _mm256_loadu_pd(first.add(4 * corners[end][lane + 4] as usize));
        let high = _mm256_cvtpd_ps(_mm256_sub_pd(place, origin));
        _mm256_set_m128(high, low)
    }
}

/// The vectors of lanes 0 and 4, 1 and 5, 2 and 6, 3 and 7, each followed by a 0.
#[inline(always)]
fn pairs(vector: Vector<Avx2>) -> [__m256; 4] {
    let (x, y, z) = (vector.x.0, vector.y.0, vector.z.0);
    // SAFETY: the machine has AVX2.
    unsafe {
        let none = _mm256_setzero_ps();
        let xy_low = _mm256_castps_pd(_mm256_unpacklo_ps(x, y));
        let xy_high = _mm256_castps_pd(_mm256_unpackhi_ps(x, y));
        let z_low = _mm256_castps_pd(_mm256_unpacklo_ps(z, none));
        let z_high = _mm256_castps_pd(_mm256_unpackhi_ps(z, none));
        [
            _mm256_castpd_ps(_mm256_unpacklo_pd(xy_low, z_low)),
            _mm256_castpd_ps(_mm256_unpackhi_pd(xy_low, z_low)),
            _mm256_castpd_ps(_mm256_unpacklo_pd(xy_high, z_high)),
            _mm256_castpd_ps(_mm256_unpackhi_pd(xy_high, z_high)),
        ]
    }
}
