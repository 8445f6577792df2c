//! What the simulation remembers of its tools from one step to the next.

use super::{
    ToolAction, ToolInput, ToolShape,
    contact::{self, ActiveContact, Contacts, Motion, Surface, SweptBox},
    grab::{ActiveHold, Grab, Tissue},
    particles::Particles,
};
use glam::Vec3;
use std::mem::discriminant;

/// Tools farther from the body than this many body sizes do nothing: single precision ends there.
const FAR_BODY_SIZES: f32 = 1e4;
/// Times all tools are solved in turn where more than one touches or holds: what one pushes, the
/// other may be in the way of.
const TURNS: usize = 3;
/// The last turn is the one whose contacts move nothing by more than this share of the most so far.
const SETTLED_SHARE: f32 = 0.01;
/// Room round a tool for what its first push sets in motion, over its radius.
const ROOM_RADII: f32 = 0.1;
/// Tissue that is caught between two tools needs so much room, in edges of its tetrahedra: with less the
/// second of the tools yields, until there is [`RETURN_EDGES`] again.
const CAUGHT_EDGES: f32 = 0.25;
const RETURN_EDGES: f32 = 0.35;
/// Tools catch tissue between them if both push within this cosine towards the other.
const CAUGHT_COSINE: f32 = 0.7;

/// One tool.
#[derive(Clone, Debug)]
struct Tool {
    input: ToolInput,
    /// Where it was when the step started, and where it will be when it ends [m].
    from_m: Vec3,
    to_m: Vec3,
    /// How far what touches the body is from there [m]: a tool found inside the body, or with a part of
    /// its shaft, is taken to be outside the nearest part of its surface, and comes in from there.
    behind_m: Vec3,
    /// Whether it is known to be outside, or else where outside it is taken to be.
    side_known: bool,
    /// Whether it is as it was in the last step.
    still: bool,
    /// Whether it has changed since it touched or held the body in the last step.
    let_go: bool,
    /// Whether it closes in this step.
    closes: bool,
    /// Whether it leaves its place to another tool, as if it were idle: there is no room for the
    /// tissue between the two.
    yields: bool,
    contacts: Contacts,
    grab: Option<Grab>,
    /// Sum over the substeps of the force on the tool [N].
    force_sum_n: Vec3,
}

/// All tools of a body.
#[derive(Clone, Debug, Default)]
pub struct Tools {
    tools: Vec<Tool>,
    /// Whether a tool that touched or held the body is no longer there.
    gone: bool,
    /// Length of the last substep [s], 0 before the first.
    last_substep_s: f32,
}

/// The body as the tools meet it at the start of a step.
#[derive(Clone, Copy)]
pub struct Met<'a> {
    pub surface: Surface<'a>,
    pub particles: &'a Particles,
    pub tissue: Tissue,
    /// Longest extent at rest [m].
    pub size_m: f32,
    /// How far a particle may get in a step [m].
    pub way_m: f32,
    /// How far a tool found inside comes in from outside in a step [m].
    pub enter_m: f32,
    /// Nothing has moved since the last step.
    pub asleep: bool,
}

impl Tools {
    /// Takes over the inputs of a step, and finds the triangles each tool may touch in it.
    pub fn begin_step(&mut self, inputs: &[ToolInput], mut body: Met) {
        let left_out = self.tools.get(inputs.len()..).unwrap_or_default();
        self.gone = left_out.iter().any(Tool::acts);
        self.tools.truncate(inputs.len());
        let mut pushed = Vec::with_capacity(inputs.len());
        for (index, &input) in inputs.iter().enumerate() {
            let input = sane(input, body);
            if index == self.tools.len() {
                self.tools.push(Tool {
                    input: ToolInput {
                        action: ToolAction::Idle,
                        ..input
                    },
                    from_m: input.position_m,
                    to_m: input.position_m,
                    behind_m: Vec3::ZERO,
                    side_known: false,
                    still: false,
                    let_go: false,
                    closes: false,
                    yields: false,
                    contacts: Contacts::default(),
                    grab: None,
                    force_sum_n: Vec3::ZERO,
                });
            }
            pushed.push(self.tools[index].contacts.multiplier());
            self.tools[index].take_over(input);
        }
        self.find_room(&pushed, body.tissue.edge_m);
        // What a tool pushes or pulls may go as far as the tool.
        let fastest_m = self.tools.iter().map(Tool::way_m).fold(0.0, f32::max);
        body.way_m += 2.0 * fastest_m;
        for tool in &mut self.tools {
            if !(tool.still && body.asleep) {
                tool.begin_step(body);
            }
        }
    }

    /// Finds the tools that yield to another, given what each `pushed` the body with in the last substep.
    ///
    /// Rigid tools give way to nothing. Two that press from both sides until nothing is left between
    /// them ask for what no tissue can do: it would be torn, or the forces grow for ever.
    fn find_room(&mut self, pushed: &[Vec3], edge_m: f32) {
        for second in 0..self.tools.len() {
            let mut yields = false;
            for first in 0..second {
                let (one, other) = (&self.tools[first], &self.tools[second]);
                if one.yields || !(one.pushes() && other.pushes()) {
                    continue;
                }
                let [one, two] = [one, other].map(|tool| (tool.input.shape, tool.input.position_m));
                let (apart_m, towards) = contact::between(one, two);
                let room_m = apart_m - one.0.radius_m() - two.0.radius_m();
                yields |= if other.yields {
                    room_m < RETURN_EDGES * edge_m
                } else {
                    let along = |pushed: Vec3| towards.dot(pushed.normalize_or_zero());
                    let caught = along(pushed[first]) > CAUGHT_COSINE
                        && along(pushed[second]) < -CAUGHT_COSINE;
                    caught && room_m < CAUGHT_EDGES * edge_m
                };
            }
            let tool = &mut self.tools[second];
            tool.let_go |= yields != tool.yields;
            tool.yields = yields;
        }
    }

    /// Number of tools that yield to another.
    pub fn yielding(&self) -> usize {
        self.tools.iter().filter(|tool| tool.yields).count()
    }

    /// How far a tool that may touch the body goes between these shares of the step, at most, in its
    /// radii.
    pub fn way_radii(&self, (from, to): (f32, f32)) -> f32 {
        let near = self.tools.iter().filter(|tool| tool.contacts.is_near());
        near.map(|tool| (to - from) * tool.way_m() / tool.input.shape.radius_m())
            .fold(0.0, f32::max)
    }

    /// Whether a tool that has changed touches or holds the body, or did so before, or comes to it on
    /// its way through this step.
    pub fn stir(&mut self, particles: &Particles, asleep: bool) -> bool {
        self.gone
            || self.tools.iter_mut().any(|tool| {
                let motion = tool.motion(0.0, 1.0);
                let moves = |contacts: &mut Contacts| {
                    // Awake, being near is enough and costs no look.
                    contacts.is_near()
                        && (!asleep || contacts.would_touch(motion, &particles.places))
                };
                tool.let_go || (!tool.still && (tool.grab.is_some() || moves(&mut tool.contacts)))
            })
    }

    /// Forgets on which side of the surface each tool is: the body was put elsewhere.
    pub fn forget_sides(&mut self) {
        for tool in &mut self.tools {
            tool.side_known = false;
        }
    }

    /// Starts a substep, once the particles have been moved by their velocities.
    pub fn begin_substep(&mut self, particles: &Particles, from: f32) {
        for tool in &mut self.tools {
            let from_m = tool.at(from);
            tool.contacts.begin_substep(from_m, &particles.previous);
        }
    }

    /// h² over that of the last substep, which this one is now.
    fn scale(&mut self, substep_s: f32) -> f32 {
        let last_s = std::mem::replace(&mut self.last_substep_s, substep_s);
        if last_s > 0.0 {
            (substep_s / last_s).powi(2)
        } else {
            1.0
        }
    }

    /// Lets tools that pressed or pulled in the last substep go on, before anything else answers.
    pub fn press_on(&mut self, particles: &mut Particles, from: f32, to: f32, substep_s: f32) {
        let scale = self.scale(substep_s);
        for tool in &mut self.tools {
            let motion = tool.motion(from, to);
            (tool.contacts).press_on(motion, scale, &mut particles.places);
            if let Some(grab) = &mut tool.grab {
                grab.pull_on(scale, &mut particles.places);
            }
        }
    }

    /// Pushes and pulls the particles once. The substep lies between the shares `from` and `to` of
    /// the step.
    pub fn solve(&mut self, particles: &mut Particles, from: f32, to: f32, substep_s: f32) {
        let (places, previous) = (&mut particles.places, &particles.previous);
        let busy = |tool: &&Tool| tool.grab.is_some() || tool.contacts.is_near();
        let turns = match self.tools.iter().filter(busy).count() {
            0 | 1 => 1,
            _ => TURNS,
        };
        let mut most_m = 0.0_f32;
        for _ in 0..turns {
            for tool in &mut self.tools {
                let position_m = tool.at(to);
                if let Some(grab) = &mut tool.grab {
                    grab.solve(position_m, places, substep_s);
                }
            }
            // Contacts last: they give way to nothing.
            let mut moved_m = 0.0_f32;
            for tool in &mut self.tools {
                let motion = tool.motion(from, to);
                let contacts = &mut tool.contacts;
                moved_m = moved_m.max(contacts.solve(motion, places, previous, substep_s));
            }
            most_m = most_m.max(moved_m);
            if moved_m <= SETTLED_SHARE * most_m {
                break;
            }
        }
    }

    /// Whether a tool holds the body or may touch it in this step.
    pub fn are_busy(&self) -> bool {
        (self.tools.iter()).any(|tool| tool.grab.is_some() || tool.contacts.is_near())
    }

    /// Has what pressed in the last substep press as it did: for solvers that find all multipliers
    /// at once.
    pub fn resume(&mut self, substep_s: f32) {
        let scale = self.scale(substep_s);
        for tool in &mut self.tools {
            tool.contacts.resume(scale);
        }
    }

    /// Looks what touches each tool if the particles end the substep, which lies between these
    /// shares of the step, where they are now. For solvers that find all multipliers at once.
    pub fn look(
        &mut self,
        particles: &Particles,
        (from, to): (f32, f32),
        substep_s: f32,
    ) -> Vec<ActiveContact> {
        let mut found = Vec::new();
        for tool in &mut self.tools {
            let motion = tool.motion(from, to);
            let places = &particles.places;
            tool.contacts.look(motion, places, substep_s, 0.0);
            found.extend(tool.contacts.active(motion, places));
        }
        found
    }

    /// Places that tools hold on to at this share of the step.
    pub fn holds(&self, to: f32) -> impl Iterator<Item = ActiveHold> {
        self.tools.iter().flat_map(move |tool| {
            let grab = tool.grab.iter();
            grab.flat_map(move |grab| grab.active(tool.at(to)))
        })
    }

    /// Takes over the multipliers, force on the body times h² [kg m], of the contacts that the last
    /// look listed.
    ///
    /// # Panics
    ///
    /// If there is not one for each.
    pub fn set_multipliers(&mut self, mut multipliers: &[Vec3]) {
        for tool in &mut self.tools {
            let (own, rest) = multipliers.split_at(tool.contacts.len());
            tool.contacts.set_multipliers(own);
            multipliers = rest;
        }
        assert!(multipliers.is_empty(), "one multiplier a contact");
    }

    /// Takes over the multipliers, force on the body times h² [kg m], of the places held.
    ///
    /// # Panics
    ///
    /// If there is not one for each.
    pub fn set_hold_multipliers(&mut self, mut multipliers: &[Vec3]) {
        for grab in self.tools.iter_mut().filter_map(|tool| tool.grab.as_mut()) {
            let (own, rest) = multipliers.split_at(grab.len());
            grab.set_multipliers(own);
            multipliers = rest;
        }
        assert!(multipliers.is_empty(), "one multiplier a place held");
    }

    /// Adds up the forces of a substep.
    pub fn end_substep(&mut self, substep_s: f32) {
        let per_h2 = 1.0 / (substep_s * substep_s);
        for tool in &mut self.tools {
            let held = tool.grab.as_ref().map_or(Vec3::ZERO, Grab::multiplier);
            tool.force_sum_n -= per_h2 * (tool.contacts.multiplier() + held);
        }
    }

    /// The particles that carry what a tool touches or holds, in order.
    pub fn carriers(&self) -> Vec<u32> {
        let mut carriers: Vec<u32> = (self.tools.iter())
            .flat_map(|tool| {
                let held = tool.grab.iter().flat_map(Grab::carriers);
                tool.contacts.carriers().chain(held)
            })
            .collect();
        carriers.sort_unstable();
        carriers.dedup();
        carriers
    }

    /// Mean force on each tool over a step of so many substeps [N].
    pub fn forces_n(&self, substeps: u32) -> Vec<Vec3> {
        let share = 1.0 / substeps as f32;
        self.tools
            .iter()
            .map(|tool| share * tool.force_sum_n)
            .collect()
    }

    /// Deepest that a pushing tool is inside the surface at the end of a step [m]; 0 if none is.
    pub fn penetration_max_m(&self, surface: Surface, particles: &Particles) -> f32 {
        self.tools
            .iter()
            .map(|tool| tool.penetration_m(surface, particles))
            .fold(0.0, f32::max)
    }
}

impl Tool {
    fn take_over(&mut self, input: ToolInput) {
        let before = self.input;
        let goes_on = before.action == input.action && input.action != ToolAction::Idle;
        // A tool that was lifted touches nothing on its way to where it comes down again.
        self.from_m = if goes_on {
            before.position_m
        } else {
            input.position_m
        };
        self.still = before == input;
        self.let_go = !self.still && self.acts();
        self.closes = !goes_on && input.action == ToolAction::Grab;
        let same_kind = discriminant(&before.shape) == discriminant(&input.shape);
        self.to_m = input.position_m;
        if !(goes_on && same_kind) {
            self.contacts.clear();
        }
        if !goes_on {
            self.behind_m = Vec3::ZERO;
            self.side_known = false;
        }
        if !goes_on {
            self.grab = None;
        }
        self.input = input;
        self.force_sum_n = Vec3::ZERO;
    }

    fn begin_step(&mut self, body: Met) {
        let shape = self.input.shape;
        let places = &body.particles.places;
        if self.yields {
            self.contacts.clear();
            (self.behind_m, self.side_known) = (Vec3::ZERO, false);
            return;
        }
        if self.pushes() {
            self.find_side(body);
            let ends = [self.from_m, self.to_m];
            let room_m = ROOM_RADII * shape.radius_m() + body.way_m;
            let swept = SweptBox::new(shape, ends, room_m);
            (self.contacts).begin_step(shape, self.from_m, swept, body.surface);
        }
        if self.closes {
            self.grab = Grab::close(
                self.input.position_m,
                shape.radius_m(),
                body.surface.points,
                body.surface.embedding,
                places,
                body.tissue,
            );
        }
    }

    /// Where outside the body it starts the step, and where it ends it.
    fn find_side(&mut self, body: Met) {
        let radius_m = self.input.shape.radius_m();
        let is_behind = self.behind_m != Vec3::ZERO;
        if self.contacts.lets_go() {
            self.side_known = false;
        }
        if !self.side_known || is_behind {
            let axis = self.axis_at(self.from_m);
            let (low, high) = body.surface.bounds;
            let (points, triangles) = (body.surface.points, body.surface.triangles);
            let inside = axis[0].max(axis[1]).cmpge(low).all()
                && axis[0].min(axis[1]).cmple(high).all()
                && contact::reaches_inside(axis, points, triangles);
            if inside && !is_behind {
                let way = contact::way_out(axis, body.surface, &body.particles.places);
                let way = way.unwrap_or_default();
                self.behind_m = way + radius_m * way.normalize_or_zero();
            } else if !inside && self.behind_m.length() > radius_m {
                self.behind_m = Vec3::ZERO; // It has come out by itself.
            }
            self.side_known = true;
        }
        let behind_m = self.behind_m.length();
        let nearer_m = (behind_m - body.enter_m).max(0.0);
        self.from_m += self.behind_m;
        self.behind_m *= nearer_m / behind_m.max(f32::MIN_POSITIVE);
        self.to_m += self.behind_m;
    }

    fn penetration_m(&self, surface: Surface, particles: &Particles) -> f32 {
        if self.yields || !self.pushes() {
            return 0.0;
        }
        let (shape, at_m) = (self.input.shape, self.input.position_m);
        let reached_m = self.contacts.penetration_m(shape, at_m, surface.points);
        // Distances have no sign: a tool that is in to its axis looks as if it were on its way out.
        let is_deep = reached_m > shape.radius_m() / 2.0;
        let axis = self.axis_at(at_m);
        if (is_deep || self.behind_m != Vec3::ZERO)
            && contact::reaches_inside(axis, surface.points, surface.triangles)
        {
            let way = contact::way_out(axis, surface, &particles.places);
            return shape.radius_m() + way.unwrap_or_default().length();
        }
        reached_m
    }

    /// The ends of its axis when it is at `position_m` [m].
    fn axis_at(&self, position_m: Vec3) -> [Vec3; 2] {
        [position_m, position_m + self.input.shape.axis_m()]
    }

    fn pushes(&self) -> bool {
        self.input.action == ToolAction::Push
    }

    /// Whether it touched or held the body in the last substep.
    fn acts(&self) -> bool {
        self.grab.is_some() || self.contacts.pressed()
    }

    /// Where it is at this share of the step [m].
    fn at(&self, share: f32) -> Vec3 {
        self.from_m.lerp(self.to_m, share)
    }

    fn way_m(&self) -> f32 {
        self.from_m.distance(self.to_m)
    }

    fn motion(&self, from: f32, to: f32) -> Motion {
        Motion {
            shape: self.input.shape,
            friction: self.input.friction,
            from_m: self.at(from),
            to_m: self.at(to),
        }
    }
}

/// The input as it can be used: idle if it is not finite, absurdly far, or has no size.
fn sane(input: ToolInput, body: Met) -> ToolInput {
    let centre = (body.surface.bounds.0 + body.surface.bounds.1) / 2.0;
    let reach = FAR_BODY_SIZES * body.size_m;
    let near = |x: Vec3| x.is_finite() && x.abs().max_element() < reach;
    let radius_m = input.shape.radius_m();
    let usable = near(input.position_m - centre)
        && near(input.shape.axis_m())
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
