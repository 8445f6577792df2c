//! The dark theatre behind the tissue, painted once for a picture's size.

use super::draw::Target;
use crate::gpu::Gpu;

/// sRGB of the drape in the lamp's pool of light, and in the corners.
const POOL: [f32; 3] = [40.0, 58.0, 62.0];
const CORNER: [f32; 3] = [9.0, 14.0, 17.0];

/// A texture of `size` [px] with the backdrop, in the picture's format.
pub fn backdrop(gpu: &Gpu, size: [u32; 2]) -> Target {
    let target = Target::new(gpu, "backdrop", size, super::PICTURE_FORMAT);
    gpu.queue.write_texture(
        target.texture.as_image_copy(),
        &pixels(size),
        wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(4 * size[0]),
            rows_per_image: None,
        },
        target.texture.size(),
    );
    target
}

/// RGBA bytes, row by row from the top: a pool of light that fades to the corners.
fn pixels([width, height]: [u32; 2]) -> Vec<u8> {
    let mut bytes = Vec::with_capacity(4 * width as usize * height as usize);
    for y in 0..height {
        for x in 0..width {
            let dx = (x as f32 + 0.5 - 0.5 * width as f32) / height as f32;
            let dy = (y as f32 + 0.5) / height as f32 - 0.44;
            let light = (-2.6 * (dx * dx + 1.2 * dy * dy)).exp();
            // So dark a slope shows its steps in 8 bits; half a step of noise hides them.
            let noise = grain(x, y) - 0.5;
            for channel in 0..3 {
                let value = CORNER[channel] + light * (POOL[channel] - CORNER[channel]);
                bytes.push((value + noise + 0.5) as u8);
            }
            bytes.push(255);
        }
    }
    bytes
}

/// A fixed number from 0 to 1 for each pixel, well spread among neighbours.
///
/// Source: Jimenez, "Next Generation Post Processing in Call of Duty", SIGGRAPH 2014 (interleaved gradient noise).
fn grain(x: u32, y: u32) -> f32 {
    let slope = 0.067_110_56 * x as f32 + 0.005_837_15 * y as f32;
    (52.982_918 * slope.fract()).fract()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_backdrop_is_brightest_near_the_middle_and_darkest_in_the_corners() {
        let (width, height) = (80, 60);
        let bytes = pixels([width, height]);
        let green = |x: u32, y: u32| bytes[4 * (y * width + x) as usize + 1];
        assert!(green(40, 26) > 50, "{}", green(40, 26));
        for corner in [(0, 0), (79, 0), (0, 59), (79, 59)] {
            assert!(green(corner.0, corner.1) < 30, "{corner:?}");
        }
    }
}
