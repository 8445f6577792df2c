//! Shapes from files: surfaces of glTF 2.0 (`.glb`, `.gltf`) and OBJ, made closed, outward and ready
//! to embed, and tetrahedra of Gmsh (`.msh`), made positive and free of overlap.
//!
//! The way of a file: [`container`] finds its bytes, `gltf` or `obj` turns them into [`Part`]s,
//! [`weld`] joins equal positions, [`closure`] finds the parts that close, [`repair`] mends small
//! defects, and [`uv`] judges the texture coordinates. Tetrahedra go through `gmsh` and [`tets`]. Nothing in a file is believed before it is
//! checked against the bytes that are really there.

mod accessor;
mod closure;
mod container;
mod describe;
mod error;
mod gltf;
mod gmsh;
mod obj;
mod part;
mod picture;
mod repair;
mod surface;
mod tets;
mod topology;
mod uv;
mod weld;

pub use describe::describe;
pub use error::{ImportError, ImportFault};
pub use part::{FileParts, Part, TextureSource, read_file, read_parts};
pub use picture::{read_picture, read_picture_bytes};
pub use surface::{ImportOptions, ImportedSurface, read_surface, read_surface_bytes};
pub use tets::{ImportedTets, read_tets, read_tets_bytes};
pub use uv::{UvState, uv_state};

#[cfg(test)]
mod tests;
