//! The light map of the surface `diffusion`: drawn in texture space, then blurred by three Gaussians, each made from
//! the one before by a blur along both directions of the metric.

use super::draw::{DepthUse, Draw, DrawKind, Target, cleared};
use super::green::Green;
use super::lightmap::{light_map_size_px, uv_per_m};
use super::maps::{Maps, level_for};
use super::mesh_buffers::MeshBuffers;
use super::tangents::Tangents;
use crate::geom::SurfaceMesh;
use crate::geom::chart::charts;
use crate::geom::tangent::rest_gradients;
use crate::gpu::{Binding, Gpu, GpuError, Timer, Wgsl, join, storage, uniform};
use crate::optics::diffusion::{GAUSSIANS, Profile, TAPS, metric};
use crate::scene::{DiffusionCore, SurfaceSection, UvMetric};
use glam::Vec3;

/// Light and metric: half floats hold numbers of charts up to 2048.
const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Rgba16Float;

/// Charts that have a number of their own; of more, some share one.
const CHARTS_MAX: u32 = 2047;

/// Mirror of `Diffuse` in `shaders/diffuse.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct DiffuseUniform {
    pub sigma_m: [f32; 4],
    pub own: [f32; 4],
    pub second: [f32; 4],
    pub first: [f32; 4],
}

/// What the light map is drawn from, made by other passes.
pub struct DiffusionInputs<'a> {
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
    /// Knobs, and depth maps where light comes through the body.
    pub green: &'a Green,
}

/// Irradiance in texture space, and its blurs.
pub struct Diffusion {
    draw: Draw,
    light: Target,
    metric: Target,
    blurs: Vec<Blur>,
    texels_per_m: f32,
}

/// The blur of one Gaussian along one direction.
struct Blur {
    draw: Draw,
    knobs: wgpu::Buffer,
    target: Target,
    gaussian: usize,
}

impl Diffusion {
    /// Name of the texture-space draw in logs.
    pub const NAME: &'static str = "diffusion-map";
    /// Name of the blurs in logs.
    pub const BLUR_NAME: &'static str = "diffuse";
    /// The WGSL files of the texture-space draw of a body that lets no light through.
    pub const WGSL: &'static [Wgsl] = crate::wgsl![
        "frame.wgsl",
        "film.wgsl",
        "light.wgsl",
        "green.wgsl",
        "behind_none.wgsl",
        "metric.wgsl",
        "diffusion_map.wgsl"
    ];
    /// The same for one that does.
    pub const TRANSLUCENT_WGSL: &'static [Wgsl] = crate::wgsl![
        "frame.wgsl",
        "film.wgsl",
        "light.wgsl",
        "green.wgsl",
        "body_light.wgsl",
        "behind_depths.wgsl",
        "metric.wgsl",
        "diffusion_map.wgsl"
    ];
    /// The WGSL files of a blur.
    pub const BLUR_WGSL: &'static [Wgsl] = crate::wgsl!["chart.wgsl", "diffuse.wgsl"];

    /// Gaussians that are blurred in the map: the narrowest is lit at the pixel unless the scene says otherwise.
    pub fn blurred_gaussians(section: &SurfaceSection) -> std::ops::Range<usize> {
        match section.diffusion.core {
            DiffusionCore::Pixel => 1..GAUSSIANS,
            DiffusionCore::Map => 0..GAUSSIANS,
        }
    }

    /// Builds the map of `section`.
    ///
    /// # Errors
    ///
    /// [`GpuError::Shader`] if the WGSL does not compile on this adapter.
    pub fn new(
        gpu: &Gpu,
        section: &SurfaceSection,
        surface_mesh: &SurfaceMesh,
        inputs: &DiffusionInputs<'_>,
    ) -> Result<Self, GpuError> {
        let size = [light_map_size_px(section, surface_mesh); 2];
        let light = Target::new(gpu, Self::NAME, size, FORMAT);
        let metric = Target::new(gpu, "metric", size, FORMAT);
        let draw = light_draw(gpu, section, surface_mesh, inputs)?;
        let mut blurs: Vec<Blur> = Vec::new();
        let gaussians = Self::blurred_gaussians(section);
        for gaussian in gaussians.clone() {
            for axis in 0..2 {
                let is_last = gaussian + 1 == GAUSSIANS && axis == 1;
                let source = blurs.last().map_or(&light, |blur| &blur.target);
                // The finished Gaussians before: every second blur.
                let finished = |back: usize| {
                    let index = 2 * (gaussian - gaussians.start) as isize - 2 * back as isize + 1;
                    usize::try_from(index)
                        .ok()
                        .filter(|_| is_last)
                        .and_then(|index| blurs.get(index))
                        .map_or(&metric, |blur| &blur.target)
                };
                let blur = Blur::new(
                    gpu,
                    [source, &metric, finished(1), finished(2)],
                    gaussian,
                    axis,
                    is_last,
                    size,
                    &join(Self::BLUR_WGSL),
                )?;
                blurs.push(blur);
            }
        }
        Ok(Self {
            draw,
            light,
            metric,
            blurs,
            texels_per_m: texels_per_m(section, surface_mesh),
        })
    }

    /// The sum of the Gaussians that are blurred, each with its share of their light.
    pub fn view(&self) -> &wgpu::TextureView {
        &self.target().view
    }

    /// The same as a texture, to be read back.
    pub fn target(&self) -> &Target {
        self.blurs.last().map_or(&self.light, |blur| &blur.target)
    }

    /// The light before it is blurred, number of the chart in alpha.
    pub fn light(&self) -> &Target {
        &self.light
    }

    /// The metric of each texel [1/m].
    pub fn metric(&self) -> &Target {
        &self.metric
    }

    /// Adds the draw and the blurs to `encoder`.
    pub fn record(
        &self,
        gpu: &Gpu,
        section: &SurfaceSection,
        mesh: &MeshBuffers,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut Timer,
    ) {
        {
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some(Self::NAME),
                color_attachments: &[cleared(&self.light.view), cleared(&self.metric.view)],
                timestamp_writes: timer.render(Self::NAME),
                ..Default::default()
            });
            self.draw.set(&mut pass);
            mesh.draw(&mut pass);
        }
        let uniforms = uniforms(section, self.texels_per_m);
        for blur in &self.blurs {
            let knobs = uniforms[blur.gaussian];
            gpu.queue
                .write_buffer(&blur.knobs, 0, bytemuck::bytes_of(&knobs));
            let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
                label: Some(Self::BLUR_NAME),
                color_attachments: &[cleared(&blur.target.view)],
                timestamp_writes: timer.render(Self::BLUR_NAME),
                ..Default::default()
            });
            blur.draw.set(&mut pass);
            pass.draw(0..3, 0..1);
        }
    }
}

/// Mean texels of the light map on a metre of the surface at rest.
pub fn texels_per_m(section: &SurfaceSection, mesh: &SurfaceMesh) -> f32 {
    light_map_size_px(section, mesh) as f32 * uv_per_m(mesh)
}

/// The profile of the layer that light wanders in, as wide as the scene asks.
fn profile(section: &SurfaceSection) -> Profile {
    let last = section.layers.len() - 1;
    let layer = section.layers[(section.diffusion.layer as usize - 1).min(last)];
    let mut profile = Profile::of(&layer.into());
    for sigma in &mut profile.sigmas_m {
        *sigma *= section.diffusion.radius_scale;
    }
    profile
}

/// Share of all light that is lit at the pixel, and what each Gaussian has left for a light map of `texels_per_m`.
pub fn shares(section: &SurfaceSection, texels_per_m: f32) -> (Vec3, [Vec3; GAUSSIANS]) {
    let profile = profile(section);
    let mut spots = profile.spots(texels_per_m);
    if section.diffusion.core == DiffusionCore::Pixel {
        spots[0] = Vec3::ONE;
    }
    let blurred = std::array::from_fn(|i| profile.weights[i] * (Vec3::ONE - spots[i]));
    (Vec3::ONE - blurred.iter().sum::<Vec3>(), blurred)
}

/// Widths and shares of the blurs of each Gaussian.
pub fn uniforms(section: &SurfaceSection, texels_per_m: f32) -> [DiffuseUniform; GAUSSIANS] {
    let profile = profile(section);
    let first = Diffusion::blurred_gaussians(section).start;
    let mut steps = profile.steps_m();
    if first == 1 {
        // What is not made from the narrowest has its whole width to go.
        steps[1] = profile.sigmas_m[1];
    }
    let (_, blurred) = shares(section, texels_per_m);
    // Where hardly anything is left for the map its sum hardly counts: the widest stands for it.
    let sum = blurred.iter().sum::<Vec3>() + 1e-6;
    let share = |gaussian: usize| (blurred[gaussian] / sum).extend(0.0).to_array();
    std::array::from_fn(|gaussian| DiffuseUniform {
        sigma_m: steps[gaussian].extend(TAPS[gaussian] as f32).to_array(),
        own: ((blurred[2] + 1e-6) / sum).extend(0.0).to_array(),
        second: share(1),
        first: share(0),
    })
}

/// Number of each vertex's chart, from 1, and its metric at rest.
///
/// # Errors
///
/// [`GpuError`] if the adapter has no room for them.
pub fn charts_at_rest(gpu: &Gpu, mesh: &SurfaceMesh) -> Result<wgpu::Buffer, GpuError> {
    let rest: Vec<[f32; 4]> = charts(mesh)
        .iter()
        .zip(rest_gradients(mesh))
        .map(|(chart, [ut, ub, vt, vb])| {
            let here = metric(Vec3::new(ut, ub, 0.0), Vec3::new(vt, vb, 0.0));
            [(chart % CHARTS_MAX + 1) as f32, here.x, here.y, here.z]
        })
        .collect();
    storage(gpu, "charts and metric at rest", &rest)
}

fn light_draw(
    gpu: &Gpu,
    section: &SurfaceSection,
    surface_mesh: &SurfaceMesh,
    inputs: &DiffusionInputs<'_>,
) -> Result<Draw, GpuError> {
    let rest = charts_at_rest(gpu, surface_mesh)?;
    let translucent = inputs.green.depths().is_some();
    let parts = if translucent {
        Diffusion::TRANSLUCENT_WGSL
    } else {
        Diffusion::WGSL
    };
    let size_px = light_map_size_px(section, surface_mesh);
    let color_level = level_for(inputs.map_size_px as f32 / size_px as f32);
    let mut constants = inputs.light_constants.to_vec();
    constants.extend([
        (
            "UNIT_FRAMES",
            f64::from(u8::from(section.uv_metric == UvMetric::Unit)),
        ),
        (
            "COLORED",
            f64::from(u8::from(section.diffusion.color_in_map > 0.0)),
        ),
    ]);
    if translucent {
        constants.extend(Green::constants(section));
    }
    let mut bindings = vec![
        Binding::Uniform(inputs.frame),
        Binding::Read(&inputs.mesh.positions),
        Binding::Read(&inputs.mesh.point_of),
        Binding::Read(&inputs.mesh.uvs),
        Binding::Sampler(&inputs.maps.sampler),
        Binding::Read(&inputs.tangents.normals),
        Binding::Read(&inputs.tangents.uv_gradients),
        Binding::Texture(inputs.maps.outer.at(color_level)),
        Binding::Texture(inputs.maps.inner.at(color_level)),
        Binding::Read(&rest),
        Binding::Depth(inputs.shadow_map),
    ];
    bindings.extend(inputs.green.bindings());
    Draw::new(
        gpu,
        &DrawKind {
            pass: Diffusion::NAME,
            parts,
            source: &join(parts),
            vertex: "diffusion_map_vertex",
            attributes: &[],
            fragment: Some(("diffusion_map_fragment", &[FORMAT, FORMAT])),
            blend: None,
            depth: DepthUse::None,
            cull: None,
            constants: &constants,
        },
        &bindings,
    )
}

impl Blur {
    /// The blur that reads the source, the metric, and for the last one the Gaussians before.
    fn new(
        gpu: &Gpu,
        [source, metric, second, first]: [&Target; 4],
        gaussian: usize,
        axis: u32,
        is_last: bool,
        size: [u32; 2],
        wgsl: &str,
    ) -> Result<Self, GpuError> {
        let none = DiffuseUniform {
            sigma_m: [0.0; 4],
            own: [0.0; 4],
            second: [0.0; 4],
            first: [0.0; 4],
        };
        let knobs = uniform(gpu, Diffusion::BLUR_NAME, &none);
        let draw = Draw::new(
            gpu,
            &DrawKind {
                pass: Diffusion::BLUR_NAME,
                parts: Diffusion::BLUR_WGSL,
                source: wgsl,
                vertex: "diffuse_vertex",
                attributes: &[],
                fragment: Some(("diffuse_fragment", &[FORMAT])),
                blend: None,
                depth: DepthUse::None,
                cull: None,
                constants: &[
                    ("AXIS", f64::from(axis)),
                    ("LAST", f64::from(u8::from(is_last))),
                ],
            },
            &[
                Binding::Uniform(&knobs),
                Binding::Unfiltered(&source.view),
                Binding::Unfiltered(&metric.view),
                Binding::Unfiltered(&second.view),
                Binding::Unfiltered(&first.view),
            ],
        )?;
        Ok(Self {
            draw,
            knobs,
            target: Target::new(gpu, Diffusion::BLUR_NAME, size, FORMAT),
            gaussian,
        })
    }
}
