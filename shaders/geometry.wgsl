// The visible surface, drawn once into packed numbers that the surface model reads: each pixel is then
// shaded exactly once, however small the triangles are.
//
//   base   = { u, v, octahedral normal, octahedral tangent with the handedness in its lowest bit }
//   detail = { octahedral normal of the plane, its offset [mm] and thickness, gradient of u, gradient of v }    planes
//            { a and b, c and thickness, gradient of u, gradient of v }                                       quadrics
//
// Gradients and bends [1/m] are along the tangent and the bitangent: (ds, dt) = (d.t u_t + d.b u_b, ...), and
// z = 1/2 (a t^2 + 2 b t b + c b^2). Thickness is that of a layer now over that at rest: tissue keeps its volume, so it is
// the area at rest over that now, |g_u x g_v| now over that at rest; times the volume that muscle wants, in the fourth
// number of a position.
//
// Source:  do Carmo, "Differential Geometry of Curves and Surfaces" (1976), 2.5, for the area; Cigolla et al., "A Survey of Efficient Representations for Independent Unit Vectors", JCGT 2014.
// Twin:    src/optics/pack.rs, fn octahedral
// Parity:  tests/shading_parity.rs, fn packed_directions_match_the_cpu_twin
// Threads: one a vertex; one a covered pixel of each triangle.
// Units:   metres, 1/m.
// Fails:   gradients and bends above 65504 / m are cut.

@group(0) @binding(1) var<storage, read> positions: array<vec4f>;
@group(0) @binding(2) var<storage, read> normals: array<vec4f>;
// A vec4f a point for planes, two for quadrics.
@group(0) @binding(3) var<storage, read> primitives: array<vec4f>;

// Gradients of u along tangent and bitangent, then of v, of each vertex at rest [1/m]; read if asked for below.
@group(0) @binding(4) var<storage, read> rest_gradients: array<vec4f>;

// 1: the papers' unit frames, in which gradients stay as they were at rest however the tissue stretches.
override UNIT_FRAMES: u32 = 0u;
// 1: layers thin where the surface stretches.
override FOLLOWS_VOLUME: u32 = 0u;

const THICKNESS_MIN: f32 = 0.25;
const THICKNESS_MAX: f32 = 4.0;

// What `primitives` holds: 0 nothing, the tangent plane is meant; 1 planes; 2 quadrics; 3 nothing, none is written.
override PRIMITIVE: u32 = 0u;

struct Varyings {
    @builtin(position) clip: vec4f,
    @location(0) normal: vec3f,
    @location(1) tangent: vec4f,
    @location(2) uv: vec2f,
    @location(3) gradients: vec4f,
    // Normal and offset of the plane, or the quadric's bends (a, b, c).
    @location(4) primitive: vec4f,
    @location(5) thickness: f32,
}

fn uv_area_per_m2(gradients: vec4f) -> f32 {
    return abs(gradients.x * gradients.w - gradients.y * gradients.z);
}

fn thickness_of(now: vec4f, rest: vec4f) -> f32 {
    let at_rest = uv_area_per_m2(rest);
    let thickness = clamp(uv_area_per_m2(now) / max(at_rest, 1e-12), THICKNESS_MIN, THICKNESS_MAX);
    return select(1.0, thickness, at_rest > 1e-12);
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
    @builtin(vertex_index) vertex: u32,
    @location(0) point: u32,
    @location(1) uv: vec2f,
    @location(2) tangent: vec4f,
    @location(3) gradient_u: vec3f,
    @location(4) gradient_v: vec3f,
) -> Varyings {
    let normal = normals[point].xyz;
    let bitangent = tangent.w * cross(normal, tangent.xyz);
    var primitive = select(vec4f(normal, 0.0), vec4f(0.0), PRIMITIVE == 3u);
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
    var gradients = vec4f(
        dot(gradient_u, tangent.xyz),
        dot(gradient_u, bitangent),
        dot(gradient_v, tangent.xyz),
        dot(gradient_v, bitangent),
    );
    var thickness = 1.0;
    if FOLLOWS_VOLUME != 0u {
        thickness = positions[point].w * thickness_of(gradients, rest_gradients[vertex]);
    }
    if UNIT_FRAMES != 0u {
        gradients = rest_gradients[vertex];
    }
    return Varyings(
        frame.clip_from_world * vec4f(positions[point].xyz, 1.0),
        normal,
        tangent,
        uv,
        gradients,
        primitive,
        thickness,
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
    var words = vec2u(0u, pack2x16float(vec2f(0.0, in.thickness)));
    if PRIMITIVE < 2u {
        let offset_mm = clamp(1e3 * in.primitive.w, -65504.0, 65504.0);
        words = vec2u(
            octahedral(in.primitive.xyz),
            pack2x16float(vec2f(offset_mm, in.thickness)),
        );
    }
    if PRIMITIVE == 2u {
        words = vec2u(
            pack2x16float(in.primitive.xy),
            pack2x16float(vec2f(in.primitive.z, in.thickness)),
        );
    }
    return Packed(
        base_of(in),
        vec4u(words, pack2x16float(gradients.xy), pack2x16float(gradients.zw)),
    );
}
