//! The body's state and one step of it.

use super::{
    Beat, BodySetup, SolverParams, StepReport, ToolInput,
    beating::Beating,
    calm::Calm,
    contact::{DEPENETRATION_SPEED_M_S, Surface},
    diagnose::rest_volume_m3,
    grab::Tissue,
    implicit::Step,
    model::Model,
    particles::Particles,
    parts::SHARED_TETS_MIN,
    team::Team,
    tools::{Met, Tools},
};
use crate::geom::bounds;
use glam::Vec3;

/// Tetrahedra a chunk, in adding up volumes: some microseconds.
const TETS_PER_CHUNK: usize = 1024;
/// Points a chunk, in bringing the surface up to date: some microseconds.
const POINTS_PER_CHUNK: usize = 1024;

/// A soft body in time.
#[derive(Debug)]
pub struct Simulation {
    setup: BodySetup,
    solver: SolverParams,
    /// Tetrahedra with a positive volume at rest; the others have no model.
    sound: Vec<u32>,
    sound_tets: Vec<[u32; 4]>,
    rest_volume_m3: f64,
    beating: Option<Beating>,
    size_m: f32,
    density_kg_m3: f32,
    edge_m: f32,

    model: Model,
    particles: Particles,
    tools: Tools,
    /// Positions, as they are given out [m].
    positions: Vec<Vec3>,
    points: Vec<Vec3>,
    /// What the tissue at each point of the surface would fill, as a share of its volume at rest; nothing while no
    /// muscle works.
    point_volumes: Vec<f32>,
    point_bounds: (Vec3, Vec3),
    report: StepReport,
    calm: Calm,
    frozen: usize,
    pool: Option<rayon::ThreadPool>,
}

/// How a body stands after a step.
struct Standing {
    residual_rms: f32,
    volume_m3: f64,
    inverted_tets: usize,
}

impl Simulation {
    /// A body at rest.
    ///
    /// # Panics
    ///
    /// If the lists of `setup` do not fit each other, a mass is not positive, or a parameter is out
    /// of range (see [`SolverParams::problem`] and [`BodySetup::problem`]).
    pub fn new(mut setup: BodySetup, params: SolverParams) -> Self {
        if setup.fill.is_empty() {
            setup.fill = vec![1.0; setup.tets.tets.len()];
        }
        check(&setup);
        assert_usable(params.problem());
        assert_usable(setup.problem());
        let mesh = &setup.tets;
        let sound: Vec<u32> = (0..mesh.tets.len() as u32)
            .filter(|&tet| is_sound(&setup, tet as usize))
            .collect();
        let sound_tets: Vec<[u32; 4]> = sound.iter().map(|&tet| mesh.tets[tet as usize]).collect();
        let (low, high) = bounds(&mesh.particles);
        let tissue_m3: f64 = sound
            .iter()
            .map(|&tet| rest_volume_m3(mesh, tet as usize) * f64::from(setup.fill[tet as usize]))
            .sum();
        let mass_kg: f64 = setup.masses_kg.iter().map(|&mass| f64::from(mass)).sum();
        let particles = Particles::new(&mesh.particles, &inverse_masses(&setup));
        let size_m = (high - low).max_element();
        let rest_volume_m3 = particles.volume_and_inverted(&sound_tets).0;
        // The edge of a regular tetrahedron of the mean volume.
        let mean_volume = rest_volume_m3 / sound.len().max(1) as f64;
        let mut simulation = Self {
            model: Model::new(params.method, mesh, &sound, &setup.fill, &particles.places),
            tools: Tools::default(),
            positions: mesh.particles.clone(),
            points: vec![Vec3::ZERO; setup.embedding.particles.len()],
            point_volumes: Vec::new(),
            point_bounds: (Vec3::ZERO, Vec3::ZERO),
            report: StepReport::default(),
            calm: Calm::new(&particles, size_m),
            frozen: 0,
            pool: None,
            size_m,
            density_kg_m3: (mass_kg / tissue_m3.max(f64::MIN_POSITIVE)) as f32,
            edge_m: (mean_volume * 72.0_f64.sqrt()).cbrt() as f32,
            rest_volume_m3,
            beating: None,
            particles,
            sound,
            sound_tets,
            solver: params,
            setup,
        };
        simulation.publish(&Team::alone());
        simulation
    }

    /// Advances the body by one time step while the tools move to where `tools` has them.
    pub fn step(&mut self, tools: &[ToolInput]) -> StepReport {
        match self.pool.take() {
            Some(pool) => {
                pool.install(|| self.advance(tools));
                self.pool = Some(pool);
            }
            None => self.advance(tools),
        }
        self.report.clone()
    }

    /// Uses this many threads, or rayon's global pool again for `None`. The bits do not change.
    ///
    /// # Panics
    ///
    /// If the system refuses the threads.
    pub fn set_threads(&mut self, threads: Option<usize>) {
        self.pool = threads.map(|count| {
            rayon::ThreadPoolBuilder::new()
                .num_threads(count)
                .build()
                .expect("the system gives the threads asked for")
        });
    }

    /// Changes method, material or time step from the next step on; wakes the body.
    ///
    /// # Panics
    ///
    /// If a value is out of range (see [`SolverParams::problem`]).
    pub fn set_params(&mut self, params: SolverParams) {
        assert_usable(params.problem());
        if params == self.solver {
            return;
        }
        if params.method != self.solver.method {
            self.solver.method = params.method;
            self.model = self.new_model();
        }
        self.solver = params;
        self.calm.forget_troubles();
        self.wake();
    }

    /// Changes gravity and damping from the next step on; wakes the body.
    ///
    /// # Panics
    ///
    /// If a value is out of range (see [`BodySetup::problem`]).
    pub fn set_gravity_and_damping(&mut self, gravity_m_s2: Vec3, damping_per_s: f32) {
        if (gravity_m_s2, damping_per_s) != (self.setup.gravity_m_s2, self.setup.damping_per_s) {
            self.setup.gravity_m_s2 = gravity_m_s2;
            self.setup.damping_per_s = damping_per_s;
            assert_usable(self.setup.problem());
            self.wake();
        }
    }

    /// Has the muscle of the body beat from the next step on, and wakes the body; with `None` it ends the beat that
    /// it is in, and rests.
    ///
    /// # Panics
    ///
    /// If a value is out of range (see [`Beat::problem`]).
    pub fn set_beat(&mut self, beat: Option<Beat>) {
        if let Some(beat) = beat {
            assert_usable(beat.problem());
        }
        match (&mut self.beating, beat) {
            (None, None) => return,
            (None, Some(beat)) => {
                let beating = Beating::new(&self.setup, &self.sound, beat);
                self.model.set_activity(&beating.activity);
                self.beating = Some(beating);
            }
            (Some(beating), Some(beat)) => (beating.beat, beating.ends) = (beat, false),
            (Some(beating), None) => beating.ends = true,
        }
        self.wake();
    }

    /// What the tissue at each point of the surface would fill if nothing pressed it, as a share of its volume at
    /// rest: below 1 where muscle has shortened. `None` while no muscle works.
    pub fn point_volumes(&self) -> Option<&[f32]> {
        (!self.point_volumes.is_empty()).then_some(&self.point_volumes[..])
    }

    /// Puts the body back to rest where it was made, tools forgotten, frozen particles free again.
    /// Parameters stay as they are.
    pub fn reset(&mut self) {
        self.particles = Particles::new(&self.setup.tets.particles, &inverse_masses(&self.setup));
        self.tools = Tools::default();
        self.frozen = 0;
        self.report = StepReport::default();
        if let Some(beating) = &mut self.beating {
            beating.phase = 0.0;
            self.model.shorten(0.0);
        }
        self.model.forget(&mut self.particles.places, &self.solver);
        self.calm.forget_troubles();
        self.wake();
        self.publish(&Team::alone());
    }

    /// Puts every free particle to `positions` [m] with `velocities` [m/s]; wakes the body.
    ///
    /// # Panics
    ///
    /// If there is not one of each a particle, or one is not finite.
    pub fn set_state(&mut self, positions: &[Vec3], velocities: &[Vec3]) {
        let count = self.positions.len();
        assert!(
            positions.len() == count && velocities.len() == count,
            "one position and one velocity a particle"
        );
        for i in 0..count {
            assert!(
                positions[i].is_finite() && velocities[i].is_finite(),
                "a state is finite"
            );
            let inverse_mass = self.particles.places[i].w;
            if inverse_mass > 0.0 {
                self.particles.places[i] = positions[i].extend(inverse_mass);
                self.particles.velocities[i] = velocities[i];
            }
        }
        self.model.forget(&mut self.particles.places, &self.solver);
        self.tools.forget_sides();
        self.wake();
        self.publish(&Team::alone());
    }

    /// Puts every held particle to where `positions` has it [m], and holds it there; wakes the body.
    /// Free particles stay where they are.
    ///
    /// # Panics
    ///
    /// If there is not one position a particle, or one of a held particle is not finite.
    pub fn hold_at(&mut self, positions: &[Vec3]) {
        assert_eq!(
            positions.len(),
            self.positions.len(),
            "one position a particle"
        );
        for (i, &position) in positions.iter().enumerate() {
            if self.setup.fixed[i] {
                assert!(position.is_finite(), "a particle is held somewhere");
                self.particles.places[i] = position.extend(0.0);
            }
        }
        self.model.forget(&mut self.particles.places, &self.solver);
        self.tools.forget_sides();
        self.wake();
        self.publish(&Team::alone());
    }

    /// Particle positions [m].
    pub fn particles(&self) -> &[Vec3] {
        &self.positions
    }

    /// Particle velocities [m/s].
    pub fn velocities(&self) -> &[Vec3] {
        &self.particles.velocities
    }

    /// Surface points [m].
    pub fn points(&self) -> &[Vec3] {
        &self.points
    }

    /// The body as it was made, with gravity and damping as they are now.
    pub fn setup(&self) -> &BodySetup {
        &self.setup
    }

    /// Method, material and time step.
    pub fn params(&self) -> SolverParams {
        self.solver
    }

    /// Number of tetrahedra.
    pub fn tet_count(&self) -> usize {
        self.setup.tets.tets.len()
    }

    /// What the last step did.
    pub fn report(&self) -> &StepReport {
        &self.report
    }

    /// Tetrahedra that take part: those with a positive volume at rest.
    pub fn sound_tets(&self) -> &[u32] {
        &self.sound
    }

    /// A substep [s] below which `mass-spring` is sure to be stable; `None` for the other methods,
    /// which have no such edge.
    pub fn stable_substep_s(&self) -> Option<f32> {
        match &self.model {
            Model::MassSpring(model) => {
                Some(model.stable_substep_s(&self.particles.places, self.solver.youngs_modulus_pa))
            }
            Model::Springs(_) | Model::NeoHookean(_) | Model::Implicit(_) => None,
        }
    }

    fn new_model(&self) -> Model {
        let (mesh, fill) = (&self.setup.tets, &self.setup.fill);
        let places = &self.particles.places;
        let mut model = Model::new(self.solver.method, mesh, &self.sound, fill, places);
        if let Some(beating) = &self.beating {
            model.set_activity(&beating.activity);
            model.shorten(beating.shortening());
        }
        model
    }

    /// Substeps from which on `xpbd-neo-hookean` bears this body as stiffly as it is; `None` if those
    /// it has are enough, and for the other methods, which have no such limit.
    pub fn faithful_substeps(&self) -> Option<u32> {
        match &self.model {
            Model::NeoHookean(model) => {
                model.faithful_substeps(&self.particles.places, &self.solver)
            }
            Model::MassSpring(_) | Model::Springs(_) | Model::Implicit(_) => None,
        }
    }

    /// Whether the body was so shaken that its method carries less stress over since, and lets it sag.
    pub fn sags(&self) -> bool {
        matches!(&self.model, Model::NeoHookean(model) if model.sags())
    }

    /// Whether waves have grown in it that carrying less stress over does not still.
    pub fn waves_grow_on(&self) -> bool {
        matches!(&self.model, Model::NeoHookean(model) if model.waves_grow_on())
    }

    /// Whether some of the body has gone back and forth from substep to substep for half a second, as poor tetrahedra
    /// can with `xpbd-neo-hookean`.
    pub fn trembles(&self) -> bool {
        matches!(self.model, Model::NeoHookean(_)) && self.calm.trembles(self.solver.timestep_s)
    }

    /// Whether tetrahedra have been inside out for half a second while no tool moved that presses, as a sliver can with
    /// too few substeps of `xpbd-neo-hookean`.
    pub fn is_folded(&self) -> bool {
        matches!(self.model, Model::NeoHookean(_)) && self.calm.is_folded(self.solver.timestep_s)
    }

    /// Volume of the shapes that the tetrahedra want now [m³].
    fn rest_volume_now_m3(&self) -> f64 {
        self.rest_volume_m3 - self.beating.as_ref().map_or(0.0, Beating::lost_m3)
    }

    /// Has the body move on by itself again, and gives it all its time to fall asleep.
    pub fn wake(&mut self) {
        self.calm.wake();
        self.report.asleep = false;
    }

    fn advance(&mut self, inputs: &[ToolInput]) {
        let speed_m_s = self.particles.speed_max_m_s();
        let asleep = self.report.asleep;
        self.tools.begin_step(
            inputs,
            Met {
                surface: surface(&self.setup, &self.points, self.point_bounds),
                particles: &self.particles,
                tissue: Tissue {
                    youngs_modulus_pa: self.solver.youngs_modulus_pa,
                    density_kg_m3: self.density_kg_m3,
                    edge_m: self.edge_m,
                },
                size_m: self.size_m,
                way_m: 2.0 * speed_m_s * self.solver.timestep_s,
                enter_m: DEPENETRATION_SPEED_M_S * self.solver.timestep_s,
                asleep,
            },
        );
        let stirred = self.tools.stir(&self.particles, asleep);
        if asleep && !stirred {
            // Tools that press or hold are where they were, and so are their forces.
            self.report.tool_forces_n.resize(inputs.len(), Vec3::ZERO);
            return;
        }

        self.particles.keep_finite();
        self.model.begin_step();
        let standing = if self.sound.len() >= SHARED_TETS_MIN {
            Team::with(|team| self.move_on(team))
        } else {
            self.move_on(&Team::alone())
        };
        let speed_max_m_s = self.particles.speed_max_m_s();
        let beats = self.beating.as_ref().is_some_and(Beating::works);
        // A body that is led back rests nowhere, though a load may hold it still: its own material is yet to answer.
        let stirred = stirred || beats || self.model.is_restoring();
        let forces_n = self.tools.forces_n(self.solver.substeps);
        if stirred && forces_n.iter().any(|force_n| *force_n != Vec3::ZERO) {
            // What is being pressed may well be folded, and that passes with the tool; not where it stays.
            self.calm.forget_folds();
        }
        let inverted_tets = if self.model.is_restoring() {
            0
        } else {
            standing.inverted_tets
        };
        let substep_s = self.solver.substep_s();
        (self.calm).watch(&self.particles, substep_s, stirred, inverted_tets);
        let surface = surface(&self.setup, &self.points, self.point_bounds);
        self.report = StepReport {
            residual_rms: standing.residual_rms,
            volume_drift: (standing.volume_m3 / self.rest_volume_now_m3() - 1.0) as f32,
            tool_forces_n: forces_n,
            penetration_max_m: (self.tools).penetration_max_m(surface, &self.particles),
            inverted_tets: standing.inverted_tets,
            frozen_particles: self.frozen,
            speed_max_m_s,
            restoring: self.model.is_restoring(),
            yielding_tools: self.tools.yielding(),
            asleep: false,
        };
        if self.calm.may_sleep(self.solver.timestep_s) {
            self.particles.velocities.fill(Vec3::ZERO);
            self.model.stand_still();
            self.report.asleep = true;
            self.report.speed_max_m_s = 0.0;
        }
    }

    /// All substeps, and how the body stands after them.
    fn move_on(&mut self, team: &Team) -> Standing {
        for substep in 0..self.solver.substeps {
            if substep + 1 == self.solver.substeps {
                self.calm.before_last_substep(&self.particles);
            }
            self.substep(team, substep);
        }
        (self.calm).after_last_substep(&self.particles, &self.tools.carriers());
        if let Some(beating) = &mut self.beating {
            beating.advance(f64::from(self.solver.timestep_s));
        }
        // Where a step is one solve after another, damping is one of its forces: struck off once a
        // step, a wave that turns as a step ends would keep all of its speed.
        if !matches!(self.model, Model::Implicit(_)) {
            // A wrecked body's speed comes from the wreck; it would overshoot its shape.
            let damping = if self.model.is_restoring() {
                0.0
            } else {
                (-self.setup.damping_per_s * self.solver.timestep_s).exp()
            };
            for velocity in &mut self.particles.velocities {
                *velocity *= damping;
            }
        }
        let frozen = self.particles.freeze_if_not_finite();
        self.frozen += frozen;
        if frozen > 0 && matches!(self.model, Model::Implicit(_)) {
            // It numbers free particles and held ones apart.
            self.model = self.new_model();
        }

        let places = &mut self.particles.places;
        let residual_rms = self.model.residual_rms(team, places, &self.solver);
        self.publish(team);
        let chunks: Vec<&[[u32; 4]]> = self.sound_tets.chunks(TETS_PER_CHUNK).collect();
        let parts = team.map(chunks.len(), |chunk| {
            self.particles.volume_and_inverted(chunks[chunk])
        });
        Standing {
            residual_rms,
            volume_m3: parts.iter().map(|part| part.0).sum(),
            inverted_tets: parts.iter().map(|part| part.1).sum(),
        }
    }

    /// Predict, constraints part by part, tools, velocities.
    fn substep(&mut self, team: &Team, substep: u32) {
        let substep_s = self.solver.substep_s();
        let share = |k: u32| k as f32 / self.solver.substeps as f32;
        let (from, to) = (share(substep), share(substep + 1));
        if let Some(beating) = &self.beating {
            let ahead_s = f64::from(to) * f64::from(self.solver.timestep_s);
            self.model.shorten(beating.shortening_in(ahead_s));
        }
        if let Model::Implicit(model) = &mut self.model {
            let step = Step {
                gravity_m_s2: self.setup.gravity_m_s2,
                damping_per_s: self.setup.damping_per_s,
                lame: self.solver.lame(),
                substep_s,
                iterations: self.solver.iterations,
                shares: (from, to),
            };
            model.substep(&mut self.particles, &mut self.tools, step);
            return;
        }
        let accelerations =
            (self.model).begin_substep(team, &mut self.particles.places, &self.solver);
        self.particles
            .predict(team, self.setup.gravity_m_s2, accelerations, substep_s);
        self.tools.begin_substep(&self.particles, from);
        self.tools
            .press_on(&mut self.particles, from, to, substep_s);
        for _ in 0..self.solver.iterations {
            (self.model).project(team, &mut self.particles.places, &self.solver);
            self.tools.solve(&mut self.particles, from, to, substep_s);
        }
        self.tools.end_substep(substep_s);
        self.particles.update_velocities(team, substep_s);
    }

    /// Copies the state to where others read it, and brings the surface up to date.
    fn publish(&mut self, team: &Team) {
        for (position, place) in self.positions.iter_mut().zip(&self.particles.places) {
            *position = place.truncate();
        }
        let (embedding, positions) = (&self.setup.embedding, &self.positions);
        team.for_runs(&mut self.points, POINTS_PER_CHUNK, |start, run| {
            for (i, point) in (start..).zip(run) {
                let (tet, weights) = (embedding.particles[i], embedding.weights[i]);
                *point = (0..4)
                    .map(|k| weights[k] * positions[tet[k] as usize])
                    .sum();
            }
        });
        self.point_bounds = bounds(&self.points);
        if let Some(beating) = &self.beating {
            self.point_volumes.clear();
            self.point_volumes.extend(beating.point_volumes());
        }
    }
}

/// The surface as the tools meet it.
fn surface<'a>(setup: &'a BodySetup, points: &'a [Vec3], bounds: (Vec3, Vec3)) -> Surface<'a> {
    Surface {
        triangles: &setup.triangles,
        points,
        bounds,
        embedding: &setup.embedding,
    }
}

fn assert_usable(problem: Option<String>) {
    if let Some(problem) = problem {
        panic!("parameters are checked before they come here: {problem}");
    }
}

/// Panics where the lists of a setup do not fit each other.
fn check(setup: &BodySetup) {
    let count = setup.tets.particles.len();
    assert!(
        setup.masses_kg.len() == count && setup.fixed.len() == count,
        "one mass and one flag a particle"
    );
    assert!(
        setup.masses_kg.iter().all(|&m| m.is_finite() && m > 0.0),
        "every particle has a mass"
    );
    assert!(
        (setup.activity.is_empty() || setup.activity.len() == count)
            && setup.activity.iter().all(|a| (0.0..=1.0).contains(a)),
        "one activity a particle, or none at all"
    );
    assert!(
        setup.fill.len() == setup.tets.tets.len() && setup.fill.iter().all(|&fill| fill > 0.0),
        "one share of tissue a tetrahedron, none 0"
    );
    assert!(
        setup.embedding.particles.len() == setup.embedding.weights.len(),
        "four weights a surface point"
    );
    assert!(
        (setup.triangles.iter().flatten())
            .all(|&point| (point as usize) < setup.embedding.particles.len()),
        "every corner of the surface is a point"
    );
    assert!(
        (setup.tets.tets.iter().chain(&setup.embedding.particles))
            .flatten()
            .all(|&particle| (particle as usize) < count),
        "every corner is a particle"
    );
}

/// Whether a tetrahedron has a volume to speak of: more than rounding of its longest edge.
fn is_sound(setup: &BodySetup, tet: usize) -> bool {
    let [a, b, c, d] = setup.tets.tets[tet].map(|particle| setup.tets.particles[particle as usize]);
    let longest = [b - a, c - a, d - a, c - b, d - b, d - c]
        .iter()
        .map(|edge| edge.length())
        .fold(0.0, f32::max);
    rest_volume_m3(&setup.tets, tet) > 1e-6 * f64::from(longest).powi(3)
}

/// Inverse masses [1/kg], 0 where a particle is held.
fn inverse_masses(setup: &BodySetup) -> Vec<f32> {
    (setup.masses_kg.iter().zip(&setup.fixed))
        .map(|(&mass, &fixed)| if fixed { 0.0 } else { 1.0 / mass })
        .collect()
}

#[cfg(test)]
mod tests;
