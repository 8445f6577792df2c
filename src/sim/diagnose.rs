//! Invariants of a body: energy, momentum, volume, inverted tetrahedra. In f64, in one fixed order.

use super::{Method, Simulation, constraint, mass_spring};
use crate::geom::TetMesh;
use glam::{DMat3, DVec3, Vec3};

/// Volume of a tetrahedron at rest [m³], signed.
pub fn rest_volume_m3(mesh: &TetMesh, tet: usize) -> f64 {
    tet_volume_m3(&mesh.particles, mesh.tets[tet])
}

/// Volume of a tetrahedron [m³], signed.
pub fn tet_volume_m3(particles: &[Vec3], tet: [u32; 4]) -> f64 {
    let [a, b, c, d] = tet.map(|i| particles[i as usize].as_dvec3());
    (b - a).dot((c - a).cross(d - a)) / 6.0
}

/// Volume of all tetrahedra [m³] and the number of negative ones.
pub fn volume_and_inverted(particles: &[Vec3], tets: &[[u32; 4]]) -> (f64, usize) {
    tets.iter().fold((0.0, 0), |(sum, inverted), &tet| {
        let volume = tet_volume_m3(particles, tet);
        (sum + volume, inverted + usize::from(volume < 0.0))
    })
}

/// Energy of a body [J].
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Energy {
    pub kinetic_j: f64,
    /// Of the springs or tetrahedra; 0 at rest.
    pub elastic_j: f64,
    /// −Σ m g·x; 0 at the origin of the world.
    pub gravitational_j: f64,
}

impl Energy {
    /// Sum of all parts [J].
    pub fn total_j(self) -> f64 {
        self.kinetic_j + self.elastic_j + self.gravitational_j
    }
}

/// Energy of the body as it is.
pub fn energy(simulation: &Simulation) -> Energy {
    let gravity = simulation.setup().gravity_m_s2.as_dvec3();
    let mut kinetic_j = 0.0;
    let mut gravitational_j = 0.0;
    for (i, &mass) in simulation.setup().masses_kg.iter().enumerate() {
        let velocity = simulation.velocities()[i].as_dvec3();
        kinetic_j += 0.5 * f64::from(mass) * velocity.length_squared();
        gravitational_j -= f64::from(mass) * gravity.dot(simulation.particles()[i].as_dvec3());
    }
    Energy {
        kinetic_j,
        elastic_j: elastic_energy_j(simulation),
        gravitational_j,
    }
}

/// Energy of what the method has; held to `constraint`, not to the kernels.
fn elastic_energy_j(simulation: &Simulation) -> f64 {
    let (setup, params) = (simulation.setup(), simulation.params());
    let (mesh, sound) = (&setup.tets, simulation.sound_tets());
    let lame = params.lame();
    let particles = simulation.particles();
    let springs = |modulus_pa: f32| -> f64 {
        mass_spring::edges_of(mesh, sound, &setup.fill)
            .iter()
            .map(|edge| {
                let x = edge.particles.map(|i| particles[i as usize]);
                let value = constraint::distance(x, edge.rest_length_m)
                    .map_or(-edge.rest_length_m, |c| c.value);
                let stiffness = f64::from(modulus_pa * edge.stiffness_per_modulus_m);
                0.5 * stiffness * f64::from(value).powi(2)
            })
            .sum()
    };
    let tets = |energy: &dyn Fn([Vec3; 4], f64, u32) -> f64| -> f64 {
        sound
            .iter()
            .map(|&tet| {
                let x = mesh.tets[tet as usize].map(|i| particles[i as usize]);
                let fill = f64::from(setup.fill[tet as usize]);
                fill * energy(x, rest_volume_m3(mesh, tet as usize), tet)
            })
            .sum()
    };
    match params.method {
        Method::MassSpring => springs(params.youngs_modulus_pa),
        Method::XpbdSprings => {
            let bulk = f64::from(lame.lambda_pa - lame.mu_pa).max(0.0);
            springs(super::springs::SPRING_PER_SHEAR_MODULUS * lame.mu_pa)
                + tets(&|x, volume, _| {
                    let change = f64::from(constraint::volume(x, volume as f32).value);
                    0.5 * bulk * change.powi(2) / volume
                })
        }
        Method::Implicit | Method::XpbdNeoHookean => tets(&|x, volume, tet| {
            let [a, b, c, d] =
                mesh.tets[tet as usize].map(|i| mesh.particles[i as usize].as_dvec3());
            let rest = DMat3::from_cols(b - a, c - a, d - a);
            let [p, q, r, s] = x.map(Vec3::as_dvec3);
            let f = DMat3::from_cols(q - p, r - p, s - p) * rest.inverse();
            volume * constraint::energy_density_pa(f, lame)
        }),
    }
}

/// Momentum of the body [kg m/s].
pub fn momentum(simulation: &Simulation) -> DVec3 {
    (simulation.setup().masses_kg.iter())
        .zip(simulation.velocities())
        .map(|(&mass, velocity)| f64::from(mass) * velocity.as_dvec3())
        .sum()
}

/// Angular momentum of the body about the origin [kg m²/s].
pub fn angular_momentum(simulation: &Simulation) -> DVec3 {
    (0..simulation.particles().len())
        .map(|i| {
            let mass = f64::from(simulation.setup().masses_kg[i]);
            let velocity = simulation.velocities()[i].as_dvec3();
            mass * simulation.particles()[i].as_dvec3().cross(velocity)
        })
        .sum()
}
