//! A running scene: one path for a frame, the same in window and replay.

use super::AppError;
use super::load::{self, LoadedBody};
use super::script::Script;
use crate::geom::SurfaceMesh;
use crate::geom::paint::OwnPictures;
use crate::geom::ray::nearest_point;
use crate::passes::tools::DrawnTool;
use crate::scene::{BeatSection, MarkerSection, RestBox, Scene};
use crate::sim::{
    HandOver, Method, Simulation, SolverParams, StepReport, ToolAction, ToolInput, ToolShape,
};
use glam::{DVec3, Vec3};
use sha2::{Digest, Sha256};
use std::time::Instant;

/// A body, its script and its time.
pub struct Session {
    /// What runs.
    pub scene: Scene,
    /// The surface at rest.
    pub mesh: SurfaceMesh,
    /// The box around it.
    pub rest: RestBox,
    /// Edge of the lattice's cubes [m]; `None` for a body of given tetrahedra.
    pub cell_m: Option<f32>,
    /// The pictures that its file brought.
    pub pictures: OwnPictures,
    /// What was guessed or repaired while loading.
    pub notes: Vec<String>,
    /// Whether the scripted tools move; without it they are not there.
    pub script_plays: bool,
    /// The tool in the user's hand, if any.
    pub hand: Option<ToolInput>,
    simulation: Simulation,
    script: Script,
    markers: Vec<Marker>,
    frame: u32,
    /// When and why another solver took the place of the scene's.
    handed_over: Option<(u32, HandOver)>,
    /// The scene's solver when that was last decided.
    decided_for: SolverParams,
}

/// What one time step did.
#[derive(Clone, Debug)]
pub struct Tick {
    /// What the simulation reports.
    pub report: StepReport,
    /// Wall time of the step [ms].
    pub sim_ms: f32,
    /// The tools as they were at the end of the step: the script's, then the hand.
    pub tools: Vec<ToolInput>,
}

/// A followed place.
#[derive(Clone, Debug)]
pub struct Marker {
    /// Name in `summary.json`.
    pub name: String,
    /// Surface points whose mean is followed.
    points: Vec<u32>,
    /// Where it was at rest [m].
    pub rest_m: Vec3,
}

impl Session {
    /// Loads the body of `scene` and places its script.
    ///
    /// # Errors
    ///
    /// [`AppError`] naming the file or the key that is wrong.
    pub fn new(scene: Scene, threads: usize) -> Result<Self, AppError> {
        let LoadedBody {
            mesh,
            rest,
            setup,
            cell_m,
            pictures,
            notes,
        } = load::body(&scene)?;
        let markers = scene
            .markers
            .iter()
            .map(|section| Marker::new(section, &mesh, &rest))
            .collect::<Result<_, _>>()?;
        let mut simulation = Simulation::new(setup, scene.solver);
        simulation.set_threads(Some(threads));
        let cause = HandOver::at_start(&mut simulation);
        simulation.set_beat(BeatSection::beat(scene.body.beat.as_ref()));
        let mut notes = notes;
        notes.extend(solver_notes(&scene, &simulation));
        Ok(Self {
            script: Script::new(&scene.tools, &mesh, &rest),
            simulation,
            script_plays: true,
            hand: None,
            frame: 0,
            handed_over: cause.map(|cause| (0, cause)),
            decided_for: scene.solver,
            scene,
            mesh,
            rest,
            cell_m,
            pictures,
            notes,
            markers,
        })
    }

    /// Runs one time step.
    pub fn tick(&mut self) -> Tick {
        self.frame += 1;
        let tools = self.tools_now();
        let start = Instant::now();
        let report = self.simulation.step(&tools);
        if let Some(cause) = HandOver::after_step(&mut self.simulation) {
            self.note_hand_over(cause);
        }
        Tick {
            report,
            sim_ms: start.elapsed().as_secs_f32() * 1e3,
            tools,
        }
    }

    /// Says once why the body was handed over, and what is done from here on.
    fn note_hand_over(&mut self, cause: HandOver) {
        let why = match cause {
            HandOver::TooStiff => "the tissue was too stiff for",
            HandOver::WavesGrew => "waves grew in the tissue, which is too stiff for",
            HandOver::Folded => "some of the tissue had been inside out for half a second by",
            HandOver::Trembled => {
                "some of the tissue had trembled for half a second, as poor tetrahedra do by"
            }
        };
        self.handed_over = Some((self.frame, cause));
        let taken = self.solver();
        let note = format!(
            "in frame {} {why} {} in {}: from there on {} is taken, in {}",
            self.frame,
            self.scene.solver.method.name(),
            substeps(self.scene.solver.substeps),
            taken.method.name(),
            substeps(taken.substeps),
        );
        // The same run after a reset says the same.
        if !self.notes.contains(&note) {
            self.notes.push(note);
        }
    }

    /// The tools as they are at this time: the script's, then the hand. Each keeps its place in the
    /// list, so that letting go is a change of action.
    pub fn tools_now(&self) -> Vec<ToolInput> {
        let mut tools = self.script.at(self.time_s());
        if !self.script_plays {
            for tool in &mut tools {
                tool.action = ToolAction::Idle;
            }
        }
        tools.push(self.hand.unwrap_or(ABSENT_HAND));
        tools
    }

    /// How deep the front of the first scripted tool with an approach is below the surface at rest
    /// [m]; `None` without such a tool.
    pub fn tool_depth_m(&self) -> Option<f32> {
        self.script.depth_m(self.time_s())
    }

    /// The tools that can be seen: those of a script that plays, and a hand that does something.
    pub fn visible_tools(&self) -> Vec<DrawnTool> {
        let tools = self.tools_now();
        let hand = tools.len() - 1;
        tools
            .into_iter()
            .enumerate()
            .filter(|&(index, tool)| {
                if index == hand {
                    tool.action != ToolAction::Idle
                } else {
                    self.script_plays
                }
            })
            .map(|(_, tool)| DrawnTool {
                tip_m: tool.position_m,
                axis_m: tool.shape.axis_m(),
                radius_m: tool.shape.radius_m(),
            })
            .collect()
    }

    /// Back to rest at time 0.
    pub fn reset(&mut self) {
        self.frame = 0;
        self.simulation.reset();
        self.set_gravity_and_damping();
        // What the run has shown is forgotten with it.
        self.take_scenes_solver();
    }

    /// Takes over changed knobs of the solver, gravity and damping. A body that has shown that it needs `implicit` keeps
    /// it, with a changed material too, until the method or its steps are changed.
    pub fn set_solver(&mut self) {
        self.set_gravity_and_damping();
        let (asked, before) = (self.scene.solver, self.decided_for);
        if asked == before {
            return;
        }
        let shown = self
            .handed_over
            .filter(|(_, cause)| *cause != HandOver::TooStiff);
        self.take_scenes_solver();
        let same_steps = SolverParams {
            youngs_modulus_pa: before.youngs_modulus_pa,
            poisson_ratio: before.poisson_ratio,
            ..asked
        } == before;
        if let (Some((frame, cause)), None, true) = (shown, self.handed_over, same_steps) {
            self.handed_over = Some((frame, cause.take(&mut self.simulation)));
        }
    }

    fn set_gravity_and_damping(&mut self) {
        let body = &self.scene.body;
        self.simulation
            .set_gravity_and_damping(body.gravity_m_s2, body.damping_per_s);
    }

    /// The scene's solver, or `implicit` where the material alone asks for that.
    fn take_scenes_solver(&mut self) {
        self.decided_for = self.scene.solver;
        self.simulation.set_params(self.scene.solver);
        let cause = HandOver::at_start(&mut self.simulation);
        self.handed_over = cause.map(|cause| (self.frame, cause));
    }

    /// Takes over a changed heartbeat.
    pub fn set_beat(&mut self) {
        let section = self.scene.body.beat.as_ref();
        self.simulation.set_beat(BeatSection::beat(section));
    }

    /// Method, material and time step that are taken: the scene's, or `implicit` if its tissue asks for that.
    pub fn solver(&self) -> SolverParams {
        self.simulation.params()
    }

    /// The frame from which on another solver is taken than the scene's, 0 from the start; `None` if it is that.
    pub fn handed_over_frame(&self) -> Option<u32> {
        self.handed_over.map(|(frame, _)| frame)
    }

    /// Why it is taken.
    pub fn handed_over_for(&self) -> Option<HandOver> {
        self.handed_over.map(|(_, cause)| cause)
    }

    /// Time steps since the start.
    pub fn frame(&self) -> u32 {
        self.frame
    }

    /// Simulated time [s].
    pub fn time_s(&self) -> f32 {
        self.frame as f32 * self.scene.solver.timestep_s
    }

    /// Simulated time a step ago [s].
    pub fn time_before_s(&self) -> f32 {
        self.frame.saturating_sub(1) as f32 * self.scene.solver.timestep_s
    }

    /// Where the surface points are [m].
    pub fn points(&self) -> &[Vec3] {
        self.simulation.points()
    }

    /// The body in time.
    pub fn simulation(&self) -> &Simulation {
        &self.simulation
    }

    /// Number of tetrahedra.
    pub fn tet_count(&self) -> usize {
        self.simulation.tet_count()
    }

    /// SHA-256 of the particle positions, as little-endian f32, in hexadecimal.
    pub fn state_sha256(&self) -> String {
        let mut hash = Sha256::new();
        for x in self.simulation.particles() {
            for component in x.to_array() {
                hash.update(component.to_le_bytes());
            }
        }
        hash.finalize().iter().map(|b| format!("{b:02x}")).collect()
    }

    /// Each followed place, and where it is now [m].
    pub fn markers(&self) -> impl Iterator<Item = (&Marker, Vec3)> {
        self.markers
            .iter()
            .map(|marker| (marker, mean(&marker.points, self.points())))
    }
}

/// "1 substep", "4 substeps".
pub fn substeps(count: u32) -> String {
    let plural = if count == 1 { "" } else { "s" };
    format!("{count} substep{plural}")
}

/// What a user should know before trusting the solver with this body.
fn solver_notes(scene: &Scene, simulation: &Simulation) -> Vec<String> {
    let mut notes = Vec::new();
    if scene.solver.method == Method::MassSpring {
        let substep_s = scene.solver.substep_s();
        notes.push("mass-spring has a Poisson ratio of 1/4, whatever is asked for".to_owned());
        if let Some(stable_s) = simulation.stable_substep_s()
            && substep_s > stable_s
        {
            notes.push(format!(
                "mass-spring is sure to be stable only below a substep of {stable_s:.1e} s and has \
                 {substep_s:.1e} s: use {} substeps or a softer material",
                (scene.solver.timestep_s / stable_s).ceil()
            ));
        }
    }
    let (asked, taken) = (scene.solver, simulation.params());
    if taken.method != asked.method {
        notes.push(format!(
            "tissue of {:.0} Pa is too stiff for {} in {} on this mesh, and would sag too far or tremble: \
             {} is taken, in {}",
            asked.youngs_modulus_pa,
            asked.method.name(),
            substeps(asked.substeps),
            taken.method.name(),
            substeps(taken.substeps),
        ));
    }
    let setup = simulation.setup();
    if !setup.fixed.contains(&true) {
        notes.push("nothing holds the body: body.fixed reaches no particle of it".to_owned());
    }
    notes
}

/// A hand that holds nothing: far away, doing nothing.
const ABSENT_HAND: ToolInput = ToolInput {
    shape: ToolShape::Sphere { radius_m: 0.0 },
    position_m: Vec3::ZERO,
    action: ToolAction::Idle,
    friction: 0.0,
};

impl Marker {
    fn new(section: &MarkerSection, mesh: &SurfaceMesh, rest: &RestBox) -> Result<Self, AppError> {
        let points = match rest.place(section.nearest_m, section.nearest_share) {
            Some(place) => nearest_point(place, &mesh.points)
                .map(|i| vec![i as u32])
                .unwrap_or_default(),
            None => {
                let corner = |k: usize| {
                    rest.place(
                        section.mean_box_m.map(|b| b[k]),
                        section.mean_box_share.map(|b| b[k]),
                    )
                    .expect("a checked marker has a place")
                };
                let (low, high) = (corner(0), corner(1));
                (0..mesh.points.len() as u32)
                    .filter(|&i| {
                        let x = mesh.points[i as usize];
                        x.cmpge(low).all() && x.cmple(high).all()
                    })
                    .collect()
            }
        };
        if points.is_empty() {
            return Err(AppError::Body(format!(
                "marker {} follows no point of the surface: make its box larger",
                section.name
            )));
        }
        Ok(Self {
            name: section.name.clone(),
            rest_m: mean(&points, &mesh.points),
            points,
        })
    }
}

/// Summed in f64: a settled tip is compared to a ten-thousandth of its way.
fn mean(indices: &[u32], points: &[Vec3]) -> Vec3 {
    let sum: DVec3 = (indices.iter())
        .map(|&i| points[i as usize].as_dvec3())
        .sum();
    (sum / indices.len() as f64).as_vec3()
}
