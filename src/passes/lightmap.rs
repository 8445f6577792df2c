//! The light map of the gooey surface: drawn in texture space, then blurred.

use super::diffusion::charts_at_rest;
use super::draw::{DepthUse, Draw, DrawKind, Target, cleared};
use super::maps::{Maps, level_for};
use super::mesh_buffers::MeshBuffers;
use super::tangents::Tangents;
use crate::geom::SurfaceMesh;
use crate::gpu::{Binding, Gpu, GpuError, Timer, Wgsl, join, uniform};
use crate::optics::blur::{TAP_PAIRS, taps};
use crate::scene::{SurfaceKind, SurfaceSection, UvMetric};
use glam::Vec3;

/// Format of the maps: irradiance, and the number of the chart or coverage in alpha; metric and thickness.
const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;

/// Side of a map that a scene says nothing of [px], at least and at most.
pub const SIZES_PX: [u32; 2] = [96, 256];
/// Texels on the radius of the blur of such a map.
const TEXELS_A_RADIUS: f32 = 2.0;

/// Turn of the disc between two passes [rad]: neighbours of one pass are not those of the next.
const TURN: f32 = 0.5;

/// What the light map is drawn from, made by other passes.
pub struct LightMapInputs<'a> {
    /// Camera, lights, knobs.
    pub frame: &'a wgpu::Buffer,
    /// Values of the `override`s that say which lights there are.
    pub light_constants: &'a [(&'static str, f64)],
    /// The surface on the GPU.
    pub mesh: &'a MeshBuffers,
    /// Normals and texture gradients.
    pub tangents: &'a Tangents,
    /// The texture maps, and the side of their pictures [px].
    pub maps: &'a Maps,
    /// Side of the maps [px].
    pub map_size_px: u32,
    /// Where light 0 enters the body.
    pub shadow_map: &'a wgpu::TextureView,
}

/// Irradiance in texture space and its blurs.
pub struct LightMap {
    draw: Draw,
    maps: [Target; 2],
    metric: Target,
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
    /// Places on the unit disc; each is used with its opposite.
    pub taps: [[f32; 2]; TAP_PAIRS],
    /// Radius of the disc on the surface [m].
    pub radius_m: f32,
    pub pad0: f32,
    pub pad1: f32,
    pub pad2: f32,
}

impl BlurUniform {
    /// The disc of the pass of that number.
    fn of(pass: usize, radius_m: f32) -> Self {
        Self {
            taps: taps(TURN * pass as f32),
            radius_m,
            pad0: 0.0,
            pad1: 0.0,
            pad2: 0.0,
        }
    }
}

impl LightMap {
    /// Name of the texture-space draw in logs.
    pub const NAME: &'static str = "lightmap";
    /// Name of the blurs in logs.
    pub const BLUR_NAME: &'static str = "blur";
    /// The WGSL files of the texture-space draw, joined in this order.
    pub const WGSL: &'static [Wgsl] = crate::wgsl![
        "frame.wgsl",
        "film.wgsl",
        "light.wgsl",
        "metric.wgsl",
        "layers.wgsl",
        "lightmap.wgsl"
    ];
    /// The WGSL files of a blur, joined in this order.
    pub const BLUR_WGSL: &'static [Wgsl] = crate::wgsl!["chart.wgsl", "blur.wgsl"];

    /// Builds the map of `section` and its blurs.
    ///
    /// # Errors
    ///
    /// [`GpuError::Shader`] if the WGSL does not compile on this adapter.
    pub fn new(
        gpu: &Gpu,
        section: &SurfaceSection,
        surface_mesh: &SurfaceMesh,
        inputs: &LightMapInputs<'_>,
    ) -> Result<Self, GpuError> {
        Self::with_source(
            gpu,
            section,
            surface_mesh,
            inputs,
            [&join(Self::WGSL), &join(Self::BLUR_WGSL)],
        )
    }

    /// As [`LightMap::new`] with other WGSL for the draw and the blurs: lets a test sabotage them and see the check fail.
    ///
    /// # Errors
    ///
    /// As [`LightMap::new`].
    pub fn with_source(
        gpu: &Gpu,
        section: &SurfaceSection,
        surface_mesh: &SurfaceMesh,
        inputs: &LightMapInputs<'_>,
        [source, blur_source]: [&str; 2],
    ) -> Result<Self, GpuError> {
        let size_px = light_map_size_px(section, surface_mesh);
        let size = [size_px; 2];
        let maps = [(); 2].map(|()| Target::new(gpu, Self::NAME, size, FORMAT));
        let metric = Target::new(gpu, "metric", size, FORMAT);
        let rest = charts_at_rest(gpu, surface_mesh)?;
        let yes = |is: bool| f64::from(u8::from(is));
        let color_level = level_for(inputs.map_size_px as f32 / size_px as f32);
        let mut constants = inputs.light_constants.to_vec();
        constants.extend([
            ("UNIT_FRAMES", yes(section.uv_metric == UvMetric::Unit)),
            ("FOLLOWS_VOLUME", yes(section.thickness_follows_volume)),
            ("BLURRED", yes(section.blur_passes > 0)),
            ("SHADES", yes(section.layer_shadow > 0.0)),
        ]);
        let draw = Draw::new(
            gpu,
            &DrawKind {
                pass: Self::NAME,
                parts: Self::WGSL,
                source,
                vertex: "lightmap_vertex",
                attributes: &[],
                fragment: Some(("lightmap_fragment", &[FORMAT, FORMAT])),
                blend: None,
                depth: DepthUse::None,
                cull: None,
                constants: &constants,
            },
            &[
                Binding::Uniform(inputs.frame),
                Binding::Read(&inputs.mesh.positions),
                Binding::Read(&inputs.mesh.point_of),
                Binding::Read(&inputs.mesh.uvs),
                Binding::Read(&inputs.tangents.normals),
                Binding::Depth(inputs.shadow_map),
                Binding::Read(&inputs.tangents.uv_gradients),
                Binding::Read(&rest),
                Binding::Sampler(&inputs.maps.sampler),
                Binding::Texture(inputs.maps.outer.at(color_level)),
            ],
        )?;
        let passes = section.blur_passes as usize;
        let blurs = (0..passes)
            .map(|pass| {
                let views = [&maps[pass % 2].view, &metric.view];
                Blur::new(gpu, views, pass + 1 == passes, blur_source)
            })
            .collect::<Result<_, GpuError>>()?;
        Ok(Self {
            draw,
            maps,
            metric,
            blurs,
        })
    }

    /// The map after its last blur.
    pub fn view(&self) -> &wgpu::TextureView {
        &self.target().view
    }

    /// The same as a texture, to be read back.
    pub fn target(&self) -> &Target {
        &self.maps[self.blurs.len() % 2]
    }

    /// The metric (a, b, c) of each texel [1/m], and how thick layers are there.
    pub fn metric(&self) -> &Target {
        &self.metric
    }

    /// Adds the draw and the blurs to `encoder`; `radius_m` is that of the disc on the surface.
    pub fn record(
        &self,
        gpu: &Gpu,
        radius_m: f32,
        mesh: &MeshBuffers,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut Timer,
    ) {
        {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some(Self::NAME),
                color_attachments: &[cleared(&self.maps[0].view), cleared(&self.metric.view)],
                timestamp_writes: timer.render(Self::NAME),
                ..Default::default()
            });
            self.draw.set(&mut pass);
            mesh.draw(&mut pass);
        }
        for (index, blur) in self.blurs.iter().enumerate() {
            let knobs = BlurUniform::of(index, radius_m);
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
    fn new(
        gpu: &Gpu,
        [source, metric]: [&wgpu::TextureView; 2],
        is_last: bool,
        wgsl: &str,
    ) -> Result<Self, GpuError> {
        let knobs = uniform(gpu, LightMap::BLUR_NAME, &BlurUniform::of(0, 0.0));
        let draw = Draw::new(
            gpu,
            &DrawKind {
                pass: LightMap::BLUR_NAME,
                parts: LightMap::BLUR_WGSL,
                source: wgsl,
                vertex: "blur_vertex",
                attributes: &[],
                fragment: Some(("blur_fragment", &[FORMAT])),
                blend: None,
                depth: DepthUse::None,
                cull: None,
                constants: &[("LAST", f64::from(u8::from(is_last)))],
            },
            &[
                Binding::Uniform(&knobs),
                Binding::Unfiltered(source),
                Binding::Unfiltered(metric),
            ],
        )?;
        Ok(Self { draw, knobs })
    }
}

/// Side of a light map [px]: what `section` says, and otherwise what the surface needs.
///
/// The blur of `gooey` leaves no detail finer than its disc, so the radius of that has two texels, of a body as it was
/// when the map was made: against 512 texels the picture of a bundled organ differs by 0.07 % RMS, of 256 by 0.05 %.
pub fn light_map_size_px(section: &SurfaceSection, mesh: &SurfaceMesh) -> u32 {
    section.light_map_size_px.unwrap_or_else(|| {
        if section.kind != SurfaceKind::Gooey || section.blur_passes == 0 {
            return SIZES_PX[1];
        }
        let radius = section.blur_radius_m * uv_per_m(mesh);
        let wanted = (TEXELS_A_RADIUS / radius.max(1e-6)).ceil() as u32;
        wanted.clamp(SIZES_PX[0], SIZES_PX[1])
    })
}

/// Mean length in texture space of a metre on the surface, from the areas of its triangles.
pub fn uv_per_m(mesh: &SurfaceMesh) -> f32 {
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
