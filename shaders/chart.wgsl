// A light map whose texels know their chart: its number in alpha, 0 where no chart is. Reads `source_map`, which the
// file after it declares.
//
// Source:  ours; gutters as Oat 2006, 4.5, leaves them to the texture map.
// Twin:    src/optics/diffusion.rs, fn covered_near
// Parity:  tests/green_parity.rs, fn diffusion_matches_the_cpu_twin
// Threads: none of its own.
// Units:   texels.
// Fails:   charts nearer than two texels a pass share their gutter.

fn texel(at: vec2i) -> vec4f {
    let size = vec2i(textureDimensions(source_map));
    if any(at < vec2i(0)) || any(at >= size) {
        return vec4f(0.0);
    }
    return textureLoad(source_map, at, 0);
}

// A texel of the gutter stands for its neighbour.
fn covered_near(at: vec2i) -> vec2i {
    if texel(at).a != 0.0 {
        return at;
    }
    for (var i = 0; i < 8; i += 1) {
        // Sides first, then corners.
        let turn = i & 3;
        let along = select(1, -1, (turn & 1) != 0);
        var beside = select(vec2i(along, 0), vec2i(0, along), turn >= 2);
        if i >= 4 {
            beside = vec2i(along, select(1, -1, turn >= 2));
        }
        if texel(at + beside).a != 0.0 {
            return at + beside;
        }
    }
    return at;
}
