// Which points moved, and which patches they are in.
//
//   moved:  |x - x_committed| > tolerance      then x_now = x, else x_now = x_committed
//
// Membership is symmetric, so the patches that a point is in are those of its own patch's members.
// The lists of 8 points of a leaf are joined beforehand: a run with a moved point marks all of them,
// and the next kernel passes over the few that have no moved member. Whoever sets a mark first
// lists the patch, so that the next kernel is sent to listed patches only, and to none if none moved.
//
// Source:  none; the idea is that of a dirty bit.
// Twin:    src/geom/moments.rs, fn find_moved
// Parity:  tests/gpu_parity.rs, fn incremental_planes_match_the_cpu_twin
// Threads: one per leaf of 32 slots. The order of the list is left to chance; no result depends on it.
// Units:   metres.
// Fails:   nowhere; a tolerance of 0 counts every change.

struct Params {
    slot_count: u32,
    tolerance_squared_m2: f32,
    pad0: u32,
    pad1: u32,
}

// Workgroup size of plane_incremental.wgsl.
const UPDATE_WORKGROUP_SIZE: u32 = 64u;

struct Frame {
    moved: atomic<u32>,
    refitted: atomic<u32>,
    listed: atomic<u32>,
    // patches of each leaf that are listed
    marks: array<atomic<u32>>,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var positions: texture_2d<f32>;
// where the sums have each slot, and its point in w
@group(0) @binding(2) var committed: texture_2d<f32>;
@group(0) @binding(3) var<storage, read> run_start: array<u32>;
// leaf, members: the patches that points of a run of 8 slots are in
@group(0) @binding(4) var run_blocks: texture_2d<u32>;
// where the sums are to have each slot: the same as `committed` for slots that do not move
@group(0) @binding(5) var now: texture_storage_2d<rgba32float, write>;
// where the sums had each slot that moves
@group(0) @binding(6) var before: texture_storage_2d<rgba32float, write>;
// a bit a slot, by leaf
@group(0) @binding(7) var moved: texture_storage_2d<r32uint, write>;
// zeros at the start of the frame
@group(0) @binding(8) var<storage, read_write> frame: Frame;
@group(0) @binding(9) var<storage, read_write> listed: array<u32>;
// workgroups of the next kernel; x is zero at the start of the frame
@group(0) @binding(10) var<storage, read_write> workgroups: array<atomic<u32>, 3>;

// Marks and lists the patches that points of this run of 8 slots are in.
fn list_patches(run: u32) {
    let end = run_start[run + 1u];
    for (var k = run_start[run]; k < end; k += 1u) {
        let block = textureLoad(run_blocks, entry(k), 0);
        let known = atomicOr(&frame.marks[block.x], block.y);
        var fresh = block.y & ~known;
        if fresh != 0u {
            let count = countOneBits(fresh);
            var place = atomicAdd(&frame.listed, count);
            let needed = (place + count + UPDATE_WORKGROUP_SIZE - 1u) / UPDATE_WORKGROUP_SIZE;
            atomicMax(&workgroups[0], needed);
            for (; fresh != 0u; fresh &= fresh - 1u) {
                listed[place] = 32u * block.x + firstTrailingBit(fresh);
                place += 1u;
            }
        }
    }
}

@compute @workgroup_size(8)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let leaf = id.x;
    let first = 32u * leaf;
    if first >= params.slot_count {
        return;
    }
    let count = min(32u, params.slot_count - first);
    var bits = 0u;
    for (var i = 0u; i < count; i += 1u) {
        let old = textureLoad(committed, entry(first + i), 0);
        let place = textureLoad(positions, entry(u32(old.w)), 0).xyz;
        let d = place - old.xyz;
        if dot(d, d) > params.tolerance_squared_m2 {
            bits |= 1u << i;
            textureStore(before, entry(first + i), old);
            textureStore(now, entry(first + i), vec4f(place, old.w));
        }
    }
    textureStore(moved, entry(leaf), vec4u(bits));
    if bits == 0u {
        return;
    }
    atomicAdd(&frame.moved, countOneBits(bits));
    for (var run = 4u * leaf; bits != 0u; run += 1u) {
        if (bits & 255u) != 0u {
            list_patches(run);
        }
        bits >>= 8u;
    }
}
