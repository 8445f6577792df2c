//! What walks of photons share, for tests: numbers, and where a photon goes that was scattered.

use glam::DVec3;

/// Numbers between 0 and 1, the same ones every time.
pub struct Random(u64);

impl Random {
    pub fn new() -> Self {
        Self(0x9e37_79b9_7f4a_7c15)
    }

    pub fn next(&mut self) -> f64 {
        // Source: Marsaglia, "Xorshift RNGs", Journal of Statistical Software 8, 2003.
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        ((self.0 >> 11) as f64 + 0.5) / (1u64 << 53) as f64
    }

    /// The weight of a walk after a game of chance that ends light ones; `None` if it ends.
    pub fn survivor(&mut self, weight: f64) -> Option<f64> {
        const LEAST: f64 = 0.1;
        if weight >= LEAST {
            return Some(weight);
        }
        (self.next() <= weight / LEAST).then_some(LEAST)
    }

    /// The direction of a photon that went `along` before it was scattered with Schlick's `k`.
    pub fn scattered(&mut self, along: DVec3, k: f64) -> DVec3 {
        // Schlick's function, inverted: (2 u + k − 1) / (2 k u − k + 1).
        let u = self.next();
        let cosine = (2.0 * u + k - 1.0) / (2.0 * k * u - k + 1.0);
        let sine = (1.0 - cosine * cosine).max(0.0).sqrt();
        let (b, c) = along.any_orthonormal_pair();
        let around = std::f64::consts::TAU * self.next();
        (cosine * along + sine * (around.cos() * b + around.sin() * c)).normalize()
    }
}
