// A body that lets no light through, for the light map of the diffusion.

fn light_behind(k: u32, world: vec3f, normal: vec3f) -> vec3f {
    return vec3f(0.0);
}
