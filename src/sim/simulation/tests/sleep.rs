//! What sleeps, what wakes it, and what it tells while it sleeps.

use super::*;

/// A slab with a ball pressed 4 mm into it, asleep, and the force on the ball [N].
fn pressed_asleep(method: Method) -> (Simulation, ToolInput, Vec3) {
    let mut setup = slab();
    setup.damping_per_s = 20.0;
    let params = match method {
        // Springs need no more; the classic needs short substeps.
        Method::MassSpring => SolverParams {
            substeps: 40,
            ..soft(method)
        },
        _ => soft(method),
    };
    let mut simulation = Simulation::new(setup, params);
    let at = |depth_m: f32| {
        tool(
            0.012,
            Vec3::new(0.04, 0.042 - depth_m, 0.04),
            ToolAction::Push,
        )
    };
    for step in 0..20 {
        simulation.step(&[at(0.004 * step as f32 / 20.0)]);
    }
    for _ in 0..400 {
        if simulation.step(&[at(0.004)]).asleep {
            let force_n = simulation.report().tool_forces_n[0];
            return (simulation, at(0.004), force_n);
        }
    }
    panic!(
        "{method:?}: a tool that rests lets the body sleep, but it goes on at {:e} m/s",
        simulation.report().speed_max_m_s
    );
}

#[test]
fn body_under_a_tool_that_rests_falls_asleep_and_keeps_telling_the_force() {
    for method in Method::ALL {
        let (mut simulation, ball, force_n) = pressed_asleep(method);
        assert!(force_n.y > 0.1, "{method:?}: {force_n} N");
        let before = simulation.particles().to_vec();
        for _ in 0..5 {
            let far = tool(0.01, Vec3::new(0.04, 0.2, 0.04), ToolAction::Push);
            let report = simulation.step(&[ball, far]);
            assert!(report.asleep, "{method:?}");
            assert_eq!(report.tool_forces_n, [force_n, Vec3::ZERO]);
        }
        assert_eq!(simulation.particles(), before);
    }
}

#[test]
fn tool_that_rested_wakes_the_body_when_it_moves_changes_lets_go_or_is_gone() {
    let (asleep, ball, force_n) = pressed_asleep(Method::XpbdNeoHookean);
    let woken_by = |tools: &[ToolInput]| {
        let mut simulation = Simulation::new(slab(), asleep.params());
        std::mem::swap(
            &mut simulation,
            &mut pressed_asleep(Method::XpbdNeoHookean).0,
        );
        !simulation.step(tools).asleep
    };
    assert!(!woken_by(&[ball]));
    let away = ToolInput {
        position_m: ball.position_m + 1e-6 * Vec3::Y,
        ..ball
    };
    assert!(woken_by(&[away]));
    let idle = ToolInput {
        action: ToolAction::Idle,
        ..ball
    };
    assert!(woken_by(&[idle]));
    assert!(woken_by(&[]));
    let slippery = ToolInput {
        friction: 0.0,
        ..ball
    };
    assert!(woken_by(&[slippery]));

    // And where it let go, the body comes back.
    let mut simulation = asleep;
    for _ in 0..120 {
        simulation.step(&[]);
    }
    assert!(farthest_from_rest_m(&simulation) < 1e-5);
    assert!(force_n.y > 0.0 && simulation.report().tool_forces_n.is_empty());
}

#[test]
fn body_asleep_wakes_by_a_touch_or_a_grab_and_not_by_a_tool_that_passes() {
    for method in Method::ALL {
        let asleep = || {
            let mut simulation = Simulation::new(slab(), soft(method));
            let far = tool(0.01, Vec3::new(0.04, 0.2, 0.04), ToolAction::Push);
            for _ in 0..=CALM_STEPS {
                simulation.step(&[far]);
            }
            assert!(simulation.report().asleep, "{method:?}");
            simulation
        };
        // Half a millimetre above the surface, across all of it.
        let mut passed = asleep();
        for x in [0.0, 0.03, 0.08] {
            let over = tool(0.01, Vec3::new(x, 0.0405, 0.04), ToolAction::Push);
            // It comes down beside the body.
            let start = ToolInput {
                position_m: Vec3::new(x, 0.0405, 0.2),
                ..over
            };
            passed.step(&[start]);
            assert!(passed.step(&[over]).asleep, "{method:?}: woken from {x} m");
        }
        let mut touched = asleep();
        let through = tool(0.01, Vec3::new(0.04, 0.0395, 0.04), ToolAction::Push);
        assert!(!touched.step(&[through]).asleep, "{method:?}: not touched");
        let mut grabbed = asleep();
        let hand = tool(0.012, Vec3::new(0.04, 0.03, 0.04), ToolAction::Grab);
        assert!(!grabbed.step(&[hand]).asleep, "{method:?}: not grabbed");
    }
}
