// The way of sight through layers, how one hides and shades those below. No bindings.
//
//   R = reflect(-V, n), T = R mirrored at the surface, s = d / |T . N|
//   radiance_k+1 = radiance_k + left_k a_k color_k,  left_k+1 = left_k (1 - a_k)
//   let through  = 1 - layer_shadow opacity
//
// Source:  Oat 2006, listing 1 and 4.7; Norberg 2010, eqs. 15-17.
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

// Share of the light that a layer of `opacity` lets through to those below.
fn let_through(opacity: f32, layer_shadow: f32) -> f32 {
    return 1.0 - layer_shadow * clamp(opacity, 0.0, 1.0);
}

// What is seen so far from above: how much of what lies below is not hidden, and what share of light reaches it.
struct Seen {
    radiance: vec3f,
    left: f32,
    lit: f32,
}

fn layered(before: Seen, color: vec3f, opacity: f32, layer_shadow: f32) -> Seen {
    return Seen(
        before.radiance + before.left * before.lit * opacity * color,
        before.left * (1.0 - opacity),
        before.lit * let_through(opacity, layer_shadow),
    );
}
