// What every drawing pass knows of a frame: camera, lights, layers and knobs. One uniform, at binding 0.
//
// Mirror: src/passes/view.rs, struct FrameUniform
// Units:  metres, 1/m, W/m2, W/sr.

struct Light {
    // Unit direction to a far light (w = 0) or place of a near one [m] (w = 1).
    place: vec4f,
    // Irradiance [W/m2] of a far light, intensity [W/sr] of a near one; w = 1 if it casts shadows.
    power: vec4f,
}

struct Frame {
    clip_from_world: mat4x4f,
    world_from_clip: mat4x4f,
    shadow_from_world: mat4x4f,
    eye: vec4f,
    lights: array<Light, 4>,
    // sigma_t of each layer [1/m], the last one repeated; w is Schlick's k.
    extinction: array<vec4f, 8>,
    // sigma_s / sigma_t of each layer.
    albedo: array<vec4f, 8>,
    // r0 of each layer: what it throws back of even light, were it endless.
    reflectance: array<vec4f, 8>,
    // Light scattered more than once: the share that stays where it fell, how far round the terminator the rest comes, and
    // its radiance per irradiance [1/sr].
    kept: vec4f,
    around: vec4f,
    leaked: vec4f,
    // Diffuse attenuation of light that comes through the body [1/m].
    through: vec4f,
    // Width and height of the picture [px], and their inverses.
    size: vec4f,
    // Colour of each inner layer, and its opacity.
    inner: array<vec4f, 4>,
    // Distance of each from the surface, in layer distances.
    inner_distances: vec4f,
    layer_depth_max_m: f32,
    reach_m: f32,
    color_blend: f32,
    multiple_scattering: f32,
    wrap: f32,
    layer_distance_m: f32,
    outer_opacity: f32,
    relief: f32,
    roughness: f32,
    wetness: f32,
    // Depth range of the shadow map [m], and how far behind it a point counts as lit [m].
    shadow_depth_m: f32,
    shadow_bias_m: f32,
    // Radius of the disc that an inner layer is blurred by, as a share of the way to it.
    inner_blur: f32,
    // Share of the light that an opaque layer keeps from those below.
    layer_shadow: f32,
    // Radius of the disc that light is blurred by [m].
    blur_radius_m: f32,
    // How far noise moves where the march reads the layers [m].
    noise_m: f32,
    // Look-ups of the noise, each at the place that the one before tells.
    noise_lookups: u32,
    // What radiance is multiplied by before the tone curve.
    exposure: f32,
    // Multiplies the light of the room on the tissue.
    room_light: f32,
    pad0: f32,
}

@group(0) @binding(0) var<uniform> frame: Frame;

// Lights of the scene; bit k of POINT_LIGHTS is 1 if light k is a near one.
override LIGHT_COUNT: u32 = 1u;
override POINT_LIGHTS: u32 = 0u;
// 1 if light 0 has a shadow map.
override HAS_SHADOW: u32 = 0u;

// Unit vector to light `k` and the irradiance [W/m2] it casts on a plane at `x` that faces it.
struct Lit {
    to_light: vec3f,
    irradiance: vec3f,
}

fn light_at(k: u32, x: vec3f) -> Lit {
    let light = frame.lights[k];
    if (POINT_LIGHTS & (1u << k)) == 0u {
        return Lit(light.place.xyz, light.power.rgb);
    }
    let to = light.place.xyz - x;
    let inverse2 = 1.0 / max(dot(to, to), 1e-8);
    return Lit(to * sqrt(inverse2), light.power.rgb * inverse2);
}
