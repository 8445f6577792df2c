// Layers of tissue: light scattered once, gathered along the view ray below the surface; light scattered more
// often, as diffuse light; the wet film on top.
//
//   M(t) = P - t w_out,  t = T (i/n)^2 (closed form) or T i/n (as published)
//   T    = min(deepest layer / N.w_out, cap, exp(-8) of the clearest layer)
//   (ds, dt) = (PM . g_u, PM . g_v)                        with the metric of the deformed surface
//   L    = sum over lights and segments (medium.wgsl) + albedo diffuse / pi + film
//
// Each sample reads the layers once, for all lights; the light's way is split over the layers at M (their mean
// with those at K' changes little and costs a fetch a light). The layers are tinted by the colour maps: the
// upper two by the outer one, the lower two by the inner one.
//
// Source:  François 2006, Algorithms 1 and 2 with the faults mended that docs/METHODS.md lists; Norberg 2010,
//          eqs. 10, 14 and 5.1 (colour).
// Twin:    src/optics/march.rs, fn march
// Parity:  tests/shading_parity.rs, fn march_matches_the_cpu_twin
// Threads: one a covered pixel.
// Units:   metres, 1/m, W/(m2 sr).
// Fails:   folds below the patch radius; light that enters far from P.

override SAMPLES: u32 = 4u;
override PUBLISHED: u32 = 0u;

// What the march needs of a ray.
struct Ray {
    world: vec3f,
    normal: vec3f,
    plane: vec3f,
    to_eye: vec3f,
    pair: PlanePair,
    uv: vec2f,
    // Texture coordinates a metre along the ray.
    drift: vec2f,
}

// One light on its way along the ray: its cosines with both planes, its optical depth at the last sample.
struct Beam {
    facing: vec2f,
    irradiance: vec3f,
    sources: Layers,
    depth: vec3f,
}

fn bottoms_at(ray: Ray, t: f32) -> vec3f {
    let texel = textureSampleLevel(layer_map, linear_sampler, ray.uv + t * ray.drift, 0.0);
    return frame.layer_depth_max_m * texel.rgb;
}

fn extinctions() -> Layers {
    return Layers(
        frame.extinction[0].xyz,
        frame.extinction[1].xyz,
        frame.extinction[2].xyz,
        frame.extinction[3].xyz,
    );
}

fn beam_start(k: u32, ray: Ray) -> Beam {
    return beam_at(k, ray, 0.0, 0.0, vec3f(0.0), extinctions());
}

fn beam_at(k: u32, ray: Ray, t: f32, blend: f32, bottoms: vec3f, layers: Layers) -> Beam {
    let lit = light_at(k, ray.world - t * ray.to_eye);
    let facing = vec2f(dot(ray.normal, lit.to_light), dot(ray.plane, lit.to_light));
    let p = phases(dot(lit.to_light, ray.to_eye), vec4f(
        frame.extinction[0].w,
        frame.extinction[1].w,
        frame.extinction[2].w,
        frame.extinction[3].w,
    ));
    let sources = Layers(
        p.x * frame.albedo[0].xyz,
        p.y * frame.albedo[1].xyz,
        p.z * frame.albedo[2].xyz,
        p.w * frame.albedo[3].xyz,
    );
    let way = way_to_light(ray.pair, t, blend, facing.x, facing.y);
    return Beam(facing, lit.irradiance, sources, light_depth(way, bottoms, layers));
}

// Beyond any eye's reach where the plane faces away.
fn light_depth(way: vec2f, bottoms: vec3f, layers: Layers) -> vec3f {
    return select(vec3f(60.0), optical_depth(way.x, way.y, bottoms, layers), way.y > 0.0);
}

struct Step {
    t: f32,
    blend: f32,
    bottoms: vec3f,
    segment: Segment,
    // How far the start of the segment lies below each boundary [m].
    below: vec3f,
}

// Moves a beam to the end of a step and returns what the step sends to the eye.
fn advance(k: u32, ray: Ray, step: Step, layers: Layers, beam: ptr<function, Beam>) -> Gathered {
    let last = *beam;
    if (POINT_LIGHTS & (1u << k)) != 0u {
        *beam = beam_at(k, ray, step.t, step.blend, step.bottoms, layers);
    } else {
        let way = way_to_light(ray.pair, step.t, step.blend, last.facing.x, last.facing.y);
        (*beam).depth = light_depth(way, step.bottoms, layers);
    }
    var got = gather(step.segment, last.depth, (*beam).depth, last.sources);
    if PUBLISHED != 0u {
        got = gather_at_start(step.segment, last.depth, step.below, last.sources);
    }
    return Gathered(got.upper * last.irradiance, got.lower * last.irradiance);
}

fn single_scattering(ray: Ray, unshadowed: f32) -> Gathered {
    let layers = extinctions();
    let n_v = max(ray.pair.tangent_eye, 1e-3);
    let reach = min(frame.layer_depth_max_m / max(n_v, 0.125), frame.reach_m);
    var beam0 = beam_start(0u, ray);
    beam0.irradiance *= unshadowed;
    var beam1: Beam;
    var beam2: Beam;
    var beam3: Beam;
    if LIGHT_COUNT > 1u {
        beam1 = beam_start(1u, ray);
    }
    if LIGHT_COUNT > 2u {
        beam2 = beam_start(2u, ray);
    }
    if LIGHT_COUNT > 3u {
        beam3 = beam_start(3u, ray);
    }
    var upper = vec3f(0.0);
    var lower = vec3f(0.0);
    var t = 0.0;
    var a = vec3f(0.0);
    var below = -bottoms_at(ray, 0.0);
    for (var i = 1u; i <= SAMPLES; i += 1u) {
        let even = f32(i) * (1.0 / f32(SAMPLES));
        let share = select(even * even, even, PUBLISHED != 0u);
        let next = reach * share;
        let bottoms = bottoms_at(ray, next);
        let below_next = next * n_v - bottoms;
        var shares = above(below, below_next);
        if PUBLISHED != 0u {
            shares = select(vec3f(1.0), vec3f(0.0), below > vec3f(0.0));
        }
        let blend = select(share * share, share, PUBLISHED != 0u);
        let step = Step(next, blend, bottoms, segment(a, next - t, shares, layers), below);
        var got = advance(0u, ray, step, layers, &beam0);
        upper += got.upper;
        lower += got.lower;
        if LIGHT_COUNT > 1u {
            got = advance(1u, ray, step, layers, &beam1);
            upper += got.upper;
            lower += got.lower;
        }
        if LIGHT_COUNT > 2u {
            got = advance(2u, ray, step, layers, &beam2);
            upper += got.upper;
            lower += got.lower;
        }
        if LIGHT_COUNT > 3u {
            got = advance(3u, ray, step, layers, &beam3);
            upper += got.upper;
            lower += got.lower;
        }
        t = next;
        a = step.segment.a4;
        below = below_next;
    }
    return Gathered(upper, lower);
}

// A colour map leaves a layer as it is where it is this bright.
const NEUTRAL_COLOR: f32 = 0.18;

@fragment
fn fragment(@builtin(position) at: vec4f) -> @location(0) vec4f {
    let pixel = pixel_at(at);
    let detail = textureLoad(detail_map, vec2i(at.xy), 0);
    let gradients = gradients_of(detail);
    let plane = from_octahedral(detail.x);
    let drift = -vec2f(dot(gradients.u, pixel.across), dot(gradients.v, pixel.across));
    let pair = PlanePair(
        dot(pixel.normal, plane),
        dot(pixel.normal, pixel.to_eye),
        dot(plane, pixel.to_eye),
        bitcast<f32>(detail.y),
    );
    let ray = Ray(pixel.world, pixel.normal, plane, pixel.to_eye, pair, pixel.uv, drift);

    // What lies deep is seen where the ray meets it: that shift is the parallax of the vessels.
    let sunk = 0.35 * frame.layer_depth_max_m / max(pair.tangent_eye, 0.35);
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
    radiance += frame.multiple_scattering * color * diffuse(pixel.world, soft, wrap, through) / PI;
    return vec4f(radiance, 1.0);
}
