//! A beam that sticks out level sags by Timoshenko's formula under a small load.

use super::*;

/// A long beam: for the same share of sag, the longer it is, the longer sound takes through a cell.
const LENGTH_M: f64 = 5.0;
const HEIGHT_M: f64 = 1.0;
/// Sags by 2.5 % of its length. Without a Poisson ratio the width is of no account, and no tetrahedron locks for
/// volume.
const TISSUE: Tissue = Tissue {
    youngs_modulus_pa: 75e6,
    poisson_ratio: 0.0,
};

/// In a default substep sound would pass two of the finer cells, too many for what carries stress over.
const SETTLING: Settling = Settling {
    frames: 90,
    substeps: 40,
};

/// The sag by formula [m].
fn exact_m() -> f64 {
    cantilever_m(
        TISSUE.youngs_modulus_pa,
        LENGTH_M,
        HEIGHT_M,
        9.81 * f64::from(DENSITY_KG_M3),
    )
}

/// Sag of the end with so many cells over the height, five times that over the length [m].
fn sag_m(solver: Solver, tissue: Tissue, cells: usize) -> f64 {
    let size_m = Vec3::new(LENGTH_M as f32, 0.25, HEIGHT_M as f32);
    let mut setup = block(size_m, [5 * cells, 1, cells], |x| x.x < 1e-6);
    setup.gravity_m_s2 = Vec3::new(0.0, 0.0, -9.81);
    setup.damping_per_s = 17.0;
    let found = solver.settle(&setup, tissue, &rest_of(&setup), SETTLING);
    mean_where(
        &setup,
        |x| x.x > 0.9999 * LENGTH_M as f32,
        |i| f64::from(setup.tets.particles[i].z) - found[i].z,
    )
}

/// Relative error of the sag, extrapolated with second order from 4 and 8 cells over the height.
fn cantilever_error(solver: Solver, modulus_factor: f64) -> f64 {
    let [coarse, fine] = [4, 8].map(|cells| sag_m(solver, TISSUE.stiffer(modulus_factor), cells));
    ((fine + (fine - coarse) / 3.0) / exact_m() - 1.0).abs()
}

#[test]
fn cantilever_sags_by_timoshenko() {
    let solvers = Solver::all(at_best::CANTILEVER, |held| held.cantilever);
    assert_all("cantilever", &solvers, |solver| {
        cantilever_error(solver, 1.0)
    });
}

#[test]
fn cantilever_converges_to_timoshenko_with_second_order() {
    let off = [4, 8, 16].map(|cells| 1.0 - sag_m(Solver::Reference, TISSUE, cells) / exact_m());
    println!("cantilever, Reference: {off:.4?} too stiff at 4, 8, 16 cells over the height");
    // Tetrahedra of constant strain bend too hard, by the square of their size.
    assert!((3.0..5.0).contains(&(off[0] / off[1])), "{off:?}");
    assert!((3.0..5.0).contains(&(off[1] / off[2])), "{off:?}");
}

#[test]
fn cantilever_check_notices_a_modulus_five_per_cent_off() {
    let limits = [
        at_best::CANTILEVER,
        FAITHFUL.cantilever.expect("it has a limit"),
    ];
    assert_noticed("cantilever", limits, |solver| {
        cantilever_error(solver, 1.05)
    });
}
