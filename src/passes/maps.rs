//! The texture maps of a surface on the GPU, with mipmaps.

use crate::geom::paint::TissueMaps;
use crate::gpu::Gpu;
use crate::optics::noise;
use crate::optics::tone::linear_from_srgb;
use crate::scene::Noise;
use half::f16;
use image::{DynamicImage, RgbaImage};

/// Textures of four layers each that the shaders have room for.
pub const LAYER_MAPS_MAX: usize = 2;

/// Levels of detail of a map: further ones would mix charts of the atlas.
pub const LEVELS: usize = 4;

/// A map at each level of detail. A frame binds the one level that suits it: a software adapter reads a texture that has no
/// other a fifth faster.
pub struct Leveled([wgpu::TextureView; LEVELS]);

impl Leveled {
    /// The map at `level`, 0 the finest.
    ///
    /// # Panics
    ///
    /// If `level` is not below [`LEVELS`].
    pub fn at(&self, level: usize) -> &wgpu::TextureView {
        &self.0[level]
    }
}

/// The level at which a texel is about as large as `texels` of the finest.
pub fn level_for(texels: f32) -> usize {
    texels
        .max(1e-6)
        .log2()
        .round()
        .clamp(0.0, (LEVELS - 1) as f32) as usize
}

/// Views of the maps, and how they are sampled.
pub struct Maps {
    /// Square roots of the linear colour of the outer layer, opacity in alpha.
    pub outer: Leveled,
    /// Tangent-space normals.
    pub normal: Leveled,
    /// Square roots of the linear colour of the deep tissue.
    pub inner: Leveled,
    /// Lower boundaries of layers 1 to 4, as shares of the deepest, and of layers 5 to 8; of two views the second is
    /// the first where there are no more than four.
    pub layers: [wgpu::TextureView; LAYER_MAPS_MAX],
    /// Clouds that move the march, where a scene asks for them.
    pub noise: Option<wgpu::TextureView>,
    /// Linear.
    pub sampler: wgpu::Sampler,
}

impl Maps {
    /// Uploads `maps`, and the clouds if `noise` is made of them.
    pub fn new(gpu: &Gpu, maps: &TissueMaps, noise: Noise) -> Self {
        Self {
            outer: upload_levels(gpu, "outer map", square_roots(&maps.outer)),
            normal: upload_levels(gpu, "normal map", maps.normal.clone()),
            inner: upload_levels(gpu, "inner map", square_roots(&maps.inner)),
            layers: std::array::from_fn(|k| {
                let last = maps.layers.len() - 1;
                upload_depths(gpu, &maps.layers[k.min(last)])
            }),
            noise: (noise == Noise::Clouds).then(|| {
                let side = noise::SIZE as u32;
                let clouds = noise::clouds();
                let picture = RgbaImage::from_fn(side, side, |x, y| {
                    let [r, g] = clouds[(y * side + x) as usize];
                    image::Rgba([r, g, 0, 255])
                });
                upload(gpu, "noise", &picture)
            }),
            sampler: gpu.device.create_sampler(&wgpu::SamplerDescriptor {
                label: Some("maps"),
                mag_filter: wgpu::FilterMode::Linear,
                min_filter: wgpu::FilterMode::Linear,
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

/// Depths of layers as exactly as they come: bytes, or half floats of what has more bits. They are read at their
/// finest level alone.
fn upload_depths(gpu: &Gpu, image: &DynamicImage) -> wgpu::TextureView {
    match image {
        DynamicImage::ImageRgba16(_)
        | DynamicImage::ImageRgb16(_)
        | DynamicImage::ImageRgba32F(_)
        | DynamicImage::ImageRgb32F(_) => {
            let fine = image.to_rgba32f();
            let halves: Vec<f16> = fine.iter().map(|&v| f16::from_f32(v)).collect();
            let texture = texture(
                gpu,
                "layer map",
                fine.dimensions().into(),
                1,
                wgpu::TextureFormat::Rgba16Float,
            );
            write_level(
                gpu,
                &texture,
                0,
                fine.width(),
                bytemuck::cast_slice(&halves),
            );
            texture.create_view(&wgpu::TextureViewDescriptor::default())
        }
        _ => upload(gpu, "layer map", &image.to_rgba8()),
    }
}

fn texture(
    gpu: &Gpu,
    label: &str,
    [width, height]: [u32; 2],
    levels: u32,
    format: wgpu::TextureFormat,
) -> wgpu::Texture {
    gpu.device.create_texture(&wgpu::TextureDescriptor {
        label: Some(label),
        size: wgpu::Extent3d {
            width,
            height,
            depth_or_array_layers: 1,
        },
        mip_level_count: levels,
        sample_count: 1,
        dimension: wgpu::TextureDimension::D2,
        format,
        usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
        view_formats: &[],
    })
}

/// Fills a level that is `width` wide [px].
fn write_level(gpu: &Gpu, texture: &wgpu::Texture, level: u32, width: u32, bytes: &[u8]) {
    let texel = texture
        .format()
        .block_copy_size(None)
        .expect("a colour format has a size");
    gpu.queue.write_texture(
        wgpu::TexelCopyTextureInfo {
            mip_level: level,
            ..texture.as_image_copy()
        },
        bytes,
        wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(texel * width),
            rows_per_image: None,
        },
        wgpu::Extent3d {
            width,
            height: bytes.len() as u32 / (texel * width),
            depth_or_array_layers: 1,
        },
    );
}

/// A texture of one level.
fn upload(gpu: &Gpu, label: &str, image: &RgbaImage) -> wgpu::TextureView {
    let texture = texture(
        gpu,
        label,
        image.dimensions().into(),
        1,
        wgpu::TextureFormat::Rgba8Unorm,
    );
    write_level(gpu, &texture, 0, image.width(), image);
    texture.create_view(&wgpu::TextureViewDescriptor::default())
}

/// A texture and each half, quarter … of it; of a picture too small for that the last level stands for those beyond.
fn upload_levels(gpu: &Gpu, label: &str, image: RgbaImage) -> Leveled {
    let levels = LEVELS.min(1 + image.width().min(image.height()).ilog2() as usize);
    let texture = texture(
        gpu,
        label,
        image.dimensions().into(),
        levels as u32,
        wgpu::TextureFormat::Rgba8Unorm,
    );
    let mut level_image = image;
    for level in 0..levels as u32 {
        if level > 0 {
            level_image = halved(&level_image);
        }
        write_level(gpu, &texture, level, level_image.width(), &level_image);
    }
    Leveled(std::array::from_fn(|level| {
        texture.create_view(&wgpu::TextureViewDescriptor {
            label: Some(label),
            base_mip_level: level.min(levels - 1) as u32,
            mip_level_count: Some(1),
            ..Default::default()
        })
    }))
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
