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
@group(0) @binding(2) var<storage, read> normals: array<vec4f>;
@group(0) @binding(3) var<storage, read> planes: array<vec4f>;

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
fn geometry_vertex(
    @location(0) point: u32,
    @location(1) uv: vec2f,
    @location(2) tangent: vec4f,
    @location(3) gradient_u: vec3f,
    @location(4) gradient_v: vec3f,
) -> Varyings {
    let normal = normals[point].xyz;
    let bitangent = tangent.w * cross(normal, tangent.xyz);
    var plane = vec4f(normal, 0.0);
    if HAS_PLANES != 0u {
        plane = planes[point];
    }
    return Varyings(
        frame.clip_from_world * vec4f(positions[point].xyz, 1.0),
        normal,
        tangent,
        uv,
        vec4f(
            dot(gradient_u, tangent.xyz),
            dot(gradient_u, bitangent),
            dot(gradient_v, tangent.xyz),
            dot(gradient_v, bitangent),
        ),
        plane,
    );
}

fn base_of(in: Varyings) -> vec4u {
    let handedness = select(0u, 1u, in.tangent.w < 0.0);
    return vec4u(
        bitcast<u32>(in.uv.x),
        bitcast<u32>(in.uv.y),
        octahedral(in.normal),
        (octahedral(in.tangent.xyz) & 0xfffffffeu) | handedness,
    );
}

// For models that look at the surface alone.
@fragment
fn base_fragment(in: Varyings) -> @location(0) vec4u {
    return base_of(in);
}

// For models that look below it.
@fragment
fn detail_fragment(in: Varyings) -> Packed {
    let gradients = clamp(in.gradients, vec4f(-65504.0), vec4f(65504.0));
    return Packed(
        base_of(in),
        vec4u(
            octahedral(in.plane.xyz),
            bitcast<u32>(in.plane.w),
            pack2x16float(gradients.xy),
            pack2x16float(gradients.zw),
        ),
    );
}
