//! The reference against answers of an independent program on the same meshes: settled beams, an organ,
//! and the free swing of a beam.
//!
//! Needs the shared data (`PALPATE_SHARED`); without them each test says so and passes.

#[path = "support/bodies.rs"]
mod bodies;
#[path = "support/peers.rs"]
mod peers;

use bodies::{block, farthest_m, fem, mean_where};
use glam::{DVec3, Vec3};
use palpate::reference::{Material, Swing};
use peers::{Peer, shared};

/// Of the displacement of the tip; asked for is 1e-4. Recorded answers are in f64 on coordinates of nine digits,
/// ours on coordinates rounded to f32, so that strains differ by 6e-8 of a coordinate over an edge.
const TOLERANCE: f64 = 1e-6;
/// What rounding the coordinates of a beam at rest takes from every position [m]: half a unit in the last place
/// of 0.1, along each axis.
const ROUNDING_M: f64 = 6.5e-9;

/// Recorded positions of all particles [m].
fn recorded(name: &str) -> Option<Vec<DVec3>> {
    let path = shared(&format!("peers/solver/refs/{name}.npy"))?;
    let bytes = std::fs::read(path).expect("the answer can be read");
    let npy = npyz::NpyFile::new(&bytes[..]).expect("an npy file");
    let values: Vec<f64> = npy.into_vec().expect("numbers in f64");
    Some(values.chunks(3).map(DVec3::from_slice).collect())
}

/// A settled body beside the recorded one.
struct Compared {
    /// Largest distance of a particle from its recorded place [m].
    farthest_m: f64,
    /// Displacement of the tip as recorded [m].
    tip_m: f64,
}

impl Compared {
    fn agrees(&self) -> bool {
        self.farthest_m < TOLERANCE * self.tip_m + ROUNDING_M
    }
}

/// Settles the beam or organ `mesh` and compares it with the recorded answer, if there is one here.
fn compared(mesh: &str, youngs_modulus_pa: f64, answer: &str) -> Option<Compared> {
    let peer = Peer::load(mesh)?;
    let recorded = recorded(answer)?;
    let fem = peer.fem(youngs_modulus_pa);
    let found = fem.statics().expect("it settles");
    let compared = Compared {
        farthest_m: farthest_m(&found.positions, &recorded),
        tip_m: peer.tip_m(&recorded).length(),
    };
    println!(
        "{mesh} at {youngs_modulus_pa:.0} Pa: tip {:.6} mm, {:.1e} of it off the recorded answer, residual {:.1e} \
         after {} iterations",
        1e3 * peer.tip_m(&found.positions).z,
        compared.farthest_m / compared.tip_m,
        found.residual,
        found.iterations
    );
    Some(compared)
}

#[test]
fn settled_bodies_are_where_an_independent_program_has_them() {
    for (mesh, youngs_modulus_pa, answer) in [
        ("beam_1k", 1e4, "beam_1k_snh"),
        ("beam_1k", 5e4, "beam_1k_snh_E50000"),
        ("beam_1k", 1e7, "beam_1k_snh_E1e+07"),
        ("beam_1k_sliver", 1e4, "beam_1k_sliver_snh"),
        ("organ_5k", 1e4, "organ_5k_snh"),
    ] {
        if let Some(compared) = compared(mesh, youngs_modulus_pa, answer) {
            assert!(compared.agrees(), "{mesh} at {youngs_modulus_pa} Pa");
        }
    }
}

#[test]
fn settled_check_rejects_a_modulus_off_by_a_hundredth_of_a_per_cent() {
    if let Some(compared) = compared("beam_1k", 1.0001e4, "beam_1k_snh") {
        assert!(!compared.agrees());
    }
}

/// Height of the tip at each frame of the free swing of `beam_1k`, from 0 to `frames` [m].
fn swing_of_beam_1k(frames: usize, damping_per_s: f64) -> Option<Vec<f64>> {
    let peer = Peer::load("beam_1k")?;
    let fem = peer.fem(1e4);
    let swing = Swing {
        frames,
        frame_s: 1.0 / 60.0,
        steps_per_frame: 16,
        damping_per_s,
    };
    let mut tips = vec![0.0];
    fem.swing(fem.at_rest(), &swing, |_, state| {
        tips.push(peer.tip_m(&state.positions).z);
    })
    .expect("every step has a solution");
    let last = tips.len() - 1;
    println!("frame {last}: tip {:.4} mm", 1e3 * tips[last]);
    Some(tips)
}

/// The recorded heights of the same swing, 121 of them [m].
fn recorded_swing() -> Option<Vec<f64>> {
    let text = std::fs::read_to_string(shared("peers/solver/refs.json")?).expect("can be read");
    let all: serde_json::Value = serde_json::from_str(&text).expect("JSON");
    let tips = all["beam_1k:snh:dynamic"]["tip_z_per_frame"].as_array();
    let tips = tips.expect("the recorded swing").iter();
    Some(tips.map(|tip| tip.as_f64().expect("a number")).collect())
}

/// Largest difference of two swings over the depth of the first.
fn swing_difference(found: &[f64], recorded: &[f64]) -> f64 {
    let depth = recorded.iter().fold(0.0_f64, |depth, tip| depth.max(-tip));
    let pairs = found.iter().zip(recorded);
    let worst = pairs.map(|(a, b)| (a - b).abs()).fold(0.0, f64::max);
    println!("swing: {:.1e} of {:.3} mm off", worst / depth, 1e3 * depth);
    worst / depth
}

/// Frames and depths [mm] of the turning points at the bottom.
fn bottoms(tips: &[f64]) -> Vec<(usize, f64)> {
    (1..tips.len() - 1)
        .filter(|&i| tips[i] < tips[i - 1] && tips[i] <= tips[i + 1])
        .map(|i| (i, 1e3 * tips[i]))
        .collect()
}

#[test]
fn first_swing_of_the_beam_is_the_recorded_one() {
    let (Some(found), Some(recorded)) = (swing_of_beam_1k(13, 0.0), recorded_swing()) else {
        return;
    };
    // Both solve each step of the same rule to 1e-7 of the load or better: 2e-8 measured.
    let off = swing_difference(&found, &recorded);
    assert!(off < 1e-6, "{off}");
    let (frame, depth) = bottoms(&found)[0];
    assert_eq!(frame, 12);
    assert!((depth + 96.4).abs() < 0.05, "{depth} mm");
}

#[test]
fn swing_check_rejects_a_per_mille_of_damping() {
    let (Some(found), Some(recorded)) = (swing_of_beam_1k(6, 0.06), recorded_swing()) else {
        return;
    };
    assert!(swing_difference(&found, &recorded) > 1e-4);
}

#[test]
#[ignore = "ten seconds and more: cargo test --release --test reference -- --ignored --nocapture"]
fn all_swings_of_the_beam_are_the_recorded_ones() {
    let (Some(found), Some(recorded)) = (swing_of_beam_1k(120, 0.0), recorded_swing()) else {
        return;
    };
    println!("bottoms: {:.1?}", bottoms(&found));
    // A difference of the first swing has grown tenfold in two seconds: 2e-7 measured.
    assert!(swing_difference(&found, &recorded) < 1e-5);
    let exact = [
        (12, -96.4),
        (36, -92.9),
        (60, -92.2),
        (85, -90.5),
        (110, -87.5),
    ];
    for ((frame, depth), (frame_exact, depth_exact)) in bottoms(&found).into_iter().zip(exact) {
        assert_eq!(frame, frame_exact);
        assert!(
            (depth - depth_exact).abs() < 0.1,
            "frame {frame}: {depth} mm"
        );
    }
}

#[test]
fn settled_beams_of_ten_thousand_tetrahedra_are_the_recorded_ones() {
    for (youngs_modulus_pa, answer) in [(1e4, "beam_10k_snh"), (5e4, "beam_10k_snh_E50000")] {
        if let Some(compared) = compared("beam_10k", youngs_modulus_pa, answer) {
            assert!(compared.agrees(), "{youngs_modulus_pa} Pa");
        }
    }
}

#[test]
#[ignore = "twenty seconds and more: cargo test --release --test reference -- --ignored --nocapture"]
fn settled_beam_of_fifty_thousand_tetrahedra_is_the_recorded_one() {
    // The recorded mesh by formula: cells of a seventeenth of the height, cut into five.
    let size_m = Vec3::new(0.1, 0.05, 0.05);
    let mut setup = block(size_m, [34, 17, 17], |x| x.x < 1e-6);
    setup.gravity_m_s2 = Vec3::new(0.0, 0.0, -9.81);
    let fem = fem(&setup, Material::new(1e4, 0.45));
    let found = fem.statics().expect("it settles");
    let tip = mean_where(
        &setup,
        |x| x.x > 0.0999,
        |i| found.positions[i].z - fem.rest()[i].z,
    );
    println!(
        "tip {:.5} mm, residual {:.1e} after {} iterations",
        1e3 * tip,
        found.residual,
        found.iterations
    );
    // As recorded beside the other answers, by the same program.
    assert!(
        (tip / -0.061_176_713_086_645 - 1.0).abs() < TOLERANCE,
        "{tip} m"
    );
}
