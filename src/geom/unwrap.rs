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

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    /// Texel centres that lie inside two triangles, counted another way than [`report`] does.
    fn covered_twice(mesh: &SurfaceMesh, size_px: i64) -> usize {
        let mut count = vec![0_u32; (size_px * size_px) as usize];
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|v| mesh.uvs[v as usize].as_dvec2() * size_px as f64);
            let whole = (b - a).perp_dot(c - a);
            let (low, high) = (a.min(b).min(c).floor(), a.max(b).max(c).ceil());
            for y in (low.y as i64).max(0)..(high.y as i64).min(size_px) {
                for x in (low.x as i64).max(0)..(high.x as i64).min(size_px) {
                    let p = DVec2::new(x as f64 + 0.5, y as f64 + 0.5);
                    let weights = [
                        (b - p).perp_dot(c - p),
                        (c - p).perp_dot(a - p),
                        (a - p).perp_dot(b - p),
                    ];
                    // Centres this near to an edge belong to either side.
                    if weights.iter().all(|w| w / whole > 1e-3) {
                        count[(y * size_px + x) as usize] += 1;
                    }
                }
            }
        }
        count.iter().filter(|&&n| n > 1).count()
    }

    /// A ball of `rings` rings with its poles stretched out, or squeezed in, by `poles`.
    fn spindle(rings: u32, poles: f32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let sides = 2 * rings;
        let mut points = vec![Vec3::Y * poles, -Vec3::Y * poles];
        let mut triangles = Vec::new();
        for ring in 1..rings {
            let polar = std::f32::consts::PI * ring as f32 / rings as f32;
            for side in 0..sides {
                let turn = std::f32::consts::TAU * side as f32 / sides as f32;
                let (s, c) = turn.sin_cos();
                points.push(Vec3::new(
                    polar.sin() * s,
                    poles * polar.cos(),
                    polar.sin() * c,
                ));
            }
        }
        let at = |ring: u32, side: u32| 2 + (ring - 1) * sides + side % sides;
        for side in 0..sides {
            triangles.push([0, at(1, side), at(1, side + 1)]);
            triangles.push([1, at(rings - 1, side + 1), at(rings - 1, side)]);
            for ring in 1..rings - 1 {
                let [a, b] = [at(ring, side), at(ring, side + 1)];
                let [c, d] = [at(ring + 1, side), at(ring + 1, side + 1)];
                triangles.extend([[a, c, d], [a, d, b]]);
            }
        }
        (points, triangles)
    }

    /// Points and triangles of a file in the shared data; `None`, said aloud, without it.
    fn shared(name: &str) -> Option<SurfaceMesh> {
        let root = std::env::var("PALPATE_SHARED")
            .unwrap_or_else(|_| concat!(env!("CARGO_MANIFEST_DIR"), "/../shared").to_string());
        let path = format!("{root}/data/organs/{name}");
        let Ok((models, _)) = tobj::load_obj(&path, &tobj::GPU_LOAD_OPTIONS) else {
            println!("{path} is absent: not tested");
            return None;
        };
        let mesh = &models[0].mesh;
        let vertices: Vec<Vec3> = mesh
            .positions
            .chunks_exact(3)
            .map(Vec3::from_slice)
            .collect();
        // Vertices at the same place are one point.
        let key = |v: usize| vertices[v].to_array().map(f32::to_bits);
        let mut order: Vec<usize> = (0..vertices.len()).collect();
        order.sort_by_key(|&v| key(v));
        let mut welded = SurfaceMesh {
            point_of: vec![0; vertices.len()],
            uvs: mesh
                .texcoords
                .chunks_exact(2)
                .map(Vec2::from_slice)
                .collect(),
            triangles: mesh
                .indices
                .chunks_exact(3)
                .map(|t| [t[0], t[1], t[2]])
                .collect(),
            ..SurfaceMesh::default()
        };
        for (k, &v) in order.iter().enumerate() {
            if k == 0 || key(order[k - 1]) != key(v) {
                welded.points.push(vertices[v]);
            }
            welded.point_of[v] = welded.points.len() as u32 - 1;
        }
        Some(welded)
    }

    #[test]
    fn liver_unwraps_into_few_charts_without_overlap() {
        let Some(liver) = shared("liver-smooth.obj") else {
            return;
        };
        let mesh = unwrap(&liver.points, &liver.point_triangles());
        assert_eq!(covered_twice(&mesh, 1024), 0);
        let report = report(&mesh, 1024);
        // Measured: 4 charts, 0.53 covered, 1.33 stretched.
        assert!(report.charts <= 8, "{report:?}");
        assert!(report.covered_share > 0.45, "{report:?}");
        assert!(report.stretch_p99 < 1.5, "{report:?}");
        assert_eq!(report.overlap_share, 0.0);
    }

    #[test]
    fn both_overlap_checks_reject_a_map_in_which_all_triangles_lie_on_each_other() {
        let Some(mesh) = shared("liver-smoothUV.obj") else {
            return;
        };
        assert!(covered_twice(&mesh, 256) > 256 * 256 / 4);
        assert!(report(&mesh, 256).overlap_share > 0.9);
    }

    #[test]
    fn overlap_checks_reject_a_chart_pushed_onto_another() {
        let (points, triangles) = spindle(12, 1.0);
        let mut mesh = unwrap(&points, &triangles);
        assert_eq!(covered_twice(&mesh, 512), 0);
        let middle = mesh.uvs.iter().sum::<Vec2>() / mesh.uvs.len() as f32;
        for corner in mesh.triangles[0] {
            let uv = &mut mesh.uvs[corner as usize];
            *uv = uv.lerp(middle, 0.9);
        }
        assert!(covered_twice(&mesh, 512) > 0);
        assert!(report(&mesh, 512).overlap_share > 0.0);
    }

    #[test]
    fn charts_keep_their_distance() {
        let (points, triangles) = spindle(16, 1.6);
        let mesh = unwrap(&points, &triangles);
        const SIZE: i32 = 1024;
        // The island of each texel, painted triangle by triangle.
        let mut parent: Vec<u32> = (0..mesh.uvs.len() as u32).collect();
        for _ in 0..mesh.triangles.len() {
            let before = parent.clone();
            for t in &mesh.triangles {
                let least = t.map(|v| parent[v as usize]).into_iter().min();
                for v in t {
                    parent[*v as usize] = least.expect("three corners");
                }
            }
            if parent == before {
                break;
            }
        }
        let mut island = vec![u32::MAX; (SIZE * SIZE) as usize];
        for t in &mesh.triangles {
            let p = t.map(|v| mesh.uvs[v as usize] * SIZE as f32);
            for step in 0..=900 {
                let (i, j) = (step / 30, step % 31);
                let (u, v) = (i as f32 / 30.0, j as f32 / 30.0);
                if u + v <= 1.0 {
                    let at = p[0] + (p[1] - p[0]) * u + (p[2] - p[0]) * v;
                    island[(at.y as i32 * SIZE + at.x as i32) as usize] = parent[t[0] as usize];
                }
            }
        }
        for y in 5..SIZE - 5 {
            for x in 5..SIZE - 5 {
                let here = island[(y * SIZE + x) as usize];
                for (dx, dy) in [(5, 0), (0, 5), (3, 3), (3, -3), (2, 0), (0, 2)] {
                    let there = island[((y + dy) * SIZE + x + dx) as usize];
                    let apart = here == there || here == u32::MAX || there == u32::MAX;
                    assert!(apart, "two charts meet near {x} {y}");
                }
            }
        }
    }

    #[test]
    fn unwrapping_keeps_points_triangles_and_winding() {
        let (points, triangles) = spindle(10, 0.5);
        let mesh = unwrap(&points, &triangles);
        assert_eq!(mesh.points, points);
        assert_eq!(mesh.point_triangles(), triangles);
        for t in &mesh.triangles {
            let [a, b, c] = t.map(|v| mesh.uvs[v as usize]);
            assert!((b - a).perp_dot(c - a) < 0.0, "v grows downwards");
        }
        assert_eq!(mesh, unwrap(&points, &triangles), "the same bits again");
    }

    #[test]
    fn hard_cases_have_a_map() {
        let (mut points, mut triangles) = spindle(6, 1.0);
        // A second component, triangles without area, an edge of three triangles, a lone point.
        let first = points.len() as u32;
        points.extend([Vec3::X * 3.0, Vec3::X * 4.0, Vec3::X * 3.0 + Vec3::Y]);
        triangles.push([first, first + 1, first + 2]);
        triangles.push([first, first, first + 1]);
        triangles.push([first, first + 1, first + 1]);
        triangles.push([2, 3, first]);
        points.push(Vec3::splat(9.0));
        let mesh = unwrap(&points, &triangles);
        assert_eq!(mesh.point_triangles(), triangles);
        assert!(
            mesh.uvs
                .iter()
                .all(|uv| uv.min_element() >= 0.0 && uv.max_element() <= 1.0)
        );
        assert_eq!(covered_twice(&mesh, 512), 0);
        assert_eq!(mesh.first_vertex_of_point().len(), points.len());

        assert_eq!(unwrap(&[], &[]).triangles.len(), 0);
        let spot = unwrap(&[Vec3::ONE; 3], &[[0, 1, 2]]);
        assert!(spot.uvs.iter().all(|uv| uv.is_finite()));
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(24))]
        #[test]
        fn no_triangle_soup_overlaps_itself_or_leaves_the_square(
            places in prop::collection::vec((-1.0_f32..1.0, -1.0_f32..1.0, -1.0_f32..1.0), 4..12),
            corners in prop::collection::vec((0_u32..4, 0_u32..4, 0_u32..4), 1..24),
        ) {
            let points: Vec<Vec3> = places.into_iter().map(Vec3::from).collect();
            let triangles: Vec<[u32; 3]> = corners.into_iter().map(|(a, b, c)| [a, b, c]).collect();
            let mesh = unwrap(&points, &triangles);
            prop_assert_eq!(covered_twice(&mesh, 256), 0);
            prop_assert!(mesh.uvs.iter().all(|uv| uv.min_element() >= 0.0 && uv.max_element() <= 1.0));
        }
    }
}
