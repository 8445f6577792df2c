//! The GPU: adapter, device, buffers, shader joining, timestamps.
//!
//! Knows no physics and no scene. Passes are built from [`Kernel`]s and pipelines made here.

mod binding;
mod buffer;
mod error;
mod shader;
mod table;
mod timer;

pub use binding::{Binding, Kernel, bind, workgroups};
pub use buffer::{
    ReadBack, read_buffer, read_texture_depth, read_texture_rgba8, read_texture_rgba16f,
    read_texture_words, storage, uniform,
};
pub use error::GpuError;
pub use shader::{Wgsl, compile, join};
pub use table::{Entry, Table};
pub use timer::{PassTime, Timer};

/// Joins WGSL files of the `shaders` folder: `wgsl!["common.wgsl", "tangents.wgsl"]`.
#[macro_export]
macro_rules! wgsl {
    ($($file:literal),+ $(,)?) => {
        &[$($crate::gpu::Wgsl {
            file: concat!("shaders/", $file),
            source: include_str!(concat!(env!("CARGO_MANIFEST_DIR"), "/shaders/", $file)),
        }),+]
    };
}

/// A device and its queue.
#[derive(Clone, Debug)]
pub struct Gpu {
    /// What every resource is made from.
    pub device: wgpu::Device,
    /// Where work is submitted.
    pub queue: wgpu::Queue,
    /// The adapter itself, which a window asks what it can present.
    pub raw_adapter: wgpu::Adapter,
    /// Name, backend and driver of the adapter, for logs and charts.
    pub adapter: String,
    /// Whether passes can be timed by the GPU itself.
    pub has_timestamps: bool,
    /// Nanoseconds a timestamp tick.
    pub timestamp_period_ns: f32,
}

impl Gpu {
    /// Opens the best adapter there is, without a window. A software adapter will do.
    ///
    /// # Errors
    ///
    /// [`GpuError::NoAdapter`] or [`GpuError::NoDevice`].
    pub fn headless() -> Result<Self, GpuError> {
        Self::open(&Self::instance(None), None)
    }

    /// The entry to the drivers. A window passes its `display`, which some systems need to present.
    pub fn instance(display: Option<Box<dyn wgpu::wgt::WgpuHasDisplayHandle>>) -> wgpu::Instance {
        // OpenGL lacks what the kernels need, unless somebody insists on it by WGPU_BACKEND.
        let mut descriptor = wgpu::InstanceDescriptor {
            backends: wgpu::Backends::PRIMARY,
            ..wgpu::InstanceDescriptor::new_without_display_handle()
        }
        .with_env();
        descriptor.display = display;
        // Indirect dispatches are sized by our own kernels, within what `workgroups` allowed when the
        // pass was made; checking them again is one more dispatch each.
        descriptor
            .flags
            .remove(wgpu::InstanceFlags::VALIDATION_INDIRECT_CALL);
        wgpu::Instance::new(descriptor)
    }

    /// Opens an adapter that can present to `surface`, if there is one.
    ///
    /// # Errors
    ///
    /// [`GpuError::NoAdapter`] or [`GpuError::NoDevice`].
    pub fn open(
        instance: &wgpu::Instance,
        surface: Option<&wgpu::Surface<'_>>,
    ) -> Result<Self, GpuError> {
        let adapter = pollster::block_on(instance.request_adapter(&wgpu::RequestAdapterOptions {
            power_preference: wgpu::PowerPreference::HighPerformance,
            compatible_surface: surface,
            ..Default::default()
        }))
        .map_err(GpuError::NoAdapter)?;
        Self::with_adapter(adapter)
    }

    fn with_adapter(adapter: wgpu::Adapter) -> Result<Self, GpuError> {
        let info = adapter.get_info();
        if !adapter.get_downlevel_capabilities().is_webgpu_compliant() {
            return Err(GpuError::WeakAdapter(info.name));
        }
        let has_timestamps = adapter.features().contains(wgpu::Features::TIMESTAMP_QUERY);
        let offered = adapter.limits();
        // WebGPU's default limits, so that what runs here runs anywhere, but buffers as large as
        // the adapter has them: patches of a fine mesh are long lists.
        let required_limits = wgpu::Limits {
            max_buffer_size: offered.max_buffer_size,
            max_storage_buffer_binding_size: offered.max_storage_buffer_binding_size,
            max_texture_dimension_2d: offered.max_texture_dimension_2d.min(16384),
            ..wgpu::Limits::default()
        }
        .or_worse_values_from(&offered);
        let (device, queue) = pollster::block_on(adapter.request_device(&wgpu::DeviceDescriptor {
            label: Some("palpate"),
            required_features: if has_timestamps {
                wgpu::Features::TIMESTAMP_QUERY
            } else {
                wgpu::Features::empty()
            },
            required_limits,
            ..Default::default()
        }))
        .map_err(GpuError::NoDevice)?;
        Ok(Self {
            timestamp_period_ns: queue.get_timestamp_period(),
            device,
            queue,
            raw_adapter: adapter,
            adapter: format!("{} ({:?}, {})", info.name, info.backend, info.driver_info),
            has_timestamps,
        })
    }

    /// Submits `encoder` and waits until the GPU has finished it.
    pub fn submit_and_wait(&self, encoder: wgpu::CommandEncoder) {
        self.queue.submit([encoder.finish()]);
        self.wait();
    }

    /// Waits until everything submitted has finished.
    pub fn wait(&self) {
        // The only failure is a timeout, and no timeout is set.
        let _ = self.device.poll(wgpu::PollType::wait_indefinitely());
    }

    /// An encoder for one frame.
    pub fn encoder(&self) -> wgpu::CommandEncoder {
        self.device
            .create_command_encoder(&wgpu::CommandEncoderDescriptor {
                label: Some("frame"),
            })
    }
}
