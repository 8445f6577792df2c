//! Bodies of the study: bundled organs meshed as finely as asked, a ball with bumps, and any closed surface.

use crate::app::AppError;
use crate::geom::import::{ImportOptions, UvState, read_surface};
use crate::geom::organ::Organ;
use crate::geom::tangent::{Fans, rest_normals};
use crate::geom::unwrap::unwrap;
use crate::geom::{SurfaceMesh, bounds};
use glam::Vec3;
use serde::{Deserialize, Serialize};
use std::path::Path;

/// A body by formula.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Shape {
    Liver,
    Kidney,
    Spleen,
    /// A flattened ball with bumps, a groove and a dent.
    Blob,
}

impl Shape {
    /// Every shape.
    const ALL: [Self; 4] = [Self::Liver, Self::Kidney, Self::Spleen, Self::Blob];

    /// As rows call it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Liver => "liver",
            Self::Kidney => "kidney",
            Self::Spleen => "spleen",
            Self::Blob => "blob",
        }
    }

    /// The shape of that name.
    pub fn named(name: &str) -> Option<Self> {
        Self::ALL.into_iter().find(|shape| shape.name() == name)
    }
}

/// A surface at rest, about the origin, and how it lies.
#[derive(Clone, Debug)]
pub struct Body {
    /// The surface; its longest extent is the size that was asked for.
    pub mesh: SurfaceMesh,
    /// Unit normal of each point.
    pub normals: Vec<Vec3>,
    /// Longest extent [m].
    pub size_m: f32,
    /// Axes of the box, longest first, right-handed.
    pub axes: [Vec3; 3],
    /// Extents along them [m].
    pub extents_m: Vec3,
    /// The point that is prodded: outermost along the shortest axis near the middle.
    pub poked: usize,
}

impl Body {
    /// A body by formula of about so many `vertices`.
    pub fn of_shape(shape: Shape, vertices: u32, size_m: f32) -> Self {
        let (points, triangles) = match shape {
            Shape::Liver => Organ::Liver.surface_of_about(vertices as usize),
            Shape::Kidney => Organ::Kidney.surface_of_about(vertices as usize),
            Shape::Spleen => Organ::Spleen.surface_of_about(vertices as usize),
            Shape::Blob => blob(vertices),
        };
        Self::new(unwrap(&points, &triangles), size_m)
    }

    /// The closed surface in `file`, as fine as it is there.
    ///
    /// # Errors
    ///
    /// [`AppError::Import`] if it holds none.
    pub fn of_file(file: &Path, size_m: f32) -> Result<Self, AppError> {
        let imported = read_surface(file, &ImportOptions::default()).map_err(AppError::Import)?;
        let mesh = imported.mesh;
        Ok(Self::new(
            match imported.uv {
                UvState::Usable => mesh,
                _ => unwrap(&mesh.points, &mesh.point_triangles()),
            },
            size_m,
        ))
    }

    /// `mesh` brought about the origin and to its size.
    fn new(mut mesh: SurfaceMesh, size_m: f32) -> Self {
        let (low, high) = bounds(&mesh.points);
        let scale = size_m / (high - low).max_element();
        for point in &mut mesh.points {
            *point = scale * (*point - 0.5 * (low + high));
        }
        Self::as_it_lies(mesh)
    }

    /// A surface as large and where it is.
    pub fn as_it_lies(mesh: SurfaceMesh) -> Self {
        let (low, high) = bounds(&mesh.points);
        let extents = high - low;
        let mut order = [0, 1, 2];
        order.sort_by(|&a: &usize, &b| extents[b].total_cmp(&extents[a]));
        let axis = |i: usize| Vec3::AXES[order[i]];
        let axes = [axis(0), axis(1), axis(0).cross(axis(1))];
        let normals = rest_normals(&mesh, &Fans::new(&mesh));
        let outermost = |p: &Vec3| {
            let aside = (*p - p.dot(axes[2]) * axes[2]).length();
            p.dot(axes[2]) - 0.5 * aside
        };
        let poked = (0..mesh.points.len())
            .max_by(|&a, &b| outermost(&mesh.points[a]).total_cmp(&outermost(&mesh.points[b])))
            .expect("a closed surface has points");
        Self {
            normals,
            size_m: extents.max_element(),
            axes,
            extents_m: Vec3::from_array(order.map(|axis| extents[axis])),
            poked,
            mesh,
        }
    }
}

/// A ball of triangles halved until it has at least nearly so many points, pressed flat and made uneven.
fn blob(vertices: u32) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let (mut points, mut triangles) = icosahedron();
    while points.len() < (vertices as usize) * 2 / 3 {
        (points, triangles) = halved(&points, &triangles);
    }
    for point in &mut points {
        let n = *point;
        let bumps = 0.06 * (5.0 * n.x + 1.0).sin() * (4.0 * n.y).cos()
            + 0.03 * (11.0 * n.z + 3.0 * n.x).sin();
        let groove = 0.10 * (-(n.x - 0.25).powi(2) / 0.01).exp() * n.z.max(0.0);
        let dent =
            0.12 * (-(n - Vec3::new(-0.5, 0.6, 0.6).normalize()).length_squared() / 0.06).exp();
        *point = n * Vec3::new(1.0, 0.7, 0.5) * (1.0 + bumps - groove - dent);
    }
    (points, triangles)
}

fn icosahedron() -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let g = 0.5 * (1.0 + 5.0_f32.sqrt());
    let rectangle = [[-1.0, g], [1.0, g], [-1.0, -g], [1.0, -g]];
    let points = [
        rectangle.map(|[a, b]| Vec3::new(a, b, 0.0)),
        rectangle.map(|[a, b]| Vec3::new(0.0, a, b)),
        rectangle.map(|[a, b]| Vec3::new(b, 0.0, a)),
    ];
    let triangles = vec![
        [0, 11, 5],
        [0, 5, 1],
        [0, 1, 7],
        [0, 7, 10],
        [0, 10, 11],
        [1, 5, 9],
        [5, 11, 4],
        [11, 10, 2],
        [10, 7, 6],
        [7, 1, 8],
        [3, 9, 4],
        [3, 4, 2],
        [3, 2, 6],
        [3, 6, 8],
        [3, 8, 9],
        [4, 9, 5],
        [2, 4, 11],
        [6, 2, 10],
        [8, 6, 7],
        [9, 8, 1],
    ];
    (
        points.concat().into_iter().map(Vec3::normalize).collect(),
        triangles,
    )
}

fn halved(points: &[Vec3], triangles: &[[u32; 3]]) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let mut points = points.to_vec();
    let mut middles = std::collections::HashMap::new();
    let mut middle = |a: u32, b: u32| {
        *middles.entry((a.min(b), a.max(b))).or_insert_with(|| {
            points.push((points[a as usize] + points[b as usize]).normalize());
            points.len() as u32 - 1
        })
    };
    let triangles = triangles
        .iter()
        .flat_map(|&[a, b, c]| {
            let (ab, bc, ca) = (middle(a, b), middle(b, c), middle(c, a));
            [[a, ab, ca], [b, bc, ab], [c, ca, bc], [ab, bc, ca]]
        })
        .collect();
    (points, triangles)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn blob_is_closed_outward_and_as_fine_as_asked() {
        for (asked, points) in [(600, 642), (2500, 2562)] {
            let body = Body::of_shape(Shape::Blob, asked, 0.15);
            assert_eq!(body.mesh.points.len(), points);
            let volume = body.mesh.volume_m3();
            // Of a box of 0.15 x 0.105 x 0.075 m an ellipsoid fills a half.
            assert!((0.0003..0.0008).contains(&volume), "{volume}");
            assert!((body.extents_m.x - 0.15).abs() < 1e-6);
            assert!(body.extents_m.x >= body.extents_m.y && body.extents_m.y >= body.extents_m.z);
            let poked = body.mesh.points[body.poked];
            assert!(poked.dot(body.axes[2]) > 0.3 * body.extents_m.z, "{poked}");
            assert!(body.normals[body.poked].dot(body.axes[2]) > 0.5);
        }
    }
}
