//! Bodies whose answer is known by formula, solved by the reference and by every method.
//!
//! Each case is a function from who solves it to how far off he is; `HELD_TO` says how far that may be. Each has
//! a check that it notices: five per cent of the modulus, or what else would be wrong. `docs/TESTING.md` lists
//! the cases.

#[path = "support/bodies.rs"]
mod bodies;
#[path = "support/closed_form.rs"]
mod closed_form;

use bodies::*;
use closed_form::*;
use glam::{DMat3, DVec3, Quat, Vec3};
use palpate::reference::{Fem, Material, State, Swing};
use palpate::sim::{BodySetup, Method, Simulation, SolverParams};

/// How far off a method may be, case by case; `None` where its model has no such answer.
struct HeldTo {
    method: Method,
    /// Motion of a body that nothing moves, over its length.
    rest: f64,
    /// The same of a body that was turned and shifted.
    rigid_motion: f64,
    /// Distance of inner particles from where the affine map puts them, over how far that moved the body.
    patch: Option<f64>,
    /// Relative error of a hanging bar's lengthening.
    bar: f64,
    /// Relative error of a cantilever's sag, extrapolated from two meshes.
    cantilever: Option<f64>,
    /// Relative error of the lowest frequency of a bar.
    frequency: f64,
    /// Error of the lateral stretch of a pulled bar, over 1 less it.
    stretch: Option<f64>,
}

/// A method is added by a line here.
const HELD_TO: &[HeldTo] = &[
    HeldTo {
        method: Method::MassSpring,
        rest: 1e-6,
        rigid_motion: 1e-6,
        patch: None,
        bar: 0.25,
        cantilever: None,
        frequency: 0.15,
        stretch: None,
    },
    HeldTo {
        method: Method::XpbdSprings,
        rest: 1e-6,
        rigid_motion: 1e-6,
        patch: None,
        bar: 0.25,
        cantilever: None,
        frequency: 0.15,
        stretch: None,
    },
    HeldTo {
        method: Method::XpbdNeoHookean,
        rest: 1e-6,
        rigid_motion: 1e-6,
        patch: Some(1e-3),
        bar: 0.02,
        cantilever: Some(0.03),
        frequency: 0.01,
        stretch: Some(0.01),
    },
];

/// Who solves a case.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Solver {
    /// `palpate::reference`.
    Reference,
    Method(Method),
}

/// Young's modulus and Poisson's ratio.
#[derive(Clone, Copy, Debug)]
struct Tissue {
    youngs_modulus_pa: f64,
    poisson_ratio: f64,
}

impl Tissue {
    fn material(self) -> Material {
        Material::new(self.youngs_modulus_pa, self.poisson_ratio)
    }

    /// Parameters fine enough that the model is looked at, and not the price of too few substeps.
    fn params(self, method: Method) -> SolverParams {
        SolverParams {
            method,
            substeps: 60,
            youngs_modulus_pa: self.youngs_modulus_pa as f32,
            poisson_ratio: self.poisson_ratio as f32,
            ..SolverParams::default()
        }
    }
}

impl Solver {
    /// The reference, and every method for which `held_to` has a limit, with that limit.
    fn all(reference: f64, held_to: impl Fn(&HeldTo) -> Option<f64>) -> Vec<(Self, f64)> {
        let methods = HELD_TO
            .iter()
            .filter_map(|held| held_to(held).map(|limit| (Self::Method(held.method), limit)));
        std::iter::once((Self::Reference, reference))
            .chain(methods)
            .collect()
    }

    /// Poisson's ratio 0, or the smallest that the model has: springs along edges have 1/4.
    fn smallest_poisson_ratio(self) -> f64 {
        match self {
            Self::Method(Method::MassSpring | Method::XpbdSprings) => 0.25,
            _ => 0.0,
        }
    }

    /// Positions at which `setup` comes to rest [m], its held particles where `held` has them.
    fn settle(
        self,
        setup: &BodySetup,
        tissue: Tissue,
        held: &[DVec3],
        frames: usize,
    ) -> Vec<DVec3> {
        match self {
            Self::Reference => {
                let mut fem = fem(setup, tissue.material());
                hold(&mut fem, setup, held);
                fem.statics().expect("the body settles").positions
            }
            Self::Method(method) => {
                let mut simulation = Simulation::new(setup.clone(), tissue.params(method));
                let places: Vec<Vec3> = held.iter().map(|x| x.as_vec3()).collect();
                simulation.hold_at(&places);
                simulation.set_state(&places, &vec![Vec3::ZERO; places.len()]);
                run(&mut simulation, frames);
                positions(&simulation)
            }
        }
    }
}

fn hold(fem: &mut Fem, setup: &BodySetup, held: &[DVec3]) {
    for (i, x) in held.iter().enumerate().filter(|(i, _)| setup.fixed[*i]) {
        fem.hold(i, *x);
    }
}

fn rest_of(setup: &BodySetup) -> Vec<DVec3> {
    setup.tets.particles.iter().map(|x| x.as_dvec3()).collect()
}

/// Prints and asserts the error of every solver; all of them are seen before the first fails.
fn assert_all(case: &str, solvers: &[(Solver, f64)], error: impl Fn(Solver) -> f64) {
    let errors: Vec<f64> = solvers.iter().map(|(solver, _)| error(*solver)).collect();
    for ((solver, limit), error) in solvers.iter().zip(&errors) {
        println!("{case}, {solver:?}: {error:.2e} (at most {limit:.0e})");
    }
    for ((solver, limit), error) in solvers.iter().zip(&errors) {
        // NaN is not below.
        assert!(
            error < limit,
            "{case}, {solver:?}: {error} is not below {limit}"
        );
    }
}

const DEFAULT: Solver = Solver::Method(Method::XpbdNeoHookean);

// ---------------------------------------------------------------------------------------------- rest

/// An irregular body, 4 × 3 × 3 cm, turned and shifted so that no coordinate is a round number.
fn crooked_body() -> BodySetup {
    let size_m = Vec3::new(0.04, 0.03, 0.03);
    let mut setup = block(size_m, [4, 3, 3], |_| false);
    shake_inside(&mut setup, size_m, 2e-3);
    placed(
        &setup,
        Quat::from_scaled_axis(Vec3::new(0.4, -0.9, 0.3)),
        Vec3::new(0.013, -0.027, 0.031),
    )
}

/// How far `method` moves the body from `start` in so many steps that it is kept awake, over its length.
fn drift(method: Method, setup: &BodySetup, start: &[DVec3], steps: usize) -> f64 {
    let mut simulation = Simulation::new(
        setup.clone(),
        SolverParams {
            method,
            ..SolverParams::default()
        },
    );
    let start: Vec<Vec3> = start.iter().map(|x| x.as_vec3()).collect();
    simulation.set_state(&start, &vec![Vec3::ZERO; start.len()]);
    let before = positions(&simulation);
    for step in 0..steps {
        // Damping that multiplies by exactly 1; a change of it keeps the body from falling asleep.
        simulation.set_gravity_and_damping(setup.gravity_m_s2, 1e-20 * (step % 2) as f32);
        simulation.step(&[]);
        assert!(!simulation.report().asleep);
    }
    farthest_m(&positions(&simulation), &before) / 0.04
}

#[test]
fn body_at_rest_without_gravity_stays_for_ten_thousand_steps() {
    let setup = crooked_body();
    for held in HELD_TO {
        let moved = drift(held.method, &setup, &rest_of(&setup), 10_000);
        println!("rest, {:?}: {moved:.2e} of its length", held.method);
        assert!(moved <= held.rest, "{:?}: {moved}", held.method);
    }
}

#[test]
fn rest_check_sees_a_hundred_millionth_of_gravity() {
    let mut setup = crooked_body();
    setup.gravity_m_s2 = Vec3::new(0.0, -1e-7, 0.0);
    let moved = drift(Method::XpbdNeoHookean, &setup, &rest_of(&setup), 10_000);
    assert!(moved > 1e-6, "{moved}");
}

// --------------------------------------------------------------------------------------- rigid motion

fn turned(setup: &BodySetup, stretch: f64) -> Vec<DVec3> {
    let turn = Quat::from_scaled_axis(Vec3::new(-1.2, 0.7, 1.9)).as_dquat();
    rest_of(setup)
        .iter()
        .map(|x| turn * (DVec3::new(stretch, 1.0, 1.0) * *x) + DVec3::new(0.02, 0.01, -0.03))
        .collect()
}

#[test]
fn body_turned_and_shifted_is_as_much_at_rest_as_before() {
    let setup = crooked_body();
    let fem = fem(&setup, Material::new(5e3, 0.45));
    let force = |x: &[DVec3]| {
        fem.elastic_forces_n(x)
            .iter()
            .map(|f| f.length())
            .fold(0.0, f64::max)
    };
    let (still, strained) = (force(&turned(&setup, 1.0)), force(&turned(&setup, 1.001)));
    println!(
        "rigid motion, Reference: {:.1e} of the forces of 0.1 % strain",
        still / strained
    );
    assert!(still < 1e-10 * strained);
    for held in HELD_TO {
        let moved = drift(held.method, &setup, &turned(&setup, 1.0), 300);
        println!("rigid motion, {:?}: {moved:.2e} of its length", held.method);
        assert!(moved <= held.rigid_motion, "{:?}: {moved}", held.method);
    }
}

#[test]
fn rigid_motion_check_sees_a_strain_of_a_hundred_thousandth() {
    let setup = crooked_body();
    let moved = drift(
        Method::XpbdNeoHookean,
        &setup,
        &turned(&setup, 1.00001),
        300,
    );
    assert!(moved > 1e-6, "{moved}");
}

// --------------------------------------------------------------------------------------- affine patch

/// Error of the patch test, with the tissue of one half as stiff as `half` of the other's.
fn patch_error(solver: Solver, half: f32) -> f64 {
    let size_m = Vec3::splat(0.04);
    let skin = |x: Vec3| x.min_element() < 1e-6 || (size_m - x).min_element() < 1e-6;
    let mut setup = block(size_m, [4, 4, 4], skin);
    shake_inside(&mut setup, size_m, 2e-3);
    setup.damping_per_s = 10.0;
    for (fill, tet) in setup.fill.iter_mut().zip(&setup.tets.tets) {
        if setup.tets.particles[tet[0] as usize].x > 0.02 {
            *fill = half;
        }
    }
    // Stretched by a fifth, sheared, turned.
    let map = DMat3::from_cols(
        DVec3::new(1.2, 0.1, 0.0),
        DVec3::new(-0.05, 0.9, 0.1),
        DVec3::new(0.1, -0.15, 1.05),
    );
    let exact: Vec<DVec3> = rest_of(&setup).iter().map(|x| map * *x).collect();
    let moved = farthest_m(&exact, &rest_of(&setup));
    // Inner particles start off their place; held ones are there.
    let start: Vec<DVec3> = (exact.iter().enumerate())
        .map(|(i, x)| {
            *x + if setup.fixed[i] {
                DVec3::ZERO
            } else {
                1e-3 * scatter(i).as_dvec3()
            }
        })
        .collect();
    let tissue = Tissue {
        youngs_modulus_pa: 1e4,
        poisson_ratio: 0.4,
    };
    farthest_m(&solver.settle(&setup, tissue, &start, 60), &exact) / moved
}

#[test]
fn inner_particles_go_where_an_affine_map_of_the_skin_says() {
    let solvers = Solver::all(1e-10, |held| held.patch);
    assert_all("patch", &solvers, |solver| patch_error(solver, 1.0));
}

#[test]
fn patch_check_rejects_a_half_that_is_five_per_cent_softer() {
    for (solver, limit) in [(Solver::Reference, 1e-10), (DEFAULT, 1e-3)] {
        let error = patch_error(solver, 0.95);
        println!("patch, 5 % softer half, {solver:?}: {error:.2e}");
        assert!(error > 2.0 * limit, "{solver:?}: {error}");
    }
}

// ---------------------------------------------------------------------------------------- hanging bar

/// A bar 10 × 2 × 2 cm along x, held at x = 0.
fn bar(cells: [usize; 3]) -> BodySetup {
    block(Vec3::new(0.1, 0.02, 0.02), cells, |x| x.x < 1e-6)
}

/// Mean displacement of the end x = `length_m` along `axis` [m].
fn end_m(setup: &BodySetup, positions: &[DVec3], length_m: f32, axis: usize) -> f64 {
    let rest = &setup.tets.particles;
    mean_where(
        setup,
        |x| x.x > 0.9999 * length_m,
        |i| positions[i][axis] - f64::from(rest[i][axis]),
    )
}

/// Relative error of the lengthening, with a modulus so many times the right one.
fn bar_error(solver: Solver, modulus_factor: f64) -> f64 {
    let mut setup = bar([10, 2, 2]);
    setup.gravity_m_s2 = Vec3::new(9.81, 0.0, 0.0);
    setup.damping_per_s = 60.0;
    // Lengthens by about 1 %.
    let tissue = Tissue {
        youngs_modulus_pa: 49e3,
        poisson_ratio: solver.smallest_poisson_ratio(),
    };
    let exact = hanging_bar_m(
        Tissue {
            poisson_ratio: 0.0,
            ..tissue
        }
        .material(),
        0.1,
        981.0,
    );
    let used = Tissue {
        youngs_modulus_pa: modulus_factor * tissue.youngs_modulus_pa,
        ..tissue
    };
    let found = solver.settle(&setup, used, &rest_of(&setup), 90);
    (end_m(&setup, &found, 0.1, 0) / exact - 1.0).abs()
}

#[test]
fn bar_hangs_by_the_closed_form() {
    let solvers = Solver::all(1e-4, |held| Some(held.bar));
    assert_all("hanging bar", &solvers, |solver| bar_error(solver, 1.0));
}

#[test]
fn closed_form_of_the_bar_is_linear_for_a_small_weight() {
    let (e, length) = (1e4, 0.1);
    let small = hanging_bar_m(Material::new(e, 0.0), length, 1e-3 * e);
    // The next order is 1e-3 of this one.
    assert!(
        (small / (1e-3 * length / 2.0) - 1.0).abs() < 2e-3,
        "{small}"
    );
}

#[test]
fn bar_check_rejects_a_modulus_five_per_cent_off() {
    for (solver, limit) in [(Solver::Reference, 1e-4), (DEFAULT, 0.02)] {
        let error = bar_error(solver, 1.05);
        assert!(error > 1.5 * limit, "{solver:?}: {error}");
    }
}

// ----------------------------------------------------------------------------------------- cantilever

/// Sag of the end of a bar of length 1 m and side 0.2 m that sticks out level [m].
fn cantilever_sag_m(solver: Solver, tissue: Tissue, cells: [usize; 3]) -> f64 {
    let mut setup = block(Vec3::new(1.0, 0.2, 0.2), cells, |x| x.x < 1e-6);
    setup.gravity_m_s2 = Vec3::new(0.0, 0.0, -9.81);
    setup.damping_per_s = 30.0;
    let found = solver.settle(&setup, tissue, &rest_of(&setup), 90);
    -end_m(&setup, &found, 1.0, 2)
}

/// What `values` of meshes, each twice as fine as the one before, tend to with second order.
fn extrapolated(coarse: f64, fine: f64) -> f64 {
    fine + (fine - coarse) / 3.0
}

fn cantilever_error(solver: Solver, modulus_factor: f64) -> f64 {
    // Sags by about 2 % of its length.
    let tissue = Tissue {
        youngs_modulus_pa: 18e6,
        poisson_ratio: 0.0,
    };
    let exact = cantilever_m(tissue.youngs_modulus_pa, 1.0, 0.2, 9810.0);
    let used = Tissue {
        youngs_modulus_pa: modulus_factor * tissue.youngs_modulus_pa,
        ..tissue
    };
    let sags: Vec<f64> = [[10, 2, 2], [20, 4, 4]]
        .into_iter()
        .map(|cells| cantilever_sag_m(solver, used, cells))
        .collect();
    println!("{solver:?} {sags:?} {exact}");
    (extrapolated(sags[0], sags[1]) / exact - 1.0).abs()
}

#[test]
fn cantilever_sags_by_timoshenko() {
    let solvers = Solver::all(0.01, |held| held.cantilever);
    assert_all("cantilever", &solvers, |solver| {
        cantilever_error(solver, 1.0)
    });
}

#[test]
fn cantilever_sag_converges_with_second_order() {
    let tissue = Tissue {
        youngs_modulus_pa: 18e6,
        poisson_ratio: 0.0,
    };
    let sag = |n: usize| cantilever_sag_m(Solver::Reference, tissue, [5 * n, n, n]);
    let sags = [sag(2), sag(4), sag(8)];
    let ratio = (sags[1] - sags[0]) / (sags[2] - sags[1]);
    let exact = cantilever_m(tissue.youngs_modulus_pa, 1.0, 0.2, 9810.0);
    println!("cantilever: {sags:?} m on 2, 4, 8 cells, differences fall {ratio:.2} times, {exact}");
    assert!((3.0..5.0).contains(&ratio), "{ratio}");
}

#[test]
fn cantilever_check_rejects_a_modulus_five_per_cent_off() {
    for (solver, limit) in [(Solver::Reference, 0.01), (DEFAULT, 0.03)] {
        let error = cantilever_error(solver, 1.05);
        assert!(error > 1.2 * limit, "{solver:?}: {error}");
    }
}

// ------------------------------------------------------------------------------------------ frequency

const SAMPLES_PER_S: f64 = 240.0;

/// Displacement along the lowest axial mode, sampled.
fn mode_samples(solver: Solver, setup: &BodySetup, tissue: Tissue, samples: usize) -> Vec<f64> {
    let rest = rest_of(setup);
    let start: Vec<DVec3> = rest
        .iter()
        .map(|x| *x + 5e-4 * bar_mode(x.x, 0.1) * DVec3::X)
        .collect();
    let amplitude = |x: &[DVec3]| -> f64 {
        (0..rest.len())
            .map(|i| {
                f64::from(setup.masses_kg[i]) * (x[i].x - rest[i].x) * bar_mode(rest[i].x, 0.1)
            })
            .sum()
    };
    let mut found = vec![amplitude(&start)];
    match solver {
        Solver::Reference => {
            let fem = fem(setup, tissue.material());
            let swing = Swing {
                frames: samples,
                frame_s: 1.0 / SAMPLES_PER_S,
                steps_per_frame: 2,
                damping_per_s: 0.0,
            };
            let start = State {
                velocities: vec![DVec3::ZERO; start.len()],
                positions: start,
            };
            fem.swing(start, &swing, |_, state| {
                found.push(amplitude(&state.positions))
            });
        }
        Solver::Method(method) => {
            let params = SolverParams {
                timestep_s: (1.0 / SAMPLES_PER_S) as f32,
                substeps: 15,
                ..tissue.params(method)
            };
            let mut simulation = Simulation::new(setup.clone(), params);
            let start: Vec<Vec3> = start.iter().map(|x| x.as_vec3()).collect();
            simulation.set_state(&start, &vec![Vec3::ZERO; start.len()]);
            for _ in 0..samples {
                simulation.step(&[]);
                found.push(amplitude(&positions(&simulation)));
            }
        }
    }
    found
}

/// Frequency of samples that swing about 0, from the first and the last time they pass it [Hz].
fn frequency_hz(samples: &[f64]) -> f64 {
    let crossings: Vec<f64> = (samples.windows(2).enumerate())
        .filter(|(_, pair)| pair[0] * pair[1] < 0.0)
        .map(|(i, pair)| i as f64 + pair[0] / (pair[0] - pair[1]))
        .collect();
    let last = crossings.len() - 1;
    0.5 * last as f64 * SAMPLES_PER_S / (crossings[last] - crossings[0])
}

fn frequency_error(solver: Solver, modulus_factor: f64) -> f64 {
    let tissue = Tissue {
        youngs_modulus_pa: 1e4,
        poisson_ratio: solver.smallest_poisson_ratio(),
    };
    let exact = bar_frequency_hz(tissue.youngs_modulus_pa, f64::from(DENSITY_KG_M3), 0.1);
    let used = Tissue {
        youngs_modulus_pa: modulus_factor * tissue.youngs_modulus_pa,
        ..tissue
    };
    let samples = mode_samples(solver, &bar([10, 2, 2]), used, 120);
    (frequency_hz(&samples) / exact - 1.0).abs()
}

#[test]
fn bar_swings_along_itself_at_c_over_four_lengths() {
    let solvers = Solver::all(3e-3, |held| Some(held.frequency));
    assert_all("frequency", &solvers, |solver| frequency_error(solver, 1.0));
}

#[test]
fn frequency_check_rejects_a_modulus_five_per_cent_off() {
    for (solver, limit) in [(Solver::Reference, 3e-3), (DEFAULT, 0.01)] {
        let error = frequency_error(solver, 1.05);
        assert!(error > 1.5 * limit, "{solver:?}: {error}");
    }
}

// ------------------------------------------------------------------------------------ uniaxial stretch

const INCOMPRESSIBLE: Tissue = Tissue {
    youngs_modulus_pa: 1e4,
    poisson_ratio: 0.45,
};

/// Error of the lateral stretch in the middle of a long bar that is pulled to 1.4 times its length by its ends,
/// which keep their size, over 1 less it.
fn stretch_error(solver: Solver, poisson_ratio: f64) -> f64 {
    let mut setup = block(Vec3::new(0.16, 0.02, 0.02), [16, 2, 2], |x| {
        x.x < 1e-6 || x.x > 0.1599
    });
    setup.damping_per_s = 10.0;
    let start: Vec<DVec3> = rest_of(&setup)
        .iter()
        .map(|x| DVec3::new(1.4, 1.0, 1.0) * *x)
        .collect();
    let tissue = Tissue {
        poisson_ratio,
        ..INCOMPRESSIBLE
    };
    let found = solver.settle(&setup, tissue, &start, 120);
    let plane = |at: f32| move |x: Vec3| (x.x - at).abs() < 1e-4;
    let axial = mean_where(&setup, plane(0.1), |i| found[i].x)
        - mean_where(&setup, plane(0.06), |i| found[i].x);
    // Width over four planes, of particles at opposite sides.
    let side = |y: f32| {
        mean_where(
            &setup,
            move |x| (0.055..0.105).contains(&x.x) && (x.y - y).abs() < 1e-4,
            |i| found[i].y,
        )
    };
    let lateral = (side(0.02) - side(0.0)) / 0.02;
    let exact = uniaxial(INCOMPRESSIBLE.material(), axial / 0.04).0;
    println!(
        "{solver:?} axial {} lateral {lateral} exact {exact}",
        axial / 0.04
    );
    ((lateral - exact) / (1.0 - exact)).abs()
}

#[test]
fn pulled_bar_narrows_by_the_closed_form() {
    let solvers = Solver::all(1e-3, |held| held.stretch);
    assert_all("uniaxial stretch", &solvers, |solver| {
        stretch_error(solver, 0.45)
    });
}

#[test]
fn stretch_check_rejects_a_poisson_ratio_five_per_cent_off() {
    for (solver, limit) in [(Solver::Reference, 1e-3), (DEFAULT, 0.01)] {
        let error = stretch_error(solver, 0.95 * 0.45);
        assert!(error > 1.5 * limit, "{solver:?}: {error}");
    }
}

/// Relative error of the force that holds a bar at 1.5 times its length, its ends free to narrow by the closed
/// form.
fn stretch_force_error(modulus_factor: f64) -> f64 {
    let stretch = 1.5;
    let (lateral, stress_pa) = uniaxial(INCOMPRESSIBLE.material(), stretch);
    let setup = block(Vec3::new(0.08, 0.02, 0.02), [8, 2, 2], |x| {
        x.x < 1e-6 || x.x > 0.0799
    });
    let places: Vec<DVec3> = (rest_of(&setup).iter())
        .map(|x| DVec3::new(stretch, lateral, lateral) * *x)
        .collect();
    let used = Tissue {
        youngs_modulus_pa: modulus_factor * INCOMPRESSIBLE.youngs_modulus_pa,
        ..INCOMPRESSIBLE
    };
    let mut fem = fem(&setup, used.material());
    hold(&mut fem, &setup, &places);
    let found = fem.statics().expect("it settles").positions;
    // All of the bar is stretched evenly, sides included: they are free.
    assert!(farthest_m(&found, &places) < 1e-9);
    let forces = fem.elastic_forces_n(&found);
    let force: f64 = (0..forces.len())
        .filter(|&i| setup.tets.particles[i].x < 1e-6)
        .map(|i| forces[i].x)
        .sum();
    (force / (stress_pa * 0.02 * 0.02) - 1.0).abs()
}

#[test]
fn force_of_a_pulled_bar_is_the_closed_form_s() {
    let error = stretch_force_error(1.0);
    println!("uniaxial force, Reference: {error:.1e}");
    // Coordinates at rest are rounded to f32.
    assert!(error < 1e-6, "{error}");
    assert!(stretch_force_error(1.05) > 0.04);
}
