// Irradiance of the deformed surface, drawn into texture space: each triangle lies where its texture
// coordinates are.
//
//   clip = (2 u - 1, 1 - 2 v),  E = sum_l E_l max(n.l, 0),  a = 1
//
// Alpha marks the texels that are covered; the blur carries it along, so that what lies outside a chart
// darkens nothing.
//
// Source:  Oat 2006, 4.5; Norberg 2010, 2.2.2.
// Twin:    src/optics/film.rs, fn wrapped
// Parity:  tests/replay.rs, fn the_light_map_is_bright_where_the_lamp_shines
// Threads: one a vertex; one a covered texel.
// Units:   W/m2.
// Fails:   texture coordinates that overlap, which the importer unwraps anew.

@vertex
fn lightmap_vertex(@builtin(vertex_index) vertex: u32) -> Varyings {
    let uv = uvs[vertex];
    return surface_vertex(vertex, vec4f(2.0 * uv.x - 1.0, 1.0 - 2.0 * uv.y, 0.5, 1.0));
}

@fragment
fn lightmap_fragment(in: Varyings) -> @location(0) vec4f {
    let normal = normalize(in.normal);
    let shadow = unshadowed(in.world, normal);
    var sum = vec3f(0.05, 0.055, 0.06);
    for (var k = 0u; k < frame.light_count; k += 1u) {
        let lit = light_at(frame.lights[k], in.world);
        let share = select(1.0, shadow, k == 0u);
        sum += share * lit.irradiance * wrapped(dot(normal, lit.to_light), 0.15);
    }
    return vec4f(sum, 1.0);
}
