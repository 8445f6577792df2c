// Single scattering in layers of tissue, gathered along the view ray below the surface.
//
//   M(t)  = P - t w_out,  t = T (i/n)^2 (closed form) or T i/n (as published)
//   plane = P's tangent plane at t = 0, the fitted plane at t = T, blended in between   François eq. 9
//   s     = (h t/T - n_M . (M - P)) / (n_M . w_in)           signed; a plane that faces away is unlit
//   (ds, dt) = (PM . g_u, PM . g_v)                          with the metric of the deformed surface
//
// T is where the ray has sunk to the deepest layer or lost all but exp(-8). Each sample reads the layers
// once; those of the light's way are the layers at M (their mean with K' changes little, and costs a fetch).
//
// Source:  François 2006, Algorithms 1 and 2 with the faults mended that docs/METHODS.md lists; Norberg 2010,
//          eqs. 10, 14, 5.1.
// Twin:    src/optics/march.rs, fn march
// Parity:  tests/shading_parity.rs, fn march_matches_the_cpu_twin
// Threads: one a covered pixel.
// Units:   metres, 1/m, W/(m2 sr).
// Fails:   surfaces that fold below the patch radius; light that enters far from P.

override PUBLISHED: u32 = 0u;
override LIGHTS: u32 = 2u;

struct Ray {
    position: vec3f,
    normal: vec3f,
    plane: vec4f,
    to_eye: vec3f,
    n_v: f32,
    uv: vec2f,
    gradient_u: vec3f,
    gradient_v: vec3f,
}

fn bottoms_at(ray: Ray, offset: vec3f) -> vec4f {
    let uv = ray.uv + vec2f(dot(offset, ray.gradient_u), dot(offset, ray.gradient_v));
    return frame.layer_depth_max_m * textureSampleLevel(layer_map, linear_sampler, uv, 0.0);
}

// Optical depth from a light to a point that lies `below` the plane [m]; beyond any eye's reach where the
// plane faces away.
fn depth_to_light(below: f32, cosine: f32, bottoms: vec4f, sigma_t: mat4x3f) -> vec3f {
    let c = max(cosine, 1e-3);
    let depth = optical_depth(max(below, 0.0) / c, c, bottoms, sigma_t);
    return select(depth, vec3f(60.0), cosine <= 1e-3);
}

// Radiance [W/(m2 sr)] scattered once towards the eye; `shares` is how much of each light arrives.
fn single_scattering(ray: Ray, shares: vec4f, bottoms_p: vec4f) -> vec3f {
    let sigma_t = mat4x3f(
        frame.extinction[0].xyz,
        frame.extinction[1].xyz,
        frame.extinction[2].xyz,
        frame.extinction[3].xyz,
    );
    let sigma_s = mat4x3f(
        frame.scattering[0].xyz,
        frame.scattering[1].xyz,
        frame.scattering[2].xyz,
        frame.scattering[3].xyz,
    );
    var to_light: array<vec3f, 4>;
    var arriving: array<vec3f, 4>;
    var phases: array<vec4f, 4>;
    var before: array<vec3f, 4>;
    var before_e: array<vec3f, 4>;
    for (var k = 0u; k < LIGHTS; k += 1u) {
        let lit = light_at(frame.lights[k], ray.position);
        let cosine = dot(lit.to_light, ray.to_eye);
        to_light[k] = lit.to_light;
        arriving[k] = shares[k] * lit.irradiance;
        phases[k] = vec4f(
            phase(cosine, frame.scattering[0].w),
            phase(cosine, frame.scattering[1].w),
            phase(cosine, frame.scattering[2].w),
            phase(cosine, frame.scattering[3].w),
        );
        before[k] = depth_to_light(0.0, dot(ray.normal, lit.to_light), bottoms_p, sigma_t);
        before_e[k] = exp(-before[k]);
    }
    let clearest = min(min(sigma_t[1].x, sigma_t[1].y), sigma_t[1].z);
    let reach = min(frame.layer_depth_max_m / ray.n_v, 8.0 / clearest);
    var sum = vec3f(0.0);
    var to_eye_depth = vec3f(0.0);
    var bottoms = bottoms_p;
    var t = 0.0;
    for (var i = 1u; i <= SAMPLES; i += 1u) {
        let share = f32(i) / f32(SAMPLES);
        let next = reach * select(share * share, share, PUBLISHED != 0u);
        let step = next - t;
        let offset = -next * ray.to_eye;
        let blend = next / reach;
        let bottoms_next = bottoms_at(ray, offset);
        let n = normalize(mix(ray.normal, ray.plane.xyz, blend));
        let below = blend * ray.plane.w - dot(n, offset);
        var content = filled(t * ray.n_v, next * ray.n_v, 0.5 * (bottoms + bottoms_next));
        if PUBLISHED != 0u {
            // The layer at the start of the step stands for all of it.
            let layer = layer_at(t * ray.n_v, bottoms);
            content = vec4f(vec4u(layer) == vec4u(0u, 1u, 2u, 3u));
        }
        let eye_next = to_eye_depth + step * (sigma_t * content);
        for (var k = 0u; k < LIGHTS; k += 1u) {
            let a = eye_next + depth_to_light(below, dot(n, to_light[k]), bottoms_next, sigma_t);
            let e = exp(-a);
            let emitted = sigma_s * (content * phases[k]);
            let mean = select(piece(before[k], a, before_e[k], e), before_e[k], PUBLISHED != 0u);
            sum += step * arriving[k] * emitted * mean;
            before[k] = a;
            before_e[k] = e;
        }
        to_eye_depth = eye_next;
        t = next;
        bottoms = bottoms_next;
    }
    return sum;
}

@fragment
fn fragment(in: Varyings) -> @location(0) vec4f {
    let at = place(in);
    // The parallax of what shines through: the deep colour is read where the refracted ray meets it.
    let ray = Ray(
        in.world,
        at.normal,
        vec4f(normalize(in.plane.xyz), in.plane.w),
        at.to_eye,
        max(at.n_v, 0.12),
        in.uv,
        in.gradient_u,
        in.gradient_v,
    );
    let bottoms = bottoms_at(ray, vec3f(0.0));
    let sunk = -(0.35 * frame.layer_depth_max_m / max(at.n_v, 0.35)) * at.to_eye;
    let deep_uv = in.uv + vec2f(dot(sunk, in.gradient_u), dot(sunk, in.gradient_v));
    let deep = textureSample(inner_map, linear_sampler, deep_uv).rgb;
    let shadow = unshadowed(in.world, at.normal);

    var shares = vec4f(1.0);
    var diffuse = vec3f(0.05, 0.055, 0.06);
    for (var k = 0u; k < LIGHTS; k += 1u) {
        let lit = light_at(frame.lights[k], in.world);
        shares[k] = select(1.0, shadow, frame.lights[k].power.w > 0.0);
        // Red light wanders farthest, so it reaches farthest round the terminator.
        let soft = mix(at.detail, at.normal, 0.5);
        let cosine = dot(soft, lit.to_light);
        let reach = frame.wrap * vec3f(1.0, 0.45, 0.3);
        diffuse += mix(0.25, 1.0, shares[k]) * lit.irradiance * vec3f(
            wrapped(cosine, reach.x),
            wrapped(cosine, reach.y),
            wrapped(cosine, reach.z),
        );
    }
    let single = single_scattering(ray, shares, bottoms);
    let color = mix(deep, at.outer.rgb, at.outer.a);
    let tint = mix(vec3f(1.0), 2.2 * color, frame.color_blend);
    let scattered = tint * single + frame.multiple_scattering * color * diffuse / PI;
    return vec4f(scattered + wet(in, at, shadow), 1.0);
}
