//! What is done to one body without a tool: it hangs, or it is wrecked.

use super::super::contender::Contender;
use super::super::held_body::{GRAVITY_M_S2, HeldBody};
use super::super::random::Random;
use super::super::sweep::{Cost, Row, finite};
use super::super::timing::{Clock, Times};
use super::fault::{BACK_RMS, Fault, judge};
use super::{Cell, Start, Statics};
use crate::geom::bounds;
use crate::sim::diagnose::{energy, volume_and_inverted};
use crate::sim::{Simulation, ToolInput};
use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

/// Time without any force, in which nothing may move [s].
const REST_S: f64 = 1.0;
/// Time of undamped release, in which no energy may be gained [s].
const RELEASE_S: f64 = 1.0;
/// Time of damping, after which a body of 10 kPa hangs still [s]; a softer one takes longer.
const SETTLE_S: f64 = 2.5;
/// Time in which a wrecked body must be back [s]; again of 10 kPa.
const RECOVER_S: f64 = 3.0;
/// Modulus and damping for which these times are [Pa], [1/s].
const MODULUS_PA: f64 = 1e4;
const DAMPING_PER_S: f64 = 10.0;
/// Energy is that of places rounded to f32; their rounding looks like so much, in the mean of it over
/// many tetrahedra, that the highest of a hundred frames stays below.
const ROUNDINGS: f64 = 2.0;

/// What is measured of a trial; absent where the trial has no such thing.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Measures {
    pub tets: usize,
    /// Edge of a regular tetrahedron of the mean volume, dx [m].
    pub edge_m: f64,
    /// h² (λ+2μ) / (ρ dx²): how far a pressure wave runs in a substep h, in edges, squared.
    pub stiffness_number: f64,
    /// What errors are against.
    pub oracle: String,
    /// The kind of the worst fault.
    pub fault: Option<Fault>,
    /// Frame in which a particle was frozen because it was not finite.
    pub not_finite_frame: Option<u32>,
    /// Largest distance from rest on the way, in body sizes.
    pub farthest_sizes: Option<f64>,
    /// Way without any force, in body sizes.
    pub drift_sizes: Option<f64>,
    /// Energy gained in undamped release beyond what rounding looks like, over the work of gravity
    /// down to the static sag.
    pub energy_growth_rel: Option<f64>,
    /// Sag of the tip over the static one.
    pub sag_ratio: Option<f64>,
    /// At the end.
    pub inverted_tets: Option<usize>,
    /// In the static solution: so many fold in truth as well.
    pub inverted_tets_oracle: Option<usize>,
    pub speed_left_m_s: Option<f64>,
    /// Volume off that of the static solution, or that at rest, at the end; as a share.
    pub volume_error_rel: Option<f64>,
    /// Frames from the wreck until the body stays near its settled state without a newly inverted
    /// tetrahedron.
    pub frames_to_recover: Option<u32>,
    /// RMS distance from the settled state at the end, in body sizes.
    pub rms_left_sizes: Option<f64>,
    /// Deepest surface point inside the tool, as a share of the thickness.
    pub penetration_share: Option<f64>,
    /// Whether the tool ended up inside the tissue.
    pub tunnelled: Option<bool>,
    /// Largest force on the tool [N].
    pub force_max_n: Option<f64>,
}

impl Cell {
    /// How much slower than a body of 10 kPa this one moves; 1 for stiffer ones.
    fn slowness(&self) -> f64 {
        (MODULUS_PA / self.youngs_modulus_pa).sqrt().max(1.0)
    }

    pub fn frames(&self, time_s: f64) -> u32 {
        (time_s / self.timestep_s).round() as u32
    }

    /// Frames in which this body comes to rest where one of 10 kPa takes so long.
    pub fn settling_frames(&self, time_s: f64) -> u32 {
        self.frames(time_s * self.slowness() * (DAMPING_PER_S / self.damping_per_s).max(1.0))
    }

    /// More would hold a soft body back.
    pub fn damped_per_s(&self) -> f32 {
        (self.damping_per_s / self.slowness()) as f32
    }
}

/// A body under way, watched.
pub struct Watched<'a> {
    body: &'a HeldBody,
    contender: Contender,
    pub simulation: Simulation,
    times: Times,
    frame: u32,
    not_finite_frame: Option<u32>,
    farthest_m: f64,
}

impl<'a> Watched<'a> {
    pub fn new(cell: &Cell, body: &'a HeldBody, gravity_m_s2: Vec3, damping_per_s: f32) -> Self {
        let mut setup = body.setup.clone();
        setup.gravity_m_s2 = gravity_m_s2;
        setup.damping_per_s = damping_per_s;
        let mut simulation = Simulation::new(setup, cell.params());
        cell.method.start(&mut simulation, cell.params());
        // Cells are measured side by side, each on a thread.
        simulation.set_threads(Some(1));
        Self {
            body,
            contender: cell.method,
            simulation,
            times: Times::default(),
            frame: 0,
            not_finite_frame: None,
            farthest_m: 0.0,
        }
    }

    pub fn step(&mut self, tools: &[ToolInput]) {
        // Asleep it would be still whatever it did before.
        self.simulation.wake();
        let clock = Clock::start();
        let frozen = self.simulation.step(tools).frozen_particles;
        self.contender.after_step(&mut self.simulation);
        self.times.add(clock);
        self.frame += 1;
        if frozen > 0 {
            self.not_finite_frame.get_or_insert(self.frame);
        }
        self.farthest_m = self
            .farthest_m
            .max(self.body.farthest_m(self.simulation.particles()));
    }

    pub fn steps(&mut self, frames: u32) {
        (0..frames).for_each(|_| self.step(&[]));
    }

    /// What every trial measures at its end.
    pub fn measures(&self, cell: &Cell, oracle: &str) -> Measures {
        let report = self.simulation.report();
        let edge_m = self.body.edge_m();
        let density = f64::from(super::DENSITY_KG_M3);
        let nu = cell.poisson_ratio;
        let pressure_modulus_pa =
            cell.youngs_modulus_pa * (1.0 - nu) / ((1.0 + nu) * (1.0 - 2.0 * nu));
        let wave_m = cell.substep_s() * (pressure_modulus_pa / density).sqrt();
        Measures {
            tets: self.body.setup.tets.tets.len(),
            edge_m,
            stiffness_number: (wave_m / edge_m).powi(2),
            oracle: oracle.to_owned(),
            not_finite_frame: self.not_finite_frame,
            farthest_sizes: finite(self.farthest_m / self.body.size_m),
            inverted_tets: Some(report.inverted_tets),
            speed_left_m_s: finite(f64::from(report.speed_max_m_s)),
            ..Measures::default()
        }
    }

    pub fn row(&self, cell: &Cell, mut measures: Measures) -> Row<Cell, Measures> {
        let (verdict, fault) = judge(&measures);
        measures.fault = fault;
        let wall = self.times.wall();
        Row {
            cell: cell.clone(),
            measures,
            cost: Cost {
                ms_p50: wall.map(|(median, _)| median),
                ms_p95: wall.map(|(_, p95)| p95),
            },
            verdict,
        }
    }
}

/// Rest, undamped release, damped settling.
pub fn hang(cell: &Cell, body: &HeldBody, statics: Option<&Statics>) -> Row<Cell, Measures> {
    let mut resting = Watched::new(cell, body, Vec3::ZERO, 0.0);
    resting.steps(cell.frames(REST_S));
    let mut hanging = Watched::new(cell, body, GRAVITY_M_S2, 0.0);
    let start_j = energy(&hanging.simulation).total_j();
    let mut highest_j = start_j;
    for _ in 0..cell.frames(RELEASE_S) {
        hanging.step(&[]);
        highest_j = highest_j.max(energy(&hanging.simulation).total_j());
    }
    (hanging.simulation).set_gravity_and_damping(GRAVITY_M_S2, cell.damped_per_s());
    hanging.steps(cell.settling_frames(SETTLE_S));
    let positions = hanging.simulation.particles();
    let mut measures = hanging.measures(cell, "Newton statics");
    measures.not_finite_frame = resting.not_finite_frame.or(measures.not_finite_frame);
    measures.drift_sizes = finite(resting.farthest_m / body.size_m);
    if let Some(statics) = statics {
        let settled_m = &statics.settled_m;
        let work_j = work_of_gravity_j(body, settled_m);
        let gained_j = (highest_j - start_j - ROUNDINGS * statics.rounding_j).max(0.0);
        measures.energy_growth_rel = finite(gained_j / work_j);
        measures.inverted_tets_oracle = Some(statics.inverted_tets);
        let sag_m = body.tip_of_oracle_m(settled_m).z;
        measures.sag_ratio = finite(body.tip_m(positions).z / sag_m);
        let still: Vec<Vec3> = settled_m.iter().map(|x| x.as_vec3()).collect();
        measures.volume_error_rel = volume_error(body, positions, &still);
    } else {
        measures.oracle = "no static solution".to_owned();
        measures.volume_error_rel = volume_error(body, positions, &body.setup.tets.particles);
    }
    hanging.row(cell, measures)
}

/// Σ m g·(x − rest) [J].
fn work_of_gravity_j(body: &HeldBody, positions: &[DVec3]) -> f64 {
    let rest = &body.setup.tets.particles;
    (body.setup.masses_kg.iter().zip(positions).zip(rest))
        .map(|((&mass, x), rest)| {
            f64::from(mass) * GRAVITY_M_S2.as_dvec3().dot(*x - rest.as_dvec3())
        })
        .sum()
}

/// Volume over that of `truth`, off by, over the volume at rest.
pub fn volume_error(body: &HeldBody, positions: &[Vec3], truth: &[Vec3]) -> Option<f64> {
    let tets = &body.setup.tets;
    let volume = |x: &[Vec3]| volume_and_inverted(x, &tets.tets).0;
    finite(((volume(positions) - volume(truth)) / volume(&tets.particles)).abs())
}

/// Settled, wrecked, let go: it is to come back to where it was, and that is to be where statics have it.
pub fn wreck(cell: &Cell, body: &HeldBody, statics: Option<&Statics>) -> Row<Cell, Measures> {
    let mut watched = Watched::new(cell, body, GRAVITY_M_S2, cell.damped_per_s());
    watched.steps(cell.settling_frames(SETTLE_S));
    let settled = watched.simulation.particles().to_vec();
    let tets = &body.setup.tets.tets;
    let inverted = volume_and_inverted(&settled, tets).1;
    let mut back_since = None;
    let mut rms = f64::INFINITY;
    let is_usable = settled.iter().all(|x| x.is_finite());
    if is_usable {
        let wrecked = wrecked(cell, body, &settled);
        let still = vec![Vec3::ZERO; wrecked.len()];
        watched.simulation.set_state(&wrecked, &still);
        for frame in 1..=cell.settling_frames(RECOVER_S) {
            watched.step(&[]);
            let positions = watched.simulation.particles();
            rms = rms_distance_m(positions, &settled) / body.size_m;
            let is_back = rms < BACK_RMS && volume_and_inverted(positions, tets).1 <= inverted;
            back_since = back_since.or(Some(frame)).filter(|_| is_back);
        }
    }
    let mut measures = watched.measures(cell, "its own settled state");
    measures.inverted_tets_oracle = is_usable.then_some(inverted);
    if let Some(statics) = statics {
        measures.oracle = "its own settled state, and Newton statics".to_owned();
        measures.inverted_tets_oracle = Some(statics.inverted_tets);
        let tip_m = body.tip_m(watched.simulation.particles());
        measures.sag_ratio = finite(tip_m.z / body.tip_of_oracle_m(&statics.settled_m).z);
    }
    measures.frames_to_recover = back_since;
    measures.rms_left_sizes = Some(if rms.is_finite() { rms } else { f64::MAX });
    // A particle pulled away by ten lengths was not thrown there by the method.
    let sizes = measures.farthest_sizes;
    measures.farthest_sizes = sizes.map(|sizes| match cell.start {
        Start::Pull => (sizes - 10.0).max(0.0),
        _ => sizes,
    });
    watched.row(cell, measures)
}

/// `settled` with every free particle put where the start of `cell` has it.
fn wrecked(cell: &Cell, body: &HeldBody, settled: &[Vec3]) -> Vec<Vec3> {
    let (low, high) = bounds(&body.setup.tets.particles);
    let middle = (low + high) / 2.0;
    let mut random = Random::new(u64::from(cell.seed) + 1);
    let mut x = settled.to_vec();
    for i in body.free() {
        match cell.start {
            Start::Rest | Start::Pull => {}
            Start::Random => x[i] = random.in_box(low, high),
            Start::Point => x[i] = middle,
            Start::Plane => x[i].z = middle.z,
        }
    }
    if cell.start == Start::Pull {
        let rest = &body.setup.tets.particles;
        let far = |i: &&usize| rest[**i].element_sum();
        let corner = body.tip().iter().max_by(|a, b| far(a).total_cmp(&far(b)));
        let corner = *corner.expect("a body has a tip");
        x[corner].x += 10.0 * body.size_m as f32;
    }
    x
}

fn rms_distance_m(a: &[Vec3], b: &[Vec3]) -> f64 {
    let squares = a
        .iter()
        .zip(b)
        .map(|(a, b)| (a.as_dvec3() - b.as_dvec3()).length_squared());
    (squares.sum::<f64>() / a.len() as f64).sqrt()
}

#[cfg(test)]
pub mod tests {
    use super::*;
    use crate::study::held_body::{Hold, beam};
    use crate::study::stability::{Deed, Mesh};
    use crate::study::sweep::State;

    pub fn cell() -> Cell {
        Cell {
            method: Contender::XpbdNeoHookean,
            mesh: Mesh::Regular,
            youngs_modulus_pa: 1e4,
            poisson_ratio: 0.45,
            timestep_s: 1.0 / 60.0,
            substeps: 10,
            iterations: 1,
            damping_per_s: 10.0,
            tool_speed_m_s: 0.0,
            deed: Deed::Poke,
            start: Start::Rest,
            seed: 0,
        }
    }

    pub fn small_beam(hold: Hold) -> HeldBody {
        HeldBody::new(beam(2), 1000.0, hold)
    }

    #[test]
    fn hanging_beam_is_compared_with_what_it_should_be() {
        let body = small_beam(Hold::End);
        let tissue = crate::study::oracle::Tissue {
            youngs_modulus_pa: 1e4,
            poisson_ratio: 0.45,
        };
        let settled_m = crate::study::oracle::settled_m(&body, tissue).expect("it comes to rest");
        let statics = |settled_m: &[DVec3]| Statics {
            settled_m: settled_m.to_vec(),
            inverted_tets: 0,
            rounding_j: 0.0,
        };
        let row = hang(&cell(), &body, Some(&statics(&settled_m)));
        let sag = row.measures.sag_ratio.expect("it sags");
        // Ten substeps on a coarse mesh are within some percent; half the truth is seen at once.
        assert!((0.9..1.1).contains(&sag), "{sag}");
        let half: Vec<DVec3> = (settled_m.iter().zip(&body.setup.tets.particles))
            .map(|(x, rest)| (*x + rest.as_dvec3()) / 2.0)
            .collect();
        let row = hang(&cell(), &body, Some(&statics(&half)));
        assert!(row.measures.sag_ratio.expect("it sags") > 1.8);
        assert_eq!(
            row.measures.fault,
            Some(Fault::TooSoft),
            "{}",
            row.verdict.why
        );
    }

    #[test]
    fn springs_with_too_long_a_substep_fail() {
        let explosive = Cell {
            method: Contender::MassSpring,
            youngs_modulus_pa: 1e6,
            substeps: 1,
            ..cell()
        };
        let row = hang(&explosive, &small_beam(Hold::End), None);
        assert_eq!(row.verdict.state, State::Failed, "{}", row.verdict.why);
    }

    #[test]
    fn pulled_beam_is_back_after_some_frames_and_not_at_once() {
        let pulled = Cell {
            start: Start::Pull,
            ..cell()
        };
        let row = wreck(&pulled, &small_beam(Hold::End), None);
        let frames = row.measures.frames_to_recover.expect(&row.verdict.why);
        assert!(frames > 1, "{frames}");
    }

    #[test]
    fn starts_are_what_they_say_and_hold_what_is_held() {
        let body = small_beam(Hold::End);
        let rest = body.setup.tets.particles.clone();
        for start in Start::ALL {
            let x = wrecked(&Cell { start, ..cell() }, &body, &rest);
            let moved = (0..x.len()).filter(|&i| x[i] != rest[i]).count();
            let free = body.free().count();
            match start {
                Start::Rest => assert_eq!(moved, 0),
                Start::Pull => assert_eq!(moved, 1),
                // Some are in the middle already.
                Start::Random | Start::Point | Start::Plane => {
                    assert!(moved > free / 2 && moved <= free, "{start:?}: {moved}");
                }
            }
            assert!((0..x.len()).all(|i| !body.setup.fixed[i] || x[i] == rest[i]));
        }
    }
}
