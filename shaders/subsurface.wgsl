// Layers of tissue: light scattered once, gathered along the view ray below the surface; light scattered more
// often, as diffuse light; the wet film on top.
//
//   M(t) = P - t w_out,  t at the layers' ends (by layer), T (i/n)^2 (closed form) or T i/n (as published)
//   T    = min(deepest layer / N.w_out, cap, exp(-8) of the clearest layer, the way out)
//   (ds, dt) = (PM . g_u, PM . g_v)                        with the metric of the deformed surface
//   L    = sum over lights and segments (medium.wgsl) + albedo diffuse / pi + film
//
// Light scattered more than once is that diffuse term, in the colour of the maps, or (OFTEN) comes from the medium: then
// each layer scatters albedo p + often (multiple.wgsl), and what leaks out of a small body is wrapped round its terminator.
//
// Each sample reads the layers once, for all lights; the light's way is split over the layers at M (their mean
// with those at K' changes little and costs a fetch a light). The layers are tinted by the colour maps: the
// upper half by the outer one, the lower half by the inner one. How many layers there are is the matter of the file
// before it: layers_four.wgsl, or layers_eight.wgsl.
//
// Source:  François 2006, Algorithms 1 and 2 with the faults mended that docs/METHODS.md lists; Norberg 2010,
//          eqs. 10, 14, 3.1.2 (noise) and 5.1 (colour).
// Twin:    src/optics/march.rs, fn march
// Parity:  tests/shading_parity.rs, fn march_matches_the_cpu_twin
// Threads: one a covered pixel.
// Units:   metres, 1/m, W/(m2 sr).
// Fails:   folds below the patch radius; light that enters far from P.

// 0 by layer, 1 closed form, 2 as published.
override QUADRATURE: u32 = 0u;
// Samples of the last two; of the first, samples in each layer.
override SAMPLES: u32 = 4u;
override PIECES: u32 = 1u;
// 1: light that scattered more than once comes from the medium.
override OFTEN: u32 = 0u;

// What the march needs of a ray.
struct Ray {
    world: vec3f,
    to_eye: vec3f,
    // N.w_out
    cos_eye: f32,
    cover: Cover,
    uv: vec2f,
    // Texture coordinates a metre along the ray.
    drift: vec2f,
    // The deepest boundary that the layer map can tell, as thick as layers are here [m].
    deepest_m: f32,
}

// One light on its way along the ray: how it meets the cover; phase function of the layers; its optical
// depth A, with that from the eye, at the last sample, and exp(-A).
struct Beam {
    facing: Facing,
    irradiance: vec3f,
    phases: Phases,
    depth: vec3f,
    left: vec3f,
}

// Where the march is. Beams of lights that the scene does not have are never touched.
struct March {
    t: f32,
    // Optical depth from the eye.
    a: vec3f,
    bottoms: Bottoms,
    beam0: Beam,
    beam1: Beam,
    beam2: Beam,
    beam3: Beam,
}

// As printed, a march ends where the deepest layer does below the fitted plane.
fn reach_of(ray: Ray) -> f32 {
    if QUADRATURE == 2u {
        return ray.deepest_m / max(printed_cosine(ray.cover), 0.08);
    }
    let deepest = ray.deepest_m / max(ray.cos_eye, 0.125);
    return min(min(deepest, frame.reach_m), exit_of(ray.cover));
}

// Optical depth of a way to the light; beyond any eye's reach where the plane faces away.
fn light_depth(way: vec2f, bottoms: Bottoms, layers: Layers) -> vec3f {
    return select(vec3f(60.0), optical_depth(way.x, way.y, bottoms, layers), way.y > 0.0);
}

fn beam_start(k: u32, ray: Ray, bottoms: Bottoms) -> Beam {
    let lit = light_at(k, ray.world);
    let facing = facing_of(ray.cover, k, lit.to_light);
    let depth = light_depth(way_under(ray.cover, facing, 0.0, 0.0), bottoms, extinctions());
    let p = phases_towards(dot(lit.to_light, ray.to_eye));
    return Beam(facing, lit.irradiance, p, depth, exp(-depth));
}

// A near light's direction and distance change along the ray.
fn turned(k: u32, ray: Ray, t: f32, beam: Beam) -> Beam {
    if (POINT_LIGHTS & (1u << k)) == 0u {
        return beam;
    }
    let lit = light_at(k, ray.world - t * ray.to_eye);
    return Beam(
        facing_of(ray.cover, k, lit.to_light),
        lit.irradiance,
        beam.phases,
        beam.depth,
        beam.left,
    );
}

fn march_start(ray: Ray, unshadowed: f32) -> March {
    var m: March;
    m.bottoms = bottoms_at(ray, 0.0);
    m.beam0 = beam_start(0u, ray, m.bottoms);
    m.beam0.irradiance *= select(unshadowed, 1.0, SEES_SHADOWS);
    if LIGHT_COUNT > 1u {
        m.beam1 = beam_start(1u, ray, m.bottoms);
    }
    if LIGHT_COUNT > 2u {
        m.beam2 = beam_start(2u, ray, m.bottoms);
    }
    if LIGHT_COUNT > 3u {
        m.beam3 = beam_start(3u, ray, m.bottoms);
    }
    return m;
}

// A sample within one layer: the stretch from the last one to it.
struct Stretch {
    t: f32,
    blend: f32,
    bottoms: Bottoms,
    // Optical depth from the eye at both ends.
    a0: vec3f,
    a1: vec3f,
}

// A beam at the end of a stretch, and what the stretch sends to the eye, per albedo and phase.
struct Followed {
    beam: Beam,
    light: vec3f,
}

fn follow(k: u32, ray: Ray, s: Stretch, layers: Layers, last: Beam) -> Followed {
    var next = turned(k, ray, s.t, last);
    let way = way_under(ray.cover, next.facing, s.t, s.blend);
    next.depth = light_depth(way, s.bottoms, layers);
    let before = s.a0 + last.depth;
    let after = s.a1 + next.depth;
    next.left = exp(-after);
    let mean = mean_transmittance(before, after, last.left, next.left);
    return Followed(next, (s.a1 - s.a0) * mean * last.irradiance);
}

// What stands beside albedo times phase of layer `j` for light `k` scattered more than once [1/sr].
fn often_of(k: u32, j: u32, ray: Ray) -> vec3f {
    if OFTEN == 0u {
        return vec3f(0.0);
    }
    let cos_light = dot(ray.cover.normal, light_at(k, ray.world).to_light);
    let scattered = often(cos_light, ray.cos_eye, frame.reflectance[j].xyz, frame.around.xyz);
    return frame.multiple_scattering * frame.kept.xyz * scattered;
}

// The same beside the phase function alone.
fn phase_often(k: u32, j: u32, ray: Ray) -> vec3f {
    return often_of(k, j, ray) / max(frame.albedo[j].xyz, vec3f(1e-6));
}

// Gathers one layer of extinction `sigma` [1/m]. `pick` says at which boundary it ends; the last layer ends where the
// march does. `p` is the phase function of layer `j` for each light. The end is looked for where the last sample's layers
// say it is, and corrected once by what is found there. Several samples lie at (i/n)^2 of the way through the layer.
fn gather_layer(
    m: ptr<function, March>,
    ray: Ray,
    layers: Layers,
    sigma: vec3f,
    pick: Pick,
    j: u32,
    p: vec4f,
) -> vec3f {
    let n_v = max(ray.cos_eye, 1e-3);
    let reach = reach_of(ray);
    var sum = vec3f(0.0);
    for (var i = 0u; i < PIECES; i += 1u) {
        // Of what is left of the layer: ((i + 1)^2 - i^2) / (n^2 - i^2).
        let part = f32(2u * i + 1u) / f32((PIECES - i) * (PIECES + i));
        let t = (*m).t;
        let guess = select(clamp(boundary(pick, (*m).bottoms) / n_v, t, reach), reach, is_last(pick));
        let bottoms = bottoms_at(ray, t + (guess - t) * part);
        let end = select(clamp(boundary(pick, bottoms) / n_v, t, reach), reach, is_last(pick));
        let next = t + (end - t) * part;
        let share = next / reach;
        let a0 = (*m).a;
        let s = Stretch(next, share * share, bottoms, a0, a0 + (next - t) * sigma);
        var got = follow(0u, ray, s, layers, (*m).beam0);
        (*m).beam0 = got.beam;
        sum += (p.x + phase_often(0u, j, ray)) * got.light;
        if LIGHT_COUNT > 1u {
            got = follow(1u, ray, s, layers, (*m).beam1);
            (*m).beam1 = got.beam;
            sum += (p.y + phase_often(1u, j, ray)) * got.light;
        }
        if LIGHT_COUNT > 2u {
            got = follow(2u, ray, s, layers, (*m).beam2);
            (*m).beam2 = got.beam;
            sum += (p.z + phase_often(2u, j, ray)) * got.light;
        }
        if LIGHT_COUNT > 3u {
            got = follow(3u, ray, s, layers, (*m).beam3);
            (*m).beam3 = got.beam;
            sum += (p.w + phase_often(3u, j, ray)) * got.light;
        }
        (*m).t = next;
        (*m).a = s.a1;
        (*m).bottoms = bottoms;
    }
    return sum;
}

// A step of the other two rules, which may cross layers.
struct Step {
    t: f32,
    blend: f32,
    bottoms: Bottoms,
    segment: Segment,
    // How far the start of the segment lies below each boundary [m].
    below: Bottoms,
}

// A beam at the end of a step, and what the step sends to the eye.
struct Advanced {
    beam: Beam,
    light: Gathered,
}

fn advance(k: u32, ray: Ray, step: Step, layers: Layers, last: Beam) -> Advanced {
    var next = turned(k, ray, step.t, last);
    let way = way_under(ray.cover, next.facing, step.t, step.blend);
    next.depth = light_depth(way, step.bottoms, layers);
    let sources = with_often(k, ray, sources_of(last.phases));
    var got: Gathered;
    if QUADRATURE == 2u {
        got = gather_at_start(step.segment, last.depth, step.below, sources);
    } else {
        got = gather(step.segment, last.depth, next.depth, sources);
    }
    return Advanced(next, Gathered(got.upper * last.irradiance, got.lower * last.irradiance));
}

// Equal steps valued at their start, or steps that grow with depth and are integrated layer by layer.
fn by_step(ray: Ray, unshadowed: f32) -> Gathered {
    let layers = extinctions();
    let n_v = max(ray.cos_eye, 1e-3);
    let reach = reach_of(ray);
    var m = march_start(ray, unshadowed);
    var upper = vec3f(0.0);
    var lower = vec3f(0.0);
    var below = below_all(0.0, m.bottoms);
    for (var i = 1u; i <= SAMPLES; i += 1u) {
        let even = f32(i) * (1.0 / f32(SAMPLES));
        let share = select(even * even, even, QUADRATURE == 2u);
        let next = reach * share;
        let bottoms = bottoms_at(ray, next);
        let below_next = below_all(next * n_v, bottoms);
        var shares = above(below, below_next);
        if QUADRATURE == 2u {
            shares = above_at_start(below);
        }
        let blend = select(share * share, share, QUADRATURE == 2u);
        let step = Step(next, blend, bottoms, segment(m.a, next - m.t, shares, layers), below);
        var got = advance(0u, ray, step, layers, m.beam0);
        m.beam0 = got.beam;
        upper += got.light.upper;
        lower += got.light.lower;
        if LIGHT_COUNT > 1u {
            got = advance(1u, ray, step, layers, m.beam1);
            m.beam1 = got.beam;
            upper += got.light.upper;
            lower += got.light.lower;
        }
        if LIGHT_COUNT > 2u {
            got = advance(2u, ray, step, layers, m.beam2);
            m.beam2 = got.beam;
            upper += got.light.upper;
            lower += got.light.lower;
        }
        if LIGHT_COUNT > 3u {
            got = advance(3u, ray, step, layers, m.beam3);
            m.beam3 = got.beam;
            upper += got.light.upper;
            lower += got.light.lower;
        }
        m.t = next;
        m.a = end_of(step.segment);
        below = below_next;
    }
    return Gathered(upper, lower);
}

fn single_scattering(ray: Ray, unshadowed: f32) -> Gathered {
    if QUADRATURE == 0u {
        return by_layer(ray, unshadowed);
    }
    return by_step(ray, unshadowed);
}

// A colour map leaves a layer as it is where it is this bright.
const NEUTRAL_COLOR: f32 = 0.18;

@fragment
fn fragment(@builtin(position) at: vec4f) -> @location(0) vec4f {
    let pixel = pixel_at(at);
    let detail = textureLoad(detail_map, vec2i(at.xy), 0);
    let gradients = gradients_of(detail);
    let drift = -vec2f(dot(gradients.u, pixel.across), dot(gradients.v, pixel.across));
    let cover = cover_at(
        pixel.world,
        pixel.normal,
        pixel.tangent,
        pixel.bitangent,
        pixel.to_eye,
        detail.xy,
    );
    let cos_eye = dot(pixel.normal, pixel.to_eye);
    let deepest_m = thickness_of(detail) * frame.layer_depth_max_m;
    var uv = pixel.uv;
    if NOISE != 0u {
        let moved = frame.noise_m * noise_at(pixel.uv, at.xy);
        uv += vec2f(dot(gradients.u, moved), dot(gradients.v, moved));
    }
    let ray = Ray(pixel.world, pixel.to_eye, cos_eye, cover, uv, drift, deepest_m);

    // What lies deep is seen where the ray meets it: that shift is the parallax of the vessels.
    let sunk = 0.35 * deepest_m / max(cos_eye, 0.35);
    let deep = color_at(inner_map, pixel.uv + sunk * drift).rgb;
    let through = way_through(pixel.world, pixel.normal);
    let unshadowed = unshadowed_after(through);

    var radiance = wet(pixel, unshadowed);
    if LIGHT_COUNT > 0u {
        let single = single_scattering(ray, unshadowed);
        let neutral = vec3f(1.0);
        radiance += single.upper * mix(neutral, pixel.outer.rgb / NEUTRAL_COLOR, frame.color_blend)
            + single.lower * mix(neutral, deep / NEUTRAL_COLOR, frame.color_blend);
    }
    // Red wanders farthest, so its light is softest and reaches farthest round the terminator.
    let soft = normalize(pixel.relief + pixel.normal);
    let wrap = frame.wrap * vec3f(1.0, 0.42, 0.30);
    let color = mix(deep, pixel.outer.rgb, pixel.outer.a);
    if OFTEN == 0u {
        radiance += frame.multiple_scattering * color * diffuse(pixel.world, soft, wrap, through) / PI;
        return shown(radiance, at);
    }
    radiance += color * ambient(soft) / PI;
    let tint = mix(vec3f(1.0), color / NEUTRAL_COLOR, frame.color_blend);
    for (var k = 0u; k < LIGHT_COUNT; k += 1u) {
        radiance += frame.multiple_scattering * tint * frame.leaked.xyz
            * diffuse_of(k, pixel.world, soft, frame.around.xyz, through);
    }
    return shown(radiance, at);
}
