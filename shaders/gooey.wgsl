// Two layers: an outer one lit as it lies, an inner one seen through it, shifted by parallax and lit by a
// blurred light map.
//
//   R = reflect(-V, n), T = (R.xy, -R.z)                          in the tangent frame of the surface
//   s = d / |T.z|,  PM = s T,  (ds, dt) = (PM . g_u, PM . g_v)     Oat listing 1, Norberg eqs. 15-18
//   L = lerp(outer, inner, (1 - opacity) N.V)                       Oat listing 3
//
// The layers' distance d and the blur are metres on the deformed surface, where the sources have texels: what
// stretches keeps its depth. Oat's listing takes alpha for transparency and his text for opacity; here alpha is
// opacity.
//
// Source:  Oat 2006, 4.4 to 4.6; Norberg 2010, 2.2.
// Twin:    src/optics/layers.rs, fn transmission
// Parity:  tests/shading_parity.rs, fn parallax_matches_the_cpu_twin
// Threads: one a covered pixel.
// Units:   metres; texture coordinates in shares of the unit square.
// Fails:   grazing views: the transmission is cut at 4 d, and N.V prefers the outer layer there.

@fragment
fn fragment(@builtin(position) at: vec4f) -> @location(0) vec4f {
    let pixel = pixel_at(at);
    let detail = textureLoad(detail_map, vec2i(at.xy), 0);
    let gradients = gradients_of(detail);
    let distance_m = thickness_of(detail) * frame.layer_distance_m;
    let shift = transmission(pixel.to_eye, pixel.relief, pixel.normal, distance_m);
    let across = vec2f(dot(shift.xyz, pixel.tangent), dot(shift.xyz, pixel.bitangent));
    let uv = pixel.uv + vec2f(dot(gradients.u, across), dot(gradients.v, across));

    // The inner albedo blurs with the way through the outer layer: three taps about the place, none at it.
    let spread = 0.35 * shift.w * vec2f(length(gradients.u), length(gradients.v));
    let inner = (color_at(inner_map, uv + spread * vec2f(0.87, 0.5)).rgb
        + color_at(inner_map, uv + spread * vec2f(-0.87, 0.5)).rgb
        + color_at(inner_map, uv - spread * vec2f(0.0, 1.0)).rgb) / 3.0;
    let blurred = textureSampleLevel(light_map, linear_sampler, uv, 0.0);
    let inner_light = blurred.rgb / max(blurred.a, 1e-3);

    let through = way_through(pixel.world, pixel.normal);
    let outer_light = diffuse(pixel.world, pixel.relief, vec3f(0.10, 0.05, 0.04), through);
    let opacity = clamp(pixel.outer.a * frame.outer_opacity, 0.0, 1.0);
    let n_v = max(dot(pixel.relief, pixel.to_eye), 0.0);
    let color = mix(pixel.outer.rgb * outer_light, inner * inner_light, (1.0 - opacity) * n_v) / PI;
    return vec4f(color + wet(pixel, unshadowed_after(through)), 1.0);
}
