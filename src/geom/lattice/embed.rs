//! Hanging points in tetrahedra that were not made round them, and the skin of a tetrahedral mesh.

use super::{
    super::{Embedding, TetMesh},
    barycentric,
};
use glam::{DVec3, Vec3};
use rstar::{AABB, PointDistance, RTree, RTreeObject};
use std::collections::HashMap;

/// The box of one tetrahedron.
struct TetBox {
    tet: u32,
    low: [f32; 3],
    high: [f32; 3],
}

impl RTreeObject for TetBox {
    type Envelope = AABB<[f32; 3]>;

    fn envelope(&self) -> Self::Envelope {
        AABB::from_corners(self.low, self.high)
    }
}

impl PointDistance for TetBox {
    fn distance_2(&self, point: &[f32; 3]) -> f32 {
        self.envelope().distance_2(point)
    }
}

/// Where each of `points` lies in `mesh`; one outside is extrapolated from the nearest tetrahedron.
///
/// Flat tetrahedra are passed over.
///
/// # Panics
///
/// If `mesh` has no tetrahedron with a volume, or a point is not finite.
pub fn embed(mesh: &TetMesh, points: &[Vec3]) -> Embedding {
    let corners_of = |tet: u32| {
        mesh.tets[tet as usize].map(|particle| mesh.particles[particle as usize].as_dvec3())
    };
    let boxes = (0..mesh.tets.len() as u32)
        .filter(|&tet| barycentric(corners_of(tet), DVec3::ZERO).is_some())
        .map(|tet| {
            let corners = mesh.tets[tet as usize].map(|i| mesh.particles[i as usize]);
            let (low, high) = super::super::bounds(&corners);
            TetBox {
                tet,
                low: low.to_array(),
                high: high.to_array(),
            }
        })
        .collect();
    let tree = RTree::bulk_load(boxes);

    let mut embedding = Embedding::default();
    for &point in points {
        assert!(point.is_finite(), "a point to embed is finite");
        let x = point.as_dvec3();
        let mut best: Option<(f64, u32, [f64; 4])> = None;
        for (candidate, box_distance_2) in
            tree.nearest_neighbor_iter_with_distance_2(point.to_array())
        {
            // Boxes come nearest first: none that follows can hold a nearer tetrahedron. The
            // factor is for the rounding of the box distance.
            if best.is_some_and(|(distance, ..)| {
                f64::from(box_distance_2) * 0.999 > distance * distance
            }) {
                break;
            }
            let corners = corners_of(candidate.tet);
            let weights = barycentric(corners, x).expect("flat tetrahedra were left out");
            let distance = distance_to_tet(corners, weights, x);
            if best.is_none_or(|(nearest, ..)| distance < nearest) {
                best = Some((distance, candidate.tet, weights));
            }
            if distance == 0.0 {
                break;
            }
        }
        let (_, tet, weights) = best.expect("the mesh has a tetrahedron with a volume");
        embedding.particles.push(mesh.tets[tet as usize]);
        embedding.weights.push(weights.map(|w| w as f32));
    }
    embedding
}

/// Distance from `x` to a tetrahedron [m]; 0 inside.
fn distance_to_tet(corners: [DVec3; 4], weights: [f64; 4], x: DVec3) -> f64 {
    if weights.iter().all(|&w| w >= 0.0) {
        return 0.0;
    }
    let [a, b, c, d] = corners;
    [[a, b, c], [a, b, d], [a, c, d], [b, c, d]]
        .into_iter()
        .map(|face| distance_to_triangle(face, x))
        .fold(f64::INFINITY, f64::min)
}

/// Distance from `x` to a triangle [m].
fn distance_to_triangle([a, b, c]: [DVec3; 3], x: DVec3) -> f64 {
    let normal = (b - a).cross(c - a);
    let over = [(a, b), (b, c), (c, a)]
        .into_iter()
        .all(|(from, to)| (to - from).cross(x - from).dot(normal) >= 0.0);
    if over && normal.length_squared() > 0.0 {
        return (x - a).dot(normal.normalize()).abs();
    }
    [(a, b), (b, c), (c, a)]
        .into_iter()
        .map(|(from, to)| {
            let edge = to - from;
            let along = (x - from).dot(edge) / edge.length_squared().max(f64::MIN_POSITIVE);
            (from + along.clamp(0.0, 1.0) * edge - x).length()
        })
        .fold(f64::INFINITY, f64::min)
}

/// The faces that belong to one tetrahedron only, counter-clockwise seen from outside, in the order
/// of the tetrahedra. Corners are particles.
pub fn boundary_triangles(mesh: &TetMesh) -> Vec<[u32; 3]> {
    let faces = || {
        mesh.tets
            .iter()
            .flat_map(|&[a, b, c, d]| [[b, c, d], [a, d, c], [a, b, d], [a, c, b]])
    };
    let key = |mut face: [u32; 3]| {
        face.sort_unstable();
        face
    };
    let mut uses: HashMap<[u32; 3], u32> = HashMap::new();
    for face in faces() {
        *uses.entry(key(face)).or_default() += 1;
    }
    faces().filter(|&face| uses[&key(face)] == 1).collect()
}
