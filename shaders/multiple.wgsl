// Light that scattered more than once, in closed form from the medium. No bindings.
//
//   H(c)  = 1 / (1 - w' c (r0 + (1/2 - r0 c) ln((1 + c) / c))),   w' = 4 r0 / (1 + r0)^2
//   often = w' / 4 pi (H(soft) H(n.v) - 1),   soft = (n.l + around) / (1 + around)
//
// It stands beside albedo times phase function, so the march gathers it layer by layer with light scattered once.
//
// Source:  Hapke, "Bidirectional Reflectance Spectroscopy", J. Geophys. Res. 86, 1981, and Icarus 157, 2002, eq. 13;
//          w' and the softened cosine are ours, see docs/METHODS.md.
// Twin:    src/optics/multiple.rs, fn often
// Parity:  tests/shading_parity.rs, fn multiple_scattering_matches_the_cpu_twin
// Threads: none of its own.
// Units:   1/sr.
// Fails:   r0 of 1 at a cosine of 0; light that grazes, by a third.

const INV_PI: f32 = 0.31830989;

fn albedo_of(r0: vec3f) -> vec3f {
    return 4.0 * r0 / ((1.0 + r0) * (1.0 + r0));
}

fn h_function(cosine: vec3f, r0: vec3f) -> vec3f {
    let c = max(cosine, vec3f(1e-4));
    return 1.0 / (1.0 - albedo_of(r0) * c * (r0 + (0.5 - r0 * c) * log((1.0 + c) / c)));
}

fn often(cos_light: f32, cos_eye: f32, r0: vec3f, around: vec3f) -> vec3f {
    let soft = (cos_light + around) / (1.0 + around);
    let both = h_function(soft, r0) * h_function(vec3f(cos_eye), r0);
    return 0.25 * INV_PI * albedo_of(r0) * (both - 1.0);
}
