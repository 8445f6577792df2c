// Depth of the deformed surface as the first light sees it.
//
//   clip = shadow_from_world x
//
// Source:  Williams, "Casting Curved Shadows on Curved Surfaces", SIGGRAPH 1978.
// Twin:    src/passes/view.rs, fn shadow_from_world
// Parity:  tests/replay.rs, fn a_shadow_falls_where_the_way_to_the_lamp_is_blocked
// Threads: one a point.
// Units:   metres in, clip space out.
// Fails:   details finer than a texel.

@group(0) @binding(0) var<uniform> shadow_from_world: mat4x4f;

@vertex
fn shadow_vertex(@location(0) position: vec3f) -> @builtin(position) vec4f {
    return shadow_from_world * vec4f(position, 1.0);
}
