//! Bodies that studies measure: tetrahedra held at one end, with a tip that is watched.

use crate::geom::lattice::block_of_cells;
use crate::geom::specimen::ellipsoid;
use crate::geom::tet::{lumped_masses_kg, skin};
use crate::geom::{Embedding, TetMesh, bounds};
use crate::sim::BodySetup;
use crate::sim::diagnose::tet_volume_m3;
use glam::{DVec3, Vec3};
use serde::{Deserialize, Serialize};

/// Standard gravity, downwards [m/s²].
pub const GRAVITY_M_S2: Vec3 = Vec3::new(0.0, 0.0, -9.81);
/// Extent of the beam [m].
const BEAM_M: Vec3 = Vec3::new(0.1, 0.05, 0.05);
/// Half axes of the organ [m].
const ORGAN_M: DVec3 = DVec3::new(0.06, 0.04, 0.03);
/// How near the end of a body a particle is to belong to it, as a share of the longest extent.
const END_SHARE: f32 = 1e-6;
/// How much of its height a standing body is held by.
const FOOT_SHARE: f32 = 0.15;

/// Where a body is held.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Hold {
    /// At its smallest x, so that it hangs out along x; its tip is its largest x.
    End,
    /// By its lowest 15 %, so that it stands; its tip is its highest particle.
    Foot,
}

/// A held body.
#[derive(Clone, Debug)]
pub struct HeldBody {
    /// Undamped, under gravity.
    pub setup: BodySetup,
    /// The particles whose mean is the tip.
    tip: Vec<usize>,
    /// Longest extent at rest [m].
    pub size_m: f64,
}

impl HeldBody {
    /// `tets` of one density, held.
    pub fn new(tets: TetMesh, density_kg_m3: f32, hold: Hold) -> Self {
        let particles = &tets.particles;
        let (low, high) = bounds(particles);
        let size_m = (high - low).max_element();
        let near = END_SHARE * size_m;
        let fixed = particles.iter().map(|x| match hold {
            Hold::End => x.x <= low.x + near,
            Hold::Foot => x.z <= low.z + FOOT_SHARE * (high.z - low.z),
        });
        let skin = skin(&tets);
        let setup = BodySetup {
            masses_kg: lumped_masses_kg(&tets, density_kg_m3),
            fixed: fixed.collect(),
            fill: Vec::new(),
            activity: Vec::new(),
            triangles: skin.triangles,
            embedding: Embedding {
                particles: skin.particles.iter().map(|&i| [i; 4]).collect(),
                weights: vec![[1.0, 0.0, 0.0, 0.0]; skin.particles.len()],
            },
            gravity_m_s2: GRAVITY_M_S2,
            damping_per_s: 0.0,
            tets,
        }
        .numbered_along();
        let is_tip = |x: &Vec3| match hold {
            Hold::End => x.x >= high.x - near,
            Hold::Foot => x.z >= high.z - near,
        };
        let particles = setup.tets.particles.iter().enumerate();
        Self {
            tip: particles
                .filter(|(_, x)| is_tip(x))
                .map(|(i, _)| i)
                .collect(),
            size_m: f64::from(size_m),
            setup,
        }
    }

    /// Particles at the tip.
    pub fn tip(&self) -> &[usize] {
        &self.tip
    }

    /// Particles that can move.
    pub fn free(&self) -> impl Iterator<Item = usize> + '_ {
        let fixed = &self.setup.fixed;
        (0..fixed.len()).filter(|&i| !fixed[i])
    }

    /// Mean displacement of the tip [m], for particles at `positions`.
    pub fn tip_m(&self, positions: &[Vec3]) -> DVec3 {
        self.mean_displacement_m(|i| positions[i].as_dvec3())
    }

    /// The same, for an oracle's positions.
    pub fn tip_of_oracle_m(&self, positions: &[DVec3]) -> DVec3 {
        self.mean_displacement_m(|i| positions[i])
    }

    fn mean_displacement_m(&self, position: impl Fn(usize) -> DVec3) -> DVec3 {
        let rest = &self.setup.tets.particles;
        let moved = |&i: &usize| position(i) - rest[i].as_dvec3();
        self.tip.iter().map(moved).sum::<DVec3>() / self.tip.len() as f64
    }

    /// Largest distance of a particle from its rest [m]; infinite if one is nowhere.
    pub fn farthest_m(&self, positions: &[Vec3]) -> f64 {
        let pairs = positions.iter().zip(&self.setup.tets.particles);
        let distances = pairs.map(|(x, rest)| f64::from(x.distance(*rest)));
        distances.fold(
            0.0,
            |a, b| if b.is_nan() { f64::INFINITY } else { b.max(a) },
        )
    }

    /// Edge of a regular tetrahedron of the mean volume [m].
    pub fn edge_m(&self) -> f64 {
        let tets = &self.setup.tets;
        let volumes = tets
            .tets
            .iter()
            .map(|&tet| tet_volume_m3(&tets.particles, tet));
        (volumes.sum::<f64>() / tets.tets.len() as f64 * 72.0_f64.sqrt()).cbrt()
    }
}

/// A beam of 10 × 5 × 5 cm, `cells_across` its side: 10 n³ tetrahedra.
pub fn beam(cells_across: u32) -> TetMesh {
    let n = cells_across as usize;
    block_of_cells(BEAM_M, [2 * n, n, n]).1.tets
}

/// An ellipsoid of 12 × 8 × 6 cm from a cube of n³ cells blown up to a ball: 5 n³ tetrahedra, poor
/// ones where the edges of the cube were.
pub fn organ(cells: usize) -> TetMesh {
    ellipsoid(ORGAN_M, cells)
}

/// `tets` in another size.
pub fn scaled(mut tets: TetMesh, factor: f32) -> TetMesh {
    for particle in &mut tets.particles {
        *particle *= factor;
    }
    tets
}

/// `tets` with a sliver: the particle nearest to the middle is moved towards the opposite face of one
/// of its tetrahedra until that has `ratio` of its volume, and all others still have one.
///
/// # Panics
///
/// If no tetrahedron round that particle can be flattened so.
pub fn with_sliver(mut tets: TetMesh, ratio: f32) -> TetMesh {
    let (low, high) = bounds(&tets.particles);
    let middle = (low + high) / 2.0;
    let distance = |i: &usize| tets.particles[*i].distance_squared(middle);
    let moved = (0..tets.particles.len())
        .min_by(|a, b| distance(a).total_cmp(&distance(b)))
        .expect("a body has particles");
    let home = tets.particles[moved];
    let around: Vec<[u32; 4]> = (tets.tets.iter())
        .filter(|tet| tet.contains(&(moved as u32)))
        .copied()
        .collect();
    for tet in &around {
        let others: Vec<Vec3> = (tet.iter())
            .filter(|&&corner| corner as usize != moved)
            .map(|&corner| tets.particles[corner as usize])
            .collect();
        let normal = (others[1] - others[0])
            .cross(others[2] - others[0])
            .normalize();
        let height = normal * (home - others[0]).dot(normal);
        tets.particles[moved] = home - (1.0 - ratio) * height;
        if around
            .iter()
            .all(|&tet| tet_volume_m3(&tets.particles, tet) > 0.0)
        {
            return tets;
        }
    }
    panic!("one of the tetrahedra round a particle inside can be flattened");
}

#[cfg(test)]
mod tests {
    use super::*;

    fn volumes_m3(tets: &TetMesh) -> Vec<f64> {
        let volume = |&tet: &[u32; 4]| tet_volume_m3(&tets.particles, tet);
        tets.tets.iter().map(volume).collect()
    }

    #[test]
    fn beam_has_ten_tetrahedra_a_cubed_cell_and_its_weight() {
        let beam = HeldBody::new(beam(5), 1000.0, Hold::End);
        assert_eq!(beam.setup.tets.tets.len(), 1250);
        let mass: f32 = beam.setup.masses_kg.iter().sum();
        // 250 cm³ of water; single precision sums of 396 masses.
        assert!((mass - 0.25).abs() < 1e-5, "{mass} kg");
        assert_eq!(beam.setup.fixed.iter().filter(|&&fixed| fixed).count(), 36);
        assert_eq!(beam.tip.len(), 36);
        // Six sides of 50 or 100 triangles.
        assert_eq!(beam.setup.triangles.len(), 2 * 50 + 4 * 100);
    }

    #[test]
    fn tip_of_a_shifted_beam_moves_by_the_shift() {
        let beam = HeldBody::new(beam(2), 1000.0, Hold::End);
        let shift = Vec3::new(0.01, 0.0, -0.25);
        let rest = &beam.setup.tets.particles;
        let mut moved: Vec<Vec3> = rest.iter().map(|x| *x + shift).collect();
        // Single precision places a centimetre apart.
        assert!((beam.tip_m(&moved) - shift.as_dvec3()).length() < 1e-7);
        assert!((beam.farthest_m(&moved) - shift.as_dvec3().length()).abs() < 1e-7);
        moved[3].y = f32::NAN;
        moved[5].y = 1.0;
        assert_eq!(beam.farthest_m(&moved), f64::INFINITY);
    }

    #[test]
    fn sliver_is_a_thousandth_and_nothing_else_is_inverted() {
        let plain = beam(5);
        let usual = volumes_m3(&plain)[0];
        let volumes = volumes_m3(&with_sliver(plain, 1e-3));
        let smallest = volumes.iter().copied().fold(f64::MAX, f64::min);
        // The first tetrahedron of a cell has a sixth of it or a third; single precision heights.
        let ratio = smallest / usual;
        assert!((0.4e-3..2.2e-3).contains(&ratio), "{ratio}");
        assert_eq!(volumes.iter().filter(|&&v| v < 0.1 * usual).count(), 1);
    }

    #[test]
    fn organ_fills_its_ellipsoid_and_has_poor_tetrahedra() {
        let volumes = volumes_m3(&organ(6));
        let ellipsoid = 4.0 / 3.0 * std::f64::consts::PI * ORGAN_M.element_product();
        let sum: f64 = volumes.iter().sum();
        // Flat facets of a sixth of the side cut off some percent.
        assert!(
            (0.9..1.0).contains(&(sum / ellipsoid)),
            "{}",
            sum / ellipsoid
        );
        let mean = sum / volumes.len() as f64;
        let smallest = volumes.iter().copied().fold(f64::MAX, f64::min);
        assert!(
            0.0 < smallest && smallest < 0.2 * mean,
            "{}",
            smallest / mean
        );
    }
}
