//! `palpate validate` from outside: reference scenes are rendered, scored and held to their goals, and a folder with a
//! fault is refused by name.

use glam::DVec3;
use palpate::app::{ReferenceScene, read_full_reference};
use palpate::optics::Layer;
use palpate::reference::{Rays, WalkTissue, walked};
use std::path::{Path, PathBuf};
use std::process::{Command, Output};

fn palpate(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_palpate"))
        .args(arguments)
        .output()
        .expect("the program starts")
}

fn folder(name: &str) -> PathBuf {
    let folder = Path::new(env!("CARGO_TARGET_TMPDIR")).join(name);
    let _ = std::fs::remove_dir_all(&folder);
    std::fs::create_dir_all(&folder).expect("a folder can be made");
    folder
}

/// The reference scenes, if they are there.
fn truth() -> Option<PathBuf> {
    let shared = std::env::var("PALPATE_SHARED")
        .unwrap_or_else(|_| format!("{}/../shared", env!("CARGO_MANIFEST_DIR")));
    let truth = Path::new(&shared).join("truth");
    if truth.is_dir() {
        return Some(truth);
    }
    println!("no reference scenes in {}: not run", truth.display());
    None
}

fn validated(truth: &Path, name: &str, sets: &[&str]) -> (Option<i32>, serde_json::Value) {
    let out = folder(name);
    let mut arguments = vec![
        "validate",
        truth.to_str().unwrap(),
        "--out",
        out.to_str().unwrap(),
    ];
    for set in sets {
        arguments.extend(["--set", set]);
    }
    let done = palpate(&arguments);
    let text = std::fs::read_to_string(out.join("validate.json")).unwrap_or_else(|_| {
        panic!("no scores: {}", String::from_utf8_lossy(&done.stderr));
    });
    (done.status.code(), serde_json::from_str(&text).unwrap())
}

fn score(document: &serde_json::Value, scene: &str, key: &str) -> f64 {
    let scenes = document["scenes"].as_array().expect("a list of scenes");
    let found = scenes.iter().find(|row| row["name"] == scene).expect(scene);
    found["scores"][key].as_f64().expect(key)
}

#[test]
fn at_most_ten_light_evaluations_meet_every_goal_by_both_rules() {
    let Some(truth) = truth() else { return };
    for set in [
        &["surface.quadrature=by-layer", "surface.samples=8"],
        &["surface.quadrature=closed-form", "surface.samples=9"],
    ] {
        let (status, document) = validated(&truth, "validate-goals", set);
        assert_eq!(status, Some(0), "{set:?}: {document:#}");
    }
}

/// Our random walks against the reference ball, which another program walked: mean ratio, and the RMS of differences in
/// standard errors of both; with the phase function of the layer turned by `sign`.
fn walks_against(dir: &Path, name: &str, sign: f64) -> (f64, f64) {
    let file = dir.join("scenes").join(format!("{name}.json"));
    let scene = ReferenceScene::read(dir, &file, &[]).expect("a scene");
    let (reference, noise) = read_full_reference(&scene).unwrap().expect("all orders");
    let points: Vec<DVec3> = scene.mesh.points.iter().map(|p| p.as_dvec3()).collect();
    let rays = Rays::new(&points, &scene.mesh.point_triangles());
    let eye = scene.view.eye.as_dvec3();
    let mut lines = Vec::new();
    // Every 11th pixel, off the edge of the ball.
    let pixels = scene.view.behind_pixels(scene.size);
    for (i, far) in pixels.into_iter().enumerate().step_by(11) {
        let along = (far.as_dvec3() - eye).normalize();
        let inner = [i, i + 2, i.saturating_sub(2)]
            .iter()
            .all(|&k| reference.mask[k]);
        if let (true, Some((distance, _))) = (inner, rays.first((eye, along))) {
            lines.push((i, (eye + distance * along, along)));
        }
    }
    let to_light = scene.scene.lights[0].toward.unwrap().as_dvec3().normalize();
    let layer = Layer::from(scene.scene.surface.layers[0]);
    let (mut ours, mut theirs, mut square) = (0.0, 0.0, 0.0);
    for channel in 0..3 {
        let tissue = WalkTissue {
            scattering_per_m: f64::from(layer.scattering_per_m[channel]),
            extinction_per_m: f64::from(layer.extinction_per_m()[channel]),
            asymmetry: sign * f64::from(layer.asymmetry),
        };
        let starts: Vec<_> = lines.iter().map(|(_, line)| *line).collect();
        for ((i, _), found) in lines
            .iter()
            .zip(walked(&rays, &tissue, to_light, &starts, 100, 2))
        {
            let exact = f64::from(reference.rgb[3 * i + channel]);
            let error = found.error.hypot(f64::from(noise[3 * i + channel]));
            ours += found.full;
            theirs += exact;
            square += ((found.full - exact) / error).powi(2);
        }
    }
    (
        ours / theirs - 1.0,
        (square / (3 * lines.len()) as f64).sqrt(),
    )
}

#[test]
fn random_walks_agree_with_the_reference_ball_from_every_side() {
    let Some(truth) = truth() else { return };
    for name in ["b_main_front", "b_main_side", "b_main_back"] {
        let (bias, deviation) = walks_against(&truth, name, 1.0);
        println!(
            "{name}: mean {:+.2} %, {deviation:.2} standard errors",
            100.0 * bias
        );
        // With 200 walks at twice as many places 0.4 % and 1.04 were seen; the mean of these is known to 1 %.
        assert!(bias.abs() < 0.03, "{name}: {bias}");
        assert!(deviation < 1.2, "{name}: {deviation}");
    }
    let (bias, _) = walks_against(&truth, "b_main_front", -1.0);
    assert!(
        bias.abs() > 0.03,
        "a phase function turned round went unnoticed: {bias}"
    );
}

/// Light of all orders: what the medium scatters more often brings every scene nearer to it.
#[test]
fn scattering_of_all_orders_is_nearer_with_the_calibrated_term_in_every_scene() {
    let Some(truth) = truth() else { return };
    let (_, document) = validated(&truth, "validate-full", &[]);
    let rows = document["scenes"].as_array().expect("a list of scenes");
    for row in rows {
        let error = |key: &str| row["full"][key].as_f64().expect(key);
        let (once, calibrated) = (error("relRMSE_once"), error("relRMSE_calibrated"));
        println!("{}: {once:.3}, calibrated {calibrated:.3}", row["name"]);
        // From behind, where light leaks all through the ball, a half remains; elsewhere a fifth was seen.
        let share = if row["name"] == "b_main_back" {
            0.7
        } else {
            0.5
        };
        assert!(
            calibrated < share * once,
            "{}: {calibrated} for {once}",
            row["name"]
        );
    }
    assert!(rows.len() >= 8, "all scenes have a reference of all orders");
}

/// The figures are those of another program that marches as the papers print it, with 100 samples.
#[test]
fn the_published_march_is_as_far_off_as_the_papers_are_and_misses_the_goals() {
    let Some(truth) = truth() else { return };
    let (status, document) = validated(
        &truth,
        "validate-published",
        &[
            "surface.quadrature=published",
            "surface.samples=100",
            "surface.layer_depth_max_m=0.003",
        ],
    );
    assert_eq!(status, Some(1));
    for (scene, printed) in [
        ("a_main_side", 0.121),
        ("b_main_front", 0.111),
        ("b_main_side", 0.687),
        ("b_main_back", 7.47),
        ("c_main_side", 0.131),
        ("c_main_head", 0.133),
        ("e_main_endo", 0.133),
        ("e_main_side", 0.383),
    ] {
        let off = score(&document, scene, "relRMSE");
        // It takes the layers' mean at both ends of the way, and fits in double precision: 0.7 % apart were seen.
        assert!(
            (off / printed - 1.0).abs() < 0.03,
            "{scene}: {off} against {printed}"
        );
    }
}

#[test]
fn a_scene_without_a_key_is_refused_by_the_name_of_the_key() {
    let dir = folder("validate-broken");
    std::fs::create_dir_all(dir.join("scenes")).unwrap();
    std::fs::write(
        dir.join("plane.obj"),
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n",
    )
    .unwrap();
    let scene = |depths: &str, layers: usize| {
        let layer = r#"{"sigma_s":[1,1,1],"sigma_t":[2,2,2],"g_schlick":0.2}"#;
        format!(
            r#"{{"mesh":"plane.obj","camera":{{"eye":[0,-9,6],"target":[0,0,0],"up":[0,0,1],"fovy_deg":35,"width":16,"height":16}},
            "light":{{"type":"directional","to_light":[0,0,1],"E":1.0}},"layers":[{}]{depths}}}"#,
            vec![layer; layers].join(",")
        )
    };
    let told = |text: &str| {
        std::fs::write(dir.join("scenes/x.json"), text).unwrap();
        let out = dir.join("out");
        let done = palpate(&[
            "validate",
            dir.to_str().unwrap(),
            "--out",
            out.to_str().unwrap(),
        ]);
        (
            done.status.code(),
            String::from_utf8_lossy(&done.stderr).into_owned(),
        )
    };
    for (text, expected) in [
        (scene("", 2), "layer_depths"),
        (scene("", 9), "1 to 8"),
        (scene("", 1).replace("\"camera\"", "\"camrea\""), "camera"),
        (scene("", 1).replace("plane.obj", "gone.obj"), "gone.obj"),
        (scene("", 1).replace("directional", "area"), "light"),
        (scene(r#","units":"inch""#, 1), "inch"),
        ("{".to_owned(), "x.json"),
    ] {
        let (status, message) = told(&text);
        assert_eq!(status, Some(2), "{message}");
        assert!(message.contains(expected), "{expected}: {message}");
    }
    let (status, message) = told(&scene("", 1));
    assert_eq!(status, Some(0), "{message}");
    assert!(dir.join("out/x.npy").is_file());
    std::fs::remove_dir_all(dir.join("scenes")).unwrap();
    let done = palpate(&["validate", dir.to_str().unwrap()]);
    assert_eq!(done.status.code(), Some(2));
}
