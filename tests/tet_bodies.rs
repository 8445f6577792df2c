//! Bodies of tetrahedra from files, as a scene makes them, and the bundled scenes that use them.

#[path = "support/tets.rs"]
mod tets;

use glam::Vec3;
use palpate::app::Session;
use palpate::geom::import::read_tets;
use palpate::geom::tet::lumped_masses_kg;
use palpate::geom::{Embedding, TetMesh, export, lattice};
use palpate::scene::{Scene, SceneSource};
use palpate::sim::{BodySetup, Method, Simulation, SolverParams};
use std::path::{Path, PathBuf};
use tets::cube;

/// A folder of its own for each test, gone when the test ends well.
struct Folder(PathBuf);

impl Folder {
    fn new(name: &str) -> Self {
        let name = format!("palpate-tets-{name}-{}", std::process::id());
        let folder = std::env::temp_dir().join(name);
        std::fs::create_dir_all(&folder).expect("the temporary folder can be written");
        Self(folder)
    }

    /// A `--set` that names a new file of this content.
    fn set_file(&self, name: &str, content: impl AsRef<[u8]>) -> String {
        let path = self.0.join(name);
        std::fs::write(&path, content).expect("the temporary folder can be written");
        format!("body.file=\"{}\"", path.display())
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

const BEAM: &str = include_str!("../scenes/beam.toml");
const ORGAN: &str = include_str!("../scenes/organ-tets.toml");
const BAR: &str = include_str!("../scenes/hanging-bar.toml");
const HERTZ: &str = include_str!("../scenes/hertz.toml");
const SLAB: &str = include_str!("../scenes/slab.toml");

fn session(text: &str, sets: &[&str]) -> Result<Session, String> {
    let source = SceneSource {
        name: "scene",
        text,
        folder: None,
    };
    let sets: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
    let scene = Scene::read(&source, &sets).map_err(|error| error.to_string())?;
    Session::new(scene, 1).map_err(|error| error.to_string())
}

fn refusal(text: &str, sets: &[&str]) -> String {
    session(text, sets).err().expect("it is refused")
}

/// Where the only marker is, and how far it went [m].
fn marker(session: &Session) -> (Vec3, Vec3) {
    let (marker, now) = session.markers().next().expect("the scene has a marker");
    (marker.rest_m, now - marker.rest_m)
}

fn particles_where(mesh: &TetMesh, inside: impl Fn(Vec3) -> bool) -> Vec<usize> {
    (0..mesh.particles.len())
        .filter(|&i| inside(mesh.particles[i]))
        .collect()
}

/// The folder of the meshes that other programs were measured on, or `None` with a line.
fn peers() -> Option<PathBuf> {
    let default = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared");
    let root = std::env::var_os("PALPATE_SHARED").map_or_else(default, PathBuf::from);
    let path = root.join("peers/solver/meshes");
    if !path.exists() {
        println!(
            "{} is absent; set PALPATE_SHARED to test against it",
            path.display()
        );
        return None;
    }
    Some(path)
}

/// That the scene `beam` with `file` holds exactly the face x = min and follows exactly the face
/// x = max. `cells` cells lie along a side of these faces.
fn assert_faces(sets: &[&str], cells: usize) {
    let mut session = session(BEAM, sets).expect("the beam is sound");
    let setup = session.simulation().setup().clone();
    let mesh = &setup.tets;
    let xs = mesh.particles.iter().map(|x| x.x);
    let (low, high) = xs.fold((f32::MAX, f32::MIN), |(l, h), x| (l.min(x), h.max(x)));
    let face = (cells + 1).pow(2);
    let at_low = particles_where(mesh, |x| x.x < low + 1e-5);
    assert_eq!(at_low.len(), face);
    let held = (0..mesh.particles.len()).filter(|&i| setup.fixed[i]);
    assert_eq!(held.collect::<Vec<_>>(), at_low, "{sets:?}");

    // The marker is the mean of what it follows also when that has moved.
    let at_high = particles_where(mesh, |x| x.x > high - 1e-5);
    assert_eq!(at_high.len(), face);
    session.tick();
    session.tick();
    let now = session.simulation().particles();
    let sum: Vec3 = at_high.iter().map(|&i| now[i]).sum();
    let (rest, moved) = marker(&session);
    let expected = sum / face as f32;
    assert!(moved.length() > 1e-4);
    // Sums in f32 against f64: a few roundings of 0.1 m.
    assert!((rest + moved - expected).length() < 3e-7, "{sets:?}");
}

#[test]
fn the_beam_holds_one_end_face_and_follows_the_other_whatever_its_file() {
    assert_faces(&[], 5);
    let folder = Folder::new("faces");
    let (_, block) = lattice::block_of_cells(Vec3::new(0.1, 0.05, 0.05), [6, 3, 3]);
    let mut moved = block.tets;
    for x in &mut moved.particles {
        *x = *x * 0.7 + Vec3::new(-0.0312, 0.2, 0.077);
    }
    let set = folder.set_file("moved.msh", export::msh_bytes(&moved));
    assert_faces(&[&set], 3);
    let Some(meshes) = peers() else { return };
    for (file, cells) in [
        ("beam_1k.msh", 5),
        ("beam_1k_sliver.msh", 5),
        ("beam_10k.msh", 10),
    ] {
        let set = format!("body.file=\"{}\"", meshes.join(file).display());
        assert_faces(&[&set], cells);
    }
}

#[test]
fn the_organ_holds_its_lowest_seventh_and_follows_its_top() {
    let check = |sets: &[&str], held: usize| {
        let session = session(ORGAN, sets).expect("the organ is sound");
        let fixed = session.simulation().setup().fixed.iter();
        assert_eq!(fixed.filter(|&&fixed| fixed).count(), held, "{sets:?}");
        let (rest, _) = marker(&session);
        assert!((rest - Vec3::new(0.0, 0.0, 0.03)).length() < 1e-7, "{rest}");
    };
    let low = |mesh: &TetMesh| particles_where(mesh, |x| x.z <= -0.03 + 0.15 * 0.06).len();
    let own = session(ORGAN, &[]).expect("the organ is sound");
    check(&[], low(&own.simulation().setup().tets));
    let Some(meshes) = peers() else { return };
    let file = meshes.join("organ_5k.msh");
    let mesh = read_tets(&file).expect("it is sound").mesh;
    check(&[&format!("body.file=\"{}\"", file.display())], low(&mesh));
}

#[test]
fn the_beam_settles_where_a_newton_solve_of_the_same_beam_has_it() {
    let mut session = session(BEAM, &[]).expect("the beam is sound");
    for _ in 0..150 {
        session.tick();
    }
    let (_, moved) = marker(&session);
    println!("tip moved {moved}");
    // Newton's tip of these tetrahedra and this material, to a micrometre; what a sweep a substep is
    // off by (1e-5) is smaller.
    let expected = Vec3::new(-0.012_215, 0.0, -0.054_989);
    assert!((moved - expected).length() < 1e-3 * expected.length());
}

#[test]
fn the_hanging_bar_stretches_by_the_closed_form() {
    let mut session = session(BAR, &[]).expect("the bar is sound");
    for _ in 0..120 {
        session.tick();
    }
    let (_, moved) = marker(&session);
    println!("end moved {moved}");
    let expected = 1000.0 * 9.81 * 0.1 * 0.1 / (2.0 * 50_000.0);
    // Half a per cent is the strain, for which the closed form is too small.
    assert!((-moved.y / expected - 1.0).abs() < 5e-3, "{moved}");
    assert!(moved.x.hypot(moved.z) < 1e-5);
}

#[test]
fn a_tet_body_is_its_file_particle_for_particle() {
    let folder = Folder::new("file");
    let set = folder.set_file("cube.msh", cube().format_4());
    let sets = [set.as_str(), "body.size_m=0.05", "body.fixed=[]"];
    let session = session(BEAM, &sets).expect("the cube is sound");
    let setup = session.simulation().setup();
    let places: Vec<Vec3> = (0..8)
        .map(|k| 0.05 * Vec3::new((k & 1) as f32, (k >> 1 & 1) as f32, (k >> 2) as f32))
        .collect();
    assert_eq!(setup.tets.particles, places);
    assert_eq!(setup.tets.tets[4], [7, 6, 3, 5]);
    assert_eq!(setup.fill, [1.0; 5]);
    // Corner 1 has one tetrahedron of a sixth, corner 0 that of a third and three of a sixth.
    let cube_kg = 1000.0 * 0.05_f32.powi(3);
    assert!((setup.masses_kg[1] / (cube_kg / 24.0) - 1.0).abs() < 1e-6);
    assert!((setup.masses_kg[0] / (cube_kg * 5.0 / 24.0) - 1.0).abs() < 1e-6);
    // Every point of the surface is a particle.
    assert_eq!(session.mesh.points, places);
    for (point, carriers) in setup.embedding.particles.iter().enumerate() {
        assert_eq!(*carriers, [point as u32; 4]);
        assert_eq!(setup.embedding.weights[point], [1.0, 0.0, 0.0, 0.0]);
    }
    assert_eq!(session.mesh.triangles.len(), 12);
    assert!((session.mesh.volume_m3() / 0.05_f64.powi(3) - 1.0).abs() < 1e-6);
}

#[test]
fn what_only_a_surface_has_is_refused_for_tetrahedra_with_the_reason() {
    let folder = Folder::new("cells");
    let set = folder.set_file("cube.msh", cube().format_2());
    // The slab's own cell is forgotten with its shape, one asked for is not.
    session(SLAB, &[&set]).expect("the slab's script prods a cube");
    let message = refusal(SLAB, &[&set, "body.cell_m=0.01"]);
    assert!(message.contains("body.cell_m"), "{message}");
    assert!(message.contains("taken as they are"), "{message}");
    let message = refusal(BEAM, &["body.cell_m=0.01"]);
    assert!(message.contains("body.cell_m"), "{message}");
    let message = refusal(BEAM, &["body.meshes=[\"lobe\"]"]);
    assert!(message.contains("body.meshes"), "{message}");
    let message = refusal(SLAB, &["body.file=missing.msh"]);
    assert!(message.contains("missing.msh"), "{message}");
}

#[test]
fn a_body_of_another_unit_is_told_and_one_too_small_to_weigh_is_refused() {
    let folder = Folder::new("units");
    let (_, block) = lattice::block_of_cells(Vec3::new(0.1, 0.05, 0.05), [2, 1, 1]);
    let scaled = |scale: f32| {
        let mut mesh = block.tets.clone();
        mesh.particles.iter_mut().for_each(|x| *x *= scale);
        folder.set_file("scaled.msh", export::msh_bytes(&mesh))
    };
    let says_size = |session: &Session| session.notes.iter().any(|n| n.contains("body.size_m"));
    let metres = session(BEAM, &[&scaled(1.0)]).expect("it is sound");
    assert!(!says_size(&metres), "{:?}", metres.notes);
    let millimetres = scaled(1000.0);
    let told = session(BEAM, &[&millimetres]).expect("it is sound");
    assert!(says_size(&told), "{:?}", told.notes);
    let sized = session(BEAM, &[&millimetres, "body.size_m=0.1"]).expect("it is sound");
    assert!(!says_size(&sized));
    assert!((sized.rest.longest_m() - 0.1).abs() < 1e-7);
    // Volumes below the smallest f32.
    let message = refusal(BEAM, &[&scaled(1e-13)]);
    assert!(message.contains("body.size_m"), "{message}");
}

#[test]
fn a_shape_by_formula_is_as_long_as_its_size_says() {
    let small = session(SLAB, &["body.size_m=0.05", "body.cell_m=0.0025"]).expect("it is sound");
    let extent = small.rest.high - small.rest.low;
    assert!(
        extent.distance(Vec3::new(0.05, 0.01, 0.05)) < 1e-7,
        "{extent}"
    );
    let plain = session(SLAB, &[]).expect("it is sound");
    assert!((plain.rest.longest_m() - 0.1).abs() < 1e-7);
}

/// A beam of 10 x 5 x 5 cm times `scale`, clamped at x = 0.
fn beam_of(scale: f32) -> BodySetup {
    let (surface, block) = lattice::block_of_cells(Vec3::new(0.1, 0.05, 0.05), [10, 5, 5]);
    let mut tets = block.tets;
    tets.particles.iter_mut().for_each(|x| *x *= scale);
    BodySetup {
        fixed: tets.particles.iter().map(|x| x.x < 1e-9).collect(),
        masses_kg: lumped_masses_kg(&tets, 1000.0),
        fill: Vec::new(),
        activity: Vec::new(),
        embedding: Embedding {
            particles: block.embedding.particles,
            weights: block.embedding.weights,
        },
        triangles: surface.point_triangles(),
        tets,
        gravity_m_s2: Vec3::new(0.0, 0.0, -9.81 * scale),
        damping_per_s: 0.0,
    }
}

#[test]
fn tetrahedra_of_a_millimetre_swing_as_their_enlarged_image_does() {
    // Lengths by s, gravity by s and stiffness by s² leave every time as it is. With s a power of
    // two no rounding differs either, so a threshold that is no share of a length would show.
    let swing = |scale: f32| {
        let params = SolverParams {
            youngs_modulus_pa: 1e4 * scale * scale,
            poisson_ratio: 0.45,
            ..SolverParams::default()
        };
        let mut simulation = Simulation::new(beam_of(scale), params);
        assert_eq!(simulation.sound_tets().len(), 1250, "none is dropped");
        for _ in 0..20 {
            simulation.step(&[]);
        }
        let scaled = simulation.particles().iter().map(|&x| x / scale);
        scaled.collect::<Vec<Vec3>>()
    };
    let (large, small) = (swing(1.0), swing(1.0 / 16.0));
    let tip_fell = large.iter().map(|x| -x.z).fold(0.0, f32::max);
    assert!(tip_fell > 0.02, "the beam swings, by {tip_fell} m");
    let worst = (large.iter().zip(&small))
        .map(|(a, b)| a.distance(*b))
        .fold(0.0, f32::max);
    println!("worst difference {worst} m of a fall of {tip_fell} m");
    // Thresholds that are lengths would cost millimetres.
    assert!(worst < 1e-6, "{worst}");
}

#[test]
fn damping_shrinks_velocities_once_a_frame_by_its_exponential() {
    let mut setup = beam_of(1.0);
    setup.fixed.fill(false);
    setup.gravity_m_s2 = Vec3::ZERO;
    setup.damping_per_s = 10.0;
    let mut simulation = Simulation::new(setup, SolverParams::default());
    let rest = simulation.particles().to_vec();
    simulation.set_state(&rest, &vec![Vec3::X; rest.len()]);
    let report = simulation.step(&[]);
    let kept = (-10.0_f32 / 60.0).exp();
    // 0.1 m of f32 over a substep of 1/1200 s: 1e-5 m/s a rounding.
    assert!((report.speed_max_m_s - kept).abs() < 3e-4, "{report:?}");
    // Within the frame nothing is damped: the body went a whole 1/60 m.
    let way = simulation.particles()[0].x - rest[0].x;
    assert!((way - 1.0 / 60.0).abs() < 1e-5, "{way}");
}

/// How far the tip of the bundled beam hangs after three seconds [m], and the session.
fn settled(sets: &[&str]) -> (f32, Session) {
    settled_of(BEAM, sets)
}

fn settled_of(text: &str, sets: &[&str]) -> (f32, Session) {
    let mut session = session(text, sets).expect("a sound scene");
    for _ in 0..180 {
        session.tick();
    }
    (marker(&session).1.length(), session)
}

#[test]
fn tissue_too_stiff_for_its_substeps_is_handed_to_the_implicit_method_which_is_said() {
    // A beam of a centimetre is as stiff to the method as one of 10 MPa ten times its size.
    for sets in [
        &["solver.youngs_modulus_pa=400000"][..],
        &["solver.youngs_modulus_pa=1e7"],
        &["body.size_m=0.01"],
    ] {
        let (tip, handed) = settled(sets);
        assert_eq!(handed.solver().method, Method::Implicit, "{sets:?}");
        let is_told = |note: &String| note.contains("implicit is taken, in 4");
        assert!(handed.notes.iter().any(is_told), "{:?}", handed.notes);
        let asked = [sets, &["solver.method=\"implicit\"", "solver.substeps=10"]].concat();
        let (truth, _) = settled(&asked);
        // Both come to rest at one equilibrium; half a percent is what is asked of a settled tip.
        assert!((tip / truth - 1.0).abs() < 1e-3, "{tip} m, not {truth}");
    }
}

/// A rod that strikes the free end at 5 m/s and goes through to below it.
const BLOW: &str = "
[[tool]]
name = \"rod\"
radius_m = 0.01
keys = [
    { at_s = 0.0, at_m = [0.08, 0.025, 0.30], action = \"idle\" },
    { at_s = 0.3, at_m = [0.08, 0.025, 0.15], action = \"push\" },
    { at_s = 0.35, at_m = [0.08, 0.025, -0.10], action = \"push\" },
    { at_s = 0.40, at_m = [0.08, 0.025, 0.15], action = \"idle\" },
]
";

#[test]
fn a_body_that_was_struck_so_hard_that_waves_grew_is_handed_over_and_sags_no_more_than_before() {
    let sets = ["solver.youngs_modulus_pa=90000"];
    let (tip, struck) = settled_of(&format!("{BEAM}{BLOW}"), &sets);
    assert_eq!(struck.scene.solver.method, Method::XpbdNeoHookean);
    assert_eq!(struck.solver().method, Method::Implicit);
    let told = (struck.notes.iter()).filter(|note| note.contains("waves grew"));
    assert_eq!(told.count(), 1, "{:?}", struck.notes);
    let (truth, calm) = settled(&sets);
    assert_eq!(calm.solver().method, Method::XpbdNeoHookean);
    // Left as it was, it hung 0.9 % lower; half a percent is what is asked of a settled tip.
    assert!((tip / truth - 1.0).abs() < 2e-3, "{tip} m, not {truth}");
}

#[test]
fn soft_tissue_stays_with_its_method() {
    let soft = session(BEAM, &[]).expect("a sound scene");
    assert_eq!(soft.solver(), soft.scene.solver);
    assert!(soft.notes.iter().all(|note| !note.contains("taken")));
}

#[test]
fn poor_tetrahedra_of_stiffer_tissue_come_to_rest() {
    for modulus in [20_000, 40_000, 50_000] {
        let modulus = format!("solver.youngs_modulus_pa={modulus}");
        let mut session = session(ORGAN, &[&modulus]).expect("a sound scene");
        let mut speed_m_s = f32::INFINITY;
        for _ in 0..240 {
            speed_m_s = session.tick().report.speed_max_m_s;
        }
        assert!(speed_m_s < 1e-3, "{modulus}: {speed_m_s} m/s");
    }
}

#[test]
fn poor_tetrahedra_that_tremble_or_stay_folded_are_handed_over_which_is_said_and_come_to_rest() {
    for (sets, told) in [
        (
            ["solver.substeps=50", "solver.youngs_modulus_pa=10000"],
            "trembled",
        ),
        (
            ["solver.substeps=20", "solver.youngs_modulus_pa=1000"],
            "inside out",
        ),
    ] {
        let mut session = session(ORGAN, &sets).expect("a sound scene");
        assert_eq!(session.solver(), session.scene.solver);
        let mut speed_m_s = f32::INFINITY;
        for _ in 0..360 {
            speed_m_s = session.tick().report.speed_max_m_s;
        }
        assert!(speed_m_s < 1e-3, "{sets:?}: {speed_m_s} m/s");
        assert_eq!(session.solver().method, Method::Implicit, "{sets:?}");
        let notes = (session.notes.iter()).filter(|note| note.contains(told));
        assert_eq!(notes.count(), 1, "{:?}", session.notes);
    }
}

#[test]
fn a_body_handed_over_stays_so_through_changed_damping_and_tissue_and_is_judged_anew_with_other_steps()
 {
    let sets = ["solver.substeps=50", "solver.youngs_modulus_pa=10000"];
    let mut session = session(ORGAN, &sets).expect("a sound scene");
    for _ in 0..360 {
        session.tick();
    }
    let frame = session.handed_over_frame().expect("it trembled");
    session.scene.body.damping_per_s = 4.0;
    session.scene.solver.youngs_modulus_pa = 9000.0;
    session.set_solver();
    let taken = session.solver();
    assert_eq!(taken.method, Method::Implicit);
    assert_eq!(taken.youngs_modulus_pa, 9000.0);
    assert_eq!(session.handed_over_frame(), Some(frame));
    session.scene.solver.substeps = 60;
    session.set_solver();
    assert_eq!(
        session.solver(),
        session.scene.solver,
        "nothing is known of these steps"
    );
    assert_eq!(session.handed_over_frame(), None);
}

/// A ball that comes to rest 4 mm deep in the top of the organ and stays.
const RESTING_BALL: &str = "
[[tool]]
name = \"ball\"
radius_m = 0.01
approach = { from_share = [0.5, 0.5, 1.6], toward_share = [0.5, 0.5, 0.5] }
keys = [
    { at_s = 0.0, depth_m = -0.004, action = \"push\" },
    { at_s = 0.2, depth_m = 0.004, action = \"push\" },
]
";

#[test]
fn poor_tetrahedra_tremble_under_a_resting_tool_and_under_heavy_damping_too_and_are_handed_over() {
    let pressed = format!("{ORGAN}{RESTING_BALL}");
    for (text, sets) in [
        (
            pressed.as_str(),
            ["solver.substeps=52", "body.damping_per_s=10"],
        ),
        (ORGAN, ["solver.substeps=52", "body.damping_per_s=60"]),
    ] {
        let mut session = session(text, &sets).expect("a sound scene");
        assert_eq!(session.solver(), session.scene.solver, "{sets:?}");
        let mut report = session.tick().report;
        for _ in 0..300 {
            report = session.tick().report;
        }
        assert_eq!(session.solver().method, Method::Implicit, "{sets:?}");
        assert!(report.speed_max_m_s < 1e-3, "{sets:?}: {report:?}");
        let is_pressed = report
            .tool_forces_n
            .iter()
            .any(|force| force.length() > 0.05);
        assert_eq!(is_pressed, text != ORGAN, "{report:?}");
    }
}

#[test]
fn pressed_tissue_is_not_taken_for_trembling() {
    let mut session = session(include_str!("../scenes/slab.toml"), &[]).expect("a sound scene");
    for _ in 0..180 {
        session.tick();
    }
    assert_eq!(session.handed_over_frame(), None, "{:?}", session.notes);
}

#[test]
fn poor_tetrahedra_tremble_with_even_substeps_as_with_odd_ones() {
    // Asleep, a body is still: the tremble of two substeps is over as a step of 40 ends.
    for substeps in [39, 40, 41] {
        let mut session =
            session(ORGAN, &["solver.youngs_modulus_pa=2500"]).expect("a sound scene");
        let mut simulation = Simulation::new(
            session.simulation().setup().clone(),
            SolverParams {
                substeps,
                youngs_modulus_pa: 1e4,
                ..session.scene.solver
            },
        );
        let mut report = session.tick().report;
        for _ in 0..150 {
            report = simulation.step(&[]);
        }
        assert!(
            !report.asleep && report.speed_max_m_s > 0.01,
            "{substeps}: {report:?}"
        );
    }
}

#[test]
fn a_modulus_that_changes_while_it_runs_changes_the_method_and_back() {
    let mut session = session(BEAM, &[]).expect("a sound scene");
    session.scene.solver.youngs_modulus_pa = 4e5;
    session.set_solver();
    assert_eq!(session.solver().method, Method::Implicit);
    session.tick();
    session.scene.solver.youngs_modulus_pa = 1e4;
    session.set_solver();
    assert_eq!(session.solver().method, Method::XpbdNeoHookean);
    session.tick();
}

#[test]
fn a_wave_in_step_with_the_frames_is_damped_as_any_other() {
    // At 40 substeps a corner of this beam swings in step with the frames, and so had no speed whenever
    // damping came, once a frame: a millimetre a second was left after two seconds, and half of it after ten.
    let sets = ["solver.method=\"implicit\"", "solver.substeps=40"];
    let mut session = session(BEAM, &sets).expect("a sound scene");
    let mut speed_m_s = 0.0;
    for _ in 0..130 {
        speed_m_s = session.tick().report.speed_max_m_s;
    }
    // Damping of 10/s takes all waves to exp(-5 t) of some metre a second, 2e-5 here.
    assert!(speed_m_s < 1e-4, "{speed_m_s} m/s");
}

#[test]
fn waves_that_grow_where_a_mesh_is_fine_hand_the_body_over_before_it_is_wrecked() {
    // Stiff for its fine cells only, in steps of half the scene's length: as a whole it is not too stiff.
    let sets = ["solver.poisson_ratio=0.45", "solver.timestep_s=0.0025"];
    let mut session = session(HERTZ, &sets).expect("a sound scene");
    assert_eq!(session.handed_over_frame(), None);
    for _ in 0..85 {
        session.tick();
    }
    assert!(session.handed_over_frame().is_some(), "{:?}", session.notes);
    let speed_m_s = session.tick().report.speed_max_m_s;
    assert!(
        speed_m_s < 0.01,
        "the tool goes at 0.002 m/s, something at {speed_m_s}"
    );
}

/// A needle led 1 cm into the top of a block of cells as long, where it stays.
const NEEDLE: &str = "
title = \"a needle\"
[body]
shape = \"slab\"
extent_m = [0.1, 0.05, 0.1]
cell_m = 0.01
density_kg_m3 = 1000.0
[[body.fixed]]
plane_share = { point = [0.0, 1e-3, 0.0], normal = [0.0, 1.0, 0.0] }
[[tool]]
radius_m = 0.001
keys = [
    { at_s = 0.0, at_share = [0.53, 1.1, 0.53], action = \"push\" },
    { at_s = 1.0, at_share = [0.53, 0.8, 0.53], action = \"push\" },
]
[light_path]
method = \"tangent\"
[surface]
kind = \"plain\"
";

#[test]
fn a_fold_below_a_tool_that_stays_is_handed_over() {
    let mut session = session(NEEDLE, &[]).expect("a sound scene");
    let mut tick = session.tick();
    for _ in 0..150 {
        tick = session.tick();
    }
    assert!(tick.force_max_n() > 0.5, "the needle presses");
    assert_eq!(
        session.solver().method,
        Method::Implicit,
        "{:?}",
        session.notes
    );
    assert!(session.notes.iter().any(|note| note.contains("inside out")));
    assert_eq!(session.simulation().report().inverted_tets, 0);
}

#[test]
fn the_pressed_slab_answers_as_hertz_has_it() {
    // The second is too stiff for the scene's method, and handed over.
    for sets in [&[][..], &["solver.poisson_ratio=0.45"]] {
        answers_as_hertz_has_it(sets);
    }
}

fn answers_as_hertz_has_it(sets: &[&str]) {
    let mut session = session(HERTZ, sets).expect("a sound scene");
    let solver = session.scene.solver;
    let modulus_pa = solver.youngs_modulus_pa / (1.0 - solver.poisson_ratio.powi(2));
    for frame in 1..=session.scene.output.frames {
        let tick = session.tick();
        let depth_m = session.tool_depth_m().expect("the sphere has a way");
        let hertz_n = 4.0 / 3.0 * modulus_pa * 0.01_f32.sqrt() * depth_m.powf(1.5);
        let off = tick.force_max_n() / hertz_n - 1.0;
        // Asked for: 5 %. Shallower, the contact is hardly wider than two cells.
        assert!(
            frame < 14 || off.abs() < 0.05,
            "{sets:?}: {off} at {depth_m} m"
        );
    }
}
