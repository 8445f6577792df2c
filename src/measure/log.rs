//! The frame log: one row a frame, speed and accuracy side by side.

use super::files::{FileError, write_with};
use std::path::Path;

/// What one frame cost and how far off it was.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct FrameRecord {
    /// Number of the frame, from 0.
    pub frame: u32,
    /// Simulated time at its end [s].
    pub time_s: f64,
    /// Wall time of the whole frame [ms].
    pub wall_ms: f32,
    /// Wall time of the simulation [ms].
    pub sim_ms: f32,
    /// GPU time by pass [ms], in the order recorded. Only passes that this scene has.
    pub passes_ms: Vec<(&'static str, f32)>,
    /// CPU time outside simulation and waiting for the GPU [ms].
    pub cpu_outside_ms: f32,
    /// Vertices whose light-path primitive was brought up to date.
    pub vertices_refitted: u32,
    /// RMS of the constraint residual, in the unit of the constraint.
    pub residual_rms: f32,
    /// (volume - rest volume) / rest volume.
    pub volume_drift: f32,
    /// Force on the tools together [N].
    pub tool_force_n: f32,
    /// How deep the front of the first scripted tool is below the surface at rest [m], negative
    /// above it; `None` if no tool has a way to the surface.
    pub tool_depth_m: Option<f32>,
    /// Deepest penetration of tissue into a tool [m].
    pub penetration_m: f32,
    /// Speed of the fastest particle [m/s].
    pub speed_max_m_s: f32,
}

/// The passes with a record in any frame, in the order of their first.
pub fn pass_names(records: &[FrameRecord]) -> Vec<&'static str> {
    let mut names = Vec::new();
    for (name, _) in records.iter().flat_map(|record| &record.passes_ms) {
        if !names.contains(name) {
            names.push(*name);
        }
    }
    names
}

/// Writes `records` as CSV: units in the header, a column a pass, empty where a frame did not run it.
///
/// # Errors
///
/// [`FileError::Write`].
pub fn write_frames_csv(file: &Path, records: &[FrameRecord]) -> Result<(), FileError> {
    let passes = pass_names(records);
    let has_depth = records.iter().any(|record| record.tool_depth_m.is_some());
    write_with(file, |out| {
        let mut table = csv::Writer::from_writer(out);
        let before = ["frame", "time_s", "wall_ms", "sim_ms"];
        let after = [
            "cpu_outside_ms",
            "vertices_refitted",
            "residual_rms",
            "volume_drift",
            "tool_force_n",
            "penetration_m",
            "speed_max_m_s",
        ];
        let mut header: Vec<String> = before.map(str::to_owned).to_vec();
        header.extend(passes.iter().map(|pass| format!("{pass}_gpu_ms")));
        header.extend(after.map(str::to_owned));
        if has_depth {
            header.push("tool_depth_m".to_owned());
        }
        table.write_record(&header)?;
        for record in records {
            let mut row = row(record, &passes);
            if has_depth {
                row.push(record.tool_depth_m.map_or(String::new(), |d| d.to_string()));
            }
            table.write_record(row)?;
        }
        table.flush()
    })
}

fn row(record: &FrameRecord, passes: &[&str]) -> Vec<String> {
    let mut row = vec![
        record.frame.to_string(),
        // Steps are fixed, so more digits would only show the rounding of their sum.
        format!("{:.6}", record.time_s),
        record.wall_ms.to_string(),
        record.sim_ms.to_string(),
    ];
    row.extend(passes.iter().map(|pass| {
        let mut runs = record.passes_ms.iter().filter(|(name, _)| name == pass);
        runs.next().map_or(String::new(), |(_, ms)| ms.to_string())
    }));
    row.extend([
        record.cpu_outside_ms.to_string(),
        record.vertices_refitted.to_string(),
        record.residual_rms.to_string(),
        record.volume_drift.to_string(),
        record.tool_force_n.to_string(),
        record.penetration_m.to_string(),
        record.speed_max_m_s.to_string(),
    ]);
    row
}

#[cfg(test)]
mod tests {
    use super::super::files::{read, tests::Folder};
    use super::*;

    fn csv(records: &[FrameRecord]) -> String {
        let folder = Folder::new();
        let file = folder.0.join("frames.csv");
        write_frames_csv(&file, records).unwrap();
        String::from_utf8(read(&file).unwrap()).unwrap()
    }

    #[test]
    fn columns_are_the_passes_the_scene_has_and_gaps_stay_empty() {
        let first = FrameRecord {
            passes_ms: vec![("tangents", 0.5)],
            ..FrameRecord::default()
        };
        let second = FrameRecord {
            frame: 1,
            time_s: 1.0 / 60.0,
            passes_ms: vec![("tangents", 0.25), ("surface", 2.0)],
            tool_force_n: 1.5,
            ..FrameRecord::default()
        };
        assert_eq!(
            csv(&[first, second]),
            "frame,time_s,wall_ms,sim_ms,tangents_gpu_ms,surface_gpu_ms,cpu_outside_ms,\
             vertices_refitted,residual_rms,volume_drift,tool_force_n,penetration_m,speed_max_m_s\n\
             0,0.000000,0,0,0.5,,0,0,0,0,0,0,0\n\
             1,0.016667,0,0,0.25,2,0,0,0,0,1.5,0,0\n"
        );
    }

    #[test]
    fn depth_is_the_last_column_of_a_log_that_has_one() {
        let record = FrameRecord {
            tool_depth_m: Some(0.25),
            ..FrameRecord::default()
        };
        let log = csv(&[FrameRecord::default(), record]);
        let ends: Vec<&str> = (log.lines())
            .map(|line| line.rsplit(',').next().expect("a line has a word"))
            .collect();
        assert_eq!(ends, ["tool_depth_m", "", "0.25"]);
        assert!(!csv(&[FrameRecord::default()]).contains("depth"));
    }

    #[test]
    fn scene_without_passes_has_no_pass_column() {
        assert!(!csv(&[FrameRecord::default()]).contains("gpu_ms"));
    }
}
