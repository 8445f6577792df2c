// One direction of a Gaussian blur of the light map, a width for each colour, in metres on the deformed surface.
//
//   E'(x) = sum_i w_i (E(x + i d) + E(x - i d)) / sum w,   w_i = exp(-(i d)^2 / 2 sigma^2),  d along (0, c) or (a, b)
//
// Taps come in pairs about the middle, so nothing moves. A pair with a tap in another chart or in none counts as the
// middle: across a seam nothing leaks, and an even slope of light stays what it is, so that both sides of a seam agree.
// Where the taps would be too many they are spread, over what the blur before has smoothed. Texels of the gutter take
// what lies nearest to them; each pass widens the charts by one texel.
//
// Source:  Green 2004, 16.4, listings 16-6 and 16-7 (separable, weights per colour); d'Eon and Luebke, "Advanced
//          Techniques for Realistic Real-Time Skin Rendering", GPU Gems 3, ch. 14, 2007 (sums of Gaussians, each made
//          from the one before). Pairs and metric are ours.
// Twin:    src/optics/diffusion.rs, fn diffused
// Parity:  tests/green_parity.rs, fn diffusion_matches_the_cpu_twin
// Threads: one a texel.
// Units:   W/m2, metres, texels.
// Fails:   widths of an eighth of the map and more are cut; charts narrower than a width are blurred less.

struct Diffuse {
    // Widths of this blur [m], per colour; w: taps on each side, at most.
    sigma_m: vec4f,
    // What the last blur gives of itself and of the two before.
    own: vec4f,
    second: vec4f,
    first: vec4f,
}

@group(0) @binding(0) var<uniform> blur: Diffuse;
@group(0) @binding(1) var source_map: texture_2d<f32>;
@group(0) @binding(2) var metric_map: texture_2d<f32>;
// Read by the last blur alone.
@group(0) @binding(3) var second_map: texture_2d<f32>;
@group(0) @binding(4) var first_map: texture_2d<f32>;

// 0 along (0, c), 1 along (a, b).
override AXIS: u32 = 0u;
// 1: the sum of the Gaussians is written, and coverage in alpha.
override LAST: u32 = 0u;

@vertex
fn diffuse_vertex(@builtin(vertex_index) corner: u32) -> @builtin(position) vec4f {
    let x = f32(corner & 1u) * 4.0 - 1.0;
    let y = f32(corner >> 1u) * 4.0 - 1.0;
    return vec4f(x, y, 0.0, 1.0);
}

fn diffused(at: vec2i) -> vec4f {
    let place = covered_near(at);
    let here = texel(place);
    if here.a == 0.0 {
        return vec4f(0.0);
    }
    let metric = textureLoad(metric_map, place, 0);
    let size = f32(textureDimensions(source_map).x);
    // v of the texture points down the rows.
    let step = size * select(vec2f(0.0, metric.z), metric.xy, AXIS == 1u);
    let longest = max(max(abs(step.x), abs(step.y)), 1e-9);
    let sigma = min(blur.sigma_m.xyz * longest, vec3f(0.125 * size));
    let reach = 3.0 * max(max(sigma.x, sigma.y), sigma.z);
    let stride = max(ceil(reach / blur.sigma_m.w), 1.0);
    let narrow = -0.5 / max(sigma * sigma, vec3f(1e-4));
    var sum = here.rgb;
    var weight = vec3f(1.0);
    let count = i32(ceil(reach / stride));
    for (var i = 1; i <= count; i += 1) {
        let x = f32(i) * stride;
        let offset = vec2i(round(x * step / longest));
        let w = exp(x * x * narrow);
        let p = texel(place + offset);
        let q = texel(place - offset);
        let is_inside = p.a == here.a && q.a == here.a;
        sum += w * select(2.0 * here.rgb, p.rgb + q.rgb, is_inside);
        weight += 2.0 * w;
    }
    return vec4f(sum / weight, here.a);
}

@fragment
fn diffuse_fragment(@builtin(position) place: vec4f) -> @location(0) vec4f {
    let at = vec2i(place.xy);
    let got = diffused(at);
    if LAST == 0u {
        return got;
    }
    // The earlier blurs end a ring sooner.
    let near = covered_near(at);
    let second = textureLoad(second_map, near, 0);
    let first = textureLoad(first_map, near, 0);
    let sum = blur.own.xyz * got.rgb + blur.second.xyz * second.rgb + blur.first.xyz * first.rgb;
    return select(vec4f(0.0), vec4f(sum, 1.0), got.a != 0.0);
}
