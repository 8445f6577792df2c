//! Colours of constraints that share no particle.

/// Colours the constraints `members` so that no two of one colour share a particle: the constraint
/// numbers of each colour, in the order given.
///
/// First fit in the order given, so the same constraints always get the same colours. Fewer colours
/// than the most constraints at one particle are impossible; first fit needs a few more.
///
/// # Panics
///
/// If a constraint names a particle beyond `particle_count`.
pub fn color<const N: usize>(
    constraints: &[[u32; N]],
    members: &[u32],
    particle_count: usize,
) -> Vec<Vec<u32>> {
    let mut colors: Vec<Vec<u32>> = Vec::new();
    let mut waiting = members.to_vec();
    // A word of 128 colours at a time; whoever finds none free waits for the next word.
    while !waiting.is_empty() {
        let first_color = colors.len();
        let mut used = vec![0_u128; particle_count];
        waiting.retain(|&constraint| {
            let particles = constraints[constraint as usize];
            let taken = particles
                .iter()
                .fold(0_u128, |taken, &particle| taken | used[particle as usize]);
            let free = (!taken).trailing_zeros() as usize;
            if free == 128 {
                return true;
            }
            for particle in particles {
                used[particle as usize] |= 1 << free;
            }
            if first_color + free >= colors.len() {
                colors.resize(first_color + free + 1, Vec::new());
            }
            colors[first_color + free].push(constraint);
            false
        });
    }
    colors
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::HashSet;

    /// Whether every constraint has one colour and no colour uses a particle twice.
    fn is_sound(colors: &[Vec<u32>], constraints: &[[u32; 4]]) -> bool {
        let mut seen: Vec<u32> = colors.concat();
        seen.sort_unstable();
        seen == (0..constraints.len() as u32).collect::<Vec<_>>()
            && colors.iter().all(|color| {
                let mut used = HashSet::new();
                color.iter().all(|&c| {
                    let particles: HashSet<u32> = constraints[c as usize].into();
                    particles.iter().all(|&particle| used.insert(particle))
                })
            })
    }

    proptest! {
        #[test]
        fn no_color_uses_a_particle_twice(
            constraints in prop::collection::vec(prop::array::uniform4(0_u32..30), 0..400),
        ) {
            // 400 constraints on 30 particles need more than the 128 colours of one word.
            let all: Vec<u32> = (0..constraints.len() as u32).collect();
            prop_assert!(is_sound(&color(&constraints, &all, 30), &constraints));
        }
    }

    #[test]
    fn soundness_check_rejects_two_neighbours_in_one_color() {
        let constraints = [[0, 1, 2, 3], [3, 4, 5, 6]];
        assert!(!is_sound(&[vec![0, 1]], &constraints));
    }
}
