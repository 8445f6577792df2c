//! Percentiles of a list of times. A mean alone hides the frames that a user sees.

use serde::Serialize;

/// Share of the slowest frames in [`Stats::low1pct`].
const SLOWEST_SHARE: f64 = 0.01;

/// What a list of values looks like, in the unit of the values.
#[derive(Clone, Copy, Debug, PartialEq, Serialize)]
pub struct Stats {
    /// Median.
    pub p50: f64,
    /// 95th percentile.
    pub p95: f64,
    /// 99th percentile.
    pub p99: f64,
    /// Largest.
    pub max: f64,
    /// Mean of the slowest 1 %, of at least one value.
    pub low1pct: f64,
}

impl Stats {
    /// Statistics of `values`; `None` if there are none. NaN counts as the largest value.
    pub fn of(values: impl IntoIterator<Item = f32>) -> Option<Self> {
        let sorted = sorted(values);
        let slowest = (sorted.len() as f64 * SLOWEST_SHARE).round().max(1.0) as usize;
        let slowest = sorted.get(sorted.len().checked_sub(slowest)?..)?;
        Some(Self {
            p50: percentile(&sorted, 0.50)?,
            p95: percentile(&sorted, 0.95)?,
            p99: percentile(&sorted, 0.99)?,
            max: percentile(&sorted, 1.0)?,
            low1pct: slowest.iter().sum::<f64>() / slowest.len() as f64,
        })
    }
}

/// `values` in ascending order, NaN last.
pub fn sorted(values: impl IntoIterator<Item = f32>) -> Vec<f64> {
    let mut sorted: Vec<f64> = values.into_iter().map(f64::from).collect();
    // A NaN of either sign is a failure and belongs at the bad end.
    sorted.sort_by(|a, b| a.is_nan().cmp(&b.is_nan()).then(a.total_cmp(b)));
    sorted
}

/// The value below which `share` (0 to 1) of an ascending list lies, linear between neighbours;
/// `None` if the list is empty.
pub fn percentile(sorted: &[f64], share: f64) -> Option<f64> {
    let last = sorted.len().checked_sub(1)?;
    let place = share.clamp(0.0, 1.0) * last as f64;
    let (below, above) = (
        sorted[place.floor() as usize],
        sorted[place.ceil() as usize],
    );
    let rest = place.fract();
    // Without the test an infinite neighbour at weight zero would give NaN.
    Some(if rest == 0.0 {
        below
    } else {
        below + rest * (above - below)
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn percentiles_of_zero_to_a_hundred_are_their_own_number() {
        let values = sorted((0..=100).rev().map(|k| k as f32));
        for share in [0.0, 0.5, 0.95, 0.99, 1.0] {
            // Place and value are the same multiple of 1/100 up to rounding of the product.
            assert!((percentile(&values, share).unwrap() - 100.0 * share).abs() < 1e-12);
        }
    }

    #[test]
    fn slowest_percent_is_the_mean_of_the_slowest_and_at_least_one() {
        let stats = Stats::of((1..=200).map(|k| k as f32)).unwrap();
        assert_eq!(stats.low1pct, 199.5);
        assert_eq!(Stats::of([3.0, 1.0, 2.0]).unwrap().low1pct, 3.0);
    }

    #[test]
    fn median_of_two_lies_between_them_and_nothing_has_none() {
        assert_eq!(Stats::of([1.0, 2.0]).unwrap().p50, 1.5);
        assert_eq!(Stats::of([]), None);
    }

    #[test]
    fn one_bad_frame_in_a_hundred_shows_in_the_slowest_percent_and_not_in_the_median() {
        let stats = Stats::of((0..100).map(|k| if k == 41 { 500.0 } else { 10.0 })).unwrap();
        assert_eq!((stats.p50, stats.max, stats.low1pct), (10.0, 500.0, 500.0));
    }

    #[test]
    fn not_a_number_is_the_worst_and_never_lost() {
        let stats = Stats::of([1.0, -f32::NAN, 2.0]).unwrap();
        assert!(stats.max.is_nan());
        assert_eq!(stats.p50, 2.0);
    }
}
