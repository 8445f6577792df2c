//! Texture maps painted in space over any unwrapped surface: no seam shows, and any organ that a
//! user loads gets tissue.
//!
//! Each texel is carried to its place on the surface; colours, relief and depths are functions of
//! that place ([`tissue`]) and of vessels grown over the surface ([`vessel`]). Sizes in these
//! functions are those of the bundled organ of the same kind: a surface of another size or unit is
//! painted as if scaled to it. Results do not depend on the number of threads.

mod canvas;
mod relief;
mod tissue;
mod vessel;

use super::SurfaceMesh;
use super::organ::{Features, Organ};
use canvas::Canvas;
use glam::Vec3;
use image::{Rgba, RgbaImage};
use rayon::prelude::*;

/// What a surface is painted as.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Tissue {
    Liver,
    Heart,
}

impl Tissue {
    /// Every tissue.
    pub const ALL: [Self; 2] = [Self::Liver, Self::Heart];

    /// Name in scene files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Liver => "liver",
            Self::Heart => "heart",
        }
    }

    /// Longest extent of an organ of this tissue [cm]: sets the scale of the pattern.
    fn extent_cm(self) -> f32 {
        match self {
            Self::Liver => 22.0,
            Self::Heart => 12.5,
        }
    }
}

/// The maps of one organ. Texels outside the charts hold what the nearest chart would go on with
/// for a gutter of [`GUTTER_PX`], and a mean beyond.
#[derive(Clone, Debug, PartialEq)]
pub struct TissueMaps {
    /// Side of each map [px].
    pub size_px: u32,
    /// Outer layer: sRGB colour; alpha is its opacity, linear, 255 opaque.
    pub outer: RgbaImage,
    /// Normal in tangent space as glTF has it: red towards growing u, green towards smaller v,
    /// blue outwards, 128 is 0. Alpha is 255.
    pub normal: RgbaImage,
    /// Deep tissue: sRGB colour. Alpha is 255.
    pub inner: RgbaImage,
    /// Depth of the lower boundary of layers 1 to 4 as a share of the deepest depth, linear,
    /// red ≤ green ≤ blue ≤ alpha. Layer 1 is the capsule, layer 3 holds the vessels: thick
    /// where one runs, thin elsewhere.
    pub layers: RgbaImage,
}

/// Width of the painted border round each chart [px].
pub const GUTTER_PX: u32 = 12;

/// Paints a surface whose charts do not overlap.
///
/// # Panics
///
/// If `size_px` is 0.
pub fn paint(mesh: &SurfaceMesh, tissue: Tissue, size_px: u32) -> TissueMaps {
    paint_with(mesh, tissue, size_px, None)
}

/// Paints a bundled organ, with the vessels, fat and neighbours that its formula knows of.
///
/// # Panics
///
/// If `size_px` is 0.
pub fn paint_organ(mesh: &SurfaceMesh, organ: Organ, size_px: u32) -> TissueMaps {
    let tissue = match organ {
        Organ::Liver => Tissue::Liver,
        Organ::Heart => Tissue::Heart,
    };
    paint_with(mesh, tissue, size_px, Some(organ))
}

/// A place on the surface, as the tissues see it.
pub(in crate::geom) struct Site {
    /// Place at the size of the bundled organ [cm], from the corner of its box.
    pub place: Vec3,
    /// Unit normal.
    pub normal: Vec3,
    /// How hollow the surface is there: 0 flat or bulging, 1 a groove.
    pub hollow: f32,
    /// Height in the box of the organ, 0 to 1.
    pub height: f32,
    pub features: Features,
}

/// What a tissue has at a place. Colours are sRGB from 0 to 1.
#[derive(Clone, Copy, Debug, Default)]
pub(in crate::geom) struct Dab {
    pub outer: Vec3,
    pub opacity: f32,
    /// Relief above the surface [cm].
    pub relief: f32,
    pub inner: Vec3,
    /// As [`TissueMaps::layers`].
    pub depths: [f32; 4],
}

fn paint_with(
    mesh: &SurfaceMesh,
    tissue: Tissue,
    size_px: u32,
    organ: Option<Organ>,
) -> TissueMaps {
    assert!(size_px > 0, "a map has at least one texel");
    let canvas = Canvas::new(mesh, size_px, tissue.extent_cm());
    let guides: Vec<Vec<Vec3>> = organ
        .map(|organ| organ.vessel_paths())
        .unwrap_or_default()
        .into_iter()
        .map(|path| path.into_iter().map(|p| canvas.scaled(p)).collect())
        .collect();
    let brush = tissue::Brush::new(tissue, &canvas, &guides);
    let features = |place: Vec3| {
        organ.map_or(Features::default(), |organ| {
            organ.features(canvas.unscaled(place))
        })
    };
    let dabs: Vec<Option<Dab>> = (0..size_px * size_px)
        .into_par_iter()
        .map(|texel| {
            canvas
                .site(mesh, texel, &features)
                .map(|site| brush.dab(&site))
        })
        .collect();
    let normals = relief::normals(&canvas, mesh, &dabs);
    maps(size_px, &dabs, &normals)
}

/// Rounds the dabs to texels.
fn maps(size_px: u32, dabs: &[Option<Dab>], normals: &[Vec3]) -> TissueMaps {
    let painted = dabs.iter().flatten().count().max(1) as f32;
    let mean = |value: fn(&Dab) -> Vec3| dabs.iter().flatten().map(value).sum::<Vec3>() / painted;
    let empty = Dab {
        outer: mean(|dab| dab.outer),
        opacity: 1.0,
        relief: 0.0,
        inner: mean(|dab| dab.inner),
        depths: [0.1, 0.4, 0.5, 1.0],
    };
    // Colours and depths are rounded to every `step`-th value: noise hides it, and the pictures
    // pack into half the bytes.
    let image = |step: f32, texel: &dyn Fn(&Dab, Vec3) -> [f32; 4]| {
        RgbaImage::from_fn(size_px, size_px, |x, y| {
            let at = (y * size_px + x) as usize;
            let channels = texel(dabs[at].as_ref().unwrap_or(&empty), normals[at]);
            Rgba(channels.map(|c| {
                let rounded = (c.clamp(0.0, 1.0) * 255.0 / step + 0.5) as u8;
                (f32::from(rounded) * step) as u8
            }))
        })
    };
    TissueMaps {
        size_px,
        outer: image(3.0, &|dab, _| dab.outer.extend(dab.opacity).to_array()),
        normal: image(1.0, &|_, normal| {
            // 128 is 0, as in glTF: the shader takes 255 steps from −1 to 1.
            (normal * (127.0 / 255.0) + Vec3::splat(128.0 / 255.0))
                .extend(1.0)
                .to_array()
        }),
        inner: image(5.0, &|dab, _| dab.inner.extend(1.0).to_array()),
        layers: image(5.0, &|dab, _| dab.depths),
    }
}
