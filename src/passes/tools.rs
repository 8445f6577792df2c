//! The tools, drawn over the tissue: one draw a frame, an instance a tool.

use super::draw::{Output, kept};
use super::view::View;
use crate::gpu::{Binding, Gpu, GpuError, Timer, Wgsl, bind, compile, join, storage, uniform};
use glam::{Mat4, Vec3};

/// Tools that can be drawn at once; a scene has a few.
pub const TOOLS_MAX: usize = 16;

/// Rings of a round end and steps around the axis: a circle of 24 corners misses a round outline of 40 pixels by a
/// third of one, and a software adapter pays for each corner.
const RINGS: u32 = 8;
const STEPS: u32 = 24;

/// A capsule to draw; a sphere has no axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct DrawnTool {
    /// Middle of the front end [m].
    pub tip_m: Vec3,
    /// From there to the middle of the other end [m].
    pub axis_m: Vec3,
    /// Radius [m].
    pub radius_m: f32,
}

/// Mirror of `View` in `shaders/tools.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
pub struct ToolsView {
    /// World to clip space.
    pub clip_from_world: [f32; 16],
    /// The camera [m], and what radiance is multiplied by before the tone curve.
    pub eye_exposure: [f32; 4],
}

impl ToolsView {
    /// What `view` shows in a picture of that width over height.
    pub fn new(view: &View, aspect: f32, exposure: f32) -> Self {
        Self {
            clip_from_world: view.clip_from_world(aspect).to_cols_array(),
            eye_exposure: view.eye.extend(exposure).to_array(),
        }
    }
}

/// Mirror of `Tool` in `shaders/capsule.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, bytemuck::Pod, bytemuck::Zeroable)]
struct ToolData {
    tip_radius: [f32; 4],
    axis: [f32; 4],
}

/// The pass that draws the tools.
pub struct Tools {
    pipeline: wgpu::RenderPipeline,
    bindings: wgpu::BindGroup,
    view: wgpu::Buffer,
    tools: wgpu::Buffer,
    directions: wgpu::Buffer,
    index_buffer: wgpu::Buffer,
    index_count: u32,
}

impl Tools {
    /// Name in logs.
    pub const NAME: &'static str = "tools";
    /// The WGSL files of this pass, joined in this order.
    pub const WGSL: &'static [Wgsl] = crate::wgsl!["tone.wgsl", "capsule.wgsl", "tools.wgsl"];

    /// Builds the pass, to draw what `output` says.
    ///
    /// # Errors
    ///
    /// [`GpuError::Shader`] if the WGSL does not compile on this adapter.
    pub fn new(gpu: &Gpu, output: Output) -> Result<Self, GpuError> {
        let module = compile(gpu, Self::NAME, Self::WGSL, &join(Self::WGSL))?;
        let view = uniform(
            gpu,
            "tools view",
            &ToolsView {
                clip_from_world: Mat4::IDENTITY.to_cols_array(),
                eye_exposure: [0.0; 4],
            },
        );
        let nothing = [ToolData {
            tip_radius: [0.0; 4],
            axis: [0.0; 4],
        }; TOOLS_MAX];
        let tools = storage(gpu, "tools", &nothing)?;
        let (directions, indices) = unit_capsule();
        let directions = storage(gpu, "tool directions", &directions)?;
        let (layout, bindings) = bind(
            gpu,
            Self::NAME,
            wgpu::ShaderStages::VERTEX_FRAGMENT,
            &[
                Binding::Uniform(&view),
                Binding::Read(&tools),
                Binding::Read(&directions),
            ],
        );
        let pipeline_layout = gpu
            .device
            .create_pipeline_layout(&wgpu::PipelineLayoutDescriptor {
                label: Some(Self::NAME),
                bind_group_layouts: &[Some(&layout)],
                immediate_size: 0,
            });
        let pipeline = gpu
            .device
            .create_render_pipeline(&wgpu::RenderPipelineDescriptor {
                label: Some(Self::NAME),
                layout: Some(&pipeline_layout),
                vertex: wgpu::VertexState {
                    module: &module,
                    entry_point: Some("vertex"),
                    compilation_options: wgpu::PipelineCompilationOptions::default(),
                    buffers: &[],
                },
                primitive: wgpu::PrimitiveState {
                    cull_mode: Some(wgpu::Face::Back),
                    ..Default::default()
                },
                depth_stencil: Some(wgpu::DepthStencilState {
                    format: super::DEPTH_FORMAT,
                    depth_write_enabled: Some(true),
                    // Equal too: radiance may be asked for where the picture has left its depth.
                    depth_compare: Some(wgpu::CompareFunction::LessEqual),
                    stencil: wgpu::StencilState::default(),
                    bias: wgpu::DepthBiasState::default(),
                }),
                multisample: wgpu::MultisampleState::default(),
                fragment: Some(wgpu::FragmentState {
                    module: &module,
                    entry_point: Some("fragment"),
                    compilation_options: wgpu::PipelineCompilationOptions {
                        constants: &[output.tone()],
                        ..Default::default()
                    },
                    targets: &[Some(wgpu::ColorTargetState {
                        format: output.format(),
                        blend: output.blend(),
                        write_mask: wgpu::ColorWrites::ALL,
                    })],
                }),
                multiview_mask: None,
                cache: None,
            });
        Ok(Self {
            pipeline,
            bindings,
            view,
            tools,
            directions,
            index_buffer: storage(gpu, "tool triangles", &indices)?,
            index_count: indices.len() as u32,
        })
    }

    /// Draws `tools` into colour and depth of a finished surface; without tools there is no pass.
    ///
    /// # Panics
    ///
    /// If there are more than [`TOOLS_MAX`].
    pub fn record(
        &self,
        gpu: &Gpu,
        view: &ToolsView,
        tools: &[DrawnTool],
        [color, depth]: [&wgpu::TextureView; 2],
        encoder: &mut wgpu::CommandEncoder,
        timer: &mut Timer,
    ) {
        assert!(tools.len() <= TOOLS_MAX, "at most {TOOLS_MAX} tools");
        if tools.is_empty() {
            return;
        }
        let data: Vec<ToolData> = tools
            .iter()
            .map(|tool| ToolData {
                tip_radius: tool.tip_m.extend(tool.radius_m).to_array(),
                axis: tool.axis_m.extend(0.0).to_array(),
            })
            .collect();
        gpu.queue
            .write_buffer(&self.view, 0, bytemuck::bytes_of(view));
        gpu.queue
            .write_buffer(&self.tools, 0, bytemuck::cast_slice(&data));
        let mut pass = encoder.begin_render_pass(&wgpu::RenderPassDescriptor {
            label: Some(Self::NAME),
            color_attachments: &[kept(color)],
            depth_stencil_attachment: Some(wgpu::RenderPassDepthStencilAttachment {
                view: depth,
                depth_ops: Some(wgpu::Operations {
                    load: wgpu::LoadOp::Load,
                    store: wgpu::StoreOp::Store,
                }),
                stencil_ops: None,
            }),
            timestamp_writes: timer.render(Self::NAME),
            ..Default::default()
        });
        pass.set_pipeline(&self.pipeline);
        pass.set_bind_group(0, &self.bindings, &[]);
        self.draw(&mut pass, tools.len());
    }

    /// What a pipeline needs to draw the same tools elsewhere: places and radii, then directions.
    pub fn bindings(&self) -> [Binding<'_>; 2] {
        [Binding::Read(&self.tools), Binding::Read(&self.directions)]
    }

    /// Draws so many tools by the pipeline that is set.
    pub fn draw(&self, pass: &mut wgpu::RenderPass<'_>, count: usize) {
        pass.set_index_buffer(self.index_buffer.slice(..), wgpu::IndexFormat::Uint32);
        pass.draw_indexed(0..self.index_count, 0, 0..count as u32);
    }
}

/// Unit directions of a capsule along +z, `w` the share of the axis they are moved by, and its triangles.
///
/// The equator is there twice, once for each end, so that the rings between make the rod.
fn unit_capsule() -> (Vec<[f32; 4]>, Vec<u32>) {
    let mut directions = Vec::new();
    for ring in 0..=2 * RINGS + 1 {
        let (ring, end) = if ring <= RINGS {
            (ring, 0.0)
        } else {
            (ring - 1, 1.0)
        };
        let polar = std::f32::consts::PI * ring as f32 / (2 * RINGS) as f32;
        for step in 0..STEPS {
            let around = std::f32::consts::TAU * step as f32 / STEPS as f32;
            let (sin, cos) = polar.sin_cos();
            directions.push([sin * around.cos(), sin * around.sin(), -cos, end]);
        }
    }
    let mut indices = Vec::new();
    for ring in 0..2 * RINGS + 1 {
        for step in 0..STEPS {
            let next = (step + 1) % STEPS;
            let [a, b, c, d] = [
                ring * STEPS + step,
                ring * STEPS + next,
                (ring + 1) * STEPS + step,
                (ring + 1) * STEPS + next,
            ];
            indices.extend([a, b, c, b, d, c]);
        }
    }
    (directions, indices)
}

/// Where the vertex shader puts a direction: twin of `on_tool` in `shaders/capsule.wgsl`.
#[cfg(test)]
fn capsule_point(tool: &DrawnTool, n: [f32; 4]) -> Vec3 {
    let along = tool.axis_m.try_normalize().unwrap_or(Vec3::Z);
    let side = if along.x.abs() > 0.9 {
        Vec3::Y
    } else {
        Vec3::X
    };
    let across = side.cross(along).normalize();
    let normal = n[0] * across + n[1] * along.cross(across) + n[2] * along;
    tool.tip_m + n[3] * tool.axis_m + tool.radius_m * normal
}

#[cfg(test)]
mod tests {
    use super::*;

    const TOOL: DrawnTool = DrawnTool {
        tip_m: Vec3::new(0.3, -0.1, 0.2),
        axis_m: Vec3::new(0.5, 0.2, -0.1),
        radius_m: 0.05,
    };

    #[test]
    fn every_vertex_lies_on_the_capsule() {
        for n in unit_capsule().0 {
            let x = capsule_point(&TOOL, n) - TOOL.tip_m;
            let along = (x.dot(TOOL.axis_m) / TOOL.axis_m.length_squared()).clamp(0.0, 1.0);
            let distance = (x - along * TOOL.axis_m).length();
            assert!((distance - TOOL.radius_m).abs() < 1e-6, "{n:?}: {distance}");
        }
    }

    #[test]
    fn triangles_face_outwards() {
        let (directions, indices) = unit_capsule();
        let middle = TOOL.tip_m + 0.5 * TOOL.axis_m;
        let volume: f32 = indices
            .chunks_exact(3)
            .map(|t| {
                let [a, b, c] =
                    [0, 1, 2].map(|k| capsule_point(&TOOL, directions[t[k] as usize]) - middle);
                a.dot(b.cross(c)) / 6.0
            })
            .sum();
        let (r, l) = (TOOL.radius_m, TOOL.axis_m.length());
        let exact = std::f32::consts::PI * r * r * (l + 4.0 / 3.0 * r);
        // A ring of 32 steps encloses 0.6 % less than a circle.
        assert!(
            (volume / exact - 1.0).abs() < 0.02,
            "{volume} m³, not {exact}"
        );
    }
}
