//! The gooey surface after Oat (2006) and the noise after Norberg (2010) on the GPU, against closed forms and CPU twins, on
//! sheets that are stretched; each check against something sabotaged.
//!
//! A missing adapter is a failure, not a skip: a software one (mesa-vulkan-drivers) will do.

#[allow(dead_code)] // Other tests use the rest.
#[path = "support/surfaces.rs"]
mod surfaces;

#[path = "support/shader.rs"]
mod shader;

use glam::{Vec2, Vec3, Vec4};
use image::{Rgba, RgbaImage};
use palpate::geom::SurfaceMesh;
use palpate::geom::paint::TissueMaps;
use palpate::gpu::{
    Binding, Gpu, Kernel, Timer, Wgsl, join, read_buffer, read_texture_rgba16f, storage,
};
use palpate::optics::layers::{Seen, layered};
use palpate::optics::{blur, noise};
use palpate::passes::draw::Output;
use palpate::passes::draw::Target;
use palpate::passes::frame::FramePasses;
use palpate::passes::view::View;
use palpate::scene::{RestBox, Scene, SceneSource};
use palpate::wgsl;
use shader::{gpu, sabotaged};

/// What `body` makes of each of `cases`; `clouds` stand at binding 2.
fn call(gpu: &Gpu, source: &str, body: &str, cases: &[Vec4], clouds: &Target) -> Vec<Vec4> {
    let source = source.replace("@binding(15)", "@binding(2)");
    let kernel = format!(
        "{source}
        @group(0) @binding(0) var<storage, read> cases: array<vec4f>;
        @group(0) @binding(1) var<storage, read_write> results: array<vec4f>;
        @compute @workgroup_size(64)
        fn main(@builtin(global_invocation_id) id: vec3u) {{
            let i = id.x;
            if i >= arrayLength(&results) {{ return; }}
            let a = cases[i];
            {body}
        }}"
    );
    let cases_buffer = storage(gpu, "cases", cases).unwrap();
    let results = storage(gpu, "results", &vec![Vec4::ZERO; cases.len()]).unwrap();
    let bindings = [
        Binding::Read(&cases_buffer),
        Binding::Write(&results),
        Binding::Unfiltered(&clouds.view),
    ];
    let kernel = Kernel::new(gpu, "parity", &[], &kernel, "main", &bindings).unwrap();
    let mut encoder = gpu.encoder();
    {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        kernel.dispatch(&mut pass, cases.len().div_ceil(64) as u32);
    }
    gpu.submit_and_wait(encoder);
    read_buffer(gpu, &results).unwrap()
}

/// The clouds as a texture.
fn clouds(gpu: &Gpu) -> Target {
    let side = noise::SIZE as u32;
    let format = wgpu::TextureFormat::Rgba8Unorm;
    let target = Target::new(gpu, "clouds", [side; 2], format);
    let texels: Vec<[u8; 4]> = (noise::clouds().iter())
        .map(|&[x, y]| [x, y, 0, 255])
        .collect();
    gpu.queue.write_texture(
        target.texture.as_image_copy(),
        bytemuck::cast_slice(&texels),
        wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(4 * side),
            rows_per_image: None,
        },
        target.texture.size(),
    );
    target
}

fn worst(got: &[Vec4], twin: &[Vec4]) -> f32 {
    assert_eq!(got.len(), twin.len());
    got.iter()
        .zip(twin)
        .map(|(g, t)| (*g - *t).abs().max_element())
        .fold(0.0, f32::max)
}

const NOISE: &[Wgsl] = wgsl!["frame.wgsl", "noise.wgsl"];

fn noise_difference(gpu: &Gpu, source: &str) -> f32 {
    let cases: Vec<Vec4> = (0..1024)
        .map(|i| {
            let (x, y) = ((i % 32) as f32, (i / 32) as f32);
            Vec4::new((x + 0.3) / 37.0, (y + 0.6) / 41.0, x + 0.5, y + 0.5)
        })
        .collect();
    let body = "results[i] = vec4f(chained(a.xy, 3u), gradient(a.zw));";
    let map = noise::clouds();
    let twin: Vec<Vec4> = cases
        .iter()
        .map(|a| {
            let [uv, at] = [Vec2::new(a.x, a.y), Vec2::new(a.z, a.w)];
            let [c, g] = [noise::chained(&map, uv, 3), noise::gradient(at)];
            Vec4::new(c.x, c.y, g.x, g.y)
        })
        .collect();
    worst(&call(gpu, source, body, &cases, &clouds(gpu)), &twin)
}

#[test]
fn noise_matches_the_cpu_twin() {
    let difference = noise_difference(&gpu(), &join(NOISE));
    // Clouds end at the same bytes; gradients multiply the rounding of f32 by 53.
    assert!(difference < 1e-3, "differ by {difference}");
}

#[test]
fn noise_check_sees_look_ups_that_are_not_chained() {
    let source = sabotaged(&join(NOISE), "at = bytes * size / 256.0;", "");
    assert!(noise_difference(&gpu(), &source) > 0.1);
}

const LAYERS: &[Wgsl] = wgsl!["layers.wgsl", "disc.wgsl"];

fn layered_difference(gpu: &Gpu, source: &str) -> f32 {
    let cases: Vec<Vec4> = (0..256)
        .map(|i| {
            let t = i as f32;
            Vec4::new(0.37 * t, 0.61 * t, 0.83 * t, 0.29 * t).map(f32::fract)
        })
        .collect();
    let body = "var seen = Seen(vec3f(0.0), 1.0, 1.0);
        seen = layered(seen, a.xyz, a.w, a.y);
        seen = layered(seen, a.zxy, a.x, a.y);
        results[i] = vec4f(seen.radiance.xy, seen.left, seen.lit);";
    let twin: Vec<Vec4> = cases
        .iter()
        .map(|a| {
            let above = layered(Seen::NOTHING, a.truncate(), a.w, a.y);
            let seen = layered(above, Vec3::new(a.z, a.x, a.y), a.x, a.y);
            Vec4::new(seen.radiance.x, seen.radiance.y, seen.left, seen.lit)
        })
        .collect();
    worst(&call(gpu, source, body, &cases, &clouds(gpu)), &twin)
}

#[test]
fn layers_over_layers_match_the_cpu_twin() {
    let difference = layered_difference(&gpu(), &join(LAYERS));
    assert!(difference < 1e-6, "differ by {difference}");
}

#[test]
fn the_layer_check_sees_layers_that_cast_no_shadow() {
    let source = sabotaged(
        &join(LAYERS),
        "before.lit * let_through(opacity, layer_shadow)",
        "before.lit",
    );
    assert!(layered_difference(&gpu(), &source) > 0.1);
}

#[test]
fn the_disc_of_the_pixel_is_that_of_the_twin() {
    let gpu = gpu();
    let body = "var disc = DISC; results[i] = vec4f(disc[i], 0.0, 0.0);";
    let got = call(
        &gpu,
        &join(LAYERS),
        body,
        &[Vec4::ZERO; blur::TAP_PAIRS],
        &clouds(&gpu),
    );
    let twin = blur::taps(0.0).map(|[x, y]| Vec4::new(x, y, 0.0, 0.0));
    assert!(worst(&got, &twin) < 1e-5, "{got:?}");
}

// What is drawn.

const SIZE: [u32; 2] = [64, 64];

/// Maps of 512 px: opacity of the outer layer by column, white above vertical stripes of the inner layer.
fn maps(opacity: impl Fn(u32) -> u8, inner: impl Fn(u32) -> u8, bump: u8) -> TissueMaps {
    let side = 512;
    let outer = RgbaImage::from_fn(side, side, |x, _| Rgba([255, 255, 255, opacity(x)]));
    let inner = RgbaImage::from_fn(side, side, |x, _| Rgba([inner(x), inner(x), inner(x), 255]));
    let normal = RgbaImage::from_fn(side, side, |x, _| {
        let lean = if (x / 4).is_multiple_of(2) {
            128 + bump
        } else {
            128 - bump
        };
        Rgba([lean, 128, 255, 255])
    });
    let layers = RgbaImage::from_fn(side, side, |x, _| {
        let depth = 20 + (x / 2) as u8 / 4;
        Rgba([depth, 2 * depth, 2 * depth + 20, 255])
    });
    TissueMaps {
        size_px: side,
        outer,
        normal,
        inner,
        layers: vec![layers.into()],
    }
}

/// Draws `mesh` moved to `points`, seen along −z at a slant, dry.
fn draw(
    gpu: &Gpu,
    mesh: &SurfaceMesh,
    points: &[Vec3],
    maps: &TissueMaps,
    sets: &[&str],
) -> FramePasses {
    draw_muscle(gpu, mesh, points, 1.0, 1.0, maps, sets)
}

/// The same from `near` times as far, of muscle that wants to fill `volume` times what it does at rest.
fn draw_muscle(
    gpu: &Gpu,
    mesh: &SurfaceMesh,
    points: &[Vec3],
    near: f32,
    volume: f32,
    maps: &TissueMaps,
    sets: &[&str],
) -> FramePasses {
    let text = "[body]\nshape = \"slab\"\nextent_m = [0.1, 0.1, 0.1]\n[surface]\nkind = \"gooey\"\nwetness = 0.0\n\
                [[light]]\ntoward = [0.3, 0.0, 1.0]\nirradiance_w_m2 = [3.0, 3.0, 3.0]\n";
    let source = SceneSource {
        name: "sheet",
        text,
        folder: None,
    };
    let sets: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
    let scene = Scene::read(&source, &sets).expect("a sound scene");
    let (low, high) = palpate::geom::bounds(&mesh.points);
    let rest = RestBox { low, high };
    let mut passes =
        FramePasses::new(gpu, &scene, &rest, mesh, maps, SIZE, Output::Radiance).unwrap();
    if volume != 1.0 {
        passes.mesh.set_volumes(&vec![volume; points.len()]);
    }
    let view = View {
        up: Vec3::Y,
        eye: near * Vec3::new(0.1, 0.0, 0.2),
        target: Vec3::ZERO,
        fov_y: 0.1,
    };
    let mut timer = Timer::new(gpu, 32);
    let mut encoder = gpu.encoder();
    passes.record(gpu, points, &view, &[], &mut encoder, &mut timer);
    gpu.submit_and_wait(encoder);
    passes
}

fn vectors(gpu: &Gpu, target: &Target) -> Vec<Vec4> {
    read_texture_rgba16f(gpu, &target.texture)
        .unwrap()
        .chunks_exact(4)
        .map(Vec4::from_slice)
        .collect()
}

/// The picture of a level sheet.
fn picture(gpu: &Gpu, maps: &TissueMaps, sets: &[&str]) -> Vec<Vec4> {
    let mesh = sheet(8);
    let passes = draw(gpu, &mesh, &mesh.points, maps, sets);
    let radiance = vectors(gpu, &passes.target);
    assert!(radiance.iter().all(|pixel| pixel.is_finite()), "{sets:?}");
    radiance
}

/// Root mean square difference of two pictures, as a share of the first.
fn difference(a: &[Vec4], b: &[Vec4]) -> f32 {
    let square = |v: Vec4| v.truncate().length_squared();
    let apart: f32 = a.iter().zip(b).map(|(a, b)| square(*a - *b)).sum();
    (apart / a.iter().copied().map(square).sum::<f32>()).sqrt()
}

/// A level square of 4 cm on nine tenths of its map.
fn sheet(cells: usize) -> SurfaceMesh {
    let mut mesh = SurfaceMesh::default();
    add_square(&mut mesh, cells, Vec3::ZERO, 0.04, [0.05, 0.9]);
    mesh
}

/// Adds a square of `side_m` about `middle` as a chart from `left` and of `width` in the map.
fn add_square(
    mesh: &mut SurfaceMesh,
    cells: usize,
    middle: Vec3,
    side_m: f32,
    [left, width]: [f32; 2],
) {
    let first = mesh.points.len();
    for row in 0..=cells {
        for column in 0..=cells {
            let (s, t) = (column as f32 / cells as f32, row as f32 / cells as f32);
            mesh.point_of.push(mesh.points.len() as u32);
            mesh.points
                .push(middle + side_m * Vec3::new(s - 0.5, t - 0.5, 0.0));
            mesh.uvs.push(Vec2::new(left + width * s, 0.95 - 0.9 * t));
        }
    }
    let at = |row: usize, column: usize| (first + row * (cells + 1) + column) as u32;
    for row in 0..cells {
        for column in 0..cells {
            let [a, b] = [at(row, column), at(row, column + 1)];
            let [c, d] = [at(row + 1, column), at(row + 1, column + 1)];
            mesh.triangles.extend([[a, b, c], [b, d, c]]);
        }
    }
}

const RADIUS_M: f32 = 0.004;

/// Standard deviation across [m] of an edge of light after two passes, on a sheet stretched to `stretch` of its length.
fn edge_width_m(gpu: &Gpu, stretch: f32, sets: &[&str]) -> f32 {
    let mesh = sheet(8);
    let points: Vec<Vec3> = mesh
        .points
        .iter()
        .map(|p| Vec3::new(stretch * p.x, p.y, p.z))
        .collect();
    let opacity = |x| if x < 256 { 0 } else { 255 };
    let all = [
        &[
            "surface.light_map_size_px=512",
            "surface.layer_shadow=1.0",
            "surface.blur_radius_m=0.004",
            "surface.blur_passes=2",
        ],
        sets,
    ]
    .concat();
    let passes = draw(gpu, &mesh, &points, &maps(opacity, |_| 255, 0), &all);
    let map = vectors(gpu, passes.light_map().expect("a light map").target());
    let row = &map[256 * 512 + 30..256 * 512 + 482];
    // Its fall from texel to texel is the blur of a point.
    let mut sums = [0.0_f32; 3];
    for (i, pair) in row.windows(2).enumerate() {
        let fall = pair[0].y - pair[1].y;
        let x = i as f32;
        sums[0] += fall;
        sums[1] += fall * x;
        sums[2] += fall * x * x;
    }
    let mean = sums[1] / sums[0];
    let texels = (sums[2] / sums[0] - mean * mean).sqrt();
    texels * stretch * 0.04 / (0.9 * 512.0)
}

/// What the two passes should give [m]: the mean squares of their taps add up.
fn exact_width_m() -> f32 {
    let square: f32 = [0.0, 0.5]
        .iter()
        .map(|&turn| {
            let taps = blur::taps(turn);
            2.0 * taps.iter().map(|[x, _]| x * x).sum::<f32>() / 13.0
        })
        .sum();
    RADIUS_M * square.sqrt()
}

#[test]
fn the_blur_is_as_wide_in_metres_however_the_tissue_is_stretched() {
    let gpu = gpu();
    for stretch in [0.8, 1.0, 1.25, 1.5, 2.0] {
        let error = edge_width_m(&gpu, stretch, &[]) / exact_width_m() - 1.0;
        println!("stretched to {stretch}: radius {:+.2} %", 100.0 * error);
        // Taps of 20 to 50 texels are rounded to whole ones.
        assert!(error.abs() < 0.02, "{stretch}: {error}");
    }
}

#[test]
fn the_width_check_sees_unit_frames() {
    let error = edge_width_m(&gpu(), 1.5, &["surface.uv_metric=unit"]) / exact_width_m() - 1.0;
    assert!(error > 0.45, "went unnoticed: {error}");
}

#[test]
fn the_blur_narrows_with_a_layer_that_thins() {
    let sets = ["surface.thickness_follows_volume=true"];
    let width = edge_width_m(&gpu(), 1.5, &sets);
    let error = 1.5 * width / exact_width_m() - 1.0;
    assert!(error.abs() < 0.03, "{error}");
}

#[test]
fn what_lies_below_a_clear_layer_is_seen_by_the_cosine_of_the_view() {
    let gpu = gpu();
    // Below white lies black: a clear outer layer keeps 1 − N·V of its light.
    let maps = maps(|_| 255, |_| 0, 0);
    let light = |opacity: &str| -> f32 {
        let sets = [&format!("surface.outer_opacity={opacity}")[..]];
        picture(&gpu, &maps, &sets)
            .iter()
            .map(|pixel| pixel.y)
            .sum()
    };
    let left = light("0.0") / light("1.0");
    let exact = 1.0 - 0.2 / 0.05_f32.sqrt();
    // The view is a little wide, and texels of 128 lean by 1/255.
    assert!((left - exact).abs() < 0.01, "{left}, not {exact}");
}

/// How a level sheet of muscle looks that is `scale` times as large as at rest, from `scale` times as far, when it wants
/// to fill `volume` times what it did.
fn shrunk(gpu: &Gpu, scale: f32, volume: f32, sets: &[&str]) -> Vec<Vec4> {
    let mesh = sheet(8);
    let points: Vec<Vec3> = mesh.points.iter().map(|&p| scale * p).collect();
    let all = [&["surface.thickness_follows_volume=true"], sets].concat();
    let opacity = |x| if (x / 64) % 2 == 0 { 40 } else { 160 };
    let maps = maps(opacity, stripes, 20);
    let passes = draw_muscle(gpu, &mesh, &points, scale, volume, &maps, &all);
    vectors(gpu, &passes.target)
}

#[test]
fn layers_and_blurs_grow_and_shrink_with_a_beat() {
    let gpu = gpu();
    // Parallax alone, then the light map's blur as well.
    let parallax = [
        "surface.inner_light=smooth-normal",
        "surface.inner_taps=disc",
    ];
    let blurred = ["surface.layer_shadow=1.0", "surface.blur_radius_m=0.004"];
    for sets in [&parallax, &blurred] {
        let rest = shrunk(&gpu, 1.0, 1.0, sets);
        for scale in [0.8_f32, 1.2] {
            // All lengths go as the scale, and so all of the picture stays: half floats, and taps that are rounded
            // to texels.
            let followed = difference(&rest, &shrunk(&gpu, scale, scale.powi(3), sets));
            assert!(followed < 0.01, "{scale}: {followed}");
            // Tissue that keeps the volume that it had instead.
            let kept = difference(&rest, &shrunk(&gpu, scale, 1.0, sets));
            assert!(
                kept > 5.0 * followed.max(0.004),
                "{scale}: went unnoticed, {kept}"
            );
        }
    }
}

/// Two squares beside each other in the map, four texels apart, far apart in space; the left one lit, the right one in the
/// shade of its outer layer. Light of the left one at its seam and of the right at its own, as shares of the left one's
/// middle, in the gutters; `joined` makes them one chart.
fn at_the_seam(gpu: &Gpu, joined: bool) -> [f32; 2] {
    let mut mesh = SurfaceMesh::default();
    let gap = 4.0 / 128.0;
    add_square(
        &mut mesh,
        2,
        Vec3::new(-0.03, 0.0, 0.0),
        0.02,
        [0.1, 0.4 - gap],
    );
    let left = mesh.points.len() as u32;
    add_square(&mut mesh, 2, Vec3::new(0.03, 0.0, 0.0), 0.02, [0.5, 0.4]);
    if joined {
        mesh.triangles.push([left - 1, left - 1, left]);
    }
    let opacity = |x| if x < 254 { 0 } else { 255 };
    let sets = [
        "surface.light_map_size_px=128",
        "surface.layer_shadow=1.0",
        "surface.blur_radius_m=0.003",
        "surface.blur_passes=2",
    ];
    let passes = draw(gpu, &mesh, &mesh.points, &maps(opacity, |_| 255, 0), &sets);
    let map = vectors(gpu, passes.light_map().unwrap().target());
    let row = &map[64 * 128..65 * 128];
    let inside = row[32].y;
    // The left chart ends at texel 59, the right one starts at 64; two more on each side are gutter.
    assert!(row[61].w == 1.0 && row[62].w == 1.0, "gutters are filled");
    [row[61].y / inside, row[62].y / inside]
}

#[test]
fn no_light_or_dark_leaks_over_a_seam() {
    let [left, right] = at_the_seam(&gpu(), false);
    assert!((left - 1.0).abs() < 2e-3, "dark leaks: {left}");
    assert!(right < 2e-3, "light leaks: {right}");
}

#[test]
fn the_seam_check_sees_charts_that_are_taken_for_one() {
    let [left, right] = at_the_seam(&gpu(), true);
    assert!(
        right > 0.05 || left < 0.95,
        "went unnoticed: {left}, {right}"
    );
}

#[test]
fn opaque_places_of_the_outer_layer_shade_the_light_map() {
    let gpu = gpu();
    let mesh = sheet(2);
    let maps = maps(|_| 102, |_| 255, 0);
    let light = |sets: &[&str]| {
        let passes = draw(&gpu, &mesh, &mesh.points, &maps, sets);
        let map = passes.light_map().unwrap().target();
        let side = map.texture.width() as usize;
        vectors(&gpu, map)[side / 2 * side + side / 2].y
    };
    let open = light(&[]);
    for passes in ["surface.blur_passes=0", "surface.blur_passes=2"] {
        let shaded = light(&["surface.layer_shadow=0.5", passes]);
        // Half of the opacity, 102 / 255; half floats.
        assert!((shaded / open - 0.8).abs() < 2e-3, "{shaded} of {open}");
        let thicker = light(&[
            "surface.layer_shadow=0.5",
            "surface.outer_opacity=2.0",
            passes,
        ]);
        assert!((thicker / open - 0.6).abs() < 2e-3, "{thicker} of {open}");
    }
}

fn stripes(x: u32) -> u8 {
    if (x / 24).is_multiple_of(2) { 230 } else { 60 }
}

#[test]
fn a_clear_layer_shows_the_one_below_and_an_opaque_one_hides_it() {
    let gpu = gpu();
    let maps = maps(|_| 0, stripes, 0);
    let seen = |inner: &str| picture(&gpu, &maps, &[&format!("surface.inner={inner}")]);
    let near = seen("[{ distance = 1.0 }]");
    let deep = seen("[{ distance = 2.5 }]");
    // Halves are good to 5e-4.
    let clear = seen("[{ distance = 1.0, opacity = 0.0 }, { distance = 2.5 }]");
    assert!(difference(&deep, &clear) < 1e-3);
    let opaque = seen("[{ distance = 1.0, opacity = 1.0 }, { distance = 2.5 }]");
    assert!(difference(&near, &opaque) < 1e-3);
    assert!(difference(&near, &deep) > 0.05, "they lie at two depths");
    let four = "[{ opacity = 0.3 }, { distance = 1.5, opacity = 0.3 }, { distance = 2.0, opacity = 0.3 }, { distance = 2.5 }]";
    let four = seen(four);
    let (to_near, to_deep) = (difference(&near, &four), difference(&deep, &four));
    assert!(to_near > 0.01 && to_deep > 0.01, "{to_near} {to_deep}");
}

#[test]
fn layers_shade_those_below_them() {
    let gpu = gpu();
    let maps = maps(|_| 0, |_| 200, 0);
    let mean = |deep: &str, shadow: &str| -> f32 {
        let inner = format!(
            "surface.inner=[{{ opacity = 0.5, color = [0.0, 0.0, 0.0] }}, {{ distance = 2.0, color = [{deep}, {deep}, {deep}] }}]"
        );
        picture(&gpu, &maps, &[&inner, shadow])
            .iter()
            .map(|p| p.y)
            .sum()
    };
    // What slanted views see of the outer layer.
    let outer = mean("0.0", "surface.layer_shadow=0.0");
    let open = mean("1.0", "surface.layer_shadow=0.0") - outer;
    let shaded = mean("1.0", "surface.layer_shadow=0.6") - outer;
    // The black layer lets 1 - 0.6 0.5 through; it covers all that is seen.
    assert!((shaded / open - 0.7).abs() < 5e-3, "{shaded} of {open}");
}

#[test]
fn the_disc_blurs_what_lies_below_by_its_way_to_the_eye() {
    let gpu = gpu();
    let maps = maps(|_| 0, stripes, 0);
    let contrast = |taps: &str, radius: &str| {
        let sets = [
            format!("surface.inner_taps={taps}"),
            format!("surface.inner_blur={radius}"),
            "surface.layer_distance_m=0.001".to_owned(),
        ];
        let seen = picture(&gpu, &maps, &sets.each_ref().map(String::as_str));
        let lit: Vec<f32> = seen.iter().filter(|p| p.w > 0.0).map(|p| p.y).collect();
        let mean = lit.iter().sum::<f32>() / lit.len() as f32;
        (lit.iter().map(|l| (l - mean).powi(2)).sum::<f32>() / lit.len() as f32).sqrt() / mean
    };
    let sharp = contrast("one", "2.0");
    assert!(
        (contrast("disc", "0.0") / sharp - 1.0).abs() < 1e-3,
        "no radius, no blur"
    );
    let [narrow, wide] = ["0.5", "1.5"].map(|radius| contrast("disc", radius));
    assert!(
        wide < 0.8 * narrow && narrow < sharp,
        "{wide} {narrow} {sharp}"
    );
}

#[test]
fn cheaper_lights_draw_no_light_map_and_agree_where_the_surface_is_smooth() {
    let gpu = gpu();
    let smooth = maps(|_| 0, stripes, 0);
    let by = |maps: &TissueMaps, light: &str| {
        picture(&gpu, maps, &[&format!("surface.inner_light={light}")])
    };
    let [map, bumps, normal] = ["map", "normal-map", "smooth-normal"].map(|by_| by(&smooth, by_));
    // The sheet is level and the light far: all three are the same light; texels of 128 lean by 1/255.
    assert!(
        difference(&map, &normal) < 0.01,
        "{}",
        difference(&map, &normal)
    );
    assert!(
        difference(&bumps, &normal) < 0.01,
        "{}",
        difference(&bumps, &normal)
    );
    let bumpy = maps(|_| 0, stripes, 100);
    let [bumps, normal] = ["normal-map", "smooth-normal"].map(|by_| by(&bumpy, by_));
    assert!(
        difference(&bumps, &normal) > 0.02,
        "{}",
        difference(&bumps, &normal)
    );
    let mesh = sheet(2);
    let passes = draw(
        &gpu,
        &mesh,
        &mesh.points,
        &smooth,
        &["surface.inner_light=smooth-normal"],
    );
    assert!(passes.light_map().is_none());
}

#[test]
fn noise_moves_the_march_by_its_amount_and_not_at_all_without() {
    let gpu = gpu();
    let maps = maps(|_| 128, stripes, 0);
    let march = |noise: &str, amount: &str| {
        let sets = [
            "surface.kind=subsurface".to_owned(),
            "light_path.method=tangent".to_owned(),
            format!("surface.noise={noise}"),
            format!("surface.noise_m={amount}"),
        ];
        picture(&gpu, &maps, &sets.each_ref().map(String::as_str))
    };
    let still = march("none", "0.002");
    for noise in ["clouds", "gradient"] {
        assert_eq!(difference(&still, &march(noise, "0.0")), 0.0, "{noise}");
        let [some, more] = ["0.001", "0.004"].map(|m| difference(&still, &march(noise, m)));
        assert!(some > 1e-4 && more > 1.5 * some, "{noise}: {some} {more}");
    }
}
