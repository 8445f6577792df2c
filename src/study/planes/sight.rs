//! What is looked at: points of the deformed surface seen by four eyes, three lights for each, places below the
//! surface along every view, and the true way of light from each of those, by rays.

use super::super::random::Random;
use super::body::Body;
use super::deform::POKED_SHARE;
use crate::reference::{EvenTissue, Rays, all_by};
use glam::{DQuat, DVec3, Vec3};

/// Angles between the eye and its lights [degrees].
pub const LIGHTS_DEG: [f64; 3] = [20.0, 85.0, 150.0];
/// The lights as rows call them.
pub const FRONT: usize = 0;
pub const GRAZE: usize = 1;
pub const BACK: usize = 2;
/// Eyes; the first looks straight at the poked place.
pub const EYES: usize = 4;
/// Places along a view.
pub const SAMPLES: usize = 20;
/// Views flatter than this are left out: they see the rim of the body, a pixel wide.
const COS_EYE_MIN: f64 = 0.05;
/// Light that is left at the radius of a patch: ε of François 2006, section 2.2.
const EPSILON: f64 = 0.01;
/// Half the width of the edge of a cast shadow, as a share of the body's size: a texel and a half of a depth map. Which
/// side of it a place lies on is a matter of the map's resolution, and no more the light path's than the shadow is.
const SHADOW_EDGE_SHARE: f64 = 0.002;
/// How far rays start off the triangle that a place lies on [m].
pub const OFF_M: f64 = 1e-9;
const SEED: u64 = 2010;

/// A point of the surface, the eye that sees it, and how far it looks in.
#[derive(Clone, Debug)]
pub struct Sight {
    /// Which of the eyes.
    pub eye: usize,
    /// Corners of the triangle, as points, and their shares of the place.
    pub corners: [u32; 3],
    pub shares: Vec3,
    /// The place itself [m].
    pub place: DVec3,
    /// Unit direction to the eye.
    pub to_eye: DVec3,
    /// Unit directions to the lights.
    pub to_lights: [DVec3; 3],
    /// Cosine of the interpolated normal with each light.
    pub cos_lights: [f64; 3],
    /// How far the view goes in [m].
    pub reach_m: f64,
    /// Where it comes out at the far side [m].
    pub far_m: f64,
    /// Whether something stands between the point and each light.
    pub is_shaded: [bool; 3],
    /// Whether it lies where the body is poked.
    pub is_poked: bool,
}

impl Sight {
    /// A look from `to_eye` at a `place` [m] on the triangle of these `corners`, of a surface at `points` [m] with these
    /// normals, where patches reach `radius_m` far. Its lights are all at the eye, and it counts as lit. `None` if no ray goes
    /// through the body there.
    pub fn at(
        place: DVec3,
        to_eye: DVec3,
        corners: [u32; 3],
        [points, normals]: [&[DVec3]; 2],
        rays: &Rays,
        radius_m: f64,
    ) -> Option<Self> {
        let [a, b, c] = corners.map(|corner| points[corner as usize]);
        let area = (b - a).cross(c - a);
        let part = |p: DVec3, q: DVec3| p.cross(q).dot(area) / area.length_squared();
        let shares = DVec3::new(
            part(b - place, c - place),
            part(c - place, a - place),
            part(a - place, b - place),
        );
        let normal: DVec3 = (0..3)
            .map(|k| shares[k] * normals[corners[k] as usize])
            .sum();
        let normal = normal.normalize_or_zero();
        let cos_eye = normal.dot(to_eye).max(COS_EYE_MIN);
        Some(Self {
            eye: 0,
            corners,
            shares: shares.as_vec3(),
            place,
            to_eye,
            to_lights: [to_eye; 3],
            cos_lights: [cos_eye; 3],
            reach_m: reach_m(radius_m, cos_eye),
            far_m: rays.exit_m((place - OFF_M * to_eye, -to_eye))?,
            is_shaded: [false; 3],
            is_poked: false,
        })
    }

    /// Length of a sample [m].
    pub fn step_m(&self) -> f64 {
        self.reach_m / SAMPLES as f64
    }

    /// Places along the view [m] that lie inside the body, with their index.
    pub fn samples_m(&self) -> impl Iterator<Item = (usize, f64)> + '_ {
        (0..SAMPLES)
            .map(|i| (i, (i as f64 + 0.5) * self.step_m()))
            .filter(|(_, t)| *t < self.far_m)
    }
}

/// The way from a place to a light: nothing where the place lies outside.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Way {
    /// Length to where it first leaves the body [m].
    pub length_m: Option<f64>,
    /// Whether it meets the body again beyond: a cast shadow, or the very edge of one.
    pub is_shaded: bool,
}

/// The ways from all places of a sight to its lights.
pub type Ways = [[Way; SAMPLES]; 3];

/// The sights of a pose with their true ways.
pub struct Truth {
    pub sights: Vec<Sight>,
    /// By sight, light and sample.
    pub ways: Vec<Ways>,
    /// The radius of the patches [m], beyond which no light is followed.
    pub radius_m: f64,
    /// The tissue whose light dies within that radius.
    pub tissue: EvenTissue,
}

/// Unit directions to the lights of every eye on `body`.
pub fn all_lights(body: &Body) -> Vec<[DVec3; 3]> {
    (0..EYES)
        .map(|eye| Look::of(body, eye, 0.0).to_lights)
        .collect()
}

/// The tissue of a radius: green and blue keep a hundredth over it, red dies sooner; the dermis of a fish
/// (François 2006, table 1) in ratio.
pub fn tissue_of(radius_m: f64) -> EvenTissue {
    let sigma = -EPSILON.ln() / radius_m;
    let extinction_per_m = sigma * DVec3::new(2.6 / 1.6, 1.0, 1.0);
    EvenTissue {
        scattering_per_m: 0.9 * extinction_per_m,
        extinction_per_m,
    }
}

impl Truth {
    /// Looks at `body` where its points are at `points` [m] with so many sights an eye, and casts the rays by so many
    /// `threads`.
    pub fn new(
        body: &Body,
        points: &[DVec3],
        radius_m: f64,
        sights_per_eye: usize,
        threads: usize,
    ) -> Self {
        let triangles = body.mesh.point_triangles();
        let rays = Rays::new(points, &triangles);
        let mut random = Random::new(SEED);
        let normals = exact_normals(points, &triangles);
        let mut sights = Vec::new();
        for eye in 0..EYES {
            let look = Look::of(body, eye, radius_m);
            let to_eye = look.to_eye;
            let areas = facing_areas(points, &triangles, to_eye);
            let candidates: Vec<(usize, Vec3)> = (0..3 * sights_per_eye)
                .map(|_| {
                    let wanted = f64::from(random.unit()) * areas[areas.len() - 1];
                    let triangle = areas.partition_point(|area| *area <= wanted);
                    (triangle.min(areas.len() - 1), shares(&mut random))
                })
                .collect();
            let seen = all_by(threads, &candidates, |&(triangle, shares)| {
                look.sight(body, points, &normals, &rays, triangles[triangle], shares)
            });
            sights.extend(seen.into_iter().flatten().take(sights_per_eye));
        }
        let edge_m = SHADOW_EDGE_SHARE * f64::from(body.size_m);
        let ways = all_by(threads, &sights, |sight| {
            ways(sight, &rays, radius_m, edge_m)
        });
        Self {
            sights,
            ways,
            radius_m,
            tissue: tissue_of(radius_m),
        }
    }
}

/// An eye and its lights.
struct Look {
    eye: usize,
    to_eye: DVec3,
    to_lights: [DVec3; 3],
    radius_m: f64,
}

impl Look {
    fn of(body: &Body, eye: usize, radius_m: f64) -> Self {
        let axes = body.axes.map(|axis| axis.as_dvec3());
        let turn = DQuat::from_axis_angle(axes[0], eye as f64 * std::f64::consts::FRAC_PI_2);
        let to_eye = turn * axes[2];
        let side = DQuat::from_axis_angle(to_eye, 1.2 * eye as f64) * (turn * axes[0]);
        Self {
            eye,
            to_eye,
            to_lights: LIGHTS_DEG
                .map(|angle| DQuat::from_axis_angle(side, angle.to_radians()) * to_eye),
            radius_m,
        }
    }

    /// The sight of a place on a triangle; `None` if it is hidden or seen too flatly.
    fn sight(
        &self,
        body: &Body,
        points: &[DVec3],
        normals: &[DVec3],
        rays: &Rays,
        corners: [u32; 3],
        shares: Vec3,
    ) -> Option<Sight> {
        let mixed = |of: &[DVec3]| -> DVec3 {
            (0..3)
                .map(|k| f64::from(shares[k]) * of[corners[k] as usize])
                .sum()
        };
        let place = mixed(points);
        let normal = mixed(normals).normalize_or_zero();
        let cos_eye = normal.dot(self.to_eye);
        if cos_eye < COS_EYE_MIN || rays.is_blocked((place + OFF_M * self.to_eye, self.to_eye), 0.0)
        {
            return None;
        }
        let far_m = rays.exit_m((place - OFF_M * self.to_eye, -self.to_eye))?;
        let at_rest: Vec3 = (0..3)
            .map(|k| shares[k] * body.mesh.points[corners[k] as usize])
            .sum();
        let poked = body.mesh.points[body.poked];
        Some(Sight {
            eye: self.eye,
            corners,
            shares,
            place,
            to_eye: self.to_eye,
            to_lights: self.to_lights,
            cos_lights: self.to_lights.map(|to_light| normal.dot(to_light)),
            reach_m: reach_m(self.radius_m, cos_eye),
            far_m,
            is_shaded: self
                .to_lights
                .map(|light| is_shaded(rays, place, light, self.radius_m)),
            is_poked: at_rest.distance(poked) < POKED_SHARE * body.size_m,
        })
    }
}

/// How far a view goes in [m]: as deep as half the radius, and never farther than the radius.
fn reach_m(radius_m: f64, cos_eye: f64) -> f64 {
    (0.5 * radius_m / cos_eye).min(radius_m)
}

/// Whether something stands between `place` and a light: not the surface round it, whose facets rise before each
/// other where light grazes, and which is the light path's to know.
pub fn is_shaded(rays: &Rays, place: DVec3, to_light: DVec3, radius_m: f64) -> bool {
    rays.is_blocked((place, to_light), 0.5 * radius_m)
}

fn ways(sight: &Sight, rays: &Rays, radius_m: f64, edge_m: f64) -> Ways {
    let mut ways = Ways::default();
    for (i, t) in sight.samples_m() {
        let inside = sight.place - t * sight.to_eye;
        for (way, to_light) in ways.iter_mut().zip(sight.to_lights) {
            let mut found = way_of(rays, inside, to_light);
            if let Some(length_m) = found.length_m {
                let out = inside + length_m * to_light;
                found.is_shaded |= is_by_shadow(rays, out, to_light, radius_m, edge_m);
            }
            way[i] = found;
        }
    }
    ways
}

/// Whether a light's way that leaves the body at `out` [m] passes another part of it nearer than `edge_m`.
fn is_by_shadow(rays: &Rays, out: DVec3, to_light: DVec3, radius_m: f64, edge_m: f64) -> bool {
    let (u, v) = to_light.any_orthonormal_pair();
    [u, v, -u, -v]
        .iter()
        .any(|&aside| is_shaded(rays, out + edge_m * aside, to_light, radius_m))
}

/// The true way from a place `inside` [m] to a light.
pub fn way_of(rays: &Rays, inside: DVec3, to_light: DVec3) -> Way {
    let length_m = rays.exit_m((inside, to_light));
    let beyond = length_m.map(|exit| exit + OFF_M);
    Way {
        length_m,
        is_shaded: beyond.is_some_and(|m| rays.is_blocked((inside, to_light), m)),
    }
}

/// A place spread evenly over a triangle.
fn shares(random: &mut Random) -> Vec3 {
    let (mut u, mut v) = (random.unit(), random.unit());
    if u + v > 1.0 {
        (u, v) = (1.0 - u, 1.0 - v);
    }
    Vec3::new(1.0 - u - v, u, v)
}

/// Running sum of the areas that the triangles show to the eye.
fn facing_areas(points: &[DVec3], triangles: &[[u32; 3]], to_eye: DVec3) -> Vec<f64> {
    let mut sum = 0.0;
    triangles
        .iter()
        .map(|corners| {
            let [a, b, c] = corners.map(|corner| points[corner as usize]);
            sum += 0.5 * (b - a).cross(c - a).dot(to_eye).max(0.0);
            sum
        })
        .collect()
}

/// Unit normal of each point, weighted by area.
pub fn exact_normals(points: &[DVec3], triangles: &[[u32; 3]]) -> Vec<DVec3> {
    let mut normals = vec![DVec3::ZERO; points.len()];
    for corners in triangles {
        let [a, b, c] = corners.map(|corner| points[corner as usize]);
        let area = (b - a).cross(c - a);
        for &corner in corners {
            normals[corner as usize] += area;
        }
    }
    normals.into_iter().map(DVec3::normalize_or_zero).collect()
}

#[cfg(test)]
mod tests {
    use super::super::body::Shape;
    use super::super::deform::Deformation;
    use super::*;

    #[test]
    fn ways_are_those_of_the_surface_and_places_beyond_the_far_side_have_none() {
        let body = Body::of_shape(Shape::Blob, 600, 0.15);
        let points = Deformation::Rest.apply(&body);
        let truth = Truth::new(&body, &points, 0.1 * 0.15, 40, 2);
        assert!(truth.sights.len() > 100, "{}", truth.sights.len());
        assert!(truth.sights.iter().any(|sight| sight.is_poked));
        let rays = Rays::new(&points, &body.mesh.point_triangles());
        for (sight, ways) in truth.sights.iter().zip(&truth.ways) {
            for (i, t) in sight.samples_m() {
                let inside = sight.place - t * sight.to_eye;
                let way = ways[FRONT][i].length_m;
                let way = way.expect("inside the body light has a way out");
                // Straight back to the eye it is t: the oracle's own closed form.
                let back = rays.exit_m((inside, sight.to_eye)).expect("inside");
                assert!((back - t).abs() < 1e-8, "{back} for {t}");
                assert!(way > 0.0 && way < 0.2);
            }
            let inside = sight.samples_m().count();
            assert_eq!(
                ways[BACK].iter().filter_map(|way| way.length_m).count(),
                inside
            );
        }
    }

    #[test]
    fn places_by_the_edge_of_a_shadow_are_told_from_those_off_it() {
        // A roof a metre above, over x > 0.
        let roof = [
            DVec3::new(0.0, -9.0, 1.0),
            DVec3::new(9.0, 0.0, 1.0),
            DVec3::new(0.0, 9.0, 1.0),
        ];
        let rays = Rays::new(&roof, &[[0, 1, 2]]);
        let by = |x: f64, edge_m: f64| {
            is_by_shadow(&rays, DVec3::new(x, 0.0, 0.0), DVec3::Z, 0.01, edge_m)
        };
        assert!(by(-0.001, 0.002) && by(0.001, 0.002));
        assert!(!by(-0.003, 0.002));
        // Nearer than half a radius it is the surface round the place.
        let near = DVec3::new(-0.001, 0.0, 0.998);
        assert!(!is_by_shadow(&rays, near, DVec3::Z, 0.01, 0.002));
    }

    #[test]
    fn same_sights_come_from_one_thread_and_from_three() {
        let body = Body::of_shape(Shape::Blob, 600, 0.15);
        let points = Deformation::Poke.apply(&body);
        let [one, three] = [1, 3].map(|threads| Truth::new(&body, &points, 0.01, 20, threads));
        assert_eq!(one.ways, three.ways);
    }

    #[test]
    fn tissue_keeps_a_hundredth_over_its_radius() {
        let tissue = tissue_of(0.01);
        let left = (-tissue.extinction_per_m * 0.01).exp();
        assert!((left.y - 0.01).abs() < 1e-12 && left.x < left.y);
    }
}
