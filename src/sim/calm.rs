//! Whether a body goes anywhere, and whether it trembles or stays folded.

use super::particles::Particles;
use glam::{Vec3, Vec4};

/// A body that goes nowhere by more than this many of its sizes is calm.
const CALM_SIZES: f32 = 1e-4;
/// Calm for so long, it falls asleep [s]: longer than it hangs still at the turning point of a
/// swing.
const CALM_S: f32 = 0.5;
/// So long without a pause, turning back and forth is no blow that dies away, and being inside out no moment of a
/// large motion [s].
const TROUBLE_S: f32 = 0.5;
/// Turned back with less of its speed than this, a particle was stopped and does not tremble.
const TURNED_SHARE: f32 = 0.5;

/// The watch over a body.
#[derive(Clone, Debug)]
pub struct Calm {
    /// How far a calm body goes [m].
    way_max_m: f32,
    /// Where the particles were when they last were not calm [m], and for how many steps they have
    /// been near there.
    places: Vec<Vec4>,
    calm_steps: u32,
    /// Velocities before the last substep [m/s]; nothing until the first.
    before: Vec<Vec3>,
    /// How fast some of the body went back and forth in the last substep [m/s].
    tremble_m_s: f32,
    /// For how many steps in a row the body has trembled, and had tetrahedra inside out.
    trembling_steps: u32,
    folded_steps: u32,
}

impl Calm {
    /// A body of this size [m].
    pub fn new(particles: &Particles, size_m: f32) -> Self {
        Self {
            way_max_m: CALM_SIZES * size_m,
            places: particles.places.clone(),
            calm_steps: 0,
            before: Vec::new(),
            tremble_m_s: 0.0,
            trembling_steps: 0,
            folded_steps: 0,
        }
    }

    /// The body was moved or changed: it has all its time to calm down again.
    pub fn wake(&mut self) {
        self.calm_steps = 0;
    }

    /// Forgets that the body has trembled and is folded: it is another one.
    pub fn forget_troubles(&mut self) {
        (self.trembling_steps, self.folded_steps) = (0, 0);
        self.before.clear();
    }

    /// Forgets that the body is folded: something presses it.
    pub fn forget_folds(&mut self) {
        self.folded_steps = 0;
    }

    /// Keeps the velocities that the last substep of a step starts with.
    pub fn before_last_substep(&mut self, particles: &Particles) {
        self.before.clear();
        self.before.extend_from_slice(&particles.velocities);
    }

    /// Looks at how particles went on in the last substep, before anything slows them. Those that carry what a tool
    /// touches, `carriers` in order, rattle between tool and tissue, and count for nothing.
    pub fn after_last_substep(&mut self, particles: &Particles, carriers: &[u32]) {
        self.tremble_m_s = tremble_m_s(&self.before, &particles.velocities, carriers);
    }

    /// Looks at the body after a step; `stirred` from outside, it is not calm.
    pub fn watch(
        &mut self,
        particles: &Particles,
        substep_s: f32,
        stirred: bool,
        inverted_tets: usize,
    ) {
        // By the way and not the speed: where something presses, light particles tremble by less. A tremble of two
        // substeps is back where it was as a step ends, so the way of a substep counts too.
        let goes = particles.speed_max_m_s() * substep_s > self.way_max_m
            || particles.farthest_m(&self.places) > self.way_max_m;
        if stirred || goes {
            self.places.copy_from_slice(&particles.places);
            self.calm_steps = 0;
        } else {
            self.calm_steps += 1;
        }
        if self.tremble_m_s * substep_s > self.way_max_m {
            self.trembling_steps += 1;
        } else {
            self.trembling_steps = 0;
        }
        self.folded_steps = if inverted_tets > 0 {
            self.folded_steps + 1
        } else {
            0
        };
    }

    /// Whether the body has been calm for so long that it may sleep.
    pub fn may_sleep(&self, timestep_s: f32) -> bool {
        self.calm_steps >= (CALM_S / timestep_s).round() as u32
    }

    /// Whether some particle or other has turned back in every substep looked at for so long that it will not stop.
    pub fn trembles(&self, timestep_s: f32) -> bool {
        self.trembling_steps >= trouble_steps(timestep_s)
    }

    /// Whether tetrahedra have been inside out for so long that they will not turn back.
    pub fn is_folded(&self, timestep_s: f32) -> bool {
        self.folded_steps >= trouble_steps(timestep_s)
    }
}

fn trouble_steps(timestep_s: f32) -> u32 {
    ((TROUBLE_S / timestep_s).round() as u32).max(2)
}

/// Half of the largest change of velocity of a particle that turned back, which is its speed if it goes back and
/// forth [m/s]; particles `but` a list in order.
fn tremble_m_s(before: &[Vec3], now: &[Vec3], but: &[u32]) -> f32 {
    (before.iter().zip(now).zip(0..))
        .filter(|((before, now), _)| {
            before.dot(**now) < 0.0
                && now.length_squared() > TURNED_SHARE * TURNED_SHARE * before.length_squared()
        })
        .filter(|(_, particle)| but.binary_search(particle).is_err())
        .map(|((before, now), _)| before.distance_squared(*now))
        .fold(0.0, f32::max)
        .sqrt()
        / 2.0
}

#[cfg(test)]
mod tests {
    use super::*;

    const STEP_S: f32 = 1.0 / 60.0;
    const SUBSTEP_S: f32 = STEP_S / 20.0;

    /// Two particles, one of which is watched.
    fn particles() -> Particles {
        Particles::new(&[Vec3::ZERO, Vec3::X], &[0.0, 1.0])
    }

    /// Watches for a second while the free particle has `velocity` [m/s] in each last substep and `before` in the one
    /// before it, its place at the ends of steps being the same.
    fn watched(before: Vec3, velocity: Vec3) -> Calm {
        watched_but(before, velocity, &[])
    }

    /// The same with particles that a tool touches.
    fn watched_but(before: Vec3, velocity: Vec3, but: &[u32]) -> Calm {
        let mut particles = particles();
        let mut calm = Calm::new(&particles, 1.0);
        for _ in 0..60 {
            particles.velocities[1] = before;
            calm.before_last_substep(&particles);
            particles.velocities[1] = velocity;
            calm.after_last_substep(&particles, but);
            calm.watch(&particles, SUBSTEP_S, false, 1);
        }
        calm
    }

    #[test]
    fn body_that_is_back_as_each_step_ends_is_not_calm_and_trembles() {
        // 1e-4 m in a substep is 0.12 m/s.
        let calm = watched(-0.2 * Vec3::Z, 0.2 * Vec3::Z);
        assert!(!calm.may_sleep(STEP_S) && calm.trembles(STEP_S));
    }

    #[test]
    fn body_at_rest_may_sleep_and_one_under_way_does_neither() {
        let still = watched(Vec3::ZERO, Vec3::ZERO);
        assert!(still.may_sleep(STEP_S) && !still.trembles(STEP_S));
        assert!(still.is_folded(STEP_S), "it has one inside out");
        let under_way = watched(0.2 * Vec3::Z, 0.2 * Vec3::Z);
        assert!(!under_way.may_sleep(STEP_S) && !under_way.trembles(STEP_S));
        let stopped = watched(-0.5 * Vec3::Z, 0.2 * Vec3::Z);
        assert!(!stopped.trembles(STEP_S));
    }

    #[test]
    fn tremble_too_small_to_see_is_none() {
        let calm = watched(-0.1 * Vec3::Z, 0.1 * Vec3::Z);
        assert!(calm.may_sleep(STEP_S) && !calm.trembles(STEP_S));
    }

    #[test]
    fn what_a_tool_touches_rattles_and_does_not_tremble() {
        let calm = watched_but(-0.2 * Vec3::Z, 0.2 * Vec3::Z, &[1]);
        assert!(!calm.trembles(STEP_S));
        let calm = watched_but(-0.2 * Vec3::Z, 0.2 * Vec3::Z, &[0]);
        assert!(calm.trembles(STEP_S));
    }

    #[test]
    fn another_body_has_not_trembled() {
        let mut calm = watched(-0.2 * Vec3::Z, 0.2 * Vec3::Z);
        calm.forget_troubles();
        assert!(!calm.trembles(STEP_S) && !calm.is_folded(STEP_S));
    }
}
