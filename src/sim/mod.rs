//! The body in time: a tetrahedral mesh that is pulled, pushed and left alone. No GPU, no clock.
//!
//! [`Simulation`] owns the state; [`Simulation::step`] advances it by one fixed time step under
//! rigid tools. Everything is in SI units, and the same inputs give the same bits on any number of
//! threads.

mod beat;
mod beating;
mod calm;
mod coloring;
pub mod constraint;
mod contact;
pub mod diagnose;
mod grab;
mod hand_over;
mod handle;
mod implicit;
mod lanes;
mod mass_spring;
mod model;
mod muscle;
mod neo_hookean;
mod particles;
mod parts;
mod simulation;
mod springs;
mod team;
mod tools;

pub use beat::Beat;
pub use hand_over::HandOver;
pub use simulation::Simulation;

use crate::geom::{Embedding, TetMesh, bounds};
use glam::Vec3;
use parts::SHARED_TETS_MIN;
use serde::{Deserialize, Serialize};

/// How the body resists deformation, and how that is solved.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Method {
    /// Springs along the edges, semi-implicit Euler. The classic; Poisson's ratio is 1/4 whatever
    /// is asked for, and too long a substep explodes.
    MassSpring,
    /// Compliant edge lengths and tetrahedron volumes, XPBD.
    XpbdSprings,
    /// Stable neo-Hookean tetrahedra, each substep solved as a whole: for stiff bodies, long
    /// substeps, and states that are to be right to the last digit.
    Implicit,
    /// Stable neo-Hookean tetrahedra, shape and volume solved together, XPBD.
    XpbdNeoHookean,
}

impl Method {
    /// Every method, the recommended one last.
    pub const ALL: [Self; 4] = [
        Self::MassSpring,
        Self::XpbdSprings,
        Self::Implicit,
        Self::XpbdNeoHookean,
    ];

    /// The name scene files use.
    pub fn name(self) -> &'static str {
        match self {
            Self::MassSpring => "mass-spring",
            Self::XpbdSprings => "xpbd-springs",
            Self::Implicit => "implicit",
            Self::XpbdNeoHookean => "xpbd-neo-hookean",
        }
    }
}

/// Method, material and time step.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct SolverParams {
    pub method: Method,
    /// Time one call of [`Simulation::step`] advances [s].
    pub timestep_s: f32,
    /// Substeps a step.
    pub substeps: u32,
    /// Sweeps over all constraints a substep, or Newton steps of the implicit method; more substeps
    /// are nearly always the better buy.
    pub iterations: u32,
    /// Young's modulus E [Pa].
    pub youngs_modulus_pa: f32,
    /// Poisson's ratio ν.
    pub poisson_ratio: f32,
}

impl Default for SolverParams {
    fn default() -> Self {
        Self {
            method: Method::XpbdNeoHookean,
            timestep_s: 1.0 / 60.0,
            substeps: 20,
            iterations: 1,
            youngs_modulus_pa: 5e3,
            poisson_ratio: 0.45,
        }
    }
}

/// Lamé's two moduli.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Lame {
    /// Shear modulus μ [Pa].
    pub mu_pa: f32,
    /// First modulus λ [Pa].
    pub lambda_pa: f32,
}

impl SolverParams {
    /// What is wrong with these values, with the allowed range; `None` if they can be used.
    pub fn problem(&self) -> Option<String> {
        let checks = [
            ("timestep_s", self.timestep_s, 1e-5, 0.1),
            ("substeps", self.substeps as f32, 1.0, 10_000.0),
            ("iterations", self.iterations as f32, 1.0, 1_000.0),
            ("youngs_modulus_pa", self.youngs_modulus_pa, 1.0, 1e9),
            ("poisson_ratio", self.poisson_ratio, 0.0, 0.499),
        ];
        out_of_range(&checks)
    }

    /// Lamé's moduli of the material.
    pub fn lame(&self) -> Lame {
        let (e, nu) = (self.youngs_modulus_pa, self.poisson_ratio);
        Lame {
            mu_pa: e / (2.0 * (1.0 + nu)),
            lambda_pa: e * nu / ((1.0 + nu) * (1.0 - 2.0 * nu)),
        }
    }

    /// Length of a substep [s].
    pub fn substep_s(&self) -> f32 {
        self.timestep_s / self.substeps as f32
    }
}

/// The first value that is outside its range, in words.
fn out_of_range(checks: &[(&str, f32, f32, f32)]) -> Option<String> {
    checks
        .iter()
        // Written so that NaN is out of range too.
        .find(|(_, value, low, high)| !(*low <= *value && *value <= *high))
        .map(|(name, value, low, high)| {
            format!("{name} = {value} is out of range: choose from {low} to {high}")
        })
}

/// A body at rest, as the simulation takes it over.
#[derive(Clone, Debug, Default)]
pub struct BodySetup {
    /// Particles [m] and tetrahedra; flat and inverted ones are left out of the elastic model.
    pub tets: TetMesh,
    /// Mass of each particle [kg], all positive.
    pub masses_kg: Vec<f32>,
    /// Particles that are held in place; one flag each.
    pub fixed: Vec<bool>,
    /// Share of each tetrahedron that is tissue, scaling its stiffness: `Lattice::fill`, or nothing
    /// at all for a mesh that is all tissue.
    pub fill: Vec<f32>,
    /// How much of each particle is muscle, from 0 to 1, for a body that beats; nothing at all for one that is
    /// muscle throughout.
    pub activity: Vec<f32>,
    /// Triangles of the surface; corners are points.
    pub triangles: Vec<[u32; 3]>,
    /// Where each surface point hangs in the tetrahedra.
    pub embedding: Embedding,
    /// Acceleration of every particle [m/s²].
    pub gravity_m_s2: Vec3,
    /// Velocities fall by exp(−damping · time step) in a step: at its end, or in its substeps by the implicit
    /// method [1/s].
    pub damping_per_s: f32,
}

impl BodySetup {
    /// What is wrong with gravity or damping, with the allowed range; `None` if both can be used.
    pub fn problem(&self) -> Option<String> {
        let [x, y, z] = self.gravity_m_s2.to_array();
        out_of_range(&[
            ("gravity_m_s2", x, -1e4, 1e4),
            ("gravity_m_s2", y, -1e4, 1e4),
            ("gravity_m_s2", z, -1e4, 1e4),
            ("damping_per_s", self.damping_per_s, 0.0, 1e4),
        ])
    }

    /// The same body; if it is large enough to be shared by threads, with its particles numbered
    /// along its longest side: what they work on at the same time is then apart in memory too. Two
    /// cores that write to one cache line in turn wait for each other every time.
    ///
    /// # Panics
    ///
    /// If the lists do not fit each other.
    pub fn numbered_along(mut self) -> Self {
        if self.tets.tets.len() < SHARED_TETS_MIN {
            return self;
        }
        let (low, high) = bounds(&self.tets.particles);
        let order = parts::order_along(&self.tets.particles, (high - low).max_position());
        let number = parts::places_in(&order);
        let corners = self
            .tets
            .tets
            .iter_mut()
            .chain(&mut self.embedding.particles);
        for particle in corners.flatten() {
            *particle = number[*particle as usize];
        }
        self.tets.particles = reordered(&self.tets.particles, &order);
        self.masses_kg = reordered(&self.masses_kg, &order);
        self.fixed = reordered(&self.fixed, &order);
        if !self.activity.is_empty() {
            self.activity = reordered(&self.activity, &order);
        }
        self
    }
}

fn reordered<T: Copy>(values: &[T], order: &[u32]) -> Vec<T> {
    order.iter().map(|&i| values[i as usize]).collect()
}

/// Shape of a rigid tool.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ToolShape {
    /// About the tool's position.
    Sphere { radius_m: f32 },
    /// Round the segment from the tool's position (the tip) to position + axis.
    Capsule { radius_m: f32, axis_m: Vec3 },
}

impl ToolShape {
    /// Radius [m].
    pub fn radius_m(self) -> f32 {
        match self {
            Self::Sphere { radius_m } | Self::Capsule { radius_m, .. } => radius_m,
        }
    }

    /// From the tool's position to the other end of its axis [m]; zero for a sphere.
    pub fn axis_m(self) -> Vec3 {
        match self {
            Self::Sphere { .. } => Vec3::ZERO,
            Self::Capsule { axis_m, .. } => axis_m,
        }
    }
}

/// What a tool does.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, Hash, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum ToolAction {
    /// Touches nothing.
    #[default]
    Idle,
    /// Is solid.
    Push,
    /// Holds the surface points that it reached when it closed.
    Grab,
}

/// One tool during one step. Tools are told apart by their place in the list.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct ToolInput {
    pub shape: ToolShape,
    /// Where it is at the end of the step [m]; it comes in a straight line from where it was.
    pub position_m: Vec3,
    pub action: ToolAction,
    /// Coulomb friction coefficient.
    pub friction: f32,
}

/// What a step did.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct StepReport {
    /// What is left of the equations after the last substep, free of units: RMS of C + α̃λ over the
    /// rest length or volume for `xpbd-springs`, of the misfit of stress and deformation over
    /// Young's modulus for `xpbd-neo-hookean`, residual over load for `implicit`; 0 for
    /// `mass-spring`.
    pub residual_rms: f32,
    /// (volume − rest volume) / rest volume, over all tetrahedra.
    pub volume_drift: f32,
    /// Force of the body on each tool [N], mean over the step, in the order of the inputs.
    pub tool_forces_n: Vec<Vec3>,
    /// Deepest that a pushing tool is inside the surface, faces and all, at the end of the step [m].
    pub penetration_max_m: f32,
    /// Tetrahedra of negative volume that were positive at rest.
    pub inverted_tets: usize,
    /// Particles frozen so far because their state was no longer finite.
    pub frozen_particles: usize,
    /// Fastest particle at the end of the step [m/s].
    pub speed_max_m_s: f32,
    /// The body is wrecked, and led back to its last sound shape: forces mean nothing.
    pub restoring: bool,
    /// Pushing tools that do nothing, since they leave tissue no room between themselves and another.
    pub yielding_tools: usize,
    /// Nothing moved and nothing was computed; forces are those of a tool that rests on the body or
    /// holds it, as they were when it fell asleep.
    pub asleep: bool,
}
