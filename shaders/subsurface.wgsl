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

// Optical depth from the light to M; beyond any eye's reach where the plane faces away.
fn depth_to_light(
    ray: Ray,
    offset: vec3f,
    blend: f32,
    to_light: vec3f,
    bottoms: vec4f,
    sigma_t: array<vec3f, 4>,
) -> vec3f {
    let n = normalize(mix(ray.normal, ray.plane.xyz, blend));
    let cosine = dot(n, to_light);
    let below = blend * ray.plane.w - dot(n, offset);
    if cosine <= 1e-3 {
        return vec3f(60.0);
    }
    return optical_depth(max(below, 0.0) / cosine, cosine, bottoms, sigma_t);
}

fn single_scattering(ray: Ray, light_index: u32, count: u32, bottoms_p: vec4f) -> vec3f {
    let lit = light_at(frame.lights[light_index], ray.position);
    // All of the light's planes face away: nothing to gather.
    if max(dot(ray.normal, lit.to_light), dot(ray.plane.xyz, lit.to_light)) <= 1e-3 {
        return vec3f(0.0);
    }
    var sigma_t = array<vec3f, 4>(
        frame.extinction[0].xyz,
        frame.extinction[1].xyz,
        frame.extinction[2].xyz,
        frame.extinction[3].xyz,
    );
    let cos_scatter = dot(lit.to_light, ray.to_eye);
    var source = array<vec3f, 4>();
    for (var j = 0u; j < 4u; j += 1u) {
        let scattering = frame.scattering[j];
        source[j] = scattering.xyz * phase(cos_scatter, scattering.w);
    }
    let clearest = min(min(sigma_t[1].x, sigma_t[1].y), sigma_t[1].z);
    let reach = min(frame.layer_depth_max_m / ray.n_v, 8.0 / clearest);
    var sum = vec3f(0.0);
    var to_eye_depth = vec3f(0.0);
    var bottoms = bottoms_p;
    var t = 0.0;
    var a0 = depth_to_light(ray, vec3f(0.0), 0.0, lit.to_light, bottoms, sigma_t);
    for (var i = 1u; i <= count; i += 1u) {
        let share = f32(i) / f32(count);
        let next = reach * select(share * share, share, PUBLISHED != 0u);
        let step = next - t;
        let offset = -next * ray.to_eye;
        let bottoms_next = bottoms_at(ray, offset);
        let light_depth = depth_to_light(ray, offset, next / reach, lit.to_light, bottoms_next, sigma_t);
        if PUBLISHED != 0u {
            // The sample at the start of the step stands for all of it.
            let layer = layer_at(t * ray.n_v, bottoms);
            sum += step * source[layer] * exp(-to_eye_depth - a0);
            to_eye_depth += step * sigma_t[layer];
            a0 = light_depth;
        } else {
            // The layers between the two ends, by how much of the step each fills at its middle.
            let top = t * ray.n_v;
            let bottom = next * ray.n_v;
            let edges = clamp(0.5 * (bottoms + bottoms_next), vec4f(top), vec4f(bottom));
            let filled = vec4f(
                edges.x - top,
                max(edges.y - edges.x, 0.0),
                max(edges.z - max(edges.x, edges.y), 0.0),
                bottom - max(max(edges.x, edges.y), edges.z),
            ) / (bottom - top);
            let extinction = filled.x * sigma_t[0] + filled.y * sigma_t[1]
                + filled.z * sigma_t[2] + filled.w * sigma_t[3];
            let emitted = filled.x * source[0] + filled.y * source[1]
                + filled.z * source[2] + filled.w * source[3];
            let eye_next = to_eye_depth + step * extinction;
            sum += step * emitted * piece(to_eye_depth + a0, eye_next + light_depth);
            to_eye_depth = eye_next;
            a0 = light_depth;
        }
        t = next;
        bottoms = bottoms_next;
    }
    return sum * lit.irradiance;
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

    var single = vec3f(0.0);
    var diffuse = vec3f(0.05, 0.055, 0.06);
    for (var k = 0u; k < frame.light_count; k += 1u) {
        let lit = light_at(frame.lights[k], in.world);
        let share = select(1.0, shadow, frame.lights[k].power.w > 0.0);
        single += share * single_scattering(ray, k, SAMPLES, bottoms);
        // Red light wanders farthest, so it reaches farthest round the terminator.
        let soft = mix(at.detail, at.normal, 0.5);
        let cosine = dot(soft, lit.to_light);
        let reach = frame.wrap * vec3f(1.0, 0.45, 0.3);
        diffuse += mix(0.25, 1.0, share) * lit.irradiance * vec3f(
            wrapped(cosine, reach.x),
            wrapped(cosine, reach.y),
            wrapped(cosine, reach.z),
        );
    }
    let color = mix(deep, at.outer.rgb, at.outer.a);
    let tint = mix(vec3f(1.0), 2.2 * color, frame.color_blend);
    let scattered = tint * single + frame.multiple_scattering * color * diffuse / PI;
    return vec4f(scattered + wet(in, at, shadow), 1.0);
}
