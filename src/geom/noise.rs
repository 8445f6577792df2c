//! Noise over space from integer hashes: the same bits on every machine and every run.
//!
//! Only additions, multiplications and `floor` are used; there is no table and no state. Lengths
//! are in cells of the noise: the caller divides metres by the size of a cell.
//!
//! Sources: Perlin, "Improving Noise", SIGGRAPH 2002 (the fade curve and the twelve gradients);
//! Worley, "A Cellular Texture Basis Function", SIGGRAPH 1996.

use glam::Vec3;

/// The two nearest feature points of a cellular pattern.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cells {
    /// Distance to the nearest feature point [cells].
    pub nearest: f32,
    /// Distance to the second nearest [cells]; never below `nearest`.
    pub second: f32,
    /// A number in `[0, 1)` that is the same all over a cell.
    pub shade: f32,
}

/// Well mixed bits of a lattice point.
pub fn hash(cell: [i32; 3], seed: u32) -> u32 {
    let [x, y, z] = cell.map(|c| c as u32);
    mix(x.wrapping_mul(0x8da6_b343)
        ^ y.wrapping_mul(0xd816_3841)
        ^ z.wrapping_mul(0xcb1a_b31f)
        ^ seed.wrapping_mul(0x9e37_79b9))
}

/// A bijection of 32 bits in which each input bit moves about half of the output bits.
pub fn mix(mut h: u32) -> u32 {
    h ^= h >> 16;
    h = h.wrapping_mul(0x7feb_352d);
    h ^= h >> 15;
    h = h.wrapping_mul(0x846c_a68b);
    h ^ (h >> 16)
}

/// The top 24 bits of `h` as a number in `[0, 1)`; exact in f32.
pub fn unit(h: u32) -> f32 {
    (h >> 8) as f32 / (1 << 24) as f32
}

/// Smooth noise in about `[-1, 1]`, zero at every lattice point, with continuous second
/// derivatives.
pub fn gradient(p: Vec3, seed: u32) -> f32 {
    let (cell, f) = split(p);
    let fade = f * f * f * (f * (f * 6.0 - 15.0) + 10.0);
    let corner = |dx: i32, dy: i32, dz: i32| {
        let h = hash(
            [
                cell[0].wrapping_add(dx),
                cell[1].wrapping_add(dy),
                cell[2].wrapping_add(dz),
            ],
            seed,
        );
        slope(h, f - Vec3::new(dx as f32, dy as f32, dz as f32))
    };
    let along_x = |dy: i32, dz: i32| lerp(corner(0, dy, dz), corner(1, dy, dz), fade.x);
    let along_y = |dz: i32| lerp(along_x(0, dz), along_x(1, dz), fade.y);
    lerp(along_y(0), along_y(1), fade.z)
}

/// Sum of `octaves` noises, each of half the cell and half the height of the one before, scaled
/// to about `[-1, 1]`.
pub fn fractal(p: Vec3, octaves: u32, seed: u32) -> f32 {
    let (mut sum, mut weight, mut total, mut q) = (0.0, 1.0, 0.0, p);
    for octave in 0..octaves {
        sum += weight * gradient(q, seed.wrapping_add(octave));
        total += weight;
        weight *= 0.5;
        // Off the lattice of the octave before, whose zeros would coincide otherwise.
        q = q * 2.0 + Vec3::new(0.37, 0.71, 0.13);
    }
    if total > 0.0 { sum / total } else { 0.0 }
}

/// Distances to the feature points, one in each lattice cell.
pub fn cellular(p: Vec3, seed: u32) -> Cells {
    let (cell, f) = split(p);
    let mut found = Cells {
        nearest: f32::MAX,
        second: f32::MAX,
        shade: 0.0,
    };
    for dz in -1..=1 {
        for dy in -1..=1 {
            for dx in -1..=1 {
                let h = hash(
                    [
                        cell[0].wrapping_add(dx),
                        cell[1].wrapping_add(dy),
                        cell[2].wrapping_add(dz),
                    ],
                    seed,
                );
                let inside = Vec3::new(
                    unit(h),
                    unit(mix(h ^ 0x68bc_21eb)),
                    unit(mix(h ^ 0x02e5_be93)),
                );
                let feature = Vec3::new(dx as f32, dy as f32, dz as f32) + inside;
                let squared = feature.distance_squared(f);
                if squared < found.nearest {
                    found.second = found.nearest;
                    found.nearest = squared;
                    found.shade = unit(mix(h ^ 0x967a_889b));
                } else if squared < found.second {
                    found.second = squared;
                }
            }
        }
    }
    found.nearest = found.nearest.sqrt();
    found.second = found.second.sqrt();
    found
}

/// 0 below `low`, 1 above `high`, the cubic 3t² − 2t³ between.
pub fn smoothstep(low: f32, high: f32, x: f32) -> f32 {
    let t = ((x - low) / (high - low)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

/// `a` at `t = 0`, `b` at `t = 1`.
pub fn lerp(a: f32, b: f32, t: f32) -> f32 {
    a + (b - a) * t
}

/// The lattice cell of `p` and the place in it. By truncation, since `floor` is a call to the
/// maths library on processors without SSE4.1.
fn split(p: Vec3) -> ([i32; 3], Vec3) {
    let cell = p.to_array().map(|x| {
        let whole = x as i32;
        whole - i32::from(x < whole as f32)
    });
    (cell, p - Vec3::from(cell.map(|n| n as f32)))
}

/// Dot product of `offset` with one of the twelve edge directions of a cube, picked by `h`.
fn slope(h: u32, offset: Vec3) -> f32 {
    let Vec3 { x, y, z } = offset;
    match h % 12 {
        0 => x + y,
        1 => x - y,
        2 => -x + y,
        3 => -x - y,
        4 => x + z,
        5 => x - z,
        6 => -x + z,
        7 => -x - z,
        8 => y + z,
        9 => y - z,
        10 => -y + z,
        _ => -y - z,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn somewhere() -> impl Strategy<Value = Vec3> {
        (-50.0_f32..50.0, -50.0_f32..50.0, -50.0_f32..50.0).prop_map(|(x, y, z)| Vec3::new(x, y, z))
    }

    proptest! {
        #[test]
        fn gradient_noise_is_bounded_and_continuous(p in somewhere(), seed in 0_u32..9) {
            let here = gradient(p, seed);
            prop_assert!(here.abs() <= 1.1, "{here}");
            // The slope of this noise stays below 4 a cell; f32 adds 1e-4 of rounding at 50 cells.
            let near = gradient(p + Vec3::splat(1e-3), seed);
            prop_assert!((near - here).abs() < 4.0 * 1.8e-3 + 1e-4, "{here} {near}");
        }

        #[test]
        fn nearest_feature_point_is_never_farther_than_the_second(p in somewhere()) {
            let cells = cellular(p, 3);
            prop_assert!(cells.nearest <= cells.second);
            // A feature point of the own cell is at most a diagonal away.
            prop_assert!(cells.nearest <= 3.0_f32.sqrt());
            prop_assert!((0.0..1.0).contains(&cells.shade));
        }
    }

    #[test]
    fn gradient_noise_is_zero_at_lattice_points_and_not_between() {
        assert_eq!(gradient(Vec3::new(3.0, -2.0, 7.0), 1), 0.0);
        let between: f32 = (0..100)
            .map(|i| gradient(Vec3::new(i as f32 + 0.5, 0.4, 0.3), 1).abs())
            .sum();
        assert!(between > 10.0, "noise must vary, sum {between}");
    }

    #[test]
    fn noise_has_the_same_bits_as_when_it_was_written() {
        let p = Vec3::new(1.3, -2.7, 0.45);
        let bits = [
            hash([1, -2, 3], 4),
            gradient(p, 5).to_bits(),
            fractal(p, 4, 6).to_bits(),
            cellular(p, 7).second.to_bits(),
        ];
        assert_eq!(bits, NOISE_BITS);
    }

    /// Recorded on x86-64; any other value on any machine means bundled files cannot be remade.
    const NOISE_BITS: [u32; 4] = [1817541680, 3194116420, 1044361689, 1062140605];
}
