//! What a mesh or picture file holds, in words: the text of `palpate check`.

use super::error::ImportError;
use super::part::{TextureSource, read_parts};
use super::picture::read_picture;
use super::surface::{ImportOptions, read_surface};
use super::tets::{ImportedTets, read_tets};
use crate::geom::bounds;
use crate::geom::tet::{self, SLIVER_BELOW};
use std::fmt::Write;
use std::path::Path;

/// Extents outside this are hardly an organ in metres.
const PLAUSIBLE_EXTENT_M: std::ops::RangeInclusive<f32> = 0.005..=1.0;

const TO_STRING: &str = "a string takes all that is written to it";

/// Says what a surface (`.glb`, `.gltf`, `.obj`), a body of tetrahedra (`.msh`) or a picture (`.png`,
/// `.jpg`) holds, a line a fact.
///
/// # Errors
///
/// [`ImportError`] says what is wrong with the file.
pub fn describe(path: &Path) -> Result<String, ImportError> {
    let ending = path.extension().and_then(|ending| ending.to_str());
    match ending.map(str::to_ascii_lowercase).as_deref() {
        Some("png" | "jpg" | "jpeg") => {
            let picture = read_picture(&TextureSource::File(path.to_owned()))?;
            Ok(format!("picture: {}", about(&picture)))
        }
        Some("msh") => Ok(describe_tets(&read_tets(path)?)),
        _ => describe_surface(path),
    }
}

fn describe_tets(imported: &ImportedTets) -> String {
    let mesh = &imported.mesh;
    let (low, high) = bounds(&mesh.particles);
    let extent = high - low;
    let volume_m3: f64 = (0..mesh.tets.len())
        .map(|tet| tet::volume_m3(tet::corners(mesh, tet)))
        .sum();
    let skin = tet::skin(mesh);
    let quality = imported.quality;
    let mut text = String::new();
    writeln!(
        text,
        "format: {}\n\
         tetrahedra: {} on {} nodes, {} part(s)\n\
         extent: {} x {} x {} m, volume {volume_m3:.6e} m³ ({:.1} mL)\n\
         quality: radius ratio 3r/R {:.3} in the median, {:.3e} at worst; {} slivers below \
         {SLIVER_BELOW}\n\
         boundary: {} vertices, {} triangles, Euler number {}",
        imported.format,
        mesh.tets.len(),
        mesh.particles.len(),
        imported.parts,
        extent.x,
        extent.y,
        extent.z,
        volume_m3 * 1e6,
        quality.median,
        quality.worst,
        quality.slivers,
        skin.particles.len(),
        skin.triangles.len(),
        skin.euler_number(),
    )
    .expect(TO_STRING);
    if imported.ignored > 0 {
        writeln!(
            text,
            "passed over: {} points, lines and faces",
            imported.ignored
        )
        .expect(TO_STRING);
    }
    warn_of_size(&mut text, extent.max_element());
    for note in &imported.notes {
        writeln!(text, "note: {note}").expect(TO_STRING);
    }
    text.trim_end().to_owned()
}

/// Says that a body of this length [m] is hardly an organ in metres.
fn warn_of_size(text: &mut String, longest_m: f32) {
    if !PLAUSIBLE_EXTENT_M.contains(&longest_m) {
        writeln!(
            text,
            "warning: {longest_m:.4} m is not the size of an organ; set body.size_m to the longest \
             extent wanted"
        )
        .expect(TO_STRING);
    }
}

fn describe_surface(path: &Path) -> Result<String, ImportError> {
    let mut text = String::new();
    let file = read_parts(path)?;
    for part in &file.parts {
        let uv = if part.uvs.is_some() {
            "with"
        } else {
            "without"
        };
        writeln!(
            text,
            "mesh `{}`: {} vertices, {} triangles, {uv} texture coordinates",
            part.name,
            part.positions.len(),
            part.triangles.len()
        )
        .expect(TO_STRING);
    }
    let surface = read_surface(path, &ImportOptions::default())?;
    let mesh = &surface.mesh;
    let (low, high) = mesh.bounds();
    let extent = high - low;
    let euler = mesh.points.len() as i64 - mesh.triangles.len() as i64 / 2;
    writeln!(
        text,
        "surface: closed, {} points, {} vertices, {} triangles, {} handles\n\
         extent: {:.4} x {:.4} x {:.4} m, volume {:.6e} m³ ({:.1} mL)\n\
         texture coordinates: {}",
        mesh.points.len(),
        mesh.point_of.len(),
        mesh.triangles.len(),
        (2 - euler) / 2,
        extent.x,
        extent.y,
        extent.z,
        mesh.volume_m3(),
        mesh.volume_m3() * 1e6,
        surface.uv,
    )
    .expect(TO_STRING);
    warn_of_size(&mut text, extent.max_element());
    for note in &surface.notes {
        writeln!(text, "note: {note}").expect(TO_STRING);
    }
    let pictures = [
        ("base colour", &surface.base_color),
        ("normals", &surface.normal),
    ];
    for (what, source) in pictures {
        let Some(source) = source else {
            continue;
        };
        let place = match source {
            TextureSource::File(file) => file.display().to_string(),
            TextureSource::Embedded(_) => "embedded".to_owned(),
        };
        let picture = read_picture(source).map_err(|error| match source {
            TextureSource::File(_) => error,
            TextureSource::Embedded(_) => error.fault.of(path),
        })?;
        writeln!(text, "{what}: {place}, {}", about(&picture)).expect(TO_STRING);
    }
    Ok(text.trim_end().to_owned())
}

/// Size and channels of a picture.
fn about(picture: &image::DynamicImage) -> String {
    let color = picture.color();
    let channels = color.channel_count();
    format!(
        "{} x {} pixels, {channels} channels of {} bits",
        picture.width(),
        picture.height(),
        color.bits_per_pixel() / u16::from(channels)
    )
}
