//! The shape of the crate, as `docs/ARCHITECTURE.md` draws it: who uses whom, what every kernel and
//! every module must say of itself, and that the map names only places that exist.
//!
//! Each rule is a function of text, so that a test can hand it a text that breaks it.

use std::fs;
use std::path::{Path, PathBuf};

/// Each module and the modules it may use. What is missing here is forbidden.
const MAY_USE: &[(&str, &[&str])] = &[
    ("geom", &[]),
    ("optics", &[]),
    ("measure", &[]),
    ("gpu", &[]),
    ("sim", &["geom"]),
    ("scene", &["geom", "sim", "optics"]),
    ("reference", &["geom"]),
    ("passes", &["geom", "optics", "gpu", "scene"]),
    (
        "study",
        &[
            "geom",
            "sim",
            "optics",
            "gpu",
            "scene",
            "passes",
            "measure",
            "reference",
            "app",
        ],
    ),
    (
        "app",
        &[
            "geom",
            "sim",
            "optics",
            "gpu",
            "scene",
            "passes",
            "measure",
            "reference",
            "study",
        ],
    ),
];

/// Crates that only some places may use: a path prefix under `src/` each.
const CRATE_PLACES: &[(&str, &[&str])] = &[
    ("winit", &["app/"]),
    ("egui", &["app/"]),
    ("bvh", &["reference/"]),
    ("faer", &["reference/"]),
    ("gltf", &["geom/import"]),
    ("tobj", &["geom/"]),
    ("rayon", &["sim/", "geom/"]),
    ("nalgebra", &["geom/", "reference/"]),
    ("wgpu", &["gpu/", "passes/", "app/", "study/"]),
];

fn root() -> &'static Path {
    Path::new(env!("CARGO_MANIFEST_DIR"))
}

fn read(path: &str) -> Option<String> {
    fs::read_to_string(root().join(path)).ok()
}

/// Files under `folder` with this extension, as paths from the project's root.
fn files(folder: &str, extension: &str) -> Vec<String> {
    let mut found = Vec::new();
    let mut folders = vec![root().join(folder)];
    while let Some(folder) = folders.pop() {
        for entry in fs::read_dir(folder).expect("the folder is there") {
            let path: PathBuf = entry.expect("can be listed").path();
            if path.is_dir() {
                folders.push(path);
            } else if path.extension().is_some_and(|e| e == extension) {
                let inside = path.strip_prefix(root()).expect("is inside");
                found.push(inside.to_string_lossy().into_owned());
            }
        }
    }
    found.sort();
    found
}

/// The lines of `source` that are code.
fn code_lines(source: &str) -> impl Iterator<Item = &str> {
    source
        .lines()
        .filter(|line| !line.trim_start().starts_with("//"))
}

/// Module of a file: `src/geom/plane.rs` and `src/geom.rs` are in `geom`.
fn module_of(path: &str) -> Option<&str> {
    let inside = path.strip_prefix("src/")?;
    Some(inside.split('/').next()?.trim_end_matches(".rs"))
}

/// Modules that `source` names by `crate::module`.
fn modules_used(source: &str) -> Vec<String> {
    code_lines(source)
        .flat_map(|line| line.split("crate::").skip(1))
        .map(|rest| {
            let word = rest.split(|c: char| !(c.is_alphanumeric() || c == '_'));
            word.into_iter().next().unwrap_or_default().to_owned()
        })
        .collect()
}

fn direction_faults(path: &str, source: &str) -> Vec<String> {
    let Some((module, allowed)) = module_of(path)
        .and_then(|module| MAY_USE.iter().find(|(name, _)| *name == module))
        .copied()
    else {
        return Vec::new();
    };
    modules_used(source)
        .into_iter()
        .filter(|used| MAY_USE.iter().any(|(name, _)| name == used))
        .filter(|used| used != module && !allowed.contains(&used.as_str()))
        .map(|used| format!("{path} uses {used}, which does not lie below {module}"))
        .collect()
}

fn crate_faults(path: &str, source: &str) -> Vec<String> {
    let inside = path.strip_prefix("src/").unwrap_or(path);
    CRATE_PLACES
        .iter()
        .filter(|(_, places)| !places.iter().any(|place| inside.starts_with(place)))
        .filter(|(name, _)| {
            code_lines(source).any(|line| {
                let line = line.trim_start();
                line.starts_with(&format!("use {name}::"))
                    || line.starts_with(&format!("use {name};"))
                    || line.contains(&format!(" {name}::"))
                    || line.contains(&format!("({name}::"))
                    || line.contains(&format!("<{name}::"))
            })
        })
        .map(|(name, places)| format!("{path} uses {name}, which belongs in {places:?}"))
        .collect()
}

/// What the header of a kernel lacks. `exists` tells whether a file has a function.
fn kernel_faults(path: &str, source: &str, exists: impl Fn(&str, &str) -> bool) -> Vec<String> {
    let stages = ["@compute", "@vertex", "@fragment"];
    let is_kernel = stages.iter().any(|stage| source.contains(stage));
    let header: Vec<&str> = source
        .lines()
        .take_while(|line| line.starts_with("//"))
        .collect();
    let value = |key: &str| {
        let lines = header.iter();
        let mut values = lines.filter_map(|line| line.trim_start_matches("// ").strip_prefix(key));
        values.next().map(str::trim)
    };
    // A shared file without a formula of its own needs no twin.
    if !is_kernel && value("Twin:").is_none() {
        return Vec::new();
    }
    let mut faults = Vec::new();
    if value("Source:").is_none_or(str::is_empty) {
        faults.push(format!("{path} names no source"));
    }
    for key in ["Twin:", "Parity:"] {
        if key == "Parity:" && !is_kernel && value(key).is_none() {
            continue;
        }
        let Some((file, function)) = value(key).and_then(|v| v.split_once(", fn ")) else {
            faults.push(format!("{path} names no {key} file and function"));
            continue;
        };
        if !exists(file, function) {
            faults.push(format!(
                "{path}: {key} {file}, fn {function} does not exist"
            ));
        }
    }
    faults
}

fn has_function(file: &str, function: &str) -> bool {
    let name = format!("fn {function}");
    read(file).is_some_and(|source| {
        source.match_indices(&name).any(|(at, _)| {
            let next = source[at + name.len()..].chars().next();
            matches!(next, Some('(' | '<'))
        })
    })
}

/// Paths in backticks that a document names and that are not there.
fn missing_paths(document: &str, exists: impl Fn(&str) -> bool) -> Vec<String> {
    document
        .split('`')
        .skip(1)
        .step_by(2)
        .filter(|word| {
            let folders = ["src/", "shaders/", "scenes/", "tests/", "docs/"];
            folders.iter().any(|folder| word.starts_with(folder))
        })
        .filter(|path| !path.contains(['*', ' ', '…']) && !exists(path))
        .map(str::to_owned)
        .collect()
}

#[test]
fn modules_use_only_what_lies_below_them() {
    let faults: Vec<String> = files("src", "rs")
        .iter()
        .flat_map(|path| direction_faults(path, &read(path).expect("can be read")))
        .collect();
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn direction_check_rejects_an_arrow_upwards() {
    let source = "use crate::geom::patch;\nlet x = crate::passes::tangents::NAME;\n";
    assert!(direction_faults("src/app/mod.rs", source).is_empty());
    assert_eq!(direction_faults("src/sim/mod.rs", source).len(), 1);
    assert_eq!(direction_faults("src/gpu/mod.rs", source).len(), 2);
}

#[test]
fn every_module_has_its_row_in_the_table() {
    for path in files("src", "rs") {
        let module = module_of(&path).expect("is in src");
        assert!(
            ["lib", "main", "build"].contains(&module)
                || MAY_USE.iter().any(|(name, _)| *name == module),
            "{path}: say in MAY_USE what {module} may use"
        );
    }
}

#[test]
fn crates_are_used_where_they_belong() {
    let faults: Vec<String> = files("src", "rs")
        .iter()
        .flat_map(|path| crate_faults(path, &read(path).expect("can be read")))
        .collect();
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn crate_check_rejects_a_gpu_in_the_simulation() {
    assert_eq!(
        crate_faults(
            "src/sim/mod.rs",
            "fn f(d: &wgpu::Device, b: wgpu::Buffer) {}"
        )
        .len(),
        1
    );
    assert!(crate_faults("src/sim/mod.rs", "// wgpu::Device\nuse rayon::prelude::*;").is_empty());
}

#[test]
fn every_kernel_names_a_source_and_a_twin_that_exists() {
    let faults: Vec<String> = files("shaders", "wgsl")
        .iter()
        .flat_map(|path| kernel_faults(path, &read(path).expect("can be read"), has_function))
        .collect();
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn kernel_check_rejects_a_missing_source_and_a_twin_that_is_gone() {
    let kernel = "// Normals.\n// Source:  a paper.\n// Twin:    src/a.rs, fn twin\n\
                  // Parity:  tests/a.rs, fn parity\n@compute @workgroup_size(64) fn main() {}\n";
    let both = |_: &str, function: &str| ["twin", "parity"].contains(&function);
    assert!(kernel_faults("a.wgsl", kernel, both).is_empty());
    let without_source = kernel.replace("// Source:  a paper.\n", "");
    assert_eq!(kernel_faults("a.wgsl", &without_source, both).len(), 1);
    assert_eq!(kernel_faults("a.wgsl", kernel, |_, f| f == "twin").len(), 1);
    let without_header = "@compute @workgroup_size(64) fn main() {}\n";
    assert_eq!(kernel_faults("a.wgsl", without_header, both).len(), 3);
    assert!(has_function("src/geom/plane.rs", "fit_plane"));
    assert!(!has_function("src/geom/plane.rs", "fit_plan"));
    assert!(!has_function("src/geom/nowhere.rs", "fit_plane"));
}

#[test]
fn every_module_opens_with_a_comment() {
    let silent: Vec<String> = files("src", "rs")
        .into_iter()
        .chain(files("tests", "rs"))
        .filter(|path| !opens_with_a_comment(&read(path).expect("can be read")))
        .collect();
    assert!(silent.is_empty(), "no `//!` at the top of {silent:?}");
}

fn opens_with_a_comment(source: &str) -> bool {
    source.starts_with("//! ")
}

#[test]
fn opening_check_rejects_code_without_a_comment() {
    assert!(opens_with_a_comment("//! Shapes.\nuse glam::Vec3;\n"));
    assert!(!opens_with_a_comment("use glam::Vec3;\n//! Shapes.\n"));
    assert!(!opens_with_a_comment(""));
}

#[test]
fn every_path_in_the_architecture_document_exists() {
    if let Some(document) = read("docs/ARCHITECTURE.md") {
        let missing = missing_paths(&document, |path| root().join(path).exists());
        assert!(missing.is_empty(), "not there: {missing:?}");
    }
}

#[test]
fn path_check_rejects_a_place_that_is_gone() {
    let document = "See `src/lib.rs`, `src/nowhere.rs` and `cargo test`.";
    let missing = missing_paths(document, |path| root().join(path).exists());
    assert_eq!(missing, ["src/nowhere.rs"]);
}
