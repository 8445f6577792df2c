// The visible surface, drawn once into packed numbers that the surface model reads: each pixel is then
// shaded exactly once, however small the triangles are.
//
//   base   = { u, v, octahedral normal, octahedral tangent with the handedness in its lowest bit }
//   detail = { octahedral normal of the plane, its offset, gradient of u, gradient of v }
//
// The gradients [1/m] are along the tangent and the bitangent: (ds, dt) = (d.t u_t + d.b u_b, ...).
//
// Source:  Cigolla et al., "A Survey of Efficient Representations for Independent Unit Vectors", JCGT 2014.
// Twin:    src/optics/pack.rs, fn octahedral
// Parity:  tests/shading_parity.rs, fn packed_directions_match_the_cpu_twin
// Threads: one a vertex; one a covered pixel of each triangle.
// Units:   metres, 1/m.
// Fails:   gradients above 65504 / m are cut.

@group(0) @binding(1) var<storage, read> positions: array<vec4f>;
@group(0) @binding(2) var<storage, read> point_of: array<u32>;
@group(0) @binding(3) var<storage, read> uvs: array<vec2f>;
@group(0) @binding(4) var<storage, read> normals: array<vec4f>;
@group(0) @binding(5) var<storage, read> tangents: array<vec4f>;
@group(0) @binding(6) var<storage, read> uv_gradients: array<array<vec4f, 2>>;
@group(0) @binding(7) var<storage, read> planes: array<vec4f>;

// 1 if `planes` holds planes; the tangent plane is meant where it is 0.
override HAS_PLANES: u32 = 0u;

struct Varyings {
    @builtin(position) clip: vec4f,
    @location(0) normal: vec3f,
    @location(1) tangent: vec4f,
    @location(2) uv: vec2f,
    @location(3) gradients: vec4f,
    @location(4) plane: vec4f,
}

struct Packed {
    @location(0) base: vec4u,
    @location(1) detail: vec4u,
}

@vertex
fn geometry_vertex(@builtin(vertex_index) vertex: u32) -> Varyings {
    let point = point_of[vertex];
    let normal = normals[point].xyz;
    let tangent = tangents[vertex];
    let bitangent = tangent.w * cross(normal, tangent.xyz);
    let gradient_u = uv_gradients[vertex][0].xyz;
    let gradient_v = uv_gradients[vertex][1].xyz;
    var plane = vec4f(normal, 0.0);
    if HAS_PLANES != 0u {
        plane = planes[point];
    }
    return Varyings(
        frame.clip_from_world * vec4f(positions[point].xyz, 1.0),
        normal,
        tangent,
        uvs[vertex],
        vec4f(
            dot(gradient_u, tangent.xyz),
            dot(gradient_u, bitangent),
            dot(gradient_v, tangent.xyz),
            dot(gradient_v, bitangent),
        ),
        plane,
    );
}

@fragment
fn geometry_fragment(in: Varyings) -> Packed {
    let handedness = select(0u, 1u, in.tangent.w < 0.0);
    return Packed(
        vec4u(
            bitcast<u32>(in.uv.x),
            bitcast<u32>(in.uv.y),
            octahedral(in.normal),
            (octahedral(in.tangent.xyz) & 0xfffffffeu) | handedness,
        ),
        vec4u(
            octahedral(in.plane.xyz),
            bitcast<u32>(in.plane.w),
            pack2x16float(clamp(in.gradients.xy, vec2f(-65504.0), vec2f(65504.0))),
            pack2x16float(clamp(in.gradients.zw, vec2f(-65504.0), vec2f(65504.0))),
        ),
    );
}
