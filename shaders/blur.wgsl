// One pass of the growable disc: the mean of thirteen taps of the light map.
//
//   E'(x) = (E(x) + sum_k E(x + R d_k)) / 13,  sum_k d_k = 0
//
// The published twelve taps have their centroid at (0.03, -0.10) R, so that each pass moves the light; ours lie on
// two rings, turned against each other, with their centroid at 0. The angle turns from pass to pass.
//
// Source:  Oat 2006, 4.5 and listing 2; Norberg 2010, 3.2 (several passes).
// Twin:    src/optics/blur.rs, fn taps
// Parity:  tests/shading_parity.rs, fn blur_matches_the_cpu_twin
// Threads: one a texel.
// Units:   W/m2; the radius in shares of the unit square.
// Fails:   charts closer than the radius see each other's light.

struct Blur {
    radius: f32,
    angle: f32,
    pad0: f32,
    pad1: f32,
}

@group(0) @binding(0) var<uniform> blur: Blur;
@group(0) @binding(1) var source_map: texture_2d<f32>;
@group(0) @binding(2) var linear_sampler: sampler;

@vertex
fn blur_vertex(@builtin(vertex_index) corner: u32) -> @builtin(position) vec4f {
    let x = f32(corner & 1u) * 4.0 - 1.0;
    let y = f32(corner >> 1u) * 4.0 - 1.0;
    return vec4f(x, y, 0.0, 1.0);
}

// The k-th of twelve taps on the unit disc: four on the inner ring, eight on the outer.
fn tap(k: u32, turn: f32) -> vec2f {
    if k < 4u {
        let a = turn + 1.57079633 * f32(k);
        return 0.42 * vec2f(cos(a), sin(a));
    }
    let a = turn + 0.39269908 + 0.78539816 * f32(k - 4u);
    return 0.86 * vec2f(cos(a), sin(a));
}

@fragment
fn blur_fragment(@builtin(position) at: vec4f) -> @location(0) vec4f {
    let uv = at.xy / vec2f(textureDimensions(source_map));
    var sum = textureSampleLevel(source_map, linear_sampler, uv, 0.0);
    for (var k = 0u; k < 12u; k += 1u) {
        sum += textureSampleLevel(source_map, linear_sampler, uv + blur.radius * tap(k, blur.angle), 0.0);
    }
    return sum / 13.0;
}
