// Constants and small functions that several kernels share. Declares no bindings.

// Share of the summed squared edges below which a fan of triangles spans no area.
const MIN_AREA_SHARE: f32 = 1e-5;
// Squared lengths below this are zero.
const MIN_LENGTH_SQUARED: f32 = 1e-30;
// sin^2 of the angle between the UV axes below which they have no dual basis.
const MIN_UV_SINE_SQUARED: f32 = 1e-4;

// A unit vector across the unit vector `n`: the axis least along `n`, made perpendicular.
fn any_perpendicular(n: vec3f) -> vec3f {
    let along = abs(n);
    var axis = vec3f(0.0, 0.0, 1.0);
    if along.x <= along.y && along.x <= along.z {
        axis = vec3f(1.0, 0.0, 0.0);
    } else if along.y <= along.z {
        axis = vec3f(0.0, 1.0, 0.0);
    }
    return normalize(axis - n * dot(n, axis));
}
