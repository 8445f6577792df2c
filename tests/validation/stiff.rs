//! A body so stiff that its swings are far shorter than a frame, in one substep a frame.

use super::*;

const TISSUE: Tissue = Tissue {
    youngs_modulus_pa: 10e6,
    poisson_ratio: 0.45,
};

/// A beam 10 × 5 × 5 cm that sags under its weight by some hundredths of a millimetre.
fn beam() -> BodySetup {
    let mut setup = block(Vec3::new(0.1, 0.05, 0.05), [8, 4, 4], |x| x.x < 1e-6);
    setup.gravity_m_s2 = Vec3::new(0.0, 0.0, -9.81);
    setup
}

/// Sag of the free end [m].
fn sag_m(setup: &BodySetup, places: &[DVec3]) -> f64 {
    let rest = rest_of(setup);
    mean_where(setup, |x| x.x > 0.0999, |i| rest[i].z - places[i].z)
}

/// The sag in each of the last of 60 frames of one substep, over that of the statics.
fn shares(tissue: Tissue, damping_per_s: f32, iterations: u32) -> Vec<f64> {
    let mut setup = beam();
    setup.damping_per_s = damping_per_s;
    let statics = fem(&setup, TISSUE.material()).statics();
    let right_m = sag_m(&setup, &statics.expect("the beam settles").positions);
    let params = SolverParams {
        substeps: 1,
        iterations,
        ..tissue.params(Method::Implicit)
    };
    let mut simulation = simulation(&setup, params);
    run(&mut simulation, 50);
    (0..10)
        .map(|_| {
            run(&mut simulation, 1);
            sag_m(&setup, &positions(&simulation)) / right_m
        })
        .collect()
}

#[test]
fn stiff_beam_is_at_rest_where_statics_has_it_in_one_substep_a_frame() {
    for damping_per_s in [0.0, 10.0] {
        for iterations in [1, 4] {
            for share in shares(TISSUE, damping_per_s, iterations) {
                // Positions are given out in single precision: 4e-9 m of 4e-5 m.
                assert!((share - 1.0).abs() < 1e-3, "{share}, {damping_per_s}/s");
            }
        }
    }
}

#[test]
fn stiff_check_notices_a_hundredth_of_the_modulus() {
    let shares = shares(TISSUE.stiffer(1.01), 10.0, 4);
    assert!(shares.iter().all(|share| (share - 1.0).abs() > 5e-3));
}
