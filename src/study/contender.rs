//! What the studies of the body compare: each method as it is, and what a scene makes of the default.

use crate::sim::{HandOver, Method, Simulation, SolverParams};
use serde::{Deserialize, Serialize};

/// A method as it is, or the default as a scene runs it.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Contender {
    MassSpring,
    XpbdSprings,
    Implicit,
    XpbdNeoHookean,
    /// `xpbd-neo-hookean`, handed to `implicit` where a scene is.
    AsAScene,
}

impl Contender {
    pub const ALL: [Self; 5] = [
        Self::MassSpring,
        Self::XpbdSprings,
        Self::Implicit,
        Self::XpbdNeoHookean,
        Self::AsAScene,
    ];

    /// The name in plans and tables.
    pub fn name(self) -> &'static str {
        match self {
            Self::AsAScene => "as-a-scene",
            _ => self.method().name(),
        }
    }

    /// The method that it starts with.
    pub fn method(self) -> Method {
        match self {
            Self::MassSpring => Method::MassSpring,
            Self::XpbdSprings => Method::XpbdSprings,
            Self::Implicit => Method::Implicit,
            Self::XpbdNeoHookean | Self::AsAScene => Method::XpbdNeoHookean,
        }
    }

    /// Gets a body ready with `params`, which have its method, before its first step.
    pub fn start(self, simulation: &mut Simulation, params: SolverParams) {
        simulation.set_params(params);
        if self == Self::AsAScene {
            HandOver::at_start(simulation);
        }
    }

    /// Does what a scene does after a step.
    pub fn after_step(self, simulation: &mut Simulation) {
        if self == Self::AsAScene {
            HandOver::after_step(simulation);
        }
    }
}

#[cfg(test)]
mod tests {
    use super::super::held_body::{HeldBody, Hold, beam};
    use super::*;

    /// The method that moves a stiff beam after a step.
    fn taken(contender: Contender) -> Method {
        let params = SolverParams {
            method: contender.method(),
            youngs_modulus_pa: 1e7,
            ..SolverParams::default()
        };
        let body = HeldBody::new(beam(2), 1000.0, Hold::End);
        let mut simulation = Simulation::new(body.setup, params);
        contender.start(&mut simulation, params);
        simulation.step(&[]);
        contender.after_step(&mut simulation);
        simulation.params().method
    }

    #[test]
    fn methods_stay_as_they_are_and_a_scene_hands_a_stiff_body_over() {
        for contender in Contender::ALL {
            let method = match contender {
                Contender::AsAScene => Method::Implicit,
                other => other.method(),
            };
            assert_eq!(taken(contender), method, "{}", contender.name());
        }
    }

    #[test]
    fn plans_name_them_as_tables_do() {
        for contender in Contender::ALL {
            let name = serde_json::to_value(contender).expect("a name");
            assert_eq!(name, contender.name());
        }
    }
}
