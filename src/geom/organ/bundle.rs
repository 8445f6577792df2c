//! The files of a bundled organ, as bytes: one call makes them again, bit for bit.

use super::Organ;
use crate::geom::export::{GlbMaterial, glb_bytes};
use crate::geom::paint::{TissueMaps, paint_organ};
use crate::geom::tangent::{Fans, rest_normals};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{DynamicImage, ExtendedColorType, ImageEncoder, RgbaImage};

/// One file of an organ.
#[derive(Clone, Debug, PartialEq)]
pub struct BundledFile {
    /// Path below the folder of the scenes, with `/`.
    pub path: String,
    pub bytes: Vec<u8>,
}

/// `organs/NAME.glb` and `textures/NAME-{outer,normal,inner,layers}.png`.
pub fn bundled_files(organ: Organ) -> Vec<BundledFile> {
    let mesh = organ.mesh();
    let normals = rest_normals(&mesh, &Fans::new(&mesh));
    let name = organ.name();
    let material = GlbMaterial {
        name: name.to_string(),
        base_color: Some(format!("../textures/{name}-outer.png")),
        normal_map: Some(format!("../textures/{name}-normal.png")),
        roughness: 0.35,
    };
    let mut files = vec![BundledFile {
        path: format!("organs/{name}.glb"),
        bytes: glb_bytes(&mesh, &normals, &material),
    }];
    let maps = paint_organ(&mesh, organ, organ.map_size_px());
    files.extend(png_files(&maps).map(|(map, bytes)| BundledFile {
        path: format!("textures/{name}-{map}.png"),
        bytes,
    }));
    files
}

/// The maps as PNG files, with the name of each.
fn png_files(maps: &TissueMaps) -> [(&'static str, Vec<u8>); 4] {
    [
        ("outer", png_bytes(&maps.outer, Channels::All)),
        ("normal", png_bytes(&maps.normal, Channels::Colour)),
        ("inner", png_bytes(&maps.inner, Channels::Colour)),
        (
            "layers",
            png_bytes(&maps.layers[0].to_rgba8(), Channels::All),
        ),
    ]
}

/// What a PNG keeps: alpha costs bytes where it is 255 everywhere.
enum Channels {
    All,
    Colour,
}

fn png_bytes(image: &RgbaImage, channels: Channels) -> Vec<u8> {
    let mut bytes = Vec::new();
    let encoder =
        PngEncoder::new_with_quality(&mut bytes, CompressionType::Best, FilterType::Adaptive);
    let (width, height) = image.dimensions();
    match channels {
        Channels::All => {
            encoder.write_image(image.as_raw(), width, height, ExtendedColorType::Rgba8)
        }
        Channels::Colour => encoder.write_image(
            DynamicImage::from(image.clone()).to_rgb8().as_raw(),
            width,
            height,
            ExtendedColorType::Rgb8,
        ),
    }
    .expect("memory takes any picture");
    bytes
}
