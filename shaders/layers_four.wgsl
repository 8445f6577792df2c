// Up to four layers, as one texture holds them: what subsurface.wgsl needs of them. Follows medium.wgsl, pixel.wgsl.
//
// A scene with fewer layers repeats its last one below LAYER_COUNT, so that sums over all four stay right; by layer
// nothing is sampled there.
//
// Source:  François 2006, section 3.
// Units:   metres, 1/m, 1/sr.

override LAYER_COUNT: u32 = 4u;

// Phase function of each layer.
alias Phases = vec4f;
// 1 for the boundary at which a layer ends; zeros for the last layer.
alias Pick = vec3f;

fn bottoms_at(ray: Ray, t: f32) -> Bottoms {
    let texel = textureSampleLevel(layer_map, linear_sampler, ray.uv + t * ray.drift, 0.0);
    return ray.deepest_m * texel.rgb;
}

fn extinctions() -> Layers {
    return Layers(
        frame.extinction[0].xyz,
        frame.extinction[1].xyz,
        frame.extinction[2].xyz,
        frame.extinction[3].xyz,
    );
}

fn phases_towards(cos_angle: f32) -> Phases {
    let k_of_layers = vec4f(
        frame.extinction[0].w,
        frame.extinction[1].w,
        frame.extinction[2].w,
        frame.extinction[3].w,
    );
    return phases(cos_angle, k_of_layers);
}

// Albedo times phase.
fn sources_of(p: Phases) -> Layers {
    return Layers(
        p.x * frame.albedo[0].xyz,
        p.y * frame.albedo[1].xyz,
        p.z * frame.albedo[2].xyz,
        p.w * frame.albedo[3].xyz,
    );
}

// With what scatters more than once.
fn with_often(k: u32, ray: Ray, sources: Layers) -> Layers {
    return Layers(
        sources.t0 + often_of(k, 0u, ray),
        sources.t1 + often_of(k, 1u, ray),
        sources.t2 + often_of(k, 2u, ray),
        sources.t3 + often_of(k, 3u, ray),
    );
}

fn boundary(pick: Pick, bottoms: Bottoms) -> f32 {
    return dot(pick, bottoms);
}

fn is_last(pick: Pick) -> bool {
    return all(pick == vec3f(0.0));
}

fn end_of(s: Segment) -> vec3f {
    return s.a4;
}

// One sample at the end of each layer, or several within each: exact for parallel layers.
fn by_layer(ray: Ray, unshadowed: f32) -> Gathered {
    let layers = extinctions();
    var m = march_start(ray, unshadowed);
    let p0 = m.beam0.phases;
    let p1 = m.beam1.phases;
    let p2 = m.beam2.phases;
    let p3 = m.beam3.phases;
    let none = vec3f(0.0);
    var second = vec3f(0.0);
    var third = vec3f(0.0);
    var fourth = vec3f(0.0);
    let pick0 = select(vec3f(1.0, 0.0, 0.0), none, LAYER_COUNT == 1u);
    let first = gather_layer(&m, ray, layers, layers.t0, pick0, 0u, vec4f(p0.x, p1.x, p2.x, p3.x));
    if LAYER_COUNT > 1u {
        let pick = select(vec3f(0.0, 1.0, 0.0), none, LAYER_COUNT == 2u);
        second = gather_layer(&m, ray, layers, layers.t1, pick, 1u, vec4f(p0.y, p1.y, p2.y, p3.y));
    }
    if LAYER_COUNT > 2u {
        let pick = select(vec3f(0.0, 0.0, 1.0), none, LAYER_COUNT == 3u);
        third = gather_layer(&m, ray, layers, layers.t2, pick, 2u, vec4f(p0.z, p1.z, p2.z, p3.z));
    }
    if LAYER_COUNT > 3u {
        fourth = gather_layer(&m, ray, layers, layers.t3, none, 3u, vec4f(p0.w, p1.w, p2.w, p3.w));
    }
    return Gathered(
        first * frame.albedo[0].xyz + second * frame.albedo[1].xyz,
        third * frame.albedo[2].xyz + fourth * frame.albedo[3].xyz,
    );
}
