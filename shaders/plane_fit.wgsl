// The plane of a patch from its moments. Declares no bindings.
//
//   C = sum_j d_j d_j^T / N - m m^T,  m = sum_j d_j / N      d_j from a place near the patch
//   n = eigenvector of the smallest eigenvalue of C, turned to the side of the point's normal
//   h = n . (mean - P)                                       signed: below the point is negative
//
// Source:  François et al., "Subsurface Texture Mapping" (2006), section 4; the eigenvector by cyclic
//          Jacobi rotations, Golub and Van Loan, "Matrix Computations", 8.5.
// Twin:    src/geom/plane.rs, fn plane_of_moments
// Units:   any for C, since it is divided by its trace; mean and h in metres.
// Fails:   points at one place, on one line, or spread alike across it have no thinnest direction:
//          the tangent plane is returned.

const JACOBI_SWEEPS: u32 = 4u;
const MIN_EIGENVALUE_GAP: f32 = 1e-3;
const MIN_TRACE: f32 = 1e-30;

struct Spread {
    // xx, yy, zz
    squares: vec3f,
    // xy, xz, yz
    products: vec3f,
}

// A unit vector, or zero where there is no thinnest direction.
fn thinnest_direction(spread: Spread) -> vec3f {
    let trace = spread.squares.x + spread.squares.y + spread.squares.z;
    if !(trace > MIN_TRACE) {
        return vec3f(0.0);
    }
    // Diagonal (a, b, c) and off-diagonal (ab, ac, bc), with one axis each for a, b and c.
    var d = spread.squares / trace;
    var o = spread.products / trace;
    var va = vec3f(1.0, 0.0, 0.0);
    var vb = vec3f(0.0, 1.0, 0.0);
    var vc = vec3f(0.0, 0.0, 1.0);
    for (var turn = 0u; turn < 3u * JACOBI_SWEEPS; turn += 1u) {
        // Turn a and b until ab is 0, then rename (a, b, c) to (b, c, a).
        let difference = d.y - d.x;
        let size = abs(difference) + sqrt(difference * difference + 4.0 * o.x * o.x);
        let side = select(1.0, -1.0, difference < 0.0);
        var t = 0.0;
        if size > MIN_TRACE {
            t = 2.0 * side * o.x / size;
        }
        let cosine = 1.0 / sqrt(1.0 + t * t);
        let sine = t * cosine;
        d = vec3f(d.y + t * o.x, d.z, d.x - t * o.x);
        o = vec3f(sine * o.y + cosine * o.z, 0.0, cosine * o.y - sine * o.z);
        let a_axis = cosine * va - sine * vb;
        va = sine * va + cosine * vb;
        vb = vc;
        vc = a_axis;
    }
    var least = d.x;
    var direction = va;
    if d.y < least {
        least = d.y;
        direction = vb;
    }
    if d.z < least {
        least = d.z;
        direction = vc;
    }
    let largest = max(max(d.x, d.y), d.z);
    let middle = d.x + d.y + d.z - least - largest;
    if middle - least > MIN_EIGENVALUE_GAP * largest {
        return normalize(direction);
    }
    return vec3f(0.0);
}

// Normal and offset [m] of a patch whose mean lies at `mean_m` from its point.
fn plane_of_moments(mean_m: vec3f, spread: Spread, normal: vec3f) -> vec4f {
    var direction = thinnest_direction(spread);
    if all(direction == vec3f(0.0)) {
        return vec4f(normal, 0.0);
    }
    if dot(direction, normal) < 0.0 {
        direction = -direction;
    }
    return vec4f(direction, dot(direction, mean_m));
}
