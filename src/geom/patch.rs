//! Patches: the points near each point at rest, as lists of bit masks.
//!
//! Points are sorted into *slots* so that 32 neighbouring ones share a *leaf*, and a patch says
//! which slots of which leaves belong to it. A patch of 200 points meets about 20 leaves: 160 bytes
//! in place of 800, and "which of them have moved" is 20 and-operations in place of 200 look-ups.

use glam::Vec3;
use rayon::prelude::*;
use rstar::RTree;
use rstar::primitives::GeomWithData;

/// Slots of a leaf: the bits of a mask.
pub const LEAF_SLOTS: usize = 32;
/// Slots that share one list of [`Patches::patches_of_runs`]; the same in `plane_moved.wgsl`.
pub const RUN_SLOTS: usize = 8;
/// Runs of a leaf.
const RUNS_PER_LEAF: usize = LEAF_SLOTS / RUN_SLOTS;
/// Points every patch has, if the surface has them: below about 7 a plane follows single points.
pub const MEMBERS_MIN: usize = 16;

/// The members of a patch in one leaf: bit i stands for slot `32 leaf + i`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Eq, bytemuck::Pod, bytemuck::Zeroable)]
pub struct Block {
    /// Which 32 slots.
    pub leaf: u32,
    /// Which of them.
    pub members: u32,
}

impl Block {
    /// Slots of this block, in order.
    pub fn slots(self) -> impl Iterator<Item = usize> {
        let first = self.leaf as usize * LEAF_SLOTS;
        (0..LEAF_SLOTS)
            .filter(move |bit| self.members >> bit & 1 == 1)
            .map(move |bit| first + bit)
    }
}

/// Block lists, one after another (CSR): those of `i` stand at `start[i]..start[i + 1]`.
#[derive(Clone, Debug, PartialEq, Eq)]
pub struct BlockLists {
    /// Where each list starts, and the end.
    pub start: Vec<u32>,
    /// The lists, each sorted by leaf.
    pub blocks: Vec<Block>,
}

impl BlockLists {
    fn join(lists: &[Vec<Block>]) -> Self {
        let mut start = Vec::with_capacity(lists.len() + 1);
        start.push(0);
        for list in lists {
            start.push(start[start.len() - 1] + list.len() as u32);
        }
        Self {
            start,
            blocks: lists.concat(),
        }
    }

    /// The blocks of list `index`.
    pub fn of(&self, index: usize) -> &[Block] {
        &self.blocks[self.start[index] as usize..self.start[index + 1] as usize]
    }
}

/// The patch of every point. Membership is symmetric, and every point is in its own patch.
#[derive(Clone, Debug)]
pub struct Patches {
    /// The point in each slot.
    pub order: Vec<u32>,
    /// The slot of each point.
    pub slot_of: Vec<u32>,
    /// The patch of the point in each slot.
    pub lists: BlockLists,
}

impl Patches {
    /// Points within `radius_m` whose normals are not opposed (`n_i · n_j > 0`), and at least the
    /// 16 nearest such points where the radius holds fewer.
    ///
    /// The list is made for the surface at rest and kept while it deforms. Without the look at the
    /// normals a thin lobe would be fitted through both its sides.
    ///
    /// # Panics
    ///
    /// If `points` and `normals` differ in length.
    pub fn new(points: &[Vec3], normals: &[Vec3], radius_m: f32) -> Self {
        assert_eq!(points.len(), normals.len(), "one normal a point");
        let order = spatial_order(points);
        let mut slot_of = vec![0; points.len()];
        for (slot, &point) in order.iter().enumerate() {
            slot_of[point as usize] = slot as u32;
        }
        let sorted: Vec<Site> = order
            .iter()
            .map(|&point| Site {
                position: points[point as usize],
                normal: normals[point as usize],
            })
            .collect();
        let mut lists = within_radius(&sorted, radius_m.max(0.0));
        fill_small_patches(&sorted, &mut lists);
        Self {
            order,
            slot_of,
            lists: BlockLists::join(&lists),
        }
    }

    /// Points of the patch of `point`, itself included.
    pub fn members(&self, point: usize) -> impl Iterator<Item = usize> + '_ {
        self.lists
            .of(self.slot_of[point] as usize)
            .iter()
            .flat_map(|block| block.slots())
            .map(|slot| self.order[slot] as usize)
    }

    /// Points in the patch of `slot`.
    pub fn member_count(&self, slot: usize) -> u32 {
        let blocks = self.lists.of(slot).iter();
        blocks.map(|block| block.members.count_ones()).sum()
    }

    /// Leaves, the last of which may be partly filled.
    pub fn leaf_count(&self) -> usize {
        self.order.len().div_ceil(LEAF_SLOTS)
    }

    /// The patches that any point of a run of 8 slots is in, run by run: four to a leaf.
    pub fn patches_of_runs(&self) -> BlockLists {
        let runs: Vec<Vec<Block>> = (0..RUNS_PER_LEAF * self.leaf_count())
            .into_par_iter()
            .map(|run| {
                let first = run * RUN_SLOTS;
                let end = (first + RUN_SLOTS).min(self.order.len());
                let mut union: Vec<Block> = Vec::new();
                for block in (first..end).flat_map(|slot| self.lists.of(slot)) {
                    add_members(&mut union, *block);
                }
                union
            })
            .collect();
        BlockLists::join(&runs)
    }
}

/// The distance beyond which light of extinction `extinction_per_m` has lost all but `epsilon` of
/// itself: `r = -ln ε / σ_t` [m]. Source: François 2006, section 4.
pub fn radius_from_extinction_m(extinction_per_m: f32, epsilon: f32) -> f32 {
    -epsilon.ln() / extinction_per_m
}

#[derive(Clone, Copy)]
struct Site {
    position: Vec3,
    normal: Vec3,
}

impl Site {
    fn faces(&self, other: &Self) -> bool {
        self.normal.dot(other.normal) > 0.0
    }
}

/// Points sorted so that each run of 32, and within it of 16, 8 and 4, is compact: halved along the
/// longest side of their box until 4 are left.
fn spatial_order(points: &[Vec3]) -> Vec<u32> {
    fn halve(points: &[Vec3], order: &mut [u32]) {
        if order.len() <= 4 {
            order.sort_unstable();
            return;
        }
        let places = || order.iter().map(|&point| points[point as usize]);
        let low = places().fold(Vec3::INFINITY, Vec3::min);
        let high = places().fold(Vec3::NEG_INFINITY, Vec3::max);
        let axis = (high - low).max_position();
        let half = if order.len() > LEAF_SLOTS {
            (order.len() / 2).next_multiple_of(LEAF_SLOTS)
        } else {
            (order.len() / 2).next_power_of_two()
        };
        order.select_nth_unstable_by(half, |&a, &b| {
            points[a as usize][axis]
                .total_cmp(&points[b as usize][axis])
                .then(a.cmp(&b))
        });
        let (left, right) = order.split_at_mut(half);
        halve(points, left);
        halve(points, right);
    }
    let mut order: Vec<u32> = (0..points.len() as u32).collect();
    halve(points, &mut order);
    order
}

fn within_radius(sorted: &[Site], radius_m: f32) -> Vec<Vec<Block>> {
    let radius_squared = radius_m * radius_m;
    let boxes: Vec<(Vec3, Vec3)> = sorted
        .chunks(LEAF_SLOTS)
        .map(|leaf| {
            let places = || leaf.iter().map(|site| site.position);
            (
                places().fold(Vec3::INFINITY, Vec3::min),
                places().fold(Vec3::NEG_INFINITY, Vec3::max),
            )
        })
        .collect();
    // A hair more than the radius, so that rounding in the box test loses no member.
    let reach_squared = radius_squared * 1.0001;
    let near = |a: &(Vec3, Vec3), b: &(Vec3, Vec3)| {
        let gap = (b.0 - a.1).max(a.0 - b.1).max(Vec3::ZERO);
        gap.length_squared() <= reach_squared
    };
    sorted
        .par_chunks(LEAF_SLOTS)
        .zip(&boxes)
        .flat_map_iter(|(leaf, leaf_box)| {
            let others: Vec<usize> = (0..boxes.len())
                .filter(|&other| near(leaf_box, &boxes[other]))
                .collect();
            let radius_test = move |site: &Site, other: &Site| {
                site.position.distance_squared(other.position) <= radius_squared
                    && site.faces(other)
            };
            leaf.iter().map(move |site| {
                others
                    .iter()
                    .map(|&other| {
                        let first = other * LEAF_SLOTS;
                        let slots = &sorted[first..(first + LEAF_SLOTS).min(sorted.len())];
                        let members = slots
                            .iter()
                            .enumerate()
                            .filter(|(_, s)| std::ptr::eq(*s, site) || radius_test(site, s))
                            .fold(0, |mask, (bit, _)| mask | 1 << bit);
                        Block {
                            leaf: other as u32,
                            members,
                        }
                    })
                    .filter(|block| block.members != 0)
                    .collect::<Vec<_>>()
            })
        })
        .collect()
}

/// Gives every patch of fewer than 16 points its nearest, and them it.
fn fill_small_patches(sorted: &[Site], lists: &mut [Vec<Block>]) {
    let small: Vec<usize> = (0..lists.len())
        .filter(|&slot| {
            let members: u32 = lists[slot].iter().map(|b| b.members.count_ones()).sum();
            (members as usize) < MEMBERS_MIN
        })
        .collect();
    if small.is_empty() {
        return;
    }
    let tree = RTree::bulk_load(
        sorted
            .iter()
            .enumerate()
            .map(|(slot, site)| GeomWithData::new(site.position.to_array(), slot))
            .collect(),
    );
    let pairs: Vec<(usize, usize)> = small
        .into_par_iter()
        .flat_map_iter(|slot| {
            tree.nearest_neighbor_iter(sorted[slot].position.to_array())
                .map(|found| found.data)
                .filter(move |&other| sorted[slot].faces(&sorted[other]))
                .take(MEMBERS_MIN)
                .map(move |other| (slot, other))
        })
        .collect();
    for (slot, other) in pairs {
        add_member(&mut lists[slot], other);
        add_member(&mut lists[other], slot);
    }
}

fn add_member(list: &mut Vec<Block>, slot: usize) {
    let block = Block {
        leaf: (slot / LEAF_SLOTS) as u32,
        members: 1 << (slot % LEAF_SLOTS),
    };
    add_members(list, block);
}

fn add_members(list: &mut Vec<Block>, block: Block) {
    match list.binary_search_by_key(&block.leaf, |known| known.leaf) {
        Ok(at) => list[at].members |= block.members,
        Err(at) => list.insert(at, block),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::surfaces::wavy;
    use crate::geom::tangent::{Fans, rest_normals};
    use proptest::prelude::*;

    fn wavy_patches(side: usize, radius_m: f32) -> (Vec<Vec3>, Patches) {
        let mesh = wavy(side);
        let normals = rest_normals(&mesh, &Fans::new(&mesh));
        let patches = Patches::new(&mesh.points, &normals, radius_m);
        (mesh.points, patches)
    }

    fn are_symmetric(lists: &[Vec<usize>]) -> bool {
        lists.iter().enumerate().all(|(point, members)| {
            members.contains(&point) && members.iter().all(|&m| lists[m].contains(&point))
        })
    }

    #[test]
    fn symmetry_check_rejects_a_patch_that_lost_a_member() {
        let (points, patches) = wavy_patches(9, 0.03);
        let mut lists: Vec<Vec<usize>> = (0..points.len())
            .map(|point| patches.members(point).collect())
            .collect();
        assert!(are_symmetric(&lists));
        lists[40].pop();
        assert!(!are_symmetric(&lists));
    }

    #[test]
    fn patch_of_200_points_meets_few_leaves() {
        let (points, patches) = wavy_patches(100, 0.0083);
        let members: u32 = (0..points.len())
            .map(|slot| patches.member_count(slot))
            .sum();
        let per_patch = patches.lists.blocks.len() as f32 / points.len() as f32;
        assert!(members as usize / points.len() > 180);
        // 11.2 measured; a list of indices would be as long as 100 blocks.
        assert!(per_patch < 15.0, "{per_patch} blocks");
    }

    #[test]
    fn points_of_the_other_side_of_a_thin_lobe_are_left_out() {
        let mesh = wavy(12);
        let mut points = mesh.points.clone();
        points.extend(mesh.points.iter().map(|&p| p - 0.001 * Vec3::Y));
        let mut normals = vec![Vec3::Y; 144];
        normals.extend(vec![Vec3::NEG_Y; 144]);
        let patches = Patches::new(&points, &normals, 0.03);
        assert!((0..144).all(|point| patches.members(point).all(|member| member < 144)));
    }

    #[test]
    fn small_radius_still_gives_the_sixteen_nearest() {
        for radius_m in [0.0, 1e-6, f32::NAN] {
            let (points, patches) = wavy_patches(12, radius_m);
            assert!((0..points.len()).all(|slot| patches.member_count(slot) >= 16));
        }
    }

    #[test]
    fn runs_list_the_patches_of_their_points_and_no_others() {
        let (_, patches) = wavy_patches(13, 0.02);
        let runs = patches.patches_of_runs();
        assert_eq!(runs.start.len(), 4 * patches.leaf_count() + 1);
        for run in 0..4 * patches.leaf_count() {
            let first = run * RUN_SLOTS;
            let mut expected: Vec<usize> = (first..(first + RUN_SLOTS).min(169))
                .flat_map(|slot| patches.lists.of(slot))
                .flat_map(|block| block.slots())
                .collect();
            expected.sort_unstable();
            expected.dedup();
            let listed = runs.of(run).iter().flat_map(|block| block.slots());
            assert_eq!(listed.collect::<Vec<_>>(), expected);
        }
    }

    #[test]
    fn radius_of_published_coefficients_is_the_published_depth() {
        // Extinction 1.6/mm leaves one hundredth after 2.9 mm.
        let radius_m = radius_from_extinction_m(1600.0, 0.01);
        assert!((radius_m - 2.878e-3).abs() < 1e-6, "{radius_m} m");
    }

    proptest! {
        #[test]
        fn patches_are_symmetric_and_hold_all_within_the_radius(
            coordinates in prop::collection::vec(prop::array::uniform3(-0.05_f32..0.05), 1..150),
            radius_m in 0.005_f32..0.06,
        ) {
            let points: Vec<Vec3> = coordinates.into_iter().map(Vec3::from).collect();
            let normals: Vec<Vec3> = points.iter().map(|p| p.normalize_or(Vec3::Y)).collect();
            let patches = Patches::new(&points, &normals, radius_m);
            let lists: Vec<Vec<usize>> = (0..points.len())
                .map(|point| patches.members(point).collect())
                .collect();
            prop_assert!(are_symmetric(&lists));
            for (i, list) in lists.iter().enumerate() {
                let belongs = |&j: &usize| {
                    points[i].distance_squared(points[j]) <= radius_m * radius_m
                        && normals[i].dot(normals[j]) > 0.0
                };
                let near: Vec<usize> = (0..points.len()).filter(belongs).collect();
                prop_assert!(near.iter().all(|j| list.contains(j)));
                let facing = |&j: &usize| normals[i].dot(normals[j]) > 0.0;
                let facing = (0..points.len()).filter(facing).count();
                prop_assert!(list.len() >= facing.min(MEMBERS_MIN));
            }
        }
    }
}
