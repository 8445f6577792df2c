//! Light scattered once, gathered along the view ray below the surface.
//!
//! Twin of `shaders/subsurface.wgsl`, fn `single_scattering`, for one far light. Source: François 2006, Algorithms
//! 1 and 2; Norberg 2010, eqs. 10 to 14.

use super::light_plane::{self, PlanePair};
use super::light_quadric::{self, Aim, Bend};
use super::medium::{
    UNLIT, above, gather, gather_at_start, mean_transmittance, optical_depth, phase, segment,
};
use super::{LAYERS, Layer};
use glam::Vec3;

/// What stands for the surface over a view ray, and how the light meets it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Cover {
    /// Tangent plane and fitted plane.
    Planes {
        /// Both planes at P.
        pair: PlanePair,
        /// N · to_light.
        tangent_light: f32,
        /// n · to_light, for the fitted plane.
        plane_light: f32,
    },
    /// A paraboloid.
    Quadric {
        /// With the eye.
        bend: Bend,
        /// With the light.
        aim: Aim,
    },
}

impl Cover {
    /// N · to_eye.
    pub fn cos_eye(&self) -> f32 {
        match self {
            Self::Planes { pair, .. } => pair.tangent_eye,
            Self::Quadric { bend, .. } => bend.to_eye.z,
        }
    }

    /// Length [m] of the light's way to the point `t` [m] along the view ray, and its cosine where it enters;
    /// `None` where no light comes straight.
    pub fn way_to_light(&self, t: f32, blend: f32) -> Option<(f32, f32)> {
        match self {
            Self::Planes {
                pair,
                tangent_light,
                plane_light,
            } => light_plane::way_to_light(pair, t, blend, *tangent_light, *plane_light),
            Self::Quadric { bend, aim } => light_quadric::way_to_light(bend, aim, t),
        }
    }

    /// The same as the papers print it: a plane that faces away lets light through as if it were mirrored.
    pub fn way_as_printed(&self, t: f32, blend: f32) -> Option<(f32, f32)> {
        match self {
            Self::Planes {
                pair,
                tangent_light,
                plane_light,
            } => Some(light_plane::way_as_printed(
                pair,
                t,
                blend,
                *tangent_light,
                *plane_light,
            )),
            Self::Quadric { .. } => self.way_to_light(t, blend),
        }
    }

    /// The cosine by which the papers' march ends: with the fitted plane.
    pub fn printed_cosine(&self) -> f32 {
        match self {
            Self::Planes { pair, .. } => pair.plane_eye,
            Self::Quadric { bend, .. } => bend.to_eye.z,
        }
    }

    /// Where the view ray leaves the body again [m], as far as the cover tells.
    pub fn exit_m(&self) -> f32 {
        match self {
            Self::Planes { .. } => f32::INFINITY,
            Self::Quadric { bend, .. } => bend.exit_m(),
        }
    }
}

/// A view ray, seen from the point P where it meets the surface, and the light.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// What lies over it.
    pub cover: Cover,
    /// to_light · to_eye.
    pub light_eye: f32,
    /// How far the march goes [m].
    pub reach_m: f32,
}

/// How light along the ray is summed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Rule {
    /// Equal steps, each valued at its start; planes blended by the share of the way (eq. 9).
    Published,
    /// Steps that grow with depth, each integrated in closed form; planes blended by the square of the share.
    ClosedForm,
    /// As many samples in each layer, the last at its end; between them as the closed form.
    ByLayer,
}

/// How far a march goes [m]: to the deepest layer, at most 8 times its depth, and not beyond `optical_reach_m`.
///
/// François divides by the fitted normal, which may face away; Norberg by the vertex normal, without a bound.
pub fn reach_m(deepest_m: f32, cos_eye: f32, optical_reach_m: f32) -> f32 {
    (deepest_m / cos_eye.max(0.125)).min(optical_reach_m)
}

/// How far the papers' march goes [m]: to the deepest layer below the fitted plane (François 2006, eq. 15); where that
/// is seen from the side or from behind, as if by a cosine of 0.08.
pub fn printed_reach_m(deepest_m: f32, cover: &Cover) -> f32 {
    deepest_m / cover.printed_cosine().max(0.08)
}

/// Radiance per irradiance on a plane facing the light [1/sr], with `samples` evaluations of the light below P.
///
/// `bottoms` gives the lower boundaries of the first three layers [m], ascending, at a distance along the ray.
pub fn march(
    ray: &Ray,
    layers: &[Layer; LAYERS],
    bottoms: impl Fn(f32) -> Vec3,
    samples: u32,
    rule: Rule,
) -> Vec3 {
    let tissue = Tissue::new(ray, layers);
    match rule {
        Rule::ByLayer => by_layer(ray, &tissue, bottoms, samples.div_ceil(LAYERS as u32)),
        Rule::ClosedForm | Rule::Published => by_step(ray, &tissue, bottoms, samples, rule),
    }
}

/// What of the layers and the light is the same all along a ray.
struct Tissue {
    extinction: [Vec3; LAYERS],
    /// Albedo times phase function.
    sources: [Vec3; LAYERS],
}

impl Tissue {
    fn new(ray: &Ray, layers: &[Layer; LAYERS]) -> Self {
        Self {
            extinction: layers.map(|layer| layer.extinction_per_m()),
            sources: layers.map(|layer| layer.albedo() * phase(ray.light_eye, layer.asymmetry)),
        }
    }

    fn light_depth(&self, ray: &Ray, t: f32, blend: f32, bottoms: Vec3, rule: Rule) -> Vec3 {
        let way = match rule {
            Rule::Published => ray.cover.way_as_printed(t, blend),
            Rule::ClosedForm | Rule::ByLayer => ray.cover.way_to_light(t, blend),
        };
        way.map_or(Vec3::splat(UNLIT), |(s, cosine)| {
            optical_depth(s, cosine, bottoms, &self.extinction)
        })
    }
}

fn by_layer(ray: &Ray, tissue: &Tissue, bottoms: impl Fn(f32) -> Vec3, pieces: u32) -> Vec3 {
    let cos_eye = ray.cover.cos_eye().max(1e-3);
    // Where a layer ends, as far as the boundaries read at one place tell; the last ends with the march.
    let end = |layer: usize, t: f32, found: Vec3| {
        if layer + 1 < LAYERS {
            (found[layer] / cos_eye).clamp(t, ray.reach_m)
        } else {
            ray.reach_m
        }
    };
    let mut t = 0.0;
    let mut a = Vec3::ZERO;
    let mut found = bottoms(0.0);
    let mut depth = tissue.light_depth(ray, 0.0, 0.0, bottoms(0.0), Rule::ByLayer);
    let mut sum = Vec3::ZERO;
    for layer in 0..LAYERS {
        for i in 0..pieces {
            // Of what is left of the layer, so that samples lie at (i/n)² of the way through it.
            let part = (2 * i + 1) as f32 / ((pieces - i) * (pieces + i)) as f32;
            found = bottoms(t + (end(layer, t, found) - t) * part);
            let next = t + (end(layer, t, found) - t) * part;
            let share = next / ray.reach_m;
            let depth_next = tissue.light_depth(ray, next, share * share, found, Rule::ByLayer);
            let a_next = a + (next - t) * tissue.extinction[layer];
            let mean = mean_transmittance(a + depth, a_next + depth_next);
            sum += (a_next - a) * mean * tissue.sources[layer];
            (t, a, depth) = (next, a_next, depth_next);
        }
    }
    sum
}

fn by_step(
    ray: &Ray,
    tissue: &Tissue,
    bottoms: impl Fn(f32) -> Vec3,
    samples: u32,
    rule: Rule,
) -> Vec3 {
    let cos_eye = ray.cover.cos_eye().max(1e-3);
    let is_published = rule == Rule::Published;
    let mut t = 0.0;
    let mut a = Vec3::ZERO;
    let mut below = -bottoms(0.0);
    let mut depth = tissue.light_depth(ray, 0.0, 0.0, bottoms(0.0), rule);
    let mut sum = Vec3::ZERO;
    for i in 1..=samples {
        let even = i as f32 / samples as f32;
        let share = if is_published { even } else { even * even };
        let blend = if is_published { share } else { share * share };
        let next = ray.reach_m * share;
        let found = bottoms(next);
        let below_next = next * cos_eye - found;
        let depth_next = tissue.light_depth(ray, next, blend, found, rule);
        let shares = if is_published {
            below.map(|b| if b > 0.0 { 0.0 } else { 1.0 })
        } else {
            above(below, below_next)
        };
        let passed = segment(a, next - t, shares, &tissue.extinction);
        let got = if is_published {
            gather_at_start(&passed, depth, below, &tissue.sources)
        } else {
            gather(&passed, depth, depth_next, &tissue.sources)
        };
        sum += got.iter().sum::<Vec3>();
        (t, a, below, depth) = (next, passed[LAYERS], below_next, depth_next);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::super::closed_form::parallel_layers;
    use super::*;

    /// Dermis, blood and organs of François' Table 1, in 1/m; the fourth goes on like the third.
    fn table_1() -> [Layer; LAYERS] {
        let layer = |scattering: [f32; 3], extinction: [f32; 3], asymmetry| {
            let scattering_per_m = 1e3 * Vec3::from(scattering);
            Layer {
                absorption_per_m: 1e3 * Vec3::from(extinction) - scattering_per_m,
                scattering_per_m,
                asymmetry,
            }
        };
        let organs = layer([1.0, 1.0, 2.0], [1.5, 1.5, 2.5], 0.8);
        [
            layer([2.0, 1.0, 1.0], [2.6, 1.6, 1.6], 0.25),
            layer([6.0, 3.0, 2.0], [6.6, 3.6, 2.6], 0.40),
            organs,
            organs,
        ]
    }

    /// A flat body; light and eye in one plane with the normal, on opposite sides.
    fn flat(cos_light: f32, cos_eye: f32, reach_m: f32) -> Ray {
        let sine = |c: f32| (1.0 - c * c).sqrt();
        Ray {
            cover: Cover::Planes {
                pair: PlanePair::tangent(cos_eye),
                tangent_light: cos_light,
                plane_light: cos_light,
            },
            light_eye: cos_light * cos_eye - sine(cos_light) * sine(cos_eye),
            reach_m,
        }
    }

    fn relative(got: Vec3, exact: Vec3) -> f32 {
        ((got - exact) / exact).abs().max_element()
    }

    const ANGLES: [(f32, f32); 4] = [(0.9, 0.95), (0.3, 0.9), (0.8, 0.15), (0.05, 0.06)];

    #[test]
    fn one_closed_form_segment_is_exact_in_a_homogeneous_half_space() {
        let layers = [table_1()[0]; LAYERS];
        for (cos_light, cos_eye) in ANGLES {
            // 12 lengths of extinction along the ray.
            let ray = flat(cos_light, cos_eye, 12.0 / 1600.0);
            let got = march(&ray, &layers, |_| Vec3::ONE, 1, Rule::ClosedForm);
            let exact = parallel_layers(&layers[..1], &[], cos_light, cos_eye, ray.light_eye);
            // e⁻¹² is 6e-6; the rest is rounding.
            let error = relative(got, exact);
            assert!(error < 2e-5, "{cos_light} {cos_eye}: {error}");
        }
    }

    #[test]
    fn one_closed_form_segment_is_exact_in_parallel_layers() {
        let layers = table_1();
        let bottoms = Vec3::new(0.00025, 0.00045, 0.001);
        for (cos_light, cos_eye) in ANGLES {
            let ray = flat(cos_light, cos_eye, 15.0 / 1500.0);
            let got = march(&ray, &layers, |_| bottoms, 1, Rule::ClosedForm);
            let bottoms = bottoms.to_array();
            let exact = parallel_layers(&layers, &bottoms, cos_light, cos_eye, ray.light_eye);
            // e⁻¹⁵, and the rounding of differences of exponentials.
            let error = relative(got, exact);
            assert!(error < 5e-5, "{cos_light} {cos_eye}: {error}");
        }
    }

    #[test]
    fn one_sample_a_layer_is_exact_in_parallel_layers() {
        let layers = table_1();
        let bottoms = Vec3::new(0.00025, 0.00045, 0.001);
        for (cos_light, cos_eye) in ANGLES {
            let ray = flat(cos_light, cos_eye, 15.0 / 1500.0);
            let got = march(&ray, &layers, |_| bottoms, 4, Rule::ByLayer);
            let bottoms = bottoms.to_array();
            let exact = parallel_layers(&layers, &bottoms, cos_light, cos_eye, ray.light_eye);
            // e⁻¹⁵, and the rounding of differences of exponentials.
            let error = relative(got, exact);
            assert!(error < 5e-5, "{cos_light} {cos_eye}: {error}");
        }
    }

    #[test]
    fn the_published_march_is_too_bright_by_the_factor_that_theory_gives() {
        let layers = [table_1()[0]; LAYERS];
        let (cos_light, cos_eye) = (0.72, 0.55);
        let ray = flat(cos_light, cos_eye, 0.003 / cos_eye);
        let exact = parallel_layers(&layers[..1], &[], cos_light, cos_eye, ray.light_eye);
        for samples in [10, 100] {
            let got = march(&ray, &layers, |_| Vec3::ONE, samples, Rule::Published);
            // A left Riemann sum of an exponential: x / (1 − e^−x) times what is right.
            let step = ray.reach_m / samples as f32;
            let x = layers[0].extinction_per_m() * step * (1.0 + cos_eye / cos_light);
            let factor = x / (1.0 - (-x).exp());
            // Less than 1e-6 of the light comes from beyond 3 mm of depth.
            let error = relative(got, factor * exact);
            assert!(error < 1e-3, "{samples} samples: {error}");
            if samples == 10 {
                assert!(factor.x > 1.5, "a coarse march must be far off: {factor}");
            }
        }
    }

    #[test]
    fn closed_form_with_ten_samples_beats_the_published_march_with_a_hundred_fivefold() {
        let layers = table_1();
        // A vein: the second layer swells along the ray.
        let bottoms = |t: f32| {
            let swell = 0.0002 * (-((t - 0.0008) / 0.0004).powi(2)).exp();
            Vec3::new(0.00025 - 0.5 * swell, 0.00045 + swell, 0.002)
        };
        let ray = flat(0.6, 0.5, 0.005);
        let exact = march(&ray, &layers, bottoms, 8192, Rule::ClosedForm);
        let ours = relative(march(&ray, &layers, bottoms, 10, Rule::ClosedForm), exact);
        let four = relative(march(&ray, &layers, bottoms, 4, Rule::ByLayer), exact);
        let papers = relative(march(&ray, &layers, bottoms, 100, Rule::Published), exact);
        assert!(ours < 0.2 * papers, "{ours} against {papers}");
        assert!(
            four < papers,
            "four samples, one a layer: {four} against {papers}"
        );
    }

    #[test]
    fn closed_form_error_falls_sixteenfold_when_samples_quadruple() {
        let layers = table_1();
        let bottoms = |t: f32| Vec3::new(0.0003 + 0.1 * t, 0.0008 + 0.1 * t, 0.003);
        let ray = Ray {
            cover: Cover::Planes {
                pair: PlanePair {
                    normals: 0.97,
                    tangent_eye: 0.7,
                    plane_eye: 0.8,
                    offset_m: -0.0003,
                },
                tangent_light: 0.6,
                plane_light: 0.4,
            },
            light_eye: 0.2,
            reach_m: 0.006,
        };
        let exact = march(&ray, &layers, bottoms, 4096, Rule::ClosedForm);
        let error = |n: u32| relative(march(&ray, &layers, bottoms, n, Rule::ClosedForm), exact);
        let ratio = error(8) / error(32);
        // 16 for a second-order rule; where boundaries fall within segments moves it a little.
        assert!(
            (8.0..40.0).contains(&ratio),
            "{} then {}",
            error(8),
            error(32)
        );
    }

    #[test]
    fn the_half_space_check_rejects_light_that_ignores_the_way_in() {
        let layers = [table_1()[0]; LAYERS];
        let ray = flat(0.3, 0.9, 12.0 / 1600.0);
        let blind = Ray {
            cover: Cover::Planes {
                pair: PlanePair::tangent(0.9),
                tangent_light: 1e6,
                plane_light: 1e6,
            },
            ..ray
        };
        let got = march(&blind, &layers, |_| Vec3::ONE, 1, Rule::ClosedForm);
        let exact = parallel_layers(&layers[..1], &[], 0.3, 0.9, ray.light_eye);
        assert!(relative(got, exact) > 0.5);
    }

    #[test]
    fn reach_is_bounded_at_grazing_views() {
        assert_eq!(reach_m(0.003, 1e-6, 1.0), 0.024);
        assert_eq!(reach_m(0.003, -0.4, 1.0), 0.024);
        assert_eq!(reach_m(0.003, 0.5, 0.001), 0.001);
    }
}
