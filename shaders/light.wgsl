// Light that enters the tissue: straight, round the terminator, and through thin parts. Reads `shadow_map`, which
// the file before it declares.
//
//   E = ambient + sum_l E_l wrapped(n.l),  light 0 times exp(-sigma_eff s / 2), s its way through the body
//
// The shadow map holds where light 0 enters the body, so one reading gives the hard shadow of the film and the
// light that thin parts let through: the same depth, attenuated by each colour's own length. Diffuse light takes
// the shortest way: past the terminator of a round limb that is half of the straight one.
//
// Source:  Williams, "Casting Curved Shadows on Curved Surfaces", SIGGRAPH 1978; Green 2004, 16.2 and 16.3.
// Twin:    src/optics/film.rs, fn wrapped
// Parity:  tests/shading_parity.rs, fn film_matches_the_cpu_twin
// Threads: none of its own.
// Units:   W/m2, metres.
// Fails:   air between two parts counts as tissue; details finer than a texel.

// How far light 0 has come through the body to reach `world` [m]; 0 where it is lit.
fn way_through(world: vec3f, normal: vec3f) -> f32 {
    if HAS_SHADOW == 0u {
        return 0.0;
    }
    let off = world + frame.shadow_bias_m * normal;
    let clip = frame.shadow_from_world * vec4f(off, 1.0);
    // The map is square; those of other lights may stand to the right of it.
    let size = vec2f(f32(textureDimensions(shadow_map).y));
    let at = (clip.xy * vec2f(0.5, -0.5) + 0.5) * size - 0.5;
    let low = floor(at);
    let share = at - low;
    let i = vec2i(low);
    let last = vec2i(size) - 1;
    let a = clamp(i, vec2i(0), last);
    let b = clamp(i + 1, vec2i(0), last);
    let entries = vec4f(
        textureLoad(shadow_map, a, 0),
        textureLoad(shadow_map, vec2i(b.x, a.y), 0),
        textureLoad(shadow_map, vec2i(a.x, b.y), 0),
        textureLoad(shadow_map, b, 0),
    );
    let behind = max(vec4f(clip.z) - entries, vec4f(0.0));
    let rows = mix(behind.xz, behind.yw, share.x);
    return max(mix(rows.x, rows.y, share.y) * frame.shadow_depth_m - frame.shadow_bias_m, 0.0);
}

// Light of the room from everywhere, brighter from above [W/m2].
fn ambient(normal: vec3f) -> vec3f {
    return frame.room_light * (1.0 + 0.7 * normal.y) * vec3f(0.150, 0.165, 0.175);
}

// Light that leaves the tissue after many scatterings, per colour [W/m2]: wrapped round the terminator, and
// for light 0 let through thin parts.
fn diffuse_of(k: u32, x: vec3f, soft: vec3f, wrap: vec3f, through: f32) -> vec3f {
    let lit = light_at(k, x);
    let cosine = dot(soft, lit.to_light);
    var share = wrapped(cosine, wrap);
    if k == 0u && HAS_SHADOW != 0u {
        share = max(share, 0.2 * wrap) * exp(-0.5 * through * frame.through.xyz);
    }
    return share * lit.irradiance;
}

fn diffuse(x: vec3f, soft: vec3f, wrap: vec3f, through: f32) -> vec3f {
    var sum = ambient(soft);
    if LIGHT_COUNT > 0u {
        sum += diffuse_of(0u, x, soft, wrap, through);
    }
    if LIGHT_COUNT > 1u {
        sum += diffuse_of(1u, x, soft, wrap, through);
    }
    if LIGHT_COUNT > 2u {
        sum += diffuse_of(2u, x, soft, wrap, through);
    }
    if LIGHT_COUNT > 3u {
        sum += diffuse_of(3u, x, soft, wrap, through);
    }
    return sum;
}

// Share of light 0 that reaches the surface itself.
fn unshadowed_after(through: f32) -> f32 {
    return clamp(1.0 - through / (3.0 * frame.shadow_bias_m + 1e-9), 0.0, 1.0);
}
