//! A grab that no cursor can turn into a wreck.

use super::*;

#[test]
fn cursor_that_jumps_anywhere_leaves_a_body_that_is_whole() {
    for method in [Method::XpbdSprings, Method::XpbdNeoHookean] {
        let mut setup = slab();
        setup.damping_per_s = 5.0;
        let mut simulation = Simulation::new(setup, soft(method));
        let top = Vec3::new(0.04, 0.03, 0.04);
        // Ten body lengths, a kilometre, nowhere, and back, each within a step.
        let jumps = [
            top + 0.8 * Vec3::Y,
            top + 1e3 * Vec3::X,
            Vec3::NAN,
            top,
            top - 0.8 * Vec3::Y,
            Vec3::splat(1e30),
            Vec3::splat(f32::NEG_INFINITY),
            top + 0.8 * Vec3::Z,
            top,
        ];
        for jump in jumps {
            for _ in 0..2 {
                simulation.step(&[tool(0.012, jump, ToolAction::Grab)]);
                assert!(all_finite(&simulation), "{method:?} at {jump}");
            }
        }
        let mut report = StepReport::default();
        for _ in 0..150 {
            report = simulation.step(&[tool(0.012, top, ToolAction::Idle)]);
        }
        assert_eq!(
            (report.inverted_tets, report.frozen_particles),
            (0, 0),
            "{method:?}"
        );
        let off_m = farthest_from_rest_m(&simulation);
        // 1 % of the thickness.
        assert!(off_m < 3e-4, "{method:?}: {off_m} m from rest");
    }
}

#[test]
fn body_lifted_and_held_still_hangs_with_its_weight() {
    // Surface points between particles, as of an organ, and points that are particles, as of a tet
    // file.
    for mut setup in [ball(0.03, 0.012), body(Vec3::splat(0.04), 0.01, |_| false)] {
        let top = setup
            .tets
            .particles
            .iter()
            .copied()
            .max_by(|a, b| a.y.total_cmp(&b.y));
        let top = Vec3::new(0.5, 1.0, 0.5)
            * crate::geom::bounds(&setup.tets.particles)
                .1
                .min(top.expect("a body has particles").max(Vec3::splat(0.02)));
        setup.gravity_m_s2 = DOWN;
        setup.damping_per_s = 10.0;
        let weight_n: f32 = setup.masses_kg.iter().sum::<f32>() * 9.81;
        let stiff = SolverParams {
            youngs_modulus_pa: 2e4,
            ..soft(Method::XpbdNeoHookean)
        };
        let mut simulation = Simulation::new(setup, stiff);
        let mut report = StepReport::default();
        for step in 0..180 {
            let lift = 0.1 * (step as f32 / 60.0).min(1.0);
            let hand = tool(0.025, top + lift * Vec3::Y, ToolAction::Grab);
            report = simulation.step(&[hand]);
        }
        let force_n = report.tool_forces_n[0];
        // What is left of the swing after two seconds.
        assert!(
            (force_n + weight_n * Vec3::Y).length() < 0.01 * weight_n,
            "{force_n} N for a weight of {weight_n} N"
        );
    }
}

#[test]
fn grasp_pulls_against_another_tool_and_not_through_it() {
    let mut setup = slab();
    setup.damping_per_s = 5.0;
    let mut simulation = Simulation::new(setup, soft(Method::XpbdNeoHookean));
    let top = Vec3::new(0.04, 0.03, 0.04);
    for step in 0..60 {
        // A ball rests on the slab; a hand beside it pulls the tissue up and across, against it.
        let ball = tool(0.01, top + Vec3::new(0.0, 0.0095, 0.0), ToolAction::Push);
        let pull = 0.02 * (step as f32 / 30.0).min(1.0);
        let hand = tool(
            0.008,
            Vec3::new(0.06, 0.03, 0.04) + pull * Vec3::new(-0.7, 0.7, 0.0),
            ToolAction::Grab,
        );
        let report = simulation.step(&[ball, hand]);
        assert!(
            report.penetration_max_m < 3e-4,
            "{} m in step {step}",
            report.penetration_max_m
        );
    }
    let report = simulation.report();
    // The ball holds back what the hand pulls at.
    assert!(report.tool_forces_n[0].y > 0.0 && report.tool_forces_n[1].x > 0.0);
    assert_eq!(report.inverted_tets, 0);
}
