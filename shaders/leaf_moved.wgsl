// Which leaves of 32 neighbouring points moved, and which are to be fitted anew for it.
//
//   moved:  |x - x_committed| > tolerance / 2  for any point of the leaf
//
// A moved leaf lists every leaf that has a sample in it, or a normal that hangs on a point in it; whoever
// marks a leaf first lists it. The next kernel is sent to listed leaves only, and to none if none moved.
// Leaves and not points are listed: the threads of a leaf run side by side, so one alone would save nothing.
//
// Source:  none; the idea is that of a dirty bit.
// Twin:    src/geom/sample.rs, fn find
// Parity:  tests/light_parity.rs, fn sampled_planes_match_the_cpu_twin
// Threads: one per leaf. The order of the list is left to chance; no result depends on it.
// Units:   metres.
// Fails:   nowhere; a tolerance of 0 counts every change.

struct Params {
    slot_count: u32,
    tolerance_squared_m2: f32,
    pad0: u32,
    pad1: u32,
}

struct Frame {
    moved: atomic<u32>,
    refitted: atomic<u32>,
    listed: atomic<u32>,
    // leaves that are listed
    marks: array<atomic<u32>>,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var positions: texture_2d<f32>;
// where each slot lay when its leaf last moved, and its point in w
@group(0) @binding(2) var committed: texture_2d<f32>;
@group(0) @binding(3) var<storage, read> dependent_start: array<u32>;
@group(0) @binding(4) var<storage, read> dependents: array<u32>;
// zeros at the start of the frame
@group(0) @binding(5) var<storage, read_write> frame: Frame;
@group(0) @binding(6) var<storage, read_write> listed: array<u32>;
@group(0) @binding(7) var<storage, read_write> moved_leaves: array<u32>;
// workgroups of the next kernel; x is zero at the start of the frame
@group(0) @binding(8) var<storage, read_write> workgroups: array<atomic<u32>, 3>;

fn slots_of(leaf: u32) -> u32 {
    return min(32u, params.slot_count - 32u * leaf);
}

@compute @workgroup_size(8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let leaf = id.x;
    let first = 32u * leaf;
    if first >= params.slot_count {
        return;
    }
    let count = slots_of(leaf);
    var moved = 0u;
    for (var i = 0u; i < count; i += 1u) {
        let old = textureLoad(committed, entry(first + i), 0);
        let d = textureLoad(positions, entry(u32(old.w)), 0).xyz - old.xyz;
        moved += select(0u, 1u, dot(d, d) > params.tolerance_squared_m2);
    }
    moved_leaves[leaf] = moved;
    if moved == 0u {
        return;
    }
    atomicAdd(&frame.moved, moved);
    let end = dependent_start[leaf + 1u];
    for (var k = dependent_start[leaf]; k < end; k += 1u) {
        let dependent = dependents[k];
        if atomicExchange(&frame.marks[dependent], 1u) == 0u {
            let place = atomicAdd(&frame.listed, 1u);
            listed[place] = dependent;
            atomicMax(&workgroups[0], place + 1u);
            atomicAdd(&frame.refitted, slots_of(dependent));
        }
    }
}
