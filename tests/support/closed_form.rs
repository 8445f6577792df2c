//! Answers of elasticity by formula, for stable neo-Hookean tissue and for small strains.

#![allow(dead_code)] // Each test binary asks for a part of it.

use palpate::reference::Material;
use std::f64::consts::PI;

/// Lateral stretch t and stress P [Pa] of tissue that is pulled to the stretch `s` along one axis and
/// free to the sides.
///
/// F = diag(s, t, t). No stress to the sides: μ t + (l (J − 1) − μ) s t = 0, so J = 1 + μ/l − μ/(l s),
/// t² = J/s, and P = μ (s − t²/s); l = λ + μ.
pub fn uniaxial(material: Material, s: f64) -> (f64, f64) {
    let (mu, l) = (material.mu_pa, material.lambda_pa + material.mu_pa);
    let volume = 1.0 + mu / l - mu / (l * s);
    let lateral_squared = volume / s;
    (lateral_squared.sqrt(), mu * (s - lateral_squared / s))
}

/// Lengthening of a bar of `length_m` that hangs by one end under `weight_pa` = ρ g L [m].
///
/// The stress at X is ρ g (L − X); the stretch there is that of [`uniaxial`]. For a small weight it is
/// ρ g L²/2E.
pub fn hanging_bar_m(material: Material, length_m: f64, weight_pa: f64) -> f64 {
    // Gauss's rule of two points on each of 200 parts: the stretch is smooth.
    let parts = 200;
    let node = 0.5 / 3.0_f64.sqrt();
    let sum: f64 = (0..parts)
        .flat_map(|part| [part as f64 + 0.5 - node, part as f64 + 0.5 + node])
        .map(|at| stretch_under(material, weight_pa * (1.0 - at / parts as f64)) - 1.0)
        .sum();
    length_m * sum / (2 * parts) as f64
}

/// The stretch at which [`uniaxial`] has the stress `stress_pa`, by bisection between 0.5 and 3.
fn stretch_under(material: Material, stress_pa: f64) -> f64 {
    let (mut low, mut high) = (0.5, 3.0);
    for _ in 0..60 {
        let middle = 0.5 * (low + high);
        if uniaxial(material, middle).1 < stress_pa {
            low = middle;
        } else {
            high = middle;
        }
    }
    0.5 * (low + high)
}

/// Sag of the end of a slender square cantilever under its own weight [m]: Timoshenko's beam,
/// q L⁴/8EI + q L²/2κGA, with κ = 5/6 (exact for a rectangle at ν = 0, where G = E/2).
pub fn cantilever_m(youngs_modulus_pa: f64, length_m: f64, side_m: f64, weight_n_m3: f64) -> f64 {
    let (area, inertia) = (side_m.powi(2), side_m.powi(4) / 12.0);
    let load = weight_n_m3 * area;
    let shear_modulus = youngs_modulus_pa / 2.0;
    load * length_m.powi(4) / (8.0 * youngs_modulus_pa * inertia)
        + load * length_m.powi(2) / (2.0 * 5.0 / 6.0 * shear_modulus * area)
}

/// Lowest frequency of a bar held at one end that swings along itself [Hz]: c/4L, c = √(E/ρ).
pub fn bar_frequency_hz(youngs_modulus_pa: f64, density_kg_m3: f64, length_m: f64) -> f64 {
    (youngs_modulus_pa / density_kg_m3).sqrt() / (4.0 * length_m)
}

/// Its shape at `x` from the held end: 1 at the free one.
pub fn bar_mode(x: f64, length: f64) -> f64 {
    (PI * x / (2.0 * length)).sin()
}
