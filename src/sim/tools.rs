//! What the simulation remembers of its tools from one step to the next.

use super::{
    ToolAction, ToolInput, ToolShape,
    contact::{self, Contact, Motion},
    grab::{Grab, Tissue},
    particles::{Handle, Particles},
};
use crate::geom::Embedding;
use glam::{Vec3, Vec4};

/// Tools farther from the body than this many body sizes do nothing: single precision ends there.
const FAR_BODY_SIZES: f32 = 1e4;

/// One tool.
#[derive(Clone, Debug)]
struct Tool {
    input: ToolInput,
    /// Where it was when the step started [m].
    from_m: Vec3,
    contacts: Vec<Contact>,
    grab: Option<Grab>,
    /// Sum over the substeps of the force on the tool [N].
    force_sum_n: Vec3,
}

/// All tools of a body.
#[derive(Clone, Debug, Default)]
pub struct Tools {
    tools: Vec<Tool>,
}

/// The body as the tools meet it at the start of a step.
#[derive(Clone, Copy)]
pub struct Met<'a> {
    pub points: &'a [Vec3],
    /// Smallest and largest corner of their box [m].
    pub bounds: (Vec3, Vec3),
    pub embedding: &'a Embedding,
    pub particles: &'a Particles,
    pub tissue: Tissue,
    /// Longest extent at rest [m].
    pub size_m: f32,
    /// How far a particle may get in a step [m].
    pub way_m: f32,
}

impl Tools {
    /// Takes over the inputs of a step, and finds the points each tool may touch in it.
    pub fn begin_step(&mut self, inputs: &[ToolInput], body: Met) {
        self.tools.truncate(inputs.len());
        for (index, &input) in inputs.iter().enumerate() {
            let input = sane(input, body);
            if index == self.tools.len() {
                self.tools.push(Tool {
                    input: ToolInput {
                        action: ToolAction::Idle,
                        ..input
                    },
                    from_m: input.position_m,
                    contacts: Vec::new(),
                    grab: None,
                    force_sum_n: Vec3::ZERO,
                });
            }
            self.tools[index].begin_step(input, body);
        }
    }

    /// Whether a tool holds the body, or would touch it on its way through this step.
    pub fn touches(&self, points: &[Vec3]) -> bool {
        self.tools.iter().any(|tool| {
            let to_m = tool.input.position_m;
            tool.grab.is_some()
                || tool.contacts.iter().any(|contact| {
                    let point = points[contact.point as usize];
                    contact::sweep(tool.input.shape, point - tool.from_m, point - to_m).is_some()
                })
        })
    }

    /// Forgets the multipliers of the last substep.
    pub fn begin_substep(&mut self) {
        for tool in &mut self.tools {
            tool.contacts.iter_mut().for_each(Contact::begin_substep);
            if let Some(grab) = &mut tool.grab {
                grab.begin_substep();
            }
        }
    }

    /// Pushes and pulls the particles once. The substep lies between the shares `from` and `to` of
    /// the step.
    pub fn solve(&mut self, particles: &mut Particles, from: f32, to: f32, substep_s: f32) {
        for tool in &mut self.tools {
            let at = |share: f32| tool.from_m.lerp(tool.input.position_m, share);
            let motion = Motion {
                shape: tool.input.shape,
                friction: tool.input.friction,
                from_m: at(from),
                to_m: at(to),
            };
            let (places, previous) = (&mut particles.places, &particles.previous);
            contact::solve(&mut tool.contacts, motion, places, previous, substep_s);
            if let Some(grab) = &mut tool.grab {
                grab.solve(motion.to_m, places, substep_s);
            }
        }
    }

    /// Adds up the forces of a substep.
    pub fn end_substep(&mut self, substep_s: f32) {
        let per_h2 = 1.0 / (substep_s * substep_s);
        for tool in &mut self.tools {
            let on_body: Vec3 = tool.contacts.iter().map(Contact::multiplier).sum();
            let held = tool.grab.as_ref().map_or(Vec3::ZERO, Grab::multiplier);
            tool.force_sum_n -= per_h2 * (on_body + held);
        }
    }

    /// Mean force on each tool over a step of so many substeps [N].
    pub fn forces_n(&self, substeps: u32) -> Vec<Vec3> {
        let share = 1.0 / substeps as f32;
        self.tools
            .iter()
            .map(|tool| share * tool.force_sum_n)
            .collect()
    }

    /// Deepest of `points` inside a pushing tool at the end of a step [m]; 0 if there is none.
    pub fn penetration_max_m(&self, points: &[Vec3]) -> f32 {
        let mut deepest = 0.0_f32;
        for tool in &self.tools {
            for contact in &tool.contacts {
                let point = points[contact.point as usize];
                let depth = contact::depth_m(tool.input.shape, tool.input.position_m, point);
                deepest = deepest.max(depth);
            }
        }
        deepest
    }
}

impl Tool {
    fn begin_step(&mut self, input: ToolInput, body: Met) {
        let before = self.input;
        let goes_on = before.action == input.action && input.action != ToolAction::Idle;
        // A tool that was lifted touches nothing on its way to where it comes down again.
        self.from_m = if goes_on {
            before.position_m
        } else {
            input.position_m
        };
        self.input = input;
        self.force_sum_n = Vec3::ZERO;
        self.contacts.clear();
        match input.action {
            ToolAction::Idle => self.grab = None,
            ToolAction::Push => {
                self.grab = None;
                self.find_contacts(body);
            }
            ToolAction::Grab => {
                if !goes_on {
                    self.grab = Grab::close(
                        input.position_m,
                        input.shape.radius_m(),
                        body.points,
                        body.embedding,
                        &body.particles.places,
                        body.tissue,
                    );
                }
            }
        }
    }

    /// Lists the points within the box that the tool sweeps, with room for their own way.
    fn find_contacts(&mut self, body: Met) {
        let axis = self.input.shape.axis();
        let radius = self.input.shape.radius_m();
        let ends = [self.from_m, self.input.position_m];
        let room = Vec3::splat(1.5 * radius + body.way_m);
        let low = ends[0].min(ends[1]) + axis.min(Vec3::ZERO) - room;
        let high = ends[0].max(ends[1]) + axis.max(Vec3::ZERO) + room;
        if low.cmpgt(body.bounds.1).any() || high.cmplt(body.bounds.0).any() {
            return;
        }
        let places: &[Vec4] = &body.particles.places;
        for (index, point) in body.points.iter().enumerate() {
            if point.cmpge(low).all() && point.cmple(high).all() {
                let handle = Handle::of_point(body.embedding, index, places);
                self.contacts.push(Contact::new(index as u32, handle));
            }
        }
    }
}

/// The input as it can be used: idle if it is not finite, absurdly far, or has no size.
fn sane(input: ToolInput, body: Met) -> ToolInput {
    let centre = (body.bounds.0 + body.bounds.1) / 2.0;
    let reach = FAR_BODY_SIZES * body.size_m;
    let near = |x: Vec3| x.is_finite() && x.abs().max_element() < reach;
    let radius_m = input.shape.radius_m();
    let usable = near(input.position_m - centre)
        && near(input.shape.axis())
        && radius_m > 0.0
        && radius_m < reach
        && input.friction >= 0.0
        && input.friction.is_finite();
    if usable {
        return input;
    }
    ToolInput {
        shape: ToolShape::Sphere {
            radius_m: body.size_m,
        },
        position_m: centre,
        action: ToolAction::Idle,
        friction: 0.0,
    }
}
