// Least-squares plane of every patch, from all its members, about its point.
//
// Source:  François et al., "Subsurface Texture Mapping" (2006), section 4.
// Twin:    src/geom/plane.rs, fn fit_plane
// Parity:  tests/gpu_parity.rs, fn full_planes_match_the_cpu_twin
// Threads: one per slot; each gathers over the blocks of its patch, so a fixed order.
// Units:   metres; the result is a unit normal and an offset in metres.
// Fails:   fewer than three members, or members without a thinnest direction: the tangent plane.

struct Params {
    slot_count: u32,
    pad0: u32,
    pad1: u32,
    pad2: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> slots: array<vec4f>;
@group(0) @binding(2) var<storage, read> order: array<u32>;
@group(0) @binding(3) var<storage, read> block_start: array<u32>;
// leaf, members: bit i stands for slot 32 leaf + i
@group(0) @binding(4) var<storage, read> blocks: array<vec2u>;
@group(0) @binding(5) var<storage, read> normals: array<vec4f>;
@group(0) @binding(6) var<storage, read_write> planes: array<vec4f>;

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let slot = id.x;
    if slot >= params.slot_count {
        return;
    }
    let at = slots[slot].xyz;
    var count = 0u;
    var sum = vec3f(0.0);
    var squares = vec3f(0.0);
    var products = vec3f(0.0);
    let end = block_start[slot + 1u];
    for (var k = block_start[slot]; k < end; k += 1u) {
        let block = blocks[k];
        count += countOneBits(block.y);
        for (var members = block.y; members != 0u; members &= members - 1u) {
            let d = slots[32u * block.x + firstTrailingBit(members)].xyz - at;
            sum += d;
            squares += d * d;
            products += d.xxy * d.yzz;
        }
    }
    let point = order[slot];
    let normal = normals[point].xyz;
    if count < 3u {
        planes[point] = vec4f(normal, 0.0);
        return;
    }
    let share = 1.0 / f32(count);
    let mean = sum * share;
    let spread = Spread(
        squares * share - mean * mean,
        products * share - mean.xxy * mean.yzz,
    );
    planes[point] = plane_of_moments(mean, spread, normal);
}
