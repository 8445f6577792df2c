//! The study `solver`: methods × substeps × iterations × mesh, each with its cost and its error.
//!
//! A beam held at one end, as other programs were measured with it: let go under gravity with
//! velocities damped until it hangs still (the *settled* error), and let go undamped (the *swing*).
//! The oracle for both is a Newton solve of stable neo-Hookean tissue on the same mesh.

mod limit;
mod measure;
mod show;

pub use measure::Measures;

use limit::Limit;

use super::Study;
use super::contender::Contender;
use super::findings::Findings;
use super::held_body::{HeldBody, Hold, beam, organ};
use super::oracle::{Motion, Oracle, Tissue};
use super::sweep::{Row, Sweep};
use crate::app::AppError;
use crate::geom::import::read_tets;
use crate::sim::SolverParams;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};

/// Sweeps over all constraints a frame, above which more iterations are not worth a cell.
const SWEEPS_MAX: u32 = 40;
/// Cells across the beam from which on only a few settings are measured, and the statics only.
const LARGE_ACROSS: u32 = 14;
/// Bodies of so many tetrahedra are followed by the oracle through the whole swing; it takes minutes.
const SWING_TETS_MAX: usize = 2500;

/// What is swept.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    pub body: BodyPlan,
    pub solver: SolverPlan,
}

/// The beams.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BodyPlan {
    /// Lattice cells across the beam: 5, 10 and 17 give 1k, 10k and 50k tetrahedra.
    pub cells_across: Vec<u32>,
    /// Cells of the cube that is blown up to an organ of poor tetrahedra, held by its foot: 10 gives 5k.
    pub organ_cells: Vec<u32>,
    /// Instead of all these, the tetrahedra of a Gmsh file.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// Where a beam or the body of the file is held.
    pub hold: Hold,
    pub density_kg_m3: f64,
}

/// The settings.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SolverPlan {
    pub method: Vec<Contender>,
    pub substeps: Vec<u32>,
    pub iterations: Vec<u32>,
    pub youngs_modulus_pa: Vec<f64>,
    pub poisson_ratio: f64,
    pub timestep_s: f64,
}

/// One setting on one body.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    pub method: Contender,
    pub mesh: String,
    /// Of a beam; null for others.
    pub cells_across: Option<u32>,
    /// Of an organ; null for others.
    pub organ_cells: Option<u32>,
    pub hold: Hold,
    pub density_kg_m3: f64,
    pub youngs_modulus_pa: f64,
    pub poisson_ratio: f64,
    pub timestep_s: f64,
    pub substeps: u32,
    pub iterations: u32,
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

    fn tissue(&self) -> Tissue {
        Tissue {
            youngs_modulus_pa: self.youngs_modulus_pa,
            poisson_ratio: self.poisson_ratio,
        }
    }

    fn is_large(&self) -> bool {
        self.cells_across.is_some_and(|n| n >= LARGE_ACROSS)
    }

    /// How far the oracle follows the swing: a step of a 16th of a frame is converged.
    fn motion(&self, tets: usize) -> Option<Motion> {
        (tets <= SWING_TETS_MAX).then_some(Motion {
            frames: measure::SWING_FRAMES,
            frame_s: self.timestep_s,
            steps_per_frame: 16,
        })
    }

    /// Whether the cell says something that others don't.
    fn is_worthwhile(&self) -> bool {
        // Forces of springs are not iterated, and many iterations of a few substeps are the slow
        // way to the same work.
        let iterates = self.method != Contender::MassSpring;
        let few = self.substeps * self.iterations <= SWEEPS_MAX;
        let small = self.iterations == 1 || (iterates && few && !self.is_large());
        if self.method == Contender::Implicit && self.is_large() {
            return self.substeps <= 4 && self.iterations <= 2;
        }
        let worth_the_time = self.substeps >= 10 || !self.is_large();
        small && worth_the_time
    }
}

/// A body of a plan.
struct Mesh {
    name: String,
    cells_across: Option<u32>,
    organ_cells: Option<u32>,
    hold: Hold,
}

/// The beams and organs of a plan, or the body of its file.
fn meshes(body: &BodyPlan) -> Vec<Mesh> {
    if let Some(file) = &body.file {
        let stem = file.file_stem().unwrap_or(file.as_os_str());
        return vec![Mesh {
            name: stem.to_string_lossy().into_owned(),
            cells_across: None,
            organ_cells: None,
            hold: body.hold,
        }];
    }
    let beams = body.cells_across.iter().map(|&n| Mesh {
        name: beam_name(n),
        cells_across: Some(n),
        organ_cells: None,
        hold: body.hold,
    });
    let organs = body.organ_cells.iter().map(|&n| Mesh {
        name: organ_name(n),
        cells_across: None,
        organ_cells: Some(n),
        hold: Hold::Foot,
    });
    beams.chain(organs).collect()
}

fn organ_name(cells: u32) -> String {
    match cells {
        10 => "organ-5k".to_owned(),
        other => format!("organ-{}", 5 * u64::from(other).pow(3)),
    }
}

/// `1250` as `1k`.
fn beam_name(cells_across: u32) -> String {
    match cells_across {
        5 => "beam-1k".to_owned(),
        10 => "beam-10k".to_owned(),
        // 49,130 tetrahedra.
        17 => "beam-50k".to_owned(),
        other => format!("beam-{}", 10 * u64::from(other).pow(3)),
    }
}

/// The study with what its cells share.
pub struct Solver {
    out: PathBuf,
    threads: usize,
    /// Of the plan, for all cells.
    file: Option<PathBuf>,
    bodies: Shared<String, HeldBody>,
    oracles: Shared<String, Oracle>,
    limits: Shared<String, Limit>,
}

/// What is made once and used by many cells.
type Shared<K, V> = Mutex<HashMap<K, Arc<V>>>;

impl Sweep for Solver {
    const STUDY: Study = Study::Solver;
    const SIDE_BY_SIDE: bool = false;
    type Plan = Plan;
    type Cell = Cell;
    type Measures = Measures;

    fn plan(quick: bool) -> Plan {
        let full = !quick;
        let organ_cells = if full { vec![10] } else { Vec::new() };
        let pick = |all: &[u32], few: &[u32]| if full { all.to_vec() } else { few.to_vec() };
        Plan {
            body: BodyPlan {
                cells_across: pick(&[5, 10, 17], &[5]),
                organ_cells,
                file: None,
                hold: Hold::End,
                density_kg_m3: 1000.0,
            },
            solver: SolverPlan {
                method: Contender::ALL.to_vec(),
                substeps: pick(&[1, 2, 4, 5, 10, 20, 40], &[1, 5, 20]),
                iterations: pick(&[1, 2, 4, 10, 20], &[1]),
                youngs_modulus_pa: if full { vec![1e4, 5e4] } else { vec![1e4] },
                poisson_ratio: 0.45,
                timestep_s: 1.0 / 60.0,
            },
        }
    }

    fn cells(plan: &Plan) -> Result<Vec<Cell>, String> {
        let (body, solver) = (&plan.body, &plan.solver);
        for (key, cells) in [
            ("cells_across", &body.cells_across),
            ("organ_cells", &body.organ_cells),
        ] {
            if let Some(n) = cells.iter().find(|n| !(1..=50).contains(*n)) {
                return Err(format!(
                    "body.{key} = {n} is out of range: choose from 1 to 50"
                ));
            }
        }
        if !(1.0..=30_000.0).contains(&body.density_kg_m3) {
            return Err(format!(
                "body.density_kg_m3 = {} is out of range: choose from 1 to 30000",
                body.density_kg_m3
            ));
        }
        let mut cells = Vec::new();
        for mesh in meshes(body) {
            for &youngs_modulus_pa in &solver.youngs_modulus_pa {
                for &method in &solver.method {
                    for &substeps in &solver.substeps {
                        for &iterations in &solver.iterations {
                            cells.push(Cell {
                                method,
                                mesh: mesh.name.clone(),
                                cells_across: mesh.cells_across,
                                organ_cells: mesh.organ_cells,
                                hold: mesh.hold,
                                density_kg_m3: body.density_kg_m3,
                                youngs_modulus_pa,
                                poisson_ratio: solver.poisson_ratio,
                                timestep_s: solver.timestep_s,
                                substeps,
                                iterations,
                            });
                        }
                    }
                }
            }
        }
        match cells.iter().find_map(|cell| cell.params().problem()) {
            Some(problem) => Err(format!("solver.{problem}")),
            None => {
                cells.retain(Cell::is_worthwhile);
                Ok(cells)
            }
        }
    }

    fn new(plan: &Plan, out: &Path, threads: usize) -> Result<Self, AppError> {
        Ok(Self {
            file: plan.body.file.clone(),
            out: out.to_owned(),
            threads,
            bodies: Shared::default(),
            oracles: Shared::default(),
            limits: Shared::default(),
        })
    }

    fn measure(&self, cell: &Cell) -> Result<Row<Cell, Measures>, AppError> {
        let body = shared(&self.bodies, cell.mesh.clone(), || self.body(cell))?;
        let tissue = format!("{}-{}pa", cell.mesh, cell.youngs_modulus_pa);
        let oracle = shared(&self.oracles, tissue.clone(), || {
            let file = self.out.join(format!("oracle-{tissue}.json"));
            let motion = cell.motion(body.setup.tets.tets.len());
            Oracle::kept(&file, &body, cell.tissue(), motion)
        })?;
        // A method has the same limit whoever takes it.
        let limit = shared(
            &self.limits,
            format!("{tissue}-{}", cell.method.method().name()),
            || Ok(Limit::of(&body, cell.params(), cell.timestep_s)),
        )?;
        Ok(measure::row(cell, &body, &oracle, *limit, self.threads))
    }

    fn findings(rows: &[Row<Cell, Measures>]) -> Findings {
        show::findings(rows)
    }
}

impl Solver {
    fn body(&self, cell: &Cell) -> Result<HeldBody, AppError> {
        let tets = match (&self.file, cell.cells_across, cell.organ_cells) {
            (None, Some(cells_across), _) => beam(cells_across),
            (None, None, Some(cells)) => organ(cells as usize),
            (Some(file), ..) => {
                let imported = read_tets(file)?;
                for note in imported.notes {
                    eprintln!("{}: {note}", file.display());
                }
                imported.mesh
            }
            (None, None, None) => unreachable!("a plan without a file has beams and organs"),
        };
        let body = HeldBody::new(tets, cell.density_kg_m3 as f32, cell.hold);
        let refuse = |problem: &str| Err(AppError::Body(format!("{}: {problem}", cell.mesh)));
        if !body.setup.masses_kg.iter().all(|mass| mass.is_normal()) {
            return refuse("a tetrahedron is too small to weigh anything as a number");
        }
        if body.free().next().is_none() {
            return refuse("every particle is held: set body.hold to \"end\" or \"foot\"");
        }
        Ok(body)
    }
}

/// What `all` holds under `key`, made by `make` if it is not there. Cells are measured one at a
/// time, so nothing is made twice.
fn shared<K: Eq + std::hash::Hash, V>(
    all: &Shared<K, V>,
    key: K,
    make: impl FnOnce() -> Result<V, AppError>,
) -> Result<Arc<V>, AppError> {
    let mut all = all.lock().expect("no cell panics");
    if let Some(found) = all.get(&key) {
        return Ok(found.clone());
    }
    let made = Arc::new(make()?);
    all.insert(key, made.clone());
    Ok(made)
}

#[cfg(test)]
mod tests {
    use super::*;

    fn plan() -> Plan {
        Solver::plan(false)
    }

    #[test]
    fn few_cells_are_spent_on_the_largest_beam_and_none_on_iterated_springs() {
        let cells = Solver::cells(&plan()).expect("the plan is sound");
        let large = cells.iter().filter(|cell| cell.is_large()).count();
        assert!(
            large > 0 && 5 * large < cells.len(),
            "{large} of {}",
            cells.len()
        );
        let iterated = |cell: &&Cell| cell.method == Contender::MassSpring && cell.iterations > 1;
        assert_eq!(cells.iter().filter(iterated).count(), 0);
    }

    #[test]
    fn values_out_of_range_are_refused_with_the_range() {
        let mut dense = plan();
        dense.body.density_kg_m3 = f64::NAN;
        assert!(Solver::cells(&dense).unwrap_err().contains("30000"));
        let mut stiff = plan();
        stiff.solver.poisson_ratio = 0.5;
        assert!(Solver::cells(&stiff).unwrap_err().contains("0.499"));
        let mut huge = plan();
        huge.body.cells_across = vec![5, 1000];
        assert!(Solver::cells(&huge).unwrap_err().contains("1 to 50"));
    }
}
