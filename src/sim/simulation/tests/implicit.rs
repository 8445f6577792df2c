//! The implicit method under tools, in long substeps, and after a wreck.

use super::*;

/// So many substeps of so many Newton steps.
fn implicit(substeps: u32, iterations: u32) -> SolverParams {
    SolverParams {
        substeps,
        iterations,
        ..soft(Method::Implicit)
    }
}

/// Few and many substeps, few and many Newton steps.
const SETTINGS: [(u32, u32); 4] = [(1, 1), (1, 4), (4, 1), (20, 1)];

/// The force on a tool pressed 4 mm into a slab, in each of the last steps [N].
fn pressed(params: SolverParams, shape: ToolShape) -> Vec<Vec3> {
    let mut setup = slab();
    setup.damping_per_s = 10.0;
    let mut simulation = Simulation::new(setup, params);
    let mut forces_n = Vec::new();
    for step in 0..80 {
        let y = 0.042 - 0.004 * (step as f32 / 20.0).min(1.0);
        let tool = ToolInput {
            shape,
            ..tool(0.012, Vec3::new(0.041, y, 0.036), ToolAction::Push)
        };
        let report = simulation.step(&[tool]);
        // 1 % of the thickness.
        assert!(
            report.penetration_max_m < 3e-4,
            "{} m in step {step}",
            report.penetration_max_m
        );
        assert_eq!(report.inverted_tets, 0);
        if step >= 70 {
            forces_n.push(report.tool_forces_n[0]);
        }
    }
    forces_n
}

#[test]
fn tool_that_rests_feels_a_steady_force_and_that_of_the_default_method() {
    let ball = ToolShape::Sphere { radius_m: 0.012 };
    let rod = ToolShape::Capsule {
        radius_m: 0.012,
        axis_m: Vec3::new(0.003, 0.004, 0.02),
    };
    for shape in [ball, rod] {
        let right_n = pressed(soft(Method::XpbdNeoHookean), shape)[9];
        for (substeps, iterations) in SETTINGS {
            let forces_n = pressed(implicit(substeps, iterations), shape);
            for force_n in &forces_n {
                let trembling = (*force_n - forces_n[9]).length() / right_n.length();
                assert!(
                    trembling < 2e-3,
                    "{shape:?}, {substeps} × {iterations}: {forces_n:?}"
                );
            }
            // Both stick where they slid to, which is not quite the same place.
            let error = (forces_n[9] - right_n).length() / right_n.length();
            assert!(
                error < 0.02,
                "{shape:?}, {substeps} × {iterations}: {} N, not {right_n}",
                forces_n[9]
            );
        }
    }
}

#[test]
fn body_lifted_by_a_grasp_hangs_on_it_with_its_weight() {
    for (substeps, iterations) in SETTINGS {
        let mut setup = body(Vec3::new(0.03, 0.03, 0.03), 0.01, |_| false);
        setup.gravity_m_s2 = DOWN;
        setup.damping_per_s = 10.0;
        let weight_n: f32 = setup.masses_kg.iter().sum::<f32>() * 9.81;
        let params = SolverParams {
            youngs_modulus_pa: 2e4,
            ..implicit(substeps, iterations)
        };
        let mut simulation = Simulation::new(setup, params);
        for step in 0..150 {
            let lift = 0.1 * (step as f32 / 60.0).min(1.0);
            let at = Vec3::new(0.015, 0.03 + lift, 0.015);
            simulation.step(&[tool(0.025, at, ToolAction::Grab)]);
        }
        let force_n = simulation.report().tool_forces_n[0];
        // What is left of the swing.
        assert!(
            (force_n + weight_n * Vec3::Y).length() < 0.01 * weight_n,
            "{substeps} × {iterations}: {force_n} N for a weight of {weight_n} N"
        );
    }
}

/// A soft cantilever 8 × 2 × 2 cm that has come to rest under its weight.
fn hanging(params: SolverParams) -> Simulation {
    let mut setup = body(Vec3::new(0.08, 0.02, 0.02), 0.01, |x| x.x < 1e-6);
    setup.gravity_m_s2 = DOWN;
    setup.damping_per_s = 10.0;
    let params = SolverParams {
        youngs_modulus_pa: 2e4,
        ..params
    };
    let mut simulation = Simulation::new(setup, params);
    for _ in 0..150 {
        simulation.step(&[]);
    }
    simulation
}

/// Root mean square of how far the particles are from `places` [m].
fn off_m(simulation: &Simulation, places: &[Vec3]) -> f32 {
    let squares = (simulation.particles().iter().zip(places)).map(|(a, b)| a.distance_squared(*b));
    (squares.sum::<f32>() / places.len() as f32).sqrt()
}

#[test]
fn body_wrecked_in_any_way_is_back_within_a_second() {
    for (substeps, iterations) in [(1, 1), (4, 1), (20, 1)] {
        let settled = hanging(implicit(substeps, iterations));
        let places = settled.particles().to_vec();
        let scattered = |i: usize| {
            let phase = i as f32 * Vec3::new(1.7, 2.9, 4.3);
            0.04 * Vec3::new(1.0 + phase.x.sin(), phase.y.sin(), phase.z.sin())
        };
        let rest = &settled.setup().tets.particles;
        let pulled = |(x, rest): (&Vec3, &Vec3)| {
            let way_m = if rest.x > 0.079 { 0.8 } else { 0.0 };
            *x + way_m * Vec3::X
        };
        let starts: [Vec<Vec3>; 4] = [
            (0..places.len()).map(scattered).collect(),
            vec![Vec3::new(0.04, 0.0, 0.0); places.len()],
            places.iter().map(|x| Vec3::new(x.x, 0.01, x.z)).collect(),
            places.iter().zip(rest).map(pulled).collect(),
        ];
        for (number, start) in starts.iter().enumerate() {
            let mut simulation = hanging(implicit(substeps, iterations));
            simulation.set_state(start, &vec![Vec3::ZERO; start.len()]);
            assert!(off_m(&simulation, &places) > 0.1 * 0.02);
            for _ in 0..60 {
                simulation.step(&[]);
                assert!(all_finite(&simulation));
            }
            let off_m = off_m(&simulation, &places);
            // 2 % of the length.
            assert!(
                off_m < 0.02 * 0.08 && simulation.report().inverted_tets == 0,
                "start {number}, {substeps} × {iterations}: {off_m} m, {} inverted",
                simulation.report().inverted_tets
            );
        }
    }
}
