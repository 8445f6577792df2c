//! An X server of a test's own, with a window of palpate on it and a mouse to drive it.

#![allow(dead_code)] // Each test binary asks for a part of it.

use std::path::PathBuf;
use std::process::{Child, Command, Stdio};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// A child that does not outlive the test.
pub struct Guard(pub Child);

impl Drop for Guard {
    fn drop(&mut self) {
        let _ = self.0.kill();
        let _ = self.0.wait();
    }
}

/// An X server of our own and the folder that the window saves into.
pub struct Desk {
    display: String,
    /// What the window saves into.
    pub folder: PathBuf,
    _server: Guard,
}

impl Desk {
    /// Starts a server; `None`, said aloud, where Xvfb or xdotool is missing.
    pub fn new(name: &str, number: u32) -> Option<Self> {
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
            // Else it begins anew when the last program leaves it, and takes a window that just comes with it.
            .arg("-noreset")
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

    /// Standard output of xdotool, if it does what it is told.
    pub fn try_tool(&self, arguments: &[&str]) -> Option<String> {
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

    /// The same; it must.
    pub fn tool(&self, arguments: &[&str]) -> String {
        self.try_tool(arguments)
            .unwrap_or_else(|| panic!("xdotool {arguments:?} failed"))
    }

    /// Looks again and again, for two minutes at most.
    pub fn wait_for(&self, what: &str, mut ready: impl FnMut() -> bool) {
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
    pub fn picture(&self, number: u32) -> image::RgbaImage {
        self.tool(&["key", "s"]);
        let path = self.folder.join(format!("palpate-{number:03}.png"));
        self.wait_for("a picture", || path.exists());
        image::open(path).expect("a sound PNG").to_rgba8()
    }
}

impl Desk {
    /// A window on `scene` that has the keyboard, with further arguments.
    pub fn window(&self, scene: &str, more: &[&str]) -> Guard {
        let window = Command::new(env!("CARGO_BIN_EXE_palpate"))
            .args(["window", scene])
            .args(more)
            .current_dir(&self.folder)
            .env("DISPLAY", &self.display)
            .env_remove("WAYLAND_DISPLAY")
            .env_remove("WAYLAND_SOCKET")
            .stdout(Stdio::null())
            .spawn()
            .expect("the window starts");
        let mut window = Guard(window);
        self.wait_for("the window", || {
            let ended = window.0.try_wait().expect("it can be asked");
            assert!(ended.is_none(), "the window ended: {ended:?}");
            self.id().is_some()
        });
        self.tool(&["windowfocus", "--sync", &self.id().expect("it is there")]);
        window
    }

    /// The window's number.
    pub fn id(&self) -> Option<String> {
        let found = self.try_tool(&["search", "--name", "^palpate$"])?;
        let id = found.lines().next()?.trim().to_owned();
        (!id.is_empty()).then_some(id)
    }

    /// Types a path where the panel takes one, and opens it.
    pub fn open(&self, path: &str) {
        // The field below the title.
        self.tool(&["mousemove", "960", "62", "click", "1"]);
        // A slow machine takes a second to a frame, and the field has the keys from the next one on.
        sleep(Duration::from_secs(3));
        self.tool(&["key", "ctrl+a"]);
        self.tool(&["type", path]);
        self.tool(&["key", "Return"]);
        self.tool(&["mousemove", "430", "360"]);
    }

    /// Asks the window to close, and waits until it has.
    ///
    /// # Panics
    ///
    /// If it does not end well.
    pub fn close(&self, window: &mut Guard) {
        self.tool(&["key", "ctrl+q"]);
        self.wait_for("the window to close", || {
            window.0.try_wait().expect("the window's state").is_some()
        });
        let status = window.0.wait().expect("the window has ended");
        assert!(status.success(), "the window ended with {status}");
    }
}

/// What the system says of a process: processor time so far [s], and memory in use [MiB].
pub fn spent(process: u32) -> Option<(f64, f64)> {
    let stat = std::fs::read_to_string(format!("/proc/{process}/stat")).ok()?;
    // The name in brackets may hold anything; user and system time are the 12th and 13th after it.
    let after: Vec<&str> = stat.rsplit_once(')')?.1.split_whitespace().collect();
    let ticks: f64 = after
        .get(11..13)?
        .iter()
        .filter_map(|t| t.parse::<f64>().ok())
        .sum();
    let status = std::fs::read_to_string(format!("/proc/{process}/status")).ok()?;
    let resident = status
        .lines()
        .find_map(|line| line.strip_prefix("VmRSS:"))?;
    let kib: f64 = resident.split_whitespace().next()?.parse().ok()?;
    // Linux counts a hundred ticks a second for everyone.
    Some((ticks / 100.0, kib / 1024.0))
}

impl Drop for Desk {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.folder);
    }
}
