//! Tetrahedral meshes by formula that are shipped as files: bodies to measure mechanics on.

use super::TetMesh;
use super::export::msh_bytes;
use super::lattice::block_of_cells;
use super::organ::BundledFile;
use glam::{DVec3, Vec3};

/// A body to measure mechanics on.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Specimen {
    /// A box of 10 x 5 x 5 cm in 10 x 5 x 5 cells, from the origin.
    Beam,
    /// An ellipsoid of 12 x 8 x 6 cm in 10 x 10 x 10 cells, about the origin.
    Organ,
}

impl Specimen {
    /// Every specimen.
    pub const ALL: [Self; 2] = [Self::Beam, Self::Organ];

    /// The name of its file.
    pub fn name(self) -> &'static str {
        match self {
            Self::Beam => "beam",
            Self::Organ => "organ",
        }
    }

    /// Its tetrahedra, five a cell, all positive.
    pub fn mesh(self) -> TetMesh {
        match self {
            Self::Beam => {
                block_of_cells(Vec3::new(0.1, 0.05, 0.05), [10, 5, 5])
                    .1
                    .tets
            }
            Self::Organ => ellipsoid(DVec3::new(0.06, 0.04, 0.03), 10),
        }
    }

    /// `tets/NAME.msh`.
    pub fn bundled_file(self) -> BundledFile {
        BundledFile {
            path: format!("tets/{}.msh", self.name()),
            bytes: msh_bytes(&self.mesh()),
        }
    }
}

/// An ellipsoid of these half axes [m] about the origin: a cube of `cells` cells a side, blown up to
/// a ball and stretched.
pub fn ellipsoid(half_axes_m: DVec3, cells: usize) -> TetMesh {
    let mut mesh = block_of_cells(Vec3::splat(2.0), [cells; 3]).1.tets;
    for particle in &mut mesh.particles {
        *particle = (half_axes_m * ball_of_cube(particle.as_dvec3() - 1.0)).as_vec3();
    }
    mesh
}

/// Maps the cube from −1 to 1 onto the unit ball, each cube about the middle onto a sphere: |x|² of
/// the image is 1 − (1 − x²)(1 − y²)(1 − z²), which is 1 on the faces.
///
/// Source: Nowell, "Mapping a Cube to a Sphere", 2005.
fn ball_of_cube(x: DVec3) -> DVec3 {
    let s = x * x;
    let shrunk = |a: f64, b: f64| (1.0 - 0.5 * (a + b) + a * b / 3.0).sqrt();
    x * DVec3::new(shrunk(s.y, s.z), shrunk(s.z, s.x), shrunk(s.x, s.y))
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::tet::{self, volume_m3};

    #[test]
    fn every_tetrahedron_of_a_specimen_is_positive_and_together_they_have_the_volume() {
        // The ellipsoid loses what its flat facets cut off: 2.5 % at 10 cells.
        let ball = 4.0 / 3.0 * std::f64::consts::PI * 0.06 * 0.04 * 0.03;
        for (specimen, tets, volume, tolerance) in [
            (Specimen::Beam, 1250, 2.5e-4, 1e-6),
            (Specimen::Organ, 5000, ball, 0.03),
        ] {
            let mesh = specimen.mesh();
            assert_eq!(mesh.tets.len(), tets);
            let volumes: Vec<f64> = (0..tets)
                .map(|tet| volume_m3(tet::corners(&mesh, tet)))
                .collect();
            assert!(volumes.iter().all(|&v| v > 0.0), "{specimen:?}");
            let sum: f64 = volumes.iter().sum();
            assert!(
                (sum / volume - 1.0).abs() < tolerance,
                "{specimen:?}: {sum}"
            );
        }
    }

    #[test]
    fn the_faces_of_the_cube_land_on_the_ball() {
        for x in [DVec3::X, DVec3::new(1.0, 0.3, -0.8), DVec3::ONE] {
            assert!((ball_of_cube(x).length() - 1.0).abs() < 1e-12, "{x}");
        }
    }
}
