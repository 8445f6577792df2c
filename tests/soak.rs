//! A window that is used without sense for as long as it is told: `cargo test --test soak -- --ignored --nocapture`,
//! for `PALPATE_SOAK_MINUTES` (10).
//!
//! Random mouse, keys, sizes, scenes and files that can't be read, by a seed that is printed. The window must live, keep
//! its memory, and log nothing but numbers.

#[path = "support/desk.rs"]
mod desk;

use desk::{Desk, spent};
use std::thread::sleep;
use std::time::{Duration, Instant};

/// Keys that do something; those that close the window or fill the folder are left out.
const KEYS: [&str; 22] = [
    "space",
    "n",
    "r",
    "p",
    "c",
    "1",
    "2",
    "3",
    "4",
    "v",
    "t",
    "l",
    "b",
    "x",
    "e",
    "u",
    "h",
    "Tab",
    "o",
    "period",
    "ctrl+plus",
    "ctrl+0",
];
const FILES: [&str; 8] = [
    "liver-gooey",
    "slab",
    "heart",
    "broken.glb",
    "liver",
    "nowhere.toml",
    "cut.toml",
    "flat.obj",
];

/// Numbers that look like chance (xorshift, Marsaglia 2003).
struct Chance(u64);

impl Chance {
    fn below(&mut self, end: u64) -> u64 {
        self.0 ^= self.0 << 13;
        self.0 ^= self.0 >> 7;
        self.0 ^= self.0 << 17;
        self.0 % end
    }

    fn of<'a>(&mut self, from: &[&'a str]) -> &'a str {
        from[self.below(from.len() as u64) as usize]
    }
}

/// Does one senseless thing.
fn act(desk: &Desk, id: &str, chance: &mut Chance) {
    let place = [
        chance.below(1180).to_string(),
        chance.below(720).to_string(),
    ];
    match chance.below(40) {
        0 => desk.open(chance.of(&FILES)),
        1 | 2 => {
            let size = [300 + chance.below(980), 200 + chance.below(600)].map(|px| px.to_string());
            desk.tool(&["windowsize", id, &size[0], &size[1]]);
        }
        3 => {
            desk.tool(&["windowunmap", id]);
            desk.tool(&["windowmap", "--sync", id]);
            desk.tool(&["windowfocus", "--sync", id]);
        }
        4..12 => {
            desk.tool(&["key", chance.of(&KEYS)]);
        }
        12..15 => {
            desk.tool(&["click", chance.of(&["4", "5"])]);
        }
        15..30 => {
            let button = chance.of(&["1", "1", "2", "3"]);
            desk.tool(&["mousemove", &place[0], &place[1], "mousedown", button]);
            for _ in 0..chance.below(6) {
                let to = [
                    chance.below(1180).to_string(),
                    chance.below(720).to_string(),
                ];
                desk.tool(&["mousemove", &to[0], &to[1]]);
                sleep(Duration::from_millis(chance.below(120)));
            }
            desk.tool(&["mouseup", button]);
        }
        _ => {
            desk.tool(&["mousemove", &place[0], &place[1]]);
        }
    }
}

#[test]
#[ignore = "takes ten minutes"]
fn a_window_used_without_sense_lives_and_keeps_its_memory() {
    let minutes = std::env::var("PALPATE_SOAK_MINUTES")
        .ok()
        .and_then(|m| m.parse().ok());
    let minutes: f64 = minutes.unwrap_or(10.0);
    let seed = std::env::var("PALPATE_SOAK_SEED")
        .ok()
        .and_then(|s| s.parse().ok());
    let seed: u64 = seed.unwrap_or(1);
    println!("seed {seed}, {minutes} minutes");
    let Some(desk) = Desk::new("soak", 75) else {
        return;
    };
    for (name, text) in [
        ("broken.glb", "glTF\u{2}\0\0\0"),
        ("cut.toml", "[body]\nshape = \"slab"),
        ("flat.obj", "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"),
    ] {
        std::fs::write(desk.folder.join(name), text).expect("written");
    }
    let log = desk.folder.join("frames.csv");
    let mut window = desk.window("liver", &["--log", &log.display().to_string()]);
    let (process, id) = (window.0.id(), desk.id().expect("the window is there"));
    let mut chance = Chance(0x9e37_79b9_7f4a_7c15 ^ seed);
    let start = Instant::now();
    let mut memory_mib = Vec::new();
    let mut acts = 0_u32;
    while start.elapsed().as_secs_f64() < 60.0 * minutes {
        act(&desk, &id, &mut chance);
        acts += 1;
        if let Some(status) = window.0.try_wait().expect("the window's state") {
            panic!("seed {seed}: after {acts} acts the window ended with {status}");
        }
        if acts.is_multiple_of(20) {
            let mib = spent(process).expect("the process is there").1;
            memory_mib.push(mib);
            println!(
                "{:5.0} s, {acts} acts, {mib:.0} MiB",
                start.elapsed().as_secs_f64()
            );
        }
    }
    // Back to what it began with.
    desk.tool(&["windowsize", &id, "1180", "720"]);
    desk.tool(&["key", "Escape"]);
    sleep(Duration::from_secs(1));
    desk.close(&mut window);
    let text = std::fs::read_to_string(&log).expect("the log is there");
    let mut rows = 0;
    for row in text.lines().skip(1) {
        rows += 1;
        for number in row.split(',').filter(|number| !number.is_empty()) {
            let number: f64 = number.parse().expect("a number");
            assert!(number.is_finite(), "seed {seed}: {row}");
        }
    }
    // Scenes differ in size, so single values do too: the largest of the last third against that of the first two.
    let third = memory_mib.len() / 3;
    let largest = |part: &[f64]| part.iter().copied().fold(0.0, f64::max);
    let (before, after) = memory_mib.split_at(2 * third);
    println!(
        "{acts} acts, {rows} frames; at most {:.0} MiB, then {:.0} MiB",
        largest(before),
        largest(after)
    );
    assert!(rows > 10, "{rows} frames");
    assert!(
        largest(after) < 1.1 * largest(before) + 64.0,
        "memory grows: {memory_mib:?}"
    );
}
