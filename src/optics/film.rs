//! The wet film on tissue and the diffuse light under it.
//!
//! Twin of `shaders/film.wgsl`.

use glam::Vec3;

/// ((n − 1) / (n + 1))² for n = 1.38: tissue under a film of water.
pub const FILM_F0: f32 = 0.025_492_6;

/// Fresnel reflectance by Schlick's approximation.
pub fn fresnel(cosine: f32) -> f32 {
    let x = 1.0 - cosine.clamp(0.0, 1.0);
    FILM_F0 + (1.0 - FILM_F0) * x * x * x * x * x
}

/// Radiance thrown back per irradiance on a plane that faces the light [1/sr]: GGX with a = roughness².
pub fn highlight(normal: Vec3, to_light: Vec3, to_eye: Vec3, roughness: f32) -> f32 {
    let half_way = (to_light + to_eye).normalize_or_zero();
    let n_h = normal.dot(half_way).max(0.0);
    let l_h = to_light.dot(half_way).max(0.1);
    let a2 = roughness.powi(4);
    let base = n_h * n_h * (a2 - 1.0) + 1.0;
    let n_l = normal.dot(to_light).max(0.0);
    n_l * a2 * fresnel(l_h) / (4.0 * std::f32::consts::PI * base * base * l_h * l_h)
}

/// Share of a light's irradiance that arrives where light wraps round the terminator by `wrap` (Green 2004, 16.2),
/// divided so that the sum over the sphere stays what it is without.
pub fn wrapped(cosine: f32, wrap: f32) -> f32 {
    (cosine + wrap).max(0.0) / ((1.0 + wrap) * (1.0 + wrap))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn wrapped_light_keeps_the_energy() {
        for wrap in [0.0, 0.2, 0.5, 1.0] {
            let sum: f64 = (0..100_000)
                .map(|i| {
                    let cosine = -1.0 + 2.0 * (i as f64 + 0.5) / 1e5;
                    f64::from(wrapped(cosine as f32, wrap)) * 2.0 / 1e5
                })
                .sum();
            // ∫ max(c, 0) dc over −1 to 1 is 1/2.
            assert!((sum - 0.5).abs() < 1e-4, "wrap {wrap}: {sum}");
        }
    }

    #[test]
    fn the_film_reflects_more_at_grazing_angles_and_never_more_than_all() {
        assert!((fresnel(1.0) - 0.0255).abs() < 1e-4);
        assert_eq!(fresnel(0.0), 1.0);
        assert!(fresnel(0.3) > fresnel(0.6));
    }

    #[test]
    fn a_film_throws_back_a_few_hundredths_of_the_light_it_gets() {
        // ∫ f cos θ dω over the upper half, light at 30 degrees.
        let to_light = Vec3::new(0.5, 0.0, 0.866_025_4);
        for roughness in [0.15, 0.3, 0.6] {
            let (rows, columns) = (800, 800);
            let mut sum = 0.0_f64;
            for row in 0..rows {
                let z = (row as f32 + 0.5) / rows as f32;
                let sine = (1.0 - z * z).sqrt();
                for column in 0..columns {
                    let angle = std::f32::consts::TAU * column as f32 / columns as f32;
                    let to_eye = Vec3::new(sine * angle.cos(), sine * angle.sin(), z);
                    let light = highlight(Vec3::Z, to_light, to_eye, roughness);
                    sum += f64::from(light * z) * std::f64::consts::TAU / f64::from(rows * columns);
                }
            }
            let share = sum / f64::from(to_light.z);
            // Fresnel at 30 degrees is 2.6 %; the approximate shadowing gains up to half at roughness 0.6.
            assert!(
                (0.015..0.045).contains(&share),
                "roughness {roughness}: {share}"
            );
        }
    }
}
