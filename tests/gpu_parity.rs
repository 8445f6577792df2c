//! Every kernel of the light path against its CPU twin and its f64 oracle, where it works and where
//! it fails, and each check against a sabotaged kernel.
//!
//! A missing adapter is a failure, not a skip: a software one (mesa-vulkan-drivers) will do.

#[allow(dead_code)] // Other tests use the rest.
#[path = "support/gpu_body.rs"]
mod gpu_body;
#[path = "support/surfaces.rs"]
mod surfaces;

use glam::{DVec3, Vec2, Vec3, Vec4};
use gpu_body::{GpuBody, RADIUS_M, gpu, percentile, sabotaged, surfaces, worst};
use palpate::geom::SurfaceMesh;
use palpate::geom::moments::{PatchSums, RunningPlanes};
use palpate::geom::plane::{
    LightPathMethod, Plane, carried_plane, exact_plane, fit_planes, stale_plane,
};
use palpate::geom::tangent::{TangentFrame, exact_normals, gradient_max_per_m, tangent_frames};
use palpate::gpu::{Gpu, join, read_buffer};
use palpate::passes::light_path::RefitCounts;
use palpate::passes::plane_carried::{PlaneCarried, planes_in_frames};
use palpate::passes::plane_full::PlaneFull;
use palpate::passes::plane_incremental::PlaneIncremental;
use palpate::passes::plane_stale::PlaneStale;
use palpate::passes::tangents::Tangents;
use surfaces::{deformed, sphere, wavy};

/// Kernel and twin differ by the last bits of dot products, normalize and fused multiply-adds: 3e-7
/// was the worst seen of a unit vector on llvmpipe; the rest is room for other drivers.
const TOLERANCE: f32 = 1e-5;
/// A plane's normal turns by rounding over the gap between two eigenvalues: 2e-6 was the worst seen.
const PLANE_TOLERANCE: f32 = 1e-4;
/// What is asked of normals, tangents and planes against f64, at the 99.9th percentile.
const ORACLE_DEGREES: f64 = 0.05;

fn twin_frames(body: &GpuBody, points: &[Vec3]) -> Vec<TangentFrame> {
    let limit = gradient_max_per_m(&body.mesh, &body.fans, &body.rest_normals);
    let normals = body.twin_normals(points);
    tangent_frames(&body.fans, &body.mesh.point_of, points, &normals, limit)
}

/// Angle [degrees] and offset difference, as a share of the radius, of each plane against the
/// f64 fit of the same points.
fn plane_errors(
    body: &GpuBody,
    points: &[Vec3],
    normals: &[Vec4],
    planes: &[Vec4],
) -> Vec<(f64, f64)> {
    (0..points.len())
        .filter_map(|point| {
            let members = body.patches.members(point).map(|m| points[m].as_dvec3());
            let members: Vec<DVec3> = members.collect();
            let (normal, offset) = exact_plane(
                members.into_iter(),
                points[point].as_dvec3(),
                normals[point].truncate().as_dvec3(),
            )?;
            let plane = planes[point].as_dvec4();
            Some((
                degrees_between(plane.truncate(), normal),
                (plane.w - offset).abs() / f64::from(RADIUS_M),
            ))
        })
        .collect()
}

fn degrees_between(a: DVec3, b: DVec3) -> f64 {
    a.cross(b).length().atan2(a.dot(b)).to_degrees()
}

fn read(gpu: &Gpu, buffer: &wgpu::Buffer) -> Vec<Vec4> {
    read_buffer(gpu, buffer).expect("memory can be read back")
}

// Normals.

fn worst_normal(gpu: &Gpu, mesh: SurfaceMesh, points: &[Vec3], source: &str) -> f32 {
    let sources = [source.to_owned(), join(Tangents::TANGENTS_WGSL)];
    let body = GpuBody::with_sources(gpu, mesh, &sources);
    body.frame(gpu, points, |_, _| {});
    let normals = read(gpu, &body.tangents.normals);
    let twin = body.twin_normals(points);
    worst(
        normals
            .iter()
            .zip(twin)
            .map(|(n, t)| n.truncate().distance(t)),
    )
}

#[test]
fn normals_match_the_cpu_twin() {
    let gpu = gpu();
    for (name, mesh) in surfaces(&[2, 3, 17, 64, 130]) {
        let points = deformed(&mesh.points);
        let worst = worst_normal(&gpu, mesh, &points, &join(Tangents::NORMALS_WGSL));
        assert!(worst < TOLERANCE, "normals of {name} differ by {worst}");
    }
}

#[test]
fn normal_parity_check_rejects_a_flipped_normal() {
    let kernel = sabotaged(
        &join(Tangents::NORMALS_WGSL),
        "cross(e1, e2)",
        "cross(e2, e1)",
    );
    let mesh = wavy(17);
    let points = deformed(&mesh.points);
    let worst = worst_normal(&gpu(), mesh, &points, &kernel);
    assert!(worst > 0.1, "a flipped normal went unnoticed: {worst}");
}

#[test]
fn normals_of_a_deformed_surface_are_those_of_f64() {
    let gpu = gpu();
    let body = GpuBody::new(&gpu, wavy(64));
    let points = deformed(&body.mesh.points);
    body.frame(&gpu, &points, |_, _| {});
    let normals = read(&gpu, &body.tangents.normals);
    let errors = normals
        .iter()
        .zip(exact_normals(&body.mesh, &points))
        .map(|(n, exact)| degrees_between(n.truncate().as_dvec3(), exact.expect("has area")));
    let error = percentile(errors.collect(), 0.999);
    assert!(error <= ORACLE_DEGREES, "{error} degrees");
}

#[test]
fn collapsed_triangles_keep_their_rest_normal() {
    let gpu = gpu();
    let body = GpuBody::new(&gpu, wavy(9));
    for points in [
        vec![Vec3::ZERO; 81],
        (0..81).map(|i| Vec3::X * 0.001 * i as f32).collect(),
    ] {
        body.frame(&gpu, &points, |_, _| {});
        let normals = read(&gpu, &body.tangents.normals);
        let rest = body.rest_normals.iter();
        let worst = worst(
            normals
                .iter()
                .zip(rest)
                .map(|(n, r)| n.truncate().distance(*r)),
        );
        assert!(worst < TOLERANCE, "differ by {worst}");
    }
}

// Tangents and UV gradients.

/// Worst difference of tangent or handedness, and of gradients as a share of the longest.
fn worst_frame(gpu: &Gpu, body: &GpuBody, points: &[Vec3]) -> (f32, f32) {
    body.frame(gpu, points, |_, _| {});
    let tangents = read(gpu, &body.tangents.tangents);
    let gradients = read(gpu, &body.tangents.uv_gradients);
    let twin = twin_frames(body, points);
    let longest = twin
        .iter()
        .flat_map(|frame| frame.uv_gradients)
        .map(Vec3::length)
        .fold(f32::MIN_POSITIVE, f32::max);
    let tangent = worst(
        tangents
            .iter()
            .zip(&twin)
            .map(|(t, frame)| t.distance(frame.tangent.extend(frame.handedness))),
    );
    let gradient = worst(gradients.chunks(2).zip(&twin).flat_map(|(pair, frame)| {
        [0, 1].map(|axis| pair[axis].truncate().distance(frame.uv_gradients[axis]) / longest)
    }));
    (tangent, gradient)
}

#[test]
fn tangent_frames_match_the_cpu_twin() {
    let gpu = gpu();
    for (name, mesh) in surfaces(&[2, 3, 17, 64, 130]) {
        let body = GpuBody::new(&gpu, mesh);
        let points = deformed(&body.mesh.points);
        let (tangent, gradient) = worst_frame(&gpu, &body, &points);
        assert!(
            tangent < TOLERANCE,
            "tangents of {name} differ by {tangent}"
        );
        assert!(
            gradient < TOLERANCE,
            "gradients of {name} differ by {gradient}"
        );
    }
}

#[test]
fn tangent_parity_check_rejects_swapped_axes_and_unit_frames() {
    let gpu = gpu();
    let mesh = wavy(17);
    let points = deformed(&mesh.points);
    for (from, to) in [
        ("normalize(pu)", "normalize(pv)"),
        ("(vv * pu - uv * pv) / determinant", "normalize(pu)"),
    ] {
        let kernel = sabotaged(&join(Tangents::TANGENTS_WGSL), from, to);
        let sources = [join(Tangents::NORMALS_WGSL), kernel];
        let body = GpuBody::with_sources(&gpu, mesh.clone(), &sources);
        let (tangent, gradient) = worst_frame(&gpu, &body, &points);
        assert!(tangent.max(gradient) > 0.1, "{to} went unnoticed");
    }
}

#[test]
fn uv_gradients_follow_a_stretched_plane_exactly() {
    // x = u a + v b with neither unit nor orthogonal axes: the dual basis in closed form.
    let (a, b) = (Vec3::new(0.3, 0.02, 0.0), Vec3::new(0.05, 0.0, 0.08));
    let gpu = gpu();
    let mut mesh = wavy(17);
    mesh.points = mesh
        .uvs
        .iter()
        .map(|uv| 0.1 * Vec3::new(uv.x, 0.0, uv.y))
        .collect();
    let points: Vec<Vec3> = mesh.uvs.iter().map(|uv| uv.x * a + uv.y * b).collect();
    let body = GpuBody::new(&gpu, mesh);
    body.frame(&gpu, &points, |_, _| {});
    let gradients = read(&gpu, &body.tangents.uv_gradients);
    let normal = a.cross(b);
    let dual = [b.cross(normal), normal.cross(a)].map(|g| g / normal.length_squared());
    let worst = worst(gradients.chunks(2).flat_map(|pair| {
        [0, 1].map(|axis| {
            let [exact, sign] = [dual[axis], dual[axis].dot([a, b][axis]) * Vec3::ONE];
            (pair[axis].truncate() - exact / sign.x).length() / exact.length()
        })
    }));
    // f32 rounding of the edges, 1e-7 of 0.3 m over edges of 5 mm.
    assert!(worst < 2e-5, "relative difference {worst}");
}

#[test]
fn uv_gradients_of_a_deformed_surface_are_those_of_f64() {
    let gpu = gpu();
    let body = GpuBody::new(&gpu, sphere(0.04, 60, 41));
    let points = deformed(&body.mesh.points);
    body.frame(&gpu, &points, |_, _| {});
    let tangents = read(&gpu, &body.tangents.tangents);
    let gradients = read(&gpu, &body.tangents.uv_gradients);
    let exact = exact_uv_axes(&body.mesh, &points);
    let mut angles = Vec::new();
    let mut products = Vec::new();
    for vertex in 0..exact.len() {
        let [pu, pv] = exact[vertex];
        if pu.cross(pv).length() < 0.05 * pu.length() * pv.length() {
            continue; // the poles, where the map has no dual basis
        }
        angles.push(degrees_between(tangents[vertex].truncate().as_dvec3(), pu));
        let [gu, gv] = [0, 1].map(|axis| gradients[2 * vertex + axis].truncate().as_dvec3());
        // What makes (PM · g_u, PM · g_v) a step in UV: g_u · Pu = 1, g_u · Pv = 0, and so on.
        products.push((gu.dot(pu) - 1.0).abs().max((gv.dot(pv) - 1.0).abs()));
        products.push((gu.dot(pv) / pv.length() * pu.length()).abs());
        products.push((gv.dot(pu) / pu.length() * pv.length()).abs());
    }
    let angle = percentile(angles, 0.999);
    assert!(angle <= ORACLE_DEGREES, "tangents off by {angle} degrees");
    let product = percentile(products, 0.999);
    // 0.05 degrees is 9e-4 of a radian.
    assert!(product <= 9e-4, "not dual by {product}");
}

/// Pu and Pv of each vertex in f64, triangle by triangle, in the plane of the exact normal.
fn exact_uv_axes(mesh: &SurfaceMesh, points: &[Vec3]) -> Vec<[DVec3; 2]> {
    let mut sums = vec![([DVec3::ZERO; 2], 0.0); mesh.uvs.len()];
    for triangle in &mesh.triangles {
        let [x0, x1, x2] = triangle.map(|v| points[mesh.point_of[v as usize] as usize].as_dvec3());
        let [w0, w1, w2] = triangle.map(|v| mesh.uvs[v as usize].as_dvec2());
        let jacobian = glam::DMat2::from_cols(w1 - w0, w2 - w0);
        if jacobian.determinant().abs() < 1e-9 {
            continue;
        }
        let inverse = jacobian.inverse();
        let area = (x1 - x0).cross(x2 - x0).length();
        for &vertex in triangle {
            let (axes, weight) = &mut sums[vertex as usize];
            for (axis, sum) in axes.iter_mut().enumerate() {
                let column = inverse.col(axis);
                *sum += area * (column.x * (x1 - x0) + column.y * (x2 - x0));
            }
            *weight += area;
        }
    }
    let normals = exact_normals(mesh, points);
    (0..mesh.uvs.len())
        .map(|vertex| {
            let n = normals[mesh.point_of[vertex] as usize].expect("has area");
            let (axes, weight) = sums[vertex];
            axes.map(|axis| axis / weight - n * n.dot(axis / weight))
        })
        .collect()
}

#[test]
fn degenerate_uvs_and_squashed_fans_give_finite_bounded_gradients() {
    let gpu = gpu();
    let mut flat_uvs = wavy(9);
    flat_uvs.uvs.fill(Vec2::splat(0.5));
    let mut line_uvs = wavy(9);
    line_uvs.uvs.iter_mut().for_each(|uv| uv.y = 2.0 * uv.x);
    for (name, mesh, squash) in [
        ("UVs at one place", flat_uvs, Vec3::ONE),
        ("UVs on a line", line_uvs, Vec3::ONE),
        (
            "a fan squashed to a line",
            wavy(9),
            Vec3::new(1.0, 0.0, 0.0),
        ),
        ("a fan squashed to a point", wavy(9), Vec3::ZERO),
        (
            "a fan squashed nearly to a point",
            wavy(9),
            Vec3::splat(1e-9),
        ),
    ] {
        let points: Vec<Vec3> = mesh.points.iter().map(|&p| p * squash).collect();
        let body = GpuBody::new(&gpu, mesh);
        let limit = gradient_max_per_m(&body.mesh, &body.fans, &body.rest_normals);
        let (tangent, gradient) = worst_frame(&gpu, &body, &points);
        assert!(tangent < TOLERANCE, "{name}: tangents differ by {tangent}");
        assert!(
            gradient < TOLERANCE,
            "{name}: gradients differ by {gradient}"
        );
        let longest = worst(
            read(&gpu, &body.tangents.uv_gradients)
                .iter()
                .map(|g| g.length()),
        );
        assert!(longest <= 1.001 * limit, "{name}: {longest} of {limit}");
        let unit = worst(
            read(&gpu, &body.tangents.tangents)
                .iter()
                .map(|t| (t.truncate().length() - 1.0).abs()),
        );
        assert!(unit < TOLERANCE, "{name}: a tangent is off unit by {unit}");
    }
}

// Planes fitted anew.

fn worst_plane(planes: &[Vec4], twin: &[Plane]) -> f32 {
    worst(planes.iter().zip(twin).map(|(plane, twin)| {
        let offset = (plane.w - twin.offset_m).abs() / RADIUS_M;
        plane.truncate().distance(twin.normal).max(offset)
    }))
}

fn full_planes(gpu: &Gpu, body: &GpuBody, points: &[Vec3], sources: &[String; 2]) -> Vec<Vec4> {
    let pass = PlaneFull::with_sources(gpu, &body.patches, &body.buffers, &body.tangents, sources)
        .expect("the pass is built");
    body.frame(gpu, points, |encoder, timer| pass.record(encoder, timer));
    read(gpu, &pass.planes)
}

fn full_sources() -> [String; 2] {
    [join(PlaneFull::SORT_WGSL), join(PlaneFull::FIT_WGSL)]
}

#[test]
fn full_planes_match_the_cpu_twin() {
    let gpu = gpu();
    for (name, mesh) in surfaces(&[2, 3, 17, 64, 130]) {
        let body = GpuBody::new(&gpu, mesh);
        let points = deformed(&body.mesh.points);
        let planes = full_planes(&gpu, &body, &points, &full_sources());
        let twin = fit_planes(&points, &body.twin_normals(&points), &body.patches);
        let worst = worst_plane(&planes, &twin);
        assert!(
            worst < PLANE_TOLERANCE,
            "planes of {name} differ by {worst}"
        );
    }
}

#[test]
fn full_plane_parity_check_rejects_sabotaged_kernels() {
    let gpu = gpu();
    let body = GpuBody::new(&gpu, wavy(17));
    let points = deformed(&body.mesh.points);
    let twin = fit_planes(&points, &body.twin_normals(&points), &body.patches);
    let [sort, fit] = full_sources();
    for (which, from, to) in [
        (0, "entry(order[id.x])", "entry(id.x)"),
        (1, "d.y < least", "d.y > least"),
        (
            1,
            "dot(direction, normal) < 0.0",
            "dot(direction, normal) > 0.0",
        ),
        (1, "members &= members - 1u", "members = 0u"),
        (1, "dot(direction, mean_m)", "abs(dot(direction, mean_m))"),
        (1, "- mean.xxy * mean.yzz", ""),
    ] {
        let mut sources = [sort.clone(), fit.clone()];
        sources[which] = sabotaged(&sources[which], from, to);
        let worst = worst_plane(&full_planes(&gpu, &body, &points, &sources), &twin);
        assert!(
            worst > 10.0 * PLANE_TOLERANCE,
            "{to} went unnoticed: {worst}"
        );
    }
}

#[test]
fn full_planes_are_those_of_f64_near_and_far_from_the_origin() {
    let gpu = gpu();
    let body = GpuBody::new(&gpu, wavy(64));
    for away in [Vec3::ZERO, Vec3::new(10.0, 7.0, -4.0)] {
        let points: Vec<Vec3> = deformed(&body.mesh.points)
            .iter()
            .map(|&p| p + away)
            .collect();
        let planes = full_planes(&gpu, &body, &points, &full_sources());
        let normals = read(&gpu, &body.tangents.normals);
        let errors = plane_errors(&body, &points, &normals, &planes);
        let degrees = percentile(errors.iter().map(|e| e.0).collect(), 0.999);
        let offset = percentile(errors.iter().map(|e| e.1).collect(), 0.999);
        assert!(degrees <= ORACLE_DEGREES, "{away}: {degrees} degrees");
        // 0.05 degrees over one radius.
        assert!(offset <= 9e-4, "{away}: offset {offset} of the radius");
    }
}

#[test]
fn patches_without_a_thinnest_direction_get_the_tangent_plane() {
    let gpu = gpu();
    let mut isolated = SurfaceMesh::default();
    isolated.points.push(Vec3::ONE);
    isolated.point_of.push(0);
    isolated.uvs.push(Vec2::ZERO);
    let body = GpuBody::new(&gpu, wavy(9));
    let at_one_place = vec![Vec3::ONE; 81];
    let on_one_line: Vec<Vec3> = (0..81)
        .map(|i| Vec3::new(0.3, 0.1, -0.2) * 0.001 * i as f32)
        .collect();
    for (name, body, points) in [
        ("at one place", &body, at_one_place),
        ("on one line", &body, on_one_line),
        ("alone", &GpuBody::new(&gpu, isolated), vec![Vec3::ONE]),
    ] {
        for method in [LightPathMethod::Full, LightPathMethod::Incremental] {
            let pass = body.light_path(&gpu, method, 0.0);
            body.frame(&gpu, &points, |encoder, timer| pass.record(encoder, timer));
            let planes = read(&gpu, pass.planes().expect("has planes"));
            let normals = read(&gpu, &body.tangents.normals);
            assert_eq!(planes, normals, "{name}, {method:?}");
        }
    }
}

#[test]
fn folded_surface_gives_finite_unit_planes() {
    let gpu = gpu();
    let body = GpuBody::new(&gpu, wavy(17));
    let points: Vec<Vec3> = body
        .mesh
        .points
        .iter()
        .map(|p| Vec3::new((p.x - 0.05).abs(), p.y, p.z))
        .collect();
    for method in [
        LightPathMethod::Carried,
        LightPathMethod::Full,
        LightPathMethod::Incremental,
    ] {
        let pass = body.light_path(&gpu, method, 0.0);
        body.frame(&gpu, &points, |encoder, timer| pass.record(encoder, timer));
        let planes = read(&gpu, pass.planes().expect("has planes"));
        let off_unit = worst(planes.iter().map(|p| (p.truncate().length() - 1.0).abs()));
        assert!(off_unit < TOLERANCE, "{method:?} is off unit by {off_unit}");
        let offset = worst(planes.iter().map(|p| p.w.abs()));
        assert!(offset <= 0.1, "{method:?} has an offset of {offset} m");
    }
}

// Planes kept from rest.

fn worst_stale(gpu: &Gpu, body: &GpuBody, points: &[Vec3], source: &str) -> f32 {
    let rest_places = &body.mesh.points;
    let rest = fit_planes(rest_places, &body.rest_normals, &body.patches);
    let pass = PlaneStale::with_source(gpu, rest_places, &rest, &body.buffers, source)
        .expect("the pass is built");
    body.frame(gpu, points, |encoder, timer| pass.record(encoder, timer));
    let twin: Vec<Plane> = rest
        .into_iter()
        .zip(rest_places.iter().zip(points))
        .map(|(plane, (&rest_place, &place))| stale_plane(plane, rest_place, place))
        .collect();
    worst_plane(&read(gpu, &pass.planes), &twin)
}

#[test]
fn stale_planes_match_the_cpu_twin() {
    let gpu = gpu();
    for (name, mesh) in surfaces(&[2, 3, 17, 64, 130]) {
        let body = GpuBody::new(&gpu, mesh);
        let points = deformed(&body.mesh.points);
        let worst = worst_stale(&gpu, &body, &points, &join(PlaneStale::WGSL));
        assert!(worst < TOLERANCE, "planes of {name} differ by {worst}");
    }
}

#[test]
fn stale_plane_parity_check_rejects_planes_that_move_along() {
    let gpu = gpu();
    let body = GpuBody::new(&gpu, wavy(17));
    let points = deformed(&body.mesh.points);
    let kernel = sabotaged(
        &join(PlaneStale::WGSL),
        "rest.w - dot(rest.xyz, moved)",
        "rest.w",
    );
    let worst = worst_stale(&gpu, &body, &points, &kernel);
    assert!(
        worst > 10.0 * TOLERANCE,
        "planes that move along went unnoticed: {worst}"
    );
}

#[test]
fn stale_planes_stay_where_they_were_in_space() {
    let gpu = gpu();
    let body = GpuBody::new(&gpu, wavy(17));
    let pass = body.light_path(&gpu, LightPathMethod::Stale, 0.0);
    let points = deformed(&body.mesh.points);
    body.frame(&gpu, &points, |encoder, timer| pass.record(encoder, timer));
    let planes = read(&gpu, pass.planes().expect("has planes"));
    let rest = fit_planes(&body.mesh.points, &body.rest_normals, &body.patches);
    let from_origin = |normal: Vec3, offset_m: f32, point: Vec3| {
        normal.as_dvec3().dot(point.as_dvec3()) + f64::from(offset_m)
    };
    for (point, (plane, rest)) in planes.iter().zip(&rest).enumerate() {
        let before = from_origin(rest.normal, rest.offset_m, body.mesh.points[point]);
        let now = from_origin(plane.truncate(), plane.w, points[point]);
        assert_eq!(plane.truncate(), rest.normal);
        assert!(
            // Rounding of places; the surface moves by centimetres.
            (now - before).abs() < 1e-6,
            "plane {point} went {} m",
            now - before
        );
    }
}

#[test]
fn tangent_method_has_neither_planes_nor_passes() {
    let gpu = gpu();
    let body = GpuBody::new(&gpu, wavy(3));
    let pass = body.light_path(&gpu, LightPathMethod::Tangent, 0.0);
    assert!(pass.planes().is_none());
    assert!(pass.pass_names().is_empty());
    assert_eq!(
        pass.counts(&gpu).expect("no read back"),
        RefitCounts::default()
    );
}

fn worst_carried(gpu: &Gpu, body: &GpuBody, points: &[Vec3], source: &str) -> f32 {
    let rest = fit_planes(&body.mesh.points, &body.rest_normals, &body.patches);
    let local = planes_in_frames(&body.mesh, &rest, &body.rest_normals);
    let pass = PlaneCarried::with_source(gpu, &body.mesh, &local, &body.tangents, source)
        .expect("the pass is built");
    body.frame(gpu, points, |encoder, timer| pass.record(encoder, timer));
    let frames = twin_frames(body, points);
    let normals = body.twin_normals(points);
    let twin: Vec<Plane> = body
        .mesh
        .first_vertex_of_point()
        .iter()
        .zip(local)
        .zip(normals)
        .map(|((&vertex, plane), normal)| {
            let frame = frames[vertex as usize];
            carried_plane(plane, frame.tangent, frame.handedness, normal)
        })
        .collect();
    worst_plane(&read(gpu, &pass.planes), &twin)
}

#[test]
fn carried_planes_match_the_cpu_twin() {
    let gpu = gpu();
    for (name, mesh) in surfaces(&[2, 3, 17, 64, 130]) {
        let body = GpuBody::new(&gpu, mesh);
        let points = deformed(&body.mesh.points);
        let worst = worst_carried(&gpu, &body, &points, &join(PlaneCarried::WGSL));
        assert!(worst < TOLERANCE, "planes of {name} differ by {worst}");
    }
}

#[test]
fn carried_plane_parity_check_rejects_a_lost_handedness() {
    let gpu = gpu();
    let body = GpuBody::new(&gpu, wavy(17));
    let points = deformed(&body.mesh.points);
    let kernel = sabotaged(&join(PlaneCarried::WGSL), "t.w * cross", "-t.w * cross");
    let worst = worst_carried(&gpu, &body, &points, &kernel);
    assert!(
        worst > 10.0 * TOLERANCE,
        "a lost handedness went unnoticed: {worst}"
    );
}

#[test]
fn carried_planes_turn_with_a_rigid_motion() {
    let gpu = gpu();
    let body = GpuBody::new(&gpu, wavy(17));
    let turn = glam::Quat::from_euler(glam::EulerRot::XYZ, 1.0, -2.0, 0.5);
    let points: Vec<Vec3> = body
        .mesh
        .points
        .iter()
        .map(|&p| turn * p + Vec3::Y)
        .collect();
    let pass = body.light_path(&gpu, LightPathMethod::Carried, 0.0);
    body.frame(&gpu, &points, |encoder, timer| pass.record(encoder, timer));
    let planes = read(&gpu, pass.planes().expect("has planes"));
    let turned: Vec<Plane> = fit_planes(&body.mesh.points, &body.rest_normals, &body.patches)
        .into_iter()
        .map(|plane| Plane {
            normal: turn * plane.normal,
            ..plane
        })
        .collect();
    // Edges of 6 mm a metre away are rounded to 1e-5 of their length.
    let worst = worst_plane(&planes, &turned);
    assert!(worst < 1e-4, "differ by {worst}");
}

// Planes kept up to date.

/// A bump that wanders over the surface while the whole of it drifts and comes to rest by turns.
fn wandering(rest: &[Vec3], frame: usize) -> Vec<Vec3> {
    let t = frame as f32;
    let centre = Vec3::new(
        0.05 + 0.04 * (0.013 * t).sin(),
        0.0,
        0.05 + 0.04 * (0.017 * t).cos(),
    );
    // The drift moves for 100 frames and rests for 400.
    let drifting = (frame / 500 * 100 + (frame % 500).min(100)) as f32;
    let drift = Vec3::new(1.5e-4, -1e-4, 0.7e-4) * drifting;
    rest.iter()
        .map(|&p| {
            let away = (p - centre) * Vec3::new(1.0, 0.0, 1.0);
            let squared = away.length_squared() / 2.25e-4;
            // Cut off, so that most points stand still in most frames.
            let bump = (1.0 - squared).max(0.0).powi(2);
            p + drift - 0.012 * bump * Vec3::Y
        })
        .collect()
}

/// As [`wandering`], with every ninth point shaken by itself: patches of which few members moved.
fn shaken(rest: &[Vec3], frame: usize) -> Vec<Vec3> {
    let mut points = wandering(rest, frame);
    for (i, point) in points.iter_mut().enumerate().step_by(9) {
        point.y += 0.001 * ((i + frame) as f32).sin();
    }
    points
}

fn incremental_sources() -> [String; 2] {
    [PlaneIncremental::MOVED_WGSL, PlaneIncremental::UPDATE_WGSL].map(join)
}

/// Whether the sums are the same but for the rounding of a patch that was summed anew: 1e-6 of the
/// members' contributions, of which each is up to 16 units.
fn sums_alike(sums: &[PatchSums], twin: &RunningPlanes) -> bool {
    let alike = |a: [i32; 3], b: [i32; 3]| {
        let room = (1e-5 * 16.0 * twin.quanta).ceil() as i32;
        (0..3).all(|axis| (a[axis] - b[axis]).abs() <= room)
    };
    sums.iter().zip(&twin.sums).all(|(sums, twin)| {
        (sums.origin, sums.per_m) == (twin.origin, twin.per_m)
            && alike(sums.sum, twin.sum)
            && alike(sums.squares, twin.squares)
            && alike(sums.products, twin.products)
    })
}

/// Runs kernel and twin over the same frames; the worst plane difference, and whether all sums and
/// counts were the same.
fn incremental_difference(
    gpu: &Gpu,
    body: &GpuBody,
    tolerance_m: f32,
    frames: &[Vec<Vec3>],
    sources: &[String; 2],
) -> (f32, bool) {
    let rest = RunningPlanes::new(&body.mesh.points, &body.rest_normals, &body.patches);
    let pass = PlaneIncremental::with_sources(
        gpu,
        tolerance_m,
        &rest,
        &body.patches,
        &body.buffers,
        &body.tangents,
        sources,
    )
    .expect("the pass is built");
    let mut twin = rest;
    let mut difference = 0.0_f32;
    let mut same = true;
    for points in frames {
        body.frame(gpu, points, |encoder, timer| pass.record(encoder, timer));
        let normals = body.twin_normals(points);
        let updated = twin.update(tolerance_m, points, &normals, &body.patches);
        let counts = pass.counts(gpu).expect("counts can be read");
        let sums: Vec<PatchSums> = read_buffer(gpu, &pass.sums).expect("sums can be read");
        same &= (counts.moved, counts.refitted) == (updated.moved, updated.refitted);
        same &= sums_alike(&sums, &twin);
        difference = difference.max(worst_plane(&read(gpu, &pass.planes), &twin.planes));
    }
    (difference, same)
}

#[test]
fn incremental_planes_match_the_cpu_twin() {
    let gpu = gpu();
    for (name, mesh) in surfaces(&[2, 3, 17, 64, 130]) {
        let body = GpuBody::new(&gpu, mesh);
        let rest = &body.mesh.points;
        let mut frames: Vec<Vec<Vec3>> = (0..4).map(|i| shaken(rest, 30 * i)).collect();
        frames.push(deformed(rest));
        let (worst, same) =
            incremental_difference(&gpu, &body, 1e-5, &frames, &incremental_sources());
        assert!(
            worst < PLANE_TOLERANCE,
            "planes of {name} differ by {worst}"
        );
        assert!(same, "sums or counts of {name} differ");
    }
}

#[test]
fn incremental_plane_parity_check_rejects_sabotaged_kernels() {
    let gpu = gpu();
    let body = GpuBody::new(&gpu, wavy(33));
    let rest = &body.mesh.points;
    let frames: Vec<Vec<Vec3>> = (0..4).map(|i| shaken(rest, 110 + 10 * i)).collect();
    let kernels = incremental_sources();
    for (which, from, to) in [
        (0, "block.y", "(block.y & 255u)"),
        (0, "bits >>= 8u", "bits = 0u"),
        (
            0,
            "textureStore(now, entry(first + i), vec4f(place, old.w));",
            "",
        ),
        (
            1,
            "change(new_d * new_d, old_d * old_d)",
            "rounded(new_d * new_d)",
        ),
        (1, "origin - here.xyz + mean / per_m", "mean / per_m"),
        (1, "6u * moved_count < member_count", "true"),
        (1, "textureStore(committed, entry(slot), here);", ""),
        (0, "textureStore(before, entry(first + i), old);", ""),
    ] {
        let mut sources = kernels.clone();
        sources[which] = sabotaged(&sources[which], from, to);
        let (worst, same) = incremental_difference(&gpu, &body, 1e-5, &frames, &sources);
        assert!(worst > PLANE_TOLERANCE || !same, "{to} went unnoticed");
    }
}

/// Every ninth point shaken by itself and no other: a sixth of no patch moves, so none is ever summed anew, which would
/// take away what had piled up.
fn shaken_alone(rest: &[Vec3], frame: usize) -> Vec<Vec3> {
    let mut points = rest.to_vec();
    for (i, point) in points.iter_mut().enumerate().step_by(9) {
        point.y += 0.001 * ((i + frame) as f32).sin();
    }
    points
}

/// Worst angle [degrees] of running planes from the f64 fit, 99.9th percentile, looked at ten times in so many frames of a
/// body that lies `away` from the origin [m].
fn worst_drift_deg(gpu: &Gpu, away: Vec3, frames: usize, sources: &[String; 2]) -> f64 {
    let mut mesh = wavy(24);
    for point in &mut mesh.points {
        *point += away;
    }
    let body = GpuBody::new(gpu, mesh);
    let pass = PlaneIncremental::with_sources(
        gpu,
        0.0,
        &RunningPlanes::new(&body.mesh.points, &body.rest_normals, &body.patches),
        &body.patches,
        &body.buffers,
        &body.tangents,
        sources,
    )
    .expect("the pass is built");
    let mut worst = 0.0_f64;
    for frame in 1..=frames {
        let points = shaken_alone(&body.mesh.points, frame);
        body.frame(gpu, &points, |encoder, timer| pass.record(encoder, timer));
        if frame % (frames / 10) == 0 {
            let planes = read(gpu, &pass.planes);
            let normals = read(gpu, &body.tangents.normals);
            let errors = plane_errors(&body, &points, &normals, &planes);
            worst = worst.max(percentile(errors.iter().map(|e| e.0).collect(), 0.999));
        }
    }
    worst
}

#[test]
fn incremental_planes_do_not_drift_in_ten_thousand_frames() {
    let worst = worst_drift_deg(&gpu(), Vec3::ZERO, 10_000, &incremental_sources());
    println!("at the origin: {worst:.2e} degrees");
    assert!(worst <= ORACLE_DEGREES, "{worst} degrees");
}

#[test]
fn incremental_planes_do_not_drift_ten_metres_from_the_origin() {
    let away = Vec3::new(10.0, 0.0, 0.0);
    let worst = worst_drift_deg(&gpu(), away, 10_000, &incremental_sources());
    println!("10 m away: {worst:.2e} degrees");
    assert!(worst <= ORACLE_DEGREES, "{worst} degrees");
}

#[test]
fn drift_check_rejects_sums_that_lose_a_quantum_an_update() {
    let mut sources = incremental_sources();
    sources[1] = sabotaged(
        &sources[1],
        "products += change(new_d.xxy * new_d.yzz, old_d.xxy * old_d.yzz);",
        "products += change(new_d.xxy * new_d.yzz, old_d.xxy * old_d.yzz) + 1;",
    );
    let worst = worst_drift_deg(&gpu(), Vec3::ZERO, 2_000, &sources);
    assert!(
        worst > ORACLE_DEGREES,
        "four millionths of a patch's square an update went unnoticed: {worst} degrees"
    );
}

#[test]
fn incremental_planes_lag_by_no_more_than_the_tolerance_allows() {
    // Two members 1e-5 m off at opposite ends of a patch of 24 mm turn its plane by 0.05 degrees.
    let tolerance_m = 1e-5;
    let gpu = gpu();
    let body = GpuBody::new(&gpu, wavy(33));
    let pass = body.light_path(&gpu, LightPathMethod::Incremental, tolerance_m);
    for frame in 0..300 {
        let points = wandering(&body.mesh.points, frame);
        body.frame(&gpu, &points, |encoder, timer| pass.record(encoder, timer));
        let planes = read(&gpu, pass.planes().expect("has planes"));
        let normals = read(&gpu, &body.tangents.normals);
        let errors = plane_errors(&body, &points, &normals, &planes);
        let error = percentile(errors.iter().map(|e| e.0).collect(), 0.999);
        assert!(error <= ORACLE_DEGREES, "{error} degrees in frame {frame}");
    }
}

#[test]
fn incremental_changes_no_bit_and_counts_nothing_while_nothing_moves() {
    let gpu = gpu();
    let body = GpuBody::new(&gpu, wavy(33));
    let pass = body.light_path(&gpu, LightPathMethod::Incremental, 0.0);
    let planes = || read(&gpu, pass.planes().expect("has planes"));
    let run = |points: &[Vec3]| {
        body.frame(&gpu, points, |encoder, timer| pass.record(encoder, timer));
        pass.counts(&gpu).expect("counts can be read")
    };
    let at_rest = planes();
    assert_eq!(run(&body.mesh.points), RefitCounts::default());
    assert_eq!(planes(), at_rest, "the first frame at rest changed a plane");

    let points = wandering(&body.mesh.points, 470);
    assert!(run(&points).moved > 0);
    let moved = planes();
    for _ in 0..20 {
        assert_eq!(run(&points), RefitCounts::default());
    }
    assert_eq!(planes(), moved, "a still frame changed a plane");
}

#[test]
fn a_moved_point_refits_the_patches_it_is_in_and_no_others() {
    let gpu = gpu();
    let body = GpuBody::new(&gpu, wavy(33));
    let pass = body.light_path(&gpu, LightPathMethod::Incremental, 0.0);
    let mut points = body.mesh.points.clone();
    points[500].y += 0.001;
    body.frame(&gpu, &points, |encoder, timer| pass.record(encoder, timer));
    assert_eq!(
        pass.counts(&gpu).expect("counts can be read"),
        RefitCounts {
            refitted: body.patches.members(500).count() as u32,
            moved: 1
        }
    );
}

#[test]
fn incremental_recovers_from_points_thrown_a_thousand_radii_away() {
    let gpu = gpu();
    let body = GpuBody::new(&gpu, wavy(33));
    let pass = body.light_path(&gpu, LightPathMethod::Incremental, 0.0);
    let mut thrown = body.mesh.points.clone();
    for point in thrown.iter_mut().step_by(7) {
        *point *= 1000.0;
    }
    for points in [thrown, deformed(&body.mesh.points)] {
        body.frame(&gpu, &points, |encoder, timer| pass.record(encoder, timer));
        let planes = read(&gpu, pass.planes().expect("has planes"));
        let normals = read(&gpu, &body.tangents.normals);
        let errors = plane_errors(&body, &points, &normals, &planes);
        let error = percentile(errors.iter().map(|e| e.0).collect(), 0.5);
        assert!(error <= ORACLE_DEGREES, "{error} degrees");
    }
    let planes = read(&gpu, pass.planes().expect("has planes"));
    let normals = read(&gpu, &body.tangents.normals);
    let errors = plane_errors(&body, &deformed(&body.mesh.points), &normals, &planes);
    let error = percentile(errors.iter().map(|e| e.0).collect(), 0.999);
    assert!(
        error <= ORACLE_DEGREES,
        "{error} degrees once they are back"
    );
}
