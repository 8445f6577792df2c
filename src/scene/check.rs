//! Collects everything that is out of range in a scene, so that one run tells it all.

use super::SceneError;

/// Collects problems; [`Checker::finish`] turns them into one error.
pub struct Checker {
    scene: String,
    problems: Vec<String>,
}

impl Checker {
    pub(super) fn new(scene: &str) -> Self {
        Self {
            scene: scene.to_owned(),
            problems: Vec::new(),
        }
    }

    /// `value` must be a number from `low` to `high`, both allowed. NaN is not.
    pub fn range(&mut self, key: &str, value: f32, low: f32, high: f32) {
        if !(low..=high).contains(&value) {
            self.problems
                .push(format!("{key} = {value} is not within {low} to {high}"));
        }
    }

    /// Each component must be within `low` to `high`.
    pub fn range3(&mut self, key: &str, value: impl Into<[f32; 3]>, low: f32, high: f32) {
        for component in value.into() {
            self.range(key, component, low, high);
        }
    }

    /// Smallest and largest corner of a box, in this order.
    pub fn corners(&mut self, key: &str, [low, high]: [glam::Vec3; 2]) {
        self.range3(key, low, -1e6, 1e6);
        self.range3(key, high, -1e6, 1e6);
        if low.cmpgt(high).any() {
            self.problem(
                key,
                "the first corner must be the smaller one on every axis",
            );
        }
    }

    /// Says `problem` about `key`.
    pub fn problem(&mut self, key: &str, problem: &str) {
        self.problems.push(format!("{key}: {problem}"));
    }

    /// Exactly one of the alternatives `names` must be given.
    pub fn exactly_one(&mut self, key: &str, given: &[bool], names: &str) {
        let count = given.iter().filter(|&&is_given| is_given).count();
        if count != 1 {
            self.problems.push(format!(
                "{key} needs exactly one of {names}; it has {count}"
            ));
        }
    }

    pub(super) fn finish(self) -> Result<(), SceneError> {
        if self.problems.is_empty() {
            return Ok(());
        }
        Err(SceneError {
            scene: self.scene,
            message: self.problems.join("; "),
        })
    }
}
