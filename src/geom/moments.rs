//! Running moments of patches: only what moved is taken out and put in again.
//!
//! Sums are kept in whole numbers. Taking a contribution out then cancels exactly what putting it in
//! added, so there is no drift however many frames pass, and no order of summation to care for. Each
//! patch measures from an origin near it, in a unit of about its own size, so the sums resolve it
//! wherever the body lies.

use super::patch::{LEAF_SLOTS, Patches};
use super::plane::{Plane, Spread, plane_of_moments};
use bytemuck::Zeroable;
use glam::{IVec3, Vec3};

/// Distance from the origin, in units, up to which a member may be counted; the same in
/// `plane_incremental.wgsl`. A patch stretched further is measured in a larger unit.
const RANGE: f32 = 4.0;
/// Times the unit may be doubled until all members are in range; the same in
/// `plane_incremental.wgsl`.
const DOUBLINGS_MAX: u32 = 32;
/// A patch of which one in so many members moved is summed anew, which reads each member once where
/// moving it reads it twice; the same in `plane_incremental.wgsl`.
const SUM_ANEW_SHARE: u32 = 6;

/// Sums over one patch. Mirror of `Sums` in `shaders/plane_incremental.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct PatchSums {
    /// Where distances are measured from [m].
    pub origin: [f32; 3],
    /// Units a metre.
    pub per_m: f32,
    /// Σ d, in quanta.
    pub sum: [i32; 3],
    pub pad0: u32,
    /// Σ of xx, yy, zz, in quanta.
    pub squares: [i32; 3],
    pub pad1: u32,
    /// Σ of xy, xz, yz, in quanta.
    pub products: [i32; 3],
    pub pad2: u32,
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
    /// Where the sums have each slot [m].
    pub now: Vec<Vec3>,
    /// Where they had it before it last moved [m].
    pub before: Vec<Vec3>,
    /// Which slots of each leaf moved in the last update.
    pub moved: Vec<u32>,
    /// Sums, by slot.
    pub sums: Vec<PatchSums>,
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
        let slots = patches.order.iter();
        let places: Vec<Vec3> = slots.map(|&point| points[point as usize]).collect();
        let mut running = Self {
            quanta: quanta_for(largest),
            rest_per_m: 1.0 / widest_m(points, patches),
            now: places.clone(),
            before: places,
            moved: vec![0; patches.leaf_count()],
            sums: Vec::new(),
            planes: normals.iter().map(|&n| Plane::tangent(n)).collect(),
        };
        running.sums = (0..patches.order.len())
            .map(|slot| running.sum_anew(slot, patches))
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
            self.now.len(),
            patches.order.len(),
            "the patches the planes were made from"
        );
        self.find_moved(tolerance_m, points, &patches.order);
        let moved = self.moved.iter().map(|bits| bits.count_ones()).sum();
        let mut refitted = 0;
        for slot in 0..self.now.len() {
            let blocks = patches.lists.of(slot);
            let moved_members: u32 = blocks
                .iter()
                .map(|b| (b.members & self.moved[b.leaf as usize]).count_ones())
                .sum();
            if moved_members == 0 {
                continue;
            }
            let few = SUM_ANEW_SHARE * moved_members < patches.member_count(slot);
            let moved_sums = few.then(|| self.sum_moved(slot, patches)).flatten();
            self.sums[slot] = moved_sums.unwrap_or_else(|| self.sum_anew(slot, patches));
            self.fit(slot, patches, normals);
            refitted += 1;
        }
        Updated { moved, refitted }
    }

    fn find_moved(&mut self, tolerance_m: f32, points: &[Vec3], order: &[u32]) {
        self.moved.fill(0);
        for (slot, &point) in order.iter().enumerate() {
            let place = points[point as usize];
            let d = place - self.now[slot];
            if d.dot(d) > tolerance_m * tolerance_m {
                self.moved[slot / LEAF_SLOTS] |= 1 << (slot % LEAF_SLOTS);
                self.before[slot] = self.now[slot];
                self.now[slot] = place;
            }
        }
    }

    /// Takes moved members out and puts them in where they are now. `None` if one is out of range.
    fn sum_moved(&self, slot: usize, patches: &Patches) -> Option<PatchSums> {
        let mut sums = self.sums[slot];
        let origin = Vec3::from(sums.origin);
        for block in patches.lists.of(slot) {
            let mut moved = *block;
            moved.members &= self.moved[block.leaf as usize];
            for member in moved.slots() {
                let old_d = (self.before[member] - origin) * sums.per_m;
                let new_d = (self.now[member] - origin) * sums.per_m;
                if new_d.abs().max_element() > RANGE {
                    return None;
                }
                sums.add(Moments::of(old_d), -self.quanta);
                sums.add(Moments::of(new_d), self.quanta);
            }
        }
        Some(sums)
    }

    /// Sums all members about where the patch's point is now, in the smallest unit that will do.
    fn sum_anew(&self, slot: usize, patches: &Patches) -> PatchSums {
        let origin = self.now[slot];
        let mut total = Moments::of(Vec3::ZERO);
        for member in patches
            .lists
            .of(slot)
            .iter()
            .flat_map(|block| block.slots())
        {
            let d = self.now[member] - origin;
            let moments = Moments::of(d);
            total.sum += moments.sum;
            total.squares += moments.squares;
            total.products += moments.products;
        }
        // No member is farther than the root of the sum of squares.
        let reach = total.squares.max_element().sqrt();
        let mut per_m = self.rest_per_m;
        for _ in 0..DOUBLINGS_MAX {
            if reach * per_m > RANGE {
                per_m *= 0.5;
            }
        }
        let mut sums = PatchSums {
            origin: origin.to_array(),
            per_m,
            ..PatchSums::zeroed()
        };
        let scaled = Moments {
            sum: total.sum * per_m,
            squares: total.squares * per_m * per_m,
            products: total.products * per_m * per_m,
        };
        sums.add(scaled, self.quanta);
        sums
    }

    fn fit(&mut self, slot: usize, patches: &Patches, normals: &[Vec3]) {
        let sums = &self.sums[slot];
        let point = patches.order[slot] as usize;
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
        let from_point = Vec3::from(sums.origin) - self.now[slot];
        let mean_m = from_point + mean / sums.per_m;
        self.planes[point] = plane_of_moments(mean_m, spread, normals[point]);
    }
}

/// What one member adds to the sums of its patch.
struct Moments {
    sum: Vec3,
    squares: Vec3,
    products: Vec3,
}

impl Moments {
    fn of(d: Vec3) -> Self {
        Self {
            sum: d,
            squares: d * d,
            products: Vec3::new(d.x * d.y, d.x * d.z, d.y * d.z),
        }
    }
}

impl PatchSums {
    /// Adds `moments`, rounded to whole quanta; a negative number of quanta takes them out.
    fn add(&mut self, moments: Moments, quanta: f32) {
        for (sum, part) in [
            (&mut self.sum, moments.sum),
            (&mut self.squares, moments.squares),
            (&mut self.products, moments.products),
        ] {
            let rounded = (part * quanta)
                .to_array()
                .map(|x| x.round_ties_even() as i32);
            for axis in 0..3 {
                sum[axis] = sum[axis].wrapping_add(rounded[axis]);
            }
        }
    }
}

/// The largest power of two with `members` contributions of up to `RANGE²` below 2³⁰ quanta, and a
/// single one up to 2²², so that a kernel can round it by an addition.
fn quanta_for(members: u32) -> f32 {
    let range_bits = (RANGE * RANGE).log2() as i32;
    let member_bits = members.next_power_of_two().ilog2() as i32;
    2.0_f32.powi((30 - range_bits - member_bits).min(22 - range_bits))
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

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::plane::fit_planes;
    use crate::geom::surfaces::{deformed, wavy};
    use crate::geom::tangent::{Fans, point_normals, rest_normals};

    struct Body {
        points: Vec<Vec3>,
        fans: Fans,
        normals: Vec<Vec3>,
        patches: Patches,
        running: RunningPlanes,
    }

    fn body() -> Body {
        let mesh = wavy(24);
        let fans = Fans::new(&mesh);
        let normals = rest_normals(&mesh, &fans);
        let patches = Patches::new(&mesh.points, &normals, 0.02);
        Body {
            running: RunningPlanes::new(&mesh.points, &normals, &patches),
            points: mesh.points,
            fans,
            normals,
            patches,
        }
    }

    impl Body {
        fn update(&mut self, tolerance_m: f32, points: &[Vec3]) -> Updated {
            let normals = point_normals(&self.fans, points, &self.normals);
            self.running
                .update(tolerance_m, points, &normals, &self.patches)
        }

        /// Largest angle [degrees] to the planes fitted from all members.
        fn worst_degrees(&self, points: &[Vec3]) -> f32 {
            let normals = point_normals(&self.fans, points, &self.normals);
            let fitted = fit_planes(points, &normals, &self.patches);
            self.running
                .planes
                .iter()
                .zip(fitted)
                .map(|(running, full)| running.normal.cross(full.normal).length())
                .fold(0.0, f32::max)
                .asin()
                .to_degrees()
        }
    }

    /// Every fortieth point shaken, each by its own rhythm: no patch has a sixth of its members moved.
    fn shaken(rest: &[Vec3], frame: usize) -> Vec<Vec3> {
        let mut points = rest.to_vec();
        for (i, point) in points.iter_mut().enumerate().step_by(40) {
            point.y += 0.002 * ((i * 7 + frame * (i % 5 + 1)) as f32).sin();
        }
        points
    }

    #[test]
    fn sums_return_to_the_same_bits_when_the_points_return() {
        let mut body = body();
        let rest = body.points.clone();
        let at_rest = body.running.sums.clone();
        for frame in 0..500 {
            assert!(body.update(0.0, &shaken(&rest, frame)).moved > 0);
        }
        assert_ne!(body.running.sums, at_rest);
        body.update(0.0, &rest);
        assert_eq!(body.running.sums, at_rest);
    }

    #[test]
    fn planes_are_those_of_a_full_fit_wherever_the_body_goes() {
        let mut body = body();
        let rest = body.points.clone();
        for frame in 0..40 {
            let drift = Vec3::new(0.3, -0.1, 0.2) * frame as f32;
            let points: Vec<Vec3> = shaken(&rest, frame).iter().map(|&p| p + drift).collect();
            body.update(0.0, &points);
            let worst = body.worst_degrees(&points);
            // Both are f32; 0.003 degrees was seen 10 m away.
            assert!(worst < 0.02, "{worst} degrees in frame {frame}");
        }
    }

    #[test]
    fn motion_within_the_tolerance_is_not_counted_until_it_adds_up() {
        let mut body = body();
        let rest = body.points.clone();
        let risen = |by_m: f32| -> Vec<Vec3> { rest.iter().map(|&p| p + by_m * Vec3::X).collect() };
        assert_eq!(body.update(1e-4, &risen(0.6e-4)), Updated::default());
        assert_eq!(body.update(1e-4, &risen(0.9e-4)), Updated::default());
        assert_eq!(body.update(1e-4, &risen(1.2e-4)).moved, 576);
    }

    #[test]
    fn stretch_beyond_the_range_takes_a_larger_unit_and_returns() {
        let mut body = body();
        let rest = body.points.clone();
        let units =
            |body: &Body| -> Vec<f32> { body.running.sums.iter().map(|sums| sums.per_m).collect() };
        let at_rest = units(&body);
        let stretched: Vec<Vec3> = deformed(&rest).iter().map(|&p| 100.0 * p).collect();
        body.update(0.0, &stretched);
        assert!(
            units(&body)
                .iter()
                .zip(&at_rest)
                .all(|(now, rest)| now < rest)
        );
        let worst = body.worst_degrees(&stretched);
        assert!(worst < 0.05, "{worst} degrees stretched");
        body.update(0.0, &rest);
        assert_eq!(units(&body), at_rest);
        let worst = body.worst_degrees(&rest);
        assert!(worst < 0.02, "{worst} degrees after return");
    }

    #[test]
    fn no_patch_can_overflow_its_sums() {
        for members in [1, 3, 16, 200, 1000, 1024, 1025, 40_000] {
            let largest = f64::from(RANGE * RANGE * quanta_for(members));
            assert!(largest <= f64::from(1 << 22), "{members} members");
            assert!(
                largest * f64::from(members) <= f64::from(1 << 30),
                "{members} members"
            );
        }
    }
}
