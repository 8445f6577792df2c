//! GPU time of every pass of a frame, by timestamp queries.

use super::{Gpu, GpuError, ReadBack};

/// Time of one pass in one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PassTime {
    /// Name of the pass.
    pub name: &'static str,
    /// Milliseconds between its first and its last command, by the GPU's clock.
    pub gpu_ms: f32,
    /// Start after the first timestamp of the frame [ms].
    pub start_ms: f32,
}

/// Two timestamps a pass. Without timestamp queries it records and reports nothing.
pub struct Timer {
    queries: Option<Queries>,
    names: Vec<&'static str>,
}

struct Queries {
    set: wgpu::QuerySet,
    resolved: wgpu::Buffer,
    back: ReadBack,
    capacity: u32,
    period_ns: f32,
}

impl Timer {
    /// Room for `capacity` passes a frame; what comes after that is not timed.
    pub fn new(gpu: &Gpu, capacity: u32) -> Self {
        let queries = gpu.has_timestamps.then(|| Queries {
            set: gpu.device.create_query_set(&wgpu::QuerySetDescriptor {
                label: Some("pass times"),
                ty: wgpu::QueryType::Timestamp,
                count: 2 * capacity,
            }),
            resolved: gpu.device.create_buffer(&wgpu::BufferDescriptor {
                label: Some("pass times"),
                size: u64::from(2 * capacity) * 8,
                usage: wgpu::BufferUsages::QUERY_RESOLVE | wgpu::BufferUsages::COPY_SRC,
                mapped_at_creation: false,
            }),
            back: ReadBack::new(gpu, u64::from(2 * capacity) * 8),
            capacity,
            period_ns: gpu.timestamp_period_ns,
        });
        Self {
            queries,
            names: Vec::new(),
        }
    }

    /// One that times nothing, for what is drawn once.
    pub fn off() -> Self {
        Self {
            queries: None,
            names: Vec::new(),
        }
    }

    /// Forgets the passes of the frame before.
    pub fn begin_frame(&mut self) {
        self.names.clear();
    }

    /// Timestamps around a compute pass called `name`.
    pub fn compute(&mut self, name: &'static str) -> Option<wgpu::ComputePassTimestampWrites<'_>> {
        let first = self.next(name)?;
        let queries = self.queries.as_ref()?;
        Some(wgpu::ComputePassTimestampWrites {
            query_set: &queries.set,
            beginning_of_pass_write_index: Some(first),
            end_of_pass_write_index: Some(first + 1),
        })
    }

    /// Timestamps around a render pass called `name`.
    pub fn render(&mut self, name: &'static str) -> Option<wgpu::RenderPassTimestampWrites<'_>> {
        let first = self.next(name)?;
        let queries = self.queries.as_ref()?;
        Some(wgpu::RenderPassTimestampWrites {
            query_set: &queries.set,
            beginning_of_pass_write_index: Some(first),
            end_of_pass_write_index: Some(first + 1),
        })
    }

    fn next(&mut self, name: &'static str) -> Option<u32> {
        let queries = self.queries.as_ref()?;
        let pass = self.names.len() as u32;
        if pass >= queries.capacity {
            return None;
        }
        self.names.push(name);
        Some(2 * pass)
    }

    /// Adds the copy of this frame's timestamps to `encoder`: last, before it is submitted.
    pub fn resolve(&self, encoder: &mut wgpu::CommandEncoder) {
        if let Some(queries) = &self.queries
            && !self.names.is_empty()
        {
            let count = 2 * self.names.len() as u32;
            encoder.resolve_query_set(&queries.set, 0..count, &queries.resolved, 0);
            queries.back.copy(&queries.resolved, encoder);
        }
    }

    /// Times of the passes of the submitted frame, in the order they were recorded, waited for.
    ///
    /// # Errors
    ///
    /// [`GpuError::ReadBack`] if the timestamps can't be read.
    pub fn read(&self, gpu: &Gpu) -> Result<Vec<PassTime>, GpuError> {
        let Some(queries) = &self.queries else {
            return Ok(Vec::new());
        };
        if self.names.is_empty() {
            return Ok(Vec::new());
        }
        let ticks: Vec<u64> = queries.back.read(gpu)?;
        let ms = |from: u64, to: u64| {
            // A software driver may stamp out of order by a tick; that is no negative time.
            to.saturating_sub(from) as f32 * queries.period_ns * 1e-6
        };
        Ok(self
            .names
            .iter()
            .zip(ticks.chunks_exact(2))
            .map(|(&name, pair)| PassTime {
                name,
                gpu_ms: ms(pair[0], pair[1]),
                start_ms: ms(ticks[0], pair[0]),
            })
            .collect())
    }
}
