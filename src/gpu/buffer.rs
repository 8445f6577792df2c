//! Buffers made from slices, and memory read back into vectors.

use super::{Gpu, GpuError};
use bytemuck::Pod;
use wgpu::util::DeviceExt;

/// A storage buffer that holds `content`; at least one element long, since an empty one can't be bound.
///
/// Its contents can be copied out and in, and drawn from as vertices or indices.
///
/// # Errors
///
/// [`GpuError::BufferTooLarge`] if the adapter can't bind it.
pub fn storage<T: Pod>(gpu: &Gpu, label: &str, content: &[T]) -> Result<wgpu::Buffer, GpuError> {
    let limit = gpu.device.limits().max_storage_buffer_binding_size;
    let bytes = size_of_val(content) as u64;
    if bytes > limit {
        return Err(GpuError::BufferTooLarge {
            what: label.to_owned(),
            bytes,
            limit,
        });
    }
    let empty = [T::zeroed()];
    Ok(gpu
        .device
        .create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some(label),
            contents: bytemuck::cast_slice(if content.is_empty() { &empty } else { content }),
            usage: wgpu::BufferUsages::STORAGE
                | wgpu::BufferUsages::COPY_SRC
                | wgpu::BufferUsages::COPY_DST
                | wgpu::BufferUsages::VERTEX
                | wgpu::BufferUsages::INDEX
                | wgpu::BufferUsages::INDIRECT,
        }))
}

/// A uniform buffer that holds `content` and can be written anew.
pub fn uniform<T: Pod>(gpu: &Gpu, label: &str, content: &T) -> wgpu::Buffer {
    gpu.device
        .create_buffer_init(&wgpu::util::BufferInitDescriptor {
            label: Some(label),
            contents: bytemuck::bytes_of(content),
            usage: wgpu::BufferUsages::UNIFORM | wgpu::BufferUsages::COPY_DST,
        })
}

/// The contents of `buffer`, waited for.
///
/// # Errors
///
/// [`GpuError::ReadBack`] if the memory can't be mapped.
pub fn read_buffer<T: Pod>(gpu: &Gpu, buffer: &wgpu::Buffer) -> Result<Vec<T>, GpuError> {
    let back = ReadBack::new(gpu, buffer.size());
    let mut encoder = gpu.encoder();
    back.copy(buffer, &mut encoder);
    gpu.queue.submit([encoder.finish()]);
    back.read(gpu)
}

/// A place where a buffer's content is kept for the CPU: the copy can be part of a frame, which need not be waited for
/// twice then.
pub struct ReadBack {
    staging: wgpu::Buffer,
}

impl ReadBack {
    /// Room for `size` bytes.
    pub fn new(gpu: &Gpu, size: u64) -> Self {
        Self {
            staging: staging(gpu, size),
        }
    }

    /// Adds the copy of all of `buffer` to `encoder`.
    pub fn copy(&self, buffer: &wgpu::Buffer, encoder: &mut wgpu::CommandEncoder) {
        encoder.copy_buffer_to_buffer(buffer, 0, &self.staging, 0, buffer.size());
    }

    /// What was copied last, waited for.
    ///
    /// # Errors
    ///
    /// [`GpuError::ReadBack`] if the memory can't be mapped.
    pub fn read<T: Pod>(&self, gpu: &Gpu) -> Result<Vec<T>, GpuError> {
        Ok(bytemuck::pod_collect_to_vec(&map(gpu, &self.staging)?))
    }
}

/// Pixels of an 8-bit RGBA texture, row by row from the top, 4 bytes each.
///
/// # Errors
///
/// [`GpuError::ReadBack`] if the memory can't be mapped.
pub fn read_texture_rgba8(gpu: &Gpu, texture: &wgpu::Texture) -> Result<Vec<u8>, GpuError> {
    read_texture(gpu, texture, 4)
}

/// Pixels of a half-float RGBA texture as f32, row by row from the top, 4 values each.
///
/// # Errors
///
/// [`GpuError::ReadBack`] if the memory can't be mapped.
pub fn read_texture_rgba16f(gpu: &Gpu, texture: &wgpu::Texture) -> Result<Vec<f32>, GpuError> {
    let bytes = read_texture(gpu, texture, 8)?;
    let halves: Vec<half::f16> = bytemuck::pod_collect_to_vec(&bytes);
    Ok(halves.into_iter().map(f32::from).collect())
}

/// Depths of a 32-bit float depth texture, row by row from the top.
///
/// # Errors
///
/// [`GpuError::ReadBack`] if the memory can't be mapped.
pub fn read_texture_depth(gpu: &Gpu, texture: &wgpu::Texture) -> Result<Vec<f32>, GpuError> {
    Ok(bytemuck::pod_collect_to_vec(&read_texture(
        gpu, texture, 4,
    )?))
}

/// Words of a texture of four u32 a texel, row by row.
///
/// # Errors
///
/// [`GpuError::ReadBack`] if it can't be mapped.
pub fn read_texture_words(gpu: &Gpu, texture: &wgpu::Texture) -> Result<Vec<[u32; 4]>, GpuError> {
    Ok(bytemuck::pod_collect_to_vec(&read_texture(
        gpu, texture, 16,
    )?))
}

fn read_texture(
    gpu: &Gpu,
    texture: &wgpu::Texture,
    bytes_per_pixel: u32,
) -> Result<Vec<u8>, GpuError> {
    let row = texture.width() * bytes_per_pixel;
    let padded = row.next_multiple_of(wgpu::COPY_BYTES_PER_ROW_ALIGNMENT);
    let staging = staging(gpu, u64::from(padded) * u64::from(texture.height()));
    let mut encoder = gpu.encoder();
    encoder.copy_texture_to_buffer(
        texture.as_image_copy(),
        wgpu::TexelCopyBufferInfo {
            buffer: &staging,
            layout: wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(padded),
                rows_per_image: None,
            },
        },
        texture.size(),
    );
    gpu.queue.submit([encoder.finish()]);
    let bytes = map(gpu, &staging)?;
    Ok(bytes
        .chunks_exact(padded as usize)
        .flat_map(|line| &line[..row as usize])
        .copied()
        .collect())
}

fn staging(gpu: &Gpu, size: u64) -> wgpu::Buffer {
    gpu.device.create_buffer(&wgpu::BufferDescriptor {
        label: Some("read back"),
        size,
        usage: wgpu::BufferUsages::COPY_DST | wgpu::BufferUsages::MAP_READ,
        mapped_at_creation: false,
    })
}

fn map(gpu: &Gpu, staging: &wgpu::Buffer) -> Result<Vec<u8>, GpuError> {
    let (sender, receiver) = std::sync::mpsc::channel();
    staging.map_async(wgpu::MapMode::Read, .., move |result| {
        // The receiver lives until the result has come.
        let _ = sender.send(result);
    });
    gpu.wait();
    receiver
        .recv()
        .map_err(|e| GpuError::ReadBack(e.to_string()))?
        .map_err(|e| GpuError::ReadBack(e.to_string()))?;
    let bytes = staging
        .get_mapped_range(..)
        .map_err(|e| GpuError::ReadBack(e.to_string()))?
        .to_vec();
    staging.unmap();
    Ok(bytes)
}
