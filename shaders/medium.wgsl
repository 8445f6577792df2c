// Light in scattering layers: phase function, optical depth along a path, and what one segment of the view
// ray sends to the eye. No bindings.
//
//   p(cos) = (1 - k^2) / (4 pi (1 + k cos)^2)     cos between w_in and w_out, both pointing away from M
//   d_j    = max(0, min(s - sum_{i<j} D_i / c, D_j / c))            Norberg eq. 14; the last layer has no end
//   A(f)   = a(f) + tau(f),   tau grows with a:  A = A0 + r (a - a0),  r = 1 + (tau1 - tau0) / (a1 - a0)
//   L      = sum_j albedo_j p_j E (exp(-A_j) - exp(-A_j+1)) / r
//
// `w_in` points to the light, `w_out` to the eye: cos = +1 is light thrown back, and k > 0 scatters forwards.
// a is the optical depth from the eye, tau that from the light. Both pile up in the same layers, so tau is
// taken to grow along a segment as a does, not evenly with length: then one segment is exact for parallel
// layers, and every exponential belongs to a layer's end and is shared by its neighbours.
//
// Source:  François 2006, eqs. 2, 6, 12; Norberg 2010, eqs. 3, 14; the segment is the integral of an
//          exponential whose exponent is linear in a.
// Twin:    src/optics/medium.rs, fn phase
// Parity:  tests/shading_parity.rs, fn medium_functions_match_the_cpu_twin
// Threads: none of its own.
// Units:   metres, 1/m, 1/sr.
// Fails:   k beyond +-0.98; cos of the light's angle below 1e-3 is taken as 1e-3.

const INV_FOUR_PI: f32 = 0.07957747;

// Depth of the lower boundary of the first three layers, or how far something lies below each.
alias Bottoms = vec3f;

// Extinction of the four layers [1/m].
struct Layers {
    t0: vec3f,
    t1: vec3f,
    t2: vec3f,
    t3: vec3f,
}

fn phase(cos_angle: f32, k: f32) -> f32 {
    let base = 1.0 + k * cos_angle;
    return INV_FOUR_PI * (1.0 - k * k) / max(base * base, 1e-6);
}

fn phases(cos_angle: f32, k: vec4f) -> vec4f {
    let base = 1.0 + k * cos_angle;
    return INV_FOUR_PI * (1.0 - k * k) / max(base * base, vec4f(1e-6));
}

// Optical depth of a path of length `s` [m] from the surface inwards, at an angle of `cosine` with the normal.
// `bottoms` are the depths of the lower boundaries of the first three layers [m], ascending.
fn optical_depth(s: f32, cosine: f32, bottoms: vec3f, layers: Layers) -> vec3f {
    let ends = min(bottoms / max(cosine, 1e-3), vec3f(s));
    return ends.x * layers.t0 + (ends.y - ends.x) * layers.t1 + (ends.z - ends.y) * layers.t2
        + (s - ends.z) * layers.t3;
}

// Mean of exp(-A) over a piece of one layer along which A goes evenly from a0 to a1; e0 and e1 are exp(-a0) and
// exp(-a1). Never a growing exponential, and one exponential a sample.
fn mean_transmittance(a0: vec3f, a1: vec3f, e0: vec3f, e1: vec3f) -> vec3f {
    let change = a1 - a0;
    // Where A hardly changes the quotient loses its digits; there the mean of the ends errs by change^2 / 12.
    let is_flat = abs(change) < vec3f(0.02);
    return select((e0 - e1) / select(change, vec3f(1.0), is_flat), 0.5 * (e0 + e1), is_flat);
}

// Share of a segment that lies above each boundary; `start` and `end` are how far its ends lie below them [m].
fn above(start: vec3f, end: vec3f) -> vec3f {
    let below = max(start, vec3f(0.0)) + max(end, vec3f(0.0));
    return 1.0 - below / max(abs(start) + abs(end), vec3f(1e-12));
}

fn below_all(depth: f32, bottoms: Bottoms) -> Bottoms {
    return depth - bottoms;
}

// The same where its start stands for all of it.
fn above_at_start(below: Bottoms) -> Bottoms {
    return select(vec3f(1.0), vec3f(0.0), below > vec3f(0.0));
}

// Optical depth from the eye at a segment's end and at the ends of the layers within it.
struct Segment {
    a0: vec3f,
    a1: vec3f,
    a2: vec3f,
    a3: vec3f,
    a4: vec3f,
}

fn segment(a0: vec3f, length: f32, shares: vec3f, layers: Layers) -> Segment {
    let a1 = a0 + length * shares.x * layers.t0;
    let a2 = a1 + length * (shares.y - shares.x) * layers.t1;
    let a3 = a2 + length * (shares.z - shares.y) * layers.t2;
    return Segment(a0, a1, a2, a3, a3 + length * (1.0 - shares.z) * layers.t3);
}

// What a segment sends to the eye per irradiance: of the upper two layers, and of the lower two, so that each
// pair can be tinted. `before` and `after` are the light's optical depths at its ends, `sources` holds albedo
// times phase of each layer.
struct Gathered {
    upper: vec3f,
    lower: vec3f,
}

fn gather(s: Segment, before: vec3f, after: vec3f, sources: Layers) -> Gathered {
    let growth = s.a4 - s.a0;
    let r = 1.0 + (after - before) / max(growth, vec3f(1e-12));
    let start = s.a0 + before;
    let e0 = exp(-start);
    let e1 = exp(-(start + r * (s.a1 - s.a0)));
    let e2 = exp(-(start + r * (s.a2 - s.a0)));
    let e3 = exp(-(start + r * (s.a3 - s.a0)));
    let e4 = exp(-(s.a4 + after));
    // Where A hardly changes the differences lose their digits; there the mean of the ends errs by change^2 / 12.
    let is_flat = abs(r * growth) < vec3f(0.02);
    let over = 1.0 / select(r, vec3f(1.0), is_flat);
    let mean = 0.5 * (e0 + e4);
    let g0 = select((e0 - e1) * over, (s.a1 - s.a0) * mean, is_flat);
    let g1 = select((e1 - e2) * over, (s.a2 - s.a1) * mean, is_flat);
    let g2 = select((e2 - e3) * over, (s.a3 - s.a2) * mean, is_flat);
    let g3 = select((e3 - e4) * over, (s.a4 - s.a3) * mean, is_flat);
    return Gathered(g0 * sources.t0 + g1 * sources.t1, g2 * sources.t2 + g3 * sources.t3);
}

// The papers' step: its start stands for all of it. `below` is how far the start lies below each boundary [m].
fn gather_at_start(s: Segment, before: vec3f, below: vec3f, sources: Layers) -> Gathered {
    let light = (s.a4 - s.a0) * exp(-(s.a0 + before));
    let is_below = below > vec3f(0.0);
    let upper = select(sources.t0, sources.t1, is_below.x) * light;
    let lower = select(sources.t2, sources.t3, is_below.z) * light;
    return Gathered(select(upper, vec3f(0.0), is_below.y), select(vec3f(0.0), lower, is_below.y));
}
