// Lit tissue without scattering: wrapped diffuse light and a wet film.
//
//   L = outer / pi  sum_l E_l wrapped(n.l) + wet film
//
// Source:  Lambert; Green 2004, 16.2.
// Twin:    src/optics/film.rs, fn wrapped
// Parity:  tests/shading_parity.rs, fn film_matches_the_cpu_twin
// Threads: one a covered pixel.
// Units:   W/(m2 sr).
// Fails:   nothing of its own.

@fragment
fn fragment(in: Varyings) -> @location(0) vec4f {
    let at = place(in);
    let shadow = unshadowed(in.world, at.normal);
    var diffuse = vec3f(0.06);
    for (var k = 0u; k < frame.light_count; k += 1u) {
        let lit = light_at(frame.lights[k], in.world);
        let share = select(1.0, shadow, k == 0u);
        diffuse += share * lit.irradiance * wrapped(dot(at.detail, lit.to_light), 0.0);
    }
    return vec4f(at.outer.rgb * diffuse / PI + wet(in, at, shadow), 1.0);
}
