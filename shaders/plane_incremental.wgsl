// Brings the marked patches' moments up to date with what moved, and fits their planes.
//
//   S <- S - round(q f(d_before)) + round(q f(d_now))     f(d): d, and the six products of d
//
// d is measured from an origin near the patch, in units of about its size. Sums are whole numbers
// of quanta 1/q, so what is taken out is exactly what was put in: nothing drifts. A patch of which
// half moved, or that has a member beyond 4 units, is summed anew about its point.
//
// Source:  François et al., "Subsurface Texture Mapping" (2006), section 4, for the plane; Knuth,
//          "The Art of Computer Programming" vol. 2, 4.2.2, on what sums of floats lose.
// Twin:    src/geom/moments.rs, fn update
// Parity:  tests/gpu_parity.rs, fn incremental_planes_match_the_cpu_twin
// Threads: one per slot; each gathers over the blocks of its patch, so a fixed order.
// Units:   metres; the result is a unit normal and an offset in metres.
// Fails:   as plane_fit.wgsl; and a plane lags by what its members moved within the tolerance.

const RANGE: f32 = 4.0;
const DOUBLINGS_MAX: u32 = 32u;

struct Params {
    slot_count: u32,
    quanta: f32,
    rest_per_m: f32,
    pad0: u32,
}

struct Slot {
    now: vec4f,
    before: vec4f,
}

struct Patch {
    origin: vec3f,
    per_m: f32,
    sum: vec3i,
    point: u32,
    squares: vec3i,
    first_block: u32,
    products: vec3i,
    end_block: u32,
}

struct Frame {
    moved: atomic<u32>,
    refitted: atomic<u32>,
    marked: array<atomic<u32>>,
}

@group(0) @binding(0) var<uniform> params: Params;
@group(0) @binding(1) var<storage, read> slots: array<Slot>;
@group(0) @binding(2) var<storage, read> moved: array<u32>;
// leaf, members: bit i stands for slot 32 leaf + i
@group(0) @binding(3) var<storage, read> blocks: array<vec2u>;
@group(0) @binding(4) var<storage, read> normals: array<vec4f>;
@group(0) @binding(5) var<storage, read_write> patches: array<Patch>;
@group(0) @binding(6) var<storage, read_write> frame: Frame;
@group(0) @binding(7) var<storage, read_write> planes: array<vec4f>;

fn rounded(d: vec3f) -> vec3i {
    return vec3i(round(d * params.quanta));
}

fn in_range(d: vec3f) -> bool {
    return max(max(abs(d.x), abs(d.y)), abs(d.z)) <= RANGE;
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    let slot = id.x;
    if slot >= params.slot_count {
        return;
    }
    if (atomicLoad(&frame.marked[slot / 32u]) & (1u << (slot % 32u))) == 0u {
        return;
    }
    let first_block = patches[slot].first_block;
    let end_block = patches[slot].end_block;
    var member_count = 0u;
    var moved_count = 0u;
    for (var k = first_block; k < end_block; k += 1u) {
        let block = blocks[k];
        member_count += countOneBits(block.y);
        moved_count += countOneBits(block.y & moved[block.x]);
    }
    if moved_count == 0u {
        return;
    }
    atomicAdd(&frame.refitted, 1u);

    var origin = patches[slot].origin;
    var per_m = patches[slot].per_m;
    var sum = patches[slot].sum;
    var squares = patches[slot].squares;
    var products = patches[slot].products;
    var usable = 2u * moved_count < member_count;
    if usable {
        for (var k = first_block; k < end_block; k += 1u) {
            let block = blocks[k];
            for (var bits = block.y & moved[block.x]; bits != 0u; bits &= bits - 1u) {
                let places = slots[32u * block.x + firstTrailingBit(bits)];
                let before = (places.before.xyz - origin) * per_m;
                let now = (places.now.xyz - origin) * per_m;
                usable = usable && in_range(now);
                sum += rounded(now) - rounded(before);
                squares += rounded(now * now) - rounded(before * before);
                products += rounded(now.xxy * now.yzz) - rounded(before.xxy * before.yzz);
            }
        }
    }
    let at = slots[slot].now.xyz;
    if !usable {
        origin = at;
        per_m = params.rest_per_m;
        for (var doubling = 0u; doubling < DOUBLINGS_MAX; doubling += 1u) {
            sum = vec3i(0);
            squares = vec3i(0);
            products = vec3i(0);
            var all_in_range = true;
            for (var k = first_block; k < end_block; k += 1u) {
                let block = blocks[k];
                for (var bits = block.y; bits != 0u; bits &= bits - 1u) {
                    let place = slots[32u * block.x + firstTrailingBit(bits)].now.xyz;
                    let d = (place - origin) * per_m;
                    all_in_range = all_in_range && in_range(d);
                    sum += rounded(d);
                    squares += rounded(d * d);
                    products += rounded(d.xxy * d.yzz);
                }
            }
            if all_in_range {
                break;
            }
            per_m *= 0.5;
        }
    }
    patches[slot].origin = origin;
    patches[slot].per_m = per_m;
    patches[slot].sum = sum;
    patches[slot].squares = squares;
    patches[slot].products = products;

    let point = patches[slot].point;
    let normal = normals[point].xyz;
    if member_count < 3u {
        planes[point] = vec4f(normal, 0.0);
        return;
    }
    let share = 1.0 / (f32(member_count) * params.quanta);
    let mean = vec3f(sum) * share;
    let spread = Spread(
        vec3f(squares) * share - mean * mean,
        vec3f(products) * share - mean.xxy * mean.yzz,
    );
    planes[point] = plane_of_moments(origin - at + mean / per_m, spread, normal);
}
