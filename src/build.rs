//! Tells the binary which commit it was built from, and which code its geometry is.

use std::path::Path;
use std::process::Command;

fn main() {
    let commit = Command::new("git")
        .args(["rev-parse", "--short=12", "HEAD"])
        .output()
        .ok()
        .filter(|output| output.status.success())
        .and_then(|output| String::from_utf8(output.stdout).ok())
        .map_or_else(|| "unknown".to_owned(), |text| text.trim().to_owned());
    println!("cargo:rustc-env=PALPATE_COMMIT={commit}");
    println!("cargo:rerun-if-changed=.git/HEAD");
    println!("cargo:rerun-if-changed=.git/logs/HEAD");
    let mut revision = 0xcbf2_9ce4_8422_2325;
    digest(Path::new("src/geom"), &mut revision);
    println!("cargo:rustc-env=PALPATE_GEOM_REVISION={revision:016x}");
    println!("cargo:rerun-if-changed=src/geom");
}

/// Adds every file below `folder` to a digest (FNV-1a), in the order of their names.
fn digest(folder: &Path, revision: &mut u64) {
    let entries = std::fs::read_dir(folder).expect("the sources are there");
    let mut paths: Vec<_> = entries
        .map(|entry| entry.expect("a source can be listed").path())
        .collect();
    paths.sort();
    for path in paths {
        if path.is_dir() {
            digest(&path, revision);
            continue;
        }
        for byte in std::fs::read(&path).expect("a source can be read") {
            *revision = (*revision ^ u64::from(byte)).wrapping_mul(0x0100_0000_01b3);
        }
    }
}
