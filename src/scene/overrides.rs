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
        let mut root =
            Value::try_from(&scene).map_err(|e| refuse(&format!("scene has no TOML form: {e}")))?;
        let steps: Vec<&str> = path.split('.').collect();
        insert(&mut root, &steps, parse(text.trim())).map_err(|message| refuse(&message))?;
        let before = scene.body.file.clone();
        scene = Scene::deserialize(root).map_err(|e| refuse(e.to_string().trim_end()))?;
        if path == "body.file" {
            // A file takes the place of a shape, and the maps painted for another surface do not
            // fit its UV map.
            scene.body.shape = None;
            scene.body.extent_m = None;
            if scene.body.file != before {
                scene.body.maps = None;
            }
            // Nor are cells and names of a surface said of tetrahedra.
            if scene.body.names_tets() {
                scene.body.cell_m = None;
                scene.body.meshes = None;
            }
            scene.body.file = scene.body.file.map(|file| from_here(&file));
        }
        if path == "surface.tissue" {
            scene.surface.take_tissue();
        }
        if path == "body.shape" {
            scene.body.file = None;
            scene.body.maps = None;
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
pub fn parse(text: &str) -> Value {
    format!("value = {text}")
        .parse::<Table>()
        .ok()
        .filter(|table| table.len() == 1)
        .and_then(|mut table| table.remove("value"))
        .unwrap_or_else(|| Value::String(text.to_owned()))
}

/// Puts `value` at the place that `steps` lead to; a number steps into a list.
///
/// # Errors
///
/// What is wrong with the path, with what is there.
pub fn insert(place: &mut Value, steps: &[&str], value: Value) -> Result<(), String> {
    let Some((step, rest)) = steps.split_first() else {
        *place = value;
        return Ok(());
    };
    if step.is_empty() {
        return Err("empty key".to_owned());
    }
    match place {
        Value::Table(table) => {
            if rest.is_empty() {
                forget_alternative(table, step);
            }
            let inner = table
                .entry(*step)
                .or_insert_with(|| Value::Table(Table::new()));
            insert(inner, rest, value)
        }
        Value::Array(items) => {
            let count = items.len();
            let item = step
                .parse::<usize>()
                .ok()
                .and_then(|index| items.get_mut(index))
                .ok_or_else(|| match count {
                    0 => format!("the list before {step} is empty"),
                    _ => format!(
                        "the list before {step} has {count}: write a number from 0 to {}",
                        count - 1
                    ),
                })?;
            insert(item, rest, value)
        }
        _ => Err(format!("there is no key {step} below a plain value")),
    }
}

/// A length in metres takes the place of the same one as a share, and the other way round.
fn forget_alternative(table: &mut Table, key: &str) {
    let other = match (key.strip_suffix("_m"), key.strip_suffix("_share")) {
        (Some(stem), _) => format!("{stem}_share"),
        (_, Some(stem)) => format!("{stem}_m"),
        _ => return,
    };
    table.remove(&other);
}

#[cfg(test)]
mod tests {
    use super::*;

    fn changed(path: &str, value: &str) -> Result<Value, String> {
        let mut root: Value = "a = [[1, 2], [3, 4]]\n[t]\nradius_share = 0.1\n[[l]]\nx = 1"
            .parse::<Table>()
            .map(Value::Table)
            .expect("sound TOML");
        let steps: Vec<&str> = path.split('.').collect();
        insert(&mut root, &steps, parse(value))?;
        Ok(root)
    }

    #[test]
    fn a_number_steps_into_lists_of_lists() {
        let root = changed("a.1.0", "9").expect("it is there");
        assert_eq!(root["a"][1][0].as_integer(), Some(9));
        assert_eq!(root["a"][1][1].as_integer(), Some(4));
        let root = changed("l.0", "{ x = 5 }").expect("it is there");
        assert_eq!(root["l"][0]["x"].as_integer(), Some(5));
    }

    #[test]
    fn a_place_that_is_not_there_is_refused_with_what_is() {
        assert!(changed("a.7", "1").unwrap_err().contains("0 to 1"));
        assert!(changed("a.1.0.x", "1").unwrap_err().contains('x'));
        assert!(changed("", "1").is_err());
    }

    #[test]
    fn metres_take_the_place_of_a_share() {
        let root = changed("t.radius_m", "0.02").expect("a table takes keys");
        assert_eq!(root["t"]["radius_m"].as_float(), Some(0.02));
        assert!(root["t"].get("radius_share").is_none());
    }

    #[test]
    fn a_bare_word_is_a_string() {
        assert_eq!(parse("gooey"), Value::String("gooey".to_owned()));
        assert_eq!(parse("[1, 2]").as_array().map(Vec::len), Some(2));
    }
}
