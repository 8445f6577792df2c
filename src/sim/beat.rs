//! The heartbeat: how far muscle has shortened at a moment of the beat.
//!
//! All times follow the left ventricle's volume at rest: it falls for a third of the beat, stays low for a
//! moment, fills quickly and waits (C. J. Wiggers, "Circulation in Health and Disease", 1923; the diagram is in
//! every textbook of physiology). Rise and fall have no kink and no step in acceleration, so that they stir no
//! waves.

use super::out_of_range;
use serde::{Deserialize, Serialize};

/// Shares of a beat: muscle shortens until the first, stays short until the second, and is long again from the
/// third on.
const SHORTENED: [f64; 3] = [0.30, 0.36, 0.66];

/// How muscle beats.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Beat {
    /// Beats a minute.
    pub rate_per_min: f32,
    /// By how much muscle shortens at most, as a share of its length at rest.
    pub strain: f32,
}

impl Beat {
    /// What is wrong with these values, with the allowed range; `None` if they can be used.
    pub fn problem(&self) -> Option<String> {
        out_of_range(&[
            ("rate_per_min", self.rate_per_min, 1.0, 300.0),
            ("strain", self.strain, 0.0, 0.3),
        ])
    }

    /// Beats in a time [s].
    pub fn beats(&self, time_s: f64) -> f64 {
        f64::from(self.rate_per_min) / 60.0 * time_s
    }

    /// By how much muscle has shortened at `phase`, counted in beats from the start of one, as a share of its
    /// length at rest.
    pub fn shortening(&self, phase: f64) -> f32 {
        let phase = phase.rem_euclid(1.0);
        let [short, hold, long] = SHORTENED;
        let share = if phase < hold {
            smooth(phase / short)
        } else {
            1.0 - smooth((phase - hold) / (long - hold))
        };
        (f64::from(self.strain) * share) as f32
    }
}

/// From 0 at 0 to 1 at 1, flat and straight at both ends: 6x⁵ − 15x⁴ + 10x³.
fn smooth(x: f64) -> f64 {
    let x = x.clamp(0.0, 1.0);
    x * x * x * (x * (6.0 * x - 15.0) + 10.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    const BEAT: Beat = Beat {
        rate_per_min: 70.0,
        strain: 0.2,
    };

    /// Largest second difference of the shortening over a beat, over the square of the step.
    fn sharpest(shortening: impl Fn(f64) -> f64) -> f64 {
        const STEP: f64 = 1e-3;
        (0..1000)
            .map(|i| {
                let x = f64::from(i) * STEP;
                let bend = shortening(x + STEP) - 2.0 * shortening(x) + shortening(x - STEP);
                (bend / (STEP * STEP)).abs()
            })
            .fold(0.0, f64::max)
    }

    #[test]
    fn muscle_shortens_by_the_strain_and_is_at_rest_as_a_beat_starts() {
        assert_eq!(BEAT.shortening(0.0), 0.0);
        assert_eq!(BEAT.shortening(0.33), 0.2);
        assert_eq!(BEAT.shortening(0.8), 0.0);
        assert_eq!(BEAT.shortening(7.33), BEAT.shortening(0.33));
        let systole = (0..1000).filter(|&i| BEAT.shortening(f64::from(i) * 1e-3) > 0.1);
        // Longer relaxed than contracted: more than half short from the middle of one flank to that of the other.
        assert!((355..365).contains(&systole.count()));
    }

    #[test]
    fn shortening_has_no_kink() {
        // 10/√3 over the square of the shorter flank, times the strain; the rest is room for f32.
        let bound = 1.2 * 0.2 * 5.78 / (0.3 * 0.3);
        let found = sharpest(|x| f64::from(BEAT.shortening(x)));
        assert!(found < bound, "{found}");
        let kinked = sharpest(|x| 0.2 * (x.rem_euclid(1.0) / 0.3).min(1.0));
        assert!(
            kinked > 5.0 * bound,
            "the check must be able to fail: {kinked}"
        );
    }

    #[test]
    fn beats_that_no_heart_has_are_refused() {
        assert_eq!(BEAT.problem(), None);
        for (rate_per_min, strain) in [(0.0, 0.1), (f32::NAN, 0.1), (70.0, 0.5), (70.0, -0.1)] {
            let beat = Beat {
                rate_per_min,
                strain,
            };
            assert!(beat.problem().is_some(), "{beat:?}");
        }
    }
}
