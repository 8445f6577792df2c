// Brings the listed patches' moments up to date with what moved, and fits their planes.
//
//   S <- S - round(q f(d_old)) + round(q f(d_new))     f(d): d, and the six products of d
//
// d is measured from an origin near the patch, in units of about its size. Sums are whole numbers
// of quanta 1/q, so what is taken out is exactly what was put in: nothing drifts. A patch of which a
// sixth moved, or that has a member beyond 4 units, is summed anew about its point.
//
// Source:  François et al., "Subsurface Texture Mapping" (2006), section 4, for the plane; Knuth,
//          "The Art of Computer Programming" vol. 2, 4.2.2, on what sums of floats lose.
// Twin:    src/geom/moments.rs, fn update
// Parity:  tests/gpu_parity.rs, fn incremental_planes_match_the_cpu_twin
// Threads: one per listed patch; each gathers over the blocks of its patch, so a fixed order.
// Units:   metres; the result is a unit normal and an offset in metres.
// Fails:   as plane_fit.wgsl; and a plane lags by what its members moved within the tolerance.

const RANGE: f32 = 4.0;
const DOUBLINGS_MAX: u32 = 32u;
const ROUNDING: f32 = 12582912.0;

struct Params {
    quanta: f32,
    rest_per_m: f32,
    pad0: u32,
    pad1: u32,
}

struct Frame {
    moved: atomic<u32>,
    refitted: atomic<u32>,
    listed: atomic<u32>,
}

struct Sums {
    origin: vec3f,
    per_m: f32,
    sum: vec3i,
    pad0: u32,
    // xx, yy, zz
    squares: vec3i,
    pad1: u32,
    // xy, xz, yz
    products: vec3i,
    pad2: u32,
}

@group(0) @binding(0) var<uniform> params: Params;
// where the sums have each moved slot and where they are to have every slot, with its point in w
@group(0) @binding(1) var before: texture_2d<f32>;
@group(0) @binding(2) var now: texture_2d<f32>;
// which slots of each leaf moved
@group(0) @binding(3) var moved: texture_2d<u32>;
// first block and end of each slot's patch
@group(0) @binding(4) var ranges: texture_2d<u32>;
// leaf, members: bit i stands for slot 32 leaf + i
@group(0) @binding(5) var blocks: texture_2d<u32>;
@group(0) @binding(6) var<storage, read> listed: array<u32>;
@group(0) @binding(7) var<storage, read> normals: array<vec4f>;
@group(0) @binding(8) var<storage, read_write> sums: array<Sums>;
@group(0) @binding(9) var<storage, read_write> frame: Frame;
@group(0) @binding(10) var<storage, read_write> planes: array<vec4f>;
// what the next frame's points are held against
@group(0) @binding(11) var committed: texture_storage_2d<rgba32float, write>;

fn rounded(d: vec3f) -> vec3i {
    return vec3i(round(d * params.quanta));
}

// rounded(to) - rounded(old): added to 1.5 2^23, a float shows its whole number in its last bits.
// Within RANGE neither passes 2^22, and multiplying by a power of two is exact, fused or not.
fn change(to: vec3f, old: vec3f) -> vec3i {
    let to_bits = bitcast<vec3i>(to * params.quanta + ROUNDING);
    return to_bits - bitcast<vec3i>(old * params.quanta + ROUNDING);
}

fn longest_side(d: vec3f) -> f32 {
    return max(max(abs(d.x), abs(d.y)), abs(d.z));
}

@compute @workgroup_size(64)
fn main(@builtin(global_invocation_id) id: vec3u) {
    if id.x >= atomicLoad(&frame.listed) {
        return;
    }
    let slot = listed[id.x];
    let range = textureLoad(ranges, entry(slot), 0);
    var member_count = 0u;
    var moved_count = 0u;
    for (var k = range.x; k < range.y; k += 1u) {
        let block = textureLoad(blocks, entry(k), 0);
        member_count += countOneBits(block.y);
        moved_count += countOneBits(block.y & textureLoad(moved, entry(block.x), 0).x);
    }
    if moved_count == 0u {
        return;
    }
    atomicAdd(&frame.refitted, 1u);

    let here = textureLoad(now, entry(slot), 0);
    // A point is in its own patch, so each moved one comes by here.
    if (textureLoad(moved, entry(slot / 32u), 0).x & (1u << (slot % 32u))) != 0u {
        textureStore(committed, entry(slot), here);
    }
    var origin = here.xyz;
    var per_m = params.rest_per_m;
    var sum = vec3i(0);
    var squares = vec3i(0);
    var products = vec3i(0);
    var usable = 6u * moved_count < member_count;
    if usable {
        origin = sums[slot].origin;
        per_m = sums[slot].per_m;
        sum = sums[slot].sum;
        squares = sums[slot].squares;
        products = sums[slot].products;
        for (var k = range.x; k < range.y; k += 1u) {
            let block = textureLoad(blocks, entry(k), 0);
            var bits = block.y & textureLoad(moved, entry(block.x), 0).x;
            for (; bits != 0u; bits &= bits - 1u) {
                let member = entry(32u * block.x + firstTrailingBit(bits));
                let old_d = (textureLoad(before, member, 0).xyz - origin) * per_m;
                let new_d = (textureLoad(now, member, 0).xyz - origin) * per_m;
                usable = usable && longest_side(new_d) <= RANGE;
                sum += change(new_d, old_d);
                squares += change(new_d * new_d, old_d * old_d);
                products += change(new_d.xxy * new_d.yzz, old_d.xxy * old_d.yzz);
            }
        }
    }
    if !usable {
        origin = here.xyz;
        var sum_m = vec3f(0.0);
        var squares_m2 = vec3f(0.0);
        var products_m2 = vec3f(0.0);
        for (var k = range.x; k < range.y; k += 1u) {
            let block = textureLoad(blocks, entry(k), 0);
            for (var bits = block.y; bits != 0u; bits &= bits - 1u) {
                let member = entry(32u * block.x + firstTrailingBit(bits));
                let d = textureLoad(now, member, 0).xyz - origin;
                sum_m += d;
                squares_m2 += d * d;
                products_m2 += d.xxy * d.yzz;
            }
        }
        // No member is farther than the root of the sum of squares.
        let reach = sqrt(longest_side(squares_m2));
        per_m = params.rest_per_m;
        for (var i = 0u; i < DOUBLINGS_MAX && reach * per_m > RANGE; i += 1u) {
            per_m *= 0.5;
        }
        sum = rounded(sum_m * per_m);
        squares = rounded(squares_m2 * per_m * per_m);
        products = rounded(products_m2 * per_m * per_m);
        sums[slot].origin = origin;
        sums[slot].per_m = per_m;
    }
    sums[slot].sum = sum;
    sums[slot].squares = squares;
    sums[slot].products = products;

    let point = u32(here.w);
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
    planes[point] = plane_of_moments(origin - here.xyz + mean / per_m, spread, normal);
}
