// Where light enters the body, leaves it, and enters it again: a depth map each.
//
//   clip.xy of x + grow n,  clip.z / clip.w of x
//
// Pushed out along its normals the body covers a little more of the map, at its own depth: no empty texel of the rim
// lies on it. The second entries are the nearest ones behind the first exits.
//
// Source:  Green 2004, 16.3, listing 16-2 (grow), 16.4.1; Everitt, "Interactive Order-Independent Transparency",
//          NVIDIA, 2001 (peeling).
// Twin:    src/passes/view.rs, fn light_from_world
// Parity:  tests/green_parity.rs, fn body_depths_hold_what_rays_cast_at_the_surface_meet
// Threads: one a point; one a texel of each triangle.
// Units:   metres in, clip space out.
// Fails:   details finer than a texel; grown parts closer than twice the growth overlap.

struct BodyDepth {
    clip_from_world: mat4x4f,
    grow_m: f32,
    pad0: f32,
    pad1: f32,
    pad2: f32,
}

@group(0) @binding(0) var<uniform> view: BodyDepth;
@group(0) @binding(1) var<storage, read> normals: array<vec4f>;
@group(0) @binding(2) var exit_map: texture_depth_2d;

// How far behind an exit the next entry lies at least, as a share of the map's depth.
const APART: f32 = 1e-4;

@vertex
fn body_depth_vertex(@builtin(vertex_index) point: u32, @location(0) position: vec3f) -> @builtin(position) vec4f {
    let clip = view.clip_from_world * vec4f(position, 1.0);
    let grown = view.clip_from_world * vec4f(position + view.grow_m * normals[point].xyz, 1.0);
    return vec4f(grown.xy, clip.z / clip.w * grown.w, grown.w);
}

@fragment
fn second_fragment(@builtin(position) at: vec4f) {
    if at.z < textureLoad(exit_map, vec2i(at.xy), 0) + APART {
        discard;
    }
}
