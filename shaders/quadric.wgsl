// Least-squares paraboloid of sixteen weighted samples of a patch, through its point and its tangent plane.
//
//   z = 1/2 (a u^2 + 2 b u v + c v^2),   min sum_k w_k (z(u_k, v_k) - z_k)^2 + ridge
//   Q = a uu^T + b (uv^T + vu^T) + c vv^T        kept in world axes: no frame that vertices would have to share
//
// Samples that lie steeper than 45 degrees over or under the tangent plane are passed over: on a sphere the chord to a
// place rises by half of what its normal is turned, so those are the ones whose normal is turned away.
//
// Source:  do Carmo, "Differential Geometry of Curves and Surfaces" (1976), 3.3 (the osculating paraboloid);
//          Golub and Van Loan, "Matrix Computations", 4.1 (LDL^T).
// Twin:    src/geom/quadric.rs, fn fit_quadric
// Parity:  tests/light_parity.rs, fn quadrics_match_the_cpu_twin
// Threads: one per slot of a listed leaf; each gathers its samples in their order.
// Units:   metres; Q in 1/m.
// Fails:   fewer than three points, or points at one place: zero, the tangent plane. Along one line only the
//          bend along it is told.

const RIDGE: f32 = 1e-4;
// Of the matrix's squared size, a^2 + 2 b^2 + c^2.
const SIZE_OF: vec3f = vec3f(1.0, 2.0, 1.0);
const MIN_REACH: f32 = 1e-12;
const MAX_REACH: f32 = 1e30;
const POINTS_MIN: u32 = 3u;

// xx, yy, zz, 0 and xy, xz, yz, 0 of each point
@group(0) @binding(8) var<storage, read_write> quadrics: array<array<vec4f, 2>>;

struct Sums {
    // tangent, bitangent, normal
    u_axis: vec3f,
    v_axis: vec3f,
    normal: vec3f,
    count: u32,
    diagonal: vec3f,
    beside: vec3f,
    right: vec3f,
}

fn add(sums: ptr<function, Sums>, d_m: vec3f, weight: f32) {
    let d = params.per_m * d_m;
    let u = dot(d, (*sums).u_axis);
    let v = dot(d, (*sums).v_axis);
    let z = dot(d, (*sums).normal);
    let counts = weight > 0.0 && z * z <= u * u + v * v;
    let basis = vec3f(0.5 * u * u, u * v, 0.5 * v * v);
    let weighted = select(0.0, weight, counts) * basis;
    (*sums).count += select(0u, 1u, counts);
    (*sums).diagonal += weighted * basis;
    (*sums).beside += weighted.xxy * basis.yzz;
    (*sums).right += z * weighted;
}

// Solves a positive definite system by LDL^T; `beside` holds the entries 01, 02, 12.
fn solve(diagonal: vec3f, beside: vec3f, right: vec3f) -> vec3f {
    let l10 = beside.x / diagonal.x;
    let l20 = beside.y / diagonal.x;
    let d1 = diagonal.y - l10 * beside.x;
    let e = beside.z - l20 * beside.x;
    let l21 = e / d1;
    let d2 = diagonal.z - l20 * beside.y - l21 * e;
    let y1 = right.y - l10 * right.x;
    let y2 = right.z - l20 * right.x - l21 * y1;
    let z = y2 / d2;
    let y = y1 / d1 - l21 * z;
    return vec3f(right.x / diagonal.x - l10 * y - l20 * z, y, z);
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
    let normal = normals[point].xyz;
    let u_axis = any_perpendicular(normal);
    let v_axis = cross(normal, u_axis);
    var sums = Sums(u_axis, v_axis, normal, 0u, vec3f(0.0), vec3f(0.0), vec3f(0.0));
    add_samples(&sums, slot, at);
    let diagonal = sums.diagonal;
    // sum_k w_k (u_k^2 + v_k^2)^2 / 4, whichever way the axes are turned
    let reach = diagonal.x + 0.5 * diagonal.y + diagonal.z;
    if sums.count < POINTS_MIN || !(reach > MIN_REACH && reach < MAX_REACH) {
        quadrics[point][0] = vec4f(0.0);
        quadrics[point][1] = vec4f(0.0);
        return;
    }
    let bends = params.per_m * solve(diagonal + RIDGE * reach * SIZE_OF, sums.beside, sums.right);
    let uu = bends.x * u_axis;
    let uv = bends.y * u_axis;
    let vv = bends.z * v_axis;
    let squares = uu * u_axis + 2.0 * uv * v_axis + vv * v_axis;
    let mixed = uv.xxy * v_axis.yzz + uv.yzz * v_axis.xxy;
    let products = uu.xxy * u_axis.yzz + mixed + vv.xxy * v_axis.yzz;
    quadrics[point][0] = vec4f(squares, 0.0);
    quadrics[point][1] = vec4f(products, 0.0);
}
