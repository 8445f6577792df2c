//! The study `planes`: every way to follow light below a moving surface, what it costs, and how wrong it is.
//!
//! The passes are the product's, their primitives are read back from the GPU, and the truth is rays cast at the
//! deformed triangles in f64 from the same places below the surface.

mod body;
mod deform;
mod estimate;
mod exact;
mod picture;
mod prod;
mod show;
mod sight;
mod stage;
mod trial;

pub use estimate::{Blend, Drawn, DrawnPrimitives};
pub use picture::heat;
pub use sight::{Sight, exact_normals, tissue_of, way_of};
pub use stage::read_depth_maps;

use super::Study;
use super::findings::Findings;
use super::sweep::{Row, Sweep};
use crate::app::AppError;
use crate::geom::plane::LightPathMethod;
use crate::gpu::Gpu;
use body::Shape;
use deform::Deformation;
use serde::{Deserialize, Serialize};
use std::path::Path;
use trial::Bench;

/// What is swept.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Plan {
    pub light_path: LightPathPlan,
    pub body: BodyPlan,
    pub motion: MotionPlan,
    pub drift: DriftPlan,
    pub oracle: OraclePlan,
}

/// The methods.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct LightPathPlan {
    pub method: Vec<LightPathMethod>,
    /// Radius of the patches as a share of the body's size.
    pub radius_share: Vec<f64>,
    /// Optical depths below which `sampled` takes the tangent plane without a fit; the others fit all.
    pub skip_optical_depth: Vec<f64>,
}

/// The bodies.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct BodyPlan {
    /// Bodies by formula; left out where a file is named.
    pub shape: Vec<Shape>,
    /// About so many points of those.
    pub vertices: Vec<u32>,
    /// Closed surfaces, as fine as they are.
    pub file: Vec<String>,
    /// Longest extent [m].
    pub size_m: f64,
}

/// How they move.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct MotionPlan {
    pub deformation: Vec<Deformation>,
    /// Shares of the points that move in a poke, those nearest to it; elsewhere all move.
    pub moved_share: Vec<f64>,
    /// Timed frames.
    pub frames: u32,
}

/// Long runs, with a twentieth of the points moving.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct DriftPlan {
    pub method: Vec<LightPathMethod>,
    pub frames: u32,
    /// How far the body lies from the origin [m].
    pub origin_m: Vec<f64>,
    pub vertices: u32,
    pub radius_share: f64,
}

/// The truth.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct OraclePlan {
    /// Points looked at by each of four eyes.
    pub sights: u32,
    /// The picture beside the chart: pixels of a panel's side; 0 for none, and for no simulated prodding.
    pub picture_px: u32,
}

/// One point of the sweep.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Cell {
    pub method: LightPathMethod,
    /// A shape, or a file.
    pub body: String,
    /// Longest extent [m].
    pub size_m: f64,
    /// Points asked for; null for a file.
    pub vertices_asked: Option<u32>,
    pub deformation: Deformation,
    pub radius_share: f64,
    /// Optical depth below which no fit is made; 0 fits all.
    pub skip_optical_depth: f64,
    pub moved_share: f64,
    pub frames: u32,
    /// Distance from the origin [m].
    pub origin_m: f64,
    /// Points looked at by each eye; 0 in long runs, which look at the fits alone.
    pub sights: u32,
}

/// What is measured of it; errors of radiance are `√(Σ error² / Σ truth²)`.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
pub struct Measures {
    pub vertices: u32,
    /// Points to a patch, on average.
    pub patch_members: f64,
    /// Points found moved, and fits made, in the last frame but one.
    pub moved: u32,
    pub refitted: u32,
    /// GPU time of the passes of the method [ms].
    pub refit_ms_p50: Option<f64>,
    pub refit_ms_p95: Option<f64>,
    /// Angle from the f64 fit of all members.
    pub normal_error_deg_p99: Option<f64>,
    /// Angle from the f64 fit of what the kernel is given.
    pub kernel_error_deg_p999: Option<f64>,
    /// Of ‖KM‖, front and graze.
    pub km_error_rel: Option<f64>,
    /// Of radiance, front and graze.
    pub radiance_error_rel: Option<f64>,
    pub radiance_error_front_rel: Option<f64>,
    pub radiance_error_graze_rel: Option<f64>,
    pub radiance_error_back_rel: Option<f64>,
    /// Where the body is poked.
    pub radiance_error_poked_rel: Option<f64>,
    /// With cast shadows: in truth those of every place, for a method those it sees, or that of the point.
    pub radiance_error_with_shadows_rel: Option<f64>,
    /// With planes blended as published, by the first power of the way.
    pub radiance_error_published_rel: Option<f64>,
    /// Of stale planes if they moved along with their points and turned with nothing: everywhere, and where the
    /// body is poked. What is left of their error is that they do not turn.
    pub radiance_error_unturned_rel: Option<f64>,
    pub radiance_error_unturned_poked_rel: Option<f64>,
    pub oracle: String,
}

/// The study.
pub struct Planes {
    bench: Bench,
}

impl Sweep for Planes {
    const STUDY: Study = Study::Planes;
    const SIDE_BY_SIDE: bool = false;
    type Plan = Plan;
    type Cell = Cell;
    type Measures = Measures;

    fn plan(quick: bool) -> Plan {
        let pick = |full: u32, few: u32| if quick { few } else { full };
        Plan {
            light_path: LightPathPlan {
                method: LightPathMethod::ALL.to_vec(),
                radius_share: if quick {
                    vec![0.05, 0.1]
                } else {
                    vec![0.02, 0.05, 0.1, 0.2]
                },
                skip_optical_depth: vec![0.0, 0.05, 0.2],
            },
            body: BodyPlan {
                shape: if quick {
                    vec![Shape::Blob]
                } else {
                    vec![Shape::Spleen, Shape::Liver, Shape::Blob]
                },
                vertices: if quick {
                    vec![2_500]
                } else {
                    vec![2_500, 10_000, 40_000]
                },
                file: Vec::new(),
                size_m: 0.15,
            },
            motion: MotionPlan {
                deformation: Deformation::ALL.to_vec(),
                moved_share: vec![0.0, 0.01, 0.05, 0.2, 1.0],
                frames: pick(21, 3),
            },
            drift: DriftPlan {
                method: vec![LightPathMethod::Incremental],
                frames: pick(100_000, 500),
                origin_m: vec![0.0, 10.0],
                vertices: 2_500,
                radius_share: 0.1,
            },
            oracle: OraclePlan {
                sights: pick(220, 60),
                picture_px: pick(360, 120),
            },
        }
    }

    fn cells(plan: &Plan) -> Result<Vec<Cell>, String> {
        in_range(
            "light_path.radius_share",
            &plan.light_path.radius_share,
            1e-3,
            0.5,
        )?;
        in_range(
            "light_path.skip_optical_depth",
            &plan.light_path.skip_optical_depth,
            0.0,
            10.0,
        )?;
        in_range("motion.moved_share", &plan.motion.moved_share, 0.0, 1.0)?;
        in_range("body.size_m", &[plan.body.size_m], 1e-3, 10.0)?;
        in_range("drift.radius_share", &[plan.drift.radius_share], 1e-3, 0.5)?;
        in_range("drift.origin_m", &plan.drift.origin_m, 0.0, 1e4)?;
        let vertices: Vec<f64> = plan.body.vertices.iter().map(|&n| f64::from(n)).collect();
        in_range("body.vertices", &vertices, 200.0, 200_000.0)?;
        in_range(
            "drift.vertices",
            &[f64::from(plan.drift.vertices)],
            200.0,
            200_000.0,
        )?;
        in_range("motion.frames", &[f64::from(plan.motion.frames)], 1.0, 1e6)?;
        in_range("oracle.sights", &[f64::from(plan.oracle.sights)], 1.0, 1e5)?;
        in_range(
            "oracle.picture_px",
            &[f64::from(plan.oracle.picture_px)],
            0.0,
            2048.0,
        )?;
        let mut cells = Vec::new();
        for (body, vertices_asked) in bodies(plan) {
            for &radius_share in &plan.light_path.radius_share {
                for &method in &plan.light_path.method {
                    for &deformation in &plan.motion.deformation {
                        let shares = match deformation {
                            Deformation::Rest => vec![0.0],
                            Deformation::Poke => plan.motion.moved_share.clone(),
                            _ => vec![1.0],
                        };
                        let skips = plan.light_path.skip_optical_depth.iter();
                        let skips = skips
                            .filter(|&&skip| skip == 0.0 || method == LightPathMethod::Sampled);
                        for &skip_optical_depth in skips {
                            cells.extend(shares.iter().map(|&moved_share| Cell {
                                method,
                                body: body.clone(),
                                size_m: plan.body.size_m,
                                vertices_asked,
                                deformation,
                                radius_share,
                                skip_optical_depth,
                                moved_share,
                                frames: plan.motion.frames,
                                origin_m: 0.0,
                                sights: plan.oracle.sights,
                            }));
                        }
                    }
                }
            }
        }
        if let Some((body, asked)) = bodies(plan).into_iter().next() {
            for &method in &plan.drift.method {
                for &origin_m in &plan.drift.origin_m {
                    if plan.drift.frames > 0 {
                        cells.push(Cell {
                            method,
                            body: body.clone(),
                            size_m: plan.body.size_m,
                            vertices_asked: asked.map(|_| plan.drift.vertices),
                            deformation: Deformation::Poke,
                            radius_share: plan.drift.radius_share,
                            skip_optical_depth: 0.0,
                            moved_share: 0.05,
                            frames: plan.drift.frames,
                            origin_m,
                            sights: 0,
                        });
                    }
                }
            }
        }
        Ok(cells)
    }

    fn adapter() -> Result<String, AppError> {
        Ok(Gpu::headless().map_err(AppError::Gpu)?.adapter)
    }

    fn new(_: &Plan, _: &Path, threads: usize) -> Result<Self, AppError> {
        Ok(Self {
            bench: Bench::new(Gpu::headless().map_err(AppError::Gpu)?, threads),
        })
    }

    fn measure(&self, cell: &Cell) -> Result<Row<Cell, Measures>, AppError> {
        self.bench.measure(cell)
    }

    fn finish(plan: &Plan, out: &Path, threads: usize) -> Result<(), AppError> {
        let side_px = plan.oracle.picture_px;
        if side_px == 0 {
            return Ok(());
        }
        let bench = Bench::new(Gpu::headless().map_err(AppError::Gpu)?, threads);
        picture::write(&bench, side_px, out)?;
        prod::write(&bench, plan.oracle.sights, out)
    }

    fn findings(rows: &[Row<Cell, Measures>]) -> Findings {
        show::findings(rows)
    }
}

/// Every body with the points asked for.
fn bodies(plan: &Plan) -> Vec<(String, Option<u32>)> {
    if plan.body.file.is_empty() {
        let shapes = plan.body.shape.iter();
        let both = shapes.flat_map(|shape| plan.body.vertices.iter().map(move |&n| (shape, n)));
        both.map(|(shape, n)| (shape.name().to_owned(), Some(n)))
            .collect()
    } else {
        let files = plan.body.file.iter();
        files.map(|file| (file.clone(), None)).collect()
    }
}

fn in_range(key: &str, values: &[f64], low: f64, high: f64) -> Result<(), String> {
    match values.iter().find(|value| !(low..=high).contains(*value)) {
        None => Ok(()),
        Some(value) => Err(format!(
            "{key} = {value} is out of range: choose from {low} to {high}"
        )),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn plan_crosses_methods_radii_deformations_sizes_and_shares() {
        let plan = Planes::plan(false);
        let cells = Planes::cells(&plan).expect("the plan is sound");
        let bodies = 3 * 3;
        let poses = 6 + 5;
        let methods = LightPathMethod::ALL.len();
        // Two more settings of `sampled`.
        assert_eq!(cells.len(), bodies * 4 * (methods + 2) * poses + 2);
        assert!(
            cells
                .iter()
                .any(|cell| cell.frames >= 100_000 && cell.origin_m == 10.0)
        );
    }

    #[test]
    fn files_take_the_place_of_shapes_and_values_out_of_range_are_refused() {
        let mut plan = Planes::plan(true);
        plan.body.file = vec!["organ.glb".to_owned()];
        let cells = Planes::cells(&plan).expect("the plan is sound");
        assert!(
            cells
                .iter()
                .all(|cell| cell.body == "organ.glb" && cell.vertices_asked.is_none())
        );
        plan.light_path.radius_share = vec![0.05, f64::NAN];
        assert!(Planes::cells(&plan).unwrap_err().contains("0.001 to 0.5"));
    }
}
