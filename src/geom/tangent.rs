//! Normals, tangents and UV gradients of a deformed surface, gathered over fans of triangles.
//!
//! A point has one normal, made from all its triangles, so light shows no UV seam. A vertex has its
//! own tangent and UV gradients, made from its own triangles, since a seam changes the UV map.

use super::SurfaceMesh;
use glam::{DVec3, Vec2, Vec3};

/// Share of the summed squared edges below which a fan spans no area; the same in `common.wgsl`.
const MIN_AREA_SHARE: f32 = 1e-5;
/// Squared lengths below this are zero; the same in `common.wgsl`.
const MIN_LENGTH_SQUARED: f32 = 1e-30;
/// `sin²` of the angle between the UV axes below which they have no dual basis; the same in
/// `common.wgsl`.
const MIN_UV_SINE_SQUARED: f32 = 1e-4;
/// Twice a UV triangle's area over its squared edges, below which it gives no tangent.
const MIN_UV_AREA_SHARE: f32 = 1e-6;
/// How many times steeper than the surface's median at rest a UV gradient may become.
const GRADIENT_GROWTH_MAX: f32 = 64.0;

/// The triangles round every point and round every vertex, in the order the kernels gather them.
///
/// Lists are CSR: those of `i` stand at `start[i]..start[i + 1]`.
#[derive(Clone, Debug)]
pub struct Fans {
    /// Where each point's fan starts, and the end: `[points + 1]`.
    pub point_start: Vec<u32>,
    /// The other two corners of each triangle of a point, as points, counter-clockwise.
    pub point_corners: Vec<[u32; 2]>,
    /// Where each vertex's fan starts, and the end: `[vertices + 1]`.
    pub vertex_start: Vec<u32>,
    /// The other two corners of each triangle of a vertex, as points, counter-clockwise.
    pub vertex_corners: Vec<[u32; 2]>,
    /// With edges e1, e2 to those corners: `∂x/∂u = [0] e1 + [1] e2`, `∂x/∂v = [2] e1 + [3] e2`.
    /// Zeros where the triangle has no area in UV.
    pub uv_inverse: Vec<[f32; 4]>,
}

impl Fans {
    /// Sorts the triangles of `mesh` by point and by vertex.
    pub fn new(mesh: &SurfaceMesh) -> Self {
        let corners = || {
            mesh.triangles
                .iter()
                .flat_map(|&[a, b, c]| [[a, b, c], [b, c, a], [c, a, b]])
        };
        let point = |vertex: u32| mesh.point_of[vertex as usize];
        let others = |[_, b, c]: [u32; 3]| [point(b), point(c)];
        let (point_start, point_corners) = sorted_by_key(
            mesh.points.len(),
            corners().map(|corner| (point(corner[0]), others(corner))),
        );
        let (vertex_start, vertex_fans) = sorted_by_key(
            mesh.uvs.len(),
            corners().map(|corner| {
                let uvs = corner.map(|vertex| mesh.uvs[vertex as usize]);
                (corner[0], (others(corner), uv_inverse(uvs)))
            }),
        );
        let (vertex_corners, uv_inverse) = vertex_fans.into_iter().unzip();
        Self {
            point_start,
            point_corners,
            vertex_start,
            vertex_corners,
            uv_inverse,
        }
    }
}

/// Values of each key `0..keys` one after another, and where each key's begin (CSR).
fn sorted_by_key<T>(
    keys: usize,
    pairs: impl Iterator<Item = (u32, T)> + Clone,
) -> (Vec<u32>, Vec<T>) {
    let mut start = vec![0_u32; keys + 1];
    for (key, _) in pairs.clone() {
        start[key as usize + 1] += 1;
    }
    for key in 0..keys {
        start[key + 1] += start[key];
    }
    let mut pairs: Vec<_> = pairs.collect();
    pairs.sort_by_key(|&(key, _)| key);
    (start, pairs.into_iter().map(|(_, value)| value).collect())
}

fn uv_inverse([uv0, uv1, uv2]: [Vec2; 3]) -> [f32; 4] {
    let (d1, d2) = (uv1 - uv0, uv2 - uv0);
    let determinant = d1.perp_dot(d2);
    if determinant.abs() <= MIN_UV_AREA_SHARE * (d1.length_squared() + d2.length_squared()) {
        return [0.0; 4];
    }
    [d2.y, -d1.y, -d2.x, d1.x].map(|entry| entry / determinant)
}

/// Unit normal of each point, weighted by area; `rest_normals` where a fan spans no area.
///
/// `n = Σ e1 × e2 / |Σ e1 × e2|` over the triangles of the point. Positions are in metres.
///
/// Twin of `shaders/normals.wgsl`.
///
/// # Panics
///
/// If `points` or `rest_normals` do not have one entry a point.
pub fn point_normals(fans: &Fans, points: &[Vec3], rest_normals: &[Vec3]) -> Vec<Vec3> {
    assert_eq!(
        points.len() + 1,
        fans.point_start.len(),
        "one place a point"
    );
    assert_eq!(points.len(), rest_normals.len(), "one rest normal a point");
    (0..points.len())
        .map(|point| {
            let mut area = Vec3::ZERO;
            let mut edges = 0.0;
            for k in fans.point_start[point]..fans.point_start[point + 1] {
                let [a, b] = fans.point_corners[k as usize];
                let e1 = points[a as usize] - points[point];
                let e2 = points[b as usize] - points[point];
                area += e1.cross(e2);
                edges += e1.dot(e1) + e2.dot(e2);
            }
            let smallest = MIN_AREA_SHARE * edges;
            if area.dot(area) > (smallest * smallest).max(MIN_LENGTH_SQUARED) {
                area.normalize()
            } else {
                rest_normals[point]
            }
        })
        .collect()
}

/// Unit normals of `mesh` as it was made; +z where a point's triangles span no area.
pub fn rest_normals(mesh: &SurfaceMesh, fans: &Fans) -> Vec<Vec3> {
    point_normals(fans, &mesh.points, &vec![Vec3::Z; mesh.points.len()])
}

/// How the UV map lies in the tangent plane of one vertex.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TangentFrame {
    /// Unit vector towards growing u.
    pub tangent: Vec3,
    /// ±1: `handedness * normal.cross(tangent)` points towards growing v.
    pub handedness: f32,
    /// Gradients of u and v along the surface [1/m]: a step `d` in the tangent plane changes (u, v)
    /// by `(d · [0], d · [1])`. They are dual to `∂x/∂u` and `∂x/∂v` of the deformed surface, so
    /// they are neither unit nor orthogonal.
    pub uv_gradients: [Vec3; 2],
}

/// Tangent frame of each vertex, weighted by area, in the plane of its point's normal.
///
/// `Pu = Σ w ∂x/∂u / Σ w` with w the triangle's area, made tangential, and likewise Pv; then
/// `g_u = (Pv² Pu - Pu·Pv Pv) / (Pu² Pv² - (Pu·Pv)²)`. Where the two are parallel each gradient is
/// that of its own axis alone; where the map has no extent it is zero; none is longer than
/// `gradient_max_per_m`. A vertex without a direction of growing u takes any tangent.
///
/// Twin of `shaders/tangents.wgsl`.
///
/// # Panics
///
/// If `point_of` does not have one entry a vertex.
pub fn tangent_frames(
    fans: &Fans,
    point_of: &[u32],
    points: &[Vec3],
    normals: &[Vec3],
    gradient_max_per_m: f32,
) -> Vec<TangentFrame> {
    assert_eq!(
        point_of.len() + 1,
        fans.vertex_start.len(),
        "one point a vertex"
    );
    (0..point_of.len())
        .map(|vertex| {
            let point = point_of[vertex] as usize;
            let n = normals[point];
            let mut pu = Vec3::ZERO;
            let mut pv = Vec3::ZERO;
            let mut weight = 0.0;
            for k in fans.vertex_start[vertex]..fans.vertex_start[vertex + 1] {
                let [a, b] = fans.vertex_corners[k as usize];
                let e1 = points[a as usize] - points[point];
                let e2 = points[b as usize] - points[point];
                let m = fans.uv_inverse[k as usize];
                let area = e1.cross(e2).length();
                if m != [0.0; 4] {
                    pu += area * (m[0] * e1 + m[1] * e2);
                    pv += area * (m[2] * e1 + m[3] * e2);
                    weight += area;
                }
            }
            if weight > 0.0 {
                pu /= weight;
                pv /= weight;
            }
            pu -= n * n.dot(pu);
            pv -= n * n.dot(pv);
            frame_of_axes(n, pu, pv, gradient_max_per_m)
        })
        .collect()
}

fn frame_of_axes(n: Vec3, pu: Vec3, pv: Vec3, gradient_max_per_m: f32) -> TangentFrame {
    let (uu, uv, vv) = (pu.dot(pu), pu.dot(pv), pv.dot(pv));
    let determinant = uu * vv - uv * uv;
    let [gu, gv] = if determinant > MIN_UV_SINE_SQUARED * uu * vv {
        [
            (vv * pu - uv * pv) / determinant,
            (uu * pv - uv * pu) / determinant,
        ]
    } else {
        [lone_gradient(pu), lone_gradient(pv)]
    };
    TangentFrame {
        tangent: if uu > MIN_LENGTH_SQUARED {
            pu.normalize()
        } else {
            any_perpendicular(n)
        },
        handedness: if n.cross(pu).dot(pv) < 0.0 { -1.0 } else { 1.0 },
        uv_gradients: [
            bounded(gu, gradient_max_per_m),
            bounded(gv, gradient_max_per_m),
        ],
    }
}

fn lone_gradient(axis: Vec3) -> Vec3 {
    let squared = axis.dot(axis);
    if squared > MIN_LENGTH_SQUARED {
        axis / squared
    } else {
        Vec3::ZERO
    }
}

fn bounded(v: Vec3, length_max: f32) -> Vec3 {
    let squared = v.dot(v);
    if squared > length_max * length_max {
        v * (length_max / squared.sqrt())
    } else {
        v
    }
}

/// A unit vector across the unit vector `n`: the axis least along `n`, made perpendicular.
pub fn any_perpendicular(n: Vec3) -> Vec3 {
    let along = n.abs();
    let axis = if along.x <= along.y && along.x <= along.z {
        Vec3::X
    } else if along.y <= along.z {
        Vec3::Y
    } else {
        Vec3::Z
    };
    (axis - n * n.dot(axis)).normalize()
}

/// The longest UV gradient a deformed surface may show [1/m]: 64 times the median at rest.
///
/// A fan that is squashed to nothing would otherwise send gradients, and with them the distance
/// that a texture is shifted, to infinity.
pub fn gradient_max_per_m(mesh: &SurfaceMesh, fans: &Fans, rest_normals: &[Vec3]) -> f32 {
    let frames = tangent_frames(fans, &mesh.point_of, &mesh.points, rest_normals, f32::MAX);
    let mut lengths: Vec<f32> = frames
        .iter()
        .flat_map(|frame| frame.uv_gradients)
        .map(Vec3::length)
        .filter(|&length| length > 0.0 && length.is_finite())
        .collect();
    lengths.sort_by(f32::total_cmp);
    lengths
        .get(lengths.len() / 2)
        .map_or(0.0, |median| GRADIENT_GROWTH_MAX * median)
}

/// Gradients of u along tangent and bitangent, then of v [1/m]: the same however the frame is turned.
pub fn gradients_in_frame(frame: &TangentFrame, normal: Vec3) -> [f32; 4] {
    let bitangent = frame.handedness * normal.cross(frame.tangent);
    let [u, v] = frame.uv_gradients;
    [
        u.dot(frame.tangent),
        u.dot(bitangent),
        v.dot(frame.tangent),
        v.dot(bitangent),
    ]
}

/// [`gradients_in_frame`] of every vertex of `mesh` at rest.
pub fn rest_gradients(mesh: &SurfaceMesh) -> Vec<[f32; 4]> {
    let fans = Fans::new(mesh);
    let normals = rest_normals(mesh, &fans);
    tangent_frames(&fans, &mesh.point_of, &mesh.points, &normals, f32::MAX)
        .iter()
        .zip(&mesh.point_of)
        .map(|(frame, &point)| gradients_in_frame(frame, normals[point as usize]))
        .collect()
}

/// How thick a layer is now, as a share of how thick it is at rest: the area at rest over that now, from gradients
/// as [`gradients_in_frame`] gives them. From a quarter to four; 1 where the texture map has no area.
///
/// Twin of `thickness_of` in `shaders/geometry.wgsl`.
pub fn thickness_share(now: [f32; 4], rest: [f32; 4]) -> f32 {
    let area = |[ut, ub, vt, vb]: [f32; 4]| (ut * vb - ub * vt).abs();
    if area(rest) > 1e-12 {
        (area(now) / area(rest)).clamp(0.25, 4.0)
    } else {
        1.0
    }
}

/// Normals in f64, triangle by triangle: the oracle. `None` where a point has no area at all.
pub fn exact_normals(mesh: &SurfaceMesh, points: &[Vec3]) -> Vec<Option<DVec3>> {
    let mut areas = vec![DVec3::ZERO; points.len()];
    for triangle in mesh.point_triangles() {
        let [a, b, c] = triangle.map(|point| points[point as usize].as_dvec3());
        let area = (b - a).cross(c - a);
        for point in triangle {
            areas[point as usize] += area;
        }
    }
    areas.into_iter().map(DVec3::try_normalize).collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::surfaces::{sphere, wavy};
    use glam::Mat3;
    use proptest::prelude::*;

    /// Largest angle between normals and radii from 22.5 degrees north to as far south.
    fn worst_sphere_normal(meridians: usize) -> f32 {
        let mesh = sphere(0.05, meridians, meridians / 2 - 1);
        let normals = rest_normals(&mesh, &Fans::new(&mesh));
        normals
            .iter()
            .zip(&mesh.points)
            .filter(|(_, point)| point.y.abs() < 0.0201)
            .map(|(normal, point)| normal.cross(point.normalize()).length())
            .fold(0.0, f32::max)
    }

    #[test]
    fn normals_of_a_sphere_are_radial_and_their_error_falls_fourfold_on_a_mesh_twice_as_fine() {
        let (coarse, fine) = (worst_sphere_normal(32), worst_sphere_normal(64));
        assert!(coarse < 0.01, "{coarse} radians");
        assert!(
            (coarse / fine - 4.0).abs() < 0.5,
            "{coarse} falls to {fine}"
        );
    }

    #[test]
    fn each_triangle_is_in_the_fans_of_its_three_corners() {
        let mesh = sphere(0.05, 12, 5);
        let fans = Fans::new(&mesh);
        assert_eq!(fans.point_corners.len(), 3 * mesh.triangles.len());
        assert_eq!(fans.vertex_corners.len(), 3 * mesh.triangles.len());
        let poles = [0, mesh.points.len() - 1];
        for pole in poles {
            assert_eq!(fans.point_start[pole + 1] - fans.point_start[pole], 12);
        }
        assert!(fans.point_start.is_sorted() && fans.vertex_start.is_sorted());
    }

    #[test]
    fn vertices_of_a_seam_share_a_point_and_keep_their_own_gradients() {
        let mut mesh = sphere(0.05, 12, 5);
        // The last column of the map is thirteen times as wide as the others.
        let on_last_meridian = mesh.uvs.iter_mut().filter(|uv| uv.x == 1.0);
        on_last_meridian.for_each(|uv| uv.x = 2.0);
        let fans = Fans::new(&mesh);
        let normals = rest_normals(&mesh, &fans);
        let frames = tangent_frames(&fans, &mesh.point_of, &mesh.points, &normals, f32::MAX);
        // Vertices of the third parallel.
        let (first, last) = (3 * 13, 3 * 13 + 12);
        assert_eq!(mesh.point_of[first], mesh.point_of[last]);
        let steepness = |vertex: usize| frames[vertex].uv_gradients[0].length();
        let ratio = steepness(last) / steepness(first);
        assert!((ratio - 13.0).abs() < 0.01, "{ratio}");
    }

    #[test]
    fn gradients_of_a_squashed_fan_grow_to_the_limit_and_no_further() {
        let mesh = wavy(9);
        let fans = Fans::new(&mesh);
        let rest = rest_normals(&mesh, &fans);
        let limit = gradient_max_per_m(&mesh, &fans, &rest);
        for squash in [1.0, 0.1, 1e-3, 1e-6, 1e-12, 0.0] {
            let points: Vec<Vec3> = mesh.points.iter().map(|&p| p * squash).collect();
            let normals = point_normals(&fans, &points, &rest);
            for frame in tangent_frames(&fans, &mesh.point_of, &points, &normals, limit) {
                let longest = frame.uv_gradients.map(Vec3::length);
                assert!(
                    longest.into_iter().all(|l| l <= 1.0001 * limit),
                    "{longest:?}"
                );
            }
        }
    }

    #[test]
    fn layers_of_stretched_tissue_keep_their_volume() {
        let mesh = wavy(9);
        let fans = Fans::new(&mesh);
        let rest = rest_gradients(&mesh);
        for scale in [1.0, 1.5, 0.8] {
            let points: Vec<Vec3> = mesh.points.iter().map(|&p| scale * p).collect();
            let normals = rest_normals(&mesh, &fans);
            let frames = tangent_frames(&fans, &mesh.point_of, &points, &normals, f32::MAX);
            for (vertex, frame) in frames.iter().enumerate() {
                let normal = normals[mesh.point_of[vertex] as usize];
                let now = gradients_in_frame(frame, normal);
                let volume = thickness_share(now, rest[vertex]) * scale * scale;
                // Rounding of edges.
                assert!((volume - 1.0).abs() < 1e-3, "{volume}");
            }
        }
        assert_eq!(thickness_share([9.0; 4], [0.0; 4]), 1.0);
        assert_eq!(thickness_share([1e9, 0.0, 0.0, 1e9], rest[0]), 4.0);
    }

    #[test]
    fn any_perpendicular_is_unit_and_across_for_every_axis() {
        for n in [Vec3::X, Vec3::Y, Vec3::NEG_Z, Vec3::ONE.normalize()] {
            let t = any_perpendicular(n);
            assert!(t.dot(n).abs() < 1e-6 && (t.length() - 1.0).abs() < 1e-6);
        }
    }

    proptest! {
        #[test]
        fn gradients_are_dual_to_the_axes_of_any_affine_map(
            entries in prop::array::uniform9(-0.5_f32..0.5),
        ) {
            let map = Mat3::from_cols_array(&entries) + Mat3::IDENTITY;
            prop_assume!(map.determinant() > 0.2);
            let mut mesh = wavy(5);
            let flat = |uv: &Vec2| 0.1 * Vec3::new(uv.x, 0.0, uv.y);
            mesh.points = mesh.uvs.iter().map(|uv| map * flat(uv)).collect();
            let fans = Fans::new(&mesh);
            let normals = rest_normals(&mesh, &fans);
            let frames =
                tangent_frames(&fans, &mesh.point_of, &mesh.points, &normals, f32::MAX);
            let [pu, pv] = [map * Vec3::X * 0.1, map * Vec3::Z * 0.1];
            for frame in frames {
                let [gu, gv] = frame.uv_gradients;
                // Rounding of edges a few millimetres long: 1e-5 seen.
                for (product, exact) in
                    [(gu.dot(pu), 1.0), (gu.dot(pv), 0.0), (gv.dot(pu), 0.0), (gv.dot(pv), 1.0)]
                {
                    prop_assert!((product - exact).abs() < 1e-3, "{product} for {exact}");
                }
            }
        }
    }
}
