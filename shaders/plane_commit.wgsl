// Takes over where moved slots are now, once all patches have seen them move.
//
// Source:  none.
// Twin:    src/geom/moments.rs, fn find_moved
// Parity:  tests/gpu_parity.rs, fn incremental_planes_match_the_cpu_twin
// Threads: one per leaf of 32 slots.
// Units:   metres.
// Fails:   nowhere.

struct Params {
    slot_count: u32,
    tolerance_squared_m2: f32,
    pad0: u32,
    pad1: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var moved: texture_2d<u32>;
@group(0) @binding(2) var now: texture_2d<f32>;
@group(0) @binding(3) var committed: texture_storage_2d<rgba32float, write>;

@compute @workgroup_size(8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let leaf = id.x;
    if 32u * leaf >= params.slot_count {
        return;
    }
    for (var bits = textureLoad(moved, entry(leaf), 0).x; bits != 0u; bits &= bits - 1u) {
        let slot = entry(32u * leaf + firstTrailingBit(bits));
        textureStore(committed, slot, textureLoad(now, slot, 0));
    }
}
