// What kernels over listed leaves of 32 points share: their bindings, taking over where moved points lie, and the walk
// over the samples of a patch. A kernel declares `Sums` and how a sample is added to them:
//
//   fn add(sums: ptr<function, Sums>, d: vec3f, weight: f32)
//
// Units:   metres.

struct Params {
    slot_count: u32,
    // one over the radius of the patches
    per_m: f32,
    // how near to the tangent plane a patch's mean lies that takes it without a fit
    skip_m: f32,
    pad0: u32,
}

// Texels of a patch: four of points, two of weights as half floats.
const TEXELS: u32 = 6u;

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var positions: texture_2d<f32>;
// sixteen points and their weights for each slot
@group(0) @binding(2) var samples: texture_2d<u32>;
@group(0) @binding(3) var<storage, read> order: array<u32>;
@group(0) @binding(4) var<storage, read> listed: array<u32>;
@group(0) @binding(5) var<storage, read> moved_leaves: array<u32>;
// what the next frame's points are held against
@group(0) @binding(6) var committed: texture_storage_2d<rgba32float, write>;
@group(0) @binding(7) var<storage, read> normals: array<vec4f>;

// A leaf that moved is always among those listed.
fn commit(leaf: u32, slot: u32, point: u32, place: vec3f) {
    if moved_leaves[leaf] != 0u {
        textureStore(committed, entry(slot), vec4f(place, f32(point)));
    }
}

fn add_two(sums: ptr<function, Sums>, at: vec3f, points: vec2u, halves: u32) {
    let weights = unpack2x16float(halves);
    add(sums, textureLoad(positions, entry(points.x), 0).xyz - at, weights.x);
    add(sums, textureLoad(positions, entry(points.y), 0).xyz - at, weights.y);
}

// Adds the samples of `slot` in their order, as they lie about `at`.
fn add_samples(sums: ptr<function, Sums>, slot: u32, at: vec3f) {
    for (var side = 0u; side < 2u; side += 1u) {
        let first = TEXELS * slot + 2u * side;
        let weights = textureLoad(samples, entry(TEXELS * slot + 4u + side), 0);
        let four = textureLoad(samples, entry(first), 0);
        add_two(sums, at, four.xy, weights.x);
        add_two(sums, at, four.zw, weights.y);
        let next = textureLoad(samples, entry(first + 1u), 0);
        add_two(sums, at, next.xy, weights.z);
        add_two(sums, at, next.zw, weights.w);
    }
}
