//! Surfaces from files: glTF 2.0 (`.glb`, `.gltf`) and OBJ, made closed, outward and ready to embed.
//!
//! The way of a file: [`container`] finds its bytes, `gltf` or `obj` turns them into [`Part`]s,
//! [`weld`] joins equal positions, [`closure`] finds the parts that close, [`repair`] mends small
//! defects, and [`uv`] judges the texture coordinates. Nothing in a file is believed before it is
//! checked against the bytes that are really there.

mod accessor;
mod closure;
mod container;
mod describe;
mod error;
mod gltf;
mod obj;
mod part;
mod repair;
mod surface;
mod topology;
mod uv;
mod weld;

pub use describe::describe;
pub use error::{ImportError, ImportFault};
pub use part::{FileParts, Part, TextureSource, read_parts};
pub use surface::{ImportOptions, ImportedSurface, read_surface, read_surface_bytes};
pub use uv::{UvState, uv_state};

#[cfg(test)]
mod tests;
