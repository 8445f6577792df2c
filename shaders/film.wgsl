// The wet film on tissue, what it mirrors, and diffuse light. No bindings.
//
//   F(c) = F0 + (1 - F0) (1 - c)^5                          Fresnel, n = 1.38
//   D    = a^2 / (pi ((n.h)^2 (a^2 - 1) + 1)^2),  a = roughness^2
//   V    = 1 / (4 (l.h)^2)                                  shadowing and cosines in one
//   wrapped(c, w) = max(c + w, 0) / (1 + w)^2               as much light over the sphere for any w
//
// Source:  Schlick 1994 (F); Walter et al., "Microfacet Models for Refraction", EGSR 2007 (D); Kelemen and
//          Szirmay-Kalos, "A Microfacet Based Coupled Specular-Matte BRDF", EG 2001 (V); Green 2004, 16.2
//          (wrapped light; the division that keeps the energy is added).
// Twin:    src/optics/film.rs, fn highlight
// Parity:  tests/shading_parity.rs, fn film_matches_the_cpu_twin
// Threads: none of its own.
// Units:   1/sr for the highlight, 1 for the rest.
// Fails:   roughness below 0.02; l.h below 0.1 is taken as 0.1.

const PI: f32 = 3.14159265;
// ((n - 1) / (n + 1))^2 for n = 1.38.
const FILM_F0: f32 = 0.0254926;

fn fresnel(cosine: f32) -> f32 {
    let x = 1.0 - clamp(cosine, 0.0, 1.0);
    let x2 = x * x;
    return FILM_F0 + (1.0 - FILM_F0) * x2 * x2 * x;
}

// Radiance thrown back per irradiance on a plane that faces the light.
fn highlight(normal: vec3f, to_light: vec3f, to_eye: vec3f, roughness: f32) -> f32 {
    let half_way = normalize(to_light + to_eye);
    let n_h = max(dot(normal, half_way), 0.0);
    let l_h = max(dot(to_light, half_way), 0.1);
    let a = roughness * roughness;
    let a2 = a * a;
    let base = n_h * n_h * (a2 - 1.0) + 1.0;
    let n_l = max(dot(normal, to_light), 0.0);
    return n_l * a2 * fresnel(l_h) / (4.0 * PI * base * base * l_h * l_h);
}

fn wrapped(cosine: f32, wrap: vec3f) -> vec3f {
    let w = 1.0 + wrap;
    return max(vec3f(cosine) + wrap, vec3f(0.0)) / (w * w);
}

// What a wet surface mirrors in a dim operating theatre: a round lamp above, a light panel to the side,
// drapes below. Smooth, so that it needs no filtering.
fn theatre(direction: vec3f) -> vec3f {
    let lamp = clamp((dot(direction, vec3f(-0.30, 0.86, 0.41)) - 0.90) * 16.0, 0.0, 1.0);
    let panel = clamp((dot(direction, vec3f(0.86, 0.32, 0.40)) - 0.72) * 5.0, 0.0, 1.0);
    let height = clamp(0.5 + 0.6 * direction.y, 0.0, 1.0);
    return vec3f(0.020, 0.032, 0.036) + height * height * vec3f(0.17, 0.19, 0.20)
        + lamp * lamp * (3.0 - 2.0 * lamp) * vec3f(3.4, 3.3, 3.1)
        + panel * panel * vec3f(0.50, 0.58, 0.66);
}
