// The visible surface, drawn once into packed numbers that the surface model reads: each pixel is then
// shaded exactly once, however small the triangles are.
//
//   base   = { u, v, octahedral normal, octahedral tangent with the handedness in its lowest bit }
//   detail = { octahedral normal of the plane, its offset, gradient of u, gradient of v }    planes
//            { a and b, c, gradient of u, gradient of v }                                    quadrics
//
// Gradients and bends [1/m] are along the tangent and the bitangent: (ds, dt) = (d.t u_t + d.b u_b, ...), and
// z = 1/2 (a t^2 + 2 b t b + c b^2).
//
// Source:  Cigolla et al., "A Survey of Efficient Representations for Independent Unit Vectors", JCGT 2014.
// Twin:    src/optics/pack.rs, fn octahedral
// Parity:  tests/shading_parity.rs, fn packed_directions_match_the_cpu_twin
// Threads: one a vertex; one a covered pixel of each triangle.
// Units:   metres, 1/m.
// Fails:   gradients and bends above 65504 / m are cut.

@group(0) @binding(1) var<storage, read> positions: array<vec4f>;
@group(0) @binding(2) var<storage, read> normals: array<vec4f>;
// A vec4f a point for planes, two for quadrics.
@group(0) @binding(3) var<storage, read> primitives: array<vec4f>;

// What `primitives` holds: 0 nothing, the tangent plane is meant; 1 planes; 2 quadrics.
override PRIMITIVE: u32 = 0u;

struct Varyings {
    @builtin(position) clip: vec4f,
    @location(0) normal: vec3f,
    @location(1) tangent: vec4f,
    @location(2) uv: vec2f,
    @location(3) gradients: vec4f,
    // Normal and offset of the plane, or the quadric's bends (a, b, c).
    @location(4) primitive: vec4f,
}

struct Packed {
    @location(0) base: vec4u,
    @location(1) detail: vec4u,
}

// The matrix that is kept in two vectors, times `d`.
fn times(squares: vec3f, products: vec3f, d: vec3f) -> vec3f {
    return squares * d + vec3f(
        products.x * d.y + products.y * d.z,
        products.x * d.x + products.z * d.z,
        products.y * d.x + products.z * d.y,
    );
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
    var primitive = vec4f(normal, 0.0);
    if PRIMITIVE == 1u {
        primitive = primitives[point];
    }
    if PRIMITIVE == 2u {
        let squares = primitives[2u * point].xyz;
        let products = primitives[2u * point + 1u].xyz;
        let along = times(squares, products, tangent.xyz);
        let across = times(squares, products, bitangent);
        let bends = vec3f(dot(tangent.xyz, along), dot(tangent.xyz, across), dot(bitangent, across));
        primitive = vec4f(clamp(bends, vec3f(-65504.0), vec3f(65504.0)), 0.0);
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
        primitive,
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
    var words = vec2u(octahedral(in.primitive.xyz), bitcast<u32>(in.primitive.w));
    if PRIMITIVE == 2u {
        words = vec2u(pack2x16float(in.primitive.xy), pack2x16float(in.primitive.zw));
    }
    return Packed(
        base_of(in),
        vec4u(words, pack2x16float(gradients.xy), pack2x16float(gradients.zw)),
    );
}
