//! Texture coordinates for a surface that has none: an atlas in which no two triangles overlap.
//!
//! Charts grow over the surface from seeds ([`charts`]), are laid flat with little stretch
//! ([`flatten`]), merged while that stays cheap, cut where a flat chart overlaps itself, and packed
//! ([`pack`]). Texel density is the same in every chart. The same input gives the same bits.

mod charts;
mod flatten;
mod pack;

use super::SurfaceMesh;
use charts::Faces;
use flatten::Flat;
use glam::{DVec2, DVec3, Vec2, Vec3};

/// Empty space between two charts, and twice that between a chart and the border, as a share of
/// the side: 8 texels in a texture of 1024.
pub const GUTTER_SHARE: f64 = 8.0 / 1024.0;

/// A chart may stretch lengths by so much (98th percentile over its area) before it is not merged
/// further.
const STRETCH_MAX: f64 = 1.45;

/// Two charts above this share of the whole area are not joined: the result would pack badly.
const JOINT_SHARE_MAX: f64 = 0.4;

/// A chart below this share is joined to any other: it costs seams and packs no better.
const SMALL_SHARE: f64 = 0.06;

/// Merging ends when it has laid flat this many times the triangles of the surface.
const MERGE_WORK_MAX: usize = 12;

/// How well a UV map uses its square and keeps lengths.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct UvReport {
    /// Connected pieces of the UV map.
    pub charts: usize,
    /// Share of the texel centres that some triangle covers.
    pub covered_share: f64,
    /// Share of the covered texel centres that more than one triangle covers.
    pub overlap_share: f64,
    /// Median and 99th percentile over the area of the larger of σ₁ and 1/σ₂, the singular values
    /// of the map from the surface to UV space, relative to the mean density; 1 is no stretch.
    pub stretch_p50: f64,
    pub stretch_p99: f64,
}

/// Lays a triangle surface out in the unit square without overlap.
///
/// The result has the same points and the triangles in the same order; points on seams get one
/// vertex a chart. Seen from outside, triangles keep their winding when v is drawn downwards, so
/// no chart is mirrored. A triangle without area gets a place without area. A point that no
/// triangle uses gets a vertex at the origin. Any input is accepted; edges with more or fewer than
/// two triangles become seams.
///
/// # Panics
///
/// If a corner is not a point.
pub fn unwrap(points: &[Vec3], triangles: &[[u32; 3]]) -> SurfaceMesh {
    let positions: Vec<DVec3> = points.iter().map(|p| p.as_dvec3()).collect();
    let faces = Faces::new(&positions, triangles);
    let grown = charts::grow(&faces);
    let mut flats = lay_flat(&positions, triangles, &faces, grown);
    merge(&positions, triangles, &faces, &mut flats);
    pack::pack(&mut flats);
    assemble(points, triangles, &flats)
}

/// Flattens every chart, cutting those that overlap themselves until none does.
fn lay_flat(
    positions: &[DVec3],
    triangles: &[[u32; 3]],
    faces: &Faces,
    grown: Vec<Vec<u32>>,
) -> Vec<Flat> {
    let mut waiting = grown;
    waiting.reverse();
    let mut flats = Vec::new();
    while let Some(chart) = waiting.pop() {
        match flatten::flatten(positions, triangles, faces, &chart, f64::INFINITY) {
            Some(flat) => flats.push(flat),
            None => waiting.extend(charts::cut(faces, &chart)),
        }
    }
    flats
}

/// Joins neighbouring charts, smallest first, while the joint chart is sound and little stretched.
fn merge(positions: &[DVec3], triangles: &[[u32; 3]], faces: &Faces, flats: &mut Vec<Flat>) {
    let mut refused: Vec<(u32, u32)> = Vec::new();
    let whole: f64 = faces.areas.iter().sum();
    let mut work = 0;
    while let Some((a, b)) = charts::next_merge(faces, flats, &refused) {
        let key = (flats[a].triangles[0], flats[b].triangles[0]);
        let (small, large) = (
            flats[a].area.min(flats[b].area),
            flats[a].area.max(flats[b].area),
        );
        if small + large > JOINT_SHARE_MAX * whole && small > SMALL_SHARE * whole {
            refused.push(key);
            continue;
        }
        let mut joint = flats[a].triangles.clone();
        joint.extend(&flats[b].triangles);
        joint.sort_unstable();
        work += joint.len();
        if work > MERGE_WORK_MAX * triangles.len() {
            return;
        }
        match flatten::flatten(positions, triangles, faces, &joint, STRETCH_MAX) {
            Some(flat) => {
                flats[a] = flat;
                flats.remove(b);
                // What a pair was refused for may no longer hold for what it has become.
                refused.retain(|&(x, y)| x != key.0 && y != key.0 && x != key.1 && y != key.1);
            }
            None => refused.push(key),
        }
    }
}

/// The mesh with one vertex for each point in each chart, in the order the triangles name them.
fn assemble(points: &[Vec3], triangles: &[[u32; 3]], flats: &[Flat]) -> SurfaceMesh {
    let mut chart_of = vec![0_usize; triangles.len()];
    for (chart, flat) in flats.iter().enumerate() {
        for &triangle in &flat.triangles {
            chart_of[triangle as usize] = chart;
        }
    }
    let mut mesh = SurfaceMesh {
        points: points.to_vec(),
        ..SurfaceMesh::default()
    };
    let mut vertices: Vec<Vec<u32>> = flats
        .iter()
        .map(|flat| vec![u32::MAX; flat.points.len()])
        .collect();
    for (triangle, corners) in triangles.iter().enumerate() {
        let chart = chart_of[triangle];
        let flat = &flats[chart];
        mesh.triangles.push(corners.map(|point| {
            let local = flat.local(point);
            let vertex = &mut vertices[chart][local];
            if *vertex == u32::MAX {
                *vertex = mesh.point_of.len() as u32;
                mesh.point_of.push(point);
                let at = flat.places[local];
                mesh.uvs.push(Vec2::new(at.x as f32, (1.0 - at.y) as f32));
            }
            *vertex
        }));
    }
    let mut used = vec![false; points.len()];
    for &point in &mesh.point_of {
        used[point as usize] = true;
    }
    for (point, _) in used.iter().enumerate().filter(|(_, used)| !**used) {
        mesh.point_of.push(point as u32);
        mesh.uvs.push(Vec2::ZERO);
    }
    mesh
}

/// Looks at a UV map with `size_px` texels a side.
pub fn report(mesh: &SurfaceMesh, size_px: u32) -> UvReport {
    let places: Vec<DVec2> = mesh.uvs.iter().map(|uv| uv.as_dvec2()).collect();
    let (covered, twice) = flatten::coverage(&places, &mesh.triangles, f64::from(size_px));
    let mut stretches = Vec::new();
    let (mut area_3d, mut area_uv) = (0.0, 0.0);
    for triangle in 0..mesh.triangles.len() {
        let corners = mesh
            .point_triangle(triangle)
            .map(|p| mesh.points[p as usize].as_dvec3());
        let uvs = mesh.triangles[triangle].map(|v| places[v as usize]);
        area_3d += (corners[1] - corners[0])
            .cross(corners[2] - corners[0])
            .length();
        area_uv += (uvs[1] - uvs[0]).perp_dot(uvs[2] - uvs[0]).abs();
    }
    let density = (area_uv / area_3d.max(f64::MIN_POSITIVE)).sqrt();
    for triangle in 0..mesh.triangles.len() {
        let corners = mesh
            .point_triangle(triangle)
            .map(|p| mesh.points[p as usize].as_dvec3());
        let uvs = mesh.triangles[triangle].map(|v| places[v as usize] / density);
        if let Some((area, stretch)) = flatten::stretch(corners, uvs) {
            stretches.push((stretch, area));
        }
    }
    UvReport {
        charts: islands(mesh),
        covered_share: covered as f64 / f64::from(size_px).powi(2),
        overlap_share: twice as f64 / (covered as f64).max(1.0),
        stretch_p50: flatten::weighted_percentile(&mut stretches, 0.5),
        stretch_p99: flatten::weighted_percentile(&mut stretches, 0.99),
    }
}

/// Connected pieces of the triangles, joined where they share a vertex.
fn islands(mesh: &SurfaceMesh) -> usize {
    let mut parent: Vec<u32> = (0..mesh.point_of.len() as u32).collect();
    fn root(parent: &mut [u32], mut v: u32) -> u32 {
        while parent[v as usize] != v {
            parent[v as usize] = parent[parent[v as usize] as usize];
            v = parent[v as usize];
        }
        v
    }
    for t in &mesh.triangles {
        for k in 1..3 {
            let (a, b) = (root(&mut parent, t[0]), root(&mut parent, t[k]));
            parent[a.max(b) as usize] = a.min(b);
        }
    }
    let mut roots: Vec<u32> = mesh
        .triangles
        .iter()
        .map(|t| root(&mut parent, t[0]))
        .collect();
    roots.sort_unstable();
    roots.dedup();
    roots.len()
}
