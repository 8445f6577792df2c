//! Parts of a body that threads can work on at the same time, each for long.
//!
//! Sweeping over a body colour by colour, all threads have to meet after each of some thirty
//! colours, and pass the particles round among their caches. Here the body is cut into slabs: what
//! lies inside one shares no particle with what lies inside another. What lies across the cuts is
//! left for a second round, where it is cut across another axis, and so on; after a few rounds
//! hardly anything is left. The cuts depend on the body alone, so the bits do not depend on the
//! number of threads.

use glam::Vec3;

/// Most parts a round.
pub const PARTS_MAX: usize = 16;
/// Constraints a part of the first round, at least: two slabs of fewer are mostly cut.
const FIRST_PART_MIN: usize = 3000;
/// A smaller body is one part.
pub const SHARED_TETS_MIN: usize = 2 * FIRST_PART_MIN;
/// Constraints a part of later rounds, at least: some microseconds, against the one of a meeting.
const PART_MIN: usize = 48;
/// After so many rounds one thread does the rest.
const ROUNDS_MAX: usize = 4;

/// Divides constraints between `particles` [m] into rounds of parts: numbers of constraints, in
/// ascending order. Parts of one round share no particle.
///
/// # Panics
///
/// If a constraint names a particle beyond the last.
pub fn rounds<const N: usize>(constraints: &[[u32; N]], particles: &[Vec3]) -> Vec<Vec<Vec<u32>>> {
    let ranks = [0, 1, 2].map(|axis| places_in(&order_along(particles, axis)));
    let mut rounds = Vec::new();
    let mut left: Vec<u32> = (0..constraints.len() as u32).collect();
    let mut parts = power_of_two(left.len() / FIRST_PART_MIN);
    while parts > 1 && rounds.len() < ROUNDS_MAX {
        let cuts = ranks
            .each_ref()
            .map(|rank| cut(constraints, rank, &left, parts));
        let cut = cuts.into_iter().min_by_key(Cut::length);
        let cut = cut.expect("there are three axes");
        rounds.push(cut.parts);
        left = cut.across;
        parts = power_of_two(left.len() / PART_MIN).min(parts);
    }
    if !left.is_empty() {
        rounds.push(vec![left]);
    }
    rounds
}

/// Constraints inside the slabs between some cuts, and those across the cuts.
struct Cut {
    parts: Vec<Vec<u32>>,
    across: Vec<u32>,
}

impl Cut {
    /// How long the threads are at it, counted in constraints, if what is across is left to one.
    fn length(&self) -> usize {
        self.parts.iter().map(Vec::len).max().unwrap_or(0) + self.across.len()
    }
}

/// The particles in their order along an axis; those in one plane follow each other along the other
/// two axes, so that a cut may turn a corner in a plane.
pub fn order_along(particles: &[Vec3], axis: usize) -> Vec<u32> {
    let key = |&i: &u32| {
        let x = particles[i as usize];
        [0, 1, 2].map(|k| x[(axis + k) % 3])
    };
    let mut order: Vec<u32> = (0..particles.len() as u32).collect();
    order.sort_by(|a, b| {
        let ([a, b, c], [d, e, f]) = (key(a), key(b));
        a.total_cmp(&d).then(b.total_cmp(&e)).then(c.total_cmp(&f))
    });
    order
}

/// The place of each particle in an order.
pub fn places_in(order: &[u32]) -> Vec<u32> {
    let mut places = vec![0; order.len()];
    for (place, &particle) in order.iter().enumerate() {
        places[particle as usize] = place as u32;
    }
    places
}

/// Cuts the constraints `members` into `count` slabs of about as many each, by the ranks of their
/// particles.
fn cut<const N: usize>(
    constraints: &[[u32; N]],
    rank: &[u32],
    members: &[u32],
    count: usize,
) -> Cut {
    let ranks_of = |member: u32| constraints[member as usize].map(|i| rank[i as usize]);
    let mut middles: Vec<u32> = (members.iter())
        .map(|&member| ranks_of(member).iter().sum::<u32>() / N as u32)
        .collect();
    middles.sort_unstable();
    let cuts: Vec<u32> = (1..count)
        .map(|slab| middles[slab * middles.len() / count])
        .collect();
    let slab_of = |rank| cuts.partition_point(|&cut| cut <= rank);
    let mut parts = vec![Vec::new(); count];
    let mut across = Vec::new();
    for &member in members {
        let slabs = ranks_of(member).map(slab_of);
        if slabs.iter().all(|&slab| slab == slabs[0]) {
            parts[slabs[0]].push(member);
        } else {
            across.push(member);
        }
    }
    Cut { parts, across }
}

/// The largest power of two up to `count` and [`PARTS_MAX`]; 1 at least.
fn power_of_two(count: usize) -> usize {
    1 << count.clamp(1, PARTS_MAX).ilog2()
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::HashMap;

    /// Whether every constraint is in one part, and no two parts of a round share a particle.
    fn is_sound(rounds: &[Vec<Vec<u32>>], constraints: &[[u32; 4]]) -> bool {
        let mut seen: Vec<u32> = rounds.concat().concat();
        seen.sort_unstable();
        seen == (0..constraints.len() as u32).collect::<Vec<_>>()
            && rounds.iter().all(|parts| {
                let mut owner = HashMap::new();
                parts.iter().enumerate().all(|(part, members)| {
                    (members.iter().flat_map(|&m| constraints[m as usize]))
                        .all(|particle| *owner.entry(particle).or_insert(part) == part)
                })
            })
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(32))]
        #[test]
        fn parts_of_a_round_share_no_particle(
            places in prop::collection::vec(prop::array::uniform3(-1.0_f32..1.0), 60),
            near in prop::collection::vec((0_u32..56, prop::array::uniform4(0_u32..4)), 3000..7000),
        ) {
            let particles: Vec<Vec3> = places.into_iter().map(Vec3::from).collect();
            let constraints: Vec<[u32; 4]> =
                near.iter().map(|(first, offsets)| offsets.map(|k| first + k)).collect();
            prop_assert!(is_sound(&rounds(&constraints, &particles), &constraints));
        }
    }

    #[test]
    fn soundness_check_rejects_neighbours_in_two_parts() {
        assert!(!is_sound(
            &[vec![vec![0], vec![1]]],
            &[[0, 1, 2, 3], [3, 4, 5, 6]]
        ));
    }

    /// Constraints of four neighbours in a row, along a grid of particles.
    fn grid(size: [u32; 3]) -> (Vec<[u32; 4]>, Vec<Vec3>) {
        let [nx, ny, nz] = size;
        let number = |x, y, z| x + nx * (y + ny * z);
        let (mut constraints, mut particles) = (Vec::new(), Vec::new());
        for (z, y, x) in
            (0..nz).flat_map(|z| (0..ny).flat_map(move |y| (0..nx).map(move |x| (z, y, x))))
        {
            particles.push(Vec3::new(x as f32, y as f32, z as f32));
            if x + 1 < nx && y + 1 < ny && z + 1 < nz {
                let corner = number(x, y, z);
                let others = [
                    number(x + 1, y, z),
                    number(x, y + 1, z),
                    number(x, y, z + 1),
                ];
                constraints.push([corner, others[0], others[1], others[2]]);
            }
        }
        (constraints, particles)
    }

    #[test]
    fn two_threads_have_nearly_the_same_to_do_and_little_is_left_for_one() {
        let (constraints, particles) = grid([41, 21, 21]);
        let rounds = rounds(&constraints, &particles);
        let alone: usize = (rounds.iter().filter(|parts| parts.len() == 1))
            .map(|parts| parts[0].len())
            .sum();
        // A cut is one cell of forty; the cut of the cut is one of twenty of that.
        assert!(
            alone * 100 < constraints.len(),
            "{alone} of {}",
            constraints.len()
        );
        for parts in rounds.iter().filter(|parts| parts.len() > 1) {
            let lengths: Vec<usize> = parts.iter().map(Vec::len).collect();
            let (least, most) = (lengths.iter().min(), lengths.iter().max());
            // Slabs are whole layers of cells, of which a part has ten or so.
            assert!(
                10 * least.unwrap_or(&0) >= 7 * most.unwrap_or(&0),
                "{lengths:?}"
            );
        }
    }

    #[test]
    fn a_small_body_is_one_part() {
        let (constraints, particles) = grid([9, 9, 9]);
        let rounds = rounds(&constraints, &particles);
        assert_eq!(rounds.len(), 1);
        assert_eq!(rounds[0][0].len(), constraints.len());
    }
}
