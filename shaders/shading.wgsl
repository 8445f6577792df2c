// What all surfaces share: the frame's camera, lights and knobs, the wet film, and what it mirrors.
//
//   F(c) = F0 + (1 - F0) (1 - c)^5                        Fresnel, tissue under a film of water
//   D    = a^2 / (pi ((n.h)^2 (a^2 - 1) + 1)^2)           GGX
//   V    = 1 / (4 max(l.h, 0.1)^2 ...)                    one division for shadowing and cosines
//
// Source:  Schlick 1994 (F); Walter et al., "Microfacet Models for Refraction", EGSR 2007 (D);
//          Kelemen and Szirmay-Kalos, "A Microfacet Based Coupled Specular-Matte BRDF", EG 2001 (V).
// Twin:    src/optics/film.rs, fn film
// Parity:  tests/shading_parity.rs, fn film_matches_the_cpu_twin
// Threads: none of its own.
// Units:   metres, radiance W/(m2 sr).
// Fails:   roughness below 0.02.

struct Light {
    // Unit direction to a far light (w = 0) or place of a near one [m] (w = 1).
    place: vec4f,
    // Irradiance [W/m2] or, of a near light, intensity [W/sr]. The first light is the one with shadows.
    power: vec4f,
}

struct Frame {
    clip_from_world: mat4x4f,
    shadow_from_world: mat4x4f,
    eye: vec4f,
    lights: array<Light, 4>,
    // absorption + scattering and scattering of each layer [1/m]; w of the second is Schlick's k.
    extinction: array<vec4f, 4>,
    scattering: array<vec4f, 4>,
    light_count: u32,
    layer_depth_max_m: f32,
    color_blend: f32,
    multiple_scattering: f32,
    wrap: f32,
    layer_distance_m: f32,
    blur_radius_m: f32,
    outer_opacity: f32,
    relief: f32,
    roughness: f32,
    wetness: f32,
    exposure: f32,
    // Side of a texel of the light map in texture space, and of a shadow map texel in metres.
    light_map_texel: f32,
    shadow_texel_m: f32,
    uv_per_m: f32,
    // Level of the maps whose texels are as large as a pixel.
    map_level: f32,
}

const PI: f32 = 3.14159265;
// Water on tissue: n = 1.38.
const FILM_F0: f32 = 0.0255;

fn fresnel(cosine: f32) -> f32 {
    let x = 1.0 - clamp(cosine, 0.0, 1.0);
    let x2 = x * x;
    return FILM_F0 + (1.0 - FILM_F0) * x2 * x2 * x;
}

// Reflected radiance per irradiance of the facing plane, cosine included [1/sr].
fn film(normal: vec3f, to_light: vec3f, to_eye: vec3f, roughness: f32) -> f32 {
    let half_way = normalize(to_light + to_eye);
    let n_h = max(dot(normal, half_way), 0.0);
    let l_h = max(dot(to_light, half_way), 0.1);
    let a2 = roughness * roughness * roughness * roughness;
    let base = n_h * n_h * (a2 - 1.0) + 1.0;
    let distribution = a2 / max(PI * base * base, 1e-7);
    let n_l = max(dot(normal, to_light), 0.0);
    return n_l * distribution * fresnel(l_h) / (4.0 * l_h * l_h);
}

// What a wet surface mirrors in a dim operating theatre: a ring lamp above, a window's glow aside,
// drapes below. Smooth, so that it needs no filtering.
fn theatre(direction: vec3f, roughness: f32) -> vec3f {
    let soft = 0.02 + 0.35 * roughness;
    let lamp = smoothstep(0.93 - soft, 0.97, dot(direction, vec3f(-0.28, 0.90, 0.334)));
    let side = smoothstep(0.80 - soft, 0.98, dot(direction, vec3f(0.93, 0.25, 0.27)));
    let sky = smoothstep(-0.35, 0.9, direction.y);
    return mix(vec3f(0.015, 0.03, 0.035), vec3f(0.20, 0.24, 0.27), sky)
        + lamp * vec3f(3.2, 3.1, 2.9) + side * vec3f(0.45, 0.6, 0.75);
}

// Unit vector to a light and the irradiance [W/m2] it casts on a plane at `x` that faces it.
struct Lit {
    to_light: vec3f,
    irradiance: vec3f,
}

fn light_at(light: Light, x: vec3f) -> Lit {
    if light.place.w == 0.0 {
        return Lit(light.place.xyz, light.power.rgb);
    }
    let to = light.place.xyz - x;
    let distance2 = max(dot(to, to), 1e-8);
    return Lit(to * inverseSqrt(distance2), light.power.rgb / distance2);
}

// Diffuse light wrapped round the terminator; its integral over the sphere is that of n.l.
// Source: Green 2004, 16.2, with the normalization of energy added.
fn wrapped(cosine: f32, wrap: f32) -> f32 {
    let w = 1.0 + wrap;
    return max(cosine + wrap, 0.0) / (w * w);
}
