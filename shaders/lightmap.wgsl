// Irradiance of the deformed surface, drawn into texture space: each triangle lies where its texture coordinates
// are. Beside it the metric there, and how thick layers are.
//
//   clip = (2 u - 1, 1 - 2 v),  E = (ambient + sum_l E_l wrapped(n.l)) (1 - layer_shadow opacity),  a = chart
//
// The light is gathered at the vertices: what is between them is finer than the blur that follows. It is the light that
// comes through the outer layer, so where that is opaque a scene may ask for less of it. Alpha holds the number of the chart,
// or 1 where no blur follows.
//
// Source:  Oat 2006, 4.5 and 4.7 (shadows between layers); Norberg 2010, 2.2.2.
// Twin:    src/optics/film.rs, fn wrapped
// Parity:  tests/oat.rs, fn opaque_places_of_the_outer_layer_shade_the_light_map
// Threads: one a vertex; one a covered texel.
// Units:   W/m2, 1/m.
// Fails:   texture coordinates that overlap, which the importer unwraps anew; shadows finer than a triangle.

@group(0) @binding(1) var<storage, read> positions: array<vec4f>;
@group(0) @binding(2) var<storage, read> point_of: array<u32>;
@group(0) @binding(3) var<storage, read> uvs: array<vec2f>;
@group(0) @binding(4) var<storage, read> normals: array<vec4f>;
@group(0) @binding(5) var shadow_map: texture_depth_2d;
@group(0) @binding(6) var<storage, read> uv_gradients: array<array<vec4f, 2>>;
// Number of a vertex's chart, from 1, and its metric at rest.
@group(0) @binding(7) var<storage, read> rest: array<vec4f>;
@group(0) @binding(8) var linear_sampler: sampler;
@group(0) @binding(9) var outer_map: texture_2d<f32>;

// 1: the papers' unit frames, in which the metric stays as it was at rest.
override UNIT_FRAMES: u32 = 0u;
// 1: layers thin where the surface stretches.
override FOLLOWS_VOLUME: u32 = 0u;
// 1: a blur follows, which asks for charts.
override BLURRED: u32 = 1u;
// 1: the outer layer's opacity takes light away.
override SHADES: u32 = 0u;

struct Varyings {
    @builtin(position) clip: vec4f,
    @location(0) light: vec3f,
    @location(1) metric: vec4f,
    @location(2) uv: vec2f,
    @location(3) @interpolate(flat) chart: f32,
}

// As `thickness_of` of shaders/geometry.wgsl: the area in texture space is a c.
fn thickness_of(now: vec3f, before: vec3f) -> f32 {
    let at_rest = before.x * before.z;
    let thickness = clamp(now.x * now.z / max(at_rest, 1e-12), 0.25, 4.0);
    return select(1.0, thickness, at_rest > 1e-12);
}

@vertex
fn lightmap_vertex(@builtin(vertex_index) vertex: u32) -> Varyings {
    let point = point_of[vertex];
    let uv = uvs[vertex];
    let normal = normals[point].xyz;
    let world = positions[point].xyz;
    let through = way_through(world, normal);
    let gradients = uv_gradients[vertex];
    var here = metric(gradients[0].xyz, gradients[1].xyz);
    var thickness = 1.0;
    if FOLLOWS_VOLUME != 0u {
        thickness = positions[point].w * thickness_of(here, rest[vertex].yzw);
    }
    if UNIT_FRAMES != 0u {
        here = rest[vertex].yzw;
    }
    return Varyings(
        vec4f(2.0 * uv.x - 1.0, 1.0 - 2.0 * uv.y, 0.5, 1.0),
        diffuse(world, normal, frame.wrap * vec3f(1.0, 0.42, 0.30), through),
        vec4f(here, thickness),
        uv,
        rest[vertex].x,
    );
}

struct Texel {
    @location(0) light: vec4f,
    @location(1) metric: vec4f,
}

@fragment
fn lightmap_fragment(in: Varyings) -> Texel {
    var light = in.light;
    if SHADES != 0u {
        let opacity = textureSampleLevel(outer_map, linear_sampler, in.uv, 0.0).a;
        light *= let_through(opacity * frame.outer_opacity, frame.layer_shadow);
    }
    return Texel(vec4f(light, select(1.0, in.chart, BLURRED != 0u)), in.metric);
}
