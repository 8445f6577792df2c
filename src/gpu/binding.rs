//! Bind groups and compute kernels from a list of what a WGSL file declares, in its order.

use super::{Gpu, GpuError, Wgsl, compile};

/// What stands at one `@binding` of group 0. The n-th of a list is `@binding(n)`.
#[derive(Clone, Copy)]
pub enum Binding<'a> {
    /// `var<uniform>`
    Uniform(&'a wgpu::Buffer),
    /// `var<storage, read>`
    Read(&'a wgpu::Buffer),
    /// `var<storage, read_write>`
    Write(&'a wgpu::Buffer),
    /// `texture_2d<f32>`, filterable
    Texture(&'a wgpu::TextureView),
    /// `texture_2d<f32>` of a format that can't be filtered, read by `textureLoad`
    Unfiltered(&'a wgpu::TextureView),
    /// `texture_2d<u32>`
    Integers(&'a wgpu::TextureView),
    /// `texture_depth_2d`
    Depth(&'a wgpu::TextureView),
    /// `texture_storage_2d<…, write>` of the format given
    Image(&'a wgpu::TextureView, wgpu::TextureFormat),
    /// `sampler`
    Sampler(&'a wgpu::Sampler),
    /// `sampler_comparison`
    Comparison(&'a wgpu::Sampler),
}

impl<'a> Binding<'a> {
    fn layout(&self) -> wgpu::BindingType {
        let buffer = |ty| wgpu::BindingType::Buffer {
            ty,
            has_dynamic_offset: false,
            min_binding_size: None,
        };
        let texture = |sample_type| wgpu::BindingType::Texture {
            sample_type,
            view_dimension: wgpu::TextureViewDimension::D2,
            multisampled: false,
        };
        match self {
            Self::Uniform(_) => buffer(wgpu::BufferBindingType::Uniform),
            Self::Read(_) => buffer(wgpu::BufferBindingType::Storage { read_only: true }),
            Self::Write(_) => buffer(wgpu::BufferBindingType::Storage { read_only: false }),
            Self::Texture(_) => texture(wgpu::TextureSampleType::Float { filterable: true }),
            Self::Unfiltered(_) => texture(wgpu::TextureSampleType::Float { filterable: false }),
            Self::Integers(_) => texture(wgpu::TextureSampleType::Uint),
            Self::Depth(_) => texture(wgpu::TextureSampleType::Depth),
            Self::Image(_, format) => wgpu::BindingType::StorageTexture {
                access: wgpu::StorageTextureAccess::WriteOnly,
                format: *format,
                view_dimension: wgpu::TextureViewDimension::D2,
            },
            Self::Sampler(_) => wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Filtering),
            Self::Comparison(_) => wgpu::BindingType::Sampler(wgpu::SamplerBindingType::Comparison),
        }
    }

    fn resource(&self) -> wgpu::BindingResource<'a> {
        match *self {
            Self::Uniform(buffer) | Self::Read(buffer) | Self::Write(buffer) => {
                buffer.as_entire_binding()
            }
            Self::Texture(view)
            | Self::Unfiltered(view)
            | Self::Integers(view)
            | Self::Depth(view)
            | Self::Image(view, _) => wgpu::BindingResource::TextureView(view),
            Self::Sampler(sampler) | Self::Comparison(sampler) => {
                wgpu::BindingResource::Sampler(sampler)
            }
        }
    }
}

/// The layout and the bind group of `bindings`, visible in `stages`.
///
/// A read-write storage buffer is only allowed in compute and fragment stages.
pub fn bind(
    gpu: &Gpu,
    label: &str,
    stages: wgpu::ShaderStages,
    bindings: &[Binding<'_>],
) -> (wgpu::BindGroupLayout, wgpu::BindGroup) {
    let layout_entries: Vec<_> = bindings
        .iter()
        .enumerate()
        .map(|(index, binding)| wgpu::BindGroupLayoutEntry {
            binding: index as u32,
            visibility: stages,
            ty: binding.layout(),
            count: None,
        })
        .collect();
    let layout = gpu
        .device
        .create_bind_group_layout(&wgpu::BindGroupLayoutDescriptor {
            label: Some(label),
            entries: &layout_entries,
        });
    let entries: Vec<_> = bindings
        .iter()
        .enumerate()
        .map(|(index, binding)| wgpu::BindGroupEntry {
            binding: index as u32,
            resource: binding.resource(),
        })
        .collect();
    let group = gpu.device.create_bind_group(&wgpu::BindGroupDescriptor {
        label: Some(label),
        layout: &layout,
        entries: &entries,
    });
    (layout, group)
}

/// Workgroups that cover `threads`.
///
/// # Errors
///
/// [`GpuError::DispatchTooLarge`] if one dispatch can't have that many.
pub fn workgroups(
    gpu: &Gpu,
    pass: &'static str,
    threads: usize,
    workgroup_size: u32,
) -> Result<u32, GpuError> {
    let limit = gpu.device.limits().max_compute_workgroups_per_dimension;
    let workgroups = threads.div_ceil(workgroup_size as usize) as u64;
    u32::try_from(workgroups)
        .ok()
        .filter(|&count| count <= limit)
        .ok_or(GpuError::DispatchTooLarge {
            pass,
            workgroups: workgroups.min(u64::from(u32::MAX)) as u32,
            limit,
        })
}

/// A compute pipeline with its bind group. Immutable once made.
pub struct Kernel {
    name: &'static str,
    pipeline: wgpu::ComputePipeline,
    bindings: wgpu::BindGroup,
}

impl Kernel {
    /// Compiles `entry_point` of `source`, which was joined from `parts`, and binds `bindings`.
    ///
    /// # Errors
    ///
    /// [`GpuError::Shader`] if the WGSL does not compile, [`GpuError::Pass`] if it does not fit
    /// `bindings`.
    pub fn new(
        gpu: &Gpu,
        name: &'static str,
        parts: &[Wgsl],
        source: &str,
        entry_point: &str,
        bindings: &[Binding<'_>],
    ) -> Result<Self, GpuError> {
        let module = compile(gpu, name, parts, source)?;
        let scope = gpu.device.push_error_scope(wgpu::ErrorFilter::Validation);
        let (layout, bindings) = bind(gpu, name, wgpu::ShaderStages::COMPUTE, bindings);
        let pipeline_layout = gpu
            .device
            .create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some(name),
                bind_group_layouts: &[Some(&layout)],
                immediate_size: 0,
            });
        let pipeline = gpu
            .device
            .create_compute_pipeline(&wgpu::ComputePipelineDescriptor {
                label: Some(name),
                layout: Some(&pipeline_layout),
                module: &module,
                entry_point: Some(entry_point),
                compilation_options: wgpu::PipelineCompilationOptions::default(),
                cache: None,
            });
        match pollster::block_on(scope.pop()) {
            None => Ok(Self {
                name,
                pipeline,
                bindings,
            }),
            Some(error) => Err(GpuError::Pass {
                pass: name,
                message: error.to_string(),
            }),
        }
    }

    /// The pass this kernel is timed and logged as.
    pub fn name(&self) -> &'static str {
        self.name
    }

    /// Adds one dispatch to a pass that is being recorded.
    pub fn dispatch(&self, pass: &mut wgpu::ComputePass<'_>, workgroups: u32) {
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.bindings, &[]);
        pass.dispatch_workgroups(workgroups, 1, 1);
    }

    /// Adds a dispatch whose size an earlier kernel wrote: three u32 at `offset` of `arguments`.
    pub fn dispatch_indirect(
        &self,
        pass: &mut wgpu::ComputePass<'_>,
        arguments: &wgpu::Buffer,
        offset: u64,
    ) {
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.bindings, &[]);
        pass.dispatch_workgroups_indirect(arguments, offset);
    }
}
