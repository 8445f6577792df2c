//! The closed form against walks of photons, and against what must not come out.

use super::super::photon::Random;
use super::*;
use glam::DVec3;

fn layer(albedo: f32, k: f32) -> Layer {
    // Mean free path of 1 mm.
    Layer {
        absorption_per_m: Vec3::splat(1e3 * (1.0 - albedo)),
        scattering_per_m: Vec3::splat(1e3 * albedo),
        asymmetry: k,
    }
}

/// Radiance per irradiance that an even half-space sends to the eye after more than one scattering, by walks from the
/// eye that look for the light wherever they scatter; `azimuth` lies between both.
fn walked(albedo: f64, k: f64, cos_light: f64, cos_eye: f64, azimuth: f64) -> f64 {
    const WALKS: u32 = 12_000;
    let mut random = Random::new();
    let sine = |c: f64| (1.0 - c * c).sqrt();
    let to_light = DVec3::new(
        sine(cos_light) * azimuth.cos(),
        sine(cos_light) * azimuth.sin(),
        cos_light,
    );
    let mut sum = 0.0;
    for _ in 0..WALKS {
        let (mut along, mut z) = (DVec3::new(-sine(cos_eye), 0.0, -cos_eye), 0.0);
        let mut weight = 1.0;
        for order in 0.. {
            z -= random.next().ln() * along.z;
            if z > 0.0 {
                break;
            }
            weight *= albedo;
            if order > 0 {
                let base = 1.0 - k * along.dot(to_light);
                let phase = (1.0 - k * k) / (4.0 * std::f64::consts::PI * base * base);
                sum += weight * phase * (z / cos_light).exp();
            }
            let Some(survived) = random.survivor(weight) else {
                break;
            };
            weight = survived;
            along = random.scattered(along, k);
        }
    }
    sum / f64::from(WALKS)
}

/// Worst ratio of the closed form to the walks, less one, over views that do not graze.
fn worst(albedo: f32, k: f32, form: impl Fn(f32, f32, Vec3) -> Vec3) -> f64 {
    let r0 = reflectance(&layer(albedo, k));
    let mut worst = 0.0_f64;
    for (cos_light, cos_eye, azimuth) in [
        (1.0, 1.0, 0.0),
        (0.7, 0.7, 0.0),
        (0.3, 0.9, 1.6),
        (0.9, 0.4, 2.0),
    ] {
        let exact = walked(
            albedo.into(),
            k.into(),
            cos_light.into(),
            cos_eye.into(),
            azimuth,
        );
        let got = f64::from((form(cos_light, cos_eye, r0) * cos_light / (cos_light + cos_eye)).x);
        worst = worst.max((got / exact - 1.0).abs());
    }
    worst
}

#[test]
fn the_closed_form_is_within_a_tenth_of_walks_and_the_full_albedo_is_not() {
    let form = |cos_light, cos_eye, r0| often(cos_light, cos_eye, r0, Vec3::ZERO);
    for (albedo, k) in [
        (0.5, 0.0),
        (0.769, 0.25),
        (0.625, 0.25),
        (0.909, 0.4),
        (0.8, 0.645),
    ] {
        let off = worst(albedo, k, form);
        println!("albedo {albedo}, k {k}: {:.1} % off", 100.0 * off);
        // 11 % was seen of k = 0.645 and 7 % of the others, where noise of the walks is 1 to 2 %.
        assert!(
            off < if k > 0.5 { 0.15 } else { 0.1 },
            "albedo {albedo}, k {k}: {off}"
        );
    }
    // Hapke's own ϖ in place of ϖ′.
    let naive = |cos_light: f32, cos_eye: f32, _: Vec3| {
        let gamma = (1.0_f32 - 0.8).sqrt();
        let r0 = Vec3::splat((1.0 - gamma) / (1.0 + gamma));
        often(cos_light, cos_eye, r0, Vec3::ZERO)
    };
    assert!(
        worst(0.8, 0.645, naive) > 0.2,
        "the check must be able to fail"
    );
}

/// Share of a far light that a flat body throws back: scattered once by its phase function, and more often.
fn thrown_back_flat(albedo: f32, k: f32, cos_light: f32) -> f64 {
    const STEPS: u32 = 120;
    let r0 = reflectance(&layer(albedo, k));
    let sine = |c: f32| (1.0 - c * c).sqrt();
    let mut sum = 0.0;
    for row in 0..STEPS {
        let cos_eye = (row as f32 + 0.5) / STEPS as f32;
        for column in 0..STEPS {
            let azimuth = std::f32::consts::TAU * (column as f32 + 0.5) / STEPS as f32;
            let between = cos_light * cos_eye + sine(cos_light) * sine(cos_eye) * azimuth.cos();
            let source =
                albedo * medium::phase(between, k) + often(cos_light, cos_eye, r0, Vec3::ZERO).x;
            let radiance = source * cos_light / (cos_light + cos_eye);
            sum += f64::from(radiance * cos_eye);
        }
    }
    sum * std::f64::consts::TAU / f64::from(STEPS * STEPS) / f64::from(cos_light)
}

#[test]
fn no_more_light_comes_out_than_went_in() {
    for k in [0.0, 0.25, 0.4, 0.645, 0.8] {
        for albedo in [0.3, 0.9, 0.99, 1.0] {
            for cos_light in [0.1, 0.5, 1.0] {
                let share = thrown_back_flat(albedo, k, cos_light);
                // H is right within 1 %; nothing that absorbs came near.
                assert!(share < 1.01, "albedo {albedo}, k {k}, {cos_light}: {share}");
            }
        }
    }
    // Without absorption, scattering evenly, all of it comes back.
    assert!(thrown_back_flat(1.0, 0.0, 0.5) > 0.98);
}

/// Share that a ball throws back, each place of it as a flat body but for the leak.
fn thrown_back_by_ball(layer: &Layer, leak: &Leak) -> f64 {
    const STEPS: u32 = 60;
    let r0 = reflectance(layer);
    let mut sum = 0.0;
    for place in 0..2 * STEPS {
        let cos_light = (place as f32 + 0.5) / STEPS as f32 - 1.0;
        let lit = cos_light.max(0.0);
        let wrapped = super::super::film::wrapped(cos_light, leak.around.x);
        let mut out = f64::from(leak.radiance.x * wrapped) * std::f64::consts::PI;
        for row in 0..STEPS {
            let cos_eye = (row as f32 + 0.5) / STEPS as f32;
            let source = layer.albedo().x * 0.25 / PI
                + leak.kept.x * often(cos_light, cos_eye, r0, leak.around).x;
            let radiance = source * lit / (lit + cos_eye);
            out += f64::from(radiance * cos_eye) * std::f64::consts::TAU / f64::from(STEPS);
        }
        sum += out / f64::from(STEPS);
    }
    // ∫ max(c, 0) dc is 1/2.
    2.0 * sum
}

#[test]
fn what_leaks_round_a_ball_is_taken_from_its_lit_side() {
    for albedo in [0.6, 0.9, 0.99] {
        let layer = layer(albedo, 0.0);
        let flat = thrown_back_by_ball(&layer, &Leak::NONE);
        for radius_m in [0.1, 0.02, 0.008, 0.004] {
            let leak = Leak::of(&layer, radius_m);
            let share = thrown_back_by_ball(&layer, &leak);
            println!("albedo {albedo}, radius {radius_m}: {share:.3}, flat {flat:.3}");
            assert!(share < 1.0, "albedo {albedo}, radius {radius_m}: {share}");
            // 8 % was seen where light is softened most.
            assert!((share / flat - 1.0).abs() < 0.12, "{share} for {flat}");
        }
        let large = Leak::of(&layer, 1e3);
        assert!((large.kept - 1.0).abs().max_element() < 1e-3);
    }
}

#[test]
fn h_is_that_of_the_tables() {
    // The integral equation solved with 64 Gauss points: albedo 1 and 0.8.
    for (albedo, cosine, exact) in [(1.0, 1.0, 2.9078), (1.0, 0.5, 2.0128), (0.8, 1.0, 1.5982)] {
        let gamma = (1.0_f32 - albedo).sqrt();
        let r0 = Vec3::splat((1.0 - gamma) / (1.0 + gamma));
        let got = h(Vec3::splat(cosine), r0).x;
        assert!((got / exact - 1.0).abs() < 0.01, "{albedo} {cosine}: {got}");
    }
}
