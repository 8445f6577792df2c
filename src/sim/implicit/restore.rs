//! Leads a wrecked body back to its last sound shape.
//!
//! A body of which many tetrahedra were turned over at once, or one was torn to many times its length,
//! is in no state that tissue comes to: it was put there, or flung. Left to its energy alone it may
//! come to rest tangled, with no tetrahedron turned over and yet wound up. So as long as it is wrecked
//! it follows another energy, the quadratic
//!
//! Σ m/(2T²) |x − x_now|² + Σ V μ |F − F_sound|²,
//!
//! with F_sound the deformation when the body was last sound: it has one minimum, which one linear
//! system finds. Nodes of sound tetrahedra stay where they are.

use super::{
    cg::Stop,
    element::{Element, LOST_J, PAIRS, Strain, TORN_SQUARED},
    newton::Newton,
};
use glam::{DMat3, DVec3, DVec4};

/// Share of the tetrahedra that may be lost at once before the body is wrecked.
const LOST_SHARE: f64 = 0.05;
/// Growth of |F|² at once by which a torn tetrahedron wrecks the body.
const TORN_GROWTH: f64 = 4.0;
/// The time T about which the body comes back in [s].
const RETURN_S: f64 = 0.05;
/// How much heavier nodes are that are to stay.
const STAYING: f64 = 1e6;

/// A body and where it is led.
pub struct Wreck<'a> {
    /// Places of the nodes at rest [m].
    pub rest: &'a [DVec3],
    pub masses_kg: &'a [f64],
    /// Displacements when the body was last sound [m].
    pub sound: &'a [DVec4],
    /// Shear modulus [Pa].
    pub mu_pa: f64,
}

impl Wreck<'_> {
    /// Whether a body is wrecked at displacements `now`, of which `strain` is known, having been
    /// sound at `sound`.
    pub fn is_wrecked(&self, elements: &[Element], strain: &Strain, now: &[DVec4]) -> bool {
        let lost_max = LOST_SHARE * elements.len() as f64;
        if !strain.energy_j.is_finite() {
            return true;
        }
        if strain.torn == 0 && strain.lost as f64 <= lost_max {
            return false;
        }
        let (mut lost, mut torn) = (0.0, false);
        for element in elements {
            let (gradients, _) = element.shape(self.rest);
            let there = deformation(element, &gradients, now);
            let before = deformation(element, &gradients, self.sound);
            lost += f64::from(u8::from(is_lost(there) && !is_lost(before)));
            torn |= is_torn(there) && squared(there) > TORN_GROWTH * squared(before);
        }
        torn || lost > lost_max
    }

    /// Changes the displacements `now` by one step back. Returns which free nodes were led.
    pub fn restore(&self, newton: &mut Newton, now: &mut [DVec4]) -> Vec<bool> {
        let free = self.masses_kg.len();
        let elements = newton.elements.elements().to_vec();
        let mut led = vec![false; self.rest.len()];
        let mut pull = vec![DVec3::ZERO; self.rest.len()];
        newton.matrix.clear();
        for element in &elements {
            let (gradients, volume_m3) = element.shape(self.rest);
            let there = deformation(element, &gradients, now);
            let before = deformation(element, &gradients, self.sound);
            if is_lost(there) || is_torn(there) {
                for &node in &element.nodes {
                    led[node as usize] = true;
                }
            }
            let stiffness = 2.0 * self.mu_pa * volume_m3;
            let stress = stiffness * (before - there);
            for (&node, gradient) in element.nodes.iter().zip(gradients) {
                pull[node as usize] += stress * gradient;
            }
            add_laplacian(newton, element, &gradients, stiffness, free);
        }
        for (node, &mass) in self.masses_kg.iter().enumerate() {
            let staying = if led[node] { 1.0 } else { STAYING };
            let inertia = staying * mass / (RETURN_S * RETURN_S);
            newton.matrix.add_to_diagonal(node, inertia as f32);
            let pull = if led[node] { pull[node] } else { DVec3::ZERO };
            newton.residual[node] = pull.as_vec3().extend(0.0);
        }
        newton.matrix.mirror_upper();
        newton.solve_anew(Stop {
            error: 1e-3,
            residual: 0.0,
            iterations_max: 100,
        });
        for (now, step) in now.iter_mut().zip(&newton.cg.solution) {
            *now += step.as_dvec4();
        }
        led.truncate(free);
        led
    }
}

/// F of a tetrahedron.
fn deformation(element: &Element, gradients: &[DVec3; 4], displacements: &[DVec4]) -> DMat3 {
    let parts = element.nodes.iter().zip(gradients);
    parts.fold(DMat3::IDENTITY, |sum, (&node, gradient)| {
        let u = displacements[node as usize].truncate();
        sum + DMat3::from_cols(gradient.x * u, gradient.y * u, gradient.z * u)
    })
}

fn is_lost(f: DMat3) -> bool {
    f.determinant() < f64::from(LOST_J)
}

fn is_torn(f: DMat3) -> bool {
    squared(f) > f64::from(TORN_SQUARED)
}

fn squared(f: DMat3) -> f64 {
    f.x_axis.length_squared() + f.y_axis.length_squared() + f.z_axis.length_squared()
}

/// Adds the second derivative of `stiffness`/2 |F|².
fn add_laplacian(
    newton: &mut Newton,
    element: &Element,
    gradients: &[DVec3; 4],
    stiffness: f64,
    free: usize,
) {
    for (a, b) in PAIRS {
        let (row, column) = (element.nodes[a], element.nodes[b]);
        // Nodes are sorted.
        if (column as usize) < free {
            let value = (stiffness * gradients[a].dot(gradients[b])) as f32;
            let place = newton.matrix.place(row, column) as usize;
            let block = &mut newton.matrix.blocks_mut()[place];
            block[0].x += value;
            block[1].y += value;
            block[2].z += value;
        }
    }
}
