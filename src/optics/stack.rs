//! The march through any number of layers.
//!
//! Twin of `shaders/layers_eight.wgsl` with `shaders/subsurface.wgsl`. Source: François 2006, section 3: N textures of
//! four channels hold 4 N layers. The formulas are those of [`super::medium`], which writes four layers out.

use super::Layer;
use super::march::{Ray, Rule};
use super::medium::{UNLIT, mean_transmittance, phase};
use glam::Vec3;

/// Optical depth of a path of `s` [m] from the surface inwards, at an angle of `cosine` with the normal, in layers of
/// `extinction` [1/m]; the first of `bottoms` are the lower boundaries of all but the last [m], ascending.
pub fn optical_depth(s: f32, cosine: f32, bottoms: &[f32], extinction: &[Vec3]) -> Vec3 {
    let mut from = 0.0;
    let mut sum = Vec3::ZERO;
    for (j, &sigma_t) in extinction.iter().enumerate() {
        let end = if j + 1 < extinction.len() {
            (bottoms[j] / cosine.max(1e-3)).min(s)
        } else {
            s
        };
        sum += (end - from) * sigma_t;
        from = end;
    }
    sum
}

/// Radiance per irradiance on a plane facing the light [1/sr], with about `samples` evaluations of the light below P.
///
/// `bottoms` gives the lower boundaries of all layers but the last [m], ascending, at a distance along the ray.
pub fn march(
    ray: &Ray,
    layers: &[Layer],
    bottoms: impl Fn(f32) -> Vec<f32>,
    samples: u32,
    rule: Rule,
) -> Vec3 {
    let extinction: Vec<Vec3> = layers.iter().map(Layer::extinction_per_m).collect();
    let sources: Vec<Vec3> = layers
        .iter()
        .map(|layer| layer.albedo() * phase(ray.light_eye, layer.asymmetry))
        .collect();
    let light_depth = |t: f32, blend: f32, found: &[f32]| {
        let way = match rule {
            Rule::Published => ray.cover.way_as_printed(t, blend),
            Rule::ClosedForm | Rule::ByLayer => ray.cover.way_to_light(t, blend),
        };
        way.map_or(Vec3::splat(UNLIT), |(s, cosine)| {
            optical_depth(s, cosine, found, &extinction)
        })
    };
    let cos_eye = ray.cover.cos_eye().max(1e-3);
    let last = layers.len() - 1;
    let (mut t, mut a, mut sum) = (0.0, Vec3::ZERO, Vec3::ZERO);
    let mut found = bottoms(0.0);
    let mut depth = light_depth(0.0, 0.0, &found);
    if rule == Rule::ByLayer {
        let pieces = samples.div_ceil(layers.len() as u32);
        let end_of = |j: usize, t: f32, found: &[f32]| {
            if j < last {
                (found[j] / cos_eye).clamp(t, ray.reach_m)
            } else {
                ray.reach_m
            }
        };
        for j in 0..layers.len() {
            for i in 0..pieces {
                let part = (2 * i + 1) as f32 / ((pieces - i) * (pieces + i)) as f32;
                found = bottoms(t + (end_of(j, t, &found) - t) * part);
                let next = t + (end_of(j, t, &found) - t) * part;
                let share = next / ray.reach_m;
                let depth_next = light_depth(next, share * share, &found);
                let a_next = a + (next - t) * extinction[j];
                let mean = mean_transmittance(a + depth, a_next + depth_next);
                sum += (a_next - a) * mean * sources[j];
                (t, a, depth) = (next, a_next, depth_next);
            }
        }
        return sum;
    }
    for i in 1..=samples {
        let even = i as f32 / samples as f32;
        let published = rule == Rule::Published;
        let share = if published { even } else { even * even };
        let next = ray.reach_m * share;
        let found_next = bottoms(next);
        let depth_next = light_depth(
            next,
            if published { share } else { share * share },
            &found_next,
        );
        let below = |j: usize| t * cos_eye - found[j];
        if published {
            let j = (0..last).find(|&j| below(j) <= 0.0).unwrap_or(last);
            let a_next = a + (next - t) * extinction[j];
            sum += (a_next - a) * (-(a + depth)).exp() * sources[j];
            a = a_next;
        } else {
            // Where the step crosses each boundary, as a share of it.
            let crossing = |j: usize| {
                let (start, end) = (below(j), next * cos_eye - found_next[j]);
                1.0 - (start.max(0.0) + end.max(0.0)) / (start.abs() + end.abs()).max(1e-12)
            };
            let mut ends = vec![a];
            let mut from = 0.0;
            for (j, &sigma_t) in extinction.iter().enumerate() {
                let share = if j < last { crossing(j) } else { 1.0 };
                ends.push(ends[j] + (next - t) * (share - from) * sigma_t);
                from = share;
            }
            let growth = ends[last + 1] - a;
            let r = Vec3::ONE + (depth_next - depth) / growth.max(Vec3::splat(1e-12));
            for (j, &source) in sources.iter().enumerate() {
                let at = |k: usize| a + depth + r * (ends[k] - a);
                sum += (ends[j + 1] - ends[j]) * mean_transmittance(at(j), at(j + 1)) * source;
            }
            a = ends[last + 1];
        }
        (t, depth, found) = (next, depth_next, found_next);
    }
    sum
}

#[cfg(test)]
mod tests {
    use super::super::closed_form::parallel_layers;
    use super::super::light_plane::PlanePair;
    use super::super::march::{self, Cover};
    use super::*;

    fn layer(k: usize) -> Layer {
        let scattering = 1000.0 + 500.0 * (k % 3) as f32;
        Layer {
            absorption_per_m: Vec3::new(200.0, 300.0 + 40.0 * k as f32, 500.0),
            scattering_per_m: Vec3::new(scattering, 0.7 * scattering, 0.5 * scattering),
            asymmetry: 0.1 * k as f32 - 0.2,
        }
    }

    fn ray(cos_light: f32, cos_eye: f32, light_eye: f32) -> Ray {
        Ray {
            cover: Cover::Planes {
                pair: PlanePair::tangent(cos_eye),
                tangent_light: cos_light,
                plane_light: cos_light,
            },
            light_eye,
            reach_m: 0.02,
        }
    }

    #[test]
    fn one_sample_a_layer_is_exact_in_eight_parallel_layers() {
        let layers: Vec<Layer> = (0..8).map(layer).collect();
        let bottoms: Vec<f32> = (1..8).map(|j| 0.0002 * j as f32).collect();
        let exact = parallel_layers(&layers, &bottoms, 0.6, 0.7, 0.2);
        for (rule, samples) in [(Rule::ByLayer, 8), (Rule::ClosedForm, 1)] {
            let got = march(
                &ray(0.6, 0.7, 0.2),
                &layers,
                |_| bottoms.clone(),
                samples,
                rule,
            );
            // e⁻¹⁴ is left below; rounding of differences of exponentials, and means of nearly equal ones.
            let error = ((got - exact) / exact).abs().max_element();
            assert!(error < 1e-4, "{rule:?}: {error}");
        }
    }

    #[test]
    fn four_layers_are_gathered_as_the_march_of_four_does() {
        let layers: [Layer; 4] = std::array::from_fn(layer);
        let bottoms = |t: f32| Vec3::new(0.0003 + 0.1 * t, 0.0007, 0.0015 - 0.05 * t);
        let ray = ray(0.5, 0.8, -0.3);
        for (rule, samples) in [
            (Rule::ByLayer, 8),
            (Rule::ClosedForm, 9),
            (Rule::Published, 23),
        ] {
            let four = march::march(&ray, &layers, bottoms, samples, rule);
            let any = march(
                &ray,
                &layers,
                |t| bottoms(t).to_array().to_vec(),
                samples,
                rule,
            );
            // Two ways to write the same sums; the mean over a flat stretch is taken at other ends.
            assert!(
                ((four - any) / four).abs().max_element() < 2e-4,
                "{rule:?}: {four} {any}"
            );
        }
    }
}
