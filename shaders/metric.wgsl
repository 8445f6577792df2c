// The metric of a texture map on a surface, as the lower triangle that blurs in texture space go along. No bindings.
//
//   L L^T = [g_u.g_u  g_u.g_v; g_u.g_v  g_v.g_v]      L = [a 0; b c]: a metre on the surface along (a, b) or (0, c)
//
// Source:  do Carmo, "Differential Geometry of Curves and Surfaces" (1976), 2.5.
// Twin:    src/optics/diffusion.rs, fn metric
// Parity:  tests/green_parity.rs, fn the_metric_of_the_light_map_is_that_of_the_stretched_surface
// Threads: none of its own.
// Units:   1/m.
// Fails:   nothing of its own: a surface without texture coordinates has a metric of zeros.

fn metric(gradient_u: vec3f, gradient_v: vec3f) -> vec3f {
    let a = length(gradient_u);
    let b = dot(gradient_u, gradient_v) / max(a, 1e-20);
    let c = sqrt(max(dot(gradient_v, gradient_v) - b * b, 0.0));
    return vec3f(a, b, c);
}
