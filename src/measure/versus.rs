//! Two runs side by side: the median of every stage, the ratio, and whether it is more than noise.

use super::chart::three_digits;
use super::files::{FileError, read};
use super::stats::percentile;
use serde::Deserialize;
use std::fmt::Write;
use std::path::Path;

/// Half the width of the range that holds the median of independent frames 19 times in 20, in standard
/// deviations of a rank. Frames are alike from one to the next, so it is a lower bound.
const MEDIAN_RANGE: f64 = 1.96;
/// Ratios nearer to one than this say nothing, however many frames there are: clocks and other programs.
const SAME_WITHIN: f64 = 0.03;

/// What a run says of itself, of the keys of `summary.json`.
#[derive(Clone, Debug, Deserialize, PartialEq)]
pub struct Setting {
    scene: String,
    commit: String,
    adapter: Option<String>,
    threads: usize,
    frames: u32,
    size: [u32; 2],
    state_sha256: String,
}

/// One column of times of a `frames.csv`.
#[derive(Clone, Debug, PartialEq)]
struct Column {
    name: String,
    /// Ascending; frames without an entry are left out [ms].
    sorted: Vec<f64>,
}

/// A run that was read from its folder.
#[derive(Clone, Debug, PartialEq)]
pub struct TimedRun {
    setting: Setting,
    stages: Vec<Column>,
}

/// How a stage of B stands to that of A.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Change {
    /// Medians differ by less than noise does.
    Same,
    /// B's median is smaller.
    Faster,
    /// B's median is larger.
    Slower,
    /// Only one of the runs has it.
    OneHasIt,
}

impl Change {
    fn word(self) -> &'static str {
        match self {
            Self::Same => "same",
            Self::Faster => "faster",
            Self::Slower => "slower",
            Self::OneHasIt => "in one only",
        }
    }
}

/// One stage of both runs.
#[derive(Clone, Debug, PartialEq)]
pub struct Stage {
    /// `frame`, `simulation`, `CPU outside`, or a pass.
    pub name: String,
    /// Medians of A and B [ms].
    pub p50_ms: [Option<f64>; 2],
    /// 95th percentiles of A and B [ms].
    pub p95_ms: [Option<f64>; 2],
    /// Of the medians.
    pub change: Change,
}

impl Stage {
    /// Median of B over that of A; `None` if one lacks it, or A's is zero.
    pub fn ratio(&self) -> Option<f64> {
        match self.p50_ms {
            [Some(a), Some(b)] if a > 0.0 => Some(b / a),
            _ => None,
        }
    }

    /// Median of B less that of A; a stage that a run lacks took no time [ms].
    pub fn difference_ms(&self) -> f64 {
        self.p50_ms[1].unwrap_or(0.0) - self.p50_ms[0].unwrap_or(0.0)
    }
}

impl TimedRun {
    /// Reads `summary.json` and `frames.csv` of the run in `folder`.
    ///
    /// # Errors
    ///
    /// [`FileError`] naming the file and what it lacks.
    pub fn read(folder: &Path) -> Result<Self, FileError> {
        let file = folder.join("summary.json");
        let setting = serde_json::from_slice(&read(&file)?).map_err(|e| FileError::Content {
            problem: format!("{e}; give a folder that `palpate replay` wrote"),
            file,
        })?;
        let file = folder.join("frames.csv");
        let stages = columns(&read(&file)?).map_err(|problem| FileError::Content {
            problem: format!("{problem}; give a folder that `palpate replay` wrote"),
            file,
        })?;
        Ok(Self { setting, stages })
    }
}

/// What a column of the log is called here; `None` if it holds no time.
fn stage_name(column: &str) -> Option<&str> {
    match column {
        "wall_ms" => Some("frame"),
        "sim_ms" => Some("simulation"),
        "cpu_outside_ms" => Some("CPU outside"),
        other => other.strip_suffix("_gpu_ms"),
    }
}

/// The times of a frame log.
fn columns(log: &[u8]) -> Result<Vec<Column>, String> {
    let mut table = csv::Reader::from_reader(log);
    let header = table.headers().map_err(|e| e.to_string())?.clone();
    let mut stages: Vec<(usize, Column)> = (header.iter().enumerate())
        .filter_map(|(place, column)| {
            let name = stage_name(column)?.to_owned();
            let sorted = Vec::new();
            Some((place, Column { name, sorted }))
        })
        .collect();
    if stages
        .first()
        .is_none_or(|(_, first)| first.name != "frame")
    {
        return Err("it has no column wall_ms".to_owned());
    }
    for row in table.records() {
        let row = row.map_err(|e| e.to_string())?;
        for (place, column) in &mut stages {
            let text = row.get(*place).unwrap_or_default();
            if text.is_empty() {
                continue;
            }
            match text.parse::<f64>() {
                Ok(ms) if ms.is_finite() => column.sorted.push(ms),
                _ => {
                    let line = row.position().map_or(0, csv::Position::line);
                    return Err(format!("line {line}: {text} is no time"));
                }
            }
        }
    }
    for (_, column) in &mut stages {
        column.sorted.sort_by(f64::total_cmp);
    }
    Ok(stages.into_iter().map(|(_, column)| column).collect())
}

/// The range that holds the median 19 times in 20, from its rank's spread (order statistics).
fn median_range(sorted: &[f64]) -> Option<[f64; 2]> {
    let count = sorted.len() as f64;
    let half = 0.5 * MEDIAN_RANGE / count.sqrt();
    Some([
        percentile(sorted, 0.5 - half)?,
        percentile(sorted, 0.5 + half)?,
    ])
}

fn change(a: &[f64], b: &[f64]) -> Change {
    let medians = percentile(a, 0.5).zip(percentile(b, 0.5));
    let (Some((of_a, of_b)), Some(a), Some(b)) = (medians, median_range(a), median_range(b)) else {
        return Change::OneHasIt;
    };
    if (of_b - of_a).abs() <= SAME_WITHIN * of_a {
        Change::Same
    } else if b[1] < a[0] {
        Change::Faster
    } else if b[0] > a[1] {
        Change::Slower
    } else {
        Change::Same
    }
}

/// Every stage of either run: A's in its order, then what B alone has.
pub fn stages(a: &TimedRun, b: &TimedRun) -> Vec<Stage> {
    let find = |run: &TimedRun, name: &str| -> Vec<f64> {
        let found = run.stages.iter().find(|column| column.name == name);
        found.map_or_else(Vec::new, |column| column.sorted.clone())
    };
    let names = a.stages.iter().map(|column| &column.name);
    let more = (b.stages.iter().map(|column| &column.name))
        .filter(|name| !a.stages.iter().any(|column| &column.name == *name));
    (names.chain(more))
        .map(|name| {
            let times = [find(a, name), find(b, name)];
            let share = |share| times.each_ref().map(|sorted| percentile(sorted, share));
            Stage {
                name: name.clone(),
                p50_ms: share(0.5),
                p95_ms: share(0.95),
                change: change(&times[0], &times[1]),
            }
        })
        .collect()
}

/// The comparison as text: what was set otherwise, a line a stage, and which stages made the difference.
pub fn told(names: [&str; 2], runs: [&TimedRun; 2]) -> String {
    let mut text = String::new();
    let mut line = |written: String| writeln!(text, "{written}").expect("a string takes all");
    for (letter, (name, run)) in ["A", "B"].iter().zip(names.iter().zip(runs)) {
        let Setting {
            scene,
            commit,
            adapter,
            threads,
            frames,
            size: [width, height],
            ..
        } = &run.setting;
        let adapter = adapter.as_deref().unwrap_or("nothing drawn");
        line(format!(
            "{letter}  {name}: {scene}, {frames} frames, {width}x{height}, {threads} threads, commit {commit}, {adapter}"
        ));
    }
    let unlike = unlike(&runs[0].setting, &runs[1].setting);
    if !unlike.is_empty() {
        line(format!(
            "Not the same in both: {}; what differs below may come from that.",
            unlike.join(", ")
        ));
    }
    let stages = stages(runs[0], runs[1]);
    line(format!(
        "\n{:<16}{:>10}{:>10}{:>8}{:>10}{:>10}",
        "median ms", "A", "B", "B/A", "A p95", "B p95"
    ));
    let shown = |ms: Option<f64>| ms.map_or("-".to_owned(), |ms| format!("{ms:.3}"));
    for stage in &stages {
        line(format!(
            "{:<16}{:>10}{:>10}{:>8}{:>10}{:>10}  {}",
            stage.name,
            shown(stage.p50_ms[0]),
            shown(stage.p50_ms[1]),
            (stage.ratio()).map_or("-".to_owned(), |ratio| format!("{ratio:.2}")),
            shown(stage.p95_ms[0]),
            shown(stage.p95_ms[1]),
            stage.change.word(),
        ));
    }
    line(String::new());
    line(verdict(&stages));
    if runs[0].setting.state_sha256 == runs[1].setting.state_sha256 {
        line("Both end in the same state, bit for bit.".to_owned());
    } else if runs[0].setting.frames == runs[1].setting.frames {
        line(
            "They end in different states; `palpate replay … --against` says by how much."
                .to_owned(),
        );
    }
    text
}

/// What was not the same for both runs, commits apart.
fn unlike(a: &Setting, b: &Setting) -> Vec<&'static str> {
    [
        ("scene", a.scene != b.scene),
        ("number of frames", a.frames != b.frames),
        ("size of the picture", a.size != b.size),
        ("threads", a.threads != b.threads),
        ("adapter", a.adapter != b.adapter),
    ]
    .into_iter()
    .filter_map(|(what, differs)| differs.then_some(what))
    .collect()
}

/// What became of the frame, and which stages it owes that to.
fn verdict(stages: &[Stage]) -> String {
    let (frame, parts) = stages.split_first().expect("a log has its frame");
    let mut parts: Vec<&Stage> = (parts.iter())
        .filter(|stage| stage.change != Change::Same)
        .collect();
    parts.sort_by(|a, b| (b.difference_ms().abs()).total_cmp(&a.difference_ms().abs()));
    let causes: Vec<String> = (parts.iter().take(4))
        .map(|stage| format!("{} {:+.3} ms", stage.name, stage.difference_ms()))
        .collect();
    let causes = match causes.as_slice() {
        [] => "no stage differs by more than noise".to_owned(),
        some => some.join(", "),
    };
    match (frame.change, frame.ratio()) {
        (Change::Same, _) => format!("A frame takes the same time in both; {causes}."),
        (_, Some(ratio)) => format!(
            "A frame of B takes {} times as long as one of A ({:+.3} ms): {causes}.",
            three_digits(ratio),
            frame.difference_ms()
        ),
        (_, None) => format!("One of the runs has no frame; {causes}."),
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn run(log: &str) -> TimedRun {
        TimedRun {
            setting: Setting {
                scene: "slab".to_owned(),
                commit: "0123abc".to_owned(),
                adapter: None,
                threads: 2,
                frames: 3,
                size: [8, 8],
                state_sha256: "9f".to_owned(),
            },
            stages: columns(log.as_bytes()).expect("a sound log"),
        }
    }

    /// A log of 100 frames whose surface takes `surface` and whose simulation 4 ms, both ± 5 %.
    fn log(surface: f64) -> String {
        let mut log = "frame,time_s,wall_ms,sim_ms,surface_gpu_ms,tool_force_n\n".to_owned();
        for frame in 0..100 {
            let wobble = 1.0 + 0.05 * (f64::from(frame) * 2.399).sin();
            let (sim, surface) = (4.0 * wobble, surface * wobble);
            log += &format!("{frame},0.1,{},{sim},{surface},1.5\n", sim + surface);
        }
        log
    }

    #[test]
    fn runs_of_different_length_and_size_are_told_to_be_so_and_their_ends_are_not_compared() {
        let (a, mut b) = (run(&log(10.0)), run(&log(10.0)));
        assert!(!told(["a", "b"], [&a, &b]).contains("Not the same"));
        (b.setting.frames, b.setting.size) = (7, [9, 9]);
        b.setting.state_sha256 = "a0".to_owned();
        let text = told(["a", "b"], [&a, &b]);
        assert!(
            text.contains("Not the same in both: number of frames, size of the picture;"),
            "{text}"
        );
        assert!(!text.contains("different states"), "{text}");
    }

    #[test]
    fn a_slower_stage_is_named_with_its_milliseconds_and_the_others_are_not() {
        let (a, b) = (run(&log(10.0)), run(&log(15.0)));
        let stages = stages(&a, &b);
        let changes: Vec<_> = stages.iter().map(|s| (s.name.as_str(), s.change)).collect();
        assert_eq!(
            changes,
            [
                ("frame", Change::Slower),
                ("simulation", Change::Same),
                ("surface", Change::Slower)
            ]
        );
        let text = told(["a", "b"], [&a, &b]);
        assert!(text.contains("surface +5.0"), "{text}");
        assert!(!text.contains("simulation +"), "{text}");
        assert!(text.contains("1.36 times as long"), "{text}");
    }

    #[test]
    fn a_run_is_the_same_as_itself_and_noise_is_no_change() {
        let a = run(&log(10.0));
        assert!(stages(&a, &a).iter().all(|s| s.change == Change::Same));
        // Two medians of a wide spread that differ by 4 %: within the range of the medians.
        let spread = |shift: f64| {
            let rows = (0..30).map(|k| format!("{k},{}\n", 10.0 + f64::from(k % 10) + shift));
            run(&format!("frame,wall_ms\n{}", rows.collect::<String>()))
        };
        assert_eq!(stages(&spread(0.0), &spread(0.6))[0].change, Change::Same);
        assert_eq!(stages(&spread(0.0), &spread(6.0))[0].change, Change::Slower);
    }

    #[test]
    fn a_pass_that_one_run_lacks_is_told_as_such() {
        let b = run("frame,wall_ms,sim_ms\n0,4,4\n1,5,5\n");
        let stages = stages(&run(&log(10.0)), &b);
        let surface = stages.iter().find(|s| s.name == "surface").unwrap();
        assert_eq!(surface.change, Change::OneHasIt);
        assert_eq!(surface.ratio(), None);
        assert!(surface.difference_ms() < -9.0);
    }

    #[test]
    fn what_is_no_frame_log_is_refused_with_the_line() {
        assert!(columns(b"a,b\n1,2\n").unwrap_err().contains("wall_ms"));
        assert!(columns(b"").is_err());
        let broken = columns(b"frame,wall_ms\n0,1\n1,NaN\n").unwrap_err();
        assert!(broken.contains("line 3"), "{broken}");
        assert!(columns(b"frame,wall_ms\n0,1,2\n").is_err());
    }
}
