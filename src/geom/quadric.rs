//! The paraboloid that stands for the surface near a point, where light is followed to its entry.
//!
//! `z = ½ (a u² + 2 b u v + c v²)` above the tangent plane at P, z along the normal: a symmetric matrix Q [1/m]
//! that takes the normal to zero, `z = ½ d·Q d`. It passes through P and has the tangent plane there, so the light
//! path of a shallow sample is right to first order whatever the fit. Kept in world axes, it needs no frame
//! that two vertices would have to share. On a sphere of radius R it is −1/R across.
//!
//! Source: the least squares of François et al., "Subsurface Texture Mapping", INRIA 2006, section 4, with the
//! plane replaced by the osculating paraboloid (do Carmo, "Differential Geometry of Curves and Surfaces", 3.3).

use super::sample::{Sample, Samples};
use super::tangent::any_perpendicular;
use glam::{DMat3, DVec3, Mat3, Vec3};

/// Weight of the squared size of the matrix, a² + 2 b² + c², as a share of Σ w (u² + v²)²/4; the same in
/// `quadric.wgsl`. It bends what too few samples leave open back to the tangent plane, and shortens a curvature by
/// a thousandth. Neither depends on how the axes are turned.
const RIDGE: f32 = 1e-4;
/// The squared size by component; the same in `quadric.wgsl`.
const SIZE_OF: Vec3 = Vec3::new(1.0, 2.0, 1.0);
/// Values of that sum below this, of samples measured in patch radii, are those of a single place; the same in
/// `quadric.wgsl`.
const MIN_REACH: f32 = 1e-12;
/// And above this, of what was torn apart beyond all measure; the same in `quadric.wgsl`.
const MAX_REACH: f32 = 1e30;
/// Points that a fit asks for, P among them; the same in `quadric.wgsl`.
const POINTS_MIN: u32 = 3;

/// A symmetric matrix [1/m]; zero is the tangent plane.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Quadric {
    /// xx, yy, zz
    pub squares: Vec3,
    /// xy, xz, yz
    pub products: Vec3,
}

impl Quadric {
    /// From curvatures along and across the unit vectors `u` and `v`: `a uuᵀ + b (uvᵀ + vuᵀ) + c vvᵀ`.
    pub fn in_world([a, b, c]: [f32; 3], u: Vec3, v: Vec3) -> Self {
        let products = |p: Vec3, q: Vec3| Vec3::new(p.x * q.y, p.x * q.z, p.y * q.z);
        Self {
            squares: a * u * u + 2.0 * b * u * v + c * v * v,
            products: a * products(u, u)
                + b * (products(u, v) + products(v, u))
                + c * products(v, v),
        }
    }

    /// `Q d`.
    pub fn times(&self, d: Vec3) -> Vec3 {
        let (s, p) = (self.squares, self.products);
        Mat3::from_cols_array(&[s.x, p.x, p.y, p.x, s.y, p.z, p.y, p.z, s.z]) * d
    }

    /// (a, b, c) along the unit vectors `u` and `v`.
    pub fn in_frame(&self, u: Vec3, v: Vec3) -> [f32; 3] {
        [
            u.dot(self.times(u)),
            u.dot(self.times(v)),
            v.dot(self.times(v)),
        ]
    }

    /// As the shaders read it: two vectors.
    pub fn to_arrays(self) -> [[f32; 4]; 2] {
        [
            self.squares.extend(0.0).to_array(),
            self.products.extend(0.0).to_array(),
        ]
    }
}

/// Least-squares paraboloid through the point `at` [m] with unit normal `normal`, over its `samples`.
///
/// `per_m` is one over the patch's radius and sets the scale of the arithmetic alone. Samples that lie steeper than
/// 45 degrees over or under the tangent plane are passed over: on a sphere the chord to a place rises by half of what
/// its normal is turned, so those are the ones whose normal is turned away. The tangent plane
/// for fewer than three points, P among them, and for points at one place; along one line only the curvature
/// along it is told.
///
/// Twin of `shaders/quadric.wgsl`.
pub fn fit_quadric(
    samples: &[Sample],
    points: &[Vec3],
    [at, normal]: [Vec3; 2],
    per_m: f32,
) -> Quadric {
    let u_axis = any_perpendicular(normal);
    let v_axis = normal.cross(u_axis);
    let mut count = 0;
    let mut diagonal = Vec3::ZERO;
    let mut beside = Vec3::ZERO;
    let mut right = Vec3::ZERO;
    for sample in samples {
        let d = (points[sample.point as usize] - at) * per_m;
        let (u, v, z) = (d.dot(u_axis), d.dot(v_axis), d.dot(normal));
        if sample.weight <= 0.0 || z * z > u * u + v * v {
            continue;
        }
        count += 1;
        let basis = Vec3::new(0.5 * u * u, u * v, 0.5 * v * v);
        diagonal += sample.weight * basis * basis;
        beside +=
            sample.weight * Vec3::new(basis.x * basis.y, basis.x * basis.z, basis.y * basis.z);
        right += sample.weight * z * basis;
    }
    // Σ w (u² + v²)² / 4
    let reach = diagonal.x + 0.5 * diagonal.y + diagonal.z;
    if count < POINTS_MIN || !(MIN_REACH..MAX_REACH).contains(&reach) {
        return Quadric::default();
    }
    let bends = solve(diagonal + RIDGE * reach * SIZE_OF, beside, right);
    Quadric::in_world((bends * per_m).to_array(), u_axis, v_axis)
}

/// Solves a positive definite system by LDLᵀ; `beside` holds the entries 01, 02, 12.
fn solve(diagonal: Vec3, beside: Vec3, right: Vec3) -> Vec3 {
    let l10 = beside.x / diagonal.x;
    let l20 = beside.y / diagonal.x;
    let d1 = diagonal.y - l10 * beside.x;
    let e = beside.z - l20 * beside.x;
    let l21 = e / d1;
    let d2 = diagonal.z - l20 * beside.y - l21 * e;
    let y1 = right.y - l10 * right.x;
    let y2 = right.z - l20 * right.x - l21 * y1;
    let z = y2 / d2;
    let y = y1 / d1 - l21 * z;
    Vec3::new(right.x / diagonal.x - l10 * y - l20 * z, y, z)
}

/// [`fit_quadric`] for every point.
pub fn fit_quadrics(
    points: &[Vec3],
    normals: &[Vec3],
    samples: &Samples,
    per_m: f32,
) -> Vec<Quadric> {
    let mut quadrics = vec![Quadric::default(); points.len()];
    for (own, &point) in samples.of_slot.iter().zip(&samples.order) {
        let point = point as usize;
        let here = [points[point], normals[point]];
        quadrics[point] = fit_quadric(own, points, here, per_m);
    }
    quadrics
}

/// The paraboloid in f64, as a matrix [1/m]: the oracle. `samples` are places [m] with their weights, those that
/// count; `None` where they leave it open.
pub fn exact_quadric(
    samples: impl Iterator<Item = (DVec3, f64)>,
    at: DVec3,
    normal: DVec3,
) -> Option<DMat3> {
    let u_axis = normal.any_orthonormal_vector();
    let v_axis = normal.cross(u_axis);
    let mut system = nalgebra::Matrix3::<f64>::zeros();
    let mut right = nalgebra::Vector3::zeros();
    for (place, weight) in samples {
        let d = place - at;
        let (u, v) = (d.dot(u_axis), d.dot(v_axis));
        let basis = nalgebra::Vector3::new(0.5 * u * u, u * v, 0.5 * v * v);
        system += basis * basis.transpose() * weight;
        right += basis * (weight * d.dot(normal));
    }
    let reach = system[(0, 0)] + 0.5 * system[(1, 1)] + system[(2, 2)];
    let size_of = SIZE_OF.as_dvec3();
    for (i, size) in size_of.to_array().into_iter().enumerate() {
        system[(i, i)] += f64::from(RIDGE) * reach * size;
    }
    let bends = system.cholesky()?.solve(&right);
    let outer = |p: DVec3, q: DVec3| DMat3::from_cols(p * q.x, p * q.y, p * q.z);
    Some(
        outer(u_axis, u_axis) * bends.x
            + (outer(u_axis, v_axis) + outer(v_axis, u_axis)) * bends.y
            + outer(v_axis, v_axis) * bends.z,
    )
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Quat;
    use proptest::prelude::*;

    /// Sixteen places round the origin, up to `r_m` away, on the graph of `height` over y = 0.
    fn on_graph(r_m: f32, height: impl Fn(f32, f32) -> f32) -> (Vec<Sample>, Vec<Vec3>) {
        let places: Vec<Vec3> = (0..16)
            .map(|i| {
                // The turn is the golden angle.
                let around = 2.399_963_2 * i as f32;
                let ring = r_m * (i as f32 / 15.0).sqrt();
                let (x, z) = (ring * around.cos(), ring * around.sin());
                Vec3::new(x, height(x, z), z)
            })
            .collect();
        let samples = (0..16).map(|point| Sample {
            point,
            weight: 1.0 / 16.0,
        });
        (samples.collect(), places)
    }

    fn fit(samples: &[Sample], points: &[Vec3], up: Vec3) -> Quadric {
        fit_quadric(samples, points, [points[0], up], 100.0)
    }

    fn fit_of_graph(r_m: f32, height: impl Fn(f32, f32) -> f32) -> [f32; 3] {
        let (samples, points) = on_graph(r_m, height);
        fit(&samples, &points, Vec3::Y).in_frame(Vec3::X, Vec3::Z)
    }

    #[test]
    fn curvatures_of_plane_sphere_cylinder_and_saddle_are_those_of_the_closed_forms() {
        let radius = 0.05_f32;
        let dome = |squared: f32| (radius * radius - squared).sqrt() - radius;
        let k = 1.0 / radius;
        let found = [
            fit_of_graph(0.01, |_, _| 0.0),
            fit_of_graph(0.01, |x, z| dome(x * x + z * z)),
            fit_of_graph(0.01, |x, _| dome(x * x)),
            fit_of_graph(0.01, |x, z| k * x * z),
        ];
        let exact = [[0.0; 3], [-k, 0.0, -k], [-k, 0.0, 0.0], [0.0, k, 0.0]];
        for (found, exact) in found.iter().zip(exact) {
            for (f, e) in found.iter().zip(exact) {
                // The dome's fourth order: r²/4R² = 1 %; the ridge a tenth of that.
                assert!((f - e).abs() < 0.012 * k, "{found:?} for {exact:?}");
            }
        }
    }

    #[test]
    fn curvature_of_a_sphere_errs_fourfold_less_in_a_patch_half_as_wide() {
        let radius = 0.05_f32;
        let dome = |squared: f32| (radius * radius - squared).sqrt() - radius;
        let error = |r_m: f32| {
            let [a, ..] = fit_of_graph(r_m, |x, z| dome(x * x + z * z));
            // What the ridge alone takes, seen on a paraboloid.
            let [flat, ..] = fit_of_graph(r_m, |x, z| -0.5 * (x * x + z * z) / radius);
            (a / flat - 1.0).abs()
        };
        let ratio = error(0.02) / error(0.01);
        assert!((ratio - 4.0).abs() < 0.5, "{ratio}");
    }

    #[test]
    fn a_turned_patch_has_the_turned_quadric() {
        let (samples, points) = on_graph(0.01, |x, z| 10.0 * x * x + 4.0 * x * z - 7.0 * z * z);
        let turn = Quat::from_euler(glam::EulerRot::XYZ, 1.0, -2.0, 0.5);
        let turned: Vec<Vec3> = points.iter().map(|&p| turn * p + Vec3::ONE).collect();
        let at_rest = fit(&samples, &points, Vec3::Y).in_frame(Vec3::X, Vec3::Z);
        let moved = fit(&samples, &turned, turn * Vec3::Y);
        let moved = moved.in_frame(turn * Vec3::X, turn * Vec3::Z);
        for (a, b) in at_rest.iter().zip(moved) {
            // Places are rounded to 1e-7 m: 1e-5 of the patch, and squared over heights of 1 mm.
            assert!((a - b).abs() < 0.05, "{at_rest:?} and {moved:?}");
        }
    }

    #[test]
    fn patches_that_leave_it_open_have_the_tangent_plane_or_the_bend_along_their_line() {
        let sample = |point, weight| Sample { point, weight };
        let up = Vec3::Y;
        let two = [sample(0, 0.5), sample(1, 0.5)];
        let points = [Vec3::ZERO, Vec3::new(0.01, 0.001, 0.0)];
        assert_eq!(fit(&two, &points, up), Quadric::default());
        let same: Vec<Sample> = (0..16).map(|i| sample(i, 1.0 / 16.0)).collect();
        assert_eq!(fit(&same, &[Vec3::ONE; 16], up), Quadric::default());
        assert_eq!(fit(&[], &points, up), Quadric::default());

        let line: Vec<Vec3> = (0..16)
            .map(|i| {
                let x = 6e-4 * i as f32;
                Vec3::new(x, 5.0 * x * x, 0.0)
            })
            .collect();
        let [a, b, c] = fit(&same, &line, up).in_frame(Vec3::X, Vec3::Z);
        assert!((a - 10.0).abs() < 0.02, "{a}");
        assert!(b.abs() < 1e-3 && c.abs() < 1e-3, "{b} {c}");
    }

    #[test]
    fn samples_on_a_sheet_that_is_folded_over_are_passed_over() {
        let (samples, mut points) = on_graph(0.01, |x, z| 10.0 * (x * x + z * z));
        let sound = fit(&samples, &points, Vec3::Y);
        for i in [9, 12, 15] {
            points[i] = Vec3::new(0.002, -0.02, 0.001 * i as f32 - 0.012);
        }
        let folded = fit(&samples, &points, Vec3::Y);
        assert!((folded.squares - sound.squares).length() < 0.1);
        // Lying flatter they count, and show.
        for i in [9, 12, 15] {
            points[i].y = -0.002;
        }
        let flatter = fit(&samples, &points, Vec3::Y);
        assert!((flatter.squares - sound.squares).length() > 1.0);
    }

    #[test]
    fn chords_of_a_sphere_rise_by_half_of_what_its_normals_are_turned() {
        for degrees in [10.0_f32, 60.0, 89.0, 91.0, 150.0] {
            let turned = degrees.to_radians();
            let (rho, z) = (turned.sin(), turned.cos() - 1.0);
            assert!((z.abs().atan2(rho) - 0.5 * turned).abs() < 1e-5);
            assert_eq!(z * z <= rho * rho, degrees < 90.0);
        }
    }

    proptest! {
        #[test]
        fn quadric_of_any_patch_is_finite_and_that_of_f64(
            heights in prop::array::uniform16(-0.002_f32..0.002),
            squash in prop::sample::select(vec![1.0_f32, 0.1, 0.0]),
            turn in prop::array::uniform4(-1.0_f32..1.0),
        ) {
            let turn = Quat::from_array(turn);
            prop_assume!(turn.length() > 0.1);
            let turn = turn.normalize();
            // Round, a sliver, a line.
            let (samples, flat) = on_graph(0.01, |_, _| 0.0);
            let points: Vec<Vec3> = flat
                .iter()
                .zip(heights)
                .enumerate()
                .map(|(i, (p, h))| {
                    let h = if i == 0 { 0.0 } else { h };
                    turn * Vec3::new(p.x, h, squash * p.z)
                })
                .collect();
            let normal = turn * Vec3::Y;
            let found = fit(&samples, &points, normal);
            let counts = |p: &DVec3| {
                let d = *p - points[0].as_dvec3();
                2.0 * d.dot(normal.as_dvec3()).powi(2) <= d.length_squared()
            };
            // At the very edge of what counts, a rounding decides.
            let edge = |p: &Vec3| {
                let d = *p - points[0];
                (2.0 * d.dot(normal).powi(2) - d.length_squared()).abs() < 1e-4 * d.length_squared()
            };
            prop_assume!(!points[1..].iter().any(edge));
            let places = points.iter().map(|p| p.as_dvec3()).filter(counts).map(|p| (p, 0.0625));
            prop_assume!(places.clone().count() > 2);
            let exact = exact_quadric(places, points[0].as_dvec3(), normal.as_dvec3())
                .expect("the ridge determines it");
            for axis in [Vec3::X, Vec3::Y, Vec3::Z] {
                let difference = found.times(axis).as_dvec3() - exact * axis.as_dvec3();
                // Over 10 mm: 0.05 degrees of the normal at the rim. Slivers lose more digits, and what
                // they lose them of lies across.
                let room = if squash == 1.0 { 8.7e-4 } else { 2e-2 };
                prop_assert!(difference.length() * 0.01 < room, "{}", difference);
            }
        }
    }
}
