// Unit normal of every point of the deformed surface.
//
//   n = sum_t (e1 x e2) / |sum_t (e1 x e2)|      over the triangles of the point
//
// Source:  Max, "Weights for Computing Vertex Normals from Facet Normals", JGT 4(2), 1999 (the
//          area-weighted variant, which alone is exact under any way of cutting a flat face).
// Twin:    src/geom/tangent.rs, fn point_normals
// Parity:  tests/gpu_parity.rs, fn normals_match_the_cpu_twin
// Threads: one per point; each gathers over its own triangles, so no atomics and a fixed order.
// Units:   positions in metres; results are unit vectors.
// Fails:   a point whose triangles span no area keeps its rest normal.

struct Params {
    point_count: u32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> positions: array<vec4f>;
@group(0) @binding(2) var<storage, read> fan_start: array<u32>;
@group(0) @binding(3) var<storage, read> fan_corners: array<vec2u>;
@group(0) @binding(4) var<storage, read> rest_normals: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> normals: array<vec4f>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let point = id.x;
    if point >= params.point_count {
        return;
    }
    let origin = positions[point].xyz;
    var area = vec3f(0.0);
    var edges = 0.0;
    let end = fan_start[point + 1u];
    for (var k = fan_start[point]; k < end; k += 1u) {
        let corners = fan_corners[k];
        let e1 = positions[corners.x].xyz - origin;
        let e2 = positions[corners.y].xyz - origin;
        area += cross(e1, e2);
        edges += dot(e1, e1) + dot(e2, e2);
    }
    let smallest = MIN_AREA_SHARE * edges;
    var n = rest_normals[point].xyz;
    if dot(area, area) > max(smallest * smallest, MIN_LENGTH_SQUARED) {
        n = normalize(area);
    }
    normals[point] = vec4f(n, 0.0);
}
