//! `summary.json`: the run in one object, its keys fixed for scripts that read it.

use super::files::{FileError, write};
use super::log::{FrameRecord, pass_names};
use super::stats::{Stats, percentile, sorted};
use serde::Serialize;
use std::path::Path;

/// The run in one object. Field names are the keys.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct Summary {
    /// Name of the scene.
    pub scene: String,
    /// Version of the program.
    pub version: String,
    /// Commit it was built from.
    pub commit: String,
    /// GPU adapter; `None` (null) if nothing was drawn.
    pub adapter: Option<String>,
    /// Threads of the simulation.
    pub threads: usize,
    /// Frames done.
    pub frames: u32,
    /// Fixed time step [s].
    pub timestep_s: f64,
    /// Width and height of the pictures [pixels].
    pub size: [u32; 2],
    /// How large the body is.
    pub mesh: MeshCounts,
    /// The solver that moved it at the end.
    pub solver: SolverSummary,
    /// Wall time of a frame [ms]; null without frames.
    pub frame_ms: Option<Stats>,
    /// Wall time of the simulation of a frame [ms]; null without frames.
    pub sim_ms: Option<Stats>,
    /// The passes of the scene in the order of a frame.
    pub passes: Vec<PassSummary>,
    /// Names of the passes that the scene did not need.
    pub left_out: Vec<String>,
    /// How the light-path primitives were kept up to date.
    pub refit: RefitSummary,
    /// SHA-256 of the final f32 particle positions, in hexadecimal.
    pub state_sha256: String,
    /// Whether every particle was finite in every frame.
    pub finite: bool,
    /// Tetrahedra of negative volume.
    pub inverted_tets: MaxFinal<u64>,
    /// (volume - rest volume) / rest volume; the largest by magnitude.
    pub volume_drift: MaxFinal<f64>,
    /// Speed of the fastest particle in the last frame [m/s].
    pub speed_max_final_m_s: f64,
    /// The tools together.
    pub tool: ToolSummary,
    /// The points that the scene follows.
    pub markers: Vec<MarkerSummary>,
    /// From the start of the process to the first finished frame [s].
    pub first_frame_s: f64,
}

/// How large the body is.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct MeshCounts {
    /// Vertices of the drawn surface.
    pub vertices: usize,
    /// Its triangles.
    pub triangles: usize,
    /// Tetrahedra of the simulated body.
    pub tets: usize,
}

/// The solver that moved the body at the end, which may not be the one that the scene asked for.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct SolverSummary {
    /// Name of the method.
    pub method: String,
    /// Substeps of a frame.
    pub substeps: u32,
    /// Iterations of a substep.
    pub iterations: u32,
    /// Frame from which on it took the place of what the scene asks for, 0 from the start; null if it is that.
    pub handed_over_frame: Option<u32>,
}

/// One pass over the run.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct PassSummary {
    /// Name of the pass.
    pub name: String,
    /// Dispatches or draws in a frame.
    pub dispatches_or_draws: u32,
    /// GPU time [ms]; null if the adapter has no timestamps.
    pub gpu_ms: Option<GpuStats>,
}

/// GPU times of one pass [ms].
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct GpuStats {
    /// Median.
    pub p50: f64,
    /// 95th percentile.
    pub p95: f64,
    /// Largest.
    pub max: f64,
}

/// How the light-path primitives were kept up to date.
#[derive(Clone, Debug, Default, PartialEq, Serialize)]
pub struct RefitSummary {
    /// Name of the method.
    pub method: String,
    /// Vertices that have a primitive.
    pub vertices: usize,
    /// Mean number of vertices refitted in a frame.
    pub refitted_mean: f64,
    /// Largest number of vertices refitted in a frame.
    pub refitted_max: u32,
    /// Mean number of vertices that moved in a frame.
    pub moved_mean: f64,
}

/// The worst value of the run and the last.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct MaxFinal<T> {
    /// The worst of all frames.
    pub max: T,
    /// That of the last frame.
    #[serde(rename = "final")]
    pub last: T,
}

/// The tools together, the largest of all frames.
#[derive(Clone, Copy, Debug, Default, PartialEq, Serialize)]
pub struct ToolSummary {
    /// Force [N].
    pub force_max_n: f64,
    /// Penetration [m].
    pub penetration_max_m: f64,
}

/// A point that the scene follows.
#[derive(Clone, Debug, PartialEq, Serialize)]
pub struct MarkerSummary {
    /// Its name in the scene.
    pub name: String,
    /// Where it was at rest [m].
    pub rest_m: [f64; 3],
    /// Where it ended [m].
    pub final_m: [f64; 3],
    /// `final_m` - `rest_m` [m].
    pub displacement_m: [f64; 3],
}

impl MarkerSummary {
    /// A marker that went from `rest_m` to `final_m`.
    pub fn new(name: String, rest_m: [f64; 3], final_m: [f64; 3]) -> Self {
        Self {
            name,
            rest_m,
            final_m,
            displacement_m: std::array::from_fn(|k| final_m[k] - rest_m[k]),
        }
    }
}

impl MaxFinal<f64> {
    /// The value of largest magnitude, and the last; zeros without values. NaN is the largest.
    pub fn of(values: impl IntoIterator<Item = f64>) -> Self {
        values
            .into_iter()
            .fold(Self::default(), |so_far, value| Self {
                max: if value.is_nan() || value.abs() > so_far.max.abs() {
                    value
                } else {
                    so_far.max
                },
                last: value,
            })
    }
}

impl ToolSummary {
    /// The largest force and penetration in `records`.
    pub fn of(records: &[FrameRecord]) -> Self {
        let most = |value: fn(&FrameRecord) -> f32| {
            MaxFinal::of(records.iter().map(|record| f64::from(value(record)))).max
        };
        Self {
            force_max_n: most(|record| record.tool_force_n),
            penetration_max_m: most(|record| record.penetration_m),
        }
    }
}

/// The passes in `records`; `count_of` says how many dispatches or draws each has in a frame.
pub fn passes(records: &[FrameRecord], count_of: impl Fn(&str) -> u32) -> Vec<PassSummary> {
    let summary = |name: &'static str| {
        let times = records.iter().flat_map(|record| &record.passes_ms);
        let times = sorted(times.filter(|(pass, _)| *pass == name).map(|&(_, ms)| ms));
        let share = |share| percentile(&times, share);
        PassSummary {
            name: name.to_owned(),
            dispatches_or_draws: count_of(name),
            gpu_ms: share(0.5)
                .zip(share(0.95))
                .zip(share(1.0))
                .map(|((p50, p95), max)| GpuStats { p50, p95, max }),
        }
    };
    pass_names(records).into_iter().map(summary).collect()
}

/// Writes `summary` as JSON. Numbers that are not finite become null.
///
/// # Errors
///
/// [`FileError::Write`].
pub fn write_summary(file: &Path, summary: &Summary) -> Result<(), FileError> {
    let mut text = serde_json::to_string_pretty(summary).expect("a summary has string keys");
    text.push('\n');
    write(file, text.as_bytes())
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;

    /// A summary with something in every field.
    pub fn example(records: &[FrameRecord]) -> Summary {
        Summary {
            scene: "liver".to_owned(),
            version: "0.1.0".to_owned(),
            commit: "0123abc".to_owned(),
            adapter: Some("llvmpipe (LLVM 15.0.6, 256 bits), Vulkan".to_owned()),
            threads: 2,
            frames: records.len() as u32,
            timestep_s: 1.0 / 60.0,
            size: [800, 600],
            mesh: MeshCounts {
                vertices: 4274,
                triangles: 8544,
                tets: 10213,
            },
            solver: SolverSummary {
                method: "implicit".to_owned(),
                substeps: 4,
                iterations: 1,
                handed_over_frame: Some(37),
            },
            frame_ms: Stats::of(records.iter().map(|record| record.wall_ms)),
            sim_ms: Stats::of(records.iter().map(|record| record.sim_ms)),
            passes: passes(records, |_| 1),
            left_out: vec!["light map".to_owned(), "diffusion blur".to_owned()],
            refit: RefitSummary {
                method: "incremental".to_owned(),
                vertices: 4274,
                refitted_mean: 211.4,
                refitted_max: 903,
                moved_mean: 640.2,
            },
            state_sha256: "9f".repeat(32),
            finite: true,
            inverted_tets: MaxFinal { max: 2, last: 0 },
            volume_drift: MaxFinal::of(records.iter().map(|r| f64::from(r.volume_drift))),
            speed_max_final_m_s: 0.0004,
            tool: ToolSummary::of(records),
            markers: vec![MarkerSummary::new(
                "tip".to_owned(),
                [0.1, 0.0, 0.0],
                [0.098, -0.021, 0.0],
            )],
            first_frame_s: 0.84,
        }
    }

    #[test]
    fn summary_has_exactly_the_agreed_keys() {
        let json = serde_json::to_value(example(&[FrameRecord::default()])).unwrap();
        let keys = |value: &serde_json::Value| {
            let mut keys: Vec<String> = value.as_object().unwrap().keys().cloned().collect();
            keys.sort();
            keys.join(" ")
        };
        assert_eq!(
            keys(&json),
            "adapter commit finite first_frame_s frame_ms frames inverted_tets left_out markers mesh \
             passes refit scene sim_ms size solver speed_max_final_m_s state_sha256 threads timestep_s tool \
             version volume_drift"
        );
        assert_eq!(keys(&json["frame_ms"]), "low1pct max p50 p95 p99");
        assert_eq!(keys(&json["sim_ms"]), "low1pct max p50 p95 p99");
        assert_eq!(keys(&json["mesh"]), "tets triangles vertices");
        assert_eq!(
            keys(&json["solver"]),
            "handed_over_frame iterations method substeps"
        );
        assert_eq!(keys(&json["inverted_tets"]), "final max");
        assert_eq!(keys(&json["volume_drift"]), "final max");
        assert_eq!(keys(&json["tool"]), "force_max_n penetration_max_m");
        assert_eq!(
            keys(&json["refit"]),
            "method moved_mean refitted_max refitted_mean vertices"
        );
        assert_eq!(
            keys(&json["markers"][0]),
            "displacement_m final_m name rest_m"
        );
    }

    #[test]
    fn passes_are_summed_up_over_the_frames_that_ran_them() {
        let record = |ms| FrameRecord {
            passes_ms: vec![("tangents", ms)],
            ..FrameRecord::default()
        };
        let passes = passes(&[record(1.0), FrameRecord::default(), record(3.0)], |_| 4);
        assert_eq!(passes[0].dispatches_or_draws, 4);
        let gpu_ms = passes[0].gpu_ms.unwrap();
        assert_eq!((gpu_ms.p50, gpu_ms.max), (2.0, 3.0));
        let json = serde_json::to_value(&passes).unwrap();
        assert!(json[0]["gpu_ms"]["p95"].is_number());
    }

    #[test]
    fn worst_drift_is_the_largest_by_magnitude_and_nan_is_worse_than_any() {
        let drift = MaxFinal::of([0.01, -0.05, 0.02]);
        assert_eq!((drift.max, drift.last), (-0.05, 0.02));
        assert!(MaxFinal::of([0.01, f64::NAN, 0.02]).max.is_nan());
    }
}
