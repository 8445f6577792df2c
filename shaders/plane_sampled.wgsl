// Least-squares plane of sixteen weighted samples of a patch, about its point.
//
//   m = sum_k w_k d_k / W,  C = sum_k w_k d_k d_k^T / W - m m^T,  W = sum_k w_k     then as plane_fit.wgsl
//
// Where |N.m| < skip and the plane leans by less than skip over the patch's radius, the tangent plane is taken and
// no direction looked for: on a sphere of radius R the mean lies r^2/4R deep.
//
// The weights are chosen at rest so that the samples have the moments of all members (src/geom/sample.rs).
//
// Source:  François et al., "Subsurface Texture Mapping" (2006), section 4, for the plane; the samples are those
//          of Gonzalez, "Clustering to Minimize the Maximum Intercluster Distance" (1985), farthest first.
// Twin:    src/geom/plane.rs, fn fit_sampled_plane
// Parity:  tests/light_parity.rs, fn sampled_planes_match_the_cpu_twin
// Threads: one per slot of a listed leaf; each gathers its samples in their order.
// Units:   metres; the result is a unit normal and an offset in metres.
// Fails:   as plane_fit.wgsl; and what bends between the samples goes unseen.

@group(0) @binding(8) var<storage, read_write> planes: array<vec4f>;

struct Sums {
    weight: f32,
    sum: vec3f,
    squares: vec3f,
    products: vec3f,
}

fn add(sums: ptr<function, Sums>, d: vec3f, weight: f32) {
    let weighted = weight * d;
    (*sums).weight += weight;
    (*sums).sum += weighted;
    (*sums).squares += weighted * d;
    (*sums).products += weighted.xxy * d.yzz;
}

// The lean of the plane is |C N - (N.C N) N| over the spread along the surface, r^2/4 of a disc; trace C is r^2/2.
fn is_flat(mean: vec3f, spread: Spread, normal: vec3f) -> bool {
    let turned = spread.squares * normal + vec3f(
        spread.products.x * normal.y + spread.products.y * normal.z,
        spread.products.x * normal.x + spread.products.z * normal.z,
        spread.products.y * normal.x + spread.products.z * normal.y,
    );
    let along = turned - normal * dot(normal, turned);
    let trace = spread.squares.x + spread.squares.y + spread.squares.z;
    return abs(dot(normal, mean)) < params.skip_m
        && 8.0 * dot(along, along) < params.skip_m * params.skip_m * trace;
}

@compute @workgroup_size(32)
fn main(@builtin(workgroup_id) group: vec3u, @builtin(local_invocation_id) local: vec3u) {
    let leaf = listed[group.x];
    let slot = 32u * leaf + local.x;
    if slot >= params.slot_count {
        return;
    }
    let point = order[slot];
    let at = textureLoad(positions, entry(point), 0).xyz;
    commit(leaf, slot, point, at);
    var sums: Sums;
    add_samples(&sums, slot, at);
    let share = 1.0 / sums.weight;
    let mean = share * sums.sum;
    let spread = Spread(
        share * sums.squares - mean * mean,
        share * sums.products - mean.xxy * mean.yzz,
    );
    let normal = normals[point].xyz;
    if is_flat(mean, spread, normal) {
        planes[point] = vec4f(normal, 0.0);
    } else {
        planes[point] = plane_of_moments(mean, spread, normal);
    }
}
