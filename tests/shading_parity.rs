//! The shading on the GPU does what its CPU twins do.
//!
//! Functions of files without bindings are called over lists of cases by a few lines of compute shader; the march
//! is called as the surface calls it. Differences are relative, over the range that a scene may ask for.

#[path = "support/shader.rs"]
mod shader;

use glam::{Vec3, Vec4};
use palpate::geom::SurfaceMesh;
use palpate::geom::plane::LightPathMethod;
use palpate::gpu::{
    Binding, Gpu, Kernel, Wgsl, join, read_buffer, read_texture_rgba16f, storage, uniform,
};
use palpate::optics::light_entry;
use palpate::optics::light_plane::{PlanePair, way_to_light};
use palpate::optics::light_quadric::{self, Aim, Bend};
use palpate::optics::march::{Cover, Ray, Rule, march, printed_reach_m, reach_m};
use palpate::optics::{Layer, blur, film, layers, medium, multiple, pack, stack, tone};
use palpate::passes::draw::Output;
use palpate::passes::draw::Target;
use palpate::passes::frame::FramePasses;
use palpate::passes::light_path::CoverKind;
use palpate::passes::lightmap::{BlurUniform, LightMap};
use palpate::passes::surface::Surface;
use palpate::passes::view::{FrameUniform, View};
use palpate::scene::{PlacedLight, RestBox, Scene, SceneSource, SurfaceKind, SurfaceSection};
use palpate::wgsl;
use shader::{gpu, sabotaged};

#[allow(dead_code)] // Other tests use the rest.
#[path = "support/surfaces.rs"]
mod surfaces;

/// Worst relative difference seen on llvmpipe is 4e-6, of the highlight; the rest is room for fused
/// multiply-add and a coarser exp.
const TOLERANCE: f32 = 1e-4;

/// What `body`, WGSL that turns `cases[4 i ..]` into a `vec4f`, makes of four vectors a case.
fn call(gpu: &Gpu, source: &str, body: &str, cases: &[[Vec4; 4]]) -> Vec<Vec4> {
    let kernel = format!(
        "{source}
        @group(0) @binding(0) var<storage, read> cases: array<vec4f>;
        @group(0) @binding(1) var<storage, read_write> results: array<vec4f>;
        @compute @workgroup_size(64)
        fn main(@builtin(global_invocation_id) id: vec3u) {{
            let i = id.x;
            if i >= arrayLength(&results) {{ return; }}
            let a = cases[4u * i];
            let b = cases[4u * i + 1u];
            let c = cases[4u * i + 2u];
            let d = cases[4u * i + 3u];
            {body}
        }}"
    );
    let cases_buffer = storage(gpu, "cases", cases).unwrap();
    let results = storage(gpu, "results", &vec![Vec4::ZERO; cases.len()]).unwrap();
    let kernel = Kernel::new(
        gpu,
        "parity",
        &[],
        &kernel,
        "main",
        &[Binding::Read(&cases_buffer), Binding::Write(&results)],
    )
    .unwrap();
    dispatch(gpu, &kernel, cases.len());
    read_buffer(gpu, &results).unwrap()
}

fn dispatch(gpu: &Gpu, kernel: &Kernel, threads: usize) {
    let mut encoder = gpu.encoder();
    {
        let mut pass = encoder.begin_compute_pass(&wgpu::ComputePassDescriptor::default());
        kernel.dispatch(&mut pass, threads.div_ceil(64) as u32);
    }
    gpu.submit_and_wait(encoder);
}

/// Worst difference of a component, relative to the larger of it and `floor`.
fn worst(got: &[Vec4], twin: &[Vec4], floor: f32) -> f32 {
    assert_eq!(got.len(), twin.len());
    got.iter()
        .zip(twin)
        .flat_map(|(g, t)| {
            (0..4).map(move |c| {
                let difference = (g[c] - t[c]).abs() / t[c].abs().max(floor);
                if difference.is_nan() {
                    f32::INFINITY
                } else {
                    difference
                }
            })
        })
        .fold(0.0, f32::max)
}

/// Repeatable numbers from 0 to 1.
struct Numbers(u32);

impl Numbers {
    fn next(&mut self) -> f32 {
        self.0 = self.0.wrapping_mul(1_664_525).wrapping_add(1_013_904_223);
        (self.0 >> 8) as f32 / (1 << 24) as f32
    }

    fn between(&mut self, low: f32, high: f32) -> f32 {
        low + (high - low) * self.next()
    }

    fn direction(&mut self) -> Vec3 {
        loop {
            let v = Vec3::from_array([(); 3].map(|()| self.between(-1.0, 1.0)));
            if (0.01..1.0).contains(&v.length_squared()) {
                return v.normalize();
            }
        }
    }
}

/// 500 cases made by `make`: a workgroup and a rest.
fn cases(make: impl Fn(&mut Numbers) -> [Vec4; 4]) -> Vec<[Vec4; 4]> {
    let mut numbers = Numbers(7);
    (0..500).map(|_| make(&mut numbers)).collect()
}

// Medium.

const MEDIUM: &[Wgsl] = wgsl!["medium.wgsl"];

fn phase_difference(gpu: &Gpu, source: &str) -> f32 {
    let cases = cases(|n| {
        let k = Vec4::new(n.between(-0.9, 0.9), 0.0, -0.9, 0.9);
        [Vec4::splat(n.between(-1.0, 1.0)), k, Vec4::ZERO, Vec4::ZERO]
    });
    let twin: Vec<Vec4> = cases
        .iter()
        .map(|[a, b, ..]| Vec4::from_array(b.to_array().map(|k| medium::phase(a.x, k))))
        .collect();
    let body = "results[i] = vec4f(phase(a.x, b.x), phases(a.x, b).yzw);";
    worst(&call(gpu, source, body, &cases), &twin, 1e-6)
}

#[test]
fn medium_functions_match_the_cpu_twin() {
    let gpu = gpu();
    let source = join(MEDIUM);
    let difference = phase_difference(&gpu, &source);
    assert!(difference < TOLERANCE, "phase differs by {difference}");

    let extinction = [100.0, 900.0, 2500.0, 400.0].map(Vec3::splat);
    let layers = "Layers(vec3f(100.0), vec3f(900.0), vec3f(2500.0), vec3f(400.0))";
    let ascending = |n: &mut Numbers| {
        let mut bottom = 0.0;
        Vec3::from_array([(); 3].map(|()| {
            bottom += n.between(0.0, 0.002);
            bottom
        }))
    };
    // s, cosine | bottoms
    let paths = cases(|n| {
        let path = Vec4::new(n.between(0.0, 0.01), n.between(-0.2, 1.0), 0.0, 0.0);
        [path, ascending(n).extend(0.0), Vec4::ZERO, Vec4::ZERO]
    });
    let got = call(
        &gpu,
        &source,
        &format!("results[i] = vec4f(optical_depth(a.x, a.y, b.xyz, {layers}), 0.0);"),
        &paths,
    );
    let twin: Vec<Vec4> = paths
        .iter()
        .map(|[a, b, ..]| medium::optical_depth(a.x, a.y, b.truncate(), &extinction).extend(0.0))
        .collect();
    let difference = worst(&got, &twin, 1e-3);
    assert!(
        difference < TOLERANCE,
        "optical depth differs by {difference}"
    );

    // a0, length, before, after | starts of the segment below the boundaries | its ends
    let segments = cases(|n| {
        let deep = ascending(n);
        let [start, end] = [(); 2].map(|()| n.between(0.0, 0.004));
        let after = if n.next() < 0.2 {
            medium::UNLIT
        } else {
            n.between(0.0, 8.0)
        };
        [
            Vec4::new(
                n.between(0.0, 4.0),
                n.between(1e-6, 0.006),
                n.between(0.0, 8.0),
                after,
            ),
            (start - deep).extend(0.0),
            (end - deep).extend(0.0),
            Vec4::ZERO,
        ]
    });
    let sources = [0.3, 0.5, 0.7, 0.9].map(Vec3::splat);
    let begin = format!(
        "let s = segment(vec3f(a.x), a.y, above(b.xyz, c.xyz), {layers});
        let sources = Layers(vec3f(0.3), vec3f(0.5), vec3f(0.7), vec3f(0.9));"
    );
    let got = call(
        &gpu,
        &source,
        &format!(
            "{begin}
            let g = gather(s, vec3f(a.z), vec3f(a.w), sources);
            let p = gather_at_start(s, vec3f(a.z), b.xyz, sources);
            results[i] = vec4f(g.upper.x, g.lower.y, p.upper.z + p.lower.z, s.a4.x);"
        ),
        &segments,
    );
    let twin: Vec<Vec4> = segments
        .iter()
        .map(|[a, b, c, _]| {
            let below = b.truncate();
            let shares = medium::above(below, c.truncate());
            let s = medium::segment(Vec3::splat(a.x), a.y, shares, &extinction);
            let (before, after) = (Vec3::splat(a.z), Vec3::splat(a.w));
            let g = medium::gather(&s, before, after, &sources);
            let p = medium::gather_at_start(&s, before, below, &sources);
            Vec4::new(
                (g[0] + g[1]).x,
                (g[2] + g[3]).y,
                p.iter().sum::<Vec3>().z,
                s[4].x,
            )
        })
        .collect();
    // Differences of exponentials lose digits where little is left: below 1e-3 of the light they count as that.
    let difference = worst(&got, &twin, 1e-3);
    assert!(difference < 1e-3, "a segment differs by {difference}");
}

#[test]
fn medium_parity_check_rejects_the_wrong_sign_of_the_asymmetry() {
    let source = sabotaged(&join(MEDIUM), "1.0 + k * cos_angle", "1.0 - k * cos_angle");
    let difference = phase_difference(&gpu(), &source);
    assert!(
        difference > 0.5,
        "backwards scattering went unnoticed: {difference}"
    );
}

// Light planes.

fn light_plane_difference(gpu: &Gpu, source: &str) -> f32 {
    // N·n, N·eye, n·eye, h | t, blend, N·light, n·light
    let cases = cases(|n| {
        let normal = n.direction();
        let plane = (normal + 0.7 * n.direction()).normalize();
        let (to_eye, to_light) = (n.direction(), n.direction());
        [
            Vec4::new(
                normal.dot(plane),
                normal.dot(to_eye),
                plane.dot(to_eye),
                n.between(-0.001, 0.001),
            ),
            Vec4::new(
                n.between(0.0, 0.01),
                n.next(),
                normal.dot(to_light),
                plane.dot(to_light),
            ),
            Vec4::ZERO,
            Vec4::ZERO,
        ]
    });
    let body = "let way = way_to_light(PlanePair(a.x, a.y, a.z, a.w), b.x, b.y, b.z, b.w);
        results[i] = vec4f(way, 0.0, 0.0);";
    let twin: Vec<Vec4> = cases
        .iter()
        .map(|[a, b, ..]| {
            let pair = PlanePair {
                normals: a.x,
                tangent_eye: a.y,
                plane_eye: a.z,
                offset_m: a.w,
            };
            let (s, cosine) = way_to_light(&pair, b.x, b.y, b.z, b.w).unwrap_or((0.0, 0.0));
            Vec4::new(s, cosine, 0.0, 0.0)
        })
        .collect();
    worst(&call(gpu, source, body, &cases), &twin, 1e-5)
}

#[test]
fn light_planes_match_the_cpu_twin() {
    let difference = light_plane_difference(&gpu(), &join(wgsl!["pack.wgsl", "light_plane.wgsl"]));
    // A way that starts on the plane is a difference of lengths: 1e-3 of 10 micrometres is 10 nanometres.
    assert!(difference < 1e-3, "differ by {difference}");
}

#[test]
fn light_plane_parity_check_rejects_an_offset_without_its_sign() {
    let source = join(wgsl!["pack.wgsl", "light_plane.wgsl"]);
    let source = sabotaged(
        &source,
        "blend * pair.offset *",
        "blend * abs(pair.offset) *",
    );
    assert!(light_plane_difference(&gpu(), &source) > 0.1);
}

// Light quadrics.

/// Worst difference of ways and cosines. Where light grazes, whether it enters at all hangs on the last bit: those
/// cases are passed over.
fn light_quadric_difference(gpu: &Gpu, source: &str) -> f32 {
    // bends, t | to eye | to light
    let cases: Vec<_> = cases(|n| {
        let bends = Vec3::from_array([(); 3].map(|()| n.between(-60.0, 60.0)));
        let upwards = |d: Vec3| Vec3::new(d.x, d.y, d.z.abs());
        [
            bends.extend(n.between(0.0, 0.006)),
            upwards(n.direction()).extend(0.0),
            n.direction().extend(0.0),
            Vec4::ZERO,
        ]
    });
    let ways = |[a, b, c, _]: &[Vec4; 4]| {
        let bend = Bend {
            bends: a.truncate(),
            to_eye: b.truncate(),
        };
        let aim = Aim {
            to_light: c.truncate(),
        };
        light_quadric::way_to_light(&bend, &aim, a.w).unwrap_or((0.0, 0.0))
    };
    let grazing = |case: &[Vec4; 4]| (0.0..0.05).contains(&ways(case).1);
    let unlit = |case: &[Vec4; 4]| {
        // Surely unlit: still so with a light a little higher or lower.
        [-0.02, 0.0, 0.02].iter().all(|turn| {
            let mut turned = *case;
            turned[2] = (case[2].truncate() + *turn * Vec3::Z)
                .normalize()
                .extend(0.0);
            ways(&turned).1 == 0.0
        })
    };
    let cases: Vec<_> = cases
        .into_iter()
        .filter(|case| !grazing(case) || unlit(case))
        .collect();
    assert!(
        cases.len() > 300,
        "most cases are clear ones: {}",
        cases.len()
    );
    let body = "let bend = bend_of(a.xyz, b.xyz);
        let way = way_to_light(bend, aim_of(bend, c.xyz), a.w);
        results[i] = vec4f(way, 0.0, 0.0);";
    let twin: Vec<Vec4> = cases
        .iter()
        .map(|case| {
            let (s, cosine) = ways(case);
            Vec4::new(s, cosine, 0.0, 0.0)
        })
        .collect();
    worst(&call(gpu, source, body, &cases), &twin, 1e-5)
}

#[test]
fn light_quadrics_match_the_cpu_twin() {
    let source = join(wgsl!["pack.wgsl", "light_quadric.wgsl"]);
    let difference = light_quadric_difference(&gpu(), &source);
    // As with planes; and a root of a small difference doubles its rounding.
    assert!(difference < 2e-3, "differ by {difference}");
}

#[test]
fn light_quadric_parity_check_rejects_the_other_root_and_a_lost_bend() {
    let gpu = gpu();
    let source = join(wgsl!["pack.wgsl", "light_quadric.wgsl"]);
    for (from, to) in [
        ("(root - rise)", "(root + rise)"),
        ("- 2.0 * depth * aim.light_light", ""),
        ("+ t * aim.eye_light", "- t * aim.eye_light"),
        ("0.5 * t * t * bend.eye_eye", "t * t * bend.eye_eye"),
        ("- t * bend.of_eye", ""),
    ] {
        let difference = light_quadric_difference(&gpu, &sabotaged(&source, from, to));
        assert!(difference > 0.05, "{to} went unnoticed: {difference}");
    }
}

// Entries read from depth maps.

fn entry_difference(gpu: &Gpu, source: &str) -> f32 {
    // entry, slack | normal | at | to light
    let cases = cases(|n| {
        let near = |n: &mut Numbers| 0.01 * n.direction() * n.next();
        [
            near(n).extend(n.between(0.0, 0.002)),
            n.direction().extend(0.0),
            near(n).extend(0.0),
            n.direction().extend(0.0),
        ]
    });
    let body = "results[i] = vec4f(way_from_entry(a.xyz, b.xyz, c.xyz, d.xyz, a.w), 0.0, 0.0);";
    let twin: Vec<Vec4> = cases
        .iter()
        .map(|[a, b, c, d]| {
            let [entry, normal, at, to_light] = [a, b, c, d].map(|v| v.truncate());
            let way = light_entry::way_from_entry(entry, normal, at, to_light, a.w);
            let (s, cosine) = way.unwrap_or((0.0, 0.0));
            Vec4::new(s, cosine, 0.0, 0.0)
        })
        .collect();
    worst(&call(gpu, source, body, &cases), &twin, 1e-4)
}

#[test]
fn ways_from_entries_match_the_cpu_twin() {
    let difference = entry_difference(&gpu(), &join(wgsl!["light_entry.wgsl"]));
    assert!(difference < TOLERANCE, "differ by {difference}");
}

#[test]
fn entry_parity_check_rejects_a_cut_across_the_light_and_a_lost_slack() {
    let gpu = gpu();
    let source = join(wgsl!["light_entry.wgsl"]);
    for (from, to) in [
        ("dot(way - along * to_light, normal) / cosine", "0.0"),
        ("below > -slack_m", "below > 0.0"),
    ] {
        assert!(
            entry_difference(&gpu, &sabotaged(&source, from, to)) > 0.1,
            "{to}"
        );
    }
}

// Parallax.

fn parallax_difference(gpu: &Gpu, source: &str) -> f32 {
    // to eye | relief | normal | distance
    let cases = cases(|n| {
        let normal = n.direction();
        let relief = (normal + 0.4 * n.direction()).normalize();
        let side = n.direction();
        let to_eye = if side.dot(normal) < 0.0 { -side } else { side };
        [
            to_eye.extend(0.0),
            relief.extend(0.0),
            normal.extend(0.0),
            Vec4::splat(n.between(0.0, 0.005)),
        ]
    });
    let body = "results[i] = transmission(a.xyz, b.xyz, c.xyz, d.x);";
    let twin: Vec<Vec4> = cases
        .iter()
        .map(|[a, b, c, d]| {
            let (step, way) = layers::transmission(a.truncate(), b.truncate(), c.truncate(), d.x);
            step.extend(way)
        })
        .collect();
    worst(&call(gpu, source, body, &cases), &twin, 1e-3)
}

#[test]
fn parallax_matches_the_cpu_twin() {
    let difference = parallax_difference(&gpu(), &join(wgsl!["layers.wgsl"]));
    assert!(difference < TOLERANCE, "differ by {difference}");
}

#[test]
fn parallax_parity_check_rejects_a_way_that_leaves_the_body() {
    let source = join(wgsl!["layers.wgsl"]);
    let source = sabotaged(&source, "mirrored - 2.0 *", "mirrored - 0.0 *");
    assert!(parallax_difference(&gpu(), &source) > 0.1);
}

// Film.

fn film_difference(gpu: &Gpu, source: &str) -> f32 {
    // normal, roughness | to light, wrap | to eye, cosine
    let cases = cases(|n| {
        let normal = n.direction();
        let facing = |d: Vec3| if d.dot(normal) < 0.0 { -d } else { d };
        [
            normal.extend(n.between(0.05, 1.0)),
            facing(n.direction()).extend(n.next()),
            facing(n.direction()).extend(n.between(-1.0, 1.0)),
            Vec4::ZERO,
        ]
    });
    let body = "results[i] = vec4f(
            fresnel(c.w),
            highlight(a.xyz, b.xyz, c.xyz, a.w),
            wrapped(c.w, vec3f(b.w)).y,
            0.0,
        );";
    let twin: Vec<Vec4> = cases
        .iter()
        .map(|[a, b, c, _]| {
            let [normal, to_light, to_eye] = [a, b, c].map(|v| v.truncate());
            Vec4::new(
                film::fresnel(c.w),
                film::highlight(normal, to_light, to_eye, a.w),
                film::wrapped(c.w, b.w),
                0.0,
            )
        })
        .collect();
    worst(&call(gpu, source, body, &cases), &twin, 1e-5)
}

#[test]
fn film_matches_the_cpu_twin() {
    let difference = film_difference(&gpu(), &join(wgsl!["film.wgsl"]));
    assert!(difference < 1e-3, "differ by {difference}");
}

#[test]
fn film_parity_check_rejects_a_roughness_that_is_not_squared() {
    let source = join(wgsl!["film.wgsl"]);
    let source = sabotaged(
        &source,
        "let a = roughness * roughness;",
        "let a = roughness;",
    );
    assert!(film_difference(&gpu(), &source) > 0.1);
}

// Light scattered more than once.

fn often_difference(gpu: &Gpu, source: &str) -> f32 {
    // to the light, to the eye, cosines | r0 | around
    let cases = cases(|n| {
        let three =
            |n: &mut Numbers, high: f32| Vec3::from_array([(); 3].map(|()| n.between(0.0, high)));
        [
            Vec4::new(n.between(-1.0, 1.0), n.next(), 0.0, 0.0),
            three(n, 0.95).extend(0.0),
            three(n, 1.0).extend(0.0),
            Vec4::ZERO,
        ]
    });
    let twin: Vec<Vec4> = cases
        .iter()
        .map(|[a, b, c, _]| multiple::often(a.x, a.y, b.truncate(), c.truncate()).extend(0.0))
        .collect();
    let body = "results[i] = vec4f(often(a.x, a.y, b.xyz, c.xyz), 0.0);";
    // What is a hundredth of the brightest or less is a difference of numbers near one.
    worst(&call(gpu, source, body, &cases), &twin, 1e-2)
}

#[test]
fn multiple_scattering_matches_the_cpu_twin() {
    let difference = often_difference(&gpu(), &join(wgsl!["multiple.wgsl"]));
    assert!(difference < 1e-3, "differ by {difference}");
}

#[test]
fn multiple_scattering_parity_check_rejects_a_lost_cosine_and_the_first_order() {
    let gpu = gpu();
    let source = join(wgsl!["multiple.wgsl"]);
    for (from, to) in [
        ("(0.5 - r0 * c)", "(0.5 - r0)"),
        ("(both - 1.0)", "both"),
        ("/ (1.0 + around)", ""),
    ] {
        let difference = often_difference(&gpu, &sabotaged(&source, from, to));
        assert!(difference > 0.02, "{to} went unnoticed: {difference}");
    }
}

// Packed directions.

fn packed_difference(gpu: &Gpu, source: &str) -> f32 {
    let cases = cases(|n| {
        [
            n.direction().extend(0.0),
            Vec4::ZERO,
            Vec4::ZERO,
            Vec4::ZERO,
        ]
    });
    let body = "results[i] = vec4f(from_octahedral(octahedral(3.0 * a.xyz)), 0.0);";
    let twin: Vec<Vec4> = cases
        .iter()
        .map(|[a, ..]| pack::from_octahedral(pack::octahedral(a.truncate())).extend(0.0))
        .collect();
    worst(&call(gpu, source, body, &cases), &twin, 1.0)
}

#[test]
fn packed_directions_match_the_cpu_twin() {
    let difference = packed_difference(&gpu(), &join(wgsl!["pack.wgsl"]));
    // A step of 16 bits is 3e-5; where a coordinate lies between two, rounding may differ.
    assert!(difference < 1e-4, "differ by {difference}");
}

#[test]
fn packed_parity_check_rejects_a_lower_half_that_is_not_folded() {
    let source = join(wgsl!["pack.wgsl"]);
    let source = sabotaged(&source, "if direction.z < 0.0 {", "if direction.z < -2.0 {");
    assert!(packed_difference(&gpu(), &source) > 0.1);
}

// Tone map.

fn tone_difference(gpu: &Gpu, source: &str) -> f32 {
    let cases = cases(|n| {
        let light = Vec3::from_array([(); 3].map(|()| 10.0_f32.powf(n.between(-6.0, 3.0)) - 1e-4));
        [light.extend(0.0), Vec4::ZERO, Vec4::ZERO, Vec4::ZERO]
    });
    let body = "results[i] = vec4f(displayed(a.xyz), 0.0);";
    let twin: Vec<Vec4> = cases
        .iter()
        .map(|[a, ..]| tone::displayed(a.truncate()).extend(0.0))
        .collect();
    worst(&call(gpu, source, body, &cases), &twin, 0.01)
}

#[test]
fn tone_map_matches_the_cpu_twin() {
    let difference = tone_difference(&gpu(), &join(wgsl!["tone.wgsl"]));
    // A tenth of a step of 8 bits; roots are good to 1e-6.
    assert!(difference < 4e-4, "differ by {difference}");
}

#[test]
fn tone_map_parity_check_rejects_a_missing_srgb_curve() {
    let source = join(wgsl!["tone.wgsl"]);
    let source = sabotaged(
        &source,
        "return encoded(filmic(radiance));",
        "return filmic(radiance);",
    );
    assert!(tone_difference(&gpu(), &source) > 0.1);
}

// Blur.

fn blur_difference(gpu: &Gpu, source: &str) -> f32 {
    const SIZE: usize = 32;
    let mut numbers = Numbers(3);
    // Two charts with a gap between them, in a metric that changes from texel to texel.
    let map: Vec<Vec4> = (0..SIZE * SIZE)
        .map(|i| {
            let chart = match (i % SIZE).cmp(&(SIZE / 2)) {
                std::cmp::Ordering::Less => 1.0,
                std::cmp::Ordering::Equal => 0.0,
                std::cmp::Ordering::Greater => 2.0,
            };
            let light = Vec3::new(numbers.next(), numbers.next(), numbers.next());
            if chart == 0.0 {
                Vec4::ZERO
            } else {
                light.extend(chart)
            }
        })
        .collect();
    let metrics: Vec<Vec4> = (0..SIZE * SIZE)
        .map(|i| {
            let row = (i / SIZE) as f32 / SIZE as f32;
            Vec4::new(20.0 + 10.0 * row, 7.0 * row, 25.0, 1.2 - 0.4 * row)
        })
        .collect();
    let (taps, radius_m) = (blur::taps(0.7), 0.007);
    let knobs = BlurUniform {
        taps,
        radius_m,
        pad0: 0.0,
        pad1: 0.0,
        pad2: 0.0,
    };
    let [target, metric] = [&map, &metrics].map(|texels| {
        let format = wgpu::TextureFormat::Rgba32Float;
        let target = Target::new(gpu, "light map", [SIZE as u32; 2], format);
        gpu.queue.write_texture(
            target.texture.as_image_copy(),
            bytemuck::cast_slice(texels),
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(16 * SIZE as u32),
                rows_per_image: None,
            },
            target.texture.size(),
        );
        target
    });
    let kernel = format!(
        "{source}
        @group(0) @binding(3) var<storage, read_write> results: array<vec4f>;
        @compute @workgroup_size(64)
        fn main(@builtin(global_invocation_id) id: vec3u) {{
            results[id.x] = blurred(vec2i(vec2u(id.x % {SIZE}u, id.x / {SIZE}u)));
        }}"
    );
    let results = storage(gpu, "results", &vec![Vec4::ZERO; map.len()]).unwrap();
    let kernel = Kernel::new(
        gpu,
        "blur parity",
        &[],
        &kernel,
        "main",
        &[
            Binding::Uniform(&uniform(gpu, "taps", &knobs)),
            Binding::Unfiltered(&target.view),
            Binding::Unfiltered(&metric.view),
            Binding::Write(&results),
        ],
    )
    .unwrap();
    dispatch(gpu, &kernel, map.len());
    let twin = blur::blurred(&map, &metrics, SIZE, &taps, radius_m);
    worst(&read_buffer(gpu, &results).unwrap(), &twin, 1.0)
}

#[test]
fn blur_matches_the_cpu_twin() {
    let difference = blur_difference(&gpu(), &join(LightMap::BLUR_WGSL));
    assert!(difference < TOLERANCE, "differ by {difference}");
}

#[test]
fn blur_parity_check_rejects_taps_without_their_opposites() {
    let source = sabotaged(&join(LightMap::BLUR_WGSL), "p.rgb + q.rgb", "2.0 * p.rgb");
    assert!(blur_difference(&gpu(), &source) > 0.1);
}

// The march, as the surface calls it.

/// Layer map: the same boundaries everywhere, as bytes.
const BOUNDARIES: [u8; 4] = [26, 51, 128, 255];

fn section() -> SurfaceSection {
    SurfaceSection {
        layer_depth_max_m: 0.005,
        ..SurfaceSection::default()
    }
}

fn far_light(toward: Vec3) -> PlacedLight {
    PlacedLight {
        place: toward,
        is_point: false,
        power: Vec3::ONE,
        shadow: false,
    }
}

/// Worst difference of the march by `rule` from its twin, relative to the brightest case.
fn march_difference(gpu: &Gpu, source: &str, cover: CoverKind, rule: Rule, samples: u32) -> f32 {
    let section = section();
    let to_light = Vec3::new(0.3, 0.5, 0.8).normalize();
    let view = View {
        up: Vec3::Y,
        eye: Vec3::Z,
        target: Vec3::ZERO,
        fov_y: 0.5,
    };
    let frame = FrameUniform::new(
        &view,
        [64; 2],
        &[far_light(to_light)],
        &section,
        glam::Mat4::IDENTITY,
    );
    let quadrature = match rule {
        Rule::ByLayer => 0,
        Rule::ClosedForm => 1,
        Rule::Published => 2,
    };
    let mirrored = format!(
        "const MIRRORED: u32 = {}u;",
        u32::from(rule == Rule::Published)
    );
    let source = source
        .replace("override MIRRORED: u32 = 0u;", &mirrored)
        .replace(
            "override QUADRATURE: u32 = 0u;",
            &format!("const QUADRATURE: u32 = {quadrature}u;"),
        )
        .replace(
            "override SAMPLES: u32 = 4u;",
            &format!("const SAMPLES: u32 = {samples}u;"),
        )
        .replace(
            "override PIECES: u32 = 1u;",
            &format!("const PIECES: u32 = {}u;", samples.div_ceil(4)),
        );
    // The last two vectors of a case are the plane, or the bends and the tangent of the paraboloid.
    let make_cover = match cover {
        CoverKind::Planes => {
            "let pair = PlanePair(
                dot(normal, plane.xyz), dot(normal, to_eye), dot(plane.xyz, to_eye), plane.w);
            let cover = Cover(normal, plane.xyz, pair);"
        }
        CoverKind::DepthMaps => unreachable!("its entries are read"),
        CoverKind::Quadrics => {
            "let tangent = cases[4u * i + 3u].xyz;
            let bitangent = cross(normal, tangent);
            let bend = bend_of(1e3 * plane.www * vec3f(50.0, 20.0, 90.0),
                in_frame(tangent, bitangent, normal, to_eye));
            let cover = Cover(tangent, bitangent, normal, bend);"
        }
    };
    let kernel = format!(
        "{source}
        @group(0) @binding(11) var<storage, read> cases: array<vec4f>;
        @group(0) @binding(12) var<storage, read_write> results: array<vec4f>;
        @compute @workgroup_size(64)
        fn main(@builtin(global_invocation_id) id: vec3u) {{
            let i = id.x;
            if i >= arrayLength(&results) {{ return; }}
            let normal = cases[4u * i].xyz;
            let plane = cases[4u * i + 1u];
            let to_eye = cases[4u * i + 2u].xyz;
            {make_cover}
            let ray = Ray(vec3f(0.0), to_eye, dot(normal, to_eye), cover, vec2f(0.5), vec2f(0.0),
                frame.layer_depth_max_m);
            let got = single_scattering(ray, 1.0);
            results[i] = vec4f(got.upper + got.lower, 0.0);
        }}"
    );
    // normal | plane, offset | to eye
    let cases = cases(|n| {
        let normal = (to_light + 0.9 * n.direction()).normalize();
        let plane = (normal + 0.3 * n.direction()).normalize();
        let side = n.direction();
        let to_eye = if side.dot(normal) < 0.05 {
            (normal + 0.5 * side).normalize()
        } else {
            side
        };
        [
            normal.extend(0.0),
            plane.extend(n.between(-5e-4, 5e-4)),
            to_eye.extend(0.0),
            normal.any_orthonormal_vector().extend(0.0),
        ]
    });
    let twin: Vec<Vec4> = cases
        .iter()
        .map(|case| twin_of_march(case, cover, to_light, &section, rule, samples))
        .collect();

    let rgba8 = wgpu::TextureFormat::Rgba8Unorm;
    let image = Target::new(gpu, "any map", [4; 2], rgba8);
    gpu.queue.write_texture(
        image.texture.as_image_copy(),
        &BOUNDARIES.repeat(16),
        wgpu::TexelCopyBufferLayout {
            offset: 0,
            bytes_per_row: Some(16),
            rows_per_image: None,
        },
        image.texture.size(),
    );
    let words = Target::new(gpu, "no words", [1; 2], wgpu::TextureFormat::Rgba32Uint);
    let depth = Target::new(gpu, "no depth", [1; 2], wgpu::TextureFormat::Depth32Float);
    let sampler = gpu.device.create_sampler(&wgpu::SamplerDescriptor {
        mag_filter: wgpu::FilterMode::Linear,
        ..Default::default()
    });
    let cases_buffer = storage(gpu, "cases", &cases).unwrap();
    let results = storage(gpu, "results", &vec![Vec4::ZERO; cases.len()]).unwrap();
    let kernel = Kernel::new(
        gpu,
        "march parity",
        &[],
        &kernel,
        "main",
        &[
            Binding::Uniform(&uniform(gpu, "frame", &frame)),
            Binding::Integers(&words.view),
            Binding::Integers(&words.view),
            Binding::Depth(&depth.view),
            Binding::Sampler(&sampler),
            Binding::Texture(&image.view),
            Binding::Texture(&image.view),
            Binding::Texture(&image.view),
            Binding::Texture(&image.view),
            Binding::Texture(&image.view),
            Binding::Depth(&depth.view),
            Binding::Read(&cases_buffer),
            Binding::Write(&results),
        ],
    )
    .unwrap();
    dispatch(gpu, &kernel, cases.len());
    let brightest = twin.iter().map(|v| v.max_element()).fold(0.0, f32::max);
    worst(
        &read_buffer(gpu, &results).unwrap(),
        &twin,
        0.01 * brightest,
    )
}

fn twin_of_march(
    [normal, plane, to_eye, tangent]: &[Vec4; 4],
    cover: CoverKind,
    to_light: Vec3,
    section: &SurfaceSection,
    rule: Rule,
    samples: u32,
) -> Vec4 {
    let [normal, plane_normal, to_eye, tangent] =
        [normal, plane, to_eye, tangent].map(|v| v.truncate());
    let layers: [Layer; 4] = std::array::from_fn(|j| section.layers[j].into());
    let clearest = layers
        .iter()
        .map(|layer| layer.extinction_per_m().min_element())
        .fold(f32::INFINITY, f32::min);
    let in_frame = |d: Vec3| {
        let bitangent = normal.cross(tangent);
        Vec3::new(tangent.dot(d), bitangent.dot(d), normal.dot(d))
    };
    let cover = match cover {
        CoverKind::Planes => Cover::Planes {
            pair: PlanePair {
                normals: normal.dot(plane_normal),
                tangent_eye: normal.dot(to_eye),
                plane_eye: plane_normal.dot(to_eye),
                offset_m: plane.w,
            },
            tangent_light: normal.dot(to_light),
            plane_light: plane_normal.dot(to_light),
        },
        CoverKind::DepthMaps => unreachable!("its entries are read"),
        CoverKind::Quadrics => Cover::Quadric {
            bend: Bend {
                bends: 1e3 * plane.w * Vec3::new(50.0, 20.0, 90.0),
                to_eye: in_frame(to_eye),
            },
            aim: Aim {
                to_light: in_frame(to_light),
            },
        },
    };
    let deepest_m = section.layer_depth_max_m;
    let reach_m = match rule {
        Rule::Published => printed_reach_m(deepest_m, &cover),
        _ => reach_m(deepest_m, normal.dot(to_eye), 8.0 / clearest).min(cover.exit_m()),
    };
    let ray = Ray {
        cover,
        light_eye: to_light.dot(to_eye),
        reach_m,
    };
    let [r, g, b, _] = BOUNDARIES.map(|byte| section.layer_depth_max_m * f32::from(byte) / 255.0);
    march(&ray, &layers, |_| Vec3::new(r, g, b), samples, rule).extend(0.0)
}

#[test]
fn march_matches_the_cpu_twin() {
    let gpu = gpu();
    for cover in [CoverKind::Planes, CoverKind::Quadrics] {
        let source = join(Surface::wgsl(SurfaceKind::Subsurface, cover));
        for (rule, samples) in [
            (Rule::ByLayer, 4),
            (Rule::ByLayer, 8),
            (Rule::ClosedForm, 1),
            (Rule::ClosedForm, 10),
            (Rule::Published, 23),
        ] {
            let difference = march_difference(&gpu, &source, cover, rule, samples);
            // Sums of differences of exponentials. (A published sample on a boundary would be in either layer: 23
            // equal steps have none there.)
            assert!(
                difference < 2e-3,
                "{cover:?}, {rule:?} with {samples}: differ by {difference}"
            );
        }
    }
}

#[test]
fn march_parity_check_rejects_planes_blended_the_wrong_way_round() {
    // François' Algorithm 2 against his eq. 9.
    let source = sabotaged(
        &join(Surface::wgsl(SurfaceKind::Subsurface, CoverKind::Planes)),
        "let rest = 1.0 - blend;",
        "let rest = blend;",
    );
    let difference = march_difference(&gpu(), &source, CoverKind::Planes, Rule::ClosedForm, 10);
    assert!(
        difference > 0.02,
        "swapped planes went unnoticed: {difference}"
    );
}

#[test]
fn march_parity_check_rejects_a_march_that_goes_on_outside_the_body() {
    let source = sabotaged(
        &join(Surface::wgsl(SurfaceKind::Subsurface, CoverKind::Quadrics)),
        "return max(exit, 1e-6);",
        "return 1e6;",
    );
    let difference = march_difference(&gpu(), &source, CoverKind::Quadrics, Rule::ClosedForm, 10);
    assert!(difference > 0.02, "an exit went unnoticed: {difference}");
}

/// Worst difference of the march through eight layers of two maps from its twin, relative to the brightest case.
fn eight_layers_difference(gpu: &Gpu, source: &str, rule: Rule, samples: u32) -> f32 {
    const BYTES: [u8; 8] = [20, 45, 70, 100, 130, 165, 205, 255];
    let mut section = section();
    section.layers = (0..8)
        .map(|j| {
            let mut layer = SurfaceSection::default().layers[j % 4];
            layer.asymmetry = 0.1 * j as f32 - 0.3;
            layer.scattering_per_m[j % 3] += 900.0;
            layer
        })
        .collect();
    let to_light = Vec3::new(0.3, 0.5, 0.8).normalize();
    let view = View {
        up: Vec3::Y,
        eye: Vec3::Z,
        target: Vec3::ZERO,
        fov_y: 0.5,
    };
    let lights = [far_light(to_light)];
    let frame = FrameUniform::new(&view, [64; 2], &lights, &section, glam::Mat4::IDENTITY);
    let quadrature = match rule {
        Rule::ByLayer => 0,
        Rule::ClosedForm => 1,
        Rule::Published => 2,
    };
    let set = |source: String, name: &str, was: u32, value: u32| {
        let from = format!("override {name}: u32 = {was}u;");
        sabotaged(&source, &from, &format!("const {name}: u32 = {value}u;"))
    };
    let source = set(source.to_owned(), "QUADRATURE", 0, quadrature);
    let source = set(source, "SAMPLES", 4, samples);
    let source = set(source, "PIECES", 1, samples.div_ceil(8));
    let source = set(source, "MIRRORED", 0, u32::from(rule == Rule::Published));
    let kernel = format!(
        "{source}
        @group(0) @binding(11) var<storage, read> cases: array<vec4f>;
        @group(0) @binding(12) var<storage, read_write> results: array<vec4f>;
        @compute @workgroup_size(64)
        fn main(@builtin(global_invocation_id) id: vec3u) {{
            let i = id.x;
            if i >= arrayLength(&results) {{ return; }}
            let normal = cases[2u * i].xyz;
            let to_eye = cases[2u * i + 1u].xyz;
            let cosine = dot(normal, to_eye);
            let cover = Cover(normal, normal, PlanePair(1.0, cosine, cosine, 0.0));
            let ray = Ray(vec3f(0.0), to_eye, cosine, cover, vec2f(0.5), vec2f(0.0), frame.layer_depth_max_m);
            let got = single_scattering(ray, 1.0);
            results[i] = vec4f(got.upper + got.lower, 0.0);
        }}"
    );
    let mut numbers = Numbers(7);
    let cases: Vec<[Vec4; 2]> = (0..256)
        .map(|_| {
            let normal = (to_light + 0.8 * numbers.direction()).normalize();
            let to_eye = (normal + 0.8 * numbers.direction()).normalize();
            [normal.extend(0.0), to_eye.extend(0.0)]
        })
        .collect();
    let layers: Vec<Layer> = section.layers.iter().map(|&layer| layer.into()).collect();
    let clearest = layers
        .iter()
        .map(|layer| layer.extinction_per_m().min_element())
        .fold(f32::INFINITY, f32::min);
    let deepest_m = section.layer_depth_max_m;
    let bottoms = BYTES.map(|byte| deepest_m * f32::from(byte) / 255.0);
    let twin: Vec<Vec4> = cases
        .iter()
        .map(|[normal, to_eye]| {
            let (normal, to_eye) = (normal.truncate(), to_eye.truncate());
            let cos_light = normal.dot(to_light);
            let cover = Cover::Planes {
                pair: PlanePair::tangent(normal.dot(to_eye)),
                tangent_light: cos_light,
                plane_light: cos_light,
            };
            let ray = Ray {
                cover,
                light_eye: to_light.dot(to_eye),
                reach_m: match rule {
                    Rule::Published => printed_reach_m(deepest_m, &cover),
                    _ => reach_m(deepest_m, normal.dot(to_eye), 8.0 / clearest),
                },
            };
            stack::march(&ray, &layers, |_| bottoms.to_vec(), samples, rule).extend(0.0)
        })
        .collect();
    let map = |bytes: &[u8]| {
        let image = Target::new(gpu, "layers", [4; 2], wgpu::TextureFormat::Rgba8Unorm);
        gpu.queue.write_texture(
            image.texture.as_image_copy(),
            &bytes.repeat(16),
            wgpu::TexelCopyBufferLayout {
                offset: 0,
                bytes_per_row: Some(16),
                rows_per_image: None,
            },
            image.texture.size(),
        );
        image
    };
    let [upper, lower] = [map(&BYTES[..4]), map(&BYTES[4..])];
    let words = Target::new(gpu, "no words", [1; 2], wgpu::TextureFormat::Rgba32Uint);
    let depth = Target::new(gpu, "no depth", [1; 2], wgpu::TextureFormat::Depth32Float);
    let sampler = gpu
        .device
        .create_sampler(&wgpu::SamplerDescriptor::default());
    let cases_buffer = storage(gpu, "cases", &cases).unwrap();
    let results = storage(gpu, "results", &vec![Vec4::ZERO; cases.len()]).unwrap();
    let kernel = Kernel::new(
        gpu,
        "eight layers",
        &[],
        &kernel,
        "main",
        &[
            Binding::Uniform(&uniform(gpu, "frame", &frame)),
            Binding::Integers(&words.view),
            Binding::Integers(&words.view),
            Binding::Depth(&depth.view),
            Binding::Sampler(&sampler),
            Binding::Texture(&upper.view),
            Binding::Texture(&upper.view),
            Binding::Texture(&upper.view),
            Binding::Texture(&upper.view),
            Binding::Texture(&upper.view),
            Binding::Depth(&depth.view),
            Binding::Read(&cases_buffer),
            Binding::Write(&results),
            Binding::Depth(&depth.view),
            Binding::Texture(&lower.view),
        ],
    )
    .unwrap();
    dispatch(gpu, &kernel, cases.len());
    let brightest = twin.iter().map(|v| v.max_element()).fold(0.0, f32::max);
    worst(
        &read_buffer(gpu, &results).unwrap(),
        &twin,
        0.01 * brightest,
    )
}

fn eight_layers() -> String {
    let mut section = section();
    section.layers = vec![section.layers[0]; 8];
    join(&Surface::parts(&section, CoverKind::Planes))
}

#[test]
fn eight_layers_match_the_cpu_twin() {
    let gpu = gpu();
    for (rule, samples) in [
        (Rule::ByLayer, 8),
        (Rule::ByLayer, 16),
        (Rule::ClosedForm, 9),
        (Rule::Published, 23),
    ] {
        let difference = eight_layers_difference(&gpu, &eight_layers(), rule, samples);
        // As for four layers.
        assert!(
            difference < 2e-3,
            "{rule:?} with {samples}: differ by {difference}"
        );
    }
}

#[test]
fn eight_layers_parity_check_rejects_a_second_map_that_is_not_read() {
    let source = sabotaged(
        &eight_layers(),
        "textureSampleLevel(deep_layer_map,",
        "textureSampleLevel(layer_map,",
    );
    let difference = eight_layers_difference(&gpu(), &source, Rule::ByLayer, 8);
    assert!(
        difference > 0.02,
        "the first map twice went unnoticed: {difference}"
    );
}

// Whole frames.

/// Radiance of a lit ball, drawn small, and whether each pixel is covered.
fn ball(gpu: &Gpu, kind: &str, sets: &[&str], light: &str) -> Vec<Vec4> {
    let mesh = surfaces::sphere(0.05, 48, 31);
    let size_px = 32;
    let map = |texel: [u8; 4]| image::RgbaImage::from_pixel(size_px, size_px, image::Rgba(texel));
    let tissue = palpate::geom::paint::TissueMaps {
        size_px,
        outer: map([170, 80, 60, 128]),
        normal: map([128, 128, 255, 255]),
        inner: map([140, 40, 30, 255]),
        layers: vec![map(BOUNDARIES).into()],
    };
    let text = format!(
        "[body]\nshape = \"sphere\"\nextent_m = [0.1, 0.1, 0.1]\n[surface]\nkind = \"{kind}\"\n\
         [light_path]\nmethod = \"tangent\"\n[[light]]\n{light}\nirradiance_w_m2 = [3.0, 3.0, 3.0]\n"
    );
    let source = SceneSource {
        name: "ball",
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
        &mesh,
        &tissue,
        [64, 64],
        Output::Radiance,
    )
    .unwrap();
    let view = View {
        up: Vec3::Y,
        eye: Vec3::new(0.0, 0.0, 0.4),
        target: Vec3::ZERO,
        fov_y: 0.3,
    };
    let mut timer = palpate::gpu::Timer::new(gpu, 16);
    let mut encoder = gpu.encoder();
    passes.record(gpu, &mesh.points, &view, &[], &mut encoder, &mut timer);
    gpu.submit_and_wait(encoder);
    read_texture_rgba16f(gpu, &passes.target.texture)
        .unwrap()
        .chunks_exact(4)
        .map(Vec4::from_slice)
        .collect()
}

#[test]
fn the_lit_side_is_bright_by_every_light_path() {
    let gpu = gpu();
    for method in LightPathMethod::ALL {
        let method = format!("light_path.method={}", method.name());
        let sets = [method.as_str(), "light_path.radius_m=0.01"];
        for light in [
            "toward = [1.0, 0.2, 0.0]\nshadow = true",
            "toward = [1.0, 0.2, 0.0]",
            "at_m = [0.12, 0.0, 0.0]",
        ] {
            let pixels = ball(&gpu, "subsurface", &sets, light);
            assert!(pixels.iter().all(|pixel| pixel.is_finite()), "{method}");
            let [left, right] = halves(&pixels);
            assert!(right > 3.0 * left, "{method}, {light}: {left} and {right}");
        }
    }
}

#[test]
fn below_a_ball_quadrics_come_nearer_than_planes_to_what_depth_maps_read() {
    let gpu = gpu();
    // Light that scattered once, alone, in tissue clear enough for the ball to be seen bent.
    let by = |method: &str| {
        let method = format!("light_path.method={method}");
        let sets = [
            method.as_str(),
            "light_path.radius_m=0.015",
            "surface.multiple_scattering=0.0",
            "surface.wetness=0.0",
            "surface.color_blend=0.0",
            "surface.samples=16",
            "surface.layer.0.absorption_per_m=[5.0, 10.0, 20.0]",
            "surface.layer.1.absorption_per_m=[5.0, 10.0, 20.0]",
            "surface.layer.2.absorption_per_m=[5.0, 10.0, 20.0]",
            "surface.layer.3.absorption_per_m=[5.0, 10.0, 20.0]",
            "surface.layer_depth_max_m=0.03",
        ];
        ball(&gpu, "subsurface", &sets, "toward = [0.7, 0.3, 0.6]")
    };
    let read = by("depth-map");
    let error = |method: &str| {
        let [sum, norm] = by(method)
            .iter()
            .zip(&read)
            .fold([0.0_f32; 2], |[sum, norm], (a, b)| {
                [
                    sum + (*a - *b).length_squared(),
                    norm + b.truncate().length_squared(),
                ]
            });
        (sum / norm).sqrt()
    };
    let [quadric, full, tangent] = ["quadric", "full", "tangent"].map(error);
    println!("from depth maps: quadric {quadric:.4}, full {full:.4}, tangent {tangent:.4}");
    assert!(
        quadric < 0.6 * full && quadric < 0.6 * tangent,
        "{quadric}, {full}, {tangent}"
    );
}

/// Mean brightness of the covered pixels of the left and the right half.
fn halves(pixels: &[Vec4]) -> [f32; 2] {
    [0, 1].map(|half| {
        let side: Vec<f32> = pixels
            .iter()
            .enumerate()
            .filter(|(i, pixel)| (i % 64) / 32 == half && pixel.w > 0.0)
            .map(|(_, pixel)| pixel.truncate().element_sum())
            .collect();
        assert!(side.len() > 200, "half a ball is covered");
        side.iter().sum::<f32>() / side.len() as f32
    })
}

#[test]
fn the_lit_side_is_bright_in_every_model() {
    let gpu = gpu();
    for kind in ["plain", "subsurface", "gooey"] {
        for light in ["toward = [1.0, 0.2, 0.0]", "at_m = [0.12, 0.0, 0.0]"] {
            let pixels = ball(&gpu, kind, &[], light);
            assert!(pixels.iter().all(|pixel| pixel.is_finite()), "{kind}");
            let [left, right] = halves(&pixels);
            assert!(right > 3.0 * left, "{kind}, {light}: {left} and {right}");
        }
    }
}

#[test]
fn a_lit_ball_casts_no_shadow_on_its_lit_side() {
    let gpu = gpu();
    let light = "toward = [0.3, 0.4, 1.0]";
    for kind in ["plain", "subsurface", "gooey"] {
        let bare = ball(&gpu, kind, &[], light);
        let shadowed = ball(&gpu, kind, &[], &format!("{light}\nshadow = true"));
        let total =
            |pixels: &[Vec4]| -> f32 { pixels.iter().map(|p| p.truncate().element_sum()).sum() };
        let (bare, shadowed) = (total(&bare), total(&shadowed));
        // What lies past the terminator gets its light through the body, so a little more or less.
        assert!(
            (shadowed / bare - 1.0).abs() < 0.06,
            "{kind}: {bare} and {shadowed}"
        );
    }
}

#[test]
fn more_samples_by_layer_and_in_closed_form_end_at_the_same_picture() {
    let gpu = gpu();
    let light = "toward = [0.3, 0.4, 1.0]";
    let exact = ball(
        &gpu,
        "subsurface",
        &["surface.samples=48", "surface.quadrature=closed-form"],
        light,
    );
    let coarse = ball(&gpu, "subsurface", &["surface.samples=4"], light);
    let papers = ball(
        &gpu,
        "subsurface",
        &["surface.samples=10", "surface.quadrature=published"],
        light,
    );
    let error = |pixels: &[Vec4]| {
        let [sum, norm] = pixels
            .iter()
            .zip(&exact)
            .fold([0.0_f32; 2], |[sum, norm], (a, b)| {
                [
                    sum + (*a - *b).length_squared(),
                    norm + b.truncate().length_squared(),
                ]
            });
        (sum / norm).sqrt()
    };
    // Half floats are good to 5e-4.
    assert!(error(&coarse) < 0.01, "{}", error(&coarse));
    assert!(error(&papers) > 5.0 * error(&coarse), "{}", error(&papers));
}
