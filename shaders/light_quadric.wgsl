// The way of light to a point below the surface, by the paraboloid that stands for the surface. No bindings.
//
//   F(x) = N.x - q(x, x) / 2,  q(x, y) = a x_u y_u + b (x_u y_v + x_v y_u) + c x_v y_v,   inside F < 0
//   M = -t w_out:   C = -F(M) = t N.w_out + t^2 q(w_out, w_out) / 2        how deep M lies
//   B = dF/ds at M = N.w_in + t q(w_out, w_in)                             how steeply light rises there
//   F(M + s w_in) = -C + B s - s^2 q(w_in, w_in) / 2 = 0
//   s = 2 C / (B + D),  D = sqrt(B^2 - 2 C q(w_in, w_in)) = dF/ds at K
//
// D > 0 is the root at which light goes in, so a light behind a bulge comes through the bulge (B < 0, where the same
// root is (D - B) / -q), and one that never meets the paraboloid is unlit. All but t is constant along a ray: a
// sample costs one root and one quotient. The layers lie along the normal at K.
//
// Source:  François 2006, eq. 10, with the plane replaced by the osculating paraboloid (do Carmo 1976, 3.3);
//          derived in docs/METHODS.md.
// Twin:    src/optics/light_quadric.rs, fn way_to_light
// Parity:  tests/shading_parity.rs, fn light_quadrics_match_the_cpu_twin
// Threads: none of its own.
// Units:   metres; a, b, c in 1/m.
// Fails:   light that enters beyond the patch, where the paraboloid is no more the surface.

// A paraboloid and a view ray in the frame of tangent, bitangent and normal.
struct Bend {
    // a, b, c
    bends: vec3f,
    to_eye: vec3f,
    // q(w_out, .), q(w_out, w_out)
    of_eye: vec2f,
    eye_eye: f32,
}

// A light in the same frame.
struct Aim {
    to_light: vec3f,
    // q(w_in, .), q(w_in, w_in), q(w_out, w_in)
    of_light: vec2f,
    light_light: f32,
    eye_light: f32,
}

fn applied(bends: vec3f, x: vec2f) -> vec2f {
    return vec2f(dot(bends.xy, x), dot(bends.yz, x));
}

fn bend_of(bends: vec3f, to_eye: vec3f) -> Bend {
    let of_eye = applied(bends, to_eye.xy);
    return Bend(bends, to_eye, of_eye, dot(of_eye, to_eye.xy));
}

fn aim_of(bend: Bend, to_light: vec3f) -> Aim {
    let of_light = applied(bend.bends, to_light.xy);
    return Aim(to_light, of_light, dot(of_light, to_light.xy), dot(bend.of_eye, to_light.xy));
}

// Length of the way [m] and its cosine with the surface's normal where it enters; a cosine of 0 is unlit.
fn way_to_light(bend: Bend, aim: Aim, t: f32) -> vec2f {
    let depth = max(t * bend.to_eye.z + 0.5 * t * t * bend.eye_eye, 0.0);
    let rise = aim.to_light.z + t * aim.eye_light;
    let squared = rise * rise - 2.0 * depth * aim.light_light;
    let root = sqrt(max(squared, 0.0));
    let front = 2.0 * depth / max(rise + root, 2e-3);
    let behind = (root - rise) / max(-aim.light_light, 1e-3);
    let s = select(behind, front, rise >= 0.0);
    let slope = s * aim.of_light - t * bend.of_eye;
    let cosine = root * inverseSqrt(1.0 + dot(slope, slope));
    let is_lit = squared >= 0.0 && cosine > 1e-3 && (rise >= 0.0 || aim.light_light < -1e-3);
    return select(vec2f(0.0), vec2f(s, cosine), is_lit);
}

// What stands for the surface here knows nothing of other parts that cast shadows.
const SEES_SHADOWS: bool = false;

// What stands for the surface over a view ray.
struct Cover {
    tangent: vec3f,
    bitangent: vec3f,
    normal: vec3f,
    bend: Bend,
}

alias Facing = Aim;

fn in_frame(cover_tangent: vec3f, cover_bitangent: vec3f, cover_normal: vec3f, d: vec3f) -> vec3f {
    return vec3f(dot(cover_tangent, d), dot(cover_bitangent, d), dot(cover_normal, d));
}

// From what geometry.wgsl wrote for the pixel.
fn cover_at(world: vec3f, normal: vec3f, tangent: vec3f, bitangent: vec3f, to_eye: vec3f, words: vec2u) -> Cover {
    let bends = vec3f(unpack2x16float(words.x), unpack2x16float(words.y).x);
    let bend = bend_of(bends, in_frame(tangent, bitangent, normal, to_eye));
    return Cover(tangent, bitangent, normal, bend);
}

fn facing_of(cover: Cover, light: u32, to_light: vec3f) -> Facing {
    return aim_of(cover.bend, in_frame(cover.tangent, cover.bitangent, cover.normal, to_light));
}

fn way_under(cover: Cover, facing: Facing, t: f32, blend: f32) -> vec2f {
    return way_to_light(cover.bend, facing, t);
}

// Where the view ray leaves the body again [m]: there its depth is back at zero.
fn exit_of(cover: Cover) -> f32 {
    let exit = 2.0 * max(cover.bend.to_eye.z, 1e-3) / max(-cover.bend.eye_eye, 1e-6);
    return max(exit, 1e-6);
}

// The cosine by which the papers' march ends; they know of planes alone.
fn printed_cosine(cover: Cover) -> f32 {
    return cover.bend.to_eye.z;
}
