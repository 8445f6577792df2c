//! Stable neo-Hookean tetrahedra in XPBD: shape and dilation of a tetrahedron solved together.
//!
//! The two constraints of `constraint::shape` and `constraint::dilation` share all four particles,
//! so their 2×2 system (J W Jᵀ + α̃) Δλ = −(C + α̃ λ) is solved as one: solved one after the other
//! they would undo each other's work.

use super::{
    Lame,
    constraint::SHAPE_SQUARED_MIN,
    lanes::{Colored, Corner, Corners, LANES, Lanes, Lanes3, ParticleAccess},
};
use crate::geom::TetMesh;
use glam::{DMat3, Vec4};

/// A 2×2 system nearer to singular than this is pulled away from it: both gradients are parallel
/// in pure dilation, and single precision leaves no more digits.
const DETERMINANT_SHARE_MIN: f32 = 1e-5;

/// Eight tetrahedra.
#[derive(Clone, Debug)]
#[repr(C, align(32))]
struct Batch {
    corners: Corners<4>,
    /// Inverse of the rest edges, row by row [1/m].
    rest_inverse: [Lanes3; 3],
    /// Its determinant: one over six rest volumes [1/m³].
    determinant: Lanes,
    /// One over the tissue volume [1/m³]; compliance times modulus.
    inverse_volume: Lanes,
    /// Multipliers of shape and dilation, of this substep.
    lambda: [Lanes; 2],
}

/// Values and gradients of the two constraints of eight tetrahedra.
struct Linearized {
    shape: Lanes,
    dilation: Lanes,
    shape_gradient: [Lanes3; 4],
    dilation_gradient: [Lanes3; 4],
}

/// All tetrahedra of a body.
#[derive(Clone, Debug)]
pub struct NeoHookean {
    tets: Colored<Batch>,
}

/// The compliances of a substep times tissue volume, α̃ V [1/(Pa s²)].
#[derive(Clone, Copy)]
struct Compliance {
    shape: f32,
    dilation: f32,
}

impl Compliance {
    fn new(lame: Lame, substep_s: f32) -> Self {
        let h2 = substep_s * substep_s;
        Self {
            shape: 1.0 / (lame.mu_pa * h2),
            // λ is 0 at ν = 0: a dilation that resists nothing is infinitely compliant.
            dilation: (1.0 / (lame.lambda_pa * h2)).min(1e30),
        }
    }
}

impl NeoHookean {
    /// Tetrahedra `sound` of `mesh`, of which `fill` is the share that is tissue.
    pub fn new(mesh: &TetMesh, sound: &[u32], fill: &[f32]) -> Self {
        let corners: Vec<[u32; 4]> = sound.iter().map(|&tet| mesh.tets[tet as usize]).collect();
        let tets = Colored::new(&corners, mesh.particles.len(), |members, corners| {
            let mut batch = Batch {
                corners,
                rest_inverse: Default::default(),
                determinant: Lanes::default(),
                inverse_volume: Lanes::splat(1.0),
                lambda: Default::default(),
            };
            for (lane, &member) in members.iter().enumerate() {
                let tet = sound[member as usize] as usize;
                let [a, b, c, d] = mesh.tets[tet].map(|i| mesh.particles[i as usize].as_dvec3());
                let inverse = DMat3::from_cols(b - a, c - a, d - a).inverse();
                for row in 0..3 {
                    let values = inverse.row(row).as_vec3();
                    batch.rest_inverse[row].x.0[lane] = values.x;
                    batch.rest_inverse[row].y.0[lane] = values.y;
                    batch.rest_inverse[row].z.0[lane] = values.z;
                }
                let determinant = inverse.determinant();
                batch.determinant.0[lane] = determinant as f32;
                batch.inverse_volume.0[lane] = (6.0 * determinant) as f32 / fill[tet];
            }
            batch
        });
        Self { tets }
    }

    /// Sets all multipliers to 0, as a substep starts.
    pub fn begin_substep(&mut self) {
        for batch in self.tets.batches_mut() {
            batch.lambda = Default::default();
        }
    }

    /// One sweep over all tetrahedra.
    pub fn project(&mut self, particles: &mut [Vec4], lame: Lame, substep_s: f32) {
        let compliance = Compliance::new(lame, substep_s);
        self.tets.for_each_colored(particles, |run, access| {
            project_run(run, access, compliance)
        });
    }

    /// Sum of squares of all residuals C + α̃λ, and how many there are.
    pub fn residual(&self, particles: &mut [Vec4], lame: Lame, substep_s: f32) -> (f64, usize) {
        let compliance = Compliance::new(lame, substep_s);
        let unused = particles.len() as u32 - 1;
        let access = ParticleAccess::reading(particles);
        let (mut sum, mut count) = (0.0, 0);
        for batch in self.tets.batches() {
            let c = linearize(batch, &gather(batch, access));
            let shape = c.shape + batch.inverse_volume * batch.lambda[0].times(compliance.shape);
            let dilation =
                c.dilation + batch.inverse_volume * batch.lambda[1].times(compliance.dilation);
            for lane in (0..LANES).filter(|&lane| batch.corners[0][lane] != unused) {
                sum += f64::from(shape.0[lane]).powi(2) + f64::from(dilation.0[lane]).powi(2);
                count += 2;
            }
        }
        (sum, count)
    }
}

/// Projects one batch after the other, with the widest vectors the machine has.
fn project_run(run: &mut [Batch], access: ParticleAccess, compliance: Compliance) {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the machine has AVX2.
        return unsafe { project_run_avx2(run, access, compliance) };
    }
    for batch in run {
        project_batch(batch, access, compliance);
    }
}

/// The same code, compiled for eight lanes an instruction. No fused multiply-add: bits stay.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn project_run_avx2(run: &mut [Batch], access: ParticleAccess, compliance: Compliance) {
    for batch in run {
        project_batch(batch, access, compliance);
    }
}

#[inline(always)]
fn gather(batch: &Batch, access: ParticleAccess) -> [Corner; 4] {
    [
        access.gather(&batch.corners[0]),
        access.gather(&batch.corners[1]),
        access.gather(&batch.corners[2]),
        access.gather(&batch.corners[3]),
    ]
}

/// Values and gradients; the twin of `constraint::shape` and `constraint::dilation`.
#[inline(always)]
fn linearize(batch: &Batch, corners: &[Corner; 4]) -> Linearized {
    let one = Lanes::splat(1.0);
    let two = Lanes::splat(2.0);
    let rows = &batch.rest_inverse;
    let origin = corners[0].position;
    let a = corners[1].position - origin;
    let b = corners[2].position - origin;
    let c = corners[3].position - origin;

    // Columns of F = [a b c] · rest inverse.
    let column = |p: Lanes, q: Lanes, r: Lanes| a.scaled(p) + b.scaled(q) + c.scaled(r);
    let fx = column(rows[0].x, rows[1].x, rows[2].x);
    let fy = column(rows[0].y, rows[1].y, rows[2].y);
    let fz = column(rows[0].z, rows[1].z, rows[2].z);

    // ∂J/∂x of corners 1 to 3.
    let d1 = b.cross(c).scaled(batch.determinant);
    let d2 = c.cross(a).scaled(batch.determinant);
    let d3 = a.cross(b).scaled(batch.determinant);
    let j = a.dot(d1);
    let dilation = j - one;

    let (xx, yy, zz) = (fx.dot(fx) - one, fy.dot(fy) - one, fz.dot(fz) - one);
    let (xy, yz, zx) = (fx.dot(fy), fy.dot(fz), fz.dot(fx));
    let (xy2, yz2, zx2) = (xy * xy, yz * yz, zx * zx);
    let second = xx * yy + yy * zz + zz * xx - xy2 - yz2 - zx2;
    let third = xx * yy * zz + two * xy * yz * zx - xx * yz2 - yy * zx2 - zz * xy2;
    let near = two * dilation * dilation - second - third;
    let trace = xx + yy + zz + Lanes::splat(3.0);
    let far = trace + j * j - Lanes::splat(4.0) * j;
    let squared = Lanes::where_below(trace, 4.0, near, far).map(|x| if x > 0.0 { x } else { 0.0 });
    let shape = squared.map(f32::sqrt);
    let inverse_shape = Lanes::where_below(
        squared,
        SHAPE_SQUARED_MIN,
        Lanes::default(),
        squared.map(|x| 1.0 / x.max(SHAPE_SQUARED_MIN).sqrt()),
    );

    let along = |row: &Lanes3, d: Lanes3| {
        let f = fx.scaled(row.x) + fy.scaled(row.y) + fz.scaled(row.z);
        (f + d.scaled(j - two)).scaled(inverse_shape)
    };
    let (s1, s2, s3) = (
        along(&rows[0], d1),
        along(&rows[1], d2),
        along(&rows[2], d3),
    );
    Linearized {
        shape,
        dilation,
        shape_gradient: [-(s1 + s2 + s3), s1, s2, s3],
        dilation_gradient: [-(d1 + d2 + d3), d1, d2, d3],
    }
}

#[inline(always)]
fn project_batch(batch: &mut Batch, access: ParticleAccess, compliance: Compliance) {
    let mut corners = gather(batch, access);
    let c = linearize(batch, &corners);

    let alpha_shape = batch.inverse_volume.times(compliance.shape);
    let alpha_dilation = batch.inverse_volume.times(compliance.dilation);
    let (mut ss, mut dd, mut sd) = (alpha_shape, alpha_dilation, Lanes::default());
    for k in 0..4 {
        let w = corners[k].inverse_mass;
        ss = ss + w * c.shape_gradient[k].dot(c.shape_gradient[k]);
        dd = dd + w * c.dilation_gradient[k].dot(c.dilation_gradient[k]);
        sd = sd + w * c.shape_gradient[k].dot(c.dilation_gradient[k]);
    }
    let shape = c.shape + alpha_shape * batch.lambda[0];
    let dilation = c.dilation + alpha_dilation * batch.lambda[1];
    let product = ss * dd;
    let determinant = (product - sd * sd).zip(product.times(DETERMINANT_SHARE_MIN), |d, min| {
        if d > min { d } else { min }
    });
    let inverse = determinant.map(|d| 1.0 / d);
    let delta_shape = (sd * dilation - dd * shape) * inverse;
    let delta_dilation = (sd * shape - ss * dilation) * inverse;
    batch.lambda[0] = batch.lambda[0] + delta_shape;
    batch.lambda[1] = batch.lambda[1] + delta_dilation;

    for k in 0..4 {
        let step =
            c.shape_gradient[k].scaled(delta_shape) + c.dilation_gradient[k].scaled(delta_dilation);
        corners[k].position = corners[k].position + step.scaled(corners[k].inverse_mass);
        access.scatter(&batch.corners[k], corners[k]);
    }
}
