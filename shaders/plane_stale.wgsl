// The plane fitted at rest, left where it was in space while its point moves away: what a precomputed plane is.
//
//   n as at rest,  h = h_rest + n.(P_rest - P)
//
// Source:  Norberg 2010, section 5.1: planes that "need to be precalculated".
// Twin:    src/geom/plane.rs, fn stale_plane
// Parity:  tests/gpu_parity.rs, fn stale_planes_match_the_cpu_twin
// Threads: one per point.
// Units:   unit normals, offsets and places in metres.
// Fails:   wherever the surface moves or turns: it is the case that the other methods are measured against.

struct Params {
    point_count: u32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> rest_planes: array<vec4f>;
@group(0) @binding(2) var<storage, read> rest_places: array<vec4f>;
@group(0) @binding(3) var<storage, read> positions: array<vec4f>;
@group(0) @binding(4) var<storage, read_write> planes: array<vec4f>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let point = id.x;
    if point >= params.point_count {
        return;
    }
    let rest = rest_planes[point];
    let moved = positions[point].xyz - rest_places[point].xyz;
    planes[point] = vec4f(rest.xyz, rest.w - dot(rest.xyz, moved));
}
