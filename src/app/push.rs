//! Force against depth of a push: what a tool that goes in and comes out again is answered by.

/// Points that are kept; of a longer push every second one is dropped, as often as it takes.
const POINTS_MAX: usize = 2000;

/// The push that goes on, or the last one.
#[derive(Clone, Debug, Default)]
pub struct PushCurve {
    /// Depth [mm] and force [N], in the order of time.
    points: Vec<[f64; 2]>,
    goes_on: bool,
    /// Time steps to a point, and those since the last one.
    every: u32,
    since: u32,
}

impl PushCurve {
    /// Adds a time step: how deep the tool is pushed in [m], nothing if none pushes, and the force on it [N].
    pub fn add(&mut self, depth_m: Option<f32>, force_n: f32) {
        let Some(depth_m) = depth_m else {
            self.goes_on = false;
            return;
        };
        if !self.goes_on {
            *self = Self {
                goes_on: true,
                every: 1,
                ..Self::default()
            };
        }
        self.since += 1;
        if self.since < self.every {
            return;
        }
        self.since = 0;
        if self.points.len() == POINTS_MAX {
            let mut is_kept = false;
            self.points.retain(|_| {
                is_kept = !is_kept;
                is_kept
            });
            self.every *= 2;
        }
        self.points
            .push([1e3 * f64::from(depth_m), f64::from(force_n)]);
    }

    /// Depth [mm] and force [N], in the order of time.
    pub fn points(&self) -> &[[f64; 2]] {
        &self.points
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_push_is_kept_until_the_next_one_begins() {
        let mut curve = PushCurve::default();
        curve.add(None, 0.0);
        assert!(curve.points().is_empty());
        for k in 0..5 {
            curve.add(Some(0.001 * k as f32), k as f32);
        }
        curve.add(None, 0.0);
        assert_eq!(curve.points().len(), 5);
        assert!((curve.points()[2][0] - 2.0).abs() < 1e-6 && curve.points()[2][1] == 2.0);
        curve.add(Some(0.0), 0.5);
        assert_eq!(curve.points(), [[0.0, 0.5]]);
    }

    #[test]
    fn a_push_without_end_takes_no_more_room_and_loses_neither_end() {
        let mut curve = PushCurve::default();
        for k in 0..100_000 {
            curve.add(Some(1e-6 * k as f32), 1.0);
        }
        assert!(curve.points().len() <= POINTS_MAX);
        assert_eq!(curve.points()[0][0], 0.0);
        let last_mm = curve.points().last().expect("a point")[0];
        assert!(last_mm > 99.0, "{last_mm} of 100 mm");
    }
}
