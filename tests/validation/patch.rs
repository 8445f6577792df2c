//! The patch test: a body whose skin follows an affine map follows it inside too, whatever its tetrahedra.

use super::*;

/// Farthest inner particle from its affine place over the farthest that the map moves one, for a body of which one
/// half is `half` as stiff as the other.
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
    // Stretched by a fifth, sheared and turned.
    let map = DMat3::from_cols(
        DVec3::new(1.2, 0.1, 0.0),
        DVec3::new(-0.05, 0.9, 0.1),
        DVec3::new(0.1, -0.15, 1.05),
    );
    let exact: Vec<DVec3> = rest_of(&setup).iter().map(|x| map * *x).collect();
    // Inner particles start a millimetre off.
    let start: Vec<DVec3> = (exact.iter().enumerate())
        .map(|(i, x)| *x + if setup.fixed[i] { 0.0 } else { 1e-3 } * scatter(i).as_dvec3())
        .collect();
    let tissue = Tissue {
        youngs_modulus_pa: 1e4,
        poisson_ratio: 0.4,
    };
    let found = solver.settle(&setup, tissue, &start, Settling::by_default(60));
    farthest_m(&found, &exact) / farthest_m(&exact, &rest_of(&setup))
}

#[test]
fn inner_particles_go_where_an_affine_map_of_the_skin_puts_them() {
    let solvers = Solver::all(at_best::PATCH, |held| held.patch);
    assert_all("patch", &solvers, |solver| patch_error(solver, 1.0));
}

#[test]
fn patch_check_notices_a_half_that_is_five_per_cent_softer() {
    let limits = [at_best::PATCH, FAITHFUL.patch.expect("it has a limit")];
    assert_noticed("patch", limits, |solver| patch_error(solver, 0.95));
}
