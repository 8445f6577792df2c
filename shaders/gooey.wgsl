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
fn fragment(in: Varyings) -> @location(0) vec4f {
    let at = place(in);
    let shift = transmission(at.to_eye, at.detail, at.normal, frame.layer_distance_m);
    let offset = vec2f(dot(shift.xyz, in.gradient_u), dot(shift.xyz, in.gradient_v));
    let uv = in.uv + offset;

    // The inner albedo blurs with the way through the outer layer.
    let spread = 0.35 * shift.w * vec2f(length(in.gradient_u), length(in.gradient_v));
    var inner = color_at(inner_map, uv + spread * vec2f(0.87, 0.5)).rgb;
    inner += color_at(inner_map, uv + spread * vec2f(-0.87, 0.5)).rgb;
    inner += color_at(inner_map, uv - spread * vec2f(0.0, 1.0)).rgb;
    inner /= 3.0;

    let blurred = textureSampleLevel(light_map, linear_sampler, uv, 0.0);
    let inner_light = blurred.rgb / max(blurred.a, 1e-3);

    let shadow = unshadowed(in.world, at.normal);
    var outer_light = vec3f(0.05, 0.055, 0.06);
    for (var k = 0u; k < frame.light_count; k += 1u) {
        let lit = light_at(frame.lights[k], in.world);
        let share = select(1.0, shadow, k == 0u);
        outer_light += share * lit.irradiance * wrapped(dot(at.detail, lit.to_light), 0.0);
    }
    let opacity = clamp(at.outer.a * frame.outer_opacity, 0.0, 1.0);
    let through = (1.0 - opacity) * max(dot(at.detail, at.to_eye), 0.0);
    let color = mix(at.outer.rgb * outer_light, inner * inner_light, through) / PI;
    return vec4f(color + wet(in, at, shadow), 1.0);
}
