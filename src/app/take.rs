//! A take: what the hand did in the window, frame by frame, and the scene that does it again.

use super::Session;
use crate::scene::{Key, Scene, ToolSection, ToolShapeName};
use crate::sim::{ToolAction, ToolInput, ToolShape};
use glam::Vec3;

/// What the hand did since the scene started from rest.
#[derive(Clone, Debug, Default)]
pub struct Take {
    /// A tool for each drag.
    drags: Vec<ToolSection>,
    /// What the hand held in the frame before.
    held: Option<ToolInput>,
    frames: u32,
}

impl Take {
    /// Adds the time step that `session` has just taken.
    pub fn add(&mut self, session: &Session) {
        self.frames = session.frame();
        let now = session.hand.filter(|tool| tool.action != ToolAction::Idle);
        let goes_on = self.held.zip(now).is_some_and(|(before, now)| {
            (before.action, before.shape, before.friction) == (now.action, now.shape, now.friction)
        });
        if !goes_on {
            if let Some(before) = self.held {
                self.key(session.time_s(), ToolAction::Idle, before.position_m);
            }
            if let Some(tool) = now {
                self.drags.push(drag(self.drags.len() + 1, tool));
                // Idle until now: what a script does not say of the time before, its first key does.
                if self.frames > 1 {
                    self.key(0.0, ToolAction::Idle, tool.position_m);
                    self.key(session.time_before_s(), ToolAction::Idle, tool.position_m);
                }
            }
        }
        if let Some(tool) = now {
            self.key(session.time_s(), tool.action, tool.position_m);
        }
        self.held = now;
    }

    /// Adds a key to the last drag; of a stretch in which nothing changes it keeps the ends.
    fn key(&mut self, at_s: f32, action: ToolAction, at_m: Vec3) {
        let Some(drag) = self.drags.last_mut() else {
            return;
        };
        let same = |key: &Key| key.action == action && key.at_m == Some(at_m);
        if drag.keys.last().is_some_and(|last| last.at_s >= at_s) {
            return;
        }
        if drag.keys.len() >= 2 && drag.keys[drag.keys.len() - 2..].iter().all(same) {
            drag.keys.pop();
        }
        drag.keys.push(Key {
            at_s,
            action,
            at_m: Some(at_m),
            at_share: None,
            depth_m: None,
            depth_share: None,
            shift_share: None,
        });
    }

    /// Whether no time step was taken.
    pub fn is_empty(&self) -> bool {
        self.frames == 0
    }

    /// The scene of `session` with the hand as tools of its script, as long as the take.
    pub fn scene(&self, session: &Session) -> Scene {
        let mut scene = session.scene.clone();
        if !session.script_plays {
            scene.tools.clear();
        }
        scene.tools.extend(self.drags.iter().cloned());
        scene.output.frames = self.frames.max(1);
        scene.title = format!("recorded by hand: {}", scene.title);
        scene
    }
}

/// A tool without keys, shaped as the hand's.
fn drag(number: usize, tool: ToolInput) -> ToolSection {
    let (shape, axis_m) = match tool.shape {
        ToolShape::Sphere { .. } => (ToolShapeName::Sphere, None),
        ToolShape::Capsule { axis_m, .. } => (ToolShapeName::Capsule, Some(axis_m)),
    };
    ToolSection {
        name: format!("hand {number}"),
        shape,
        radius_m: Some(tool.shape.radius_m()),
        radius_share: None,
        axis_m,
        axis_share: None,
        friction: tool.friction,
        approach: None,
        keys: Vec::new(),
    }
}

#[cfg(test)]
mod tests {
    use super::super::load;
    use super::*;
    use crate::scene::SceneSource;

    fn session(sets: &[&str]) -> Session {
        let sets: Vec<String> = sets.iter().map(|&set| set.to_owned()).collect();
        let scene = load::scene("slab", &sets).expect("a bundled scene");
        Session::new(scene, 1).expect("a sound scene")
    }

    /// What a hand does in frame `n`: nothing, a push that slides, nothing, a grab that pulls and rests, nothing.
    fn hand(frame: u32, rest_high: Vec3) -> Option<ToolInput> {
        let n = frame as f32;
        let at = |action, offset: Vec3| ToolInput {
            shape: ToolShape::Sphere { radius_m: 0.0123 },
            position_m: rest_high * Vec3::new(0.4, 1.0, 0.5) + offset,
            action,
            friction: 0.31,
        };
        match frame {
            5..25 => {
                let slide = Vec3::new(0.0003 * (n - 5.0), 0.012 - 0.0006 * (n - 5.0), 0.0001 * n);
                Some(at(ToolAction::Push, slide))
            }
            31..50 => {
                let pull = Vec3::new(0.01, 0.0005 * (n - 31.0).min(9.0), 0.0);
                Some(at(ToolAction::Grab, pull))
            }
            _ => None,
        }
    }

    /// A take of sixty frames.
    fn taken(session: &mut Session) -> Take {
        session.script_plays = false;
        let high = session.rest.high;
        let mut take = Take::default();
        for _ in 0..60 {
            session.hand = hand(session.frame() + 1, high);
            session.tick();
            take.add(session);
        }
        take
    }

    /// The state that the scene ends in when it is saved, read and played.
    fn played(scene: &Scene) -> String {
        let text = scene.to_toml().expect("a scene has a TOML form");
        let source = SceneSource {
            name: "take",
            text: &text,
            folder: None,
        };
        let scene = Scene::read(&source, &[]).expect("what was saved can be read");
        let frames = scene.output.frames;
        let mut session = Session::new(scene, 2).expect("a sound scene");
        for _ in 0..frames {
            session.tick();
        }
        session.state_sha256()
    }

    #[test]
    fn a_take_ends_in_the_same_bits_when_it_is_played_from_its_file() {
        for method in ["xpbd-neo-hookean", "implicit"] {
            let mut session = session(&[&format!("solver.method=\"{method}\"")]);
            let take = taken(&mut session);
            assert_eq!(
                played(&take.scene(&session)),
                session.state_sha256(),
                "{method}"
            );
        }
    }

    #[test]
    fn a_take_after_a_reset_is_that_of_a_new_window() {
        let mut session = session(&[]);
        let first = taken(&mut session);
        let state = session.state_sha256();
        session.hand = None;
        session.reset();
        let second = taken(&mut session);
        assert_eq!(session.state_sha256(), state);
        assert_eq!(second.drags, first.drags);
    }

    #[test]
    fn a_take_that_lost_a_frame_ends_elsewhere() {
        let mut session = session(&[]);
        let mut scene = taken(&mut session).scene(&session);
        // Sabotage: the push, moved by a frame.
        for key in &mut scene.tools[0].keys[1..] {
            key.at_s += session.scene.solver.timestep_s;
        }
        assert_ne!(played(&scene), session.state_sha256());
    }

    #[test]
    fn a_tool_at_rest_in_the_hand_takes_two_keys() {
        let mut session = session(&[]);
        let take = taken(&mut session);
        assert_eq!(take.drags.len(), 2);
        // Idle twice, ten places on its way, the last of them held, and let go.
        assert_eq!(take.drags[1].keys.len(), 2 + 10 + 1 + 1);
    }
}
