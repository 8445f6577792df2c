//! A closed triangle mesh round the inside of a field, from its values on a grid.
//!
//! Every cell through which the surface passes gets one point for each sheet in it, every grid edge
//! through which it passes one quad between the points of the four cells round it. Thin walls and
//! narrow gaps, of which a cell may hold two sheets, stay apart.
//!
//! Sources: Gibson, "Constrained Elastic Surface Nets", MICCAI 1998; Nielson, "Dual Marching
//! Cubes", Visualization 2004 (a point for each sheet).

use super::field::Shape;
use glam::Vec3;

const NONE: u32 = u32::MAX;

/// Points [cm] and triangles, counter-clockwise seen from outside.
///
/// # Panics
///
/// If the shape's box does not hold the shape.
pub fn dual_mesh(shape: &Shape) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let grid = Grid::sample(shape);
    let mut points = Vec::new();
    // The point of each of a cell's twelve edges, for the cells that have any.
    let mut sheets: Vec<[u32; 12]> = Vec::new();
    let mut sheets_of = vec![NONE; grid.values.len()];
    grid.each(|cell| {
        if let Some(of_edge) = grid.sheets(shape, cell, &mut points) {
            sheets_of[grid.index(cell)] = sheets.len() as u32;
            sheets.push(of_edge);
        }
    });
    let mut triangles = Vec::new();
    grid.each(|corner| {
        for axis in 0..3 {
            let mut end = corner;
            end[axis] += 1;
            let (here, there) = (grid.inside(corner), grid.inside(end));
            if here == there {
                continue;
            }
            let (u, v) = ((axis + 1) % 3, (axis + 2) % 3);
            let mut quad = [(0, 0), (1, 0), (1, 1), (0, 1)].map(|(back_u, back_v)| {
                let mut cell = corner;
                cell[u] -= back_u;
                cell[v] -= back_v;
                let sheet = sheets_of[grid.index(cell)];
                sheets[sheet as usize][4 * axis + back_u + 2 * back_v]
            });
            if !here {
                quad.reverse();
            }
            let [a, b, c, d] = quad;
            let length = |p: u32, q: u32| points[p as usize].distance_squared(points[q as usize]);
            if length(a, c) <= length(b, d) {
                triangles.extend([[a, b, c], [a, c, d]]);
            } else {
                triangles.extend([[b, c, d], [b, d, a]]);
            }
        }
    });
    (points, triangles)
}

/// Values of a field at the corners of cells.
struct Grid {
    size: [usize; 3],
    values: Vec<f32>,
}

impl Grid {
    fn sample(shape: &Shape) -> Self {
        let cells = ((shape.high - shape.low) / shape.cell).ceil();
        let size = cells.to_array().map(|n| n as usize + 1);
        let mut values = Vec::with_capacity(size[0] * size[1] * size[2]);
        for z in 0..size[2] {
            for y in 0..size[1] {
                for x in 0..size[0] {
                    let at = shape.low + shape.cell * Vec3::new(x as f32, y as f32, z as f32);
                    let value = (shape.field)(at);
                    let border = [x, y, z]
                        .iter()
                        .zip(size)
                        .any(|(&k, n)| k == 0 || k + 1 == n);
                    assert!(value > 0.0 || !border, "the box of a shape holds it all");
                    values.push(value);
                }
            }
        }
        Self { size, values }
    }

    fn index(&self, [x, y, z]: [usize; 3]) -> usize {
        (z * self.size[1] + y) * self.size[0] + x
    }

    fn inside(&self, corner: [usize; 3]) -> bool {
        self.values[self.index(corner)] < 0.0
    }

    /// Visits the first corner of every cell.
    fn each(&self, mut visit: impl FnMut([usize; 3])) {
        for z in 0..self.size[2] - 1 {
            for y in 0..self.size[1] - 1 {
                for x in 0..self.size[0] - 1 {
                    visit([x, y, z]);
                }
            }
        }
    }

    /// The point of each edge of a cell that the surface crosses, added to `points`. Edge
    /// `4 a + b` runs along axis `a`; the bits of `b` are its place along the next two axes.
    fn sheets(&self, shape: &Shape, cell: [usize; 3], points: &mut Vec<Vec3>) -> Option<[u32; 12]> {
        let corner = |edge: usize, end: usize| {
            let mut offset = [0; 3];
            offset[edge / 4] = end;
            offset[(edge / 4 + 1) % 3] = edge & 1;
            offset[(edge / 4 + 2) % 3] = (edge >> 1) & 1;
            offset
        };
        let at = |offset: [usize; 3]| std::array::from_fn::<usize, 3, _>(|d| cell[d] + offset[d]);
        let crossed: [bool; 12] = std::array::from_fn(|edge| {
            self.inside(at(corner(edge, 0))) != self.inside(at(corner(edge, 1)))
        });
        if !crossed.contains(&true) {
            return None;
        }
        let mut sheet: [usize; 12] = std::array::from_fn(|edge| edge);
        for face in 0..6 {
            let (normal, side) = (face / 2, face % 2);
            let on_face = |edge: &usize| {
                crossed[*edge] && edge / 4 != normal && corner(*edge, 0)[normal] == side
            };
            let edges: Vec<usize> = (0..12).filter(on_face).collect();
            for (k, &a) in edges.iter().enumerate() {
                for &b in &edges[k + 1..] {
                    // Of four crossed edges, two and two meet at a corner that lies inside: the
                    // cell beyond the face sees the same corners and joins them the same way.
                    let meet = (0..2).any(|i| {
                        (0..2)
                            .any(|j| corner(a, i) == corner(b, j) && self.inside(at(corner(a, i))))
                    });
                    if edges.len() == 2 || meet {
                        let (from, to) = (sheet[a].max(sheet[b]), sheet[a].min(sheet[b]));
                        for s in &mut sheet {
                            if *s == from {
                                *s = to;
                            }
                        }
                    }
                }
            }
        }
        let mut of_edge = [NONE; 12];
        for first in 0..12 {
            if !crossed[first] || sheet[first] != first {
                continue;
            }
            let (mut sum, mut count) = (Vec3::ZERO, 0.0);
            for edge in (0..12).filter(|&edge| crossed[edge] && sheet[edge] == first) {
                let ends = [at(corner(edge, 0)), at(corner(edge, 1))];
                let values = ends.map(|end| self.values[self.index(end)]);
                let t = values[0] / (values[0] - values[1]);
                let places = ends.map(|end| Vec3::from(end.map(|n| n as f32)));
                sum += places[0].lerp(places[1], t);
                count += 1.0;
                of_edge[edge] = points.len() as u32;
            }
            points.push(shape.low + shape.cell * (sum / count));
        }
        Some(of_edge)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::organ::field::{carve, ellipsoid};

    /// Edges that do not have exactly one triangle on each side.
    fn open_edges(triangles: &[[u32; 3]]) -> usize {
        let mut sides: Vec<(u32, u32)> = triangles
            .iter()
            .flat_map(|t| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])])
            .collect();
        sides.sort_unstable();
        let single = |&(a, b): &(u32, u32)| {
            sides.iter().filter(|s| **s == (a, b)).count() == 1
                && sides.binary_search(&(b, a)).is_ok()
        };
        sides.iter().filter(|side| !single(side)).count()
    }

    /// A hollow ball whose wall is `wall` cells thick.
    fn shell(wall: f32) -> Shape {
        Shape {
            field: if wall < 1.0 {
                |p| {
                    carve(
                        ellipsoid(p, Vec3::ZERO, Vec3::splat(3.03)),
                        p.length() - 2.73,
                        0.01,
                    )
                }
            } else {
                |p| {
                    carve(
                        ellipsoid(p, Vec3::ZERO, Vec3::splat(3.03)),
                        p.length() - 1.5,
                        0.01,
                    )
                }
            },
            low: Vec3::splat(-4.0),
            high: Vec3::splat(4.0),
            cell: 0.4,
        }
    }

    #[test]
    fn sheets_closer_than_a_cell_stay_two_closed_surfaces() {
        for wall in [0.75, 3.8] {
            let (points, triangles) = dual_mesh(&shell(wall));
            assert_eq!(open_edges(&triangles), 0, "wall of {wall} cells");
            let inner = points.iter().filter(|p| p.length() < 2.88).count();
            assert!(inner > 100 && points.len() - inner > 100, "{inner}");
        }
    }

    #[test]
    fn edge_check_rejects_a_missing_triangle() {
        let (_, mut triangles) = dual_mesh(&shell(3.8));
        triangles.pop();
        assert!(open_edges(&triangles) > 0);
    }
}
