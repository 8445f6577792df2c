//! Whether the texture coordinates of a surface can carry a texture in which each place has a texel
//! of its own.

use crate::geom::SurfaceMesh;
use glam::{DVec2, Vec2};
use std::fmt;

/// Texels along each side of the grid on which overlap is counted.
const GRID: usize = 1024;
/// Where in a texel it is sampled: off its middle, by a little that no exporter's grid shares.
const CENTRE: f64 = 0.503_17;
/// Overlap up to this share of the covered texels is filtering noise at chart borders.
const OVERLAP_SHARE_MAX: f32 = 0.01;
/// Triangles that would cover the box of all texture coordinates this many times over overlap,
/// without counting texels. Bounds the work.
const COVERS_MAX: f64 = 3.0;
/// Texture coordinates may leave the unit square by this much, half a texel of [`GRID`].
const OUTSIDE_MAX: f32 = 0.5 / GRID as f32;

/// What the texture coordinates of a surface are good for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum UvState {
    /// Each place of the surface has its own place in the unit square.
    Usable,
    /// A mesh has none.
    Missing,
    /// Some are not numbers.
    NonFinite,
    /// They cover no area: all zero, or all on a line.
    NoArea,
    /// They leave the unit square, so a texture would repeat.
    Outside,
    /// Places far apart on the surface share texels.
    Overlapping {
        /// Share of the covered texels that more than one triangle covers.
        share: f32,
    },
}

impl fmt::Display for UvState {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Usable => write!(f, "usable"),
            Self::Missing => write!(f, "missing"),
            Self::NonFinite => write!(f, "not finite"),
            Self::NoArea => write!(f, "without area"),
            Self::Outside => write!(f, "outside the unit square"),
            Self::Overlapping { share } => write!(f, "overlapping on {:.1} %", 100.0 * share),
        }
    }
}

/// Judges the texture coordinates of `mesh`. Overlap is counted on a grid of 1024 × 1024 texels laid
/// over the box of the coordinates; more than 1 % of the covered texels is [`UvState::Overlapping`].
pub fn uv_state(mesh: &SurfaceMesh) -> UvState {
    if mesh.uvs.iter().any(|uv| !uv.is_finite()) {
        return UvState::NonFinite;
    }
    let Some(&first) = mesh.uvs.first() else {
        return UvState::Missing;
    };
    let low = mesh.uvs.iter().fold(first, |low, &uv| low.min(uv));
    let high = mesh.uvs.iter().fold(first, |high, &uv| high.max(uv));
    let extent = high.as_dvec2() - low.as_dvec2();
    if extent.min_element() <= 0.0 {
        return UvState::NoArea;
    }
    let corners: Vec<[DVec2; 3]> = mesh
        .triangles
        .iter()
        .map(|t| t.map(|vertex| (mesh.uvs[vertex as usize].as_dvec2() - low.as_dvec2()) / extent))
        .collect();
    let covers: f64 = corners.iter().map(|t| twice_area(*t).abs() / 2.0).sum();
    if covers <= 1e-9 {
        return UvState::NoArea;
    }
    let share = if covers > COVERS_MAX {
        1.0
    } else {
        overlap_share(&corners)
    };
    if share > OVERLAP_SHARE_MAX {
        return UvState::Overlapping { share };
    }
    let outside =
        low.min_element() < -OUTSIDE_MAX || (high - Vec2::ONE).max_element() > OUTSIDE_MAX;
    if outside {
        UvState::Outside
    } else {
        UvState::Usable
    }
}

/// Number of triangles of `mesh` that have no area in the texture.
pub(super) fn triangles_without_uv_area(mesh: &SurfaceMesh) -> usize {
    let area = |t: &[u32; 3]| twice_area(t.map(|vertex| mesh.uvs[vertex as usize].as_dvec2()));
    mesh.triangles.iter().filter(|t| area(t) == 0.0).count()
}

fn twice_area([a, b, c]: [DVec2; 3]) -> f64 {
    (b - a).perp_dot(c - a)
}

/// Share of the covered texel centres that lie inside more than one triangle.
fn overlap_share(triangles: &[[DVec2; 3]]) -> f32 {
    let mut cover = vec![0_u8; GRID * GRID];
    for triangle in triangles {
        let rows = texels(
            triangle.iter().map(|p| p.y).fold(f64::MAX, f64::min),
            triangle.iter().map(|p| p.y).fold(f64::MIN, f64::max),
        );
        for row in rows {
            let (from, to) = span(triangle, (row as f64 + CENTRE) / GRID as f64);
            for cover in &mut cover[row * GRID..][texels(from, to)] {
                *cover = cover.saturating_add(1);
            }
        }
    }
    let covered = cover.iter().filter(|&&times| times > 0).count();
    let shared = cover.iter().filter(|&&times| times > 1).count();
    // If nothing is covered, every triangle is thinner than a texel and none is shared.
    shared as f32 / covered.max(1) as f32
}

/// The part of the line at height `y` that lies inside `triangle`; empty (from > to) if none does.
fn span(triangle: &[DVec2; 3], y: f64) -> (f64, f64) {
    let (mut from, mut to) = (f64::MAX, f64::MIN);
    for k in 0..3 {
        // Ends in one order, so that the two triangles at an edge get the very same crossing.
        let (mut a, mut b) = (triangle[k], triangle[(k + 1) % 3]);
        if a.y > b.y {
            (a, b) = (b, a);
        }
        if a.y <= y && y < b.y {
            let x = a.x + (y - a.y) / (b.y - a.y) * (b.x - a.x);
            (from, to) = (from.min(x), to.max(x));
        }
    }
    (from, to)
}

/// The texels whose centre lies in `from..to`, of coordinates in 0..1.
fn texels(from: f64, to: f64) -> std::ops::Range<usize> {
    let first_from = |x: f64| (x * GRID as f64 - CENTRE).ceil().clamp(0.0, GRID as f64) as usize;
    let (first, end) = (first_from(from), first_from(to));
    first..end.max(first)
}
