//! The bundled organs and specimens are what the code makes, byte for byte.
//!
//! `PALPATE_ACCEPT=1 cargo test --test bundled_organs` makes the files again; commit what it
//! writes together with the change that made it necessary.

use palpate::geom::organ::{BundledFile, Organ, bundled_files};
use palpate::geom::specimen::Specimen;
use std::path::{Path, PathBuf};

fn scenes() -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("scenes")
}

/// What is wrong with the file under `folder`, if anything.
fn difference(folder: &Path, made: &BundledFile) -> Option<String> {
    match std::fs::read(folder.join(&made.path)) {
        Err(error) => Some(format!("{}: {error}", made.path)),
        Ok(found) if found.len() != made.bytes.len() => Some(format!(
            "{}: {} bytes on disk, {} made",
            made.path,
            found.len(),
            made.bytes.len()
        )),
        Ok(found) => found
            .iter()
            .zip(&made.bytes)
            .position(|(a, b)| a != b)
            .map(|at| format!("{}: byte {at} differs", made.path)),
    }
}

fn accept(made: &BundledFile) {
    let path = scenes().join(&made.path);
    std::fs::create_dir_all(path.parent().expect("a file lies in a folder"))
        .expect("the folder can be made");
    std::fs::write(&path, &made.bytes).expect("the file can be written");
}

#[test]
fn bundled_files_are_what_the_code_makes_byte_for_byte() {
    let made: Vec<BundledFile> = (Organ::ALL.into_iter().flat_map(bundled_files))
        .chain(Specimen::ALL.map(Specimen::bundled_file))
        .collect();
    if std::env::var_os("PALPATE_ACCEPT").is_some() {
        made.iter().for_each(accept);
        let total: usize = made.iter().map(|file| file.bytes.len()).sum();
        println!("wrote {} files, {total} bytes", made.len());
    }
    let wrong: Vec<String> = made
        .iter()
        .filter_map(|file| difference(&scenes(), file))
        .collect();
    assert!(
        wrong.is_empty(),
        "PALPATE_ACCEPT=1 makes them again:\n{}",
        wrong.join("\n")
    );
    let total: usize = made.iter().map(|file| file.bytes.len()).sum();
    // They are inside the binary.
    assert!(total < 8 << 20, "{total} bytes are too many to bundle");
}

#[test]
fn bundle_check_rejects_one_changed_byte() {
    let folder = std::env::temp_dir().join(format!("palpate-bundle-{}", std::process::id()));
    let made = BundledFile {
        path: "organs/any.glb".to_string(),
        bytes: vec![1, 2, 3],
    };
    std::fs::create_dir_all(folder.join("organs")).expect("the folder can be made");
    let check = |bytes: &[u8]| {
        std::fs::write(folder.join(&made.path), bytes).expect("the file can be written");
        difference(&folder, &made)
    };
    assert_eq!(check(&[1, 2, 3]), None);
    assert!(check(&[1, 7, 3]).is_some_and(|why| why.contains("byte 1")));
    assert!(check(&[1, 2]).is_some());
    std::fs::remove_dir_all(&folder).expect("the folder can be removed");
    assert!(difference(&folder, &made).is_some());
}
