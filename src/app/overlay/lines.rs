//! Many thin lines as one mesh: the painter's own lines have soft edges, which cost ten times the triangles.

use egui::epaint::Vertex;
use egui::{Color32, Mesh, Pos2, Shape};

/// Half the width of a line, in points.
const THIN: f32 = 0.55;
const THICK: f32 = 1.2;

/// Lines, in the order they are drawn.
#[derive(Default)]
pub struct Lines {
    mesh: Mesh,
}

impl Lines {
    /// A thin line; none where an end can't be placed.
    pub fn thin(&mut self, from: Option<Pos2>, to: Option<Pos2>, color: Color32) {
        self.line(from, to, THIN, color);
    }

    /// A thicker one.
    pub fn thick(&mut self, from: Option<Pos2>, to: Option<Pos2>, color: Color32) {
        self.line(from, to, THICK, color);
    }

    fn line(&mut self, from: Option<Pos2>, to: Option<Pos2>, half: f32, color: Color32) {
        let (Some(from), Some(to)) = (from, to) else {
            return;
        };
        let along = to - from;
        let length = along.length();
        if !(length > 0.0 && length.is_finite()) {
            return;
        }
        let across = half / length * along.rot90();
        let first = self.mesh.vertices.len() as u32;
        for pos in [from + across, from - across, to - across, to + across] {
            self.mesh.vertices.push(Vertex {
                pos,
                uv: egui::epaint::WHITE_UV,
                color,
            });
        }
        self.mesh.add_triangle(first, first + 1, first + 2);
        self.mesh.add_triangle(first, first + 2, first + 3);
    }

    /// All of them.
    pub fn into_shape(self) -> Shape {
        Shape::mesh(self.mesh)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use egui::pos2;

    #[test]
    fn a_line_without_an_end_or_a_length_is_not_drawn() {
        let mut lines = Lines::default();
        let at = Some(pos2(1.0, 2.0));
        lines.thin(at, None, Color32::WHITE);
        lines.thin(at, at, Color32::WHITE);
        lines.thin(at, Some(pos2(f32::NAN, 0.0)), Color32::WHITE);
        assert!(lines.mesh.is_empty());
        lines.thin(at, Some(pos2(5.0, 2.0)), Color32::WHITE);
        assert_eq!(lines.mesh.indices.len(), 6);
        assert!(
            lines
                .mesh
                .vertices
                .iter()
                .all(|v| (v.pos.y - 2.0).abs() < 1.0)
        );
    }
}
