//! Stable neo-Hookean tetrahedra in XPBD: shape and dilation of a tetrahedron solved together.
//!
//! The two constraints of `constraint::shape` and `constraint::dilation` share all four particles,
//! so their 2×2 system (J W Jᵀ + α̃) Δλ = −(C + α̃ λ) is solved as one: solved one after the other
//! they would undo each other's work.

#![expect(
    clippy::needless_range_loop,
    reason = "one counter for several arrays of the same fixed length"
)]

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

/// Sum of three vectors, each times its factor. A function and no closure: closures are compiled
/// for the narrow vectors of the base machine.
#[inline(always)]
fn combine(vectors: [Lanes3; 3], factors: [Lanes; 3]) -> Lanes3 {
    vectors[0].scaled(factors[0]) + vectors[1].scaled(factors[1]) + vectors[2].scaled(factors[2])
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
    let fx = combine([a, b, c], [rows[0].x, rows[1].x, rows[2].x]);
    let fy = combine([a, b, c], [rows[0].y, rows[1].y, rows[2].y]);
    let fz = combine([a, b, c], [rows[0].z, rows[1].z, rows[2].z]);

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

    // ∂C/∂x of corners 1 to 3: (F + (J − 2) cof F) / C times a row of the rest inverse.
    let f = [fx, fy, fz];
    let towards = j - two;
    let s1 = (combine(f, rows[0].parts()) + d1.scaled(towards)).scaled(inverse_shape);
    let s2 = (combine(f, rows[1].parts()) + d2.scaled(towards)).scaled(inverse_shape);
    let s3 = (combine(f, rows[2].parts()) + d3.scaled(towards)).scaled(inverse_shape);
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::sim::constraint;
    use glam::{Mat3, Vec3, Vec3Swizzles};
    use proptest::prelude::*;

    const LAME: Lame = Lame {
        mu_pa: 2e3,
        lambda_pa: 2e4,
    };
    const SUBSTEP_S: f32 = 1e-3;

    /// Eight tetrahedra side by side, none sharing a particle, each moved by three of `moves`.
    fn eight(moves: &[f32]) -> (TetMesh, Vec<Vec4>) {
        let mut mesh = TetMesh::default();
        let mut places = Vec::new();
        for lane in 0..LANES {
            let first = mesh.particles.len() as u32;
            for corner in [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z] {
                let rest = 0.01 * (corner + 0.2 * corner.yzx());
                let k = 3 * mesh.particles.len();
                let moved = rest + 0.008 * Vec3::from_slice(&moves[k..k + 3]);
                mesh.particles.push(rest);
                places.push(moved.extend(1e4 * (1.0 + corner.x + lane as f32)));
            }
            mesh.tets.push([first, first + 1, first + 2, first + 3]);
        }
        places.push(Vec4::ZERO);
        (mesh, places)
    }

    /// One projection of one tetrahedron from the formulas of `constraint`, in f64 where it counts.
    fn projected(mesh: &TetMesh, tet: usize, places: &[Vec4]) -> [Vec3; 4] {
        let [a, b, c, d] = mesh.tets[tet].map(|i| mesh.particles[i as usize]);
        let rest_inverse = Mat3::from_cols(b - a, c - a, d - a).inverse();
        let volume = 1.0 / (6.0 * f64::from(rest_inverse.determinant()));
        let x = mesh.tets[tet].map(|i| places[i as usize].truncate());
        let w = mesh.tets[tet].map(|i| f64::from(places[i as usize].w));
        let h2 = f64::from(SUBSTEP_S).powi(2);
        let shape = constraint::shape(x, rest_inverse).expect("the tetrahedron is deformed");
        let dilation = constraint::dilation(x, rest_inverse);
        let inner = |a: [Vec3; 4], b: [Vec3; 4]| -> f64 {
            (0..4)
                .map(|k| w[k] * a[k].as_dvec3().dot(b[k].as_dvec3()))
                .sum()
        };
        let ss =
            inner(shape.gradient, shape.gradient) + 1.0 / (f64::from(LAME.mu_pa) * h2 * volume);
        let dd = inner(dilation.gradient, dilation.gradient)
            + 1.0 / (f64::from(LAME.lambda_pa) * h2 * volume);
        let sd = inner(shape.gradient, dilation.gradient);
        let determinant = ss * dd - sd * sd;
        let (s, d) = (f64::from(shape.value), f64::from(dilation.value));
        let delta = [
            (sd * d - dd * s) / determinant,
            (sd * s - ss * d) / determinant,
        ];
        std::array::from_fn(|k| {
            let step = delta[0] * shape.gradient[k].as_dvec3()
                + delta[1] * dilation.gradient[k].as_dvec3();
            x[k] + (w[k] * step).as_vec3()
        })
    }

    /// Worst distance between kernel and formulas over eight tetrahedra [m].
    fn worst_difference_m(moves: &[f32], lame: Lame) -> f32 {
        let (mesh, mut places) = eight(moves);
        let expected: Vec<[Vec3; 4]> = (0..LANES)
            .map(|tet| projected(&mesh, tet, &places))
            .collect();
        let all: Vec<u32> = (0..LANES as u32).collect();
        let mut model = NeoHookean::new(&mesh, &all, &[1.0; LANES]);
        model.project(&mut places, lame, SUBSTEP_S);
        let mut worst = 0.0_f32;
        for (tet, expected) in expected.iter().enumerate() {
            for k in 0..4 {
                let found = places[mesh.tets[tet][k] as usize].truncate();
                worst = worst.max(found.distance(expected[k]));
            }
        }
        worst
    }

    /// Edges are 1 cm, and the 2×2 system loses two to three of seven digits.
    const TOLERANCE_M: f32 = 1e-5;

    proptest! {
        #[test]
        fn kernel_moves_corners_as_the_constraint_formulas_say(
            moves in prop::collection::vec(-1.0_f32..1.0, 12 * LANES),
        ) {
            let worst = worst_difference_m(&moves, LAME);
            prop_assert!(worst < TOLERANCE_M, "{worst} m");
        }
    }

    #[test]
    fn kernel_check_rejects_another_stiffness() {
        let moves: Vec<f32> = (0..12 * LANES)
            .map(|i| ((i * 37) % 19) as f32 / 19.0)
            .collect();
        let softer = Lame {
            mu_pa: 0.5 * LAME.mu_pa,
            ..LAME
        };
        assert!(worst_difference_m(&moves, softer) > 10.0 * TOLERANCE_M);
    }

    #[test]
    fn collapsed_and_coincident_corners_stay_finite() {
        for scale in [0.0, 1e-20, 1e-3] {
            let (mesh, mut places) = eight(&[0.0; 12 * LANES]);
            for place in &mut places {
                *place = (scale * place.truncate()).extend(place.w);
            }
            let all: Vec<u32> = (0..LANES as u32).collect();
            let mut model = NeoHookean::new(&mesh, &all, &[1.0; LANES]);
            for _ in 0..10 {
                model.project(&mut places, LAME, SUBSTEP_S);
            }
            assert!(places.iter().all(|place| place.is_finite()), "{scale}");
        }
    }
}
