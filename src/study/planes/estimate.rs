//! What a method makes of a sight: the primitives that the GPU holds, evaluated as the shaders do, and how far off
//! that is.

use super::sight::{BACK, FRONT, GRAZE, Sight, Truth, Way};
use crate::geom::quadric::Quadric;
use crate::optics::light_entry::way_from_entry;
use crate::optics::light_plane::{self, PlanePair};
use crate::optics::light_quadric::{self, Aim, Bend};
use crate::optics::pack::from_octahedral;
use glam::{DVec3, Mat4, Vec2, Vec3, Vec4};

/// What the shaders read of every point, read back.
#[derive(Clone, Debug)]
pub struct Drawn {
    /// Unit normals.
    pub normals: Vec<Vec4>,
    pub primitives: DrawnPrimitives,
}

/// The primitive of each point.
#[derive(Clone, Debug)]
pub enum DrawnPrimitives {
    /// The tangent plane.
    Tangent,
    /// Unit normal and signed offset [m].
    Planes(Vec<Vec4>),
    /// The matrix of the paraboloid [1/m].
    Quadrics(Vec<[Vec4; 2]>),
    /// Nothing a point: a map of each light of each eye.
    DepthMaps(Vec<Vec<DepthMap>>),
}

/// Where one light enters, as the shaders read it.
#[derive(Clone, Debug)]
pub struct DepthMap {
    pub clip_from_world: Mat4,
    pub world_from_clip: Mat4,
    /// How far before its entry a place still counts as inside [m].
    pub slack_m: f32,
    /// Side of the map [px].
    pub side: u32,
    /// 0 near the light to 1 far.
    pub depth: Vec<f32>,
    /// The packed normal at each entry.
    pub normals: Vec<u32>,
}

impl DepthMap {
    /// The way [m] from `at` to the light; `None` where none comes. As `way_under` of `shaders/light_depth.wgsl`, with
    /// `flat_m` where the map is empty, and nothing where that faces away.
    fn way_m(&self, at: Vec3, to_light: Vec3, flat_m: Option<f32>) -> Option<f32> {
        let clip = self.clip_from_world * at.extend(1.0);
        let ndc = clip.truncate().truncate() / clip.w;
        let size = self.side as f32;
        let texel = ((ndc * Vec2::new(0.5, -0.5) + 0.5) * size).floor();
        if texel.min_element() < 0.0 || texel.max_element() >= size {
            return flat_m.or(Some(0.0));
        }
        let index = texel.y as usize * self.side as usize + texel.x as usize;
        let depth = self.depth[index];
        if depth >= 1.0 {
            return flat_m.or(Some(0.0));
        }
        let centre = (texel + 0.5) / size * Vec2::new(2.0, -2.0) + Vec2::new(-1.0, 1.0);
        let entry = self.world_from_clip.project_point3(centre.extend(depth));
        let normal = from_octahedral(self.normals[index]);
        way_from_entry(entry, normal, at, to_light, self.slack_m).map(|(way, _)| way)
    }
}

/// How the plane of a sample is blended from the tangent plane to the fitted one.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Blend {
    /// By the square of the share of the way: ours.
    Squared,
    /// By the share itself, and with the absolute values that let light through planes that face away: François 2006,
    /// eqs. 9 and 10.
    Published,
}

impl Drawn {
    /// Whether every number is one.
    pub fn is_finite(&self) -> bool {
        let primitives_are = match &self.primitives {
            DrawnPrimitives::Tangent | DrawnPrimitives::DepthMaps(_) => true,
            DrawnPrimitives::Planes(planes) => planes.iter().all(|plane| plane.is_finite()),
            DrawnPrimitives::Quadrics(quadrics) => {
                quadrics.iter().flatten().all(|half| half.is_finite())
            }
        };
        primitives_are && self.normals.iter().all(|normal| normal.is_finite())
    }

    /// The same with every plane, left where it was in space, moved along with its point from `rest` to `now` [m], unturned.
    pub fn moved_along(&self, rest: &[Vec3], now: &[Vec3]) -> Self {
        let mut moved = self.clone();
        if let DrawnPrimitives::Planes(planes) = &mut moved.primitives {
            for (plane, (rest, now)) in planes.iter_mut().zip(rest.iter().zip(now)) {
                plane.w += plane.truncate().dot(*now - *rest);
            }
        }
        moved
    }

    /// Whether its ways know of every shadow; with the others the place itself is asked.
    pub fn sees_shadows(&self) -> bool {
        matches!(self.primitives, DrawnPrimitives::DepthMaps(_))
    }

    /// What stands for the surface over a sight, mixed over its triangle as a pixel mixes it.
    pub fn cover(&self, sight: &Sight) -> Cover<'_> {
        let mixed = |of: &[Vec4]| -> Vec4 {
            (0..3)
                .map(|k| sight.shares[k] * of[sight.corners[k] as usize])
                .sum()
        };
        let normal = mixed(&self.normals).truncate().normalize_or_zero();
        match &self.primitives {
            DrawnPrimitives::DepthMaps(maps) => Cover::DepthMaps {
                normal,
                maps: &maps[sight.eye],
            },
            DrawnPrimitives::Tangent => Cover::Plane {
                normal,
                plane: normal,
                offset_m: 0.0,
            },
            DrawnPrimitives::Planes(planes) => {
                let plane = mixed(planes);
                Cover::Plane {
                    normal,
                    plane: plane.truncate().normalize_or_zero(),
                    offset_m: plane.w,
                }
            }
            DrawnPrimitives::Quadrics(quadrics) => {
                let half = |which: usize| -> Vec3 {
                    (0..3)
                        .map(|k| sight.shares[k] * quadrics[sight.corners[k] as usize][which])
                        .sum::<Vec4>()
                        .truncate()
                };
                Cover::Quadric {
                    normal,
                    quadric: Quadric {
                        squares: half(0),
                        products: half(1),
                    },
                }
            }
        }
    }
}

/// What stands for the surface at one place.
#[derive(Clone, Copy, Debug)]
pub enum Cover<'a> {
    Plane {
        normal: Vec3,
        plane: Vec3,
        offset_m: f32,
    },
    Quadric {
        normal: Vec3,
        quadric: Quadric,
    },
    DepthMaps {
        normal: Vec3,
        maps: &'a [DepthMap],
    },
}

impl Cover<'_> {
    /// Length [m] of the way from `t_m` along the view of `sight` to a light, by the product's own formula; `None` where
    /// no light comes.
    pub fn way_m(&self, sight: &Sight, light: usize, t_m: f64, blend: Blend) -> Option<f64> {
        let reach_m = sight.reach_m;
        let which = light;
        let (eye, light) = (sight.to_eye.as_vec3(), sight.to_lights[light].as_vec3());
        let way = match *self {
            Self::Plane {
                normal,
                plane,
                offset_m,
            } => {
                let pair = PlanePair {
                    normals: normal.dot(plane),
                    tangent_eye: normal.dot(eye),
                    plane_eye: plane.dot(eye),
                    offset_m,
                };
                let (t, share) = (t_m as f32, (t_m / reach_m) as f32);
                let (tangent_light, plane_light) = (normal.dot(light), plane.dot(light));
                match blend {
                    Blend::Squared => light_plane::way_to_light(
                        &pair,
                        t,
                        share * share,
                        tangent_light,
                        plane_light,
                    ),
                    Blend::Published => Some(light_plane::way_as_printed(
                        &pair,
                        t,
                        share,
                        tangent_light,
                        plane_light,
                    )),
                }
            }
            Self::Quadric { normal, quadric } => {
                let (u, v) = normal.any_orthonormal_pair();
                let local = |d: Vec3| Vec3::new(d.dot(u), d.dot(v), d.dot(normal));
                let bend = Bend {
                    bends: Vec3::from_array(quadric.in_frame(u, v)),
                    to_eye: local(eye),
                };
                let aim = Aim {
                    to_light: local(light),
                };
                light_quadric::way_to_light(&bend, &aim, t_m as f32)
            }
            Self::DepthMaps { normal, maps } => {
                let (cosine, tangent_eye) = (normal.dot(light), normal.dot(eye).max(0.0));
                let flat_m = (cosine > 1e-3).then(|| t_m as f32 * tangent_eye / cosine);
                let at = (sight.place - t_m * sight.to_eye).as_vec3();
                maps[which].way_m(at, light, flat_m).map(|way| (way, 1.0))
            }
        };
        way.map(|(way_m, _)| f64::from(way_m))
    }
}

/// How far off a method is over a set of sights: `√(Σ error² / Σ truth²)`; `None` where there is nothing to see.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Errors {
    /// ‖KM‖, cut at the radius of the patches; front and graze, lit points.
    pub km: Option<f64>,
    /// Radiance of the same; red, green, blue together.
    pub radiance: Option<f64>,
    /// Radiance by light: front and graze of lit points, back of all.
    pub front: Option<f64>,
    pub graze: Option<f64>,
    pub back: Option<f64>,
    /// Radiance of front and graze where the body is poked.
    pub poked: Option<f64>,
    /// Radiance of front and graze with cast shadows: those of the truth are of each place, those of a method as it
    /// sees them.
    pub shadowed: Option<f64>,
}

#[derive(Clone, Copy, Debug, Default)]
struct Sum {
    wrong: f64,
    whole: f64,
}

impl Sum {
    fn add(&mut self, wrong: f64, whole: f64) {
        self.wrong += wrong;
        self.whole += whole;
    }

    fn share(self) -> Option<f64> {
        (self.whole > 0.0).then(|| (self.wrong / self.whole).sqrt())
    }
}

/// Errors of ways that `way_m` tells: by sight, index of the light, and depth along the view [m].
///
/// Places in a cast shadow are left out, but in `shadowed`: what shades a place is not the light path's to find. A
/// method that does not see shadows itself is told there what shades the point of the sight.
pub fn errors(
    truth: &Truth,
    sees_shadows: bool,
    way_m: impl Fn(usize, usize, f64) -> Option<f64>,
) -> Errors {
    let mut by_light = [Sum::default(); 3];
    let (mut km, mut poked, mut shadowed) = (Sum::default(), Sum::default(), Sum::default());
    let clamped = |way: Option<f64>| way.map_or(truth.radius_m, |s| s.min(truth.radius_m));
    for (index, (sight, ways)) in truth.sights.iter().zip(&truth.ways).enumerate() {
        for light in [FRONT, GRAZE, BACK] {
            if light != BACK && sight.cos_lights[light] <= 0.0 {
                continue;
            }
            let (mut got, mut exact) = (DVec3::ZERO, DVec3::ZERO);
            let (mut dim_got, mut dim_exact) = (DVec3::ZERO, DVec3::ZERO);
            for (i, t) in sight.samples_m() {
                let Way {
                    length_m: Some(way),
                    is_shaded,
                } = ways[light][i]
                else {
                    continue;
                };
                let told = way_m(index, light, t);
                let seen = told.filter(|_| sees_shadows || !sight.is_shaded[light]);
                dim_got += truth.tissue.glow(t, seen, sight.step_m());
                if is_shaded {
                    continue;
                }
                dim_exact += truth.tissue.glow(t, Some(way), sight.step_m());
                exact += truth.tissue.glow(t, Some(way), sight.step_m());
                got += truth.tissue.glow(t, told, sight.step_m());
                if light != BACK {
                    let (way, told) = (clamped(Some(way)), clamped(told));
                    km.add((told - way).powi(2), way * way);
                }
            }
            let (wrong, whole) = ((got - exact).length_squared(), exact.length_squared());
            by_light[light].add(wrong, whole);
            if light != BACK {
                let wrong = (dim_got - dim_exact).length_squared();
                shadowed.add(wrong, dim_exact.length_squared());
            }
            if light != BACK && sight.is_poked {
                poked.add(wrong, whole);
            }
        }
    }
    let lit = Sum {
        wrong: by_light[FRONT].wrong + by_light[GRAZE].wrong,
        whole: by_light[FRONT].whole + by_light[GRAZE].whole,
    };
    Errors {
        km: km.share(),
        radiance: lit.share(),
        front: by_light[FRONT].share(),
        graze: by_light[GRAZE].share(),
        back: by_light[BACK].share(),
        poked: poked.share(),
        shadowed: shadowed.share(),
    }
}

/// [`errors`] of what the GPU holds.
pub fn errors_of(truth: &Truth, drawn: &Drawn, blend: Blend) -> Errors {
    let covers: Vec<Cover<'_>> = truth.sights.iter().map(|s| drawn.cover(s)).collect();
    errors(truth, drawn.sees_shadows(), |index, light, t| {
        covers[index].way_m(&truth.sights[index], light, t, blend)
    })
}

#[cfg(test)]
mod tests {
    use super::super::body::{Body, Shape};
    use super::super::deform::Deformation;
    use super::*;

    fn truth() -> Truth {
        let body = Body::of_shape(Shape::Blob, 600, 0.15);
        let points = Deformation::Rest.apply(&body);
        Truth::new(&body, &points, 0.1 * 0.15, 30, 2)
    }

    /// The truth told back, times `factor`.
    fn told(truth: &Truth, factor: f64) -> Errors {
        errors(truth, false, |index, light, t| {
            let sight = &truth.sights[index];
            let i = (t / sight.step_m()) as usize;
            let way = truth.ways[index][light][i];
            way.length_m.map(|way| factor * way)
        })
    }

    #[test]
    fn truth_itself_has_no_error_and_ways_ten_percent_long_have_ten_percent() {
        let truth = truth();
        assert_eq!(told(&truth, 1.0).radiance, Some(0.0));
        assert_eq!(told(&truth, 1.0).km, Some(0.0));
        let longer = told(&truth, 1.1);
        // Ways at the radius are cut, so it is less than ten percent.
        let km = longer.km.expect("there are sights");
        assert!((0.05..=0.1001).contains(&km), "{km}");
        assert!(longer.radiance.unwrap() > 0.01);
    }

    #[test]
    fn one_sight_has_the_error_worked_out_by_hand() {
        let mut truth = truth();
        let tissue = truth.tissue;
        truth.sights.truncate(1);
        truth.ways.truncate(1);
        let sight = &mut truth.sights[0];
        sight.cos_lights = [0.5, -0.5, -0.5];
        sight.far_m = 1.4 * sight.step_m();
        let (step, ways) = (sight.step_m(), [0.002, 0.004]);
        let way = |length_m| Way {
            length_m: Some(length_m),
            is_shaded: false,
        };
        truth.ways[0] = Default::default();
        truth.ways[0][FRONT][0] = way(ways[0]);
        // The second place lies beyond the far side: it counts for nothing.
        truth.ways[0][FRONT][1] = way(ways[1]);
        let got = errors(&truth, false, |_, _, _| Some(0.003));
        let glow = |way| tissue.glow(0.5 * step, Some(way), step);
        let by_hand = (glow(0.003) - glow(0.002)).length() / glow(0.002).length();
        assert!((got.radiance.unwrap() - by_hand).abs() < 1e-12);
        assert!((got.km.unwrap() - 0.5).abs() < 1e-12);
        assert_eq!((got.graze, got.back), (None, None));
        // A shadow on the place itself is no error of the way, but one of what is seen.
        truth.ways[0][FRONT][0].is_shaded = true;
        let shaded = errors(&truth, false, |_, _, _| Some(0.003));
        assert_eq!((shaded.radiance, shaded.km), (None, None));
    }

    #[test]
    fn planes_that_are_tangent_err_as_much_as_none_and_turned_or_shifted_ones_more() {
        let truth = truth();
        let body = Body::of_shape(Shape::Blob, 600, 0.15);
        let normals: Vec<Vec4> = body.normals.iter().map(|n| n.extend(0.0)).collect();
        let turned = |angle: f32| Drawn {
            normals: normals.clone(),
            primitives: DrawnPrimitives::Planes(
                body.normals
                    .iter()
                    .map(|n| (glam::Quat::from_rotation_x(angle) * *n).extend(0.0))
                    .collect(),
            ),
        };
        let error = |drawn: &Drawn, blend| errors_of(&truth, drawn, blend).radiance.unwrap();
        let tangent = Drawn {
            normals: normals.clone(),
            primitives: DrawnPrimitives::Tangent,
        };
        let published = Blend::Published;
        let none = error(&tangent, published);
        assert!((error(&turned(0.0), published) - none).abs() < 1e-6);
        let wrong = error(&turned(1.0), published);
        assert!(wrong > 1.1 * none, "{wrong} and {none}");
        // The squared blend hides more of a plane's faults: less of the light comes from where it counts.
        assert!(error(&turned(1.0), Blend::Squared) < wrong);

        let rest = &body.mesh.points;
        let moved: Vec<Vec3> = rest.iter().map(|p| *p + 0.01 * Vec3::Z).collect();
        let shifted = turned(0.0).moved_along(rest, &moved);
        assert!(error(&shifted, published) > 1.5 * none);
        assert_eq!(
            error(&turned(0.0).moved_along(rest, rest), published),
            error(&turned(0.0), published)
        );
    }
}
