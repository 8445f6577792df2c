// Tissue in which light wanders: the light map, blurred by as much; what wanders less than its texels can tell is lit
// at the pixel; a wet film.
//
//   L = color / pi (w E + (1 - w) blurred E) + wet film,   w = sum over the Gaussians of w_i 2^-(sigma_i / 0.4 texels)^2
//
// Of the colour, a power lies in the light map already where the scene asks so.
//
// Source:  Green 2004, 16.4; d'Eon and Luebke 2007 (part of the colour before, part after the blur).
// Twin:    src/optics/diffusion.rs, fn diffused
// Parity:  tests/green_parity.rs, fn diffusion_matches_the_cpu_twin
// Threads: one a covered pixel.
// Units:   W/(m2 sr).
// Fails:   parts of the texture map thinner than a texel have no blurred light, and are lit at the pixel alone.

@fragment
fn fragment(@builtin(position) at: vec4f) -> @location(0) vec4f {
    let pixel = pixel_at(at);
    let unshadowed = unshadowed_after(way_through(pixel.world, pixel.normal));
    let color = color_of(pixel);
    let blurred = textureSampleLevel(light_map, linear_sampler, pixel.uv, 0.0);
    let has_map = blurred.a > 0.02;
    let soft = blurred.rgb / max(blurred.a, 0.02) * pow(max(color, vec3f(1e-4)), vec3f(1.0 - green.color_in_map));
    let core = select(vec3f(1.0), green.core.xyz, has_map);
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
    return shown(sum / PI + wet(pixel, unshadowed), at);
}

fn lambert(k: u32, pixel: Pixel) -> vec3f {
    let lit = light_at(k, pixel.world);
    return max(dot(pixel.relief, lit.to_light), 0.0) * lit.irradiance;
}
