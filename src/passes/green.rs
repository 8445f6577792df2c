//! What the surfaces after Green (2004) read beside the pixel: their knobs, the table of wrapped light, the ramp of
//! absorption, and the depth maps of the lights.

use super::body_depths::BodyDepths;
use super::diffusion::{shares, texels_per_m};
use super::mesh_buffers::MeshBuffers;
use super::shadow::SIZE_PX;
use super::tangents::Tangents;
use super::view::light_from_world;
use crate::geom::SurfaceMesh;
use crate::geom::paint::TissueMaps;
use crate::gpu::{Binding, Gpu, GpuError, Timer, uniform};
use crate::optics::absorption::{RAMP_LENGTH, disc, layered_ramp};
use crate::optics::wrap_lookup::{LOOKUP_SIDE, WrapLight};
use crate::optics::{LAYERS, Layer};
use crate::scene::{Falloff, LIGHTS_MAX, PlacedLight, SurfaceSection};
use glam::{Mat4, Vec2, Vec3, Vec4};
use half::f16;

/// Mirror of `Green` in `shaders/green.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct GreenUniform {
    pub clip_from_world: [[f32; 16]; LIGHTS_MAX],
    pub spans: [[f32; 4]; LIGHTS_MAX],
    pub disc: [[f32; 4]; 16],
    pub attenuation: [f32; 4],
    pub core: [f32; 4],
    pub disc_radius_m: f32,
    pub glow: f32,
    pub ramp_per_m: f32,
    pub color_in_map: f32,
    pub translucency: f32,
    pub pad0: f32,
    pub pad1: f32,
    pub pad2: f32,
}

/// Tables, knobs and depth maps.
pub struct Green {
    uniform: wgpu::Buffer,
    lookup: Colors,
    ramp: Colors,
    /// Read in place of the layers where the scene names a picture.
    told_ramp: Option<Vec<Vec3>>,
    /// Mean lower boundaries of the first three layers, as shares of the deepest.
    mean_bottoms: Vec3,
    depths: Option<BodyDepths>,
    /// Of the light map.
    texels_per_m: f32,
}

/// What is left of light at a place, as the surface's wrapped light is told.
pub fn wrap_light(section: &SurfaceSection) -> WrapLight {
    WrapLight {
        wrap: section.wrap,
        scatter_width: section.lookup.scatter_width,
        scatter_color: Vec3::from_array(section.lookup.scatter_color),
        shininess: section.lookup.shininess,
        conserves_energy: section.lookup.conserves_energy,
    }
}

impl Green {
    /// Builds what the surface of `section` reads.
    ///
    /// # Errors
    ///
    /// [`GpuError::Shader`] if the WGSL does not compile on this adapter.
    pub fn new(
        gpu: &Gpu,
        section: &SurfaceSection,
        light_count: usize,
        mesh: &SurfaceMesh,
        tangents: &Tangents,
        tissue: &TissueMaps,
    ) -> Result<Self, GpuError> {
        let depths = if section.is_translucent() {
            let layers = section.absorption.depth_layers;
            Some(BodyDepths::new(gpu, mesh, light_count, layers, tangents)?)
        } else {
            None
        };
        let green = Self {
            uniform: uniform(gpu, "green", &green_uniform(section, &[], &[], 0.0)),
            lookup: Colors::new(gpu, "wrapped light", [LOOKUP_SIDE; 2]),
            ramp: Colors::new(gpu, "ramp", [RAMP_LENGTH, 1]),
            told_ramp: None,
            mean_bottoms: mean_color(&tissue.layers[0].to_rgba8()),
            depths,
            texels_per_m: texels_per_m(section, mesh),
        };
        green.set_knobs(gpu, section);
        Ok(green)
    }

    /// Makes the tables anew.
    pub fn set_knobs(&self, gpu: &Gpu, section: &SurfaceSection) {
        self.lookup.write(gpu, &wrap_light(section).table());
        let ramp = self.told_ramp.clone().unwrap_or_else(|| {
            layered_ramp(
                &four_layers(section),
                section.layer_depth_max_m * self.mean_bottoms,
                section.absorption.ramp_length_m,
                section.absorption.way_share,
            )
        });
        let ramp: Vec<Vec4> = ramp.into_iter().map(|color| color.extend(1.0)).collect();
        self.ramp.write(gpu, &ramp);
    }

    /// Takes `colors`, evenly from no way to the longest, in place of those made from the layers.
    pub fn set_ramp(&mut self, gpu: &Gpu, section: &SurfaceSection, colors: Vec<Vec3>) {
        self.told_ramp = Some(colors);
        self.set_knobs(gpu, section);
    }

    /// The depth maps, where light comes through the body.
    pub fn depths(&self) -> Option<&BodyDepths> {
        self.depths.as_ref()
    }

    /// What `shaders/green.wgsl`, `shaders/wrap_lookup.wgsl` and `shaders/body_light.wgsl` bind, from 11 on.
    pub fn bindings(&self) -> Vec<Binding<'_>> {
        let mut bindings = vec![
            Binding::Uniform(&self.uniform),
            Binding::Texture(&self.lookup.view),
        ];
        if let Some(depths) = &self.depths {
            bindings.extend([
                Binding::Depth(&depths.entries().view),
                Binding::Depth(&depths.exits().view),
                Binding::Depth(&depths.second_entries().view),
                Binding::Texture(&self.ramp.view),
            ]);
        }
        bindings
    }

    /// Values of the `override`s of `shaders/body_light.wgsl`.
    pub fn constants(section: &SurfaceSection) -> [(&'static str, f64); 3] {
        let absorption = &section.absorption;
        let falloff = match absorption.falloff {
            Falloff::Exp => 0.0,
            Falloff::Ramp => 1.0,
        };
        [
            ("LOOKS", f64::from(absorption.samples)),
            ("DEPTH_LAYERS", f64::from(absorption.depth_layers)),
            ("FALLOFF", falloff),
        ]
    }

    /// Sends this frame's knobs and draws the depth maps, with the surface at `points` [m].
    #[allow(clippy::too_many_arguments, reason = "each is another pass's result")]
    pub fn record(
        &self,
        gpu: &Gpu,
        section: &SurfaceSection,
        lights: &[PlacedLight],
        points: &[Vec3],
        mesh: &MeshBuffers,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut Timer,
    ) {
        let views: Vec<Mat4> = match &self.depths {
            Some(_) => lights
                .iter()
                .map(|light| light_from_world(light, points))
                .collect(),
            None => Vec::new(),
        };
        let knobs = green_uniform(section, lights, &views, self.texels_per_m);
        gpu.queue
            .write_buffer(&self.uniform, 0, bytemuck::bytes_of(&knobs));
        if let Some(depths) = &self.depths {
            depths.record(gpu, &views, section.absorption.grow_m, mesh, encoder, timer);
        }
    }
}

/// Knobs of `section` for a light map of `texels_per_m`, and how each light's map lies.
pub fn green_uniform(
    section: &SurfaceSection,
    lights: &[PlacedLight],
    clip_from_world: &[Mat4],
    texels_per_m: f32,
) -> GreenUniform {
    let absorption = &section.absorption;
    let mut looks = disc(absorption.samples as usize);
    looks.resize(32, Vec2::ZERO);
    let deepest = four_layers(section)[LAYERS - 1];
    let attenuation = absorption.way_share * deepest.diffuse_attenuation_per_m();
    let (at_pixel, _) = shares(section, texels_per_m);
    let mut green = GreenUniform {
        clip_from_world: [Mat4::IDENTITY.to_cols_array(); LIGHTS_MAX],
        spans: [[1.0; 4]; LIGHTS_MAX],
        disc: std::array::from_fn(|i| {
            let [a, b] = [looks[2 * i], looks[2 * i + 1]];
            [a.x, a.y, b.x, b.y]
        }),
        attenuation: attenuation.extend(0.0).to_array(),
        core: at_pixel.extend(0.0).to_array(),
        disc_radius_m: absorption.disc_radius_m,
        glow: absorption.glow,
        ramp_per_m: 1.0 / absorption.ramp_length_m,
        color_in_map: section.diffusion.color_in_map,
        translucency: section.diffusion.translucency,
        pad0: 0.0,
        pad1: 0.0,
        pad2: 0.0,
    };
    for (k, (light, matrix)) in lights.iter().zip(clip_from_world).enumerate() {
        green.clip_from_world[k] = matrix.to_cols_array();
        green.spans[k] = span(light, matrix).to_array();
    }
    green
}

/// The four layers of one texture; the last is repeated below.
fn four_layers(section: &SurfaceSection) -> [Layer; LAYERS] {
    let last = section.layers.len() - 1;
    std::array::from_fn(|layer| section.layers[layer.min(last)].into())
}

/// Scales of a light's map, as `shaders/green.wgsl` has them.
fn span(light: &PlacedLight, clip_from_world: &Mat4) -> Vec4 {
    let half_side = 0.5 * SIZE_PX as f32;
    let rows = [0, 1, 2, 3].map(|row| clip_from_world.row(row));
    let [across, down, along] = [0, 1, 2].map(|row| rows[row].truncate().length().max(1e-9));
    if !light.is_point {
        let texels_per_m = half_side * Vec2::new(across, down);
        return Vec4::new(
            1.0 / along,
            texels_per_m.x,
            texels_per_m.y,
            2.0 / texels_per_m.min_element(),
        );
    }
    // Depth in clip space is r (distance − near), r = far / (far − near); the last row is the distance.
    let near = rows[3].w - rows[2].w / along;
    let far = along * near / (along - 1.0);
    let focal = half_side * across;
    Vec4::new(near, far, focal, 2.0 * 0.5 * (near + far) / focal)
}

fn mean_color(image: &image::RgbaImage) -> Vec3 {
    let mut sum = [0u64; 3];
    for texel in image.pixels() {
        for (sum, value) in sum.iter_mut().zip(texel.0) {
            *sum += u64::from(value);
        }
    }
    let count = f64::from(image.width()) * f64::from(image.height()) * 255.0;
    Vec3::from_array(sum.map(|s| (s as f64 / count) as f32))
}

/// A texture of half floats that the CPU writes.
struct Colors {
    texture: wgpu::Texture,
    view: wgpu::TextureView,
}

impl Colors {
    fn new(gpu: &Gpu, label: &str, [width, height]: [usize; 2]) -> Self {
        let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some(label),
            size: wgpu::Extent3d {
                width: width as u32,
                height: height as u32,
                depth_or_array_layers: 1,
            },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format: wgpu::TextureFormat::Rgba16Float,
            usage: wgpu::TextureUsages::TEXTURE_BINDING | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        Self { texture, view }
    }

    fn write(&self, gpu: &Gpu, colors: &[Vec4]) {
        let halves: Vec<[f16; 4]> = colors
            .iter()
            .map(|color| color.to_array().map(f16::from_f32))
            .collect();
        gpu.queue.write_texture(
            self.texture.as_image_copy(),
            bytemuck::cast_slice(&halves),
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(8 * self.texture.width()),
                rows_per_image: None,
            },
            self.texture.size(),
        );
    }
}
