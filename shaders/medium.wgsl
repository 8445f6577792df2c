// Light in scattering layers: phase function, optical depth along a path, and the light that one
// piece of the view ray sends to the eye. No bindings.
//
//   p(cos) = (1 - k^2) / (4 pi (1 + k cos)^2)     cos between w_in and w_out, both pointing away from M
//   d_j    = max(0, min(s - sum_{i<j} D_i / c, D_j / c))            Norberg eq. 14; the last layer has no end
//   L      = sigma_s p E ds (exp(-A0) - exp(-A1)) / (A1 - A0)
//
// `w_in` points to the light, `w_out` to the eye: cos = +1 is light thrown back, and k > 0 scatters
// forwards. A is the optical depth from the light to a point plus that from the point to the eye.
//
// Source:  François 2006, eqs. 2, 6, 12; Norberg 2010, eqs. 3, 14; the closed form integrates an exponential
//          whose exponent is linear along the piece.
// Twin:    src/optics/medium.rs, fn phase
// Parity:  tests/shading_parity.rs, fn medium_functions_match_the_cpu_twin
// Threads: none of its own.
// Units:   metres, 1/m, 1/sr.
// Fails:   k beyond +-0.98; cos of the light's angle below 1e-4 is taken as 1e-4.

const INV_FOUR_PI: f32 = 0.07957747;

fn phase(cos_angle: f32, k: f32) -> f32 {
    let base = 1.0 + k * cos_angle;
    return INV_FOUR_PI * (1.0 - k * k) / max(base * base, 1e-6);
}

// Optical depth of a path of length `s` [m] from the surface inwards. `bottoms` are the depths of the
// layers' lower boundaries [m], `cosine` that of the path's angle with the normal; `sigma_t` has a column a
// layer.
fn optical_depth(s: f32, cosine: f32, bottoms: vec4f, sigma_t: mat4x3f) -> vec3f {
    let along = bottoms.xyz / max(cosine, 1e-4);
    let tops = vec3f(0.0, max(along.x, 0.0), max(along.x, along.y));
    let d = clamp(vec3f(s) - tops, vec3f(0.0), max(along - tops, vec3f(0.0)));
    return sigma_t * vec4f(d, max(s - d.x - d.y - d.z, 0.0));
}

// How much of the depths from `top` to `bottom` [m] each layer fills.
fn filled(top: f32, bottom: f32, bottoms: vec4f) -> vec4f {
    let e1 = clamp(bottoms.x, top, bottom);
    let e2 = clamp(bottoms.y, e1, bottom);
    let e3 = clamp(bottoms.z, e2, bottom);
    return vec4f(e1 - top, e2 - e1, e3 - e2, bottom - e3) / max(bottom - top, 1e-9);
}

// The layer at `depth` [m].
fn layer_at(depth: f32, bottoms: vec4f) -> u32 {
    return u32(depth > bottoms.x) + u32(depth > bottoms.y) + u32(depth > bottoms.z);
}

// Mean of exp(-A) over a piece along which A goes evenly from a0 to a1; e0 and e1 are exp(-a0) and exp(-a1).
// Never a growing exponential, and one exponential a node.
fn piece(a0: vec3f, a1: vec3f, e0: vec3f, e1: vec3f) -> vec3f {
    let change = a1 - a0;
    let is_flat = abs(change) < vec3f(0.02);
    // Where A hardly changes the quotient loses its digits; there the mean errs by change^2 / 12.
    let safe = select(change, vec3f(1.0), is_flat);
    return select((e0 - e1) / safe, 0.5 * (e0 + e1), is_flat);
}
