//! The report of a replay: what ran on what machine, what each frame cost, and how far off it was.

use super::chart::{BARS_MAX, Level, LineChart, Series, StackedChart, number, three_digits};
use super::log::{FrameRecord, pass_names};
use super::page::{Block, KeyFigure, Page, Section, Table};
use super::stats::{Stats, percentile, sorted};
use super::summary::Summary;

/// Charts over the whole width, and two in a row [px].
const WIDE_PX: (f64, f64) = (880.0, 270.0);
const HALF_PX: (f64, f64) = (427.0, 200.0);
/// Frames above this multiple of the 99th percentile are marked rather than drawn to scale.
const CEILING_OF_P99: f64 = 1.5;

/// What a report is made of.
#[derive(Clone, Debug)]
pub struct Replay<'a> {
    /// The run in one object.
    pub summary: &'a Summary,
    /// The run frame by frame.
    pub records: &'a [FrameRecord],
    /// What it ran on, see [`machine`].
    pub machine: &'a str,
    /// The values of the scene that were replaced for this run, as `key=value`.
    pub sets: &'a [String],
    /// What was guessed, mended or left out when the scene was loaded.
    pub notes: &'a [String],
    /// PNG files, each with what it shows.
    pub pictures: Vec<(Vec<u8>, String)>,
}

/// The report of `replay`.
pub fn replay_page(replay: Replay) -> Page {
    let Replay {
        summary,
        records,
        machine,
        sets,
        notes,
        pictures,
    } = replay;
    let mut sections = vec![
        frame_times(summary, records),
        stages(records),
        accuracy(records),
    ];
    if !pictures.is_empty() {
        sections.push(Section {
            title: "Pictures".to_owned(),
            blocks: vec![Block::Pictures(pictures)],
        });
    }
    sections.push(passes(summary));
    if !summary.markers.is_empty() {
        sections.push(markers(summary));
    }
    sections.push(setup(summary, machine, sets, notes));
    let with = match sets {
        [] => String::new(),
        sets => format!(" · with {}", sets.join(", ")),
    };
    Page {
        title: format!("Replay of {}", summary.scene),
        subtitle: format!(
            "palpate {} ({}) · {} frames at {} × {} pixels · {}{with}",
            summary.version,
            summary.commit,
            summary.frames,
            summary.size[0],
            summary.size[1],
            summary.adapter.as_deref().unwrap_or("simulation only")
        ),
        lead: lead(summary),
        figures: figures(summary),
        sections,
    }
}

/// The processor, its threads and the system, as far as the system tells.
pub fn machine() -> String {
    let processor = std::fs::read_to_string("/proc/cpuinfo")
        .ok()
        .and_then(|text| {
            let mut lines = text.lines();
            let line = lines.find(|line| line.starts_with("model name"))?;
            Some(line.split_once(':')?.1.trim().to_owned())
        });
    let threads = std::thread::available_parallelism().map_or(1, |threads| threads.get());
    format!(
        "{}, {threads} hardware threads, {} {}",
        processor.unwrap_or_else(|| "unnamed processor".to_owned()),
        std::env::consts::OS,
        std::env::consts::ARCH
    )
}

/// The result in a few sentences.
fn lead(summary: &Summary) -> String {
    let mut lead = match &summary.frame_ms {
        Some(frame) => format!(
            "Half of the frames took at most {} ms and 99 % at most {} ms; the slowest 1 % took {} ms \
             on average. ",
            three_digits(frame.p50),
            three_digits(frame.p99),
            three_digits(frame.low1pct)
        ),
        None => "No frame was finished. ".to_owned(),
    };
    if summary.adapter.is_some() {
        lead +=
            "Frame 0, the body at rest, was drawn first and is left out: it warms the adapter up. ";
    }
    lead += &format!(
        "The volume was off by {} % at most and by {} % at the end.",
        number(100.0 * summary.volume_drift.max),
        number(100.0 * summary.volume_drift.last)
    );
    lead += match summary.inverted_tets {
        tets if tets.max == 0 => " No tetrahedron was ever inverted.",
        tets if tets.last == 0 => " Some tetrahedra were inverted on the way, none at the end.",
        _ => " Some tetrahedra are inverted at the end: do not trust this run.",
    };
    if !summary.finite {
        lead += " Positions became non-finite: do not trust this run.";
    }
    lead
}

fn figures(summary: &Summary) -> Vec<KeyFigure> {
    let figure = |label: &str, value: String, unit: &str| KeyFigure {
        label: label.to_owned(),
        value,
        unit: unit.to_owned(),
    };
    let mut figures = Vec::new();
    if let Some(frame) = &summary.frame_ms {
        figures.push(figure("Frame, median", three_digits(frame.p50), "ms"));
        figures.push(figure(
            "Frame, 99th percentile",
            three_digits(frame.p99),
            "ms",
        ));
    }
    if let Some(simulation) = &summary.sim_ms {
        figures.push(figure(
            "Simulation, median",
            three_digits(simulation.p50),
            "ms",
        ));
    }
    figures.push(figure(
        "Volume drift, largest",
        number(100.0 * summary.volume_drift.max),
        "%",
    ));
    figures.push(figure(
        "Tool force, largest",
        number(summary.tool.force_max_n),
        "N",
    ));
    figures.push(figure(
        "Penetration, deepest",
        number(1e3 * summary.tool.penetration_max_m),
        "mm",
    ));
    figures
}

fn over_frames(records: &[FrameRecord], value: impl Fn(&FrameRecord) -> f64) -> Vec<(f64, f64)> {
    let point = |record: &FrameRecord| (f64::from(record.frame), value(record));
    records.iter().map(point).collect()
}

fn frame_times(summary: &Summary, records: &[FrameRecord]) -> Section {
    let mut levels = Vec::new();
    if let Some(frame) = &summary.frame_ms {
        for (name, value) in [("p50", frame.p50), ("p95", frame.p95), ("p99", frame.p99)] {
            levels.push(Level {
                label: format!("{name} {} ms", three_digits(value)),
                value,
            });
        }
    }
    let chart = LineChart {
        size_px: WIDE_PX,
        x_label: "frame".to_owned(),
        y_label: "wall time of the frame [ms]".to_owned(),
        series: vec![Series {
            label: "frame".to_owned(),
            look: 0,
            points: over_frames(records, |record| f64::from(record.wall_ms)),
        }],
        levels,
        ceiling: summary.frame_ms.map(|frame| CEILING_OF_P99 * frame.p99),
    };
    let max = summary.frame_ms.map_or(f64::NAN, |frame| frame.max);
    Section {
        title: "Frame time".to_owned(),
        blocks: vec![
            Block::Chart {
                svg: chart.svg(),
                caption: format!(
                    "Wall time of every frame, with the median, the 95th and the 99th percentile. Red \
                     triangles mark frames beyond the top; the slowest took {} ms.",
                    three_digits(max)
                ),
            },
            Block::Table(times_table(&[
                ("frame", summary.frame_ms),
                ("simulation", summary.sim_ms),
            ])),
        ],
    }
}

fn times_table(rows: &[(&str, Option<Stats>)]) -> Table {
    let head = ["", "p50 ms", "p95 ms", "p99 ms", "max ms", "slowest 1 % ms"];
    let row = |(name, stats): &(&str, Option<Stats>)| {
        let stats = (*stats)?;
        let cells = [stats.p50, stats.p95, stats.p99, stats.max, stats.low1pct].map(three_digits);
        Some(std::iter::once((*name).to_owned()).chain(cells).collect())
    };
    Table {
        head: head.map(str::to_owned).to_vec(),
        rows: rows.iter().filter_map(row).collect(),
    }
}

/// The stages of every frame: simulation, each pass, the rest of the CPU.
fn stage_times(records: &[FrameRecord]) -> Vec<(String, Vec<f64>)> {
    let column = |value: &dyn Fn(&FrameRecord) -> f32| {
        records
            .iter()
            .map(|record| f64::from(value(record)))
            .collect()
    };
    let mut stages = vec![("simulation".to_owned(), column(&|record| record.sim_ms))];
    for pass in pass_names(records) {
        let time = |record: &FrameRecord| {
            let mut runs = record.passes_ms.iter().filter(|(name, _)| *name == pass);
            runs.next().map_or(0.0, |&(_, ms)| ms)
        };
        stages.push((pass.to_owned(), column(&time)));
    }
    stages.push((
        "CPU outside".to_owned(),
        column(&|record| record.cpu_outside_ms),
    ));
    stages
}

fn stages(records: &[FrameRecord]) -> Section {
    let layers = stage_times(records);
    let medians: Vec<[f64; 3]> = layers
        .iter()
        .map(|(_, values)| {
            let values = sorted(values.iter().map(|&value| value as f32));
            [0.5, 0.95, 1.0].map(|share| percentile(&values, share).unwrap_or(0.0))
        })
        .collect();
    let total: f64 = medians.iter().map(|[p50, ..]| p50).sum();
    let rows = layers.iter().zip(&medians).map(|((name, _), times)| {
        let share = format!("{:.0} %", 100.0 * times[0] / total.max(f64::MIN_POSITIVE));
        let cells = times.iter().map(|&time| three_digits(time));
        std::iter::once(name.clone())
            .chain(cells)
            .chain([share])
            .collect()
    });
    let head = ["stage", "p50 ms", "p95 ms", "max ms", "share of p50"];
    let table = Table {
        head: head.map(str::to_owned).to_vec(),
        rows: rows.collect(),
    };
    let group = records.len().div_ceil(BARS_MAX).max(1);
    let chart = StackedChart {
        size_px: WIDE_PX,
        x_label: "frame".to_owned(),
        y_label: "time by stage [ms]".to_owned(),
        layers,
    };
    let gathered = match group {
        1 => "Each bar is a frame.".to_owned(),
        group => format!("Each bar is the mean of {group} frames."),
    };
    Section {
        title: "Where the time goes".to_owned(),
        blocks: vec![
            Block::Chart {
                svg: chart.svg(),
                caption: format!(
                    "{gathered} GPU passes by timestamp queries; they may run beside CPU work, so the \
                     sum may pass the wall time."
                ),
            },
            Block::Table(table),
        ],
    }
}

fn accuracy(records: &[FrameRecord]) -> Section {
    let chart = |y_label: &str, caption: &str, value: fn(&FrameRecord) -> f64| {
        let chart = LineChart {
            size_px: HALF_PX,
            x_label: "frame".to_owned(),
            y_label: y_label.to_owned(),
            series: vec![Series {
                label: y_label.to_owned(),
                look: 0,
                points: over_frames(records, value),
            }],
            levels: Vec::new(),
            ceiling: None,
        };
        (chart.svg(), caption.to_owned())
    };
    Section {
        title: "How far off it was".to_owned(),
        blocks: vec![Block::Charts(vec![
            chart(
                "volume drift [%]",
                "Volume against the volume at rest.",
                |record| 100.0 * f64::from(record.volume_drift),
            ),
            chart(
                "residual, RMS",
                "What is left of the constraints, in their unit.",
                |record| f64::from(record.residual_rms),
            ),
            chart(
                "tool force [N]",
                "Force on the tools, from the multipliers.",
                |record| f64::from(record.tool_force_n),
            ),
            chart(
                "penetration [mm]",
                "Deepest point of tissue inside a tool.",
                |record| 1e3 * f64::from(record.penetration_m),
            ),
        ])],
    }
}

fn passes(summary: &Summary) -> Section {
    let rows = summary.passes.iter().map(|pass| {
        let times = match pass.gpu_ms {
            Some(gpu) => [gpu.p50, gpu.p95, gpu.max].map(three_digits),
            None => [const { String::new() }; 3],
        };
        [pass.name.clone(), pass.dispatches_or_draws.to_string()]
            .into_iter()
            .chain(times)
            .collect()
    });
    let head = [
        "pass",
        "dispatches or draws",
        "GPU p50 ms",
        "p95 ms",
        "max ms",
    ];
    let table = Table {
        head: head.map(str::to_owned).to_vec(),
        rows: rows.collect(),
    };
    let left_out = if summary.left_out.is_empty() {
        "The scene needed every pass.".to_owned()
    } else {
        format!(
            "Left out, because the scene does not need them: {}.",
            summary.left_out.join(", ")
        )
    };
    let refit = &summary.refit;
    let refit = format!(
        "Light-path primitives: {}, {} vertices; {} refitted in a frame on average, {} at most, where {} \
         moved on average.",
        refit.method,
        refit.vertices,
        number(refit.refitted_mean),
        refit.refitted_max,
        number(refit.moved_mean)
    );
    let mut blocks = vec![Block::Paragraph(left_out), Block::Paragraph(refit)];
    if summary.passes.is_empty() {
        blocks.insert(0, Block::Paragraph("Nothing was drawn.".to_owned()));
    } else {
        blocks.insert(0, Block::Table(table));
    }
    Section {
        title: "Passes".to_owned(),
        blocks,
    }
}

fn markers(summary: &Summary) -> Section {
    let millimetres = |place: [f64; 3]| place.map(|metres| number(1e3 * metres)).join(", ");
    let rows = summary.markers.iter().map(|marker| {
        let length = marker
            .displacement_m
            .iter()
            .map(|d| d * d)
            .sum::<f64>()
            .sqrt();
        vec![
            marker.name.clone(),
            millimetres(marker.rest_m),
            millimetres(marker.final_m),
            number(1e3 * length),
        ]
    });
    let head = ["marker", "at rest [mm]", "at the end [mm]", "moved by [mm]"];
    Section {
        title: "Markers".to_owned(),
        blocks: vec![Block::Table(Table {
            head: head.map(str::to_owned).to_vec(),
            rows: rows.collect(),
        })],
    }
}

fn setup(summary: &Summary, machine: &str, sets: &[String], notes: &[String]) -> Section {
    let mut facts = vec![
        ("Machine", machine.to_owned()),
        (
            "GPU adapter",
            summary.adapter.clone().unwrap_or_else(|| "none".to_owned()),
        ),
        ("Simulation threads", summary.threads.to_string()),
        (
            "Time step",
            format!("{} ms, fixed", number(1e3 * summary.timestep_s)),
        ),
        (
            "Surface and body",
            format!(
                "{} vertices, {} triangles, {} tetrahedra",
                summary.mesh.vertices, summary.mesh.triangles, summary.mesh.tets
            ),
        ),
        (
            "Start to first frame",
            format!("{} s", number(summary.first_frame_s)),
        ),
        (
            "Fastest particle at the end",
            format!("{} m/s", number(summary.speed_max_final_m_s)),
        ),
        ("SHA-256 of the final state", summary.state_sha256.clone()),
    ];
    let told = [("Set for this run", sets), ("Noted on loading", notes)];
    let told = told.into_iter().filter(|(_, lines)| !lines.is_empty());
    facts.extend(told.map(|(name, lines)| (name, lines.join("; "))));
    Section {
        title: "Set-up".to_owned(),
        blocks: vec![Block::Table(Table {
            head: Vec::new(),
            rows: facts
                .into_iter()
                .map(|(name, value)| vec![name.to_owned(), value])
                .collect(),
        })],
    }
}

#[cfg(test)]
mod tests {
    use super::super::files::tests::Folder;
    use super::super::summary::tests::example;
    use super::*;

    /// A run of 300 frames with two pokes and one stalled frame.
    fn records() -> Vec<FrameRecord> {
        let record = |frame: u32| {
            let poke = (-((f64::from(frame % 150) - 70.0) / 22.0).powi(2)).exp() as f32;
            let noise = ((frame.wrapping_mul(2_654_435_761) >> 16) % 1000) as f32 / 1000.0;
            let sim_ms = 3.4 + 2.2 * poke + 0.8 * noise;
            let stall = if frame == 211 { 140.0 } else { 0.0 };
            let passes_ms = vec![
                ("tangents", 0.35 + 0.05 * noise),
                ("refit", 0.2 + 0.9 * poke),
                ("shadow map", 1.6 + 0.2 * noise),
                ("subsurface", 7.5 + 1.1 * noise),
                ("tone map", 0.7),
            ];
            let gpu_ms: f32 = passes_ms.iter().map(|(_, ms)| ms).sum();
            FrameRecord {
                frame,
                time_s: f64::from(frame + 1) / 60.0,
                wall_ms: sim_ms + gpu_ms + 0.6 + 2.0 * noise * noise + stall,
                sim_ms,
                passes_ms,
                cpu_outside_ms: 0.6 + 0.2 * noise,
                vertices_refitted: (900.0 * poke) as u32,
                residual_rms: 2e-7 + 3e-6 * poke,
                volume_drift: -0.012 * poke,
                tool_force_n: 4.1 * poke,
                tool_depth_m: None,
                penetration_m: 8e-5 * poke,
                speed_max_m_s: 0.01 * poke,
            }
        };
        (0..300).map(record).collect()
    }

    /// A smooth picture to stand for a rendered frame.
    fn picture(frame: u32) -> (Vec<u8>, String) {
        let mut png = std::io::Cursor::new(Vec::new());
        image::RgbImage::from_fn(400, 300, |x, y| {
            let (x, y) = ((x as f32 - 200.0) / 120.0, (y as f32 - 150.0) / 110.0);
            let height = (1.0 - x * x - y * y).max(0.0).sqrt();
            image::Rgb(
                [
                    40.0 + 170.0 * height,
                    25.0 + 70.0 * height,
                    25.0 + 60.0 * height,
                ]
                .map(|c| c as u8),
            )
        })
        .write_to(&mut png, image::ImageFormat::Png)
        .unwrap();
        (
            png.into_inner(),
            format!("Frame {frame}, {:.2} s", f64::from(frame) / 60.0),
        )
    }

    #[test]
    fn report_holds_times_stages_accuracy_pictures_passes_and_machine() {
        let records = records();
        let summary = example(&records);
        let machine = machine();
        let page = replay_page(Replay {
            summary: &summary,
            records: &records,
            machine: &machine,
            sets: &["body.file='spleen.glb'".to_owned()],
            notes: &["texture coordinates are made anew".to_owned()],
            pictures: [0, 70, 299].map(picture).to_vec(),
        });
        let html = page.html();
        for heading in [
            "Frame time",
            "Where the time goes",
            "How far off it was",
            "Pictures",
            "Passes",
        ] {
            assert!(html.contains(&format!("<h2>{heading}</h2>")), "{heading}");
        }
        assert!(html.contains("light map, diffusion blur"));
        assert!(html.contains(&summary.state_sha256));
        assert!(html.contains("llvmpipe"));
        assert_eq!(html.matches("spleen.glb").count(), 2);
        assert!(html.contains("made anew"));
        assert_eq!(html.matches("data:image/png;base64,").count(), 3);
        // The stalled frame is marked, not lost.
        assert!(html.contains("l3.5 6h-7z"));
        let folder = Folder::new();
        page.write(&folder.0.join("report.html")).unwrap();
        assert_eq!(folder.names(), ["report.html"]);
        // To look at it in a browser: PALPATE_KEEP_REPORT=report.html cargo test report_holds
        if let Some(keep) = std::env::var_os("PALPATE_KEEP_REPORT") {
            page.write(std::path::Path::new(&keep)).unwrap();
        }
    }

    #[test]
    fn run_that_failed_says_so_and_has_no_bad_number() {
        let summary = Summary {
            finite: false,
            ..example(&[])
        };
        let html = replay_page(Replay {
            summary: &summary,
            records: &[],
            machine: "a machine",
            sets: &[],
            notes: &[],
            pictures: Vec::new(),
        })
        .html();
        assert!(html.contains("No frame was finished"));
        assert!(html.contains("do not trust this run"));
        assert!(!html.contains("NaN"));
    }
}
