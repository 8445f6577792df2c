//! Which values of a scene were turned since it was opened, how each goes back, and what a change asks of the window.

use super::panel::PanelAsk;
use crate::scene::{BeatSection, Scene, overrides};
use serde::Deserialize;
use toml::Value;

/// A value that is not what the scene says.
#[derive(Clone, Debug, PartialEq)]
pub struct Change {
    /// Its dotted path, as `--set` takes it.
    pub path: String,
    /// What the scene says; nothing where it leaves the value out.
    pub home: Option<Value>,
    /// What it is now.
    pub now: Option<Value>,
}

/// Every value of `now` that differs from `home`, in the order of their names.
pub fn changes(home: &Scene, now: &Scene) -> Vec<Change> {
    let mut found = Vec::new();
    if home != now
        && let (Ok(home), Ok(now)) = (Value::try_from(home), Value::try_from(now))
    {
        collect("", Some(&home), Some(&now), &mut found);
    }
    found
}

fn collect(path: &str, home: Option<&Value>, now: Option<&Value>, found: &mut Vec<Change>) {
    let below = |key: &str| match path {
        "" => key.to_owned(),
        path => format!("{path}.{key}"),
    };
    match (home, now) {
        (Some(Value::Table(home)), Some(Value::Table(now))) => {
            let mut keys: Vec<&String> = home.keys().chain(now.keys()).collect();
            keys.sort();
            keys.dedup();
            for key in keys {
                collect(&below(key), home.get(key), now.get(key), found);
            }
        }
        // Lists of sections step by number; colours and places are one value.
        (Some(Value::Array(home)), Some(Value::Array(now)))
            if home.len() == now.len() && home.iter().all(Value::is_table) =>
        {
            for (index, pair) in home.iter().zip(now).enumerate() {
                collect(
                    &below(&index.to_string()),
                    Some(pair.0),
                    Some(pair.1),
                    found,
                );
            }
        }
        (home, now) if home != now => found.push(Change {
            path: path.to_owned(),
            home: home.cloned(),
            now: now.cloned(),
        }),
        _ => {}
    }
}

/// `now` with one value as `home` has it; `None` if that would be no scene.
pub fn undone(now: &Scene, change: &Change) -> Option<Scene> {
    let mut root = Value::try_from(now).ok()?;
    let steps: Vec<&str> = change.path.split('.').collect();
    match &change.home {
        Some(home) => overrides::insert(&mut root, &steps, home.clone()).ok()?,
        None => remove(&mut root, &steps),
    }
    Scene::deserialize(root).ok()
}

fn remove(place: &mut Value, steps: &[&str]) {
    match (place, steps) {
        (Value::Table(table), [last]) => {
            table.remove(*last);
        }
        (Value::Table(table), [step, rest @ ..]) => {
            if let Some(inner) = table.get_mut(*step) {
                remove(inner, rest);
            }
        }
        (Value::Array(items), [step, rest @ ..]) => {
            let index = step.parse::<usize>().ok();
            if let Some(item) = index.and_then(|index| items.get_mut(index)) {
                remove(item, rest);
            }
        }
        _ => {}
    }
}

/// A value as a reader wants it: of a number no more digits than it was given with.
pub fn told(value: Option<&Value>) -> String {
    match value {
        None => "left out".to_owned(),
        Some(Value::Float(number)) => (*number as f32).to_string(),
        Some(Value::Array(items)) => {
            let items: Vec<String> = items.iter().map(|item| told(Some(item))).collect();
            format!("[{}]", items.join(", "))
        }
        Some(Value::String(text)) => text.clone(),
        Some(other) => other.to_string(),
    }
}

/// What the window must do when a scene has changed from `before` to `after`.
pub fn asks(before: &Scene, after: &Scene) -> Vec<PanelAsk> {
    let mut asks = Vec::new();
    let lasting = |scene: &Scene| {
        let mut body = scene.body.clone();
        (body.gravity_m_s2, body.damping_per_s) = Default::default();
        body.beat = body.beat.map(|beat| BeatSection {
            muscle: beat.muscle,
            ..BeatSection::default()
        });
        (body, scene.tools.clone(), scene.markers.clone())
    };
    if lasting(before) != lasting(after) {
        asks.push(PanelAsk::Reload);
    }
    let moving = |scene: &Scene| {
        (
            scene.solver,
            scene.body.gravity_m_s2,
            scene.body.damping_per_s,
        )
    };
    if moving(before) != moving(after) {
        asks.push(PanelAsk::Solver);
    }
    if before.body.beat != after.body.beat {
        asks.push(PanelAsk::Beat);
    }
    let light_kinds = |scene: &Scene| -> Vec<(bool, bool)> {
        (scene.lights.iter())
            .map(|light| (light.toward.is_some(), light.shadow))
            .collect()
    };
    if before.light_path != after.light_path || light_kinds(before) != light_kinds(after) {
        asks.push(PanelAsk::Rebuild);
    } else if before.lights != after.lights {
        asks.push(PanelAsk::Lights);
    }
    if before.surface != after.surface {
        asks.push(super::knobs::ask(&before.surface, &after.surface));
    }
    if before.camera != after.camera {
        asks.push(PanelAsk::Camera);
    }
    asks
}

#[cfg(test)]
mod tests {
    use super::super::load;
    use super::*;

    fn scene() -> Scene {
        load::scene("liver", &[]).expect("a bundled scene")
    }

    /// A scene of which a value of each kind was turned.
    fn turned() -> Scene {
        let mut scene = scene();
        scene.solver.substeps = 7;
        scene.surface.layers[1].asymmetry = 0.123;
        scene.lights[0].irradiance_w_m2 = [1.0, 0.3, 0.2];
        scene.light_path.radius_m = Some(0.01);
        scene.body.gravity_m_s2.y = -9.81;
        scene
    }

    #[test]
    fn each_turned_value_is_told_by_the_path_that_set_takes() {
        let changes = changes(&scene(), &turned());
        let paths: Vec<&str> = changes.iter().map(|change| change.path.as_str()).collect();
        assert_eq!(
            paths,
            [
                "body.gravity_m_s2",
                "light.0.irradiance_w_m2",
                "light_path.radius_m",
                "solver.substeps",
                "surface.layer.1.asymmetry",
            ]
        );
        assert_eq!(told(changes[2].home.as_ref()), "left out");
        assert_eq!(told(changes[4].now.as_ref()), "0.123");
        let sets: Vec<String> = (changes.iter())
            .map(|change| format!("{}={}", change.path, change.now.as_ref().expect("a value")))
            .collect();
        assert_eq!(scene().with(&sets).expect("sound"), turned());
    }

    #[test]
    fn one_value_goes_back_alone_and_all_go_back_one_by_one() {
        let home = scene();
        let mut now = turned();
        while let Some(change) = changes(&home, &now).first() {
            let before = changes(&home, &now).len();
            now = undone(&now, change).expect("still a scene");
            assert_eq!(changes(&home, &now).len(), before - 1, "{}", change.path);
        }
        assert_eq!(now, home);
    }

    #[test]
    fn a_change_asks_for_no_more_than_it_needs() {
        let of = |change: &dyn Fn(&mut Scene)| {
            let mut after = scene();
            change(&mut after);
            asks(&scene(), &after)
        };
        assert_eq!(of(&|_| ()), []);
        assert_eq!(of(&|s| s.surface.wetness = 0.3), [PanelAsk::SurfaceKnobs]);
        assert_eq!(of(&|s| s.surface.samples = 9), [PanelAsk::Rebuild]);
        assert_eq!(
            of(&|s| s.light_path.tolerance_m = Some(1e-5)),
            [PanelAsk::Rebuild]
        );
        assert_eq!(
            of(&|s| s.lights[1].irradiance_w_m2[0] = 9.0),
            [PanelAsk::Lights]
        );
        assert_eq!(of(&|s| s.lights[0].shadow = false), [PanelAsk::Rebuild]);
        assert_eq!(of(&|s| s.body.damping_per_s = 1.0), [PanelAsk::Solver]);
        assert_eq!(of(&|s| s.body.density_kg_m3 = 900.0), [PanelAsk::Reload]);
        assert_eq!(of(&|s| s.camera.fov_y_deg = 20.0), [PanelAsk::Camera]);
    }
}
