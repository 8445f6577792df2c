//! The surfaces after Green (2004) on the GPU against closed forms and CPU twins, on bodies that have moved; each check
//! against something sabotaged.
//!
//! A missing adapter is a failure, not a skip: a software one (mesa-vulkan-drivers) will do.

#[allow(dead_code)] // Other tests use the rest.
#[path = "support/surfaces.rs"]
mod surfaces;

#[path = "support/shader.rs"]
mod shader;

use glam::{Vec2, Vec3, Vec4};
use palpate::geom::SurfaceMesh;
use palpate::geom::paint::TissueMaps;
use palpate::gpu::{
    Binding, Gpu, Kernel, Timer, join, read_buffer, read_texture_depth, read_texture_rgba16f,
    storage,
};
use palpate::optics::Layer;
use palpate::optics::diffusion::{Axis, Profile, TAPS, diffused, metric};
use palpate::passes::body_depths::BodyDepths;
use palpate::passes::diffusion::{shares, texels_per_m};
use palpate::passes::draw::Output;
use palpate::passes::draw::Target;
use palpate::passes::frame::FramePasses;
use palpate::passes::green::wrap_light;
use palpate::passes::mesh_buffers::MeshBuffers;
use palpate::passes::shadow::SIZE_PX;
use palpate::passes::tangents::Tangents;
use palpate::passes::view::{View, shadow_from_world};
use palpate::scene::{RestBox, Scene, SceneSource, SurfaceSection};
use palpate::wgsl;
use shader::{gpu, sabotaged};

// Wrapped light.

/// Worst difference of colour or highlight between the table on the GPU and the formulas.
fn lookup_difference(gpu: &Gpu, source: &str) -> f32 {
    let light = wrap_light(&SurfaceSection::default());
    let target = Target::new(gpu, "table", [256; 2], wgpu::TextureFormat::Rgba16Float);
    let halves: Vec<[half::f16; 4]> = light
        .table()
        .iter()
        .map(|entry| entry.to_array().map(half::f16::from_f32))
        .collect();
    gpu.queue.write_texture(
        target.texture.as_image_copy(),
        bytemuck::cast_slice(&halves),
        wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(8 * 256),
            rows_per_image: None,
        },
        target.texture.size(),
    );
    let sampler = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
        mag_filter: wgpu::FilterMode::Linear,
        ..Default::default()
    });
    // N.L and N.H, the latter mostly near 1, where the highlight is.
    let cases: Vec<Vec4> = (0..512)
        .map(|i| {
            let n_l = -1.0 + 2.0 * i as f32 / 511.0;
            let v = ((i * 37) % 512) as f32 / 511.0;
            Vec4::new(n_l, 1.0 - v * v * v, 0.0, 0.0)
        })
        .collect();
    let source = source.replace("@binding(12)", "@binding(1)");
    let kernel = format!(
        "@group(0) @binding(0) var linear_sampler: sampler;
        {source}
        @group(0) @binding(2) var<storage, read> cases: array<vec4f>;
        @group(0) @binding(3) var<storage, read_write> results: array<vec4f>;
        @compute @workgroup_size(64)
        fn main(@builtin(global_invocation_id) id: vec3u) {{
            results[id.x] = wrapped_light(cases[id.x].x, cases[id.x].y);
        }}"
    );
    let cases_buffer = storage(gpu, "cases", &cases).unwrap();
    let results = storage(gpu, "results", &vec![Vec4::ZERO; cases.len()]).unwrap();
    let kernel = Kernel::new(
        gpu,
        "lookup parity",
        &[],
        &kernel,
        "main",
        &[
            Binding::Sampler(&sampler),
            Binding::Texture(&target.view),
            Binding::Read(&cases_buffer),
            Binding::Write(&results),
        ],
    )
    .unwrap();
    let mut encoder = gpu.encoder();
    {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        kernel.dispatch(&mut pass, 8);
    }
    gpu.submit_and_wait(encoder);
    let got: Vec<Vec4> = read_buffer(gpu, &results).unwrap();
    let top = light.highlight(1.0, 1.0);
    got.iter()
        .zip(&cases)
        .map(|(got, case)| {
            let color = (got.truncate() - light.diffuse(case.x)).abs().max_element();
            color.max((got.w - light.highlight(case.x, case.y)).abs() / top)
        })
        .fold(0.0, f32::max)
}

#[test]
fn wrapped_light_matches_the_cpu_twin() {
    let difference = lookup_difference(&gpu(), &join(wgsl!["wrap_lookup.wgsl"]));
    // A kink of the curve between two of 256 entries, and half floats.
    assert!(difference < 6e-3, "differ by {difference}");
}

#[test]
fn wrapped_light_check_rejects_evenly_spaced_rows_and_a_range_of_one_half() {
    let gpu = gpu();
    let source = join(wgsl!["wrap_lookup.wgsl"]);
    for (from, to) in [
        (
            "sqrt(clamp(1.0 - n_h, 0.0, 1.0))",
            "clamp(1.0 - n_h, 0.0, 1.0)",
        ),
        ("0.5 * n_l + 0.5", "n_l"),
    ] {
        let difference = lookup_difference(&gpu, &sabotaged(&source, from, to));
        assert!(difference > 0.1, "{to} went unnoticed: {difference}");
    }
}

// Whole frames.

/// A drawn frame, and what it was drawn from.
struct Drawn {
    passes: FramePasses,
    scene: Scene,
}

const SIZE: [u32; 2] = [96, 64];

fn plain_maps(outer: image::RgbaImage) -> TissueMaps {
    let size_px = outer.width();
    let map = |texel: [u8; 4]| image::RgbaImage::from_pixel(size_px, size_px, image::Rgba(texel));
    TissueMaps {
        size_px,
        normal: map([128, 128, 255, 255]),
        inner: map([255, 255, 255, 255]),
        layers: vec![image::DynamicImage::ImageRgba8(map([60, 120, 180, 255]))],
        outer,
    }
}

fn white(size_px: u32) -> image::RgbaImage {
    image::RgbaImage::from_pixel(size_px, size_px, image::Rgba([255; 4]))
}

/// Draws `mesh` moved to `points`, seen along −z, white and dry.
fn draw(
    gpu: &Gpu,
    mesh: &SurfaceMesh,
    points: &[Vec3],
    outer: image::RgbaImage,
    light: &str,
    sets: &[&str],
) -> Drawn {
    let text = format!(
        "[body]\nshape = \"sphere\"\nextent_m = [0.1, 0.1, 0.1]\n[surface]\nwetness = 0.0\nrelief = 0.0\n\
         [[light]]\n{light}\nirradiance_w_m2 = [3.0, 3.0, 3.0]\n"
    );
    let source = SceneSource {
        name: "frame",
        text: &text,
        folder: None,
    };
    let sets: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
    let scene = Scene::read(&source, &sets).expect("a sound scene");
    let (low, high) = palpate::geom::bounds(&mesh.points);
    let rest = RestBox { low, high };
    let passes = FramePasses::new(
        gpu,
        &scene,
        &rest,
        mesh,
        &plain_maps(outer),
        SIZE,
        Output::Radiance,
    )
    .unwrap();
    let mut timer = Timer::new(gpu, 32);
    let mut encoder = gpu.encoder();
    passes.record(gpu, points, &view(), &[], &mut encoder, &mut timer);
    gpu.submit_and_wait(encoder);
    Drawn { passes, scene }
}

/// From 2 m, so that the eye's rays are nearly parallel.
fn view() -> View {
    View {
        up: Vec3::Y,
        eye: Vec3::new(0.0, 0.0, 2.0),
        target: Vec3::ZERO,
        fov_y: 0.08,
    }
}

/// Covered pixels: place on the surface, and radiance.
fn pixels(gpu: &Gpu, drawn: &Drawn) -> Vec<(Vec3, Vec3)> {
    let radiance = read_texture_rgba16f(gpu, &drawn.passes.target.texture).unwrap();
    let depth = read_texture_depth(gpu, &drawn.passes.targets.depth.texture).unwrap();
    let [width, height] = SIZE;
    let world_from_clip = view()
        .clip_from_world(width as f32 / height as f32)
        .inverse();
    (0..width * height)
        .filter(|&i| depth[i as usize] < 1.0)
        .map(|i| {
            let x = 2.0 * ((i % width) as f32 + 0.5) / width as f32 - 1.0;
            let y = 1.0 - 2.0 * ((i / width) as f32 + 0.5) / height as f32;
            let world = world_from_clip.project_point3(Vec3::new(x, y, depth[i as usize]));
            let at = 4 * i as usize;
            (world, Vec3::from_slice(&radiance[at..at + 3]))
        })
        .collect()
}

/// Ambient light of `shaders/light.wgsl` [W/m²].
fn ambient(normal: Vec3) -> Vec3 {
    (1.0 + 0.7 * normal.y) * Vec3::new(0.150, 0.165, 0.175)
}

/// Clear tissue in which a ball of centimetres lets light through.
const CLEAR: [&str; 2] = [
    "surface.layer.3.absorption_per_m=[5.0, 20.0, 60.0]",
    "surface.layer.3.scattering_per_m=[100.0, 100.0, 100.0]",
];

/// Worst error of the light that comes through an ellipsoid lit from behind, as a share of the brightest, if the tissue
/// were `factor` times as dense as it is.
fn through_error(gpu: &Gpu, sets: &[&str], light: &str, factor: f32) -> f32 {
    let mesh = surfaces::sphere(0.05, 128, 81);
    let stretch = Vec3::new(1.2, 0.7, 0.6);
    let points: Vec<Vec3> = mesh.points.iter().map(|&p| p * stretch).collect();
    let mut all = vec!["surface.kind=absorption", "surface.absorption.glow=1.0"];
    all.extend(CLEAR);
    all.extend(sets);
    let drawn = draw(gpu, &mesh, &points, white(8), light, &all);
    let section = &drawn.scene.surface;
    let layer = Layer::from(section.layers[3]);
    let sigma = factor * section.absorption.way_share * layer.diffuse_attenuation_per_m();
    let lookup = wrap_light(section);
    let placed = drawn.scene.lights[0].placed(&RestBox {
        low: Vec3::splat(-0.05),
        high: Vec3::splat(0.05),
    });
    let (mut worst, mut brightest, mut count) = (0.0_f32, 0.0_f32, 0);
    for (world, radiance) in pixels(gpu, &drawn) {
        let normal = (world / (stretch * stretch)).normalize();
        let to_light = if placed.is_point {
            (placed.place - world).normalize()
        } else {
            placed.place
        };
        let irradiance = if placed.is_point {
            placed.power / placed.place.distance_squared(world)
        } else {
            placed.power
        };
        let cosine = normal.dot(to_light);
        // Where light or sight grazes the maps' texels and the picture's are too coarse to tell.
        if normal.z < 0.35 || cosine > -0.35 {
            continue;
        }
        // The chord of the ellipsoid, in the space where it is a unit sphere.
        let (x, d) = (world / (0.05 * stretch), to_light / (0.05 * stretch));
        let chord = -2.0 * x.dot(d) / d.length_squared();
        let expected = (ambient(normal)
            + irradiance
                * (-sigma * chord).exp()
                * (lookup.diffuse(cosine) + (0.5 - 0.5 * cosine)))
            / std::f32::consts::PI;
        worst = worst.max((radiance - expected).abs().max_element());
        brightest = brightest.max(radiance.max_element());
        count += 1;
    }
    assert!(count > 300, "{count} pixels look at the far side");
    worst / brightest
}

const BEHIND: &str = "toward = [0.3, 0.2, -1.0]";

#[test]
fn light_through_the_body_matches_the_cpu_twin() {
    let gpu = gpu();
    let near = "at_m = [0.05, 0.02, -0.25]";
    for (light, sets) in [
        (BEHIND, &["surface.absorption.samples=1"][..]),
        (
            BEHIND,
            &[
                "surface.absorption.depth_layers=2",
                "surface.absorption.samples=1",
            ],
        ),
        (BEHIND, &["surface.absorption.disc_radius_m=0.0005"]),
        (near, &["surface.absorption.samples=1"]),
    ] {
        let error = through_error(&gpu, sets, light, 1.0);
        println!("{light}, {sets:?}: {error:.4}");
        // The bias of two texels, 0.4 mm of a way of centimetres, and the mean over the disc.
        assert!(error < 0.03, "{light}, {sets:?}: {error}");
    }
}

#[test]
fn the_check_of_light_through_the_body_sees_tissue_a_fifth_too_dense() {
    let error = through_error(&gpu(), &["surface.absorption.samples=1"], BEHIND, 1.2);
    assert!(error > 0.06, "went unnoticed: {error}");
}

/// Two balls of 3 cm along z, 2 cm apart.
fn two_balls() -> SurfaceMesh {
    let one = surfaces::sphere(0.015, 48, 31);
    let mut mesh = SurfaceMesh::default();
    for (ball, z) in [0.025, -0.025].into_iter().enumerate() {
        let points = mesh.points.len() as u32;
        let vertices = mesh.uvs.len() as u32;
        mesh.points
            .extend(one.points.iter().map(|&p| p + z * Vec3::Z));
        mesh.point_of
            .extend(one.point_of.iter().map(|&p| p + points));
        let place = |uv: &Vec2| Vec2::new(0.48 * uv.x + 0.51 * ball as f32, uv.y);
        mesh.uvs.extend(one.uvs.iter().map(place));
        mesh.triangles
            .extend(one.triangles.iter().map(|t| t.map(|v| v + vertices)));
    }
    mesh
}

#[test]
fn air_between_two_parts_counts_as_tissue_with_one_depth_layer_and_not_with_two() {
    let gpu = gpu();
    let mesh = two_balls();
    // Light from behind through both; the front of the near one is seen.
    let middle = |layers: u32| {
        let layers = format!("surface.absorption.depth_layers={layers}");
        let mut sets = vec![
            "surface.kind=absorption",
            "surface.absorption.samples=1",
            "surface.absorption.glow=1.0",
            layers.as_str(),
        ];
        sets.extend(CLEAR);
        let light = "toward = [0.0, 0.0, -1.0]";
        let drawn = draw(&gpu, &mesh, &mesh.points, white(8), light, &sets);
        let layer = Layer::from(drawn.scene.surface.layers[3]);
        let sigma = drawn.scene.surface.absorption.way_share * layer.diffuse_attenuation_per_m().x;
        let at = pixels(&gpu, &drawn)
            .into_iter()
            .min_by(|a, b| a.0.truncate().length().total_cmp(&b.0.truncate().length()))
            .expect("the ball is seen");
        let glow = at.1.x * std::f32::consts::PI - ambient(Vec3::Z).x;
        -(glow / 3.0).ln() / sigma
    };
    let (one, two) = (middle(1), middle(2));
    // 8 cm from the first entry to the place, of which 6 are tissue; the bias of two texels is a tenth of a millimetre.
    assert!((one - 0.08).abs() < 1.5e-3, "{one} m");
    assert!((two - 0.06).abs() < 1.5e-3, "{two} m");
}

/// Share of texels where the maps of two balls, seen along z, are not where the balls are.
fn depth_disagreement(gpu: &Gpu, source: &str) -> f64 {
    let mesh = two_balls();
    let buffers = MeshBuffers::new(gpu, &mesh).unwrap();
    let tangents = Tangents::new(gpu, &mesh, &buffers).unwrap();
    let maps = BodyDepths::with_source(gpu, &mesh, 1, 2, &tangents, source).unwrap();
    let matrix = shadow_from_world(Vec3::Z, &mesh.points);
    buffers.upload(gpu, &mesh.points);
    let mut timer = Timer::new(gpu, 8);
    let mut encoder = gpu.encoder();
    tangents.record(&mut encoder, &mut timer);
    maps.record(gpu, &[matrix], 0.0, &buffers, &mut encoder, &mut timer);
    gpu.submit_and_wait(encoder);
    let [entries, exits, seconds] = [maps.entries(), maps.exits(), maps.second_entries()]
        .map(|map| read_texture_depth(gpu, &map.texture).unwrap());
    let side = SIZE_PX as f32;
    let (mut wrong, mut all) = (0, 0);
    for row in (3..SIZE_PX).step_by(17) {
        for column in (5..SIZE_PX).step_by(19) {
            let at = (row * SIZE_PX + column) as usize;
            let x = 2.0 * (column as f32 + 0.5) / side - 1.0;
            let y = 1.0 - 2.0 * (row as f32 + 0.5) / side;
            let on_axis = matrix.inverse().project_point3(Vec3::new(x, y, 0.0));
            let off = on_axis.truncate().length();
            if (off - 0.015).abs() < 0.001 {
                continue;
            }
            let depth = |z: f32| {
                if off > 0.015 {
                    1.0
                } else {
                    matrix.project_point3(on_axis.truncate().extend(z)).z
                }
            };
            let half = (0.015_f32 * 0.015 - off * off).max(0.0).sqrt();
            let expected = [0.025 + half, 0.025 - half, -0.025 + half].map(depth);
            let got = [entries[at], exits[at], seconds[at]];
            // A share of 8 cm: facets of 48 sides lie up to a millimetre below the ball near its rim.
            wrong += usize::from((0..3).any(|k| (expected[k] - got[k]).abs() > 0.012));
            all += 1;
        }
    }
    assert!(all > 1000, "{all} texels were looked at");
    f64::from(wrong as u32) / f64::from(all)
}

#[test]
fn body_depths_hold_what_rays_cast_at_the_surface_meet() {
    let share = depth_disagreement(&gpu(), &join(BodyDepths::WGSL));
    assert!(share < 0.005, "{share} of the texels disagree");
}

#[test]
fn body_depth_check_rejects_second_entries_that_are_the_first() {
    let source = sabotaged(&join(BodyDepths::WGSL), "at.z <", "at.z < -1.0 +");
    let share = depth_disagreement(&gpu(), &source);
    assert!(share > 0.1, "went unnoticed: {share}");
}

// Diffusion.

/// A flat square of 4 cm in x and y that faces the eye; its texture fills the map but for a rim.
fn sheet(cells: usize) -> SurfaceMesh {
    let mut mesh = SurfaceMesh::default();
    for row in 0..=cells {
        for column in 0..=cells {
            let (s, t) = (column as f32 / cells as f32, row as f32 / cells as f32);
            mesh.point_of.push(mesh.points.len() as u32);
            mesh.points.push(0.04 * Vec3::new(s - 0.5, t - 0.5, 0.0));
            mesh.uvs.push(Vec2::new(0.05 + 0.9 * s, 0.95 - 0.9 * t));
        }
    }
    let at = |row: usize, column: usize| (row * (cells + 1) + column) as u32;
    for row in 0..cells {
        for column in 0..cells {
            let [a, b] = [at(row, column), at(row, column + 1)];
            let [c, d] = [at(row + 1, column), at(row + 1, column + 1)];
            mesh.triangles.extend([[a, b, c], [b, d, c]]);
        }
    }
    mesh
}

fn vectors(gpu: &Gpu, target: &Target) -> Vec<Vec4> {
    read_texture_rgba16f(gpu, &target.texture)
        .unwrap()
        .chunks_exact(4)
        .map(Vec4::from_slice)
        .collect()
}

/// Tissue of François' Table 1: dermis, in 1/m.
const DERMIS: [&str; 3] = [
    "surface.layer.1.absorption_per_m=[600.0, 600.0, 600.0]",
    "surface.layer.1.scattering_per_m=[2000.0, 1000.0, 1000.0]",
    "surface.layer.1.asymmetry=0.25",
];

/// Worst difference between the blurred map on the GPU and on the CPU whose widths are `factor` times as large, as a
/// share of the brightest.
fn diffusion_difference(gpu: &Gpu, factor: f32) -> f32 {
    let mesh = surfaces::sphere(0.02, 32, 21);
    let points = surfaces::deformed(&mesh.points);
    let sets = [
        "surface.kind=diffusion",
        "surface.light_map_size_px=64",
        "surface.diffusion.core=map",
    ];
    let light = "toward = [0.7, 0.4, 0.5]\nshadow = true";
    let drawn = draw(gpu, &mesh, &points, white(8), light, &sets);
    let diffusion = drawn.passes.diffusion().expect("it has a light map");
    let mut map = vectors(gpu, diffusion.light());
    let metrics: Vec<Vec3> = vectors(gpu, diffusion.metric())
        .iter()
        .map(|m| m.truncate())
        .collect();
    let section = &drawn.scene.surface;
    let profile = Profile::of(&section.layers[1].into());
    let mut sum = vec![Vec3::ZERO; map.len()];
    let (at_pixel, blurred) = shares(section, texels_per_m(section, &mesh));
    for (gaussian, step) in profile.steps_m().into_iter().enumerate() {
        for axis in [Axis::Second, Axis::First] {
            map = diffused(&map, &metrics, 64, axis, factor * step, TAPS[gaussian]);
        }
        let weight = blurred[gaussian] / (1.0 - at_pixel);
        for (sum, texel) in sum.iter_mut().zip(&map) {
            *sum += weight * texel.truncate();
        }
    }
    let got = vectors(gpu, diffusion.target());
    let brightest = got.iter().map(|t| t.max_element()).fold(0.0, f32::max);
    assert!(brightest > 1.0, "the ball is lit: {brightest}");
    // The gutter is widened from pass to pass, so that its earlier Gaussians end sooner: only charts are compared.
    let light = vectors(gpu, diffusion.light());
    got.iter()
        .zip(&sum)
        .zip(&light)
        .filter(|(_, light)| light.w != 0.0)
        .map(|((got, sum), _)| (got.truncate() - *sum).abs().max_element() / brightest)
        .fold(0.0, f32::max)
}

#[test]
fn diffusion_matches_the_cpu_twin() {
    let difference = diffusion_difference(&gpu(), 1.0);
    // Six maps of half floats, each rounded by 5e-4; a tap that is rounded to the other texel.
    assert!(difference < 0.01, "differ by {difference}");
}

#[test]
fn diffusion_parity_check_rejects_widths_of_other_tissue() {
    let difference = diffusion_difference(&gpu(), 2.0);
    assert!(difference > 0.02, "went unnoticed: {difference}");
}

#[test]
fn the_metric_of_the_light_map_is_that_of_the_stretched_surface() {
    let gpu = gpu();
    let mesh = sheet(8);
    // Stretched by 1.5 along x and sheared: (x, y) = (1.5 s + 0.4 t, t) of what it was.
    let points: Vec<Vec3> = mesh
        .points
        .iter()
        .map(|p| Vec3::new(1.5 * p.x + 0.4 * p.y, p.y, p.z))
        .collect();
    let texel = |metric: &str| {
        let sets = [
            "surface.kind=diffusion",
            "surface.light_map_size_px=32",
            metric,
        ];
        let light = "toward = [0.0, 0.0, 1.0]";
        let drawn = draw(&gpu, &mesh, &points, white(8), light, &sets);
        vectors(&gpu, drawn.passes.diffusion().unwrap().metric())[16 * 32 + 16].truncate()
    };
    // u = 22.5 s, v = -22.5 t, s = (x - 0.4 y) / 1.5, t = y, all in 1/m.
    let exact = metric(
        22.5 / 1.5 * Vec3::new(1.0, -0.4, 0.0),
        22.5 * Vec3::new(0.0, -1.0, 0.0),
    );
    let deformed = texel("surface.uv_metric=deformed");
    // Half floats.
    assert!(
        (deformed - exact).abs().max_element() < 0.02,
        "{deformed} for {exact}"
    );
    let unit = texel("surface.uv_metric=unit");
    assert!(
        (unit - Vec3::new(22.5, 0.0, 22.5)).abs().max_element() < 0.02,
        "{unit}"
    );
    assert!((deformed - unit).length() > 3.0, "the two metrics differ");
}

/// Worst root mean square of the edge's error over ±6 mean radii, per colour, for a sheet stretched by `stretch`
/// whose half is lit; `scale` multiplies the blur's widths.
fn edge_error(gpu: &Gpu, core: &str, stretch: f32, scale: f32) -> Vec3 {
    let mesh = sheet(8);
    let points: Vec<Vec3> = mesh
        .points
        .iter()
        .map(|p| Vec3::new(stretch * p.x, p.y, p.z))
        .collect();
    let side = 512;
    let outer = image::RgbaImage::from_fn(side, side, |x, _| {
        let lit = if x >= side / 2 { 255 } else { 0 };
        image::Rgba([lit, lit, lit, 255])
    });
    let (core, scale) = (
        format!("surface.diffusion.core={core}"),
        format!("surface.diffusion.radius_scale={scale}"),
    );
    let mut sets = vec![
        "surface.kind=diffusion",
        "surface.light_map_size_px=512",
        "surface.diffusion.color_in_map=1.0",
        core.as_str(),
        scale.as_str(),
    ];
    sets.extend(DERMIS);
    let light = "toward = [0.0, 0.0, 1.0]";
    let drawn = draw(gpu, &mesh, &points, outer, light, &sets);
    let row =
        vectors(gpu, drawn.passes.diffusion().unwrap().target())[256 * 512..257 * 512].to_vec();
    let full = row[440];
    let section = &drawn.scene.surface;
    let (at_pixel, _) = shares(section, texels_per_m(section, &mesh));
    // Three Gaussians fitted to Monte Carlo walks in dermis by others, good to 0.002: widths [mm], weights, mean radius.
    let published = [
        ([0.046, 0.245, 0.731], [0.238, 0.456, 0.306], 0.437),
        ([0.059, 0.313, 0.978], [0.248, 0.458, 0.295], 0.564),
        ([0.059, 0.313, 0.978], [0.248, 0.458, 0.295], 0.564),
    ];
    let mut error = Vec3::ZERO;
    for (channel, (sigmas, weights, mean)) in published.into_iter().enumerate() {
        let exact = Profile {
            sigmas_m: sigmas.map(|mm| Vec3::splat(1e-3 * mm)),
            weights: weights.map(|w: f32| Vec3::splat(w / weights.iter().sum::<f32>())),
        };
        let (mut square, mut count) = (0.0, 0);
        for (column, texel) in row.iter().enumerate() {
            // 4 cm on 0.9 of the map.
            let x = stretch * 0.04 * ((column as f32 + 0.5) / 512.0 - 0.5) / 0.9;
            if x.abs() > 6e-3 * mean {
                continue;
            }
            let step = if x > 0.0 { 1.0 } else { 0.0 };
            let core = at_pixel[channel];
            let got = core * step + (1.0 - core) * texel[channel] / full[channel];
            square += (got - exact.edge(x, 0)).powi(2);
            count += 1;
        }
        error[channel] = (square / count as f32).sqrt();
    }
    error
}

#[test]
fn the_edge_of_light_is_as_soft_as_monte_carlo_walks_make_it_however_the_tissue_is_stretched() {
    let gpu = gpu();
    for stretch in [1.0, 1.6] {
        let error = edge_error(&gpu, "map", stretch, 1.0);
        println!("stretched by {stretch}: edge RMS {error:.4}");
        // 0.01 is asked for against the walks, of which the published Gaussians are 0.002 off.
        assert!(error.max_element() < 0.008, "{stretch}: {error}");
    }
    // The cheaper one is for maps whose texels are wider than the narrowest Gaussian: here they are not.
    let pixel = edge_error(&gpu, "pixel", 1.0, 1.0);
    println!("core at the pixel: edge RMS {pixel:.4}");
    assert!(pixel.max_element() < 0.01, "{pixel}");
}

#[test]
fn the_edge_check_sees_a_blur_half_as_wide_again() {
    let error = edge_error(&gpu(), "map", 1.0, 1.5);
    assert!(error.min_element() > 0.01, "went unnoticed: {error}");
}

/// Two squares side by side in the map, two texels apart, far apart in space; the left one white, the right one black.
/// Brightness of the left at its seam and of the right at its own, as shares of the light; `joined` makes them one chart.
fn at_the_seam(gpu: &Gpu, joined: bool) -> [f32; 2] {
    let mut mesh = SurfaceMesh::default();
    let gap = 1.0 / 64.0;
    for (part, x) in [-0.03_f32, 0.03].into_iter().enumerate() {
        for [s, t] in [[0.0, 0.0], [1.0, 0.0], [0.0, 1.0], [1.0, 1.0]] {
            mesh.point_of.push(mesh.points.len() as u32);
            let at = Vec3::new(x + 0.02 * (s - 0.5), 0.02 * (t - 0.5), 0.0);
            mesh.points.push(at);
            let left = if part == 0 { 0.1 } else { 0.5 + gap };
            let width = 0.4 - gap;
            mesh.uvs.push(Vec2::new(left + width * s, 0.9 - 0.8 * t));
        }
        let first = 4 * part as u32;
        for triangle in [[0, 1, 2], [1, 3, 2]] {
            mesh.triangles.push(triangle.map(|v| v + first));
        }
    }
    if joined {
        mesh.triangles.push([3, 3, 4]);
    }
    let side = 128;
    let outer = image::RgbaImage::from_fn(side, side, |x, _| {
        let lit = if x < side / 2 { 255 } else { 0 };
        image::Rgba([lit, lit, lit, 255])
    });
    let sets = [
        "surface.kind=diffusion",
        "surface.light_map_size_px=128",
        "surface.diffusion.color_in_map=1.0",
        "surface.diffusion.core=map",
    ];
    let light = "toward = [0.0, 0.0, 1.0]";
    let drawn = draw(gpu, &mesh, &mesh.points, outer, light, &sets);
    let row = &vectors(gpu, drawn.passes.diffusion().unwrap().target())[64 * 128..65 * 128];
    let inside = row[32].y;
    // The left chart ends at texel 62, the right one starts at 66; one more is gutter that a pixel's sampler reads.
    [row[62].y / inside, row[66].y / inside]
}

#[test]
fn no_light_or_dark_leaks_over_a_seam() {
    let [left, right] = at_the_seam(&gpu(), false);
    // Black is a ten thousandth of white in the map; half floats.
    assert!((left - 1.0).abs() < 2e-3, "dark leaks: {left}");
    assert!(right < 2e-3, "light leaks: {right}");
}

#[test]
fn the_seam_check_sees_charts_that_are_taken_for_one() {
    let [left, right] = at_the_seam(&gpu(), true);
    assert!(right > 4e-3, "went unnoticed: {left}, {right}");
}

#[test]
fn the_lit_side_is_bright_and_even_light_stays_even_in_every_surface() {
    let gpu = gpu();
    let mesh = surfaces::sphere(0.04, 48, 31);
    let points = surfaces::deformed(&mesh.points);
    for kind in ["wrap", "absorption", "diffusion"] {
        let kind = format!("surface.kind={kind}");
        for extra in [
            "surface.relief=1.0",
            "surface.diffusion.translucency=1.0",
            "surface.absorption.falloff=ramp",
        ] {
            for light in [
                "toward = [1.0, 0.1, 0.0]\nshadow = true",
                "at_m = [0.3, 0.0, 0.0]",
            ] {
                let drawn = draw(&gpu, &mesh, &points, white(8), light, &[&kind, extra]);
                let all = pixels(&gpu, &drawn);
                assert!(
                    all.iter().all(|(_, radiance)| radiance.is_finite()),
                    "{kind}"
                );
                let mean = |side: f32| {
                    let lit: Vec<f32> = all
                        .iter()
                        .filter(|(world, _)| side * world.x > 0.01)
                        .map(|(_, radiance)| radiance.element_sum())
                        .collect();
                    assert!(lit.len() > 200, "{kind}: {} pixels", lit.len());
                    lit.iter().sum::<f32>() / lit.len() as f32
                };
                let (right, left) = (mean(1.0), mean(-1.0));
                assert!(
                    right > 1.3 * left,
                    "{kind}, {extra}, {light}: {left}, {right}"
                );
            }
        }
    }
}
