//! What a run leaves behind: the frame log, the summary, the trace, the states and the report.

use super::renderer::{Frame, Renderer};
use super::session::{Session, Tick};
use super::{AppError, VERSION_COMMIT, VERSION_NUMBER};
use crate::measure::chart::three_digits;
use crate::measure::log::{FrameRecord, write_frames_csv};
use crate::measure::report::{self, replay_page};
use crate::measure::states::States;
use crate::measure::stats::Stats;
use crate::measure::summary::{
    MarkerSummary, MaxFinal, MeshCounts, RefitSummary, SolverSummary, Summary, ToolSummary, passes,
    write_summary,
};
use crate::measure::trace::{Span, write_trace};
use crate::passes::frame::{FramePlan, effective_method};
use crate::sim::{Method, ToolAction};
use std::path::Path;
use std::sync::OnceLock;
use std::time::Instant;

/// Pictures that a report embeds; beyond that it takes them evenly.
const REPORT_PICTURES_MAX: usize = 6;

/// Residual over load beyond which a frame of the implicit method is not to be trusted; one iteration of a swift
/// swing leaves a fifth, which the next step makes good.
const UNSETTLED_SHARE: f32 = 1.0;

static PROCESS_START: OnceLock<Instant> = OnceLock::new();

/// Remembers when the process started; called first in `main`.
pub fn start_clock() {
    process_start();
}

fn process_start() -> Instant {
    *PROCESS_START.get_or_init(Instant::now)
}

/// Everything a run is asked for afterwards.
pub struct Recording {
    scene: String,
    threads: usize,
    records: Vec<FrameRecord>,
    /// For the trace; none where there will be only a log.
    spans: Option<Vec<Span>>,
    states: States,
    pictures: Vec<(Vec<u8>, String)>,
    moved: Vec<u32>,
    inverted: Vec<usize>,
    speed_final_m_s: f32,
    frozen: usize,
    finite: bool,
    first_frame_s: f64,
}

impl Recording {
    /// An empty recording of a run of `scene`.
    pub fn new(scene: String, threads: usize) -> Self {
        Self {
            scene,
            threads,
            records: Vec::new(),
            spans: Some(Vec::new()),
            states: States::default(),
            pictures: Vec::new(),
            moved: Vec::new(),
            inverted: Vec::new(),
            speed_final_m_s: 0.0,
            frozen: 0,
            finite: true,
            first_frame_s: 0.0,
        }
    }

    /// The same where only the frame log will be written: an hour of a window is long.
    pub fn of_log(scene: String, threads: usize) -> Self {
        Self {
            spans: None,
            ..Self::new(scene, threads)
        }
    }

    /// A frame is finished: the first one of all is remembered.
    pub fn first_frame_done(&mut self) {
        if self.first_frame_s == 0.0 {
            self.first_frame_s = process_start().elapsed().as_secs_f64();
        }
    }

    /// Adds the frame that began at `start` and has just ended.
    pub fn add(&mut self, session: &Session, start: Instant, tick: &Tick, drawn: Frame) {
        let wall_ms = start.elapsed().as_secs_f32() * 1e3;
        self.first_frame_done();
        let mut passes_ms: Vec<(&'static str, f32)> = Vec::new();
        for pass in &drawn.passes {
            match passes_ms.iter_mut().find(|(name, _)| *name == pass.name) {
                Some((_, ms)) => *ms += pass.gpu_ms,
                None => passes_ms.push((pass.name, pass.gpu_ms)),
            }
        }
        self.add_spans(start, wall_ms, tick, &drawn);
        let gpu_ms: f32 = passes_ms.iter().map(|(_, ms)| ms).sum();
        self.finite &= session.points().iter().all(|p| p.is_finite());
        self.frozen = tick.report.frozen_particles;
        self.moved.push(drawn.refit.moved);
        self.inverted.push(tick.report.inverted_tets);
        self.speed_final_m_s = tick.report.speed_max_m_s;
        self.records.push(FrameRecord {
            frame: session.frame(),
            time_s: f64::from(session.frame()) * f64::from(session.scene.solver.timestep_s),
            wall_ms,
            sim_ms: tick.sim_ms,
            passes_ms,
            cpu_outside_ms: (wall_ms - tick.sim_ms - gpu_ms).max(0.0),
            vertices_refitted: drawn.refit.refitted,
            residual_rms: tick.report.residual_rms,
            volume_drift: tick.report.volume_drift,
            tool_force_n: tick.force_max_n(),
            tool_depth_m: session.tool_depth_m(),
            penetration_m: tick.report.penetration_max_m,
            speed_max_m_s: tick.report.speed_max_m_s,
        });
    }

    fn add_spans(&mut self, start: Instant, wall_ms: f32, tick: &Tick, drawn: &Frame) {
        let Some(spans) = &mut self.spans else {
            return;
        };
        let start_us = (start - process_start()).as_secs_f64() * 1e6;
        let mut span = |name: &'static str, category, from_ms: f32, ms: f32, thread| {
            spans.push(Span {
                name: name.into(),
                category,
                start_us: start_us + 1e3 * f64::from(from_ms),
                duration_us: 1e3 * f64::from(ms),
                thread,
            });
        };
        span("frame", "frame", 0.0, wall_ms, 0);
        span("simulation", "simulation", 0.0, tick.sim_ms, 1);
        // The GPU has a clock of its own; its passes follow the simulation.
        for pass in &drawn.passes {
            span(
                pass.name,
                "gpu",
                tick.sim_ms + pass.start_ms,
                pass.gpu_ms,
                2,
            );
        }
    }

    /// Samples the surface as it lies now.
    pub fn sample(&mut self, session: &Session) {
        let points = session.points().iter().map(|p| p.to_array());
        self.states.push(session.frame(), points);
    }

    /// Keeps a picture for the report.
    pub fn add_picture(&mut self, frame: u32, png: Vec<u8>) {
        self.pictures.push((png, format!("frame {frame}")));
    }

    /// Writes only the frame log.
    ///
    /// # Errors
    ///
    /// [`AppError::File`] naming the file and the remedy.
    pub fn write_log(&self, file: &Path) -> Result<(), AppError> {
        Ok(write_frames_csv(file, &self.records)?)
    }

    /// Writes all files of a run into `out`; `sets` are the values that were replaced for it.
    ///
    /// # Errors
    ///
    /// [`AppError::File`] naming the file and the remedy.
    pub fn write(
        mut self,
        out: &Path,
        sets: &[String],
        session: &Session,
        renderer: Option<&Renderer>,
    ) -> Result<(), AppError> {
        write_frames_csv(&out.join("frames.csv"), &self.records)?;
        let threads = [(0, "frame"), (1, "simulation"), (2, "GPU")];
        write_trace(
            &out.join("trace.json"),
            self.spans.as_deref().unwrap_or_default(),
            &threads,
        )?;
        self.states.write(out)?;
        let summary = self.summary(session, renderer);
        write_summary(&out.join("summary.json"), &summary)?;
        let machine = report::machine();
        replay_page(report::Replay {
            summary: &summary,
            records: &self.records,
            machine: &machine,
            sets,
            notes: &session.notes,
            pictures: thinned(std::mem::take(&mut self.pictures)),
        })
        .write(&out.join("report.html"))?;
        self.say(&summary, session.solver().method, out);
        self.say_unsettled(session);
        Ok(())
    }

    fn summary(&self, session: &Session, renderer: Option<&Renderer>) -> Summary {
        let plan = match renderer {
            Some(_) => FramePlan::for_scene(&session.scene),
            None => FramePlan::for_scene(&session.scene).undrawn(),
        };
        let method = match renderer.and_then(|_| effective_method(&session.scene)) {
            Some(method) => method.name(),
            None => "none",
        };
        let drift = self.records.iter().map(|r| f64::from(r.volume_drift));
        let refitted = self.records.iter().map(|r| r.vertices_refitted);
        let frames = self.records.len().max(1) as f64;
        Summary {
            scene: self.scene.clone(),
            version: VERSION_NUMBER.to_owned(),
            commit: VERSION_COMMIT.to_owned(),
            adapter: renderer.map(|r| r.adapter().to_owned()),
            threads: self.threads,
            frames: self.records.len() as u32,
            timestep_s: f64::from(session.scene.solver.timestep_s),
            size: renderer.map_or([0; 2], Renderer::size),
            mesh: MeshCounts {
                vertices: session.mesh.uvs.len(),
                triangles: session.mesh.triangles.len(),
                tets: session.tet_count(),
            },
            solver: SolverSummary {
                method: session.solver().method.name().to_owned(),
                substeps: session.solver().substeps,
                iterations: session.solver().iterations,
                handed_over_frame: session.handed_over_frame(),
            },
            frame_ms: Stats::of(self.records.iter().map(|r| r.wall_ms)),
            sim_ms: Stats::of(self.records.iter().map(|r| r.sim_ms)),
            passes: passes(&self.records, |name| plan.count_of(name)),
            left_out: plan.left_out.iter().map(|&name| name.to_owned()).collect(),
            refit: RefitSummary {
                method: method.to_owned(),
                vertices: session.mesh.points.len(),
                refitted_mean: refitted.clone().map(f64::from).sum::<f64>() / frames,
                refitted_max: refitted.max().unwrap_or(0),
                moved_mean: self.moved.iter().map(|&m| f64::from(m)).sum::<f64>() / frames,
            },
            state_sha256: session.state_sha256(),
            finite: self.finite && self.frozen == 0,
            inverted_tets: MaxFinal {
                max: self.inverted.iter().copied().max().unwrap_or(0) as u64,
                last: self.inverted.last().copied().unwrap_or(0) as u64,
            },
            volume_drift: MaxFinal::of(drift),
            speed_max_final_m_s: f64::from(self.speed_final_m_s),
            tool: ToolSummary::of(&self.records),
            markers: session
                .markers()
                .map(|(marker, now)| {
                    MarkerSummary::new(
                        marker.name.clone(),
                        marker.rest_m.as_dvec3().to_array(),
                        now.as_dvec3().to_array(),
                    )
                })
                .collect(),
            first_frame_s: self.first_frame_s,
        }
    }

    /// Warns where the implicit method stopped long before its forces were settled.
    fn say_unsettled(&self, session: &Session) {
        let unsettled = |record: &&FrameRecord| {
            record.residual_rms.is_finite() && record.residual_rms > UNSETTLED_SHARE
        };
        let frames = self.records.iter().filter(unsettled).count();
        if session.solver().method == Method::Implicit && frames > 0 {
            eprintln!(
                "in {frames} frames the implicit method left forces as large as the load unsettled, and what \
                 tools felt may be far off: use more iterations or a shorter time step"
            );
        }
    }

    /// One line for the one who waited.
    fn say(&self, summary: &Summary, method: Method, out: &Path) {
        if let Some(frame) = &summary.frame_ms {
            eprintln!(
                "{} frames, p50 {:.1} ms, p95 {:.1} ms, largest force {} N; see {}",
                summary.frames,
                frame.p50,
                frame.p95,
                three_digits(summary.tool.force_max_n),
                out.join("report.html").display()
            );
        }
        if summary.inverted_tets.last > 0 {
            let remedy = match method {
                Method::Implicit => {
                    "the load folds it: use a stiffer material, or a finer mesh where it is held"
                }
                _ => "use more substeps, a stiffer material, or the method implicit",
            };
            let count = summary.inverted_tets.last;
            eprintln!("{count} tetrahedra end inverted, so the body is wrecked: {remedy}");
        }
        if self.frozen > 0 {
            eprintln!(
                "{} particles went astray and were held where they were last sound: \
                 use more substeps or a softer material",
                self.frozen
            );
        }
    }
}

impl Tick {
    /// Size of the largest force on a tool that does something [N].
    pub fn force_max_n(&self) -> f32 {
        self.report
            .tool_forces_n
            .iter()
            .zip(&self.tools)
            .filter(|(_, tool)| tool.action != ToolAction::Idle)
            .map(|(force, _)| force.length())
            .fold(0.0, f32::max)
    }
}

/// At most [`REPORT_PICTURES_MAX`] pictures, evenly chosen, the last one among them.
fn thinned(pictures: Vec<(Vec<u8>, String)>) -> Vec<(Vec<u8>, String)> {
    let count = pictures.len();
    if count <= REPORT_PICTURES_MAX {
        return pictures;
    }
    let wanted: Vec<usize> = (0..REPORT_PICTURES_MAX)
        .map(|k| k * (count - 1) / (REPORT_PICTURES_MAX - 1))
        .collect();
    pictures
        .into_iter()
        .enumerate()
        .filter(|(index, _)| wanted.contains(index))
        .map(|(_, picture)| picture)
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_log_counts_every_frame_and_says_what_it_costs() {
        use crate::app::load;
        use crate::gpu::PassTime;
        let scene = load::scene("slab", &["body.cell_m=0.01".to_owned()]).expect("a bundled scene");
        let mut session = Session::new(scene, 1).expect("a sound scene");
        let mut recording = Recording::new("slab".to_owned(), 1);
        let (frames, start) = (120, Instant::now());
        let mut logging_s = 0.0;
        for _ in 0..frames {
            let begun = Instant::now();
            let tick = session.tick();
            let passes = [
                "tangents", "shadow", "geometry", "plain", "tools", "tonemap",
            ];
            let drawn = Frame {
                passes: passes
                    .map(|name| PassTime {
                        name,
                        gpu_ms: 0.1,
                        start_ms: 0.0,
                    })
                    .to_vec(),
                ..Frame::default()
            };
            let logged = Instant::now();
            recording.add(&session, begun, &tick, drawn);
            logging_s += logged.elapsed().as_secs_f64();
        }
        let spans = recording.spans.as_ref().expect("a trace");
        assert_eq!((recording.records.len(), spans.len()), (frames, 8 * frames));
        let row = size_of::<FrameRecord>() + 6 * size_of::<(&str, f32)>();
        println!(
            "logging: {:.2} us a frame, {:.3} % of {:.2} ms simulated alone; {} bytes a frame, {} without a trace",
            1e6 * logging_s / frames as f64,
            100.0 * logging_s / start.elapsed().as_secs_f64(),
            1e3 * start.elapsed().as_secs_f64() / frames as f64,
            row + 8 * size_of::<Span>(),
            row,
        );
        assert!(Recording::of_log(String::new(), 1).spans.is_none());
    }

    #[test]
    fn a_report_takes_first_and_last_of_many_pictures() {
        let pictures = (0..100).map(|k| (vec![k as u8], k.to_string())).collect();
        let kept = thinned(pictures);
        assert_eq!(kept.len(), REPORT_PICTURES_MAX);
        assert_eq!(kept[0].1, "0");
        assert_eq!(kept[REPORT_PICTURES_MAX - 1].1, "99");
    }
}
