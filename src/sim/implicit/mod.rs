//! The implicit method: stable neo-Hookean tetrahedra, each substep solved as a whole.
//!
//! A substep of length h ends where
//!
//! u₁ = 4/3 u₀ − 1/3 u₋₁ + τ v₁,  v₁ = 4/3 v₀ − 1/3 v₋₁ + τ a(u₁),  τ = 2/3 h:
//!
//! the backward differentiation formula of second order (BDF2), which is L-stable: there is no limit
//! on the substep, what is stiff comes to rest, and little is lost of a slow swing. The end of the
//! substep is the minimum of an energy, found by Newton's method. Where there is no past, because the
//! body was put where it is, one with the acceleration that the forces give is made up.
//!
//! A formula that looks two substeps back takes the blow of a tool for a motion that goes on: what was
//! stopped at speed v it has rebound at v/2, and a light body on a tool hops for ever. So nodes that a
//! tool is in the way of go by the backward Euler formula, u₁ = u₀ + h v₁, v₁ = v₀ + h a(u₁), and
//! leave it with the past of a steady motion. A body of which nothing is held goes so as a whole while a
//! tool carries it: its weight would rebound else.
//!
//! Source: Hairer, Wanner, "Solving Ordinary Differential Equations II", 2nd ed., 1996, ch. V.1.

#[cfg(target_arch = "x86_64")]
mod avx2;
mod band;
mod cg;
mod element;
mod elements;
mod galerkin;
mod grip;
mod hold;
mod lattice;
mod matrix;
mod multigrid;
mod newton;
mod order;
mod restore;
mod strips;
mod sweep;
mod wide;

use super::{Lame, particles::Particles, tools::Tools};
use crate::geom::TetMesh;
use element::{Element, PAIRS};
use elements::Elements;
use glam::{DVec3, DVec4, Vec3, Vec4};
use grip::Span;
use matrix::BlockMatrix;
use multigrid::Multigrid;
use newton::{Goal, Newton, State};
use order::Order;
use restore::Wreck;

/// The implicit share of a substep, τ/h.
const IMPLICIT_SHARE: f64 = 2.0 / 3.0;
/// Rounds of one Newton step a substep in which tools act, at most: so many, and as many for each
/// iteration. A body that a tool leaves in one long substep needs the most.
const ROUNDS: u32 = 4;
/// Rounds that begin with a look at what the tools do, for each iteration. More than one Newton step
/// between two looks would go to where the tools' tangents no longer hold, and fro.
const LOOKS: u32 = 2;
/// What goes farther than this share of a tool's radius against it in a substep has the tool come in
/// pieces of that length, one a round: at once it would meet the tissue from too many sides.
const PIECE_RADII: f32 = 0.5;
/// Such pieces of a substep at most.
const PIECES_MAX: u32 = 12;
/// Looks that are added while a place is deeper in a tool than [`DEEP_RADII`] of its radius, at most.
const MORE_LOOKS: u32 = 12;
const DEEP_RADII: f64 = 0.01;
/// Forces beyond so many times the weight come from no motion that a past could be made up for.
const SMOOTH_WEIGHTS: f64 = 2.0;

/// What a substep is taken with.
#[derive(Clone, Copy, Debug)]
pub struct Step {
    pub gravity_m_s2: Vec3,
    /// Force against velocity, over mass [1/s].
    pub damping_per_s: f32,
    pub lame: Lame,
    /// Length [s].
    pub substep_s: f32,
    /// Newton steps, at most; where tools act, a measure of them.
    pub iterations: u32,
    /// Shares of the time step at which it starts and ends.
    pub shares: (f32, f32),
}

/// A body whose substeps are solved as a whole.
#[derive(Clone, Debug)]
pub struct Implicit {
    order: Order,
    /// Places of the nodes at rest [m].
    rest: Vec<DVec3>,
    masses_kg: Vec<f64>,
    newton: Newton,
    goal: Goal,
    /// Displacement of each node, and 0 for one that no particle owns [m].
    now: Vec<DVec4>,
    /// The same a substep ago [m].
    before: Vec<DVec4>,
    /// Velocity of each free node a substep ago [m/s].
    velocities_before: Vec<DVec4>,
    /// Free nodes that a tool is in the way of in this substep.
    touched: Vec<bool>,
    /// The substep the past was made with [s]; `None` if there is none.
    past_substep_s: Option<f32>,
    /// Where each particle was put last, to see whether somebody else has moved it.
    published: Vec<Vec4>,
    /// Displacements that are worked on [m].
    next: Vec<DVec4>,
    /// Displacements when the body was last sound [m].
    sound: Vec<DVec4>,
    /// Elastic energy at `now`; `None` if that was not the end of a substep [J].
    elastic_j: Option<f64>,
    /// Residual over load, that of the tools included, after the last substep.
    residual_share: f64,
    /// Whether the body was wrecked in the last substep and led back.
    restoring: bool,
}

impl Implicit {
    /// Tetrahedra `sound` of `mesh`, of which `fill` is the share that is tissue, with particles
    /// as in `places` [m, 1/kg].
    pub fn new(mesh: &TetMesh, sound: &[u32], fill: &[f32], places: &[Vec4]) -> Self {
        let particles: Vec<DVec3> = mesh.particles.iter().map(|x| x.as_dvec3()).collect();
        let order = Order::new(&particles, |i| places[i].w > 0.0);
        let in_order = |i: &u32| particles[*i as usize];
        let rest: Vec<DVec3> = order.particle.iter().map(in_order).collect();
        let mut elements: Vec<Element> = Vec::with_capacity(sound.len());
        for &tet in sound {
            let mut nodes = mesh.tets[tet as usize].map(|i| order.node[i as usize]);
            nodes.sort_unstable();
            let fill = f64::from(fill[tet as usize]);
            elements.push(Element { nodes, fill });
        }
        elements.sort_by_key(|element| order.rank[element.nodes[0] as usize]);
        let volume_m3: f64 = elements.iter().map(|e| e.shape(&rest).1 / e.fill).sum();
        let pairs = elements
            .iter()
            .flat_map(|e| PAIRS.map(|(a, b)| (e.nodes[a], e.nodes[b])))
            .filter(|&(_, b)| (b as usize) < order.free);
        let matrix = BlockMatrix::new(order.free, pairs);
        let spacing_m = (volume_m3 / order.free.max(1) as f64).cbrt();
        let multigrid = Multigrid::new(&matrix, &rest[..order.free], spacing_m);
        let elements = Elements::new(&elements, &rest, &matrix);
        let mass_kg = |&i: &u32| 1.0 / f64::from(places[i as usize].w);
        let count = rest.len();
        Self {
            masses_kg: order.particle[..order.free].iter().map(mass_kg).collect(),
            newton: Newton::new(elements, matrix, multigrid, count),
            goal: Goal {
                free: vec![DVec4::ZERO; order.free],
                ..Goal::default()
            },
            now: vec![DVec4::ZERO; count + 1],
            before: vec![DVec4::ZERO; count + 1],
            velocities_before: vec![DVec4::ZERO; order.free],
            touched: vec![false; order.free],
            past_substep_s: None,
            published: mesh.particles.iter().map(|x| x.extend(0.0)).collect(),
            next: vec![DVec4::ZERO; count + 1],
            sound: vec![DVec4::ZERO; count + 1],
            elastic_j: None,
            residual_share: 0.0,
            restoring: false,
            rest,
            order,
        }
    }

    /// What is left of the forces after the last substep, over the forces that move the body.
    pub fn residual_share(&self) -> f32 {
        self.residual_share as f32
    }

    /// Whether the body was wrecked in the last substep and led back.
    pub fn is_restoring(&self) -> bool {
        self.restoring
    }

    /// Forgets the past: the body was put where it is.
    pub fn forget(&mut self) {
        self.past_substep_s = None;
    }

    /// Takes over how much of each particle is muscle.
    pub fn set_activity(&mut self, activity: &[f32]) {
        let in_order = |&i: &u32| activity[i as usize];
        let activity: Vec<f32> = self.order.particle.iter().map(in_order).collect();
        self.newton.elements.set_activity(&activity);
    }

    /// Has muscle shorten, as a share of its length.
    pub fn shorten(&mut self, shortening: f32) {
        let old = std::mem::replace(&mut self.newton.elements.shortening, shortening);
        if old != shortening {
            // The energy of the same place is another.
            self.elastic_j = None;
        }
    }

    /// Starts a time step.
    pub fn begin_step(&mut self) {
        self.newton.begin_step();
    }

    /// Advances the particles by a substep, under `tools`.
    pub fn substep(&mut self, particles: &mut Particles, tools: &mut Tools, step: Step) {
        self.take_over(particles);
        particles.previous.copy_from_slice(&particles.places);
        let h = f64::from(step.substep_s);
        let tau = IMPLICIT_SHARE * h;
        let gravity = step.gravity_m_s2.as_dvec3().extend(0.0);
        self.goal.grip.clear();
        self.touched.fill(false);
        if self.past_substep_s != Some(step.substep_s) {
            self.make_up_past(particles, step);
        }
        // v = carried + tau (force / mass - damping v), so damping adds to inertia.
        let damped = 1.0 + f64::from(step.damping_per_s) * tau;
        let inertia = self
            .masses_kg
            .iter()
            .map(|&mass| mass * damped / (tau * tau));
        self.goal.inertia.clear();
        self.goal.inertia.extend(inertia);
        for (node, &particle) in self.order.particle[..self.order.free].iter().enumerate() {
            let velocity = particles.velocities[particle as usize]
                .as_dvec3()
                .extend(0.0);
            let (now, before) = (self.now[node], self.before[node]);
            let velocity_before = std::mem::replace(&mut self.velocities_before[node], velocity);
            if !velocity.is_finite() {
                // Held for this substep; whoever made it so will be told.
                (self.goal.free[node], self.next[node]) = (now, now);
                continue;
            }
            let carried = (4.0 * velocity - velocity_before) / 3.0;
            self.goal.free[node] =
                (4.0 * now - before) / 3.0 + tau / damped * (carried + tau * gravity);
            self.next[node] = now + h * velocity;
        }
        let end = if tools.are_busy() {
            self.solve_with(tools, particles, step)
        } else {
            let start = self.start(step);
            start.map(|start| self.descend(start, step))
        };
        self.restoring = end.is_none();
        let Some(end) = end else {
            self.restore(particles, step);
            self.publish(particles);
            return;
        };
        self.elastic_j = Some(end.strain.energy_j);
        let load_n = self.goal.load_n.max(self.goal.grip.load_n(&self.next));
        self.residual_share = end.residual_n / load_n.max(f64::MIN_POSITIVE);
        for (node, &particle) in self.order.particle[..self.order.free].iter().enumerate() {
            if !self.velocities_before[node].is_finite() {
                continue;
            }
            let (now, before, next) = (self.now[node], self.before[node], self.next[node]);
            let velocity = if self.touched[node] {
                self.velocities_before[node] = (next - now) / h;
                (next - now) / h
            } else {
                (next - (4.0 * now - before) / 3.0) / tau
            };
            particles.velocities[particle as usize] = velocity.truncate().as_vec3();
        }
        std::mem::swap(&mut self.before, &mut self.now);
        std::mem::swap(&mut self.now, &mut self.next);
        if !self.is_wrecked(&end, &self.now, step) {
            self.sound.copy_from_slice(&self.now);
        }
        self.publish(particles);
    }

    /// Newton's method from `next`, where the energy is `start`.
    fn descend(&mut self, start: State, step: Step) -> State {
        let (newton, goal) = (&mut self.newton, &self.goal);
        newton.descend(&mut self.next, start, goal, step.lame, step.iterations)
    }

    /// Newton's method in rounds, with what the tools do looked at anew in each; `None` if the body
    /// is wrecked.
    fn solve_with(
        &mut self,
        tools: &mut Tools,
        particles: &mut Particles,
        step: Step,
    ) -> Option<State> {
        let span = Span {
            shares: step.shares,
            substep_s: step.substep_s,
        };
        tools.begin_substep(particles, step.shares.0);
        tools.resume(step.substep_s);
        self.newton.begin_step();
        let mut state = None;
        let pieces = tools.way_radii(step.shares) / PIECE_RADII;
        let pieces = pieces.clamp(1.0, PIECES_MAX as f32).ceil() as u32;
        // The last piece is the tool where it ends: the looks of a slow one come from there on.
        let mut looks = pieces - 1 + LOOKS * step.iterations;
        let looks_max = looks + MORE_LOOKS;
        let mut rounds = pieces - 1 + ROUNDS + ROUNDS * step.iterations;
        let once = Step {
            iterations: 1,
            ..step
        };
        let mut round = 0;
        while round < rounds {
            if round < looks {
                self.show(particles);
                self.goal.grip.look(
                    tools,
                    particles,
                    span.until((round + 1).min(pieces) as f32 / pieces as f32),
                    &self.order,
                    (self.newton).body_stiffness(&self.now, &self.goal, step.lame),
                    &self.next,
                );
                self.take_blows(step);
                let is_deep = self.goal.grip.depth_radii() > DEEP_RADII;
                if is_deep && round + 1 == looks && looks < looks_max {
                    looks += 1;
                    rounds += 1;
                }
            }
            let start = if round == 0 {
                self.start(step)?
            } else {
                self.newton.evaluate(&self.next, &self.goal, step.lame)
            };
            state = Some(self.descend(start, once));
            let settled = self.goal.grip.settle(tools, span, &self.next);
            round += 1;
            if settled && round >= looks {
                break;
            }
        }
        tools.end_substep(step.substep_s);
        state
    }

    /// Has the nodes that tools are in the way of go by the backward Euler formula; all of them, where
    /// nothing else carries the body.
    fn take_blows(&mut self, step: Step) {
        let touches = self.goal.grip.touches();
        let carriers = touches.iter().flat_map(|hold| &hold.place.carriers);
        let mut nodes: Vec<usize> = carriers.map(|&(node, _)| node as usize).collect();
        let is_held = self.order.free < self.rest.len();
        if !(nodes.is_empty() || is_held) {
            nodes = (0..self.order.free).collect();
        }
        let h = f64::from(step.substep_s);
        let gravity = step.gravity_m_s2.as_dvec3().extend(0.0);
        let damped = 1.0 + f64::from(step.damping_per_s) * h;
        for node in nodes {
            let is_free = node < self.order.free && self.velocities_before[node].is_finite();
            if is_free && !std::mem::replace(&mut self.touched[node], true) {
                self.goal.inertia[node] = self.masses_kg[node] * damped / (h * h);
                self.goal.free[node] =
                    self.now[node] + h / damped * (self.velocities_before[node] + h * gravity);
            }
        }
    }

    /// Puts particles to where they are at `next`, for the tools to see.
    fn show(&self, particles: &mut Particles) {
        for (node, &particle) in self.order.particle[..self.order.free].iter().enumerate() {
            let place = self.rest[node] + self.next[node].truncate();
            let shown = &mut particles.places[particle as usize];
            *shown = place.as_vec3().extend(shown.w);
        }
    }

    /// The energy at the guess `next`, which is put to `now` if that is better; `None` if the body
    /// is wrecked.
    fn start(&mut self, step: Step) -> Option<State> {
        let gravity_m_s2 = f64::from(step.gravity_m_s2.length());
        let (goal, newton) = (&mut self.goal, &mut self.newton);
        let (mut load_n2, mut inertial_j) = (0.0, 0.0);
        for (node, mass) in self.masses_kg.iter().enumerate() {
            let away = self.now[node] - goal.free[node];
            let force = goal.inertia[node] * away;
            load_n2 += force.length_squared() + (mass * gravity_m_s2).powi(2);
            inertial_j += 0.5 * force.dot(away);
        }
        goal.load_n = load_n2.sqrt();
        let guess = newton.evaluate(&self.next, goal, step.lame);
        let is_sound = !self.is_wrecked(&guess, &self.next, step);
        let limit_j = self.elastic_j.map(|still_j| still_j + inertial_j);
        let is_alone = self.goal.grip.holds().is_empty();
        if is_alone && is_sound && limit_j.is_some_and(|limit_j| guess.energy_j <= limit_j) {
            return Some(guess);
        }
        let still = self.newton.evaluate(&self.now, &self.goal, step.lame);
        if self.is_wrecked(&still, &self.now, step) {
            return None;
        }
        if is_sound && guess.energy_j <= still.energy_j {
            return Some(self.newton.evaluate(&self.next, &self.goal, step.lame));
        }
        self.next.copy_from_slice(&self.now);
        Some(still)
    }

    /// Whether the body is wrecked at displacements `at`, where the energy is `state`.
    fn is_wrecked(&self, state: &State, at: &[DVec4], step: Step) -> bool {
        let elements = self.newton.elements.elements();
        self.wreck(step).is_wrecked(elements, &state.strain, at)
    }

    fn wreck(&self, step: Step) -> Wreck<'_> {
        Wreck {
            rest: &self.rest,
            masses_kg: &self.masses_kg,
            sound: &self.sound,
            mu_pa: f64::from(step.lame.mu_pa),
        }
    }

    /// Takes a step of a wrecked body towards its last sound shape. What is led there stands still.
    fn restore(&mut self, particles: &mut Particles, step: Step) {
        let wreck = Wreck {
            rest: &self.rest,
            masses_kg: &self.masses_kg,
            sound: &self.sound,
            mu_pa: f64::from(step.lame.mu_pa),
        };
        let led = wreck.restore(&mut self.newton, &mut self.now);
        for (node, _) in led.iter().enumerate().filter(|(_, led)| **led) {
            particles.velocities[self.order.particle[node] as usize] = Vec3::ZERO;
        }
        self.elastic_j = None;
        self.forget();
    }

    /// Makes up a past of constant acceleration: the one that a step of the backward Euler formula finds, or
    /// none where the forces are those of no smooth motion. The forces alone would do for slow waves; a stiff
    /// body let go would be told a past in which it fell freely, and take that fall's speed over.
    fn make_up_past(&mut self, particles: &Particles, step: Step) {
        let h = f64::from(step.substep_s);
        let gravity = step.gravity_m_s2.as_dvec3().extend(0.0);
        let velocity = |particle: u32| {
            let velocity = particles.velocities[particle as usize];
            velocity.as_dvec3().extend(0.0)
        };
        // Where the goal is where the body is, the residual is the elastic force.
        self.goal.inertia.resize(self.masses_kg.len(), 0.0);
        self.goal.free.copy_from_slice(&self.now[..self.order.free]);
        self.newton.evaluate(&self.now, &self.goal, step.lame);
        let (mut force_n2, mut weight_n2) = (0.0, 0.0);
        for (node, &mass) in self.masses_kg.iter().enumerate() {
            let force = self.newton.residual[node].as_dvec4() + mass * gravity;
            force_n2 += force.length_squared();
            weight_n2 += (mass * gravity).length_squared();
        }
        let is_finite = (particles.velocities.iter()).all(|velocity| velocity.is_finite());
        let is_smooth = is_finite && force_n2 <= SMOOTH_WEIGHTS.powi(2) * weight_n2;
        if is_smooth {
            self.goal.load_n = (force_n2 + weight_n2).sqrt();
            let damped = 1.0 + f64::from(step.damping_per_s) * h;
            self.next.copy_from_slice(&self.now);
            for (node, &mass) in self.masses_kg.iter().enumerate() {
                let velocity = velocity(self.order.particle[node]);
                self.goal.inertia[node] = mass * damped / (h * h);
                self.goal.free[node] = self.now[node] + h / damped * (velocity + h * gravity);
            }
            let start = self.newton.evaluate(&self.next, &self.goal, step.lame);
            self.descend(start, step);
        }
        for node in 0..self.order.free {
            let velocity = velocity(self.order.particle[node]);
            let acceleration = match is_smooth {
                true => (self.next[node] - self.now[node] - h * velocity) / (h * h),
                false => DVec4::ZERO,
            };
            self.before[node] = self.now[node] - h * (velocity - 0.5 * h * acceleration);
            self.velocities_before[node] = velocity - h * acceleration;
        }
        self.past_substep_s = Some(step.substep_s);
    }

    /// Takes over particles that somebody else has moved; then there is no past.
    fn take_over(&mut self, particles: &Particles) {
        for (particle, published) in self.published.iter_mut().enumerate() {
            let place = particles.places[particle];
            if place.truncate() == published.truncate() {
                continue;
            }
            *published = place;
            let node = self.order.node[particle] as usize;
            let moved = place.truncate().as_dvec3() - self.rest[node];
            for displacements in [&mut self.now, &mut self.before, &mut self.next] {
                displacements[node] = moved.extend(0.0);
            }
            self.elastic_j = None;
            if node < self.order.free {
                self.past_substep_s = None;
            }
        }
    }

    /// Puts the free particles where their nodes are.
    fn publish(&mut self, particles: &mut Particles) {
        for (node, &particle) in self.order.particle[..self.order.free].iter().enumerate() {
            let particle = particle as usize;
            let place = self.rest[node] + self.now[node].truncate();
            let old = particles.places[particle];
            let new = place.as_vec3().extend(old.w);
            particles.places[particle] = new;
            self.published[particle] = new;
        }
    }
}
