//! Bodies whose answer is known by formula, or by measurement, solved by the reference and by every method.
//!
//! Each case is a function from who solves it to how far off he is; `HELD_TO` says how far that may be. Each has a
//! check that it can fail: with five per cent of the modulus, or what else would be wrong. `docs/TESTING.md` lists
//! the cases; `cargo test --test validation -- --nocapture` prints what they measure.

#[path = "support/bodies.rs"]
mod bodies;
#[path = "support/closed_form.rs"]
mod closed_form;
#[path = "support/peers.rs"]
mod peers;

use bodies::*;
use closed_form::*;
use glam::{DMat3, DQuat, DVec3, Quat, Vec3};
use palpate::geom::TetMesh;
use palpate::reference::{Fem, Material, State, Swing};
use palpate::sim::{BodySetup, Method, Simulation, SolverParams};

/// How far off a method may be, case by case; `None` where its model has no such answer.
#[derive(Clone, Copy)]
struct HeldTo {
    method: Method,
    /// Motion of a body that nothing moves, over its length.
    rest: f64,
    /// Change of an edge of a body that was turned and shifted, over its length.
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
    /// Error of where a silicone beam's end hangs, over its drop.
    silicone: Option<f64>,
}

/// What a method is held to that solves the reference's own equations. A millionth of the length at rest is the
/// goal. A body that was turned rounds anew: its positions by 2e-9 m, its velocities by 2e-9 m a substep, which
/// nothing damps, so that edges tremble by up to 1e-5 of the length. The mesh's part of the others is that of the
/// reference (see `at_best`); single precision and a finite time to settle were measured to add less than is left.
const FAITHFUL: HeldTo = HeldTo {
    method: Method::XpbdNeoHookean,
    rest: 1e-6,
    rigid_motion: 3e-5,
    patch: Some(1e-3),
    bar: 2e-3,
    cantilever: Some(0.015),
    frequency: 5e-3,
    stretch: Some(2e-3),
    silicone: Some(0.1),
};

/// Springs are no continuum: on these meshes they are 8 % off in frequency and 16 % in length, and their bending
/// and their sides are another body's.
const SPRINGS: HeldTo = HeldTo {
    patch: None,
    bar: 0.25,
    cantilever: None,
    frequency: 0.15,
    stretch: None,
    silicone: None,
    ..FAITHFUL
};

/// Every method; one is added by a line here.
const HELD_TO: &[HeldTo] = &[
    HeldTo {
        method: Method::MassSpring,
        ..SPRINGS
    },
    HeldTo {
        method: Method::XpbdSprings,
        ..SPRINGS
    },
    HeldTo {
        method: Method::Implicit,
        ..FAITHFUL
    },
    FAITHFUL,
];

/// What the reference is held to: rounding where the answer is exact on any mesh, else what the mesh leaves.
mod at_best {
    /// Rounding in f64.
    pub const PATCH: f64 = 1e-10;
    /// The held end keeps its width, which the bar of the closed form does not: of second order in a strain of 1 %,
    /// over a share of the length; 4.5e-4 measured.
    pub const BAR: f64 = 1e-3;
    /// Extrapolated from 4 and 8 cells over the height, the next orders are left.
    pub const CANTILEVER: f64 = 0.015;
    /// Masses lumped in ten elements lower it by (π/20)²/24, 1.0e-3.
    pub const FREQUENCY: f64 = 2e-3;
    /// What reaches the middle of the bar from its ends, four widths away: 2e-5 measured.
    pub const STRETCH: f64 = 1e-4;
    /// Young's modulus of the silicone is known to a tenth or so; a lattice of 9.5 mm is 1 % off in all.
    pub const SILICONE: f64 = 0.1;
}

/// Who solves a case.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Solver {
    /// `palpate::reference`.
    Reference,
    Method(Method),
}

/// The method that a scene has unless it says otherwise.
const DEFAULT: Solver = Solver::Method(Method::XpbdNeoHookean);

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

    fn stiffer(self, factor: f64) -> Self {
        Self {
            youngs_modulus_pa: factor * self.youngs_modulus_pa,
            ..self
        }
    }

    /// This tissue with the default time step, substeps and iterations, 20 × 1 at 60 Hz.
    fn params(self, method: Method) -> SolverParams {
        SolverParams {
            method,
            youngs_modulus_pa: self.youngs_modulus_pa as f32,
            poisson_ratio: self.poisson_ratio as f32,
            ..SolverParams::default()
        }
    }
}

/// How a method comes to rest.
#[derive(Clone, Copy, Debug)]
struct Settling {
    frames: usize,
    substeps: u32,
}

impl Settling {
    /// So many frames of the default substeps.
    fn by_default(frames: usize) -> Self {
        let substeps = SolverParams::default().substeps;
        Self { frames, substeps }
    }
}

/// A simulation of `setup`, with more substeps than `params` says where the method needs them to be stable.
fn simulation(setup: &BodySetup, params: SolverParams) -> Simulation {
    let mut simulation = Simulation::new(setup.clone(), params);
    if let Some(bound_s) = simulation.stable_substep_s() {
        let needed = (params.timestep_s / (0.8 * bound_s)).ceil() as u32;
        simulation.set_params(SolverParams {
            substeps: params.substeps.max(needed),
            ..params
        });
    }
    simulation
}

impl Solver {
    /// The reference with its limit, and every method for which `limit` has one.
    fn all(at_best: f64, limit: impl Fn(&HeldTo) -> Option<f64>) -> Vec<(Self, f64)> {
        let reference = std::iter::once((Self::Reference, at_best));
        reference.chain(Self::methods(limit)).collect()
    }

    /// Every method for which `limit` has one.
    fn methods(limit: impl Fn(&HeldTo) -> Option<f64>) -> Vec<(Self, f64)> {
        HELD_TO
            .iter()
            .filter_map(|held| limit(held).map(|limit| (Self::Method(held.method), limit)))
            .collect()
    }

    /// Poisson's ratio 0, or the smallest that the model has: springs along edges have 1/4.
    fn smallest_poisson_ratio(self) -> f64 {
        match self {
            Self::Method(Method::MassSpring | Method::XpbdSprings) => 0.25,
            _ => 0.0,
        }
    }

    /// Where `setup` comes to rest [m], from `start`, which is also where its fixed particles are held.
    fn settle(
        self,
        setup: &BodySetup,
        tissue: Tissue,
        start: &[DVec3],
        settling: Settling,
    ) -> Vec<DVec3> {
        match self {
            Self::Reference => {
                let mut fem = fem(setup, tissue.material());
                hold(&mut fem, setup, start);
                fem.statics().expect("the body settles").positions
            }
            Self::Method(method) => {
                let params = SolverParams {
                    substeps: settling.substeps,
                    ..tissue.params(method)
                };
                let mut simulation = simulation(setup, params);
                let places: Vec<Vec3> = start.iter().map(|x| x.as_vec3()).collect();
                simulation.hold_at(&places);
                simulation.set_state(&places, &vec![Vec3::ZERO; places.len()]);
                run(&mut simulation, settling.frames);
                positions(&simulation)
            }
        }
    }
}

fn hold(fem: &mut Fem, setup: &BodySetup, places: &[DVec3]) {
    for (i, x) in places.iter().enumerate().filter(|(i, _)| setup.fixed[*i]) {
        fem.hold(i, *x);
    }
}

fn rest_of(setup: &BodySetup) -> Vec<DVec3> {
    setup.tets.particles.iter().map(|x| x.as_dvec3()).collect()
}

/// Prints and asserts the error of every solver; all of them are seen before the first fails.
fn assert_all(case: &str, solvers: &[(Solver, f64)], error: impl Fn(Solver) -> f64) {
    let errors: Vec<f64> = solvers
        .iter()
        .map(|(solver, limit)| {
            let error = error(*solver);
            println!("{case}, {solver:?}: {error:.1e} (at most {limit:.1e})");
            error
        })
        .collect();
    for ((solver, limit), error) in solvers.iter().zip(&errors) {
        // NaN is not below.
        assert!(
            error < limit,
            "{case}, {solver:?}: {error} is not below {limit}"
        );
    }
}

/// Asserts that what is wrong takes the reference and the default method beyond their limits.
fn assert_noticed(case: &str, limits: [f64; 2], error: impl Fn(Solver) -> f64) {
    for (solver, limit) in [Solver::Reference, DEFAULT].into_iter().zip(limits) {
        let error = error(solver);
        println!("{case}, {solver:?}: {error:.1e} where at most {limit:.1e} is right");
        assert!(error > limit, "{case}, {solver:?}: {error} went unnoticed");
    }
}

#[test]
fn every_method_is_held_to_something() {
    let held: Vec<Method> = HELD_TO.iter().map(|held| held.method).collect();
    for method in Method::ALL {
        assert!(held.contains(&method), "{method:?} has no line in HELD_TO");
    }
}

#[path = "validation/cantilever.rs"]
mod cantilever;
#[path = "validation/frequency.rs"]
mod frequency;
#[path = "validation/hanging_bar.rs"]
mod hanging_bar;
#[path = "validation/manufactured.rs"]
mod manufactured;
#[path = "validation/patch.rs"]
mod patch;
#[path = "validation/rest.rs"]
mod rest;
#[path = "validation/silicone.rs"]
mod silicone;
#[path = "validation/stiff.rs"]
mod stiff;
#[path = "validation/stretch.rs"]
mod stretch;
