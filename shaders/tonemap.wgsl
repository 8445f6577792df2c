// From linear radiance to what a screen shows: exposure, filmic curve, sRGB; and the dark theatre behind.
//
//   c = x (2.51 x + 0.03) / (x (2.43 x + 0.59) + 0.14)
//   sRGB: 12.92 c below 0.0031308, else 1.055 c^(1/2.4) - 0.055
//
// Coverage is in alpha. Where a pixel and a neighbour differ in it, the five are averaged: the outline loses its
// steps, everything else keeps its sharpness.
//
// Source:  Narkowicz, "ACES Filmic Tone Mapping Curve", 2015; IEC 61966-2-1.
// Twin:    src/optics/tone.rs, fn displayed
// Parity:  tests/shading_parity.rs, fn tone_map_matches_the_cpu_twin
// Threads: one a pixel.
// Units:   W/(m2 sr) in, sRGB out.
// Fails:   nothing of its own.

@group(0) @binding(0) var<uniform> exposure: vec4f;
@group(0) @binding(1) var radiance: texture_2d<f32>;

@vertex
fn tonemap_vertex(@builtin(vertex_index) corner: u32) -> @builtin(position) vec4f {
    let x = f32(corner & 1u) * 4.0 - 1.0;
    let y = f32(corner >> 1u) * 4.0 - 1.0;
    return vec4f(x, y, 0.0, 1.0);
}

fn backdrop(at: vec2f, size: vec2f) -> vec3f {
    let from_middle = (at - size * vec2f(0.5, 0.42)) / size.y;
    let glow = exp(-1.9 * dot(from_middle, from_middle));
    return mix(vec3f(0.004, 0.008, 0.010), vec3f(0.030, 0.058, 0.064), glow);
}

@fragment
fn tonemap_fragment(@builtin(position) at: vec4f) -> @location(0) vec4f {
    let pixel = vec2i(at.xy);
    let size = vec2i(textureDimensions(radiance));
    var here = textureLoad(radiance, pixel, 0);
    let left = textureLoad(radiance, max(pixel - vec2i(1, 0), vec2i(0)), 0);
    let right = textureLoad(radiance, min(pixel + vec2i(1, 0), size - 1), 0);
    let above = textureLoad(radiance, max(pixel - vec2i(0, 1), vec2i(0)), 0);
    let below = textureLoad(radiance, min(pixel + vec2i(0, 1), size - 1), 0);
    let around = left.a + right.a + above.a + below.a;
    if around != 4.0 * here.a {
        // A bright highlight must not outvote the backdrop, so each is weighed as it will be shown.
        here = 0.5 * here + 0.125 * (min(left, vec4f(2.0)) + min(right, vec4f(2.0))
            + min(above, vec4f(2.0)) + min(below, vec4f(2.0)));
    }
    var shown = backdrop(at.xy, vec2f(size));
    if here.a > 0.0 {
        let curve = filmic(exposure.x * here.rgb / here.a);
        shown = mix(shown, curve, here.a);
    }
    return vec4f(encode(shown), 1.0);
}
