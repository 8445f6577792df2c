//! The surface of the scene: one draw a frame over the covered pixels, by the one model the scene has.

use super::depth_maps::DepthMaps;
use super::draw::{DepthUse, Draw, DrawKind, Output, Target, bound, cleared, kept, read_depth};
use super::geometry::GeometryTargets;
use super::green::Green;
use super::light_path::CoverKind;
use super::maps::{LEVELS, Maps};
use crate::gpu::{Binding, Gpu, GpuError, Timer, Wgsl, join};
use crate::optics::LAYERS;
use crate::scene::{
    InnerLight, InnerTaps, Multiple, Noise, Quadrature, SurfaceKind, SurfaceSection,
};

/// What a surface reads, made by other passes.
pub struct SurfaceInputs<'a> {
    /// Camera, lights, knobs.
    pub frame: &'a wgpu::Buffer,
    /// Values of the `override`s that say which lights there are.
    pub light_constants: &'a [(&'static str, f64)],
    /// What the light's way is found by.
    pub cover: CoverKind,
    /// What lies at each pixel.
    pub geometry: &'a GeometryTargets,
    /// The texture maps.
    pub maps: &'a Maps,
    /// Read by the gooey model alone; any texture will do for others.
    pub light_map: &'a wgpu::TextureView,
    /// Where light 0 enters the body; any depth texture will do without shadows.
    pub shadow_map: &'a wgpu::TextureView,
    /// Where the view rays leave the body again, for [`CoverKind::DepthMaps`]; else any depth texture will do.
    pub exit_map: &'a wgpu::TextureView,
    /// The maps of all lights, for [`CoverKind::DepthMaps`]; `shadow_map` is their depth.
    pub depth_maps: Option<&'a DepthMaps>,
    /// What the surfaces after Green (2004) read more.
    pub green: Option<&'a Green>,
}

/// The draw of the tissue.
pub struct Surface {
    kind: SurfaceKind,
    output: Output,
    /// With a set of bindings for each level of the maps.
    draw: Draw,
}

impl Surface {
    /// The WGSL files of a model, joined in this order; only `subsurface` asks for `cover`.
    pub fn wgsl(kind: SurfaceKind, cover: CoverKind) -> &'static [Wgsl] {
        match kind {
            SurfaceKind::Plain => crate::wgsl![
                "frame.wgsl",
                "pack.wgsl",
                "tone.wgsl",
                "film.wgsl",
                "light.wgsl",
                "pixel.wgsl",
                "plain.wgsl"
            ],
            SurfaceKind::Subsurface => match cover {
                CoverKind::Planes => crate::wgsl![
                    "frame.wgsl",
                    "pack.wgsl",
                    "tone.wgsl",
                    "film.wgsl",
                    "light.wgsl",
                    "pixel.wgsl",
                    "medium.wgsl",
                    "multiple.wgsl",
                    "layers_four.wgsl",
                    "light_plane.wgsl",
                    "noise.wgsl",
                    "subsurface.wgsl"
                ],
                CoverKind::DepthMaps => crate::wgsl![
                    "frame.wgsl",
                    "pack.wgsl",
                    "tone.wgsl",
                    "film.wgsl",
                    "light.wgsl",
                    "pixel.wgsl",
                    "medium.wgsl",
                    "multiple.wgsl",
                    "layers_four.wgsl",
                    "light_entry.wgsl",
                    "light_depth.wgsl",
                    "noise.wgsl",
                    "subsurface.wgsl"
                ],
                CoverKind::Quadrics => crate::wgsl![
                    "frame.wgsl",
                    "pack.wgsl",
                    "tone.wgsl",
                    "film.wgsl",
                    "light.wgsl",
                    "pixel.wgsl",
                    "medium.wgsl",
                    "multiple.wgsl",
                    "layers_four.wgsl",
                    "light_quadric.wgsl",
                    "noise.wgsl",
                    "subsurface.wgsl"
                ],
            },
            SurfaceKind::Gooey => crate::wgsl![
                "frame.wgsl",
                "pack.wgsl",
                "tone.wgsl",
                "film.wgsl",
                "light.wgsl",
                "pixel.wgsl",
                "layers.wgsl",
                "disc.wgsl",
                "gooey.wgsl"
            ],
            SurfaceKind::Wrap => crate::wgsl![
                "frame.wgsl",
                "pack.wgsl",
                "tone.wgsl",
                "film.wgsl",
                "light.wgsl",
                "pixel.wgsl",
                "green_pixel.wgsl",
                "wrap_lookup.wgsl",
                "wrap.wgsl"
            ],
            SurfaceKind::Absorption => crate::wgsl![
                "frame.wgsl",
                "pack.wgsl",
                "tone.wgsl",
                "film.wgsl",
                "light.wgsl",
                "pixel.wgsl",
                "green_pixel.wgsl",
                "green.wgsl",
                "wrap_lookup.wgsl",
                "body_light.wgsl",
                "absorption.wgsl"
            ],
            SurfaceKind::Diffusion => crate::wgsl![
                "frame.wgsl",
                "pack.wgsl",
                "tone.wgsl",
                "film.wgsl",
                "light.wgsl",
                "pixel.wgsl",
                "green_pixel.wgsl",
                "green.wgsl",
                "diffusion.wgsl"
            ],
        }
    }

    /// Builds the model that `section` names, to draw what `output` says.
    ///
    /// # Errors
    ///
    /// [`GpuError::Shader`] if the WGSL does not compile on this adapter.
    pub fn new(
        gpu: &Gpu,
        section: &SurfaceSection,
        output: Output,
        inputs: &SurfaceInputs<'_>,
    ) -> Result<Self, GpuError> {
        Self::with_source(
            gpu,
            section,
            output,
            inputs,
            &join(&Self::parts(section, inputs.cover)),
        )
    }

    /// The WGSL files of the model that `section` names: those of [`Surface::wgsl`], for as many layers.
    pub fn parts(section: &SurfaceSection, cover: CoverKind) -> Vec<Wgsl> {
        let mut parts = Self::wgsl(section.kind, cover).to_vec();
        if section.layers.len() > LAYERS {
            let eight = crate::wgsl!["layers_eight.wgsl"];
            parts.retain(|part| !part.file.ends_with("/medium.wgsl"));
            for part in &mut parts {
                if part.file.ends_with("/layers_four.wgsl") {
                    *part = eight[0];
                }
            }
        }
        parts
    }

    /// As [`Surface::new`] with other WGSL: lets a test sabotage the model and see the check fail.
    ///
    /// # Errors
    ///
    /// As [`Surface::new`].
    pub fn with_source(
        gpu: &Gpu,
        section: &SurfaceSection,
        output: Output,
        inputs: &SurfaceInputs<'_>,
        source: &str,
    ) -> Result<Self, GpuError> {
        let mut constants = inputs.light_constants.to_vec();
        constants.push(output.tone());
        if section.kind == SurfaceKind::Subsurface {
            let quadrature = match section.quadrature {
                Quadrature::ByLayer => 0.0,
                Quadrature::ClosedForm => 1.0,
                Quadrature::Published => 2.0,
            };
            let noise = match section.noise {
                Noise::None => 0.0,
                Noise::Clouds => 1.0,
                Noise::Gradient => 2.0,
            };
            constants.extend([
                ("QUADRATURE", quadrature),
                ("SAMPLES", f64::from(section.samples)),
                (
                    "PIECES",
                    f64::from(section.samples.div_ceil(section.layers.len() as u32)),
                ),
                ("LAYER_COUNT", section.layers.len() as f64),
                ("NOISE", noise),
                (
                    "OFTEN",
                    f64::from(u8::from(section.multiple == Multiple::Calibrated)),
                ),
            ]);
            if inputs.cover == CoverKind::Planes && section.quadrature == Quadrature::Published {
                constants.push(("MIRRORED", 1.0));
            }
        }
        if section.kind == SurfaceKind::Gooey {
            constants.extend(gooey_constants(section));
        }
        if section.kind == SurfaceKind::Absorption {
            constants.extend(Green::constants(section));
        }
        let draw = Draw::with_sets(
            gpu,
            &DrawKind {
                pass: section.kind.name(),
                parts: &Self::parts(section, inputs.cover),
                source,
                vertex: "pixel_vertex",
                attributes: &[],
                fragment: Some(("fragment", &[output.format()])),
                blend: output.blend(),
                depth: DepthUse::Covered,
                cull: None,
                constants: &constants,
            },
            &sets(inputs),
        )?;
        Ok(Self {
            kind: section.kind,
            output,
            draw,
        })
    }

    /// What the model binds to read from `inputs` of another size than before, for [`Surface::rebind`].
    pub fn bound(&self, gpu: &Gpu, inputs: &SurfaceInputs<'_>) -> Vec<wgpu::BindGroup> {
        bound(gpu, self.kind.name(), &sets(inputs))
    }

    /// Takes what [`Surface::bound`] made.
    pub fn rebind(&mut self, sets: Vec<wgpu::BindGroup>) {
        self.draw.rebind(sets);
    }

    /// Name in logs.
    pub fn name(&self) -> &'static str {
        self.kind.name()
    }

    /// Adds the draw with the maps at `level` to `encoder`: the tissue, over the backdrop that a picture holds, or radiance and nothing elsewhere.
    pub fn record(
        &self,
        target: &Target,
        depth: &Target,
        level: usize,
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut Timer,
    ) {
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some(self.name()),
            color_attachments: &[match self.output {
                Output::Picture => kept(&target.view),
                Output::Radiance => cleared(&target.view),
            }],
            depth_stencil_attachment: Some(read_depth(&depth.view)),
            timestamp_writes: timer.render(self.name()),
            ..Default::default()
        });
        self.draw.set_with(&mut pass, level);
        pass.draw(0..3, 0..1);
    }
}

/// Values of the `override`s of `shaders/gooey.wgsl`.
fn gooey_constants(section: &SurfaceSection) -> [(&'static str, f64); 4] {
    let taps = match section.inner_taps {
        InnerTaps::One => 0.0,
        InnerTaps::Three => 1.0,
        InnerTaps::Disc => 2.0,
    };
    let light = match section.inner_light {
        InnerLight::Map => 0.0,
        InnerLight::NormalMap => 1.0,
        InnerLight::SmoothNormal => 2.0,
    };
    let shades = f64::from(u8::from(section.layer_shadow > 0.0));
    [
        ("INNER_COUNT", section.inner.len() as f64),
        ("INNER_BLUR", taps),
        ("INNER_LIGHT", light),
        ("SHADES", shades),
    ]
}

/// The bindings at each level of the maps.
fn sets<'a>(inputs: &SurfaceInputs<'a>) -> Vec<Vec<Binding<'a>>> {
    (0..LEVELS).map(|level| bindings(inputs, level)).collect()
}

/// The bindings of `shaders/pixel.wgsl`, in its order, with the maps at `level`, and of `shaders/light_depth.wgsl` or `shaders/green.wgsl`.
fn bindings<'a>(inputs: &SurfaceInputs<'a>, level: usize) -> Vec<Binding<'a>> {
    let mut bindings = vec![
        Binding::Uniform(inputs.frame),
        Binding::Integers(&inputs.geometry.base.view),
        Binding::Integers(&inputs.geometry.detail.view),
        Binding::Depth(&inputs.geometry.depth.view),
        Binding::Sampler(&inputs.maps.sampler),
        Binding::Texture(inputs.maps.outer.at(level)),
        Binding::Texture(inputs.maps.normal.at(level)),
        Binding::Texture(inputs.maps.inner.at(level)),
        Binding::Texture(&inputs.maps.layers[0]),
        Binding::Texture(inputs.light_map),
        Binding::Depth(inputs.shadow_map),
    ];
    if let Some(green) = inputs.green {
        bindings.extend(green.bindings());
        return bindings;
    }
    // What one cover reads is bound for all: the layers beyond the fourth follow it.
    let none = (inputs.frame, &inputs.geometry.base.view, inputs.shadow_map);
    let (views, normals, exits) = inputs.depth_maps.map_or(none, |maps| {
        (&maps.views, &maps.normals.view, inputs.exit_map)
    });
    bindings.extend([
        Binding::Uniform(views),
        Binding::Integers(normals),
        Binding::Depth(exits),
        Binding::Texture(&inputs.maps.layers[1]),
        Binding::Texture(
            inputs
                .maps
                .noise
                .as_ref()
                .unwrap_or(inputs.maps.outer.at(level)),
        ),
    ]);
    bindings
}
