//! The light map of the gooey surface: drawn in texture space, then blurred.

use super::draw::{DepthUse, Draw, DrawKind, Target, cleared};
use super::mesh_buffers::MeshBuffers;
use super::tangents::Tangents;
use crate::gpu::{Binding, Gpu, GpuError, Timer, Wgsl, join, uniform};
use crate::optics::blur::{TAP_PAIRS, taps};
use glam::Vec3;

/// Format of the map: irradiance, and coverage in alpha.
const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;

/// Turn of the disc between two passes [rad]: neighbours of one pass are not those of the next.
const TURN: f32 = 0.5;

/// Irradiance in texture space and its blurs.
pub struct LightMap {
    draw: Draw,
    maps: [Target; 2],
    blurs: Vec<Blur>,
}

struct Blur {
    draw: Draw,
    knobs: wgpu::Buffer,
}

/// Mirror of `Blur` in `shaders/blur.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct BlurUniform {
    /// Offsets in texels; each is used with its opposite.
    pub taps: [[i32; 2]; TAP_PAIRS],
}

impl LightMap {
    /// Name of the texture-space draw in logs.
    pub const NAME: &'static str = "lightmap";
    /// Name of the blurs in logs.
    pub const BLUR_NAME: &'static str = "blur";
    /// The WGSL files of the texture-space draw, joined in this order.
    pub const WGSL: &'static [Wgsl] =
        crate::wgsl!["frame.wgsl", "film.wgsl", "light.wgsl", "lightmap.wgsl"];
    /// The WGSL files of a blur, joined in this order.
    pub const BLUR_WGSL: &'static [Wgsl] = crate::wgsl!["blur.wgsl"];

    /// Builds a map of `size_px` a side that is blurred `passes` times.
    ///
    /// # Errors
    ///
    /// [`GpuError::Shader`] if the WGSL does not compile on this adapter.
    #[allow(clippy::too_many_arguments)]
    pub fn new(
        gpu: &Gpu,
        size_px: u32,
        passes: u32,
        frame: &wgpu::Buffer,
        light_constants: &[(&'static str, f64)],
        mesh: &MeshBuffers,
        tangents: &Tangents,
        shadow_map: &wgpu::TextureView,
    ) -> Result<Self, GpuError> {
        let maps = [(); 2].map(|()| Target::new(gpu, Self::NAME, [size_px; 2], FORMAT));
        let draw = Draw::new(
            gpu,
            &DrawKind {
                pass: Self::NAME,
                parts: Self::WGSL,
                source: &join(Self::WGSL),
                vertex: "lightmap_vertex",
                attributes: &[],
                fragment: Some(("lightmap_fragment", &[FORMAT])),
                blend: None,
                depth: DepthUse::None,
                cull: None,
                constants: light_constants,
            },
            &[
                Binding::Uniform(frame),
                Binding::Read(&mesh.positions),
                Binding::Read(&mesh.point_of),
                Binding::Read(&mesh.uvs),
                Binding::Read(&tangents.normals),
                Binding::Depth(shadow_map),
            ],
        )?;
        let blurs = (0..passes)
            .map(|pass| Blur::new(gpu, &maps[pass as usize % 2].view))
            .collect::<Result<_, GpuError>>()?;
        Ok(Self { draw, maps, blurs })
    }

    /// The map after its last blur.
    pub fn view(&self) -> &wgpu::TextureView {
        &self.maps[self.blurs.len() % 2].view
    }

    /// Adds the draw and the blurs to `encoder`; `radius` is in shares of the unit square.
    pub fn record(
        &self,
        gpu: &Gpu,
        radius: f32,
        mesh: &MeshBuffers,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut Timer,
    ) {
        {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some(Self::NAME),
                color_attachments: &[cleared(&self.maps[0].view)],
                timestamp_writes: timer.render(Self::NAME),
                ..Default::default()
            });
            self.draw.set(&mut pass);
            mesh.draw(&mut pass);
        }
        let radius_px = radius * self.maps[0].texture.width() as f32;
        for (index, blur) in self.blurs.iter().enumerate() {
            let knobs = BlurUniform {
                taps: taps(radius_px, TURN * index as f32),
            };
            gpu.queue
                .write_buffer(&blur.knobs, 0, bytemuck::bytes_of(&knobs));
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some(Self::BLUR_NAME),
                color_attachments: &[cleared(&self.maps[(index + 1) % 2].view)],
                timestamp_writes: timer.render(Self::BLUR_NAME),
                ..Default::default()
            });
            blur.draw.set(&mut pass);
            pass.draw(0..3, 0..1);
        }
    }
}

impl Blur {
    fn new(gpu: &Gpu, source: &wgpu::TextureView) -> Result<Self, GpuError> {
        let knobs = uniform(
            gpu,
            LightMap::BLUR_NAME,
            &BlurUniform {
                taps: [[0; 2]; TAP_PAIRS],
            },
        );
        let draw = Draw::new(
            gpu,
            &DrawKind {
                pass: LightMap::BLUR_NAME,
                parts: LightMap::BLUR_WGSL,
                source: &join(LightMap::BLUR_WGSL),
                vertex: "blur_vertex",
                attributes: &[],
                fragment: Some(("blur_fragment", &[FORMAT])),
                blend: None,
                depth: DepthUse::None,
                cull: None,
                constants: &[],
            },
            &[Binding::Uniform(&knobs), Binding::Unfiltered(source)],
        )?;
        Ok(Self { draw, knobs })
    }
}
/// Mean length in texture space of a metre on the surface, from the areas of its triangles.
pub fn uv_per_m(mesh: &crate::geom::SurfaceMesh) -> f32 {
    let mut area_m2 = 0.0;
    let mut area_uv = 0.0;
    for (triangle, corners) in mesh.triangles.iter().enumerate() {
        let [a, b, c] = mesh
            .point_triangle(triangle)
            .map(|point| mesh.points[point as usize]);
        area_m2 += f64::from(Vec3::cross(b - a, c - a).length());
        let [p, q, r] = corners.map(|vertex| mesh.uvs[vertex as usize]);
        area_uv += f64::from((q - p).perp_dot(r - p).abs());
    }
    (area_uv / area_m2.max(1e-30)).sqrt() as f32
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::SurfaceMesh;
    use glam::Vec2;

    #[test]
    fn a_square_of_two_metres_on_half_the_map_has_a_quarter_a_metre() {
        let mesh = SurfaceMesh {
            points: vec![
                Vec3::ZERO,
                2.0 * Vec3::X,
                2.0 * Vec3::new(1.0, 1.0, 0.0),
                2.0 * Vec3::Y,
            ],
            point_of: vec![0, 1, 2, 3],
            uvs: vec![
                Vec2::ZERO,
                Vec2::new(0.5, 0.0),
                Vec2::splat(0.5),
                Vec2::new(0.0, 0.5),
            ],
            triangles: vec![[0, 1, 2], [0, 2, 3]],
        };
        assert!((uv_per_m(&mesh) - 0.25).abs() < 1e-6);
    }
}
