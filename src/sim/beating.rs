//! A body that beats: where in its beat it is, and what that does to volumes.

use super::{Beat, BodySetup, diagnose::rest_volume_m3};

/// The heartbeat of a body in time.
#[derive(Clone, Debug)]
pub struct Beating {
    pub beat: Beat,
    /// Whether it rests from the end of this beat on.
    pub ends: bool,
    /// Beats since it started, less the whole ones.
    pub phase: f64,
    /// How much of each particle is muscle.
    pub activity: Vec<f32>,
    /// The same of each point of the surface.
    points: Vec<f32>,
    /// Σ V a, Σ V a² and Σ V a³ over the tetrahedra, of volume V and activity a [m³].
    moments_m3: [f64; 3],
}

impl Beating {
    /// At the start of a beat; `sound` are the tetrahedra that take part.
    pub fn new(setup: &BodySetup, sound: &[u32], beat: Beat) -> Self {
        let activity = if setup.activity.is_empty() {
            vec![1.0; setup.tets.particles.len()]
        } else {
            setup.activity.clone()
        };
        let of = |particle: u32| activity[particle as usize];
        let mut moments_m3 = [0.0; 3];
        for &tet in sound {
            let corners = setup.tets.tets[tet as usize];
            let mean = corners.map(|c| f64::from(of(c))).iter().sum::<f64>() / 4.0;
            let mut part = rest_volume_m3(&setup.tets, tet as usize);
            for moment in &mut moments_m3 {
                part *= mean;
                *moment += part;
            }
        }
        let embedding = &setup.embedding;
        let points = (embedding.particles.iter().zip(&embedding.weights))
            .map(|(particles, weights)| {
                let mean: f32 = (0..4).map(|k| weights[k] * of(particles[k])).sum();
                // A point outside of its tetrahedron is extrapolated.
                mean.clamp(0.0, 1.0)
            })
            .collect();
        Self {
            beat,
            ends: false,
            phase: 0.0,
            activity,
            points,
            moments_m3,
        }
    }

    /// Whether muscle works, or will.
    pub fn works(&self) -> bool {
        !self.ends || self.phase > 0.0
    }

    /// Goes on by a time [s].
    pub fn advance(&mut self, time_s: f64) {
        if self.works() {
            let phase = self.phase + self.beat.beats(time_s);
            self.phase = if self.ends && phase >= 1.0 {
                0.0
            } else {
                phase.fract()
            };
        }
    }

    /// Shortening of full muscle now, as a share of its length.
    pub fn shortening(&self) -> f32 {
        self.beat.shortening(self.phase)
    }

    /// The same in a time [s] from now.
    pub fn shortening_in(&self, time_s: f64) -> f32 {
        let phase = self.phase + self.beat.beats(time_s);
        if !self.works() || (self.ends && phase >= 1.0) {
            0.0
        } else {
            self.beat.shortening(phase)
        }
    }

    /// By how much the shapes that all tetrahedra want are smaller than at rest [m³].
    pub fn lost_m3(&self) -> f64 {
        // Σ V (1 − (1 − c a)³)
        let c = f64::from(self.shortening());
        let [first, second, third] = self.moments_m3;
        c * (3.0 * first - c * (3.0 * second - c * third))
    }

    /// Volume of tissue that nothing presses, over that at rest, at each point of the surface.
    pub fn point_volumes(&self) -> impl Iterator<Item = f32> {
        let shortening = self.shortening();
        self.points
            .iter()
            .map(move |a| (1.0 - a * shortening).powi(3))
    }
}
