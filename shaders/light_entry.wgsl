// The way of light from where it enters to a point below the surface. No bindings.
//
//   a = (E - M).w_in,  s = a + (E - M - a w_in).n / (n.w_in)
//                                     E the entry that a depth map holds near M's ray to the light, n its normal
//
// The texel's centre lies beside that ray by up to half a texel, so the ray is cut with the plane through E. Only what
// is beside the ray asks for n: where light grazes, an interpolated normal may face away from it.
//
// Source:  Green 2004, 16.3; the cut with the entry's plane is ours.
// Twin:    src/optics/light_entry.rs, fn way_from_entry
// Parity:  tests/shading_parity.rs, fn ways_from_entries_match_the_cpu_twin
// Threads: none of its own.
// Units:   metres.
// Fails:   entries that light grazes by less than three degrees are cut as if by three, beside the ray.

const MIN_ENTRY_COSINE: f32 = 0.05;

// Length of the way [m] and its cosine with the surface's normal where it enters. A point that lies before the entry
// and above the surface there by more than `slack_m` is outside the body: nothing scatters there, and it counts as
// unlit, with a cosine of 0. Where light grazes, a hair above the surface is far before the entry.
fn way_from_entry(entry: vec3f, normal: vec3f, at: vec3f, to_light: vec3f, slack_m: f32) -> vec2f {
    let cosine = max(dot(normal, to_light), MIN_ENTRY_COSINE);
    let way = entry - at;
    let along = dot(way, to_light);
    let s = along + dot(way - along * to_light, normal) / cosine;
    let below = max(s, dot(way, normal));
    return select(vec2f(0.0), vec2f(max(s, 0.0), cosine), below > -slack_m);
}
