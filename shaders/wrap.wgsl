// Tissue under wrapped light from a table, with a shift of colour past the terminator; a wet film.
//
//   L = color / pi (ambient + sum_l E_l lookup(n.l, n.h).rgb) + sum_l E_l lookup(n.l, n.h).a + mirrored room
//
// What lies in a shadow gets what the body lets through, as the other surfaces have it.
//
// Source:  Green 2004, 16.2, listing 16-1.
// Twin:    src/optics/wrap_lookup.rs, fn table
// Parity:  tests/green_parity.rs, fn wrapped_light_matches_the_cpu_twin
// Threads: one a covered pixel.
// Units:   W/(m2 sr).
// Fails:   shadows end as sharply as their map has them.

@fragment
fn fragment(@builtin(position) at: vec4f) -> @location(0) vec4f {
    let pixel = pixel_at(at);
    let through = way_through(pixel.world, pixel.normal);
    var light = vec4f(ambient(pixel.relief), 0.0);
    if LIGHT_COUNT > 0u {
        let shade = exp(-0.5 * through * frame.through.xyz);
        light += vec4f(shade, unshadowed_after(through)) * lit_by(0u, pixel);
    }
    if LIGHT_COUNT > 1u {
        light += lit_by(1u, pixel);
    }
    if LIGHT_COUNT > 2u {
        light += lit_by(2u, pixel);
    }
    if LIGHT_COUNT > 3u {
        light += lit_by(3u, pixel);
    }
    // A highlight of the film has no colour of its own; that of the light is nearly white.
    return shown(color_of(pixel) * light.rgb / PI + frame.wetness * light.a + mirrored(pixel), at);
}

fn lit_by(k: u32, pixel: Pixel) -> vec4f {
    let lit = light_at(k, pixel.world);
    let half_way = normalize(lit.to_light + pixel.to_eye);
    let light = wrapped_light(dot(pixel.relief, lit.to_light), dot(pixel.relief, half_way));
    let white = dot(lit.irradiance, vec3f(1.0 / 3.0));
    return vec4f(lit.irradiance, white) * light;
}
