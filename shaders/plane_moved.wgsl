// Which points moved, and which patches they are in.
//
//   moved:  |x - x_committed| > tolerance      then x_before = x_committed, x_committed = x
//
// Membership is symmetric, so the patches that a point is in are those of its own patch's members.
// The lists of the 32 points of a leaf are joined beforehand: a leaf with a moved point marks all of
// them, and the next kernel passes over the few that have no moved member.
//
// Source:  none; the idea is that of a dirty bit.
// Twin:    src/geom/moments.rs, fn find_moved
// Parity:  tests/gpu_parity.rs, fn incremental_planes_match_the_cpu_twin
// Threads: one per leaf of 32 slots. Marks are set by atomic or, in any order to the same end.
// Units:   metres.
// Fails:   nowhere; a tolerance of 0 counts every change.

struct Params {
    slot_count: u32,
    tolerance_squared_m2: f32,
    pad0: u32,
    pad1: u32,
}

struct Slot {
    now: vec4f,
    before: vec4f,
}

struct Frame {
    moved: atomic<u32>,
    refitted: atomic<u32>,
    marked: array<atomic<u32>>,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> positions: array<vec4f>;
@group(0) @binding(2) var<storage, read> order: array<u32>;
@group(0) @binding(3) var<storage, read> leaf_start: array<u32>;
// leaf, members: the patches that points of a leaf are in
@group(0) @binding(4) var<storage, read> leaf_blocks: array<vec2u>;
@group(0) @binding(5) var<storage, read_write> slots: array<Slot>;
@group(0) @binding(6) var<storage, read_write> moved: array<u32>;
// zeros at the start of the frame
@group(0) @binding(7) var<storage, read_write> frame: Frame;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let leaf = id.x;
    let first = 32u * leaf;
    if first >= params.slot_count {
        return;
    }
    let count = min(32u, params.slot_count - first);
    var bits = 0u;
    for (var i = 0u; i < count; i += 1u) {
        let slot = first + i;
        let place = positions[order[slot]].xyz;
        let committed = slots[slot].now.xyz;
        let d = place - committed;
        if dot(d, d) > params.tolerance_squared_m2 {
            bits |= 1u << i;
            slots[slot].before = vec4f(committed, 0.0);
            slots[slot].now = vec4f(place, 0.0);
        }
    }
    moved[leaf] = bits;
    if bits == 0u {
        return;
    }
    atomicAdd(&frame.moved, countOneBits(bits));
    let end = leaf_start[leaf + 1u];
    for (var k = leaf_start[leaf]; k < end; k += 1u) {
        let block = leaf_blocks[k];
        atomicOr(&frame.marked[block.x], block.y);
    }
}
