//! The first product from end to end: what a replay leaves behind is there, agrees with itself and is true.
//!
//! Small pictures and few frames. A missing adapter is a failure: a software one (mesa-vulkan-drivers) will do.

#[path = "support/dump.rs"]
mod dump;
#[path = "support/oracle.rs"]
mod oracle;
#[path = "support/run.rs"]
mod run;

use dump::{Dump, Seen};
use glam::DVec3;
use oracle::{angle_p999, degrees_between, percentile};
use run::{Run, folder, messages, palpate};
use std::collections::BTreeSet;
use std::path::Path;
use std::process::Output;
use std::sync::OnceLock;

/// What is asked of normals and planes against f64, at the 99.9th percentile [degrees].
const DEGREES_MAX: f64 = 0.05;
/// The probe has touched the liver after 30 frames and presses it still deeper.
const PRESSED: u32 = 44;

/// The default scene with planes, pressed by its probe, with a sample of the states in the last frame.
fn pressed_liver() -> &'static Run {
    static RUN: OnceLock<Run> = OnceLock::new();
    RUN.get_or_init(|| {
        Run::new(
            "replay-liver",
            &format!(
                "liver --size 160x120 --frames {PRESSED} --png 20 --dump 0 --dump {PRESSED} \
                 --set light_path.method=incremental"
            ),
        )
    })
}

// What is written.

/// Column names and rows of `frames.csv`.
fn frames(run: &Run) -> (Vec<String>, Vec<Vec<f64>>) {
    let text = run.text("frames.csv");
    let mut reader = csv::Reader::from_reader(text.as_bytes());
    let header = reader.headers().expect("a header").iter();
    let header = header.map(str::to_owned).collect();
    let rows = reader
        .records()
        .map(|row| {
            let row = row.expect("as many cells as columns");
            row.iter()
                .map(|cell| {
                    cell.parse()
                        .unwrap_or_else(|_| panic!("{cell:?} in {row:?}"))
                })
                .collect()
        })
        .collect();
    (header, rows)
}

fn pass_names(summary: &serde_json::Value) -> Vec<String> {
    let passes = summary["passes"].as_array().expect("passes");
    let name = |pass: &serde_json::Value| pass["name"].as_str().expect("a name").to_owned();
    passes.iter().map(name).collect()
}

/// Checks all files of a replay of `count` frames with a picture every `png` frames.
fn check_files(run: &Run, count: u32, png: u32) {
    let summary = run.summary();
    let passes = pass_names(&summary);
    check_log(run, count, &summary, &passes);
    check_trace(run, count, &passes);
    check_states(run, count);

    let expected: BTreeSet<String> = (0..=count)
        .filter(|frame| *frame == count || frame.is_multiple_of(png))
        .map(|frame| format!("frame-{frame:04}.png"))
        .collect();
    assert_eq!(run.pictures(), expected.into_iter().collect::<Vec<_>>());
    for name in run.pictures() {
        let picture = image::open(run.out.join(&name))
            .expect("a sound PNG")
            .to_rgb8();
        assert_eq!(picture.dimensions(), (160, 120), "{name}");
        let colors: BTreeSet<[u8; 3]> = picture.pixels().map(|pixel| pixel.0).collect();
        assert!(colors.len() > 100, "{name} has {} colours", colors.len());
    }
    let report = run.text("report.html");
    assert!(report.contains("data:image/png;base64,") && report.contains("<svg"));
    assert!(
        !report.contains("src=\"http") && !report.contains("href=\"http"),
        "the report needs other files"
    );
    let leftovers = std::fs::read_dir(&run.out)
        .expect("the folder")
        .map(|entry| entry.expect("an entry").file_name())
        .filter(|name| name.to_string_lossy().contains("partial"));
    assert_eq!(leftovers.count(), 0, "half-written files");
}

fn check_log(run: &Run, count: u32, summary: &serde_json::Value, passes: &[String]) {
    let (header, rows) = frames(run);
    let column = |name: &str| {
        let at = header.iter().position(|column| column == name);
        let at = at.unwrap_or_else(|| panic!("no column {name} in {header:?}"));
        rows.iter().map(move |row| row[at])
    };
    assert_eq!(summary["frames"], count);
    assert!(
        column("frame").eq((1..=count).map(f64::from)),
        "a row a frame"
    );
    let timed: Vec<String> = header
        .iter()
        .filter_map(|name| name.strip_suffix("_gpu_ms"))
        .map(str::to_owned)
        .collect();
    assert_eq!(timed, passes, "a column for each pass of the summary");
    let left_out = summary["left_out"].as_array().expect("left_out");
    assert!(!left_out.is_empty());
    for name in left_out {
        let name = name.as_str().expect("a name");
        assert!(
            !timed.iter().any(|pass| pass == name),
            "{name} is left out and timed"
        );
    }
    for pass in summary["passes"].as_array().expect("passes") {
        let name = pass["name"].as_str().expect("a name");
        let times: Vec<f64> = column(&format!("{name}_gpu_ms")).collect();
        assert!(times.iter().all(|&ms| ms > 0.0), "{name}: {times:?} ms");
        let largest = times.iter().copied().fold(0.0, f64::max);
        let max = pass["gpu_ms"]["max"].as_f64().expect("a maximum");
        assert!(
            (max - largest).abs() <= 1e-5 * largest,
            "{name}: {max} ms and {largest} ms"
        );
        assert!(
            pass["dispatches_or_draws"].as_u64().expect("a count") > 0,
            "{name}"
        );
    }
    for (index, row) in rows.iter().enumerate() {
        let sum_of = |ending: &str| -> f64 {
            let cells = header.iter().zip(row);
            cells
                .filter(|(name, _)| name.ends_with(ending))
                .map(|(_, ms)| ms)
                .sum()
        };
        let wall_ms = column("wall_ms").nth(index).expect("a wall time");
        let parts_ms = sum_of("_gpu_ms") + column("sim_ms").nth(index).expect("a time");
        assert!(
            parts_ms <= wall_ms,
            "frame {index}: {parts_ms} of {wall_ms} ms"
        );
    }
    let wall = percentile(column("wall_ms"), 1.0);
    let max = summary["frame_ms"]["max"].as_f64().expect("a maximum");
    assert!((max - wall).abs() <= 1e-5 * wall);
}

fn check_trace(run: &Run, count: u32, passes: &[String]) {
    let trace = run.json("trace.json");
    let events = trace["traceEvents"].as_array().expect("events");
    let spans = |name: &str| -> Vec<(f64, f64)> {
        let named = events
            .iter()
            .filter(|event| event["ph"] == "X" && event["name"] == *name);
        let time = |event: &serde_json::Value, key: &str| event[key].as_f64().expect("a time");
        named
            .map(|event| (time(event, "ts"), time(event, "dur")))
            .collect()
    };
    for name in passes
        .iter()
        .map(String::as_str)
        .chain(["frame", "simulation"])
    {
        let found = spans(name).len();
        assert!(found >= count as usize, "{found} spans of {name}");
        assert!(
            spans(name)
                .iter()
                .all(|&(start, length)| start > 0.0 && length >= 0.0)
        );
    }
    let starts: Vec<f64> = spans("frame").iter().map(|&(start, _)| start).collect();
    assert!(
        starts.is_sorted_by(|a, b| a < b),
        "frames follow one another"
    );
}

/// Sampled frames and the positions [m] of the last of them.
fn states(out: &Path) -> (Vec<u64>, Vec<[f32; 3]>) {
    let text = std::fs::read_to_string(out.join("states.json")).expect("states.json");
    let description: serde_json::Value = serde_json::from_str(&text).expect("sound JSON");
    let points = description["points"].as_u64().expect("points") as usize;
    let frames = description["frames"].as_array().expect("frames").iter();
    let frames: Vec<u64> = frames
        .map(|frame| frame.as_u64().expect("a number"))
        .collect();
    let bytes = std::fs::read(out.join("states.bin")).expect("states.bin");
    assert_eq!(bytes.len(), 12 * points * frames.len());
    let last = bytes[12 * points * (frames.len() - 1)..].chunks_exact(12);
    let number = |b: &[u8]| f32::from_le_bytes(b.try_into().expect("four bytes"));
    let last = last.map(|b| std::array::from_fn(|k| number(&b[4 * k..4 * k + 4])));
    (frames, last.collect())
}

fn check_states(run: &Run, count: u32) {
    let (sampled, last) = states(&run.out);
    assert_eq!(sampled.first(), Some(&0));
    assert_eq!(sampled.last(), Some(&u64::from(count)));
    assert!(sampled.is_sorted_by(|a, b| a < b) && sampled.len() >= 2);
    assert_eq!(last.len() as u64, run.summary()["refit"]["vertices"]);
    assert!(last.as_flattened().iter().all(|x| x.is_finite()));
}

#[test]
fn every_file_of_a_subsurface_replay_is_there_and_true() {
    check_files(pressed_liver(), PRESSED, 20);
    let summary = pressed_liver().summary();
    assert!(summary["tool"]["force_max_n"].as_f64().expect("a force") > 0.01);
    assert!(summary["refit"]["refitted_max"].as_u64().expect("a count") > 0);
}

#[test]
fn every_file_of_a_gooey_replay_is_there_and_true() {
    let run = Run::new(
        "replay-gooey",
        "liver-gooey --size 160x120 --frames 6 --png 4",
    );
    check_files(&run, 6, 4);
}

#[test]
fn every_file_of_a_plain_replay_is_there_and_true() {
    let run = Run::new("replay-slab", "slab --size 160x120 --frames 6 --png 4");
    check_files(&run, 6, 4);
}

#[test]
fn the_last_sampled_state_is_what_was_drawn() {
    let dump = Dump::read(&pressed_liver().out, PRESSED);
    let (_, last) = states(&pressed_liver().out);
    let drawn: Vec<[f32; 3]> = dump
        .now
        .points
        .iter()
        .map(|p| p.as_vec3().to_array())
        .collect();
    assert_eq!(drawn, last);
}

#[test]
fn a_replay_ends_in_the_same_bits_on_one_and_two_threads_drawn_or_not() {
    let hash = |name: &str, more: &str| {
        let run = Run::new(name, &format!("liver --size 80x60 --frames 40 {more}"));
        run.summary()["state_sha256"].clone()
    };
    let drawn = hash("bits-drawn", "--threads 1");
    assert_eq!(drawn, hash("bits-two", "--threads 2 --no-render"));
    assert_eq!(drawn, hash("bits-one", "--threads 1 --no-render"));
}

// What is dumped.

#[test]
fn dumped_normals_are_those_of_the_dumped_positions() {
    for frame in [0, PRESSED] {
        let dump = Dump::read(&pressed_liver().out, frame);
        let exact = dump.now.normals();
        let mut normals = dump.normals();
        let angle = angle_p999(&normals, &exact);
        println!("frame {frame}: normals p99.9 {angle:.2e} degrees");
        assert!(angle <= DEGREES_MAX, "{angle} degrees");
        // The same check with one normal of a hundred a fifth of a degree off.
        for normal in normals.iter_mut().step_by(100) {
            *normal += 0.2_f64.to_radians() * normal.any_orthonormal_vector();
        }
        let angle = angle_p999(&normals, &exact);
        assert!(
            angle > DEGREES_MAX,
            "turned normals went unnoticed: {angle} degrees"
        );
    }
}

#[test]
fn dumped_tangents_are_unit_vectors_across_the_normal_with_a_side() {
    let dump = Dump::read(&pressed_liver().out, PRESSED);
    let normals = dump.normals();
    let axes = dump.now.uv_axes(&dump.now.normals());
    for (vertex, [x, y, z, side]) in dump.columns::<4>("tangents").into_iter().enumerate() {
        let tangent = DVec3::new(x, y, z);
        let normal = normals[dump.now.point_of[vertex] as usize];
        assert!(
            (tangent.length() - 1.0).abs() < 1e-3,
            "{tangent} of vertex {vertex}"
        );
        assert!(
            tangent.dot(normal).abs() < 1e-3,
            "{tangent} of vertex {vertex}"
        );
        assert!(side.abs() == 1.0, "side {side} of vertex {vertex}");
        if let Some([_, pv]) = axes[vertex] {
            let bitangent = side * normal.cross(tangent);
            assert!(
                bitangent.dot(pv) > 0.0,
                "vertex {vertex} is on the wrong side"
            );
        }
    }
}

/// 99.9th percentiles of angle [degrees] and offset, as a share of the radius, against the f64 fit to the patch
/// that `dump.json` describes.
fn primitive_errors(dump: &Dump, primitives: &[(DVec3, f64)]) -> (f64, f64) {
    let patches = oracle::patches(&dump.rest.points, &dump.rest.normals(), dump.radius_m());
    let exact = oracle::planes(&dump.now.points, &dump.now.normals(), &patches);
    let pairs = || primitives.iter().zip(&exact);
    (
        percentile(pairs().map(|(a, b)| degrees_between(a.0, b.0)), 0.999),
        percentile(pairs().map(|(a, b)| (a.1 - b.1).abs()), 0.999) / dump.radius_m(),
    )
}

#[test]
fn dumped_primitives_are_the_planes_of_the_documented_patches() {
    for frame in [0, PRESSED] {
        let dump = Dump::read(&pressed_liver().out, frame);
        let mut primitives = dump.primitives();
        let (angle, offset) = primitive_errors(&dump, &primitives);
        println!("frame {frame}: planes p99.9 {angle:.2e} degrees, {offset:.2e} of the radius");
        assert!(angle <= DEGREES_MAX, "{angle} degrees");
        assert!(offset <= 1e-3, "{offset} of the radius");
        for primitive in primitives.iter_mut().step_by(100) {
            primitive.1 += 2e-3 * dump.radius_m();
        }
        assert!(
            primitive_errors(&dump, &primitives).1 > 1e-3,
            "moved planes went unnoticed"
        );
    }
}

#[test]
fn each_light_path_method_makes_the_planes_that_it_promises() {
    let primitives = |method: &str| {
        let run = Run::new(
            &format!("method-{method}"),
            &format!(
                "liver --size 80x60 --frames {PRESSED} --dump {PRESSED} --set light_path.method={method}"
            ),
        );
        assert_eq!(run.summary()["refit"]["method"], method);
        let dump = Dump::read(&run.out, PRESSED);
        (dump.primitives(), dump)
    };
    let (full, dump) = primitives("full");
    let (stale, _) = primitives("stale");
    let (carried, _) = primitives("carried");
    let (tangent, tangent_dump) = primitives("tangent");
    let incremental = Dump::read(&pressed_liver().out, PRESSED).primitives();

    let moved: Vec<f64> = dump
        .now
        .points
        .iter()
        .zip(&dump.rest.points)
        .map(|(a, b)| a.distance(*b))
        .collect();
    let deepest = moved.iter().copied().fold(0.0, f64::max);
    assert!(deepest > 1e-3, "the probe moved the liver by {deepest} m");
    let pressed: Vec<usize> = (0..moved.len())
        .filter(|&point| moved[point] > 0.5 * deepest)
        .collect();
    let angle = |planes: &[(DVec3, f64)], points: &[usize], share: f64| {
        let angles = points
            .iter()
            .map(|&p| degrees_between(planes[p].0, full[p].0));
        percentile(angles, share)
    };
    let all: Vec<usize> = (0..moved.len()).collect();
    assert!(
        angle(&incremental, &all, 0.999) <= DEGREES_MAX,
        "incremental follows full"
    );
    // Half a degree is ten times what full may be off.
    assert!(
        angle(&stale, &pressed, 0.5) > 0.5,
        "stale planes were left as they were"
    );
    assert!(
        angle(&carried, &pressed, 0.5) > DEGREES_MAX,
        "carried planes keep their bend"
    );
    let of_rest = oracle::patches(&dump.rest.points, &dump.rest.normals(), dump.radius_m());
    let at_rest = oracle::planes(&dump.rest.points, &dump.rest.normals(), &of_rest);
    let stale_normals: Vec<DVec3> = stale.iter().map(|plane| plane.0).collect();
    let rest_normals: Vec<DVec3> = at_rest.iter().map(|plane| plane.0).collect();
    assert!(
        angle_p999(&stale_normals, &rest_normals) <= DEGREES_MAX,
        "stale is of the rest"
    );
    // How far a plane has gone along its normal since rest.
    let gone_m = |planes: &[(DVec3, f64)], point: usize| {
        let (normal, offset_m) = planes[point];
        let way = dump.now.points[point] - dump.rest.points[point];
        (normal.dot(way) + offset_m - at_rest[point].1).abs()
    };
    let stale_m = percentile(all.iter().map(|&p| gone_m(&stale, p)), 0.999);
    assert!(stale_m < 0.01 * deepest, "stale planes went {stale_m} m");
    let carried_m = percentile(pressed.iter().map(|&p| gone_m(&carried, p)), 0.5);
    assert!(
        carried_m > 0.1 * deepest,
        "carried planes stayed where they were"
    );
    assert!(
        tangent.iter().all(|plane| plane.1 == 0.0),
        "the tangent plane lies at its point"
    );
    let tangent_normals: Vec<DVec3> = tangent.iter().map(|plane| plane.0).collect();
    assert!(angle_p999(&tangent_normals, &tangent_dump.now.normals()) <= DEGREES_MAX);
}

#[test]
fn methods_of_sixteen_samples_and_depth_maps_dump_what_they_say() {
    let run = |method: &str| {
        let run = Run::new(
            &format!("method-{method}"),
            &format!(
                "liver --size 80x60 --frames {PRESSED} --dump {PRESSED} --set light_path.method={method}"
            ),
        );
        let names: Vec<String> = run.summary()["passes"]
            .as_array()
            .expect("passes are a list")
            .iter()
            .map(|pass| pass["name"].as_str().expect("has a name").to_owned())
            .collect();
        (Dump::read(&run.out, PRESSED), names)
    };
    let (full, _) = run("full");
    let full = full.primitives();
    let (sampled, names) = run("sampled");
    assert!(names.contains(&"planes-sampled".to_owned()), "{names:?}");
    let sampled = sampled.primitives();
    let apart = sampled
        .iter()
        .zip(&full)
        .map(|(a, b)| degrees_between(a.0, b.0));
    // Sixteen samples of about 200, on a pressed surface: half a degree at most for most.
    assert!(percentile(apart, 0.5) < 0.5);

    let (quadric, names) = run("quadric");
    assert!(names.contains(&"quadrics".to_owned()), "{names:?}");
    let rows = quadric.columns::<8>("primitives");
    let normals = quadric.columns::<3>("normals");
    let mut bent = 0;
    for ([xx, yy, zz, _, xy, xz, yz, _], [x, y, z]) in rows.into_iter().zip(normals) {
        let n = DVec3::new(x, y, z);
        let q = |d: DVec3| {
            DVec3::new(
                xx * d.x + xy * d.y + xz * d.z,
                xy * d.x + yy * d.y + yz * d.z,
                xz * d.x + yz * d.y + zz * d.z,
            )
        };
        let size = q(DVec3::X).length() + q(DVec3::Y).length() + q(DVec3::Z).length();
        assert!(size.is_finite());
        // The normal that was dumped may lie within the tolerance of the one that was fitted with.
        assert!(
            q(n).length() <= 0.01 * size + 1e-3,
            "{} of {size}",
            q(n).length()
        );
        bent += usize::from(size > 1.0);
    }
    assert!(bent > 100, "a liver is bent: {bent} vertices are");

    let (_, names) = run("depth-map");
    assert!(names.contains(&"depth-maps".to_owned()), "{names:?}");
    assert!(
        !names.contains(&"shadow".to_owned()),
        "one map serves both: {names:?}"
    );
}

// What is drawn.

/// A liver that sags under its weight, with no tool before it.
fn sagging(name: &str, scene: &str, more: &str) -> Dump {
    let run = Run::new(
        name,
        &format!(
            "{scene} --size 160x120 --frames 8 --dump 8 --set tool=[] --set body.gravity_m_s2=[0,-9.81,0] {more}"
        ),
    );
    Dump::read(&run.out, 8)
}

/// How many pixels are covered in `depth` and not in `drawn` or the other way, and the 99.9th percentile of the
/// distance between the places that both have, in pixels.
fn cover_errors(dump: &Dump, depth: &[f64], drawn: &[Option<Seen>]) -> (usize, f64) {
    let [width, _] = dump.size;
    let mut uneven = 0;
    let mut distances = Vec::new();
    for (index, (&depth, seen)) in depth.iter().zip(drawn).enumerate() {
        match (depth < 1.0, seen) {
            (true, Some(seen)) => {
                let found = dump.world(index % width, index / width, depth);
                let eye = dump.world(index % width, index / width, 0.0);
                let apart = found - seen.world;
                // Along the ray a slope of 1 moves a place by as much as half a pixel moves it across.
                let pixel = dump.project(
                    seen.world
                        + apart.length() * (found - eye).any_orthonormal_vector().normalize(),
                );
                let here = dump.project(seen.world);
                distances.push((pixel - here).truncate().length());
            }
            (false, None) => {}
            _ => uneven += 1,
        }
    }
    (uneven, percentile(distances, 0.99))
}

#[test]
fn the_picture_covers_where_the_organ_is() {
    let dump = sagging("replay-cover", "liver", "");
    let moved = dump.now.points.iter().zip(&dump.rest.points);
    let moved = percentile(moved.map(|(a, b)| a.distance(*b)), 1.0);
    assert!(moved > 2e-4, "the liver sagged by {moved} m");
    let drawn = dump.drawn();
    let depth = dump.pixels("depth", 1);
    let covered = drawn.iter().flatten().count();
    assert!(
        (2000..17_000).contains(&covered),
        "{covered} of 19200 pixels"
    );
    let (uneven, apart) = cover_errors(&dump, &depth, &drawn);
    println!("{uneven} of {covered} pixels uneven, places p99 {apart:.3} pixels apart");
    // Corners are rounded to 1/256 pixel, so only pixels whose middle an edge all but meets may differ.
    assert!(
        uneven * 500 <= covered,
        "{uneven} pixels are covered by one alone"
    );
    assert!(apart < 1.0, "places are {apart} pixels apart");

    let radiance = dump.pixels("radiance", 3);
    assert!(
        radiance
            .iter()
            .all(|value| value.is_finite() && *value >= 0.0)
    );
    for (pixel, depth) in radiance.chunks_exact(3).zip(&depth) {
        let is_lit = pixel.iter().any(|&value| value > 0.0);
        assert_eq!(
            is_lit,
            *depth < 1.0,
            "radiance where there is tissue and nowhere else"
        );
    }
    // A picture two pixels aside must not pass.
    let mut shifted = depth.clone();
    shifted.rotate_right(2);
    let (uneven, _) = cover_errors(&dump, &shifted, &drawn);
    assert!(uneven * 500 > covered, "a shifted picture went unnoticed");
}

/// Mean brightness of the pixels that `wanted` accepts.
fn mean_brightness(dump: &Dump, drawn: &[Option<Seen>], wanted: impl Fn(&Seen) -> bool) -> f64 {
    let brightness = dump.brightness();
    let lit: Vec<f64> = drawn
        .iter()
        .zip(brightness)
        .filter(|(seen, _)| seen.as_ref().is_some_and(&wanted))
        .map(|(_, brightness)| brightness)
        .collect();
    assert!(lit.len() > 200, "{} pixels to compare", lit.len());
    lit.iter().sum::<f64>() / lit.len() as f64
}

#[test]
fn every_surface_is_bright_where_the_lamp_shines() {
    let lamps = [DVec3::new(-1.0, 0.4, 0.5), DVec3::new(1.0, 0.4, 0.5)];
    for scene in ["liver-gooey", "liver"] {
        for (index, lamp) in lamps.into_iter().enumerate() {
            let [x, y, z] = lamp.to_array();
            let dump = sagging(
                &format!("replay-lamp-{scene}-{index}"),
                scene,
                &format!(
                    "--set light=[{{toward=[{x:.1},{y:.1},{z:.1}],irradiance_w_m2=[3.0,3.0,3.0]}}]"
                ),
            );
            let drawn = dump.drawn();
            let lamp = lamp.normalize();
            let lit = mean_brightness(&dump, &drawn, |seen| seen.normal.dot(lamp) > 0.6);
            let dark = mean_brightness(&dump, &drawn, |seen| seen.normal.dot(lamp) < -0.1);
            println!("{scene}, lamp {index}: lit {lit:.4}, turned away {dark:.4} W/(m2 sr)");
            // The dark side has the light of the room, a tenth of the lamp's, and what scatters round the edge.
            assert!(lit > 2.0 * dark, "{scene}: {lit} lit, {dark} turned away");
        }
    }
}

/// A floor with a wall along one side, as an OBJ file of 10 mm squares.
fn floor_and_wall() -> String {
    let is_solid = |[x, y, z]: [i32; 3]| {
        let is_floor = (0..10).contains(&x) && (0..2).contains(&y);
        let is_wall = (0..3).contains(&x) && (2..8).contains(&y);
        (is_floor || is_wall) && (0..10).contains(&z)
    };
    let mut corners: Vec<[i32; 3]> = Vec::new();
    let mut faces = String::new();
    for cell in 0..1000 {
        let cell = [cell % 10, cell / 10 % 10, cell / 100];
        for (axis, side) in [(0, 0), (0, 1), (1, 0), (1, 1), (2, 0), (2, 1)] {
            let mut beyond = cell;
            beyond[axis] += 2 * side - 1;
            if !is_solid(cell) || is_solid(beyond) {
                continue;
            }
            // Counter-clockwise seen from outside.
            let mut around = [[0, 0], [1, 0], [1, 1], [0, 1]];
            if side == 0 {
                around.reverse();
            }
            faces.push('f');
            for [along, across] in around {
                let mut corner = cell;
                corner[axis] += side;
                corner[(axis + 1) % 3] += along;
                corner[(axis + 2) % 3] += across;
                let known = corners.iter().position(|known| *known == corner);
                let index = known.unwrap_or_else(|| {
                    corners.push(corner);
                    corners.len() - 1
                });
                faces.push_str(&format!(" {}", index + 1));
            }
            faces.push('\n');
        }
    }
    let metres = |corner: &[i32; 3]| corner.map(|steps| 0.01 * f64::from(steps));
    let points = corners.iter().map(metres);
    let lines: Vec<String> = points.map(|[x, y, z]| format!("v {x} {y} {z}\n")).collect();
    lines.concat() + &faces
}

#[test]
fn a_shadow_falls_where_the_way_to_the_lamp_is_blocked() {
    let files = folder("shadow-scene");
    std::fs::write(files.join("wall.obj"), floor_and_wall()).expect("written");
    let scene = files.join("wall.toml");
    let text = "[body]\nfile = \"wall.obj\"\ncell_m = 0.02\n[surface]\nkind = \"plain\"\n";
    std::fs::write(&scene, text).expect("written");
    let lamp = DVec3::new(-0.6, 0.7, 0.1);
    let dump = |shadow: bool| {
        let run = Run::new(
            &format!("replay-shadow-{shadow}"),
            &format!(
                "{} --size 160x120 --frames 1 --dump 1 --set light=[{{toward=[-0.6,0.7,0.1],\
                 irradiance_w_m2=[3.0,3.0,3.0],shadow={shadow}}}]",
                scene.display()
            ),
        );
        Dump::read(&run.out, 1)
    };
    let (with, without) = (dump(true), dump(false));
    let lamp = lamp.normalize();
    let (mut open, mut blocked) = (Vec::new(), Vec::new());
    let pairs = with.brightness().into_iter().zip(without.brightness());
    for (seen, (shadowed, lit)) in with.drawn().iter().zip(pairs) {
        // A square's middle: at its edges the normal that light is taken with is that of no side.
        let Some(seen) =
            seen.filter(|seen| seen.normal.dot(lamp) > 0.3 && is_inside_a_square(seen))
        else {
            continue;
        };
        match first_hit_m(&with, seen.world, lamp) {
            None => open.push(shadowed / lit),
            Some(_) => blocked.push(shadowed / lit),
        }
    }
    let [brightest, darkest] = [
        percentile(blocked.iter().copied(), 0.95),
        percentile(open.iter().copied(), 0.05),
    ];
    println!(
        "{} pixels open, at least {darkest:.3} as bright; {} blocked, at most {brightest:.3}",
        open.len(),
        blocked.len()
    );
    assert!(open.len() > 300 && blocked.len() > 300);
    assert!(darkest > 0.95, "the open side is darkened to {darkest}");
    assert!(brightest < 0.6, "what is blocked is still lit: {brightest}");
}

/// Brightness with the shadow over that without, where the way to the lamp passes a ball of [`BALL_RADIUS_M`] at
/// `ball`, and where it does not.
fn ball_shadow(name: &str, place: DVec3, ball: DVec3) -> [Vec<f64>; 2] {
    let lamp = DVec3::new(-0.3, 0.9, 0.2);
    let files = folder(&format!("{name}-scene"));
    let scene = files.join("ball.toml");
    let [x, y, z] = place.to_array();
    let text = format!(
        "[body]\nshape = \"slab\"\nextent_m = [0.1, 0.03, 0.1]\ncell_m = 0.01\n[surface]\nkind = \"plain\"\n\
         [camera]\ndirection = [0.2, 1.0, 0.7]\n\
         [[tool]]\nradius_m = {BALL_RADIUS_M}\nkeys = [{{ at_s = 0.0, action = \"idle\", at_m = [{x}, {y}, {z}] }}]\n"
    );
    std::fs::write(&scene, text).expect("written");
    let dump = |shadow: bool| {
        let run = Run::new(
            &format!("{name}-{shadow}"),
            &format!(
                "{} --size 160x120 --frames 1 --dump 1 --set light=[{{toward=[-0.3,0.9,0.2],\
                 irradiance_w_m2=[3.0,3.0,3.0],shadow={shadow}}}]",
                scene.display()
            ),
        );
        Dump::read(&run.out, 1)
    };
    let (with, without) = (dump(true), dump(false));
    let lamp = lamp.normalize();
    let [mut blocked, mut open] = [Vec::new(), Vec::new()];
    let depths = with.pixels("depth", 1);
    let pairs = with.brightness().into_iter().zip(without.brightness());
    for ((seen, (shadowed, lit)), depth) in with.drawn().iter().zip(pairs).zip(depths) {
        // The top of the slab, where the ball itself does not hide it.
        let Some(seen) =
            seen.filter(|seen| seen.normal.y > 0.9 && (seen.depth - depth).abs() < 1e-3)
        else {
            continue;
        };
        let to_ball = ball - seen.world;
        let off_m = (to_ball - to_ball.dot(lamp) * lamp).length();
        if off_m < 0.85 * BALL_RADIUS_M {
            blocked.push(shadowed / lit);
        } else if off_m > 1.25 * BALL_RADIUS_M {
            open.push(shadowed / lit);
        }
    }
    [blocked, open]
}

const BALL_RADIUS_M: f64 = 0.012;

#[test]
fn a_tool_shades_what_lies_behind_it() {
    // Above the slab, so far that it stands before the map's front, which is fitted round the body.
    let ball = DVec3::new(0.03, 0.08, 0.055);
    let [blocked, open] = ball_shadow("tool-shadow", ball, ball);
    let brightest = percentile(blocked.iter().copied(), 0.95);
    let darkest = percentile(open.iter().copied(), 0.05);
    let counts = [blocked.len(), open.len()];
    println!("{counts:?} blocked and open, {brightest:.3} at most and {darkest:.3} at least");
    assert!(counts[0] > 100 && counts[1] > 1000, "{counts:?}");
    assert!(brightest < 0.6, "what is blocked is still lit: {brightest}");
    assert!(darkest > 0.95, "the open side is darkened to {darkest}");
}

#[test]
fn the_tool_shadow_check_sees_a_shadow_that_is_not_there() {
    // Sabotage: the ball is not where the check thinks it is.
    let ball = DVec3::new(0.03, 0.08, 0.055);
    let [blocked, _] = ball_shadow("tool-elsewhere", ball + 0.5 * DVec3::X, ball);
    let brightest = percentile(blocked.iter().copied(), 0.95);
    assert!(brightest > 0.95, "{brightest}");
}

/// Whether a place on [`floor_and_wall`] is away from the edges of its square.
fn is_inside_a_square(seen: &Seen) -> bool {
    (0..3).all(|axis| {
        let share = (seen.world[axis] / 0.01).rem_euclid(1.0);
        seen.normal[axis].abs() > 0.9 || (0.2..0.8).contains(&share)
    })
}

/// Distance to the first triangle that a ray from `from` meets [m], by trying them all.
fn first_hit_m(dump: &Dump, from: DVec3, toward: DVec3) -> Option<f64> {
    let surface = &dump.now;
    let hits = surface.triangles.iter().filter_map(|triangle| {
        let [a, b, c] = triangle.map(|v| surface.points[surface.point_of[v as usize] as usize]);
        let (e1, e2) = (b - a, c - a);
        let p = toward.cross(e2);
        let determinant = e1.dot(p);
        let s = (from - a) / determinant;
        let (u, v, t) = (s.dot(p), s.cross(e1).dot(toward), s.cross(e1).dot(e2));
        (u >= 0.0 && v >= 0.0 && u + v <= 1.0 && t > 1e-4).then_some(t)
    });
    hits.min_by(f64::total_cmp)
}

#[test]
fn a_scene_told_to_have_no_lights_keeps_none_whatever_else_is_set() {
    let dump = sagging(
        "replay-dark",
        "liver",
        "--set surface.kind=plain --set light=[] --set surface.roughness=0.4",
    );
    let lights = dump.description["lights"].as_array().expect("lights");
    assert!(lights.is_empty(), "{lights:?}");
}

// What is compared.

/// The recording that others are compared with: eight frames of a slab that is pressed from the start.
const RECORDED: &str = "slab --size 160x120 --frames 8 --png 4 --set tool.0.keys.0.depth_m=0.0 \
                        --set tool.0.keys.1.at_s=0.1";

/// Compares a run with a recording that `alter` has changed.
fn against(name: &str, alter: impl FnOnce(&Path)) -> Output {
    static RECORDING: OnceLock<Run> = OnceLock::new();
    let original = RECORDING.get_or_init(|| Run::new("against-recorded", RECORDED));
    let altered = folder(&format!("against-{name}-recorded"));
    for entry in std::fs::read_dir(&original.out).expect("the recording") {
        let from = entry.expect("an entry").path();
        let to = altered.join(from.file_name().expect("a name"));
        std::fs::copy(&from, to).expect("a copy");
    }
    alter(&altered);
    let out = folder(&format!("against-{name}"));
    let mut command = Run::command(&out, RECORDED);
    command.arg("--against").arg(&altered);
    command.output().expect("it runs")
}

fn assert_differs(output: &Output, words: &[&str]) {
    let text = messages(output);
    assert_eq!(output.status.code(), Some(1), "{text}");
    for word in words {
        assert!(text.contains(word), "no {word:?} in {text}");
    }
}

#[test]
fn a_run_agrees_with_its_own_recording() {
    let output = against("same", |_| {});
    assert_eq!(output.status.code(), Some(0), "{}", messages(&output));
    assert!(!messages(&output).contains("differs"));
}

#[test]
fn one_point_moved_by_ten_times_what_it_may_is_found_and_named() {
    // Positions may differ by 2e-5 m.
    let output = against("moved", |folder| {
        let file = folder.join("states.bin");
        let mut bytes = std::fs::read(&file).expect("states");
        let points = bytes.len() / 12 / states(folder).0.len();
        // y of point 7 in the third sample
        let at = 12 * (2 * points + 7) + 4;
        let y = f32::from_le_bytes(bytes[at..at + 4].try_into().expect("four bytes")) + 2e-4;
        bytes[at..at + 4].copy_from_slice(&y.to_le_bytes());
        std::fs::write(&file, bytes).expect("written");
    });
    assert_differs(&output, &["frame 2", "vertex 7"]);
}

#[test]
fn a_recording_that_is_a_frame_late_is_found() {
    let output = against("late", |folder| {
        let file = folder.join("states.bin");
        let bytes = std::fs::read(&file).expect("states");
        let frame = bytes.len() / states(folder).0.len();
        // Each sample as the one before it.
        let late = [&bytes[..frame], &bytes[..bytes.len() - frame]].concat();
        std::fs::write(&file, late).expect("written");
    });
    assert_differs(&output, &["positions differ"]);
}

#[test]
fn a_recorded_picture_with_gamma_applied_twice_is_found() {
    let output = against("gamma", |folder| {
        let file = folder.join("frame-0008.png");
        let mut picture = image::open(&file).expect("a picture").to_rgb8();
        for value in picture.iter_mut() {
            *value = (255.0 * (f32::from(*value) / 255.0).powf(1.0 / 2.2)).round() as u8;
        }
        picture.save(&file).expect("written");
    });
    assert_differs(&output, &["frame-0008.png", "% of the pixels differ"]);
}

#[test]
fn a_run_is_not_compared_with_itself() {
    let run = Run::new("against-itself", "slab --no-render --frames 2");
    let itself = run.out.display();
    let output = Run::command(
        &run.out,
        &format!("slab --no-render --frames 2 --against {itself}"),
    )
    .output()
    .expect("it runs");
    assert_eq!(output.status.code(), Some(2), "{}", messages(&output));
    assert!(messages(&output).contains("--against"));
}

// What goes wrong.

/// Exit status 2 and one message, with all of `words`, in which nothing panicked.
fn assert_refused(output: &Output, words: &[&str]) {
    let text = messages(output);
    assert_eq!(output.status.code(), Some(2), "{text}");
    let told: Vec<&str> = text
        .lines()
        .filter(|line| line.starts_with("palpate: "))
        .collect();
    let [message] = told[..] else {
        panic!("one message was expected: {text}");
    };
    for word in words {
        assert!(message.contains(word), "no {word:?} in {message}");
    }
    assert!(!text.contains("panicked"), "{text}");
}

#[test]
fn bad_input_ends_with_status_two_and_one_clear_message() {
    let folder = folder("refused");
    let file = folder.join("a-file");
    std::fs::write(&file, "not a picture").expect("written");
    let path = file.display().to_string();
    let out = folder.join("out").display().to_string();
    let map = format!("body.maps.normal='{path}'");
    let start = ["replay", "slab", "--frames", "2", "--size", "80x60"];
    let cases: [(&[&str], &[&str]); 4] = [
        (&["--dump", "3", "--out", &out], &["--dump", "3", "2"]),
        (&["--out", &path], &[&path]),
        (
            &[
                "--set",
                "light.0.irradiance_w_m2=[-1.0,1.0,1.0]",
                "--out",
                &out,
            ],
            &["irradiance_w_m2", "-1", "0"],
        ),
        (
            &["--against", "/nonexistent", "--out", &out],
            &["/nonexistent"],
        ),
    ];
    for (more, words) in cases {
        let output = palpate(&[&start[..], more].concat())
            .output()
            .expect("it runs");
        assert_refused(&output, words);
    }
    let liver = [
        "replay", "liver", "--frames", "2", "--size", "80x60", "--out", &out,
    ];
    let output = palpate(&[&liver[..], &["--set", &map]].concat())
        .output()
        .expect("it runs");
    assert_refused(&output, &["texture", &path]);
}

#[cfg(target_os = "linux")]
#[test]
fn without_an_adapter_a_replay_says_what_to_install() {
    let out = folder("no-adapter");
    let output = Run::command(&out, "slab --frames 2")
        .env("VK_DRIVER_FILES", "/nonexistent")
        .env("VK_ICD_FILENAMES", "/nonexistent")
        .env("WGPU_BACKEND", "vulkan")
        .output()
        .expect("it runs");
    assert_refused(&output, &["mesa-vulkan-drivers", "--no-render"]);
}

#[cfg(target_os = "linux")]
#[test]
fn without_a_display_the_window_says_so_and_replays_into_out() {
    let folder = folder("no-display");
    let output = palpate(&[
        "window",
        "liver",
        "--set",
        "output.frames=3",
        "--set",
        "output.size=[80,60]",
    ])
    .current_dir(&folder)
    .env_remove("DISPLAY")
    .env_remove("WAYLAND_DISPLAY")
    .env_remove("WAYLAND_SOCKET")
    .output()
    .expect("it runs");
    let text = messages(&output);
    assert_eq!(output.status.code(), Some(0), "{text}");
    let told = text.lines().filter(|line| line.contains("no display"));
    assert_eq!(told.count(), 1, "{text}");
    for name in [
        "frames.csv",
        "summary.json",
        "frame-0003.png",
        "report.html",
    ] {
        assert!(folder.join("out").join(name).is_file(), "no {name}");
    }
}
