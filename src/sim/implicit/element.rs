//! Energy, forces and stiffness of stable neo-Hookean tetrahedra, eight at a time.
//!
//! With D = F − 1 the energy density of `sim::constraint` is
//!
//! ψ = μ/2 (|D|² − 2 II(D) − 2 det D) + (λ+μ)/2 (J − 1)²,  J − 1 = tr D + II(D) + det D,
//!
//! and its stress μ (D + Dᵀ − tr D − cof D) + (λ+μ) (J − 1) cof F. D comes from differences of
//! displacements, so no digit is lost however small the strain is.
//!
//! Its second derivative, μ + (λ+μ) cof F ⊗ cof F + s ∂²J/∂F² with s = (λ+μ)(J − 1) − μ, is not
//! positive where a tetrahedron is compressed. ∂²J/∂F² has the eigenvalues ±σₖ on the twists and
//! flips of F's principal axes, so that keeping |s| σ_max ≤ μ makes them positive; at rest, in every
//! rotation of it, and in a pull along one axis with free sides |s| σ_max is μ already, and nothing
//! is changed. Its eigenvalues on the stretches reach 2 σ_max, but the largest of them is on a stretch
//! of the volume, for which the second term makes up; where that fails, in a tetrahedron so crushed
//! that q = (λ+μ)/μ |cof F|² < 1, the bound is divided by 2 − q. What is left is above −0.15 μ
//! whatever F is, and 0 or above in all but a few.
//!
//! Source: Smith, de Goes, Kim, "Stable Neo-Hookean Flesh Simulation", ACM TOG 37, 2018 (energy,
//! eigenvalues). The bounds on s are derived here; a test holds them to the eigenvalues.

#![expect(
    clippy::needless_range_loop,
    reason = "one counter for several arrays of the same fixed length"
)]

#[cfg(target_arch = "x86_64")]
use super::avx2::Avx2;
use super::{
    matrix::Block,
    wide::{LANES, Lanes, Plain, Vector, Wide},
};
use crate::sim::Lame;
use glam::{DMat3, DVec3, DVec4, Vec4};

/// A tetrahedron whose volume is below this share of its rest volume is lost.
pub const LOST_J: f32 = 0.05;
/// One of which |F|² is above this is torn: a stretch of more than eight along one axis.
pub const TORN_SQUARED: f32 = 75.0;

/// Eight tetrahedra. A lane that is not used has no volume, and places that nothing reads.
#[derive(Clone, Debug)]
#[repr(C, align(32))]
pub struct Batch {
    /// Nodes, ascending in each tetrahedron.
    pub corners: [[u32; LANES]; 4],
    /// Gradients of the shape functions of corners 1 to 3 [1/m].
    gradients: [[Lanes; 3]; 3],
    /// Volume that is tissue [m³].
    volume: Lanes,
    /// Where the blocks of the pairs of corners 00, 01, 02, 03, 11, 12, … are in the matrix, in
    /// bytes.
    pub offsets: [[u32; LANES]; 10],
}

/// A tetrahedron as a batch takes it up.
#[derive(Clone, Copy, Debug)]
pub struct Element {
    /// Nodes, ascending.
    pub nodes: [u32; 4],
    /// Share that is tissue.
    pub fill: f64,
}

impl Element {
    /// Gradients of the four shape functions [1/m] and volume that is tissue [m³].
    pub fn shape(&self, rest: &[DVec3]) -> ([DVec3; 4], f64) {
        let [a, b, c, d] = self.nodes.map(|node| rest[node as usize]);
        let edges = DMat3::from_cols(b - a, c - a, d - a);
        let rows = edges.inverse().transpose();
        let first = -(rows.x_axis + rows.y_axis + rows.z_axis);
        let gradients = [first, rows.x_axis, rows.y_axis, rows.z_axis];
        // Nodes are sorted, so half of the tetrahedra are mirrored; their gradients are the same.
        (gradients, self.fill * edges.determinant().abs() / 6.0)
    }
}

/// What a pass over tetrahedra found.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Strain {
    /// Elastic energy [J]; 0 at rest.
    pub energy_j: f64,
    /// Sum of the squares of the forces of all tetrahedra on their corners [N²].
    pub force_squared_n2: f64,
    /// Tetrahedra that are turned over or nearly flat.
    pub lost: usize,
    /// Tetrahedra that are stretched beyond all reason.
    pub torn: usize,
}

impl Strain {
    /// The sum over two sets of tetrahedra.
    pub fn and(self, other: Self) -> Self {
        Self {
            energy_j: self.energy_j + other.energy_j,
            force_squared_n2: self.force_squared_n2 + other.force_squared_n2,
            lost: self.lost + other.lost,
            torn: self.torn + other.torn,
        }
    }
}

/// The two moduli of the energy.
#[derive(Clone, Copy, Debug)]
pub struct Moduli {
    /// μ [Pa].
    pub mu: f32,
    /// λ + μ [Pa].
    pub dilation: f32,
}

impl From<Lame> for Moduli {
    fn from(lame: Lame) -> Self {
        Self {
            mu: lame.mu_pa,
            dilation: lame.lambda_pa + lame.mu_pa,
        }
    }
}

impl Contraction<'_> {
    /// Scale of the rest shapes of batch number `index` of the run.
    #[inline(always)]
    fn scale<W: Wide>(&self, index: usize) -> W {
        W::splat(1.0) - W::load(&self.activity[index]) * W::splat(self.shortening)
    }
}

impl Batch {
    /// A batch of up to eight elements. Unused lanes get the node `unused_node` and the place
    /// `unused_place`.
    pub fn new(
        elements: &[Element],
        rest: &[DVec3],
        place: impl Fn(u32, u32) -> u32,
        unused_node: u32,
        unused_place: u32,
    ) -> Self {
        let mut batch = Self {
            corners: [[unused_node; LANES]; 4],
            gradients: Default::default(),
            volume: Lanes::default(),
            offsets: [[byte_offset(unused_place); LANES]; 10],
        };
        for (lane, element) in elements.iter().enumerate() {
            let ([_, gradients @ ..], volume) = element.shape(rest);
            for (lanes, gradient) in batch.gradients.iter_mut().zip(gradients) {
                for (lanes, value) in lanes.iter_mut().zip(gradient.as_vec3().to_array()) {
                    lanes.0[lane] = value;
                }
            }
            batch.volume.0[lane] = volume as f32;
            for corner in 0..4 {
                batch.corners[corner][lane] = element.nodes[corner];
            }
            for (number, (a, b)) in PAIRS.into_iter().enumerate() {
                let place = place(element.nodes[a], element.nodes[b]);
                batch.offsets[number][lane] = byte_offset(place);
            }
        }
        batch
    }
}

/// Where block number `place` starts.
fn byte_offset(place: u32) -> u32 {
    let offset = place.checked_mul(size_of::<Block>() as u32);
    offset.expect("a matrix has less than 4 GiB")
}

/// The pairs of corners, in the order of the blocks of a batch.
pub const PAIRS: [(usize, usize); 10] = [
    (0, 0),
    (0, 1),
    (0, 2),
    (0, 3),
    (1, 1),
    (1, 2),
    (1, 3),
    (2, 2),
    (2, 3),
    (3, 3),
];

/// Muscle among the tetrahedra of a run.
#[derive(Clone, Copy, Debug)]
pub struct Contraction<'a> {
    /// Activity of each batch of the run.
    pub activity: &'a [Lanes],
    /// Shortening of full muscle, as a share of its length.
    pub shortening: f32,
}

/// Adds the forces of `run` at `displacements` [m] to `forces` [N].
///
/// # Safety
///
/// Every corner is an index into `displacements` and `forces`, and nobody else uses those forces.
pub unsafe fn add_forces(
    run: &[Batch],
    displacements: &[DVec4],
    moduli: Moduli,
    muscle: Option<Contraction<'_>>,
    forces: *mut Vec4,
) -> Strain {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the machine has AVX2; the rest as the caller's.
        return unsafe { add_forces_avx2(run, displacements, moduli, muscle, forces) };
    }
    // SAFETY: as the caller's.
    unsafe { add_forces_of::<Plain>(run, displacements, moduli, muscle, forces) }
}

/// Adds the stiffness of `run` at `displacements` [m], made positive, to the blocks on and right of
/// the diagonal [N/m].
///
/// # Safety
///
/// Every corner is an index into `displacements`, every offset that of one of `blocks`, and nobody else
/// uses those blocks.
pub unsafe fn add_stiffness(
    run: &[Batch],
    displacements: &[DVec4],
    moduli: Moduli,
    muscle: Option<Contraction<'_>>,
    blocks: *mut Block,
) {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the machine has AVX2; the rest as the caller's.
        return unsafe { add_stiffness_avx2(run, displacements, moduli, muscle, blocks) };
    }
    // SAFETY: as the caller's.
    unsafe { add_stiffness_of::<Plain>(run, displacements, moduli, muscle, blocks) }
}

/// The same code, compiled for eight lanes an instruction. No fused multiply-add: bits stay.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
unsafe fn add_forces_avx2(
    run: &[Batch],
    displacements: &[DVec4],
    moduli: Moduli,
    muscle: Option<Contraction<'_>>,
    forces: *mut Vec4,
) -> Strain {
    // SAFETY: as the caller's.
    unsafe { add_forces_of::<Avx2>(run, displacements, moduli, muscle, forces) }
}

/// As above.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
unsafe fn add_stiffness_avx2(
    run: &[Batch],
    displacements: &[DVec4],
    moduli: Moduli,
    muscle: Option<Contraction<'_>>,
    blocks: *mut Block,
) {
    // SAFETY: as the caller's.
    unsafe { add_stiffness_of::<Avx2>(run, displacements, moduli, muscle, blocks) }
}

/// Deformation of eight tetrahedra.
struct Deformation<W> {
    /// Columns of D = F − 1.
    d: [Vector<W>; 3],
    /// Columns of cof D.
    cofactor_d: [Vector<W>; 3],
    /// Columns of cof F = (1 + tr D) − Dᵀ + cof D.
    cofactor: [Vector<W>; 3],
    trace: W,
    /// II(D) = tr cof D.
    second: W,
    determinant: W,
    /// J − 1.
    dilation: W,
}

/// Sum of three vectors, each times its factor.
#[inline(always)]
fn combine<W: Wide>(vectors: [Vector<W>; 3], x: W, y: W, z: W) -> Vector<W> {
    vectors[0].times(x) + vectors[1].times(y) + vectors[2].times(z)
}

/// A matrix, given by its columns, times a vector.
#[inline(always)]
fn apply<W: Wide>(columns: [Vector<W>; 3], vector: Vector<W>) -> Vector<W> {
    combine(columns, vector.x, vector.y, vector.z)
}

impl<W: Wide> Deformation<W> {
    /// # Safety
    ///
    /// Every corner is an index into `displacements`.
    #[inline(always)]
    unsafe fn new(
        batch: &Batch,
        displacements: &[DVec4],
        g: [Vector<W>; 3],
        scale: Option<W>,
    ) -> Self {
        // SAFETY: as the caller's.
        let edges = unsafe { W::edge_changes(displacements, &batch.corners) };
        let mut d = [
            combine(edges, g[0].x, g[1].x, g[2].x),
            combine(edges, g[0].y, g[1].y, g[2].y),
            combine(edges, g[0].z, g[1].z, g[2].z),
        ];
        // F/s − 1 = (D + 1 − s)/s.
        if let Some(scale) = scale {
            let (change, inverse) = (W::splat(1.0) - scale, W::splat(1.0) / scale);
            d[0].x = d[0].x + change;
            d[1].y = d[1].y + change;
            d[2].z = d[2].z + change;
            d = [
                d[0].times(inverse),
                d[1].times(inverse),
                d[2].times(inverse),
            ];
        }
        let c = [d[1].cross(d[2]), d[2].cross(d[0]), d[0].cross(d[1])];
        let trace = d[0].x + d[1].y + d[2].z;
        let second = c[0].x + c[1].y + c[2].z;
        let determinant = d[0].dot(c[0]);
        let all = trace + W::splat(1.0);
        let cofactor = [
            Vector {
                x: c[0].x - d[0].x + all,
                y: c[0].y - d[1].x,
                z: c[0].z - d[2].x,
            },
            Vector {
                x: c[1].x - d[0].y,
                y: c[1].y - d[1].y + all,
                z: c[1].z - d[2].y,
            },
            Vector {
                x: c[2].x - d[0].z,
                y: c[2].y - d[1].z,
                z: c[2].z - d[2].z + all,
            },
        ];
        Self {
            d,
            cofactor_d: c,
            cofactor,
            trace,
            second,
            determinant,
            dilation: trace + second + determinant,
        }
    }

    /// |D|².
    #[inline(always)]
    fn squared(&self) -> W {
        self.d[0].dot(self.d[0]) + self.d[1].dot(self.d[1]) + self.d[2].dot(self.d[2])
    }

    /// Columns of the stress ∂ψ/∂F times `factor` [Pa].
    #[inline(always)]
    fn stress(&self, moduli: Moduli, factor: W) -> [Vector<W>; 3] {
        let (d, c) = (&self.d, &self.cofactor_d);
        let (mu, t) = (factor * W::splat(moduli.mu), self.trace);
        let pressure = factor * self.dilation * W::splat(moduli.dilation);
        let (xy, yz, zx) = (d[0].y + d[1].x, d[1].z + d[2].y, d[2].x + d[0].z);
        let shear = [
            Vector {
                x: d[0].x + d[0].x - t - c[0].x,
                y: xy - c[0].y,
                z: zx - c[0].z,
            },
            Vector {
                x: xy - c[1].x,
                y: d[1].y + d[1].y - t - c[1].y,
                z: yz - c[1].z,
            },
            Vector {
                x: zx - c[2].x,
                y: yz - c[2].y,
                z: d[2].z + d[2].z - t - c[2].z,
            },
        ];
        [
            shear[0].times(mu) + self.cofactor[0].times(pressure),
            shear[1].times(mu) + self.cofactor[1].times(pressure),
            shear[2].times(mu) + self.cofactor[2].times(pressure),
        ]
    }

    /// The largest stretch, from the characteristic polynomial of FᵀF − 1: its roots are
    /// m + 2p cos((θ + 2πk)/3) with cos θ = q.
    #[inline(always)]
    fn stretch_max(&self) -> W {
        let d = &self.d;
        let xx = d[0].x + d[0].x + d[0].dot(d[0]);
        let yy = d[1].y + d[1].y + d[1].dot(d[1]);
        let zz = d[2].z + d[2].z + d[2].dot(d[2]);
        let xy = d[0].y + d[1].x + d[0].dot(d[1]);
        let yz = d[1].z + d[2].y + d[1].dot(d[2]);
        let zx = d[2].x + d[0].z + d[2].dot(d[0]);
        let mean = (xx + yy + zz) * W::splat(1.0 / 3.0);
        let (a, b, c) = (xx - mean, yy - mean, zz - mean);
        let off = xy * xy + yz * yz + zx * zx;
        let p_squared = (a * a + b * b + c * c + off + off) * W::splat(1.0 / 6.0);
        let p = p_squared.sqrt();
        let determinant = a * (b * c - yz * yz) - xy * (xy * c - yz * zx) + zx * (xy * yz - b * zx);
        let cube = (p * p_squared).max(W::splat(1e-30));
        let q = W::splat(0.5) * determinant / cube;
        let q = q.min(W::splat(1.0)).max(W::splat(-1.0));
        let squared = W::splat(1.0) + mean + (p + p) * cosine_of_third(q);
        squared.max(W::splat(1e-12)).sqrt()
    }
}

/// cos(θ/3) from cos θ, to 1.4e-6: a polynomial in cos(θ/2), in which it is smooth.
#[inline(always)]
fn cosine_of_third<W: Wide>(cosine: W) -> W {
    let half = W::splat(0.5);
    let t = (half + half * cosine).sqrt();
    let value = W::splat(0.004_120_8);
    let value = value * t + W::splat(-0.019_121_83);
    let value = value * t + W::splat(0.047_634_51);
    let value = value * t + W::splat(-0.109_884_46);
    let value = value * t + W::splat(0.577_250_4);
    value * t + W::splat(0.500_001_4)
}

/// # Safety
///
/// Every corner is an index into `displacements` and `forces`, and nobody else uses those forces.
#[inline(always)]
unsafe fn add_forces_of<W: Wide>(
    run: &[Batch],
    displacements: &[DVec4],
    moduli: Moduli,
    muscle: Option<Contraction<'_>>,
    forces: *mut Vec4,
) -> Strain {
    let mut energy = [0.0_f64; LANES];
    let mut squares = W::splat(0.0);
    let (mut lost, mut torn) = (W::splat(0.0), W::splat(0.0));
    for (index, batch) in run.iter().enumerate() {
        // No closure: it would be compiled for the narrow vectors of the base machine.
        let mut scale = None;
        if let Some(muscle) = muscle {
            scale = Some(muscle.scale::<W>(index));
        }
        let [g1, g2, g3] = &batch.gradients;
        let (g1, g2, g3) = (Vector::load(g1), Vector::load(g2), Vector::load(g3));
        // SAFETY: as the caller's.
        let f = unsafe { Deformation::<W>::new(batch, displacements, [g1, g2, g3], scale) };
        // The energy of the shape that muscle wants is V s³ ψ(F/s), its forces are V s² P(F/s) g.
        let mut volume = W::load(&batch.volume);
        if let Some(scale) = scale {
            volume = volume * scale * scale;
        }
        let squared = f.squared();
        let unequal = f.second + f.determinant;
        let shear = squared - (unequal + unequal);
        let density = shear * W::splat(0.5 * moduli.mu)
            + f.dilation * f.dilation * W::splat(0.5 * moduli.dilation);
        let mut energies = volume * density;
        if let Some(scale) = scale {
            energies = energies * scale;
        }
        let energies = energies.store();
        for lane in 0..LANES {
            energy[lane] += f64::from(energies.0[lane]);
        }
        lost = lost + f.dilation.is_below(W::splat(LOST_J - 1.0));
        // |F|² = |D|² + 2 tr D + 3.
        let stretch = squared + f.trace + f.trace;
        torn = torn + W::splat(TORN_SQUARED - 3.0).is_below(stretch);

        let stress = f.stress(moduli, -volume);
        let (f1, f2, f3) = (apply(stress, g1), apply(stress, g2), apply(stress, g3));
        let f0 = -(f1 + f2 + f3);
        squares = squares + f0.dot(f0) + f1.dot(f1) + f2.dot(f2) + f3.dot(f3);
        // SAFETY: as the caller's.
        unsafe {
            W::add_vector(f0, forces, &batch.corners[0]);
            W::add_vector(f1, forces, &batch.corners[1]);
            W::add_vector(f2, forces, &batch.corners[2]);
            W::add_vector(f3, forces, &batch.corners[3]);
        }
    }
    let sum = |values: Lanes| -> f64 { values.0.iter().map(|&x| f64::from(x)).sum() };
    Strain {
        energy_j: energy.iter().sum(),
        force_squared_n2: sum(squares.store()),
        lost: sum(lost.store()) as usize,
        torn: sum(torn.store()) as usize,
    }
}

/// # Safety
///
/// Every corner is an index into `displacements`, every offset that of one of `blocks`, and nobody
/// else uses those blocks.
#[inline(always)]
unsafe fn add_stiffness_of<W: Wide>(
    run: &[Batch],
    displacements: &[DVec4],
    moduli: Moduli,
    muscle: Option<Contraction<'_>>,
    blocks: *mut Block,
) {
    for (index, batch) in run.iter().enumerate() {
        // No closure: it would be compiled for the narrow vectors of the base machine.
        let mut scale = None;
        if let Some(muscle) = muscle {
            scale = Some(muscle.scale::<W>(index));
        }
        let [g1, g2, g3] = &batch.gradients;
        let (g1, g2, g3) = (Vector::load(g1), Vector::load(g2), Vector::load(g3));
        // SAFETY: as the caller's.
        let f = unsafe { Deformation::<W>::new(batch, displacements, [g1, g2, g3], scale) };
        let (mut volume, one) = (W::load(&batch.volume), W::splat(1.0));
        // And the derivative of those V s ∂P/∂F.
        if let Some(scale) = scale {
            volume = volume * scale;
        }
        let [x, y, z] = f.cofactor;
        let cover = W::splat(moduli.dilation / moduli.mu) * (x.dot(x) + y.dot(y) + z.dot(z));
        let crushed = (one - cover).max(W::splat(0.0));
        let limit = W::splat(moduli.mu) / (f.stretch_max() * (one + crushed));
        let s = f.dilation * W::splat(moduli.dilation) - W::splat(moduli.mu);
        let s = volume * s.min(limit).max(-limit);
        let mu = volume * W::splat(moduli.mu);
        let bulk = volume * W::splat(moduli.dilation);

        // ∂²J/∂xₐ∂x_b is minus the cross product matrix of F (gₐ × g_b).
        let [mut fx, mut fy, mut fz] = f.d;
        fx.x = fx.x + one;
        fy.y = fy.y + one;
        fz.z = fz.z + one;
        let deformation = [fx, fy, fz];
        let w12 = apply(deformation, g1.cross(g2).times(s));
        let w23 = apply(deformation, g2.cross(g3).times(s));
        let w31 = apply(deformation, g3.cross(g1).times(s));
        // ∂J/∂x of each corner.
        let (c1, c2, c3) = (
            apply(f.cofactor, g1),
            apply(f.cofactor, g2),
            apply(f.cofactor, g3),
        );
        let (g0, c0) = (-(g1 + g2 + g3), -(c1 + c2 + c3));
        let none = Vector::splat(0.0);
        let (b0, b1, b2, b3) = (
            c0.times(bulk),
            c1.times(bulk),
            c2.times(bulk),
            c3.times(bulk),
        );
        let at = &batch.offsets;
        // SAFETY: as the caller's.
        unsafe {
            W::add_block(block(b0, c0, mu * g0.dot(g0), none), blocks, &at[0]);
            W::add_block(block(b0, c1, mu * g0.dot(g1), w12 - w31), blocks, &at[1]);
            W::add_block(block(b0, c2, mu * g0.dot(g2), w23 - w12), blocks, &at[2]);
            W::add_block(block(b0, c3, mu * g0.dot(g3), w31 - w23), blocks, &at[3]);
            W::add_block(block(b1, c1, mu * g1.dot(g1), none), blocks, &at[4]);
            W::add_block(block(b1, c2, mu * g1.dot(g2), w12), blocks, &at[5]);
            W::add_block(block(b1, c3, mu * g1.dot(g3), -w31), blocks, &at[6]);
            W::add_block(block(b2, c2, mu * g2.dot(g2), none), blocks, &at[7]);
            W::add_block(block(b2, c3, mu * g2.dot(g3), w23), blocks, &at[8]);
            W::add_block(block(b3, c3, mu * g3.dot(g3), none), blocks, &at[9]);
        }
    }
}

/// Columns of a ⊗ b + shear + minus the cross product matrix of `twist`.
#[inline(always)]
fn block<W: Wide>(a: Vector<W>, b: Vector<W>, shear: W, twist: Vector<W>) -> [Vector<W>; 3] {
    let (x, y, z) = (a.times(b.x), a.times(b.y), a.times(b.z));
    [
        Vector {
            x: x.x + shear,
            y: x.y - twist.z,
            z: x.z + twist.y,
        },
        Vector {
            x: y.x + twist.z,
            y: y.y + shear,
            z: y.z - twist.x,
        },
        Vector {
            x: z.x - twist.y,
            y: z.y + twist.x,
            z: z.z + shear,
        },
    ]
}

#[cfg(test)]
mod tests;
