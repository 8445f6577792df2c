//! One tool against triangles of free particles, without any tissue: what contact does by itself.

use super::*;
use crate::geom::{Embedding, bounds};
use glam::{DVec3, Quat};
use proptest::prelude::*;

const MASS_KG: f32 = 1e-3;
const FRICTION: f32 = 0.3;

/// A triangle of three particles on its way, and a tool on its own.
#[derive(Clone, Debug)]
struct Meeting {
    start: [Vec3; 3],
    end: [Vec3; 3],
    tool: Motion,
}

/// What came of it.
struct Outcome {
    end: [Vec3; 3],
    touches: Vec<Touch>,
    multiplier: Vec3,
}

impl Meeting {
    /// One substep.
    fn solve(&self, substep_s: f32) -> Outcome {
        let w = 1.0 / MASS_KG;
        let previous: Vec<Vec4> = self.start.iter().map(|x| x.extend(w)).collect();
        let mut places: Vec<Vec4> = self.end.iter().map(|x| x.extend(w)).collect();
        let embedding = Embedding {
            particles: (0..3).map(|k| [k; 4]).collect(),
            weights: vec![[1.0, 0.0, 0.0, 0.0]; 3],
        };
        let surface = Surface {
            triangles: &[[0, 1, 2]],
            points: &self.start,
            bounds: bounds(&self.start),
            embedding: &embedding,
        };
        let tool = self.tool;
        let swept = SweptBox::new(tool.shape, [tool.from_m, tool.to_m], 1.0);
        let mut contacts = Contacts::default();
        contacts.begin_step(tool.shape, tool.from_m, swept, surface);
        contacts.begin_substep(tool.from_m, &previous);
        contacts.solve(tool, &mut places, &previous, substep_s);
        Outcome {
            end: [0, 1, 2].map(|k: usize| places[k].truncate()),
            multiplier: contacts.multiplier(),
            touches: contacts.touches,
        }
    }

    /// The same, turned and shifted.
    fn moved(&self, turn: Quat, shift: Vec3) -> Self {
        let place = |x: Vec3| turn * x + shift;
        let shape = match self.tool.shape {
            ToolShape::Capsule { radius_m, axis_m } => ToolShape::Capsule {
                radius_m,
                axis_m: turn * axis_m,
            },
            sphere => sphere,
        };
        Self {
            start: self.start.map(place),
            end: self.end.map(place),
            tool: Motion {
                shape,
                from_m: place(self.tool.from_m),
                to_m: place(self.tool.to_m),
                ..self.tool
            },
        }
    }

    /// Signed volume that the tip and the corners span at this share of the substep, and whether
    /// the tip is over the triangle then. In f64.
    fn tip_over(&self, end: [Vec3; 3], share: f64) -> (f64, bool) {
        let at = |from: Vec3, to: Vec3| from.as_dvec3().lerp(to.as_dvec3(), share);
        let tip = at(self.tool.from_m, self.tool.to_m);
        let [a, b, c] = [0, 1, 2].map(|k| at(self.start[k], end[k]) - tip);
        let normal = (b - a).cross(c - a);
        let over = |p: DVec3, q: DVec3| normal.dot(p.cross(q)) > 0.0;
        (a.dot(b.cross(c)), over(a, b) && over(b, c) && over(c, a))
    }

    /// Whether the tip goes through the triangle on its way, looked at so many times.
    fn tip_goes_through(&self, end: [Vec3; 3], looks: u32) -> bool {
        let mut last = self.tip_over(end, 0.0);
        (1..=looks).any(|look| {
            let now = self.tip_over(end, f64::from(look) / f64::from(looks));
            let through = last.1 && now.1 && last.0 * now.0 < 0.0;
            last = now;
            through
        })
    }

    fn start_distance_m(&self) -> f32 {
        let corners = self.start.map(|x| x - self.tool.from_m);
        nearest([Vec3::ZERO, self.tool.shape.axis_m()], corners).distance_m()
    }
}

/// Tools of 1 to 10 mm, bare or on a shaft, and triangles of up to 10 cm, each moving by up to 17 cm:
/// 10 m/s for 1/60 s.
fn meetings() -> impl Strategy<Value = Meeting> {
    let metres = |span: f32| prop::array::uniform3(-span..span).prop_map(Vec3::from);
    (
        prop::array::uniform3(metres(0.05)),
        prop::array::uniform3(metres(0.1)),
        metres(0.1),
        metres(0.1),
        0.001_f32..0.01,
        metres(0.03),
        any::<bool>(),
    )
        .prop_map(|(start, way, from_m, to_m, radius_m, axis_m, is_sphere)| {
            let shape = if is_sphere {
                ToolShape::Sphere { radius_m }
            } else {
                ToolShape::Capsule { radius_m, axis_m }
            };
            Meeting {
                start,
                end: [0, 1, 2].map(|k| start[k] + way[k]),
                tool: Motion {
                    shape,
                    friction: FRICTION,
                    from_m,
                    to_m,
                },
            }
        })
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]
    #[test]
    fn gap_falls_by_its_gradient(
        corners in prop::array::uniform3(prop::array::uniform3(-0.05_f32..0.05).prop_map(Vec3::from)),
        axis in prop::array::uniform3(-0.03_f32..0.03).prop_map(Vec3::from),
    ) {
        const STEP_M: f32 = 1e-4;
        let axis = [Vec3::ZERO, axis];
        let distance_m = |corners| nearest(axis, corners).distance_m();
        let near = nearest(axis, corners);
        // Nearer, rounding and the curvature of the distance are no longer small.
        prop_assume!(near.distance_m() > 0.01);
        let normal = near.normal(corners);
        for corner in 0..3 {
            for way in [Vec3::X, Vec3::Y, Vec3::Z] {
                let (mut ahead, mut behind) = (corners, corners);
                ahead[corner] += STEP_M * way;
                behind[corner] -= STEP_M * way;
                // Where edges are all but parallel to the axis the nearest place jumps: no gradient there.
                let jumps = nearest(axis, ahead).weights.distance(nearest(axis, behind).weights);
                if jumps > 0.1 {
                    continue;
                }
                let slope = (distance_m(ahead) - distance_m(behind)) / (2.0 * STEP_M);
                let exact = near.weights[corner] * normal.dot(way);
                prop_assert!((slope - exact).abs() < 0.01, "{slope}, not {exact}");
            }
        }
    }

    #[test]
    fn gap_and_slip_of_a_touch_follow_each_particle_by_their_gradients(meeting in meetings()) {
        const STEP_M: f32 = 1e-3;
        let outcome = meeting.solve(1e-3);
        let places: Vec<Vec4> = outcome.end.iter().map(|x| x.extend(1.0 / MASS_KG)).collect();
        for touch in &outcome.touches {
            for (particle, weight) in touch.handle.carriers() {
                for way in [Vec3::X, Vec3::Y, Vec3::Z] {
                    let moved = |by: f32| {
                        let mut moved = places.clone();
                        moved[particle as usize] += (by * way).extend(0.0);
                        (touch.gap_m(meeting.tool, &moved), touch.slip_m(meeting.tool, &moved))
                    };
                    let (ahead, behind) = (moved(STEP_M), moved(-STEP_M));
                    let gap = (ahead.0 - behind.0) / (2.0 * STEP_M);
                    let slip = (ahead.1 - behind.1) / (2.0 * STEP_M);
                    let along = touch.normal.dot(way);
                    // Places of up to 0.3 m are rounded to 3e-8, over a step of 2e-3.
                    prop_assert!((gap - weight * along).abs() < 1e-3, "{gap}");
                    let expected = weight * (way - along * touch.normal);
                    prop_assert!(slip.distance(expected) < 1e-3, "{slip}, not {expected}");
                }
            }
        }
    }

    #[test]
    fn no_tool_of_any_speed_changes_sides_of_a_face_too_wide_to_be_passed(meeting in meetings()) {
        // Ten times as wide, as far beyond every way.
        let wide = Meeting {
            start: [
                Vec3::new(-1.0, meeting.start[0].y, -0.6),
                Vec3::new(1.0, meeting.start[1].y, -0.6),
                Vec3::new(0.0, meeting.start[2].y, 1.2),
            ],
            end: [0, 1, 2].map(|k| meeting.end[k] - meeting.start[k]),
            ..meeting
        };
        let wide = Meeting {
            end: [0, 1, 2].map(|k| wide.start[k] + wide.end[k]),
            ..wide
        };
        prop_assume!(wide.start_distance_m() > 1.05 * wide.tool.shape.radius_m());
        let outcome = wide.solve(1.0 / 60.0);
        let (before, after) = (wide.tip_over(wide.start, 0.0), wide.tip_over(outcome.end, 1.0));
        prop_assert!(before.1 && after.1, "the tip stays over the face");
        prop_assert!(before.0 * after.0 > 0.0, "it went through");
    }

    #[test]
    fn no_tool_of_any_speed_ends_in_a_triangle_of_any_speed(meeting in meetings()) {
        prop_assume!(meeting.start_distance_m() > 1.05 * meeting.tool.shape.radius_m());
        let outcome = meeting.solve(1.0 / 60.0);
        prop_assert!(outcome.end.iter().all(|x| x.is_finite()));
        let radius_m = meeting.tool.shape.radius_m();
        let corners = outcome.end.map(|x| x - meeting.tool.to_m);
        let left_m = nearest([Vec3::ZERO, meeting.tool.shape.axis_m()], corners).distance_m();
        // A triangle dips in by half a per cent; the rest is where sweeps and looks stop.
        prop_assert!(left_m > 0.97 * radius_m, "{left_m} m of {radius_m} m");
    }

    #[test]
    fn contact_pushes_within_the_cone_of_friction_and_never_pulls(meeting in meetings()) {
        prop_assume!(meeting.start_distance_m() > meeting.tool.shape.radius_m());
        let outcome = meeting.solve(1.0 / 60.0);
        for touch in &outcome.touches {
            let pushed = touch.multiplier.dot(touch.normal);
            let held = (touch.multiplier - pushed * touch.normal).length();
            let rounding = 1e-5 * touch.multiplier.length();
            prop_assert!(pushed >= -rounding, "{touch:?}");
            prop_assert!(held <= FRICTION * pushed + rounding, "{touch:?}");
        }
    }

    #[test]
    fn momentum_that_the_particles_are_given_is_that_of_the_multipliers(meeting in meetings()) {
        prop_assume!(meeting.start_distance_m() > meeting.tool.shape.radius_m());
        let outcome = meeting.solve(1.0 / 60.0);
        let given: Vec3 = (0..3)
            .map(|k| MASS_KG * (outcome.end[k] - meeting.end[k]))
            .sum();
        // Rounding of places of 0.2 m, in as many as hundreds of pieces.
        let off = (given - outcome.multiplier).length();
        prop_assert!(off < 1e-4 * given.length() + 1e-5 * MASS_KG, "{given} {}", outcome.multiplier);
    }

    #[test]
    fn response_moves_with_the_scene(
        meeting in meetings(),
        axis in prop::array::uniform3(-1.0_f32..1.0),
        shift in prop::array::uniform3(-0.1_f32..0.1),
    ) {
        prop_assume!(Vec3::from(axis).length() > 0.1);
        // Slow ones: a fast one bounces about between the pieces, and its way is chaotic.
        let slow = Meeting {
            end: [0, 1, 2].map(|k| meeting.start[k].lerp(meeting.end[k], 0.02)),
            tool: Motion {
                to_m: meeting.tool.from_m.lerp(meeting.tool.to_m, 0.02),
                ..meeting.tool
            },
            ..meeting
        };
        prop_assume!(slow.start_distance_m() > slow.tool.shape.radius_m());
        let turn = Quat::from_scaled_axis(Vec3::from(axis));
        let (here, there) = (slow.solve(1e-3), slow.moved(turn, Vec3::from(shift)).solve(1e-3));
        for k in 0..3 {
            let expected = turn * here.end[k] + Vec3::from(shift);
            // Sweeps stop at a thousandth of what they move, some millimetres.
            prop_assert!(expected.distance(there.end[k]) < 3e-5, "{expected} {}", there.end[k]);
        }
    }
}

#[test]
fn tip_that_meets_a_face_goes_through_it_unless_it_is_held() {
    let meeting = Meeting {
        start: [Vec3::ZERO, 0.1 * Vec3::Z, 0.1 * Vec3::X],
        end: [Vec3::ZERO, 0.1 * Vec3::Z, 0.1 * Vec3::X],
        tool: Motion {
            shape: ToolShape::Sphere { radius_m: 0.003 },
            friction: 0.0,
            from_m: Vec3::new(0.03, 0.1, 0.03),
            to_m: Vec3::new(0.03, -0.07, 0.03),
        },
    };
    assert!(meeting.tip_goes_through(meeting.end, 1000));
    let outcome = meeting.solve(1.0 / 60.0);
    assert!(!meeting.tip_goes_through(outcome.end, 1000));
    // All of it is in front of the ball, which came 17 cm in a substep.
    assert!(outcome.end.iter().all(|x| x.y < -0.05), "{:?}", outcome.end);
    assert!(outcome.multiplier.y < 0.0);
}

#[test]
fn guess_of_the_last_substep_is_pushed_before_anything_answers() {
    let embedding = Embedding {
        particles: (0..3).map(|k| [k; 4]).collect(),
        weights: vec![[1.0, 0.0, 0.0, 0.0]; 3],
    };
    let points = [Vec3::ZERO, 0.01 * Vec3::Z, 0.01 * Vec3::X];
    let surface = Surface {
        triangles: &[[0, 1, 2]],
        points: &points,
        bounds: bounds(&points),
        embedding: &embedding,
    };
    let above = Vec3::new(0.003, 0.0199, 0.003);
    let tool = Motion {
        shape: ToolShape::Sphere { radius_m: 0.02 },
        friction: 0.0,
        from_m: above,
        to_m: above,
    };
    let still: Vec<Vec4> = points.iter().map(|x| x.extend(1.0 / MASS_KG)).collect();
    // A load presses the triangle against the tool by 10 µm each substep.
    let loaded: Vec<Vec4> = still.iter().map(|x| *x + Vec4::Y * 1e-5).collect();
    let mut contacts = Contacts::default();
    let swept = SweptBox::new(tool.shape, [above; 2], 0.01);
    contacts.begin_step(tool.shape, above, swept, surface);
    let mut previous = still;
    for _ in 0..30 {
        contacts.begin_substep(above, &previous);
        let mut places = loaded.clone();
        contacts.press_on(tool, 1.0, &mut places);
        contacts.solve(tool, &mut places, &previous, 1e-3);
        previous = places;
    }
    // In balance with the load: what is pressed on beforehand leaves nothing to be done.
    let load = 3.0 * 1e-5 * MASS_KG;
    contacts.begin_substep(above, &previous);
    let mut places = loaded;
    contacts.press_on(tool, 1.0, &mut places);
    assert!(
        (contacts.multiplier().y / -load - 1.0).abs() < 0.02,
        "{}",
        contacts.multiplier()
    );
    let moved_m = contacts.solve(tool, &mut places, &previous, 1e-3);
    assert!(moved_m < 1e-7, "{moved_m} m");
}
