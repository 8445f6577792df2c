// The plane fitted at rest, turned with the tangent frame of its point.
//
//   n = |a t + b w (N x t) + c N|,  h as at rest        (a, b, c) is n at rest in that frame
//
// Source:  François et al., "Subsurface Texture Mapping" (2006), section 4, for the plane at rest; that
//          it may be carried is our extension, for normals that turn little within a patch.
// Twin:    src/geom/plane.rs, fn carried_plane
// Parity:  tests/gpu_parity.rs, fn carried_planes_match_the_cpu_twin
// Threads: one per point.
// Units:   unit normals, offsets in metres.
// Fails:   where the surface bends within a patch the plane keeps the bend it had at rest.

struct Params {
    point_count: u32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> rest_planes: array<vec4f>;
@group(0) @binding(2) var<storage, read> vertex_of_point: array<u32>;
@group(0) @binding(3) var<storage, read> normals: array<vec4f>;
@group(0) @binding(4) var<storage, read> tangents: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> planes: array<vec4f>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let point = id.x;
    if point >= params.point_count {
        return;
    }
    let rest = rest_planes[point];
    let n = normals[point].xyz;
    let t = tangents[vertex_of_point[point]];
    let bitangent = t.w * cross(n, t.xyz);
    planes[point] = vec4f(normalize(rest.x * t.xyz + rest.y * bitangent + rest.z * n), rest.w);
}
