//! The gallery: every technique of the sources, off and on, on a prodded organ, drawn by the passes that users see.
//!
//! `tests/gallery/list.toml` says what is shown. The test draws each technique small and holds what it changes to
//! `tests/gallery/changes.tsv`, so that the loss of one is noticed. `make gallery` draws it large, with captions, and
//! writes `docs/pictures/gallery/`, `docs/GALLERY.md` and the recorded changes.
//!
//! A missing adapter is a failure, not a skip: a software one (mesa-vulkan-drivers) will do.

#[path = "gallery/list.rs"]
mod list;
#[path = "gallery/shots.rs"]
mod shots;

use image::{Rgba, RgbaImage, imageops};
use list::{List, Row, Sheet, Then, Variant};
use palpate::measure::caption;
use palpate::measure::files::{create_folder, write, write_png};
use shots::{Shot, Studio};
use std::fmt::Write;
use std::path::{Path, PathBuf};

/// Pictures of the test [px].
const SMALL: [u32; 2] = [120, 90];
/// Pictures of the sheets [px], drawn twice as large: the outlines are smoother then.
const LARGE: [u32; 2] = [188, 141];

/// A change below this share of the light is no technique: pictures that are drawn again have the same bits, and what
/// acts round the probe alone changes 0.08 %.
const CHANGE_MIN: f64 = 0.0005;
/// Other adapters round otherwise, and fits and noise then differ in some pixels; what is lost changes by all of it.
const CHANGE_TOLERANCE: f64 = 0.25;

fn here(path: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join(path)
}

/// What turning a technique on changes.
#[derive(Clone, Copy, Debug)]
struct Change {
    /// Mean size of the difference, over the mean light.
    size: f64,
    /// Mean light after over before.
    brightness: f64,
    /// Mean step between neighbouring pixels, over the mean light, after over before.
    contrast: f64,
    /// Share of red in the light after over before.
    redness: f64,
}

impl Change {
    fn between(off: &Shot, on: &Shot) -> Self {
        let (mut size, mut before, mut after) = (0.0, [0.0; 3], [0.0; 3]);
        for (i, _) in off.covered.iter().enumerate().filter(|(_, lies)| **lies) {
            for channel in 0..3 {
                let [a, b] = [off, on].map(|shot| f64::from(shot.radiance[3 * i + channel]));
                size += (a - b).abs();
                before[channel] += a;
                after[channel] += b;
            }
        }
        let sum = |light: [f64; 3]| light.iter().sum::<f64>();
        let red = |light: [f64; 3]| light[0] / sum(light);
        Self {
            size: size / sum(before),
            brightness: sum(after) / sum(before),
            contrast: on.contrast() / off.contrast(),
            redness: red(after) / red(before),
        }
    }

    /// Whether it is one that was asked for.
    fn is(&self, then: Then) -> bool {
        self.size > CHANGE_MIN
            && match then {
                Then::Differs => true,
                Then::Brighter => self.brightness > 1.01,
                Then::Darker => self.brightness < 0.99,
                Then::Softer => self.contrast < 0.99,
                Then::Sharper => self.contrast > 1.01,
                Then::Redder => self.redness > 1.005,
            }
    }
}

/// The recorded size of each change, by sheet and technique; nothing before the first `make gallery`.
fn recorded() -> Vec<(String, f64)> {
    let text = std::fs::read_to_string(here("tests/gallery/changes.tsv")).unwrap_or_default();
    let lines = text.lines().filter(|line| !line.starts_with('#'));
    lines
        .map(|line| {
            let (key, size) = line.rsplit_once('\t').expect("a key and a number");
            (key.to_owned(), size.parse().expect("a number"))
        })
        .collect()
}

fn key(sheet: &Sheet, row: &Row) -> String {
    format!("{}\t{}", sheet.name, row.what)
}

/// What is wrong with a change, in words; nothing if it is as it was asked for, and as it was recorded if it was.
fn fault(change: &Change, then: Then, recorded: Option<f64>) -> Option<String> {
    if !change.is(then) {
        return Some(format!("it should be {then:?}, and is {change:?}"));
    }
    let before = recorded.filter(|before| (change.size / before - 1.0).abs() > CHANGE_TOLERANCE)?;
    let size = change.size;
    Some(format!(
        "it changes {size:.4} of the light, not {before:.4}"
    ))
}

/// All changes on prodded bodies, with what is asked of them.
fn changes(list: &List) -> Vec<(String, Change, Then)> {
    let mut studio = Studio::new(SMALL);
    let mut found = Vec::new();
    for sheet in &list.sheet {
        for row in &sheet.row {
            let [off, on] = [&row.off, &row.on].map(|variant| studio.shot(row, variant, 1, false));
            found.push((key(sheet, row), Change::between(&off, &on), row.then));
        }
    }
    found
}

/// Words on a sheet.
fn label(sheet: &mut RgbaImage, at: (u32, u32), scale: u32, text: &str, color: [u8; 3]) {
    let [r, g, b] = color;
    caption::write(sheet, at, scale, text, Rgba([r, g, b, 255]));
}

/// Four pictures a row: off and on at rest, off and on prodded.
fn contact_sheet(studio: &mut Studio, sheet: &Sheet) -> RgbaImage {
    let [width, height] = LARGE;
    let (gap, head) = (4, 24);
    let row_height = height + head + gap;
    let size = (
        4 * (width + gap) + gap,
        sheet.row.len() as u32 * row_height + gap,
    );
    let mut picture = RgbaImage::from_pixel(size.0, size.1, Rgba([18, 22, 24, 255]));
    for (index, row) in sheet.row.iter().enumerate() {
        let top = gap + index as u32 * row_height;
        label(&mut picture, (gap, top), 2, &row.what, [235, 235, 225]);
        for column in 0..4 {
            let variant = if column % 2 == 0 { &row.off } else { &row.on };
            let left = gap + column * (width + gap);
            let shot = studio.shot(row, variant, column as usize / 2, true);
            let small =
                imageops::resize(&shot.picture, width, height, imageops::FilterType::Triangle);
            imageops::replace(&mut picture, &small, left.into(), (top + head).into());
            let when = if column < 2 { "rest" } else { "prodded" };
            label(
                &mut picture,
                (left, top + 15),
                1,
                &format!("{} - {when}", variant.name),
                [150, 165, 165],
            );
        }
    }
    // Five bits a channel: the file is a third of the size, and at this size nobody sees it.
    for pixel in picture.pixels_mut() {
        for channel in &mut pixel.0[..3] {
            *channel = (*channel & 0xf8) | (*channel >> 5);
        }
    }
    picture
}

/// The page that shows the sheets.
fn page(list: &List) -> String {
    let mut text = list.about.trim_end().to_owned() + "\n";
    let sets = |variant: &Variant| match variant.set.len() {
        0 => "as the scene has it".to_owned(),
        _ => list::told(&variant.set),
    };
    for sheet in &list.sheet {
        write!(
            text,
            "\n## {}: {}\n\n![{}](pictures/gallery/{}.png)\n\n| technique | scene, and what both have | off | on |\n\
             | --- | --- | --- | --- |\n",
            sheet.source, sheet.title, sheet.title, sheet.name,
        )
        .expect("a string takes all");
        for row in &sheet.row {
            let both = match row.both.len() {
                0 => String::new(),
                _ => format!(", {}", list::told(&row.both)),
            };
            writeln!(
                text,
                "| {} | `{}`{both} | {}: {} | {}: {} |",
                row.what,
                row.scene,
                row.off.name,
                sets(&row.off),
                row.on.name,
                sets(&row.on),
            )
            .expect("a string takes all");
        }
    }
    text
}

/// Draws the sheets, and records what changes.
fn accept(list: &List) {
    let folder = here("docs/pictures/gallery");
    create_folder(&folder).expect("a folder");
    let mut studio = Studio::new(LARGE.map(|side| 2 * side));
    for sheet in &list.sheet {
        let picture = contact_sheet(&mut studio, sheet);
        let file = folder.join(format!("{}.png", sheet.name));
        write_png(&file, &picture).expect("written");
    }
    let mut lines = "# sheet, technique, mean change of light over mean light\n".to_owned();
    for (key, change, then) in changes(list) {
        println!("{key}: {then:?} {change:?}");
        writeln!(lines, "{key}\t{:.5}", change.size).expect("a string takes all");
    }
    write(&here("tests/gallery/changes.tsv"), lines.as_bytes()).expect("written");
    write(&here("docs/GALLERY.md"), page(list).as_bytes()).expect("written");
}

#[test]
fn every_technique_changes_the_picture_as_it_was_recorded() {
    let list = List::read();
    if std::env::var_os("PALPATE_ACCEPT").is_some() {
        accept(&list);
        return;
    }
    let recorded = recorded();
    let faults: Vec<String> = changes(&list)
        .iter()
        .filter_map(|(key, change, then)| {
            let before = recorded.iter().find(|(known, _)| known == key);
            let fault = fault(change, *then, before.map(|(_, size)| *size));
            fault.map(|fault| format!("{}: {fault}", key.replace('\t', ": ")))
        })
        .collect();
    assert!(
        faults.is_empty(),
        "{}\nif this is meant: make gallery",
        faults.join("\n")
    );
}

#[test]
fn a_technique_that_is_lost_or_turned_round_is_noticed() {
    let list = List::read();
    let sheet = list.sheet.iter().find(|sheet| sheet.name == "beyond");
    let rows = &sheet.expect("a sheet").row;
    let row = rows.iter().find(|row| row.then == Then::Brighter);
    let row = row.expect("one that brightens");
    let mut studio = Studio::new(SMALL);
    let [off, on] = [&row.off, &row.on].map(|variant| studio.shot(row, variant, 0, false));
    let there = Change::between(&off, &on);
    let size = Some(there.size);
    assert_eq!(fault(&there, row.then, size), None);
    let lost = Change::between(&off, &off);
    assert!(fault(&lost, row.then, size).is_some());
    assert!(fault(&lost, Then::Differs, size).is_some());
    let round = Change::between(&on, &off);
    assert!(fault(&round, row.then, size).is_some());
    let other = Change {
        size: 1.3 * there.size,
        ..there
    };
    assert!(fault(&other, row.then, size).is_some());
    assert_eq!(fault(&there, row.then, None), None);
    assert!(fault(&lost, row.then, None).is_some());
}

#[test]
fn the_page_is_that_of_the_list_and_its_pictures_are_small() {
    if std::env::var_os("PALPATE_ACCEPT").is_some() {
        return;
    }
    let list = List::read();
    let written = std::fs::read_to_string(here("docs/GALLERY.md")).expect("docs/GALLERY.md");
    assert_eq!(written, page(&list), "the list has changed: make gallery");
    let bytes: u64 = (list.sheet.iter())
        .map(|sheet| {
            let file = here(&format!("docs/pictures/gallery/{}.png", sheet.name));
            std::fs::metadata(file).expect("a sheet").len()
        })
        .sum();
    assert!(bytes < 3_000_000, "{bytes} bytes");
}
