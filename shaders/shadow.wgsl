// Depth of the deformed surface as the first light sees it.
//
//   clip = shadow_from_world x
//
// Source:  Williams, "Casting Curved Shadows on Curved Surfaces", SIGGRAPH 1978.
// Twin:    src/passes/view.rs, fn shadow_from_world
// Parity:  tests/replay.rs, fn a_shadow_falls_where_the_way_to_the_lamp_is_blocked
// Threads: one a vertex.
// Units:   metres in, clip space out.
// Fails:   details finer than a texel.

@group(0) @binding(0) var<uniform> shadow_from_world: mat4x4f;
@group(0) @binding(1) var<storage, read> positions: array<vec4f>;
@group(0) @binding(2) var<storage, read> point_of: array<u32>;

@vertex
fn shadow_vertex(@builtin(vertex_index) vertex: u32) -> @builtin(position) vec4f {
    return shadow_from_world * vec4f(positions[point_of[vertex]].xyz, 1.0);
}
