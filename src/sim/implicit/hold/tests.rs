//! Forces are slopes of energies, and the stiffness is that of a parabola that is nowhere below.

use super::*;
use proptest::prelude::*;

const COUNT: usize = 3;

/// A place between three free nodes and a held one.
fn place() -> Place {
    Place {
        carriers: vec![(0, 0.5), (1, 0.3), (2, -0.1), (3, 0.3)],
    }
}

fn barrier(force_n: f64, gap_m: f64) -> Hold {
    Hold {
        place: place(),
        barrier: Some(Barrier {
            normal: DVec3::new(0.6, 0.0, 0.8),
            gap_m,
            force_n,
            stiffness: 300.0,
            slopes: Vec::new(),
        }),
        pull: None,
        friction: 0.0,
    }
}

fn pull(force_n: DVec3, force_max_n: f64) -> Hold {
    Hold {
        place: place(),
        barrier: None,
        pull: Some(Pull {
            across: DMat3::IDENTITY,
            anchor_m: DVec3::new(1e-3, -2e-3, 5e-4),
            force_n,
            stiffness: 120.0,
            force_max_n,
        }),
        friction: 0.0,
    }
}

/// A tool with friction, which holds across its normal.
fn rubbing(force_n: f64, gap_m: f64) -> Hold {
    let mut hold = barrier(force_n, gap_m);
    let normal = DVec3::new(0.6, 0.0, 0.8);
    let mut held = pull(0.1 * DVec3::Y, 0.3 * force_n).pull;
    held.as_mut().expect("it pulls").across = DMat3::IDENTITY - outer(normal, normal);
    hold.pull = held;
    hold
}

fn displaced(way_m: [f64; 12]) -> Vec<DVec4> {
    way_m
        .chunks(3)
        .map(|x| DVec4::new(x[0], x[1], x[2], 0.0))
        .collect()
}

fn energy_j(hold: &Hold, at: &[DVec4]) -> f64 {
    hold.add_forces(at, &mut [Vec4::ZERO; COUNT])
}

/// Largest difference between the forces and minus the slope of the energy [N], and largest force [N].
fn gradient_error(hold: &Hold, at: &[DVec4]) -> (f64, f64) {
    const STEP_M: f64 = 1e-8;
    let mut forces = [Vec4::ZERO; COUNT];
    hold.add_forces(at, &mut forces);
    let (mut worst, mut largest) = (0.0_f64, 0.0_f64);
    for (node, axis) in (0..3 * COUNT).map(|k| (k / 3, k % 3)) {
        let mut moved = at.to_vec();
        moved[node][axis] += STEP_M;
        let above = energy_j(hold, &moved);
        moved[node][axis] -= 2.0 * STEP_M;
        let slope = (above - energy_j(hold, &moved)) / (2.0 * STEP_M);
        let force = f64::from(forces[node][axis]);
        worst = worst.max((force + slope).abs());
        largest = largest.max(force.abs());
    }
    (worst, largest)
}

/// How far the energy at `to` is above the parabola from `at` with the hold's stiffness [J].
fn above_parabola_j(hold: &Hold, at: &[DVec4], to: &[DVec4]) -> f64 {
    let mut matrix = BlockMatrix::new(COUNT, [(0, 1), (0, 2), (1, 2)]);
    hold.add_stiffness(at, &mut matrix);
    matrix.mirror_upper();
    let way: Vec<Vec4> = (0..COUNT).map(|i| (to[i] - at[i]).as_vec4()).collect();
    let mut forces = [Vec4::ZERO; COUNT];
    let start = hold.add_forces(at, &mut forces);
    let parabola: f64 = (0..COUNT)
        .map(|row| {
            let product = matrix.product(matrix.row(row), &way);
            f64::from(way[row].dot(0.5 * product - forces[row]))
        })
        .sum();
    energy_j(hold, to) - start - parabola
}

proptest! {
    #[test]
    fn forces_are_slopes_of_the_energy(
        way_m in prop::array::uniform12(-5e-3..5e-3),
        force_n in 0.0..1.0,
        gap_m in -2e-3..2e-3,
    ) {
        let at = displaced(way_m);
        let holds = [
            barrier(force_n, gap_m),
            pull(DVec3::ZERO, 0.4),
            pull(force_n * DVec3::X, f64::INFINITY),
            rubbing(force_n + 0.01, gap_m),
        ];
        for hold in holds {
            let (error, largest) = gradient_error(&hold, &at);
            // Where a place begins to touch or to slip, the second derivative jumps: by 300 N/m times
            // the step. Rounding of single precision elsewhere.
            prop_assert!(error < 1e-5 * largest + 3e-6, "{error} N of {largest} N");
        }
    }

    #[test]
    fn energy_is_below_the_parabola_that_newton_takes_for_it(
        from_m in prop::array::uniform12(-5e-3..5e-3),
        to_m in prop::array::uniform12(-5e-3..5e-3),
        force_n in 0.0..1.0,
        force_max_n in 0.01..1.0,
    ) {
        let (at, mut to) = (displaced(from_m), displaced(to_m));
        to[COUNT..].copy_from_slice(&at[COUNT..]); // Held.
        let pulling = pull(force_n * DVec3::X, force_max_n);
        // A barrier that pushes where it starts: one that does not has no stiffness yet.
        let pushing = barrier(force_n + 5.0, 0.0);
        for hold in [pulling, pushing] {
            // Energies of 1e-2 J in sums of single precision.
            prop_assert!(above_parabola_j(&hold, &at, &to) < 1e-8);
        }
    }
}

#[test]
fn check_of_the_slopes_sees_a_force_without_an_energy() {
    let at = displaced([1e-3; 12]);
    let mut hold = rubbing(0.5, 0.0);
    // A pull of which the multiplier is not across, as if friction could push.
    hold.pull.as_mut().expect("it pulls").force_n = DVec3::new(0.02, 0.0, 0.0);
    let (error, largest) = gradient_error(&hold, &at);
    assert!(error > 1e-3 * largest, "{error} N of {largest} N");
}

#[test]
fn pull_grows_to_its_largest_and_no_further() {
    let pull = pull(DVec3::ZERO, 0.4);
    for way_m in [1e-3, 2e-3, 0.1, 10.0] {
        let at = displaced([way_m; 12]);
        let force_n = pull.force_n(&at).length();
        let spring_n = 120.0 * (DVec3::splat(way_m) - DVec3::new(1e-3, -2e-3, 5e-4)).length();
        // Rounding.
        assert!((force_n - spring_n.min(0.4)).abs() < 1e-9, "{force_n} N");
    }
}

#[test]
fn multiplier_of_a_barrier_becomes_the_force_that_closes_the_gap() {
    // A place on a spring of 80 N/m, pushed 1 mm by a tool: each round ends where both balance.
    let spring = 80.0;
    let mut hold = barrier(0.0, -1e-3);
    let normal = DVec3::new(0.6, 0.0, 0.8);
    let mut along_m = 0.0;
    let at = |along_m: f64| {
        let mut all = displaced([0.0; 12]);
        all.fill((along_m * normal).extend(0.0));
        all
    };
    for _ in 0..12 {
        let barrier = hold.barrier.as_ref().expect("it pushes");
        along_m =
            (barrier.force_n - barrier.stiffness * barrier.gap_m) / (spring + barrier.stiffness);
        hold.update_multipliers(&at(along_m));
    }
    // Each round leaves 80/380 of the gap.
    assert!((along_m - 1e-3).abs() < 1e-10, "{along_m} m");
    assert!((hold.force_n(&at(along_m)).length() - spring * 1e-3).abs() < 1e-7);
}

#[test]
fn stiffness_that_the_matrix_has_no_place_for_is_laid_on_the_diagonal() {
    let hold = barrier(5.0, 0.0);
    let at = displaced([0.0; 12]);
    let stiffness = |pairs: &[(u32, u32)], x: &[Vec4]| -> f32 {
        let mut matrix = BlockMatrix::new(COUNT, pairs.iter().copied());
        hold.add_stiffness(&at, &mut matrix);
        matrix.mirror_upper();
        (0..COUNT)
            .map(|row| x[row].dot(matrix.product(matrix.row(row), x)))
            .sum()
    };
    for k in 0..20 {
        let x: Vec<Vec4> = (0..COUNT)
            .map(|i| {
                let phase = (k * COUNT + i) as f32;
                Vec4::new(phase.sin(), (2.0 * phase).cos(), (3.0 * phase).sin(), 0.0)
            })
            .collect();
        let whole = stiffness(&[(0, 1), (0, 2), (1, 2)], &x);
        let lumped = stiffness(&[(0, 1)], &x);
        // Rounding of stiffnesses of 300 N/m.
        assert!(lumped > whole - 1e-3, "{lumped} below {whole}");
    }
}
