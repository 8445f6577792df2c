//! Why the GPU part could not start, or a pass could not be built.

use std::fmt;

/// Why the GPU part could not start, or a pass could not be built.
#[derive(Debug)]
pub enum GpuError {
    /// No adapter, hardware or software.
    NoAdapter(wgpu::RequestAdapterError),
    /// An adapter that lacks what every WebGPU adapter has.
    WeakAdapter(String),
    /// The adapter refused a device, mostly for want of memory.
    NoDevice(wgpu::RequestDeviceError),
    /// The joined WGSL of a pass does not compile; `message` has the parser's excerpt.
    Shader { pass: &'static str, message: String },
    /// A pipeline or resource of a pass was refused.
    Pass { pass: &'static str, message: String },
    /// The scene's mesh needs more workgroups than one dispatch may have.
    DispatchTooLarge {
        pass: &'static str,
        workgroups: u32,
        limit: u32,
    },
    /// A buffer is larger than this adapter binds.
    BufferTooLarge {
        what: String,
        bytes: u64,
        limit: u64,
    },
    /// Memory could not be read back from the GPU.
    ReadBack(String),
}

impl fmt::Display for GpuError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::NoAdapter(_) => write!(
                f,
                "no GPU adapter: install a driver, or mesa-vulkan-drivers for a software one \
                 (or run `palpate replay SCENE --no-render`, which needs none)"
            ),
            Self::WeakAdapter(name) => write!(
                f,
                "the GPU adapter {name} lacks storage textures or buffers: install a Vulkan driver, \
                 or mesa-vulkan-drivers for a software one"
            ),
            Self::NoDevice(_) => write!(f, "the GPU adapter gave no device"),
            Self::Shader { pass, message } => {
                write!(f, "shader of pass {pass} does not compile:\n{message}")
            }
            Self::Pass { pass, message } => write!(f, "pass {pass} cannot be built: {message}"),
            Self::DispatchTooLarge {
                pass,
                workgroups,
                limit,
            } => write!(
                f,
                "pass {pass} needs {workgroups} workgroups, this adapter allows {limit}: use a \
                 coarser surface"
            ),
            Self::BufferTooLarge { what, bytes, limit } => write!(
                f,
                "{what} needs {bytes} bytes, this adapter binds {limit}: use a coarser surface or a \
                 smaller light_path.radius_m"
            ),
            Self::ReadBack(message) => write!(f, "GPU memory cannot be read back: {message}"),
        }
    }
}

impl std::error::Error for GpuError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::NoAdapter(source) => Some(source),
            Self::NoDevice(source) => Some(source),
            _ => None,
        }
    }
}
