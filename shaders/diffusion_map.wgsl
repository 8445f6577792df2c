// Irradiance of the deformed surface in texture space, the chart that a texel belongs to, and the metric there.
//
//   clip = (2 u - 1, 1 - 2 v),  E = ambient + sum_l E_l max(n.l, 0) shadow + light through the body
//   L L^T = [g_u.g_u  g_u.g_v; g_u.g_v  g_v.g_v]      L = [a 0; b c]: a metre on the surface along (a, b) or (0, c)
//
// A round blur of 1 m^2 on the surface has L L^T as its covariance in texture space, so two blurs along the columns of
// L make it, however the tissue is stretched or the texture map sheared.
//
// Source:  Green 2004, 16.4, listing 16-5 (light in texture space; his colour map and shadows in it); the metric
//          is that of shaders/tangents.wgsl, do Carmo (1976), 2.5.
// Twin:    src/optics/diffusion.rs, fn metric
// Parity:  tests/green_parity.rs, fn the_metric_of_the_light_map_is_that_of_the_stretched_surface
// Threads: one a vertex; one a covered texel.
// Units:   W/m2, 1/m.
// Fails:   texture coordinates that overlap, which the importer unwraps anew.

@group(0) @binding(1) var<storage, read> positions: array<vec4f>;
@group(0) @binding(2) var<storage, read> point_of: array<u32>;
@group(0) @binding(3) var<storage, read> uvs: array<vec2f>;
@group(0) @binding(4) var linear_sampler: sampler;
@group(0) @binding(5) var<storage, read> normals: array<vec4f>;
@group(0) @binding(6) var<storage, read> uv_gradients: array<array<vec4f, 2>>;
@group(0) @binding(7) var outer_map: texture_2d<f32>;
@group(0) @binding(8) var inner_map: texture_2d<f32>;
// Number of a vertex's chart, from 1, and its metric at rest.
@group(0) @binding(9) var<storage, read> rest: array<vec4f>;
@group(0) @binding(10) var shadow_map: texture_depth_2d;

// 1: the papers' unit frames, in which the metric stays as it was at rest.
override UNIT_FRAMES: u32 = 0u;
// 1: a power of the colour map is blurred along with the light.
override COLORED: u32 = 0u;

struct Varyings {
    @builtin(position) clip: vec4f,
    @location(0) world: vec3f,
    @location(1) normal: vec3f,
    @location(2) uv: vec2f,
    @location(3) metric: vec3f,
    @location(4) @interpolate(flat) chart: f32,
}

@vertex
fn diffusion_map_vertex(@builtin(vertex_index) vertex: u32) -> Varyings {
    let point = point_of[vertex];
    let uv = uvs[vertex];
    let gradients = uv_gradients[vertex];
    var here = metric(gradients[0].xyz, gradients[1].xyz);
    if UNIT_FRAMES != 0u {
        here = rest[vertex].yzw;
    }
    return Varyings(
        vec4f(2.0 * uv.x - 1.0, 1.0 - 2.0 * uv.y, 0.5, 1.0),
        positions[point].xyz,
        normals[point].xyz,
        uv,
        here,
        rest[vertex].x,
    );
}

struct Texel {
    @location(0) light: vec4f,
    @location(1) metric: vec4f,
}

fn linear_color(map: texture_2d<f32>, uv: vec2f) -> vec4f {
    let texel = textureSampleLevel(map, linear_sampler, uv, 0.0);
    return vec4f(texel.rgb * texel.rgb, texel.a);
}

fn lambert(k: u32, world: vec3f, normal: vec3f) -> vec3f {
    let lit = light_at(k, world);
    return max(dot(normal, lit.to_light), 0.0) * lit.irradiance;
}

@fragment
fn diffusion_map_fragment(in: Varyings) -> Texel {
    let normal = normalize(in.normal);
    var light = ambient(normal);
    if LIGHT_COUNT > 0u {
        let unshadowed = unshadowed_after(way_through(in.world, normal));
        light += unshadowed * lambert(0u, in.world, normal) + light_behind(0u, in.world, normal);
    }
    if LIGHT_COUNT > 1u {
        light += lambert(1u, in.world, normal) + light_behind(1u, in.world, normal);
    }
    if LIGHT_COUNT > 2u {
        light += lambert(2u, in.world, normal) + light_behind(2u, in.world, normal);
    }
    if LIGHT_COUNT > 3u {
        light += lambert(3u, in.world, normal) + light_behind(3u, in.world, normal);
    }
    if COLORED != 0u {
        let outer = linear_color(outer_map, in.uv);
        let color = mix(linear_color(inner_map, in.uv).rgb, outer.rgb, outer.a);
        light *= pow(max(color, vec3f(1e-4)), vec3f(green.color_in_map));
    }
    return Texel(vec4f(light, in.chart), vec4f(in.metric, 0.0));
}
