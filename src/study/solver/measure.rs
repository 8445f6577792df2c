//! One cell: the body settles, swings, and is timed.

use super::super::contender::Contender;
use super::super::held_body::HeldBody;
use super::super::oracle::Oracle;
use super::super::sweep::{Cost, Row, State, Verdict, finite};
use super::super::timing::{Clock, Times};
use super::Cell;
use super::limit::Limit;
use crate::measure::chart::number;
use crate::sim::Simulation;
use crate::sim::diagnose::volume_and_inverted;
use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

/// Frames of damped settling: the slowest mode has died away by a factor of 10⁵.
const SETTLE_FRAMES: u32 = 150;
/// Damping of the settling [1/s]; moves no equilibrium.
const SETTLE_DAMPING_PER_S: f32 = 10.0;
/// Frames of the undamped swing: five swings of the soft beam.
pub const SWING_FRAMES: usize = 125;
/// The same of a large mesh, for its time alone, and for the time on two threads.
const TIMED_FRAMES: usize = 30;
/// Frames before the clock counts: caches fill and threads start.
const WARM_UP_FRAMES: usize = 5;
/// A swing is a lowest point below this share of the deepest one.
const SWING_SHARE: f64 = 0.6;

/// A particle farther from rest than this many body sizes was thrown away.
const THROWN_SIZES: f64 = 20.0;
/// Errors and speeds up to the first are fine, up to the second degraded, beyond failed.
const TIP_ERROR_BOUNDS: [f64; 2] = [0.02, 0.2];
const SPEED_BOUNDS_M_S: [f64; 2] = [1e-3, 0.1];

/// What is measured of a cell. Errors are magnitudes, relative to the oracle.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measures {
    pub tets: usize,
    /// What the errors are against.
    pub oracle: String,
    /// Height of the tip over its rest, settled [m], and the oracle's.
    pub tip_m: Option<f64>,
    pub tip_oracle_m: f64,
    pub tip_error_rel: Option<f64>,
    /// RMS distance of all particles from the oracle's, over the oracle's RMS displacement.
    pub field_rms_error_rel: Option<f64>,
    /// Lowest point of the first swing [m], and the oracle's.
    pub swing_m: Option<f64>,
    pub swing_oracle_m: Option<f64>,
    pub swing_error_rel: Option<f64>,
    /// Frame of that point, and the oracle's.
    pub swing_frame: Option<usize>,
    pub swing_oracle_frame: Option<usize>,
    /// Fifth swing over the first, and the oracle's.
    pub fifth_swing_ratio: Option<f64>,
    pub fifth_swing_oracle_ratio: Option<f64>,
    /// Tetrahedra of negative volume, settled.
    pub inverted_tets: usize,
    /// Fastest particle, settled [m/s].
    pub speed_left_m_s: Option<f64>,
    /// Difference to the oracle's volume, settled, over the rest volume.
    pub volume_error_rel: Option<f64>,
    /// Longest substep that keeps the body together [s], found by bisection; absent if one a frame
    /// does, or none was found. Beside it the estimate of the method.
    pub stable_substep_s: Option<f64>,
    pub stable_substep_estimate_s: Option<f64>,
    /// Processor time of a frame on one thread, median [ms]: what a quiet machine would need.
    pub cpu_ms_p50: Option<f64>,
    /// Wall time of a frame on two threads, median [ms].
    pub ms_p50_two_threads: Option<f64>,
}

/// Measures one cell.
pub fn row(
    cell: &Cell,
    body: &HeldBody,
    oracle: &Oracle,
    limit: Limit,
    threads: usize,
) -> Row<Cell, Measures> {
    let mut simulation = Simulation::new(body.setup.clone(), cell.params());
    cell.method.start(&mut simulation, cell.params());
    simulation.set_threads(Some(1));
    let swing_frames = if oracle.swing_m.is_empty() {
        TIMED_FRAMES
    } else {
        SWING_FRAMES
    };
    let swung = swing(&mut simulation, cell.method, body, swing_frames);
    let two_threads = (threads >= 2).then(|| {
        simulation.reset();
        cell.method.start(&mut simulation, cell.params());
        simulation.set_threads(Some(2));
        swing(&mut simulation, cell.method, body, TIMED_FRAMES)
            .times
            .wall()
    });
    let settled = settle(body, cell);
    let oracle_tip_m = body.tip_of_oracle_m(&oracle.settled_m).z;
    let ours = Swings::of(&swung.tip_m);
    let theirs = Swings::of(&oracle.swing_m);
    let swing_error = relative(ours.first_m(), theirs.first_m());
    let has_burst = settled.has_burst(body) || swung.has_burst(body);
    let tip_error = relative(finite(settled.tip_m), Some(oracle_tip_m)).filter(|_| !has_burst);
    let measures = Measures {
        tets: body.setup.tets.tets.len(),
        oracle: if theirs.lowest.is_empty() {
            "Newton statics".to_owned()
        } else {
            "Newton statics, implicit midpoint".to_owned()
        },
        tip_m: finite(settled.tip_m),
        tip_oracle_m: oracle_tip_m,
        tip_error_rel: tip_error,
        field_rms_error_rel: finite(field_error(&settled.positions, &oracle.settled_m, body))
            .filter(|_| !has_burst),
        swing_m: ours.first_m(),
        swing_oracle_m: theirs.first_m(),
        swing_error_rel: swing_error,
        swing_frame: ours.first_frame(),
        swing_oracle_frame: theirs.first_frame(),
        fifth_swing_ratio: ours.fifth_ratio(),
        fifth_swing_oracle_ratio: theirs.fifth_ratio(),
        inverted_tets: settled.inverted_tets,
        speed_left_m_s: finite(settled.speed_m_s),
        volume_error_rel: finite(volume_error(&settled.positions, &oracle.settled_m, body)),
        stable_substep_s: limit.found_s,
        stable_substep_estimate_s: limit.estimate_s,
        cpu_ms_p50: swung.times.cpu().map(|(median, _)| median),
        ms_p50_two_threads: two_threads.flatten().map(|(median, _)| median),
    };
    let wall = swung.times.wall();
    Row {
        cell: cell.clone(),
        verdict: verdict(&settled, &swung, tip_error, body),
        measures,
        cost: Cost {
            ms_p50: wall.map(|(median, _)| median),
            ms_p95: wall.map(|(_, p95)| p95),
        },
    }
}

/// The body after its damped settling.
struct Settled {
    positions: Vec<Vec3>,
    tip_m: f64,
    speed_m_s: f64,
    inverted_tets: usize,
    frozen: usize,
    farthest_m: f64,
}

impl Settled {
    /// Whether parts of it were thrown away.
    fn has_burst(&self, body: &HeldBody) -> bool {
        self.frozen > 0 || self.farthest_m >= THROWN_SIZES * body.size_m
    }
}

fn settle(body: &HeldBody, cell: &Cell) -> Settled {
    let mut setup = body.setup.clone();
    setup.damping_per_s = SETTLE_DAMPING_PER_S;
    let mut simulation = Simulation::new(setup, cell.params());
    cell.method.start(&mut simulation, cell.params());
    simulation.set_threads(Some(1));
    for _ in 0..SETTLE_FRAMES {
        // Asleep it would be still whatever it did before.
        simulation.wake();
        simulation.step(&[]);
        cell.method.after_step(&mut simulation);
    }
    let report = simulation.report();
    let positions = simulation.particles().to_vec();
    Settled {
        tip_m: body.tip_m(&positions).z,
        speed_m_s: f64::from(report.speed_max_m_s),
        inverted_tets: report.inverted_tets,
        frozen: report.frozen_particles,
        farthest_m: body.farthest_m(&positions),
        positions,
    }
}

/// An undamped release.
struct Swung {
    /// Height of the tip over its rest [m], from the start on.
    tip_m: Vec<f64>,
    times: Times,
    frozen: usize,
    farthest_m: f64,
}

impl Swung {
    /// Whether parts of it were thrown away.
    fn has_burst(&self, body: &HeldBody) -> bool {
        self.frozen > 0 || self.farthest_m >= THROWN_SIZES * body.size_m
    }
}

fn swing(
    simulation: &mut Simulation,
    contender: Contender,
    body: &HeldBody,
    frames: usize,
) -> Swung {
    let mut tip_m = vec![body.tip_m(simulation.particles()).z];
    let mut times = Times::default();
    let mut farthest = 0.0_f64;
    for frame in 0..frames {
        // A stiff body is soon calm, and would cost nothing asleep.
        simulation.wake();
        let clock = Clock::start();
        simulation.step(&[]);
        contender.after_step(simulation);
        if frame >= WARM_UP_FRAMES {
            times.add(clock);
        }
        tip_m.push(body.tip_m(simulation.particles()).z);
        farthest = farthest.max(body.farthest_m(simulation.particles()));
    }
    Swung {
        tip_m,
        times,
        frozen: simulation.report().frozen_particles,
        farthest_m: farthest,
    }
}

/// The lowest points of a swing.
struct Swings {
    /// Frame and height [m].
    lowest: Vec<(usize, f64)>,
}

impl Swings {
    fn of(tip_m: &[f64]) -> Self {
        let deepest = tip_m.iter().copied().fold(0.0, f64::min);
        let is_lowest = |&k: &usize| {
            tip_m[k] < tip_m[k - 1] && tip_m[k] <= tip_m[k + 1] && tip_m[k] < SWING_SHARE * deepest
        };
        let inner = 1..tip_m.len().saturating_sub(1);
        Self {
            lowest: inner.filter(is_lowest).map(|k| (k, tip_m[k])).collect(),
        }
    }

    fn first_frame(&self) -> Option<usize> {
        self.lowest.first().map(|(frame, _)| *frame)
    }

    fn first_m(&self) -> Option<f64> {
        self.lowest.first().and_then(|(_, tip_m)| finite(*tip_m))
    }

    fn fifth_ratio(&self) -> Option<f64> {
        let (_, fifth) = self.lowest.get(4)?;
        finite(fifth / self.first_m()?)
    }
}

/// |value / truth − 1|.
fn relative(value: Option<f64>, truth: Option<f64>) -> Option<f64> {
    finite((value? / truth? - 1.0).abs())
}

fn field_error(positions: &[Vec3], oracle: &[DVec3], body: &HeldBody) -> f64 {
    let rest = &body.setup.tets.particles;
    let (mut off, mut moved) = (0.0, 0.0);
    for ((x, truth), rest) in positions.iter().zip(oracle).zip(rest) {
        off += (x.as_dvec3() - *truth).length_squared();
        moved += (*truth - rest.as_dvec3()).length_squared();
    }
    (off / moved).sqrt()
}

fn volume_error(positions: &[Vec3], oracle: &[DVec3], body: &HeldBody) -> f64 {
    let tets = &body.setup.tets;
    let oracle: Vec<Vec3> = oracle.iter().map(|x| x.as_vec3()).collect();
    let volume = |positions: &[Vec3]| volume_and_inverted(positions, &tets.tets).0;
    ((volume(positions) - volume(&oracle)) / volume(&tets.particles)).abs()
}

fn verdict(settled: &Settled, swung: &Swung, tip_error: Option<f64>, body: &HeldBody) -> Verdict {
    let mut faults = Vec::new();
    let frozen = settled.frozen.max(swung.frozen);
    if frozen > 0 {
        faults.push((State::Failed, format!("{frozen} particles not finite")));
    }
    let has_burst = settled.has_burst(body) || swung.has_burst(body);
    if has_burst {
        faults.push((State::Failed, "explodes".to_owned()));
    }
    if settled.inverted_tets > 0 {
        let why = format!("{} tetrahedra inverted at rest", settled.inverted_tets);
        faults.push((State::Failed, why));
    }
    match tip_error {
        // How far pieces lie apart says nothing.
        _ if has_burst => {}
        None => faults.push((State::Failed, "no settled tip".to_owned())),
        Some(error) => {
            let why = || format!("settles {} % off", number(100.0 * error));
            faults.extend(beyond(error, TIP_ERROR_BOUNDS).map(|state| (state, why())));
        }
    }
    let speed = settled.speed_m_s;
    let why = || format!("does not settle: {} m/s left", number(speed));
    faults.extend(beyond(speed, SPEED_BOUNDS_M_S).map(|state| (state, why())));
    Verdict::of(faults)
}

/// What a value beyond the first or the second bound is.
fn beyond(value: f64, [fine, degraded]: [f64; 2]) -> Option<State> {
    if value <= fine {
        None
    } else if value <= degraded {
        Some(State::Degraded)
    } else {
        Some(State::Failed)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::held_body::{Hold, beam};

    #[test]
    fn swings_are_found_with_their_frames_and_decay() {
        // 24 frames a swing, decaying by 2 % each.
        let tip: Vec<f64> = (0..=125)
            .map(|frame| {
                let turns = f64::from(frame) / 24.0;
                -0.05 * 0.98_f64.powf(turns) * (1.0 - (std::f64::consts::TAU * turns).cos())
            })
            .collect();
        let swings = Swings::of(&tip);
        assert_eq!(swings.first_frame(), Some(12));
        assert_eq!(swings.lowest.len(), 5);
        // Four swings later: 0.98⁴, and the lowest point is a frame at most from the true one.
        assert!((swings.fifth_ratio().unwrap() - 0.98_f64.powi(4)).abs() < 2e-3);
        assert_eq!(Swings::of(&[]).first_m(), None);
        assert_eq!(Swings::of(&[0.0, f64::NAN, f64::NAN]).first_m(), None);
    }

    #[test]
    fn error_grows_with_distance_from_the_oracle_and_is_zero_on_it() {
        let beam = HeldBody::new(beam(2), 1000.0, Hold::End);
        let rest = &beam.setup.tets.particles;
        let truth: Vec<DVec3> = rest
            .iter()
            .map(|x| x.as_dvec3() - DVec3::Z * 0.01)
            .collect();
        let on_it: Vec<Vec3> = truth.iter().map(|x| x.as_vec3()).collect();
        // Single precision places of a body of 0.1 m, over a displacement of 0.01 m.
        assert!(field_error(&on_it, &truth, &beam) < 1e-6);
        assert!((field_error(rest, &truth, &beam) - 1.0).abs() < 1e-6);
    }

    #[test]
    fn lost_particle_and_bad_tip_are_failures() {
        let beam = HeldBody::new(beam(2), 1000.0, Hold::End);
        let settled = |speed_m_s: f64, farthest_m: f64| Settled {
            positions: Vec::new(),
            tip_m: -0.05,
            speed_m_s,
            inverted_tets: 0,
            frozen: 0,
            farthest_m,
        };
        let swung = Swung {
            tip_m: Vec::new(),
            times: Times::default(),
            frozen: 0,
            farthest_m: 0.1,
        };
        let state = |settled: &Settled, error| verdict(settled, &swung, error, &beam).state;
        assert_eq!(state(&settled(0.0, 0.05), Some(0.001)), State::Fine);
        assert_eq!(state(&settled(0.0, 0.05), Some(0.1)), State::Degraded);
        assert_eq!(state(&settled(0.0, 0.05), None), State::Failed);
        assert_eq!(state(&settled(f64::NAN, 0.05), Some(0.001)), State::Failed);
        assert_eq!(state(&settled(0.0, 1e3), Some(0.001)), State::Failed);
    }
}
