// What kernels over listed leaves of 32 points share: their bindings, and taking over where moved points lie.
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

const SAMPLES: u32 = 16u;

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var positions: texture_2d<f32>;
// point, bits of the weight: 16 a slot
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
