//! Charts of a texture map: parts of a surface that hang together in it.

use super::SurfaceMesh;

/// Number of each vertex's chart, from 0, in the order of their first vertices.
pub fn charts(mesh: &SurfaceMesh) -> Vec<u32> {
    let mut parent: Vec<u32> = (0..mesh.uvs.len() as u32).collect();
    for &[a, b, c] in &mesh.triangles {
        let root = find(&mut parent, a);
        for other in [b, c] {
            let other = find(&mut parent, other);
            // The smaller number leads, so that charts are numbered by their first vertices.
            let (low, high) = (root.min(other), root.max(other));
            let low = find(&mut parent, low);
            parent[high as usize] = low;
        }
    }
    let mut number = vec![u32::MAX; parent.len()];
    let mut count = 0;
    (0..parent.len() as u32)
        .map(|vertex| {
            let root = find(&mut parent, vertex) as usize;
            if number[root] == u32::MAX {
                number[root] = count;
                count += 1;
            }
            number[root]
        })
        .collect()
}

fn find(parent: &mut [u32], vertex: u32) -> u32 {
    let mut at = vertex;
    while parent[at as usize] != at {
        let up = parent[parent[at as usize] as usize];
        parent[at as usize] = up;
        at = up;
    }
    at
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::{Vec2, Vec3};

    #[test]
    fn a_strip_is_one_chart_and_a_triangle_apart_another() {
        let mesh = SurfaceMesh {
            points: vec![Vec3::ZERO; 8],
            point_of: (0..8).collect(),
            uvs: vec![Vec2::ZERO; 8],
            triangles: vec![[2, 3, 4], [5, 6, 7], [0, 1, 2], [1, 4, 0]],
        };
        assert_eq!(charts(&mesh), [0, 0, 0, 0, 0, 1, 1, 1]);
    }
}
