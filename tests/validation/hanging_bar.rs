//! A bar that hangs by one end grows longer by ρ g L²/2E.

use super::*;

/// Relative error of the lengthening of a bar 10 × 2 × 2 cm, solved with so many times the right modulus.
fn bar_error(solver: Solver, modulus_factor: f64) -> f64 {
    let mut setup = block(Vec3::new(0.1, 0.02, 0.02), [10, 2, 2], |x| x.x < 1e-6);
    setup.gravity_m_s2 = Vec3::new(9.81, 0.0, 0.0);
    setup.damping_per_s = 60.0;
    let tissue = Tissue {
        // Longer by 1 %.
        youngs_modulus_pa: 49e3,
        poisson_ratio: solver.smallest_poisson_ratio(),
    };
    let one_dimensional = Material::new(tissue.youngs_modulus_pa, 0.0);
    let exact = hanging_bar_m(one_dimensional, 0.1, 981.0);
    let used = tissue.stiffer(modulus_factor);
    let found = solver.settle(&setup, used, &rest_of(&setup), Settling::by_default(90));
    let length = mean_where(&setup, |x| x.x > 0.0999, |i| found[i].x);
    ((length - 0.1) / exact - 1.0).abs()
}

#[test]
fn bar_hangs_by_the_closed_form() {
    let solvers = Solver::all(at_best::BAR, |held| Some(held.bar));
    assert_all("hanging bar", &solvers, |solver| bar_error(solver, 1.0));
}

#[test]
fn closed_form_of_the_bar_is_rho_g_l_squared_over_2_e_for_a_small_weight() {
    let (modulus_pa, length_m) = (1e4, 0.1);
    let weight_pa = 1e-3 * modulus_pa;
    let small = hanging_bar_m(Material::new(modulus_pa, 0.0), length_m, weight_pa);
    let linear = weight_pa * length_m / (2.0 * modulus_pa);
    // The next order is 1e-3 of this one.
    assert!((small / linear - 1.0).abs() < 2e-3, "{small} for {linear}");
}

#[test]
fn bar_check_notices_a_modulus_five_per_cent_off() {
    let limits = [at_best::BAR, FAITHFUL.bar];
    assert_noticed("hanging bar", limits, |solver| bar_error(solver, 1.05));
}
