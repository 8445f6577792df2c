//! Cuts tetrahedra into strips across the body, of which every other one shares no node.

/// Tetrahedra a strip, about: their part of the matrix stays in a core's own cache.
const STRIP_TETS: usize = 600;

/// Strips of the tetrahedra with corners `tets`: their numbers, ascending in each strip.
///
/// Nodes are counted in steps along edges from one end of the body. A tetrahedron reaches from one
/// count to the same or the next, so one that starts at count k shares no node with any that starts
/// at k + 2 or beyond, and strips of whole counts only touch the strips next to them.
pub fn strips(tets: &[[u32; 4]], node_count: usize) -> Vec<Vec<u32>> {
    let steps = steps(tets, node_count);
    let start = |tet: &[u32; 4]| tet.iter().map(|&node| steps[node as usize]).min();
    let starts: Vec<usize> = tets.iter().filter_map(start).collect();
    let mut counted: Vec<Vec<u32>> = vec![Vec::new(); starts.iter().max().map_or(0, |m| m + 1)];
    for (tet, &start) in starts.iter().enumerate() {
        counted[start].push(tet as u32);
    }
    let mut strips: Vec<Vec<u32>> = vec![Vec::new()];
    for tets in counted {
        let full = strips
            .last()
            .is_some_and(|strip| strip.len() + tets.len() / 2 > STRIP_TETS);
        if full {
            strips.push(Vec::new());
        }
        strips.last_mut().expect("there is one").extend(tets);
    }
    for strip in &mut strips {
        strip.sort_unstable();
    }
    strips
}

/// Steps along edges of each node from an end of the body. A part that hangs on nothing goes on
/// counting two beyond the last.
fn steps(tets: &[[u32; 4]], node_count: usize) -> Vec<usize> {
    let mut neighbours = vec![Vec::new(); node_count];
    for tet in tets {
        for &node in tet {
            neighbours[node as usize].extend(tet);
        }
    }
    let mut steps = vec![usize::MAX; node_count];
    let mut first = 0;
    for node in 0..node_count {
        if steps[node] != usize::MAX {
            continue;
        }
        // The node found last from anywhere is at an end.
        let mut seen = vec![false; node_count];
        let end = spread(&neighbours, node, |node, _| {
            !std::mem::replace(&mut seen[node], true)
        });
        let mut last = first;
        spread(&neighbours, end, |node, count| {
            let is_new = steps[node] == usize::MAX;
            if is_new {
                steps[node] = first + count;
                last = first + count;
            }
            is_new
        });
        first = last + 2;
    }
    steps
}

/// Visits what is connected to `from`, nearest first, as long as `visit`, which is given a node and
/// its steps, finds it new. Returns the last node.
fn spread(
    neighbours: &[Vec<u32>],
    from: usize,
    mut visit: impl FnMut(usize, usize) -> bool,
) -> usize {
    visit(from, 0);
    let mut front = vec![from];
    let mut count = 0;
    loop {
        count += 1;
        let mut next = Vec::new();
        for &node in &front {
            for &neighbour in &neighbours[node] {
                if visit(neighbour as usize, count) {
                    next.push(neighbour as usize);
                }
            }
        }
        match next.last() {
            Some(_) => front = next,
            None => return *front.last().expect("a front is not empty"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;
    use std::collections::HashSet;

    fn nodes(strip: &[u32], tets: &[[u32; 4]]) -> HashSet<u32> {
        strip.iter().flat_map(|&tet| tets[tet as usize]).collect()
    }

    /// Whether every tetrahedron is in one strip and strips that are not next to each other share
    /// no node.
    fn is_sound(strips: &[Vec<u32>], tets: &[[u32; 4]]) -> bool {
        let mut all = strips.concat();
        all.sort_unstable();
        all == (0..tets.len() as u32).collect::<Vec<_>>()
            && (0..strips.len()).all(|a| {
                let a_nodes = nodes(&strips[a], tets);
                (a + 2..strips.len()).all(|b| nodes(&strips[b], tets).is_disjoint(&a_nodes))
            })
    }

    proptest! {
        #[test]
        fn strips_share_nodes_with_the_strips_next_to_them_only(
            tets in prop::collection::vec(
                (0_u32..3000).prop_flat_map(|a| prop::array::uniform4(a..a + 40)), 0..3000,
            ),
        ) {
            prop_assert!(is_sound(&strips(&tets, 3040), &tets));
        }
    }

    #[test]
    fn soundness_check_rejects_a_cut_in_the_wrong_place() {
        let tets = [[0, 1, 2, 3], [1, 2, 3, 4], [2, 3, 4, 5]];
        assert!(!is_sound(&[vec![0], vec![1], vec![2]], &tets));
    }
}
