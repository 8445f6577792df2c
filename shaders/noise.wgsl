// What moves the places where the march reads the layers, so that nearby pixels do not all sample at one depth. Reads
// `frame`, which a file before it declares.
//
//   clouds:   n_0 = texel of uv,  n_i+1 = texel that n_i names,  offset = 2 n - 1                  Norberg eq. 21
//   gradient: f(p) = fract(52.9829189 fract(0.06711056 p_x + 0.00583715 p_y)), the second f(p + (47, 17))
//
// Look-ups go by whole texels, so that they end at the same one on every adapter. The clouds are evened out, each value as
// often as each other: plain difference clouds are dark, and would move all layers one way.
//
// Source:  Norberg 2010, 3.1.2 and eq. 21; J. Jimenez, "Next Generation Post Processing in Call of Duty", SIGGRAPH 2014.
// Twin:    src/optics/noise.rs, fn chained
// Parity:  tests/oat.rs, fn noise_matches_the_cpu_twin
// Threads: none of its own.
// Units:   shares of the amount, -1 to 1.
// Fails:   the clouds repeat sixteen times over the texture map.

@group(0) @binding(15) var noise_map: texture_2d<f32>;

// 0 none, 1 clouds, 2 gradient.
override NOISE: u32 = 0u;

// Repeats of the clouds over the texture map.
const NOISE_TILES: f32 = 16.0;

fn chained(uv: vec2f, lookups: u32) -> vec2f {
    let size = vec2f(textureDimensions(noise_map));
    var at = min(fract(uv * NOISE_TILES) * size, size - 1.0);
    var bytes = vec2f(0.0);
    for (var i = 0u; i < lookups; i += 1u) {
        bytes = round(255.0 * textureLoad(noise_map, vec2i(at), 0).rg);
        at = bytes * size / 256.0;
    }
    return (2.0 * bytes + 1.0) / 256.0 - 1.0;
}

fn gradient(at: vec2f) -> vec2f {
    let x = 0.06711056 * at.x + 0.00583715 * at.y;
    let y = 0.06711056 * (at.x + 47.0) + 0.00583715 * (at.y + 17.0);
    return 2.0 * fract(52.9829189 * fract(vec2f(x, y))) - 1.0;
}

// Where the march of the pixel `at` is moved to, -1 to 1 along tangent and bitangent.
fn noise_at(uv: vec2f, at: vec2f) -> vec2f {
    if NOISE == 1u {
        return chained(uv, frame.noise_lookups);
    }
    if NOISE == 2u {
        return gradient(at);
    }
    return vec2f(0.0);
}
