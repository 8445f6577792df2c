//! The study `stability`: where each method fails, and why.
//!
//! Small bodies hang, are poked, pressed, pulled and wrecked, over modulus, Poisson's ratio, time step,
//! substeps, damping, mesh quality, speed of the tool and start. The cells are those of the grid of all knobs in which at most
//! two knobs depart from a base setting, and the whole grid of mesh, modulus and substeps.

mod fault;
mod show;
mod touch;
mod trial;

pub use trial::Measures;

use super::Study;
use super::contender::Contender;
use super::findings::Findings;
use super::held_body::{HeldBody, Hold, beam, organ, scaled, with_sliver};
use super::oracle::{self, Tissue};
use super::sweep::{Row, Sweep};
use crate::app::AppError;
use crate::geom::TetMesh;
use crate::sim::SolverParams;
use crate::sim::diagnose::volume_and_inverted;
use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::path::Path;
use std::sync::{Arc, Mutex, OnceLock};

/// Density of every body [kg/m³].
const DENSITY_KG_M3: f32 = 1000.0;

/// What is swept.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    pub body: BodyPlan,
    pub solver: SolverPlan,
    pub tool: ToolPlan,
}

/// The bodies, and how they start.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BodyPlan {
    pub mesh: Vec<Mesh>,
    pub start: Vec<Start>,
    /// Random starts of the default method with nothing else changed.
    pub seeds: u32,
    /// Of a body of 10 kPa or more that is to settle [1/s]; a softer one, slower by itself, has less.
    pub damping_per_s: Vec<f64>,
}

/// The settings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SolverPlan {
    pub method: Vec<Contender>,
    pub youngs_modulus_pa: Vec<f64>,
    pub poisson_ratio: Vec<f64>,
    pub timestep_s: Vec<f64>,
    pub substeps: Vec<u32>,
}

/// The tool.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ToolPlan {
    /// 0 is no tool.
    pub speed_m_s: Vec<f64>,
    pub deed: Vec<Deed>,
}

/// What a tool does that comes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Deed {
    /// It is pushed in, stays for a third of a second, and leaves.
    Poke,
    /// It is pushed in and stays.
    Press,
    /// It takes hold of the surface, pulls, and holds on.
    Pull,
}

impl Deed {
    fn name(self) -> &'static str {
        match self {
            Self::Poke => "poke",
            Self::Press => "press",
            Self::Pull => "pull",
        }
    }
}

/// The bodies there are, all but one of about a thousand tetrahedra.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Mesh {
    /// A beam of 10 × 5 × 5 cm in cubes of a centimetre.
    Regular,
    /// The same with one tetrahedron of a thousandth of its volume.
    Sliver,
    /// An ellipsoid of 12 × 8 × 6 cm with poor tetrahedra.
    Organ,
    /// The same of five thousand tetrahedra, the poorest much poorer.
    #[serde(rename = "organ-5k")]
    Organ5k,
    /// The beam a tenth as large: tetrahedra of a millimetre.
    Millimetre,
}

impl Mesh {
    const ALL: [Self; 5] = [
        Self::Regular,
        Self::Sliver,
        Self::Organ,
        Self::Organ5k,
        Self::Millimetre,
    ];

    fn name(self) -> &'static str {
        match self {
            Self::Regular => "regular",
            Self::Sliver => "sliver",
            Self::Organ => "organ",
            Self::Organ5k => "organ-5k",
            Self::Millimetre => "millimetre",
        }
    }

    fn tets(self) -> TetMesh {
        match self {
            Self::Regular => beam(5),
            Self::Sliver => with_sliver(beam(5), 1e-3),
            Self::Organ => organ(6),
            Self::Organ5k => organ(10),
            Self::Millimetre => scaled(beam(5), 0.1),
        }
    }

    /// How the body is held where nothing pokes it.
    fn hold(self) -> Hold {
        match self {
            Self::Regular | Self::Sliver | Self::Millimetre => Hold::End,
            Self::Organ | Self::Organ5k => Hold::Foot,
        }
    }
}

/// How a body starts.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Hash, PartialOrd, Ord, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Start {
    /// At rest.
    Rest,
    /// Settled, then every free particle anywhere in its box.
    Random,
    /// Settled, then every free particle in the middle.
    Point,
    /// Settled, then every free particle at half height.
    Plane,
    /// Settled, then one particle of the tip pulled away by ten lengths.
    Pull,
}

impl Start {
    const ALL: [Self; 5] = [
        Self::Rest,
        Self::Random,
        Self::Point,
        Self::Plane,
        Self::Pull,
    ];

    fn name(self) -> &'static str {
        match self {
            Self::Rest => "rest",
            Self::Random => "random",
            Self::Point => "point",
            Self::Plane => "plane",
            Self::Pull => "pull",
        }
    }
}

/// One setting of all knobs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    pub method: Contender,
    pub mesh: Mesh,
    pub youngs_modulus_pa: f64,
    pub poisson_ratio: f64,
    pub timestep_s: f64,
    pub substeps: u32,
    pub iterations: u32,
    pub damping_per_s: f64,
    pub tool_speed_m_s: f64,
    pub deed: Deed,
    pub start: Start,
    pub seed: u32,
}

/// What is done to the body of a cell.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Kind {
    /// It hangs or stands under gravity.
    Hang,
    /// A tool comes.
    Touch,
    /// It is wrecked and let go.
    Wreck,
}

impl Cell {
    fn params(&self) -> SolverParams {
        SolverParams {
            method: self.method.method(),
            timestep_s: self.timestep_s as f32,
            substeps: self.substeps,
            iterations: self.iterations,
            youngs_modulus_pa: self.youngs_modulus_pa as f32,
            poisson_ratio: self.poisson_ratio as f32,
        }
    }

    fn kind(&self) -> Kind {
        if self.tool_speed_m_s > 0.0 {
            Kind::Touch
        } else if self.start != Start::Rest {
            Kind::Wreck
        } else {
            Kind::Hang
        }
    }

    /// The length of a substep [s].
    fn substep_s(&self) -> f64 {
        self.timestep_s / f64::from(self.substeps)
    }
}

/// What a hanging body is judged by.
#[derive(Clone, Debug, PartialEq)]
pub struct Statics {
    /// Where its particles come to rest [m].
    pub settled_m: Vec<DVec3>,
    /// Tetrahedra that are inverted there: tissue too soft for its weight folds, in truth as well.
    pub inverted_tets: usize,
    /// What the rounding of its particles' places to f32 looks like as elastic energy [J].
    pub rounding_j: f64,
}

/// The static oracle, or why there is none.
type Equilibrium = Result<Statics, String>;

/// The study with what its cells share.
pub struct Stability {
    /// Each mesh, held where nothing pokes it.
    hanging: HashMap<Mesh, HeldBody>,
    /// The same, held by its foot.
    standing: HashMap<Mesh, HeldBody>,
    /// By mesh, modulus and Poisson's ratio; made by the first cell that asks.
    equilibria: Mutex<HashMap<String, Arc<OnceLock<Equilibrium>>>>,
}

impl Sweep for Stability {
    const STUDY: Study = Study::Stability;
    const SIDE_BY_SIDE: bool = true;
    type Plan = Plan;
    type Cell = Cell;
    type Measures = Measures;

    fn plan(quick: bool) -> Plan {
        if quick {
            return Plan {
                body: BodyPlan {
                    mesh: vec![Mesh::Regular, Mesh::Sliver],
                    start: vec![Start::Rest, Start::Random, Start::Pull],
                    seeds: 2,
                    damping_per_s: vec![10.0],
                },
                solver: SolverPlan {
                    method: Contender::ALL.to_vec(),
                    youngs_modulus_pa: vec![1e3, 1e4, 1e6],
                    poisson_ratio: vec![0.45],
                    timestep_s: vec![1.0 / 60.0],
                    substeps: vec![1, 20],
                },
                tool: ToolPlan {
                    speed_m_s: vec![0.0, 1.0],
                    deed: vec![Deed::Poke, Deed::Press, Deed::Pull],
                },
            };
        }
        Plan {
            body: BodyPlan {
                mesh: Mesh::ALL.to_vec(),
                start: Start::ALL.to_vec(),
                seeds: 20,
                damping_per_s: vec![10.0, 2.0],
            },
            solver: SolverPlan {
                method: Contender::ALL.to_vec(),
                youngs_modulus_pa: vec![1e3, 1e4, 1e5, 1e6, 1e7],
                poisson_ratio: vec![0.0, 0.3, 0.45, 0.49],
                timestep_s: vec![1.0 / 30.0, 1.0 / 60.0, 1.0 / 120.0],
                substeps: vec![1, 5, 20, 40],
            },
            tool: ToolPlan {
                speed_m_s: vec![0.0, 0.01, 0.1, 1.0, 10.0],
                deed: vec![Deed::Poke, Deed::Press, Deed::Pull],
            },
        }
    }

    fn cells(plan: &Plan) -> Result<Vec<Cell>, String> {
        let cells = cells(plan);
        if let Some(problem) = cells.iter().find_map(|cell| cell.params().problem()) {
            return Err(format!("solver.{problem}"));
        }
        let dampings = &plan.body.damping_per_s;
        if let Some(damping) = dampings.iter().find(|d| !(0.5..=100.0).contains(*d)) {
            return Err(format!(
                "body.damping_per_s = {damping} is out of range: choose from 0.5 to 100"
            ));
        }
        let speeds = &plan.tool.speed_m_s;
        match speeds.iter().find(|speed| !(0.0..=100.0).contains(*speed)) {
            Some(speed) => Err(format!(
                "tool.speed_m_s = {speed} is out of range: choose from 0 to 100"
            )),
            None => Ok(cells),
        }
    }

    fn new(plan: &Plan, _: &Path, _: usize) -> Result<Self, AppError> {
        let bodies = |hold: &dyn Fn(Mesh) -> Hold| -> HashMap<Mesh, HeldBody> {
            let body = |&mesh: &Mesh| {
                let body = HeldBody::new(mesh.tets(), DENSITY_KG_M3, hold(mesh));
                (mesh, body)
            };
            plan.body.mesh.iter().map(body).collect()
        };
        Ok(Self {
            hanging: bodies(&Mesh::hold),
            standing: bodies(&|_| Hold::Foot),
            equilibria: Mutex::default(),
        })
    }

    fn measure(&self, cell: &Cell) -> Result<Row<Cell, Measures>, AppError> {
        let (hanging, standing) = (&self.hanging[&cell.mesh], &self.standing[&cell.mesh]);
        Ok(match cell.kind() {
            Kind::Hang | Kind::Wreck => {
                let equilibrium = self.equilibrium(cell);
                let statics = equilibrium.get().and_then(|e| e.as_ref().ok());
                match cell.kind() {
                    Kind::Wreck => trial::wreck(cell, hanging, statics),
                    _ => trial::hang(cell, hanging, statics),
                }
            }
            Kind::Touch => touch::touch(cell, standing),
        })
    }

    fn findings(rows: &[Row<Cell, Measures>]) -> Findings {
        show::findings(rows)
    }
}

impl Stability {
    /// The static oracle of a cell, filled.
    fn equilibrium(&self, cell: &Cell) -> Arc<OnceLock<Equilibrium>> {
        let key = format!(
            "{} {} {}",
            cell.mesh.name(),
            cell.youngs_modulus_pa,
            cell.poisson_ratio
        );
        let place = {
            let mut all = self.equilibria.lock().expect("no cell panics");
            all.entry(key).or_default().clone()
        };
        // Outside the lock: other cells go on while this one is solved, and none solves it twice.
        place.get_or_init(|| {
            let tissue = Tissue {
                youngs_modulus_pa: cell.youngs_modulus_pa,
                poisson_ratio: cell.poisson_ratio,
            };
            let body = &self.hanging[&cell.mesh];
            let settled_m = oracle::settled_m(body, tissue).map_err(|error| error.to_string())?;
            let rounded: Vec<Vec3> = settled_m.iter().map(|x| x.as_vec3()).collect();
            Ok(Statics {
                inverted_tets: volume_and_inverted(&rounded, &body.setup.tets.tets).1,
                rounding_j: oracle::rounding_j(body, tissue),
                settled_m,
            })
        });
        place
    }
}

/// The cells of a plan; see the head of this file.
fn cells(plan: &Plan) -> Vec<Cell> {
    let (body, solver) = (&plan.body, &plan.solver);
    let base = base(plan);
    let mut cells = vec![base.clone()];
    over(&mut cells, &solver.method, |cell, value| {
        cell.method = value
    });
    over(&mut cells, &body.mesh, |cell, value| cell.mesh = value);
    over(&mut cells, &solver.youngs_modulus_pa, |cell, value| {
        cell.youngs_modulus_pa = value;
    });
    over(&mut cells, &solver.poisson_ratio, |cell, value| {
        cell.poisson_ratio = value;
    });
    over(&mut cells, &solver.timestep_s, |cell, value| {
        cell.timestep_s = value
    });
    over(&mut cells, &solver.substeps, |cell, value| {
        cell.substeps = value
    });
    over(&mut cells, &body.damping_per_s, |cell, value| {
        cell.damping_per_s = value;
    });
    over(&mut cells, &plan.tool.speed_m_s, |cell, value| {
        cell.tool_speed_m_s = value;
    });
    over(&mut cells, &plan.tool.deed, |cell, value| cell.deed = value);
    over(&mut cells, &body.start, |cell, value| cell.start = value);
    cells.retain(|cell| is_worthwhile(cell, &base));
    cells
        .into_iter()
        .flat_map(|cell| {
            let is_seeded = cell.method == Contender::AsAScene
                && cell.start == Start::Random
                && departures(&cell, &base) == 1;
            let seeds = if is_seeded { body.seeds.max(1) } else { 1 };
            (0..seeds).map(move |seed| Cell {
                seed,
                ..cell.clone()
            })
        })
        .collect()
}

/// The setting that others depart from.
fn base(plan: &Plan) -> Cell {
    let (body, solver) = (&plan.body, &plan.solver);
    let default = SolverParams::default();
    Cell {
        method: Contender::AsAScene,
        mesh: or_first(&body.mesh, Mesh::Regular),
        youngs_modulus_pa: or_first(&solver.youngs_modulus_pa, 1e4),
        poisson_ratio: or_first(&solver.poisson_ratio, 0.45),
        timestep_s: or_first(&solver.timestep_s, 1.0 / 60.0),
        substeps: or_first(&solver.substeps, default.substeps),
        iterations: 1,
        damping_per_s: or_first(&body.damping_per_s, 10.0),
        tool_speed_m_s: or_first(&plan.tool.speed_m_s, 0.0),
        deed: or_first(&plan.tool.deed, Deed::Poke),
        start: or_first(&body.start, Start::Rest),
        seed: 0,
    }
}

/// Puts in place of each cell one for each of `values`.
fn over<T: Copy>(cells: &mut Vec<Cell>, values: &[T], set: impl Fn(&mut Cell, T)) {
    let with = |cell: &Cell| -> Vec<Cell> {
        let mut copies = vec![cell.clone(); values.len()];
        for (copy, &value) in copies.iter_mut().zip(values) {
            set(copy, value);
        }
        copies
    };
    *cells = cells.iter().flat_map(with).collect();
}

/// `wanted` if it is among the values, else the first of them.
fn or_first<T: Copy + PartialEq>(values: &[T], wanted: T) -> T {
    if values.contains(&wanted) {
        wanted
    } else {
        values.first().copied().unwrap_or(wanted)
    }
}

/// How many knobs, the method and what the tool does apart, are not those of `base`.
fn departures(cell: &Cell, base: &Cell) -> usize {
    [
        cell.mesh != base.mesh,
        cell.youngs_modulus_pa != base.youngs_modulus_pa,
        cell.poisson_ratio != base.poisson_ratio,
        cell.timestep_s != base.timestep_s,
        cell.substeps != base.substeps,
        cell.damping_per_s != base.damping_per_s,
        cell.tool_speed_m_s != base.tool_speed_m_s,
        cell.start != base.start,
    ]
    .into_iter()
    .filter(|&departs| departs)
    .count()
}

fn is_worthwhile(cell: &Cell, base: &Cell) -> bool {
    // A body is touched from rest, and wrecked without a tool.
    if cell.tool_speed_m_s > 0.0 && cell.start != Start::Rest {
        return false;
    }
    if cell.tool_speed_m_s == 0.0 && cell.deed != base.deed {
        return false;
    }
    let on_the_map = Cell {
        mesh: base.mesh,
        youngs_modulus_pa: base.youngs_modulus_pa,
        substeps: base.substeps,
        ..cell.clone()
    };
    departures(cell, base) <= 2 || departures(&on_the_map, base) == 0
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plan_has_more_than_five_hundred_cells_and_each_knob_at_each_value() {
        let plan = Stability::plan(false);
        let cells = Stability::cells(&plan).expect("the plan is sound");
        assert!(cells.len() >= 500, "{}", cells.len());
        for &method in &plan.solver.method {
            let cells = || cells.iter().filter(move |cell| cell.method == method);
            for &e in &plan.solver.youngs_modulus_pa {
                for &mesh in &plan.body.mesh {
                    for &substeps in &plan.solver.substeps {
                        assert!(cells().any(|c| c.youngs_modulus_pa == e
                            && c.mesh == mesh
                            && c.substeps == substeps
                            && c.kind() == Kind::Hang));
                    }
                    for &speed in &plan.tool.speed_m_s {
                        assert!(cells().any(|c| c.mesh == mesh && c.tool_speed_m_s == speed));
                    }
                    for &deed in &plan.tool.deed {
                        assert!(cells().any(|c| c.mesh == mesh && c.deed == deed));
                    }
                }
            }
        }
        let default = Contender::AsAScene;
        let random = |c: &&Cell| c.method == default && c.start == Start::Random && c.seed > 0;
        assert_eq!(cells.iter().filter(random).count(), 19);
    }

    #[test]
    fn list_of_one_value_is_the_base_of_all_cells() {
        let mut plan = Stability::plan(true);
        plan.solver.youngs_modulus_pa = vec![1e7];
        plan.solver.substeps = vec![1];
        let cells = Stability::cells(&plan).expect("the plan is sound");
        assert!(cells.len() > 10);
        assert!(
            cells
                .iter()
                .all(|cell| cell.youngs_modulus_pa == 1e7 && cell.substeps == 1)
        );
    }

    #[test]
    fn unknown_speeds_are_refused() {
        let mut plan = Stability::plan(true);
        plan.tool.speed_m_s = vec![0.0, f64::NAN];
        assert!(Stability::cells(&plan).unwrap_err().contains("0 to 100"));
        plan.body.damping_per_s = vec![0.0];
        assert!(Stability::cells(&plan).unwrap_err().contains("0.5 to 100"));
    }
}
