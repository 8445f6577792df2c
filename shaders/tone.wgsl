// The tone curve and the sRGB encoding. No bindings.
//
//   c = x (2.51 x + 0.03) / (x (2.43 x + 0.59) + 0.14)
//
// Source:  Narkowicz 2015; IEC 61966-2-1.
// Twin:    src/optics/tone.rs, fn displayed
// Parity:  tests/shading_parity.rs, fn tone_map_matches_the_cpu_twin
// Threads: none of its own.
// Units:   linear radiance in, display values 0 to 1 out.
// Fails:   nothing of its own.

fn filmic(x: vec3f) -> vec3f {
    let scaled = 0.8 * max(x, vec3f(0.0));
    let c = scaled * (2.51 * scaled + 0.03) / (scaled * (2.43 * scaled + 0.59) + 0.14);
    return clamp(c, vec3f(0.0), vec3f(1.0));
}

fn encode(c: vec3f) -> vec3f {
    return select(1.055 * pow(max(c, vec3f(1e-6)), vec3f(1.0 / 2.4)) - 0.055, 12.92 * c, c < vec3f(0.0031308));
}
