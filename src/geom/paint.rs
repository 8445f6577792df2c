//! Texture maps painted in space over any unwrapped surface: no seam shows, and any organ that a
//! user loads gets tissue.
//!
//! Each texel is carried to its place on the surface; colours, relief and depths are functions of
//! that place ([`tissue`]) and of vessels grown over the surface ([`vessel`]). Sizes in these
//! functions are those of the bundled organ of the same kind: a surface of another size or unit is
//! painted as if scaled to it. Results do not depend on the number of threads.

mod canvas;
mod own;
mod relief;
mod tissue;
mod vessel;

use super::SurfaceMesh;
use super::organ::{Features, Organ};
use canvas::Canvas;
use glam::Vec3;
use image::{DynamicImage, Rgba, RgbaImage};
pub use own::{OwnPictures, lay_over};
use rayon::prelude::*;

/// What a surface is painted as.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq, serde::Serialize, serde::Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Tissue {
    #[default]
    Liver,
    Heart,
    Kidney,
    Spleen,
}

impl Tissue {
    /// Every tissue.
    pub const ALL: [Self; 4] = [Self::Liver, Self::Heart, Self::Kidney, Self::Spleen];

    /// Name in scene files.
    pub fn name(self) -> &'static str {
        match self {
            Self::Liver => "liver",
            Self::Heart => "heart",
            Self::Kidney => "kidney",
            Self::Spleen => "spleen",
        }
    }

    /// Longest extent of an organ of this tissue [cm]: sets the scale of the pattern.
    fn extent_cm(self) -> f32 {
        match self {
            Self::Liver => 22.0,
            Self::Heart | Self::Kidney | Self::Spleen => 12.0,
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
    /// red ≤ green ≤ blue ≤ alpha; of layers 5 to 8 in a second picture. Eight bits a channel, or more. Of what is
    /// painted layer 1 is the capsule, layer 3 holds the vessels: thick where one runs, thin elsewhere.
    pub layers: Vec<DynamicImage>,
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
        Organ::Kidney => Tissue::Kidney,
        Organ::Spleen => Tissue::Spleen,
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
        layers: vec![DynamicImage::ImageRgba8(image(5.0, &|dab, _| dab.depths))],
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::unwrap::unwrap;
    use glam::Vec2;

    /// An octahedron cut finer three times and blown up to a ball of 10 cm.
    fn ball() -> SurfaceMesh {
        let mut points = vec![Vec3::X, Vec3::Y, Vec3::Z, -Vec3::X, -Vec3::Y, -Vec3::Z];
        let mut triangles = vec![
            [0, 1, 2],
            [1, 3, 2],
            [3, 4, 2],
            [4, 0, 2],
            [1, 0, 5],
            [3, 1, 5],
            [4, 3, 5],
            [0, 4, 5_u32],
        ];
        for _ in 0..3 {
            let mut finer = Vec::new();
            for [a, b, c] in triangles {
                let mut middle = |p: u32, q: u32| {
                    let m = (points[p as usize] + points[q as usize]).normalize();
                    points.iter().position(|&x| x == m).unwrap_or_else(|| {
                        points.push(m);
                        points.len() - 1
                    }) as u32
                };
                let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
                finer.extend([[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]);
            }
            triangles = finer;
        }
        let points: Vec<Vec3> = points.iter().map(|p| p.normalize() * 0.05).collect();
        unwrap(&points, &triangles)
    }

    /// Colour between the texels, from 0 to 255.
    fn fetch(image: &RgbaImage, uv: Vec2) -> Vec3 {
        let at = uv * image.width() as f32 - 0.5;
        let (base, f) = (at.floor(), at - at.floor());
        let texel = |dx: f32, dy: f32| {
            let most = image.width() as f32 - 1.0;
            let p = (base + Vec2::new(dx, dy)).clamp(Vec2::ZERO, Vec2::splat(most));
            let Rgba([r, g, b, _]) = *image.get_pixel(p.x as u32, p.y as u32);
            Vec3::new(f32::from(r), f32::from(g), f32::from(b))
        };
        texel(0.0, 0.0)
            .lerp(texel(1.0, 0.0), f.x)
            .lerp(texel(0.0, 1.0).lerp(texel(1.0, 1.0), f.x), f.y)
    }

    /// Mean difference of the colours that the vertices of one point see.
    fn seam(mesh: &SurfaceMesh, image: &RgbaImage) -> f32 {
        let first = mesh.first_vertex_of_point();
        let differences: Vec<f32> = (0..mesh.uvs.len())
            .filter(|&v| first[mesh.point_of[v] as usize] != v as u32)
            .map(|v| {
                let other = first[mesh.point_of[v] as usize] as usize;
                (fetch(image, mesh.uvs[v]) - fetch(image, mesh.uvs[other])).length()
            })
            .collect();
        assert!(differences.len() > 10, "the map has seams");
        differences.iter().sum::<f32>() / differences.len() as f32
    }

    #[test]
    fn colours_agree_on_both_sides_of_a_seam() {
        let mesh = ball();
        for tissue in Tissue::ALL {
            let maps = paint(&mesh, tissue, 512);
            // Texels of both sides do not lie on each other, so noise of their size differs a
            // little: measured 3 to 6 of 255.
            for image in [&maps.outer, &maps.inner] {
                let difference = seam(&mesh, image);
                assert!(difference < 9.0, "{} {difference}", tissue.name());
            }
        }
    }

    #[test]
    fn seam_check_rejects_a_picture_shifted_by_a_quarter() {
        let mesh = ball();
        let maps = paint(&mesh, Tissue::Heart, 256);
        let shifted = RgbaImage::from_fn(256, 256, |x, y| {
            *maps.outer.get_pixel((x + 64) % 256, (y + 32) % 256)
        });
        assert!(seam(&mesh, &shifted) > 2.0 * seam(&mesh, &maps.outer));
    }

    #[test]
    fn layers_lie_below_each_other_everywhere() {
        let mesh = ball();
        for tissue in Tissue::ALL {
            let maps = paint(&mesh, tissue, 128);
            for Rgba(depths) in maps.layers[0].to_rgba8().pixels() {
                assert!(depths.is_sorted() && depths[0] > 0, "{depths:?}");
            }
        }
    }

    #[test]
    fn maps_have_the_same_bits_on_one_and_four_threads() {
        let mesh = ball();
        let on = |threads: usize| {
            rayon::ThreadPoolBuilder::new()
                .num_threads(threads)
                .build()
                .expect("threads can be started")
                .install(|| paint(&mesh, Tissue::Liver, 128))
        };
        assert_eq!(on(1), on(4));
    }

    #[test]
    fn painted_border_is_as_wide_as_promised() {
        let mesh = ball();
        let canvas = Canvas::new(&mesh, 256, 22.0);
        let size = 256_i32;
        // A vertex lies up to a texel from the nearest centre that a triangle covers.
        let reach = GUTTER_PX as i32 - 2;
        for uv in &mesh.uvs {
            let at = (*uv * size as f32).as_ivec2();
            for (dx, dy) in [(reach, 0), (-reach, 0), (0, reach), (0, -reach)] {
                let (x, y) = (at.x + dx, at.y + dy);
                if (0..size).contains(&x) && (0..size).contains(&y) {
                    assert!(canvas.triangle((y * size + x) as u32).is_some());
                }
            }
        }
    }

    #[test]
    fn surfaces_of_any_unit_get_the_same_picture() {
        let mesh = ball();
        let mut large = mesh.clone();
        // A power of two, so that scaling back is exact.
        large.points.iter_mut().for_each(|p| *p *= 1024.0);
        assert_eq!(
            paint(&mesh, Tissue::Liver, 64),
            paint(&large, Tissue::Liver, 64)
        );
    }

    #[test]
    fn surfaces_without_extent_or_triangles_are_painted_too() {
        let maps = paint(&SurfaceMesh::default(), Tissue::Liver, 8);
        assert_eq!(maps.normal.get_pixel(3, 3), &Rgba([128, 128, 255, 255]));
        let spot = unwrap(&[Vec3::ONE; 3], &[[0, 1, 2]]);
        assert_eq!(paint(&spot, Tissue::Heart, 8).size_px, 8);
    }
}
