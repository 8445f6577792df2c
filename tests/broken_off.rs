//! Runs that are broken off: killed at any moment, out of room, into a folder that takes nothing. What has
//! its final name is whole, and what went wrong is named. No test here needs a GPU.

#[path = "support/run.rs"]
mod run;

use run::{Run, folder, messages, palpate};
use std::path::Path;
use std::process::{Command, Stdio};
use std::time::Duration;

/// A simulated replay of some twenty frames.
const REPLAY: &str = "slab --no-render --frames 20";

/// What is wrong with the files of `out` under their final names; files under way end in `.partial`.
fn faults(out: &Path) -> Vec<String> {
    let mut faults = Vec::new();
    for entry in std::fs::read_dir(out).into_iter().flatten() {
        let file = entry.expect("an entry").path();
        let name = file
            .file_name()
            .unwrap_or_default()
            .to_string_lossy()
            .into_owned();
        let bytes = std::fs::read(&file).unwrap_or_default();
        let whole = match file.extension().and_then(|ending| ending.to_str()) {
            Some("json") => serde_json::from_slice::<serde_json::Value>(&bytes).is_ok(),
            Some("csv") => bytes.ends_with(b"\n"),
            Some("html") => bytes.ends_with(b"</html>\n"),
            Some("bin") => bytes.len() > 100,
            Some("partial") => true,
            _ => false,
        };
        if !whole {
            faults.push(format!("{name} of {} bytes", bytes.len()));
        }
    }
    faults
}

#[test]
fn replay_that_is_killed_leaves_no_half_of_a_file() {
    let out = folder("broken-off-killed");
    let (mut killed, mut ended) = (0, 0);
    // From long before a run can end on any machine to long after, until both ends were seen.
    for attempt in 0..32 {
        let mut replay = Run::command(&out, REPLAY)
            .stderr(Stdio::null())
            .spawn()
            .expect("it runs");
        std::thread::sleep(Duration::from_secs_f64(0.004 * 1.25_f64.powi(attempt)));
        // SIGKILL on Unix: nothing is tidied up.
        replay.kill().expect("it can be killed");
        match replay.wait().expect("it ends").success() {
            true => ended += 1,
            false => killed += 1,
        }
        assert_eq!(faults(&out), Vec::<String>::new(), "attempt {attempt}");
        if ended >= 3 && killed >= 3 {
            break;
        }
    }
    assert!(killed >= 3, "{killed} runs were killed");
}

#[test]
fn half_of_a_file_would_be_noticed() {
    let run = Run::new("broken-off-halves", REPLAY);
    assert_eq!(faults(&run.out), Vec::<String>::new());
    for name in ["summary.json", "frames.csv", "report.html", "trace.json"] {
        let file = run.out.join(name);
        let whole = std::fs::read(&file).expect("it is there");
        std::fs::write(&file, &whole[..whole.len() / 2 + 1]).expect("it can be cut");
        assert_eq!(faults(&run.out).len(), 1, "{name}");
        std::fs::write(&file, &whole).expect("it can be mended");
    }
}

/// Each file may have `blocks` of 512 bytes: then the system refuses to write more, as a full disk does.
#[cfg(target_os = "linux")]
fn in_little_room(blocks: u32, out: &Path) -> std::process::Output {
    let program = env!("CARGO_BIN_EXE_palpate");
    let script = format!(
        "trap '' XFSZ; ulimit -f {blocks}; exec '{program}' replay {REPLAY} --out '{}'",
        out.display()
    );
    Command::new("sh")
        .args(["-c", &script])
        .output()
        .expect("a shell runs")
}

#[cfg(target_os = "linux")]
#[test]
fn disk_without_room_is_told_and_keeps_what_was_there() {
    let out = folder("broken-off-full");
    std::fs::write(out.join("frames.csv"), "an earlier run\n").expect("a file");
    let output = in_little_room(1, &out);
    let message = messages(&output);
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(
        message.contains("cannot write") && message.contains("room"),
        "{message}"
    );
    assert_eq!(faults(&out), Vec::<String>::new());
    let names = std::fs::read_dir(&out).expect("it is there");
    let partial = names
        .flatten()
        .any(|entry| entry.path().extension().is_some_and(|e| e == "partial"));
    assert!(!partial, "what could not be finished is removed");
    let before = std::fs::read_to_string(out.join("frames.csv")).expect("it is there");
    assert!(
        before == "an earlier run\n" || before.starts_with("frame"),
        "{before}"
    );
}

#[cfg(target_os = "linux")]
#[test]
fn device_that_is_full_is_named() {
    let out = folder("broken-off-device");
    std::os::unix::fs::symlink("/dev/full", out.join("summary.json")).expect("a link");
    let output = Run::command(&out, REPLAY).output().expect("it runs");
    let message = messages(&output);
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(message.contains("summary.json"), "{message}");
}

#[cfg(target_os = "linux")]
#[test]
fn folder_that_takes_no_files_is_refused_before_a_frame_is_run() {
    // Not even root makes files there.
    let output = palpate(&[
        "replay",
        "slab",
        "--no-render",
        "--frames",
        "100000",
        "--out",
        "/proc",
    ])
    .output()
    .expect("it runs");
    let message = messages(&output);
    assert_eq!(output.status.code(), Some(2), "{message}");
    assert!(message.contains("/proc"), "{message}");
}
