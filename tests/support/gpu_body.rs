//! A surface on the GPU with its normals and tangents, what the twins need to know of it, and how differences between
//! both are summed up.

#[path = "shader.rs"]
mod shader;

pub use shader::{gpu, sabotaged};

use super::surfaces::{sphere, wavy};
use glam::{Vec3, Vec4};
use palpate::geom::SurfaceMesh;
use palpate::geom::patch::Patches;
use palpate::geom::plane::LightPathMethod;
use palpate::geom::tangent::{Fans, point_normals, rest_normals};
use palpate::gpu::{Gpu, Timer, join, read_buffer};
use palpate::passes::light_path::{LightPath, LightPathKnobs};
use palpate::passes::mesh_buffers::MeshBuffers;
use palpate::passes::tangents::Tangents;

/// Reach of a patch on the test surfaces [m]: 2 to 60 members, by the surface's fineness.
pub const RADIUS_M: f32 = 0.012;

/// Waves of so many points a side, and one surface with a seam and poles.
pub fn surfaces(sides: &[usize]) -> Vec<(String, SurfaceMesh)> {
    let waves = sides.iter();
    let mut all: Vec<_> = waves
        .map(|&side| (format!("{side} x {side} points"), wavy(side)))
        .collect();
    all.push(("a sphere".to_owned(), sphere(0.04, 40, 21)));
    all
}

/// A surface on the GPU.
pub struct GpuBody {
    pub mesh: SurfaceMesh,
    pub buffers: MeshBuffers,
    pub tangents: Tangents,
    pub fans: Fans,
    pub rest_normals: Vec<Vec3>,
    pub patches: Patches,
}

impl GpuBody {
    pub fn new(gpu: &Gpu, mesh: SurfaceMesh) -> Self {
        let sources = [join(Tangents::NORMALS_WGSL), join(Tangents::TANGENTS_WGSL)];
        Self::with_sources(gpu, mesh, &sources)
    }

    /// The same with other WGSL for normals and tangents.
    pub fn with_sources(gpu: &Gpu, mesh: SurfaceMesh, sources: &[String; 2]) -> Self {
        let buffers = MeshBuffers::new(gpu, &mesh).expect("the surface fits");
        let tangents =
            Tangents::with_sources(gpu, &mesh, &buffers, sources).expect("the pass is built");
        let fans = Fans::new(&mesh);
        let rest_normals = rest_normals(&mesh, &fans);
        let patches = Patches::new(&mesh.points, &rest_normals, RADIUS_M);
        Self {
            mesh,
            buffers,
            tangents,
            fans,
            rest_normals,
            patches,
        }
    }

    /// One frame with the surface at `points` [m].
    pub fn frame(
        &self,
        gpu: &Gpu,
        points: &[Vec3],
        record: impl FnOnce(&mut wgpu::CommandEncoder, &mut Timer),
    ) {
        self.buffers.upload(gpu, points);
        let mut timer = Timer::new(gpu, 4);
        let mut encoder = gpu.encoder();
        self.tangents.record(&mut encoder, &mut timer);
        record(&mut encoder, &mut timer);
        gpu.queue.submit([encoder.finish()]);
    }

    pub fn light_path(&self, gpu: &Gpu, method: LightPathMethod, tolerance_m: f32) -> LightPath {
        let knobs = LightPathKnobs {
            method,
            radius_m: RADIUS_M,
            tolerance_m,
            skip_m: 0.0,
        };
        LightPath::new(gpu, knobs, &self.mesh, &self.buffers, &self.tangents)
            .expect("the pass is built")
    }

    pub fn twin_normals(&self, points: &[Vec3]) -> Vec<Vec3> {
        point_normals(&self.fans, points, &self.rest_normals)
    }

    /// The normals that the last frame left.
    pub fn normals(&self, gpu: &Gpu) -> Vec<Vec3> {
        let normals: Vec<Vec4> = read_buffer(gpu, &self.tangents.normals).expect("can be read");
        normals.iter().map(|n| n.truncate()).collect()
    }
}

/// The value that a share of all does not exceed.
pub fn percentile(mut values: Vec<f64>, share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * share).round() as usize]
}

/// Not a number counts as infinitely far.
pub fn worst(differences: impl Iterator<Item = f32>) -> f32 {
    differences.fold(0.0, |worst, d| {
        if d <= worst {
            worst
        } else if d.is_nan() {
            f32::INFINITY
        } else {
            d
        }
    })
}
