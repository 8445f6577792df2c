//! Why a scene was refused.

use std::fmt;

/// Why a scene was refused: the file, the place in it, and what would be right.
#[derive(Clone, Debug, PartialEq)]
pub struct SceneError {
    /// File or bundled scene.
    pub scene: String,
    /// What is wrong, where, and what would be right.
    pub message: String,
}

impl SceneError {
    /// The text is no TOML, or no scene: `error` names line and column.
    pub(super) fn toml(scene: &str, error: &toml::de::Error) -> Self {
        Self {
            scene: scene.to_owned(),
            message: error.to_string().trim_end().to_owned(),
        }
    }

    /// `key` has a value that can't be used.
    pub(super) fn invalid(scene: &str, key: &str, message: &str) -> Self {
        Self {
            scene: scene.to_owned(),
            message: format!("{key}: {message}"),
        }
    }
}

impl fmt::Display for SceneError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        write!(f, "scene {}: {}", self.scene, self.message)
    }
}

impl std::error::Error for SceneError {}
