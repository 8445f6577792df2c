//! The bundled organs, from formulas.
//!
//! Each organ is a field over space, negative inside ([`field`], one file an organ), whose zero
//! surface is meshed with even triangles ([`surface`]) and unwrapped. Only arithmetic that has the
//! same bits everywhere is used: no trigonometry, no exponentials, no threads.
//!
//! Axes are those of a patient who faces you: x to the patient's left, y up, z to the front.

mod bundle;
mod dual;
pub mod field;
mod heart;
mod liver;
mod surface;

pub use bundle::{BundledFile, MAP_SIZE_PX, bundled_files};

use super::SurfaceMesh;
use super::unwrap::unwrap;
use glam::Vec3;

/// An organ that comes with the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Organ {
    Liver,
    Heart,
}

/// What lies at a place of a bundled organ beside its tissue, each from 0 (absent) to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Features {
    /// Fat under the outer layer.
    pub fat: f32,
    /// The gallbladder, greenish under the liver.
    pub gallbladder: f32,
    /// Walls of arteries, pale and smooth.
    pub artery: f32,
    /// Walls of great veins and of the pulmonary trunk, bluish.
    pub vein: f32,
    /// The inside of a vessel cut open.
    pub lumen: f32,
    /// Thin-walled and darker: the atria.
    pub atrium: f32,
    /// Ligament and other tough, whitish tissue.
    pub ligament: f32,
}

impl Organ {
    /// Every organ.
    pub const ALL: [Self; 2] = [Self::Liver, Self::Heart];

    /// Name in file names.
    pub fn name(self) -> &'static str {
        match self {
            Self::Liver => "liver",
            Self::Heart => "heart",
        }
    }

    /// The surface [m]: closed, without handles, 8,000 to 11,000 triangles, unwrapped.
    pub fn mesh(self) -> SurfaceMesh {
        let (points, triangles) = self.surface();
        unwrap(&points, &triangles)
    }

    /// Points [m] and triangles, before unwrapping.
    pub fn surface(self) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let shape = match self {
            Self::Liver => liver::SHAPE,
            Self::Heart => heart::SHAPE,
        };
        surface::surface(&shape)
    }

    /// What lies at `place_m` beside the tissue that the organ is made of.
    pub fn features(self, place_m: Vec3) -> Features {
        let p = place_m / field::METRES_PER_UNIT;
        match self {
            Self::Liver => liver::features(p),
            Self::Heart => heart::features(p),
        }
    }

    /// Paths along which the organ's large surface vessels run [m]; each from its root on.
    pub fn vessel_paths(self) -> Vec<Vec<Vec3>> {
        let paths = match self {
            Self::Liver => liver::VESSELS,
            Self::Heart => heart::VESSELS,
        };
        paths
            .iter()
            .map(|path| {
                path.iter()
                    .map(|&p| Vec3::from(p) * field::METRES_PER_UNIT)
                    .collect()
            })
            .collect()
    }
}
