// Depth of the tools as the first light sees them, into the map that holds the surface. Follows capsule.wgsl.
//
//   clip = shadow_from_world x,  z at least 0: what stands between the lamp and the map is pressed onto its front
//
// Source:  Williams, "Casting Curved Shadows on Curved Surfaces", SIGGRAPH 1978.
// Twin:    src/passes/tools.rs, fn capsule_point
// Parity:  tests/replay.rs, fn a_tool_shades_what_lies_behind_it
// Threads: one a vertex.
// Units:   metres in, clip space out.
// Fails:   details finer than a texel; what falls beside the map, which is fitted round the body, shades nothing there.

@group(0) @binding(0) var<uniform> shadow_from_world: mat4x4f;
@group(0) @binding(1) var<storage, read> tools: array<Tool>;
@group(0) @binding(2) var<storage, read> directions: array<vec4f>;

@vertex
fn tool_shadow_vertex(
    @builtin(vertex_index) corner: u32,
    @builtin(instance_index) index: u32,
) -> @builtin(position) vec4f {
    let clip = shadow_from_world * vec4f(on_tool(tools[index], directions[corner]).world, 1.0);
    return vec4f(clip.xy, max(clip.z, 0.0), clip.w);
}
