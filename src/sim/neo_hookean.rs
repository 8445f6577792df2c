//! Stable neo-Hookean tetrahedra in XPBD, the nine components of the stress solved together.
//!
//! XPBD's multiplier of a constraint is, over the square of the substep, a force. Here a
//! tetrahedron of volume V has nine of them, the entries of its stress T, and the constraint is
//! that T be the first Piola-Kirchhoff stress P(F) of its deformation gradient F. A change D of T
//! moves corner k, of inverse mass w and shape gradient g, by −h² V w D g, and so changes F by
//! −h² V D S with S = Σ w g gᵀ. To first order, T + D = P(F − h² V D S) is
//!
//! D + θ h² V H : (D S) = P(F) − T,
//!
//! nine equations with H = ∂P/∂F and θ = 1. One sweep solves them for each tetrahedron in turn. Three things
//! make one sweep a substep enough:
//!
//! * H is replaced by c μ 1 + (λ+μ) cof F ⊗ cof F, the rank-one part in full and the rest by a
//!   bound: |(λ+μ)(J−1) − μ| ‖∂cof F/∂F‖ is at most μ where the stress is moderate, so c = 2. The
//!   system then has a closed form, Q = S (1 + c μ θ h² V S)⁻¹ being constant; a stiffer H only
//!   shortens steps whose end is the same.
//! * θ is 0.85: over-relaxation. In a smooth field the neighbours undo half of what a tetrahedron
//!   does, so the solve of one alone is too careful; at 0.75 the shortest waves grow.
//! * A substep starts from the stress where the last one ended, as contact solvers do. A body at
//!   rest is then exactly in balance, however few sweeps it gets; from zero, as textbooks start,
//!   each substep finds only a part of the force and the body sags.
//! * What is carried over acts where the last substep left the body, so an explicit step is hidden
//!   in it, and in smooth waves, of which one sweep finds only a share g of the change, the stress
//!   lags behind by 1/g substeps. A wave that turns by the angle φ a substep then grows if
//!   1/g > L + 1 + φ², where each change D acts at once but L D is added to the stress: a lead,
//!   which is gone where nothing changes. L = 1 is what the equations above say; 1.2 lets a little
//!   more stiffness pass, and near 2 the shortest waves grow. For shear 1/g is 1 + 2 θ h² V μ S,
//!   about 1 + κ/7 with κ = h² V (λ+2μ) tr S and ν = 0.45.
//! * It is cut where it would be unstable still: see [`CARRIED_STIFFNESS_MAX`], [`Carry`] and
//!   [`CARRIED_STRESS_IN_E`].
//!
//! Sources: Macklin, Müller, Chentanez, "XPBD: Position-Based Simulation of Compliant Constrained
//! Dynamics", MIG 2016; Smith, de Goes, Kim, "Stable Neo-Hookean Flesh Simulation", ACM TOG 37,
//! 2018 (the energy). The stress form and its closed solution are derived here.

#![expect(
    clippy::needless_range_loop,
    reason = "one counter for several arrays of the same fixed length"
)]

mod kernel;

use super::{
    Lame, SolverParams,
    lanes::{Batches, LANES, Lanes, ParticleAccess, add_spare},
    muscle::{Muscle, Pull},
    team::Team,
};
use crate::geom::TetMesh;
use glam::{DMat3, DVec3, Vec4};
use kernel::{Batch, OWN_RESPONSE, STIFFNESS_IN_MU, Step};
use std::sync::atomic::{AtomicBool, Ordering};

/// Largest κ, over the number of sweeps, whose stress is carried over whole: mean over a body of up
/// to [`SMALL_TETS`] tetrahedra, and of a single tetrahedron. Above, the share falls as its inverse.
/// A uniform mesh of spacing d has about 2 (h c/d)², c being the speed of sound. Slivers jitter if
/// 150 is let pass for one.
pub const CARRIED_STIFFNESS_MAX: [f32; 2] = [12.0, 40.0];
/// A body of which a larger share is stiffer than a single tetrahedron may be sags or trembles: a few slivers do not
/// show, but a beam with a twenty-fifth of it there, at its clamp, was 1.4 % too low, and an organ with a hundredth
/// trembled even where nothing acted on it; with 0.3 % it lay still.
const SHED_SHARE_MAX: f32 = 0.005;
/// A body of more tetrahedra has room for longer waves, which grow earlier: its limit falls as the
/// inverse of the number of tetrahedra along a side.
const SMALL_TETS: f32 = 1e4;
/// The mean limit of a body whose waves have been seen to grow: none was seen to below 5.
const CARRIED_STIFFNESS_SAFE: f32 = 5.0;
/// A misfit of stress and deformation beyond this, in Young's moduli, for so many steps is that of
/// waves that grow; a beam that swings has half of it at the turning points.
const GROWN_RESIDUAL: f64 = 0.3;
const GROWN_STEPS: u32 = 4;
/// Waves that go on for so many steps though the body carries as much over as is safe for a mean one: its mesh is much finer
/// in one place, and they grow there. A blow is over sooner.
const GROWN_ON_STEPS: u32 = 12;
/// A stress of more Young's moduli than this is carried over cut down to it: beyond there are wrecks, and there the
/// explicit step throws things about. Small tetrahedra at the rim of a clamp have 2 and more for good, and a body
/// whose stress is cut keeps moving.
const CARRIED_STRESS_IN_E: f32 = 10.0;
/// A body is wrecked once more than this share of its tetrahedra is, and on its way back until
/// less than the second share is.
const WRECKED_SHARES: [f64; 2] = [0.2, 0.01];
/// A body that so many steps have not led back is held in its state by something, a tool or a load,
/// and left to its own material again.
const LED_STEPS_MAX: u32 = 120;
/// Volume over rest volume below which a tetrahedron is wrecked, in a sound body and in one that
/// is on its way back.
const WRECKED_VOLUMES: [f32; 2] = [-0.05, 0.1];

/// Batches a chunk, in looking how they stand: some microseconds.
const BATCHES_PER_CHUNK: usize = 64;

/// All tetrahedra of a body.
#[derive(Clone, Debug)]
pub struct NeoHookean {
    tets: Batches<Batch>,
    tet_count: usize,
    /// What the stresses do to each particle [m/s²], and spare places.
    accelerations: Vec<Vec4>,
    /// The last shape that was not wrecked [m], and spare places.
    sound: Vec<Vec4>,
    /// What of the body is muscle; nothing where it has never beaten.
    pub muscle: Option<Muscle>,
    /// What the responses and shares of `tets` were made for.
    ready_for: Option<SolverParams>,
    step: Step,
    carry: Carry,
    /// Share of its stress that every tetrahedron carries over at most.
    kept_by_all: f32,
    /// Whether some tetrahedron carries only a share of its stress over.
    sheds: bool,
    /// Whether some stress was too large to be carried over after the last sweep.
    overloaded: bool,
    /// Whether the body is wrecked and is led back to its last sound shape.
    restoring: bool,
    /// Steps since it was wrecked.
    led_steps: u32,
}

/// How much of its stress the body as a whole carries over.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Carry {
    /// As much as its size and stiffness allow, with so many steps in a row in which waves seemed
    /// to grow, though all was carried over.
    #[default]
    Most,
    Growing(u32),
    /// As much as is safe: waves have grown, and have gone on for so many steps in a row since.
    Safe(u32),
}

/// How all tetrahedra stand.
#[derive(Clone, Copy, Debug, Default)]
pub struct Residual {
    /// Sum over all tetrahedra of ‖P − T‖² over E².
    pub squared_sum: f64,
    /// Number of tetrahedra.
    pub count: usize,
    wrecked: usize,
}

impl NeoHookean {
    /// Tetrahedra `sound` of `mesh`, of which `fill` is the share that is tissue.
    pub fn new(mesh: &TetMesh, sound: &[u32], fill: &[f32]) -> Self {
        let corners: Vec<[u32; 4]> = sound.iter().map(|&tet| mesh.tets[tet as usize]).collect();
        let tets = Batches::new(&corners, &mesh.particles, |members, corners| {
            let mut batch = Batch {
                corners,
                rest_inverse: Default::default(),
                volume_m3: Lanes::default(),
                response: Default::default(),
                kept: Lanes::splat(1.0),
                stress: Default::default(),
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
                let volume = 1.0 / (6.0 * inverse.determinant());
                batch.volume_m3.0[lane] = volume as f32 * fill[tet];
            }
            batch
        });
        let mut rest: Vec<Vec4> = mesh.particles.iter().map(|x| x.extend(0.0)).collect();
        add_spare(&mut rest);
        Self {
            tets,
            tet_count: sound.len(),
            accelerations: vec![Vec4::ZERO; rest.len()],
            sound: rest,
            muscle: None,
            ready_for: None,
            carry: Carry::default(),
            kept_by_all: 1.0,
            step: Step::default(),
            sheds: false,
            overloaded: false,
            restoring: false,
            led_steps: 0,
        }
    }

    /// Starts a substep from the stress where the last one ended, and returns what that does to
    /// each particle [m/s²]; the last entries are of spare places.
    pub fn begin_substep(
        &mut self,
        team: &Team,
        particles: &mut [Vec4],
        params: &SolverParams,
    ) -> &[Vec4] {
        if self.ready_for != Some(*params) {
            self.make_ready(team, particles, params);
        } else if self.sheds || self.overloaded {
            let (step, places) = (self.step, ParticleAccess::new(particles));
            self.tets
                .for_each_part(team, &mut self.accelerations, |run, accelerations| {
                    run_avx(run, Work::Shed, places, accelerations, places, step);
                });
        }
        &self.accelerations
    }

    /// One sweep over all tetrahedra.
    pub fn project(&mut self, team: &Team, particles: &mut [Vec4]) {
        let step = self.step;
        let sound = ParticleAccess::new(&mut self.sound);
        let accelerations = ParticleAccess::new(&mut self.accelerations);
        let work = match self.muscle.as_mut().map(Muscle::pull) {
            _ if self.restoring => Work::Restore,
            Some(pull) => Work::Contract(pull),
            None => Work::Project,
        };
        let overloaded = AtomicBool::new(false);
        self.tets.for_each_part(team, particles, |run, places| {
            if run_avx(run, work, places, accelerations, sound, step) {
                overloaded.store(true, Ordering::Relaxed);
            }
        });
        self.overloaded = overloaded.into_inner();
    }

    /// Substeps with which the body is safe to carry all its stress over, if with those of `params` it
    /// can't and sags too far.
    pub fn faithful_substeps(&self, particles: &[Vec4], params: &SolverParams) -> Option<u32> {
        let mut stiffnesses = self.stiffnesses(particles, params);
        stiffnesses.sort_by(|a, b| b.total_cmp(a));
        let count = stiffnesses.len().max(1) as f32;
        let mean = stiffnesses.iter().sum::<f64>() as f32 / count;
        let all_but_few = stiffnesses.get((SHED_SHARE_MAX * count) as usize);
        let all_but_few = all_but_few.map_or(0.0, |&stiffness| stiffness as f32);
        let (own_max, safe) = (
            own_max(params),
            CARRIED_STIFFNESS_SAFE * params.iterations as f32,
        );
        let wanted = (mean / safe).max(all_but_few / own_max);
        let wanted = f64::from(params.substeps) * f64::from(wanted).sqrt();
        (mean > self.mean_max(params) || all_but_few > own_max)
            .then(|| wanted.ceil().min(f64::from(u32::MAX)) as u32)
    }

    /// Whether waves have been seen to grow in it, and it sags since.
    pub fn sags(&self) -> bool {
        matches!(self.carry, Carry::Safe(_)) && self.kept_by_all < 1.0
    }

    /// Whether waves have grown on since.
    pub fn waves_grow_on(&self) -> bool {
        matches!(self.carry, Carry::Safe(steps) if steps >= GROWN_ON_STEPS)
    }

    /// κ of every tetrahedron.
    fn stiffnesses(&self, particles: &[Vec4], params: &SolverParams) -> Vec<f64> {
        let step = step_of(params);
        let used = |batch: &Batch, lane: usize| batch.volume_m3.0[lane] > 0.0;
        (self.tets.as_slice().iter())
            .flat_map(|batch| (0..LANES).map(move |lane| (batch, lane)))
            .filter(|&(batch, lane)| used(batch, lane))
            .map(|(batch, lane)| {
                let k = f64::from(step.h2_s2 * batch.volume_m3.0[lane]);
                stiffness(mobility(batch, lane, particles), k, step)
            })
            .collect()
    }

    /// The largest such mean at which all stress is carried over.
    fn mean_max(&self, params: &SolverParams) -> f32 {
        let a_sweep = match self.carry {
            Carry::Most | Carry::Growing(_) => {
                let size = (SMALL_TETS / self.tet_count.max(1) as f32).cbrt();
                CARRIED_STIFFNESS_MAX[0] * size.min(1.0)
            }
            Carry::Safe(_) => CARRIED_STIFFNESS_SAFE,
        };
        a_sweep * params.iterations as f32
    }

    /// Forgets all stress: the body was put somewhere else. A wrecked one is led back from there.
    pub fn forget(&mut self, particles: &mut [Vec4], params: &SolverParams) {
        for batch in self.tets.as_mut_slice() {
            batch.stress = Default::default();
        }
        self.accelerations.fill(Vec4::ZERO);
        (self.carry, self.ready_for) = (Carry::Most, None);
        self.assess(&Team::alone(), particles, params);
    }

    /// How far stress and deformation are apart, after a step; decides whether the body is
    /// wrecked, and remembers its shape if it is not.
    pub fn assess(
        &mut self,
        team: &Team,
        particles: &mut [Vec4],
        params: &SolverParams,
    ) -> Residual {
        self.step = step_of(params);
        let pull = self.muscle.as_mut().map(Muscle::pull);
        let residual = self.standing(team, particles, pull);
        let count = residual.count.max(1) as f64;
        self.watch((residual.squared_sum / count).sqrt());
        let share = residual.wrecked as f64 / count;
        let wrecked = share > WRECKED_SHARES[usize::from(self.led_steps > 0)];
        self.led_steps = if wrecked { self.led_steps + 1 } else { 0 };
        self.restoring = wrecked && self.led_steps <= LED_STEPS_MAX;
        if !self.restoring && residual.wrecked == 0 {
            self.sound.copy_from_slice(particles);
        }
        residual
    }

    /// Carries less over from now on if waves have been growing.
    fn watch(&mut self, residual_rms: f64) {
        let is_shaken = residual_rms > GROWN_RESIDUAL && !self.restoring;
        let grows = is_shaken && self.kept_by_all >= 1.0;
        self.carry = match self.carry {
            Carry::Growing(steps) if grows && steps + 1 >= GROWN_STEPS => {
                self.ready_for = None;
                Carry::Safe(0)
            }
            Carry::Growing(steps) if grows => Carry::Growing(steps + 1),
            Carry::Most if grows => Carry::Growing(1),
            Carry::Safe(steps) if is_shaken => Carry::Safe(steps.saturating_add(1)),
            Carry::Safe(_) => Carry::Safe(0),
            Carry::Most | Carry::Growing(_) => Carry::Most,
        };
    }

    /// Whether the body is wrecked and is led back to its last sound shape.
    pub fn is_restoring(&self) -> bool {
        self.restoring
    }

    fn standing(&self, team: &Team, particles: &mut [Vec4], pull: Option<Pull>) -> Residual {
        let places = ParticleAccess::new(particles);
        let volume_min = WRECKED_VOLUMES[usize::from(self.restoring)];
        let chunks: Vec<&[Batch]> = self.tets.as_slice().chunks(BATCHES_PER_CHUNK).collect();
        let standings = team.map(chunks.len(), |chunk| {
            standing_of(chunks[chunk], places, pull, self.step, volume_min)
        });
        let (squared_sum_pa2, wrecked) =
            (standings.into_iter()).fold((0.0, 0), |sum, own| (sum.0 + own.0, sum.1 + own.1));
        let young_pa = f64::from(self.step.carried_max_pa / CARRIED_STRESS_IN_E);
        Residual {
            squared_sum: squared_sum_pa2 / (young_pa * young_pa),
            count: self.tet_count,
            wrecked,
        }
    }

    /// Responses, shares and accelerations for these parameters.
    fn make_ready(&mut self, team: &Team, particles: &mut [Vec4], params: &SolverParams) {
        let step = step_of(params);
        self.step = step;
        if self.ready_for.replace(*params).is_some() {
            // Another material or time step: what was seen of the old one says nothing.
            self.carry = Carry::Most;
        }
        let own_max = own_max(params);
        let mean_max = self.mean_max(params);
        let mut stiffness_sum = 0.0;
        for batch in self.tets.as_mut_slice() {
            for lane in 0..LANES {
                let k = f64::from(step.h2_s2 * batch.volume_m3.0[lane]);
                let mobility = mobility(batch, lane, particles);
                let stiffness = stiffness(mobility, k, step);
                stiffness_sum += stiffness;
                let shear = k * f64::from(OWN_RESPONSE * STIFFNESS_IN_MU * step.mu_pa);
                let response = mobility * (DMat3::IDENTITY + mobility * shear).inverse();
                let [x, y, z] = [response.x_axis, response.y_axis, response.z_axis];
                let entries = [x.x, y.y, z.z, x.y, y.z, z.x];
                for (entry, value) in entries.iter().enumerate() {
                    batch.response[entry].0[lane] = *value as f32;
                }
                batch.kept.0[lane] = own_max / (stiffness as f32).max(own_max);
            }
        }
        let mean = (stiffness_sum / self.tet_count.max(1) as f64) as f32;
        self.kept_by_all = mean_max / mean.max(mean_max);
        self.sheds = false;
        for batch in self.tets.as_mut_slice() {
            for kept in &mut batch.kept.0 {
                *kept = kept.min(self.kept_by_all);
                self.sheds |= *kept < 1.0;
            }
        }
        self.accelerations.fill(Vec4::ZERO);
        let places = ParticleAccess::new(particles);
        self.tets
            .for_each_part(team, &mut self.accelerations, |run, accelerations| {
                for batch in run {
                    batch.accelerate_anew::<false>(places, accelerations);
                }
            });
    }
}

/// The largest κ at which a tetrahedron carries all its stress over.
fn own_max(params: &SolverParams) -> f32 {
    CARRIED_STIFFNESS_MAX[1] * params.iterations as f32
}

/// κ of a tetrahedron of this mobility S, with k = h² V; 0 where a lane is not used.
fn stiffness(mobility: DMat3, k: f64, step: Step) -> f64 {
    let trace = mobility.x_axis.x + mobility.y_axis.y + mobility.z_axis.z;
    k * trace * f64::from(step.bulk_pa + step.mu_pa)
}

/// S = Σ w g gᵀ of one tetrahedron [1/(kg m²)].
fn mobility(batch: &Batch, lane: usize, particles: &[Vec4]) -> DMat3 {
    let mut sum = DMat3::ZERO;
    let mut first = DVec3::ZERO;
    let outer = |g: DVec3, w: f32| {
        let g_w = f64::from(w) * g;
        DMat3::from_cols(g_w * g.x, g_w * g.y, g_w * g.z)
    };
    for k in 0..3 {
        let row = &batch.rest_inverse[k];
        let g = glam::Vec3::new(row.x.0[lane], row.y.0[lane], row.z.0[lane]).as_dvec3();
        first -= g;
        sum += outer(g, particles[batch.corners[k + 1][lane] as usize].w);
    }
    sum + outer(first, particles[batch.corners[0][lane] as usize].w)
}

fn step_of(params: &SolverParams) -> Step {
    let Lame { mu_pa, lambda_pa } = params.lame();
    Step {
        mu_pa,
        bulk_pa: lambda_pa + mu_pa,
        h2_s2: params.substep_s() * params.substep_s(),
        carried_max_pa: CARRIED_STRESS_IN_E * params.youngs_modulus_pa,
    }
}

/// What is done to a run of batches.
#[derive(Clone, Copy)]
enum Work {
    Project,
    Contract(Pull),
    Restore,
    Shed,
}

/// Works on one batch after the other, with the widest vectors the machine has. Returns whether a
/// stress is too large to be carried over.
fn run_avx(
    run: &mut [Batch],
    work: Work,
    places: ParticleAccess,
    accelerations: ParticleAccess,
    sound: ParticleAccess,
    step: Step,
) -> bool {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the machine has AVX2.
        return unsafe { run_with_avx2(run, work, places, accelerations, sound, step) };
    }
    run_batches::<false>(run, work, places, accelerations, sound, step)
}

/// The same code, compiled for eight lanes an instruction. No fused multiply-add: bits stay.
#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn run_with_avx2(
    run: &mut [Batch],
    work: Work,
    places: ParticleAccess,
    accelerations: ParticleAccess,
    sound: ParticleAccess,
    step: Step,
) -> bool {
    run_batches::<true>(run, work, places, accelerations, sound, step)
}

#[inline(always)]
fn run_batches<const WIDE: bool>(
    run: &mut [Batch],
    work: Work,
    places: ParticleAccess,
    accelerations: ParticleAccess,
    sound: ParticleAccess,
    step: Step,
) -> bool {
    // Loops and no closures: those are compiled for the narrow vectors of the base machine.
    let mut over = false;
    match work {
        Work::Project => {
            for batch in run {
                over |= batch.project::<WIDE>(places, accelerations, None, step);
            }
        }
        Work::Contract(pull) => {
            for batch in run {
                over |= batch.project::<WIDE>(places, accelerations, Some(pull), step);
            }
        }
        Work::Restore => {
            for batch in run {
                over |= batch.restore::<WIDE>(places, accelerations, sound, step);
            }
        }
        Work::Shed => {
            for batch in run {
                batch.shed::<WIDE>(places, accelerations, step);
            }
        }
    }
    over
}

/// Sum of squares of what is left of the equations [Pa²], and the number of wrecked tetrahedra.
fn standing_of(
    batches: &[Batch],
    places: ParticleAccess,
    pull: Option<Pull>,
    step: Step,
    volume_share_min: f32,
) -> (f64, usize) {
    #[cfg(target_arch = "x86_64")]
    if std::arch::is_x86_feature_detected!("avx2") {
        // SAFETY: the machine has AVX2.
        return unsafe { standing_with_avx2(batches, places, pull, step, volume_share_min) };
    }
    add_standings::<false>(batches, places, pull, step, volume_share_min)
}

#[cfg(target_arch = "x86_64")]
#[target_feature(enable = "avx2")]
fn standing_with_avx2(
    batches: &[Batch],
    places: ParticleAccess,
    pull: Option<Pull>,
    step: Step,
    volume_share_min: f32,
) -> (f64, usize) {
    add_standings::<true>(batches, places, pull, step, volume_share_min)
}

#[inline(always)]
fn add_standings<const WIDE: bool>(
    batches: &[Batch],
    places: ParticleAccess,
    pull: Option<Pull>,
    step: Step,
    volume_share_min: f32,
) -> (f64, usize) {
    let mut squared_sum_pa2 = 0.0;
    let mut wrecked = 0.0;
    for batch in batches {
        let standing = batch.standing::<WIDE>(places, pull, step, volume_share_min);
        for lane in 0..LANES {
            squared_sum_pa2 += f64::from(standing.residual_squared.0[lane]);
            wrecked += standing.wrecked.0[lane];
        }
    }
    (squared_sum_pa2, wrecked as usize)
}

#[cfg(test)]
mod tests;
