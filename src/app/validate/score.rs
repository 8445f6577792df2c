//! Scores of a rendered scene, and the goals of its folder.

use super::super::AppError;
use super::scene::ReferenceScene;
use crate::measure::npz;
use crate::measure::radiance::{self, Picture, Reference, Scores};
use serde::Deserialize;
use serde_json::json;
use std::collections::HashMap;
use std::path::Path;

/// Heads of the table.
pub const HEAD: [&str; 13] = [
    "scene",
    "relRMSE",
    "bias",
    "FLIP",
    "after gain",
    "vein",
    "cover px",
    "not finite",
    "all: once",
    "all: calibrated",
    "surface ms",
    "frame ms",
    "goal",
];

/// What a scene's scores must not exceed.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
pub struct Goal {
    #[serde(rename = "relRMSE")]
    pub rel_rmse: f64,
    #[serde(rename = "FLIP", default)]
    pub flip: Option<f64>,
    #[serde(default)]
    pub vein: Option<f64>,
}

/// The goals of a folder, by scene.
#[derive(Debug, Default)]
pub struct Goals(HashMap<String, Goal>);

impl Goals {
    /// The goals in `dir/goals.json` under `single`; none if there is no such file.
    pub fn of_folder(dir: &Path) -> Result<Self, AppError> {
        #[derive(Deserialize)]
        struct File {
            #[serde(default)]
            single: HashMap<String, Goal>,
        }
        let path = dir.join("goals.json");
        let bytes = match std::fs::read(&path) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => {
                return Ok(Self::default());
            }
            Err(source) => {
                return Err(AppError::Read {
                    path: path.display().to_string(),
                    source,
                });
            }
        };
        let file: File = serde_json::from_slice(&bytes)
            .map_err(|error| AppError::Usage(format!("{}: {error}", path.display())))?;
        Ok(Self(file.single))
    }

    /// Names of goals of which no scene is among `rows`, in order.
    pub fn without_scene(&self, rows: &[Scored]) -> Vec<&str> {
        let is_absent = |name: &&str| rows.iter().all(|row| row.name != *name);
        let mut names: Vec<&str> = self
            .0
            .keys()
            .map(String::as_str)
            .filter(is_absent)
            .collect();
        names.sort_unstable();
        names
    }

    /// The goal of the scene called `name`.
    pub fn of(&self, name: &str) -> Option<Goal> {
        self.0.get(name).copied()
    }
}

/// The reference picture of `scene`; `None` if there is none.
///
/// # Errors
///
/// [`AppError::Usage`] naming the file and what is wrong with it.
pub fn reference(scene: &ReferenceScene) -> Result<Option<Reference>, AppError> {
    let Some(arrays) = Arrays::of(scene)? else {
        return Ok(None);
    };
    let without_veins = if arrays.has("single_noveins") {
        Some(arrays.rgb("single_noveins")?)
    } else {
        None
    };
    Ok(Some(Reference {
        without_veins,
        ..arrays.reference("single")?
    }))
}

/// The reference picture of light of all orders and the standard error of each of its numbers; `None` if there is none.
///
/// # Errors
///
/// As [`reference`].
pub fn full_reference(scene: &ReferenceScene) -> Result<Option<(Reference, Vec<f32>)>, AppError> {
    let arrays = Arrays::of(scene)?.filter(|arrays| arrays.has("full") && arrays.has("full_se"));
    arrays
        .map(|arrays| Ok((arrays.reference("full")?, arrays.rgb("full_se")?)))
        .transpose()
}

/// The arrays of a scene's reference file.
struct Arrays<'a> {
    scene: &'a ReferenceScene,
    bytes: Vec<u8>,
    names: Vec<String>,
}

impl<'a> Arrays<'a> {
    fn of(scene: &'a ReferenceScene) -> Result<Option<Self>, AppError> {
        let path = &scene.reference;
        let bytes = match std::fs::read(path) {
            Ok(bytes) => bytes,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => return Ok(None),
            Err(source) => {
                return Err(AppError::Read {
                    path: path.display().to_string(),
                    source,
                });
            }
        };
        let names = npz::names(&bytes)
            .map_err(|problem| AppError::Usage(format!("{}: {problem}", path.display())))?;
        Ok(Some(Self {
            scene,
            bytes,
            names,
        }))
    }

    fn has(&self, name: &str) -> bool {
        self.names.iter().any(|known| known == name)
    }

    fn values(&self, name: &str, channels: &[u64]) -> Result<Vec<f32>, AppError> {
        let wrong = |problem: String| {
            AppError::Usage(format!("{}: {problem}", self.scene.reference.display()))
        };
        let [width, height] = self.scene.size.map(u64::from);
        let shape = [&[height, width], channels].concat();
        let array = npz::read(&self.bytes, name).map_err(wrong)?;
        if array.shape == shape {
            Ok(array.values)
        } else {
            Err(wrong(format!(
                "array `{name}` is of shape {:?}, the scene's camera makes {shape:?}",
                array.shape
            )))
        }
    }

    fn rgb(&self, name: &str) -> Result<Vec<f32>, AppError> {
        self.values(name, &[3])
    }

    fn reference(&self, name: &str) -> Result<Reference, AppError> {
        let mask = self.values("mask", &[])?;
        Ok(Reference {
            size: self.scene.size.map(|side| side as usize),
            rgb: self.rgb(name)?,
            mask: mask.iter().map(|v| *v > 0.5).collect(),
            without_veins: None,
        })
    }
}

/// How far the picture `rgb` of `scene` is from its reference; `None` if there is none.
///
/// # Errors
///
/// As [`reference`].
pub fn scores(scene: &ReferenceScene, rgb: &[f32]) -> Result<Option<Scores>, AppError> {
    let size = scene.size.map(|side| side as usize);
    Ok(reference(scene)?.map(|reference| radiance::scores(Picture { size, rgb }, &reference)))
}

/// Errors against light of all orders, relative RMS less the reference's own noise.
#[derive(Clone, Copy, Debug)]
pub struct FullErrors {
    /// Of light scattered once.
    pub once: f64,
    /// With what scattered more often from the medium.
    pub calibrated: f64,
}

/// A scene that was rendered.
#[derive(Debug)]
pub struct Scored {
    pub name: String,
    /// `None` without a reference.
    pub scores: Option<Scores>,
    pub goal: Option<Goal>,
    /// `None` without a reference of all orders.
    pub full: Option<FullErrors>,
    /// GPU time of the surface, and of the whole frame [ms].
    pub surface_ms: Option<f64>,
    pub frame_ms: Option<f64>,
}

impl Scored {
    /// Whether there is a goal that was not reached.
    pub fn missed(&self) -> bool {
        let Some(goal) = self.goal else {
            return false;
        };
        self.scores.is_none_or(|scores| {
            let over = |value: Option<f64>, goal: Option<f64>| match (value, goal) {
                (Some(value), Some(goal)) => value.is_nan() || value > goal,
                (None, Some(_)) => true,
                (_, None) => false,
            };
            scores.nonfinite_px > 0
                || over(Some(scores.rel_rmse), Some(goal.rel_rmse))
                || over(Some(scores.flip), goal.flip)
                || over(scores.vein, goal.vein)
        })
    }

    fn verdict(&self) -> &'static str {
        match (&self.goal, &self.scores) {
            (None, None) => "no reference",
            (None, Some(_)) => "no goal",
            (Some(_), None) => "MISSED: no reference",
            (Some(_), Some(_)) if self.missed() => "MISSED",
            (Some(_), Some(_)) => "met",
        }
    }

    /// A line of the table.
    pub fn cells(&self) -> Vec<String> {
        let told = |value: Option<f64>| value.map_or("-".to_owned(), |v| format!("{v:.4}"));
        let of = |f: &dyn Fn(&Scores) -> f64| told(self.scores.as_ref().map(f));
        let goal = self.goal.map_or(String::new(), |goal| {
            let limit = |value: Option<f64>| value.map_or("-".to_owned(), |v| v.to_string());
            format!(
                " (<= {}, FLIP {}, vein {})",
                goal.rel_rmse,
                limit(goal.flip),
                limit(goal.vein)
            )
        });
        vec![
            self.name.clone(),
            of(&|s| s.rel_rmse),
            self.scores
                .map_or("-".to_owned(), |s| format!("{:+.4}", s.bias)),
            of(&|s| s.flip),
            of(&|s| s.rel_rmse_after_gain),
            told(self.scores.and_then(|s| s.vein)),
            self.scores
                .map_or("-".to_owned(), |s| s.coverage_mismatch_px.to_string()),
            self.scores
                .map_or("-".to_owned(), |s| s.nonfinite_px.to_string()),
            told(self.full.map(|full| full.once)),
            told(self.full.map(|full| full.calibrated)),
            told(self.surface_ms),
            told(self.frame_ms),
            format!("{}{goal}", self.verdict()),
        ]
    }

    /// The same, for programs.
    pub fn json(&self) -> serde_json::Value {
        let finite = |value: f64| value.is_finite().then_some(value);
        let scores = self.scores.map(|s| {
            json!({
                "relRMSE": finite(s.rel_rmse),
                "bias": finite(s.bias),
                "FLIP": finite(s.flip),
                "relRMSE_after_gain": finite(s.rel_rmse_after_gain),
                "vein": s.vein.and_then(finite),
                "coverage_mismatch_px": s.coverage_mismatch_px,
                "nonfinite_px": s.nonfinite_px,
            })
        });
        json!({
            "name": self.name,
            "scores": scores,
            "goal": self.goal.map(|goal| json!({
                "relRMSE": goal.rel_rmse, "FLIP": goal.flip, "vein": goal.vein,
            })),
            "verdict": self.verdict(),
            "full": self.full.map(|full| json!({
                "relRMSE_once": finite(full.once),
                "relRMSE_calibrated": finite(full.calibrated),
            })),
            "surface_ms_p50": self.surface_ms,
            "frame_ms_p50": self.frame_ms,
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn goals_of_scenes_that_are_not_there_are_named() {
        let goal = Goal {
            rel_rmse: 0.1,
            flip: None,
            vein: None,
        };
        let names = ["seen", "lost", "gone"];
        let goals = Goals(names.map(|name| (name.to_owned(), goal)).into());
        let seen = Scored {
            name: "seen".to_owned(),
            scores: None,
            goal: Some(goal),
            full: None,
            surface_ms: None,
            frame_ms: None,
        };
        assert_eq!(goals.without_scene(&[seen]), ["gone", "lost"]);
    }
}
