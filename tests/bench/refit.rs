//! What each light-path method costs and how wrong it is, by the share of points that move.
//!
//! Prints a CSV row a method, share and pattern: GPU milliseconds by timestamps, and the angle
//! between its planes and the f64 fit of the same frame. Of `quadric` the angle is that of the surface's normal at the
//! rim of the patch, against the f64 fit of the same samples. `drift` moves all alike, `poke` the points nearest to one
//! place, `scattered` as many all over, which is the worst case for a method that skips what is
//! still. `tangent` has no pass; its errors say what that saves.

#[allow(dead_code, reason = "one of the shared surfaces is enough here")]
#[path = "../support/surfaces.rs"]
mod surfaces;

use glam::{DVec3, Vec3, Vec4};
use palpate::geom::SurfaceMesh;
use palpate::geom::patch::Patches;
use palpate::geom::plane::{LightPathMethod, exact_plane};
use palpate::geom::quadric::{Quadric, exact_quadric};
use palpate::geom::sample::Samples;
use palpate::geom::tangent::{Fans, rest_normals};
use palpate::gpu::{Gpu, GpuError, Timer, read_buffer};
use palpate::passes::light_path::{LightPath, LightPathKnobs, Primitives, RefitCounts};
use palpate::passes::mesh_buffers::MeshBuffers;
use palpate::passes::tangents::Tangents;

/// 100 x 100 points 1 mm apart, so that this radius holds about 200.
const SIDE: usize = 100;
const RADIUS_M: f32 = 0.0083;
const TOLERANCE_M: f32 = 1e-6;
const WARM_UP: usize = 5;
const FRAMES: usize = 101;

fn main() -> Result<(), GpuError> {
    let gpu = Gpu::headless()?;
    let mesh = surfaces::wavy(SIDE);
    let normals = rest_normals(&mesh, &Fans::new(&mesh));
    let patches = Patches::new(&mesh.points, &normals, RADIUS_M);
    let point_count = mesh.points.len();
    let members: u32 = (0..point_count)
        .map(|slot| patches.member_count(slot))
        .sum();
    eprintln!(
        "{}; {point_count} points, {:.0} to a patch in {:.1} blocks",
        gpu.adapter,
        f64::from(members) / point_count as f64,
        patches.lists.blocks.len() as f64 / point_count as f64,
    );
    println!(
        "method,skip_m,pattern,moved_share,moved,refitted,ms_p50,ms_p95,tangents_ms_p50,\
         normal_error_deg_p50,normal_error_deg_p99,oracle"
    );
    // Depth maps have no pass of their own here: what they cost is the draw of `depth-maps` in a replay.
    let fitted = |method: &LightPathMethod| *method != LightPathMethod::DepthMap;
    for method in LightPathMethod::ALL.into_iter().filter(fitted) {
        for (pattern, share) in [
            ("none", 0.0),
            ("poke", 0.01),
            ("poke", 0.05),
            ("poke", 0.2),
            ("scattered", 0.01),
            ("scattered", 0.05),
            ("scattered", 0.2),
            ("all", 1.0),
        ] {
            row(&gpu, &mesh, &patches, method, 0.0, (pattern, share))?;
        }
    }
    // What it saves to pass over patches whose mean lies near their tangent plane, and what it costs: the waves of
    // the sheet as they are, moved as a whole.
    for share_of_radius in [0.0, 0.01, 0.03, 0.1] {
        let skip_m = share_of_radius * RADIUS_M;
        let pattern = ("drift", 1.0);
        row(
            &gpu,
            &mesh,
            &patches,
            LightPathMethod::Sampled,
            skip_m,
            pattern,
        )?;
    }
    Ok(())
}

fn moving_points(mesh: &SurfaceMesh, pattern: &str, share: f64) -> Vec<usize> {
    let count = (share * mesh.points.len() as f64) as usize;
    if pattern == "scattered" {
        // A stride that shares no factor with the number of points visits each once.
        return (0..count).map(|i| i * 3_463 % mesh.points.len()).collect();
    }
    let centre = Vec3::new(0.05, 0.0, 0.05);
    let distance = |point: &usize| mesh.points[*point].distance_squared(centre);
    let mut points: Vec<usize> = (0..mesh.points.len()).collect();
    points.sort_by(|a, b| distance(a).total_cmp(&distance(b)));
    points.truncate(count);
    points
}

fn row(
    gpu: &Gpu,
    mesh: &SurfaceMesh,
    patches: &Patches,
    method: LightPathMethod,
    skip_m: f32,
    (pattern, share): (&str, f64),
) -> Result<(), GpuError> {
    let moving = moving_points(mesh, pattern, share);
    let buffers = MeshBuffers::new(gpu, mesh)?;
    let tangents = Tangents::new(gpu, mesh, &buffers)?;
    let knobs = LightPathKnobs {
        method,
        radius_m: RADIUS_M,
        tolerance_m: TOLERANCE_M,
        skip_m,
    };
    let pass = LightPath::new(gpu, knobs, mesh, &buffers, &tangents)?;
    let mut timer = Timer::new(gpu, 4);
    let mut points = mesh.points.clone();
    let (mut path_ms, mut tangents_ms) = (Vec::new(), Vec::new());
    let mut counts = RefitCounts::default();
    for frame in 0..WARM_UP + FRAMES {
        for &point in &moving {
            let along = if pattern == "drift" { 0.0 } else { 200.0 };
            let phase = 0.4 * frame as f32 + along * mesh.points[point].x;
            points[point] = mesh.points[point] - Vec3::Y * (0.006 + 0.002 * phase.sin());
        }
        buffers.upload(gpu, &points);
        timer.begin_frame();
        let mut encoder = gpu.encoder();
        tangents.record(&mut encoder, &mut timer);
        pass.record(&mut encoder, &mut timer);
        timer.resolve(&mut encoder);
        gpu.submit_and_wait(encoder);
        let times = timer.read(gpu)?;
        counts = pass.counts(gpu)?;
        if frame >= WARM_UP {
            tangents_ms.push(f64::from(times[0].gpu_ms));
            path_ms.push(times.get(1).map_or(0.0, |time| f64::from(time.gpu_ms)));
        }
    }
    let mut errors = normal_errors_deg(gpu, patches, &mesh.points, &points, &tangents, &pass)?;
    println!(
        "{},{skip_m},{pattern},{share},{},{},{:.4},{:.4},{:.4},{:.5},{:.5},f64 fit of every patch",
        method.name(),
        counts.moved,
        counts.refitted,
        percentile(&mut path_ms, 0.5),
        percentile(&mut path_ms, 0.95),
        percentile(&mut tangents_ms, 0.5),
        percentile(&mut errors, 0.5),
        percentile(&mut errors, 0.99),
    );
    Ok(())
}

fn quadric_errors_deg(
    gpu: &Gpu,
    patches: &Patches,
    rest: &[Vec3],
    points: &[Vec3],
    normals: &[Vec4],
    buffer: &wgpu::Buffer,
) -> Result<Vec<f64>, GpuError> {
    let vectors: Vec<[Vec4; 2]> = read_buffer(gpu, buffer)?;
    let samples = Samples::new(rest, patches).weighted_to_the_middle(rest);
    let angle = |slot: usize| {
        let own = samples.order[slot] as usize;
        let normal = normals[own].truncate().as_dvec3();
        let members = samples
            .weighing(slot)
            .filter(|s| {
                let d = (points[s.point as usize] - points[own]).as_dvec3();
                2.0 * d.dot(normal).powi(2) <= d.length_squared()
            })
            .map(|s| (points[s.point as usize].as_dvec3(), f64::from(s.weight)));
        let exact = exact_quadric(members, points[own].as_dvec3(), normal).expect("16 samples");
        let [squares, products] = vectors[own].map(|v| v.truncate());
        let quadric = Quadric { squares, products };
        let apart = [Vec3::X, Vec3::Y, Vec3::Z]
            .map(|axis| (quadric.times(axis).as_dvec3() - exact * axis.as_dvec3()).length());
        apart.into_iter().fold(0.0, f64::max) * f64::from(RADIUS_M)
    };
    Ok((0..points.len())
        .map(|slot| angle(slot).to_degrees())
        .collect())
}

fn normal_errors_deg(
    gpu: &Gpu,
    patches: &Patches,
    rest: &[Vec3],
    points: &[Vec3],
    tangents: &Tangents,
    pass: &LightPath,
) -> Result<Vec<f64>, GpuError> {
    let normals: Vec<Vec4> = read_buffer(gpu, &tangents.normals)?;
    if let Primitives::Quadrics(buffer) = pass.primitives() {
        return quadric_errors_deg(gpu, patches, rest, points, &normals, buffer);
    }
    let planes: Vec<Vec4> = match pass.planes() {
        Some(planes) => read_buffer(gpu, planes)?,
        None => normals.clone(),
    };
    let angle = |point: usize| {
        let members = patches.members(point).map(|m| points[m].as_dvec3());
        let members: Vec<DVec3> = members.collect();
        let normal = normals[point].truncate().as_dvec3();
        let (exact, _) = exact_plane(members.into_iter(), points[point].as_dvec3(), normal)
            .expect("patches have members");
        let fitted = planes[point].truncate().as_dvec3();
        fitted.cross(exact).length().atan2(fitted.dot(exact))
    };
    Ok((0..points.len()).map(|p| angle(p).to_degrees()).collect())
}

fn percentile(values: &mut [f64], share: f64) -> f64 {
    values.sort_by(f64::total_cmp);
    values[((values.len() - 1) as f64 * share).round() as usize]
}
