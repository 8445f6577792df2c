//! The constraints: value C(x) and gradient ∇C(x) as pure functions.
//!
//! The energy of a constraint is C²/2α with its compliance α; nothing here knows of bodies,
//! buffers or threads. The lane kernels of `springs` and `neo_hookean` compute the same formulas
//! eight at a time, and their tests compare them with these.
//!
//! Sources: Macklin, Müller, Chentanez, "XPBD: Position-Based Simulation of Compliant Constrained
//! Dynamics", MIG 2016; Smith, de Goes, Kim, "Stable Neo-Hookean Flesh Simulation", ACM TOG 37,
//! 2018 (the energy).

use super::Lame;
use glam::{DMat3, Vec3};

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

/// Energy density of stable neo-Hookean tissue [Pa], 0 at rest and in every rotation of it:
///
/// ψ = μ/2 (tr FᵀF − 3) − μ (J − 1) + (λ+μ)/2 (J − 1)²   with J = det F.
///
/// Smith, de Goes, Kim 2018, equation 14, with the constant that makes the energy of rest zero and
/// λ+μ for their λ, so that small strains see Lamé's moduli.
pub fn energy_density_pa(f: DMat3, lame: Lame) -> f64 {
    let (mu, lambda) = (f64::from(lame.mu_pa), f64::from(lame.lambda_pa));
    let dilation = f.determinant() - 1.0;
    let squared: f64 = f.to_cols_array().iter().map(|x| x * x).sum();
    0.5 * mu * (squared - 3.0) - mu * dilation + 0.5 * (lambda + mu) * dilation * dilation
}

/// First Piola-Kirchhoff stress P = ∂ψ/∂F [Pa] of [`energy_density_pa`]:
/// μ F + ((λ+μ)(J − 1) − μ) cof F. The constraint of `neo_hookean` is that the multipliers be it.
pub fn stress_pa(f: DMat3, lame: Lame) -> DMat3 {
    let (mu, lambda) = (f64::from(lame.mu_pa), f64::from(lame.lambda_pa));
    let cofactor = DMat3::from_cols(
        f.y_axis.cross(f.z_axis),
        f.z_axis.cross(f.x_axis),
        f.x_axis.cross(f.y_axis),
    );
    f * mu + cofactor * ((lambda + mu) * (f.determinant() - 1.0) - mu)
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
mod gradients;

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use proptest::prelude::*;

    const CORNERS: [Vec3; 4] = [
        Vec3::new(0.1, 0.0, -0.1),
        Vec3::new(1.1, 0.2, 0.0),
        Vec3::new(0.0, 0.9, 0.1),
        Vec3::new(0.1, -0.1, 1.2),
    ];
    const LAME: Lame = Lame {
        mu_pa: 3.0,
        lambda_pa: 20.0,
    };

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

    /// Largest difference between stress and central differences of the energy, over the stress.
    fn stress_error(f: DMat3, stress: impl Fn(DMat3) -> DMat3) -> f64 {
        const STEP: f64 = 1e-5;
        let exact = stress(f).to_cols_array();
        let mut worst = 0.0_f64;
        for entry in 0..9 {
            let moved = |by: f64| {
                let mut entries = f.to_cols_array();
                entries[entry] += by;
                energy_density_pa(DMat3::from_cols_array(&entries), LAME)
            };
            let slope = (moved(STEP) - moved(-STEP)) / (2.0 * STEP);
            worst = worst.max((slope - exact[entry]).abs());
        }
        worst
            / exact
                .iter()
                .fold(1.0, |largest: f64, x| largest.max(x.abs()))
    }

    // Central differences in f64: rounding 1e-16/1e-5 of an energy of some hundreds, and the third
    // derivative, some hundreds too, times 1e-10.
    const STRESS_TOLERANCE: f64 = 1e-6;

    #[test]
    fn stress_check_rejects_lame_moduli_in_the_wrong_place() {
        let f = DMat3::from_diagonal(DVec3::new(1.2, 0.9, 1.0));
        let swapped = Lame {
            mu_pa: LAME.lambda_pa,
            lambda_pa: LAME.mu_pa,
        };
        assert!(stress_error(f, |f| stress_pa(f, swapped)) > 0.1);
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

    proptest! {
        #[test]
        fn stress_matches_central_differences_of_the_energy(
            entries in proptest::array::uniform9(-2.0_f64..2.0),
        ) {
            let error = stress_error(DMat3::from_cols_array(&entries), |f| stress_pa(f, LAME));
            prop_assert!(error < STRESS_TOLERANCE, "{error}");
        }

        #[test]
        fn rest_has_no_energy_and_no_stress_in_any_rotation(
            axis in (-1.0_f64..1.0, -1.0_f64..1.0, -1.0_f64..1.0), angle in -3.0_f64..3.0,
        ) {
            let axis = DVec3::from(axis).try_normalize().unwrap_or(DVec3::X);
            let turn = DMat3::from_axis_angle(axis, angle);
            let stress = stress_pa(turn, LAME).to_cols_array();
            // Rounding of numbers up to μ + λ.
            prop_assert!(energy_density_pa(turn, LAME).abs() < 1e-13);
            prop_assert!(stress.iter().all(|x| x.abs() < 1e-13), "{stress:?}");
        }
    }

    #[test]
    fn small_strains_see_lame_moduli() {
        for size in [1e-6, 1e-4] {
            let strain =
                DMat3::from_cols_array(&[3.0, 1.0, 0.5, 1.0, -2.0, 0.2, 0.5, 0.2, 1.0]) * size;
            let trace = 2.0 * size;
            let expected = strain * (2.0 * f64::from(LAME.mu_pa))
                + DMat3::IDENTITY * (f64::from(LAME.lambda_pa) * trace);
            let error = stress_pa(DMat3::IDENTITY + strain, LAME) - expected;
            // The next order of the strain, with moduli of 20 and some nine terms.
            let bound = 1000.0 * size * size;
            assert!(
                error.to_cols_array().iter().all(|x| x.abs() < bound),
                "{error}"
            );
        }
    }
}
