//! Joining the parts of a file: one point a position, one vertex a point and texture coordinate.

use super::part::Part;
use super::topology::{EdgeUse, edge_uses, same_edge};
use glam::{IVec3, Vec2, Vec3};
use std::collections::HashMap;

/// Border points nearer than this share of the longest extent are one point: a few units in the
/// last place of f32, where two exporters round the same seam differently.
const NEAR_SHARE: f32 = 1e-6;

/// A point with a texture coordinate.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Vertex {
    pub point: u32,
    pub uv: Vec2,
}

/// A triangle of the union and the part it comes from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Face {
    /// Vertices, counter-clockwise.
    pub corners: [u32; 3],
    pub part: u32,
}

/// Parts joined at equal positions.
#[derive(Clone, Debug, Default)]
pub(super) struct Union {
    pub points: Vec<Vec3>,
    pub vertices: Vec<Vertex>,
    pub faces: Vec<Face>,
}

impl Union {
    /// The corners of every face as points.
    pub fn point_triangles(&self) -> Vec<[u32; 3]> {
        self.faces
            .iter()
            .map(|face| self.face_points(face))
            .collect()
    }

    /// The corners of one face as points.
    pub fn face_points(&self, face: &Face) -> [u32; 3] {
        face.corners
            .map(|vertex| self.vertices[vertex as usize].point)
    }

    /// The same points and vertices with the faces of some parts only.
    pub fn of_parts(&self, wanted: impl Fn(u32) -> bool) -> Self {
        let mut union = self.clone();
        union.faces.retain(|face| wanted(face.part));
        union
    }

    /// Removes faces with a repeated corner point; returns how many there were.
    pub fn drop_degenerate(&mut self) -> usize {
        let before = self.faces.len();
        let vertices = &self.vertices;
        self.faces.retain(|face| {
            let [a, b, c] = face.corners.map(|vertex| vertices[vertex as usize].point);
            a != b && b != c && c != a
        });
        before - self.faces.len()
    }

    /// Keeps the first of faces with the same three points; returns how many went.
    pub fn drop_duplicates(&mut self) -> usize {
        let before = self.faces.len();
        let mut order: Vec<(usize, [u32; 3])> =
            self.point_triangles().into_iter().enumerate().collect();
        for (_, points) in &mut order {
            points.sort_unstable();
        }
        order.sort_unstable_by_key(|&(face, points)| (points, face));
        let mut repeated = vec![false; before];
        for pair in order.windows(2) {
            repeated[pair[1].0] = pair[0].1 == pair[1].1;
        }
        let mut repeated = repeated.into_iter();
        self.faces
            .retain(|_| !repeated.next().expect("one flag a face"));
        before - self.faces.len()
    }

    /// Moves every face corner and vertex from point `p` to `target[p]`.
    fn rename_points(&mut self, target: &[u32]) {
        for vertex in &mut self.vertices {
            vertex.point = target[vertex.point as usize];
        }
    }
}

/// Joins `parts` at exactly equal positions. Vertices differ where the texture coordinates do;
/// a part without them gets zeros.
pub(super) fn weld(parts: &[Part]) -> Union {
    let mut union = Union::default();
    let mut point_at: HashMap<[u32; 3], u32> = HashMap::new();
    let mut vertex_at: HashMap<(u32, [u32; 2]), u32> = HashMap::new();
    for (
        part,
        Part {
            positions,
            uvs,
            triangles,
            ..
        },
    ) in parts.iter().enumerate()
    {
        let vertex_of: Vec<u32> = positions
            .iter()
            .enumerate()
            .map(|(k, &position)| {
                // Adding zero makes -0 and 0 the same key.
                let position = position + Vec3::ZERO;
                let point = *point_at
                    .entry(position.to_array().map(f32::to_bits))
                    .or_insert_with(|| {
                        union.points.push(position);
                        union.points.len() as u32 - 1
                    });
                let uv = uvs.as_ref().map_or(Vec2::ZERO, |uvs| uvs[k] + Vec2::ZERO);
                *vertex_at
                    .entry((point, uv.to_array().map(f32::to_bits)))
                    .or_insert_with(|| {
                        union.vertices.push(Vertex { point, uv });
                        union.vertices.len() as u32 - 1
                    })
            })
            .collect();
        union.faces.extend(triangles.iter().map(|triangle| Face {
            corners: triangle.map(|vertex| vertex_of[vertex as usize]),
            part: part as u32,
        }));
    }
    union
}

/// Joins points on the borders of parts that lie nearer than [`NEAR_SHARE`]; returns how many went.
///
/// Only borders are looked at, so fine detail inside a part is never collapsed.
pub(super) fn weld_near_borders(union: &mut Union) -> usize {
    let (low, high) = crate::geom::bounds(&union.points);
    let near = (high - low).max_element() * NEAR_SHARE;
    if near <= 0.0 {
        return 0;
    }
    let cell_of = |p: Vec3| ((p - low) / near).floor().as_ivec3();
    let mut target: Vec<u32> = (0..union.points.len() as u32).collect();
    let mut cells: HashMap<IVec3, Vec<u32>> = HashMap::new();
    let mut joined = 0;
    for point in border_points(union) {
        let position = union.points[point as usize];
        let home = cell_of(position);
        let neighbour = (0..27)
            .map(|k| home + IVec3::new(k % 3 - 1, k / 3 % 3 - 1, k / 9 - 1))
            .filter_map(|cell| cells.get(&cell))
            .flatten()
            .find(|&&other| union.points[other as usize].distance(position) <= near);
        match neighbour {
            Some(&other) => {
                target[point as usize] = other;
                joined += 1;
            }
            None => cells.entry(home).or_default().push(point),
        }
    }
    if joined > 0 {
        union.rename_points(&target);
    }
    joined
}

/// Points on edges that exactly one part uses an odd number of times, in order.
fn border_points(union: &Union) -> Vec<u32> {
    let uses = edge_uses(&union.point_triangles());
    let part = |edge: &EdgeUse| union.faces[edge.triangle as usize].part;
    let mut points: Vec<u32> = uses
        .chunk_by(same_edge)
        .filter(|uses| odd_parts(uses.iter().map(part)).len() == 1)
        .flat_map(|uses| [uses[0].low, uses[0].high])
        .collect();
    points.sort_unstable();
    points.dedup();
    points
}

/// The parts that occur an odd number of times, sorted: those for which an edge is a border.
pub(super) fn odd_parts(parts: impl Iterator<Item = u32>) -> Vec<u32> {
    let mut parts: Vec<u32> = parts.collect();
    parts.sort_unstable();
    parts
        .chunk_by(|a, b| a == b)
        .filter(|same| same.len() % 2 == 1)
        .map(|same| same[0])
        .collect()
}
