//! One picture: a bundled organ in the middle of its script, poked, as each method lights it, beside the truth by
//! rays, and how far off each pixel is.

use super::body::Body;
use super::estimate::{Blend, Drawn};
use super::sight::{SAMPLES, Sight, exact_normals, is_shaded, way_of};
use super::trial::Bench;
use crate::app::{AppError, Session, load_scene};
use crate::geom::plane::LightPathMethod;
use crate::measure::{caption, files};
use crate::passes::frame::light_radius_m;
use crate::reference::{EvenTissue, Rays, all_by};
use glam::{DVec3, Vec3};
use image::{Rgba, RgbaImage};
use std::path::Path;

/// The organ, and the time at which its probe is deepest [s].
const SCENE: &str = "spleen";
const DEEPEST_S: f32 = 1.2;
/// What is compared with the truth, left to right.
const METHODS: [LightPathMethod; 5] = [
    LightPathMethod::Stale,
    LightPathMethod::Carried,
    LightPathMethod::Full,
    LightPathMethod::Quadric,
    LightPathMethod::DepthMap,
];
/// Width of what is seen, as a share of the organ.
const WIDTH_SHARE: f32 = 0.62;
/// Angle between eye and light [degrees].
const LIGHT_DEG: f64 = 50.0;
/// The error at which the scale ends, as a share of the truth.
const ERROR_MAX: f64 = 0.5;
/// Height of the captions [px] by the dots of a letter.
const CAPTION_DOTS: u32 = 9;
const PAPER: Rgba<u8> = Rgba([24, 26, 30, 255]);
const INK: Rgba<u8> = Rgba([235, 235, 235, 255]);

/// Writes `planes.png` into `out`, with panels of `side` pixels.
///
/// # Errors
///
/// [`AppError`] if the organ can't be loaded, the GPU fails or the file can't be written.
pub fn write(bench: &Bench, side: u32, out: &Path) -> Result<(), AppError> {
    let scene = load_scene(SCENE, &[])?;
    let radius_m = light_radius_m(&scene);
    let mut session = Session::new(scene, bench.threads())?;
    while session.time_s() < DEEPEST_S {
        session.tick();
    }
    let body = Body::as_it_lies(session.mesh.clone());
    let points = session.points().to_vec();
    let view = View::new(&body, &points, radius_m);
    let sights = view.sights(side, bench.threads());
    let truth = all_by(bench.threads(), &sights, |sight| {
        sight.as_ref().map_or(DVec3::ZERO, |sight| {
            view.radiance(sight, |inside, _| {
                let way = way_of(&view.rays, inside, view.to_light);
                way.length_m.filter(|_| !way.is_shaded)
            })
        })
    });
    let mut panels = vec![("truth by rays".to_owned(), truth.clone())];
    for method in METHODS {
        let lights = [[view.to_light; 3]];
        let drawn = bench.drawn(&body, method, radius_m, &points, &lights)?;
        let lit = all_by(bench.threads(), &sights, |sight| {
            sight
                .as_ref()
                .map_or(DVec3::ZERO, |sight| view.estimate(sight, &drawn))
        });
        let error = relative_error(&lit, &truth);
        panels.push((format!("{} {:.1}%", method.name(), 100.0 * error), lit));
    }
    let picture = sheet(&panels, side);
    Ok(files::write_png(&out.join("planes.png"), &picture)?)
}

/// An eye, a light and a tissue over a deformed organ.
struct View {
    rays: Rays,
    points: Vec<DVec3>,
    normals: Vec<DVec3>,
    triangles: Vec<[u32; 3]>,
    to_eye: DVec3,
    to_light: DVec3,
    right: DVec3,
    up: DVec3,
    middle: DVec3,
    width_m: f64,
    radius_m: f64,
    tissue: EvenTissue,
}

impl View {
    /// Looks from far away, a little from the side, at the point that moved farthest.
    fn new(body: &Body, points: &[Vec3], radius_m: f32) -> Self {
        let exact: Vec<DVec3> = points.iter().map(|p| p.as_dvec3()).collect();
        let moved = |point: usize| points[point].distance_squared(body.mesh.points[point]);
        let farthest = (0..points.len())
            .max_by(|&a, &b| moved(a).total_cmp(&moved(b)))
            .expect("an organ has points");
        let triangles = body.mesh.point_triangles();
        let middle = exact[farthest];
        let normal = body.normals[farthest].as_dvec3();
        let to_eye = (normal + 0.5 * normal.any_orthonormal_vector()).normalize();
        let right = DVec3::Y.cross(to_eye).normalize();
        let up = to_eye.cross(right);
        let tilt = LIGHT_DEG.to_radians();
        let aside = (0.75 * up - 0.66 * right).normalize();
        let sigma = 0.01_f64.ln().abs() / f64::from(radius_m);
        Self {
            rays: Rays::new(&exact, &triangles),
            normals: exact_normals(&exact, &triangles),
            points: exact,
            triangles,
            to_eye,
            to_light: tilt.cos() * to_eye + tilt.sin() * aside,
            right,
            up,
            middle,
            width_m: f64::from(WIDTH_SHARE * body.size_m),
            radius_m: f64::from(radius_m),
            // Red reaches as far as the patches, green and blue half as far: flesh.
            tissue: EvenTissue {
                scattering_per_m: sigma * DVec3::new(0.9, 0.75, 0.7),
                extinction_per_m: sigma * DVec3::new(1.0, 2.2, 2.5),
            },
        }
    }

    /// What each pixel sees, row by row from the top.
    fn sights(&self, side: u32, threads: usize) -> Vec<Option<Sight>> {
        let pixels: Vec<(u32, u32)> = (0..side)
            .flat_map(|y| (0..side).map(move |x| (x, y)))
            .collect();
        all_by(threads, &pixels, |&(x, y)| self.sight(side, x, y))
    }

    fn sight(&self, side: u32, x: u32, y: u32) -> Option<Sight> {
        let share = |i: u32| (f64::from(i) + 0.5) / f64::from(side) - 0.5;
        let on_plane = self.middle + self.width_m * (share(x) * self.right - share(y) * self.up);
        let from = on_plane + 10.0 * self.width_m * self.to_eye;
        let (distance, triangle) = self.rays.first((from, -self.to_eye))?;
        let place = from - distance * self.to_eye;
        let sight = Sight::at(
            place,
            self.to_eye,
            self.triangles[triangle],
            [&self.points, &self.normals],
            &self.rays,
            self.radius_m,
        )?;
        // What faces away is lit through the body or not at all: the way itself tells.
        let normal: DVec3 = (0..3)
            .map(|k| f64::from(sight.shares[k]) * self.normals[sight.corners[k] as usize])
            .sum();
        let is_dark = normal.dot(self.to_light) > 0.0
            && is_shaded(&self.rays, place, self.to_light, self.radius_m);
        Some(Sight {
            to_lights: [self.to_light; 3],
            is_shaded: [is_dark; 3],
            ..sight
        })
    }

    /// Light along a sight, by the way that `way_m` tells for a place inside and its depth along the view.
    fn radiance(&self, sight: &Sight, way_m: impl Fn(DVec3, f64) -> Option<f64>) -> DVec3 {
        debug_assert!(sight.samples_m().count() <= SAMPLES);
        sight
            .samples_m()
            .map(|(_, t)| {
                let way = way_m(sight.place - t * sight.to_eye, t);
                self.tissue.glow(t, way, sight.step_m())
            })
            .sum()
    }

    fn estimate(&self, sight: &Sight, drawn: &Drawn) -> DVec3 {
        let cover = drawn.cover(sight);
        // As the product draws it: one look at the shadow of the point, unless the ways see shadows themselves.
        if sight.is_shaded[0] && !drawn.sees_shadows() {
            return DVec3::ZERO;
        }
        self.radiance(sight, |_, t| cover.way_m(sight, 0, t, Blend::Squared))
    }
}

fn relative_error(lit: &[DVec3], truth: &[DVec3]) -> f64 {
    let wrong: f64 = lit
        .iter()
        .zip(truth)
        .map(|(a, b)| (*a - *b).length_squared())
        .sum();
    let whole: f64 = truth.iter().map(|b| b.length_squared()).sum();
    (wrong / whole.max(f64::MIN_POSITIVE)).sqrt()
}

/// All panels in a row, the first of which is the truth, and below each its errors.
fn sheet(panels: &[(String, Vec<DVec3>)], side: u32) -> RgbaImage {
    let scale = (side / 120).max(1);
    let caption = CAPTION_DOTS * scale;
    let mut picture =
        RgbaImage::from_pixel(panels.len() as u32 * side, 2 * (side + caption), PAPER);
    let truth = &panels[0].1;
    let brightest = truth.iter().map(|l| l.max_element()).fold(1e-12, f64::max);
    for (column, (name, lit)) in panels.iter().enumerate() {
        let left = column as u32 * side;
        let top = side + 2 * caption;
        caption::write(
            &mut picture,
            (left + 2 * scale, 2 * scale),
            scale,
            name,
            INK,
        );
        for (i, (light, exact)) in lit.iter().zip(truth).enumerate() {
            let (x, y) = (i as u32 % side, i as u32 / side);
            if *exact == DVec3::ZERO {
                continue;
            }
            picture.put_pixel(left + x, caption + y, shown(*light / (0.8 * brightest)));
            if column > 0 {
                // Against a twentieth of the brightest where the truth is dark.
                let error = (*light - *exact).length() / exact.length().max(0.05 * brightest);
                picture.put_pixel(left + x, top + y, heat(error / ERROR_MAX));
            }
        }
        if column > 0 {
            let place = (left + 2 * scale, side + caption + 2 * scale);
            caption::write(&mut picture, place, scale, "error", INK);
        }
    }
    let bar = side / 12;
    for (x, y) in (0..side).flat_map(|x| (0..bar).map(move |y| (x, y))) {
        picture.put_pixel(
            x,
            side + 2 * caption + y,
            heat(f64::from(x) / f64::from(side)),
        );
    }
    let end = format!("0 to {:.0}% off", 100.0 * ERROR_MAX);
    let below = (2 * scale, side + 2 * caption + bar + 2 * scale);
    caption::write(&mut picture, below, scale, &end, INK);
    picture
}

/// Linear light as sRGB.
fn shown(linear: DVec3) -> Rgba<u8> {
    let encoded = linear.to_array().map(|l| {
        let l = l.clamp(0.0, 1.0);
        let s = if l <= 0.003_130_8 {
            12.92 * l
        } else {
            1.055 * l.powf(1.0 / 2.4) - 0.055
        };
        (255.0 * s).round() as u8
    });
    Rgba([encoded[0], encoded[1], encoded[2], 255])
}

/// The colour of a share of the scale: black over violet and orange to pale yellow.
pub fn heat(share: f64) -> Rgba<u8> {
    const STOPS: [[f64; 3]; 5] = [
        [6.0, 6.0, 12.0],
        [87.0, 16.0, 110.0],
        [188.0, 55.0, 84.0],
        [249.0, 142.0, 9.0],
        [252.0, 255.0, 164.0],
    ];
    let at = share.clamp(0.0, 1.0) * (STOPS.len() - 1) as f64;
    let low = (at as usize).min(STOPS.len() - 2);
    let part = at - low as f64;
    let mixed = |k: usize| (STOPS[low][k] * (1.0 - part) + STOPS[low + 1][k] * part).round() as u8;
    Rgba([mixed(0), mixed(1), mixed(2), 255])
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn truth_has_no_error_map_and_a_panel_twice_as_bright_is_off_the_scale() {
        let truth = vec![DVec3::splat(0.4); 64];
        let double = vec![DVec3::splat(0.8); 64];
        assert_eq!(relative_error(&truth, &truth), 0.0);
        assert!((relative_error(&double, &truth) - 1.0).abs() < 1e-12);
        let picture = sheet(
            &[
                ("truth".to_owned(), truth.clone()),
                ("same".to_owned(), truth),
                ("double".to_owned(), double),
            ],
            8,
        );
        let below = 8 + 2 * CAPTION_DOTS + 7;
        assert_eq!(*picture.get_pixel(4, below), PAPER);
        assert_eq!(*picture.get_pixel(8 + 4, below), heat(0.0));
        assert_eq!(*picture.get_pixel(16 + 4, below), heat(1.0));
    }
}
