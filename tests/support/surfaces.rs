//! Small surfaces by formula, and ways to deform them.

use super::SurfaceMesh;
use glam::{Mat3, Quat, Vec2, Vec3};

/// An open square of `side` by `side` points, 0.1 m wide, with waves 4 mm high.
///
/// No two points have the same fit, and the UV map is sheared, so that a mixed-up index shows.
pub fn wavy(side: usize) -> SurfaceMesh {
    let steps = (side - 1).max(1) as f32;
    let mut mesh = SurfaceMesh::default();
    for row in 0..side {
        for column in 0..side {
            let (s, t) = (column as f32 / steps, row as f32 / steps);
            let height = 0.004 * ((7.0 * s + 0.3).sin() + (5.0 * t - 0.2).cos() * (3.0 * s).cos());
            mesh.point_of.push(mesh.points.len() as u32);
            mesh.points.push(Vec3::new(0.1 * s, height, 0.1 * t));
            mesh.uvs.push(Vec2::new(s + 0.2 * t, 0.9 * t));
        }
    }
    let at = |row: usize, column: usize| (row * side + column) as u32;
    for row in 0..side.saturating_sub(1) {
        for column in 0..side - 1 {
            let [a, b] = [at(row, column), at(row, column + 1)];
            let [c, d] = [at(row + 1, column), at(row + 1, column + 1)];
            mesh.triangles.push([a, c, b]);
            mesh.triangles.push([b, c, d]);
        }
    }
    mesh
}

/// A sphere of meridians and parallels, with a UV seam and poles: points and vertices differ.
pub fn sphere(radius_m: f32, meridians: usize, parallels: usize) -> SurfaceMesh {
    let mut mesh = SurfaceMesh::default();
    let direction = |parallel: usize, meridian: usize| {
        let polar = std::f32::consts::PI * parallel as f32 / (parallels + 1) as f32;
        let around = std::f32::consts::TAU * meridian as f32 / meridians as f32;
        Vec3::new(
            polar.sin() * around.cos(),
            polar.cos(),
            -polar.sin() * around.sin(),
        )
    };
    mesh.points.push(Vec3::Y * radius_m);
    for parallel in 1..=parallels {
        for meridian in 0..meridians {
            mesh.points.push(radius_m * direction(parallel, meridian));
        }
    }
    mesh.points.push(Vec3::NEG_Y * radius_m);
    let south = mesh.points.len() as u32 - 1;
    // One vertex more than points on each parallel: the seam. One vertex a triangle at the poles.
    for parallel in 0..parallels + 2 {
        for meridian in 0..=meridians {
            let point = match parallel {
                0 => 0,
                p if p == parallels + 1 => south,
                p => (1 + (p - 1) * meridians + meridian % meridians) as u32,
            };
            mesh.point_of.push(point);
            mesh.uvs.push(Vec2::new(
                meridian as f32 / meridians as f32,
                parallel as f32 / (parallels + 1) as f32,
            ));
        }
    }
    let at = |parallel: usize, meridian: usize| (parallel * (meridians + 1) + meridian) as u32;
    for parallel in 0..=parallels {
        for meridian in 0..meridians {
            let [a, b] = [at(parallel, meridian), at(parallel, meridian + 1)];
            let [c, d] = [at(parallel + 1, meridian), at(parallel + 1, meridian + 1)];
            if parallel > 0 {
                mesh.triangles.push([a, c, b]);
            }
            if parallel < parallels {
                mesh.triangles.push([b, c, d]);
            }
        }
    }
    mesh
}

/// Twisted about z, sheared and dented: no rigid motion, and nothing stays where it was.
pub fn deformed(points: &[Vec3]) -> Vec<Vec3> {
    points
        .iter()
        .map(|&p| {
            let dent = 0.01 * (-(p - points[points.len() / 2]).length_squared() / 4e-4).exp();
            let sheared = Mat3::from_cols(
                Vec3::new(1.3, 0.1, 0.0),
                Vec3::new(0.2, 0.8, 0.1),
                Vec3::new(0.0, -0.1, 1.1),
            ) * p;
            Quat::from_rotation_z(9.0 * p.z) * (sheared - dent * Vec3::Y)
        })
        .collect()
}
