//! What a tool does to one body: it pokes, presses, or pulls.

use super::super::held_body::HeldBody;
use super::super::sweep::{Row, finite};
use super::trial::{Measures, Watched, volume_error};
use super::{Cell, Deed};
use crate::geom::bounds;
use crate::sim::{ToolAction, ToolInput, ToolShape};
use glam::{DMat3, DVec3, Vec3};

/// Radius of the tool, and how far its front is pushed in or what it holds is pulled out, as shares of
/// the thickness.
const RADIUS_SHARE: f32 = 0.2;
const WAY_SHARE: f32 = 0.3;
/// Time a tool that leaves stays there, and time to settle after it has left, or while it holds on [s]:
/// what rings at half a metre a second is damped to 2e-5 of it.
const HOLD_S: f64 = 0.33;
const AFTER_S: f64 = 2.0;
const FRICTION: f32 = 0.3;

/// A tool comes to the middle of the top, and does its deed. No gravity.
pub fn touch(cell: &Cell, body: &HeldBody) -> Row<Cell, Measures> {
    let (low, high) = bounds(&body.setup.tets.particles);
    let thickness_m = high.z - low.z;
    let radius_m = RADIUS_SHARE * thickness_m;
    let step_m = cell.tool_speed_m_s as f32 * cell.timestep_s as f32;
    let top = Vec3::new(
        f32::midpoint(low.x, high.x),
        f32::midpoint(low.y, high.y),
        high.z,
    );
    let action = match cell.deed {
        Deed::Poke | Deed::Press => ToolAction::Push,
        Deed::Pull => ToolAction::Grab,
    };
    let (from_z, to_z) = match cell.deed {
        Deed::Poke | Deed::Press => (
            high.z + 1.5 * radius_m,
            high.z - WAY_SHARE * thickness_m + radius_m,
        ),
        Deed::Pull => (high.z, high.z + WAY_SHARE * thickness_m),
    };
    let mut watched = Watched::new(cell, body, Vec3::ZERO, cell.damped_per_s());
    let (mut penetration_m, mut force_n) = (0.0_f32, 0.0_f32);
    let mut go = |watched: &mut Watched, way_m: f32| {
        let towards = (to_z - from_z).signum();
        watched.step(&[ToolInput {
            shape: ToolShape::Sphere { radius_m },
            position_m: top.with_z(from_z + towards * way_m),
            action,
            friction: FRICTION,
        }]);
        let report = watched.simulation.report();
        penetration_m = penetration_m.max(report.penetration_max_m);
        let forces = report.tool_forces_n.iter().map(|force| force.length());
        force_n = forces.fold(force_n, f32::max);
    };
    let way_m = (to_z - from_z).abs();
    let steps = (way_m / step_m).ceil().max(1.0) as u32;
    for step in 0..=steps {
        go(&mut watched, (step_m * step as f32).min(way_m));
    }
    let after = cell.settling_frames(AFTER_S);
    let stays = match cell.deed {
        Deed::Poke => cell.frames(HOLD_S),
        Deed::Press | Deed::Pull => after,
    };
    (0..stays).for_each(|_| go(&mut watched, way_m));
    let tunnelled = action == ToolAction::Push
        && is_inside(
            watched.simulation.particles(),
            &body.setup.tets.tets,
            top.with_z(to_z).as_dvec3(),
        );
    if cell.deed == Deed::Poke {
        for step in 1..=steps {
            go(&mut watched, (way_m - step_m * step as f32).max(0.0));
        }
        watched.steps(after);
    }
    let mut measures = watched.measures(cell, "invariants");
    measures.penetration_share = finite(f64::from(penetration_m / thickness_m));
    measures.tunnelled = Some(tunnelled);
    measures.force_max_n = finite(f64::from(force_n));
    if cell.deed == Deed::Poke {
        let rest = &body.setup.tets.particles;
        measures.volume_error_rel = volume_error(body, watched.simulation.particles(), rest);
    }
    watched.row(cell, measures)
}

/// Whether a place lies in one of the tetrahedra as they are now.
pub fn is_inside(positions: &[Vec3], tets: &[[u32; 4]], place: DVec3) -> bool {
    tets.iter().any(|tet| {
        let [a, b, c, d] = tet.map(|corner| positions[corner as usize].as_dvec3());
        let edges = DMat3::from_cols(b - a, c - a, d - a);
        let weights = edges.inverse() * (place - a);
        weights.min_element() >= 0.0 && weights.element_sum() <= 1.0
    })
}

#[cfg(test)]
mod tests {
    use super::super::trial::tests::{cell, small_beam};
    use super::*;
    use crate::study::contender::Contender;
    use crate::study::held_body::{Hold, beam};
    use crate::study::sweep::State;

    fn touched(deed: Deed) -> Row<Cell, Measures> {
        let cell = Cell {
            method: Contender::Implicit,
            tool_speed_m_s: 0.5,
            deed,
            ..cell()
        };
        // Cells no larger than the tool's radius: on larger ones millimetres a second are left.
        touch(&cell, &HeldBody::new(beam(5), 1000.0, Hold::Foot))
    }

    #[test]
    fn tool_meets_a_force_whatever_it_does_and_a_body_it_holds_is_fine() {
        for deed in [Deed::Poke, Deed::Press, Deed::Pull] {
            let row = touched(deed);
            assert!(row.measures.force_max_n.expect("finite") > 0.0, "{deed:?}");
            assert_eq!(
                row.verdict.state,
                State::Fine,
                "{deed:?}: {}",
                row.verdict.why
            );
        }
    }

    #[test]
    fn place_inside_is_told_from_one_outside() {
        let tets = small_beam(Hold::Foot).setup.tets;
        assert!(is_inside(&tets.particles, &tets.tets, DVec3::splat(0.03)));
        assert!(!is_inside(&tets.particles, &tets.tets, DVec3::splat(0.07)));
    }
}
