//! What the window remembers of the last frames, for its plots and read-outs.

use super::session::Tick;
use crate::gpu::PassTime;
use std::collections::VecDeque;

/// Frames that are remembered.
const LENGTH: usize = 150;

/// One frame of the window.
#[derive(Clone, Debug, Default)]
pub struct Sample {
    /// Wall time since the frame before [ms].
    pub wall_ms: f32,
    /// Wall time of its time steps [ms].
    pub sim_ms: f32,
    /// GPU time of its passes.
    pub passes: Vec<PassTime>,
    /// Size of the force on the tool in hand [N], in the last time step.
    pub force_n: f32,
    /// (volume − rest volume) / rest volume.
    pub volume_drift: f32,
    /// Deepest penetration of a tool [m].
    pub penetration_m: f32,
}

impl Sample {
    /// Adds one time step.
    pub fn add_tick(&mut self, tick: &Tick) {
        self.sim_ms += tick.sim_ms;
        self.force_n = tick.force_max_n();
        self.volume_drift = tick.report.volume_drift;
        self.penetration_m = tick.report.penetration_max_m;
    }
}

/// The last frames, oldest first.
#[derive(Clone, Debug, Default)]
pub struct History {
    samples: VecDeque<Sample>,
}

impl History {
    /// Adds the newest frame.
    pub fn push(&mut self, sample: Sample) {
        if self.samples.len() == LENGTH {
            self.samples.pop_front();
        }
        self.samples.push_back(sample);
    }

    /// The newest frame.
    pub fn last(&self) -> Option<&Sample> {
        self.samples.back()
    }

    /// All frames, oldest first.
    pub fn iter(&self) -> impl Iterator<Item = &Sample> {
        self.samples.iter()
    }

    /// Median wall time of a frame [ms]; 0 without frames.
    pub fn median_wall_ms(&self) -> f32 {
        let mut times: Vec<f32> = self.samples.iter().map(|sample| sample.wall_ms).collect();
        times.sort_by(f32::total_cmp);
        times.get(times.len() / 2).copied().unwrap_or(0.0)
    }

    /// Stages of a frame, in order: the simulation, then every pass that any frame had.
    pub fn stages(&self) -> Vec<&'static str> {
        let mut names = vec!["simulation"];
        for pass in self.samples.iter().flat_map(|sample| &sample.passes) {
            if !names.contains(&pass.name) {
                names.push(pass.name);
            }
        }
        names
    }
}

impl Sample {
    /// Milliseconds of one stage of [`History::stages`].
    pub fn stage_ms(&self, stage: &str) -> f32 {
        if stage == "simulation" {
            return self.sim_ms;
        }
        self.passes
            .iter()
            .filter(|pass| pass.name == stage)
            .map(|pass| pass.gpu_ms)
            .sum()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_history_forgets_its_oldest_frame() {
        let mut history = History::default();
        for frame in 0..LENGTH + 10 {
            history.push(Sample {
                wall_ms: frame as f32,
                ..Sample::default()
            });
        }
        assert_eq!(history.iter().count(), LENGTH);
        assert_eq!(history.iter().next().map(|s| s.wall_ms), Some(10.0));
    }

    #[test]
    fn a_stage_that_runs_twice_a_frame_counts_twice() {
        let pass = |name, gpu_ms| PassTime {
            name,
            gpu_ms,
            start_ms: 0.0,
        };
        let sample = Sample {
            sim_ms: 4.0,
            passes: vec![pass("blur", 1.0), pass("gooey", 5.0), pass("blur", 2.0)],
            ..Sample::default()
        };
        assert_eq!(sample.stage_ms("blur"), 3.0);
        assert_eq!(sample.stage_ms("simulation"), 4.0);
        let mut history = History::default();
        history.push(sample);
        assert_eq!(history.stages(), ["simulation", "blur", "gooey"]);
    }
}
