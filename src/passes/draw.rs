//! What render passes share: a pipeline with its bind group, made from a list of bindings, or with several to choose from.

use crate::gpu::{Binding, Gpu, GpuError, Wgsl, bind, compile};

/// A render pipeline and what it binds. Immutable once made.
pub struct Draw {
    pipeline: wgpu::RenderPipeline,
    /// At least one.
    sets: Vec<wgpu::BindGroup>,
}

/// What kind of pipeline a [`Draw`] is.
pub struct DrawKind<'a> {
    /// Name of the pass, for errors and labels.
    pub pass: &'static str,
    /// The WGSL files, in order.
    pub parts: &'a [Wgsl],
    /// Their joined text, or a changed copy.
    pub source: &'a str,
    /// Vertex entry point.
    pub vertex: &'a str,
    /// Buffers of vertices: the stride of each [bytes] and its attributes.
    ///
    /// What a vertex has to itself is better read so than from storage: a software adapter fetches it for many
    /// vertices at once.
    pub attributes: &'a [(u64, &'a [wgpu::VertexAttribute])],
    /// Fragment entry point and the formats it draws to; none for depth alone.
    pub fragment: Option<(&'a str, &'a [wgpu::TextureFormat])>,
    /// How it is blended with what is there; left out, it replaces it.
    pub blend: Option<wgpu::BlendState>,
    /// What it does with the depth target.
    pub depth: DepthUse,
    /// Which side of a triangle is not drawn.
    pub cull: Option<wgpu::Face>,
    /// Values of the `override`s.
    pub constants: &'a [(&'a str, f64)],
}

/// What a frame leaves in its target.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Output {
    /// What a screen shows: the tone curve, sRGB and soft outlines over the backdrop.
    Picture,
    /// Linear radiance; nothing where there is nothing.
    Radiance,
}

impl Output {
    /// Format of the target.
    pub fn format(self) -> wgpu::TextureFormat {
        match self {
            Self::Picture => super::PICTURE_FORMAT,
            Self::Radiance => super::RADIANCE_FORMAT,
        }
    }

    /// How what is drawn meets what is there: outlines of a picture are blended with it.
    pub fn blend(self) -> Option<wgpu::BlendState> {
        (self == Self::Picture).then_some(wgpu::BlendState::ALPHA_BLENDING)
    }

    /// Value of the `override` TONE of shaders that draw to it.
    pub fn tone(self) -> (&'static str, f64) {
        ("TONE", f64::from(u8::from(self == Self::Picture)))
    }
}

/// What a [`Draw`] does with a depth target of [`super::DEPTH_FORMAT`].
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum DepthUse {
    /// There is none.
    None,
    /// Keeps what is nearest.
    Nearest,
    /// Reads it: a draw at the far end passes where something lies before it.
    Covered,
}

impl Draw {
    /// Compiles the pipeline and binds `bindings` as group 0.
    ///
    /// # Errors
    ///
    /// [`GpuError::Shader`] if the WGSL does not compile, [`GpuError::Pass`] if it does not fit.
    pub fn new(gpu: &Gpu, kind: &DrawKind<'_>, bindings: &[Binding<'_>]) -> Result<Self, GpuError> {
        Self::with_sets(gpu, kind, &[bindings.to_vec()])
    }

    /// Compiles the pipeline with several `sets` of bindings of the same kinds; each frame takes one as group 0.
    ///
    /// # Errors
    ///
    /// As [`Draw::new`].
    ///
    /// # Panics
    ///
    /// If there is no set.
    pub fn with_sets(
        gpu: &Gpu,
        kind: &DrawKind<'_>,
        sets: &[Vec<Binding<'_>>],
    ) -> Result<Self, GpuError> {
        let module = compile(gpu, kind.pass, kind.parts, kind.source)?;
        let scope = gpu.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let (layout, first) = bind_draw(gpu, kind.pass, &sets[0]);
        let mut groups = vec![first];
        groups.extend(bound(gpu, kind.pass, &sets[1..]));
        let pipeline_layout = gpu
            .device
            .create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some(kind.pass),
                bind_group_layouts: &[Some(&layout)],
                immediate_size: 0,
            });
        let options = wgpu::PipelineCompilationOptions {
            constants: kind.constants,
            ..Default::default()
        };
        let targets: Vec<_> = kind
            .fragment
            .iter()
            .flat_map(|(_, formats)| formats.iter())
            .map(|&format| {
                Some(wgpu::ColorTargetState {
                    format,
                    blend: kind.blend,
                    write_mask: wgpu::ColorWrites::ALL,
                })
            })
            .collect();
        let buffers: Vec<_> = kind
            .attributes
            .iter()
            .map(|&(array_stride, attributes)| {
                Some(wgpu::VertexBufferLayout {
                    array_stride,
                    step_mode: wgpu::VertexStepMode::Vertex,
                    attributes,
                })
            })
            .collect();
        let depth_test = match kind.depth {
            DepthUse::None => None,
            DepthUse::Nearest => Some((true, wgpu::CompareFunction::Less)),
            DepthUse::Covered => Some((false, wgpu::CompareFunction::Greater)),
        };
        let pipeline = gpu
            .device
            .create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(kind.pass),
                layout: Some(&pipeline_layout),
                vertex: wgpu::VertexState {
                    module: &module,
                    entry_point: Some(kind.vertex),
                    compilation_options: options.clone(),
                    buffers: &buffers,
                },
                primitive: wgpu::PrimitiveState {
                    cull_mode: kind.cull,
                    ..Default::default()
                },
                depth_stencil: depth_test.map(|(write, compare)| wgpu::DepthStencilState {
                    format: super::DEPTH_FORMAT,
                    depth_write_enabled: Some(write),
                    depth_compare: Some(compare),
                    stencil: wgpu::StencilState::default(),
                    bias: wgpu::DepthBiasState::default(),
                }),
                multisample: wgpu::MultisampleState::default(),
                fragment: kind.fragment.map(|(entry_point, _)| wgpu::FragmentState {
                    module: &module,
                    entry_point: Some(entry_point),
                    compilation_options: options.clone(),
                    targets: &targets,
                }),
                multiview_mask: None,
                cache: None,
            });
        match pollster::block_on(scope.pop()) {
            None => Ok(Self {
                pipeline,
                sets: groups,
            }),
            Some(error) => Err(GpuError::Pass {
                pass: kind.pass,
                message: error.to_string(),
            }),
        }
    }

    /// Takes other things in place of those that it binds: as many sets, of the same kinds, from [`bound`].
    pub fn rebind(&mut self, sets: Vec<wgpu::BindGroup>) {
        self.sets = sets;
    }

    /// Makes `pass` use this pipeline and its bindings.
    pub fn set(&self, pass: &mut wgpu::RenderPass<'_>) {
        self.set_with(pass, 0);
    }

    /// The same with the set of that number.
    ///
    /// # Panics
    ///
    /// If there is none.
    pub fn set_with(&self, pass: &mut wgpu::RenderPass<'_>, number: usize) {
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.sets[number], &[]);
    }
}

/// What a [`Draw`] binds, one after another.
pub fn bound(gpu: &Gpu, label: &str, sets: &[Vec<Binding<'_>>]) -> Vec<wgpu::BindGroup> {
    sets.iter()
        .map(|set| bind_draw(gpu, label, set).1)
        .collect()
}

fn bind_draw(
    gpu: &Gpu,
    label: &str,
    bindings: &[Binding<'_>],
) -> (wgpu::BindGroupLayout, wgpu::BindGroup) {
    bind(gpu, label, wgpu::ShaderStages::VERTEX_FRAGMENT, bindings)
}

/// A texture that is drawn to and then read, with its view.
pub struct Target {
    /// The texture.
    pub texture: wgpu::Texture,
    /// All of it.
    pub view: wgpu::TextureView,
}

impl Target {
    /// A target of `size` [px].
    pub fn new(gpu: &Gpu, label: &str, size: [u32; 2], format: wgpu::TextureFormat) -> Self {
        let texture = gpu.device.create_texture(&wgpu::TextureDescriptor {
            label: Some(label),
            size: wgpu::Extent3d {
                width: size[0],
                height: size[1],
                depth_or_array_layers: 1,
            },
            mip_level_count: 1,
            sample_count: 1,
            dimension: wgpu::TextureDimension::D2,
            format,
            usage: wgpu::TextureUsages::RENDER_ATTACHMENT
                | wgpu::TextureUsages::TEXTURE_BINDING
                | wgpu::TextureUsages::COPY_SRC
                | wgpu::TextureUsages::COPY_DST,
            view_formats: &[],
        });
        let view = texture.create_view(&wgpu::TextureViewDescriptor::default());
        Self { texture, view }
    }
}

impl Target {
    /// Width and height [px].
    pub fn size(&self) -> [u32; 2] {
        [self.texture.width(), self.texture.height()]
    }
}

/// A colour attachment that is cleared to nothing.
pub fn cleared(view: &wgpu::TextureView) -> Option<wgpu::RenderPassColorAttachment<'_>> {
    attachment(view, wgpu::LoadOp::Clear(wgpu::Color::TRANSPARENT))
}

/// A colour attachment that is drawn over as it is.
pub fn kept(view: &wgpu::TextureView) -> Option<wgpu::RenderPassColorAttachment<'_>> {
    attachment(view, wgpu::LoadOp::Load)
}

fn attachment(
    view: &wgpu::TextureView,
    load: wgpu::LoadOp<wgpu::Color>,
) -> Option<wgpu::RenderPassColorAttachment<'_>> {
    Some(wgpu::RenderPassColorAttachment {
        view,
        depth_slice: None,
        resolve_target: None,
        ops: wgpu::Operations {
            load,
            store: wgpu::StoreOp::Store,
        },
    })
}

/// A depth attachment that is read only, so that it can be bound as a texture too.
pub fn read_depth(view: &wgpu::TextureView) -> wgpu::RenderPassDepthStencilAttachment<'_> {
    wgpu::RenderPassDepthStencilAttachment {
        view,
        depth_ops: None,
        stencil_ops: None,
    }
}

/// A depth attachment that is cleared to the far end.
pub fn cleared_depth(view: &wgpu::TextureView) -> wgpu::RenderPassDepthStencilAttachment<'_> {
    wgpu::RenderPassDepthStencilAttachment {
        view,
        depth_ops: Some(wgpu::Operations {
            load: wgpu::LoadOp::Clear(1.0),
            store: wgpu::StoreOp::Store,
        }),
        stencil_ops: None,
    }
}
