//! Random changes to small files of every kind that a user brings: each input ends in something sound or in a
//! refusal, never in a panic or a hang.
//!
//! The corpus (`tests/fuzz/corpus/`, scenes from `scenes/`) is what inputs are made from, and what fuzzing found
//! is kept there as `find-…`; every ordinary run of the tests reads all of it. The search itself is
//! `PALPATE_FUZZ_S=600 cargo test --test fuzz -- --ignored --nocapture`. An input that ends in a way not seen
//! before, told by its message without the numbers, becomes one to start from.

use cpu_time::ProcessTime;
use palpate::geom::import::{
    ImportOptions, UvState, read_picture, read_picture_bytes, read_surface_bytes, read_tets_bytes,
};
use palpate::geom::lattice::{Lattice, cells_for};
use palpate::geom::tet;
use palpate::geom::unwrap::unwrap;
use palpate::scene::{Scene, SceneSource};
use std::collections::HashSet;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::{Path, PathBuf};
use std::sync::{Arc, Mutex};
use std::time::{Duration, Instant};

/// Larger surfaces are not unwrapped and filled: an input should take milliseconds.
const TRIANGLES_MAX: usize = 300;
/// Inputs do not grow beyond this [bytes].
const BYTES_MAX: usize = 16_384;
/// An input that takes longer on the processor is a find: the corpus takes milliseconds.
const SLOW: Duration = Duration::from_secs(5);
/// And one that takes this long hangs; the search gives up and says which.
const HANG: Duration = Duration::from_secs(120);

#[derive(Clone, Copy, Debug, PartialEq)]
enum Kind {
    Glb,
    Obj,
    Msh,
    Png,
    Scene,
}

impl Kind {
    const ALL: [Self; 5] = [Self::Glb, Self::Obj, Self::Msh, Self::Png, Self::Scene];

    fn name(self) -> &'static str {
        match self {
            Self::Glb => "glb",
            Self::Obj => "obj",
            Self::Msh => "msh",
            Self::Png => "png",
            Self::Scene => "scene",
        }
    }

    /// Reads an input as the program would; how it ended, in words.
    fn read(self, bytes: &[u8]) -> String {
        match self {
            Self::Glb => surface("fuzz.gltf", bytes),
            Self::Obj => surface("fuzz.obj", bytes),
            Self::Msh => tetrahedra(bytes),
            Self::Png => match read_picture_bytes(Path::new("fuzz.png"), bytes) {
                Ok(picture) => format!("{:?}", picture.color()),
                Err(error) => error.to_string(),
            },
            Self::Scene => scene(bytes),
        }
    }

    /// The files that inputs are made from, by name.
    fn corpus(self) -> Vec<(PathBuf, Vec<u8>)> {
        let root = Path::new(env!("CARGO_MANIFEST_DIR"));
        let own = root.join("tests/fuzz/corpus").join(self.name());
        let mut folders = vec![own];
        if self == Self::Scene {
            folders.push(root.join("scenes"));
        }
        let mut files: Vec<PathBuf> = (folders.iter())
            .filter_map(|folder| std::fs::read_dir(folder).ok())
            .flatten()
            .map(|entry| entry.expect("an entry").path())
            .filter(|path| path.is_file())
            .collect();
        files.sort();
        let read = |path: PathBuf| {
            let bytes = std::fs::read(&path).expect("a file of the corpus");
            (path, bytes)
        };
        files.into_iter().map(read).collect()
    }
}

/// A surface that is taken is closed, has texture coordinates and a lattice of finite numbers.
fn surface(name: &str, bytes: &[u8]) -> String {
    // Other files that it names are looked for where there are none.
    let path = Path::new("/nowhere").join(name);
    let surface = match read_surface_bytes(&path, bytes, &ImportOptions::default()) {
        Ok(surface) => surface,
        Err(error) => return error.to_string(),
    };
    let mut mesh = surface.mesh;
    assert!(mesh.volume_m3() > 0.0, "a closed surface faces outwards");
    for source in [surface.base_color, surface.normal].into_iter().flatten() {
        let _ = read_picture(&source);
    }
    let told = format!("{:?} {:?}", surface.uv, surface.notes);
    if mesh.triangles.len() > TRIANGLES_MAX {
        return told;
    }
    if surface.uv != UvState::Usable {
        mesh = unwrap(&mesh.points, &mesh.point_triangles());
    }
    assert!(mesh.uvs.iter().all(|uv| uv.is_finite()));
    match Lattice::around(&mesh, cells_for(&mesh).cell_m, 1000.0) {
        Ok(lattice) => {
            let weights = lattice.embedding.weights.iter().flatten();
            assert!(weights.chain(&lattice.masses_kg).all(|w| w.is_finite()));
            told
        }
        Err(error) => format!("{told} {error}"),
    }
}

/// Tetrahedra that are taken are positive.
fn tetrahedra(bytes: &[u8]) -> String {
    match read_tets_bytes(Path::new("fuzz.msh"), bytes) {
        Ok(imported) => {
            let mesh = &imported.mesh;
            assert!(mesh.particles.iter().all(|x| x.is_finite()));
            let volume = |tet| tet::volume_m3(tet::corners(mesh, tet));
            assert!((0..mesh.tets.len()).all(|tet| volume(tet) > 0.0));
            format!("{} {:?}", imported.format, imported.notes)
        }
        Err(error) => error.to_string(),
    }
}

/// A scene that is taken is written and read back as the same. Lines that begin with `#set ` are overrides.
fn scene(bytes: &[u8]) -> String {
    let Ok(text) = std::str::from_utf8(bytes) else {
        return "not UTF-8".to_owned();
    };
    let source = |text| SceneSource {
        name: "fuzz.toml",
        text,
        folder: None,
    };
    let sets: Vec<String> = (text.lines())
        .filter_map(|line| line.strip_prefix("#set "))
        .map(str::to_owned)
        .collect();
    match Scene::read(&source(text), &sets) {
        Ok(scene) => {
            let saved = scene.to_toml().expect("a sound scene has a TOML form");
            let again = Scene::read(&source(&saved), &[]).expect("a saved scene is sound");
            assert_eq!(again, scene, "a saved scene is the same scene");
            format!("{:?} {:?}", scene.surface.kind, scene.solver.method)
        }
        // The first line of a TOML error says where, the last one what.
        Err(error) => error
            .to_string()
            .lines()
            .last()
            .unwrap_or_default()
            .to_owned(),
    }
}

#[test]
fn every_file_of_the_corpus_ends_in_something_sound_or_a_refusal() {
    for kind in Kind::ALL {
        let corpus = kind.corpus();
        assert!(corpus.len() >= 3, "{kind:?} has a corpus");
        for (file, bytes) in corpus {
            let start = ProcessTime::now();
            let told = kind.read(&bytes);
            assert!(start.elapsed() < SLOW, "{}: {told}", file.display());
        }
    }
}

/// Random numbers, the same for the same seed (xorshift64*, Vigna 2014).
struct Random(u64);

impl Random {
    fn next(&mut self) -> u64 {
        self.0 ^= self.0 >> 12;
        self.0 ^= self.0 << 25;
        self.0 ^= self.0 >> 27;
        self.0.wrapping_mul(0x2545_f491_4f6c_dd1d)
    }

    fn below(&mut self, count: usize) -> usize {
        (self.next() >> 16) as usize % count.max(1)
    }
}

/// Words that parsers stumble over.
const WORDS: [&str; 24] = [
    "0",
    "-1",
    "1",
    "2",
    "3",
    "4294967295",
    "4294967296",
    "18446744073709551615",
    "1e39",
    "-1e308",
    "nan",
    "inf",
    "1e-45",
    "0.5",
    "{}",
    "[]",
    "null",
    "\"\"",
    "\n",
    " ",
    "/",
    "\\",
    "\u{feff}",
    "\u{0}",
];

/// One change to `input`: a bit, a byte, a number, a word, a stretch left out, doubled or taken from `other`.
fn change(input: &mut Vec<u8>, other: &[u8], random: &mut Random) {
    let at = random.below(input.len() + 1);
    let end = (at + 1 + random.below(32)).min(input.len());
    match random.below(9) {
        0 if at < input.len() => input[at] ^= 1 << random.below(8),
        1 if at < input.len() => input[at] = random.next() as u8,
        2 if at + 4 <= input.len() => {
            let numbers = [
                0_u32,
                1,
                0x7fff_ffff,
                0x8000_0000,
                u32::MAX,
                0x7f80_0000,
                0x7fc0_0000,
            ];
            let number = numbers[random.below(numbers.len())];
            input[at..at + 4].copy_from_slice(&number.to_le_bytes());
        }
        3 => drop(input.drain(at..end)),
        4 => {
            let stretch = input[at..end].to_vec();
            input.splice(at..at, stretch);
        }
        5 => {
            let from = random.below(other.len() + 1);
            let to = (from + 1 + random.below(64)).min(other.len());
            input.splice(at..at, other[from..to].iter().copied());
        }
        6 => {
            // A number in a text, as a whole.
            let is_number = |b: &u8| b.is_ascii_digit() || b"+-.eE".contains(b);
            let first = (at..input.len())
                .find(|&k| input[k].is_ascii_digit())
                .unwrap_or(at);
            let last = (first..input.len())
                .find(|&k| !is_number(&input[k]))
                .unwrap_or(input.len());
            let word = WORDS[random.below(14)].bytes();
            input.splice(first..last, word);
        }
        7 => {
            let word = WORDS[random.below(WORDS.len())].bytes();
            input.splice(at..at, word);
        }
        _ => input.truncate(at),
    }
}

/// Makes the lengths in a GLB true again, so that changes reach what is inside.
fn mend_lengths(glb: &mut Vec<u8>) {
    let Some(mut json_end) = glb.windows(4).position(|word| word == b"BIN\0") else {
        return;
    };
    if json_end < 24 {
        return;
    }
    while !json_end.is_multiple_of(4) {
        glb.insert(json_end - 4, b' ');
        json_end += 1;
    }
    glb.resize(glb.len().next_multiple_of(4), 0);
    let (total, json) = (glb.len() as u32, (json_end - 24) as u32);
    let binary = total - json_end as u32 - 4;
    glb[8..12].copy_from_slice(&total.to_le_bytes());
    glb[12..16].copy_from_slice(&json.to_le_bytes());
    glb[json_end - 4..json_end].copy_from_slice(&binary.to_le_bytes());
}

/// A message without its digits and names: how an input ended.
fn skeleton(told: &str) -> String {
    let words = told
        .chars()
        .filter(|c| !c.is_ascii_digit() && *c != '-' && *c != '.');
    words.take(160).collect()
}

/// The input that is being read, since when, and whose it is.
type Current = Arc<Mutex<Option<(Kind, Vec<u8>, Instant)>>>;

/// Keeps an input that something was found with.
fn keep(kind: Kind, bytes: &[u8], number: usize) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR"));
    let file = folder.join(format!("find-{}-{number}", kind.name()));
    std::fs::write(&file, bytes).expect("a find can be kept");
    file
}

/// Ends the process, with the input kept, if one hangs.
fn watch(current: &Current) {
    let current = current.clone();
    std::thread::spawn(move || {
        loop {
            std::thread::sleep(Duration::from_secs(5));
            let current = current.lock().expect("the search does not panic with it");
            if let Some((kind, bytes, since)) = &*current
                && since.elapsed() > HANG
            {
                println!("hangs: {}", keep(*kind, bytes, 0).display());
                std::process::exit(1);
            }
        }
    });
}

#[test]
#[ignore = "a search for as long as PALPATE_FUZZ_S says; see the head of this file"]
fn random_changes_find_nothing() {
    let number = |name: &str, default: u64| {
        let told = std::env::var(name).ok();
        told.map_or(default, |text| text.parse().expect("a whole number"))
    };
    let seconds = number("PALPATE_FUZZ_S", 60);
    let seed = number("PALPATE_FUZZ_SEED", 1);
    let mut random = Random(seed.max(1));
    let current = Current::default();
    watch(&current);
    let mut found = 0;
    for kind in Kind::ALL {
        let mut pool: Vec<Vec<u8>> = kind.corpus().into_iter().map(|(_, bytes)| bytes).collect();
        let mut seen: HashSet<String> = pool.iter().map(|b| skeleton(&kind.read(b))).collect();
        let (start, mut tried, mut slowest) = (Instant::now(), 0_u64, Duration::ZERO);
        while start.elapsed() < Duration::from_secs(seconds) / Kind::ALL.len() as u32 {
            let other = pool[random.below(pool.len())].clone();
            let mut input = pool[random.below(pool.len())].clone();
            for _ in 0..1 + random.below(6) {
                change(&mut input, &other, &mut random);
            }
            input.truncate(BYTES_MAX);
            if kind == Kind::Glb && random.below(4) > 0 {
                mend_lengths(&mut input);
            }
            let since = ProcessTime::now();
            *current.lock().expect("nothing panics with it") =
                Some((kind, input.clone(), Instant::now()));
            let ended = catch_unwind(AssertUnwindSafe(|| kind.read(&input)));
            *current.lock().expect("nothing panics with it") = None;
            let took = since.elapsed();
            slowest = slowest.max(took);
            tried += 1;
            match ended {
                Ok(told) if took < SLOW => {
                    if seen.insert(skeleton(&told)) {
                        pool.push(input);
                    }
                }
                _ => {
                    found += 1;
                    let file = keep(kind, &input, found);
                    println!("found, after {took:?}: {}", file.display());
                }
            }
        }
        println!(
            "{}: {tried} inputs in {:.0} s from seed {seed}, {} ways to end, the slowest {:.0} ms",
            kind.name(),
            start.elapsed().as_secs_f64(),
            seen.len(),
            1e3 * slowest.as_secs_f64()
        );
    }
    assert_eq!(found, 0, "inputs that panic or take too long");
}
