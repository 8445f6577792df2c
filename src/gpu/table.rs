//! Lists in textures, for kernels that look up many scattered entries.
//!
//! A texel is fetched in one step where a storage buffer is read word by word with a check each:
//! on a software driver (llvmpipe) a table is four times as fast, on a GPU it goes through a cache.

use super::{Gpu, GpuError};
use bytemuck::Pod;

/// Texels of a row; the same in `shaders/common.wgsl`, `fn entry`.
const ROW: usize = 1024;

/// What one entry of a table is.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Entry {
    /// `vec4f`: `texture_2d<f32>`, bound as [`Binding::Unfiltered`](super::Binding::Unfiltered); a
    /// kernel may write it, as [`Binding::Image`](super::Binding::Image).
    Floats,
    /// `vec2u`: `texture_2d<u32>`, bound as [`Binding::Integers`](super::Binding::Integers).
    Pairs,
    /// `u32`: as pairs; a kernel may write it.
    Words,
    /// `vec4u`: as pairs.
    Quads,
}

impl Entry {
    /// The format of the texels.
    pub fn format(self) -> wgpu::TextureFormat {
        match self {
            Self::Floats => wgpu::TextureFormat::Rgba32Float,
            Self::Pairs => wgpu::TextureFormat::Rg32Uint,
            Self::Words => wgpu::TextureFormat::R32Uint,
            Self::Quads => wgpu::TextureFormat::Rgba32Uint,
        }
    }

    fn bytes(self) -> usize {
        match self {
            Self::Floats | Self::Quads => 16,
            Self::Pairs => 8,
            Self::Words => 4,
        }
    }
}

/// A list in a texture: entry `i` is texel `(i % 1024, i / 1024)`.
pub struct Table {
    texture: wgpu::Texture,
    entry: Entry,
    /// What a kernel binds.
    pub view: wgpu::TextureView,
}

impl Table {
    /// A table that holds `content`; one row at least.
    ///
    /// # Errors
    ///
    /// [`GpuError::BufferTooLarge`] if the adapter has no texture of that many rows.
    ///
    /// # Panics
    ///
    /// If `T` does not have the size of an `entry`.
    pub fn new<T: Pod>(
        gpu: &Gpu,
        label: &str,
        entry: Entry,
        content: &[T],
    ) -> Result<Self, GpuError> {
        let rows = content.len().div_ceil(ROW).max(1);
        let rows_max = gpu.device.limits().max_texture_dimension_2d as usize;
        if rows > rows_max {
            return Err(GpuError::BufferTooLarge {
                what: label.to_owned(),
                bytes: (rows * ROW * entry.bytes()) as u64,
                limit: (rows_max * ROW * entry.bytes()) as u64,
            });
        }
        let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some(label),
            size: wgpu::Extent3d {
                width: ROW as u32,
                height: rows as u32,
                depth_or_array_layers: 1,
            },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: entry.format(),
            usage: wgpu::TextureUsages::TEXTURE_BINDING
                | wgpu::TextureUsages::STORAGE_BINDING
                | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let table = Self {
            view: texture.create_view(&wgpu::TextureViewDescriptor::default()),
            texture,
            entry,
        };
        table.write(gpu, content);
        Ok(table)
    }

    /// Replaces the first entries before the next submitted frame.
    ///
    /// # Panics
    ///
    /// If `T` does not have the size of an entry, or there are more than the table has room for.
    pub fn write<T: Pod>(&self, gpu: &Gpu, content: &[T]) {
        assert_eq!(size_of::<T>(), self.entry.bytes(), "one value an entry");
        let (whole_rows, rest) = content.split_at(content.len() / ROW * ROW);
        let height = (whole_rows.len() / ROW) as u32;
        self.write_rows(gpu, 0, ROW, height, bytemuck::cast_slice(whole_rows));
        self.write_rows(gpu, height, rest.len(), 1, bytemuck::cast_slice(rest));
    }

    fn write_rows(&self, gpu: &Gpu, first: u32, width: usize, height: u32, bytes: &[u8]) {
        if bytes.is_empty() {
            return;
        }
        gpu.queue.write_texture(
            wgpu::TexelCopyTextureInfo {
                origin: wgpu::Origin3d {
                    x: 0,
                    y: first,
                    z: 0,
                },
                ..self.texture.as_image_copy()
            },
            bytes,
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some((width * self.entry.bytes()) as u32),
                rows_per_image: None,
            },
            wgpu::Extent3d {
                width: width as u32,
                height,
                depth_or_array_layers: 1,
            },
        );
    }
}
