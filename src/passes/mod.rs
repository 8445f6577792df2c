//! One GPU pass a file. A pass owns the buffers it writes and is immutable once made.

pub mod backdrop;
pub mod body_depths;
pub mod depth_maps;
pub mod diffusion;
pub mod draw;
pub mod exit;
pub mod frame;
pub mod geometry;
pub mod green;
pub mod light_path;
pub mod lightmap;
pub mod maps;
pub mod mesh_buffers;
pub mod moved_leaves;
pub mod plane_carried;
pub mod plane_full;
pub mod plane_incremental;
pub mod plane_stale;
pub mod sampled_fit;
pub mod shadow;
pub mod surface;
pub mod tangents;
pub mod tools;
pub mod view;

/// Linear radiance, with coverage in alpha.
pub const RADIANCE_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;
/// Depth, 0 near to 1 far.
pub const DEPTH_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;
/// What is shown: sRGB, encoded by the surface and the tools.
pub const PICTURE_FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba8Unorm;
