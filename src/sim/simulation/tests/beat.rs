//! Muscle that beats: what it settles at, that it goes on, and what it leaves alone.

use super::*;
use crate::sim::Beat;

/// A short bar.
const SIZE_M: Vec3 = Vec3::new(0.03, 0.06, 0.03);

const BEAT: Beat = Beat {
    rate_per_min: 70.0,
    strain: 0.12,
};

fn damped(fixed: impl Fn(Vec3) -> bool) -> BodySetup {
    BodySetup {
        damping_per_s: 10.0,
        ..body(SIZE_M, 0.01, fixed)
    }
}

/// A bar held at one end, of which the far half is muscle.
fn half_muscle() -> BodySetup {
    let mut setup = damped(|x| x.y < 1e-6);
    let is_muscle = |x: &Vec3| f32::from(u8::from(x.y > 0.5 * SIZE_M.y));
    setup.activity = setup.tets.particles.iter().map(is_muscle).collect();
    setup
}

/// `setup` after its muscle has been short by `shortening` for two seconds.
fn held(setup: BodySetup, params: SolverParams, shortening: f32) -> Simulation {
    let mut activity = setup.activity.clone();
    activity.resize(setup.tets.particles.len(), 1.0);
    let mut simulation = Simulation::new(setup, params);
    simulation.model.set_activity(&activity);
    simulation.model.shorten(shortening);
    for _ in 0..120 {
        simulation.step(&[]);
    }
    assert!(all_finite(&simulation) && simulation.report().inverted_tets == 0);
    simulation
}

/// Largest difference between the particles of a free body and those at rest `scale` times as large about its
/// middle, over its size.
fn worst_of_scaled(simulation: &Simulation, scale: f32) -> f32 {
    let rest = &simulation.setup().tets.particles;
    let mean = |x: &[Vec3]| x.iter().sum::<Vec3>() / x.len() as f32;
    let (from, to) = (mean(rest), mean(simulation.particles()));
    let errors = (rest.iter().zip(simulation.particles()))
        .map(|(r, x)| (*x - to).distance(scale * (*r - from)) / SIZE_M.y);
    errors.fold(0.0, f32::max)
}

#[test]
fn a_free_body_of_muscle_settles_at_the_scale_that_it_wants() {
    for method in Method::ALL {
        let simulation = held(damped(|_| false), soft(method), 0.12);
        // What two seconds have left of the swing: 2e-5 seen, and 1.6e-3 of springs, whose calm body falls
        // asleep within 1e-4 of its way.
        let error = worst_of_scaled(&simulation, 0.88);
        assert!(error < 3e-3, "{method:?}: {error}");
        let wrong = worst_of_scaled(&simulation, 0.87);
        assert!(
            wrong > 4e-3,
            "{method:?}: the check must be able to fail: {wrong}"
        );
    }
}

#[test]
fn muscle_pulls_what_is_none_alike_by_both_solvers_of_its_energy() {
    let many = SolverParams {
        substeps: 40,
        ..soft(Method::XpbdNeoHookean)
    };
    let xpbd = held(half_muscle(), many, 0.12);
    let exact = held(half_muscle(), soft(Method::Implicit), 0.12);
    let farthest = farthest_from_rest_m(&exact);
    let error = (xpbd.particles().iter().zip(exact.particles()))
        .map(|(a, b)| a.distance(*b))
        .fold(0.0, f32::max);
    // Both are in balance but for the last of the swing.
    assert!(error < 1e-3 * farthest, "{error} m of {farthest} m");
    // The stress between both halves is felt: the muscle alone would shorten by 0.12 of three centimetres.
    assert!((0.5 * 0.0036..0.0042).contains(&farthest), "{farthest} m");
}

#[test]
fn a_body_beats_on_and_ends_its_beat_when_it_is_told_to_rest() {
    for method in Method::ALL {
        let mut simulation = Simulation::new(half_muscle(), soft(method));
        simulation.set_beat(Some(BEAT));
        let mut far = Vec::new();
        for step in 1..=103 {
            simulation.step(&[]);
            far.push(farthest_from_rest_m(&simulation));
            assert!(!simulation.report().asleep);
            // A beat is 51.4 steps; it ends at 102.9.
            if step == 70 {
                simulation.set_beat(None);
            }
        }
        let most = |steps: &[f32]| steps.iter().copied().fold(0.0, f32::max);
        let (first, second) = (most(&far[..51]), most(&far[51..]));
        assert!(first > 1e-3, "{method:?}: {first} m");
        assert!(
            (second / first - 1.0).abs() < 0.05,
            "{method:?}: {first} and {second} m"
        );
        for _ in 0..200 {
            simulation.step(&[]);
        }
        assert!(simulation.report().asleep, "{method:?}");
        assert!(farthest_from_rest_m(&simulation) < 1e-4, "{method:?}");
    }
}

#[test]
fn muscle_that_does_not_shorten_changes_no_bit() {
    for method in Method::ALL {
        let run = |beat| {
            let mut setup = half_muscle();
            setup.gravity_m_s2 = DOWN;
            let mut simulation = Simulation::new(setup, soft(method));
            simulation.set_beat(beat);
            (0..10).for_each(|_| drop(simulation.step(&[])));
            simulation.particles().to_vec()
        };
        let still = Beat {
            strain: 0.0,
            ..BEAT
        };
        assert_eq!(run(None), run(Some(still)), "{method:?}");
        assert_ne!(
            run(None),
            run(Some(BEAT)),
            "{method:?}: the check must be able to fail"
        );
    }
}

#[test]
fn a_beat_is_the_same_after_a_reset_and_on_any_number_of_threads() {
    let mut setup = body(Vec3::splat(0.09), 0.007, |x| x.y < 1e-6);
    assert!(setup.tets.tets.len() >= SHARED_TETS_MIN);
    setup = setup.numbered_along();
    let mut simulation = Simulation::new(setup, soft(Method::XpbdNeoHookean));
    simulation.set_beat(Some(BEAT));
    let mut run = |threads| {
        simulation.reset();
        simulation.set_threads(Some(threads));
        (0..12).for_each(|_| drop(simulation.step(&[])));
        (
            simulation.particles().to_vec(),
            simulation.point_volumes().map(<[f32]>::to_vec),
        )
    };
    let first = run(1);
    assert_eq!(first, run(2));
    let shortest = first.1.expect("it beats").into_iter().fold(1.0, f32::min);
    // 12 steps are 0.23 beats.
    let scale = 1.0 - BEAT.shortening(12.0 / 60.0 * 70.0 / 60.0);
    assert!((shortest - scale.powi(3)).abs() < 1e-5, "{shortest}");
}

#[test]
fn volume_is_told_against_what_muscle_wants() {
    let simulation = {
        let mut simulation = Simulation::new(damped(|_| false), soft(Method::XpbdNeoHookean));
        // It stays short for longer than it takes to settle.
        simulation.set_beat(Some(Beat {
            rate_per_min: 5.0,
            ..BEAT
        }));
        (0..250).for_each(|_| drop(simulation.step(&[])));
        simulation
    };
    let tets = &simulation.setup().tets;
    let volume = |particles: &[Vec3]| diagnose::volume_and_inverted(particles, &tets.tets).0;
    let share = volume(simulation.particles()) / volume(&tets.particles);
    assert!((share - 0.88_f64.powi(3)).abs() < 2e-3, "{share}");
    let drift = simulation.report().volume_drift;
    assert!(drift.abs() < 2e-3, "{drift}");
}
