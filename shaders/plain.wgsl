// Lit tissue without scattering: diffuse light and a wet film.
//
//   L = outer / pi  sum_l E_l max(n.l, 0) + wet film
//
// Source:  Lambert; the film of shaders/film.wgsl.
// Twin:    src/optics/film.rs, fn wrapped
// Parity:  tests/shading_parity.rs, fn film_matches_the_cpu_twin
// Threads: one a covered pixel.
// Units:   W/(m2 sr).
// Fails:   nothing of its own.

@fragment
fn fragment(@builtin(position) at: vec4f) -> @location(0) vec4f {
    let pixel = pixel_at(at);
    let unshadowed = unshadowed_after(way_through(pixel.world, pixel.normal));
    var light = ambient(pixel.relief);
    if LIGHT_COUNT > 0u {
        light += unshadowed * lambert(0u, pixel);
    }
    if LIGHT_COUNT > 1u {
        light += lambert(1u, pixel);
    }
    if LIGHT_COUNT > 2u {
        light += lambert(2u, pixel);
    }
    if LIGHT_COUNT > 3u {
        light += lambert(3u, pixel);
    }
    return shown(pixel.outer.rgb * light / PI + wet(pixel, unshadowed), at);
}

fn lambert(k: u32, pixel: Pixel) -> vec3f {
    let lit = light_at(k, pixel.world);
    return max(dot(pixel.relief, lit.to_light), 0.0) * lit.irradiance;
}
