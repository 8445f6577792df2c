//! The pictures that come with a surface, laid over its painted tissue.

use super::TissueMaps;
use super::canvas::{Canvas, barycentric};
use crate::geom::SurfaceMesh;
use glam::{Vec2, Vec3};
use image::RgbImage;
use image::imageops::{FilterType, resize};

/// How much of a picture's colour the tissue below has, too: light that comes from there has been through both.
const INNER_SHARE: f32 = 0.5;

/// The pictures that come with a surface.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct OwnPictures {
    /// sRGB colour.
    pub color: Option<RgbImage>,
    /// Normals in tangent space as glTF has them, for the texture coordinates that the surface has now.
    pub normal: Option<RgbImage>,
    /// Where the corners of each triangle lie in [`OwnPictures::color`], which repeats outside the unit
    /// square; empty if that is where the surface has them now.
    pub corners: Vec<[Vec2; 3]>,
}

/// Replaces colour and relief of `maps` by those of `own`, as far as there are any. Opacity and depths
/// of layers stay as painted.
///
/// # Panics
///
/// If there are corners, but not three for each triangle of `mesh`.
pub fn lay_over(maps: &mut TissueMaps, mesh: &SurfaceMesh, own: &OwnPictures) {
    let size_px = maps.size_px;
    let fitted = |picture: &RgbImage| resize(picture, size_px, size_px, FilterType::Triangle);
    if let Some(normal) = &own.normal {
        maps.normal = image::DynamicImage::ImageRgb8(fitted(normal)).into_rgba8();
    }
    let Some(color) = &own.color else {
        return;
    };
    let color = if own.corners.is_empty() {
        fitted(color)
    } else {
        assert_eq!(
            own.corners.len(),
            mesh.triangles.len(),
            "corners of each triangle"
        );
        carried_over(mesh, &fitted(color), &own.corners)
    };
    let texels = color.pixels().zip(maps.outer.pixels_mut());
    for ((color, outer), inner) in texels.zip(maps.inner.pixels_mut()) {
        for k in 0..3 {
            let (own, painted) = (f32::from(color[k]), f32::from(inner[k]));
            outer[k] = color[k];
            inner[k] = (painted + INNER_SHARE * (own - painted)).round() as u8;
        }
    }
}

/// `picture`, in which the triangles have these `corners`, for the texture coordinates of `mesh`.
fn carried_over(mesh: &SurfaceMesh, picture: &RgbImage, corners: &[[Vec2; 3]]) -> RgbImage {
    let size_px = picture.width();
    let canvas = Canvas::new(mesh, size_px, 1.0);
    RgbImage::from_fn(size_px, size_px, |x, y| {
        let at = Vec2::new(x as f32, y as f32) + 0.5;
        let place = canvas.triangle(y * size_px + x).map(|triangle| {
            let from = corners[triangle as usize];
            match barycentric(at, canvas.corners_px(mesh, triangle)) {
                Some(weights) => (0..3).map(|k| weights[k] * from[k]).sum(),
                None => from[0],
            }
        });
        match place {
            Some(place) => image::Rgb(repeated(picture, place).to_array().map(|c| c.round() as u8)),
            None => *picture.get_pixel(x, y),
        }
    })
}

/// Colour at `uv` from 0 to 255, between the texels of a picture that repeats.
fn repeated(picture: &RgbImage, uv: Vec2) -> Vec3 {
    let size = Vec2::new(picture.width() as f32, picture.height() as f32);
    let at = (uv - uv.floor()) * size - 0.5;
    let (base, share) = (at.floor(), at - at.floor());
    let texel = |dx: f32, dy: f32| {
        let side = |value: f32, size: f32| value.rem_euclid(size).min(size - 1.0) as u32;
        let place = base + Vec2::new(dx, dy);
        let texel = picture.get_pixel(side(place.x, size.x), side(place.y, size.y));
        Vec3::from_array(texel.0.map(f32::from))
    };
    let above = texel(0.0, 0.0).lerp(texel(1.0, 0.0), share.x);
    above.lerp(texel(0.0, 1.0).lerp(texel(1.0, 1.0), share.x), share.y)
}

#[cfg(test)]
mod tests {
    use super::super::{Tissue, paint};
    use super::*;

    /// A square in two triangles that fills the texture.
    fn square() -> SurfaceMesh {
        let uvs = [Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y];
        SurfaceMesh {
            points: uvs.iter().map(|uv| uv.extend(0.0)).collect(),
            point_of: vec![0, 1, 2, 3],
            uvs: uvs.to_vec(),
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        }
    }

    /// Red grows with u, green with v.
    fn ramp() -> RgbImage {
        RgbImage::from_fn(64, 64, |x, y| image::Rgb([4 * x as u8, 4 * y as u8, 9]))
    }

    fn laid(corners: Vec<[Vec2; 3]>) -> TissueMaps {
        let mut maps = paint(&square(), Tissue::Liver, 64);
        let own = OwnPictures {
            color: Some(ramp()),
            normal: None,
            corners,
        };
        lay_over(&mut maps, &square(), &own);
        maps
    }

    #[test]
    fn picture_takes_the_place_of_colour_and_leaves_opacity_and_layers() {
        let painted = paint(&square(), Tissue::Liver, 64);
        let maps = laid(Vec::new());
        assert_eq!(maps.outer.get_pixel(40, 12).0[..3], [160, 48, 9]);
        assert_eq!(
            maps.outer.get_pixel(40, 12)[3],
            painted.outer.get_pixel(40, 12)[3]
        );
        assert_eq!(maps.layers, painted.layers);
        assert_eq!(maps.normal, painted.normal);
    }

    #[test]
    fn picture_is_carried_over_to_other_texture_coordinates() {
        // In the picture the square lies turned by a quarter, and one square further on.
        let turned = |uv: Vec2| Vec2::new(uv.y, 1.0 - uv.x) + Vec2::new(1.0, 0.0);
        let uvs = square().uvs;
        let corners = (square().triangles.iter())
            .map(|t| t.map(|vertex| turned(uvs[vertex as usize])))
            .collect();
        let maps = laid(corners);
        for (x, y) in [(10, 20), (40, 50), (33, 5)] {
            let texel = maps.outer.get_pixel(x, y);
            let expected = [4 * y as u8, 4 * (63 - x as u8)];
            for k in 0..2 {
                assert!(texel[k].abs_diff(expected[k]) <= 2, "{x} {y}: {texel:?}");
            }
        }
    }
}
