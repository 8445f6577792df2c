// Wrapped light from its table: red, green, blue by N.L, a highlight in alpha by N.L and N.H. Reads
// `linear_sampler`, which the file before it declares.
//
//   column = (N.L + 1) / 2,  row = sqrt(1 - N.H)
//
// Rows are evenly spaced in the sine of half the angle between N and H: a sharp highlight has many of them, where
// an even spacing of N.H leaves it one.
//
// Source:  Green 2004, 16.2, listing 16-1 (the spacing of the rows is ours).
// Twin:    src/optics/wrap_lookup.rs, fn table
// Parity:  tests/green_parity.rs, fn wrapped_light_matches_the_cpu_twin
// Threads: none of its own.
// Units:   1; alpha 1/sr where it conserves energy.
// Fails:   highlights sharper than an exponent of 2000 fall between the rows.

@group(0) @binding(12) var lookup_map: texture_2d<f32>;

const LOOKUP_SIDE: f32 = 256.0;

fn wrapped_light(n_l: f32, n_h: f32) -> vec4f {
    let at = vec2f(0.5 * n_l + 0.5, sqrt(clamp(1.0 - n_h, 0.0, 1.0)));
    let uv = (at * (LOOKUP_SIDE - 1.0) + 0.5) / LOOKUP_SIDE;
    return textureSampleLevel(lookup_map, linear_sampler, uv, 0.0);
}
