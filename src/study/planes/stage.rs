//! The passes of the product that bring a body's light paths up to date, run frame by frame and read back.

use super::body::Body;
use super::estimate::{DepthMap, Drawn, DrawnPrimitives};
use crate::geom::plane::LightPathMethod;
use crate::gpu::{Gpu, GpuError, Timer, read_buffer, read_texture_depth, read_texture_rgba8};
use crate::passes::depth_maps::{DepthMaps, views};
use crate::passes::light_path::{LightPath, LightPathKnobs, Primitives, RefitCounts, patch_share};
use crate::passes::mesh_buffers::MeshBuffers;
use crate::passes::tangents::Tangents;
use crate::scene::PlacedLight;
use glam::{DVec3, Mat4, Vec3};

/// How far a point moves before a fit takes notice, as a share of the radius: what scenes have.
const TOLERANCE_SHARE: f32 = 1.0 / 4000.0;
/// What a method is told where light is followed for `light_radius_m`; `skip_m` as [`LightPathKnobs`] has it.
pub fn knobs(method: LightPathMethod, light_radius_m: f32, skip_m: f32) -> LightPathKnobs {
    let radius_m = patch_share(method) * light_radius_m;
    LightPathKnobs {
        method,
        radius_m,
        tolerance_m: TOLERANCE_SHARE * radius_m,
        skip_m,
    }
}

/// Passes that are timed.
const TIMED_PASSES_MAX: u32 = 8;

/// A body, its normals, and one method.
pub struct Stage {
    gpu: Gpu,
    buffers: MeshBuffers,
    tangents: Tangents,
    path: LightPath,
    /// The map of one light, for the method that draws one.
    depth_map: Option<DepthMaps>,
    timer: Timer,
}

/// GPU time of a frame [ms]; nothing without timestamps.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FrameTimes {
    /// Of the light-path passes.
    pub refit: Option<f32>,
    /// Of these and the normals and tangents before them.
    pub all: Option<f32>,
}

impl Stage {
    /// Builds the passes of a method for the body at rest, moved by `origin_m`.
    ///
    /// # Errors
    ///
    /// [`GpuError`] if the adapter refuses a list or a kernel.
    pub fn new(
        gpu: &Gpu,
        body: &Body,
        knobs: LightPathKnobs,
        origin_m: Vec3,
    ) -> Result<Self, GpuError> {
        let mut mesh = body.mesh.clone();
        for point in &mut mesh.points {
            *point += origin_m;
        }
        let buffers = MeshBuffers::new(gpu, &mesh)?;
        let tangents = Tangents::new(gpu, &mesh, &buffers)?;
        let path = LightPath::new(gpu, knobs, &mesh, &buffers, &tangents)?;
        let depth_map = match knobs.method {
            LightPathMethod::DepthMap => Some(DepthMaps::new(gpu, &mesh, 1, &tangents)?),
            _ => None,
        };
        Ok(Self {
            gpu: gpu.clone(),
            depth_map,
            buffers,
            tangents,
            path,
            timer: Timer::new(gpu, TIMED_PASSES_MAX),
        })
    }

    /// One frame with the surface at `points` [m].
    ///
    /// # Errors
    ///
    /// [`GpuError::ReadBack`] if the times can't be read.
    pub fn frame(&mut self, points: &[Vec3]) -> Result<FrameTimes, GpuError> {
        self.record(points, true);
        if !self.gpu.has_timestamps {
            return Ok(FrameTimes::default());
        }
        let times = self.timer.read(&self.gpu)?;
        let refit = times.iter().filter(|time| time.name != Tangents::NAME);
        Ok(FrameTimes {
            refit: Some(refit.fold(0.0, |sum, time| sum + time.gpu_ms)),
            all: Some(times.iter().map(|time| time.gpu_ms).sum()),
        })
    }

    /// One frame whose times nobody asks for.
    pub fn untimed_frame(&mut self, points: &[Vec3]) {
        self.record(points, false);
    }

    fn record(&mut self, points: &[Vec3], resolves: bool) {
        self.buffers.upload(&self.gpu, points);
        self.timer.begin_frame();
        let mut encoder = self.gpu.encoder();
        self.tangents.record(&mut encoder, &mut self.timer);
        self.path.record(&mut encoder, &mut self.timer);
        if let Some(map) = &self.depth_map {
            let light = far_light(Vec3::Y);
            let (gpu, mesh) = (&self.gpu, &self.buffers);
            map.record(gpu, &[light], points, mesh, &mut encoder, &mut self.timer);
        }
        if resolves {
            self.timer.resolve(&mut encoder);
        }
        self.gpu.submit_and_wait(encoder);
    }

    /// What the last frame found moved and fitted.
    ///
    /// # Errors
    ///
    /// [`GpuError::ReadBack`] if it can't be read.
    pub fn counts(&self) -> Result<RefitCounts, GpuError> {
        self.path.counts(&self.gpu)
    }

    /// What the shaders would read with the surface at `points` [m], where the last frame left it, and with these
    /// lights of each eye.
    ///
    /// # Errors
    ///
    /// [`GpuError::ReadBack`] if it can't be read.
    pub fn drawn(&mut self, points: &[Vec3], lights: &[[DVec3; 3]]) -> Result<Drawn, GpuError> {
        let primitives = match self.path.primitives() {
            Primitives::Tangent => DrawnPrimitives::Tangent,
            Primitives::Planes(buffer) => DrawnPrimitives::Planes(read_buffer(&self.gpu, buffer)?),
            Primitives::Quadrics(buffer) => {
                DrawnPrimitives::Quadrics(read_buffer(&self.gpu, buffer)?)
            }
            Primitives::DepthMaps => {
                let mut maps = Vec::new();
                for of_eye in lights {
                    let mut of_lights = Vec::new();
                    for toward in of_eye {
                        of_lights.extend(self.depth_map_of(points, toward.as_vec3())?);
                    }
                    maps.push(of_lights);
                }
                DrawnPrimitives::DepthMaps(maps)
            }
        };
        Ok(Drawn {
            normals: read_buffer(&self.gpu, &self.tangents.normals)?,
            primitives,
        })
    }

    fn depth_map_of(&mut self, points: &[Vec3], toward: Vec3) -> Result<Vec<DepthMap>, GpuError> {
        let pass = self.depth_map.as_ref().expect("the method draws one");
        let light = far_light(toward);
        let mut encoder = self.gpu.encoder();
        self.timer.begin_frame();
        pass.record(
            &self.gpu,
            &[light],
            points,
            &self.buffers,
            &mut encoder,
            &mut self.timer,
        );
        self.gpu.submit_and_wait(encoder);
        read_depth_maps(&self.gpu, pass, &[light], points)
    }
}

/// The maps that `pass` drew last of `lights` with the surface at `points` [m], one a light.
///
/// # Errors
///
/// [`GpuError::ReadBack`] if they can't be read.
pub fn read_depth_maps(
    gpu: &Gpu,
    pass: &DepthMaps,
    lights: &[PlacedLight],
    points: &[Vec3],
) -> Result<Vec<DepthMap>, GpuError> {
    let views = views(lights, points);
    let depth = read_texture_depth(gpu, &pass.depth.texture)?;
    // Four bytes a texel, whatever they mean.
    let normals: Vec<u32> =
        bytemuck::pod_collect_to_vec(&read_texture_rgba8(gpu, &pass.normals.texture)?);
    let side = pass.depth.texture.height();
    let (width, tile) = (pass.depth.texture.width() as usize, side as usize);
    Ok((0..lights.len())
        .map(|k| {
            // They lie side by side.
            let columns = |row: usize| row * width + k * tile..row * width + (k + 1) * tile;
            DepthMap {
                clip_from_world: Mat4::from_cols_array(&views.clip_from_world[k]),
                world_from_clip: Mat4::from_cols_array(&views.world_from_clip[k]),
                slack_m: views.slack_m[k],
                side,
                depth: (0..tile)
                    .flat_map(|row| depth[columns(row)].iter().copied())
                    .collect(),
                normals: (0..tile)
                    .flat_map(|row| normals[columns(row)].iter().copied())
                    .collect(),
            }
        })
        .collect())
}

fn far_light(toward: Vec3) -> PlacedLight {
    PlacedLight {
        place: toward,
        is_point: false,
        power: Vec3::ONE,
        shadow: false,
    }
}

#[cfg(test)]
mod tests {
    use super::super::body::Shape;
    use super::*;

    #[test]
    fn maps_of_a_still_body_are_not_drawn_again_and_those_of_a_moved_one_are() {
        let gpu = Gpu::headless().expect("an adapter, such as mesa-vulkan-drivers");
        if !gpu.has_timestamps {
            println!("no timestamps on this adapter: not run");
            return;
        }
        let body = Body::of_shape(Shape::Blob, 600, 0.1);
        let knobs = knobs(LightPathMethod::DepthMap, 0.01, 0.0);
        let mut stage = Stage::new(&gpu, &body, knobs, Vec3::ZERO).expect("it builds");
        let mut points = body.mesh.points.clone();
        let mut drawn = |points: &[Vec3]| {
            let times = stage.frame(points).expect("times can be read");
            times.refit.expect("there are timestamps") > 0.0
        };
        assert!(drawn(&points));
        assert!(!drawn(&points), "nothing has moved");
        points[0].x += 1e-3;
        assert!(drawn(&points));
    }
}
