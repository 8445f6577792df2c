//! A bar that is pulled narrows, and resists, by the closed form of stable neo-Hookean tissue.

use super::*;

const TISSUE: Tissue = Tissue {
    youngs_modulus_pa: 1e4,
    poisson_ratio: 0.45,
};

/// Error of the lateral stretch in the middle of a bar that is pulled to 1.4 times its length by ends that keep
/// their size, over 1 less it; solved with `poisson_ratio`.
fn narrowing_error(solver: Solver, poisson_ratio: f64) -> f64 {
    let size_m = Vec3::new(0.16, 0.02, 0.02);
    let mut setup = block(size_m, [16, 2, 2], |x| x.x < 1e-6 || x.x > 0.1599);
    setup.damping_per_s = 10.0;
    let start: Vec<DVec3> = (rest_of(&setup).iter())
        .map(|x| DVec3::new(1.4, 1.0, 1.0) * *x)
        .collect();
    let used = Tissue {
        poisson_ratio,
        ..TISSUE
    };
    let found = solver.settle(&setup, used, &start, Settling::by_default(90));
    let is_at = |x: f32, place: f32| (x - place).abs() < 1e-4;
    let plane = |place: f32| mean_where(&setup, |x| is_at(x.x, place), |i| found[i].x);
    let axial = (plane(0.1) - plane(0.06)) / 0.04;
    // Two opposite sides, over the middle four centimetres.
    let side = |place: f32| {
        let wanted = |x: Vec3| (0.055..0.105).contains(&x.x) && is_at(x.y, place);
        mean_where(&setup, wanted, |i| found[i].y)
    };
    let lateral = (side(0.02) - side(0.0)) / 0.02;
    let exact = uniaxial(TISSUE.material(), axial).0;
    ((lateral - exact) / (1.0 - exact)).abs()
}

#[test]
fn pulled_bar_narrows_by_the_closed_form() {
    let solvers = Solver::all(at_best::STRETCH, |held| held.stretch);
    assert_all("uniaxial stretch", &solvers, |solver| {
        narrowing_error(solver, TISSUE.poisson_ratio)
    });
}

#[test]
fn stretch_check_notices_a_poisson_ratio_five_per_cent_off() {
    let limits = [at_best::STRETCH, FAITHFUL.stretch.expect("it has a limit")];
    assert_noticed("uniaxial stretch", limits, |solver| {
        narrowing_error(solver, 0.95 * TISSUE.poisson_ratio)
    });
}

/// Relative error of the force that holds a bar at 1.5 times its length by ends that narrow by the closed form.
fn force_error(modulus_factor: f64) -> f64 {
    let stretch = 1.5;
    let (lateral, stress_pa) = uniaxial(TISSUE.material(), stretch);
    let size_m = Vec3::new(0.08, 0.02, 0.02);
    let setup = block(size_m, [8, 2, 2], |x| x.x < 1e-6 || x.x > 0.0799);
    let places: Vec<DVec3> = (rest_of(&setup).iter())
        .map(|x| DVec3::new(stretch, lateral, lateral) * *x)
        .collect();
    let mut fem = fem(&setup, TISSUE.stiffer(modulus_factor).material());
    hold(&mut fem, &setup, &places);
    let found = fem.statics().expect("it settles").positions;
    // The free sides have narrowed as much as the ends: the stretch is even.
    assert!(farthest_m(&found, &places) < 1e-9);
    let pull: f64 = (fem.elastic_forces_n(&found).iter().enumerate())
        .filter(|(i, _)| setup.tets.particles[*i].x < 1e-6)
        .map(|(_, force)| force.x)
        .sum();
    (pull / (stress_pa * 0.02 * 0.02) - 1.0).abs()
}

#[test]
fn pulled_bar_resists_by_the_closed_form() {
    let error = force_error(1.0);
    println!("uniaxial force, Reference: {error:.1e}");
    // Sides of 2 cm are rounded to f32: 4e-8 measured.
    assert!(error < 1e-6, "{error}");
}

#[test]
fn force_check_notices_a_modulus_five_per_cent_off() {
    assert!(force_error(1.05) > 0.04);
}
