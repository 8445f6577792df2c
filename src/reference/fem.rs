//! A body of linear tetrahedra: energy, forces and stiffness.

use super::{Material, sparse::Pattern};
use crate::geom::TetMesh;
use glam::{DMat3, DVec3};

/// Thinner tetrahedra than this share of their longest edge cubed have no volume to speak of.
const VOLUME_SHARE_MIN: f64 = 1e-6;
/// Marks a particle that cannot move, or an entry of the stiffness that nobody asks for.
const NONE: u32 = u32::MAX;

/// A body as the reference takes it over; the same data as the simulation's.
#[derive(Clone, Copy, Debug)]
pub struct FemSetup<'a> {
    /// Particles at rest [m] and tetrahedra; flat and inverted ones are left out.
    pub tets: &'a TetMesh,
    /// Mass of each particle [kg].
    pub masses_kg: &'a [f32],
    /// Particles that are held; one flag each.
    pub fixed: &'a [bool],
    /// Share of each tetrahedron that is tissue, scaling its stiffness; empty if all of it is.
    pub fill: &'a [f32],
    /// What the tissue is made of.
    pub material: Material,
    /// Acceleration of every particle [m/s²].
    pub gravity_m_s2: DVec3,
}

/// A tetrahedron of constant strain.
#[derive(Clone, Debug)]
struct Element {
    corners: [u32; 4],
    /// Gradients of the four barycentric coordinates [1/m].
    gradients: [DVec3; 4],
    /// Tissue volume at rest [m³].
    volume_m3: f64,
}

impl Element {
    fn deformation_gradient(&self, positions: &[DVec3]) -> DMat3 {
        let mut f = DMat3::ZERO;
        for (&corner, g) in self.corners.iter().zip(&self.gradients) {
            let x = positions[corner as usize];
            f += DMat3::from_cols(g.x * x, g.y * x, g.z * x);
        }
        f
    }
}

/// A body of stable neo-Hookean tissue on a tetrahedral mesh.
#[derive(Debug)]
pub struct Fem {
    elements: Vec<Element>,
    rest: Vec<DVec3>,
    masses_kg: Vec<f64>,
    material: Material,
    /// Weight and point forces [N].
    forces_n: Vec<DVec3>,
    /// Where held particles are held [m]; rest for all others.
    held_at: Vec<DVec3>,
    is_fixed: Vec<bool>,
    /// Number of each particle among those that are free and carried by an element, or [`NONE`].
    node_of: Vec<u32>,
    /// The particle of each such node.
    particle_of: Vec<u32>,
    pattern: Pattern,
    /// For each element, where the 78 entries of the lower triangle of its 12 × 12 stiffness go.
    places: Vec<[u32; 78]>,
}

impl Fem {
    /// A body at rest. Builds the pattern of its stiffness and the order of its factorisation.
    ///
    /// # Panics
    ///
    /// If the lists of `setup` do not fit each other.
    pub fn new(setup: &FemSetup) -> Self {
        let count = setup.tets.particles.len();
        assert!(
            setup.masses_kg.len() == count && setup.fixed.len() == count,
            "one mass and one flag a particle"
        );
        let rest: Vec<DVec3> = setup.tets.particles.iter().map(|x| x.as_dvec3()).collect();
        let elements: Vec<Element> = (setup.tets.tets.iter().enumerate())
            .filter_map(|(tet, &corners)| {
                let fill = setup.fill.get(tet).map_or(1.0, |&fill| f64::from(fill));
                element(&rest, corners, fill)
            })
            .collect();
        let masses_kg: Vec<f64> = setup.masses_kg.iter().map(|&m| f64::from(m)).collect();

        let mut is_carried = vec![false; count];
        for &corner in elements.iter().flat_map(|element| &element.corners) {
            is_carried[corner as usize] = true;
        }
        let particle_of: Vec<u32> = (0..count as u32)
            .filter(|&i| is_carried[i as usize] && !setup.fixed[i as usize])
            .collect();
        let mut node_of = vec![NONE; count];
        for (node, &particle) in particle_of.iter().enumerate() {
            node_of[particle as usize] = node as u32;
        }
        let groups = elements.iter().map(|element| {
            let nodes = element.corners.map(|corner| node_of[corner as usize]);
            nodes.into_iter().filter(|&node| node != NONE).collect()
        });
        let pattern = Pattern::of_nodes(groups, particle_of.len());
        let places = (elements.iter())
            .map(|element| places(element.corners.map(|i| node_of[i as usize]), &pattern))
            .collect();
        Self {
            forces_n: masses_kg.iter().map(|&m| m * setup.gravity_m_s2).collect(),
            held_at: rest.clone(),
            is_fixed: setup.fixed.to_vec(),
            material: setup.material,
            elements,
            rest,
            masses_kg,
            node_of,
            particle_of,
            pattern,
            places,
        }
    }

    /// Adds a force on a particle [N], constant in space and time.
    pub fn push(&mut self, particle: usize, force_n: DVec3) {
        self.forces_n[particle] += force_n;
    }

    /// Holds a fixed particle at another place than at rest [m].
    ///
    /// # Panics
    ///
    /// If the particle is not fixed.
    pub fn hold(&mut self, particle: usize, place_m: DVec3) {
        assert!(
            self.is_fixed[particle],
            "only a fixed particle can be held elsewhere"
        );
        self.held_at[particle] = place_m;
    }

    /// Positions at rest [m].
    pub fn rest(&self) -> &[DVec3] {
        &self.rest
    }

    /// Elastic energy at `positions` [J]; 0 at rest.
    pub fn elastic_energy_j(&self, positions: &[DVec3]) -> f64 {
        (self.elements.iter())
            .map(|element| {
                let f = element.deformation_gradient(positions);
                element.volume_m3 * self.material.density(f)
            })
            .sum()
    }

    /// −Σ force · displacement from rest: the potential of weight and point forces [J].
    pub fn load_energy_j(&self, positions: &[DVec3]) -> f64 {
        (self.forces_n.iter().zip(positions).zip(&self.rest))
            .map(|((force, x), rest)| -force.dot(*x - *rest))
            .sum()
    }

    /// Force of the tissue on every particle at `positions` [N]; on held ones it is what holds them,
    /// with the other sign, less the load there.
    pub fn elastic_forces_n(&self, positions: &[DVec3]) -> Vec<DVec3> {
        let mut forces = vec![DVec3::ZERO; positions.len()];
        for element in &self.elements {
            let stress = self
                .material
                .stress(element.deformation_gradient(positions));
            for (&corner, &g) in element.corners.iter().zip(&element.gradients) {
                forces[corner as usize] -= element.volume_m3 * (stress * g);
            }
        }
        forces
    }

    /// Smallest determinant of the deformation gradient at `positions`.
    pub fn smallest_volume_ratio(&self, positions: &[DVec3]) -> f64 {
        (self.elements.iter())
            .map(|element| element.deformation_gradient(positions).determinant())
            .fold(f64::INFINITY, f64::min)
    }

    /// Writes the lower triangle of the stiffness ∂²energy/∂x² of the free particles into `values`
    /// [N/m].
    pub(super) fn stiffness(&self, positions: &[DVec3], values: &mut Vec<f64>) {
        values.clear();
        values.resize(self.pattern.value_count(), 0.0);
        for (element, places) in self.elements.iter().zip(&self.places) {
            let f = element.deformation_gradient(positions);
            for a in 0..4 {
                for b in 0..=a {
                    let (ga, gb) = (element.gradients[a], element.gradients[b]);
                    let block = element.volume_m3 * self.material.stiffness(f, ga, gb);
                    for i in 0..3 {
                        for k in 0..=(if a == b { i } else { 2 }) {
                            let place = places[entry(3 * a + i, 3 * b + k)];
                            if place != NONE {
                                values[place as usize] += block.col(k)[i];
                            }
                        }
                    }
                }
            }
        }
    }

    /// Whether a particle cannot move: fixed, or in no element.
    pub(super) fn is_held(&self, particle: usize) -> bool {
        self.node_of[particle] == NONE
    }

    pub(super) fn pattern(&self) -> &Pattern {
        &self.pattern
    }

    /// The particle of each free node: rows 3n to 3n + 2 of the stiffness are its three axes.
    pub(super) fn free_particles(&self) -> &[u32] {
        &self.particle_of
    }

    pub(super) fn masses_kg(&self) -> &[f64] {
        &self.masses_kg
    }

    pub(super) fn forces_n(&self) -> &[DVec3] {
        &self.forces_n
    }

    /// Puts every particle that does not move to `share` of the way from rest to where it is held.
    pub(super) fn put_held(&self, positions: &mut [DVec3], share: f64) {
        for (i, x) in positions.iter_mut().enumerate() {
            if self.is_held(i) {
                *x = self.rest[i].lerp(self.held_at[i], share);
            }
        }
    }

    /// (λ + μ) times the volume of the body [J]: the energy of a strain of order 1.
    pub(super) fn modulus_times_volume_j(&self) -> f64 {
        let volume: f64 = self.elements.iter().map(|element| element.volume_m3).sum();
        (self.material.mu_pa + self.material.lambda_pa) * volume
    }

    /// What rounding of `positions` leaves of the forces at best [N], as the norm over all elements.
    pub(super) fn rounding_n(&self, positions: &[DVec3]) -> f64 {
        let modulus = self.material.mu_pa + self.material.lambda_pa;
        let squares: f64 = (self.elements.iter())
            .map(|element| {
                let steepness: f64 = element.gradients.iter().map(|g| g.length()).sum();
                let far = positions[element.corners[0] as usize].length();
                (modulus * element.volume_m3 * steepness * (1.0 + steepness * far)).powi(2)
            })
            .sum();
        f64::EPSILON * squares.sqrt()
    }
}

/// An element on `corners`; `None` if it has no volume to speak of.
fn element(rest: &[DVec3], corners: [u32; 4], fill: f64) -> Option<Element> {
    let [a, b, c, d] = corners.map(|i| rest[i as usize]);
    let edges = DMat3::from_cols(b - a, c - a, d - a);
    let volume = edges.determinant() / 6.0;
    let longest = [b - a, c - a, d - a, c - b, d - b, d - c]
        .iter()
        .map(|edge| edge.length())
        .fold(0.0, f64::max);
    (volume > VOLUME_SHARE_MIN * longest.powi(3)).then(|| {
        let rows = edges.inverse().transpose();
        let [g1, g2, g3] = [rows.x_axis, rows.y_axis, rows.z_axis];
        Element {
            corners,
            gradients: [-(g1 + g2 + g3), g1, g2, g3],
            volume_m3: fill * volume,
        }
    })
}

/// Number of entry (`row`, `column`) of a lower triangle stored row by row.
fn entry(row: usize, column: usize) -> usize {
    row * (row + 1) / 2 + column
}

/// Where the entries of an element's stiffness go; its `nodes` are [`NONE`] where they are held.
fn places(nodes: [u32; 4], pattern: &Pattern) -> [u32; 78] {
    let mut places = [NONE; 78];
    for row in 0..12 {
        for column in 0..=row {
            let (a, b) = (nodes[row / 3], nodes[column / 3]);
            if a != NONE && b != NONE {
                let (i, k) = (3 * a + row as u32 % 3, 3 * b + column as u32 % 3);
                places[entry(row, column)] = pattern.place(i.max(k), i.min(k));
            }
        }
    }
    places
}
