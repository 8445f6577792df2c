//! Depth maps of the lights: what they hold against rays cast at the surface, and ways read from them against the
//! closed form of a sphere; each check against a sabotaged pass.
//!
//! A missing adapter is a failure, not a skip: a software one (mesa-vulkan-drivers) will do.

#[allow(dead_code)] // Other tests use the rest.
#[path = "support/surfaces.rs"]
mod surfaces;

#[path = "support/shader.rs"]
mod shader;

use glam::{Mat4, Vec3, Vec4};
use palpate::geom::SurfaceMesh;
use palpate::geom::ray::first_hit;
use palpate::gpu::{Gpu, Timer, join, read_texture_depth, read_texture_rgba8, uniform};
use palpate::optics::light_entry::way_from_entry;
use palpate::optics::pack::from_octahedral;
use palpate::passes::depth_maps::{DepthMaps, LightViews, views};
use palpate::passes::exit::Exit;
use palpate::passes::mesh_buffers::MeshBuffers;
use palpate::passes::shadow::SIZE_PX;
use palpate::passes::tangents::Tangents;
use palpate::passes::view::{FrameUniform, View};
use palpate::scene::{PlacedLight, SurfaceSection};
use shader::gpu;

/// Two far lights and a near one.
fn lights() -> Vec<PlacedLight> {
    let light = |place: Vec3, is_point: bool| PlacedLight {
        place: if is_point { place } else { place.normalize() },
        is_point,
        power: Vec3::ONE,
        shadow: false,
    };
    vec![
        light(Vec3::new(0.3, 0.9, 0.4), false),
        light(Vec3::new(-0.8, 0.1, 0.5), false),
        light(Vec3::new(0.05, 0.16, -0.08), true),
    ]
}

/// The maps of a surface at `points`, read back.
struct Maps {
    views: LightViews,
    depth: Vec<f32>,
    normals: Vec<u32>,
}

impl Maps {
    fn draw(gpu: &Gpu, mesh: &SurfaceMesh, points: &[Vec3], source: &str) -> Self {
        let buffers = MeshBuffers::new(gpu, mesh).expect("the surface fits");
        let tangents = Tangents::new(gpu, mesh, &buffers).expect("the pass is built");
        let lights = lights();
        let pass = DepthMaps::with_source(gpu, mesh, lights.len(), &tangents, source)
            .expect("the pass is built");
        buffers.upload(gpu, points);
        let mut timer = Timer::new(gpu, 4);
        let mut encoder = gpu.encoder();
        tangents.record(&mut encoder, &mut timer);
        pass.record(gpu, &lights, points, &buffers, &mut encoder, &mut timer);
        gpu.submit_and_wait(encoder);
        let words = read_texture_rgba8(gpu, &pass.normals.texture).expect("can be read");
        Self {
            views: views(&lights, points),
            depth: read_texture_depth(gpu, &pass.depth.texture).expect("can be read"),
            normals: bytemuck::pod_collect_to_vec(&words),
        }
    }

    /// Depth and normal of a texel of light `k`.
    fn texel(&self, k: usize, column: u32, row: u32) -> (f32, Vec3) {
        let at = (row * SIZE_PX * lights().len() as u32 + k as u32 * SIZE_PX + column) as usize;
        (self.depth[at], from_octahedral(self.normals[at]))
    }

    fn world(&self, k: usize, column: u32, row: u32, depth: f32) -> Vec3 {
        let side = SIZE_PX as f32;
        let x = (column as f32 + 0.5) / side * 2.0 - 1.0;
        let y = 1.0 - (row as f32 + 0.5) / side * 2.0;
        let far =
            Mat4::from_cols_array(&self.views.world_from_clip[k]) * Vec4::new(x, y, depth, 1.0);
        far.truncate() / far.w
    }

    /// The way of light `k` to `at`, step by step as `shaders/light_depth.wgsl`; `None` if it is outside or its
    /// texel is empty.
    fn way(&self, k: usize, at: Vec3, to_light: Vec3) -> Option<f32> {
        let clip = Mat4::from_cols_array(&self.views.clip_from_world[k]) * at.extend(1.0);
        let side = SIZE_PX as f32;
        let column = ((clip.x / clip.w * 0.5 + 0.5) * side).floor();
        let row = ((0.5 - clip.y / clip.w * 0.5) * side).floor();
        if !(0.0..side).contains(&column) || !(0.0..side).contains(&row) {
            return None;
        }
        let (depth, normal) = self.texel(k, column as u32, row as u32);
        let entry = self.world(k, column as u32, row as u32, depth);
        let way = way_from_entry(entry, normal, at, to_light, self.views.slack_m[k]);
        way.filter(|_| depth < 1.0).map(|(s, _)| s)
    }
}

/// Share of texels where map and ray disagree: on whether there is a surface, on where by more than 0.1 mm, or on
/// which way it faces by more than 25 degrees.
fn disagreement(maps: &Maps, mesh: &SurfaceMesh, points: &[Vec3]) -> f64 {
    let triangles = mesh.point_triangles();
    let (mut wrong, mut met, mut all) = (0, 0, 0);
    for k in 0..lights().len() {
        for row in (3..SIZE_PX).step_by(29) {
            for column in (5..SIZE_PX).step_by(31) {
                let from = maps.world(k, column, row, 0.0);
                let towards = maps.world(k, column, row, 1.0) - from;
                let hit = first_hit(from, towards, points, &triangles);
                let (depth, normal) = maps.texel(k, column, row);
                let alike = match hit {
                    None => depth >= 1.0,
                    Some(hit) => {
                        met += 1;
                        let entry = maps.world(k, column, row, depth);
                        entry.distance(from + hit.distance * towards) < 1e-4
                            && normal.dot(hit.normal) > 0.9
                    }
                };
                wrong += usize::from(!alike);
                all += 1;
            }
        }
    }
    assert!(met > all / 8, "rays meet the body");
    wrong as f64 / all as f64
}

#[test]
fn depth_maps_hold_what_rays_cast_at_the_surface_meet() {
    let gpu = gpu();
    let mesh = surfaces::sphere(0.05, 40, 25);
    let points = surfaces::deformed(&mesh.points);
    let maps = Maps::draw(&gpu, &mesh, &points, &join(DepthMaps::WGSL));
    let share = disagreement(&maps, &mesh, &points);
    // Texels on the very rim, where a ray misses by a rounding.
    assert!(share < 0.01, "{share} of the texels disagree");
}

#[test]
fn depth_map_check_rejects_flipped_normals_and_a_surface_at_another_place() {
    let gpu = gpu();
    let mesh = surfaces::sphere(0.05, 40, 25);
    let points = surfaces::deformed(&mesh.points);
    for (from, to) in [
        ("octahedral(in.normal)", "octahedral(-in.normal)"),
        ("vec4f(position, 1.0)", "vec4f(0.97 * position, 1.0)"),
    ] {
        let source = join(DepthMaps::WGSL);
        let changed = source.replace(from, to);
        assert_ne!(changed, source, "the sabotage must change the shader");
        let maps = Maps::draw(&gpu, &mesh, &points, &changed);
        let share = disagreement(&maps, &mesh, &points);
        assert!(share > 0.1, "{to} went unnoticed: {share}");
    }
}

#[test]
fn ways_read_from_depth_maps_are_the_chords_of_a_sphere() {
    let gpu = gpu();
    let radius = 0.05;
    let mesh = surfaces::sphere(radius, 160, 101);
    let maps = Maps::draw(&gpu, &mesh, &mesh.points, &join(DepthMaps::WGSL));
    for (k, light) in lights().iter().enumerate() {
        let mut errors = Vec::new();
        for i in 0..2000 {
            // Fibonacci's directions, from just below the surface to the middle, lit and unlit sides alike.
            let share = (i as f32 + 0.5) / 2000.0;
            let z = 1.0 - 2.0 * share;
            let around = 2.399_963_2 * i as f32;
            let ring = (1.0 - z * z).sqrt();
            let direction = Vec3::new(ring * around.cos(), z, ring * around.sin());
            let at = (radius - 0.001 - 0.04 * ((7 * i) % 10) as f32 / 10.0) * direction;
            let to_light = if light.is_point {
                (light.place - at).normalize()
            } else {
                light.place
            };
            let along = at.dot(to_light);
            let chord = -along + (along * along - at.length_squared() + radius * radius).sqrt();
            if let Some(way) = maps.way(k, at, to_light) {
                errors.push((way - chord).abs());
            }
        }
        assert!(errors.len() > 1950, "{} ways were read", errors.len());
        errors.sort_by(f32::total_cmp);
        let error = errors[errors.len() * 98 / 100];
        println!("light {k}: p98 {error:.2e} m");
        // Triangles lie 0.02 mm below the sphere, and where light grazes they are met farther on. A texel is 0.14 mm:
        // entries taken as they are, without the cut by their plane, err by as much.
        assert!(error < 1e-4, "light {k}: {error} m");
    }
}

/// Worst distance from a ball's far side of where view rays are said to leave it, over its radius; the rim, where a
/// ray cuts off less than a tenth of the radius, is left out.
fn exit_error(gpu: &Gpu, pass_of: impl Fn(&wgpu::Buffer, &SurfaceMesh) -> Exit) -> f32 {
    let (radius, side) = (0.05, 64);
    let mesh = surfaces::sphere(radius, 160, 101);
    let view = View {
        eye: Vec3::new(0.02, 0.05, 0.2),
        target: Vec3::ZERO,
        up: Vec3::Y,
        fov_y: 0.5,
    };
    let section = SurfaceSection::default();
    let frame = FrameUniform::new(&view, [side; 2], &lights(), &section, Mat4::IDENTITY);
    let frame = uniform(gpu, "frame", &frame);
    let pass = pass_of(&frame, &mesh);
    let buffers = MeshBuffers::new(gpu, &mesh).expect("the surface fits");
    let mut encoder = gpu.encoder();
    pass.record(&buffers, &mut encoder, &mut Timer::new(gpu, 1));
    gpu.submit_and_wait(encoder);
    let depth = read_texture_depth(gpu, &pass.target.texture).expect("can be read");
    let world_from_clip = view.clip_from_world(1.0).inverse();
    let mut worst = 0.0_f32;
    let mut met = 0;
    for (i, &depth) in (0..side * side).zip(&depth) {
        let x = ((i % side) as f32 + 0.5) / side as f32 * 2.0 - 1.0;
        let y = 1.0 - ((i / side) as f32 + 0.5) / side as f32 * 2.0;
        let along = (world_from_clip.project_point3(Vec3::new(x, y, 0.5)) - view.eye).normalize();
        let nearest = -view.eye.dot(along);
        let half = radius * radius - view.eye.length_squared() + nearest * nearest;
        if half > (0.05 * radius).powi(2) {
            let exit = view.eye + (nearest + half.sqrt()) * along;
            let told = world_from_clip.project_point3(Vec3::new(x, y, depth));
            worst = worst.max(told.distance(exit) / radius);
            met += 1;
        }
    }
    assert!(met > 500, "rays meet the ball");
    worst
}

#[test]
fn view_rays_end_at_the_far_side_of_a_ball() {
    let gpu = gpu();
    let error = exit_error(&gpu, |frame, mesh| {
        Exit::new(&gpu, mesh, frame, [64; 2]).expect("the pass is built")
    });
    // Triangles lie 5e-4 of the radius below the ball, and rays meet them at down to 3 degrees.
    assert!(error < 0.02, "{error} of the radius");
    // Turned inside out, the near side is drawn.
    let near = exit_error(&gpu, |frame, mesh| {
        let mut mesh = mesh.clone();
        for corners in &mut mesh.triangles {
            corners.swap(1, 2);
        }
        Exit::new(&gpu, &mesh, frame, [64; 2]).expect("the pass is built")
    });
    assert!(near > 1.0, "the near side went unnoticed: {near}");
}
