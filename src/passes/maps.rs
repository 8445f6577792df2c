//! The texture maps of a surface on the GPU, with mipmaps.

use crate::geom::paint::TissueMaps;
use crate::gpu::Gpu;
use crate::optics::tone::linear_from_srgb;
use image::RgbaImage;

/// Views of the four maps, and how they are sampled.
pub struct Maps {
    /// Square roots of the linear colour of the outer layer, opacity in alpha.
    pub outer: wgpu::TextureView,
    /// Tangent-space normals.
    pub normal: wgpu::TextureView,
    /// Square roots of the linear colour of the deep tissue.
    pub inner: wgpu::TextureView,
    /// Lower boundaries of the four layers, as shares of the deepest.
    pub layers: wgpu::TextureView,
    /// Linear, with mipmaps.
    pub sampler: wgpu::Sampler,
}

impl Maps {
    /// Uploads `maps`.
    pub fn new(gpu: &Gpu, maps: &TissueMaps) -> Self {
        Self {
            outer: upload(gpu, "outer map", square_roots(&maps.outer)),
            normal: upload(gpu, "normal map", maps.normal.clone()),
            inner: upload(gpu, "inner map", square_roots(&maps.inner)),
            layers: upload(gpu, "layer map", maps.layers.clone()),
            sampler: gpu.device.create_sampler(&wgpu::SamplerDescriptor {
                label: Some("maps"),
                mag_filter: wgpu::FilterMode::Linear,
                min_filter: wgpu::FilterMode::Linear,
                // The nearest level: on a software adapter two levels cost twice the time.
                mipmap_filter: wgpu::MipmapFilterMode::Nearest,
                ..Default::default()
            }),
        }
    }
}

/// sRGB colours as square roots of linear light: a software adapter undoes those for a multiplication,
/// where an sRGB texture costs it a polynomial for each of four texels.
fn square_roots(image: &RgbaImage) -> RgbaImage {
    let table: Vec<u8> = (0..=255u32)
        .map(|encoded| {
            let linear = linear_from_srgb(encoded as f32 / 255.0);
            (255.0 * linear.sqrt()).round() as u8
        })
        .collect();
    let mut image = image.clone();
    for texel in image.pixels_mut() {
        for channel in &mut texel.0[..3] {
            *channel = table[*channel as usize];
        }
    }
    image
}

fn upload(gpu: &Gpu, label: &str, image: RgbaImage) -> wgpu::TextureView {
    // Four levels: further ones would mix charts of the atlas.
    let levels = 4.min(1 + image.width().min(image.height()).ilog2());
    let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some(label),
        size: wgpu::Extent3d {
            width: image.width(),
            height: image.height(),
            depth_or_array_layers: 1,
        },
        mip_level_count: levels,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format: wgpu::TextureFormat::Rgba8Unorm,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    });
    let mut level_image = image;
    for level in 0..levels {
        if level > 0 {
            level_image = halved(&level_image);
        }
        gpu.queue.write_texture(
            wgpu::TexelCopyTextureInfo {
                mip_level: level,
                ..texture.as_image_copy()
            },
            &level_image,
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(4 * level_image.width()),
                rows_per_image: None,
            },
            wgpu::Extent3d {
                width: level_image.width(),
                height: level_image.height(),
                depth_or_array_layers: 1,
            },
        );
    }
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}

/// Half the size: the mean of each 2 x 2 texels, as they are encoded.
fn halved(image: &RgbaImage) -> RgbaImage {
    let (width, height) = ((image.width() / 2).max(1), (image.height() / 2).max(1));
    RgbaImage::from_fn(width, height, |x, y| {
        let mut sum = [0u32; 4];
        for (dx, dy) in [(0, 0), (1, 0), (0, 1), (1, 1)] {
            let texel = image.get_pixel(
                (2 * x + dx).min(image.width() - 1),
                (2 * y + dy).min(image.height() - 1),
            );
            for (sum, value) in sum.iter_mut().zip(texel.0) {
                *sum += u32::from(value);
            }
        }
        image::Rgba(sum.map(|s| ((s + 2) / 4) as u8))
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_halved_image_keeps_its_mean() {
        let image = RgbaImage::from_fn(4, 4, |x, y| image::Rgba([(16 * (x + y)) as u8, 8, 0, 255]));
        let half = halved(&image);
        assert_eq!(half.dimensions(), (2, 2));
        assert_eq!(half.get_pixel(0, 0).0, [16, 8, 0, 255]);
    }
}
