//! Surfaces in f64 by brute force: normals, texture axes, patches and planes as their definitions say, without
//! the lists and orders that the kernels and their twins share.

#![allow(dead_code)] // Each test binary asks for a part of it.

use glam::{DMat2, DVec2, DVec3};
use palpate::geom::plane::exact_plane;

/// Points that a patch has at least.
const MEMBERS_MIN: usize = 16;

/// A surface as it lies at one time.
#[derive(Clone, Debug)]
pub struct Surface {
    /// Position of each point [m].
    pub points: Vec<DVec3>,
    /// The point of each vertex.
    pub point_of: Vec<u32>,
    /// Texture coordinate of each vertex.
    pub uvs: Vec<DVec2>,
    /// Corners are vertices.
    pub triangles: Vec<[u32; 3]>,
}

impl Surface {
    fn corners(&self, triangle: [u32; 3]) -> [DVec3; 3] {
        triangle.map(|vertex| self.points[self.point_of[vertex as usize] as usize])
    }

    /// Area-weighted unit normal of each point; zero where its triangles span no area.
    pub fn normals(&self) -> Vec<DVec3> {
        let mut sums = vec![DVec3::ZERO; self.points.len()];
        for &triangle in &self.triangles {
            let [a, b, c] = self.corners(triangle);
            for vertex in triangle {
                sums[self.point_of[vertex as usize] as usize] += (b - a).cross(c - a);
            }
        }
        sums.into_iter().map(DVec3::normalize_or_zero).collect()
    }

    /// `∂x/∂u` and `∂x/∂v` of each vertex, weighted by area, in the plane of `normals`; `None` where the texture
    /// map has no area or its axes are nearly parallel, so that they have no dual basis.
    pub fn uv_axes(&self, normals: &[DVec3]) -> Vec<Option<[DVec3; 2]>> {
        let mut sums = vec![([DVec3::ZERO; 2], 0.0); self.uvs.len()];
        for &triangle in &self.triangles {
            let [x0, x1, x2] = self.corners(triangle);
            let [w0, w1, w2] = triangle.map(|vertex| self.uvs[vertex as usize]);
            let (d1, d2) = (w1 - w0, w2 - w0);
            let edges = DMat2::from_cols(d1, d2);
            if edges.determinant().abs() < 1e-5 * (d1.length_squared() + d2.length_squared()) {
                // Too thin to tell; its vertices are left out below by what it would have weighed.
                continue;
            }
            let inverse = edges.inverse();
            let area = (x1 - x0).cross(x2 - x0).length();
            for vertex in triangle {
                let (axes, weight) = &mut sums[vertex as usize];
                for (k, axis) in axes.iter_mut().enumerate() {
                    let column = inverse.col(k);
                    *axis += area * (column.x * (x1 - x0) + column.y * (x2 - x0));
                }
                *weight += area;
            }
        }
        sums.into_iter()
            .zip(&self.point_of)
            .map(|((axes, weight), &point)| {
                let n = normals[point as usize];
                let axes = axes.map(|axis| (axis - n * n.dot(axis)) / weight);
                let [pu, pv] = axes;
                let is_sound = weight > 0.0
                    && pu.cross(pv).length() > 0.05 * pu.length() * pv.length()
                    && pu.length() > 0.0;
                is_sound.then_some(axes)
            })
            .collect()
    }
}

/// The patch of each point: all points within `radius_m` whose normals are not opposed, at least the 16 nearest
/// such points; who is in a patch has its point in his own.
pub fn patches(points: &[DVec3], normals: &[DVec3], radius_m: f64) -> Vec<Vec<usize>> {
    let mut patches: Vec<Vec<usize>> = Vec::with_capacity(points.len());
    let mut given = Vec::new();
    for (i, &at) in points.iter().enumerate() {
        let mut facing: Vec<(f64, usize)> = (0..points.len())
            .filter(|&j| i == j || normals[i].dot(normals[j]) > 0.0)
            .map(|j| (at.distance_squared(points[j]), j))
            .collect();
        let wanted = |entry: &(f64, usize)| entry.0 <= radius_m * radius_m;
        let within = facing.iter().filter(|entry| wanted(entry)).count();
        if within < MEMBERS_MIN && facing.len() > MEMBERS_MIN {
            facing.select_nth_unstable_by(MEMBERS_MIN, |a, b| a.0.total_cmp(&b.0));
            facing.truncate(MEMBERS_MIN);
            given.extend(facing.iter().map(|&(_, j)| (j, i)));
        } else if within >= MEMBERS_MIN {
            facing.retain(wanted);
        }
        patches.push(facing.into_iter().map(|(_, j)| j).collect());
    }
    for (i, j) in given {
        if !patches[i].contains(&j) {
            patches[i].push(j);
        }
    }
    patches
}

/// A unit normal and a signed offset [m]: `{ x : normal · (x - P) = offset }`.
pub type ExactPlane = (DVec3, f64);

/// Least-squares plane of each patch, turned to the side of `normals`.
pub fn planes(points: &[DVec3], normals: &[DVec3], patches: &[Vec<usize>]) -> Vec<ExactPlane> {
    patches
        .iter()
        .enumerate()
        .map(|(i, members)| {
            let members = members.iter().map(|&j| points[j]);
            exact_plane(members, points[i], normals[i]).expect("a patch has 16 members")
        })
        .collect()
}

/// Angle between two directions of any length [degrees].
pub fn degrees_between(a: DVec3, b: DVec3) -> f64 {
    a.cross(b).length().atan2(a.dot(b)).to_degrees()
}

/// The value below which `share` of `values` lie. What is not a number is the largest.
///
/// # Panics
///
/// If there are no values.
pub fn percentile(values: impl IntoIterator<Item = f64>, share: f64) -> f64 {
    let mut sorted: Vec<f64> = values
        .into_iter()
        .map(|value| if value.is_nan() { f64::INFINITY } else { value })
        .collect();
    assert!(!sorted.is_empty(), "no values to rank");
    sorted.sort_by(f64::total_cmp);
    sorted[((sorted.len() - 1) as f64 * share).round() as usize]
}

/// The 99.9th percentile of the angles between directions of the same index [degrees].
pub fn angle_p999<'a>(
    found: impl IntoIterator<Item = &'a DVec3>,
    exact: impl IntoIterator<Item = &'a DVec3>,
) -> f64 {
    let pairs = found.into_iter().zip(exact);
    percentile(pairs.map(|(a, b)| degrees_between(*a, *b)), 0.999)
}
