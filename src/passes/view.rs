//! What the shaders know of a frame: camera, lights, layers and knobs, as one uniform.

use crate::scene::{LIGHTS_MAX, PlacedLight, RestBox, Scene, SurfaceSection};
use glam::{Mat4, Vec3};

/// A camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Where it is [m].
    pub eye: Vec3,
    /// What it looks at [m].
    pub target: Vec3,
    /// Vertical view angle [rad].
    pub fov_y: f32,
}

impl View {
    /// World to view space: x right, y up, the camera looks along −z.
    pub fn view_from_world(&self) -> Mat4 {
        let forward = (self.target - self.eye).normalize_or(Vec3::NEG_Z);
        let up = if forward.y.abs() > 0.999 {
            Vec3::Z
        } else {
            Vec3::Y
        };
        glam::camera::rh::view::look_at_mat4(self.eye, self.target, up)
    }

    /// View to clip space, depth 0 near to 1 far; near and far are shares of the distance.
    pub fn clip_from_view(&self, aspect: f32) -> Mat4 {
        let distance = self.eye.distance(self.target).max(1e-4);
        glam::camera::rh::proj::directx::perspective(
            self.fov_y,
            aspect,
            0.02 * distance,
            20.0 * distance,
        )
    }

    /// World to clip space.
    pub fn clip_from_world(&self, aspect: f32) -> Mat4 {
        self.clip_from_view(aspect) * self.view_from_world()
    }
}

/// World to the clip space of a far light in direction `toward`, fitted round `points` [m].
pub fn shadow_from_world(toward: Vec3, points: &[Vec3]) -> Mat4 {
    let up = if toward.y.abs() > 0.99 {
        Vec3::Z
    } else {
        Vec3::Y
    };
    let light_from_world = glam::camera::rh::view::look_at_mat4(Vec3::ZERO, -toward, up);
    let turned: Vec<Vec3> = points
        .iter()
        .map(|&p| light_from_world.transform_point3(p))
        .collect();
    let (low, high) = crate::geom::bounds(&turned);
    let margin = 0.02 * (high - low).max_element() + 1e-6;
    let clip_from_light = glam::camera::rh::proj::directx::orthographic(
        low.x - margin,
        high.x + margin,
        low.y - margin,
        high.y + margin,
        -(high.z + margin),
        -(low.z - margin),
    );
    clip_from_light * light_from_world
}

/// Mirror of `Light` in `shaders/shading.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct LightUniform {
    pub place: [f32; 4],
    pub power: [f32; 4],
}

/// Mirror of `Frame` in `shaders/shading.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct FrameUniform {
    pub clip_from_world: [f32; 16],
    pub shadow_from_world: [f32; 16],
    pub eye: [f32; 4],
    pub lights: [LightUniform; LIGHTS_MAX],
    pub extinction: [[f32; 4]; 4],
    pub scattering: [[f32; 4]; 4],
    pub light_count: u32,
    pub layer_depth_max_m: f32,
    pub color_blend: f32,
    pub multiple_scattering: f32,
    pub wrap: f32,
    pub layer_distance_m: f32,
    pub blur_radius_m: f32,
    pub outer_opacity: f32,
    pub relief: f32,
    pub roughness: f32,
    pub wetness: f32,
    pub exposure: f32,
    pub light_map_texel: f32,
    pub shadow_texel_m: f32,
    pub uv_per_m: f32,
    pub map_level: f32,
}

/// The lights of a scene, the one that casts shadows first.
pub fn placed_lights(scene: &Scene, rest: &RestBox) -> Vec<PlacedLight> {
    let mut lights: Vec<PlacedLight> = scene
        .lights
        .iter()
        .take(LIGHTS_MAX)
        .map(|light| light.placed(rest))
        .collect();
    lights.sort_by_key(|light| !light.shadow);
    lights
}

impl FrameUniform {
    /// Camera, lights and knobs of one frame of a picture of `size` [px] with maps of `map_size_px`.
    pub fn new(
        view: &View,
        size: [u32; 2],
        lights: &[PlacedLight],
        surface: &SurfaceSection,
        shadow_from_world: Mat4,
        uv_per_m: f32,
        map_size_px: u32,
    ) -> Self {
        let aspect = size[0] as f32 / size[1] as f32;
        let light = |k: usize| match lights.get(k) {
            None => LightUniform {
                place: [0.0; 4],
                power: [0.0; 4],
            },
            Some(light) => LightUniform {
                place: light
                    .place
                    .extend(if light.is_point { 1.0 } else { 0.0 })
                    .to_array(),
                power: light
                    .power
                    .extend(if light.shadow { 1.0 } else { 0.0 })
                    .to_array(),
            },
        };
        let extinction = surface.layers.map(|layer| {
            let [r, g, b] =
                std::array::from_fn(|c| layer.absorption_per_m[c] + layer.scattering_per_m[c]);
            [r, g, b, 0.0]
        });
        let scattering = surface.layers.map(|layer| {
            let [r, g, b] = layer.scattering_per_m;
            [r, g, b, layer.asymmetry]
        });
        // Length of the clip axes seen from the world: a shadow texel in metres.
        let shadow_width_m = 2.0 / shadow_from_world.row(0).truncate().length().max(1e-6);
        Self {
            clip_from_world: view.clip_from_world(aspect).to_cols_array(),
            shadow_from_world: shadow_from_world.to_cols_array(),
            eye: view.eye.extend(1.0).to_array(),
            lights: std::array::from_fn(light),
            extinction,
            scattering,
            light_count: lights.len().min(LIGHTS_MAX) as u32,
            layer_depth_max_m: surface.layer_depth_max_m,
            color_blend: surface.color_blend,
            multiple_scattering: surface.multiple_scattering,
            wrap: surface.wrap,
            layer_distance_m: surface.layer_distance_m,
            blur_radius_m: surface.blur_radius_m,
            outer_opacity: surface.outer_opacity,
            relief: surface.relief,
            roughness: surface.roughness,
            wetness: surface.wetness,
            exposure: surface.exposure,
            light_map_texel: 1.0 / surface.light_map_size_px as f32,
            shadow_texel_m: shadow_width_m / super::shadow::SIZE_PX as f32,
            uv_per_m,
            map_level: map_level(view, size[1], uv_per_m, map_size_px),
        }
    }
}

/// Level of maps of `map_size_px` at which a texel is about as large as a pixel of a picture that is
/// `height_px` high, at the distance of the view's target.
fn map_level(view: &View, height_px: u32, uv_per_m: f32, map_size_px: u32) -> f32 {
    let pixel_m =
        2.0 * view.eye.distance(view.target) * (0.5 * view.fov_y).tan() / height_px as f32;
    let texels = pixel_m * uv_per_m * map_size_px as f32;
    texels.max(1e-6).log2().round().clamp(0.0, 3.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn everything_lies_inside_the_shadow_map() {
        let points = [
            Vec3::new(-0.1, 0.0, 0.3),
            Vec3::new(0.2, 0.5, -0.1),
            Vec3::new(0.0, -0.2, 0.1),
        ];
        let clip_from_world = shadow_from_world(Vec3::new(0.3, 0.8, 0.5).normalize(), &points);
        for point in points {
            let clip = clip_from_world.project_point3(point);
            assert!(clip.x.abs() <= 1.0 && clip.y.abs() <= 1.0, "{clip}");
            assert!((0.0..=1.0).contains(&clip.z), "{clip}");
        }
    }

    #[test]
    fn what_is_nearer_to_the_light_has_the_smaller_depth() {
        let points = [Vec3::ZERO, Vec3::Y];
        let clip_from_world = shadow_from_world(Vec3::Y, &points);
        let depth = |p: Vec3| clip_from_world.project_point3(p).z;
        assert!(depth(Vec3::Y) < depth(Vec3::ZERO));
    }

    #[test]
    fn the_target_is_in_the_middle_of_the_picture() {
        let view = View {
            eye: Vec3::new(0.3, 0.4, 1.0),
            target: Vec3::new(0.1, 0.0, 0.0),
            fov_y: 0.5,
        };
        let clip = view.clip_from_world(4.0 / 3.0).project_point3(view.target);
        assert!(clip.x.abs() < 1e-5 && clip.y.abs() < 1e-5, "{clip}");
        assert!((0.0..1.0).contains(&clip.z), "{clip}");
    }
}
