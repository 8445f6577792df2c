//! Runs of the binary in folders of their own.

#![allow(dead_code)] // Each test binary asks for a part of it.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

/// An empty folder called `name` below the one that cargo keeps for these tests.
pub fn folder(name: &str) -> PathBuf {
    let path = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&path);
    std::fs::create_dir_all(&path).expect("a folder for the test");
    path
}

/// The program with these arguments, ready to run.
pub fn palpate<S: AsRef<str>>(arguments: &[S]) -> Command {
    let mut command = Command::new(env!("CARGO_BIN_EXE_palpate"));
    // What is kept for the next start is kept beside the tests' other files.
    command.env(
        "XDG_CACHE_HOME",
        concat!(env!("CARGO_TARGET_TMPDIR"), "/cache"),
    );
    command.args(arguments.iter().map(AsRef::as_ref));
    command
}

/// What it wrote to standard error.
pub fn messages(output: &Output) -> String {
    String::from_utf8_lossy(&output.stderr).into_owned()
}

/// A finished replay and its folder.
pub struct Run {
    /// What it wrote into.
    pub out: PathBuf,
}

impl Run {
    /// Replays into the folder `name`, with further `arguments` separated by spaces.
    ///
    /// # Panics
    ///
    /// If it does not end with status 0.
    pub fn new(name: &str, arguments: &str) -> Self {
        let out = folder(name);
        let output = Self::command(&out, arguments).output().expect("it runs");
        assert!(
            output.status.success(),
            "replay {arguments}: {}",
            messages(&output)
        );
        Self { out }
    }

    /// The same, not yet started.
    pub fn command(out: &Path, arguments: &str) -> Command {
        let mut command = palpate(&["replay"]);
        command.args(arguments.split_whitespace());
        command.arg("--out").arg(out);
        command
    }

    /// A file of the run, as text.
    pub fn text(&self, name: &str) -> String {
        std::fs::read_to_string(self.out.join(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    /// A file of the run, as JSON.
    pub fn json(&self, name: &str) -> serde_json::Value {
        serde_json::from_str(&self.text(name)).unwrap_or_else(|e| panic!("{name}: {e}"))
    }

    /// `summary.json`.
    pub fn summary(&self) -> serde_json::Value {
        self.json("summary.json")
    }

    /// Names of all pictures, sorted.
    pub fn pictures(&self) -> Vec<String> {
        let entries = std::fs::read_dir(&self.out).expect("the folder is there");
        let mut names: Vec<String> = entries
            .map(|entry| entry.expect("an entry").file_name())
            .map(|name| name.to_string_lossy().into_owned())
            .filter(|name| name.ends_with(".png"))
            .collect();
        names.sort();
        names
    }
}
