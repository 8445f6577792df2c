//! The study `pokes`: thousands of scripted pokes on the bundled organs, from slow to faster than any
//! hand, each at a random place. Nothing may be torn, left inside out or run through.

mod depth;
mod script;
mod show;

pub use script::Measures;

use super::Study;
use super::contender::Contender;
use super::findings::Findings;
use super::sweep::{Row, Sweep};
use crate::app::{AppError, LoadedBody, load_body, load_scene};
use crate::sim::SolverParams;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::path::Path;

/// What is swept.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    pub body: BodyPlan,
    pub solver: SolverPlan,
    pub tool: ToolPlan,
}

/// The organs.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BodyPlan {
    /// Bundled scenes, or paths of scene files; their solver and holds are used, their tools are not.
    pub scene: Vec<String>,
    /// Edge of a lattice cell, as a share of the longest extent.
    pub cell_share: f64,
}

/// The settings; substeps and material are those of each scene.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SolverPlan {
    pub method: Vec<Contender>,
}

/// The pokes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct ToolPlan {
    pub shape: Vec<Shape>,
    pub speed_m_s: Vec<f64>,
    /// Simulations for each organ, method, shape and speed, and pokes in each, one after the other.
    pub batches: u32,
    pub pokes: u32,
}

/// What pokes.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Shape {
    /// A sphere.
    Ball,
    /// A capsule of four radii, held along its way: the shaft follows its tip into the tissue.
    Rod,
}

impl Shape {
    fn name(self) -> &'static str {
        match self {
            Self::Ball => "ball",
            Self::Rod => "rod",
        }
    }
}

/// One simulation with its pokes.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    pub scene: String,
    pub cell_share: f64,
    pub method: Contender,
    pub shape: Shape,
    pub speed_m_s: f64,
    pub batch: u32,
    pub pokes: u32,
}

/// The study with its organs.
pub struct Pokes {
    organs: HashMap<String, Organ>,
}

/// A body and the solver of its scene.
struct Organ {
    body: LoadedBody,
    params: SolverParams,
}

impl Sweep for Pokes {
    const STUDY: Study = Study::Pokes;
    const SIDE_BY_SIDE: bool = true;
    type Plan = Plan;
    type Cell = Cell;
    type Measures = Measures;

    fn plan(quick: bool) -> Plan {
        let pick = |full: u32, few: u32| if quick { few } else { full };
        Plan {
            body: BodyPlan {
                scene: ["liver", "kidney", "spleen"].map(str::to_owned).to_vec(),
                cell_share: 0.08,
            },
            solver: SolverPlan {
                method: vec![Contender::AsAScene],
            },
            tool: ToolPlan {
                shape: vec![Shape::Ball, Shape::Rod],
                speed_m_s: vec![0.01, 0.03, 0.1, 0.3, 1.0, 3.0, 10.0],
                batches: pick(5, 1),
                pokes: pick(48, 10),
            },
        }
    }

    fn cells(plan: &Plan) -> Result<Vec<Cell>, String> {
        let share = plan.body.cell_share;
        if !(0.01..=0.5).contains(&share) {
            return Err(format!(
                "body.cell_share = {share} is out of range: choose from 0.01 to 0.5"
            ));
        }
        let speeds = &plan.tool.speed_m_s;
        if let Some(speed) = speeds.iter().find(|speed| !(1e-3..=100.0).contains(*speed)) {
            return Err(format!(
                "tool.speed_m_s = {speed} is out of range: choose from 0.001 to 100"
            ));
        }
        for (key, count) in [("batches", plan.tool.batches), ("pokes", plan.tool.pokes)] {
            if count == 0 {
                return Err(format!(
                    "tool.{key} = 0 leaves nothing to do: choose 1 or more"
                ));
            }
        }
        let mut cells = Vec::new();
        for scene in &plan.body.scene {
            for &method in &plan.solver.method {
                for &shape in &plan.tool.shape {
                    for &speed_m_s in speeds {
                        cells.extend((0..plan.tool.batches).map(|batch| Cell {
                            scene: scene.clone(),
                            cell_share: share,
                            method,
                            shape,
                            speed_m_s,
                            batch,
                            pokes: plan.tool.pokes,
                        }));
                    }
                }
            }
        }
        Ok(cells)
    }

    fn new(plan: &Plan, _: &Path, _: usize) -> Result<Self, AppError> {
        let mut organs = HashMap::new();
        for name in &plan.body.scene {
            let mut scene = load_scene(name, &[])?;
            let longest_m = load_body(&scene)?.rest.longest_m();
            scene.body.cell_m = Some(plan.body.cell_share as f32 * longest_m);
            let organ = Organ {
                body: load_body(&scene)?,
                params: scene.solver,
            };
            organs.insert(name.clone(), organ);
        }
        Ok(Self { organs })
    }

    fn measure(&self, cell: &Cell) -> Result<Row<Cell, Measures>, AppError> {
        let organ = &self.organs[&cell.scene];
        let params = SolverParams {
            method: cell.method.method(),
            ..organ.params
        };
        script::run(cell, &organ.body, params)
    }

    fn findings(rows: &[Row<Cell, Measures>]) -> Findings {
        show::findings(rows)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plan_has_ten_thousand_pokes() {
        let cells = Pokes::cells(&Pokes::plan(false)).expect("the plan is sound");
        let pokes: u32 = cells.iter().map(|cell| cell.pokes).sum();
        assert!(pokes >= 10_000, "{pokes}");
    }

    #[test]
    fn speeds_and_cells_out_of_range_are_refused() {
        let mut plan = Pokes::plan(true);
        plan.tool.speed_m_s = vec![0.0];
        assert!(Pokes::cells(&plan).unwrap_err().contains("0.001 to 100"));
        plan.tool.pokes = 0;
        plan.tool.speed_m_s = vec![1.0];
        assert!(Pokes::cells(&plan).unwrap_err().contains("tool.pokes"));
        plan.body.cell_share = f64::NAN;
        assert!(Pokes::cells(&plan).unwrap_err().contains("0.01 to 0.5"));
    }
}
