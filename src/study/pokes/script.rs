//! One simulation: poke after poke at random places, each looked at when it is over.

use super::super::contender::Contender;
use super::super::random::Random;
use super::super::sweep::{Cost, Row, State, Verdict, finite};
use super::super::timing::{Clock, Times};
use super::depth::depth_m;
use super::{Cell, Shape};
use crate::app::{AppError, LoadedBody};
use crate::geom::ray::first_hit;
use crate::measure::chart::number;
use crate::sim::{Simulation, SolverParams, ToolAction, ToolInput, ToolShape};
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// Radius of the tool, as shares of the body's longest extent.
const RADIUS_SHARES: [f32; 2] = [0.03, 0.08];
/// How deep the front goes, as shares of the thickness there, and at most of the extent.
const DEPTH_SHARES: [f32; 2] = [0.1, 0.35];
const DEPTH_EXTENT_MAX: f32 = 0.12;
/// Tissue thinner than this share of the extent is a border, not a place to poke.
const THICKNESS_SHARE_MIN: f32 = 0.08;
/// Between tool and tissue at the start, in radii.
const GAP_RADII: f32 = 0.1;
/// How far off the normal a poke may come: the tangent of 30°.
const TILT_MAX: f32 = 0.58;
/// Frames at the deepest place, and after the tool has left.
const HOLD_FRAMES: u32 = 6;
const AFTER_FRAMES: u32 = 40;
/// Frames in which a body comes to rest before the first poke and after the last.
const REST_FRAMES: u32 = 180;
/// A slow tool is withdrawn faster than it came [m/s].
const WITHDRAWAL_MIN_M_S: f32 = 0.1;
/// Places that are tried for one poke.
const TRIES_MAX: u32 = 1000;
const FRICTION: f32 = 0.3;
/// Length of the axis of a rod, in radii.
const ROD_RADII: f32 = 4.0;
/// Share of the thickness from which on a tool is inside: the goal, and what nobody would overlook.
const PENETRATION_BOUNDS: [f64; 2] = [0.01, 0.1];
/// Share of the extent from which on a body is not back at rest: what a pixel would tell, and what
/// nobody would overlook.
const OFF_REST_BOUNDS: [f64; 2] = [0.001, 0.01];
/// Speed left that is not rest [m/s].
const SPEED_LEFT_MAX_M_S: f64 = 1e-3;

/// What is measured of the pokes of a cell.
#[derive(Clone, Debug, Default, PartialEq, Serialize, Deserialize)]
pub struct Measures {
    pub tets: usize,
    /// What the faults are found by.
    pub oracle: String,
    /// Pokes in which a particle was frozen because it was not finite.
    pub not_finite: u32,
    /// Pokes after which tetrahedra stay inverted.
    pub lasting_inversions: u32,
    /// Pokes in which a part of the tool's axis was inside the surface after any frame.
    pub tunnelled: u32,
    /// Pokes in which the tool reached deeper into the surface than 1 % of the thickness.
    pub too_deep: u32,
    /// Deepest that the tool reached into the surface, as a share of the thickness.
    pub penetration_share_max: Option<f64>,
    /// Inverted at any time, and at the end.
    pub inverted_tets_max: usize,
    pub inverted_tets: usize,
    /// Largest force on the tool [N].
    pub force_max_n: Option<f64>,
    /// How far a point is from where it was before the first poke at most, once the body has come to
    /// rest, as a share of the longest extent.
    pub off_rest_share: Option<f64>,
    /// Fastest particle at the end [m/s].
    pub speed_left_m_s: Option<f64>,
}

/// Where a poke comes from and how deep it goes.
#[derive(Clone, Copy, Debug)]
struct Poke {
    radius_m: f32,
    /// From the tip to the other end of the tool's axis; zero for a ball.
    axis_m: Vec3,
    /// Middle of the tip before it touches.
    from_m: Vec3,
    /// Unit direction of its way.
    direction: Vec3,
    /// Length of its way.
    way_m: f32,
    thickness_m: f32,
}

/// Pokes the body of a cell.
///
/// # Errors
///
/// [`AppError::Body`] if the body has no place to poke.
pub fn run(
    cell: &Cell,
    body: &LoadedBody,
    params: SolverParams,
) -> Result<Row<Cell, Measures>, AppError> {
    let mut simulation = Simulation::new(body.setup.clone(), params);
    // Cells are measured side by side, each on a thread.
    simulation.set_threads(Some(1));
    cell.method.start(&mut simulation, params);
    let mut random = Random::new(seed(cell));
    let mut times = Times::default();
    let mut measures = Measures {
        tets: simulation.tet_count(),
        oracle: "invariants".to_owned(),
        ..Measures::default()
    };
    rest(&mut simulation, cell.method);
    let at_rest = simulation.points().to_vec();
    let places = Places::new(body, &at_rest);
    for _ in 0..cell.pokes {
        let poke = places.choose(cell.shape, &mut random).ok_or_else(|| {
            AppError::Body(format!("{}: no place on it can be poked", cell.scene))
        })?;
        let frozen_before = simulation.report().frozen_particles;
        let watched = poke_once(
            &mut simulation,
            cell.method,
            &places,
            &poke,
            cell.speed_m_s,
            &mut times,
        );
        let report = simulation.report();
        measures.not_finite += u32::from(report.frozen_particles > frozen_before);
        measures.lasting_inversions += u32::from(report.inverted_tets > 0);
        measures.tunnelled += u32::from(watched.tunnelled);
        let share = watched.penetration_m / f64::from(poke.thickness_m);
        measures.too_deep += u32::from(share > PENETRATION_BOUNDS[0]);
        let deepest = measures.penetration_share_max.unwrap_or(0.0).max(share);
        measures.penetration_share_max = finite(deepest);
        measures.inverted_tets_max = measures.inverted_tets_max.max(watched.inverted_tets_max);
        let force = measures
            .force_max_n
            .unwrap_or(0.0)
            .max(f64::from(watched.force_max_n));
        measures.force_max_n = finite(force);
    }
    rest(&mut simulation, cell.method);
    let off_m = (simulation.points().iter().zip(&at_rest))
        .map(|(x, rest)| x.distance(*rest))
        .fold(0.0, f32::max);
    measures.off_rest_share = finite(f64::from(off_m / places.extent_m));
    let report = simulation.report();
    measures.inverted_tets = report.inverted_tets;
    measures.speed_left_m_s = finite(f64::from(report.speed_max_m_s));
    let wall = times.wall();
    Ok(Row {
        cell: cell.clone(),
        verdict: verdict(&measures),
        measures,
        cost: Cost {
            ms_p50: wall.map(|(median, _)| median),
            ms_p95: wall.map(|(_, p95)| p95),
        },
    })
}

/// Lets the body come to rest by itself.
fn rest(simulation: &mut Simulation, contender: Contender) {
    for _ in 0..REST_FRAMES {
        simulation.step(&[]);
        contender.after_step(simulation);
    }
}

/// Another one for every cell, and the same one wherever it is measured.
fn seed(cell: &Cell) -> u64 {
    // FNV-1a over what tells cells apart, except the method: all methods get the same pokes.
    let text = format!(
        "{} {} {} {}",
        cell.scene,
        cell.shape.name(),
        cell.speed_m_s,
        cell.batch
    );
    text.bytes().fold(0xcbf2_9ce4_8422_2325, |hash, byte| {
        (hash ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3)
    })
}

impl Poke {
    fn shape(&self) -> ToolShape {
        let (radius_m, axis_m) = (self.radius_m, self.axis_m);
        if axis_m == Vec3::ZERO {
            ToolShape::Sphere { radius_m }
        } else {
            ToolShape::Capsule { radius_m, axis_m }
        }
    }

    /// How deep the tool with its tip at `tip_m` reaches into the surface [m], negative where it does not.
    fn depth_m(&self, tip_m: Vec3, points: &[Vec3], triangles: &[[u32; 3]]) -> f64 {
        depth_m(
            [tip_m, tip_m + self.axis_m],
            self.radius_m,
            points,
            triangles,
        )
    }
}

/// What happened during one poke.
#[derive(Clone, Copy, Debug, Default)]
struct Watched {
    penetration_m: f64,
    force_max_n: f32,
    inverted_tets_max: usize,
    tunnelled: bool,
}

fn poke_once(
    simulation: &mut Simulation,
    contender: Contender,
    places: &Places,
    poke: &Poke,
    speed_m_s: f64,
    times: &mut Times,
) -> Watched {
    let timestep_s = simulation.params().timestep_s;
    let mut watched = Watched::default();
    let mut step = |simulation: &mut Simulation, way_m: f32, action: ToolAction| {
        let tool = ToolInput {
            shape: poke.shape(),
            position_m: poke.from_m + way_m * poke.direction,
            action,
            friction: FRICTION,
        };
        let clock = Clock::start();
        let report = simulation.step(&[tool]);
        times.add(clock);
        contender.after_step(simulation);
        if action == ToolAction::Push {
            let points = simulation.points();
            let depth_m = poke.depth_m(tool.position_m, points, places.triangles);
            watched.penetration_m = watched.penetration_m.max(depth_m);
            watched.tunnelled |= depth_m >= f64::from(poke.radius_m);
        }
        watched.force_max_n = watched.force_max_n.max(report.tool_forces_n[0].length());
        watched.inverted_tets_max = watched.inverted_tets_max.max(report.inverted_tets);
    };
    let forward_m = speed_m_s as f32 * timestep_s;
    let back_m = forward_m.max(WITHDRAWAL_MIN_M_S * timestep_s);
    step(simulation, 0.0, ToolAction::Push);
    for k in 1..=steps(poke.way_m, forward_m) {
        step(
            simulation,
            (forward_m * k as f32).min(poke.way_m),
            ToolAction::Push,
        );
    }
    for _ in 0..HOLD_FRAMES {
        step(simulation, poke.way_m, ToolAction::Push);
    }
    for k in 1..=steps(poke.way_m, back_m) {
        step(
            simulation,
            (poke.way_m - back_m * k as f32).max(0.0),
            ToolAction::Push,
        );
    }
    for _ in 0..AFTER_FRAMES {
        step(simulation, 0.0, ToolAction::Idle);
    }
    watched
}

fn steps(way_m: f32, step_m: f32) -> u32 {
    (way_m / step_m).ceil().max(1.0) as u32
}

/// The surface at rest, where pokes are aimed.
struct Places<'a> {
    points: Vec<Vec3>,
    triangles: &'a [[u32; 3]],
    /// Triangles that nothing holds.
    free: Vec<usize>,
    extent_m: f32,
}

impl<'a> Places<'a> {
    fn new(body: &'a LoadedBody, points: &[Vec3]) -> Self {
        let setup = &body.setup;
        let is_held = |point: u32| {
            let carriers = setup.embedding.particles[point as usize];
            carriers
                .into_iter()
                .any(|particle| setup.fixed[particle as usize])
        };
        let is_free = |triangle: &usize| !setup.triangles[*triangle].into_iter().any(is_held);
        Self {
            points: points.to_vec(),
            triangles: &setup.triangles,
            free: (0..setup.triangles.len()).filter(is_free).collect(),
            extent_m: body.rest.longest_m(),
        }
    }

    /// A poke at a random place; `None` if no place will do.
    fn choose(&self, shape: Shape, random: &mut Random) -> Option<Poke> {
        (0..TRIES_MAX).find_map(|_| self.attempt(shape, random))
    }

    fn attempt(&self, shape: Shape, random: &mut Random) -> Option<Poke> {
        if self.free.is_empty() {
            return None;
        }
        let triangle = self.free[random.below(self.free.len())];
        let [a, b, c] = self.triangles[triangle].map(|i| self.points[i as usize]);
        let normal = (b - a).cross(c - a).try_normalize()?;
        let tilt = TILT_MAX * random.in_box(Vec3::NEG_ONE, Vec3::ONE);
        let direction = (tilt.reject_from_normalized(normal) - normal).normalize();
        let touch = (a + b + c) / 3.0;
        let radius_m = self.extent_m * random.between(RADIUS_SHARES[0], RADIUS_SHARES[1]);
        let depth_share = random.between(DEPTH_SHARES[0], DEPTH_SHARES[1]);
        let inside = touch + 1e-3 * self.extent_m * direction;
        let thickness_m = first_hit(inside, direction, &self.points, self.triangles)?.distance;
        let from_m = touch - (1.0 + GAP_RADII) * radius_m * direction;
        let in_tissue_m = (depth_share * thickness_m).min(DEPTH_EXTENT_MAX * self.extent_m);
        let poke = Poke {
            radius_m,
            axis_m: match shape {
                Shape::Ball => Vec3::ZERO,
                Shape::Rod => -ROD_RADII * radius_m * direction,
            },
            from_m,
            direction,
            way_m: GAP_RADII * radius_m + in_tissue_m,
            thickness_m,
        };
        let is_clear = poke.depth_m(from_m, &self.points, self.triangles) < 0.0;
        let is_thick = thickness_m > THICKNESS_SHARE_MIN * self.extent_m;
        (is_clear && is_thick).then_some(poke)
    }
}

fn verdict(m: &Measures) -> Verdict {
    let mut faults = Vec::new();
    let mut count = |pokes: u32, what: &str| {
        if pokes > 0 {
            faults.push((State::Failed, format!("{pokes} pokes {what}")));
        }
    };
    count(m.not_finite, "not finite");
    count(m.lasting_inversions, "left tetrahedra inverted");
    count(m.tunnelled, "with the axis of the tool inside");
    let share = m.penetration_share_max.unwrap_or(f64::INFINITY);
    if share > PENETRATION_BOUNDS[0] {
        let state = if share > PENETRATION_BOUNDS[1] {
            State::Failed
        } else {
            State::Degraded
        };
        let why = format!(
            "{} pokes with the tool deeper inside than 1 % of the thickness, {} % at most",
            m.too_deep,
            number(100.0 * share)
        );
        faults.push((state, why));
    }
    let off_rest = m.off_rest_share.unwrap_or(f64::INFINITY);
    if off_rest > OFF_REST_BOUNDS[0] {
        let state = if off_rest > OFF_REST_BOUNDS[1] {
            State::Failed
        } else {
            State::Degraded
        };
        let why = format!(
            "off its shape at rest by {} % of the extent",
            number(100.0 * off_rest)
        );
        faults.push((state, why));
    }
    let left = m.speed_left_m_s.unwrap_or(f64::INFINITY);
    if left > SPEED_LEFT_MAX_M_S {
        let why = format!("{} mm/s left after three seconds", number(1e3 * left));
        faults.push((State::Degraded, why));
    }
    Verdict::of(faults)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::app::{load_body, load_scene};

    fn slab() -> LoadedBody {
        let mut scene = load_scene("slab", &[]).expect("it is bundled");
        scene.body.cell_m = Some(0.25 * load_body(&scene).expect("sound").rest.longest_m());
        load_body(&scene).expect("sound")
    }

    #[test]
    fn pokes_come_from_outside_and_end_in_the_tissue_they_were_aimed_at() {
        let body = slab();
        let places = Places::new(&body, &body.mesh.points);
        let mut random = Random::new(7);
        for _ in 0..20 {
            let poke = places
                .choose(Shape::Rod, &mut random)
                .expect("a slab can be poked");
            let depth = |x: Vec3| depth_m([x; 2], 0.0, &places.points, places.triangles);
            assert!(depth(poke.from_m) < -f64::from(poke.radius_m));
            let front = poke.from_m + (poke.way_m + poke.radius_m) * poke.direction;
            assert!(depth(front) > 0.0, "{poke:?}");
            assert!((poke.direction.length() - 1.0).abs() < 1e-5);
        }
    }

    #[test]
    fn same_cell_gives_the_same_pokes_and_another_batch_gives_others() {
        let cell = |batch| Cell {
            scene: "slab".to_owned(),
            cell_share: 0.25,
            method: Contender::AsAScene,
            shape: Shape::Rod,
            speed_m_s: 1.0,
            batch,
            pokes: 2,
        };
        let body = slab();
        let params = SolverParams::default();
        let row = |batch| {
            run(&cell(batch), &body, params)
                .expect("it can be poked")
                .measures
        };
        assert_eq!(row(0), row(0));
        assert_ne!(row(0).force_max_n, row(1).force_max_n);
        assert!(row(0).force_max_n.expect("finite") > 0.0);
    }

    #[test]
    fn verdict_counts_what_must_not_happen() {
        let fine = Measures {
            penetration_share_max: Some(0.001),
            off_rest_share: Some(1e-5),
            speed_left_m_s: Some(0.0),
            ..Measures::default()
        };
        assert_eq!(verdict(&fine).state, State::Fine);
        let torn = Measures {
            lasting_inversions: 3,
            ..fine.clone()
        };
        assert!(verdict(&torn).why.contains("3 pokes left"));
        let deep = Measures {
            penetration_share_max: Some(0.05),
            ..fine.clone()
        };
        assert_eq!(verdict(&deep).state, State::Degraded);
        let bent = Measures {
            off_rest_share: Some(0.02),
            ..fine.clone()
        };
        assert_eq!(verdict(&bent).state, State::Failed);
        let restless = Measures {
            speed_left_m_s: Some(0.01),
            ..fine.clone()
        };
        assert_eq!(verdict(&restless).state, State::Degraded);
        let lost = Measures {
            penetration_share_max: None,
            ..fine
        };
        assert_eq!(verdict(&lost).state, State::Failed);
    }
}
