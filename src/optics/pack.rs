//! A direction in 32 bits: the octahedron unfolded on a square of 16 bits a side.
//!
//! Twin of `shaders/pack.wgsl`. Source: Cigolla et al., "A Survey of Efficient Representations for Independent Unit
//! Vectors", JCGT 2014.

use glam::{Vec2, Vec3};

/// The bits of a direction of any length above 0.
pub fn octahedral(direction: Vec3) -> u32 {
    let sum = direction.abs().element_sum();
    let mut p = Vec2::new(direction.x, direction.y) / sum.max(1e-20);
    if direction.z < 0.0 {
        let side = |x: f32| if x >= 0.0 { 1.0 } else { -1.0 };
        p = Vec2::new((1.0 - p.y.abs()) * side(p.x), (1.0 - p.x.abs()) * side(p.y));
    }
    let bits = |x: f32| u32::from((32767.0 * x.clamp(-1.0, 1.0)).round() as i16 as u16);
    bits(p.x) | bits(p.y) << 16
}

/// The unit direction of `bits`.
pub fn from_octahedral(bits: u32) -> Vec3 {
    let value = |half: u32| (f32::from(half as u16 as i16) / 32767.0).max(-1.0);
    let p = Vec2::new(value(bits & 0xffff), value(bits >> 16));
    let z = 1.0 - p.x.abs() - p.y.abs();
    let fold = (-z).max(0.0);
    let inward = |x: f32| if x >= 0.0 { x - fold } else { x + fold };
    Vec3::new(inward(p.x), inward(p.y), z).normalize_or(Vec3::Z)
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn a_packed_direction_comes_back_within_a_hundredth_of_a_degree(
            d in prop::array::uniform3(-1.0f32..1.0)
        ) {
            let direction = Vec3::from(d);
            prop_assume!(direction.length() > 1e-3);
            let back = from_octahedral(octahedral(direction));
            let angle = back.cross(direction.normalize()).length().asin().to_degrees();
            prop_assert!(angle < 0.01, "{direction} came back as {back}");
            prop_assert!(back.dot(direction) > 0.0);
        }
    }

    #[test]
    fn the_axes_survive() {
        for axis in [
            Vec3::X,
            Vec3::Y,
            Vec3::Z,
            Vec3::NEG_X,
            Vec3::NEG_Y,
            Vec3::NEG_Z,
        ] {
            assert!(
                (from_octahedral(octahedral(axis)) - axis).length() < 1e-4,
                "{axis}"
            );
        }
    }
}
