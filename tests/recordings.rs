//! Every bundled scene against a recording of it below `tests/recordings/`: where its surface is, and its picture.
//!
//! `PALPATE_ACCEPT="why they changed" cargo test --test recordings` records anew; the reason goes into
//! `tests/recordings/REASONS.md`.

#[path = "support/run.rs"]
mod run;

use run::{Run, folder, messages};
use serde_json::{Value, json};
use std::fs;
use std::io::Write;
use std::path::{Path, PathBuf};
use std::process::Output;

/// Each bundled scene, and frames that go until its tool has done something.
const SCENES: [(&str, u32); 10] = [
    ("liver", 44),
    ("liver-gooey", 44),
    ("heart", 66),
    ("kidney", 44),
    ("spleen", 44),
    ("slab", 50),
    ("beam", 30),
    ("organ-tets", 20),
    ("hanging-bar", 30),
    ("hertz", 3),
];

fn recordings() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("tests/recordings")
}

fn arguments(scene: &str, frames: u32) -> String {
    format!("{scene} --size 160x120 --frames {frames}")
}

/// Replays `scene` against the recording in `recorded`.
fn against(scene: &str, frames: u32, recorded: &Path, name: &str) -> Output {
    let out = folder(name);
    let mut command = Run::command(&out, &arguments(scene, frames));
    command.arg("--against").arg(recorded);
    command.output().expect("it runs")
}

/// Records `scene` anew: the last state and the last picture.
fn accept(scene: &str, frames: u32, to: &Path) {
    let run = Run::new(&format!("accept-{scene}"), &arguments(scene, frames));
    let mut states: Value = run.json("states.json");
    let bytes = fs::read(run.out.join("states.bin")).expect("states");
    let points = states["points"].as_u64().expect("a number") as usize;
    states["frames"] = json!([frames]);
    fs::create_dir_all(to).expect("a folder");
    fs::write(to.join("states.json"), format!("{states}\n")).expect("written");
    fs::write(to.join("states.bin"), &bytes[bytes.len() - 12 * points..]).expect("written");
    for name in run.pictures() {
        fs::copy(run.out.join(&name), to.join(&name)).expect("a copy");
    }
}

/// A reason of more than a word, or a panic that asks for one.
fn sound_reason(reason: &str) -> &str {
    let reason = reason.trim();
    assert!(
        reason.split_whitespace().count() >= 3,
        "say in PALPATE_ACCEPT, in a few words, why the recordings change"
    );
    reason
}

#[test]
fn bundled_scenes_end_where_they_were_recorded_and_look_the_same() {
    if let Ok(reason) = std::env::var("PALPATE_ACCEPT") {
        let reason = sound_reason(&reason);
        for (scene, frames) in SCENES {
            accept(scene, frames, &recordings().join(scene));
        }
        let file = recordings().join("REASONS.md");
        let mut file = fs::OpenOptions::new()
            .append(true)
            .create(true)
            .open(file)
            .expect("a file");
        writeln!(file, "* {reason}").expect("written");
        return;
    }
    let mut failures = Vec::new();
    for (scene, frames) in SCENES {
        let output = against(
            scene,
            frames,
            &recordings().join(scene),
            &format!("recorded-{scene}"),
        );
        if output.status.code() != Some(0) {
            let told = messages(&output);
            let told = told
                .lines()
                .filter(|line| line.contains("differs") || line.contains("palpate:"));
            failures.push(format!("{scene}: {}", told.collect::<Vec<_>>().join("; ")));
        }
    }
    assert!(
        failures.is_empty(),
        "{}\nif this is meant: PALPATE_ACCEPT=\"why\" cargo test --test recordings",
        failures.join("\n")
    );
}

#[test]
fn every_bundled_scene_is_recorded() {
    let output = run::palpate(&["scenes"]).output().expect("it runs");
    let listed = String::from_utf8_lossy(&output.stdout).into_owned();
    let listed: Vec<&str> = (listed.lines())
        .filter_map(|line| line.split_whitespace().next())
        .collect();
    assert_eq!(listed, SCENES.map(|(scene, _)| scene));
}

#[test]
fn a_pass_left_out_or_another_tissue_is_found() {
    if std::env::var_os("PALPATE_ACCEPT").is_some() {
        return;
    }
    // The shadow is a pass; without it light falls behind the lobes, and nothing moves otherwise.
    let set = |name: &str, value: &str| {
        let out = folder(name);
        let mut command = Run::command(&out, &arguments("heart", 66));
        command.args(["--set", value, "--against"]);
        command.arg(recordings().join("heart"));
        let output = command.output().expect("it runs");
        assert_eq!(output.status.code(), Some(1), "{}", messages(&output));
        messages(&output)
    };
    let told = set("recorded-unshadowed", "light.0.shadow=false");
    assert!(told.contains("differs: frame-0066.png"), "{told}");
    assert!(!told.contains("differs: states"), "{told}");
    let told = set("recorded-stiffer", "solver.youngs_modulus_pa=6600");
    assert!(told.contains("differs: states"), "{told}");
}

#[test]
#[should_panic(expected = "in a few words")]
fn new_recordings_without_a_reason_are_refused() {
    sound_reason("1");
}
