// Five to eight layers, of two textures: what subsurface.wgsl needs of them, and what medium.wgsl is for four.
// Follows pixel.wgsl.
//
// Layers are counted by loops; four are written out in layers_four.wgsl, which costs less.
//
// Source:  François 2006, section 3 ("N textures store 4N layers"); the formulas of medium.wgsl.
// Twin:    src/optics/stack.rs, fn march
// Parity:  tests/shading_parity.rs, fn eight_layers_match_the_cpu_twin
// Threads: none of its own.
// Units:   metres, 1/m, 1/sr.
// Fails:   as medium.wgsl.

override LAYER_COUNT: u32 = 8u;

// Boundaries of layers 5 to 8.
@group(0) @binding(14) var deep_layer_map: texture_2d<f32>;

const INV_FOUR_PI: f32 = 0.07957747;

// Depth of each layer's lower boundary, or how far something lies below it, or the share that lies above it.
struct Bottoms {
    upper: vec4f,
    lower: vec4f,
}

struct Phases {
    each: array<f32, 8>,
}

// Extinction [1/m] of each layer, or what scatters in it.
struct Layers {
    each: array<vec3f, 8>,
}

// Which layer.
alias Pick = u32;

fn bottoms_at(ray: Ray, t: f32) -> Bottoms {
    let uv = ray.uv + t * ray.drift;
    let upper = textureSampleLevel(layer_map, linear_sampler, uv, 0.0);
    let lower = textureSampleLevel(deep_layer_map, linear_sampler, uv, 0.0);
    return Bottoms(ray.deepest_m * upper, ray.deepest_m * lower);
}

fn of_layer(j: u32, b: Bottoms) -> f32 {
    return select(b.lower[j & 3u], b.upper[j & 3u], j < 4u);
}

fn extinctions() -> Layers {
    var layers: Layers;
    for (var j = 0u; j < 8u; j += 1u) {
        layers.each[j] = frame.extinction[j].xyz;
    }
    return layers;
}

fn phases_towards(cos_angle: f32) -> Phases {
    var p: Phases;
    for (var j = 0u; j < 8u; j += 1u) {
        let k = frame.extinction[j].w;
        let base = 1.0 + k * cos_angle;
        p.each[j] = INV_FOUR_PI * (1.0 - k * k) / max(base * base, 1e-6);
    }
    return p;
}

fn sources_of(p: Phases) -> Layers {
    var sources: Layers;
    for (var j = 0u; j < 8u; j += 1u) {
        sources.each[j] = p.each[j] * frame.albedo[j].xyz;
    }
    return sources;
}

// With what scatters more than once.
fn with_often(k: u32, ray: Ray, sources: Layers) -> Layers {
    var sum = sources;
    for (var j = 0u; j < LAYER_COUNT; j += 1u) {
        sum.each[j] += often_of(k, j, ray);
    }
    return sum;
}

fn boundary(pick: Pick, bottoms: Bottoms) -> f32 {
    return of_layer(pick, bottoms);
}

fn is_last(pick: Pick) -> bool {
    return pick + 1u == LAYER_COUNT;
}

fn below_all(depth: f32, bottoms: Bottoms) -> Bottoms {
    return Bottoms(depth - bottoms.upper, depth - bottoms.lower);
}

fn optical_depth(s: f32, cosine: f32, bottoms: Bottoms, layers: Layers) -> vec3f {
    let inverse = 1.0 / max(cosine, 1e-3);
    var sum = vec3f(0.0);
    var begin = 0.0;
    for (var j = 0u; j < LAYER_COUNT; j += 1u) {
        let end = select(min(of_layer(j, bottoms) * inverse, s), s, j + 1u == LAYER_COUNT);
        sum += (end - begin) * layers.each[j];
        begin = end;
    }
    return sum;
}

fn mean_transmittance(a0: vec3f, a1: vec3f, e0: vec3f, e1: vec3f) -> vec3f {
    let change = a1 - a0;
    let is_flat = abs(change) < vec3f(0.02);
    return select((e0 - e1) / select(change, vec3f(1.0), is_flat), 0.5 * (e0 + e1), is_flat);
}

fn above_four(start: vec4f, end: vec4f) -> vec4f {
    let below = max(start, vec4f(0.0)) + max(end, vec4f(0.0));
    return 1.0 - below / max(abs(start) + abs(end), vec4f(1e-12));
}

fn above(start: Bottoms, end: Bottoms) -> Bottoms {
    return Bottoms(above_four(start.upper, end.upper), above_four(start.lower, end.lower));
}

fn above_at_start(below: Bottoms) -> Bottoms {
    return Bottoms(
        select(vec4f(1.0), vec4f(0.0), below.upper > vec4f(0.0)),
        select(vec4f(1.0), vec4f(0.0), below.lower > vec4f(0.0)),
    );
}

struct Segment {
    // Optical depth from the eye at the start, and at the end of each layer within.
    start: vec3f,
    ends: array<vec3f, 8>,
}

fn segment(a0: vec3f, length: f32, shares: Bottoms, layers: Layers) -> Segment {
    var s: Segment;
    s.start = a0;
    var a = a0;
    var begin = 0.0;
    for (var j = 0u; j < LAYER_COUNT; j += 1u) {
        let share = select(of_layer(j, shares), 1.0, j + 1u == LAYER_COUNT);
        a += length * (share - begin) * layers.each[j];
        s.ends[j] = a;
        begin = share;
    }
    return s;
}

fn end_of(s: Segment) -> vec3f {
    return s.ends[LAYER_COUNT - 1u];
}

struct Gathered {
    upper: vec3f,
    lower: vec3f,
}

// Adds what one layer sends to the half that it belongs to.
fn add(sum: ptr<function, Gathered>, j: u32, light: vec3f) {
    if 2u * j < LAYER_COUNT {
        (*sum).upper += light;
    } else {
        (*sum).lower += light;
    }
}

fn gather(s: Segment, before: vec3f, after: vec3f, sources: Layers) -> Gathered {
    let growth = end_of(s) - s.start;
    let r = 1.0 + (after - before) / max(growth, vec3f(1e-12));
    let start = s.start + before;
    let is_flat = abs(r * growth) < vec3f(0.02);
    let over = 1.0 / select(r, vec3f(1.0), is_flat);
    let mean = 0.5 * (exp(-start) + exp(-(end_of(s) + after)));
    var sum: Gathered;
    var a = s.start;
    var e = exp(-start);
    for (var j = 0u; j < LAYER_COUNT; j += 1u) {
        let a_next = s.ends[j];
        var e_next = exp(-(start + r * (a_next - s.start)));
        if j + 1u == LAYER_COUNT {
            e_next = exp(-(end_of(s) + after));
        }
        add(&sum, j, select((e - e_next) * over, (a_next - a) * mean, is_flat) * sources.each[j]);
        a = a_next;
        e = e_next;
    }
    return sum;
}

fn gather_at_start(s: Segment, before: vec3f, below: Bottoms, sources: Layers) -> Gathered {
    var j = 0u;
    for (; j + 1u < LAYER_COUNT; j += 1u) {
        if of_layer(j, below) <= 0.0 {
            break;
        }
    }
    var sum: Gathered;
    add(&sum, j, (end_of(s) - s.start) * exp(-(s.start + before)) * sources.each[j]);
    return sum;
}

fn by_layer(ray: Ray, unshadowed: f32) -> Gathered {
    let layers = extinctions();
    var m = march_start(ray, unshadowed);
    let p0 = m.beam0.phases;
    let p1 = m.beam1.phases;
    let p2 = m.beam2.phases;
    let p3 = m.beam3.phases;
    var sum: Gathered;
    for (var j = 0u; j < LAYER_COUNT; j += 1u) {
        let p = vec4f(p0.each[j], p1.each[j], p2.each[j], p3.each[j]);
        let light = gather_layer(&m, ray, layers, layers.each[j], j, j, p);
        add(&sum, j, light * frame.albedo[j].xyz);
    }
    return sum;
}
