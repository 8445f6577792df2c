//! Tetrahedral meshes as bodies: their volumes, masses, shape quality and skin.

use super::TetMesh;
use super::lattice::boundary_triangles;
use glam::DVec3;

/// A tetrahedron with a radius ratio below this is a sliver.
pub const SLIVER_BELOW: f64 = 0.05;

/// The corners of tetrahedron `tet` [m].
pub fn corners(mesh: &TetMesh, tet: usize) -> [DVec3; 4] {
    mesh.tets[tet].map(|particle| mesh.particles[particle as usize].as_dvec3())
}

/// Signed volume of a tetrahedron [m³]; positive where the corners are ordered as [`TetMesh`] says.
pub fn volume_m3([a, b, c, d]: [DVec3; 4]) -> f64 {
    (b - a).dot((c - a).cross(d - a)) / 6.0
}

/// Masses [kg] of the particles: a quarter of each tetrahedron's mass a corner.
pub fn lumped_masses_kg(mesh: &TetMesh, density_kg_m3: f32) -> Vec<f32> {
    let mut masses = vec![0.0_f64; mesh.particles.len()];
    for (tet, particles) in mesh.tets.iter().enumerate() {
        let share = f64::from(density_kg_m3) * volume_m3(corners(mesh, tet)) / 4.0;
        for &particle in particles {
            masses[particle as usize] += share;
        }
    }
    masses.into_iter().map(|mass| mass as f32).collect()
}

/// Radius ratio 3 r / R of inscribed and circumscribed sphere: 1 for a regular tetrahedron, 0 for a
/// flat one.
///
/// With a, b, c the edges from one corner and A the sum of the four areas, r = 3V / A and
/// R = |a² (b×c) + b² (c×a) + c² (a×b)| / 12V.
pub fn radius_ratio(corners: [DVec3; 4]) -> f64 {
    let [a, b, c] = [1, 2, 3].map(|k| corners[k] - corners[0]);
    let (bc, ca, ab) = (b.cross(c), c.cross(a), a.cross(b));
    let volume = a.dot(bc).abs() / 6.0;
    let areas = 0.5 * (bc.length() + ca.length() + ab.length() + (bc + ca + ab).length());
    let circle =
        (a.length_squared() * bc + b.length_squared() * ca + c.length_squared() * ab).length();
    if volume > 0.0 && circle > 0.0 {
        3.0 * (3.0 * volume / areas) * (12.0 * volume / circle)
    } else {
        0.0
    }
}

/// The shape of the tetrahedra of a mesh.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct TetQuality {
    /// Median radius ratio.
    pub median: f64,
    /// The smallest radius ratio, and which tetrahedron has it.
    pub worst: f64,
    pub worst_tet: usize,
    /// Tetrahedra below [`SLIVER_BELOW`].
    pub slivers: usize,
}

/// Judges the tetrahedra of `mesh`; zeros if there are none.
pub fn quality(mesh: &TetMesh) -> TetQuality {
    let ratios: Vec<f64> = (0..mesh.tets.len())
        .map(|tet| radius_ratio(corners(mesh, tet)))
        .collect();
    let worst = (ratios.iter().enumerate()).min_by(|(_, a), (_, b)| a.total_cmp(b));
    let Some((worst_tet, &worst)) = worst else {
        return TetQuality::default();
    };
    let slivers = ratios.iter().filter(|&&ratio| ratio < SLIVER_BELOW).count();
    let mut sorted = ratios;
    let middle = sorted.len() / 2;
    let (_, &mut median, _) = sorted.select_nth_unstable_by(middle, f64::total_cmp);
    TetQuality {
        median,
        worst,
        worst_tet,
        slivers,
    }
}

/// The boundary of a tetrahedral mesh.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct Skin {
    /// The particle that each point of the surface is, in the order of the particles.
    pub particles: Vec<u32>,
    /// Triangles that face outwards; corners are points.
    pub triangles: Vec<[u32; 3]>,
}

impl Skin {
    /// V − E + F: 2 for every closed surface without handles, 0 for a torus. Edges are those that
    /// some triangle has.
    pub fn euler_number(&self) -> i64 {
        let mut edges: Vec<[u32; 2]> = (self.triangles.iter())
            .flat_map(|&[a, b, c]| [[a, b], [b, c], [c, a]])
            .map(|[a, b]| [a.min(b), a.max(b)])
            .collect();
        edges.sort_unstable();
        edges.dedup();
        self.particles.len() as i64 - edges.len() as i64 + self.triangles.len() as i64
    }
}

/// The faces of `mesh` that belong to one tetrahedron only, with one point a particle.
pub fn skin(mesh: &TetMesh) -> Skin {
    let faces = boundary_triangles(mesh);
    let mut point_of = vec![u32::MAX; mesh.particles.len()];
    for &particle in faces.as_flattened() {
        point_of[particle as usize] = 0;
    }
    let mut particles = Vec::new();
    for (particle, point) in point_of.iter_mut().enumerate() {
        if *point == 0 {
            *point = particles.len() as u32;
            particles.push(particle as u32);
        }
    }
    Skin {
        particles,
        triangles: faces
            .iter()
            .map(|face| face.map(|particle| point_of[particle as usize]))
            .collect(),
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::lattice::block_of_cells;
    use glam::Vec3;

    const REGULAR: [DVec3; 4] = [
        DVec3::new(1.0, 1.0, 1.0),
        DVec3::new(1.0, -1.0, -1.0),
        DVec3::new(-1.0, -1.0, 1.0),
        DVec3::new(-1.0, 1.0, -1.0),
    ];

    #[test]
    fn a_regular_tetrahedron_has_radius_ratio_1_at_any_size_and_place() {
        for (scale, shift) in [(1.0, 0.0), (1e-4, 0.3), (1e5, -7.0)] {
            let moved = REGULAR.map(|x| scale * x + DVec3::splat(shift));
            assert!((radius_ratio(moved) - 1.0).abs() < 1e-9, "at {scale}");
        }
    }

    #[test]
    fn a_tetrahedron_cut_off_a_cube_has_the_radius_ratio_of_its_spheres() {
        // Inscribed 1 / (3 + √3), circumscribed √3 / 2.
        let corner = [DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::Z];
        let expected = 3.0 / (3.0 + 3.0_f64.sqrt()) / (3.0_f64.sqrt() / 2.0);
        assert!((radius_ratio(corner) - expected).abs() < 1e-12);
        assert_eq!(
            radius_ratio([DVec3::ZERO, DVec3::X, DVec3::Y, DVec3::ONE - DVec3::Z]),
            0.0
        );
        assert_eq!(radius_ratio([DVec3::ONE; 4]), 0.0);
    }

    #[test]
    fn the_skin_of_a_block_is_closed_faces_outwards_and_leaves_out_the_inside() {
        let (_, block) = block_of_cells(Vec3::new(4.0, 3.0, 2.0), [4, 3, 2]);
        let skin = skin(&block.tets);
        let points: Vec<Vec3> = (skin.particles.iter())
            .map(|&particle| block.tets.particles[particle as usize])
            .collect();
        // 5 x 4 x 3 nodes, of which 3 x 2 x 1 are inside; two triangles a cell and side.
        assert_eq!(points.len(), 60 - 6);
        assert_eq!(skin.triangles.len(), 2 * 2 * (12 + 8 + 6));
        assert!((crate::geom::volume_m3(&points, &skin.triangles) - 24.0).abs() < 1e-6);
        assert!(skin.particles.is_sorted());
        assert_eq!(skin.euler_number(), 2);
    }

    #[test]
    fn lumped_masses_add_up_to_density_times_volume() {
        let (_, block) = block_of_cells(Vec3::new(0.1, 0.05, 0.05), [4, 2, 2]);
        let masses = lumped_masses_kg(&block.tets, 1000.0);
        let sum: f64 = masses.iter().map(|&mass| f64::from(mass)).sum();
        // The rounding of 45 masses to f32.
        assert!((sum - 0.25).abs() < 1e-7, "{sum}");
        assert!(masses.iter().all(|&mass| mass > 0.0));
    }
}
