//! The plane that stands for the surface near a point, where light is followed to its entry.
//!
//! A primitive is a unit normal `n` and a signed offset `h`: the plane `{ x : n · (x - P) = h }`,
//! with P the point as it lies now. The offset is negative where the surface bulges outwards.
//!
//! Source: François et al., "Subsurface Texture Mapping", INRIA 2006, section 4 (least-squares
//! planes) and eq. 14, whose unsigned offset loses the side; ours keeps it.

use super::patch::Patches;
use super::sample::{Sample, Samples};
use glam::{DVec3, Vec3};
use rayon::prelude::*;
use serde::{Deserialize, Serialize};

/// How the light-path planes follow the deforming surface.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum LightPathMethod {
    /// The tangent plane; nothing is fitted.
    Tangent,
    /// Planes fitted at rest and left where they were in space: precomputed ones.
    Stale,
    /// Planes fitted at rest and turned with the tangent frame.
    Carried,
    /// Planes fitted anew at every point in every frame.
    Full,
    /// Planes fitted anew where something moved.
    Incremental,
    /// Planes fitted to sixteen weighted samples of each patch, where something moved.
    Sampled,
    /// Paraboloids through each point, fitted to the same samples, where something moved.
    Quadric,
    /// Nothing is fitted: where light enters is read from a depth map of each light.
    DepthMap,
}

impl LightPathMethod {
    /// Every method, cheapest first.
    pub const ALL: [Self; 8] = [
        Self::Tangent,
        Self::Stale,
        Self::Carried,
        Self::Sampled,
        Self::Quadric,
        Self::Incremental,
        Self::Full,
        Self::DepthMap,
    ];

    /// As scene files and charts call it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Tangent => "tangent",
            Self::Stale => "stale",
            Self::Carried => "carried",
            Self::Full => "full",
            Self::Incremental => "incremental",
            Self::Sampled => "sampled",
            Self::Quadric => "quadric",
            Self::DepthMap => "depth-map",
        }
    }
}

/// The plane `{ x : normal · (x - P) = offset_m }` near a point P.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Plane {
    /// Unit vector to the outside.
    pub normal: Vec3,
    /// Signed distance of the plane from P along the normal [m].
    pub offset_m: f32,
}

impl Plane {
    /// The tangent plane at a point with this normal.
    pub fn tangent(normal: Vec3) -> Self {
        Self {
            normal,
            offset_m: 0.0,
        }
    }

    /// As the shaders read it.
    pub fn to_array(self) -> [f32; 4] {
        let n = self.normal;
        [n.x, n.y, n.z, self.offset_m]
    }
}

/// Second moments of a patch about its mean, `Σ d dᵀ / N`, in any unit: xx, yy, zz and xy, xz, yz.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Spread {
    /// xx, yy, zz
    pub squares: Vec3,
    /// xy, xz, yz
    pub products: Vec3,
}

/// Sweeps of Jacobi's method. Three turn what a f32 can show of the off-diagonal to zero; the fourth
/// is room. The same in `plane_fit.wgsl`.
const JACOBI_SWEEPS: usize = 4;
/// The two smaller eigenvalues must differ by this share of the largest for a plane to be told; the
/// same in `plane_fit.wgsl`. At the edge, rounding of f32 turns the normal by 0.01 degrees.
const MIN_EIGENVALUE_GAP: f32 = 1e-3;
/// Traces below this are those of a single place; the same in `plane_fit.wgsl`.
const MIN_TRACE: f32 = 1e-30;

/// The direction in which a patch is thinnest: the eigenvector of the smallest eigenvalue.
///
/// `None` where there is no such direction: all points at one place, on one line, or spread alike
/// across it.
///
/// Cyclic Jacobi rotations on the spread divided by its trace. Twin of `thinnest_direction` in
/// `shaders/plane_fit.wgsl`. Source: Golub and Van Loan, "Matrix Computations", 8.5.
pub fn thinnest_direction(spread: Spread) -> Option<Vec3> {
    let trace = spread.squares.x + spread.squares.y + spread.squares.z;
    // Written so that a trace that is no number has no direction either.
    if !(trace > MIN_TRACE && trace.is_finite()) {
        return None;
    }
    let [mut a, mut b, mut c] = (spread.squares / trace).to_array();
    let [mut ab, mut ac, mut bc] = (spread.products / trace).to_array();
    let (mut va, mut vb, mut vc) = (Vec3::X, Vec3::Y, Vec3::Z);
    for _ in 0..3 * JACOBI_SWEEPS {
        // Turn a and b until ab is 0, then rename (a, b, c) to (b, c, a).
        let difference = b - a;
        let size = difference.abs() + (difference * difference + 4.0 * ab * ab).sqrt();
        let side = if difference < 0.0 { -1.0 } else { 1.0 };
        let t = if size > MIN_TRACE {
            2.0 * side * ab / size
        } else {
            0.0
        };
        let cosine = 1.0 / (1.0 + t * t).sqrt();
        let sine = t * cosine;
        let (old_ac, old_bc, old_va, old_vb) = (ac, bc, va, vb);
        let (a_turned, b_turned) = (a - t * ab, b + t * ab);
        let turned_ac = cosine * old_ac - sine * old_bc;
        let turned_bc = sine * old_ac + cosine * old_bc;
        let a_axis = cosine * old_va - sine * old_vb;
        let b_axis = sine * old_va + cosine * old_vb;
        (a, b, c) = (b_turned, c, a_turned);
        (ab, ac, bc) = (turned_bc, 0.0, turned_ac);
        (va, vb, vc) = (b_axis, vc, a_axis);
    }
    let (mut least, mut direction) = (a, va);
    if b < least {
        (least, direction) = (b, vb);
    }
    if c < least {
        (least, direction) = (c, vc);
    }
    let largest = a.max(b).max(c);
    let middle = a + b + c - least - largest;
    (middle - least > MIN_EIGENVALUE_GAP * largest).then(|| direction.normalize())
}

/// The plane of a patch whose mean lies at `mean_m` from P, facing the way of `normal`.
///
/// The tangent plane where the patch has no thinnest direction. Twin of `plane_of_moments` in
/// `shaders/plane_fit.wgsl`.
pub fn plane_of_moments(mean_m: Vec3, spread: Spread, normal: Vec3) -> Plane {
    let Some(direction) = thinnest_direction(spread) else {
        return Plane::tangent(normal);
    };
    let outward = if direction.dot(normal) < 0.0 {
        -direction
    } else {
        direction
    };
    Plane {
        normal: outward,
        offset_m: outward.dot(mean_m),
    }
}

/// Least-squares plane through `members` [m], seen from the point `at` [m] with unit normal `normal`.
///
/// The tangent plane for fewer than three members or where they have no thinnest direction.
///
/// Twin of `shaders/plane_full.wgsl`.
pub fn fit_plane(members: impl Iterator<Item = Vec3>, at: Vec3, normal: Vec3) -> Plane {
    let mut count = 0.0;
    let mut sum = Vec3::ZERO;
    let mut squares = Vec3::ZERO;
    let mut products = Vec3::ZERO;
    for member in members {
        let d = member - at;
        count += 1.0;
        sum += d;
        squares += d * d;
        products += Vec3::new(d.x * d.y, d.x * d.z, d.y * d.z);
    }
    if count < 3.0 {
        return Plane::tangent(normal);
    }
    let mean = sum / count;
    let spread = Spread {
        squares: squares / count - mean * mean,
        products: products / count - Vec3::new(mean.x * mean.y, mean.x * mean.z, mean.y * mean.z),
    };
    plane_of_moments(mean, spread, normal)
}

/// Least-squares plane through the weighted `samples` of a patch, seen from the point `at` [m] with unit
/// normal `normal`.
///
/// The tangent plane where the samples have no thinnest direction: fewer than three, at one place, on one
/// line; and where their mean lies within `skip_m` of it and their plane leans by no more over the radius of the
/// patch. Twin of `shaders/plane_sampled.wgsl`.
pub fn fit_sampled_plane(
    samples: &[Sample],
    points: &[Vec3],
    [at, normal]: [Vec3; 2],
    skip_m: f32,
) -> Plane {
    let mut total = 0.0;
    let mut sum = Vec3::ZERO;
    let mut squares = Vec3::ZERO;
    let mut products = Vec3::ZERO;
    for sample in samples {
        let d = points[sample.point as usize] - at;
        total += sample.weight;
        sum += sample.weight * d;
        squares += sample.weight * d * d;
        products += sample.weight * Vec3::new(d.x * d.y, d.x * d.z, d.y * d.z);
    }
    let share = 1.0 / total;
    let mean = share * sum;
    let spread = Spread {
        squares: share * squares - mean * mean,
        products: share * products - Vec3::new(mean.x * mean.y, mean.x * mean.z, mean.y * mean.z),
    };
    if is_flat(mean, spread, normal, skip_m) {
        return Plane::tangent(normal);
    }
    plane_of_moments(mean, spread, normal)
}

/// Whether the mean of a patch lies within `skip_m` of the tangent plane and its plane leans by no more over the
/// radius of the patch, the root of twice the trace.
fn is_flat(mean: Vec3, spread: Spread, normal: Vec3, skip_m: f32) -> bool {
    let (s, p) = (spread.squares, spread.products);
    let spread = glam::Mat3::from_cols_array(&[s.x, p.x, p.y, p.x, s.y, p.z, p.y, p.z, s.z]);
    let turned = spread * normal;
    let along = turned - normal * normal.dot(turned);
    let trace = s.x + s.y + s.z;
    normal.dot(mean).abs() < skip_m && 8.0 * along.dot(along) < skip_m * skip_m * trace
}

/// How deep below the tangent plane the mean of a patch may lie [m] for light of extinction `extinction_per_m` to
/// meet no more than `optical_depth` on the way between: on a sphere of radius R that is r²/4R, and with
/// r = −ln ε / σ the optical depth is (ln ε)² / (4 σ R).
pub fn skip_from_optical_depth_m(optical_depth: f32, extinction_per_m: f32) -> f32 {
    optical_depth / extinction_per_m
}

/// [`fit_sampled_plane`] for every point.
pub fn fit_sampled_planes(
    points: &[Vec3],
    normals: &[Vec3],
    samples: &Samples,
    skip_m: f32,
) -> Vec<Plane> {
    let mut planes: Vec<Plane> = normals.iter().map(|&n| Plane::tangent(n)).collect();
    for (own, &point) in samples.of_slot.iter().zip(&samples.order) {
        let point = point as usize;
        let here = [points[point], normals[point]];
        planes[point] = fit_sampled_plane(own, points, here, skip_m);
    }
    planes
}

/// [`fit_plane`] for the patch of every point.
pub fn fit_planes(points: &[Vec3], normals: &[Vec3], patches: &Patches) -> Vec<Plane> {
    (0..points.len())
        .into_par_iter()
        .map(|point| {
            let members = patches.members(point).map(|member| points[member]);
            fit_plane(members, points[point], normals[point])
        })
        .collect()
}

/// A plane of `rest` that is left where it was in space while its point moves from `rest_place` to `place` [m].
///
/// Twin of `shaders/plane_stale.wgsl`.
pub fn stale_plane(rest: Plane, rest_place: Vec3, place: Vec3) -> Plane {
    Plane {
        normal: rest.normal,
        offset_m: rest.offset_m - rest.normal.dot(place - rest_place),
    }
}

/// A plane `carried` by the tangent frame of its point: its normal in (tangent, bitangent, normal).
///
/// Twin of `shaders/plane_carried.wgsl`.
pub fn carried_plane(carried: Plane, tangent: Vec3, handedness: f32, normal: Vec3) -> Plane {
    let local = carried.normal;
    let bitangent = handedness * normal.cross(tangent);
    Plane {
        normal: (local.x * tangent + local.y * bitangent + local.z * normal).normalize(),
        offset_m: carried.offset_m,
    }
}

/// `plane` with its normal written in the tangent frame of its point, for [`carried_plane`].
pub fn plane_in_frame(plane: Plane, tangent: Vec3, handedness: f32, normal: Vec3) -> Plane {
    let bitangent = handedness * normal.cross(tangent);
    Plane {
        normal: Vec3::new(
            plane.normal.dot(tangent),
            plane.normal.dot(bitangent),
            plane.normal.dot(normal),
        ),
        offset_m: plane.offset_m,
    }
}

/// The plane in f64: two passes over the members and a full eigen-decomposition. The oracle.
///
/// Normal and offset [m]; `None` for fewer than three members.
pub fn exact_plane(
    members: impl Iterator<Item = DVec3> + Clone,
    at: DVec3,
    normal: DVec3,
) -> Option<(DVec3, f64)> {
    exact_weighted_plane(members.map(|member| (member, 1.0)), at, normal)
}

/// As [`exact_plane`], with a weight for each member.
pub fn exact_weighted_plane(
    members: impl Iterator<Item = (DVec3, f64)> + Clone,
    at: DVec3,
    normal: DVec3,
) -> Option<(DVec3, f64)> {
    if members.clone().count() < 3 {
        return None;
    }
    let total: f64 = members.clone().map(|(_, weight)| weight).sum();
    let mean = members.clone().map(|(m, weight)| weight * m).sum::<DVec3>() / total;
    let mut spread = nalgebra::Matrix3::<f64>::zeros();
    for (member, weight) in members {
        let d = nalgebra::Vector3::from((member - mean).to_array());
        spread += d * d.transpose() * weight;
    }
    let eigen = spread.symmetric_eigen();
    let column = eigen.eigenvectors.column(eigen.eigenvalues.imin());
    let direction = DVec3::new(column[0], column[1], column[2]).normalize();
    let outward = if direction.dot(normal) < 0.0 {
        -direction
    } else {
        direction
    };
    Some((outward, outward.dot(mean - at)))
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::Quat;
    use proptest::prelude::*;

    /// Points spread evenly over a cap of chord `r_m` of a sphere, seen from its top at the origin.
    fn cap(radius_m: f32, r_m: f32) -> Vec<Vec3> {
        let deepest = r_m * r_m / (2.0 * radius_m);
        (0..4000)
            .map(|i| {
                // Archimedes: equal heights have equal areas. The turn is the golden angle.
                let depth = deepest * (i as f32 + 0.5) / 4000.0;
                let ring = (depth * (2.0 * radius_m - depth)).sqrt();
                let around = 2.399_963_2 * i as f32;
                Vec3::new(ring * around.cos(), -depth, ring * around.sin())
            })
            .collect()
    }

    #[test]
    fn plane_of_a_spherical_cap_is_level_and_a_quarter_of_r_squared_over_radius_deep() {
        for (radius_m, r_m) in [(0.05, 0.01), (0.05, 0.002), (0.2, 0.03)] {
            let plane = fit_plane(cap(radius_m, r_m).into_iter(), Vec3::ZERO, Vec3::Y);
            let exact = -r_m * r_m / (4.0 * radius_m);
            assert!(plane.normal.angle_between(Vec3::Y) < 1e-3);
            assert!(
                (plane.offset_m / exact - 1.0).abs() < 1e-3,
                "{plane:?} for {exact}"
            );
        }
    }

    #[test]
    fn a_cap_takes_no_fit_below_the_depth_that_theory_gives_and_a_leaning_patch_always_does() {
        let (radius_m, r_m) = (0.05, 0.01);
        let depth_m = r_m * r_m / (4.0 * radius_m);
        let points = cap(radius_m, r_m);
        let samples: Vec<Sample> = (0..points.len() as u32)
            .map(|point| Sample {
                point,
                weight: 1.0 / 4000.0,
            })
            .collect();
        let fit = |normal: Vec3, skip_m: f32| {
            fit_sampled_plane(&samples, &points, [Vec3::ZERO, normal], skip_m)
        };
        assert_eq!(fit(Vec3::Y, 1.01 * depth_m), Plane::tangent(Vec3::Y));
        assert!((fit(Vec3::Y, 0.99 * depth_m).offset_m / depth_m + 1.0).abs() < 0.01);
        // Leaning by 0.1 over 10 mm is 1 mm, more than is asked to be passed over.
        let leaning = Vec3::new(0.1, 1.0, 0.0).normalize();
        assert!(fit(leaning, 0.9e-3).normal.angle_between(Vec3::Y) < 1e-3);
        assert_eq!(fit(leaning, 1.1e-3), Plane::tangent(leaning));

        // An optical depth of 0.1 in a medium of r = -ln 0.01 / sigma.
        let sigma = -0.01_f32.ln() / r_m;
        let change = 0.01_f32.ln().powi(2) / (4.0 * sigma * radius_m);
        assert!((skip_from_optical_depth_m(change, sigma) / depth_m - 1.0).abs() < 1e-5);
    }

    #[test]
    fn offset_is_negative_on_a_bulge_and_positive_in_a_hollow() {
        let bulge = cap(0.05, 0.01);
        assert!(fit_plane(bulge.iter().copied(), Vec3::ZERO, Vec3::Y).offset_m < 0.0);
        assert!(fit_plane(bulge.into_iter(), Vec3::ZERO, Vec3::NEG_Y).offset_m > 0.0);
    }

    #[test]
    fn places_without_a_thinnest_direction_give_the_tangent_plane() {
        let line = |i: i32| Vec3::new(0.3, 0.1, -0.2) * 0.001 * i as f32;
        let octahedron = [Vec3::X, Vec3::Y, Vec3::Z].map(|axis| [axis, -axis]);
        for (name, members) in [
            ("no members", Vec::new()),
            ("two members", vec![Vec3::X, Vec3::Z]),
            ("one place", vec![Vec3::ONE; 20]),
            ("one line", (0..20).map(line).collect()),
            (
                "alike in all directions",
                octahedron.as_flattened().to_vec(),
            ),
        ] {
            let at = members.first().copied().unwrap_or(Vec3::ONE);
            let plane = fit_plane(members.into_iter(), at, Vec3::Y);
            assert_eq!(plane, Plane::tangent(Vec3::Y), "{name}");
        }
    }

    #[test]
    fn spread_that_is_no_number_has_no_direction() {
        for bad in [f32::NAN, f32::INFINITY, 0.0, -1.0] {
            let spread = Spread {
                squares: Vec3::splat(bad),
                products: Vec3::ZERO,
            };
            assert_eq!(thinnest_direction(spread), None);
        }
    }

    #[test]
    fn method_names_are_those_of_scene_files() {
        for method in LightPathMethod::ALL {
            let written = serde_json::to_string(&method).expect("can be written");
            assert_eq!(written, format!("\"{}\"", method.name()));
        }
    }

    proptest! {
        #[test]
        fn plane_of_any_patch_is_that_of_f64(
            heights in prop::collection::vec(-1.0_f32..1.0, 12..200),
            turn in prop::array::uniform4(-1.0_f32..1.0),
            away_m in prop::array::uniform3(-10.0_f32..10.0),
        ) {
            let turn = Quat::from_array(turn);
            prop_assume!(turn.length() > 0.1);
            let turn = turn.normalize();
            // 1 cm wide, up to a quarter as thick.
            let members: Vec<Vec3> = heights
                .iter()
                .enumerate()
                .map(|(i, height)| {
                    let around = 2.399_963_2 * i as f32;
                    let ring = 0.01 * ((i as f32 + 0.5) / heights.len() as f32).sqrt();
                    let local =
                        Vec3::new(ring * around.cos(), 0.0025 * height, ring * around.sin());
                    turn * local + Vec3::from(away_m)
                })
                .collect();
            let (at, normal) = (members[0], turn * Vec3::Y);
            let plane = fit_plane(members.iter().copied(), at, normal);
            let (exact, offset_m) = exact_plane(
                members.iter().map(|m| m.as_dvec3()),
                at.as_dvec3(),
                normal.as_dvec3(),
            )
            .expect("three members");
            let degrees = plane.normal.as_dvec3().angle_between(exact).to_degrees();
            prop_assert!(degrees <= 0.05, "{degrees} degrees");
            // 0.05 degrees over the width of the patch.
            prop_assert!((f64::from(plane.offset_m) - offset_m).abs() < 1e-5);
        }

        #[test]
        fn plane_written_in_a_frame_and_carried_back_is_the_same(
            turn in prop::array::uniform4(-1.0_f32..1.0),
            offset_m in -0.01_f32..0.01,
            handedness in prop::bool::ANY,
        ) {
            let turn = Quat::from_array(turn);
            prop_assume!(turn.length() > 0.1);
            let turn = turn.normalize();
            let side = if handedness { 1.0 } else { -1.0 };
            let plane = Plane { normal: turn * Vec3::new(0.6, 0.0, 0.8), offset_m };
            let local = plane_in_frame(plane, turn * Vec3::X, side, turn * Vec3::Z);
            let back = carried_plane(local, turn * Vec3::X, side, turn * Vec3::Z);
            prop_assert!(back.normal.distance(plane.normal) < 1e-5);
            prop_assert_eq!(back.offset_m, plane.offset_m);
        }
    }
}
