//! How exact the kernels are on organs that are prodded by the script of a scene: normals, tangents, texture
//! gradients and planes against f64, at several frames and after ten thousand.
//!
//! `cargo test --test accuracy -- --nocapture` prints the figures of `docs/ACCURACY.md`. The real spleen is read
//! from the folder that `PALPATE_SHARED` names (`../shared` if it is not set); without it the bundled organs alone
//! are measured.

#[path = "support/oracle.rs"]
mod oracle;

use glam::{DVec3, Vec3, Vec4};
use oracle::{Surface, angle_p999, degrees_between, percentile};
use palpate::app::Session;
use palpate::geom::SurfaceMesh;
use palpate::geom::patch::Patches;
use palpate::geom::plane::{LightPathMethod, carried_plane, exact_weighted_plane, fit_planes};
use palpate::geom::quadric::{Quadric, exact_quadric};
use palpate::geom::sample::{Sample, Samples};
use palpate::geom::tangent::{
    Fans, gradient_max_per_m, point_normals, rest_normals, tangent_frames,
};
use palpate::gpu::{Gpu, Timer, read_buffer};
use palpate::passes::frame::{patch_radius_m, tolerance_m};
use palpate::passes::light_path::{LightPath, LightPathKnobs};
use palpate::passes::mesh_buffers::MeshBuffers;
use palpate::passes::plane_carried::planes_in_frames;
use palpate::passes::tangents::Tangents;
use palpate::scene::{Scene, SceneSource};
use std::path::PathBuf;
use std::sync::OnceLock;

/// What is asked of normals, tangents and planes against f64, at the 99.9th percentile [degrees].
const DEGREES_MAX: f64 = 0.05;
/// Frames of the prod that are recorded: the probe comes, presses, slides and leaves, the grasper pulls.
const FRAMES: usize = 150;
/// Frames that are compared: at rest, touched, pressed, slid, let go, pulled.
const COMPARED: [usize; 6] = [1, 36, 56, 84, 112, 140];

/// An organ and where its surface lay in every frame of the prod.
struct Prodded {
    name: &'static str,
    mesh: SurfaceMesh,
    radius_m: f32,
    tolerance_m: f32,
    frames: Vec<Vec<Vec3>>,
    /// The patch of each point, by brute force.
    patches: Vec<Vec<usize>>,
}

impl Prodded {
    fn record(name: &'static str, text: &str, sets: &[String]) -> Self {
        let source = SceneSource {
            name,
            text,
            folder: None,
        };
        let mut sets = sets.to_vec();
        // Patches of planes, which reach twice as far as those of paraboloids.
        sets.push("light_path.method=full".to_owned());
        let scene = Scene::read(&source, &sets).expect("a sound scene");
        let (radius_m, tolerance_m) = (patch_radius_m(&scene), tolerance_m(&scene));
        let mut session = Session::new(scene, 2).expect("a sound body");
        let frames = (0..FRAMES)
            .map(|_| {
                session.tick();
                session.points().to_vec()
            })
            .collect();
        let mesh = session.mesh;
        let rest = surface(&mesh, &mesh.points);
        let patches = oracle::patches(&rest.points, &rest.normals(), f64::from(radius_m));
        Self {
            name,
            mesh,
            radius_m,
            tolerance_m,
            frames,
            patches,
        }
    }

    /// The same prod with patches of another reach.
    fn with_radius(&self, radius_m: f32) -> Self {
        let rest = surface(&self.mesh, &self.mesh.points);
        Self {
            name: self.name,
            mesh: self.mesh.clone(),
            radius_m,
            tolerance_m: self.tolerance_m * radius_m / self.radius_m,
            frames: self.frames.clone(),
            patches: oracle::patches(&rest.points, &rest.normals(), f64::from(radius_m)),
        }
    }

    fn at(&self, frame: usize) -> &[Vec3] {
        &self.frames[frame - 1]
    }

    /// Angles and offset differences, as shares of the radius, of `planes` against the f64 fit: 99.9th percentiles.
    fn plane_errors(&self, points: &[Vec3], planes: &[Vec4]) -> (f64, f64) {
        let now = surface(&self.mesh, points);
        let exact = oracle::planes(&now.points, &now.normals(), &self.patches);
        let pairs = || planes.iter().map(|plane| plane.as_dvec4()).zip(&exact);
        let angles = pairs().map(|(plane, (n, _))| degrees_between(plane.truncate(), *n));
        let offsets = pairs().map(|(plane, (_, h))| (plane.w - h).abs());
        (
            percentile(angles, 0.999),
            percentile(offsets, 0.999) / f64::from(self.radius_m),
        )
    }
}

fn surface(mesh: &SurfaceMesh, points: &[Vec3]) -> Surface {
    Surface {
        points: points.iter().map(|p| p.as_dvec3()).collect(),
        point_of: mesh.point_of.clone(),
        uvs: mesh.uvs.iter().map(|uv| uv.as_dvec2()).collect(),
        triangles: mesh.triangles.clone(),
    }
}

/// The bundled liver, and the real spleen where it is.
fn organs() -> &'static [Prodded] {
    static ORGANS: OnceLock<Vec<Prodded>> = OnceLock::new();
    ORGANS.get_or_init(|| {
        let mut organs = vec![Prodded::record(
            "bundled liver",
            include_str!("../scenes/liver.toml"),
            &[],
        )];
        let shared = std::env::var_os("PALPATE_SHARED").map_or_else(
            || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared"),
            PathBuf::from,
        );
        let file = shared.join("data/organs/VH_F_Spleen.glb");
        if file.is_file() {
            organs.push(Prodded::record(
                "real spleen",
                include_str!("../scenes/spleen.toml"),
                &[format!("body.file='{}'", file.display())],
            ));
        } else {
            println!(
                "{} is absent: the real spleen was not measured",
                file.display()
            );
        }
        organs
    })
}

/// The passes from positions to planes, without any drawing.
struct Passes {
    gpu: Gpu,
    buffers: MeshBuffers,
    tangents: Tangents,
    light_path: LightPath,
    timer: Timer,
}

impl Passes {
    fn new(organ: &Prodded, method: LightPathMethod, tolerance_m: f32) -> Self {
        let gpu =
            Gpu::headless().expect("a GPU adapter; a software one (mesa-vulkan-drivers) will do");
        let buffers = MeshBuffers::new(&gpu, &organ.mesh).expect("the surface fits");
        let tangents = Tangents::new(&gpu, &organ.mesh, &buffers).expect("the pass is built");
        let knobs = LightPathKnobs {
            method,
            radius_m: organ.radius_m,
            tolerance_m,
            skip_m: 0.0,
        };
        let light_path = LightPath::new(&gpu, knobs, &organ.mesh, &buffers, &tangents)
            .expect("the pass is built");
        Self {
            timer: Timer::new(&gpu, 4),
            gpu,
            buffers,
            tangents,
            light_path,
        }
    }

    fn frame(&mut self, points: &[Vec3]) {
        self.buffers.upload(&self.gpu, points);
        let mut encoder = self.gpu.encoder();
        self.timer.begin_frame();
        self.tangents.record(&mut encoder, &mut self.timer);
        self.light_path.record(&mut encoder, &mut self.timer);
        self.gpu.queue.submit([encoder.finish()]);
    }

    fn read(&self, buffer: &wgpu::Buffer) -> Vec<Vec4> {
        read_buffer(&self.gpu, buffer).expect("memory can be read back")
    }

    fn planes(&self) -> Vec<Vec4> {
        self.read(self.light_path.planes().expect("has planes"))
    }
}

#[test]
fn normals_of_a_prodded_organ_are_those_of_f64() {
    for organ in organs() {
        let mut passes = Passes::new(organ, LightPathMethod::Tangent, 0.0);
        for frame in COMPARED {
            passes.frame(organ.at(frame));
            let normals = passes.read(&passes.tangents.normals);
            let found: Vec<DVec3> = normals.iter().map(|n| n.truncate().as_dvec3()).collect();
            let exact = surface(&organ.mesh, organ.at(frame)).normals();
            let angle = angle_p999(&found, &exact);
            println!(
                "{}, frame {frame}: normals p99.9 {angle:.2e} degrees",
                organ.name
            );
            assert!(angle <= DEGREES_MAX, "{}: {angle} degrees", organ.name);
        }
    }
}

#[test]
fn tangents_and_texture_gradients_of_a_prodded_organ_are_those_of_f64() {
    for organ in organs() {
        let mut passes = Passes::new(organ, LightPathMethod::Tangent, 0.0);
        for frame in COMPARED {
            passes.frame(organ.at(frame));
            let tangents = passes.read(&passes.tangents.tangents);
            let gradients = passes.read(&passes.tangents.uv_gradients);
            let now = surface(&organ.mesh, organ.at(frame));
            let axes = now.uv_axes(&now.normals());
            let mut angles = Vec::new();
            let mut products = Vec::new();
            for (vertex, axes) in axes.iter().enumerate() {
                let Some([pu, pv]) = *axes else {
                    continue;
                };
                angles.push(degrees_between(tangents[vertex].truncate().as_dvec3(), pu));
                let [gu, gv] = [0, 1].map(|k| gradients[2 * vertex + k].truncate().as_dvec3());
                // Dual: a step along the surface changes u by g_u and leaves v alone, and the other way.
                products.push((gu.dot(pu) - 1.0).abs().max((gv.dot(pv) - 1.0).abs()));
                products.push((gu.dot(pv) / pv.length() * pu.length()).abs());
                products.push((gv.dot(pu) / pu.length() * pv.length()).abs());
            }
            assert!(
                angles.len() * 100 > 98 * axes.len(),
                "few vertices have a texture map"
            );
            let angle = percentile(angles, 0.999);
            let product = percentile(products, 0.999);
            println!(
                "{}, frame {frame}: tangents p99.9 {angle:.2e} degrees, metric p99.9 {product:.2e}",
                organ.name
            );
            assert!(angle <= DEGREES_MAX, "{}: {angle} degrees", organ.name);
            // 0.05 degrees is 9e-4 of a radian.
            assert!(product <= 9e-4, "{}: not dual by {product}", organ.name);
        }
    }
}

/// The worst angle and offset error over the compared frames of the prod, played from its start.
fn worst_over_the_prod(organ: &Prodded, method: LightPathMethod, tolerance_m: f32) -> (f64, f64) {
    let mut refitted = 0;
    let mut passes = Passes::new(organ, method, tolerance_m);
    let mut worst = (0.0_f64, 0.0_f64);
    for frame in 1..=FRAMES {
        passes.frame(organ.at(frame));
        let counts = passes.light_path.counts(&passes.gpu);
        refitted += u64::from(counts.expect("counts can be read").refitted);
        if COMPARED.contains(&frame) {
            let (angle, offset) = organ.plane_errors(organ.at(frame), &passes.planes());
            println!(
                "{}, frame {frame}: planes of {} p99.9 {angle:.2e} degrees, offset {offset:.2e} of the radius",
                organ.name,
                method.name()
            );
            worst = (worst.0.max(angle), worst.1.max(offset));
        }
    }
    println!(
        "{}: {} fitted {:.0} % of the planes a frame",
        organ.name,
        method.name(),
        100.0 * refitted as f64 / (FRAMES * organ.mesh.points.len()) as f64
    );
    worst
}

#[test]
fn planes_of_a_prodded_organ_are_those_of_f64() {
    for organ in organs() {
        for method in [LightPathMethod::Full, LightPathMethod::Incremental] {
            let (angle, offset) = worst_over_the_prod(organ, method, organ.tolerance_m);
            let name = format!("{} of {}", method.name(), organ.name);
            assert!(angle <= DEGREES_MAX, "{name}: {angle} degrees");
            // The tolerance is 2.5e-4 of the radius, and the plane lies within what its members may lag.
            assert!(offset <= 1e-3, "{name}: {offset} of the radius");
        }
    }
}

/// Errors [degrees] of the primitives of sixteen samples against the f64 fit of the same samples, p99.9: of planes the
/// angle of their normals, of paraboloids that of the surface's normal at the rim of the patch.
fn sampled_error(
    organ: &Prodded,
    samples: &Samples,
    method: LightPathMethod,
    points: &[Vec3],
    passes: &Passes,
) -> f64 {
    let normals = surface(&organ.mesh, points).normals();
    let at = |point: u32| points[point as usize].as_dvec3();
    let buffer = passes
        .light_path
        .primitives()
        .buffer()
        .expect("has primitives");
    let vectors = passes.read(buffer);
    if method == LightPathMethod::Sampled {
        let angles = (0..points.len()).map(|slot| {
            let own = samples.order[slot] as usize;
            let members: Vec<_> = samples
                .weighing(slot)
                .map(|s| (at(s.point), f64::from(s.weight)))
                .collect();
            let (exact, _) =
                exact_weighted_plane(members.into_iter(), points[own].as_dvec3(), normals[own])
                    .expect("16 samples");
            degrees_between(vectors[own].truncate().as_dvec3(), exact)
        });
        return percentile(angles, 0.999);
    }
    let angles = (0..points.len()).map(|slot| {
        let own = samples.order[slot] as usize;
        let counts = |s: &Sample| {
            let d = at(s.point) - points[own].as_dvec3();
            2.0 * d.dot(normals[own]).powi(2) <= d.length_squared()
        };
        let members = samples.weighing(slot).filter(counts);
        let members = members.map(|s| (at(s.point), f64::from(s.weight)));
        let exact =
            exact_quadric(members, points[own].as_dvec3(), normals[own]).expect("16 samples");
        let quadric = Quadric {
            squares: vectors[2 * own].truncate(),
            products: vectors[2 * own + 1].truncate(),
        };
        let apart = [Vec3::X, Vec3::Y, Vec3::Z]
            .map(|axis| (quadric.times(axis).as_dvec3() - exact * axis.as_dvec3()).length())
            .into_iter()
            .fold(0.0, f64::max);
        (apart * f64::from(organ.radius_m)).to_degrees()
    });
    percentile(angles, 0.999)
}

#[test]
fn sampled_planes_and_quadrics_of_a_prodded_organ_are_those_of_f64() {
    for organ in organs() {
        let mesh = &organ.mesh;
        let at_rest = rest_normals(mesh, &Fans::new(mesh));
        let patches = Patches::new(&mesh.points, &at_rest, organ.radius_m);
        let even = Samples::new(&mesh.points, &patches);
        let middle = even.clone().weighted_to_the_middle(&mesh.points);
        for (method, samples) in [
            (LightPathMethod::Sampled, &even),
            (LightPathMethod::Quadric, &middle),
        ] {
            let mut passes = Passes::new(organ, method, organ.tolerance_m);
            for frame in 1..=FRAMES {
                passes.frame(organ.at(frame));
                if frame % 10 == 0 {
                    // Uploads that wait for the GPU would pile up.
                    passes.gpu.wait();
                }
                if COMPARED.contains(&frame) {
                    let angle = sampled_error(organ, samples, method, organ.at(frame), &passes);
                    println!(
                        "{}, frame {frame}: {} p99.9 {angle:.2e} degrees",
                        organ.name,
                        method.name()
                    );
                    assert!(
                        angle <= DEGREES_MAX,
                        "{} of {}: {angle} degrees",
                        method.name(),
                        organ.name
                    );
                }
            }
        }
    }
}

#[test]
fn a_tolerance_fifty_times_larger_fails_the_check_of_planes() {
    let organ = organs().last().expect("an organ");
    let tolerance_m = 50.0 * organ.tolerance_m;
    let (angle, _) = worst_over_the_prod(organ, LightPathMethod::Incremental, tolerance_m);
    assert!(
        angle > DEGREES_MAX,
        "a lag of {tolerance_m} m went unnoticed: {angle} degrees"
    );
}

#[test]
fn carried_planes_of_a_prodded_organ_are_those_of_their_twin() {
    for organ in organs() {
        let mesh = &organ.mesh;
        let fans = Fans::new(mesh);
        let at_rest = rest_normals(mesh, &fans);
        let patches = Patches::new(&mesh.points, &at_rest, organ.radius_m);
        let local = planes_in_frames(
            mesh,
            &fit_planes(&mesh.points, &at_rest, &patches),
            &at_rest,
        );
        let limit = gradient_max_per_m(mesh, &fans, &at_rest);
        let first_vertex = mesh.first_vertex_of_point();
        let mut passes = Passes::new(organ, LightPathMethod::Carried, 0.0);
        for frame in COMPARED {
            let points = organ.at(frame);
            passes.frame(points);
            let normals = point_normals(&fans, points, &at_rest);
            let frames = tangent_frames(&fans, &mesh.point_of, points, &normals, limit);
            let twin: Vec<DVec3> = (0..points.len())
                .map(|point| {
                    let frame = frames[first_vertex[point] as usize];
                    let plane = carried_plane(
                        local[point],
                        frame.tangent,
                        frame.handedness,
                        normals[point],
                    );
                    plane.normal.as_dvec3()
                })
                .collect();
            let found: Vec<DVec3> = passes
                .planes()
                .iter()
                .map(|plane| plane.truncate().as_dvec3())
                .collect();
            let angle = angle_p999(&found, &twin);
            println!(
                "{}, frame {frame}: carried p99.9 {angle:.2e} degrees from its twin",
                organ.name
            );
            assert!(angle <= DEGREES_MAX, "{}: {angle} degrees", organ.name);
        }
    }
}

#[test]
fn incremental_planes_of_a_prodded_organ_do_not_drift_in_ten_thousand_frames() {
    // Patches of about 60 points, so that it ends within a minute on a software adapter.
    let organ = organs().last().expect("an organ").with_radius(0.01);
    assert!(
        organ.mesh.points.len() >= 4000,
        "a surface as fine as an organ's"
    );
    let mut passes = Passes::new(&organ, LightPathMethod::Incremental, organ.tolerance_m);
    // Forwards and backwards, so that every frame is near the one before.
    let period = 2 * (FRAMES - 1);
    for count in 0..10_000 {
        let phase = count % period;
        let points = &organ.frames[phase.min(period - phase)];
        passes.frame(points);
        if count % 50 == 49 {
            // Uploads that wait for the GPU would pile up.
            passes.gpu.wait();
        }
        if [100, 3_333, 6_666, 9_999].contains(&count) {
            let (angle, offset) = organ.plane_errors(points, &passes.planes());
            println!(
                "{}, {count} frames played: incremental p99.9 {angle:.2e} degrees, offset {offset:.2e} of the radius",
                organ.name
            );
            assert!(angle <= DEGREES_MAX, "{angle} degrees after {count} frames");
        }
    }
}
