// The deformed surface as the rasterizer sees it: the vertex stage of every surface model.
//
//   clip = clip_from_world x(point of vertex)
//
// Source:  the layout of src/passes/mesh_buffers.rs and src/passes/tangents.rs.
// Twin:    src/passes/surface.rs, fn clip_from_world
// Parity:  tests/replay.rs, fn the_picture_covers_where_the_organ_is
// Threads: one a vertex of the triangle list.
// Units:   metres; uv gradients in 1/m.
// Fails:   nothing of its own.

@group(0) @binding(0) var<uniform> frame: Frame;
@group(0) @binding(1) var<storage, read> positions: array<vec4f>;
@group(0) @binding(2) var<storage, read> point_of: array<u32>;
@group(0) @binding(3) var<storage, read> uvs: array<vec2f>;
@group(0) @binding(4) var<storage, read> normals: array<vec4f>;
@group(0) @binding(5) var<storage, read> tangents: array<vec4f>;
@group(0) @binding(6) var<storage, read> uv_gradients: array<vec4f>;
@group(0) @binding(7) var linear_sampler: sampler;
@group(0) @binding(8) var outer_map: texture_2d<f32>;
@group(0) @binding(9) var normal_map: texture_2d<f32>;
@group(0) @binding(10) var inner_map: texture_2d<f32>;
@group(0) @binding(11) var layer_map: texture_2d<f32>;
@group(0) @binding(12) var light_map: texture_2d<f32>;
@group(0) @binding(13) var<storage, read> planes: array<vec4f>;
@group(0) @binding(14) var shadow_map: texture_depth_2d;
@group(0) @binding(15) var shadow_sampler: sampler_comparison;

struct Varyings {
    @builtin(position) clip: vec4f,
    @location(0) world: vec3f,
    @location(1) normal: vec3f,
    @location(2) tangent: vec4f,
    @location(3) gradient_u: vec3f,
    @location(4) gradient_v: vec3f,
    @location(5) uv: vec2f,
    @location(6) plane: vec4f,
}

// HAS_PLANES and HAS_SHADOW are 0 where the scene has none; what is then bound is never read.
override HAS_PLANES: u32 = 0u;
override HAS_SHADOW: u32 = 0u;
override SAMPLES: u32 = 6u;

fn surface_vertex(vertex: u32, clip: vec4f) -> Varyings {
    let point = point_of[vertex];
    let normal = normals[point].xyz;
    var plane = vec4f(normal, 0.0);
    if HAS_PLANES != 0u {
        plane = planes[point];
    }
    return Varyings(
        clip,
        positions[point].xyz,
        normal,
        tangents[vertex],
        uv_gradients[2u * vertex].xyz,
        uv_gradients[2u * vertex + 1u].xyz,
        uvs[vertex],
        plane,
    );
}

@vertex
fn vertex(@builtin(vertex_index) vertex: u32) -> Varyings {
    let world = positions[point_of[vertex]];
    return surface_vertex(vertex, frame.clip_from_world * vec4f(world.xyz, 1.0));
}

// Share of the first light that reaches `x`: two taps of the shadow map, moved off the surface by
// about a texel so that it does not shadow itself.
fn unshadowed(x: vec3f, normal: vec3f) -> f32 {
    if HAS_SHADOW == 0u {
        return 1.0;
    }
    let off = x + 2.0 * frame.shadow_texel_m * normal;
    let clip = frame.shadow_from_world * vec4f(off, 1.0);
    let uv = clip.xy * vec2f(0.5, -0.5) + 0.5;
    let aside = 0.6 / vec2f(textureDimensions(shadow_map));
    return 0.5 * textureSampleCompareLevel(shadow_map, shadow_sampler, uv + aside, clip.z)
        + 0.5 * textureSampleCompareLevel(shadow_map, shadow_sampler, uv - aside, clip.z);
}

// Colour maps hold square roots of linear light, which a square undoes for less than sRGB costs. The level is
// the same for the whole frame: that of the organ's distance.
fn color_at(map: texture_2d<f32>, uv: vec2f) -> vec4f {
    let texel = textureSampleLevel(map, linear_sampler, uv, frame.map_level);
    return vec4f(texel.rgb * texel.rgb, texel.a);
}

struct Place {
    normal: vec3f,
    detail: vec3f,
    to_eye: vec3f,
    n_v: f32,
    outer: vec4f,
}

fn place(in: Varyings) -> Place {
    let normal = normalize(in.normal);
    let tangent = normalize(in.tangent.xyz);
    // Green of the map grows towards smaller v.
    let up = cross(normal, tangent) * in.tangent.w;
    let texel = textureSampleLevel(normal_map, linear_sampler, in.uv, frame.map_level).xyz * 2.0 - 1.0;
    let detail = normalize(frame.relief * (texel.x * tangent - texel.y * up) + texel.z * normal);
    let to_eye = normalize(frame.eye.xyz - in.world);
    let outer = color_at(outer_map, in.uv);
    return Place(normal, detail, to_eye, max(dot(normal, to_eye), 1e-3), outer);
}

// Everything the wet film sends to the eye: the lights' highlights and the mirrored room.
fn wet(in: Varyings, at: Place, shadow: f32) -> vec3f {
    var sum = vec3f(0.0);
    for (var k = 0u; k < frame.light_count; k += 1u) {
        let lit = light_at(frame.lights[k], in.world);
        let share = select(1.0, shadow, k == 0u);
        sum += share * lit.irradiance * film(at.detail, lit.to_light, at.to_eye, frame.roughness);
    }
    let mirrored = reflect(-at.to_eye, at.detail);
    let cosine = max(dot(at.detail, at.to_eye), 0.0);
    // Where the surface itself stands in the way of the mirrored ray there is tissue, not room.
    let open = clamp(1.0 + 1.6 * dot(mirrored, at.normal), 0.0, 1.0);
    sum += open * fresnel(cosine) * theatre(mirrored, frame.roughness);
    return frame.wetness * sum;
}
