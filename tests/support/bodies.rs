//! Small bodies for the checks of the solvers, the same data for the simulation and for the reference.

#![allow(dead_code)] // Each test binary asks for a part of it.

use glam::{DVec3, Quat, Vec3};
use palpate::geom::lattice::block_of_cells;
use palpate::geom::tet::lumped_masses_kg;
use palpate::reference::{Fem, FemSetup, Material};
use palpate::sim::{BodySetup, Simulation, SolverParams};

pub const DENSITY_KG_M3: f32 = 1000.0;

/// A box from the origin to `size_m` of `cells`, held where `fixed` says; no gravity, no damping.
pub fn block(size_m: Vec3, cells: [usize; 3], fixed: impl Fn(Vec3) -> bool) -> BodySetup {
    let (surface, lattice) = block_of_cells(size_m, cells);
    BodySetup {
        fixed: lattice.tets.particles.iter().map(|&x| fixed(x)).collect(),
        masses_kg: lumped_masses_kg(&lattice.tets, DENSITY_KG_M3),
        fill: lattice.fill,
        activity: Vec::new(),
        triangles: surface.point_triangles(),
        embedding: lattice.embedding,
        tets: lattice.tets,
        gravity_m_s2: Vec3::ZERO,
        damping_per_s: 0.0,
    }
}

/// Moves every particle inside a box of `size_m` by up to `way_m` along each axis, so that no two cells
/// are alike.
pub fn shake_inside(setup: &mut BodySetup, size_m: Vec3, way_m: f32) {
    for (i, x) in setup.tets.particles.iter_mut().enumerate() {
        let edge = 1e-4 * size_m;
        if x.cmpgt(edge).all() && x.cmplt(size_m - edge).all() {
            *x += way_m * scatter(i);
        }
    }
    setup.masses_kg = lumped_masses_kg(&setup.tets, DENSITY_KG_M3);
}

/// A vector within the cube of ±1, different for each `i`.
pub fn scatter(i: usize) -> Vec3 {
    let phase = i as f32 * Vec3::new(1.7, 2.9, 4.3) + Vec3::new(0.4, 1.1, 2.3);
    Vec3::new(phase.x.sin(), phase.y.sin(), phase.z.sin())
}

/// The same body, turned about the origin and then shifted; gravity is turned along.
pub fn placed(setup: &BodySetup, turn: Quat, shift_m: Vec3) -> BodySetup {
    let mut placed = setup.clone();
    for x in &mut placed.tets.particles {
        *x = (turn.as_dquat() * x.as_dvec3() + shift_m.as_dvec3()).as_vec3();
    }
    placed.gravity_m_s2 = turn * placed.gravity_m_s2;
    placed
}

/// The same body as the reference has it.
pub fn fem(setup: &BodySetup, material: Material) -> Fem {
    Fem::new(&FemSetup {
        tets: &setup.tets,
        masses_kg: &setup.masses_kg,
        fixed: &setup.fixed,
        fill: &setup.fill,
        material,
        gravity_m_s2: setup.gravity_m_s2.as_dvec3(),
    })
}

/// The body `setup` where it comes to rest, and the speed that is left [m/s].
pub fn settled(setup: &BodySetup, params: SolverParams, frames: usize) -> Vec<DVec3> {
    let mut simulation = Simulation::new(setup.clone(), params);
    run(&mut simulation, frames);
    positions(&simulation)
}

/// So many steps without a tool.
pub fn run(simulation: &mut Simulation, frames: usize) {
    for _ in 0..frames {
        simulation.step(&[]);
    }
}

/// Positions in f64 [m].
pub fn positions(simulation: &Simulation) -> Vec<DVec3> {
    simulation
        .particles()
        .iter()
        .map(|x| x.as_dvec3())
        .collect()
}

/// Mean of `value` over the particles of `setup` that are `wanted` at rest.
///
/// # Panics
///
/// If there are none.
pub fn mean_where(
    setup: &BodySetup,
    wanted: impl Fn(Vec3) -> bool,
    value: impl Fn(usize) -> f64,
) -> f64 {
    let rest = &setup.tets.particles;
    let chosen: Vec<f64> = (0..rest.len())
        .filter(|&i| wanted(rest[i]))
        .map(value)
        .collect();
    assert!(!chosen.is_empty(), "some particles are wanted");
    chosen.iter().sum::<f64>() / chosen.len() as f64
}

/// Largest distance between two lists of positions [m].
pub fn farthest_m(a: &[DVec3], b: &[DVec3]) -> f64 {
    assert_eq!(a.len(), b.len());
    let distances = a.iter().zip(b).map(|(a, b)| a.distance(*b));
    // `max` would pass over NaN.
    distances.fold(0.0, |worst, d| if d <= worst { worst } else { d })
}
