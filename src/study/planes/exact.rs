//! The fits at length: every patch over all of its members in f64, and how far the GPU's are from them.

use super::body::Body;
use super::estimate::{Drawn, DrawnPrimitives};
use crate::geom::patch::Patches;
use crate::geom::plane::{LightPathMethod, exact_plane, exact_weighted_plane};
use crate::geom::quadric::{Quadric, exact_quadric};
use crate::geom::sample::Samples;
use crate::geom::tangent::{Fans, rest_normals};
use crate::measure::stats::{percentile, sorted};
use crate::reference::all_by;
use glam::{DMat3, DVec3, Vec3};

/// Points that are compared, evenly out of all: enough for a 99.9th percentile.
const COMPARED_MAX: usize = 3000;
/// Least weight of a member at the rim, as `Samples::weighted_to_the_middle` has it.
const RIM_WEIGHT: f64 = 0.05;

/// The patches of a body at rest.
pub struct Exact {
    patches: Patches,
    samples: Samples,
    /// The same with the weights of paraboloids.
    to_the_middle: Samples,
    radius_m: f64,
    /// Points to a patch, on average.
    pub members_mean: f64,
}

/// Angles between the GPU's fits and others [degrees].
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct FitErrors {
    /// 99th percentile, from the f64 fit of all members.
    pub normal_deg_p99: Option<f64>,
    /// 99.9th percentile, from the f64 fit of what the kernel is given: all members, or its sixteen samples.
    pub kernel_deg_p999: Option<f64>,
}

impl Exact {
    /// Patches of `radius_m` of the body at rest, moved by `origin_m`, and their samples: where it lies far away,
    /// places are rounded, and so is what lies within the radius.
    pub fn new(body: &Body, radius_m: f32, origin_m: Vec3) -> Self {
        let mut mesh = body.mesh.clone();
        for point in &mut mesh.points {
            *point += origin_m;
        }
        let points = &mesh.points;
        let patches = Patches::new(points, &rest_normals(&mesh, &Fans::new(&mesh)), radius_m);
        let members: u64 = (0..points.len())
            .map(|slot| u64::from(patches.member_count(slot)))
            .sum();
        let samples = Samples::new(points, &patches);
        Self {
            to_the_middle: samples.clone().weighted_to_the_middle(points),
            samples,
            radius_m: f64::from(radius_m),
            members_mean: members as f64 / points.len() as f64,
            patches,
        }
    }

    /// Compares what `method` left on the GPU with the fits of the surface at `points` [m].
    pub fn errors(
        &self,
        method: LightPathMethod,
        drawn: &Drawn,
        points: &[Vec3],
        threads: usize,
    ) -> FitErrors {
        let stride = points.len().div_ceil(COMPARED_MAX).max(1);
        let compared: Vec<usize> = (0..points.len()).step_by(stride).collect();
        let scene = Scene {
            exact: self,
            drawn,
            points,
        };
        let angles = all_by(threads, &compared, |&point| scene.angles(method, point));
        let share = |values: Vec<f64>, share: f64| {
            percentile(&sorted(values.iter().map(|v| *v as f32)), share)
        };
        FitErrors {
            normal_deg_p99: share(angles.iter().filter_map(|a| a.0).collect(), 0.99),
            kernel_deg_p999: share(angles.iter().filter_map(|a| a.1).collect(), 0.999),
        }
    }
}

struct Scene<'a> {
    exact: &'a Exact,
    drawn: &'a Drawn,
    points: &'a [Vec3],
}

impl Scene<'_> {
    fn place(&self, point: usize) -> DVec3 {
        self.points[point].as_dvec3()
    }

    fn normal(&self, point: usize) -> DVec3 {
        self.drawn.normals[point].truncate().as_dvec3()
    }

    /// From the fit of all members, and from the fit of what the kernel is given.
    fn angles(&self, method: LightPathMethod, point: usize) -> (Option<f64>, Option<f64>) {
        let (at, normal) = (self.place(point), self.normal(point));
        match &self.drawn.primitives {
            DrawnPrimitives::Quadrics(quadrics) => {
                let [squares, products] = quadrics[point].map(|half| half.truncate());
                let got = Quadric { squares, products };
                let reach = 0.5 * self.exact.radius_m;
                let apart = |exact: DMat3| slope_deg(&got, exact, normal, reach);
                // As in `geom::quadric`: what is steeper than 45 degrees is another sheet.
                let counts = |member: usize| {
                    let d = self.place(member) - at;
                    2.0 * d.dot(normal).powi(2) <= d.length_squared()
                };
                let members = self.exact.patches.members(point).filter(|&m| counts(m));
                let to_middle = |member: usize| {
                    let d = self.place(member).distance(at) / self.exact.radius_m;
                    (self.place(member), (1.0 - d * d).max(RIM_WEIGHT))
                };
                let slot = self.exact.patches.slot_of[point] as usize;
                let own = self.exact.to_the_middle.weighing(slot);
                let own = own.filter(|sample| counts(sample.point as usize));
                let own = own.map(|s| (self.place(s.point as usize), f64::from(s.weight)));
                (
                    exact_quadric(members.map(to_middle), at, normal).map(apart),
                    exact_quadric(own, at, normal).map(apart),
                )
            }
            DrawnPrimitives::DepthMaps(_) => (None, None),
            DrawnPrimitives::Planes(_) | DrawnPrimitives::Tangent => {
                let got = match &self.drawn.primitives {
                    DrawnPrimitives::Planes(planes) => planes[point].truncate().as_dvec3(),
                    _ => normal,
                };
                let members: Vec<DVec3> = (self.exact.patches.members(point))
                    .map(|member| self.place(member))
                    .collect();
                let all = exact_plane(members.into_iter(), at, normal);
                let all = all.map(|(exact, _)| angle_deg(got, exact));
                let kernel = match method {
                    LightPathMethod::Full | LightPathMethod::Incremental => all,
                    LightPathMethod::Sampled => {
                        let slot = self.exact.patches.slot_of[point] as usize;
                        let own: Vec<(DVec3, f64)> = (self.exact.samples.weighing(slot))
                            .map(|s| (self.place(s.point as usize), f64::from(s.weight)))
                            .collect();
                        let exact = exact_weighted_plane(own.into_iter(), at, normal);
                        exact.map(|(exact, _)| angle_deg(got, exact))
                    }
                    _ => None,
                };
                (all, kernel)
            }
        }
    }
}

fn angle_deg(a: DVec3, b: DVec3) -> f64 {
    a.cross(b).length().atan2(a.dot(b)).to_degrees()
}

/// Largest angle between the normals of two paraboloids at `reach_m` from their common point.
fn slope_deg(got: &Quadric, exact: DMat3, normal: DVec3, reach_m: f64) -> f64 {
    let u = normal.any_orthonormal_vector();
    let v = normal.cross(u);
    let apart = |d: DVec3| got.times(d.as_vec3()).as_dvec3() - exact * d;
    let (a, b, c) = (u.dot(apart(u)), u.dot(apart(v)), v.dot(apart(v)));
    let (mean, half) = (0.5 * (a + c), 0.5 * (a - c));
    let largest = mean.abs() + (half * half + b * b).sqrt();
    (largest * reach_m).atan().to_degrees()
}

#[cfg(test)]
mod tests {
    use super::super::body::Shape;
    use super::*;
    use crate::geom::plane::fit_planes;
    use crate::geom::quadric::fit_quadrics;
    use glam::Vec4;

    #[test]
    fn planes_and_paraboloids_of_the_cpu_twins_are_right_and_turned_ones_are_not() {
        let body = Body::of_shape(Shape::Blob, 600, 0.15);
        let (points, radius_m) = (&body.mesh.points, 0.03);
        let exact = Exact::new(&body, radius_m, Vec3::ZERO);
        let normals: Vec<Vec4> = body.normals.iter().map(|n| n.extend(0.0)).collect();
        let drawn = |primitives| Drawn {
            normals: normals.clone(),
            primitives,
        };
        let planes: Vec<Vec4> = fit_planes(points, &body.normals, &exact.patches)
            .into_iter()
            .map(|plane| Vec4::from_array(plane.to_array()))
            .collect();
        let turned = planes
            .iter()
            .map(|plane| (glam::Quat::from_rotation_x(0.01) * plane.truncate()).extend(plane.w));
        let error = |primitives, method| exact.errors(method, &drawn(primitives), points, 2);
        let full = LightPathMethod::Full;
        let right = error(DrawnPrimitives::Planes(planes.clone()), full);
        assert!(right.normal_deg_p99.unwrap() < 0.01, "{right:?}");
        let wrong = error(DrawnPrimitives::Planes(turned.collect()), full);
        assert!(
            (0.3..0.58).contains(&wrong.normal_deg_p99.unwrap()),
            "{wrong:?}"
        );
        assert!(wrong.kernel_deg_p999.unwrap() > 0.05);

        let samples = &exact.to_the_middle;
        let quadrics = fit_quadrics(points, &body.normals, samples, 1.0 / radius_m);
        let arrays = |factor: f32| {
            let halves = quadrics.iter().map(|q| q.to_arrays().map(Vec4::from_array));
            let scaled = halves.map(|pair| pair.map(|half| factor * half));
            DrawnPrimitives::Quadrics(scaled.collect())
        };
        let right = error(arrays(1.0), LightPathMethod::Quadric);
        // The ridge of the twin shortens a curvature by about a thousandth.
        assert!(right.kernel_deg_p999.unwrap() < 0.05, "{right:?}");
        let wrong = error(arrays(1.1), LightPathMethod::Quadric);
        assert!(wrong.kernel_deg_p999.unwrap() > 0.3, "{wrong:?}");
    }
}
