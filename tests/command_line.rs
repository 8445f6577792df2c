//! The command line as scripts see it: exit status, files, messages. No test here needs a GPU.

use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn palpate(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_palpate"))
        .env(
            "XDG_CACHE_HOME",
            concat!(env!("CARGO_TARGET_TMPDIR"), "/cache"),
        )
        .args(arguments)
        .output()
        .expect("the binary runs")
}

/// A folder that is removed at the end of the test.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let path = std::env::temp_dir().join(format!("palpate-cli-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&path).expect("a temporary folder");
        Self(path)
    }

    fn write(&self, name: &str, content: &[u8]) -> String {
        let path = self.0.join(name);
        std::fs::write(&path, content).expect("a temporary file");
        path.display().to_string()
    }

    fn path(&self, name: &str) -> String {
        self.0.join(name).display().to_string()
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

/// Exit status 2 and one message that holds all of `words`.
fn refused(arguments: &[&str], words: &[&str]) {
    let output = palpate(arguments);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(
        output.status.code(),
        Some(2),
        "{arguments:?} ended with {:?}: {message}",
        output.status
    );
    for word in words {
        assert!(
            message.contains(word),
            "{arguments:?}: the message lacks {word:?}: {message}"
        );
    }
    assert!(!message.contains("panicked"), "{arguments:?}: {message}");
}

/// The `summary.json` of a simulation-only replay of the slab, 40 frames long.
fn replay(folder: &Folder, out: &str, more: &[&str]) -> serde_json::Value {
    replay_frames(folder, out, "40", more)
}

fn replay_frames(folder: &Folder, out: &str, frames: &str, more: &[&str]) -> serde_json::Value {
    let out = folder.path(out);
    let mut arguments = vec![
        "replay",
        "slab",
        "--no-render",
        "--frames",
        frames,
        "--out",
        &out,
    ];
    arguments.extend_from_slice(more);
    let output = palpate(&arguments);
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
    let text = std::fs::read_to_string(Path::new(&out).join("summary.json")).expect("a summary");
    serde_json::from_str(&text).expect("sound JSON")
}

#[test]
fn a_replay_ends_in_the_same_bits_on_one_and_two_threads_and_twice_in_a_row() {
    let folder = Folder::new("bits");
    let one = replay(&folder, "one", &["--threads", "1"]);
    let two = replay(&folder, "two", &["--threads", "2"]);
    let again = replay(&folder, "again", &["--threads", "2"]);
    assert_eq!(one["state_sha256"], two["state_sha256"]);
    assert_eq!(two["state_sha256"], again["state_sha256"]);
    let softer = replay(
        &folder,
        "softer",
        &["--set", "solver.youngs_modulus_pa=3000"],
    );
    assert_ne!(
        one["state_sha256"], softer["state_sha256"],
        "a softer slab must end elsewhere, or the hash sees nothing"
    );
}

#[test]
fn a_summary_has_every_key_that_scripts_read() {
    let folder = Folder::new("summary");
    let summary = replay(&folder, "out", &[]);
    for key in [
        "scene",
        "version",
        "commit",
        "adapter",
        "threads",
        "frames",
        "timestep_s",
        "size",
        "mesh",
        "solver",
        "frame_ms",
        "sim_ms",
        "passes",
        "left_out",
        "refit",
        "state_sha256",
        "finite",
        "inverted_tets",
        "volume_drift",
        "speed_max_final_m_s",
        "tool",
        "markers",
        "first_frame_s",
    ] {
        assert!(summary.get(key).is_some(), "no {key} in {summary}");
    }
    for key in ["p50", "p95", "p99", "max", "low1pct"] {
        assert!(summary["frame_ms"][key].is_number(), "no frame_ms.{key}");
    }
    assert_eq!(summary["frames"], 40);
    assert_eq!(summary["finite"], true);
    for file in [
        "frames.csv",
        "trace.json",
        "states.bin",
        "states.json",
        "report.html",
    ] {
        assert!(
            Path::new(&folder.path("out")).join(file).is_file(),
            "no {file}"
        );
    }
}

#[test]
fn a_pressed_slab_pushes_back_and_its_marker_sinks() {
    let folder = Folder::new("slab");
    let summary = replay_frames(&folder, "out", "80", &[]);
    let force = summary["tool"]["force_max_n"].as_f64().expect("a force");
    assert!(force > 0.01, "{force} N");
    let sunk = summary["markers"][0]["displacement_m"][1]
        .as_f64()
        .expect("a displacement");
    assert!(sunk < -0.002, "the middle moved by {sunk} m");
}

#[test]
fn a_replay_agrees_with_its_own_recording_and_not_with_another() {
    let folder = Folder::new("against");
    replay(&folder, "recorded", &[]);
    let out = folder.path("again");
    let recorded = folder.path("recorded");
    let run = |more: &[&str]| {
        let mut arguments = vec![
            "replay",
            "slab",
            "--no-render",
            "--frames",
            "40",
            "--out",
            &out,
            "--against",
            &recorded,
        ];
        arguments.extend_from_slice(more);
        palpate(&arguments).status.code()
    };
    assert_eq!(run(&[]), Some(0));
    assert_eq!(run(&["--set", "tool.0.radius_m=0.012"]), Some(1));
}

#[test]
fn a_missing_scene_is_refused_with_the_bundled_ones_named() {
    refused(&["replay", "lever"], &["lever", "liver"]);
}

#[test]
fn a_misspelt_key_is_refused_with_the_known_ones_named() {
    let folder = Folder::new("key");
    let scene = folder.write(
        "scene.toml",
        b"[body]\nshape = \"slab\"\nextent_m = [0.1, 0.1, 0.1]\n\n[solver]\nsubstep = 3\n",
    );
    refused(
        &["check", &scene],
        &[&scene, "line 6", "substep", "substeps"],
    );
    refused(
        &["replay", "slab", "--no-render", "--set", "solver.substep=3"],
        &["solver.substep", "substeps"],
    );
    refused(
        &[
            "replay",
            "slab",
            "--no-render",
            "--set",
            "solver.substeps=many",
        ],
        &["solver.substeps", "u32"],
    );
}

#[test]
fn values_out_of_range_are_refused_with_the_range() {
    for (set, words) in [
        ("solver.timestep_s=nan", ["timestep_s", "0.1"]),
        ("solver.poisson_ratio=0.5", ["poisson_ratio", "0.499"]),
        ("body.density_kg_m3=-1", ["density_kg_m3", "30000"]),
        ("body.cell_m=0", ["cell_m", "10"]),
        ("output.frames=0", ["output.frames", "1"]),
    ] {
        refused(&["replay", "slab", "--no-render", "--set", set], &words);
    }
}

#[test]
fn scene_files_that_are_no_scenes_are_refused_by_name_and_place() {
    let folder = Folder::new("hostile-scenes");
    let body = "[body]\nshape = \"slab\"\nextent_m = [0.1, 0.1, 0.1]\n";
    let cases: [(String, &[&str]); 16] = [
        (String::new(), &["body"]),
        ("body".to_owned(), &["line 1"]),
        ("[body]\n[body]\n".to_owned(), &["line 2"]),
        ("\u{0}\u{1}".to_owned(), &["line 1"]),
        (format!("a = {}", "[".repeat(100_000)), &["line 1"]),
        (
            format!("{body}colour = 3\n"),
            &["line 4", "colour", "density_kg_m3"],
        ),
        (
            format!("{body}density_kg_m3 = \"heavy\"\n"),
            &["line 4", "f32"],
        ),
        (
            format!("{body}[solver]\nsubsteps = -1\n"),
            &["line 5", "u32"],
        ),
        (
            format!("{body}[solver]\nsubsteps = 0\n"),
            &["substeps", "1"],
        ),
        (
            format!("{body}[solver]\ntimestep_s = inf\n"),
            &["timestep_s"],
        ),
        (
            format!("{body}[solver]\nmethod = \"magic\"\n"),
            &["magic", "implicit"],
        ),
        (
            format!("{body}[surface]\nkind = \"neon\"\n"),
            &["neon", "gooey"],
        ),
        (
            format!("{body}[output]\nsize = [1, 99999]\n"),
            &["output.size", "8192"],
        ),
        (
            format!("{body}[output]\nframes = 4000000000\n"),
            &["output.frames", "10000000"],
        ),
        (
            format!("{body}[[tool]]\nname = \"a\"\nradius_m = -1.0\nkeys = []\n"),
            &["tool"],
        ),
        (
            format!("{body}[[marker]]\nname = \"a\"\nnearest_m = [nan, 0, 0]\n"),
            &["marker"],
        ),
    ];
    for (text, words) in &cases {
        let scene = folder.write("hostile.toml", text.as_bytes());
        let mut all = vec!["hostile.toml"];
        all.extend(*words);
        refused(&["check", &scene], &all);
    }
    let scene = folder.write("latin.toml", b"title = \"\xe9\"\n");
    refused(&["check", &scene], &["latin.toml", "UTF-8"]);
    refused(
        &["check", &folder.0.display().to_string()],
        &["hostile-scenes"],
    );
}

#[test]
fn overrides_that_make_no_sense_are_refused_with_what_would() {
    for (set, words) in [
        ("", ["KEY=VALUE", "solver.substeps"]),
        ("solver", ["KEY=VALUE", "solver.substeps"]),
        ("=3", ["empty key", "=3"]),
        ("solver..substeps=3", ["empty key", "solver..substeps"]),
        ("solver.substeps.deeper=3", ["deeper", "plain value"]),
        ("body.extent_m=[1, 2]", ["body.extent_m", "3"]),
        ("body.extent_m=[-1, 1, 1]", ["body.extent_m", "100"]),
        ("tool.9.radius_m=0.1", ["tool.9.radius_m", "0 to 0"]),
        ("solver={}x", ["solver", "struct"]),
        ("output.size=[8192, 8193]", ["output.size", "8192"]),
        ("surface.samples=1000000", ["surface.samples", "within"]),
    ] {
        refused(&["replay", "slab", "--no-render", "--set", set], &words);
    }
    for (option, value, word) in [
        ("--size", "100000x100000", "8192"),
        ("--size", "0x0", "8192"),
        ("--frames", "4000000000", "10000000"),
        ("--frames", "0", "1.."),
        ("--frames", "-1", "-1"),
        ("--threads", "0", "1024"),
        ("--dump", "x", "x"),
    ] {
        refused(&["replay", "slab", option, value], &[word]);
    }
}

#[test]
fn meshes_that_cant_be_used_are_refused_by_name() {
    let folder = Folder::new("mesh");
    let missing = folder.path("missing.glb");
    refused(&["check", &missing], &["missing.glb"]);
    let truncated = folder.write("truncated.glb", b"glTF\x02\0\0\0\xff\xff\xff\xff");
    let flat = folder.write(
        "flat.obj",
        b"v 0 0 0\nv 0 0 0\nv 0 0 0\nv 0 0 0\nf 1 2 3\nf 1 3 4\nf 1 4 2\nf 2 4 3\n",
    );
    for (file, name) in [(&truncated, "truncated.glb"), (&flat, "flat.obj")] {
        let set = format!("body.file='{file}'");
        refused(&["replay", "liver", "--no-render", "--set", &set], &[name]);
    }
}

#[test]
fn a_missing_file_is_named_once_and_an_ending_that_is_not_read_with_those_that_are() {
    let folder = Folder::new("endings");
    let missing = folder.path("nope.msh");
    let output = palpate(&["check", &missing]);
    let message = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(message.matches("nope.msh").count(), 1, "{message}");
    let other = folder.write("body.stl", b"solid");
    let set = format!("body.file='{other}'");
    refused(
        &["replay", "liver", "--no-render", "--set", &set],
        &["body.stl", ".glb", ".obj", ".msh"],
    );
}

#[test]
fn results_are_not_put_where_a_file_is() {
    let folder = Folder::new("out-is-a-file");
    let file = folder.write("results", b"kept");
    for out in [file.clone(), format!("{file}/below")] {
        let words = ["results is a file", "folder"];
        refused(
            &[
                "replay",
                "slab",
                "--no-render",
                "--frames",
                "1",
                "--out",
                &out,
            ],
            &words,
        );
        refused(&["study", "stretch", "--quick", "--out", &out], &words);
    }
    assert_eq!(std::fs::read(&file).expect("it is there"), b"kept");
}

#[test]
fn bad_usage_ends_with_status_two() {
    refused(&["replay"], &["SCENE"]);
    refused(&["replay", "slab", "--size", "huge"], &["WIDTHxHEIGHT"]);
    refused(
        &["replay", "slab", "--frames", "10", "--dump", "11"],
        &["11", "10"],
    );
    refused(&["juggle"], &["juggle"]);
}

#[test]
fn every_bundled_scene_is_listed_and_sound() {
    let output = palpate(&["scenes"]);
    assert!(output.status.success());
    let text = String::from_utf8_lossy(&output.stdout);
    for name in ["liver", "liver-gooey", "heart", "slab"] {
        assert!(
            text.lines().any(|line| line.starts_with(name)),
            "{name} is not listed: {text}"
        );
    }
}

#[test]
fn one_who_stops_reading_ends_nothing() {
    let mut scenes = Command::new(env!("CARGO_BIN_EXE_palpate"))
        .arg("scenes")
        .stdout(std::process::Stdio::piped())
        .stderr(std::process::Stdio::piped())
        .spawn()
        .expect("the binary runs");
    drop(scenes.stdout.take());
    let ended = scenes.wait_with_output().expect("it ends");
    assert!(ended.status.success(), "{ended:?}");
    assert!(ended.stderr.is_empty(), "{ended:?}");
}

#[test]
fn two_runs_are_compared_stage_by_stage_and_a_folder_without_a_run_is_refused() {
    let folder = Folder::new("compare");
    replay(&folder, "a", &[]);
    replay(&folder, "b", &["--set", "solver.substeps=60"]);
    let (a, b) = (folder.path("a"), folder.path("b"));
    let told = |b: &str| {
        let output = palpate(&["compare", &a, b]);
        assert!(output.status.success());
        String::from_utf8_lossy(&output.stdout).into_owned()
    };
    let other = told(&b);
    let line = other.lines().find(|line| line.starts_with("simulation"));
    assert!(
        line.is_some_and(|line| line.split_whitespace().count() >= 7),
        "{other}"
    );
    assert!(other.contains("different states"), "{other}");
    let itself = told(&a);
    assert!(
        itself.contains("same time in both; no stage differs"),
        "{itself}"
    );
    assert!(itself.contains("same state"), "{itself}");
    refused(
        &["compare", &a, &folder.path("nowhere")],
        &["summary.json", "check the path"],
    );
    folder.write("summary.json", b"{}");
    let bare = folder.0.display().to_string();
    refused(&["compare", &a, &bare], &["summary.json", "palpate replay"]);
}
