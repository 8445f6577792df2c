//! XPBD on edge lengths and tetrahedron volumes.
//!
//! Springs along all edges of a mesh act, on average over directions, as an elastic body whose two
//! Lamé moduli are equal. So the springs carry the shear modulus, and the volumes carry what the
//! first modulus is above it (nothing below ν = 1/4).

use super::{
    Lame,
    constraint::LENGTH_MIN_M,
    lanes::{Colored, Corner, Corners, LANES, Lanes, Lanes3, ParticleAccess},
    mass_spring::edges_of,
};
use crate::geom::TetMesh;
use glam::Vec4;

/// Modulus of springs over the shear modulus they give, μ = 2E/5: see `mass_spring`.
pub const SPRING_PER_SHEAR_MODULUS: f32 = 2.5;

/// Eight edges.
#[derive(Clone, Debug)]
#[repr(C, align(32))]
struct EdgeBatch {
    corners: Corners<2>,
    rest_length: Lanes,
    /// Compliance times spring modulus, L²/V [1/m].
    geometry: Lanes,
    lambda: Lanes,
}

/// Eight volumes.
#[derive(Clone, Debug)]
#[repr(C, align(32))]
struct VolumeBatch {
    corners: Corners<4>,
    rest_volume: Lanes,
    /// Compliance times modulus, V₀²/V [m³].
    geometry: Lanes,
    lambda: Lanes,
}

/// All edges and volumes of a body.
#[derive(Clone, Debug)]
pub struct Springs {
    edges: Colored<EdgeBatch>,
    volumes: Colored<VolumeBatch>,
}

/// One over modulus and h² [1/(Pa s²)], for edges and for volumes; `None` where nothing resists.
#[derive(Clone, Copy)]
struct Compliance {
    edge: f32,
    volume: Option<f32>,
}

impl Compliance {
    fn new(lame: Lame, substep_s: f32) -> Self {
        let h2 = substep_s * substep_s;
        let bulk = lame.lambda_pa - lame.mu_pa;
        Self {
            edge: 1.0 / (SPRING_PER_SHEAR_MODULUS * lame.mu_pa * h2),
            volume: (bulk > 0.0).then(|| 1.0 / (bulk * h2)),
        }
    }
}

impl Springs {
    /// Edges and volumes of the tetrahedra `sound` of `mesh`, of which `fill` is tissue.
    pub fn new(mesh: &TetMesh, sound: &[u32], fill: &[f32]) -> Self {
        let particle_count = mesh.particles.len();
        let springs = edges_of(mesh, sound, fill);
        let corners: Vec<[u32; 2]> = springs.iter().map(|edge| edge.particles).collect();
        let edges = Colored::new(&corners, particle_count, |members, corners| {
            let mut batch = EdgeBatch {
                corners,
                rest_length: Lanes::splat(1.0),
                geometry: Lanes::splat(1.0),
                lambda: Lanes::default(),
            };
            for (lane, &member) in members.iter().enumerate() {
                let edge = &springs[member as usize];
                batch.rest_length.0[lane] = edge.rest_length_m;
                batch.geometry.0[lane] = 1.0 / edge.stiffness_per_modulus_m;
            }
            batch
        });
        let corners: Vec<[u32; 4]> = sound.iter().map(|&tet| mesh.tets[tet as usize]).collect();
        let volumes = Colored::new(&corners, particle_count, |members, corners| {
            let mut batch = VolumeBatch {
                corners,
                rest_volume: Lanes::splat(1.0),
                geometry: Lanes::splat(1.0),
                lambda: Lanes::default(),
            };
            for (lane, &member) in members.iter().enumerate() {
                let tet = sound[member as usize] as usize;
                let volume = super::diagnose::rest_volume_m3(mesh, tet) as f32;
                batch.rest_volume.0[lane] = volume;
                batch.geometry.0[lane] = volume / fill[tet];
            }
            batch
        });
        Self { edges, volumes }
    }

    /// Sets all multipliers to 0, as a substep starts.
    pub fn begin_substep(&mut self) {
        for batch in self.edges.batches_mut() {
            batch.lambda = Lanes::default();
        }
        for batch in self.volumes.batches_mut() {
            batch.lambda = Lanes::default();
        }
    }

    /// One sweep over all edges, then over all volumes.
    pub fn project(&mut self, particles: &mut [Vec4], lame: Lame, substep_s: f32) {
        let compliance = Compliance::new(lame, substep_s);
        self.edges.for_each_colored(particles, |run, access| {
            project_edges(run, access, compliance.edge);
        });
        if let Some(compliance) = compliance.volume {
            self.volumes.for_each_colored(particles, |run, access| {
                project_volumes(run, access, compliance);
            });
        }
    }

    /// Sum of squares of all residuals C + α̃λ, each over its rest length or volume, and how many
    /// there are.
    pub fn residual(&self, particles: &mut [Vec4], lame: Lame, substep_s: f32) -> (f64, usize) {
        let compliance = Compliance::new(lame, substep_s);
        let unused = particles.len() as u32 - 1;
        let access = ParticleAccess::reading(particles);
        let (mut sum, mut count) = (0.0, 0);
        let mut add = |corner: &[u32; LANES], residual: Lanes, rest: Lanes| {
            for lane in (0..LANES).filter(|&lane| corner[lane] != unused) {
                sum += f64::from(residual.0[lane] / rest.0[lane]).powi(2);
                count += 1;
            }
        };
        for batch in self.edges.batches() {
            let corners = [0, 1].map(|k| access.gather(&batch.corners[k]));
            let residual = edge_value(batch, &corners).0
                + batch.geometry.times(compliance.edge) * batch.lambda;
            add(&batch.corners[0], residual, batch.rest_length);
        }
        if let Some(compliance) = compliance.volume {
            for batch in self.volumes.batches() {
                let corners = [0, 1, 2, 3].map(|k| access.gather(&batch.corners[k]));
                let residual = volume_value(batch, &corners).0
                    + batch.geometry.times(compliance) * batch.lambda;
                add(&batch.corners[0], residual, batch.rest_volume);
            }
        }
        (sum, count)
    }
}

fn project_edges(run: &mut [EdgeBatch], access: ParticleAccess, compliance: f32) {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the machine has AVX2.
        return unsafe { project_edges_avx2(run, access, compliance) };
    }
    for batch in run {
        project_edge_batch(batch, access, compliance);
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn project_edges_avx2(run: &mut [EdgeBatch], access: ParticleAccess, compliance: f32) {
    for batch in run {
        project_edge_batch(batch, access, compliance);
    }
}

fn project_volumes(run: &mut [VolumeBatch], access: ParticleAccess, compliance: f32) {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the machine has AVX2.
        return unsafe { project_volumes_avx2(run, access, compliance) };
    }
    for batch in run {
        project_volume_batch(batch, access, compliance);
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn project_volumes_avx2(run: &mut [VolumeBatch], access: ParticleAccess, compliance: f32) {
    for batch in run {
        project_volume_batch(batch, access, compliance);
    }
}

/// Value and direction of `constraint::distance`; no direction where the particles coincide.
#[inline(always)]
fn edge_value(batch: &EdgeBatch, corners: &[Corner; 2]) -> (Lanes, Lanes3) {
    let edge = corners[0].position - corners[1].position;
    let length = edge.dot(edge).map(f32::sqrt);
    let inverse = Lanes::where_below(
        length,
        LENGTH_MIN_M,
        Lanes::default(),
        length.map(|l| 1.0 / l.max(LENGTH_MIN_M)),
    );
    (length - batch.rest_length, edge.scaled(inverse))
}

#[inline(always)]
fn project_edge_batch(batch: &mut EdgeBatch, access: ParticleAccess, compliance: f32) {
    let mut corners = [
        access.gather(&batch.corners[0]),
        access.gather(&batch.corners[1]),
    ];
    let (value, direction) = edge_value(batch, &corners);
    let alpha = batch.geometry.times(compliance);
    let effective = (corners[0].inverse_mass + corners[1].inverse_mass) * direction.dot(direction);
    let delta = -(value + alpha * batch.lambda) * (effective + alpha).map(|x| 1.0 / x);
    batch.lambda = batch.lambda + delta;
    let step = direction.scaled(delta);
    corners[0].position = corners[0].position + step.scaled(corners[0].inverse_mass);
    corners[1].position = corners[1].position - step.scaled(corners[1].inverse_mass);
    access.scatter(&batch.corners[0], corners[0]);
    access.scatter(&batch.corners[1], corners[1]);
}

/// Value and gradients of `constraint::volume`.
#[inline(always)]
fn volume_value(batch: &VolumeBatch, corners: &[Corner; 4]) -> (Lanes, [Lanes3; 4]) {
    let origin = corners[0].position;
    let a = corners[1].position - origin;
    let b = corners[2].position - origin;
    let c = corners[3].position - origin;
    let sixth = Lanes::splat(1.0 / 6.0);
    let g1 = b.cross(c).scaled(sixth);
    let g2 = c.cross(a).scaled(sixth);
    let g3 = a.cross(b).scaled(sixth);
    (a.dot(g1) - batch.rest_volume, [-(g1 + g2 + g3), g1, g2, g3])
}

#[inline(always)]
fn project_volume_batch(batch: &mut VolumeBatch, access: ParticleAccess, compliance: f32) {
    let mut corners = [
        access.gather(&batch.corners[0]),
        access.gather(&batch.corners[1]),
        access.gather(&batch.corners[2]),
        access.gather(&batch.corners[3]),
    ];
    let (value, gradient) = volume_value(batch, &corners);
    let alpha = batch.geometry.times(compliance);
    let mut effective = alpha;
    for k in 0..4 {
        effective = effective + corners[k].inverse_mass * gradient[k].dot(gradient[k]);
    }
    let delta = -(value + alpha * batch.lambda) * effective.map(|x| 1.0 / x);
    batch.lambda = batch.lambda + delta;
    for k in 0..4 {
        let step = gradient[k].scaled(delta * corners[k].inverse_mass);
        corners[k].position = corners[k].position + step;
        access.scatter(&batch.corners[k], corners[k]);
    }
}
