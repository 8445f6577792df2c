//! What must hold for any body and any method: momentum without outer forces, the same motion whatever the order
//! of particles and wherever the body lies, and the same bits on any number of threads.

#[path = "support/bodies.rs"]
mod bodies;

use bodies::*;
use glam::{DVec3, Quat, Vec3};
use palpate::sim::{BodySetup, Method, Simulation, SolverParams, diagnose};
use proptest::prelude::*;

fn params(method: Method) -> SolverParams {
    SolverParams {
        method,
        ..SolverParams::default()
    }
}

/// Root mean square distance of the lump's mass from its centre [m].
const GYRATION_RADIUS_M: f64 = 0.0183;

/// A free body of no symmetry, 4 × 3 × 3 cm.
fn lump_of_tissue() -> BodySetup {
    let size_m = Vec3::new(0.04, 0.03, 0.03);
    let mut setup = block(size_m, [4, 3, 3], |_| false);
    shake_inside(&mut setup, size_m, 2e-3);
    setup
}

/// What is lost of the momentum and of the spin of a body that flies, spins and trembles by `wobble` [m/s] for half a second, over
/// what it had.
fn momentum_lost(method: Method, fly: Vec3, spin: Vec3, wobble: f32, substeps: u32) -> (f64, f64) {
    let params = SolverParams {
        substeps,
        ..params(method)
    };
    let mut simulation = Simulation::new(lump_of_tissue(), params);
    let places = simulation.particles().to_vec();
    let velocities: Vec<Vec3> = (places.iter().enumerate())
        .map(|(i, x)| fly + spin.cross(*x - Vec3::new(0.02, 0.015, 0.015)) + wobble * scatter(i))
        .collect();
    simulation.set_state(&places, &velocities);
    let (linear, angular) = momenta(&simulation);
    run(&mut simulation, 30);
    let (linear_left, angular_left) = momenta(&simulation);
    (
        (linear_left - linear).length() / linear.length(),
        (angular_left - angular).length() / angular.length(),
    )
}

/// Momentum, and angular momentum about the centre of mass.
fn momenta(simulation: &Simulation) -> (DVec3, DVec3) {
    let masses = &simulation.setup().masses_kg;
    let mass: f64 = masses.iter().map(|&m| f64::from(m)).sum();
    let weighted = masses.iter().zip(simulation.particles());
    let centre: DVec3 = weighted
        .map(|(&m, x)| f64::from(m) * x.as_dvec3())
        .sum::<DVec3>()
        / mass;
    let linear = diagnose::momentum(simulation);
    let angular = diagnose::angular_momentum(simulation) - centre.cross(linear);
    (linear, angular)
}

/// So many random cases, without a file of those that failed.
fn cases(count: u32) -> ProptestConfig {
    ProptestConfig {
        cases: count,
        failure_persistence: None,
        ..ProptestConfig::default()
    }
}

proptest! {
    #![proptest_config(cases(8))]
    #[test]
    fn momentum_and_spin_are_kept_without_outer_forces(
        fly in prop::array::uniform3(0.1_f32..0.4), spin in prop::array::uniform3(1.0_f32..8.0),
    ) {
        let (fly, spin) = (Vec3::from(fly), Vec3::from(spin));
        for method in Method::ALL {
            let (linear, _) = momentum_lost(method, fly, spin, 0.05, 20);
            // About where it is: half a metre away, coordinates are rounded by as much as a spring moves them.
            let (_, angular) = momentum_lost(method, Vec3::splat(1e-3), spin, 0.0, 20);
            // Rounding of positions, 2e-9 m, becomes one of velocities of 2e-6 m/s in each of 600 substeps:
            // 1.3e-3 of 0.17 m/s measured, from what is one-sided in it.
            prop_assert!(linear < 3e-3, "{method:?} lost {linear} of its momentum");
            // Forces that act at the end of a substep take (hω)²/2 of the spin each time, and more of a body
            // that the spin stretches; mass-spring's act at its start.
            let turn = f64::from(spin.length()) / 1200.0;
            // What rounding takes is a speed and does not grow with the spin: 2e-4 m/s of xpbd-springs measured
            // from 0.3 to 3.5 rad/s.
            let rounding = 4e-4 / (GYRATION_RADIUS_M * f64::from(spin.length()));
            let limit = 2.0 * 600.0 * turn * turn / 2.0 + rounding;
            prop_assert!(angular < limit, "{method:?} lost {angular} of its spin, above {limit}");
        }
    }
}

#[test]
fn spin_is_lost_to_the_length_of_the_substep() {
    let (fly, spin) = (Vec3::splat(1e-3), Vec3::new(2.0, -5.0, 4.0));
    for method in Method::ALL {
        let lost = [20, 40].map(|substeps| momentum_lost(method, fly, spin, 0.0, substeps).1);
        println!("{method:?}: {lost:.5?} of the spin lost at 20 and 40 substeps");
        // Of first order or better, down to what rounding takes.
        assert!(lost[1] < 0.7 * lost[0] + 3e-4, "{method:?}: {lost:?}");
    }
}

#[test]
fn momentum_check_notices_a_thousandth_of_gravity() {
    let mut setup = lump_of_tissue();
    setup.gravity_m_s2 = Vec3::new(0.0, -0.0098, 0.0);
    let mut simulation = Simulation::new(setup, params(Method::XpbdNeoHookean));
    let places = simulation.particles().to_vec();
    simulation.set_state(&places, &vec![0.3 * Vec3::X; places.len()]);
    let before = momenta(&simulation).0;
    run(&mut simulation, 30);
    let lost = (momenta(&simulation).0 - before).length() / before.length();
    assert!(lost > 3e-3, "{lost}");
}

/// A bar that sags from its held end, of irregular cells, with some damping.
fn sagging_bar() -> BodySetup {
    let size_m = Vec3::new(0.08, 0.03, 0.03);
    let mut setup = block(size_m, [8, 3, 3], |x| x.x < 1e-6);
    shake_inside(&mut setup, size_m, 2e-3);
    setup.gravity_m_s2 = Vec3::new(0.0, -9.81, 0.0);
    setup.damping_per_s = 5.0;
    setup
}

fn after(setup: BodySetup, method: Method, frames: usize) -> Vec<DVec3> {
    let mut simulation = Simulation::new(setup, params(method));
    run(&mut simulation, frames);
    positions(&simulation)
}

/// 0, 1, 2 … `count` − 1 in another order.
fn shuffled(count: usize) -> Vec<usize> {
    // A stride that shares no factor with the count visits every number once.
    let stride = (count / 3..).find(|&s| gcd(s, count) == 1);
    let stride = stride.expect("there are primes");
    (0..count).map(|i| (i * stride + 5) % count).collect()
}

/// The same body with its particles and tetrahedra in another order, and the new number of each particle.
fn reordered(setup: &BodySetup) -> (BodySetup, Vec<usize>) {
    let place = shuffled(setup.tets.particles.len());
    let mut other = setup.clone();
    for (i, &to) in place.iter().enumerate() {
        other.tets.particles[to] = setup.tets.particles[i];
        other.masses_kg[to] = setup.masses_kg[i];
        other.fixed[to] = setup.fixed[i];
    }
    for (i, to) in shuffled(setup.tets.tets.len()).into_iter().enumerate() {
        other.tets.tets[to] = setup.tets.tets[i];
        other.fill[to] = setup.fill[i];
    }
    let corners = (other.tets.tets.iter_mut()).chain(&mut other.embedding.particles);
    for corner in corners.flatten() {
        *corner = place[*corner as usize] as u32;
    }
    (other, place)
}

fn gcd(a: usize, b: usize) -> usize {
    if b == 0 { a } else { gcd(b, a % b) }
}

/// Farthest that a particle of the bar in another order is from where it was, over the length of the bar.
fn order_difference(method: Method, frames: usize) -> f64 {
    let setup = sagging_bar();
    let (other, place) = reordered(&setup);
    let straight = after(setup, method, frames);
    let found = after(other, method, frames);
    let back: Vec<DVec3> = place.iter().map(|&to| found[to]).collect();
    farthest_m(&straight, &back) / 0.08
}

/// How far apart two orders of particles and tetrahedra may lead after half a second, over the length of the body.
/// They never give the same bits, since sums are rounded in the order of their terms.
fn order_limit(method: Method) -> f64 {
    match method {
        // Rounding alone, which a bar that is not damped carries on: 1e-4 measured.
        Method::MassSpring => 1e-3,
        // One sweep a substep is far from solved, and how far depends on the way it goes: 3e-3 measured.
        Method::XpbdSprings => 1e-2,
        // The same, but what one sweep leaves is found by the next: 6e-5 measured.
        Method::XpbdNeoHookean => 1e-3,
        // Newton's method stops at 1e-5 of the load, and where depends on the order: 7e-8 measured.
        Method::Implicit => 1e-4,
    }
}

#[test]
fn motion_does_not_depend_on_the_order_of_particles_and_tetrahedra() {
    for method in Method::ALL {
        let off = order_difference(method, 30);
        println!("{method:?}: {off:.1e} of the length in another order");
        assert!(off < order_limit(method), "{method:?}: {off}");
    }
}

#[test]
fn order_check_notices_one_particle_of_another_mass() {
    let setup = sagging_bar();
    let mut other = setup.clone();
    // At the free end.
    let last = other.masses_kg.len() - 1;
    other.masses_kg[last] *= 2.0;
    let method = Method::XpbdNeoHookean;
    let off = farthest_m(&after(setup, method, 30), &after(other, method, 30)) / 0.08;
    assert!(off > order_limit(method), "{off}");
}

/// Farthest that a particle of the turned and shifted bar is from the turned and shifted place of the other's,
/// over the length of the bar.
fn placement_difference(
    method: Method,
    turn: Quat,
    shift_m: Vec3,
    gravity_turn: Quat,
    frames: usize,
) -> f64 {
    let setup = sagging_bar();
    let mut other = placed(&setup, turn, shift_m);
    other.gravity_m_s2 = gravity_turn * setup.gravity_m_s2;
    let straight: Vec<DVec3> = after(setup, method, frames)
        .iter()
        .map(|x| turn.as_dquat() * *x + shift_m.as_dvec3())
        .collect();
    farthest_m(&straight, &after(other, method, frames)) / 0.08
}

proptest! {
    #![proptest_config(cases(4))]
    #[test]
    fn motion_does_not_depend_on_where_and_how_the_body_lies(
        axis in prop::array::uniform3(-1.0_f32..1.0), angle in -3.0_f32..3.0,
        shift in prop::array::uniform3(-0.1_f32..0.1),
    ) {
        let turn = Quat::from_axis_angle(Vec3::from(axis).normalize_or(Vec3::X), angle);
        for method in Method::ALL {
            let off = placement_difference(method, turn, Vec3::from(shift), turn, 30);
            // Coordinates at rest are rounded anew, and rounding is carried on: 7.5e-4 measured for mass-spring,
            // 3e-4 for the others.
            prop_assert!(off < 3e-3, "{method:?}: {off}");
        }
    }
}

#[test]
fn placement_check_notices_gravity_turned_by_two_degrees_less() {
    let turn = Quat::from_axis_angle(Vec3::new(0.6, 0.8, 0.0), 1.0);
    let less = Quat::from_axis_angle(Vec3::new(0.6, 0.8, 0.0), 1.0 - 0.035);
    let off = placement_difference(Method::XpbdNeoHookean, turn, Vec3::ZERO, less, 30);
    assert!(off > 3e-3, "{off}");
}

#[test]
fn motion_has_the_same_bits_on_one_two_and_three_threads() {
    // Ten thousand tetrahedra: colours of some hundred batches are shared out.
    let size_m = Vec3::new(0.1, 0.05, 0.05);
    for method in Method::ALL {
        let run_on = |threads: usize| {
            let mut setup = block(size_m, [20, 10, 10], |x| x.x < 1e-6);
            setup.gravity_m_s2 = Vec3::new(0.0, -9.81, 0.0);
            let mut simulation = Simulation::new(setup, params(method));
            simulation.set_threads(Some(threads));
            run(&mut simulation, 5);
            let bits = |x: &Vec3| x.to_array().map(f32::to_bits);
            simulation.particles().iter().map(bits).collect::<Vec<_>>()
        };
        let one = run_on(1);
        assert!(one == run_on(2), "{method:?}: two threads differ from one");
        assert!(
            one == run_on(3),
            "{method:?}: three threads differ from one"
        );
    }
}
