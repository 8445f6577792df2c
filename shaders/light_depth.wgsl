// The way of light to a point below the surface, from the depth map of each light. Follows pack.wgsl, frame.wgsl and
// light_entry.wgsl; reads `shadow_map`, which holds the maps side by side, the first light's on the left.
//
//   E = world_from_clip (centre of M's texel, its depth)        then as light_entry.wgsl
//
// Where the texel is empty M lies under the very rim of the body: the tangent plane at P stands for the surface, and
// where that faces away nothing does.
//
// Source:  Green 2004, 16.3; François 2006, eq. 10, with the entry read in place of the estimate.
// Units:   metres.
// Fails:   air between two parts counts as tissue; details finer than a texel.

struct LightViews {
    clip_from_world: array<mat4x4f, 4>,
    world_from_clip: array<mat4x4f, 4>,
    // How far before its entry a point still counts as inside, for each light [m].
    slack_m: vec4f,
}

@group(0) @binding(11) var<uniform> light_views: LightViews;
@group(0) @binding(12) var entry_normals: texture_2d<u32>;
// Depth of the nearest back faces as the eye sees them.
@group(0) @binding(13) var exit_map: texture_depth_2d;

// A way that is read knows of every shadow.
const SEES_SHADOWS: bool = true;

struct Cover {
    world: vec3f,
    normal: vec3f,
    to_eye: vec3f,
    // Where the view ray leaves the body [m].
    exit: f32,
}

// Clip coordinates of the light's map are `clip_start - t clip_step` along the ray.
struct Facing {
    light: u32,
    to_light: vec3f,
    clip_start: vec4f,
    clip_step: vec4f,
}

fn cover_at(world: vec3f, normal: vec3f, tangent: vec3f, bitangent: vec3f, to_eye: vec3f, words: vec2u) -> Cover {
    return Cover(world, normal, to_eye, exit_from(world));
}

fn facing_of(cover: Cover, light: u32, to_light: vec3f) -> Facing {
    let clip_from_world = light_views.clip_from_world[light];
    return Facing(
        light,
        to_light,
        clip_from_world * vec4f(cover.world, 1.0),
        clip_from_world * vec4f(cover.to_eye, 0.0),
    );
}

fn way_under(cover: Cover, facing: Facing, t: f32, blend: f32) -> vec2f {
    let k = facing.light;
    let clip = facing.clip_start - t * facing.clip_step;
    let ndc = clip.xy / clip.w;
    let size = i32(textureDimensions(shadow_map).y);
    let texel = vec2i(floor((ndc * vec2f(0.5, -0.5) + 0.5) * f32(size)));
    let inside = clamp(texel, vec2i(0), vec2i(size - 1));
    let tile = vec2i(inside.x + i32(k) * size, inside.y);
    let depth = textureLoad(shadow_map, tile, 0);
    if depth >= 1.0 || any(inside != texel) {
        let cosine = dot(cover.normal, facing.to_light);
        let flat = vec2f(t * max(dot(cover.normal, cover.to_eye), 0.0) / max(cosine, 1e-3), cosine);
        return select(vec2f(0.0, MIN_ENTRY_COSINE), flat, cosine > 1e-3);
    }
    let centre = (vec2f(inside) + 0.5) / f32(size) * vec2f(2.0, -2.0) + vec2f(-1.0, 1.0);
    let normal = from_octahedral(textureLoad(entry_normals, tile, 0).x);
    var entry = vec3f(0.0);
    if (POINT_LIGHTS & (1u << k)) == 0u {
        // From M to E; a far light's map is affine.
        entry = (light_views.world_from_clip[k] * vec4f(centre - ndc, depth - clip.z, 0.0)).xyz;
    } else {
        let far = light_views.world_from_clip[k] * vec4f(centre, depth, 1.0);
        entry = far.xyz / far.w - (cover.world - t * cover.to_eye);
    }
    return way_from_entry(entry, normal, vec3f(0.0), facing.to_light, light_views.slack_m[k]);
}

// Where the view ray leaves the body again [m]: the nearest back face behind the pixel.
fn exit_from(world: vec3f) -> f32 {
    let clip = frame.clip_from_world * vec4f(world, 1.0);
    let ndc = clip.xy / clip.w;
    let place = vec2i(floor((ndc * vec2f(0.5, -0.5) + 0.5) * frame.size.xy));
    let depth = textureLoad(exit_map, clamp(place, vec2i(0), vec2i(frame.size.xy) - 1), 0);
    let far = frame.world_from_clip * vec4f(ndc, depth, 1.0);
    let length = distance(far.xyz / far.w, world);
    return select(max(length, 1e-6), 1e6, depth >= 1.0);
}

fn exit_of(cover: Cover) -> f32 {
    return cover.exit;
}

// The cosine by which the papers' march ends; they know of planes alone.
fn printed_cosine(cover: Cover) -> f32 {
    return dot(cover.normal, cover.to_eye);
}
