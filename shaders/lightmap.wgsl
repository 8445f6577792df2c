// Irradiance of the deformed surface, drawn into texture space: each triangle lies where its texture coordinates
// are.
//
//   clip = (2 u - 1, 1 - 2 v),  E = ambient + sum_l E_l wrapped(n.l),  a = 1
//
// The light is gathered at the vertices: what is between them is finer than the blur that follows. Alpha marks the
// texels that are covered; the blur carries it along, so that what lies outside a chart darkens nothing.
//
// Source:  Oat 2006, 4.5; Norberg 2010, 2.2.2.
// Twin:    src/optics/film.rs, fn wrapped
// Parity:  tests/shading_parity.rs, fn the_lit_side_is_bright_in_every_model
// Threads: one a vertex; one a covered texel.
// Units:   W/m2.
// Fails:   texture coordinates that overlap, which the importer unwraps anew; shadows finer than a triangle.

@group(0) @binding(1) var<storage, read> positions: array<vec4f>;
@group(0) @binding(2) var<storage, read> point_of: array<u32>;
@group(0) @binding(3) var<storage, read> uvs: array<vec2f>;
@group(0) @binding(4) var<storage, read> normals: array<vec4f>;
@group(0) @binding(5) var shadow_map: texture_depth_2d;

struct Varyings {
    @builtin(position) clip: vec4f,
    @location(0) light: vec3f,
}

@vertex
fn lightmap_vertex(@builtin(vertex_index) vertex: u32) -> Varyings {
    let point = point_of[vertex];
    let uv = uvs[vertex];
    let normal = normals[point].xyz;
    let world = positions[point].xyz;
    let through = way_through(world, normal);
    return Varyings(
        vec4f(2.0 * uv.x - 1.0, 1.0 - 2.0 * uv.y, 0.5, 1.0),
        diffuse(world, normal, frame.wrap * vec3f(1.0, 0.42, 0.30), through),
    );
}

@fragment
fn lightmap_fragment(in: Varyings) -> @location(0) vec4f {
    return vec4f(in.light, 1.0);
}
