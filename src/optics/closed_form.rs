//! Exact radiance of light scattered once, where it has a closed form: the oracle of the marches.

use super::Layer;
use super::medium::phase;
use glam::Vec3;

/// Radiance per irradiance on a plane facing the light [1/sr] of parallel layers: all but the last of
/// `layers` have a lower boundary in `bottoms_m` [m]; the last has no end.
///
/// `cos_light` and `cos_eye` are the cosines of the directions with the normal, both above 0, `cos_between` that
/// between them. Layer j adds ϖ p μ₀/(μ₀ + μ) (e^−A − e^−B) with A and B the optical depths to light and eye at
/// its two boundaries.
///
/// # Panics
///
/// Unless there is one layer more than boundaries.
pub fn parallel_layers(
    layers: &[Layer],
    bottoms_m: &[f32],
    cos_light: f32,
    cos_eye: f32,
    cos_between: f32,
) -> Vec3 {
    assert_eq!(layers.len(), bottoms_m.len() + 1, "one endless layer below");
    let way = 1.0 / cos_light + 1.0 / cos_eye;
    let mut top = 0.0;
    let mut entering = Vec3::ONE;
    let mut sum = Vec3::ZERO;
    for (j, layer) in layers.iter().enumerate() {
        let leaving = match bottoms_m.get(j) {
            Some(&bottom) => {
                let depth = layer.extinction_per_m() * (bottom - top) * way;
                top = bottom;
                entering * (-depth).exp()
            }
            None => Vec3::ZERO,
        };
        sum += layer.albedo() * phase(cos_between, layer.asymmetry) * (entering - leaving);
        entering = leaving;
    }
    sum * cos_light / (cos_light + cos_eye)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_closed_form_matches_a_sum_over_many_thin_sheets() {
        let layer = |scattering: f32, absorption: f32, asymmetry: f32| Layer {
            absorption_per_m: Vec3::splat(absorption),
            scattering_per_m: Vec3::splat(scattering),
            asymmetry,
        };
        let layers = [layer(2000.0, 600.0, 0.25), layer(6000.0, 600.0, 0.4)];
        let (bottom, cos_light, cos_eye, between) = (0.0003, 0.6_f32, 0.8_f32, 0.1);
        let exact = parallel_layers(&layers, &[bottom], cos_light, cos_eye, between).x;
        let sheets = 400_000;
        let thickness = 0.004 / f64::from(sheets);
        let mut depth = 0.0_f64;
        let mut sum = 0.0_f64;
        for i in 0..sheets {
            let z = (f64::from(i) + 0.5) * thickness;
            let layer = layers[usize::from(z > f64::from(bottom))];
            let sigma_t = f64::from(layer.extinction_per_m().x);
            let p = f64::from(phase(between, layer.asymmetry));
            let way = 1.0 / f64::from(cos_light) + 1.0 / f64::from(cos_eye);
            let middle = depth + 0.5 * sigma_t * thickness;
            sum += f64::from(layer.scattering_per_m.x) * p * (-middle * way).exp() * thickness
                / f64::from(cos_eye);
            depth += sigma_t * thickness;
        }
        // The sheet that straddles the boundary is off by 1e-5.
        let error = (f64::from(exact) / sum - 1.0).abs();
        assert!(error < 1e-4, "{exact} against {sum}");
    }
}
