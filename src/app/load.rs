//! From a scene to a body that can be simulated and drawn.

use super::cache::Cache;
use super::{AppError, assets};
use crate::geom::import::{self, ImportOptions, ImportedSurface, TextureSource, UvState};
use crate::geom::lattice::{self, Cells, Lattice};
use crate::geom::paint::{OwnPictures, TissueMaps, lay_over};
use crate::geom::tet::{lumped_masses_kg, skin};
use crate::geom::unwrap::unwrap;
use crate::geom::{Embedding, SurfaceMesh, TetMesh, bounds};
use crate::optics::absorption::RAMP_LENGTH;
use crate::optics::tone::linear_from_srgb;
use crate::scene::{BodySection, MapFiles, RestBox, Scene, SceneSource, Shape};
use crate::sim::BodySetup;
use glam::Vec3;
use image::DynamicImage;
use std::path::{Path, PathBuf};

/// Finest cells of a graded slab that says nothing of them, as a share of its height: about 15,000
/// tetrahedra.
const FINEST_SHARE: f32 = 0.006;

/// Scene files beyond this are refused unread [bytes]: a mouse recorded for an hour has a quarter of it.
const SCENE_BYTES_MAX: u64 = 1 << 24;

/// A scene's body, ready to be simulated and drawn.
pub struct LoadedBody {
    /// The surface at rest.
    pub mesh: SurfaceMesh,
    /// The box around it.
    pub rest: RestBox,
    /// What the simulation starts from.
    pub setup: BodySetup,
    /// Edge of the lattice's cubes [m]; `None` for a body of given tetrahedra.
    pub cell_m: Option<f32>,
    /// The pictures that its file brought.
    pub pictures: OwnPictures,
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
    let text = text(path).map_err(|source| AppError::Read {
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

/// The text of a scene file.
fn text(path: &Path) -> std::io::Result<String> {
    let bytes = std::fs::metadata(path)?.len();
    if bytes > SCENE_BYTES_MAX {
        return Err(std::io::Error::other(format!(
            "{bytes} bytes are over the limit of {SCENE_BYTES_MAX} for a scene"
        )));
    }
    std::fs::read_to_string(path)
}

/// What is simulated of a body, before it is known where it is held.
struct Tissue {
    tets: TetMesh,
    masses_kg: Vec<f32>,
    fill: Vec<f32>,
    embedding: Embedding,
    /// Edge of the cubes of a lattice [m].
    cell_m: Option<f32>,
}

impl From<Lattice> for Tissue {
    fn from(lattice: Lattice) -> Self {
        Self {
            tets: lattice.tets,
            masses_kg: lattice.masses_kg,
            fill: lattice.fill,
            embedding: lattice.embedding,
            cell_m: Some(lattice.cell_m),
        }
    }
}

/// Reads or makes the body of `scene`.
///
/// # Errors
///
/// [`AppError`] naming the file and what is wrong with it.
pub fn body(scene: &Scene) -> Result<LoadedBody, AppError> {
    let section = &scene.body;
    let mut notes = Vec::new();
    let mut pictures = OwnPictures::default();
    let (mesh, tissue) = match (&section.file, section.shape) {
        (Some(file), _) if section.names_tets() => tets(section, file, &mut notes)?,
        (Some(file), _) => {
            let mesh = surface(section, file, &mut pictures, &mut notes)?;
            let lattice = fill(section, &mesh, &mut notes)?;
            (mesh, lattice.into())
        }
        (None, Some(Shape::Sphere)) => {
            let diameter_m = extent(section).x;
            let (points, triangles) = lattice::sphere(0.5 * diameter_m);
            let mesh = unwrap(&points, &triangles);
            let lattice = fill(section, &mesh, &mut notes)?;
            (mesh, lattice.into())
        }
        (None, Some(Shape::GradedSlab)) => {
            let size_m = extent(section);
            let cell_m = section.cell_m.unwrap_or(FINEST_SHARE * size_m.y);
            let (mesh, lattice) = lattice::graded_block(size_m, cell_m, section.density_kg_m3)?;
            (mesh, lattice.into())
        }
        (None, _) => {
            let (mesh, lattice) = lattice::block(
                extent(section),
                section.cell_m.unwrap_or_else(|| {
                    lattice::cell_for_volume_m(extent(section).element_product())
                }),
                section.density_kg_m3,
            )?;
            (mesh, lattice.into())
        }
    };
    let (low, high) = bounds(&mesh.points);
    let rest = RestBox { low, high };
    let fixed: Vec<bool> = tissue
        .tets
        .particles
        .iter()
        .map(|&x| section.fixed.iter().any(|region| region.contains(x, &rest)))
        .collect();
    let activity = activity(section, &tissue.tets.particles, &rest)?;
    if fixed.iter().all(|&held| held) {
        return Err(AppError::Body(
            "body.fixed holds every particle, so nothing can move: make the regions smaller"
                .to_owned(),
        ));
    }
    let setup = BodySetup {
        tets: tissue.tets,
        masses_kg: tissue.masses_kg,
        fixed,
        fill: tissue.fill,
        activity,
        embedding: tissue.embedding,
        triangles: mesh.point_triangles(),
        gravity_m_s2: section.gravity_m_s2,
        damping_per_s: section.damping_per_s,
    };
    Ok(LoadedBody {
        mesh,
        rest,
        setup: setup.numbered_along(),
        cell_m: tissue.cell_m,
        pictures,
        notes,
    })
}

/// How much of each particle is muscle; nothing for a body that does not beat, or is muscle throughout.
fn activity(
    section: &BodySection,
    particles: &[Vec3],
    rest: &RestBox,
) -> Result<Vec<f32>, AppError> {
    let regions = section.beat.as_ref().map_or(&[][..], |beat| &beat.muscle);
    if regions.is_empty() {
        return Ok(Vec::new());
    }
    let is_muscle = |x| regions.iter().any(|region| region.contains(x, rest));
    let activity: Vec<f32> = (particles.iter())
        .map(|&x| f32::from(u8::from(is_muscle(x))))
        .collect();
    if activity.iter().all(|&share| share == 0.0) {
        return Err(AppError::Body(
            "body.beat.muscle reaches no particle, so nothing can beat: make the regions larger"
                .to_owned(),
        ));
    }
    Ok(activity)
}

/// The texture maps of a body: the scene's files, or its tissue painted with the `pictures` that came with it.
///
/// # Errors
///
/// [`AppError::Map`] naming a file that is no picture or has another size than the first.
pub fn maps(
    section: &BodySection,
    mesh: &SurfaceMesh,
    pictures: &OwnPictures,
) -> Result<TissueMaps, AppError> {
    let Some(MapFiles {
        outer,
        normal,
        inner,
        layers,
    }) = &section.maps
    else {
        let mut maps = Cache::of_user().painted(mesh, section.tissue, section.map_size_px);
        lay_over(&mut maps, mesh, pictures);
        return Ok(maps);
    };
    let outer = picture(outer)?.into_rgba8();
    let size_px = outer.width();
    let same_size = |path: &PathBuf| -> Result<DynamicImage, AppError> {
        let image = picture(path)?;
        if (image.width(), image.height()) == (size_px, size_px) {
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
        normal: same_size(normal)?.into_rgba8(),
        inner: same_size(inner)?.into_rgba8(),
        layers: layers.iter().map(same_size).collect::<Result<_, _>>()?,
        outer,
    })
}

/// The colours of a ramp: the first row of the picture at `path`, linear, spread evenly over a ramp.
///
/// # Errors
///
/// [`AppError::Map`] if the file is no picture.
pub fn ramp(path: &Path) -> Result<Vec<Vec3>, AppError> {
    let image = picture(path)?.to_rgba8();
    let last = image.width() - 1;
    let linear = |column: u32| {
        let [r, g, b, _] = image.get_pixel(column, 0).0;
        Vec3::from_array([r, g, b].map(|byte| linear_from_srgb(f32::from(byte) / 255.0)))
    };
    Ok((0..RAMP_LENGTH)
        .map(|i| {
            let at = i as f32 / (RAMP_LENGTH - 1) as f32 * last as f32;
            let low = (at as u32).min(last);
            linear(low).lerp(linear((low + 1).min(last)), at.fract())
        })
        .collect())
}

/// A picture with as many bits a channel as the file has.
pub(super) fn picture(path: &Path) -> Result<DynamicImage, AppError> {
    let wrong = |message: String| AppError::Map {
        path: path.display().to_string(),
        message,
    };
    let bytes = assets::read(path).map_err(|e| wrong(e.to_string()))?;
    import::read_picture_bytes(path, &bytes).map_err(|e| wrong(e.fault.to_string()))
}

/// The tetrahedra of `file`, scaled, with their own skin as surface.
///
/// Particles are the nodes in the order of the file; every point of the surface is one of them.
fn tets(
    section: &BodySection,
    file: &Path,
    notes: &mut Vec<String>,
) -> Result<(SurfaceMesh, Tissue), AppError> {
    let imported = match assets::bundled(file) {
        Some(bytes) => import::read_tets_bytes(file, bytes)?,
        None => import::read_tets(file)?,
    };
    notes.extend(imported.notes);
    let mut tets = imported.mesh;
    let (low, high) = bounds(&tets.particles);
    let scale = scale(section, (high - low).max_element(), notes);
    for particle in &mut tets.particles {
        *particle *= scale;
    }
    let masses_kg = lumped_masses_kg(&tets, section.density_kg_m3);
    if !masses_kg.iter().all(|mass| mass.is_normal()) {
        return Err(AppError::Body(format!(
            "{}: a tetrahedron is too small or too large to weigh anything as a number: the body is \
             {} m long, so say body.size_m, or mesh it more evenly",
            file.display(),
            scale * (high - low).max_element()
        )));
    }
    let skin = skin(&tets);
    let points: Vec<Vec3> = (skin.particles.iter())
        .map(|&particle| tets.particles[particle as usize])
        .collect();
    let tissue = Tissue {
        masses_kg,
        fill: vec![1.0; tets.tets.len()],
        cell_m: None,
        embedding: Embedding {
            particles: skin
                .particles
                .iter()
                .map(|&particle| [particle; 4])
                .collect(),
            weights: vec![[1.0, 0.0, 0.0, 0.0]; points.len()],
        },
        tets,
    };
    let mesh = Cache::of_user().unwrapped(&points, &skin.triangles);
    Ok((mesh, tissue))
}

/// What makes a body that is `longest_m` long in its file as long as its section says.
fn scale(section: &BodySection, longest_m: f32, notes: &mut Vec<String>) -> f32 {
    if let Some(size_m) = section.size_m {
        return size_m / longest_m;
    }
    if !(1e-3..=2.0).contains(&longest_m) {
        let unit = [("centimetres", 1e-2), ("millimetres", 1e-3)]
            .into_iter()
            .find(|(_, unit_m)| (0.02..=0.5).contains(&(longest_m * unit_m)))
            .map(|(name, unit_m)| {
                format!(
                    ", in {name} it would be an organ: say body.size_m={:.3}",
                    longest_m * unit_m
                )
            });
        notes.push(format!(
            "the body is {longest_m} m long if the unit of its file is the metre{}",
            unit.as_deref().unwrap_or(": say body.size_m")
        ));
    }
    1.0
}

/// The surface of `file`, scaled, welded, closed, with a usable UV map.
fn surface(
    section: &BodySection,
    file: &Path,
    pictures: &mut OwnPictures,
    notes: &mut Vec<String>,
) -> Result<SurfaceMesh, AppError> {
    let bytes = assets::read(file).map_err(|source| AppError::Read {
        path: file.display().to_string(),
        source,
    })?;
    let options = ImportOptions {
        meshes: section.meshes.clone(),
    };
    let mut imported = import::read_surface_bytes(file, &bytes, &options)?;
    // A bundled surface is as we made it; its textures are in the binary, not beside it.
    if !assets::is_bundled(file) {
        notes.append(&mut imported.notes);
    }
    if section.maps.is_none() {
        *pictures = own_pictures(&imported, notes);
    }
    let mut mesh = imported.mesh;
    if imported.uv != UvState::Usable {
        notes.push("texture coordinates are made anew".to_owned());
        mesh = Cache::of_user().unwrapped(&mesh.points, &mesh.point_triangles());
    }
    let (low, high) = mesh.bounds();
    let longest_m = (high - low).max_element();
    if longest_m.is_nan() || longest_m <= 0.0 {
        return Err(AppError::Body(format!(
            "{}: the surface has no extent",
            file.display()
        )));
    }
    let scale = scale(section, longest_m, notes);
    for point in &mut mesh.points {
        *point *= scale;
    }
    Ok(mesh)
}

/// The pictures that came with a surface. One that can't be used is a note: the shape is still good.
fn own_pictures(imported: &ImportedSurface, notes: &mut Vec<String>) -> OwnPictures {
    let mut usable = |what: &str, source: &Option<TextureSource>| {
        let source = source.as_ref()?;
        let name = match source {
            TextureSource::File(file) => file.display().to_string(),
            TextureSource::Embedded(_) => "in the file".to_owned(),
        };
        match import::read_picture(source) {
            Ok(picture) => {
                notes.push(format!(
                    "the {what} is its own picture, {name}, {} x {}",
                    picture.width(),
                    picture.height()
                ));
                Some(picture.into_rgb8())
            }
            Err(error) => {
                notes.push(format!("the {what} is painted: {name}: {}", error.fault));
                None
            }
        }
    };
    match imported.uv {
        UvState::Usable => OwnPictures {
            color: usable("colour", &imported.base_color),
            normal: usable("relief", &imported.normal),
            corners: Vec::new(),
        },
        // A picture may repeat or be shared; it is carried over to the new texture coordinates.
        UvState::Outside | UvState::Overlapping { .. } => OwnPictures {
            color: usable("colour", &imported.base_color),
            normal: None,
            corners: (imported.mesh.triangles.iter())
                .map(|t| t.map(|vertex| imported.mesh.uvs[vertex as usize]))
                .collect(),
        },
        UvState::Missing | UvState::NonFinite | UvState::NoArea => OwnPictures::default(),
    }
}

fn fill(
    section: &BodySection,
    mesh: &SurfaceMesh,
    notes: &mut Vec<String>,
) -> Result<Lattice, AppError> {
    if let Some(cell_m) = section.cell_m {
        return Ok(Lattice::around(mesh, cell_m, section.density_kg_m3)?);
    }
    let Cells { cell_m, thin_m } = lattice::cells_for(mesh);
    let lattice = Lattice::around(mesh, cell_m, section.density_kg_m3)?;
    let mut note = format!(
        "cells of {:.3} mm: {} tetrahedra",
        1e3 * cell_m,
        lattice.tets.tets.len()
    );
    if thin_m < 0.99 * cell_m {
        note += &format!(
            "; much of the body is thinner than one, {:.3} mm or less: body.cell_m sets smaller ones, at a cost",
            1e3 * thin_m
        );
    }
    notes.push(note);
    Ok(lattice)
}

/// Extent of a shape [m], made as long as its section says.
fn extent(section: &BodySection) -> Vec3 {
    let extent_m = section.extent_m.expect("a checked shape has an extent");
    let longest_m = match section.shape {
        // A ball has the first as its diameter.
        Some(Shape::Sphere) => extent_m.x,
        _ => extent_m.max_element(),
    };
    section
        .size_m
        .map_or(extent_m, |size_m| size_m / longest_m * extent_m)
}
