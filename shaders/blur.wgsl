// One pass of the growable disc: the mean of thirteen places of the light map, on a disc of one radius in metres on the
// deformed surface.
//
//   E'(x) = (E(x) + sum_k E(x + L d_k) + E(x - L d_k)) / 13,   |d_k| <= radius,  L as in shaders/metric.wgsl
//
// A disc is round, so which way L turns it on the surface does not matter. The published twelve taps have their centroid at
// (0.03, -0.10) R, so that each pass moves the light; ours come in pairs about the middle, which stay so when they are
// rounded to texels. A pair with a tap in another chart or in none counts as the middle: nothing leaks over a seam. The disc
// turns from pass to pass, and grows with the thickness of the layer that the light comes through.
//
// Source:  Oat 2006, 4.5 and listing 2 (and figure 11: a thicker layer, a larger disc); Norberg 2010, 3.2 (several passes).
// Twin:    src/optics/blur.rs, fn blurred
// Parity:  tests/shading_parity.rs, fn blur_matches_the_cpu_twin
// Threads: one a texel.
// Units:   W/m2; metres, texels.
// Fails:   radii of a quarter of the map and more are cut; charts narrower than the disc are blurred less.

struct Blur {
    // Six places on the unit disc, two a vector.
    taps: array<vec4f, 3>,
    radius_m: f32,
    pad0: f32,
    pad1: f32,
    pad2: f32,
}

@group(0) @binding(0) var<uniform> blur: Blur;
@group(0) @binding(1) var source_map: texture_2d<f32>;
// The metric (a, b, c) [1/m], and the thickness of layers as a share of that at rest.
@group(0) @binding(2) var metric_map: texture_2d<f32>;

// 1: coverage is written in place of the number of the chart.
override LAST: u32 = 0u;

@vertex
fn blur_vertex(@builtin(vertex_index) corner: u32) -> @builtin(position) vec4f {
    let x = f32(corner & 1u) * 4.0 - 1.0;
    let y = f32(corner >> 1u) * 4.0 - 1.0;
    return vec4f(x, y, 0.0, 1.0);
}

// What a metre on the surface is in texels: the columns of L.
struct Steps {
    first: vec2f,
    second: vec2f,
}

fn pair(at: vec2i, here: vec4f, steps: Steps, tap: vec2f) -> vec3f {
    let offset = vec2i(round(tap.x * steps.first + tap.y * steps.second));
    let p = texel(at + offset);
    let q = texel(at - offset);
    return select(2.0 * here.rgb, p.rgb + q.rgb, p.a == here.a && q.a == here.a);
}

fn blurred(at: vec2i) -> vec4f {
    let place = covered_near(at);
    let here = texel(place);
    if here.a == 0.0 {
        return vec4f(0.0);
    }
    let metric = textureLoad(metric_map, place, 0);
    let size = f32(textureDimensions(source_map).x);
    let longest = max(length(metric.xy), metric.z);
    let radius = min(blur.radius_m * metric.w, 0.25 / max(longest, 1e-9));
    // v of the texture points down the rows.
    let steps = Steps(radius * size * metric.xy, vec2f(0.0, radius * size * metric.z));
    let sum = here.rgb
        + pair(place, here, steps, blur.taps[0].xy)
        + pair(place, here, steps, blur.taps[0].zw)
        + pair(place, here, steps, blur.taps[1].xy)
        + pair(place, here, steps, blur.taps[1].zw)
        + pair(place, here, steps, blur.taps[2].xy)
        + pair(place, here, steps, blur.taps[2].zw);
    return vec4f(sum / 13.0, here.a);
}

@fragment
fn blur_fragment(@builtin(position) place: vec4f) -> @location(0) vec4f {
    let got = blurred(vec2i(place.xy));
    return vec4f(got.rgb, select(got.a, sign(got.a), LAST != 0u));
}
