// From linear radiance to what a screen shows, over the backdrop that is already there.
//
// Drawn at the far end of depth where something lies before it, so that the backdrop costs nothing. A pixel with
// empty neighbours is blended with the backdrop by how many there are: the outline loses its steps.
//
// Source:  the curve of shaders/tone.wgsl.
// Twin:    src/optics/tone.rs, fn displayed
// Parity:  tests/shading_parity.rs, fn tone_map_matches_the_cpu_twin
// Threads: one a covered pixel.
// Units:   W/(m2 sr) in, sRGB out.
// Fails:   outlines inside the body, in front of other tissue, keep their steps.

@group(0) @binding(0) var<uniform> exposure: vec4f;
@group(0) @binding(1) var radiance: texture_2d<f32>;
@group(0) @binding(2) var depth_map: texture_depth_2d;

@vertex
fn tonemap_vertex(@builtin(vertex_index) corner: u32) -> @builtin(position) vec4f {
    let x = f32(corner & 1u) * 4.0 - 1.0;
    let y = f32(corner >> 1u) * 4.0 - 1.0;
    return vec4f(x, y, 1.0, 1.0);
}

fn is_empty(at: vec2i) -> f32 {
    return select(0.0, 1.0, textureLoad(depth_map, at, 0) >= 1.0);
}

@fragment
fn tonemap_fragment(@builtin(position) place: vec4f) -> @location(0) vec4f {
    let at = vec2i(place.xy);
    let last = vec2i(textureDimensions(depth_map)) - 1;
    let low = max(at - 1, vec2i(0));
    let high = min(at + 1, last);
    let empty = is_empty(vec2i(low.x, at.y)) + is_empty(vec2i(high.x, at.y))
        + is_empty(vec2i(at.x, low.y)) + is_empty(vec2i(at.x, high.y));
    let linear = textureLoad(radiance, at, 0).rgb;
    return vec4f(displayed(exposure.x * linear), 1.0 - 0.25 * min(empty, 3.0));
}
