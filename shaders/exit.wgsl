// Where view rays leave the deformed surface again: depth of its nearest back faces. Follows frame.wgsl.
//
//   clip = clip_from_world x
//
// Source:  Green 2004, 16.3, from the eye in place of the light.
// Twin:    src/passes/view.rs, fn clip_from_world
// Parity:  tests/depth_parity.rs, fn view_rays_end_at_the_far_side_of_a_ball
// Threads: one a point.
// Units:   metres in, clip space out.
// Fails:   what lies behind the first exit.

@vertex
fn exit_vertex(@location(0) position: vec3f) -> @builtin(position) vec4f {
    return frame.clip_from_world * vec4f(position, 1.0);
}
