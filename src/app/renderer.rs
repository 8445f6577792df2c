//! A session drawn: the passes of its scene, their times, and what can be read back.

use super::light_error::Snapshot;
use super::orbit::Orbit;
use super::{AppError, Session, load};
use crate::geom::paint::TissueMaps;
use crate::gpu::{
    Gpu, PassTime, Timer, read_buffer, read_texture_depth, read_texture_rgba8, read_texture_rgba16f,
};
use crate::passes::draw::Output;
use crate::passes::frame::{FramePasses, effective_method, light_radius_m};
use crate::passes::light_path::{Primitives, RefitCounts};
use crate::passes::tools::DrawnTool;
use crate::passes::view::View;
use crate::scene::{Quadrature, Scene};
use crate::study::planes::{Blend, Drawn, DrawnPrimitives, read_depth_maps};
use glam::Vec3;
use image::RgbaImage;
use std::sync::Arc;

/// Passes that are timed in a frame; a gooey scene with eight blurs has nineteen.
const TIMED_PASSES_MAX: u32 = 32;

/// The GPU side of a session.
pub struct Renderer {
    gpu: Gpu,
    passes: FramePasses,
    timer: Timer,
    /// Kept for a change of surface or light path: painting takes seconds.
    tissue: Arc<TissueMaps>,
    /// How the last frame was seen, and the tools in it.
    last: Option<(View, Vec<DrawnTool>)>,
}

/// What drawing one frame took.
#[derive(Clone, Debug, Default)]
pub struct Frame {
    /// GPU time of every pass.
    pub passes: Vec<PassTime>,
    /// How many planes were made anew.
    pub refit: RefitCounts,
}

impl Renderer {
    /// Builds the passes of the session's scene for pictures of `size` [px].
    ///
    /// # Errors
    ///
    /// [`AppError`] naming the texture or the pass that can't be used.
    pub fn new(gpu: Gpu, session: &Session, size: [u32; 2]) -> Result<Self, AppError> {
        let maps = load::maps(&session.scene.body, &session.mesh, &session.pictures)?;
        let tissue = Arc::new(maps);
        Self::with_maps(gpu, session, tissue, size)
    }

    /// The same session with the passes that its scene asks for now, on the same maps.
    ///
    /// # Errors
    ///
    /// [`AppError::Gpu`] naming the pass that can't be used.
    pub fn rebuilt(&self, session: &Session) -> Result<Self, AppError> {
        Self::with_maps(self.gpu.clone(), session, self.tissue.clone(), self.size())
    }

    fn with_maps(
        gpu: Gpu,
        session: &Session,
        tissue: Arc<TissueMaps>,
        size: [u32; 2],
    ) -> Result<Self, AppError> {
        let mut passes = FramePasses::new(
            &gpu,
            &session.scene,
            &session.rest,
            &session.mesh,
            &tissue,
            size,
            Output::Picture,
        )?;
        if session.scene.surface.is_translucent()
            && let Some(path) = &session.scene.surface.absorption.ramp
        {
            passes.set_ramp(&gpu, load::ramp(path)?);
        }
        Ok(Self {
            timer: Timer::new(&gpu, TIMED_PASSES_MAX),
            gpu,
            passes,
            tissue,
            last: None,
        })
    }

    /// Name of the adapter.
    pub fn adapter(&self) -> &str {
        &self.gpu.adapter
    }

    /// Width and height of the picture [px].
    pub fn size(&self) -> [u32; 2] {
        self.passes.size()
    }

    /// Makes the picture another size.
    pub fn resize(&mut self, size: [u32; 2]) {
        self.passes.resize(&self.gpu, size);
        self.last = None;
    }

    /// Takes over changed knobs of the surface.
    pub fn set_knobs(&mut self, scene: &Scene) {
        self.passes.set_knobs(&self.gpu, &scene.surface);
    }

    /// Takes over lights that were turned or dimmed; other kinds of light need [`Renderer::rebuilt`].
    pub fn set_lights(&mut self, session: &Session) {
        self.passes.set_lights(&session.scene, &session.rest);
    }

    /// The texture maps of the body.
    pub fn tissue(&self) -> &TissueMaps {
        &self.tissue
    }

    /// The camera that the scene asks for; moved back where the picture is narrow.
    pub fn scene_orbit(&self, session: &Session) -> Orbit {
        let camera = &session.scene.camera;
        let (eye, target) = camera.eye_and_target(&session.rest);
        let [width, height] = self.size();
        Orbit::new(eye, target, camera.up, camera.fov_y_deg.to_radians())
            .fitted(width as f32 / height as f32)
    }

    /// Draws one frame and waits for it. `volumes` say what the tissue at each point would fill if nothing pressed it,
    /// over that at rest, where that changes.
    ///
    /// # Errors
    ///
    /// [`AppError::Gpu`] if its times or counts can't be read.
    pub fn draw(
        &mut self,
        points: &[Vec3],
        volumes: Option<&[f32]>,
        orbit: &Orbit,
        tools: &[DrawnTool],
    ) -> Result<Frame, AppError> {
        if let Some(volumes) = volumes {
            self.passes.mesh.set_volumes(volumes);
        }
        let mut encoder = self.gpu.encoder();
        self.timer.begin_frame();
        let view = orbit.view();
        self.passes.record(
            &self.gpu,
            points,
            &view,
            tools,
            &mut encoder,
            &mut self.timer,
        );
        self.timer.resolve(&mut encoder);
        self.gpu.submit_and_wait(encoder);
        self.last = Some((view, tools.to_vec()));
        Ok(Frame {
            passes: self.timer.read(&self.gpu)?,
            refit: self.passes.refit_counts(&self.gpu)?,
        })
    }

    /// The finished picture, for the window to show.
    pub fn picture_view(&self) -> &wgpu::TextureView {
        &self.passes.target.view
    }

    /// The finished picture.
    ///
    /// # Errors
    ///
    /// [`AppError::Gpu`] if it can't be read back.
    pub fn picture(&self) -> Result<RgbaImage, AppError> {
        let pixels = read_texture_rgba8(&self.gpu, &self.passes.target.texture)?;
        let [width, height] = self.size();
        Ok(RgbaImage::from_raw(width, height, pixels).expect("as many pixels as the target has"))
    }

    /// Linear radiance before the tone curve of the frame drawn last, RGB, row by row from the top.
    ///
    /// # Errors
    ///
    /// [`AppError::Gpu`] if it can't be drawn or read back.
    ///
    /// # Panics
    ///
    /// If no frame was drawn since the picture got its size.
    pub fn radiance(&self) -> Result<Vec<f32>, AppError> {
        let (view, tools) = self.last.as_ref().expect("a frame was drawn");
        let drawn = self.passes.radiance(&self.gpu, view, tools)?;
        let rgba = read_texture_rgba16f(&self.gpu, &drawn.texture)?;
        Ok(rgba
            .chunks_exact(4)
            .flat_map(|pixel| &pixel[..3])
            .copied()
            .collect())
    }

    /// Depth, 0 near to 1 far, row by row from the top.
    ///
    /// # Errors
    ///
    /// [`AppError::Gpu`] if it can't be read back.
    pub fn depth(&self) -> Result<Vec<f32>, AppError> {
        Ok(read_texture_depth(
            &self.gpu,
            &self.passes.targets.depth.texture,
        )?)
    }

    /// What the light path's error is asked of, with the surface at `points` [m], where it was last drawn; `None` for a
    /// surface that follows no light below it.
    ///
    /// # Errors
    ///
    /// [`AppError::Gpu`] if the primitives can't be read back.
    pub fn snapshot(&self, session: &Session, orbit: &Orbit) -> Result<Option<Snapshot>, AppError> {
        if effective_method(&session.scene).is_none() {
            return Ok(None);
        }
        let (gpu, lights) = (&self.gpu, self.passes.lights());
        let points = session.points();
        let primitives = match self.passes.light_path.primitives() {
            Primitives::Tangent => DrawnPrimitives::Tangent,
            Primitives::Planes(buffer) => DrawnPrimitives::Planes(read_buffer(gpu, buffer)?),
            Primitives::Quadrics(buffer) => DrawnPrimitives::Quadrics(read_buffer(gpu, buffer)?),
            Primitives::DepthMaps => {
                let pass = self.passes.depth_maps().expect("the method draws them");
                let maps = read_depth_maps(gpu, pass, lights, points)?;
                DrawnPrimitives::DepthMaps(maps.into_iter().map(|map| vec![map]).collect())
            }
        };
        let is_planes = matches!(primitives, DrawnPrimitives::Planes(_));
        Ok(Some(Snapshot {
            points: points.to_vec(),
            triangles: session.mesh.point_triangles(),
            drawn: Drawn {
                normals: read_buffer(gpu, &self.passes.tangents.normals)?,
                primitives,
            },
            blend: match session.scene.surface.quadrature {
                Quadrature::Published if is_planes => Blend::Published,
                _ => Blend::Squared,
            },
            lights: lights.to_vec(),
            radius_m: light_radius_m(&session.scene),
            orbit: *orbit,
            size: self.size(),
            time_s: session.time_s(),
        }))
    }

    /// Normals a point, tangents a vertex, primitives a point (none for the tangent plane).
    ///
    /// # Errors
    ///
    /// [`AppError::Gpu`] if they can't be read back.
    pub fn geometry(&self) -> Result<DrawnGeometry, AppError> {
        let read = |buffer: &wgpu::Buffer| read_buffer::<[f32; 4]>(&self.gpu, buffer);
        Ok(DrawnGeometry {
            normals: read(&self.passes.tangents.normals)?,
            tangents: read(&self.passes.tangents.tangents)?,
            primitives: match self.passes.light_path.primitives() {
                Primitives::Tangent | Primitives::DepthMaps => None,
                Primitives::Planes(buffer) => Some((4, read(buffer)?)),
                Primitives::Quadrics(buffer) => Some((8, read(buffer)?)),
            },
        })
    }
}

/// What the shaders read of the surface, as it was last drawn.
pub struct DrawnGeometry {
    /// Unit normal of each point.
    pub normals: Vec<[f32; 4]>,
    /// Unit tangent of each vertex, handedness in the last.
    pub tangents: Vec<[f32; 4]>,
    /// Numbers of each point's primitive, and one vector after another of them.
    pub primitives: Option<(usize, Vec<[f32; 4]>)>,
}
