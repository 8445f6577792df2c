//! How far off the light path of the running scene is, pixel by pixel, against rays cast at the surface as it lies.
//!
//! The window takes a [`Snapshot`] after a frame; threads of their own answer it while the window draws on. What is
//! compared is light scattered once in an even tissue that dies within the radius of the patches, from the same places
//! below each pixel: the two differ by the ways to the lights alone. Places in a cast shadow are left out: shadow is not
//! the light path's to find.

use super::orbit::Orbit;
use crate::reference::{EvenTissue, Rays, all_by};
use crate::scene::PlacedLight;
use crate::study::planes::{Blend, Drawn, Sight, exact_normals, tissue_of, way_of};
use glam::{DVec3, Vec2, Vec3};
use std::sync::mpsc::{Receiver, TryRecvError, channel};

/// Pixels of the picture to a side of one that is looked at.
pub const COARSENESS_PX: u32 = 6;
/// What the truth is taken for at least, as a share of the brightest: darker places have no error of their own.
const DARKEST_SHARE: f64 = 0.05;

/// Everything that an answer needs, as it was in one frame.
pub struct Snapshot {
    /// The surface [m].
    pub points: Vec<Vec3>,
    /// Corners as points.
    pub triangles: Vec<[u32; 3]>,
    /// What the shaders read; the maps of light `k` are those of eye `k`.
    pub drawn: Drawn,
    /// How its planes are blended.
    pub blend: Blend,
    /// The lights, the one that casts shadows first.
    pub lights: Vec<PlacedLight>,
    /// How far light is followed [m].
    pub radius_m: f32,
    /// The camera.
    pub orbit: Orbit,
    /// Width and height of the picture [px].
    pub size: [u32; 2],
    /// Simulated time [s].
    pub time_s: f32,
}

/// How far off a picture is.
#[derive(Clone, Debug, PartialEq)]
pub struct ErrorMap {
    /// Columns and rows.
    pub size: [usize; 2],
    /// Error of the radiance of each place as a share of the truth there, row by row from the top; nothing beside the
    /// body.
    pub shares: Vec<Option<f64>>,
    /// `√(Σ error² / Σ truth²)`; nothing where no light falls.
    pub error_rel: Option<f64>,
    /// The camera that it is seen by.
    pub orbit: Orbit,
    /// Simulated time of what it shows [s].
    pub time_s: f32,
}

impl Snapshot {
    /// Compares, by so many `threads`.
    pub fn answer(&self, threads: usize) -> ErrorMap {
        let scene = Answering::new(self);
        let size = self.size.map(|px| px.div_ceil(COARSENESS_PX).max(1));
        let pixels: Vec<(u32, u32)> = (0..size[1])
            .flat_map(|y| (0..size[0]).map(move |x| (x, y)))
            .collect();
        let lit = all_by(threads, &pixels, |&(x, y)| {
            let at = Vec2::new(x as f32 + 0.5, y as f32 + 0.5)
                / Vec2::new(size[0] as f32, size[1] as f32);
            scene.radiances(at)
        });
        let brightest = (lit.iter().flatten())
            .map(|(_, exact)| exact.length())
            .fold(f64::MIN_POSITIVE, f64::max);
        let share = |(got, exact): (DVec3, DVec3)| {
            (got - exact).length() / exact.length().max(DARKEST_SHARE * brightest)
        };
        let (wrong, whole) =
            lit.iter()
                .flatten()
                .fold((0.0, 0.0), |(wrong, whole), (got, exact)| {
                    (
                        wrong + (*got - *exact).length_squared(),
                        whole + exact.length_squared(),
                    )
                });
        ErrorMap {
            size: size.map(|n| n as usize),
            shares: lit.iter().map(|pair| pair.map(share)).collect(),
            error_rel: (whole > 0.0).then(|| f64::sqrt(wrong / whole)),
            orbit: self.orbit,
            time_s: self.time_s,
        }
    }
}

/// A snapshot with the tree that rays are cast at.
struct Answering<'a> {
    snapshot: &'a Snapshot,
    points: Vec<DVec3>,
    normals: Vec<DVec3>,
    rays: Rays,
    tissue: EvenTissue,
}

impl<'a> Answering<'a> {
    fn new(snapshot: &'a Snapshot) -> Self {
        let points: Vec<DVec3> = snapshot.points.iter().map(|p| p.as_dvec3()).collect();
        Self {
            normals: exact_normals(&points, &snapshot.triangles),
            rays: Rays::new(&points, &snapshot.triangles),
            points,
            tissue: tissue_of(f64::from(snapshot.radius_m)),
            snapshot,
        }
    }

    /// Radiance by the method and in truth at a place of the picture, in shares of it; `None` beside the body.
    fn radiances(&self, at: Vec2) -> Option<(DVec3, DVec3)> {
        let [width, height] = self.snapshot.size.map(|px| px as f32);
        let ray = self.snapshot.orbit.ray(at, width / height);
        let to_eye = -ray.direction.as_dvec3();
        let (distance, triangle) = self.rays.first((ray.origin.as_dvec3(), -to_eye))?;
        let place = ray.origin.as_dvec3() - distance * to_eye;
        let sight = Sight::at(
            place,
            to_eye,
            self.snapshot.triangles[triangle],
            [&self.points, &self.normals],
            &self.rays,
            f64::from(self.snapshot.radius_m),
        )?;
        let (mut got, mut exact) = (DVec3::ZERO, DVec3::ZERO);
        for (k, light) in self.snapshot.lights.iter().enumerate() {
            let power = light.power.as_dvec3();
            let (to_light, irradiance) = if light.is_point {
                let to = light.place.as_dvec3() - place;
                (
                    to.normalize_or(DVec3::Y),
                    power / to.length_squared().max(1e-8),
                )
            } else {
                (light.place.as_dvec3(), power)
            };
            let sight = Sight {
                eye: k,
                to_lights: [to_light; 3],
                ..sight.clone()
            };
            let (by_method, by_rays) = self.lit_by(&sight);
            got += irradiance * by_method;
            exact += irradiance * by_rays;
        }
        Some((got, exact))
    }

    /// Radiance for an irradiance of 1 from one light, by the method and in truth.
    fn lit_by(&self, sight: &Sight) -> (DVec3, DVec3) {
        let cover = self.snapshot.drawn.cover(sight);
        let (mut got, mut exact) = (DVec3::ZERO, DVec3::ZERO);
        for (_, t) in sight.samples_m() {
            let way = way_of(
                &self.rays,
                sight.place - t * sight.to_eye,
                sight.to_lights[0],
            );
            if way.is_shaded {
                continue;
            }
            exact += self.tissue.glow(t, way.length_m, sight.step_m());
            let told = cover.way_m(sight, 0, t, self.snapshot.blend);
            got += self.tissue.glow(t, told, sight.step_m());
        }
        (got, exact)
    }
}

/// The map of a running scene: one answer after another, as long as it is asked for.
#[derive(Default)]
pub struct LightError {
    /// The question that is being answered.
    pending: Option<Receiver<ErrorMap>>,
    /// The last answer.
    map: Option<ErrorMap>,
    /// One that came in while nobody looked.
    arrived: Option<ErrorMap>,
}

impl LightError {
    /// Whether another question can be put.
    pub fn is_free(&self) -> bool {
        self.pending.is_none()
    }

    /// Has `snapshot` answered by so many threads beside the caller's.
    pub fn ask(&mut self, snapshot: Snapshot, threads: usize) {
        let (send, receive) = channel();
        self.pending = Some(receive);
        std::thread::spawn(move || {
            // Nobody waits for it any more when the window is closed.
            let _ = send.send(snapshot.answer(threads));
        });
    }

    /// Whether an answer has come in that was not taken yet.
    pub fn has_news(&mut self) -> bool {
        if let Some(pending) = &self.pending {
            match pending.try_recv() {
                Ok(map) => {
                    self.arrived = Some(map);
                    self.pending = None;
                }
                Err(TryRecvError::Disconnected) => self.pending = None,
                Err(TryRecvError::Empty) => {}
            }
        }
        self.arrived.is_some()
    }

    /// Takes the answer that has come in; whether there was one.
    pub fn take_news(&mut self) -> bool {
        if !self.has_news() {
            return false;
        }
        self.map = self.arrived.take();
        true
    }

    /// The last answer.
    pub fn map(&self) -> Option<&ErrorMap> {
        self.map.as_ref()
    }

    /// Forgets the last answer; one that is being worked out will still come in.
    pub fn clear(&mut self) {
        self.map = None;
        self.arrived = None;
    }

    /// Forgets that one too: it is of another scene or method.
    pub fn forget(&mut self) {
        self.clear();
        self.pending = None;
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::SurfaceMesh;
    use crate::geom::quadric::Quadric;
    use crate::study::planes::DrawnPrimitives;
    use glam::Vec4;

    const RADIUS_M: f32 = 0.05;

    /// A ball about the origin.
    fn ball() -> SurfaceMesh {
        let side = 24;
        let mut mesh = SurfaceMesh {
            points: Vec::new(),
            point_of: Vec::new(),
            uvs: Vec::new(),
            triangles: Vec::new(),
        };
        // Rings about y; poles are rings of one place.
        for ring in 0..=side {
            let polar = std::f32::consts::PI * ring as f32 / side as f32;
            for k in 0..2 * side {
                let around = std::f32::consts::PI * k as f32 / side as f32;
                let (y, r) = (polar.cos(), polar.sin());
                mesh.points
                    .push(RADIUS_M * Vec3::new(r * around.sin(), y, r * around.cos()));
            }
        }
        let at = |ring: usize, k: usize| (ring * 2 * side + k % (2 * side)) as u32;
        for (ring, k) in (0..side).flat_map(|ring| (0..2 * side).map(move |k| (ring, k))) {
            let (a, b) = (at(ring, k), at(ring, k + 1));
            let (c, d) = (at(ring + 1, k), at(ring + 1, k + 1));
            mesh.triangles.extend([[a, c, d], [a, d, b]]);
        }
        mesh.point_of = (0..mesh.points.len() as u32).collect();
        mesh.uvs = vec![Vec2::ZERO; mesh.points.len()];
        mesh
    }

    fn snapshot(primitives: impl Fn(Vec3) -> Option<Quadric>) -> Snapshot {
        let mesh = ball();
        let normals: Vec<Vec3> = mesh.points.iter().map(|p| p.normalize()).collect();
        let quadrics: Option<Vec<[Vec4; 2]>> = normals
            .iter()
            .map(|&n| Some(primitives(n)?.to_arrays().map(Vec4::from_array)))
            .collect();
        let light = |toward: Vec3| PlacedLight {
            place: toward.normalize(),
            is_point: false,
            power: Vec3::ONE,
            shadow: false,
        };
        Snapshot {
            triangles: mesh.point_triangles(),
            points: mesh.points,
            drawn: Drawn {
                normals: normals.iter().map(|n| n.extend(0.0)).collect(),
                primitives: quadrics.map_or(DrawnPrimitives::Tangent, DrawnPrimitives::Quadrics),
            },
            blend: Blend::Squared,
            lights: vec![light(Vec3::new(0.5, 0.6, 1.0)), light(Vec3::X)],
            radius_m: 0.3 * RADIUS_M,
            orbit: Orbit::new(0.3 * Vec3::Z, Vec3::ZERO, Vec3::Y, 0.6),
            size: [240, 180],
            time_s: 0.5,
        }
    }

    fn tangent() -> Snapshot {
        snapshot(|_| None)
    }

    /// The paraboloids of the ball itself.
    fn bent() -> Snapshot {
        snapshot(|n| {
            let (u, v) = n.any_orthonormal_pair();
            let k = -1.0 / RADIUS_M;
            Some(Quadric::in_world([k, 0.0, k], u, v))
        })
    }

    #[test]
    fn paraboloids_of_a_ball_err_less_than_its_tangent_planes_and_nothing_is_told_beside_it() {
        let [flat, bent] = [tangent(), bent()].map(|snapshot| snapshot.answer(2));
        assert_eq!(flat.size, [40, 30]);
        assert_eq!(flat.shares.len(), 40 * 30);
        assert_eq!(flat.shares[0], None);
        assert!(flat.shares[15 * 40 + 20].is_some());
        let [flat, bent] = [flat, bent].map(|map| map.error_rel.expect("it is lit"));
        // The ball bends by 0.3 of its radius within a patch.
        assert!(flat > 0.05, "{flat}");
        assert!(bent < 0.4 * flat, "{bent} and {flat}");
    }

    #[test]
    fn a_map_is_the_same_from_one_thread_and_from_three() {
        assert_eq!(tangent().answer(1), tangent().answer(3));
    }

    #[test]
    fn an_answer_comes_in_beside_the_caller_and_is_taken_once() {
        let mut error = LightError::default();
        assert!(error.is_free() && !error.take_news());
        error.ask(tangent(), 1);
        assert!(!error.is_free());
        while !error.has_news() {
            std::thread::yield_now();
        }
        assert!(error.is_free() && error.map().is_none());
        assert!(error.take_news() && !error.take_news());
        assert_eq!(error.map().expect("it was taken").time_s, 0.5);
        error.forget();
        assert!(error.map().is_none());
    }
}
