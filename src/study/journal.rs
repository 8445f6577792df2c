//! `NAME.partial.jsonl`: the rows of a run under way, so that a second one can go on from there.
//!
//! The first line says what run it is, each other one is a row. A line that was cut off in the
//! middle is not there.

use super::document::Header;
use crate::app::AppError;
use crate::measure::FileError;
use serde::Serialize;
use serde::de::DeserializeOwned;
use std::fs::{File, OpenOptions};
use std::io::Write;
use std::path::{Path, PathBuf};

/// The rows of a run under way, on disk.
#[derive(Debug)]
pub struct Journal {
    path: PathBuf,
    file: File,
}

impl Journal {
    /// Opens the journal of the run `header`, or starts one; gives the rows it holds.
    ///
    /// # Errors
    ///
    /// [`AppError::Usage`] if it is the journal of another run; [`AppError::File`] if it can't be
    /// read, written or understood.
    pub fn open<P, R>(path: &Path, header: &Header<P>) -> Result<(Self, Vec<R>), AppError>
    where
        P: Serialize + DeserializeOwned + PartialEq,
        R: DeserializeOwned,
    {
        let failed = |source| FileError::Write {
            file: path.to_owned(),
            source,
        };
        let text = match std::fs::read_to_string(path) {
            Ok(text) => text,
            Err(error) if error.kind() == std::io::ErrorKind::NotFound => String::new(),
            Err(source) => {
                let file = path.to_owned();
                return Err(FileError::Read { file, source }.into());
            }
        };
        let whole = &text[..text.rfind('\n').map_or(0, |end| end + 1)];
        let mut lines = whole.lines();
        let rows = match lines.next() {
            None => Vec::new(),
            Some(line) => {
                is_of_run(path, line, header)?;
                let row = |(number, line): (usize, &str)| {
                    serde_json::from_str(line).map_err(|error| FileError::Content {
                        file: path.to_owned(),
                        problem: format!(
                            "line {} is no row: {error}; remove the file to start anew",
                            number + 2
                        ),
                    })
                };
                lines.enumerate().map(row).collect::<Result<_, _>>()?
            }
        };
        let options = OpenOptions::new().create(true).append(true).open(path);
        let mut journal = Self {
            path: path.to_owned(),
            file: options.map_err(failed)?,
        };
        journal.file.set_len(whole.len() as u64).map_err(failed)?;
        if whole.is_empty() {
            journal.add(header)?;
        }
        Ok((journal, rows))
    }

    /// Adds a line, in one piece.
    ///
    /// # Errors
    ///
    /// [`AppError::File`] if the system refuses to write it.
    pub fn add(&mut self, line: &impl Serialize) -> Result<(), AppError> {
        let text = serde_json::to_string(line).expect("a row has string keys") + "\n";
        self.file.write_all(text.as_bytes()).map_err(|source| {
            AppError::File(FileError::Write {
                file: self.path.clone(),
                source,
            })
        })
    }

    /// Removes the journal of a run that is done.
    ///
    /// # Errors
    ///
    /// [`AppError::File`] if the system refuses.
    pub fn remove(self) -> Result<(), AppError> {
        drop(self.file);
        std::fs::remove_file(&self.path).map_err(|source| {
            AppError::File(FileError::Write {
                file: self.path,
                source,
            })
        })
    }
}

/// Refuses a journal whose first line is that of another run.
fn is_of_run<P>(path: &Path, line: &str, header: &Header<P>) -> Result<(), AppError>
where
    P: Serialize + DeserializeOwned + PartialEq,
{
    let mut differences = match serde_json::from_str::<Header<P>>(line) {
        Ok(found) => {
            let mut differences = header.differences(&found);
            if found.shard != header.shard {
                differences.push("shard");
            }
            differences
        }
        Err(_) => vec!["format"],
    };
    if differences.is_empty() {
        return Ok(());
    }
    differences.dedup();
    Err(AppError::Usage(format!(
        "{} is of a run with another {}: finish that one as it was started, remove the file to \
         give it up, or give --out another folder",
        path.display(),
        differences.join(" and ")
    )))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::study::Study;

    fn header(plan: u32) -> Header<u32> {
        Header {
            study: Study::Solver,
            version: "1".to_owned(),
            commit: "abc".to_owned(),
            adapter: "none".to_owned(),
            cpu: "a machine".to_owned(),
            threads: 2,
            shard: None,
            plan,
        }
    }

    fn path(name: &str) -> PathBuf {
        let name = format!("palpate-journal-{name}-{}.jsonl", std::process::id());
        let path = std::env::temp_dir().join(name);
        let _ = std::fs::remove_file(&path);
        path
    }

    fn open(path: &Path, plan: u32) -> Result<(Journal, Vec<u32>), AppError> {
        Journal::open(path, &header(plan))
    }

    #[test]
    fn line_cut_off_in_the_middle_is_forgotten_and_the_rest_goes_on() {
        let path = path("cut");
        let (mut journal, rows) = open(&path, 7).unwrap();
        assert!(rows.is_empty());
        journal.add(&11_u32).unwrap();
        journal.add(&12_u32).unwrap();
        let text = std::fs::read_to_string(&path).unwrap();
        std::fs::write(&path, text.strip_suffix("2\n").unwrap()).unwrap();
        let (mut journal, rows) = open(&path, 7).unwrap();
        assert_eq!(rows, [11]);
        journal.add(&13_u32).unwrap();
        let (journal, rows) = open(&path, 7).unwrap();
        assert_eq!(rows, [11, 13]);
        journal.remove().unwrap();
        assert!(!path.exists());
    }

    #[test]
    fn journal_of_other_settings_is_refused_and_left_alone() {
        let path = path("other");
        let (mut journal, _) = open(&path, 7).unwrap();
        journal.add(&11_u32).unwrap();
        let refusal = open(&path, 8).unwrap_err().to_string();
        assert!(
            refusal.contains("settings") && refusal.contains("--out"),
            "{refusal}"
        );
        assert_eq!(open(&path, 7).unwrap().1, [11]);
        std::fs::remove_file(&path).unwrap();
    }

    #[test]
    fn broken_line_in_the_middle_is_refused_by_its_number() {
        let path = path("broken");
        let (mut journal, _) = open(&path, 7).unwrap();
        journal.add(&11_u32).unwrap();
        journal.add(&"no number").unwrap();
        journal.add(&12_u32).unwrap();
        let refusal = open(&path, 7).unwrap_err().to_string();
        assert!(refusal.contains("line 3"), "{refusal}");
        std::fs::remove_file(&path).unwrap();
    }
}
