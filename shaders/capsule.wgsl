// Where the skin of a rigid tool is, a capsule or a sphere. No bindings.
//
//   x = tip + r n'          for the half that faces away from the axis
//   x = tip + axis + r n'   for the other half; n' = n turned so that +z lies along the axis
//
// Source:  the definition of a capsule: all that is r away from a segment.
// Twin:    src/passes/tools.rs, fn capsule_point
// Parity:  src/passes/tools.rs, fn every_vertex_lies_on_the_capsule
// Threads: none of its own.
// Units:   metres.
// Fails:   an axis shorter than 1e-6 m is a sphere.

struct Tool {
    tip_radius: vec4f,
    axis: vec4f,
}

struct OnTool {
    world: vec3f,
    normal: vec3f,
}

fn on_tool(tool: Tool, n: vec4f) -> OnTool {
    let length = length(tool.axis.xyz);
    var along = vec3f(0.0, 0.0, 1.0);
    if length > 1e-6 {
        along = tool.axis.xyz / length;
    }
    var side = vec3f(1.0, 0.0, 0.0);
    if abs(along.x) > 0.9 {
        side = vec3f(0.0, 1.0, 0.0);
    }
    let across = normalize(cross(side, along));
    let normal = n.x * across + n.y * cross(along, across) + n.z * along;
    return OnTool(tool.tip_radius.xyz + n.w * tool.axis.xyz + tool.tip_radius.w * normal, normal);
}
