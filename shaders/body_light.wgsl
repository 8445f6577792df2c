// Light that comes through the body: tissue on its way by depth maps, looked at on a disc, and how it dies away.
// Follows frame.wgsl and green.wgsl; reads `linear_sampler`, which a file before it declares. The maps hold a
// square for each light, side by side.
//
//   s_i = max(0, tissue before (z + lean o_i) at o_i - bias),   T = mean of exp(-sigma s_i), or of ramp(s_i)
//   tissue = z - z_entry,   or min(z, z_exit) - z_entry + max(0, z - z_second) with two depth layers
//
// Each look is held against the tangent plane of the place, so that a slope in full light does not shadow itself. A
// look past the rim of the body meets nothing and is left out.
//
// Source:  Green 2004, 16.3 (one look, exp or colour ramp; "multiple samples"), 16.4.1 (further layers; here
//          the first exit and the second entry). The lean of the looks is ours.
// Twin:    src/optics/absorption.rs, fn tissue_before
// Parity:  tests/green_parity.rs, fn light_through_the_body_matches_the_cpu_twin
// Threads: none of its own.
// Units:   metres, 1/m.
// Fails:   behind a third part the air before it counts as tissue; details finer than a texel.

@group(0) @binding(13) var entry_map: texture_depth_2d;
@group(0) @binding(14) var exit_map: texture_depth_2d;
@group(0) @binding(15) var second_map: texture_depth_2d;
@group(0) @binding(16) var ramp_map: texture_2d<f32>;

override LOOKS: u32 = 1u;
override DEPTH_LAYERS: u32 = 1u;
// 0 exp, 1 ramp.
override FALLOFF: u32 = 0u;

const RAMP_LENGTH: f32 = 256.0;

// What is left of light `k` at a place, and how much of it comes straight.
struct Passing {
    share: vec3f,
    open: f32,
}

fn lean(cosine: f32) -> f32 {
    return max(cosine, 0.0) / max(cosine * cosine, 0.1);
}

fn tissue_before(at: f32, entry: f32, exit: f32, second: f32) -> f32 {
    if DEPTH_LAYERS == 1u {
        return at - entry;
    }
    return min(at, exit) - entry + max(at - second, 0.0);
}

fn left_after(s: f32) -> vec3f {
    if FALLOFF == 0u {
        return exp(-s * green.attenuation.xyz);
    }
    let column = (clamp(s * green.ramp_per_m, 0.0, 1.0) * (RAMP_LENGTH - 1.0) + 0.5) / RAMP_LENGTH;
    return textureSampleLevel(ramp_map, linear_sampler, vec2f(column, 0.5), 0.0).rgb;
}

fn is_near(k: u32) -> bool {
    return (POINT_LIGHTS & (1u << k)) != 0u;
}

// Distance from the light's near end, or from a near light itself, of a depth in its map [m].
fn span_at(k: u32, depth: f32) -> f32 {
    let span = green.spans[k];
    if is_near(k) {
        return span.x * span.y / (span.y - depth * (span.y - span.x));
    }
    return depth * span.x;
}

// A place as a light sees it.
struct Seen {
    // Where in its square of the map [texels], and texels a metre there.
    at: vec2f,
    texels_per_m: vec2f,
    // Distance as `span_at` has it [m], and metres of the light's way for each.
    span_m: f32,
    along: f32,
    // How much farther the tangent plane is for each metre that a look lies to the right and down.
    slope: vec2f,
}

fn seen_by(k: u32, world: vec3f, normal: vec3f, to_light: vec3f) -> Seen {
    let m = green.clip_from_world[k];
    let clip = m * vec4f(world, 1.0);
    let ndc = clip.xyz / clip.w;
    let at = (ndc.xy * vec2f(0.5, -0.5) + 0.5) * f32(textureDimensions(entry_map).y);
    let right = normalize(vec3f(m[0].x, m[1].x, m[2].x));
    let up = normalize(vec3f(m[0].y, m[1].y, m[2].y));
    let slope = lean(dot(normal, to_light)) * vec2f(dot(normal, right), -dot(normal, up));
    let span = green.spans[k];
    if is_near(k) {
        let way = distance(world, frame.lights[k].place.xyz);
        return Seen(at, vec2f(span.z / clip.w), clip.w, way / clip.w, slope);
    }
    return Seen(at, span.yz, ndc.z * span.x, 1.0, slope);
}

// Tissue before the place on the way through a texel [m], less what rounding makes of none; -1 for an empty texel.
fn way_through_texel(k: u32, seen: Seen, texel: vec2i) -> f32 {
    let size = i32(textureDimensions(entry_map).y);
    if any(texel < vec2i(0)) || any(texel >= vec2i(size)) {
        return -1.0;
    }
    let tile = vec2i(texel.x + i32(k) * size, texel.y);
    let entry = textureLoad(entry_map, tile, 0);
    if entry >= 1.0 {
        return -1.0;
    }
    let aside = (vec2f(texel) + 0.5 - seen.at) / seen.texels_per_m;
    let at = seen.span_m + dot(seen.slope, aside);
    var exit = 1.0;
    var second = 1.0;
    if DEPTH_LAYERS == 2u {
        exit = textureLoad(exit_map, tile, 0);
        second = textureLoad(second_map, tile, 0);
    }
    let tissue = tissue_before(at, span_at(k, entry), span_at(k, exit), span_at(k, second));
    return max(tissue * seen.along - green.spans[k].w, 0.0);
}

fn let_through(k: u32, world: vec3f, normal: vec3f, to_light: vec3f) -> Passing {
    let seen = seen_by(k, world, normal, to_light);
    var sum = vec4f(0.0);
    var weight = 0.0;
    if LOOKS == 1u {
        let low = floor(seen.at - 0.5);
        let share = seen.at - 0.5 - low;
        for (var i = 0u; i < 4u; i += 1u) {
            let corner = vec2f(f32(i & 1u), f32(i >> 1u));
            let w = (1.0 - abs(corner.x - share.x)) * (1.0 - abs(corner.y - share.y));
            sum += weighed(k, way_through_texel(k, seen, vec2i(low + corner)), w, &weight);
        }
    } else {
        let radius = green.disc_radius_m * seen.texels_per_m;
        for (var i = 0u; i < LOOKS; i += 1u) {
            let two = green.disc[i >> 1u];
            let look = select(two.xy, two.zw, (i & 1u) == 1u);
            sum += weighed(k, way_through_texel(k, seen, vec2i(floor(seen.at + radius * look))), 1.0, &weight);
        }
    }
    if weight < 1e-4 {
        return Passing(vec3f(1.0), 1.0);
    }
    let mean = sum / weight;
    return Passing(mean.rgb, mean.a);
}

// What a way of `s` lets through, and whether any of it was tissue, times its weight, which is counted.
fn weighed(k: u32, s: f32, w: f32, weight: ptr<function, f32>) -> vec4f {
    if s < 0.0 {
        return vec4f(0.0);
    }
    *weight += w;
    return w * vec4f(left_after(s), clamp(1.0 - s / (green.spans[k].w + 1e-9), 0.0, 1.0));
}

// Light that comes through from behind, for what faces away from it.
fn glow_of(cosine: f32) -> f32 {
    return green.glow * (0.5 - 0.5 * cosine);
}
