// Knobs of the surfaces after Green (2004), bound after what shaders/pixel.wgsl binds.
//
// Mirror: src/passes/green.rs, struct GreenUniform
// Units:  metres, 1/m, pixels.

struct Green {
    clip_from_world: array<mat4x4f, 4>,
    // For a far light: depth range of its map [m], texels a metre across and down. For a near one: near and far end [m],
    // texels a metre at a distance of 1 m. Last, the length of two texels in the middle of the map [m].
    spans: array<vec4f, 4>,
    // Looks on the unit disc, two a vector.
    disc: array<vec4f, 16>,
    // Attenuation of light that comes through [1/m].
    attenuation: vec4f,
    // Share of the light that does not wander farther than the light map can tell, per colour.
    core: vec4f,
    disc_radius_m: f32,
    glow: f32,
    ramp_per_m: f32,
    // Power of the colour map that lies in the light map.
    color_in_map: f32,
    // Strength of light that comes through the body into the light map.
    translucency: f32,
    pad0: f32,
    pad1: f32,
    pad2: f32,
}

@group(0) @binding(11) var<uniform> green: Green;
