//! What the gallery shows, as `list.toml` says it.

use serde::Deserialize;

/// All sheets.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct List {
    /// What the page begins with.
    pub about: String,
    pub sheet: Vec<Sheet>,
}

/// The techniques of one source.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sheet {
    /// Name of its picture.
    pub name: String,
    pub title: String,
    pub source: String,
    pub row: Vec<Row>,
}

/// One technique.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Row {
    /// What it is, and where its source has it.
    pub what: String,
    /// A bundled scene.
    pub scene: String,
    /// Settings that are shown with it and without.
    #[serde(default)]
    pub both: Vec<String>,
    pub off: Variant,
    pub on: Variant,
    /// The frames that are shown: at rest, and prodded.
    #[serde(default = "rest_and_prodded")]
    pub at: [u32; 2],
    pub then: Then,
}

/// A technique off or on.
#[derive(Debug, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Variant {
    pub name: String,
    /// Settings, as `--set` takes them.
    pub set: Vec<String>,
}

/// What turning a technique on does to the light of the prodded body.
#[derive(Clone, Copy, Debug, Deserialize, PartialEq)]
#[serde(rename_all = "kebab-case")]
pub enum Then {
    Differs,
    Brighter,
    Darker,
    Softer,
    Sharper,
    Redder,
}

/// The probe is deepest from 1 s on; half of its way in is enough.
fn rest_and_prodded() -> [u32; 2] {
    [0, 52]
}

impl List {
    pub fn read() -> Self {
        toml::from_str(include_str!("list.toml")).expect("tests/gallery/list.toml is sound")
    }
}

/// Settings as a page shows them; long ones are left to the list.
pub fn told(sets: &[String]) -> String {
    let short = |set: &String| match set.split_once('=') {
        Some((key, value)) if value.len() > 40 => format!("`{key}=…`"),
        _ => format!("`{set}`"),
    };
    sets.iter().map(short).collect::<Vec<_>>().join(", ")
}
