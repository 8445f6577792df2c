//! A surface that stands still, drawn by the passes of a frame: for pictures that are compared and times that are
//! charted.

use super::AppError;
use crate::geom::SurfaceMesh;
use crate::geom::paint::TissueMaps;
use crate::gpu::{Gpu, PassTime, Timer, read_texture_rgba16f};
use crate::passes::draw::Output;
use crate::passes::frame::FramePasses;
use crate::passes::view::View;
use crate::scene::{RestBox, Scene};
use glam::Vec3;

/// Passes of a frame that are timed.
const TIMED_PASSES_MAX: u32 = 32;

/// The passes of a scene with its surface and camera.
pub struct Still {
    gpu: Gpu,
    passes: FramePasses,
    timer: Timer,
    points: Vec<Vec3>,
    view: View,
}

impl Still {
    /// Builds what `scene` needs to draw `mesh` with `maps`, seen by `view`, in pictures of `size` [px].
    ///
    /// # Errors
    ///
    /// [`AppError::Gpu`] naming the pass that can't be built.
    pub fn new(
        gpu: &Gpu,
        scene: &Scene,
        mesh: &SurfaceMesh,
        maps: &TissueMaps,
        view: View,
        size: [u32; 2],
    ) -> Result<Self, AppError> {
        let (low, high) = mesh.bounds();
        let rest = RestBox { low, high };
        Ok(Self {
            passes: FramePasses::new(gpu, scene, &rest, mesh, maps, size, Output::Radiance)?,
            timer: Timer::new(gpu, TIMED_PASSES_MAX),
            gpu: gpu.clone(),
            points: mesh.points.clone(),
            view,
        })
    }

    /// Draws it once more; the GPU time of each pass.
    ///
    /// # Errors
    ///
    /// [`AppError::Gpu`] if the times can't be read.
    pub fn draw(&mut self) -> Result<Vec<PassTime>, AppError> {
        let mut encoder = self.gpu.encoder();
        self.timer.begin_frame();
        self.passes.record(
            &self.gpu,
            &self.points,
            &self.view,
            &[],
            &mut encoder,
            &mut self.timer,
        );
        self.timer.resolve(&mut encoder);
        self.gpu.submit_and_wait(encoder);
        Ok(self.timer.read(&self.gpu)?)
    }

    /// Linear radiance of the last picture, RGB, row by row from the top; 0 where there is nothing.
    ///
    /// # Errors
    ///
    /// [`AppError::Gpu`] if it can't be read back.
    pub fn radiance(&self) -> Result<Vec<f32>, AppError> {
        let rgba = read_texture_rgba16f(&self.gpu, &self.passes.target.texture)?;
        Ok(rgba
            .chunks_exact(4)
            .flat_map(|pixel| &pixel[..3])
            .copied()
            .collect())
    }
}
