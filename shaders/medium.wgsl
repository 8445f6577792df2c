// Light in scattering layers: phase function, optical depth along a path, and the light that one
// piece of the view ray sends to the eye. No bindings.
//
//   p(cos) = (1 - k^2) / (4 pi (1 + k cos)^2)     cos between w_in and w_out, both pointing away from M
//   d_j    = max(0, min(s - sum_{i<j} D_i / c, D_j / c))            Norberg eq. 14; the last layer has no end
//   L      = sigma_s p E ds exp(-min(A0, A1)) g(|A1 - A0|),  g(x) = (1 - exp(-x)) / x
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
// layers' lower boundaries [m], `cosine` that of the path's angle with the normal.
fn optical_depth(s: f32, cosine: f32, bottoms: vec4f, sigma_t: array<vec3f, 4>) -> vec3f {
    let along = bottoms / max(cosine, 1e-4);
    let d0 = min(s, along.x);
    let d1 = clamp(s - along.x, 0.0, max(along.y - along.x, 0.0));
    let d2 = clamp(s - along.y, 0.0, max(along.z - along.y, 0.0));
    let d3 = max(s - d0 - d1 - d2, 0.0);
    return d0 * sigma_t[0] + d1 * sigma_t[1] + d2 * sigma_t[2] + d3 * sigma_t[3];
}

// The layer at `depth` [m].
fn layer_at(depth: f32, bottoms: vec4f) -> u32 {
    return u32(depth > bottoms.x) + u32(depth > bottoms.y) + u32(depth > bottoms.z);
}

// (1 - exp(-x)) / x for x >= 0.
fn mean_transmittance(x: vec3f) -> vec3f {
    let near = 1.0 - x * (0.5 - x / 6.0);
    let far = (1.0 - exp(-x)) / max(x, vec3f(1e-3));
    return select(far, near, x < vec3f(1e-3));
}

// Mean of exp(-A) over a piece along which A goes evenly from a0 to a1. Never a growing exponential.
fn piece(a0: vec3f, a1: vec3f) -> vec3f {
    return exp(-min(a0, a1)) * mean_transmittance(abs(a1 - a0));
}
