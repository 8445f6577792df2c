//! From a scene to a body that can be simulated and drawn.

use super::{AppError, assets};
use crate::geom::import::{self, ImportOptions, UvState};
use crate::geom::lattice::{self, Lattice};
use crate::geom::paint::{TissueMaps, paint};
use crate::geom::unwrap::unwrap;
use crate::geom::{SurfaceMesh, bounds};
use crate::scene::{BodySection, MapFiles, RestBox, Scene, SceneSource, Shape};
use crate::sim::BodySetup;
use glam::Vec3;
use image::RgbaImage;
use std::path::Path;

/// A scene's body, ready to be simulated and drawn.
pub struct LoadedBody {
    /// The surface at rest.
    pub mesh: SurfaceMesh,
    /// The box around it.
    pub rest: RestBox,
    /// What the simulation starts from.
    pub setup: BodySetup,
    /// What was guessed, repaired or left out, a sentence each.
    pub notes: Vec<String>,
}

/// Reads a bundled scene or a file, with its overrides.
///
/// # Errors
///
/// [`AppError`] naming the scene and what is wrong with it.
pub fn scene(name: &str, sets: &[String]) -> Result<Scene, AppError> {
    let path = Path::new(name);
    if let Some(text) = assets::scene(name) {
        let source = SceneSource {
            name,
            text,
            folder: None,
        };
        return Ok(Scene::read(&source, sets)?);
    }
    if !path.is_file() {
        return Err(AppError::UnknownScene {
            name: name.to_owned(),
            known: assets::scenes()
                .iter()
                .map(|(known, _)| *known)
                .collect::<Vec<_>>()
                .join(", "),
        });
    }
    let text = std::fs::read_to_string(path).map_err(|source| AppError::Read {
        path: name.to_owned(),
        source,
    })?;
    let source = SceneSource {
        name,
        text: &text,
        folder: path.parent(),
    };
    Ok(Scene::read(&source, sets)?)
}

/// Reads or makes the body of `scene`.
///
/// # Errors
///
/// [`AppError`] naming the file and what is wrong with it.
pub fn body(scene: &Scene) -> Result<LoadedBody, AppError> {
    let section = &scene.body;
    let mut notes = Vec::new();
    let (mesh, lattice) = match (&section.file, section.shape) {
        (Some(file), _) => {
            let mesh = surface(section, file, &mut notes)?;
            let lattice = fill(section, &mesh, &mut notes)?;
            (mesh, lattice)
        }
        (None, Some(Shape::Sphere)) => {
            let diameter_m = extent(section).x;
            let (points, triangles) = lattice::sphere(0.5 * diameter_m);
            let mesh = unwrap(&points, &triangles);
            let lattice = fill(section, &mesh, &mut notes)?;
            (mesh, lattice)
        }
        (None, _) => lattice::block(
            extent(section),
            cell_or_guess(section, extent(section).element_product()),
            section.density_kg_m3,
        )?,
    };
    let (low, high) = bounds(&mesh.points);
    let rest = RestBox { low, high };
    let fixed: Vec<bool> = lattice
        .tets
        .particles
        .iter()
        .map(|&x| section.fixed.iter().any(|region| region.contains(x, &rest)))
        .collect();
    if fixed.iter().all(|&held| held) {
        return Err(AppError::Body(
            "body.fixed holds every particle, so nothing can move: make the regions smaller"
                .to_owned(),
        ));
    }
    let setup = BodySetup {
        tets: lattice.tets,
        masses_kg: lattice.masses_kg,
        fixed,
        fill: lattice.fill,
        embedding: lattice.embedding,
        triangles: mesh.point_triangles(),
        gravity_m_s2: section.gravity_m_s2,
        damping_per_s: section.damping_per_s,
    };
    Ok(LoadedBody {
        mesh,
        rest,
        setup,
        notes,
    })
}

/// The texture maps of a body: its files, or its tissue painted.
///
/// # Errors
///
/// [`AppError::Map`] naming a file that is no picture or has another size than the first.
pub fn maps(section: &BodySection, mesh: &SurfaceMesh) -> Result<TissueMaps, AppError> {
    let Some(MapFiles {
        outer,
        normal,
        inner,
        layers,
    }) = &section.maps
    else {
        return Ok(paint(mesh, section.tissue, section.map_size_px));
    };
    let outer = picture(outer)?;
    let size_px = outer.width();
    let same_size = |path: &Path| -> Result<RgbaImage, AppError> {
        let image = picture(path)?;
        if image.dimensions() == (size_px, size_px) {
            Ok(image)
        } else {
            Err(AppError::Map {
                path: path.display().to_string(),
                message: format!(
                    "it is {} x {}; all maps of a body are squares of one size, here {size_px}",
                    image.width(),
                    image.height()
                ),
            })
        }
    };
    Ok(TissueMaps {
        size_px,
        normal: same_size(normal)?,
        inner: same_size(inner)?,
        layers: same_size(layers)?,
        outer,
    })
}

fn picture(path: &Path) -> Result<RgbaImage, AppError> {
    let wrong = |message: String| AppError::Map {
        path: path.display().to_string(),
        message,
    };
    let bytes = assets::read(path).map_err(|e| wrong(e.to_string()))?;
    let reader = image::ImageReader::new(std::io::Cursor::new(&bytes))
        .with_guessed_format()
        .map_err(|e| wrong(e.to_string()))?;
    Ok(reader
        .decode()
        .map_err(|e| wrong(e.to_string()))?
        .to_rgba8())
}

/// The surface of `file`, scaled, welded, closed, with a usable UV map.
fn surface(
    section: &BodySection,
    file: &Path,
    notes: &mut Vec<String>,
) -> Result<SurfaceMesh, AppError> {
    let bytes = assets::read(file).map_err(|source| AppError::Read {
        path: file.display().to_string(),
        source,
    })?;
    let options = ImportOptions {
        meshes: section.meshes.clone(),
    };
    let imported = import::read_surface_bytes(file, &bytes, &options)?;
    // A bundled surface is as we made it; its textures are in the binary, not beside it.
    if !assets::is_bundled(file) {
        notes.extend(imported.notes);
    }
    let mut mesh = imported.mesh;
    if imported.uv != UvState::Usable {
        notes.push(format!("{}: unwrapped anew", imported.uv));
        mesh = unwrap(&mesh.points, &mesh.point_triangles());
    }
    let (low, high) = mesh.bounds();
    let longest_m = (high - low).max_element();
    if longest_m.is_nan() || longest_m <= 0.0 {
        return Err(AppError::Body(format!(
            "{}: the surface has no extent",
            file.display()
        )));
    }
    match section.size_m {
        Some(size_m) => {
            let scale = size_m / longest_m;
            for point in &mut mesh.points {
                *point *= scale;
            }
        }
        None if !(1e-3..=2.0).contains(&longest_m) => notes.push(format!(
            "the surface is {longest_m} m long if its unit is the metre: say body.size_m"
        )),
        None => {}
    }
    Ok(mesh)
}

fn fill(
    section: &BodySection,
    mesh: &SurfaceMesh,
    notes: &mut Vec<String>,
) -> Result<Lattice, AppError> {
    let cell_m = cell_or_guess(section, mesh.volume_m3() as f32);
    let lattice = Lattice::around(mesh, cell_m, section.density_kg_m3)?;
    if section.cell_m.is_none() {
        notes.push(format!(
            "cells of {:.2} mm: {} tetrahedra",
            1e3 * cell_m,
            lattice.tets.tets.len()
        ));
    }
    Ok(lattice)
}

fn cell_or_guess(section: &BodySection, volume_m3: f32) -> f32 {
    section
        .cell_m
        .unwrap_or_else(|| lattice::cell_for_volume_m(volume_m3))
}

fn extent(section: &BodySection) -> Vec3 {
    section.extent_m.expect("a checked shape has an extent")
}
