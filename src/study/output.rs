//! The files of a study, and what it prints.

use super::Study;
use super::document::Document;
use super::run::DocumentOf;
use super::sweep::Sweep;
use crate::app::{AppError, say::say};
use crate::measure::files;
use crate::measure::page::{Page, Section};
use std::path::{Path, PathBuf};

/// Where a study's rows are.
pub fn json_file(out: &Path, study: Study) -> PathBuf {
    out.join(format!("{}.json", study.name()))
}

/// Writes `NAME.csv`, `NAME.json`, `NAME.svg` and the report, and prints the tables.
///
/// # Errors
///
/// [`AppError::File`] if a file can't be written.
pub fn write<S: Sweep>(out: &Path, document: &DocumentOf<S>) -> Result<(), AppError> {
    let name = S::STUDY.name();
    let findings = S::findings(&document.rows);
    files::write(&out.join(format!("{name}.csv")), document.csv().as_bytes())?;
    files::write(&out.join(format!("{name}.svg")), findings.svg.as_bytes())?;
    files::write(&json_file(out, S::STUDY), document.json().as_bytes())?;
    report(out)?;
    say(&findings.text());
    eprintln!("{}", out.join("report.html").display());
    Ok(())
}

/// Writes `report.html`, a section for each study whose rows are in the folder.
fn report(out: &Path) -> Result<(), AppError> {
    let sections: Vec<Section> = Study::ALL
        .into_iter()
        .filter(|&study| json_file(out, study).exists())
        .filter_map(|study| match study.section(out) {
            Ok(section) => Some(section),
            Err(error) => {
                eprintln!("left out of the report: {error}");
                None
            }
        })
        .collect();
    let page = Page {
        title: "Speed against accuracy".to_owned(),
        subtitle: "Studies of palpate: what each setting costs and how far off it is".to_owned(),
        sections,
        ..Page::default()
    };
    Ok(page.write(&out.join("report.html"))?)
}

/// The section of a study whose rows are in `out`.
///
/// # Errors
///
/// [`AppError::File`] if they can't be read.
pub fn section<S: Sweep>(out: &Path) -> Result<Section, AppError> {
    let document: DocumentOf<S> = Document::read(&json_file(out, S::STUDY))?;
    let header = &document.header;
    let part = match header.shard {
        None => String::new(),
        Some(shard) => format!(", part {shard}"),
    };
    let title = format!("{}{part}", S::STUDY.title());
    let mut section = S::findings(&document.rows).section(title);
    let adapter = match header.adapter.as_str() {
        "none" => String::new(),
        adapter => format!(" Adapter: {adapter}."),
    };
    section
        .blocks
        .push(crate::measure::page::Block::Paragraph(format!(
            "palpate study {}: {} rows, palpate {} ({}), {}.{adapter}",
            S::STUDY.name(),
            document.rows.len(),
            header.version,
            header.commit,
            header.cpu
        )));
    Ok(section)
}
