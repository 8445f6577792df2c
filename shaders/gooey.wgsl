// An outer layer lit as it lies, and inner ones seen through it, shifted by parallax, blurred by their way to the eye, and
// lit by light that has wandered.
//
//   R = reflect(-V, n), T = (R.xy, -R.z)                          in the tangent frame of the surface
//   s_k = d_k / |T.z|,  PM = s T,  (ds, dt) = (PM . g_u, PM . g_v) Oat listing 1, Norberg eqs. 15-18
//   inner = sum_k left_k a_k albedo_k E_k,  left_k = prod_{j<k} (1 - a_j)
//   L = lerp(outer, inner, (1 - opacity) N.V)                       Oat listing 3
//
// The layers' distances d and the blurs are metres on the deformed surface, where the sources have texels: what
// stretches keeps its depth. Oat's listing takes alpha for transparency and his text for opacity; here alpha is
// opacity. The light of the inner layers is the blurred light map, or in his cheaper variants the mean over the
// bumps of the normal map about the place, or that of the smooth normal.
//
// Source:  Oat 2006, 4.4 to 4.7; Norberg 2010, 2.2.
// Twin:    src/optics/layers.rs, fn transmission
// Parity:  tests/shading_parity.rs, fn parallax_matches_the_cpu_twin
// Threads: one a covered pixel.
// Units:   metres; texture coordinates in shares of the unit square.
// Fails:   grazing views: the transmission is cut at 4 d, and N.V prefers the outer layer there.

// Inner layers, at most four.
override INNER_COUNT: u32 = 1u;
// How an inner layer's colour is blurred: 0 not at all, 1 by three taps, 2 by the disc.
override INNER_BLUR: u32 = 1u;
// What lights the inner layers: 0 the light map, 1 the normal map about the place, 2 the smooth normal.
override INNER_LIGHT: u32 = 0u;
// 1: what is opaque shades the layers below.
override SHADES: u32 = 0u;

// Texture coordinates `across` metres along tangent and bitangent.
fn uv_step(gradients: Gradients, across: vec2f) -> vec2f {
    return vec2f(dot(gradients.u, across), dot(gradients.v, across));
}

fn inner_pair(uv: vec2f, gradients: Gradients, radius_m: f32, tap: vec2f) -> vec4f {
    let step = uv_step(gradients, radius_m * tap);
    return color_at(inner_map, uv + step) + color_at(inner_map, uv - step);
}

// The albedo about `uv`, on a disc of `radius_m`.
fn inner_albedo(uv: vec2f, gradients: Gradients, radius_m: f32) -> vec4f {
    if INNER_BLUR == 0u {
        return color_at(inner_map, uv);
    }
    if INNER_BLUR == 1u {
        // Three taps about the place, none at it, as wide as the disc in the mean.
        let ring_m = 0.7 * radius_m;
        return (color_at(inner_map, uv + uv_step(gradients, ring_m * vec2f(0.87, 0.5)))
            + color_at(inner_map, uv + uv_step(gradients, ring_m * vec2f(-0.87, 0.5)))
            + color_at(inner_map, uv + uv_step(gradients, ring_m * vec2f(0.0, -1.0)))) / 3.0;
    }
    return (color_at(inner_map, uv)
        + inner_pair(uv, gradients, radius_m, DISC[0])
        + inner_pair(uv, gradients, radius_m, DISC[1])
        + inner_pair(uv, gradients, radius_m, DISC[2])
        + inner_pair(uv, gradients, radius_m, DISC[3])
        + inner_pair(uv, gradients, radius_m, DISC[4])
        + inner_pair(uv, gradients, radius_m, DISC[5])) / 13.0;
}

// Diffuse light below the outer layer where its normal is `normal`.
fn light_below(pixel: Pixel, uv: vec2f, normal: vec3f, through: f32) -> vec3f {
    let wrap = frame.wrap * vec3f(1.0, 0.42, 0.30);
    var light = diffuse(pixel.world, normal, wrap, through);
    if SHADES != 0u {
        light *= let_through(color_at(outer_map, uv).a * frame.outer_opacity, frame.layer_shadow);
    }
    return light;
}

fn bumps_pair(pixel: Pixel, uv: vec2f, gradients: Gradients, radius_m: f32, tap: vec2f, through: f32) -> vec3f {
    let step = uv_step(gradients, radius_m * tap);
    let p = uv + step;
    let q = uv - step;
    return light_below(pixel, p, relief_at(p, pixel.normal, pixel.tangent, pixel.bitangent), through)
        + light_below(pixel, q, relief_at(q, pixel.normal, pixel.tangent, pixel.bitangent), through);
}

// Light on the inner layers: the mean of the lights, not of the normals, where there is no light map.
fn inner_light(pixel: Pixel, uv: vec2f, gradients: Gradients, radius_m: f32, through: f32) -> vec3f {
    if INNER_LIGHT == 0u {
        var found = textureSampleLevel(light_map, linear_sampler, uv, 0.0);
        if found.a < 0.5 {
            // The shift has left the chart: the place itself lies on it.
            found = textureSampleLevel(light_map, linear_sampler, pixel.uv, 0.0);
        }
        return found.rgb / max(found.a, 1e-3);
    }
    if INNER_LIGHT == 2u {
        return light_below(pixel, uv, pixel.normal, through);
    }
    return (light_below(pixel, uv, relief_at(uv, pixel.normal, pixel.tangent, pixel.bitangent), through)
        + bumps_pair(pixel, uv, gradients, radius_m, DISC[0], through)
        + bumps_pair(pixel, uv, gradients, radius_m, DISC[1], through)
        + bumps_pair(pixel, uv, gradients, radius_m, DISC[2], through)
        + bumps_pair(pixel, uv, gradients, radius_m, DISC[3], through)
        + bumps_pair(pixel, uv, gradients, radius_m, DISC[4], through)
        + bumps_pair(pixel, uv, gradients, radius_m, DISC[5], through)) / 13.0;
}

// What is seen of inner layer `k`, of share `distance` of the layer distance, over what was seen before it.
fn seen_below(
    k: u32,
    before: Seen,
    distance: f32,
    pixel: Pixel,
    gradients: Gradients,
    thickness: f32,
    through: f32,
) -> Seen {
    let distance_m = thickness * distance * frame.layer_distance_m;
    let shift = transmission(pixel.to_eye, pixel.relief, pixel.normal, distance_m);
    let across = vec2f(dot(shift.xyz, pixel.tangent), dot(shift.xyz, pixel.bitangent));
    let uv = pixel.uv + uv_step(gradients, across);
    let albedo = inner_albedo(uv, gradients, frame.inner_blur * shift.w);
    let light = inner_light(pixel, uv, gradients, thickness * frame.blur_radius_m, through);
    let layer = frame.inner[k];
    // The last one hides what is below.
    let opacity = select(clamp(layer.w * albedo.a, 0.0, 1.0), 1.0, k + 1u == INNER_COUNT);
    return layered(before, albedo.rgb * layer.rgb * light, opacity, frame.layer_shadow);
}

@fragment
fn fragment(@builtin(position) at: vec4f) -> @location(0) vec4f {
    let pixel = pixel_at(at);
    let detail = textureLoad(detail_map, vec2i(at.xy), 0);
    let gradients = gradients_of(detail);
    let thickness = thickness_of(detail);
    let through = way_through(pixel.world, pixel.normal);
    var seen = Seen(vec3f(0.0), 1.0, 1.0);
    seen = seen_below(0u, seen, frame.inner_distances.x, pixel, gradients, thickness, through);
    if INNER_COUNT > 1u {
        seen = seen_below(1u, seen, frame.inner_distances.y, pixel, gradients, thickness, through);
    }
    if INNER_COUNT > 2u {
        seen = seen_below(2u, seen, frame.inner_distances.z, pixel, gradients, thickness, through);
    }
    if INNER_COUNT > 3u {
        seen = seen_below(3u, seen, frame.inner_distances.w, pixel, gradients, thickness, through);
    }

    let outer_light = diffuse(pixel.world, pixel.relief, vec3f(0.10, 0.05, 0.04), through);
    let opacity = clamp(pixel.outer.a * frame.outer_opacity, 0.0, 1.0);
    let n_v = max(dot(pixel.relief, pixel.to_eye), 0.0);
    let color = mix(pixel.outer.rgb * outer_light, seen.radiance, (1.0 - opacity) * n_v) / PI;
    return shown(color + wet(pixel, unshadowed_after(through)), at);
}
