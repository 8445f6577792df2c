//! The constraints: value C(x) and gradient ∇C(x) as pure functions.
//!
//! The energy of a constraint is C²/2α with its compliance α; nothing here knows of bodies,
//! buffers or threads. The lane kernels of `springs` and `neo_hookean` compute the same formulas
//! eight at a time, and their tests compare them with these.
//!
//! Sources: Macklin, Müller, Chentanez, "XPBD: Position-Based Simulation of Compliant Constrained
//! Dynamics", MIG 2016; Smith, de Goes, Kim, "Stable Neo-Hookean Flesh Simulation", ACM TOG 37,
//! 2018 (the energy). Its split into two constraints is derived at [`shape`].

use glam::{Mat3, Vec3};

/// C(x) and ∂C/∂xᵢ for the `N` particles of one constraint.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Linearized<const N: usize> {
    /// Constraint value, in the unit of the constraint.
    pub value: f32,
    /// One gradient a particle.
    pub gradient: [Vec3; N],
}

/// Edges shorter than this have no direction [m].
pub const LENGTH_MIN_M: f32 = 1e-9;
/// Below this C² of [`shape`] is rounding and has no direction.
pub const SHAPE_SQUARED_MIN: f32 = 1e-12;

/// Edge length minus its rest length [m]. `None` if the two particles coincide.
pub fn distance(x: [Vec3; 2], rest_length_m: f32) -> Option<Linearized<2>> {
    let edge = x[0] - x[1];
    let length = edge.length();
    if length < LENGTH_MIN_M {
        return None;
    }
    let direction = edge / length;
    Some(Linearized {
        value: length - rest_length_m,
        gradient: [direction, -direction],
    })
}

/// Signed tetrahedron volume minus its rest volume [m³]. The gradients carry the same 1/6.
pub fn volume(x: [Vec3; 4], rest_volume_m3: f32) -> Linearized<4> {
    let [a, b, c] = edges(x);
    let gradients = [b.cross(c) / 6.0, c.cross(a) / 6.0, a.cross(b) / 6.0];
    Linearized {
        value: a.dot(b.cross(c)) / 6.0 - rest_volume_m3,
        gradient: with_first(gradients),
    }
}

/// Relative change of volume, J − 1 with J = det F.
///
/// `rest_inverse` is the inverse of the matrix whose columns are the edges from corner 0 at rest.
pub fn dilation(x: [Vec3; 4], rest_inverse: Mat3) -> Linearized<4> {
    let [a, b, c] = edges(x);
    let scale = rest_inverse.determinant();
    Linearized {
        value: scale * a.dot(b.cross(c)) - 1.0,
        gradient: with_first([b.cross(c), c.cross(a), a.cross(b)].map(|g| scale * g)),
    }
}

/// Change of shape, √(tr FᵀF + J² − 4J): 0 at rest and in every rotation of it, √2·‖ε‖ for a small
/// strain ε. `None` where it is 0 to within rounding and has no direction.
///
/// Stable neo-Hookean tissue has the energy density
/// ψ = μ/2 (tr FᵀF − 3) − μ (J − 1) + (λ+μ)/2 (J − 1)², with its rest at F = 1. Moved together
/// differently that is
///
/// ψ = μ/2 (tr FᵀF + J² − 4J) + λ/2 (J − 1)²,
///
/// two terms of which neither is ever negative and both are 0 at rest (the first by
/// tr FᵀF ≥ 3 J^⅔). So each is half the square of a constraint, and a body at rest is at rest for
/// both. The usual pair √(tr FᵀF) and J − 1 − μ/λ has the same sum, but its two forces only cancel.
///
/// With S = FᵀF − 1, whose entries are small at rest, the root is 2(J−1)² − II(S) − III(S), of
/// second order without cancellation; single precision needs that for strains below 10⁻³.
pub fn shape(x: [Vec3; 4], rest_inverse: Mat3) -> Option<Linearized<4>> {
    let [a, b, c] = edges(x);
    let f = Mat3::from_cols(a, b, c) * rest_inverse;
    let j = f.determinant();
    let squared = shape_squared(f, j);
    if squared < SHAPE_SQUARED_MIN {
        return None;
    }
    let value = squared.sqrt();
    // ∂C/∂F = (F + (J − 2) cof F) / C, and ∂F/∂xₖ picks row k of the rest inverse.
    let cofactor = Mat3::from_cols(
        f.y_axis.cross(f.z_axis),
        f.z_axis.cross(f.x_axis),
        f.x_axis.cross(f.y_axis),
    );
    let stress = (f + (j - 2.0) * cofactor) * (1.0 / value);
    let rows = rest_inverse.transpose();
    Some(Linearized {
        value,
        gradient: with_first([rows.x_axis, rows.y_axis, rows.z_axis].map(|row| stress * row)),
    })
}

/// C² of [`shape`], not below 0.
fn shape_squared(f: Mat3, j: f32) -> f32 {
    let c = f.transpose() * f;
    let trace = c.x_axis.x + c.y_axis.y + c.z_axis.z;
    // The invariants of S lose more than they save once S is large.
    let squared = if trace < 4.0 {
        let s = c - Mat3::IDENTITY;
        let (xx, yy, zz) = (s.x_axis.x, s.y_axis.y, s.z_axis.z);
        let (xy, yz, zx) = (s.x_axis.y, s.y_axis.z, s.z_axis.x);
        let second = xx * yy + yy * zz + zz * xx - xy * xy - yz * yz - zx * zx;
        2.0 * (j - 1.0) * (j - 1.0) - second - s.determinant()
    } else {
        trace + j * j - 4.0 * j
    };
    squared.max(0.0)
}

/// Edges from corner 0.
fn edges(x: [Vec3; 4]) -> [Vec3; 3] {
    [x[1] - x[0], x[2] - x[0], x[3] - x[0]]
}

/// Gradients of all four corners from those of corners 1 to 3: a shift of all changes nothing.
fn with_first([g1, g2, g3]: [Vec3; 3]) -> [Vec3; 4] {
    [-(g1 + g2 + g3), g1, g2, g3]
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Quat;
    use proptest::prelude::*;

    const CORNERS: [Vec3; 4] = [
        Vec3::new(0.1, 0.0, -0.1),
        Vec3::new(1.1, 0.2, 0.0),
        Vec3::new(0.0, 0.9, 0.1),
        Vec3::new(0.1, -0.1, 1.2),
    ];
    const REST: [Vec3; 4] = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];

    fn rest_inverse(rest: [Vec3; 4]) -> Mat3 {
        let [a, b, c] = edges(rest);
        Mat3::from_cols(a, b, c).inverse()
    }

    /// Largest difference between gradient and central differences, relative to the gradient.
    fn gradient_error<const N: usize>(x: [Vec3; N], c: impl Fn([Vec3; N]) -> Linearized<N>) -> f32 {
        const STEP: f32 = 2e-3;
        let exact = c(x).gradient;
        let mut worst = 0.0_f32;
        for particle in 0..N {
            for axis in 0..3 {
                let (mut ahead, mut behind) = (x, x);
                ahead[particle][axis] += STEP;
                behind[particle][axis] -= STEP;
                let slope = (c(ahead).value - c(behind).value) / (2.0 * STEP);
                worst = worst.max((slope - exact[particle][axis]).abs());
            }
        }
        worst / exact.iter().map(|g| g.length()).fold(0.0, f32::max)
    }

    // Central differences in f32: rounding 1e-7/2e-3 and the third derivative times 4e-6 are both
    // below 1e-4; the rest is room.
    const TOLERANCE: f32 = 1e-3;

    #[test]
    fn distance_gradient_matches_central_differences() {
        let error = gradient_error([CORNERS[0], CORNERS[1]], |x| {
            distance(x, 0.8).expect("the particles are apart")
        });
        assert!(error < TOLERANCE, "relative gradient error {error}");
    }

    #[test]
    fn volume_gradient_matches_central_differences() {
        let error = gradient_error(CORNERS, |x| volume(x, 0.1));
        assert!(error < TOLERANCE, "relative gradient error {error}");
    }

    #[test]
    fn dilation_gradient_matches_central_differences() {
        let inverse = rest_inverse(REST);
        let error = gradient_error(CORNERS, |x| dilation(x, inverse));
        assert!(error < TOLERANCE, "relative gradient error {error}");
    }

    #[test]
    fn shape_gradient_matches_central_differences_near_rest_far_from_it_and_inverted() {
        let inverse = rest_inverse(REST);
        for (name, scale) in [
            ("near", Vec3::ONE),
            ("stretched", Vec3::new(3.0, 1.0, 0.5)),
            ("inverted", Vec3::new(1.0, -1.0, 1.0)),
            ("flat", Vec3::new(1.0, 0.0, 1.0)),
        ] {
            let error = gradient_error(CORNERS.map(|x| x * scale), |x| {
                shape(x, inverse).expect("the tetrahedron is deformed")
            });
            assert!(error < TOLERANCE, "{name}: relative gradient error {error}");
        }
    }

    #[test]
    fn gradient_check_rejects_a_gradient_six_times_too_large() {
        let error = gradient_error(CORNERS, |x| {
            let mut c = volume(x, 0.1);
            c.gradient = c.gradient.map(|g| 6.0 * g);
            c
        });
        assert!(error > 0.5, "the check must be able to fail, got {error}");
    }

    #[test]
    fn coincident_particles_have_no_distance_gradient() {
        assert_eq!(distance([Vec3::ONE, Vec3::ONE], 0.5), None);
    }

    #[test]
    fn collapsed_tetrahedron_has_no_shape_direction() {
        assert_eq!(shape([Vec3::ONE; 4], rest_inverse(REST)), None);
    }

    /// Stable neo-Hookean energy density as it is published, in f64.
    fn published_density(x: [Vec3; 4], inverse: Mat3, mu: f64, lambda: f64) -> f64 {
        let [a, b, c] = edges(x);
        let f = glam::Mat3::from_cols(a, b, c).as_dmat3() * inverse.as_dmat3();
        let j = f.determinant();
        let c = f.transpose() * f;
        let trace = c.x_axis.x + c.y_axis.y + c.z_axis.z;
        mu / 2.0 * (trace - 3.0) - mu * (j - 1.0) + (lambda + mu) / 2.0 * (j - 1.0).powi(2)
    }

    proptest! {
        #[test]
        fn shape_and_dilation_add_up_to_the_stable_neo_hookean_energy(
            moves in proptest::array::uniform12(-0.8_f32..0.8),
        ) {
            let (mu, lambda) = (3.0, 20.0);
            let inverse = rest_inverse(REST);
            let x = std::array::from_fn(|k| {
                REST[k] + Vec3::new(moves[3 * k], moves[3 * k + 1], moves[3 * k + 2])
            });
            let c_shape = f64::from(shape(x, inverse).map_or(0.0, |c| c.value));
            let c_dilation = f64::from(dilation(x, inverse).value);
            let split = mu / 2.0 * c_shape.powi(2) + lambda / 2.0 * c_dilation.powi(2);
            let published = published_density(x, inverse, mu, lambda);
            // f32 against f64 on values up to about 300.
            prop_assert!((split - published).abs() < 1e-4 * (1.0 + published), "{split} {published}");
        }

        #[test]
        fn shape_is_zero_in_every_rotation_of_rest(
            axis in (-1.0_f32..1.0, -1.0_f32..1.0, -1.0_f32..1.0), angle in -3.0_f32..3.0,
        ) {
            let axis = Vec3::from(axis).try_normalize().unwrap_or(Vec3::X);
            let turn = Quat::from_axis_angle(axis, angle);
            let x = CORNERS.map(|corner| turn * corner + Vec3::new(0.3, -0.2, 0.1));
            let value = shape(x, rest_inverse(CORNERS)).map_or(0.0, |c| c.value);
            // A strain of a few rounding errors of the coordinates, 6e-8 each.
            prop_assert!(value < 2e-6, "{value}");
        }
    }

    #[test]
    fn small_shear_gives_root_two_times_the_strain() {
        let inverse = rest_inverse(REST);
        for shear in [1e-5_f32, 1e-4, 1e-3, 1e-2] {
            let x = REST.map(|corner| corner + Vec3::X * shear * corner.y);
            let value = shape(x, inverse)
                .expect("the shear is above rounding")
                .value;
            // ε has the two entries shear/2, so √2·‖ε‖ is the shear itself. Higher terms are of
            // the order of its square; rounding of S is 1e-7 absolute.
            let error = (value - shear).abs();
            assert!(error < shear * shear + 3e-7, "shear {shear} gives {value}");
        }
    }
}
