// One pass of the growable disc: the mean of thirteen texels of the light map.
//
//   E'(x) = (E(x) + sum_k E(x + d_k) + E(x - d_k)) / 13
//
// The published twelve taps have their centroid at (0.03, -0.10) R, so that each pass moves the light; ours come in
// pairs about the middle, which stay so when they are rounded to texels. The disc turns from pass to pass.
//
// Source:  Oat 2006, 4.5 and listing 2; Norberg 2010, 3.2 (several passes).
// Twin:    src/optics/blur.rs, fn taps
// Parity:  tests/shading_parity.rs, fn blur_matches_the_cpu_twin
// Threads: one a texel.
// Units:   W/m2; offsets in texels.
// Fails:   charts closer than the radius see each other's light.

struct Blur {
    // Six offsets, two a vector.
    taps: array<vec4i, 3>,
}

@group(0) @binding(0) var<uniform> blur: Blur;
@group(0) @binding(1) var source_map: texture_2d<f32>;

@vertex
fn blur_vertex(@builtin(vertex_index) corner: u32) -> @builtin(position) vec4f {
    let x = f32(corner & 1u) * 4.0 - 1.0;
    let y = f32(corner >> 1u) * 4.0 - 1.0;
    return vec4f(x, y, 0.0, 1.0);
}

fn texel(at: vec2i) -> vec4f {
    let last = vec2i(textureDimensions(source_map)) - 1;
    return textureLoad(source_map, clamp(at, vec2i(0), last), 0);
}

fn pair(at: vec2i, offset: vec2i) -> vec4f {
    return texel(at + offset) + texel(at - offset);
}

fn blurred(at: vec2i) -> vec4f {
    let sum = texel(at)
        + pair(at, blur.taps[0].xy)
        + pair(at, blur.taps[0].zw)
        + pair(at, blur.taps[1].xy)
        + pair(at, blur.taps[1].zw)
        + pair(at, blur.taps[2].xy)
        + pair(at, blur.taps[2].zw);
    return sum / 13.0;
}

@fragment
fn blur_fragment(@builtin(position) place: vec4f) -> @location(0) vec4f {
    return blurred(vec2i(place.xy));
}
