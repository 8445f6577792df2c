// The way of sight through the outer layer. No bindings.
//
//   R = reflect(-V, n), T = R mirrored at the surface, s = d / |T . N|
//
// Source:  Oat 2006, listing 1; Norberg 2010, eqs. 15-17.
// Twin:    src/optics/layers.rs, fn transmission
// Parity:  tests/shading_parity.rs, fn parallax_matches_the_cpu_twin
// Threads: none of its own.
// Units:   metres.
// Fails:   grazing views are cut at 4 layer distances.

// From the surface to the inner layer [m], and the length of that way [m] in w. All in world space.
fn transmission(to_eye: vec3f, relief: vec3f, normal: vec3f, distance: f32) -> vec4f {
    let mirrored = reflect(-to_eye, relief);
    let along = mirrored - 2.0 * dot(mirrored, normal) * normal;
    let down = abs(dot(along, normal));
    let way = distance / max(down, 0.25);
    return vec4f(way * along, way);
}
