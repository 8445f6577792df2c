//! `--set dotted.key=value`: one value of a scene replaced.

use super::{Scene, SceneError};
use serde::Deserialize;
use std::path::{Path, PathBuf};
use toml::{Table, Value};

/// Applies all of `sets` to `scene`.
pub(super) fn apply(name: &str, scene: Scene, sets: &[String]) -> Result<Scene, SceneError> {
    let mut scene = scene;
    for set in sets {
        let refuse = |message: &str| SceneError::invalid(name, &format!("--set {set}"), message);
        let (path, text) = set
            .split_once('=')
            .ok_or_else(|| refuse("write KEY=VALUE, for example solver.substeps=40"))?;
        let path = path.trim();
        let value = parse(text.trim());
        let mut table =
            Table::try_from(&scene).map_err(|e| refuse(&format!("scene has no TOML form: {e}")))?;
        insert(&mut table, path, value).map_err(|message| refuse(&message))?;
        let before = scene.body.file.clone();
        scene = Scene::deserialize(table).map_err(|e| refuse(e.to_string().trim_end()))?;
        if path == "body.file" {
            // A file takes the place of a shape, and the maps painted for another surface do not
            // fit its UV map.
            scene.body.shape = None;
            scene.body.extent_m = None;
            if scene.body.file != before {
                scene.body.maps = None;
            }
            scene.body.file = scene.body.file.map(|file| from_here(&file));
        }
    }
    Ok(scene)
}

/// A path typed on the command line starts from the current folder, unless it names something bundled.
fn from_here(file: &Path) -> PathBuf {
    std::path::absolute(file)
        .ok()
        .filter(|absolute| absolute.exists())
        .unwrap_or_else(|| file.to_owned())
}

/// A TOML value, or the text itself where it is none: `surface.kind=gooey` is a string.
fn parse(text: &str) -> Value {
    format!("value = {text}")
        .parse::<Table>()
        .ok()
        .filter(|table| table.len() == 1)
        .and_then(|mut table| table.remove("value"))
        .unwrap_or_else(|| Value::String(text.to_owned()))
}

/// Puts `value` at the dotted `path`; a number steps into an array.
fn insert(table: &mut Table, path: &str, value: Value) -> Result<(), String> {
    let mut steps: Vec<&str> = path.split('.').collect();
    let last = steps.pop().filter(|s| !s.is_empty()).ok_or("empty key")?;
    let mut place = table;
    let mut steps = steps.into_iter().peekable();
    while let Some(step) = steps.next() {
        let next = place
            .entry(step)
            .or_insert_with(|| Value::Table(Table::new()));
        place = match next {
            Value::Table(inner) => inner,
            Value::Array(items) => {
                let count = items.len();
                let index = steps
                    .next()
                    .and_then(|s| s.parse::<usize>().ok())
                    .filter(|&i| i < count)
                    .ok_or_else(|| {
                        format!(
                            "{step} is a list of {count}: write {step}.0 to {step}.{}",
                            count.max(1) - 1
                        )
                    })?;
                match &mut items[index] {
                    Value::Table(inner) => inner,
                    _ => return Err(format!("{step}.{index} has no keys below it")),
                }
            }
            _ => return Err(format!("{step} has no keys below it")),
        };
    }
    place.insert(last.to_owned(), value);
    Ok(())
}
