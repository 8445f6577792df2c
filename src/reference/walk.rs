//! Light of all orders in one even tissue below a surface, by random walks in f64 from the eye.
//!
//! A walk goes into the body with the view ray, scatters by Schlick's function, sampled exactly, and looks for the light
//! wherever it scatters. Boundaries are index-matched: nothing is refracted, and what leaves is gone, so a body must not
//! cast light back into itself. Each walk has numbers of its own, so the answer is the same from any number of threads.
//!
//! Sources: François et al., "Subsurface Texture Mapping", INRIA 2006, eq. 2 (the phase function); G. Marsaglia,
//! "Xorshift RNGs", Journal of Statistical Software 8, 2003; J. Arvo, D. Kirk, "Particle Transport and Image Synthesis",
//! SIGGRAPH 1990 (roulette).

use super::rays::{HalfLine, Rays, all_by};
use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// An even tissue in one colour.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WalkTissue {
    /// σ_s [1/m].
    pub scattering_per_m: f64,
    /// σ_t [1/m].
    pub extinction_per_m: f64,
    /// Schlick's k.
    pub asymmetry: f64,
}

/// Mean of many walks, and its standard error.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Walked {
    /// Radiance per irradiance on a plane that faces the light [1/sr]: of light scattered once.
    pub once: f64,
    /// Of light of all orders.
    pub full: f64,
    /// Standard error of `full`.
    pub error: f64,
}

/// Weight below which a walk is ended by chance.
const ROULETTE: f64 = 0.1;

/// What comes back along each of `lines`, which start where they enter the body, for a far light in the direction
/// `to_light`, as the mean of so many `walks` each.
///
/// # Panics
///
/// If there are no threads, or fewer than two walks.
pub fn walked(
    rays: &Rays,
    tissue: &WalkTissue,
    to_light: DVec3,
    lines: &[HalfLine],
    walks: u32,
    threads: usize,
) -> Vec<Walked> {
    assert!(walks > 1, "an error needs two walks");
    let numbered: Vec<(u64, HalfLine)> = (0..).zip(lines.iter().copied()).collect();
    all_by(threads, &numbered, |&(number, line)| {
        let (mut once, mut sum, mut square) = (0.0, 0.0, 0.0);
        for walk in 0..u64::from(walks) {
            let mut random = Random::new(number * u64::from(walks) + walk);
            let (first, all) = one_walk(rays, tissue, to_light, line, &mut random);
            once += first;
            sum += all;
            square += all * all;
        }
        let n = f64::from(walks);
        let variance = (square / n - (sum / n).powi(2)).max(0.0) / (n - 1.0);
        Walked {
            once: once / n,
            full: sum / n,
            error: variance.sqrt(),
        }
    })
}

/// What one walk finds: after its first scattering, and in all.
fn one_walk(
    rays: &Rays,
    tissue: &WalkTissue,
    to_light: DVec3,
    (mut at, mut along): HalfLine,
    random: &mut Random,
) -> (f64, f64) {
    let (sigma_t, k) = (tissue.extinction_per_m, tissue.asymmetry);
    let albedo = tissue.scattering_per_m / sigma_t;
    let (mut weight, mut first, mut all) = (1.0, None, 0.0);
    // Where the body ends; none if it does not, as with a sheet that stands for a half-space.
    while let Some(next) = free_way(rays, (at, along), -random.next().ln() / sigma_t) {
        at = next;
        weight *= albedo;
        if let Some(way) = rays.exit_m((at, to_light)) {
            // Both directions of Schlick's function point away from the place.
            let base = 1.0 - k * along.dot(to_light);
            let phase = (1.0 - k * k) / (4.0 * PI * base * base);
            let light = weight * phase * (-sigma_t * way).exp();
            all += light;
            first = first.or(Some(light));
        }
        first = first.or(Some(0.0));
        if weight < ROULETTE {
            if random.next() > weight / ROULETTE {
                break;
            }
            weight = ROULETTE;
        }
        // Schlick's function, inverted: (2 u + k − 1) / (2 k u − k + 1).
        let u = random.next();
        let cosine = (2.0 * u + k - 1.0) / (2.0 * k * u - k + 1.0);
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        let (b, c) = along.any_orthonormal_pair();
        let turn = TAU * random.next();
        along = (cosine * along + sine * (turn.cos() * b + turn.sin() * c)).normalize();
    }
    (first.unwrap_or(0.0), all)
}

/// The place `way` [m] along `line`; `None` if the body ends before.
fn free_way(rays: &Rays, line: HalfLine, way: f64) -> Option<DVec3> {
    let (from, along) = line;
    let inside = rays.exit_m(line).is_none_or(|exit| way < exit);
    inside.then(|| from + way * along)
}

/// Numbers between 0 and 1 that a seed begins.
struct Random(u64);

impl Random {
    fn new(seed: u64) -> Self {
        // Neighbouring seeds must not begin alike: a few rounds of a mixing step (Steele et al., SplittableRandom, 2014).
        let mut z = seed.wrapping_add(1).wrapping_mul(0x9e37_79b9_7f4a_7c15);
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        Self((z ^ (z >> 31)) | 1)
    }

    fn next(&mut self) -> f64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        ((self.0 >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Two triangles in the plane z = 0, wide enough to be a half-space for millimetres of light.
    fn half_space() -> Rays {
        let corners = [[-1.0, -1.0], [1.0, -1.0], [1.0, 1.0], [-1.0, 1.0]];
        let points = corners.map(|[x, y]| DVec3::new(x, y, 0.0));
        Rays::new(&points, &[[0, 1, 2], [0, 2, 3]])
    }

    fn directions(cos_light: f64, cos_eye: f64) -> (DVec3, HalfLine) {
        let sine = |c: f64| (1.0 - c * c).sqrt();
        let to_light = DVec3::new(sine(cos_light), 0.0, cos_light);
        // Lit and seen from the same side of the normal, off the edge that both triangles share.
        let from = DVec3::new(0.1, 0.03, 0.0);
        (to_light, (from, DVec3::new(-sine(cos_eye), 0.0, -cos_eye)))
    }

    /// Mean over many lines: (once, full, error of full).
    fn mean(tissue: &WalkTissue, cos_light: f64, cos_eye: f64) -> (f64, f64, f64) {
        let (to_light, line) = directions(cos_light, cos_eye);
        let found = walked(&half_space(), tissue, to_light, &[line; 40], 500, 2);
        let n = found.len() as f64;
        (
            found.iter().map(|w| w.once).sum::<f64>() / n,
            found.iter().map(|w| w.full).sum::<f64>() / n,
            found.iter().map(|w| w.error.powi(2)).sum::<f64>().sqrt() / n,
        )
    }

    #[test]
    fn light_scattered_once_in_a_half_space_has_its_closed_form() {
        for (k, cos_light, cos_eye) in [(0.25, 0.72, 0.55), (0.8, 0.4, 0.9), (0.0, 0.9, 0.3)] {
            let tissue = WalkTissue {
                scattering_per_m: 2000.0,
                extinction_per_m: 2600.0,
                asymmetry: k,
            };
            let (once, ..) = mean(&tissue, cos_light, cos_eye);
            let (to_light, (_, along)) = directions(cos_light, cos_eye);
            let base = 1.0 - k * along.dot(to_light);
            let phase = (1.0 - k * k) / (4.0 * PI * base * base);
            let exact = 2.0 / 2.6 * phase * cos_light / (cos_light + cos_eye);
            // 20,000 walks of numbers between 0 and twice their mean: 0.6 % is one standard error.
            assert!(
                (once / exact - 1.0).abs() < 0.025,
                "k {k}: {once} for {exact}"
            );
        }
    }

    #[test]
    fn light_of_all_orders_in_an_even_half_space_is_that_of_chandrasekhar() {
        let tissue = WalkTissue {
            scattering_per_m: 800.0,
            extinction_per_m: 1000.0,
            asymmetry: 0.0,
        };
        let (once, full, error) = mean(&tissue, 1.0, 1.0);
        // H(1)² at albedo 0.8, of the integral equation solved with 64 Gauss points.
        let exact = 0.8 / (4.0 * PI) * 0.5 * 1.59822 * 1.59822;
        assert!(error < 0.02 * exact, "{error}");
        assert!(
            (full - exact).abs() < 4.0 * error,
            "{full} ± {error} for {exact}"
        );
        // What the check would say of light scattered once.
        assert!((once - exact).abs() > 20.0 * error, "{once}");
    }

    #[test]
    fn any_number_of_threads_walks_alike() {
        let tissue = WalkTissue {
            scattering_per_m: 800.0,
            extinction_per_m: 1000.0,
            asymmetry: 0.4,
        };
        let (to_light, line) = directions(0.6, 0.8);
        let by = |threads| walked(&half_space(), &tissue, to_light, &[line; 7], 20, threads);
        assert_eq!(by(1), by(3));
        assert_ne!(by(1)[0], by(1)[1], "each line walks by numbers of its own");
    }
}
