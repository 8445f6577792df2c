//! Times of frames: by the wall, and by the processor.
//!
//! The wall clock counts what other programs take from a busy machine; the processor's does not, but
//! adds up all threads. On one thread of a quiet machine they agree.

use crate::measure::stats::Stats;
use cpu_time::ProcessTime;
use std::time::Instant;

/// A frame under way.
#[derive(Clone, Copy, Debug)]
pub struct Clock {
    wall: Instant,
    cpu: ProcessTime,
}

impl Clock {
    /// Starts both clocks.
    pub fn start() -> Self {
        Self {
            wall: Instant::now(),
            cpu: ProcessTime::now(),
        }
    }
}

/// Times of many frames [ms].
#[derive(Clone, Debug, Default)]
pub struct Times {
    wall_ms: Vec<f32>,
    cpu_ms: Vec<f32>,
}

impl Times {
    /// Adds a frame that ends now.
    pub fn add(&mut self, clock: Clock) {
        self.wall_ms.push(1e3 * clock.wall.elapsed().as_secs_f32());
        self.cpu_ms.push(1e3 * clock.cpu.elapsed().as_secs_f32());
    }

    /// Median and 95th percentile by the wall [ms]; `None` without frames.
    pub fn wall(&self) -> Option<(f64, f64)> {
        median_and_p95(&self.wall_ms)
    }

    /// Median and 95th percentile of the processor, all threads together [ms]; `None` without frames.
    pub fn cpu(&self) -> Option<(f64, f64)> {
        median_and_p95(&self.cpu_ms)
    }
}

fn median_and_p95(ms: &[f32]) -> Option<(f64, f64)> {
    let stats = Stats::of(ms.iter().copied())?;
    // Ten nanoseconds; what lies below is noise that only makes files longer.
    let rounded = |ms: f64| (1e5 * ms).round() / 1e5;
    Some((rounded(stats.p50), rounded(stats.p95)))
}
