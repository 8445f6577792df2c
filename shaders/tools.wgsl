// Rigid tools: spheres and capsules of polished steel, drawn over the tissue with its depth. Towards a round outline
// (n.v)^2 falls to zero evenly with the distance from it, so its slope says how much of a pixel is covered. Follows tone.wgsl and capsule.wgsl.
//
//   L = F(n.v) L_room(reflect(-v, n))
//
// Source:  Schlick, "An Inexpensive BRDF Model for Physically-based Rendering", 1994 (Fresnel term);
//          the rest is a lamp above, a lamp beside and a dark floor, by eye.
// Twin:    src/passes/tools.rs, fn capsule_point
// Parity:  src/passes/tools.rs, fn every_vertex_lies_on_the_capsule
// Threads: one a vertex; one a covered pixel.
// Units:   metres; radiance in the units of the lights, W/(m2 sr).
// Fails:   an axis shorter than 1e-6 m is a sphere.

// 1: the tone curve, sRGB and a soft outline; 0: linear radiance.
override TONE: u32 = 1u;

struct View {
    clip_from_world: mat4x4f,
    // The camera [m], and the exposure.
    eye_exposure: vec4f,
}

@group(0) @binding(0) var<uniform> view: View;
@group(0) @binding(1) var<storage, read> tools: array<Tool>;
@group(0) @binding(2) var<storage, read> directions: array<vec4f>;

struct Varyings {
    @builtin(position) clip: vec4f,
    @location(0) world: vec3f,
    @location(1) normal: vec3f,
}

@vertex
fn vertex(@builtin(vertex_index) corner: u32, @builtin(instance_index) index: u32) -> Varyings {
    let on = on_tool(tools[index], directions[corner]);
    return Varyings(view.clip_from_world * vec4f(on.world, 1.0), on.world, on.normal);
}

// What a polished surface mirrors in this room: two soft lamps and a floor.
fn room(direction: vec3f) -> vec3f {
    let up = smoothstep(-0.9, 0.9, direction.y);
    let lamp = smoothstep(0.86, 0.97, dot(direction, normalize(vec3f(-0.35, 0.85, 0.4))));
    let rim = smoothstep(0.8, 0.98, dot(direction, normalize(vec3f(0.9, 0.15, -0.3))));
    return mix(vec3f(0.05, 0.052, 0.055), vec3f(0.62, 0.66, 0.70), up)
        + 2.2 * lamp * vec3f(1.0, 0.97, 0.92) + 0.5 * rim * vec3f(0.7, 0.85, 1.0);
}

@fragment
fn fragment(in: Varyings) -> @location(0) vec4f {
    let normal = normalize(in.normal);
    let to_eye = normalize(view.eye_exposure.xyz - in.world);
    let cos_view = max(dot(normal, to_eye), 0.0);
    let steel = vec3f(0.62, 0.62, 0.64);
    let fresnel = steel + (1.0 - steel) * pow(1.0 - cos_view, 5.0);
    let radiance = fresnel * room(reflect(-to_eye, normal));
    if TONE == 0u {
        return vec4f(radiance, 1.0);
    }
    let squared = cos_view * cos_view;
    let from_outline = squared / max(length(vec2f(dpdx(squared), dpdy(squared))), 1e-6);
    return vec4f(displayed(view.eye_exposure.w * radiance), clamp(from_outline, 0.0, 1.0));
}
