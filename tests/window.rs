//! The window, driven by a real mouse under Xvfb: the organ moves, it pushes back, the picture changes.
//!
//! Needs Xvfb and xdotool, which `make test` installs. Where they are missing the tests say so; in CI that is
//! a failure.

#[path = "support/desk.rs"]
mod desk;

use desk::{Desk, spent};
use std::path::{Path, PathBuf};
use std::process::Command;
use std::thread::sleep;
use std::time::{Duration, Instant};

/// A push that is recorded, and the scene file it ends in.
fn recorded_push(desk: &Desk) -> PathBuf {
    desk.tool(&["key", "o"]);
    sleep(Duration::from_millis(500));
    desk.tool(&["mousedown", "1"]);
    for step in 0..6 {
        let y = (350 + 4 * step).to_string();
        desk.tool(&["mousemove", "440", &y]);
        sleep(Duration::from_millis(150));
    }
    desk.tool(&["mouseup", "1"]);
    sleep(Duration::from_millis(300));
    desk.tool(&["key", "o"]);
    let path = desk.folder.join("palpate-001.toml");
    desk.wait_for("a recording", || path.exists());
    path
}

fn column(log: &Path, name: &str) -> Vec<f32> {
    let mut reader = csv::Reader::from_path(log).expect("the log is there");
    let index = reader
        .headers()
        .expect("a header")
        .iter()
        .position(|title| title.starts_with(name))
        .unwrap_or_else(|| panic!("no column {name}"));
    reader
        .records()
        .map(|row| row.expect("a row")[index].parse().expect("a number"))
        .collect()
}

/// Share of pixels that differ by more than a little.
fn changed_share(a: &image::RgbaImage, b: &image::RgbaImage) -> f32 {
    assert_eq!(a.dimensions(), b.dimensions());
    let changed = a
        .pixels()
        .zip(b.pixels())
        .filter(|(p, q)| (0..3).any(|c| p[c].abs_diff(q[c]) > 12))
        .count();
    changed as f32 / a.pixels().len() as f32
}

#[test]
fn a_mouse_push_moves_the_organ_is_answered_by_a_force_and_changes_the_picture() {
    let Some(desk) = Desk::new("push", 71) else {
        return;
    };
    let log = desk.folder.join("frames.csv");
    let log_name = log.display().to_string();
    let mut window = desk.window("liver-gooey", &["--log", &log_name]);

    // The middle of the picture, left of the panel: the organ is there.
    desk.tool(&["mousemove", "430", "360"]);
    let at_rest = desk.picture(1);
    let still = desk.picture(2);
    desk.tool(&["mousedown", "1"]);
    for step in 0..10 {
        let x = (430 + 3 * step).to_string();
        desk.tool(&["mousemove", &x, "360"]);
        sleep(Duration::from_millis(150));
    }
    let pushed = desk.picture(3);
    desk.tool(&["mouseup", "1"]);
    let recorded = recorded_push(&desk);
    desk.close(&mut window);

    let force = column(&log, "tool_force_n").into_iter().fold(0.0, f32::max);
    assert!(force > 0.01, "the organ pushed back with {force} N only");
    let speed = column(&log, "speed_max_m_s")
        .into_iter()
        .fold(0.0, f32::max);
    assert!(speed > 1e-3, "nothing moved faster than {speed} m/s");
    let noise = changed_share(&at_rest, &still);
    let change = changed_share(&at_rest, &pushed);
    assert!(
        change > 0.002 && change > 10.0 * noise,
        "a push changed {change} of the pixels, standing still {noise}"
    );
    assert_replays(&recorded);
}

/// A recording says in which state it ends, and its replay ends there.
fn assert_replays(recorded: &Path) {
    let folder = recorded.parent().expect("it is in a folder");
    let replay = Command::new(env!("CARGO_BIN_EXE_palpate"))
        .args(["replay", "--no-render", "--out", "replayed"])
        .arg(recorded)
        .current_dir(folder)
        .output()
        .expect("the binary runs");
    let told = String::from_utf8_lossy(&replay.stderr).into_owned();
    assert!(replay.status.success(), "{told}");
    let summary = std::fs::read_to_string(folder.join("replayed/summary.json"));
    let summary: serde_json::Value =
        serde_json::from_str(&summary.expect("the replay has a summary")).expect("sound JSON");
    let state = summary["state_sha256"].as_str().expect("a hash");
    let text = std::fs::read_to_string(recorded).expect("the recording is there");
    assert!(
        text.contains(state),
        "{state} is not that of {}",
        &text[..200]
    );
    let force_n = summary["tool"]["force_max_n"].as_f64();
    assert!(force_n.is_some_and(|force| force > 0.01), "{force_n:?}");
}

#[test]
fn overlays_sides_and_bad_files_change_the_picture_and_end_nothing() {
    let Some(desk) = Desk::new("overlays", 72) else {
        return;
    };
    std::fs::write(desk.folder.join("broken.glb"), b"glTF, but not for long").expect("written");
    let mut window = desk.window("liver", &[]);
    desk.tool(&["mousemove", "430", "360"]);
    let front = {
        desk.tool(&["key", "1"]);
        desk.picture(1)
    };
    desk.tool(&["key", "3"]);
    let top = desk.picture(2);
    assert!(
        changed_share(&front, &top) > 0.05,
        "from above it looks as from the front"
    );
    // Each one on, over the others; the scene's own picture does not hold them.
    for key in ["v", "t", "l", "b", "x"] {
        desk.tool(&["key", key]);
    }
    let with_overlays = desk.picture(3);
    assert!(
        changed_share(&top, &with_overlays) < 0.001,
        "overlays are in the picture"
    );
    for wrong in ["broken.glb", "nowhere.toml", "notes.txt"] {
        desk.open(wrong);
        sleep(Duration::from_millis(800));
        // The message goes, and the scene is still there.
        desk.tool(&["key", "Escape"]);
    }
    let id = desk.id().expect("the window is still there");
    for [width, height] in [
        ["600", "400"],
        ["1279", "799"],
        ["480", "320"],
        ["1180", "720"],
    ] {
        desk.tool(&["windowsize", &id, width, height]);
        sleep(Duration::from_millis(300));
    }
    desk.tool(&["windowunmap", &id]);
    sleep(Duration::from_millis(300));
    desk.tool(&["windowmap", "--sync", &id]);
    desk.tool(&["windowfocus", "--sync", &id]);
    desk.tool(&["mousemove", "430", "360"]);
    let again = desk.picture(4);
    assert_eq!(again.dimensions(), top.dimensions());
    assert!(
        changed_share(&top, &again) < 0.01,
        "the scene is another after bad files"
    );
    desk.close(&mut window);
}

#[test]
fn typed_letters_are_no_keys_tab_hides_the_panel_and_a_recording_is_not_lost_with_the_window() {
    let Some(desk) = Desk::new("keys", 75) else {
        return;
    };
    let mut window = desk.window("slab", &[]);
    desk.tool(&["mousemove", "430", "360"]);
    let beside_panel = desk.picture(1);
    desk.tool(&["key", "Tab"]);
    sleep(Duration::from_secs(2));
    let whole = desk.picture(2);
    assert!(
        whole.width() > beside_panel.width(),
        "the panel is still there"
    );
    desk.tool(&["key", "Tab"]);
    sleep(Duration::from_secs(2));
    // Clicked and typed within a frame or two. A letter that got through as a key would start a recording.
    desk.tool(&["mousemove", "960", "62", "click", "1", "key", "o"]);
    desk.tool(&["type", "to"]);
    sleep(Duration::from_secs(2));
    desk.close(&mut window);
    let recorded = desk.folder.join("palpate-001.toml");
    assert!(!recorded.exists(), "typing started a recording");

    let mut window = desk.window("slab", &[]);
    desk.tool(&["mousemove", "430", "360", "key", "o"]);
    sleep(Duration::from_secs(1));
    desk.tool(&["mousedown", "1"]);
    for y in ["364", "368", "372"] {
        desk.tool(&["mousemove", "430", y]);
        sleep(Duration::from_millis(200));
    }
    desk.tool(&["mouseup", "1"]);
    desk.close(&mut window);
    assert_replays(&recorded);
}

#[test]
fn a_saved_scene_opens_to_the_same_picture() {
    let Some(desk) = Desk::new("saved", 73) else {
        return;
    };
    let mut window = desk.window("slab", &[]);
    desk.tool(&["mousemove", "430", "360", "mousedown", "2"]);
    desk.tool(&["mousemove", "500", "380"]);
    desk.tool(&["mouseup", "2"]);
    let before = desk.picture(1);
    desk.tool(&["key", "k"]);
    let saved = desk.folder.join("palpate-001.toml");
    desk.wait_for("the saved scene", || saved.exists());
    desk.tool(&["key", "3"]);
    let elsewhere = desk.picture(2);
    assert!(changed_share(&before, &elsewhere) > 0.02);
    desk.open("palpate-001.toml");
    sleep(Duration::from_secs(3));
    let after = desk.picture(3);
    assert!(
        changed_share(&before, &after) < 0.002,
        "the saved scene looks otherwise"
    );
    desk.close(&mut window);
}

/// Processor time that the window takes in a second [s], over `seconds`.
fn load_of(process: u32, seconds: u64) -> f64 {
    let before = spent(process).expect("the process is there").0;
    let start = Instant::now();
    sleep(Duration::from_secs(seconds));
    let after = spent(process).expect("the process is there").0;
    (after - before) / start.elapsed().as_secs_f64()
}

#[test]
fn a_window_that_nobody_touches_sleeps() {
    let Some(desk) = Desk::new("asleep", 74) else {
        return;
    };
    let mut window = desk.window("liver", &[]);
    let process = window.0.id();
    desk.tool(&["mousemove", "430", "360"]);
    // It falls asleep by itself; a button held down keeps it awake.
    sleep(Duration::from_secs(6));
    let asleep = load_of(process, 20);
    desk.tool(&["mousedown", "1"]);
    sleep(Duration::from_secs(1));
    let awake = load_of(process, 20);
    desk.tool(&["mouseup", "1"]);
    println!(
        "processor time a second: {asleep:.3} s asleep, {awake:.3} s awake, {:.2} %",
        100.0 * asleep / awake
    );
    // A share of the same machine's work, not a time. What is left asleep is looking ten times a second.
    assert!(asleep < 0.05 * awake, "{asleep} s asleep, {awake} s awake");
    desk.close(&mut window);
}
