//! One GPU pass a file. A pass owns the buffers it writes and is immutable once made.

pub mod light_path;
pub mod mesh_buffers;
pub mod plane_carried;
pub mod plane_full;
pub mod plane_incremental;
pub mod tangents;
