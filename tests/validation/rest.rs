//! Nothing moves what nothing pulls: a body at rest, and one that was turned and shifted.

use super::*;

const LENGTH_M: f64 = 0.04;

/// An irregular body, 4 × 3 × 3 cm, turned and shifted so that no coordinate is a round number.
fn crooked_body() -> BodySetup {
    let size_m = Vec3::new(0.04, 0.03, 0.03);
    let mut setup = block(size_m, [4, 3, 3], |_| false);
    shake_inside(&mut setup, size_m, 2e-3);
    let turn = Quat::from_scaled_axis(Vec3::new(0.4, -0.9, 0.3));
    placed(&setup, turn, Vec3::new(0.013, -0.027, 0.031))
}

/// Where `solver` has the body after so many steps in which it is kept awake, from `start`; and `start` as it was
/// taken.
fn kept_awake(solver: Solver, setup: &BodySetup, start: &[DVec3], steps: usize) -> [Vec<DVec3>; 2] {
    let Solver::Method(method) = solver else {
        panic!("the reference needs no step to stay where it is");
    };
    let params = SolverParams {
        method,
        ..SolverParams::default()
    };
    let mut simulation = simulation(setup, params);
    let start: Vec<Vec3> = start.iter().map(|x| x.as_vec3()).collect();
    simulation.set_state(&start, &vec![Vec3::ZERO; start.len()]);
    let before = positions(&simulation);
    for step in 0..steps {
        // A damping that multiplies by exactly 1; that it changes keeps the body from falling asleep.
        simulation.set_gravity_and_damping(setup.gravity_m_s2, 1e-20 * (step % 2) as f32);
        simulation.step(&[]);
        assert!(!simulation.report().asleep);
    }
    [positions(&simulation), before]
}

/// How far the body at rest moves in so many steps, over its length.
fn drift(solver: Solver, setup: &BodySetup, steps: usize) -> f64 {
    let [after, before] = kept_awake(solver, setup, &rest_of(setup), steps);
    farthest_m(&after, &before) / LENGTH_M
}

/// Largest change of the length of an edge in five seconds from `start`, over the length of the body.
fn change_of_shape(solver: Solver, setup: &BodySetup, start: &[DVec3]) -> f64 {
    let [after, before] = kept_awake(solver, setup, start, 300);
    let length = |x: &[DVec3], [a, b]: [u32; 2]| x[a as usize].distance(x[b as usize]);
    let changes = setup.tets.tets.iter().flat_map(|&[a, b, c, d]| {
        [[a, b], [a, c], [a, d], [b, c], [b, d], [c, d]]
            .map(|edge| (length(&after, edge) - length(&before, edge)).abs())
    });
    // `max` would pass over NaN.
    let largest = changes.fold(0.0, |worst, c| if c <= worst { worst } else { c });
    largest / LENGTH_M
}

/// The body at rest, turned and shifted after it was stretched along x.
fn turned(setup: &BodySetup, stretch: f64) -> Vec<DVec3> {
    let turn = DQuat::from_scaled_axis(DVec3::new(-1.2, 0.7, 1.9));
    rest_of(setup)
        .iter()
        .map(|x| turn * (DVec3::new(stretch, 1.0, 1.0) * *x) + DVec3::new(0.02, 0.01, -0.03))
        .collect()
}

#[test]
fn body_at_rest_without_gravity_stays_for_ten_thousand_steps() {
    let setup = crooked_body();
    let solvers = Solver::methods(|held| Some(held.rest));
    assert_all("rest", &solvers, |solver| drift(solver, &setup, 10_000));
}

#[test]
fn rest_check_notices_a_hundredth_of_gravity() {
    let mut setup = crooked_body();
    setup.gravity_m_s2 = Vec3::new(0.0, -0.1, 0.0);
    let moved = drift(DEFAULT, &setup, 10);
    assert!(moved > FAITHFUL.rest, "{moved}");
}

#[test]
fn body_turned_and_shifted_is_as_much_at_rest_as_before() {
    let setup = crooked_body();
    let fem = fem(&setup, Material::new(5e3, 0.45));
    let force = |x: &[DVec3]| {
        let forces = fem.elastic_forces_n(x);
        forces.iter().map(|f| f.length()).fold(0.0, f64::max)
    };
    let share = force(&turned(&setup, 1.0)) / force(&turned(&setup, 1.001));
    println!("rigid motion, Reference: {share:.1e} of the forces of a strain of 0.1 %");
    // Rounding of coordinates, 1e-17 m of cells of 1e-2 m, against a strain of 1e-3.
    assert!(share < 1e-10);
    let solvers = Solver::methods(|held| Some(held.rigid_motion));
    assert_all("rigid motion", &solvers, |solver| {
        change_of_shape(solver, &setup, &turned(&setup, 1.0))
    });
}

#[test]
fn rigid_motion_check_notices_a_strain_of_a_thousandth() {
    let setup = crooked_body();
    let moved = change_of_shape(DEFAULT, &setup, &turned(&setup, 1.001));
    assert!(moved > FAITHFUL.rigid_motion, "{moved}");
}
