// The tone curve and the sRGB encoding. No bindings.
//
//   c = x (2.51 x + 0.03) / (x (2.43 x + 0.59) + 0.14),  x = 0.8 L
//   sRGB: 12.92 c below 0.0031308, else 1.055 c^(1/2.4) - 0.055, the power by 1, q, q^2, q^3 with q = c^(1/4)
//
// Two roots cost a software adapter less than a power; the fit is good to 2.2e-4, an eighteenth of a step of 8 bits.
//
// Source:  Narkowicz, "ACES Filmic Tone Mapping Curve", 2015; IEC 61966-2-1.
// Twin:    src/optics/tone.rs, fn displayed
// Parity:  tests/shading_parity.rs, fn tone_map_matches_the_cpu_twin
// Threads: none of its own.
// Units:   linear radiance in, display values 0 to 1 out.
// Fails:   nothing of its own.

fn filmic(radiance: vec3f) -> vec3f {
    let x = 0.8 * max(radiance, vec3f(0.0));
    return clamp(x * (2.51 * x + 0.03) / (x * (2.43 * x + 0.59) + 0.14), vec3f(0.0), vec3f(1.0));
}

fn encoded(c: vec3f) -> vec3f {
    let half = sqrt(c);
    let quarter = sqrt(half);
    let curve = half * (0.9525755 - 0.1368256 * quarter) + 0.2557965 * quarter - 0.0717612;
    return select(curve, 12.92 * c, c < vec3f(0.0031308));
}

fn displayed(radiance: vec3f) -> vec3f {
    return encoded(filmic(radiance));
}
