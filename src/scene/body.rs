//! `[body]`: what is prodded.

use super::beat::BeatSection;
use super::check::Checker;
use super::place::RestBox;
use crate::geom::paint::Tissue;
use glam::Vec3;
use serde::{Deserialize, Serialize};
use std::path::{Path, PathBuf};

/// A surface in a lattice, tetrahedra from a file, or a shape by formula.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct BodySection {
    /// A closed surface (glTF, GLB or OBJ), or tetrahedra (Gmsh's `.msh`). A bundled file, or a path.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub file: Option<PathBuf>,
    /// Instead of a file, a shape by formula.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub shape: Option<Shape>,
    /// Extent of the shape [m]; a sphere has the first as its diameter.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub extent_m: Option<Vec3>,
    /// Only the meshes of the file whose name contains one of these.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub meshes: Option<Vec<String>>,
    /// Longest extent of the body [m]; left out, the file's units are metres, and a shape is as `extent_m` says.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub size_m: Option<f32>,
    /// Edge of a lattice cell [m], of a graded slab the finest; left out, it follows from the volume and a budget of tetrahedra.
    /// Not for tetrahedra from a file, which are the cells.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub cell_m: Option<f32>,
    /// Mass a volume.
    #[serde(default = "default_density")]
    pub density_kg_m3: f32,
    /// Constant acceleration. Organs are loaded as they lie at rest, so theirs is zero.
    #[serde(default)]
    pub gravity_m_s2: Vec3,
    /// Velocities shrink by exp(−damping · time).
    #[serde(default = "default_damping")]
    pub damping_per_s: f32,
    /// Texture maps of the file's UV map. Left out, `tissue` is painted.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub maps: Option<MapFiles>,
    /// What the body is painted as when it has no maps.
    #[serde(default)]
    pub tissue: Tissue,
    /// Side of the painted maps [px].
    #[serde(default = "default_map_size")]
    pub map_size_px: u32,
    /// Where the body is held.
    #[serde(default, skip_serializing_if = "Vec::is_empty")]
    pub fixed: Vec<Region>,
    /// Muscle that beats.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub beat: Option<BeatSection>,
}

/// Shapes by formula.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq, Eq)]
#[serde(rename_all = "kebab-case")]
pub enum Shape {
    /// A flat box.
    Slab,
    /// A long box.
    Beam,
    /// A ball.
    Sphere,
    /// A box below the origin, whose cells are finest there, in the middle of its top (y = max), and
    /// grow with the distance: for a tool that presses it there.
    GradedSlab,
}

/// The texture maps of a surface, as files.
#[derive(Clone, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct MapFiles {
    /// sRGB colour of the outer layer; alpha is its opacity.
    pub outer: PathBuf,
    /// Tangent-space normals as glTF has them.
    pub normal: PathBuf,
    /// sRGB colour of the deep tissue.
    pub inner: PathBuf,
    /// Lower boundaries of four layers each, as shares of the deepest: one file, or a list.
    #[serde(deserialize_with = "one_or_more")]
    pub layers: Vec<PathBuf>,
}

/// A path, or a list of them.
fn one_or_more<'de, D: serde::Deserializer<'de>>(from: D) -> Result<Vec<PathBuf>, D::Error> {
    #[derive(Deserialize)]
    #[serde(untagged, expecting = "a path, or a list of paths")]
    enum Paths {
        One(PathBuf),
        More(Vec<PathBuf>),
    }
    Ok(match Paths::deserialize(from)? {
        Paths::One(path) => vec![path],
        Paths::More(paths) => paths,
    })
}

/// Where a body is held; exactly one of the forms.
#[derive(Clone, Debug, Default, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields, default)]
pub struct Region {
    /// Smallest and largest corner [m].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub box_m: Option<[Vec3; 2]>,
    /// The same, as shares of the body's box.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub box_share: Option<[Vec3; 2]>,
    /// A ball [m].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sphere_m: Option<Ball>,
    /// The same: centre as shares of the box, radius as a share of the longest extent.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub sphere_share: Option<Ball>,
    /// Everything behind a plane [m].
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plane_m: Option<HalfSpace>,
    /// The same, its point as shares of the box.
    #[serde(skip_serializing_if = "Option::is_none")]
    pub plane_share: Option<HalfSpace>,
}

/// A ball.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct Ball {
    /// Middle.
    pub center: Vec3,
    /// Radius.
    pub radius: f32,
}

/// What lies behind a plane: (x − point) · normal ≤ 0.
#[derive(Clone, Copy, Debug, Deserialize, Serialize, PartialEq)]
#[serde(deny_unknown_fields)]
pub struct HalfSpace {
    /// A point of the plane.
    pub point: Vec3,
    /// Points away from what is held.
    pub normal: Vec3,
}

fn default_density() -> f32 {
    1060.0
}

fn default_damping() -> f32 {
    6.0
}

fn default_map_size() -> u32 {
    1024
}

impl Region {
    /// Whether `x` [m] is held, for a body that fills `rest`.
    pub fn contains(&self, x: Vec3, rest: &RestBox) -> bool {
        let share = |s: Vec3| rest.low + s * (rest.high - rest.low);
        let in_box = |[low, high]: [Vec3; 2]| x.cmpge(low).all() && x.cmple(high).all();
        let in_ball = |center: Vec3, radius: f32| x.distance(center) <= radius;
        let behind = |point: Vec3, normal: Vec3| (x - point).dot(normal) <= 0.0;
        self.box_m.is_some_and(in_box)
            || self
                .box_share
                .is_some_and(|corners| in_box(corners.map(share)))
            || self.sphere_m.is_some_and(|b| in_ball(b.center, b.radius))
            || self
                .sphere_share
                .is_some_and(|b| in_ball(share(b.center), b.radius * rest.longest_m()))
            || self.plane_m.is_some_and(|h| behind(h.point, h.normal))
            || self
                .plane_share
                .is_some_and(|h| behind(share(h.point), h.normal))
    }
}

impl Region {
    pub(super) fn check(&self, key: &str, c: &mut Checker) {
        let given = [
            self.box_m.is_some(),
            self.box_share.is_some(),
            self.sphere_m.is_some(),
            self.sphere_share.is_some(),
            self.plane_m.is_some(),
            self.plane_share.is_some(),
        ];
        c.exactly_one(
            key,
            &given,
            "box_m, box_share, sphere_m, sphere_share, plane_m, plane_share",
        );
        for corners in [self.box_m, self.box_share].into_iter().flatten() {
            c.corners(key, corners);
        }
        for ball in [self.sphere_m, self.sphere_share].into_iter().flatten() {
            c.range3(&format!("{key}.center"), ball.center, -1e6, 1e6);
            c.range(&format!("{key}.radius"), ball.radius, 0.0, 1e6);
        }
        for plane in [self.plane_m, self.plane_share].into_iter().flatten() {
            c.range3(&format!("{key}.point"), plane.point, -1e6, 1e6);
            c.range3(&format!("{key}.normal"), plane.normal, -1e6, 1e6);
            if plane.normal.length() < 1e-6 {
                c.problem(&format!("{key}.normal"), "it must not be zero");
            }
        }
    }
}

impl BodySection {
    /// Makes relative paths start from `folder`, where they lead to something; else they may name
    /// something bundled.
    pub(super) fn resolve_files(&mut self, folder: &Path) {
        let resolve = |path: &mut PathBuf| {
            let beside = folder.join(&*path);
            if beside.exists() {
                *path = beside;
            }
        };
        self.file.as_mut().map(resolve);
        if let Some(maps) = &mut self.maps {
            for path in [&mut maps.outer, &mut maps.normal, &mut maps.inner] {
                resolve(path);
            }
            maps.layers.iter_mut().for_each(resolve);
        }
    }

    /// Whether the file holds tetrahedra, by its ending.
    pub fn names_tets(&self) -> bool {
        let ending = self.file.as_ref().and_then(|file| file.extension());
        ending.is_some_and(|ending| ending.eq_ignore_ascii_case("msh"))
    }

    /// Refuses what only a surface has.
    fn check_tets(&self, c: &mut Checker) {
        if self.cell_m.is_some() {
            c.problem(
                "body.cell_m",
                "a lattice is made round a surface; the tetrahedra of a .msh file are taken as they \
                 are, so leave it out",
            );
        }
        if self.meshes.is_some() {
            c.problem("body.meshes", "a .msh file is taken whole, so leave it out");
        }
        if self.maps.is_some() {
            c.problem(
                "body.maps",
                "a .msh file has no texture coordinates that maps could be made for: leave them \
                 out, and the body is painted as body.tissue",
            );
        }
    }

    pub(super) fn check(&self, c: &mut Checker) {
        if self.names_tets() {
            self.check_tets(c);
        }
        c.exactly_one(
            "body",
            &[self.file.is_some(), self.shape.is_some()],
            "file, shape",
        );
        if self.shape.is_some() != self.extent_m.is_some() {
            c.problem("body.extent_m", "a shape needs an extent, and only a shape");
        }
        if let Some(extent) = self.extent_m {
            c.range3("body.extent_m", extent, 1e-4, 100.0);
        }
        if let Some(size) = self.size_m {
            c.range("body.size_m", size, 1e-4, 100.0);
        }
        if let Some(cell) = self.cell_m {
            c.range("body.cell_m", cell, 1e-5, 10.0);
        }
        c.range("body.density_kg_m3", self.density_kg_m3, 1.0, 30_000.0);
        c.range3("body.gravity_m_s2", self.gravity_m_s2, -1000.0, 1000.0);
        c.range("body.damping_per_s", self.damping_per_s, 0.0, 1000.0);
        c.range("body.map_size_px", self.map_size_px as f32, 64.0, 4096.0);
        for (index, region) in self.fixed.iter().enumerate() {
            region.check(&format!("body.fixed.{index}"), c);
        }
        if let Some(beat) = &self.beat {
            beat.check(c);
        }
    }
}
