//! `palpate check`: says what files hold, or what is wrong with them.

use super::{AppError, Outcome, Session, load, say::say};
use crate::geom::import::describe;
use std::path::{Path, PathBuf};

/// Describes each of `files` on standard output, what is wrong on standard error.
///
/// # Errors
///
/// [`AppError::Check`] if one can't be used; the others are still described.
pub fn check(files: &[PathBuf]) -> Result<Outcome, AppError> {
    let mut wrong = 0;
    for file in files {
        match one(file) {
            Ok(text) => say(&format!("{}\n{}\n", file.display(), indented(&text))),
            Err(error) => {
                let text = error.to_string();
                let name = file.display().to_string();
                if text.contains(&name) {
                    eprintln!("{text}");
                } else {
                    eprintln!("{name}: {text}");
                }
                wrong += 1;
            }
        }
    }
    if wrong > 0 {
        return Err(AppError::Check { wrong });
    }
    Ok(Outcome::Done)
}

/// Every line moved in, so that the file's name stands out above it.
fn indented(text: &str) -> String {
    text.trim_end()
        .lines()
        .map(|line| format!("  {line}"))
        .collect::<Vec<_>>()
        .join("\n")
}

fn one(file: &Path) -> Result<String, AppError> {
    let is_scene = file.extension().is_some_and(|ending| ending == "toml");
    if !is_scene {
        return Ok(describe(file)?);
    }
    let scene = load::scene(&file.display().to_string(), &[])?;
    let title = scene.title.clone();
    // The files it names are read too, and its script is placed.
    let session = Session::new(scene, 1)?;
    load::maps(&session.scene.body, &session.mesh, &session.pictures)?;
    let mut text = format!(
        "scene, \"{title}\"\nsurface of {} points and {} triangles, {} tetrahedra, {} tools",
        session.mesh.points.len(),
        session.mesh.triangles.len(),
        session.tet_count(),
        session.scene.tools.len(),
    );
    for note in &session.notes {
        text.push('\n');
        text.push_str(note);
    }
    Ok(text)
}
