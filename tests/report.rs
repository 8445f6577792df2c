//! Reports as a browser shows them: opened in headless Chromium, photographed, and looked at.
//!
//! Where no Chromium is installed the test says so and passes: a fresh machine need not have one.

#[path = "support/run.rs"]
mod run;

use image::{Rgb, RgbImage};
use run::{Run, folder, messages, palpate};
use std::collections::BTreeSet;
use std::path::Path;
use std::process::{Command, Stdio};

/// Width and height of the photograph [px].
const PHOTO_PX: [u32; 2] = [1000, 2600];

/// The name of a browser that is installed, or a line that says there is none.
fn browser() -> Option<&'static str> {
    let names = ["chromium", "chromium-browser", "google-chrome"];
    let found = names.into_iter().find(|name| {
        let mut version = Command::new(name);
        version
            .arg("--version")
            .stdout(Stdio::null())
            .stderr(Stdio::null());
        version.status().is_ok_and(|status| status.success())
    });
    if found.is_none() {
        println!("no Chromium is installed: reports were not photographed");
    }
    found
}

/// A photograph of the page `file`, and what the browser complained of on its console.
fn photograph(browser: &str, file: &Path) -> (RgbImage, String) {
    let picture = file.with_extension("photo.png");
    let profile = file.with_extension("profile");
    let output = Command::new(browser)
        .args([
            "--headless",
            "--no-sandbox",
            "--disable-gpu",
            "--hide-scrollbars",
        ])
        .args(["--enable-logging=stderr", "--v=0"])
        .arg(format!("--user-data-dir={}", profile.display()))
        .arg(format!("--window-size={},{}", PHOTO_PX[0], PHOTO_PX[1]))
        .arg(format!("--screenshot={}", picture.display()))
        .arg(format!("file://{}", file.display()))
        .output()
        .expect("the browser runs");
    let complaints = String::from_utf8_lossy(&output.stderr)
        .lines()
        .filter(|line| line.contains("CONSOLE") || line.contains("ERR_"))
        .collect::<Vec<_>>()
        .join("\n");
    let photo = image::open(&picture).unwrap_or_else(|e| panic!("no photograph: {e}"));
    (photo.to_rgb8(), complaints)
}

/// Rows of the photograph on which something is drawn, as a share, and its number of colours.
fn drawn(photo: &RgbImage) -> (f64, usize) {
    let paper = *photo.get_pixel(2, photo.height() - 2);
    let is_drawn = |pixel: &Rgb<u8>| (0..3).any(|c| pixel[c].abs_diff(paper[c]) > 40);
    let rows = photo.rows().filter(|row| row.clone().any(is_drawn)).count();
    let colors: BTreeSet<[u8; 3]> = photo.pixels().map(|pixel| pixel.0).collect();
    (rows as f64 / f64::from(photo.height()), colors.len())
}

/// Whether the page looks like a report: filled with text and coloured lines.
fn looks_like_a_report(photo: &RgbImage) -> bool {
    let (share, colors) = drawn(photo);
    // Half of the rows hold something, also between paragraphs; text alone has its shades of grey, some 200.
    share > 0.4 && colors > 300
}

#[test]
fn report_of_a_replay_is_shown_by_a_browser_without_a_complaint() {
    let Some(browser) = browser() else {
        return;
    };
    let run = Run::new("report-photo", "slab --size 160x120 --frames 8 --png 4");
    let page = run.out.join("report.html");
    let (photo, complaints) = photograph(browser, &page);
    assert!(looks_like_a_report(&photo), "{:?}", drawn(&photo));
    assert_eq!(complaints, "");
    // Nothing is fetched: neither from the folder, where it may stand alone, nor from elsewhere.
    let text = run.text("report.html");
    for from in [
        "src=\"http",
        "href=\"http",
        "url(http",
        "<script",
        "src=\"frame",
    ] {
        assert!(!text.contains(from), "{from}");
    }
}

#[test]
fn report_of_a_study_looks_like_one() {
    let Some(browser) = browser() else {
        return;
    };
    let out = folder("report-study");
    let path = out.display().to_string();
    let output = palpate(&[
        "study",
        "solver",
        "--quick",
        "--out",
        &path,
        "--set",
        "body.cells_across=2",
        "--set",
        "solver.substeps=[4, 8]",
    ])
    .output()
    .expect("it runs");
    assert!(output.status.success(), "{}", messages(&output));
    let (photo, complaints) = photograph(browser, &out.join("report.html"));
    assert!(looks_like_a_report(&photo), "{:?}", drawn(&photo));
    assert_eq!(complaints, "");
}

#[test]
fn an_empty_page_and_one_of_text_alone_are_no_reports() {
    let Some(browser) = browser() else {
        return;
    };
    let out = folder("report-none");
    for (name, body) in [("empty", ""), ("text", "<p>Frame times of a run.</p>")] {
        let page = out.join(format!("{name}.html"));
        std::fs::write(&page, format!("<!doctype html><body>{body}</body>")).expect("a page");
        let (photo, _) = photograph(browser, &page);
        assert!(!looks_like_a_report(&photo), "{name}: {:?}", drawn(&photo));
    }
}
