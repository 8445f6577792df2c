//! The format of reference scenes, `scenes/*.json`.

use serde::Deserialize;
use std::path::PathBuf;

/// A scene as its file says it. What a renderer does not need is left out.
#[derive(Debug, Deserialize)]
pub struct SceneFile {
    #[serde(default = "millimetres")]
    pub units: String,
    /// An OBJ or glTF file, from the folder above `scenes`.
    pub mesh: PathBuf,
    #[serde(default)]
    pub reference: Option<PathBuf>,
    pub camera: CameraFile,
    pub light: Lights,
    pub layers: Vec<LayerFile>,
    #[serde(default)]
    pub layer_depths: Option<LayerDepths>,
}

fn millimetres() -> String {
    "mm".to_owned()
}

#[derive(Debug, Deserialize)]
pub struct CameraFile {
    pub eye: [f32; 3],
    pub target: [f32; 3],
    pub up: [f32; 3],
    pub fovy_deg: f32,
    pub width: u32,
    pub height: u32,
}

/// One light, or a list.
#[derive(Debug, Deserialize)]
#[serde(
    untagged,
    expecting = "a light {type: \"directional\", to_light, E} or {type: \"point\", pos, I}, or a list of them"
)]
pub enum Lights {
    One(LightFile),
    More(Vec<LightFile>),
}

impl Lights {
    pub fn all(&self) -> &[LightFile] {
        match self {
            Self::One(light) => std::slice::from_ref(light),
            Self::More(lights) => lights,
        }
    }
}

#[derive(Debug, Deserialize)]
#[serde(tag = "type", rename_all = "lowercase")]
pub enum LightFile {
    /// Irradiance `E` on a plane that faces it.
    Directional {
        to_light: [f32; 3],
        #[serde(rename = "E")]
        irradiance: Power,
    },
    /// Intensity `I`: irradiance I/d² at the distance d, in the units of the scene.
    Point {
        pos: [f32; 3],
        #[serde(rename = "I")]
        intensity: Power,
    },
}

/// One number, or one a colour.
#[derive(Clone, Copy, Debug, Deserialize)]
#[serde(untagged, expecting = "a number, or three")]
pub enum Power {
    Grey(f32),
    Color([f32; 3]),
}

impl Power {
    pub fn rgb(self) -> [f32; 3] {
        match self {
            Self::Grey(value) => [value; 3],
            Self::Color(rgb) => rgb,
        }
    }
}

/// Coefficients in one over the units of the scene.
#[derive(Debug, Deserialize)]
pub struct LayerFile {
    pub sigma_s: [f32; 3],
    pub sigma_t: [f32; 3],
    pub g_schlick: f32,
}

/// How deep the bottoms of the layers lie: the same everywhere, or a map. The last layer fills the rest.
#[derive(Debug, Deserialize)]
pub struct LayerDepths {
    #[serde(default)]
    pub constant_mm: Option<Vec<f32>>,
    /// One RGBA map for every four layers: `.npz` with an array `depth`, `.npy` or a picture; row 0 is v = 0.
    #[serde(default)]
    pub file: Option<Maps>,
    /// What the value 1 stands for.
    #[serde(default)]
    pub depth_max_mm: Option<f32>,
    #[serde(default)]
    pub address: Option<String>,
    #[serde(default)]
    pub filter: Option<String>,
}

/// One file, or a list.
#[derive(Debug, Deserialize)]
#[serde(untagged, expecting = "a path, or a list of paths")]
pub enum Maps {
    One(PathBuf),
    More(Vec<PathBuf>),
}

impl Maps {
    pub fn all(&self) -> &[PathBuf] {
        match self {
            Self::One(path) => std::slice::from_ref(path),
            Self::More(paths) => paths,
        }
    }
}
