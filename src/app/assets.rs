//! Scenes, organs and textures inside the binary, so that it runs from any folder.

use std::borrow::Cow;
use std::path::Path;

macro_rules! bundle {
    ($($file:literal),* $(,)?) => {
        &[$(($file, include_bytes!(concat!(env!("CARGO_MANIFEST_DIR"), "/scenes/", $file)))),*]
    };
}

/// Files that bundled scenes name, by their path below `scenes/`.
const FILES: &[(&str, &[u8])] = bundle![
    "organs/liver.glb",
    "organs/heart.glb",
    "organs/kidney.glb",
    "organs/spleen.glb",
    "tets/beam.msh",
    "tets/organ.msh",
    "textures/liver-outer.png",
    "textures/liver-normal.png",
    "textures/liver-inner.png",
    "textures/liver-layers.png",
    "textures/heart-outer.png",
    "textures/heart-normal.png",
    "textures/heart-inner.png",
    "textures/heart-layers.png",
    "textures/kidney-outer.png",
    "textures/kidney-normal.png",
    "textures/kidney-inner.png",
    "textures/kidney-layers.png",
    "textures/spleen-outer.png",
    "textures/spleen-normal.png",
    "textures/spleen-inner.png",
    "textures/spleen-layers.png",
];

/// Bundled scenes, the default one first.
const SCENES: &[(&str, &str)] = &[
    ("liver", include_str!("../../scenes/liver.toml")),
    ("liver-gooey", include_str!("../../scenes/liver-gooey.toml")),
    ("heart", include_str!("../../scenes/heart.toml")),
    ("kidney", include_str!("../../scenes/kidney.toml")),
    ("spleen", include_str!("../../scenes/spleen.toml")),
    ("slab", include_str!("../../scenes/slab.toml")),
    ("beam", include_str!("../../scenes/beam.toml")),
    ("organ-tets", include_str!("../../scenes/organ-tets.toml")),
    ("hanging-bar", include_str!("../../scenes/hanging-bar.toml")),
    ("hertz", include_str!("../../scenes/hertz.toml")),
];

/// The scene of a window that was told none.
pub const DEFAULT_SCENE: &str = "liver";

/// Name and text of each bundled scene.
pub fn scenes() -> &'static [(&'static str, &'static str)] {
    SCENES
}

/// The text of a bundled scene.
pub fn scene(name: &str) -> Option<&'static str> {
    SCENES
        .iter()
        .find(|(known, _)| *known == name)
        .map(|(_, text)| *text)
}

/// Whether `path` names a file inside the binary.
pub fn is_bundled(path: &Path) -> bool {
    bundled(path).is_some()
}

/// The bytes of a file inside the binary.
pub fn bundled(path: &Path) -> Option<&'static [u8]> {
    let name = path.to_str()?;
    FILES
        .iter()
        .find(|(known, _)| *known == name)
        .map(|(_, bytes)| *bytes)
}

/// The bytes of a bundled file, or of a file on disk.
///
/// # Errors
///
/// What the system says about a file that can't be read.
pub fn read(path: &Path) -> std::io::Result<Cow<'static, [u8]>> {
    match bundled(path) {
        Some(bytes) => Ok(Cow::Borrowed(bytes)),
        None => crate::geom::import::read_file(path).map(Cow::Owned),
    }
}
