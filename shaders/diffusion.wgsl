// Tissue in which light wanders: the light map, blurred by as much, and the narrowest Gaussian lit at the pixel; a wet
// film.
//
//   L = color / pi (w_1 E + (1 - w_1) blurred E) + wet film
//
// Of the colour, a power lies in the light map already where the scene asks so.
//
// Source:  Green 2004, 16.4; d'Eon and Luebke 2007 (part of the colour before, part after the blur).
// Twin:    src/optics/diffusion.rs, fn diffused
// Parity:  tests/green_parity.rs, fn diffusion_matches_the_cpu_twin
// Threads: one a covered pixel.
// Units:   W/(m2 sr).
// Fails:   parts of the texture map thinner than a texel have no blurred light, and are lit at the pixel alone.

// 1: the narrowest Gaussian is lit at the pixel.
override PIXEL_CORE: u32 = 1u;

@fragment
fn fragment(@builtin(position) at: vec4f) -> @location(0) vec4f {
    let pixel = pixel_at(at);
    let unshadowed = unshadowed_after(way_through(pixel.world, pixel.normal));
    let color = color_of(pixel);
    let blurred = textureSampleLevel(light_map, linear_sampler, pixel.uv, 0.0);
    let has_map = blurred.a > 0.02;
    let soft = blurred.rgb / max(blurred.a, 0.02) * pow(max(color, vec3f(1e-4)), vec3f(1.0 - green.color_in_map));
    let core = select(vec3f(1.0), green.core.xyz, has_map);
    if PIXEL_CORE == 0u && has_map {
        return vec4f(soft / PI + wet(pixel, unshadowed), 1.0);
    }
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
    let sum = core * light * color + (1.0 - core) * soft;
    return vec4f(sum / PI + wet(pixel, unshadowed), 1.0);
}

fn lambert(k: u32, pixel: Pixel) -> vec3f {
    let lit = light_at(k, pixel.world);
    return max(dot(pixel.relief, lit.to_light), 0.0) * lit.irradiance;
}
