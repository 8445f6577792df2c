//! Reality: a silicone beam clamped at one end, bent by its own weight and scanned.
//!
//! Needs the shared data (`PALPATE_SHARED`); without them the tests say so and pass.

use super::*;
use palpate::geom::import::{ImportOptions, read_surface, read_tets};
use palpate::geom::lattice::Lattice;
use palpate::geom::tet::lumped_masses_kg;

/// Measured drop of the centre of the free end [m].
const MEASURED_M: f64 = 0.119_383;
const DENSITY_KG_M3: f32 = 1070.0;
const TISSUE: Tissue = Tissue {
    youngs_modulus_pa: 60e3,
    poisson_ratio: 0.49,
};

/// The beam as it was made: along z, held at z = 0.
fn setup(tets: TetMesh, masses_kg: Vec<f32>, fill: Vec<f32>) -> BodySetup {
    BodySetup {
        fixed: tets.particles.iter().map(|x| x.z <= 1e-3).collect(),
        masses_kg,
        fill,
        activity: Vec::new(),
        tets,
        gravity_m_s2: Vec3::new(0.0, -9.81, 0.0),
        damping_per_s: 10.0,
        ..BodySetup::default()
    }
}

/// The scanned surface in a lattice of cubes of 9.5 mm, four across.
fn in_a_lattice() -> Option<BodySetup> {
    let path = peers::shared("data/phantom-beam/beam_rest_surface.obj")?;
    let surface = read_surface(&path, &ImportOptions::default()).expect("the beam can be read");
    let lattice = Lattice::around(&surface.mesh, 9.5e-3, DENSITY_KG_M3).expect("it has a lattice");
    Some(setup(lattice.tets, lattice.masses_kg, lattice.fill))
}

/// The hexahedra that it was computed on before, each cut into tetrahedra.
fn in_hexahedra() -> Option<BodySetup> {
    let path = peers::shared("data/phantom-beam/beam_rest_hexa.msh")?;
    let tets = read_tets(&path).expect("the beam can be read").mesh;
    let masses_kg = lumped_masses_kg(&tets, DENSITY_KG_M3);
    Some(setup(tets, masses_kg, Vec::new()))
}

/// Relative error of the drop of the free end, solved with so many times the right modulus.
fn drop_error(setup: &BodySetup, solver: Solver, modulus_factor: f64) -> f64 {
    let used = TISSUE.stiffer(modulus_factor);
    let found = solver.settle(setup, used, &rest_of(setup), Settling::by_default(120));
    let longest = setup.tets.particles.iter().map(|x| x.z).fold(0.0, f32::max);
    let drop = mean_where(
        setup,
        |x| x.z > longest - 1e-4,
        |i| f64::from(setup.tets.particles[i].y) - found[i].y,
    );
    println!(
        "silicone, {solver:?}, {} tetrahedra: the end drops by {:.1} mm",
        setup.tets.tets.len(),
        1e3 * drop
    );
    (drop / MEASURED_M - 1.0).abs()
}

#[test]
fn silicone_beam_hangs_where_it_was_scanned() {
    let Some(setup) = in_a_lattice() else { return };
    let solvers = Solver::all(at_best::SILICONE, |held| held.silicone);
    assert_all("silicone", &solvers, |solver| {
        drop_error(&setup, solver, 1.0)
    });
}

#[test]
fn silicone_beam_hangs_where_it_was_scanned_on_a_fine_mesh_too() {
    let Some(setup) = in_hexahedra() else { return };
    let error = drop_error(&setup, Solver::Reference, 1.0);
    println!("silicone, Reference, fine: {error:.1e}");
    assert!(error < at_best::SILICONE, "{error}");
}

#[test]
fn silicone_check_notices_two_thirds_of_the_modulus() {
    let Some(setup) = in_a_lattice() else { return };
    let limits = [
        at_best::SILICONE,
        FAITHFUL.silicone.expect("it has a limit"),
    ];
    assert_noticed("silicone", limits, |solver| {
        drop_error(&setup, solver, 0.667)
    });
}
