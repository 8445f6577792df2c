//! XPBD on edge lengths and tetrahedron volumes.
//!
//! Springs along all edges of a mesh act, on average over directions, as an elastic body whose two
//! Lamé moduli are equal. So the springs carry the shear modulus, and the volumes carry what the
//! first modulus is above it (nothing below ν = 1/4).

use super::{
    Lame,
    constraint::LENGTH_MIN_M,
    lanes::{Batches, Corner, Corners, LANES, Lanes, Lanes3, ParticleAccess},
    mass_spring::edges_of,
    muscle::{Muscle, Pull},
    team::Team,
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
    edges: Batches<EdgeBatch>,
    volumes: Batches<VolumeBatch>,
    /// What of the body is muscle; nothing where it has never beaten.
    pub muscle: Option<Muscle>,
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
        let springs = edges_of(mesh, sound, fill);
        let corners: Vec<[u32; 2]> = springs.iter().map(|edge| edge.particles).collect();
        let edges = Batches::new(&corners, &mesh.particles, |members, corners| {
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
        let volumes = Batches::new(&corners, &mesh.particles, |members, corners| {
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
        Self {
            edges,
            volumes,
            muscle: None,
        }
    }

    /// Sets all multipliers to 0, as a substep starts.
    pub fn begin_substep(&mut self) {
        for batch in self.edges.as_mut_slice() {
            batch.lambda = Lanes::default();
        }
        for batch in self.volumes.as_mut_slice() {
            batch.lambda = Lanes::default();
        }
    }

    /// One sweep over all edges, then over all volumes.
    pub fn project(&mut self, team: &Team, particles: &mut [Vec4], lame: Lame, substep_s: f32) {
        let compliance = Compliance::new(lame, substep_s);
        let pull = self.muscle.as_mut().map(Muscle::pull);
        self.edges.for_each_part(team, particles, |run, access| {
            project_edges(run, access, pull, compliance.edge);
        });
        if let Some(compliance) = compliance.volume {
            self.volumes.for_each_part(team, particles, |run, access| {
                project_volumes(run, access, pull, compliance);
            });
        }
    }

    /// Sum of squares of all residuals C + α̃λ, each over its rest length or volume, and how many
    /// there are.
    pub fn residual(&mut self, particles: &mut [Vec4], lame: Lame, substep_s: f32) -> (f64, usize) {
        let compliance = Compliance::new(lame, substep_s);
        let access = ParticleAccess::new(particles);
        let pull = self.muscle.as_mut().map(Muscle::pull);
        let (mut sum, mut count) = (0.0, 0);
        // Both corners of a lane that is not used are the same spare place.
        let mut add = |corners: [&[u32; LANES]; 2], residual: Lanes, rest: Lanes| {
            for lane in (0..LANES).filter(|&lane| corners[0][lane] != corners[1][lane]) {
                sum += f64::from(residual.0[lane] / rest.0[lane]).powi(2);
                count += 1;
            }
        };
        for batch in self.edges.as_slice() {
            // SAFETY: the batches are of these particles, and nothing else runs.
            let corners = [0, 1].map(|k| unsafe { access.gather::<false>(&batch.corners[k]) });
            let residual = edge_value(batch, &corners, pull).0
                + batch.geometry.times(compliance.edge) * batch.lambda;
            add(batch.corners.each_ref(), residual, batch.rest_length);
        }
        if let Some(compliance) = compliance.volume {
            for batch in self.volumes.as_slice() {
                // SAFETY: as above.
                let corners =
                    [0, 1, 2, 3].map(|k| unsafe { access.gather::<false>(&batch.corners[k]) });
                let residual = volume_value(batch, &corners, pull).0
                    + batch.geometry.times(compliance) * batch.lambda;
                let ends = [&batch.corners[0], &batch.corners[1]];
                add(ends, residual, batch.rest_volume);
            }
        }
        (sum, count)
    }
}

fn project_edges(
    run: &mut [EdgeBatch],
    access: ParticleAccess,
    pull: Option<Pull>,
    compliance: f32,
) {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the machine has AVX2.
        return unsafe { project_edges_avx2(run, access, pull, compliance) };
    }
    for batch in run {
        project_edge_batch(batch, access, pull, compliance);
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn project_edges_avx2(
    run: &mut [EdgeBatch],
    access: ParticleAccess,
    pull: Option<Pull>,
    compliance: f32,
) {
    for batch in run {
        project_edge_batch(batch, access, pull, compliance);
    }
}

fn project_volumes(
    run: &mut [VolumeBatch],
    access: ParticleAccess,
    pull: Option<Pull>,
    compliance: f32,
) {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the machine has AVX2.
        return unsafe { project_volumes_avx2(run, access, pull, compliance) };
    }
    for batch in run {
        project_volume_batch(batch, access, pull, compliance);
    }
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn project_volumes_avx2(
    run: &mut [VolumeBatch],
    access: ParticleAccess,
    pull: Option<Pull>,
    compliance: f32,
) {
    for batch in run {
        project_volume_batch(batch, access, pull, compliance);
    }
}

/// Value and direction of `constraint::distance`; no direction where the particles coincide.
#[inline(always)]
fn edge_value(batch: &EdgeBatch, corners: &[Corner; 2], pull: Option<Pull>) -> (Lanes, Lanes3) {
    let edge = corners[0].position - corners[1].position;
    let length = edge.dot(edge).map(f32::sqrt);
    let inverse = Lanes::where_below(
        length,
        LENGTH_MIN_M,
        Lanes::default(),
        length.map(|l| 1.0 / l.max(LENGTH_MIN_M)),
    );
    let mut rest_length = batch.rest_length;
    if let Some(pull) = pull {
        // SAFETY: the activities are as long as the particles, and nobody writes them.
        rest_length = rest_length * unsafe { pull.scale::<false, 2>(&batch.corners) };
    }
    (length - rest_length, edge.scaled(inverse))
}

#[inline(always)]
fn project_edge_batch(
    batch: &mut EdgeBatch,
    access: ParticleAccess,
    pull: Option<Pull>,
    compliance: f32,
) {
    // SAFETY: a batch works in the part that `for_each_part` gives it.
    let mut corners = unsafe {
        [
            access.gather::<false>(&batch.corners[0]),
            access.gather::<false>(&batch.corners[1]),
        ]
    };
    let (value, direction) = edge_value(batch, &corners, pull);
    let alpha = batch.geometry.times(compliance);
    let effective = (corners[0].inverse_mass + corners[1].inverse_mass) * direction.dot(direction);
    let delta = -(value + alpha * batch.lambda) * (effective + alpha).map(|x| 1.0 / x);
    batch.lambda = batch.lambda + delta;
    let step = direction.scaled(delta);
    corners[0].position = corners[0].position + step.scaled(corners[0].inverse_mass);
    corners[1].position = corners[1].position - step.scaled(corners[1].inverse_mass);
    // SAFETY: as above.
    unsafe {
        access.scatter(&batch.corners[0], corners[0]);
        access.scatter(&batch.corners[1], corners[1]);
    }
}

/// Value and gradients of `constraint::volume`.
#[inline(always)]
fn volume_value(
    batch: &VolumeBatch,
    corners: &[Corner; 4],
    pull: Option<Pull>,
) -> (Lanes, [Lanes3; 4]) {
    let origin = corners[0].position;
    let a = corners[1].position - origin;
    let b = corners[2].position - origin;
    let c = corners[3].position - origin;
    let sixth = Lanes::splat(1.0 / 6.0);
    let g1 = b.cross(c).scaled(sixth);
    let g2 = c.cross(a).scaled(sixth);
    let g3 = a.cross(b).scaled(sixth);
    let mut rest_volume = batch.rest_volume;
    if let Some(pull) = pull {
        // SAFETY: as in `edge_value`.
        let scale = unsafe { pull.scale::<false, 4>(&batch.corners) };
        rest_volume = rest_volume * scale * scale * scale;
    }
    (a.dot(g1) - rest_volume, [-(g1 + g2 + g3), g1, g2, g3])
}

#[inline(always)]
fn project_volume_batch(
    batch: &mut VolumeBatch,
    access: ParticleAccess,
    pull: Option<Pull>,
    compliance: f32,
) {
    // SAFETY: a batch works in the part that `for_each_part` gives it.
    let mut corners = unsafe {
        [
            access.gather::<false>(&batch.corners[0]),
            access.gather::<false>(&batch.corners[1]),
            access.gather::<false>(&batch.corners[2]),
            access.gather::<false>(&batch.corners[3]),
        ]
    };
    let (value, gradient) = volume_value(batch, &corners, pull);
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
        // SAFETY: as above.
        unsafe { access.scatter(&batch.corners[k], corners[k]) };
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::constraint;
    use crate::sim::lanes::add_spare;
    use glam::Vec3;

    const LAME: Lame = Lame {
        mu_pa: 2e3,
        lambda_pa: 2e4,
    };
    const SUBSTEP_S: f32 = 1e-3;

    fn one_tet() -> TetMesh {
        TetMesh {
            particles: [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z]
                .map(|x| 0.01 * x)
                .to_vec(),
            tets: vec![[0, 1, 2, 3]],
        }
    }

    /// Particles of a deformed tetrahedron, of unequal masses.
    fn deformed() -> Vec<Vec4> {
        let mut places: Vec<Vec4> = [
            Vec3::new(0.1, 0.0, -0.1),
            Vec3::new(1.1, 0.2, 0.0),
            Vec3::new(0.0, 0.7, 0.1),
            Vec3::new(0.1, -0.1, 1.3),
        ]
        .iter()
        .enumerate()
        .map(|(k, &x)| (0.01 * x).extend(1e3 * (1.0 + k as f32)))
        .collect();
        add_spare(&mut places);
        places
    }

    #[test]
    fn volume_kernel_moves_corners_as_the_constraint_formula_says() {
        let mesh = one_tet();
        let mut springs = Springs::new(&mesh, &[0], &[1.0]);
        let mut places = deformed();
        let x: [Vec3; 4] = std::array::from_fn(|k| places[k].truncate());
        let rest_m3 = 1e-6 / 6.0;
        let c = constraint::volume(x, rest_m3);
        let bulk_pa = LAME.lambda_pa - LAME.mu_pa;
        let alpha_tilde = rest_m3 / (bulk_pa * SUBSTEP_S * SUBSTEP_S);
        let effective: f32 = (0..4)
            .map(|k| places[k].w * c.gradient[k].length_squared())
            .sum();
        let delta = -c.value / (effective + alpha_tilde);
        let compliance = 1.0 / (bulk_pa * SUBSTEP_S * SUBSTEP_S);
        let expected: Vec<Vec3> = (0..4)
            .map(|k| x[k] + places[k].w * delta * c.gradient[k])
            .collect();
        springs
            .volumes
            .for_each_part(&Team::alone(), &mut places, |run, access| {
                project_volumes(run, access, None, compliance);
            });
        for k in 0..4 {
            // Corrections are of the order of 1e-4 m.
            assert!(places[k].truncate().distance(expected[k]) < 1e-8, "{k}");
        }
    }

    #[test]
    fn edge_kernel_settles_where_each_edge_alone_would_be_by_the_formula() {
        // One edge that moves: the other two corners of the tetrahedron are held.
        let mesh = one_tet();
        let mut springs = Springs::new(&mesh, &[0], &[1.0]);
        let mut places = deformed();
        for place in &mut places[1..4] {
            place.w = 0.0;
        }
        let edge = edges_of(&mesh, &[0], &[1.0])[0];
        assert_eq!(edge.particles, [0, 1]);
        let x = [places[0].truncate(), places[1].truncate()];
        let c = constraint::distance(x, edge.rest_length_m).expect("the ends are apart");
        let modulus_pa = SPRING_PER_SHEAR_MODULUS * LAME.mu_pa;
        let compliance = 1.0 / (modulus_pa * SUBSTEP_S * SUBSTEP_S);
        let alpha_tilde = compliance / edge.stiffness_per_modulus_m;
        let expected = x[0] - places[0].w * c.value / (places[0].w + alpha_tilde) * c.gradient[0];
        // The edge 0–1 comes first and is the only one of its colour that can move.
        project_edges(
            &mut springs.edges.as_mut_slice()[..1],
            ParticleAccess::new(&mut places),
            None,
            compliance,
        );
        assert!(places[0].truncate().distance(expected) < 1e-8);
    }

    #[test]
    fn springs_and_volumes_together_have_the_energy_of_the_material_for_a_small_strain() {
        // Averaged over directions the six edges of many tetrahedra are isotropic; one regular
        // tetrahedron already is, to second order, under pure dilation: λ + 2μ/3 per volume.
        let side = 0.01_f32;
        let regular = [
            Vec3::new(1.0, 1.0, 1.0),
            Vec3::new(1.0, -1.0, -1.0),
            Vec3::new(-1.0, 1.0, -1.0),
            Vec3::new(-1.0, -1.0, 1.0),
        ]
        .map(|x| side * x);
        let mesh = TetMesh {
            particles: regular.to_vec(),
            tets: vec![[0, 2, 1, 3]],
        };
        let volume = super::super::diagnose::rest_volume_m3(&mesh, 0).abs();
        let strain = 1e-3_f64;
        let springs: f64 = edges_of(&mesh, &[0], &[1.0])
            .iter()
            .map(|edge| {
                let k = f64::from(edge.stiffness_per_modulus_m.abs()) * 2.5 * f64::from(LAME.mu_pa);
                0.5 * k * (strain * f64::from(edge.rest_length_m)).powi(2)
            })
            .sum();
        let bulk = f64::from(LAME.lambda_pa - LAME.mu_pa);
        let found = springs + 0.5 * bulk * volume * (3.0 * strain).powi(2);
        let (mu, lambda) = (f64::from(LAME.mu_pa), f64::from(LAME.lambda_pa));
        let exact = volume * strain.powi(2) * (3.0 * mu + 4.5 * lambda);
        assert!(
            (found / exact - 1.0).abs() < 1e-4,
            "{found} J, not {exact} J"
        );
    }
}
