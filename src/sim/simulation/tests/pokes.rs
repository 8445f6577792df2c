//! A hundred pokes, from slow to faster than the sound in the tissue: nothing is torn, left inside
//! out, or run through.

use super::*;
use crate::geom::bounds;
use glam::DVec3;

/// Numbers from 0 to 1, evenly spread over the dimensions: Roberts' additive sequence.
struct Spread(u32);

impl Spread {
    fn next<const N: usize>(&mut self) -> [f32; N] {
        // The positive root of x^(N+1) = x + 1.
        let mut root = 1.5_f64;
        for _ in 0..40 {
            root = (1.0 + root).powf(1.0 / (N as f64 + 1.0));
        }
        self.0 += 1;
        std::array::from_fn(|k| {
            (0.5 + f64::from(self.0) * root.powi(-(k as i32 + 1))).fract() as f32
        })
    }
}

fn mix(share: f32, low: f32, high: f32) -> f32 {
    low * (high / low).powf(share)
}

/// Distance from `x` to a triangle, in f64 and by another way than the solver's.
fn distance_m(x: DVec3, [a, b, c]: [DVec3; 3]) -> f64 {
    let normal = (b - a).cross(c - a).normalize_or_zero();
    let inside = |p: DVec3, q: DVec3| normal.dot((q - p).cross(x - p)) >= 0.0;
    if normal != DVec3::ZERO && inside(a, b) && inside(b, c) && inside(c, a) {
        return normal.dot(x - a).abs();
    }
    let to_edge = |p: DVec3, q: DVec3| {
        let edge = q - p;
        let share = edge.dot(x - p) / edge.length_squared().max(f64::MIN_POSITIVE);
        (p + share.clamp(0.0, 1.0) * edge).distance(x)
    };
    to_edge(a, b).min(to_edge(b, c)).min(to_edge(c, a))
}

/// How deep a ball is inside the surface [m], by the winding number of its middle and the distance
/// to every triangle.
fn depth_m(simulation: &Simulation, ball: ToolInput) -> f64 {
    let x = ball.position_m.as_dvec3();
    let (mut nearest_m, mut solid_angle) = (f64::INFINITY, 0.0);
    for triangle in &simulation.setup().triangles {
        let corners = triangle.map(|point| simulation.points()[point as usize].as_dvec3());
        nearest_m = nearest_m.min(distance_m(x, corners));
        let [a, b, c] = corners.map(|corner| corner - x);
        let (la, lb, lc) = (a.length(), b.length(), c.length());
        let below = la * lb * lc + a.dot(b) * lc + b.dot(c) * la + c.dot(a) * lb;
        solid_angle += 2.0 * a.dot(b.cross(c)).atan2(below);
    }
    let is_inside = solid_angle > 2.0 * std::f64::consts::PI;
    let side = if is_inside { -1.0 } else { 1.0 };
    f64::from(ball.shape.radius_m()) - side * nearest_m
}

/// A ball of tissue 8 cm wide, held at its foot.
fn organ() -> BodySetup {
    let mut setup = ball(0.04, 0.016);
    setup.fixed = (setup.tets.particles.iter())
        .map(|x| x.y < -0.025)
        .collect();
    setup.damping_per_s = 6.0;
    setup
}

/// What went wrong in a poke, if anything.
fn poke(simulation: &mut Simulation, shares: [f32; 6], action: ToolAction) -> Option<String> {
    let [around, height, tilt, speed, radius, depth] = shares;
    let speed_m_s = mix(speed, 0.05, 10.0);
    let radius_m = mix(radius, 0.003, 0.01);
    // At a place from the middle upwards, up to 40° off the way to the centre.
    let turn = std::f32::consts::TAU * around;
    let up = 0.9 * height;
    let outwards = Vec3::new(
        turn.cos() * (1.0 - up * up).sqrt(),
        up,
        turn.sin() * (1.0 - up * up).sqrt(),
    );
    let place = 0.04 * outwards;
    let aside = outwards.cross(Vec3::Y).normalize();
    let way = (-outwards + 0.8 * (tilt - 0.5) * aside).normalize();
    let thickness_m = 2.0 * 0.04 * -way.dot(outwards);
    let from = place - way * (1.2 * radius_m + 0.002);
    let end_m = from.distance(place) + mix(depth, 0.1, 0.4) * thickness_m - radius_m;
    let step_m = speed_m_s / 60.0;
    let steps = (end_m / step_m).ceil() as u32;
    simulation.reset();
    let mut deepest_m = 0.0_f64;
    for step in 0..=2 * steps + 4 {
        // In, four steps of rest, and out.
        let forth = step_m * step.min(2 * steps + 4 - step) as f32;
        let ball = tool(radius_m, from + way * forth.min(end_m), action);
        simulation.step(&[ball]);
        deepest_m = deepest_m.max(depth_m(simulation, ball));
    }
    for _ in 0..40 {
        simulation.step(&[]);
        if simulation.report().inverted_tets == 0 {
            break;
        }
    }
    let report = simulation.report();
    let share = deepest_m / f64::from(thickness_m);
    let whole = all_finite(simulation) && report.frozen_particles == 0;
    (!whole || report.inverted_tets > 0 || share > 0.01).then(|| {
        format!(
            "{speed_m_s} m/s, {radius_m} m, {shares:?}: {share} of the thickness deep, {} inverted, \
             {} frozen",
            report.inverted_tets, report.frozen_particles
        )
    })
}

#[test]
fn hundred_pokes_of_any_speed_leave_the_body_whole_and_the_tool_outside() {
    let mut simulation = Simulation::new(organ(), soft(Method::XpbdNeoHookean));
    assert!(bounds(simulation.points()).1.y > 0.039);
    let mut spread = Spread(0);
    let failures: Vec<String> = (0..100)
        .filter_map(|_| poke(&mut simulation, spread.next(), ToolAction::Push))
        .collect();
    assert!(failures.is_empty(), "{failures:#?}");
}

#[test]
fn poke_check_sees_a_tool_that_goes_through() {
    let mut simulation = Simulation::new(organ(), soft(Method::XpbdNeoHookean));
    let through = poke(&mut simulation, [0.5; 6], ToolAction::Idle);
    assert!(through.is_some());
}
