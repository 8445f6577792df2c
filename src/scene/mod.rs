//! What a scene file says, read and checked, as plain data.
//!
//! A scene is TOML with units in its keys; unknown keys are refused with the known ones named.
//! Places are given in metres (`…_m`) or as shares of the body's box at rest (`…_share`), so that one
//! script prods any organ.

mod beat;
mod body;
mod camera;
mod check;
mod error;
mod gooey;
mod green;
mod light;
pub mod overrides;
mod place;
mod surface;
mod tool;

pub use beat::BeatSection;
pub use body::{Ball, BodySection, HalfSpace, MapFiles, Region, Shape};
pub use camera::*;
pub use error::SceneError;
pub use gooey::*;
pub use green::*;
pub use light::*;
pub use place::RestBox;
pub use surface::*;
pub use tool::{Approach, Key, ToolSection, ToolShapeName};

use crate::geom::plane::LightPathMethod;
use crate::sim::SolverParams;
use check::Checker;
use glam::Vec3;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// A whole scene. Every section may be left out; what a scene leaves out costs nothing.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Scene {
    /// What the scene is for, in one line.
    #[serde(default)]
    pub title: String,
    /// What is prodded.
    pub body: BodySection,
    /// How it moves.
    #[serde(default)]
    pub solver: SolverParams,
    /// What prods it.
    #[serde(default, rename = "tool", skip_serializing_if = "Vec::is_empty")]
    pub tools: Vec<ToolSection>,
    /// How it is drawn.
    #[serde(default)]
    pub surface: SurfaceSection,
    /// How far light travels below the surface.
    #[serde(default)]
    pub light_path: LightPathSection,
    /// What lights it. Left out, a key and a rim light.
    // Written even where it is empty: left out, it would be the two again.
    #[serde(default = "light::default_lights", rename = "light")]
    pub lights: Vec<LightSection>,
    /// Where it is seen from.
    #[serde(default)]
    pub camera: CameraSection,
    /// Points to follow.
    #[serde(default, rename = "marker", skip_serializing_if = "Vec::is_empty")]
    pub markers: Vec<MarkerSection>,
    /// What a replay makes unless told otherwise.
    #[serde(default)]
    pub output: OutputSection,
}

/// How the distance that light travels below the surface is estimated.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields, default)]
pub struct LightPathSection {
    /// Which primitive stands for the surface around a point.
    pub method: LightPathMethod,
    /// Radius of the patch that a plane or paraboloid is fitted to [m]. Left out, it follows from the extinction of the
    /// densest layer (François 2006, section 2.2), for paraboloids half of that. At least the 16 nearest points.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub radius_m: Option<f32>,
    /// How far a point moves before `incremental`, `sampled` and `quadric` take notice [m]. Left out, 1/4000
    /// of the radius.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub tolerance_m: Option<f32>,
    /// `sampled`: patches whose plane changes the optical depth by less than this take no fit but the tangent
    /// plane. 0 fits all.
    pub skip_optical_depth: f32,
}

impl Default for LightPathSection {
    fn default() -> Self {
        Self {
            method: LightPathMethod::Quadric,
            radius_m: None,
            tolerance_m: None,
            skip_optical_depth: 0.0,
        }
    }
}

/// A named point to follow: the nearest particle, or the mean of the particles in a box.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct MarkerSection {
    /// Name in `summary.json`.
    pub name: String,
    /// The surface point nearest to this place [m].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nearest_m: Option<Vec3>,
    /// The same, as shares of the body's box.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub nearest_share: Option<Vec3>,
    /// The mean of all surface points in this box [m].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mean_box_m: Option<[Vec3; 2]>,
    /// The same, as shares of the body's box.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub mean_box_share: Option<[Vec3; 2]>,
}

/// What a replay makes unless told otherwise.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields, default)]
pub struct OutputSection {
    /// Frames; one frame is one time step.
    pub frames: u32,
    /// Width and height [px].
    pub size: [u32; 2],
    /// A picture every so many frames; 0 for the last one only.
    pub png_every: u32,
}

impl Default for OutputSection {
    fn default() -> Self {
        Self {
            frames: 180,
            size: [800, 600],
            png_every: 0,
        }
    }
}

/// Where a scene's text comes from, and where its files are looked for.
#[derive(Clone, Debug)]
pub struct SceneSource<'a> {
    /// Name in messages.
    pub name: &'a str,
    /// The TOML text.
    pub text: &'a str,
    /// Folder that relative paths in the text start from; `None` for a bundled scene.
    pub folder: Option<&'a Path>,
}

impl Scene {
    /// Reads a scene and applies `--set` overrides, each `dotted.key=value`.
    ///
    /// # Errors
    ///
    /// [`SceneError`] with the file, the line or the key, and what would be right.
    pub fn read(source: &SceneSource<'_>, sets: &[String]) -> Result<Self, SceneError> {
        let mut scene: Self =
            toml::from_str(source.text).map_err(|e| SceneError::toml(source.name, &e))?;
        if let Some(folder) = source.folder {
            scene.body.resolve_files(folder);
            if let Some(ramp) = &mut scene.surface.absorption.ramp {
                *ramp = folder.join(&*ramp);
            }
        }
        let told: toml::Table = toml::from_str(source.text).unwrap_or_default();
        let surface = told.get("surface").and_then(toml::Value::as_table);
        if surface.is_none_or(|surface| !surface.contains_key("layer")) {
            scene.surface.take_tissue();
        }
        let scene = overrides::apply(source.name, scene, sets)?;
        scene.check(source.name)?;
        Ok(scene)
    }

    /// The scene with `--set` overrides, each `dotted.key=value`.
    ///
    /// # Errors
    ///
    /// As [`Scene::read`].
    pub fn with(&self, sets: &[String]) -> Result<Self, SceneError> {
        let scene = overrides::apply("the scene", self.clone(), sets)?;
        scene.check("the scene")?;
        Ok(scene)
    }

    /// The scene as TOML, readable by [`Scene::read`].
    ///
    /// # Errors
    ///
    /// [`SceneError`] if a value has no TOML form.
    pub fn to_toml(&self) -> Result<String, SceneError> {
        toml::to_string_pretty(self)
            .map_err(|e| SceneError::invalid("scene", "save", &e.to_string()))
    }

    /// Refuses values out of range, with the allowed range.
    fn check(&self, name: &str) -> Result<(), SceneError> {
        let mut c = Checker::new(name);
        self.body.check(&mut c);
        if let Some(problem) = self.solver.problem() {
            c.problem("solver", &problem);
        }
        for (index, tool) in self.tools.iter().enumerate() {
            tool.check(index, &mut c);
        }
        if let Some(radius) = self.light_path.radius_m {
            c.range("light_path.radius_m", radius, 1e-6, 10.0);
        }
        if let Some(tolerance) = self.light_path.tolerance_m {
            c.range("light_path.tolerance_m", tolerance, 0.0, 1.0);
        }
        let skip = self.light_path.skip_optical_depth;
        c.range("light_path.skip_optical_depth", skip, 0.0, 10.0);
        for (index, marker) in self.markers.iter().enumerate() {
            let given = [
                marker.nearest_m.is_some(),
                marker.nearest_share.is_some(),
                marker.mean_box_m.is_some(),
                marker.mean_box_share.is_some(),
            ];
            c.exactly_one(
                &format!("marker.{index}"),
                &given,
                "nearest_m, nearest_share, mean_box_m, mean_box_share",
            );
            let key = format!("marker.{index}");
            for place in [marker.nearest_m, marker.nearest_share]
                .into_iter()
                .flatten()
            {
                c.range3(&key, place, -1e6, 1e6);
            }
            for corners in [marker.mean_box_m, marker.mean_box_share]
                .into_iter()
                .flatten()
            {
                c.corners(&key, corners);
            }
        }
        c.range("output.frames", self.output.frames as f32, 1.0, 1e7);
        for side in self.output.size {
            c.range("output.size", side as f32, 8.0, 8192.0);
        }
        self.surface.check(&mut c);
        self.camera.check(&mut c);
        for (index, light) in self.lights.iter().enumerate() {
            light.check(index, &mut c);
        }
        c.finish()
    }
}
