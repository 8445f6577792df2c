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

// One light along the march. Each has a variable of its own: a list that is stepped through by a counter lies in
// memory on software adapters, and costs three times as much.
struct Beam {
    to_light: vec3f,
    irradiance: vec3f,
    // Phase function of each layer between this light and the eye.
    phases: vec4f,
    // Optical depth from light to eye by way of the last node, and exp of its negative.
    depth: vec3f,
    transmittance: vec3f,
}

// What all lights share at a node.
struct Node {
    // Unit normal of the plane, and how far below it the node lies [m].
    normal: vec3f,
    below: f32,
    bottoms: vec4f,
    // How much of the step that ends here each layer fills.
    content: vec4f,
    eye_depth: vec3f,
    step: f32,
}

fn beam(ray: Ray, index: u32, share: f32, bottoms: vec4f, sigma_t: mat4x3f) -> Beam {
    let lit = light_at(frame.lights[index], ray.position);
    let cosine = dot(lit.to_light, ray.to_eye);
    let phases = vec4f(
        phase(cosine, frame.scattering[0].w),
        phase(cosine, frame.scattering[1].w),
        phase(cosine, frame.scattering[2].w),
        phase(cosine, frame.scattering[3].w),
    );
    let depth = depth_to_light(0.0, dot(ray.normal, lit.to_light), bottoms, sigma_t);
    return Beam(lit.to_light, share * lit.irradiance, phases, depth, exp(-depth));
}

// Light that the step which ends at `node` sends to the eye.
fn gather(beam: ptr<function, Beam>, node: Node, sigma_t: mat4x3f, sigma_s: mat4x3f) -> vec3f {
    let cosine = dot(node.normal, (*beam).to_light);
    let depth = node.eye_depth + depth_to_light(node.below, cosine, node.bottoms, sigma_t);
    let transmittance = exp(-depth);
    var mean = (*beam).transmittance;
    if PUBLISHED == 0u {
        mean = piece((*beam).depth, depth, (*beam).transmittance, transmittance);
    }
    let emitted = sigma_s * (node.content * (*beam).phases);
    (*beam).depth = depth;
    (*beam).transmittance = transmittance;
    return node.step * (*beam).irradiance * emitted * mean;
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
    var beam_0 = beam(ray, 0u, shares.x, bottoms_p, sigma_t);
    var beam_1: Beam;
    var beam_2: Beam;
    var beam_3: Beam;
    if LIGHTS > 1u {
        beam_1 = beam(ray, 1u, shares.y, bottoms_p, sigma_t);
    }
    if LIGHTS > 2u {
        beam_2 = beam(ray, 2u, shares.z, bottoms_p, sigma_t);
    }
    if LIGHTS > 3u {
        beam_3 = beam(ray, 3u, shares.w, bottoms_p, sigma_t);
    }
    let clearest = min(min(sigma_t[1].x, sigma_t[1].y), sigma_t[1].z);
    let reach = min(frame.layer_depth_max_m / ray.n_v, 8.0 / clearest);
    var sum = vec3f(0.0);
    var eye_depth = vec3f(0.0);
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
        var content = filled(t * ray.n_v, next * ray.n_v, 0.5 * (bottoms + bottoms_next));
        if PUBLISHED != 0u {
            // The layer at the start of the step stands for all of it.
            let layer = layer_at(t * ray.n_v, bottoms);
            content = vec4f(vec4u(layer) == vec4u(0u, 1u, 2u, 3u));
        }
        eye_depth += step * (sigma_t * content);
        let below = blend * ray.plane.w - dot(n, offset);
        let node = Node(n, below, bottoms_next, content, eye_depth, step);
        sum += gather(&beam_0, node, sigma_t, sigma_s);
        if LIGHTS > 1u {
            sum += gather(&beam_1, node, sigma_t, sigma_s);
        }
        if LIGHTS > 2u {
            sum += gather(&beam_2, node, sigma_t, sigma_s);
        }
        if LIGHTS > 3u {
            sum += gather(&beam_3, node, sigma_t, sigma_s);
        }
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
    let deep = color_at(inner_map, deep_uv).rgb;
    let shadow = unshadowed(in.world, at.normal);

    // Only the first light casts shadows.
    let shares = vec4f(shadow, 1.0, 1.0, 1.0);
    var diffuse = vec3f(0.05, 0.055, 0.06);
    for (var k = 0u; k < LIGHTS; k += 1u) {
        let lit = light_at(frame.lights[k], in.world);
        let share = select(1.0, shadow, k == 0u);
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
    let single = single_scattering(ray, shares, bottoms);
    let color = mix(deep, at.outer.rgb, at.outer.a);
    let tint = mix(vec3f(1.0), 2.2 * color, frame.color_blend);
    let scattered = tint * single + frame.multiple_scattering * color * diffuse / PI;
    return vec4f(scattered + wet(in, at, shadow), 1.0);
}
