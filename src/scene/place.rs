//! Places as shares of the body's box at rest.

use glam::Vec3;

/// The body's box at rest [m].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RestBox {
    /// Smallest corner.
    pub low: Vec3,
    /// Largest corner.
    pub high: Vec3,
}

impl RestBox {
    /// A place given in metres or as a share of the box: (0, 0, 0) is the smallest corner, (1, 1, 1)
    /// the largest. Metres win if both are given; nothing if neither is.
    pub fn place(&self, metres: Option<Vec3>, share: Option<Vec3>) -> Option<Vec3> {
        metres.or_else(|| share.map(|s| self.low + s * (self.high - self.low)))
    }

    /// A length given in metres or as a share of the longest extent.
    pub fn length(&self, metres: Option<f32>, share: Option<f32>) -> Option<f32> {
        metres.or_else(|| share.map(|s| s * self.longest_m()))
    }

    /// Longest side of the box [m].
    pub fn longest_m(&self) -> f32 {
        (self.high - self.low).max_element()
    }

    /// Middle of the box [m].
    pub fn middle(&self) -> Vec3 {
        0.5 * (self.low + self.high)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn shares_of_a_box_are_places_and_metres_win() {
        let rest = RestBox {
            low: Vec3::new(-1.0, 0.0, 2.0),
            high: Vec3::new(1.0, 4.0, 3.0),
        };
        let middle = rest.place(None, Some(Vec3::splat(0.5)));
        assert_eq!(middle, Some(Vec3::new(0.0, 2.0, 2.5)));
        assert_eq!(
            rest.place(Some(Vec3::ONE), Some(Vec3::ZERO)),
            Some(Vec3::ONE)
        );
        assert_eq!(rest.length(None, Some(0.5)), Some(2.0));
        assert_eq!(rest.place(None, None), None);
    }
}
