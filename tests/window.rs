//! The window, driven by a real mouse under Xvfb: the organ moves, it pushes back, the picture changes.
//!
//! Needs Xvfb and xdotool, which `make test` installs. Where they are missing the test says so; in CI that is
//! a failure.

use std::path::{Path, PathBuf};
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// A child that does not outlive the test.
struct Guard(Child);

impl Drop for Guard {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// An X server of our own and the folder that the window saves into.
struct Desk {
    display: String,
    folder: PathBuf,
    _server: Guard,
}

impl Desk {
    fn new(name: &str, number: u32) -> Option<Self> {
        for program in ["Xvfb", "xdotool"] {
            if Command::new(program)
                .arg(if program == "Xvfb" {
                    "-help"
                } else {
                    "version"
                })
                .stdout(Stdio::null())
                .stderr(Stdio::null())
                .status()
                .is_err()
            {
                assert!(
                    std::env::var_os("CI").is_none(),
                    "{program} is missing; `make test` installs it"
                );
                println!("{program} is missing: the window was not tested");
                return None;
            }
        }
        let folder = std::env::temp_dir().join(format!("palpate-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).expect("a temporary folder");
        let display = format!(":{number}");
        let server = Command::new("Xvfb")
            .args([&display, "-screen", "0", "1280x800x24", "-nolisten", "tcp"])
            .stdout(Stdio::null())
            .stderr(Stdio::null())
            .spawn()
            .expect("Xvfb starts");
        let desk = Self {
            display,
            folder,
            _server: Guard(server),
        };
        desk.wait_for("the X server", || {
            desk.try_tool(&["getmouselocation"]).is_some()
        });
        Some(desk)
    }

    fn try_tool(&self, arguments: &[&str]) -> Option<String> {
        let output = Command::new("xdotool")
            .args(arguments)
            .env("DISPLAY", &self.display)
            .stderr(Stdio::null())
            .output()
            .ok()?;
        output
            .status
            .success()
            .then(|| String::from_utf8_lossy(&output.stdout).into_owned())
    }

    fn tool(&self, arguments: &[&str]) -> String {
        self.try_tool(arguments)
            .unwrap_or_else(|| panic!("xdotool {arguments:?} failed"))
    }

    fn wait_for(&self, what: &str, mut ready: impl FnMut() -> bool) {
        let start = Instant::now();
        while !ready() {
            assert!(
                start.elapsed() < Duration::from_secs(120),
                "waited two minutes for {what}"
            );
            sleep(Duration::from_millis(100));
        }
    }

    /// Presses the key that saves a picture, and waits for the file.
    fn picture(&self, number: u32) -> image::RgbaImage {
        self.tool(&["key", "s"]);
        let path = self.folder.join(format!("palpate-{number:03}.png"));
        self.wait_for("a picture", || path.exists());
        image::open(path).expect("a sound PNG").to_rgba8()
    }
}

impl Desk {
    /// A push that is recorded, and the scene file it ends in.
    fn recorded_push(&self) -> PathBuf {
        self.tool(&["key", "o"]);
        sleep(Duration::from_millis(500));
        self.tool(&["mousedown", "1"]);
        for step in 0..6 {
            let y = (350 + 4 * step).to_string();
            self.tool(&["mousemove", "440", &y]);
            sleep(Duration::from_millis(150));
        }
        self.tool(&["mouseup", "1"]);
        sleep(Duration::from_millis(300));
        self.tool(&["key", "o"]);
        let path = self.folder.join("palpate-001.toml");
        self.wait_for("a recording", || path.exists());
        path
    }
}

impl Drop for Desk {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.folder);
    }
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
    let mut window = Guard(
        Command::new(env!("CARGO_BIN_EXE_palpate"))
            .args(["window", "liver-gooey", "--log"])
            .arg(&log)
            .current_dir(&desk.folder)
            .env("DISPLAY", &desk.display)
            .env_remove("WAYLAND_DISPLAY")
            .env_remove("WAYLAND_SOCKET")
            .stdout(Stdio::null())
            .spawn()
            .expect("the window starts"),
    );
    let mut id = String::new();
    desk.wait_for("the window", || {
        id = desk
            .try_tool(&["search", "--name", "^palpate$"])
            .unwrap_or_default();
        !id.trim().is_empty()
    });
    let id = id.lines().next().unwrap_or_default().trim();
    desk.tool(&["windowfocus", "--sync", id]);

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
    let recorded = desk.recorded_push();
    desk.tool(&["key", "ctrl+q"]);
    desk.wait_for("the window to close", || {
        window.0.try_wait().expect("the window's state").is_some()
    });
    let status = window.0.wait().expect("the window has ended");
    assert!(status.success(), "the window ended with {status}");

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
