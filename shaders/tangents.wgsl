// Tangent, handedness and UV gradients of every vertex of the deformed surface.
//
//   Pu = sum_t w dx/du / sum_t w,  w the triangle's area      and likewise Pv; both made tangential
//   g_u = (Pv.Pv Pu - Pu.Pv Pv) / (Pu.Pu Pv.Pv - (Pu.Pv)^2)   so g_u.Pu = 1 and g_u.Pv = 0
//   t = Pu / |Pu|,  handedness = sign((n x t) . Pv)
//
// A step d along the surface changes the texture coordinate by (d.g_u, d.g_v), however the tissue
// is stretched. The unit frames of the papers do so only while the UV map keeps its metric.
//
// Source:  do Carmo, "Differential Geometry of Curves and Surfaces" (1976), 2.5 (first fundamental
//          form); Lengyel, "Foundations of Game Engine Development" vol. 2 (2019), "Tangent Space".
// Twin:    src/geom/tangent.rs, fn tangent_frames
// Parity:  tests/gpu_parity.rs, fn tangent_frames_match_the_cpu_twin
// Threads: one per vertex; each gathers over its own triangles, so no atomics and a fixed order.
// Units:   positions in metres; tangents are unit vectors; gradients are in 1/m.
// Fails:   where the UV map has no area each gradient is that of its own axis alone, where it has no
//          extent the gradient is zero and the tangent any vector across the normal.

struct Params {
    vertex_count: u32,
    gradient_max_per_m: f32,
    pad0: u32,
    pad1: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> positions: array<vec4f>;
@group(0) @binding(2) var<storage, read> normals: array<vec4f>;
@group(0) @binding(3) var<storage, read> point_of: array<u32>;
@group(0) @binding(4) var<storage, read> fan_start: array<u32>;
@group(0) @binding(5) var<storage, read> fan_corners: array<vec2u>;
@group(0) @binding(6) var<storage, read> uv_inverse: array<vec4f>;
@group(0) @binding(7) var<storage, read_write> tangents: array<vec4f>;
@group(0) @binding(8) var<storage, read_write> uv_gradients: array<array<vec4f, 2>>;

fn lone_gradient(axis: vec3f) -> vec3f {
    let squared = dot(axis, axis);
    if squared > MIN_LENGTH_SQUARED {
        return axis / squared;
    }
    return vec3f(0.0);
}

fn bounded(v: vec3f, length_max: f32) -> vec3f {
    let squared = dot(v, v);
    if squared > length_max * length_max {
        return v * (length_max / sqrt(squared));
    }
    return v;
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let vertex = id.x;
    if vertex >= params.vertex_count {
        return;
    }
    let point = point_of[vertex];
    let n = normals[point].xyz;
    let origin = positions[point].xyz;
    var pu = vec3f(0.0);
    var pv = vec3f(0.0);
    var weight = 0.0;
    let end = fan_start[vertex + 1u];
    for (var k = fan_start[vertex]; k < end; k += 1u) {
        let corners = fan_corners[k];
        let e1 = positions[corners.x].xyz - origin;
        let e2 = positions[corners.y].xyz - origin;
        let m = uv_inverse[k];
        let area = length(cross(e1, e2));
        if any(m != vec4f(0.0)) {
            pu += area * (m.x * e1 + m.y * e2);
            pv += area * (m.z * e1 + m.w * e2);
            weight += area;
        }
    }
    if weight > 0.0 {
        pu /= weight;
        pv /= weight;
    }
    pu -= n * dot(n, pu);
    pv -= n * dot(n, pv);

    let uu = dot(pu, pu);
    let uv = dot(pu, pv);
    let vv = dot(pv, pv);
    let determinant = uu * vv - uv * uv;
    var gu = lone_gradient(pu);
    var gv = lone_gradient(pv);
    if determinant > MIN_UV_SINE_SQUARED * uu * vv {
        gu = (vv * pu - uv * pv) / determinant;
        gv = (uu * pv - uv * pu) / determinant;
    }
    var t = any_perpendicular(n);
    if uu > MIN_LENGTH_SQUARED {
        t = normalize(pu);
    }
    tangents[vertex] = vec4f(t, select(1.0, -1.0, dot(cross(n, pu), pv) < 0.0));
    uv_gradients[vertex][0] = vec4f(bounded(gu, params.gradient_max_per_m), 0.0);
    uv_gradients[vertex][1] = vec4f(bounded(gv, params.gradient_max_per_m), 0.0);
}
