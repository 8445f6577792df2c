// What a surface model reads at a covered pixel: the packed geometry, the texture maps, the shadow map; and what it
// shows there: linear radiance, or what a screen shows of it over the backdrop that is already there. A pixel with
// empty neighbours is blended with the backdrop by how many there are: the outline loses its steps.
//
// The triangle covers the picture at the far end of depth and is drawn where something lies before it, so
// that pixels without tissue cost nothing.
//
// Source:  the layout of shaders/geometry.wgsl; Green 2004, 16.3 (way through the body from a depth map).
// Twin:    src/optics/pack.rs, fn octahedral
// Parity:  tests/shading_parity.rs, fn packed_directions_match_the_cpu_twin
// Threads: one a covered pixel.
// Units:   metres.
// Fails:   one level of the maps for the whole frame: a body seen along its length shimmers at its far end; outlines
//          in front of other tissue keep their steps.

@group(0) @binding(1) var base_map: texture_2d<u32>;
@group(0) @binding(2) var detail_map: texture_2d<u32>;
@group(0) @binding(3) var depth_map: texture_depth_2d;
@group(0) @binding(4) var linear_sampler: sampler;
@group(0) @binding(5) var outer_map: texture_2d<f32>;
@group(0) @binding(6) var normal_map: texture_2d<f32>;
@group(0) @binding(7) var inner_map: texture_2d<f32>;
@group(0) @binding(8) var layer_map: texture_2d<f32>;
@group(0) @binding(9) var light_map: texture_2d<f32>;
@group(0) @binding(10) var shadow_map: texture_depth_2d;

@vertex
fn pixel_vertex(@builtin(vertex_index) corner: u32) -> @builtin(position) vec4f {
    let x = f32(corner & 1u) * 4.0 - 1.0;
    let y = f32(corner >> 1u) * 4.0 - 1.0;
    return vec4f(x, y, 1.0, 1.0);
}

// 1: the tone curve, sRGB and a soft outline; 0: linear radiance.
override TONE: u32 = 1u;

fn is_empty(at: vec2i) -> f32 {
    return select(0.0, 1.0, textureLoad(depth_map, at, 0) >= 1.0);
}

fn shown(radiance: vec3f, place: vec4f) -> vec4f {
    if TONE == 0u {
        return vec4f(radiance, 1.0);
    }
    let at = vec2i(place.xy);
    let low = max(at - 1, vec2i(0));
    let high = min(at + 1, vec2i(textureDimensions(depth_map)) - 1);
    let empty = is_empty(vec2i(low.x, at.y)) + is_empty(vec2i(high.x, at.y))
        + is_empty(vec2i(at.x, low.y)) + is_empty(vec2i(at.x, high.y));
    return vec4f(displayed(frame.exposure * radiance), 1.0 - 0.25 * min(empty, 3.0));
}

struct Pixel {
    // Place on the surface [m].
    world: vec3f,
    // Unit normal of the surface, and with the relief of the normal map.
    normal: vec3f,
    relief: vec3f,
    to_eye: vec3f,
    uv: vec2f,
    // to_eye along the tangent and the bitangent.
    across: vec2f,
    tangent: vec3f,
    bitangent: vec3f,
    // Colour, linear, and opacity of the outer layer.
    outer: vec4f,
}

// The maps are bound at the one level whose texels are as large as a pixel.
//
// Colours are stored as square roots: 8 bits then resolve the dark, and the sampler filters plain bytes.
fn color_at(map: texture_2d<f32>, uv: vec2f) -> vec4f {
    let texel = textureSampleLevel(map, linear_sampler, uv, 0.0);
    return vec4f(texel.rgb * texel.rgb, texel.a);
}

// The normal with the bumps of the normal map, whose green points to smaller v.
fn relief_at(uv: vec2f, normal: vec3f, tangent: vec3f, bitangent: vec3f) -> vec3f {
    let bump = textureSampleLevel(normal_map, linear_sampler, uv, 0.0).xyz * 2.0 - 1.0;
    return normalize(
        frame.relief * (bump.x * tangent - bump.y * bitangent) + max(bump.z, 0.05) * normal,
    );
}

fn pixel_at(at: vec4f) -> Pixel {
    let place = vec2i(at.xy);
    let base = textureLoad(base_map, place, 0);
    let depth = textureLoad(depth_map, place, 0);
    let ndc = vec4f(
        2.0 * at.x * frame.size.z - 1.0,
        1.0 - 2.0 * at.y * frame.size.w,
        depth,
        1.0,
    );
    let far = frame.world_from_clip * ndc;
    let world = far.xyz / far.w;
    let to_eye = normalize(frame.eye.xyz - world);
    let uv = vec2f(bitcast<f32>(base.x), bitcast<f32>(base.y));
    let normal = from_octahedral(base.z);
    let leaning = from_octahedral(base.w & 0xfffffffeu);
    let tangent = normalize(leaning - normal * dot(leaning, normal));
    let bitangent = select(1.0, -1.0, (base.w & 1u) != 0u) * cross(normal, tangent);
    let relief = relief_at(uv, normal, tangent, bitangent);
    let across = vec2f(dot(to_eye, tangent), dot(to_eye, bitangent));
    let outer = color_at(outer_map, uv);
    return Pixel(world, normal, relief, to_eye, uv, across, tangent, bitangent, outer);
}

// Texture coordinate changes by x along the tangent and y along the bitangent [1/m].
struct Gradients {
    u: vec2f,
    v: vec2f,
}

fn gradients_of(detail: vec4u) -> Gradients {
    return Gradients(unpack2x16float(detail.z), unpack2x16float(detail.w));
}

// How thick layers are, as a share of how thick they are at rest.
fn thickness_of(detail: vec4u) -> f32 {
    return unpack2x16float(detail.y).y;
}

// Everything the wet film sends to the eye: the lights' highlights and the mirrored room.
fn wet(at: Pixel, unshadowed: f32) -> vec3f {
    var sum = vec3f(0.0);
    if LIGHT_COUNT > 0u {
        let lit = light_at(0u, at.world);
        sum += unshadowed * lit.irradiance
            * highlight(at.relief, lit.to_light, at.to_eye, frame.roughness);
    }
    if LIGHT_COUNT > 1u {
        let lit = light_at(1u, at.world);
        sum += lit.irradiance * highlight(at.relief, lit.to_light, at.to_eye, frame.roughness);
    }
    if LIGHT_COUNT > 2u {
        let lit = light_at(2u, at.world);
        sum += lit.irradiance * highlight(at.relief, lit.to_light, at.to_eye, frame.roughness);
    }
    if LIGHT_COUNT > 3u {
        let lit = light_at(3u, at.world);
        sum += lit.irradiance * highlight(at.relief, lit.to_light, at.to_eye, frame.roughness);
    }
    return frame.wetness * sum + mirrored(at);
}

// The room in the wet film.
fn mirrored(at: Pixel) -> vec3f {
    let cosine = max(dot(at.relief, at.to_eye), 0.0);
    let direction = 2.0 * dot(at.relief, at.to_eye) * at.relief - at.to_eye;
    // Where the tissue itself stands in the way of the mirrored ray there is no room to see.
    let open = clamp(1.0 + 1.6 * dot(direction, at.normal), 0.0, 1.0);
    return frame.wetness * open * fresnel(cosine) * theatre(direction);
}
