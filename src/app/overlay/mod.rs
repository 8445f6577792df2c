//! What is drawn over the picture on a key: normals, tangents, light-path primitives, the tetrahedra, and where the
//! surface is cut. It reads back what the shaders read; nothing of it exists until it is switched on.

mod lines;
mod seen;

use super::orbit::Orbit;
use super::renderer::{DrawnGeometry, Renderer};
use super::section::Section;
use super::{AppError, Session};
use crate::geom::quadric::Quadric;
use crate::geom::tangent::any_perpendicular;
use egui::epaint::ClippedShape;
use egui::{Color32, Rect};
use glam::Vec3;
use lines::Lines;
use seen::Seen;

const NORMALS: Color32 = Color32::from_rgb(0x66, 0xcc, 0xee);
const TANGENTS: Color32 = Color32::from_rgb(0xee, 0xcc, 0x44);
const PRIMITIVES: Color32 = Color32::from_rgb(0x99, 0xee, 0x88);
const LATTICE: Color32 = Color32::from_rgba_premultiplied(90, 90, 110, 110);
const CUT: Color32 = Color32::from_rgb(0xff, 0xff, 0xff);

/// Arrows and primitives that are drawn at most: more would cover each other.
const SIGNS_MAX: usize = 1500;
/// Length of an arrow, and half the width of a primitive, in longest extents of the body.
const ARROW_SHARE: f32 = 0.022;
const PATCH_SHARE: f32 = 0.012;
/// How far behind the drawn surface a place still counts as on it, in longest extents of the body.
const HIDDEN_SHARE: f32 = 0.004;

/// What of it is switched on.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct OverlaysShown {
    /// Normals of the points.
    pub normals: bool,
    /// Tangents of the vertices.
    pub tangents: bool,
    /// Planes or paraboloids that light is followed by.
    pub primitives: bool,
    /// Edges of the tetrahedra.
    pub lattice: bool,
    /// The layers below the cursor, cut open.
    pub section: bool,
}

impl OverlaysShown {
    /// Whether anything is drawn over the picture itself.
    fn any(self) -> bool {
        self.reads_geometry() || self.lattice || self.section
    }

    fn reads_geometry(self) -> bool {
        self.normals || self.tangents || self.primitives
    }
}

/// The shapes that lie over the picture in `rect`, as it was last drawn.
///
/// # Errors
///
/// [`AppError::Gpu`] if what the shaders read can't be read back.
pub fn shapes(
    shown: OverlaysShown,
    session: &Session,
    renderer: &Renderer,
    orbit: &Orbit,
    rect: Rect,
    section: Option<&Section>,
) -> Result<Vec<ClippedShape>, AppError> {
    if !shown.any() {
        return Ok(Vec::new());
    }
    let longest_m = session.rest.longest_m();
    let mut lines = Lines::default();
    if shown.lattice {
        let seen = Seen::through(orbit, rect);
        lattice(&mut lines, &seen, session);
    }
    if shown.reads_geometry() {
        let seen = Seen::behind(orbit, rect, renderer, HIDDEN_SHARE * longest_m)?;
        let geometry = renderer.geometry()?;
        let signs = Signs {
            seen: &seen,
            points: session.points(),
            geometry: &geometry,
            longest_m,
        };
        if shown.primitives {
            signs.primitives(&mut lines);
        }
        if shown.tangents {
            signs.tangents(&mut lines, &session.mesh.point_of);
        }
        if shown.normals {
            signs.normals(&mut lines);
        }
    }
    if shown.section
        && let Some(section) = section
    {
        let seen = Seen::through(orbit, rect);
        for pair in section.places_m().windows(2) {
            lines.thick(seen.place(pair[0]), seen.place(pair[1]), CUT);
        }
    }
    Ok(vec![ClippedShape::new(rect, lines.into_shape())])
}

/// Every edge of the tetrahedra once, as pairs of particles.
fn edges(tets: &[[u32; 4]]) -> Vec<[u32; 2]> {
    let mut edges: Vec<[u32; 2]> = (tets.iter())
        .flat_map(|&[a, b, c, d]| [[a, b], [a, c], [a, d], [b, c], [b, d], [c, d]])
        .map(|[a, b]| [a.min(b), a.max(b)])
        .collect();
    edges.sort_unstable();
    edges.dedup();
    edges
}

fn lattice(lines: &mut Lines, seen: &Seen, session: &Session) {
    let simulation = session.simulation();
    let places: Vec<_> = (simulation.particles().iter())
        .map(|&x| seen.place(x))
        .collect();
    for [a, b] in edges(&simulation.setup().tets.tets) {
        lines.thin(places[a as usize], places[b as usize], LATTICE);
    }
}

/// What is drawn at points of the surface that can be seen.
struct Signs<'a> {
    seen: &'a Seen,
    points: &'a [Vec3],
    geometry: &'a DrawnGeometry,
    longest_m: f32,
}

impl Signs<'_> {
    fn normal(&self, point: usize) -> Vec3 {
        let [x, y, z, _] = self.geometry.normals[point];
        Vec3::new(x, y, z)
    }

    /// Points that face the eye with nothing before them, thinned to what can be told apart.
    fn visible(&self) -> Vec<usize> {
        let mut visible: Vec<usize> = (0..self.points.len())
            .filter(|&i| self.seen.shows(self.points[i], self.normal(i)))
            .collect();
        let every = visible.len().div_ceil(SIGNS_MAX).max(1);
        if every > 1 {
            // Neighbours often follow each other, so a step that shares no rhythm with rows spreads best.
            visible = visible.into_iter().step_by(every).collect();
        }
        visible
    }

    fn normals(&self, lines: &mut Lines) {
        for i in self.visible() {
            self.arrow(lines, self.points[i], self.normal(i), NORMALS);
        }
    }

    fn arrow(&self, lines: &mut Lines, from: Vec3, direction: Vec3, color: Color32) {
        let to = from + ARROW_SHARE * self.longest_m * direction;
        lines.thin(self.seen.place(from), self.seen.place(to), color);
    }

    fn tangents(&self, lines: &mut Lines, point_of: &[u32]) {
        let mut is_visible = vec![false; self.points.len()];
        for i in self.visible() {
            is_visible[i] = true;
        }
        for (vertex, &point) in point_of.iter().enumerate() {
            if is_visible[point as usize] {
                let [x, y, z, _] = self.geometry.tangents[vertex];
                let tangent = Vec3::new(x, y, z);
                self.arrow(lines, self.points[point as usize], tangent, TANGENTS);
            }
        }
    }

    fn primitives(&self, lines: &mut Lines) {
        let Some((width, numbers)) = &self.geometry.primitives else {
            return;
        };
        let half_m = PATCH_SHARE * self.longest_m;
        for i in self.visible() {
            let at = self.points[i];
            if *width == 4 {
                let [x, y, z, offset_m] = numbers[i];
                let n = Vec3::new(x, y, z);
                self.plane(lines, at + offset_m * n, n, half_m);
            } else {
                let [s, p] = [numbers[2 * i], numbers[2 * i + 1]];
                let quadric = Quadric {
                    squares: Vec3::new(s[0], s[1], s[2]),
                    products: Vec3::new(p[0], p[1], p[2]),
                };
                self.paraboloid(lines, at, self.normal(i), &quadric, half_m);
            }
        }
    }

    /// The outline of a square piece of a plane.
    fn plane(&self, lines: &mut Lines, at: Vec3, normal: Vec3, half_m: f32) {
        let u = half_m * any_perpendicular(normal);
        let v = normal.cross(u);
        let corners = [at - u - v, at + u - v, at + u + v, at - u + v];
        for k in 0..4 {
            let [from, to] = [corners[k], corners[(k + 1) % 4]];
            lines.thin(self.seen.place(from), self.seen.place(to), PRIMITIVES);
        }
    }

    /// The rim of a round piece of a paraboloid, and its two bent axes.
    fn paraboloid(&self, lines: &mut Lines, at: Vec3, normal: Vec3, q: &Quadric, half_m: f32) {
        let u = any_perpendicular(normal);
        let v = normal.cross(u);
        let place = |x: f32, y: f32| {
            let d = half_m * (x * u + y * v);
            self.seen.place(at + d + 0.5 * d.dot(q.times(d)) * normal)
        };
        let rim = |k: usize| {
            let (sin, cos) = (std::f32::consts::TAU * k as f32 / 12.0).sin_cos();
            place(cos, sin)
        };
        for k in 0..12 {
            lines.thin(rim(k), rim(k + 1), PRIMITIVES);
        }
        for k in [-1.0, 0.0] {
            lines.thin(place(k, 0.0), place(k + 1.0, 0.0), PRIMITIVES);
            lines.thin(place(0.0, k), place(0.0, k + 1.0), PRIMITIVES);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tetrahedra_that_share_a_face_share_its_edges() {
        // Six edges each, three of them common.
        assert_eq!(edges(&[[0, 1, 2, 3]]).len(), 6);
        assert_eq!(edges(&[[0, 1, 2, 3], [4, 3, 2, 1]]).len(), 9);
    }
}
