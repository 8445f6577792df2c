//! Profiles against walks of photons, and the blur against what it must keep.

use super::super::photon::Random;
use super::*;

/// Where photons of a thin beam come out of an even half-space, in mean free paths, with their weights.
fn walks(albedo: f64, k: f64, photons: u32) -> Vec<(f64, f64)> {
    let mut random = Random::new();
    let mut out = Vec::new();
    for _ in 0..photons {
        let (mut at, mut along) = (glam::DVec3::ZERO, glam::DVec3::NEG_Z);
        let mut weight = 1.0;
        loop {
            let next = at - random.next().ln() * along;
            if next.z > 0.0 {
                let place = at + (next - at) * (at.z / (at.z - next.z));
                out.push((place.truncate().length(), weight));
                break;
            }
            at = next;
            weight *= albedo;
            let Some(survived) = random.survivor(weight) else {
                break;
            };
            weight = survived;
            along = random.scattered(along, k);
        }
    }
    out
}

/// Light at `x` where x > 0 is lit: a photon that comes out at r adds 1/2 + asin(x/r)/π.
fn edge_of(walks: &[(f64, f64)], x: f64) -> f64 {
    let (mut sum, mut total) = (0.0, 0.0);
    for &(r, weight) in walks {
        let share = if x.abs() < r {
            0.5 + (x / r).asin() / std::f64::consts::PI
        } else {
            f64::from(u8::from(x > 0.0))
        };
        sum += weight * share;
        total += weight;
    }
    sum / total
}

fn layer(albedo: f64, k: f64) -> Layer {
    // Mean free path of 1 mm.
    Layer {
        absorption_per_m: Vec3::splat(1e3 * (1.0 - albedo) as f32),
        scattering_per_m: Vec3::splat(1e3 * albedo as f32),
        asymmetry: k as f32,
    }
}

/// Root mean square of the profile's edge against that of the walks over ±6 mean radii, with widths times `scale`.
fn edge_error(walks: &[(f64, f64)], layer: &Layer, scale: f32) -> f64 {
    let total: f64 = walks.iter().map(|w| w.1).sum();
    let mean = walks.iter().map(|w| w.0 * w.1).sum::<f64>() / total;
    let mut profile = Profile::of(layer);
    profile.sigmas_m = profile.sigmas_m.map(|sigma| scale * sigma);
    let steps = 60;
    let square: f64 = (0..=steps)
        .map(|i| {
            let x = 6.0 * mean * (2.0 * f64::from(i) / f64::from(steps) - 1.0);
            let got = f64::from(profile.edge(1e-3 * x as f32, 0));
            (got - edge_of(walks, x)).powi(2)
        })
        .sum();
    (square / f64::from(steps + 1)).sqrt()
}

#[test]
fn the_edge_of_every_tissue_is_within_a_hundredth_of_the_walks() {
    for (albedo, k) in [
        (0.3, 0.0),
        (0.769, 0.25),
        (0.625, 0.25),
        (0.909, 0.4),
        (0.8, 0.8),
    ] {
        let walks = walks(albedo, k, 20_000);
        let layer = layer(albedo, k);
        let error = edge_error(&walks, &layer, 1.0);
        println!("albedo {albedo}, k {k}: edge RMS {error:.4}");
        assert!(error < 0.01, "albedo {albedo}, k {k}: {error}");
        // What the check would say of a width half as large again.
        assert!(edge_error(&walks, &layer, 1.5) > 0.015, "{albedo}, {k}");
    }
}

#[test]
fn weights_add_up_to_one_and_widths_follow_the_mean_free_path() {
    let profile = Profile::of(&layer(0.8, 0.4));
    let sum: Vec3 = profile.weights.iter().sum();
    assert!((sum - 1.0).abs().max_element() < 1e-6, "{sum}");
    let clearer = Layer {
        absorption_per_m: 0.5 * layer(0.8, 0.4).absorption_per_m,
        scattering_per_m: 0.5 * layer(0.8, 0.4).scattering_per_m,
        ..layer(0.8, 0.4)
    };
    for (wide, narrow) in Profile::of(&clearer).sigmas_m.iter().zip(profile.sigmas_m) {
        assert!((*wide / narrow - 2.0).abs().max_element() < 1e-4);
    }
    let without_absorption = Layer {
        absorption_per_m: Vec3::ZERO,
        ..layer(0.8, 0.4)
    };
    assert!(mean_distance_m(&without_absorption).is_finite());
}

#[test]
fn steps_add_up_to_the_widths() {
    let profile = Profile::of(&layer(0.8, 0.4));
    let mut square = Vec3::ZERO;
    for (step, sigma) in profile.steps_m().into_iter().zip(profile.sigmas_m) {
        square += step * step;
        assert!((square.map(f32::sqrt) / sigma - 1.0).abs().max_element() < 1e-5);
    }
}

#[test]
fn what_is_far_below_a_texel_is_a_spot_and_what_spans_texels_is_none() {
    let profile = Profile::of(&layer(0.8, 0.4));
    // The middle Gaussian, red, one texel wide: the narrowest is a fifth of that.
    let spots = profile.spots(1.0 / profile.sigmas_m[1].x);
    assert!(spots[0].x > 0.8 && spots[1].x < 0.02 && spots[2].x < 1e-6);
    assert_eq!(profile.spots(0.0)[2], Vec3::ONE);
}

const WIDTH: usize = 65;

/// A point of light in the middle, blurred along both axes of an even metric.
fn point(metric: Vec3, sigma_m: Vec3) -> Vec<Vec4> {
    let mut map = vec![Vec4::new(0.0, 0.0, 0.0, 1.0); WIDTH * WIDTH];
    map[WIDTH * WIDTH / 2] = Vec4::ONE;
    let metrics = vec![metric; map.len()];
    let map = diffused(&map, &metrics, WIDTH, Axis::Second, sigma_m, 16);
    diffused(&map, &metrics, WIDTH, Axis::First, sigma_m, 16)
}

#[test]
fn a_blur_keeps_the_energy_does_not_move_the_light_and_has_the_covariance_of_the_metric() {
    // Gradients of u and v on a sheared surface, in maps a metre; widths of 1.5 to 4 texels.
    let (gradient_u, gradient_v) = (Vec3::new(1.0, 0.3, 0.0), Vec3::new(-0.4, 1.2, 0.0));
    let metric = metric(gradient_u, gradient_v);
    let sigma_m = Vec3::new(4.0, 2.5, 1.5) / WIDTH as f32;
    let map = point(metric, sigma_m);
    for channel in 0..3 {
        let (mut energy, mut centroid, mut square) = (0.0, Vec2::ZERO, Vec3::ZERO);
        for (i, texel) in map.iter().enumerate() {
            let x = (i % WIDTH) as f32 - (WIDTH / 2) as f32;
            let y = (i / WIDTH) as f32 - (WIDTH / 2) as f32;
            energy += texel[channel];
            centroid += texel[channel] * Vec2::new(x, y);
            square += texel[channel] * Vec3::new(x * x, x * y, y * y);
        }
        assert!((energy - 1.0).abs() < 1e-3, "{energy}");
        // A hundredth of the radius is asked for.
        let sigma_px = sigma_m[channel] * WIDTH as f32;
        assert!(centroid.length() < 0.01 * sigma_px, "{centroid}");
        let exact = sigma_px
            * sigma_px
            * Vec3::new(
                gradient_u.length_squared(),
                gradient_u.dot(gradient_v),
                gradient_v.length_squared(),
            );
        // Cut at three standard deviations a Gaussian loses 3 % of its variance; the shear is rounded to texels.
        let error = (square - exact).abs().max_element() / exact.max_element();
        assert!(error < 0.06, "channel {channel}: {square} for {exact}");
    }
}

#[test]
fn an_even_slope_of_light_goes_on_over_a_seam() {
    // Two charts that meet in the middle of the map, lit by one slope.
    let map: Vec<Vec4> = (0..WIDTH * WIDTH)
        .map(|i| {
            let x = (i % WIDTH) as f32;
            Vec3::splat(x).extend(if x < 30.0 { 1.0 } else { 2.0 })
        })
        .collect();
    let metrics = vec![Vec3::new(1.0, 0.0, 1.0); map.len()];
    let sigma = Vec3::splat(4.0 / WIDTH as f32);
    let blurred = diffused(&map, &metrics, WIDTH, Axis::First, sigma, 16);
    for (before, after) in map.iter().zip(&blurred) {
        assert!((*before - *after).abs().max_element() < 1e-3);
    }
    // A blur that leaves out single taps bends the slope at the seam.
    let lone: f32 = (1..12)
        .map(|i| (-0.5 * (i as f32 / 4.0).powi(2)).exp() * i as f32)
        .sum();
    assert!(
        lone > 10.0,
        "a check that one-sided sums are no small matter"
    );
}

#[test]
fn the_gutter_takes_what_lies_nearest_to_it() {
    let mut map = vec![Vec4::ZERO; WIDTH * WIDTH];
    for row in 10..20 {
        for column in 10..20 {
            map[row * WIDTH + column] = Vec4::new(2.0, 1.0, 0.5, 3.0);
        }
    }
    let metrics = vec![Vec3::new(1.0, 0.0, 1.0); map.len()];
    let blurred = diffused(&map, &metrics, WIDTH, Axis::First, Vec3::splat(0.05), 16);
    let near = blurred[9 * WIDTH + 9];
    assert!(
        (near - Vec4::new(2.0, 1.0, 0.5, 3.0)).length() < 1e-5,
        "{near}"
    );
    assert_eq!(blurred[8 * WIDTH + 8], Vec4::ZERO, "one texel a pass");
}
