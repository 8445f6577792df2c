//! Eight neo-Hookean tetrahedra at a time: the arithmetic of one projection.

use super::super::{
    lanes::{Corner, Corners, LANES, Lanes, Lanes3, ParticleAccess},
    muscle::Pull,
};

/// Eight tetrahedra.
#[derive(Clone, Debug)]
#[repr(C, align(32))]
pub struct Batch {
    pub corners: Corners<4>,
    /// Inverse of the rest edges, row by row [1/m]: row k is the gradient of corner k + 1.
    pub rest_inverse: [Lanes3; 3],
    /// Volume that is tissue [m³].
    pub volume_m3: Lanes,
    /// Q = S (1 + a S)⁻¹ [1/(kg m²)], see the head of `neo_hookean`: xx, yy, zz, xy, yz, zx.
    pub response: [Lanes; 6],
    /// Share of the stress that the next substep starts from.
    pub kept: Lanes,
    /// The multipliers: columns of the stress T [Pa].
    pub stress: [Lanes3; 3],
}

/// What a projection needs to know of material and time step.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Step {
    /// Shear modulus μ [Pa].
    pub mu_pa: f32,
    /// λ + μ [Pa].
    pub bulk_pa: f32,
    /// Square of the substep [s²].
    pub h2_s2: f32,
    /// A stress beyond this is not carried into the next substep as it is [Pa].
    pub carried_max_pa: f32,
}

/// Weight of the isotropic part of the local stiffness, in shear moduli (see `neo_hookean`).
pub const STIFFNESS_IN_MU: f32 = 2.0;

/// Share of its own response that a tetrahedron counts on (θ in `neo_hookean`).
pub const OWN_RESPONSE: f32 = 0.85;

/// What is added to the stress, over what acts at once (see `neo_hookean`).
const STRESS_LEAD: f32 = 1.2;

/// A tetrahedron whose ‖F‖² (3 at rest) is outside of these is crushed or torn long: pulled to five
/// times its length along all axes, which no load that tissue bears comes near.
const SQUARED_MIN: f32 = 1.0;
const SQUARED_MAX: f32 = 75.0;

/// Deformation gradient, its cofactor and its determinant.
struct Deformation {
    f: [Lanes3; 3],
    cofactor: [Lanes3; 3],
    j: Lanes,
}

/// How a batch stands: what is left of its equations, and which of its lanes are wrecked.
#[derive(Clone, Copy, Default)]
pub struct Standing {
    /// Square of the difference between the stress of the deformation and the multipliers [Pa²].
    pub residual_squared: Lanes,
    /// 1 where a tetrahedron is turned inside out, crushed or torn long, else 0.
    pub wrecked: Lanes,
}

impl Batch {
    #[inline(always)]
    fn gather<const WIDE: bool>(&self, access: ParticleAccess) -> [Corner; 4] {
        // SAFETY: a batch is one of `Batches`, and works in the part that `for_each_part` gives it or
        // where nothing else runs; every access of a body is as long as its particles.
        unsafe {
            [
                access.gather::<WIDE>(&self.corners[0]),
                access.gather::<WIDE>(&self.corners[1]),
                access.gather::<WIDE>(&self.corners[2]),
                access.gather::<WIDE>(&self.corners[3]),
            ]
        }
    }

    /// Columns of [a b c] · rest inverse.
    #[inline(always)]
    fn gradient(&self, [a, b, c]: [Lanes3; 3]) -> [Lanes3; 3] {
        let rows = &self.rest_inverse;
        [
            a.scaled(rows[0].x) + b.scaled(rows[1].x) + c.scaled(rows[2].x),
            a.scaled(rows[0].y) + b.scaled(rows[1].y) + c.scaled(rows[2].y),
            a.scaled(rows[0].z) + b.scaled(rows[1].z) + c.scaled(rows[2].z),
        ]
    }

    /// That of the shape at rest, or of the one that `pull` wants; then with the scale s of that one.
    #[inline(always)]
    fn deformation<const WIDE: bool>(
        &self,
        corners: &[Corner; 4],
        pull: Option<Pull>,
    ) -> (Deformation, Option<Lanes>) {
        let mut f = self.gradient(edges(corners));
        // No closure: it would be compiled for the narrow vectors of the base machine.
        let mut scale = None;
        if let Some(pull) = pull {
            // SAFETY: as in `gather`.
            let pulled = unsafe { pull.scale::<WIDE, 4>(&self.corners) };
            scale = Some(pulled);
            let inverse = Lanes::splat(1.0) / pulled;
            for column in &mut f {
                *column = column.scaled(inverse);
            }
        }
        let cofactor = [f[1].cross(f[2]), f[2].cross(f[0]), f[0].cross(f[1])];
        let j = f[0].dot(cofactor[0]);
        (Deformation { f, cofactor, j }, scale)
    }

    /// What the stress of the deformation is above the multipliers [Pa].
    #[inline(always)]
    fn misfit(&self, of: &Deformation, scale: Option<Lanes>, step: Step) -> [Lanes3; 3] {
        let volumetric = (of.j - Lanes::splat(1.0)).times(step.bulk_pa) - Lanes::splat(step.mu_pa);
        let mut rest = [Lanes3::default(); 3];
        for i in 0..3 {
            let mut stress = of.f[i].times(step.mu_pa) + of.cofactor[i].scaled(volumetric);
            if let Some(scale) = scale {
                stress = stress.scaled(scale * scale);
            }
            rest[i] = stress - self.stress[i];
        }
        rest
    }

    /// What a change D of the stress does to the acceleration of each corner, −V w D g.
    #[inline(always)]
    fn accelerations(&self, corners: &[Corner; 4], change: [Lanes3; 3]) -> [Lanes3; 4] {
        let rows = &self.rest_inverse;
        let v = -self.volume_m3;
        let d1 = along(change, rows[0]);
        let d2 = along(change, rows[1]);
        let d3 = along(change, rows[2]);
        let d0 = -(d1 + d2 + d3);
        [
            d0.scaled(v * corners[0].inverse_mass),
            d1.scaled(v * corners[1].inverse_mass),
            d2.scaled(v * corners[2].inverse_mass),
            d3.scaled(v * corners[3].inverse_mass),
        ]
    }

    /// Lets a change of the stress act on the acceleration of each corner, and h² times that on its
    /// place.
    #[inline(always)]
    fn act<const WIDE: bool>(
        &self,
        corners: &[Corner; 4],
        change: [Lanes3; 3],
        places: ParticleAccess,
        accelerations: ParticleAccess,
        h2_s2: f32,
    ) {
        let [a0, a1, a2, a3] = self.accelerations(corners, change);
        // No loop: the compiler would keep it and send the lanes through memory.
        // SAFETY: as in `gather`.
        unsafe {
            accelerations.add_to_both::<WIDE>(&self.corners[0], a0, places, h2_s2);
            accelerations.add_to_both::<WIDE>(&self.corners[1], a1, places, h2_s2);
            accelerations.add_to_both::<WIDE>(&self.corners[2], a2, places, h2_s2);
            accelerations.add_to_both::<WIDE>(&self.corners[3], a3, places, h2_s2);
        }
    }

    /// Lets a change of the stress act on the accelerations alone.
    #[inline(always)]
    fn accelerate<const WIDE: bool>(
        &self,
        particles: ParticleAccess,
        change: [Lanes3; 3],
        accelerations: ParticleAccess,
    ) {
        let changes = self.accelerations(&self.gather::<WIDE>(particles), change);
        for (corner, change) in self.corners.iter().zip(changes) {
            // SAFETY: as in `gather`.
            unsafe { accelerations.add::<WIDE>(corner, change) };
        }
    }

    /// Columns times the symmetric 3×3 response.
    #[inline(always)]
    fn responded(&self, columns: [Lanes3; 3]) -> [Lanes3; 3] {
        let [xx, yy, zz, xy, yz, zx] = self.response;
        let [x, y, z] = columns;
        [
            x.scaled(xx) + y.scaled(xy) + z.scaled(zx),
            x.scaled(xy) + y.scaled(yy) + z.scaled(yz),
            x.scaled(zx) + y.scaled(yz) + z.scaled(zz),
        ]
    }

    /// Moves stress and corners to where they fit each other, with the neighbours held. Returns
    /// whether a stress is too large to be carried over.
    ///
    /// With a `pull`, the stiffness is that of the shape at rest all the same: the pulled one's is s times as
    /// much, and a stiffer one only shortens steps whose end is the same.
    #[inline(always)]
    pub fn project<const WIDE: bool>(
        &mut self,
        particles: ParticleAccess,
        accelerations: ParticleAccess,
        pull: Option<Pull>,
        step: Step,
    ) -> bool {
        let corners = self.gather::<WIDE>(particles);
        let (deformation, scale) = self.deformation::<WIDE>(&corners, pull);
        let mut rest = self.misfit(&deformation, scale, step);
        let cofactor = deformation.cofactor;
        let k = self.volume_m3.times(OWN_RESPONSE * step.h2_s2);
        let bulk = k.times(step.bulk_pa);
        let shear = k.times(STIFFNESS_IN_MU * step.mu_pa);

        // Sherman and Morrison: the rank-one bulk term on top of the isotropic one.
        let bent = self.responded(cofactor);
        let share = inner(rest, bent) * bulk / (Lanes::splat(1.0) + bulk * inner(cofactor, bent));
        for i in 0..3 {
            rest[i] = rest[i] - cofactor[i].scaled(share);
        }
        let soft = self.responded(rest);
        self.settle::<WIDE>(&corners, rest, soft, shear, particles, accelerations, step)
    }

    /// The same with another material, whose only rest is the shape that `sound` holds: convex, so
    /// that nothing is ever in the way back.
    #[inline(always)]
    pub fn restore<const WIDE: bool>(
        &mut self,
        particles: ParticleAccess,
        accelerations: ParticleAccess,
        sound: ParticleAccess,
        step: Step,
    ) -> bool {
        let corners = self.gather::<WIDE>(particles);
        let [a, b, c] = edges(&corners);
        let [sound_a, sound_b, sound_c] = edges(&self.gather::<WIDE>(sound));
        let change = self.gradient([a - sound_a, b - sound_b, c - sound_c]);
        let stiffness = STIFFNESS_IN_MU * step.mu_pa;
        let shear = self.volume_m3.times(OWN_RESPONSE * step.h2_s2 * stiffness);
        let mut rest = [Lanes3::default(); 3];
        for i in 0..3 {
            rest[i] = change[i].times(stiffness) - self.stress[i];
        }
        let soft = self.responded(rest);
        self.settle::<WIDE>(&corners, rest, soft, shear, particles, accelerations, step)
    }

    /// Applies the change of stress `rest − shear · soft`.
    #[inline(always)]
    #[expect(
        clippy::too_many_arguments,
        reason = "the tail of two kernels, inlined"
    )]
    fn settle<const WIDE: bool>(
        &mut self,
        corners: &[Corner; 4],
        rest: [Lanes3; 3],
        soft: [Lanes3; 3],
        shear: Lanes,
        particles: ParticleAccess,
        accelerations: ParticleAccess,
        step: Step,
    ) -> bool {
        let mut change = [Lanes3::default(); 3];
        for i in 0..3 {
            change[i] = (rest[i] - soft[i].scaled(shear)).times(STRESS_LEAD);
            self.stress[i] = self.stress[i] + change[i];
        }
        let h2_s2 = step.h2_s2 / STRESS_LEAD;
        self.act::<WIDE>(corners, change, particles, accelerations, h2_s2);
        let squared = inner(self.stress, self.stress);
        let limit = step.carried_max_pa * step.carried_max_pa;
        let mut over = false;
        for lane in 0..LANES {
            over |= squared.0[lane] > limit;
        }
        over
    }

    /// Lets go of the stress that is not carried into the next substep.
    #[inline(always)]
    pub fn shed<const WIDE: bool>(
        &mut self,
        particles: ParticleAccess,
        accelerations: ParticleAccess,
        step: Step,
    ) {
        let squared = inner(self.stress, self.stress);
        let limit = Lanes::splat(step.carried_max_pa * step.carried_max_pa);
        let within = limit.zip(squared, |limit, x| (limit / x.max(limit)).sqrt());
        let kept = within * self.kept;
        if kept.0.iter().all(|&share| share >= 1.0) {
            return;
        }
        let mut change = [Lanes3::default(); 3];
        for i in 0..3 {
            change[i] = self.stress[i].scaled(kept - Lanes::splat(1.0));
            self.stress[i] = self.stress[i].scaled(kept);
        }
        self.accelerate::<WIDE>(particles, change, accelerations);
    }

    /// Adds what the stress as it is does to the accelerations.
    #[inline(always)]
    pub fn accelerate_anew<const WIDE: bool>(
        &self,
        particles: ParticleAccess,
        accelerations: ParticleAccess,
    ) {
        self.accelerate::<WIDE>(particles, self.stress, accelerations);
    }

    /// What is left of the equations, and who is wrecked. A body on its way back must do better
    /// than not being inside out: `volume_share_min`.
    #[inline(always)]
    pub fn standing<const WIDE: bool>(
        &self,
        particles: ParticleAccess,
        pull: Option<Pull>,
        step: Step,
        volume_share_min: f32,
    ) -> Standing {
        let (deformation, scale) = self.deformation::<WIDE>(&self.gather::<WIDE>(particles), pull);
        let rest = self.misfit(&deformation, scale, step);
        let Deformation { f, j, .. } = deformation;
        let squared = inner(f, f);
        // A lane that is not used has no volume and is nobody's wreck. Written so that NaN is one.
        let mut wrecked = Lanes::splat(1.0);
        for lane in 0..LANES {
            let fine = j.0[lane] >= volume_share_min
                && squared.0[lane] >= SQUARED_MIN
                && squared.0[lane] <= SQUARED_MAX;
            if fine || self.volume_m3.0[lane] == 0.0 {
                wrecked.0[lane] = 0.0;
            }
        }
        Standing {
            residual_squared: inner(rest, rest),
            wrecked,
        }
    }
}

/// Columns times a vector.
#[inline(always)]
fn along(columns: [Lanes3; 3], vector: Lanes3) -> Lanes3 {
    columns[0].scaled(vector.x) + columns[1].scaled(vector.y) + columns[2].scaled(vector.z)
}

/// Edges from corner 0.
#[inline(always)]
fn edges(corners: &[Corner; 4]) -> [Lanes3; 3] {
    let origin = corners[0].position;
    [
        corners[1].position - origin,
        corners[2].position - origin,
        corners[3].position - origin,
    ]
}

/// Sum of the products of all nine entries.
#[inline(always)]
fn inner(a: [Lanes3; 3], b: [Lanes3; 3]) -> Lanes {
    a[0].dot(b[0]) + a[1].dot(b[1]) + a[2].dot(b[2])
}
