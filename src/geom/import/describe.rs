//! What a mesh or picture file holds, in words: the text of `palpate check`.

use super::error::{ImportError, ImportFault};
use super::part::{TextureSource, read_bytes, read_parts};
use super::surface::{ImportOptions, read_surface};
use std::fmt::Write;
use std::path::Path;

/// Pictures with a longer side are refused [pixels].
const SIDE_MAX: u32 = 16_384;
/// Extents outside this are hardly an organ in metres.
const PLAUSIBLE_EXTENT_M: std::ops::RangeInclusive<f32> = 0.005..=1.0;

/// Says what a surface (`.glb`, `.gltf`, `.obj`) or picture (`.png`, `.jpg`) holds, a line a fact.
///
/// # Errors
///
/// [`ImportError`] says what is wrong with the file.
pub fn describe(path: &Path) -> Result<String, ImportError> {
    let ending = path.extension().and_then(|ending| ending.to_str());
    match ending.map(str::to_ascii_lowercase).as_deref() {
        Some("png" | "jpg" | "jpeg") => {
            let picture = read_bytes(path).and_then(|bytes| describe_picture(&bytes, "picture"));
            picture.map_err(|fault| fault.of(path))
        }
        _ => describe_surface(path),
    }
}

fn describe_surface(path: &Path) -> Result<String, ImportError> {
    const TO_STRING: &str = "a string takes all that is written to it";
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
    if !PLAUSIBLE_EXTENT_M.contains(&extent.max_element()) {
        writeln!(
            text,
            "warning: {:.4} m is not the size of an organ; set body.size_m to the longest extent \
             wanted",
            extent.max_element()
        )
        .expect(TO_STRING);
    }
    for note in &surface.notes {
        writeln!(text, "note: {note}").expect(TO_STRING);
    }
    if let Some(source) = &surface.base_color {
        let (bytes, name) = match source {
            TextureSource::File(file) => (read_bytes(file), file.display().to_string()),
            TextureSource::Embedded(bytes) => (Ok(bytes.clone()), "embedded".to_owned()),
        };
        let picture = bytes.and_then(|bytes| describe_picture(&bytes, &name));
        let picture = picture.map_err(|fault| fault.of(path))?;
        writeln!(text, "base colour: {picture}").expect(TO_STRING);
    }
    Ok(text.trim_end().to_owned())
}

/// Size and channels of a PNG or JPEG, which is decoded to be sure that it can be.
fn describe_picture(bytes: &[u8], place: &str) -> Result<String, ImportFault> {
    let bad = |problem: String| ImportFault::malformed(place, problem);
    let format = image::guess_format(bytes)
        .map_err(|_| bad("neither PNG nor JPEG by its first bytes".to_owned()))?;
    let mut reader = image::ImageReader::with_format(std::io::Cursor::new(bytes), format);
    let mut limits = image::Limits::default();
    limits.max_image_width = Some(SIDE_MAX);
    limits.max_image_height = Some(SIDE_MAX);
    reader.limits(limits);
    let picture = reader.decode().map_err(|error| bad(error.to_string()))?;
    let color = picture.color();
    Ok(format!(
        "{place}: {format:?}, {} x {} pixels, {} channels of {} bits",
        picture.width(),
        picture.height(),
        color.channel_count(),
        color.bits_per_pixel() / u16::from(color.channel_count())
    ))
}
