//! An even triangle mesh of a field's zero surface.
//!
//! A dual mesh over a grid is closed; then its points slide along the surface to the middle of
//! their neighbours, return to the surface, and edges are turned where that makes angles less
//! sharp.

use super::dual::dual_mesh;
use super::field::{METRES_PER_UNIT, Shape};
use glam::Vec3;

/// Rounds of sliding; half of them already leave no triangle with an angle below 20 degrees on
/// the bundled organs.
const ROUNDS: usize = 24;
/// Share of the way to the middle of the neighbours that a point slides in a round.
const SLIDE: f32 = 0.55;
/// Half the distance over which slopes of a field are taken [cm].
const SLOPE_STEP: f32 = 0.01;

/// Points [m] and triangles, counter-clockwise seen from outside.
pub fn surface(shape: &Shape) -> (Vec<Vec3>, Vec<[u32; 3]>) {
    let (mut points, mut triangles) = dual_mesh(shape);
    for round in 0..ROUNDS {
        turn_edges(&points, &mut triangles);
        slide(shape, &mut points, &triangles);
        if round + 1 == ROUNDS {
            for point in &mut points {
                *point = onto(shape, *point, shape.cell);
            }
        }
    }
    for point in &mut points {
        *point *= METRES_PER_UNIT;
    }
    (points, triangles)
}

/// The slope of the field.
fn slope(shape: &Shape, p: Vec3) -> Vec3 {
    let along =
        |axis: Vec3| (shape.field)(p + axis * SLOPE_STEP) - (shape.field)(p - axis * SLOPE_STEP);
    Vec3::new(along(Vec3::X), along(Vec3::Y), along(Vec3::Z)) / (2.0 * SLOPE_STEP)
}

/// The place on the surface near `p`, by Newton's method, at most `reach` away.
fn onto(shape: &Shape, p: Vec3, reach: f32) -> Vec3 {
    let mut q = p;
    for _ in 0..4 {
        let g = slope(shape, q);
        let squared = g.length_squared();
        if squared < 1e-6 {
            break;
        }
        let step = g * ((shape.field)(q) / squared);
        q -= step.clamp_length_max(0.5 * reach);
    }
    if q.distance(p) <= reach { q } else { p }
}

/// One round of sliding, weighted by area so that triangles come out equal.
fn slide(shape: &Shape, points: &mut [Vec3], triangles: &[[u32; 3]]) {
    let mut sums = vec![(Vec3::ZERO, 0.0_f32, Vec3::ZERO); points.len()];
    for t in triangles {
        let [a, b, c] = t.map(|p| points[p as usize]);
        let cross = (b - a).cross(c - a);
        let area = cross.length();
        let middle = (a + b + c) / 3.0;
        for p in t {
            let sum = &mut sums[*p as usize];
            sum.0 += area * middle;
            sum.1 += area;
            sum.2 += cross;
        }
    }
    for (point, (sum, area, cross)) in points.iter_mut().zip(sums) {
        if area <= 0.0 {
            continue;
        }
        let normal = cross.normalize_or_zero();
        let way = sum / area - *point;
        let slid = *point + SLIDE * 1.5 * (way - normal * normal.dot(way));
        *point = onto(shape, slid, shape.cell);
    }
}

/// Turns edges whose two opposite angles sum to more than 180 degrees, unless the surface bends
/// there or the new edge exists already.
fn turn_edges(points: &[Vec3], triangles: &mut [[u32; 3]]) {
    let mut edges: Vec<(u32, u32, u32, u8)> = Vec::with_capacity(3 * triangles.len());
    for (t, c) in triangles.iter().enumerate() {
        for k in 0..3 {
            let (a, b) = (c[k], c[(k + 1) % 3]);
            edges.push((a.min(b), a.max(b), t as u32, k as u8));
        }
    }
    edges.sort_unstable();
    let mut touched = vec![false; triangles.len()];
    let mut made: Vec<(u32, u32)> = Vec::new();
    for pair in edges.chunk_by(|x, y| (x.0, x.1) == (y.0, y.1)) {
        let [(_, _, t, i), (_, _, u, j)] = *pair else {
            continue;
        };
        let (t, u, i, j) = (t as usize, u as usize, i as usize, j as usize);
        if touched[t] || touched[u] {
            continue;
        }
        let (a, b, c) = (
            triangles[t][i],
            triangles[t][(i + 1) % 3],
            triangles[t][(i + 2) % 3],
        );
        let d = triangles[u][(j + 2) % 3];
        let new = (c.min(d), c.max(d));
        let at = |p: u32| points[p as usize];
        let cosine = |tip: u32| {
            (at(a) - at(tip))
                .normalize_or_zero()
                .dot((at(b) - at(tip)).normalize_or_zero())
        };
        // The sum of two angles is above 180 degrees where their cosines sum to below 0.
        if c == d || cosine(c) + cosine(d) > -1e-3 {
            continue;
        }
        let normal =
            |p: u32, q: u32, r: u32| (at(q) - at(p)).cross(at(r) - at(p)).normalize_or_zero();
        let flat = normal(a, b, c).dot(normal(b, a, d)) > 0.9
            && normal(a, d, c).dot(normal(d, b, c)) > 0.9;
        let exists =
            edges.binary_search_by(|e| (e.0, e.1).cmp(&new)).is_ok() || made.contains(&new);
        if !flat || exists {
            continue;
        }
        triangles[t] = [a, d, c];
        triangles[u] = [d, b, c];
        touched[t] = true;
        touched[u] = true;
        made.push(new);
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::organ::field::ellipsoid;
    use crate::geom::volume_m3;

    const BALL: Shape = Shape {
        field: |p| ellipsoid(p, Vec3::ZERO, Vec3::splat(3.0)),
        low: Vec3::splat(-4.0),
        high: Vec3::splat(4.0),
        cell: 0.4,
    };

    #[test]
    fn points_of_a_ball_lie_on_the_ball_and_its_volume_is_right() {
        let (points, triangles) = surface(&BALL);
        for p in &points {
            // Newton's method with slopes in f32 stops within 1 µm of 30 mm.
            assert!((p.length() - 0.03).abs() < 1e-6, "{p}");
        }
        let ball = 4.0 / 3.0 * std::f64::consts::PI * 0.03_f64.powi(3);
        // Chords 4 mm long under a radius of 30 mm lose about 1 % of the volume.
        let volume = volume_m3(&points, &triangles);
        assert!((volume / ball - 1.0).abs() < 0.015, "{volume} {ball}");
    }

    #[test]
    fn sliding_leaves_triangles_without_sharp_angles() {
        let sharpest = |points: &[Vec3], triangles: &[[u32; 3]]| {
            triangles
                .iter()
                .flat_map(|t| {
                    let p = t.map(|p| points[p as usize]);
                    (0..3)
                        .map(move |k| (p[(k + 1) % 3] - p[k]).angle_between(p[(k + 2) % 3] - p[k]))
                })
                .fold(f32::MAX, f32::min)
                .to_degrees()
        };
        let (points, triangles) = dual_mesh(&BALL);
        let before = sharpest(&points, &triangles);
        let (points, triangles) = surface(&BALL);
        let after = sharpest(&points, &triangles);
        assert!(before < 28.0, "the grid must leave work to do: {before}");
        assert!(after > 30.0, "{after}");
    }
}
