// Tissue that absorbs the light that comes through it; wrapped light where it faces the lights; a wet film.
//
//   L = color / pi (ambient + sum_l E_l T_l (lookup(n.l).rgb + glow (1 - n.l) / 2)) + wet film
//
// T is what the tissue on the light's way leaves of it (body_light.wgsl); for what lies in the light it is 1.
//
// Source:  Green 2004, 16.2 and 16.3, listings 16-1 to 16-4.
// Twin:    src/optics/absorption.rs, fn tissue_before
// Parity:  tests/green_parity.rs, fn light_through_the_body_matches_the_cpu_twin
// Threads: one a covered pixel.
// Units:   W/(m2 sr).
// Fails:   as body_light.wgsl.

@fragment
fn fragment(@builtin(position) at: vec4f) -> @location(0) vec4f {
    let pixel = pixel_at(at);
    var light = ambient(pixel.relief);
    var open = 1.0;
    if LIGHT_COUNT > 0u {
        let got = passed(0u, pixel);
        light += got.share;
        open = select(1.0, got.open, HAS_SHADOW != 0u);
    }
    if LIGHT_COUNT > 1u {
        light += passed(1u, pixel).share;
    }
    if LIGHT_COUNT > 2u {
        light += passed(2u, pixel).share;
    }
    if LIGHT_COUNT > 3u {
        light += passed(3u, pixel).share;
    }
    return shown(color_of(pixel) * light / PI + wet(pixel, open), at);
}

fn passed(k: u32, pixel: Pixel) -> Passing {
    let lit = light_at(k, pixel.world);
    let through = let_through(k, pixel.world, pixel.normal, lit.to_light);
    let cosine = dot(pixel.relief, lit.to_light);
    let share = wrapped_light(cosine, 0.0).rgb + glow_of(dot(pixel.normal, lit.to_light));
    return Passing(lit.irradiance * through.share * share, through.open);
}
