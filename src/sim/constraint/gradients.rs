//! Every constraint on random tetrahedra: its value against its definition in f64, its gradient
//! against central differences of that.

use super::*;
use glam::{DQuat, DVec3};
use proptest::prelude::*;

/// A definition: the value of a constraint at f64 corners, given the rest corners.
type Definition<const N: usize> = fn([DVec3; N], [DVec3; N]) -> f64;
/// The constraint under test, given the rest corners.
type Constraint<const N: usize> = fn([Vec3; N], [Vec3; N]) -> Option<Linearized<N>>;

fn length(x: [DVec3; 2], rest: [DVec3; 2]) -> f64 {
    x[0].distance(x[1]) - rest[0].distance(rest[1])
}

fn six_volumes(x: [DVec3; 4]) -> f64 {
    (x[1] - x[0]).dot((x[2] - x[0]).cross(x[3] - x[0]))
}

fn volume_change(x: [DVec3; 4], rest: [DVec3; 4]) -> f64 {
    (six_volumes(x) - six_volumes(rest)) / 6.0
}

const DISTANCE: (Constraint<2>, Definition<2>) = (
    |x, rest| {
        let rest_length_m = rest[0].as_dvec3().distance(rest[1].as_dvec3());
        distance(x, rest_length_m as f32)
    },
    length,
);
const VOLUME: (Constraint<4>, Definition<4>) = (
    |x, rest| {
        let rest_volume_m3 = six_volumes(rest.map(|x| x.as_dvec3())) / 6.0;
        Some(volume(x, rest_volume_m3 as f32))
    },
    volume_change,
);
/// Largest difference of the gradient from central differences of the definition, over the largest
/// gradient; `None` where the constraint has no direction.
fn gradient_error<const N: usize>(
    (constraint, definition): (Constraint<N>, Definition<N>),
    x: [Vec3; N],
    rest: [Vec3; N],
) -> Option<f64> {
    // Of edges of about 1: 1e-10 from the third derivative, 1e-11 from rounding.
    const STEP: f64 = 1e-5;
    let found = constraint(x, rest)?.gradient;
    let (x, rest) = (x.map(|x| x.as_dvec3()), rest.map(|x| x.as_dvec3()));
    let (mut worst, mut largest) = (0.0_f64, 0.0_f64);
    for particle in 0..N {
        for axis in 0..3 {
            let (mut ahead, mut behind) = (x, x);
            ahead[particle][axis] += STEP;
            behind[particle][axis] -= STEP;
            let slope = (definition(ahead, rest) - definition(behind, rest)) / (2.0 * STEP);
            worst = worst.max((slope - f64::from(found[particle][axis])).abs());
            largest = largest.max(slope.abs());
        }
    }
    Some(worst / largest)
}

/// Single precision: gradients are of order 1 and sum a few products of coordinates of up to 2,
/// each rounded by 6e-8; shares of the gradient of a tetrahedron nearly flat are more.
const TOLERANCE: f64 = 1e-5;

/// Corners of a tetrahedron of edges of about 1 that is not flat, anywhere within 1 of the origin.
fn rest_corners() -> impl Strategy<Value = [Vec3; 4]> {
    let moves = prop::array::uniform12(-0.25_f32..0.25);
    let axis = prop::array::uniform3(-1.0_f64..1.0);
    (moves, axis, -3.0_f64..3.0).prop_map(|(moves, axis, angle)| {
        let turn = DQuat::from_axis_angle(DVec3::from_array(axis).normalize_or(DVec3::X), angle);
        std::array::from_fn(|k| {
            let corner = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z][k];
            let moved = Vec3::from_slice(&moves[3 * k..]).as_dvec3();
            (turn * (corner + moved)).as_vec3()
        })
    })
}

/// Where corners are moved to: up to 0.8 each, so that some tetrahedra are flat or inverted.
fn moves() -> impl Strategy<Value = [f32; 12]> {
    prop::array::uniform12(-0.8_f32..0.8)
}

fn moved(rest: [Vec3; 4], moves: [f32; 12]) -> [Vec3; 4] {
    std::array::from_fn(|k| rest[k] + Vec3::from_slice(&moves[3 * k..]))
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(1000))]
    #[test]
    fn gradients_of_all_constraints_are_the_slopes_of_their_definitions(
        rest in rest_corners(), moves in moves(),
    ) {
        let x = moved(rest, moves);
        let (edge, rest_edge) = ([x[0], x[1]], [rest[0], rest[1]]);
        if edge[0].distance(edge[1]) > 0.05 {
            let error = gradient_error(DISTANCE, edge, rest_edge).expect("the ends are apart");
            prop_assert!(error < TOLERANCE, "distance: {error}");
        }
        let error = gradient_error(VOLUME, x, rest).expect("a volume has a gradient");
        prop_assert!(error < TOLERANCE, "volume: {error}");
    }

    #[test]
    fn gradients_of_a_constraint_add_up_to_nothing(rest in rest_corners(), moves in moves()) {
        let x = moved(rest, moves);
        let edge = DISTANCE.0([x[0], x[1]], [rest[0], rest[1]]).map(|c| c.gradient.to_vec());
        let tet = VOLUME.0(x, rest).map(|c| c.gradient.to_vec());
        for gradient in edge.into_iter().chain(tet) {
            let sum: Vec3 = gradient.iter().sum();
            let largest = gradient.iter().map(|g| g.length()).fold(0.0, f32::max);
            // A shift of all corners changes nothing; the sum itself rounds.
            prop_assert!(sum.length() <= 1e-6 * largest, "{sum} of {largest}");
        }
    }
}

/// The same tetrahedron for the checks of the check.
const REST: [Vec3; 4] = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
const MOVED: [Vec3; 4] = [
    Vec3::new(0.1, 0.0, -0.1),
    Vec3::new(1.3, 0.2, 0.0),
    Vec3::new(0.0, 0.9, 0.1),
    Vec3::new(0.1, -0.1, 1.2),
];

#[test]
fn gradient_check_rejects_another_definition() {
    let six_times: Definition<4> = |x, rest| 6.0 * volume_change(x, rest);
    let error = gradient_error((VOLUME.0, six_times), MOVED, REST).expect("it has a gradient");
    // Six times too small.
    assert!((error - 5.0 / 6.0).abs() < 0.01, "{error}");
}

#[test]
fn gradient_check_rejects_a_length_that_is_a_per_mille_off() {
    let off: Definition<2> = |x, rest| 1.001 * x[0].distance(x[1]) - rest[0].distance(rest[1]);
    let ends = ([MOVED[0], MOVED[1]], [REST[0], REST[1]]);
    let error = gradient_error((DISTANCE.0, off), ends.0, ends.1).expect("the ends are apart");
    assert!(error > 5.0 * TOLERANCE, "{error}");
}
