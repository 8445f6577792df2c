// The way of light to a point below the surface, by the planes that stand for the surface. No bindings; follows
// pack.wgsl.
//
//   m = (1 - b) N + b n,   P_M = P + b h n           plane of the sample, blended from tangent to fitted
//   s = (P_M - M).m / (m.w_in),  M = P - t w_out     signed; a plane that faces away from the light is unlit
//
// With M on the view ray all of it follows from six cosines, and m needs no normalizing. The plane is blended
// by the square of the share of the way: with eq. 9's first power the plane sinks as fast as the sample does,
// and every K'M is short by the same factor, those near the surface too.
//
// Source:  François 2006, eqs. 9, 10, 14 (here with the sign of the offset); Norberg 2010, eq. 11.
// Twin:    src/optics/light_plane.rs, fn way_to_light
// Parity:  tests/shading_parity.rs, fn light_planes_match_the_cpu_twin
// Threads: none of its own.
// Units:   metres.
// Fails:   light that enters far from P; folds below the radius of the patch.

// 1: as printed, the absolute values of eq. 10 and no more: what faces away from the light is lit as if mirrored.
override MIRRORED: u32 = 0u;

struct PlanePair {
    // N.n, N.w_out, n.w_out
    normals: f32,
    tangent_eye: f32,
    plane_eye: f32,
    // h [m]
    offset: f32,
}

// Length of the way [m] and its cosine with the plane's normal; a cosine of 0 is unlit.
fn way_to_light(pair: PlanePair, t: f32, blend: f32, tangent_light: f32, plane_light: f32) -> vec2f {
    let rest = 1.0 - blend;
    let squared = rest * rest + blend * blend + 2.0 * rest * blend * pair.normals;
    let height = blend * pair.offset * (rest * pair.normals + blend)
        + t * (rest * pair.tangent_eye + blend * pair.plane_eye);
    let facing = rest * tangent_light + blend * plane_light;
    let cosine = facing * inverseSqrt(max(squared, 1e-6));
    if MIRRORED != 0u {
        return vec2f(abs(height) / max(abs(facing), 1e-3), max(abs(cosine), 1e-3));
    }
    let s = max(height, 0.0) / max(facing, 1e-3);
    return select(vec2f(0.0), vec2f(s, cosine), cosine > 1e-3);
}

// What stands for the surface here knows nothing of other parts that cast shadows.
const SEES_SHADOWS: bool = false;

// What stands for the surface over a view ray.
struct Cover {
    normal: vec3f,
    plane: vec3f,
    pair: PlanePair,
}

// Cosines of a light with both planes.
struct Facing {
    tangent: f32,
    plane: f32,
}

// From what geometry.wgsl wrote for the pixel.
fn cover_at(world: vec3f, normal: vec3f, tangent: vec3f, bitangent: vec3f, to_eye: vec3f, words: vec2u) -> Cover {
    let plane = from_octahedral(words.x);
    let pair = PlanePair(
        dot(normal, plane),
        dot(normal, to_eye),
        dot(plane, to_eye),
        1e-3 * unpack2x16float(words.y).x,
    );
    return Cover(normal, plane, pair);
}

fn facing_of(cover: Cover, light: u32, to_light: vec3f) -> Facing {
    return Facing(dot(cover.normal, to_light), dot(cover.plane, to_light));
}

fn way_under(cover: Cover, facing: Facing, t: f32, blend: f32) -> vec2f {
    return way_to_light(cover.pair, t, blend, facing.tangent, facing.plane);
}

// Where the view ray leaves the body again [m]: planes do not tell.
fn exit_of(cover: Cover) -> f32 {
    return 1e6;
}

// The cosine by which the papers' march ends: with the fitted plane.
fn printed_cosine(cover: Cover) -> f32 {
    return cover.pair.plane_eye;
}
