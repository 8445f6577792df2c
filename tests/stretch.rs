//! What lies below stretched tissue: where layers appear, and how thick they are, with the metric of the deformed
//! surface and with the papers' unit frames, as the shaders read it of a drawn sheet.
//!
//! A missing adapter is a failure, not a skip: a software one (mesa-vulkan-drivers) will do.

#[path = "support/shader.rs"]
mod shader;

use glam::{Vec2, Vec3, Vec4};
use half::f16;
use palpate::geom::SurfaceMesh;
use palpate::geom::paint::TissueMaps;
use palpate::gpu::{Gpu, Timer, read_texture_rgba16f, read_texture_words};
use palpate::passes::draw::Output;
use palpate::passes::frame::FramePasses;
use palpate::passes::view::View;
use palpate::scene::{RestBox, Scene, SceneSource};
use shader::gpu;

/// A level sheet of 0.1 m, seen from above, whose texture is as large.
fn sheet(side: usize) -> SurfaceMesh {
    let mut mesh = SurfaceMesh::default();
    for row in 0..side {
        for column in 0..side {
            let uv = Vec2::new(column as f32, row as f32) / (side - 1) as f32;
            mesh.point_of.push(mesh.points.len() as u32);
            mesh.points
                .push(Vec3::new(0.1 * uv.x, 0.1 * (1.0 - uv.y), 0.0));
            mesh.uvs.push(uv);
        }
    }
    let at = |row: usize, column: usize| (row * side + column) as u32;
    for row in 0..side - 1 {
        for column in 0..side - 1 {
            let [a, b] = [at(row, column), at(row, column + 1)];
            let [c, d] = [at(row + 1, column), at(row + 1, column + 1)];
            mesh.triangles.push([a, c, b]);
            mesh.triangles.push([b, c, d]);
        }
    }
    mesh
}

/// What the shader knows of a pixel in the middle: texture coordinates a metre along x, and the layers' thickness.
struct Seen {
    u_per_m: f32,
    thickness: f32,
    radiance: Vec4,
}

fn draw(gpu: &Gpu, sets: &[&str], stretch: Vec3) -> Seen {
    let mesh = sheet(21);
    let size_px = 32;
    let map = |texel: [u8; 4]| image::RgbaImage::from_pixel(size_px, size_px, image::Rgba(texel));
    let tissue = TissueMaps {
        size_px,
        outer: map([170, 80, 60, 128]),
        normal: map([128, 128, 255, 255]),
        inner: map([140, 40, 30, 255]),
        layers: vec![map([26, 51, 128, 255]).into()],
    };
    let text = "[body]\nshape = \"slab\"\nextent_m = [0.1, 0.1, 0.01]\n[[light]]\ntoward = [0.0, 0.0, 1.0]\n\
                irradiance_w_m2 = [3.0, 3.0, 3.0]\n";
    let source = SceneSource {
        name: "sheet",
        text,
        folder: None,
    };
    let sets: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
    let scene = Scene::read(&source, &sets).expect("a sound scene");
    let rest = RestBox {
        low: Vec3::ZERO,
        high: Vec3::new(0.1, 0.1, 0.01),
    };
    let passes = FramePasses::new(
        gpu,
        &scene,
        &rest,
        &mesh,
        &tissue,
        [64, 64],
        Output::Radiance,
    )
    .expect("the passes are built");
    let points: Vec<Vec3> = mesh.points.iter().map(|&p| p * stretch).collect();
    let middle = 0.05 * stretch * Vec3::new(1.0, 1.0, 0.0);
    let view = View {
        up: Vec3::Y,
        eye: middle + 0.4 * Vec3::Z,
        target: middle,
        fov_y: 0.1,
    };
    let mut timer = Timer::new(gpu, 16);
    let mut encoder = gpu.encoder();
    passes.record(gpu, &points, &view, &[], &mut encoder, &mut timer);
    gpu.submit_and_wait(encoder);
    let detail = read_texture_words(gpu, &passes.targets.detail.texture).expect("can be read");
    let radiance = read_texture_rgba16f(gpu, &passes.target.texture).expect("can be read");
    let [_, y, u, _] = detail[32 * 64 + 32];
    let half = |bits: u32| f16::from_bits(bits as u16).to_f32();
    Seen {
        // The tangent is along x here.
        u_per_m: half(u),
        thickness: half(y >> 16),
        radiance: Vec4::from_slice(&radiance[4 * (32 * 64 + 32)..]),
    }
}

/// How deep a layer seems that lies 2 mm deep, by the parallax of a ray of 45 degrees: the ray meets the layer 2 mm
/// to the side, and what is seen there lies this far from P on the stretched surface.
fn apparent_depth_m(seen: &Seen, stretch: f32) -> f32 {
    let u = 0.002 * seen.u_per_m;
    u * 0.1 * stretch
}

#[test]
fn a_layer_seems_as_deep_as_it_lies_under_stretch_with_the_deformed_metric_and_half_deeper_with_unit_frames()
 {
    let gpu = gpu();
    for kind in ["subsurface", "gooey"] {
        let kind = format!("surface.kind={kind}");
        for (method, stretch) in [
            ("tangent", 1.0),
            ("quadric", 1.25),
            ("incremental", 1.5),
            ("tangent", 2.0),
        ] {
            let method = format!("light_path.method={method}");
            let along = Vec3::new(stretch, 1.0, 1.0);
            let metric = draw(&gpu, &[&kind, &method], along);
            let error = apparent_depth_m(&metric, stretch) / 0.002 - 1.0;
            // Half floats are good to 5e-4.
            assert!(error.abs() < 2e-3, "{kind}, {stretch}: {error}");
            let unit = draw(&gpu, &[&kind, &method, "surface.uv_metric=unit"], along);
            let error = apparent_depth_m(&unit, stretch) / 0.002 - stretch;
            assert!(
                error.abs() < 2e-3,
                "unit frames, {kind}, {stretch}: {error}"
            );
        }
    }
}

#[test]
fn layers_thin_as_the_surface_stretches_where_the_scene_asks_and_stay_where_it_does_not() {
    let gpu = gpu();
    let follow = "surface.thickness_follows_volume=true";
    for method in ["tangent", "quadric", "sampled", "depth-map"] {
        let method = format!("light_path.method={method}");
        for (stretch, exact) in [
            (Vec3::ONE, 1.0),
            (Vec3::new(1.5, 1.0, 1.0), 1.0 / 1.5),
            (Vec3::new(1.5, 1.2, 1.0), 1.0 / 1.8),
            (Vec3::new(0.8, 1.0, 1.0), 1.25),
            (Vec3::new(8.0, 8.0, 1.0), 0.25),
        ] {
            let thickness = draw(&gpu, &[&method, follow], stretch).thickness;
            assert!(
                (thickness / exact - 1.0).abs() < 2e-3,
                "{method}: {thickness} for {exact}"
            );
            assert_eq!(draw(&gpu, &[&method], stretch).thickness, 1.0);
        }
    }
}

#[test]
fn thinner_layers_are_a_change_that_shows() {
    let gpu = gpu();
    // Light that scattered once, alone.
    let seen = |sets: &[&str]| {
        let sets = [
            &["surface.multiple_scattering=0.0", "surface.wetness=0.0"],
            sets,
        ]
        .concat();
        draw(&gpu, &sets, Vec3::new(1.5, 1.2, 1.0)).radiance
    };
    let kept = seen(&["surface.thickness_follows_volume=true"]);
    let plain = seen(&[]);
    let change = (kept - plain).truncate().length() / plain.truncate().length();
    assert!(change > 0.005, "{change}");
}

#[test]
fn unit_frames_and_a_thickness_from_the_metric_exclude_each_other() {
    let text = "[body]\nshape = \"slab\"\nextent_m = [0.1, 0.1, 0.01]\n";
    let source = SceneSource {
        name: "sheet",
        text,
        folder: None,
    };
    let sets = [
        "surface.uv_metric=unit",
        "surface.thickness_follows_volume=true",
    ]
    .map(str::to_owned);
    let refusal = Scene::read(&source, &sets)
        .expect_err("is refused")
        .to_string();
    assert!(
        refusal.contains("surface.thickness_follows_volume"),
        "{refusal}"
    );
    let wrong =
        Scene::read(&source, &["surface.uv_metric=flat".to_owned()]).expect_err("is refused");
    let wrong = wrong.to_string();
    assert!(
        wrong.contains("deformed") && wrong.contains("unit"),
        "{wrong}"
    );
    let method =
        Scene::read(&source, &["light_path.method=magic".to_owned()]).expect_err("is refused");
    let method = method.to_string();
    for name in ["sampled", "quadric", "depth-map"] {
        assert!(method.contains(name), "{method}");
    }
}
