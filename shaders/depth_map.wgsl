// Where a light enters the deformed surface: its depth, and the surface's normal there. Follows pack.wgsl.
//
//   clip = clip_from_world x,   the nearest to the light is kept
//
// Source:  Williams, "Casting Curved Shadows on Curved Surfaces", SIGGRAPH 1978; Green 2004, 16.3.
// Twin:    src/passes/view.rs, fn light_from_world
// Parity:  tests/depth_parity.rs, fn depth_maps_hold_what_rays_cast_at_the_surface_meet
// Threads: one a point; one a texel of each triangle.
// Units:   metres in, clip space out.
// Fails:   details finer than a texel.

@group(0) @binding(0) var<uniform> clip_from_world: mat4x4f;
@group(0) @binding(1) var<storage, read> normals: array<vec4f>;

struct Entering {
    @builtin(position) clip: vec4f,
    @location(0) normal: vec3f,
}

@vertex
fn depth_vertex(@builtin(vertex_index) point: u32, @location(0) position: vec3f) -> Entering {
    return Entering(clip_from_world * vec4f(position, 1.0), normals[point].xyz);
}

@fragment
fn depth_fragment(in: Entering) -> @location(0) u32 {
    return octahedral(in.normal);
}
