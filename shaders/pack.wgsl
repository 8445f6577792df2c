// A direction in 32 bits: the octahedron unfolded on a square of 16 bits a side. No bindings.
//
//   p = d.xy / (|dx| + |dy| + |dz|), folded over its diagonals where dz < 0
//
// Source:  Cigolla et al., "A Survey of Efficient Representations for Independent Unit Vectors", JCGT 2014.
// Twin:    src/optics/pack.rs, fn octahedral
// Parity:  tests/shading_parity.rs, fn packed_directions_match_the_cpu_twin
// Threads: none of its own.
// Units:   unit vectors; the input may have any length above 0.
// Fails:   a zero vector comes out as +z.

fn octahedral(direction: vec3f) -> u32 {
    let sum = abs(direction.x) + abs(direction.y) + abs(direction.z);
    var p = direction.xy / max(sum, 1e-20);
    if direction.z < 0.0 {
        p = (1.0 - abs(p.yx)) * select(vec2f(-1.0), vec2f(1.0), p >= vec2f(0.0));
    }
    return pack2x16snorm(p);
}

fn from_octahedral(bits: u32) -> vec3f {
    let p = unpack2x16snorm(bits);
    let z = 1.0 - abs(p.x) - abs(p.y);
    let fold = max(-z, 0.0);
    let xy = p + select(vec2f(fold), vec2f(-fold), p >= vec2f(0.0));
    return normalize(vec3f(xy, z));
}
