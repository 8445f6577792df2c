//! What the shaders know of a frame: camera, lights, layers and knobs, as one uniform.

use super::maps::level_for;
use crate::optics::LAYERS_MAX;
use crate::optics::multiple::{Leak, reflectance};
use crate::scene::{
    INNER_MAX, InnerSection, LIGHTS_MAX, PlacedLight, RestBox, Scene, SurfaceSection,
};
use glam::{Mat4, Vec2, Vec3};

/// The march ends where the clearest layer has left exp(-8) of the light.
const OPTICAL_DEPTH_MAX: f32 = 8.0;

/// A camera.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct View {
    /// Where it is [m].
    pub eye: Vec3,
    /// What it looks at [m].
    pub target: Vec3,
    /// What is upwards in the picture.
    pub up: Vec3,
    /// Vertical view angle [rad].
    pub fov_y: f32,
}

impl View {
    /// World to view space: x right, y up, the camera looks along −z.
    pub fn view_from_world(&self) -> Mat4 {
        let forward = (self.target - self.eye).normalize_or(Vec3::NEG_Z);
        let up = self.up.normalize_or(Vec3::Y);
        let up = if forward.dot(up).abs() > 0.999 {
            forward.any_orthonormal_vector()
        } else {
            up
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

    /// What lies behind the middle of each pixel of a picture of that width and height [px]: a place on the line from the
    /// eye through it [m], row by row from the top.
    pub fn behind_pixels(&self, [width, height]: [u32; 2]) -> Vec<Vec3> {
        let world_from_clip = self.clip_from_world(width as f32 / height as f32).inverse();
        (0..width * height)
            .map(|i| {
                let at = Vec2::new((i % width) as f32, (i / width) as f32) + 0.5;
                let ndc = at / Vec2::new(width as f32, height as f32) * 2.0 - 1.0;
                world_from_clip.project_point3(Vec3::new(ndc.x, -ndc.y, 0.5))
            })
            .collect()
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

/// World to the clip space of `light`, fitted round `points` [m].
///
/// A near light looks at the middle of the body; what lies beyond 75 degrees from there is not in its map.
pub fn light_from_world(light: &PlacedLight, points: &[Vec3]) -> Mat4 {
    if !light.is_point {
        return shadow_from_world(light.place, points);
    }
    let (low, high) = crate::geom::bounds(points);
    let middle = 0.5 * (low + high);
    let radius = 0.5 * (high - low).length() + 1e-6;
    let distance = light.place.distance(middle);
    let forward = (middle - light.place).normalize_or(Vec3::NEG_Z);
    let half_angle = (1.02 * radius / distance.max(1e-6)).min(1.0).asin();
    let clip_from_light = glam::camera::rh::proj::directx::perspective(
        2.0 * half_angle.min(75_f32.to_radians()),
        1.0,
        (distance - 1.02 * radius).max(0.01 * radius),
        distance + 1.02 * radius,
    );
    let up = forward.any_orthonormal_vector();
    clip_from_light * glam::camera::rh::view::look_at_mat4(light.place, middle, up)
}

/// Mirror of `Light` in `shaders/frame.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct LightUniform {
    pub place: [f32; 4],
    pub power: [f32; 4],
}

/// Mirror of `Frame` in `shaders/frame.wgsl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, bytemuck::Pod, bytemuck::Zeroable)]
pub struct FrameUniform {
    pub clip_from_world: [f32; 16],
    pub world_from_clip: [f32; 16],
    pub shadow_from_world: [f32; 16],
    pub eye: [f32; 4],
    pub lights: [LightUniform; LIGHTS_MAX],
    pub extinction: [[f32; 4]; LAYERS_MAX],
    pub albedo: [[f32; 4]; LAYERS_MAX],
    pub reflectance: [[f32; 4]; LAYERS_MAX],
    pub kept: [f32; 4],
    pub around: [f32; 4],
    pub leaked: [f32; 4],
    pub through: [f32; 4],
    pub size: [f32; 4],
    pub inner: [[f32; 4]; INNER_MAX],
    pub inner_distances: [f32; INNER_MAX],
    pub layer_depth_max_m: f32,
    pub reach_m: f32,
    pub color_blend: f32,
    pub multiple_scattering: f32,
    pub wrap: f32,
    pub layer_distance_m: f32,
    pub outer_opacity: f32,
    pub relief: f32,
    pub roughness: f32,
    pub wetness: f32,
    pub shadow_depth_m: f32,
    pub shadow_bias_m: f32,
    pub inner_blur: f32,
    pub layer_shadow: f32,
    pub blur_radius_m: f32,
    pub noise_m: f32,
    pub noise_lookups: u32,
    pub exposure: f32,
    pub room_light: f32,
    pub pad0: f32,
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

/// What is constant in the shaders of a scene: values of their `override`s.
pub fn light_constants(lights: &[PlacedLight]) -> Vec<(&'static str, f64)> {
    let points = lights
        .iter()
        .enumerate()
        .filter(|(_, light)| light.is_point)
        .fold(0u32, |bits, (k, _)| bits | 1 << k);
    let has_shadow = lights.first().is_some_and(|light| light.shadow);
    vec![
        ("LIGHT_COUNT", lights.len() as f64),
        ("POINT_LIGHTS", f64::from(points)),
        ("HAS_SHADOW", f64::from(u8::from(has_shadow))),
    ]
}

impl FrameUniform {
    /// Camera, lights and knobs of one frame of a picture of `size` [px].
    pub fn new(
        view: &View,
        size: [u32; 2],
        lights: &[PlacedLight],
        surface: &SurfaceSection,
        shadow_from_world: Mat4,
    ) -> Self {
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
        let layers = surface.repeated_layers();
        let deepest = layers[surface.layers.len().max(1) - 1];
        let clearest = layers
            .iter()
            .map(|layer| layer.extinction_per_m().min_element())
            .fold(f32::INFINITY, f32::min);
        let last = surface.inner.len().max(1) - 1;
        let inner: [InnerSection; INNER_MAX] =
            std::array::from_fn(|k| surface.inner.get(k.min(last)).copied().unwrap_or_default());
        let [width, height] = size.map(|side| side as f32);
        let clip_from_world = view.clip_from_world(width / height);
        // Rows of the matrix: clip units a metre across and along the light.
        let across = shadow_from_world.row(0).truncate().length().max(1e-9);
        let along = shadow_from_world.row(2).truncate().length().max(1e-9);
        Self {
            clip_from_world: clip_from_world.to_cols_array(),
            world_from_clip: clip_from_world.inverse().to_cols_array(),
            shadow_from_world: shadow_from_world.to_cols_array(),
            eye: view.eye.extend(1.0).to_array(),
            lights: std::array::from_fn(light),
            extinction: layers
                .map(|layer| layer.extinction_per_m().extend(layer.asymmetry).to_array()),
            albedo: layers.map(|layer| layer.albedo().extend(0.0).to_array()),
            reflectance: layers.map(|layer| reflectance(&layer).extend(0.0).to_array()),
            kept: Leak::NONE.kept.extend(0.0).to_array(),
            around: Leak::NONE.around.extend(0.0).to_array(),
            leaked: Leak::NONE.radiance.extend(0.0).to_array(),
            through: deepest.diffuse_attenuation_per_m().extend(0.0).to_array(),
            size: [width, height, 1.0 / width, 1.0 / height],
            inner: inner.map(|layer| {
                let [r, g, b] = layer.color;
                [r, g, b, layer.opacity]
            }),
            inner_distances: inner.map(|layer| layer.distance),
            layer_depth_max_m: surface.layer_depth_max_m,
            reach_m: OPTICAL_DEPTH_MAX / clearest,
            color_blend: surface.color_blend,
            multiple_scattering: surface.multiple_scattering,
            wrap: surface.wrap,
            layer_distance_m: surface.layer_distance_m,
            outer_opacity: surface.outer_opacity,
            relief: surface.relief,
            roughness: surface.roughness,
            wetness: surface.wetness,
            shadow_depth_m: 1.0 / along,
            // Two texels: what a slope of 60 degrees rises over one.
            shadow_bias_m: 2.0 * 2.0 / (across * super::shadow::SIZE_PX as f32),
            inner_blur: surface.inner_blur,
            layer_shadow: surface.layer_shadow,
            blur_radius_m: surface.blur_radius_m,
            noise_m: surface.noise_m,
            noise_lookups: surface.noise_lookups,
            exposure: surface.exposure,
            room_light: surface.room_light,
            pad0: 0.0,
        }
    }
}

impl FrameUniform {
    /// The same for a body as thick as a ball of `radius_m` [m], round whose terminator light leaks.
    pub fn leaking(self, surface: &SurfaceSection, radius_m: f32) -> Self {
        let layers = surface.repeated_layers();
        let leak = Leak::of(&layers[surface.layers.len().max(1) - 1], radius_m);
        Self {
            kept: leak.kept.extend(0.0).to_array(),
            around: leak.around.extend(0.0).to_array(),
            leaked: leak.radiance.extend(0.0).to_array(),
            ..self
        }
    }
}

/// Level of the maps at which a texel is about as large as a pixel of a picture `height_px` high, at the
/// distance of the view's target; `map_px_per_m` texels lie on a metre of the surface. One for the whole frame: levels by the
/// pixel cost a software adapter more.
pub fn map_level(view: &View, height_px: u32, map_px_per_m: f32) -> usize {
    let pixel_m =
        2.0 * view.eye.distance(view.target) * (0.5 * view.fov_y).tan() / height_px as f32;
    level_for(pixel_m * map_px_per_m)
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
    fn everything_lies_inside_the_map_of_a_near_light_outside_the_body() {
        let points = [
            Vec3::new(-0.1, 0.0, 0.3),
            Vec3::new(0.2, 0.5, -0.1),
            Vec3::new(0.0, -0.2, 0.1),
        ];
        for place in [Vec3::new(1.0, 0.3, 0.2), Vec3::new(0.0, 0.7, 0.1)] {
            let light = PlacedLight {
                place,
                is_point: true,
                power: Vec3::ONE,
                shadow: false,
            };
            let clip_from_world = light_from_world(&light, &points);
            for point in points {
                let clip = clip_from_world.project_point3(point);
                assert!(clip.x.abs() <= 1.0 && clip.y.abs() <= 1.0, "{clip}");
                assert!((0.0..=1.0).contains(&clip.z), "{clip}");
            }
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
    fn what_is_upwards_is_higher_in_the_picture_even_seen_from_above() {
        let view = |eye: Vec3, up: Vec3| View {
            eye,
            target: Vec3::ZERO,
            up,
            fov_y: 0.5,
        };
        for up in [Vec3::Y, Vec3::Z, Vec3::new(1.0, 1.0, 0.3)] {
            let clip = view(Vec3::new(2.0, -3.0, 1.0), up).clip_from_world(1.0);
            assert!(clip.project_point3(0.1 * up).y > 0.01, "{up}");
            let above = view(3.0 * up, up).clip_from_world(1.0);
            assert!(above.project_point3(Vec3::X).is_finite(), "{up}");
        }
    }

    #[test]
    fn the_target_is_in_the_middle_of_the_picture() {
        let view = View {
            eye: Vec3::new(0.3, 0.4, 1.0),
            target: Vec3::new(0.1, 0.0, 0.0),
            up: Vec3::Y,
            fov_y: 0.5,
        };
        let clip = view.clip_from_world(4.0 / 3.0).project_point3(view.target);
        assert!(clip.x.abs() < 1e-5 && clip.y.abs() < 1e-5, "{clip}");
        assert!((0.0..1.0).contains(&clip.z), "{clip}");
    }
}
