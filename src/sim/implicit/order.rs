//! Numbers for particles and tetrahedra that keep neighbours close in memory.

use glam::DVec3;
use std::ops::Range;

/// Nodes a domain, at least.
const DOMAIN_NODES: usize = 1000;
/// Domains at most; more would weaken the sweeps.
const DOMAINS_MAX: usize = 8;
/// Places a sweep is at in turn.
const STREAMS: usize = 4;

/// The particles, free ones first, neighbours near each other.
#[derive(Clone, Debug)]
pub struct Order {
    /// Particle of each node.
    pub particle: Vec<u32>,
    /// Node of each particle.
    pub node: Vec<u32>,
    /// Nodes from here on are held.
    pub free: usize,
    /// Where each node comes on a path that visits neighbours together.
    pub rank: Vec<u32>,
}

impl Order {
    /// Numbers particles at rest at `rest`: halves them by the plane across their longest extent,
    /// and each half again, so that near numbers are near places.
    pub fn new(rest: &[DVec3], is_free: impl Fn(usize) -> bool) -> Self {
        let (mut particle, held): (Vec<u32>, Vec<u32>) =
            (0..rest.len() as u32).partition(|&i| is_free(i as usize));
        let free = particle.len();
        halve(rest, &mut particle);
        let path = particle.clone();
        for domain in domains(free) {
            interleave(&mut particle[domain]);
        }
        particle.extend(held);
        let mut node = vec![0; rest.len()];
        for (number, &i) in particle.iter().enumerate() {
            node[i as usize] = number as u32;
        }
        let mut rank: Vec<u32> = (0..rest.len() as u32).collect();
        for (place, &i) in path.iter().enumerate() {
            rank[node[i as usize] as usize] = place as u32;
        }
        Self {
            particle,
            node,
            free,
            rank,
        }
    }
}

/// Rows of a matrix that are swept one after the other; as many domains for any machine.
pub fn domains(count: usize) -> Vec<Range<usize>> {
    let domains = (count / DOMAIN_NODES).clamp(1, DOMAINS_MAX);
    (0..domains)
        .map(|domain| domain * count / domains..(domain + 1) * count / domains)
        .collect()
}

/// Takes particles from several places in turn, so that a sweep does not wait for its last result.
fn interleave(particles: &mut [u32]) {
    let length = particles.len().div_ceil(STREAMS);
    let sorted = particles.to_vec();
    let turns = (0..length).flat_map(|i| (0..STREAMS).map(move |stream| stream * length + i));
    for (particle, from) in particles
        .iter_mut()
        .zip(turns.filter(|&i| i < sorted.len()))
    {
        *particle = sorted[from];
    }
}

fn halve(rest: &[DVec3], particles: &mut [u32]) {
    if particles.len() < 2 {
        return;
    }
    let places = || particles.iter().map(|&i| rest[i as usize]);
    let low = places().fold(DVec3::INFINITY, DVec3::min);
    let high = places().fold(DVec3::NEG_INFINITY, DVec3::max);
    let axis = (high - low).max_position();
    let middle = particles.len() / 2;
    particles.select_nth_unstable_by(middle, |&a, &b| {
        let along = |i: u32| rest[i as usize][axis];
        along(a).total_cmp(&along(b)).then(a.cmp(&b))
    });
    let (lower, upper) = particles.split_at_mut(middle);
    halve(rest, lower);
    halve(rest, upper);
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_particle_has_one_number_and_the_held_ones_come_last() {
        let rest: Vec<DVec3> = (0..100)
            .map(|i| DVec3::new((i % 7) as f64, (i % 11) as f64, (i / 20) as f64))
            .collect();
        let order = Order::new(&rest, |i| i % 5 != 0);
        assert_eq!(order.free, 80);
        for i in 0..100 {
            let node = order.node[i] as usize;
            assert_eq!(order.particle[node] as usize, i);
            assert_eq!(node >= order.free, i % 5 == 0);
        }
    }
}
