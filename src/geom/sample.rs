//! Sixteen points that stand for a patch: well spread, weighted, chosen once at rest.
//!
//! A least-squares fit sees a patch through its moments up to the second order alone. So the weights
//! start as shares of the patch (how many members lie nearest to each sample) and are then changed
//! as little as it takes to give the samples the very moments of the patch. Moments follow an affine map
//! as the points do: a patch that is turned, sheared or stretched evenly keeps the fit of all its members.

use super::patch::{LEAF_SLOTS, Patches};
use glam::{DVec3, Vec3};
use rayon::prelude::*;

/// Samples of a patch; the same in `leaf_listed.wgsl`.
pub const SAMPLES: usize = 16;
/// Least share of its first weight that a sample keeps, so that none turns negative.
const WEIGHT_KEPT_MIN: f64 = 0.1;
/// Added to the diagonal of whitened moments, whose size is one: patches that are flat, or have fewer
/// samples than moments, leave some of them undetermined.
const RIDGE: f64 = 1e-9;
/// Least weight of a sample at the rim of its patch, as a share of one at its point.
const RIM_WEIGHT: f32 = 0.05;

/// A point that stands for a part of a patch.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sample {
    /// Which point.
    pub point: u32,
    /// Its share of the patch, a half float; those of a patch add up to nearly one.
    pub weight: f32,
}

/// The nearest half float: kernel and twin see the same weights.
fn rounded(weight: f32) -> f32 {
    half::f16::from_f32(weight).to_f32()
}

/// The samples of every patch.
#[derive(Clone, Debug)]
pub struct Samples {
    /// The point in each slot, as in [`Patches`].
    pub order: Vec<u32>,
    /// Samples of the patch of each slot; patches of fewer points end with their own, weighing nothing.
    pub of_slot: Vec<[Sample; SAMPLES]>,
}

impl Samples {
    /// Chooses the samples of every patch of the surface at rest.
    ///
    /// # Panics
    ///
    /// If `patches` are not those of `points`.
    pub fn new(points: &[Vec3], patches: &Patches) -> Self {
        assert_eq!(
            points.len(),
            patches.order.len(),
            "the patches of the points"
        );
        let of_slot = patches
            .order
            .par_iter()
            .map(|&point| {
                let members: Vec<usize> = patches.members(point as usize).collect();
                choose(points, &members, point as usize)
            })
            .collect();
        Self {
            order: patches.order.clone(),
            of_slot,
        }
    }

    /// The same samples with weights that fall from a patch's point to its farthest sample, as
    /// `1 − d²/r²`: a parabola errs most at the rim, and what is near decides how light enters.
    pub fn weighted_to_the_middle(mut self, points: &[Vec3]) -> Self {
        for (samples, &point) in self.of_slot.iter_mut().zip(&self.order) {
            let at = points[point as usize];
            let squared = samples.map(|sample| points[sample.point as usize].distance_squared(at));
            let reach = squared.iter().copied().fold(f32::MIN_POSITIVE, f32::max);
            for (sample, d) in samples.iter_mut().zip(squared) {
                sample.weight = rounded(sample.weight * (1.0 - d / reach).max(RIM_WEIGHT));
            }
        }
        self
    }

    /// Samples of `slot` that weigh something.
    pub fn weighing(&self, slot: usize) -> impl Iterator<Item = Sample> + '_ {
        let samples = self.of_slot[slot].iter().copied();
        samples.filter(|sample| sample.weight > 0.0)
    }

    /// As the kernels read them, slot by slot: six texels of four words.
    pub fn packed(&self) -> Vec<[u32; 4]> {
        let half = |sample: &Sample| u32::from(half::f16::from_f32(sample.weight).to_bits());
        let words = self.of_slot.iter().flat_map(|samples| {
            let points = samples.iter().map(|sample| sample.point);
            let weights = samples
                .chunks(2)
                .map(|pair| half(&pair[0]) | half(&pair[1]) << 16);
            points.chain(weights).collect::<Vec<_>>()
        });
        bytemuck::pod_collect_to_vec(&words.collect::<Vec<u32>>())
    }

    /// Leaves that are to be fitted anew when a point of `leaf` moves, sorted, leaf by leaf: those with a
    /// sample in it, or with a point whose normal hangs on one in it by a triangle.
    pub fn dependents(&self, triangles: &[[u32; 3]]) -> Vec<Vec<u32>> {
        let mut leaf_of = vec![0; self.order.len()];
        for (slot, &point) in self.order.iter().enumerate() {
            leaf_of[point as usize] = (slot / LEAF_SLOTS) as u32;
        }
        let mut dependents = vec![Vec::new(); self.order.len().div_ceil(LEAF_SLOTS)];
        for (slot, samples) in self.of_slot.iter().enumerate() {
            let leaf = (slot / LEAF_SLOTS) as u32;
            for sample in samples {
                dependents[leaf_of[sample.point as usize] as usize].push(leaf);
            }
        }
        for triangle in triangles {
            let leaves = triangle.map(|point| leaf_of[point as usize]);
            for a in leaves {
                dependents[a as usize].extend(leaves);
            }
        }
        for list in &mut dependents {
            list.sort_unstable();
            list.dedup();
        }
        dependents
    }
}

/// Farthest points first: each is the member farthest from those before it, the first the patch's own.
fn choose(points: &[Vec3], members: &[usize], own: usize) -> [Sample; SAMPLES] {
    let nothing = Sample {
        point: own as u32,
        weight: 0.0,
    };
    let mut nearest = vec![0_usize; members.len()];
    let mut squared = vec![f32::INFINITY; members.len()];
    let mut chosen = vec![own];
    loop {
        let last = points[chosen[chosen.len() - 1]];
        let (mut farthest, mut at) = (0.0, None);
        for (i, &member) in members.iter().enumerate() {
            let d = points[member].distance_squared(last);
            if d < squared[i] {
                squared[i] = d;
                nearest[i] = chosen.len() - 1;
            }
            if squared[i] > farthest {
                farthest = squared[i];
                at = Some(member);
            }
        }
        match at {
            Some(member) if chosen.len() < SAMPLES => chosen.push(member),
            _ => break,
        }
    }
    let mut shares = vec![0.0; chosen.len()];
    for &sample in &nearest {
        shares[sample] += 1.0 / members.len().max(1) as f64;
    }
    let place = |point: usize| (points[point] - points[own]).as_dvec3();
    let patch: Vec<DVec3> = members.iter().map(|&member| place(member)).collect();
    let spread: Vec<DVec3> = chosen.iter().map(|&point| place(point)).collect();
    let weights = with_moments_of(&patch, &spread, &shares);
    let mut samples = [nothing; SAMPLES];
    for (sample, (&point, weight)) in samples.iter_mut().zip(chosen.iter().zip(weights)) {
        *sample = Sample {
            point: point as u32,
            weight: rounded(weight as f32),
        };
    }
    samples
}

/// `shares` changed as little as gives `samples` the moments of `patch` up to the second order, as far as no
/// weight falls below a tenth of its share.
fn with_moments_of(patch: &[DVec3], samples: &[DVec3], shares: &[f64]) -> Vec<f64> {
    type Moments = nalgebra::SVector<f64, 10>;
    let count = patch.len() as f64;
    let mean = patch.iter().sum::<DVec3>() / count;
    let mut spread = nalgebra::Matrix3::<f64>::zeros();
    for place in patch {
        let d = nalgebra::Vector3::from((*place - mean).to_array());
        spread += d * d.transpose() / count;
    }
    let trace = spread.trace();
    if !(trace > 0.0 && trace.is_finite()) {
        return shares.to_vec();
    }
    // Whitened, so that the thin direction of a patch counts as much as the wide ones.
    let Some(whiten) = (spread + nalgebra::Matrix3::identity() * (1e-7 * trace)).cholesky() else {
        return shares.to_vec();
    };
    let moments = |place: &DVec3| {
        let mut d = nalgebra::Vector3::from((*place - mean).to_array());
        whiten.l_dirty().solve_lower_triangular_mut(&mut d);
        let [x, y, z] = [d.x, d.y, d.z];
        Moments::from([1.0, x, y, z, x * x, y * y, z * z, x * y, x * z, y * z])
    };
    let wanted = patch.iter().map(moments).sum::<Moments>() / count;
    let of_samples: Vec<Moments> = samples.iter().map(moments).collect();
    let mut missing = wanted;
    let mut gram = nalgebra::SMatrix::<f64, 10, 10>::identity() * RIDGE;
    for (share, m) in shares.iter().zip(&of_samples) {
        missing -= m * *share;
        gram += m * m.transpose() * *share;
    }
    let Some(factors) = gram.cholesky() else {
        return shares.to_vec();
    };
    // The least change by the norm Σ (δw)²/w: each weight times 1 + y · m.
    let y = factors.solve(&missing);
    let changes: Vec<f64> = of_samples.iter().map(|m| y.dot(m)).collect();
    let lowest = changes.iter().copied().fold(0.0, f64::min);
    let part = if lowest < WEIGHT_KEPT_MIN - 1.0 {
        (WEIGHT_KEPT_MIN - 1.0) / lowest
    } else {
        1.0
    };
    let weights: Vec<f64> = shares
        .iter()
        .zip(&changes)
        .map(|(share, change)| share * (1.0 + part * change))
        .collect();
    let total: f64 = weights.iter().sum();
    if !(total.is_finite() && total > 0.0) {
        return shares.to_vec();
    }
    weights.iter().map(|weight| weight / total).collect()
}

/// Which leaves of points have moved, and which are to be fitted anew for it.
///
/// Twin of `shaders/leaf_moved.wgsl`.
#[derive(Clone, Debug)]
pub struct MovedLeaves {
    /// Where each slot lay when its leaf last moved [m].
    pub committed: Vec<Vec3>,
    /// Leaves to be fitted anew when one moves.
    pub dependents: Vec<Vec<u32>>,
    half_tolerance_m: f32,
}

/// What one look found.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub struct FoundLeaves {
    /// Points farther than half the tolerance from where their leaf last moved.
    pub moved: u32,
    /// Slots of the listed leaves.
    pub refitted: u32,
    /// Leaves to be fitted anew, sorted.
    pub listed: Vec<u32>,
}

impl MovedLeaves {
    /// Of the surface at rest. A fit lags by no more than `tolerance_m`: half of it when it was made, and
    /// half since.
    pub fn new(
        points: &[Vec3],
        samples: &Samples,
        dependents: Vec<Vec<u32>>,
        tolerance_m: f32,
    ) -> Self {
        Self {
            committed: samples.order.iter().map(|&p| points[p as usize]).collect(),
            dependents,
            half_tolerance_m: half_tolerance_m(tolerance_m),
        }
    }

    /// Looks at all points, and takes over where those of moved leaves lie now.
    pub fn find(&mut self, points: &[Vec3], order: &[u32]) -> FoundLeaves {
        let mut found = FoundLeaves::default();
        for (leaf, (slots, known)) in order
            .chunks(LEAF_SLOTS)
            .zip(self.committed.chunks_mut(LEAF_SLOTS))
            .enumerate()
        {
            let moved = slots
                .iter()
                .zip(known.iter())
                .filter(|&(&point, old)| {
                    let d = points[point as usize] - *old;
                    d.dot(d) > self.half_tolerance_m * self.half_tolerance_m
                })
                .count();
            if moved > 0 {
                found.moved += moved as u32;
                found.listed.extend(&self.dependents[leaf]);
                for (old, &point) in known.iter_mut().zip(slots) {
                    *old = points[point as usize];
                }
            }
        }
        found.listed.sort_unstable();
        found.listed.dedup();
        found.refitted = found
            .listed
            .iter()
            .map(|&leaf| slots_of_leaf(leaf, order.len()).len() as u32)
            .sum();
        found
    }
}

/// How far a point may lie from where its leaf last moved before the leaf is fitted anew [m].
pub fn half_tolerance_m(tolerance_m: f32) -> f32 {
    0.5 * tolerance_m
}

/// The slots of `leaf`, of `slot_count` in all.
pub fn slots_of_leaf(leaf: u32, slot_count: usize) -> std::ops::Range<usize> {
    let first = leaf as usize * LEAF_SLOTS;
    first..(first + LEAF_SLOTS).min(slot_count)
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::SurfaceMesh;
    use crate::geom::plane::{fit_plane, fit_sampled_plane};
    use crate::geom::surfaces::{deformed, sphere, wavy};
    use crate::geom::tangent::{Fans, rest_normals};
    use glam::Mat3;
    use proptest::prelude::*;

    fn sampled(mesh: &SurfaceMesh, radius_m: f32) -> (Vec<Vec3>, Patches, Samples) {
        let normals = rest_normals(mesh, &Fans::new(mesh));
        let patches = Patches::new(&mesh.points, &normals, radius_m);
        let samples = Samples::new(&mesh.points, &patches);
        (normals, patches, samples)
    }

    #[test]
    fn samples_are_members_of_the_patch_with_weights_that_add_up_to_one() {
        let mesh = wavy(33);
        let (_, patches, samples) = sampled(&mesh, 0.012);
        for (slot, own) in samples.of_slot.iter().enumerate() {
            let members: Vec<usize> = patches.members(patches.order[slot] as usize).collect();
            assert!(own.iter().all(|s| members.contains(&(s.point as usize))));
            assert!(own.iter().all(|s| s.weight >= 0.0));
            let total: f32 = own.iter().map(|s| s.weight).sum();
            // Roundings to half floats, 5e-4 each at most.
            assert!((total - 1.0).abs() < 5e-4, "{total}");
            assert_eq!(samples.weighing(slot).count(), members.len().min(SAMPLES));
        }
    }

    #[test]
    fn samples_are_spread_farther_apart_than_members_are() {
        let mesh = wavy(65);
        let (_, patches, samples) = sampled(&mesh, 0.012);
        let closest = |points: &[usize]| {
            let mut least = f32::INFINITY;
            for (i, &a) in points.iter().enumerate() {
                for &b in &points[..i] {
                    least = least.min(mesh.points[a].distance(mesh.points[b]));
                }
            }
            least
        };
        let slot = patches.slot_of[32 * 65 + 32] as usize;
        let chosen: Vec<usize> = samples.weighing(slot).map(|s| s.point as usize).collect();
        let members: Vec<usize> = patches.members(32 * 65 + 32).collect();
        assert!(closest(&chosen) > 2.5 * closest(&members));
    }

    /// Worst angle [degrees] and offset difference, as a share of the radius, between the fit of all
    /// members and that of the samples, at the 99th percentile.
    fn distance_from_full(mesh: &SurfaceMesh, points: &[Vec3], radius_m: f32) -> (f32, f32) {
        let (_, patches, samples) = sampled(mesh, radius_m);
        let normals = rest_normals(
            &SurfaceMesh {
                points: points.to_vec(),
                ..mesh.clone()
            },
            &Fans::new(mesh),
        );
        let mut differences: Vec<(f32, f32)> = (0..points.len())
            .map(|slot| {
                let point = patches.order[slot] as usize;
                let members = patches.members(point).map(|m| points[m]);
                let full = fit_plane(members, points[point], normals[point]);
                let own = &samples.of_slot[slot];
                let plane = fit_sampled_plane(own, points, [points[point], normals[point]], 0.0);
                (
                    plane.normal.angle_between(full.normal).to_degrees(),
                    (plane.offset_m - full.offset_m).abs() / radius_m,
                )
            })
            .collect();
        let at = (points.len() - 1) * 99 / 100;
        differences.sort_by(|a, b| a.0.total_cmp(&b.0));
        let angle = differences[at].0;
        differences.sort_by(|a, b| a.1.total_cmp(&b.1));
        (angle, differences[at].1)
    }

    #[test]
    fn samples_have_the_plane_of_their_whole_patch_at_rest_and_after_an_affine_map() {
        let mesh = wavy(49);
        let map = Mat3::from_cols(
            Vec3::new(1.5, 0.2, 0.0),
            Vec3::new(-0.1, 0.8, 0.3),
            Vec3::new(0.2, 0.0, 1.2),
        );
        let mapped: Vec<Vec3> = mesh.points.iter().map(|&p| map * p).collect();
        for points in [&mesh.points, &mapped] {
            let (angle, offset) = distance_from_full(&mesh, points, 0.012);
            // Rounding of weights; where a weight would have turned negative the moments differ, at a
            // hundredth of the points.
            assert!(angle < 0.3, "{angle} degrees");
            assert!(offset < 3e-3, "{offset} of the radius");
        }
    }

    #[test]
    fn samples_follow_a_bend_to_within_two_degrees_of_their_whole_patch() {
        let mesh = wavy(49);
        let (angle, offset) = distance_from_full(&mesh, &deformed(&mesh.points), 0.012);
        assert!(angle < 2.0, "{angle} degrees");
        assert!(offset < 0.02, "{offset} of the radius");
    }

    #[test]
    fn shares_alone_miss_the_plane_of_the_patch() {
        // What the change of weights is for: without it the planes at rest are an order farther off.
        let mesh = wavy(49);
        let (normals, patches, samples) = sampled(&mesh, 0.012);
        let mut with = 0.0;
        let mut without = 0.0;
        for (slot, own) in samples.of_slot.iter().enumerate() {
            let point = patches.order[slot] as usize;
            let members: Vec<usize> = patches.members(point).collect();
            let full = fit_plane(
                members.iter().map(|&m| mesh.points[m]),
                mesh.points[point],
                normals[point],
            );
            let even = own.map(|sample| Sample {
                weight: 1.0 / SAMPLES as f32,
                ..sample
            });
            for (samples, sum) in [(own, &mut with), (&even, &mut without)] {
                let here = [mesh.points[point], normals[point]];
                let plane = fit_sampled_plane(samples, &mesh.points, here, 0.0);
                *sum += plane.normal.angle_between(full.normal).to_degrees();
            }
        }
        assert!(with < 0.1 * without, "{with} and {without}");
    }

    #[test]
    fn a_patch_of_one_point_or_of_points_at_one_place_has_one_sample() {
        for count in [1, 5] {
            let points = vec![Vec3::ONE; count];
            let members: Vec<usize> = (0..count).collect();
            let own = choose(&points, &members, 0);
            assert_eq!(own[0].weight, 1.0);
            assert!(own[1..].iter().all(|sample| sample.weight == 0.0));
        }
    }

    #[test]
    fn each_leaf_is_fitted_when_a_sample_of_it_moves() {
        let mesh = sphere(0.04, 24, 15);
        let (_, patches, samples) = sampled(&mesh, 0.012);
        let dependents = samples.dependents(&mesh.point_triangles());
        let mut moved = MovedLeaves::new(&mesh.points, &samples, dependents, 1e-5);
        assert_eq!(
            moved.find(&mesh.points, &samples.order),
            FoundLeaves::default()
        );
        for point in [0, 100, 200] {
            let mut points = mesh.points.clone();
            points[point] *= 1.1;
            let found = moved.clone().find(&points, &samples.order);
            assert_eq!(found.moved, 1);
            for (slot, own) in samples.of_slot.iter().enumerate() {
                if own.iter().any(|sample| sample.point as usize == point) {
                    let leaf = (slot / LEAF_SLOTS) as u32;
                    assert!(found.listed.contains(&leaf), "slot {slot} was passed over");
                }
            }
        }
        assert_eq!(patches.leaf_count(), moved.dependents.len());
    }

    proptest! {
        #[test]
        fn weights_of_any_patch_are_shares(
            places in prop::collection::vec(prop::array::uniform3(-0.01_f32..0.01), 1..60),
            flat in 0_usize..4,
        ) {
            // In space, in a plane, on a line, at one place.
            let points: Vec<Vec3> = places
                .iter()
                .map(|&[x, y, z]| match flat {
                    0 => Vec3::new(x, y, z),
                    1 => Vec3::new(x, 0.0, z),
                    2 => Vec3::new(x, 0.0, 0.0),
                    _ => Vec3::ZERO,
                })
                .collect();
            let members: Vec<usize> = (0..points.len()).collect();
            let own = choose(&points, &members, 0);
            let total: f32 = own.iter().map(|sample| sample.weight).sum();
            prop_assert!((total - 1.0).abs() < 5e-4, "{}", total);
            prop_assert!(own.iter().all(|sample| sample.weight >= 0.0));
        }
    }
}
