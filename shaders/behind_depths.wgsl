// Light that comes through the body, for the light map of the diffusion: what depth maps and blur each lack the other
// has. Follows body_light.wgsl.
//
//   E_l T_l glow (1 - n.l) / 2, divided by the share of the blurred Gaussians: it is not lit at the pixel
//
// Source:  Green 2004, 16.3, and 16.4.1 ("combining the depth-map and texture-space techniques").
// Units:   W/m2.

fn light_behind(k: u32, world: vec3f, normal: vec3f) -> vec3f {
    let lit = light_at(k, world);
    let through = let_through(k, world, normal, lit.to_light);
    let share = green.translucency / (1.0 - min(green.core.xyz, vec3f(0.9)));
    return share * lit.irradiance * through.share * glow_of(dot(normal, lit.to_light));
}
