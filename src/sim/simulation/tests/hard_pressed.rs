//! Bodies that tools leave little way: carried by them alone, hit fast, caught between two.

use super::*;

/// So many substeps of so many iterations.
fn params(method: Method, substeps: u32, iterations: u32) -> SolverParams {
    SolverParams {
        substeps,
        iterations,
        youngs_modulus_pa: 1e4,
        ..soft(method)
    }
}

#[test]
fn block_on_two_bars_comes_to_rest_in_one_implicit_substep_a_frame() {
    let mut setup = body(Vec3::new(0.1, 0.04, 0.04), 0.01, |_| false);
    setup.gravity_m_s2 = DOWN;
    setup.damping_per_s = 6.0;
    let weight_n: f32 = setup.masses_kg.iter().sum::<f32>() * 9.81;
    let mut simulation = Simulation::new(setup, params(Method::Implicit, 1, 1));
    let bars = [0.02, 0.08].map(|x| ToolInput {
        shape: ToolShape::Capsule {
            radius_m: 0.01,
            axis_m: 0.2 * Vec3::Z,
        },
        ..tool(0.01, Vec3::new(x, -0.01, -0.08), ToolAction::Push)
    });
    for step in 0..240 {
        let report = simulation.step(&bars);
        let force_n = report.tool_forces_n[0] + report.tool_forces_n[1];
        if step >= 120 {
            assert!(
                (force_n + weight_n * Vec3::Y).length() < 0.02 * weight_n,
                "{force_n} N in step {step} for a weight of {weight_n} N"
            );
        }
    }
}

#[test]
fn ball_of_10_m_per_s_is_kept_out_in_one_implicit_substep_a_frame() {
    let mut setup = body(Vec3::new(0.1, 0.05, 0.05), 0.01, |x| x.y < 1e-6);
    setup.damping_per_s = 6.0;
    let mut simulation = Simulation::new(setup, params(Method::Implicit, 1, 1));
    let radius_m = 0.01;
    for step in 0..30 {
        let depth_m = -0.02 + (10.0 * step as f32 / 60.0).min(0.035);
        let at = Vec3::new(0.0513, 0.05 + radius_m - depth_m, 0.0247);
        let report = simulation.step(&[tool(radius_m, at, ToolAction::Push)]);
        // 1 % of the thickness.
        assert!(
            report.penetration_max_m < 5e-4,
            "{} m in step {step}",
            report.penetration_max_m
        );
    }
    assert_eq!(simulation.report().inverted_tets, 0);
}

/// A slab between two balls that come to overlap by 4 mm, and go again.
fn caught(params: SolverParams) -> Simulation {
    let mut setup = body(Vec3::new(0.08, 0.03, 0.08), 0.01, |x| x.x < 1e-6);
    setup.damping_per_s = 6.0;
    let mut simulation = Simulation::new(setup, params);
    let radius_m = 0.012;
    let mut yielded = false;
    for step in 0..240 {
        let come_m = 0.017 * (step as f32 / 40.0).min(1.0);
        let action = if step < 120 {
            ToolAction::Push
        } else {
            ToolAction::Idle
        };
        let balls = [0.03 + radius_m - come_m, come_m - radius_m]
            .map(|y| tool(radius_m, Vec3::new(0.06, y, 0.04), action));
        let report = simulation.step(&balls);
        yielded |= report.yielding_tools == 1;
        assert!(all_finite(&simulation) && report.frozen_particles == 0);
        for force_n in report.tool_forces_n {
            // E times the area of a ball is 5 N.
            assert!(force_n.length() < 100.0, "{force_n} N in step {step}");
        }
        if (60..120).contains(&step) {
            assert!(!report.restoring && report.inverted_tets == 0, "{step}");
        }
    }
    assert!(yielded);
    simulation
}

#[test]
fn tissue_without_room_between_two_tools_is_left_by_one_and_recovers() {
    for params in [
        params(Method::XpbdNeoHookean, 20, 1),
        params(Method::Implicit, 1, 1),
        params(Method::Implicit, 4, 1),
    ] {
        let simulation = caught(params);
        let off_m = farthest_from_rest_m(&simulation);
        assert!(off_m < 1e-3, "{:?}: {off_m} m", params.method);
    }
}

#[test]
fn tools_beside_each_other_both_press_though_they_overlap() {
    let mut simulation = Simulation::new(slab(), soft(Method::XpbdNeoHookean));
    for step in 0..60 {
        let y = 0.042 - 0.005 * (step as f32 / 20.0).min(1.0);
        let balls = [0.037, 0.043].map(|x| tool(0.012, Vec3::new(x, y, 0.04), ToolAction::Push));
        simulation.step(&balls);
    }
    let report = simulation.report();
    assert_eq!(report.yielding_tools, 0);
    assert!(report.tool_forces_n.iter().all(|force_n| force_n.y > 0.05));
}
