//! A run against a recorded one: the states and every recorded picture.

use super::files::FileError;
use super::pictures::{PictureTolerance, compare_pictures, read_png};
use super::states::{Nearness, States, compare_states};
use std::path::Path;

/// The outcome of a comparison: a line for each thing compared, failures first.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Verdict {
    /// What differs more than it may.
    pub failures: Vec<String>,
    /// What agrees.
    pub agreements: Vec<String>,
}

impl Verdict {
    /// Whether all that was recorded came out again.
    pub fn agrees(&self) -> bool {
        self.failures.is_empty()
    }

    fn add(&mut self, agrees: bool, line: String) {
        let lines = if agrees {
            &mut self.agreements
        } else {
            &mut self.failures
        };
        lines.push(line);
    }
}

/// Compares the run in the folder `now` with the one in `recorded`: `states.*` and each
/// `frame-*.png` that was recorded.
///
/// # Errors
///
/// [`FileError`] if a file of `recorded` cannot be read. One that is absent from `now` is a
/// failure in the verdict.
pub fn compare_runs(
    recorded: &Path,
    now: &Path,
    nearness: Nearness,
    tolerance: PictureTolerance,
) -> Result<Verdict, FileError> {
    let mut verdict = Verdict::default();
    let before = States::read(recorded)?;
    match States::read(now) {
        Ok(after) => {
            let compared = compare_states(&before, &after, nearness);
            verdict.add(compared.agrees(), compared.to_string());
        }
        Err(error) => verdict.add(false, error.to_string()),
    }
    for name in picture_names(recorded)? {
        let before = read_png(&recorded.join(&name))?;
        match read_png(&now.join(&name)) {
            Ok(after) => {
                let compared = compare_pictures(&before, &after, tolerance);
                verdict.add(compared.agrees(), format!("{name}: {compared}"));
            }
            Err(error) => verdict.add(false, error.to_string()),
        }
    }
    Ok(verdict)
}

/// Names of the pictures of frames in `folder`, sorted.
fn picture_names(folder: &Path) -> Result<Vec<String>, FileError> {
    let failed = |source| FileError::Read {
        file: folder.to_owned(),
        source,
    };
    let mut names = Vec::new();
    for entry in std::fs::read_dir(folder).map_err(failed)? {
        let name = entry.map_err(failed)?.file_name();
        let name = name.to_string_lossy();
        if name.starts_with("frame-") && name.ends_with(".png") {
            names.push(name.into_owned());
        }
    }
    names.sort();
    Ok(names)
}

#[cfg(test)]
mod tests {
    use super::super::files::{tests::Folder, write_png};
    use super::*;
    use image::RgbaImage;

    const TOLERANCE: PictureTolerance = PictureTolerance {
        channel: 2,
        share: 0.0,
    };

    fn run(height: f32, shade: u8) -> Folder {
        let folder = Folder::new();
        let mut states = States::default();
        states.push(0, [[0.0, height, 0.0]]);
        states.write(&folder.0).unwrap();
        let picture = RgbaImage::from_pixel(4, 4, image::Rgba([shade; 4]));
        write_png(&folder.0.join("frame-0000.png"), &picture).unwrap();
        folder
    }

    #[test]
    fn run_agrees_with_itself_and_fails_by_state_picture_or_absence() {
        let recorded = run(1.0, 100);
        let against =
            |now: &Folder| compare_runs(&recorded.0, &now.0, Nearness::Exact, TOLERANCE).unwrap();
        let same = against(&run(1.0, 101));
        assert!(same.agrees() && same.agreements.len() == 2, "{same:?}");
        assert_eq!(against(&run(1.1, 100)).failures.len(), 1);
        assert_eq!(against(&run(1.0, 110)).failures.len(), 1);
        let gone = run(1.0, 100);
        std::fs::remove_file(gone.0.join("frame-0000.png")).unwrap();
        assert!(against(&gone).failures[0].contains("frame-0000.png"));
    }
}
