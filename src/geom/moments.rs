//! Running moments of patches: only what moved is taken out and put in again.
//!
//! Sums are kept in whole numbers. Taking a contribution out then cancels exactly what putting it in
//! added, so there is no drift however many frames pass, and no order of summation to care for. Each
//! patch measures from an origin near it, in a unit of about its own size, so the sums resolve it
//! wherever the body lies.

use super::patch::{LEAF_SLOTS, Patches};
use super::plane::{Plane, Spread, plane_of_moments};
use glam::{IVec3, Vec3};

/// Distance from the origin, in units, up to which a member may be counted; the same in
/// `plane_incremental.wgsl`. A patch stretched further is measured in a larger unit.
const RANGE: f32 = 4.0;
/// Times the unit may be doubled until all members are in range; the same in
/// `plane_incremental.wgsl`.
const DOUBLINGS_MAX: u32 = 32;

/// Sums over one patch. Mirror of `Patch` in `shaders/plane_incremental.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct PatchSums {
    /// Where distances are measured from [m].
    pub origin: [f32; 3],
    /// Units a metre.
    pub per_m: f32,
    /// Σ d, in quanta.
    pub sum: [i32; 3],
    /// The point the patch belongs to.
    pub point: u32,
    /// Σ of xx, yy, zz, in quanta.
    pub squares: [i32; 3],
    /// Where the patch's blocks start in the lists of [`Patches`].
    pub first_block: u32,
    /// Σ of xy, xz, yz, in quanta.
    pub products: [i32; 3],
    /// Where they end.
    pub end_block: u32,
}

/// Where a slot's point lies and lay [m]. Mirror of `Slot` in `shaders/plane_moved.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct SlotPlaces {
    /// As the sums have it, `w` is 0.
    pub now: [f32; 4],
    /// As the sums had it before the slot last moved, `w` is 0.
    pub before: [f32; 4],
}

/// What one update did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Updated {
    /// Points farther than the tolerance from where the sums had them.
    pub moved: u32,
    /// Planes fitted, each because a member moved.
    pub refitted: u32,
}

/// Planes of all points that follow moved points by their running moments.
///
/// Twin of `shaders/plane_moved.wgsl` and `shaders/plane_incremental.wgsl`.
#[derive(Clone, Debug)]
pub struct RunningPlanes {
    /// Quanta a unit (and a squared unit): the finest power of two that no patch can overflow.
    pub quanta: f32,
    /// Units a metre when a patch is summed anew: the widest patch at rest is one unit wide.
    pub rest_per_m: f32,
    /// Places, by slot.
    pub slots: Vec<SlotPlaces>,
    /// Which slots of each leaf moved in the last update.
    pub moved: Vec<u32>,
    /// Sums, by slot.
    pub patches: Vec<PatchSums>,
    /// Planes, by point.
    pub planes: Vec<Plane>,
}

impl RunningPlanes {
    /// Sums and fits every patch of the surface at rest.
    pub fn new(points: &[Vec3], normals: &[Vec3], patches: &Patches) -> Self {
        let largest = (0..patches.order.len())
            .map(|slot| patches.member_count(slot))
            .max()
            .unwrap_or(1);
        let mut running = Self {
            quanta: quanta_for(largest),
            rest_per_m: 1.0 / widest_m(points, patches),
            slots: patches
                .order
                .iter()
                .map(|&point| {
                    let place = points[point as usize].extend(0.0).to_array();
                    SlotPlaces {
                        now: place,
                        before: place,
                    }
                })
                .collect(),
            moved: vec![0; patches.leaf_count()],
            patches: Vec::new(),
            planes: normals.iter().map(|&n| Plane::tangent(n)).collect(),
        };
        running.patches = (0..patches.order.len())
            .map(|slot| {
                let mut sums = PatchSums {
                    origin: [0.0; 3],
                    per_m: running.rest_per_m,
                    sum: [0; 3],
                    point: patches.order[slot],
                    squares: [0; 3],
                    first_block: patches.lists.start[slot],
                    products: [0; 3],
                    end_block: patches.lists.start[slot + 1],
                };
                running.sum_anew(slot, patches, &mut sums);
                sums
            })
            .collect();
        for slot in 0..patches.order.len() {
            running.fit(slot, patches, normals);
        }
        running
    }

    /// Brings the planes up to date with `points` [m] and their unit `normals`.
    ///
    /// # Panics
    ///
    /// If `patches` are not those the planes were made from.
    pub fn update(
        &mut self,
        tolerance_m: f32,
        points: &[Vec3],
        normals: &[Vec3],
        patches: &Patches,
    ) -> Updated {
        assert_eq!(
            self.slots.len(),
            patches.order.len(),
            "the patches the planes were made from"
        );
        self.find_moved(tolerance_m, points, &patches.order);
        let moved = self.moved.iter().map(|bits| bits.count_ones()).sum();
        let mut refitted = 0;
        for slot in 0..self.slots.len() {
            let blocks = patches.lists.of(slot);
            let moved_members: u32 = blocks
                .iter()
                .map(|b| (b.members & self.moved[b.leaf as usize]).count_ones())
                .sum();
            if moved_members == 0 {
                continue;
            }
            let mut sums = self.patches[slot];
            let few = 2 * moved_members < patches.member_count(slot);
            if !(few && self.sum_moved(patches, &mut sums)) {
                self.sum_anew(slot, patches, &mut sums);
            }
            self.patches[slot] = sums;
            self.fit(slot, patches, normals);
            refitted += 1;
        }
        Updated { moved, refitted }
    }

    fn find_moved(&mut self, tolerance_m: f32, points: &[Vec3], order: &[u32]) {
        self.moved.fill(0);
        for (slot, places) in self.slots.iter_mut().enumerate() {
            let place = points[order[slot] as usize];
            let d = place - place_of(places.now);
            if d.dot(d) > tolerance_m * tolerance_m {
                self.moved[slot / LEAF_SLOTS] |= 1 << (slot % LEAF_SLOTS);
                places.before = places.now;
                places.now = place.extend(0.0).to_array();
            }
        }
    }

    /// Takes moved members out and puts them in where they are now. `false` if one is out of range,
    /// and the sums are then useless.
    fn sum_moved(&self, patches: &Patches, sums: &mut PatchSums) -> bool {
        let origin = Vec3::from(sums.origin);
        let mut in_range = true;
        for block in &patches.lists.blocks[sums.first_block as usize..sums.end_block as usize] {
            let mut moved = *block;
            moved.members &= self.moved[block.leaf as usize];
            for slot in moved.slots() {
                let before = (place_of(self.slots[slot].before) - origin) * sums.per_m;
                let now = (place_of(self.slots[slot].now) - origin) * sums.per_m;
                in_range &= now.abs().max_element() <= RANGE;
                add(sums, before, -self.quanta);
                add(sums, now, self.quanta);
            }
        }
        in_range
    }

    /// Sums all members about where the patch's point is now, in the smallest unit that will do.
    fn sum_anew(&self, slot: usize, patches: &Patches, sums: &mut PatchSums) {
        let origin = place_of(self.slots[slot].now);
        sums.origin = origin.to_array();
        sums.per_m = self.rest_per_m;
        for _ in 0..DOUBLINGS_MAX {
            (sums.sum, sums.squares, sums.products) = ([0; 3], [0; 3], [0; 3]);
            let mut in_range = true;
            for block in patches.lists.of(slot) {
                for member in block.slots() {
                    let d = (place_of(self.slots[member].now) - origin) * sums.per_m;
                    in_range &= d.abs().max_element() <= RANGE;
                    add(sums, d, self.quanta);
                }
            }
            if in_range {
                break;
            }
            sums.per_m *= 0.5;
        }
    }

    fn fit(&mut self, slot: usize, patches: &Patches, normals: &[Vec3]) {
        let sums = &self.patches[slot];
        let point = sums.point as usize;
        let count = patches.member_count(slot);
        if count < 3 {
            self.planes[point] = Plane::tangent(normals[point]);
            return;
        }
        let share = 1.0 / (count as f32 * self.quanta);
        let mean = IVec3::from(sums.sum).as_vec3() * share;
        let spread = Spread {
            squares: IVec3::from(sums.squares).as_vec3() * share - mean * mean,
            products: IVec3::from(sums.products).as_vec3() * share
                - Vec3::new(mean.x * mean.y, mean.x * mean.z, mean.y * mean.z),
        };
        let from_point = Vec3::from(sums.origin) - place_of(self.slots[slot].now);
        let mean_m = from_point + mean / sums.per_m;
        self.planes[point] = plane_of_moments(mean_m, spread, normals[point]);
    }
}

fn place_of(place: [f32; 4]) -> Vec3 {
    Vec3::new(place[0], place[1], place[2])
}

/// Adds the contribution of a member at `d`, in units, rounded to whole quanta; a negative number of
/// quanta takes it out.
fn add(sums: &mut PatchSums, d: Vec3, quanta: f32) {
    let round = |v: Vec3| (v * quanta).to_array().map(|x| x.round_ties_even() as i32);
    let products = Vec3::new(d.x * d.y, d.x * d.z, d.y * d.z);
    for (sum, part) in [
        (&mut sums.sum, round(d)),
        (&mut sums.squares, round(d * d)),
        (&mut sums.products, round(products)),
    ] {
        for axis in 0..3 {
            sum[axis] = sum[axis].wrapping_add(part[axis]);
        }
    }
}

/// The largest power of two with `members` contributions of up to `RANGE²` below 2³⁰ quanta.
fn quanta_for(members: u32) -> f32 {
    let bits = 30 - (RANGE * RANGE).log2() as i32 - members.next_power_of_two().ilog2() as i32;
    2.0_f32.powi(bits)
}

/// The largest distance of a member from its patch's point at rest [m]; 1 if there is none.
fn widest_m(points: &[Vec3], patches: &Patches) -> f32 {
    let widest = (0..points.len())
        .flat_map(|point| patches.members(point).map(move |m| (point, m)))
        .map(|(point, member)| points[point].distance_squared(points[member]))
        .fold(0.0, f32::max)
        .sqrt();
    if widest > 0.0 { widest } else { 1.0 }
}
