//! What is joined to what: edges, connected pieces, orientation, points where two fans meet.

/// One triangle's use of an edge.
#[derive(Clone, Copy, Debug, PartialEq, Eq, PartialOrd, Ord)]
pub(super) struct EdgeUse {
    /// The smaller point of the edge.
    pub low: u32,
    /// The larger point of the edge.
    pub high: u32,
    pub triangle: u32,
    /// Corner of the triangle at which the edge starts.
    pub corner: u8,
    /// Whether the triangle runs from `low` to `high`.
    pub forward: bool,
}

/// How far a set of triangles is from a closed manifold.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Defects {
    /// Edges with one triangle.
    pub border: usize,
    /// Edges with more than two triangles.
    pub crowded: usize,
}

impl Defects {
    pub fn none(self) -> bool {
        self == Self::default()
    }
}

/// Whether two uses are of the same edge; groups a sorted list of uses with `chunk_by`.
pub(super) fn same_edge(a: &EdgeUse, b: &EdgeUse) -> bool {
    (a.low, a.high) == (b.low, b.high)
}

/// The edge uses of all triangles, sorted so that uses of one edge are neighbours.
pub(super) fn edge_uses(triangles: &[[u32; 3]]) -> Vec<EdgeUse> {
    let mut uses: Vec<EdgeUse> = triangles
        .iter()
        .enumerate()
        .flat_map(|(triangle, corners)| {
            (0..3).map(move |k| {
                let (from, to) = (corners[k], corners[(k + 1) % 3]);
                EdgeUse {
                    low: from.min(to),
                    high: from.max(to),
                    triangle: triangle as u32,
                    corner: k as u8,
                    forward: from < to,
                }
            })
        })
        .collect();
    uses.sort_unstable();
    uses
}

/// Counts border and crowded edges.
pub(super) fn defects(triangles: &[[u32; 3]]) -> Defects {
    let mut defects = Defects::default();
    for uses in edge_uses(triangles).chunk_by(same_edge) {
        match uses.len() {
            1 => defects.border += 1,
            2 => {}
            _ => defects.crowded += 1,
        }
    }
    defects
}

/// Sets that are joined step by step.
pub(super) struct Sets {
    parent: Vec<u32>,
}

impl Sets {
    pub fn new(count: usize) -> Self {
        Self {
            parent: (0..count as u32).collect(),
        }
    }

    /// The smallest member of the set of `item`.
    pub fn root(&mut self, mut item: u32) -> u32 {
        while self.parent[item as usize] != item {
            let above = self.parent[self.parent[item as usize] as usize];
            self.parent[item as usize] = above;
            item = above;
        }
        item
    }

    /// Makes the sets of `a` and `b` one.
    pub fn join(&mut self, a: u32, b: u32) {
        let (a, b) = (self.root(a), self.root(b));
        self.parent[a.max(b) as usize] = a.min(b);
    }
}

/// The piece of each triangle; triangles that share an edge are of one piece. Pieces are numbered
/// from 0 in the order of their first triangle.
pub(super) fn pieces(triangles: &[[u32; 3]]) -> Vec<u32> {
    let mut sets = Sets::new(triangles.len());
    for pair in edge_uses(triangles).windows(2) {
        if same_edge(&pair[0], &pair[1]) {
            sets.join(pair[0].triangle, pair[1].triangle);
        }
    }
    let mut number = vec![u32::MAX; triangles.len()];
    let mut count = 0;
    (0..triangles.len() as u32)
        .map(|triangle| {
            let root = sets.root(triangle) as usize;
            if number[root] == u32::MAX {
                number[root] = count;
                count += 1;
            }
            number[root]
        })
        .collect()
}

/// Which triangles to flip so that neighbours across two-triangle edges run the same way round.
/// `None` if no choice does.
pub(super) fn flips(triangles: &[[u32; 3]]) -> Option<Vec<bool>> {
    let mut neighbours: Vec<Vec<(u32, bool)>> = vec![Vec::new(); triangles.len()];
    for uses in edge_uses(triangles).chunk_by(same_edge) {
        if let [a, b] = uses {
            // Consistent neighbours use their edge in opposite directions.
            let differ = a.forward == b.forward;
            neighbours[a.triangle as usize].push((b.triangle, differ));
            neighbours[b.triangle as usize].push((a.triangle, differ));
        }
    }
    let mut flip: Vec<Option<bool>> = vec![None; triangles.len()];
    for start in 0..triangles.len() {
        if flip[start].is_some() {
            continue;
        }
        flip[start] = Some(false);
        let mut waiting = vec![start];
        while let Some(triangle) = waiting.pop() {
            let here = flip[triangle].expect("set before it was queued");
            for &(next, differ) in &neighbours[triangle] {
                match flip[next as usize] {
                    None => {
                        flip[next as usize] = Some(here != differ);
                        waiting.push(next as usize);
                    }
                    Some(there) if there != (here != differ) => return None,
                    Some(_) => {}
                }
            }
        }
    }
    flip.into_iter().collect()
}

/// The fan of each triangle corner: corners at one point that are joined by edges there share a
/// number, `[3 * triangle + corner]`. A closed manifold has one fan a point.
pub(super) fn fans(triangles: &[[u32; 3]]) -> Vec<u32> {
    let mut sets = Sets::new(3 * triangles.len());
    let corner_at = |triangle: u32, point: u32| {
        let corners = triangles[triangle as usize];
        let corner = corners.iter().position(|&p| p == point);
        3 * triangle + corner.expect("the edge is of this triangle") as u32
    };
    for pair in edge_uses(triangles).windows(2) {
        let [a, b] = [pair[0], pair[1]];
        if same_edge(&a, &b) {
            for point in [a.low, a.high] {
                sets.join(corner_at(a.triangle, point), corner_at(b.triangle, point));
            }
        }
    }
    (0..3 * triangles.len() as u32)
        .map(|corner| sets.root(corner))
        .collect()
}
