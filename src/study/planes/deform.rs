//! Deformations of a body by formula, in f64: each maps the place at rest to the place now.

use super::body::Body;
use glam::{DQuat, DVec3};
use serde::{Deserialize, Serialize};
use std::f64::consts::PI;

/// How the body is deformed. Lengths are shares of its size.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Serialize, Deserialize)]
#[serde(rename_all = "kebab-case")]
pub enum Deformation {
    Rest,
    /// Pressed in by 0.18 over a width of 0.09, with a rim; less deep where the body is thin.
    Poke,
    /// Turned about the long axis, from nothing at one end, which is held, to 90 degrees at the other.
    Twist,
    /// Bent along the long axis, from nothing at the end that is held to 90 degrees at the other.
    Bend,
    /// 1.5 times as long, as much volume.
    Stretch,
    /// Waves 0.01 high and 0.06 long along the normals.
    Ripple,
    /// The same to 280 degrees, or as far as the inner side lets it.
    Fold,
}

/// Depth and width of the poke, and where it ends, as shares of the size.
const POKE_DEPTH: f64 = 0.18;
const POKE_WIDTH: f64 = 0.09;
/// What counts as poked: so near to the poked point at rest.
pub const POKED_SHARE: f32 = 0.22;
/// Depth of the poke as a share of the thickness there, at most: the tissue under it is compressed by half.
const POKE_THICKNESS_SHARE: f64 = 0.45;
const RIPPLE_HEIGHT: f64 = 0.01;
const RIPPLE_LENGTH: f64 = 0.06;
/// The inner side of a fold keeps this share of the radius of the middle.
const FOLD_ROOM: f64 = 1.15;

impl Deformation {
    /// Every one, rest first.
    pub const ALL: [Self; 7] = [
        Self::Rest,
        Self::Poke,
        Self::Twist,
        Self::Bend,
        Self::Stretch,
        Self::Ripple,
        Self::Fold,
    ];

    /// As rows call it.
    pub fn name(self) -> &'static str {
        match self {
            Self::Rest => "rest",
            Self::Poke => "poke",
            Self::Twist => "twist",
            Self::Bend => "bend",
            Self::Stretch => "stretch",
            Self::Ripple => "ripple",
            Self::Fold => "fold",
        }
    }

    /// Where the points of `body` are now [m].
    pub fn apply(self, body: &Body) -> Vec<DVec3> {
        let size = f64::from(body.size_m);
        let axes = body.axes.map(|axis| axis.as_dvec3());
        let half_thickness = 0.5 * f64::from(body.extents_m.z);
        let points = body.mesh.points.iter().map(|p| p.as_dvec3());
        match self {
            Self::Rest => points.collect(),
            Self::Poke => {
                let poke = Poke::new(body);
                points.map(|p| poke.apply(p)).collect()
            }
            Self::Twist => points
                .map(|p| {
                    let share = p.dot(axes[0]) / size + 0.5;
                    DQuat::from_axis_angle(axes[0], 0.5 * PI * share) * p
                })
                .collect(),
            Self::Bend => points.map(|p| bent(p, axes, size, 0.5 * PI)).collect(),
            Self::Fold => {
                let most = size / (FOLD_ROOM * half_thickness);
                let angle = (280.0 / 180.0 * PI).min(most);
                points.map(|p| bent(p, axes, size, angle)).collect()
            }
            Self::Stretch => {
                let across = 1.0 / 1.5_f64.sqrt();
                points
                    .map(|p| across * p + (1.5 - across) * p.dot(axes[0]) * axes[0])
                    .collect()
            }
            Self::Ripple => {
                let waves = 2.0 * PI / (RIPPLE_LENGTH * size);
                points
                    .zip(&body.normals)
                    .map(|(p, normal)| {
                        let wave = (waves * p.dot(axes[0])).sin() * (waves * p.dot(axes[1])).cos();
                        p + RIPPLE_HEIGHT * size * wave * normal.as_dvec3()
                    })
                    .collect()
            }
        }
    }
}

/// The middle line along the first axis becomes an arc of `angle` round the second axis; its lower end keeps its way.
fn bent(p: DVec3, axes: [DVec3; 3], size: f64, angle: f64) -> DVec3 {
    let radius = size / angle;
    let turn = (p.dot(axes[0]) + 0.5 * size) / radius;
    let out = radius + p.dot(axes[2]);
    axes[0] * (out * turn.sin()) + axes[1] * p.dot(axes[1]) + axes[2] * (out * turn.cos() - radius)
}

/// A Gaussian dent with a rim that fades towards the far side of the body, so that no two sheets meet.
struct Poke {
    at: DVec3,
    inwards: DVec3,
    width_m: f64,
    depth_m: f64,
    /// From the poked point to the far side [m].
    thickness_m: f64,
}

impl Poke {
    fn new(body: &Body) -> Self {
        let size = f64::from(body.size_m);
        let at = body.mesh.points[body.poked].as_dvec3();
        let inwards = -body.axes[2].as_dvec3();
        let width_m = POKE_WIDTH * size;
        let under = body.mesh.points.iter().map(|p| p.as_dvec3() - at);
        let under = under.filter(|d| (*d - d.dot(inwards) * inwards).length() < 2.0 * width_m);
        let thickness_m = under.map(|d| d.dot(inwards)).fold(0.0, f64::max);
        Self {
            at,
            inwards,
            width_m,
            depth_m: (POKE_DEPTH * size).min(POKE_THICKNESS_SHARE * thickness_m),
            thickness_m,
        }
    }

    fn apply(&self, p: DVec3) -> DVec3 {
        let d = p - self.at;
        let down = d.dot(self.inwards);
        let aside = (d - down * self.inwards).length() / self.width_m;
        let dent = (-0.5 * aside * aside).exp();
        let rim = 0.12 * (-0.5 * ((aside - 2.3) / 0.6).powi(2)).exp();
        let x = (1.0 - down / self.thickness_m).clamp(0.0, 1.0);
        let fade = x * x * (3.0 - 2.0 * x);
        p + self.depth_m * (dent - rim) * fade * self.inwards
    }
}

#[cfg(test)]
mod tests {
    use super::super::body::Shape;
    use super::*;
    use crate::geom::volume_m3;

    fn volume(body: &Body, points: &[DVec3]) -> f64 {
        let points: Vec<glam::Vec3> = points.iter().map(|p| p.as_vec3()).collect();
        volume_m3(&points, &body.mesh.point_triangles())
    }

    #[test]
    fn deformations_keep_what_they_are_meant_to_keep() {
        let body = Body::of_shape(Shape::Blob, 600, 0.15);
        let rest = volume(&body, &Deformation::Rest.apply(&body));
        for (deformation, tolerance) in [
            // Both are of determinant 1; facets of a coarse blob twist by degrees.
            (Deformation::Stretch, 1e-4),
            (Deformation::Twist, 0.02),
            // An arc about the middle of the box: what lies outside it grows as what lies inside shrinks.
            (Deformation::Bend, 0.1),
            (Deformation::Ripple, 0.1),
        ] {
            let now = volume(&body, &deformation.apply(&body));
            assert!(
                (now / rest - 1.0).abs() < tolerance,
                "{deformation:?}: {}",
                now / rest
            );
        }
        let poked = Deformation::Poke.apply(&body);
        let at = body.mesh.points[body.poked].as_dvec3();
        let depth = (at - poked[body.poked]).dot(body.axes[2].as_dvec3());
        assert!((0.1 * 0.15..=0.18 * 0.15).contains(&depth), "{depth}");
        let stretched = Deformation::Stretch.apply(&body);
        let long = |points: &[DVec3]| {
            let along = points.iter().map(|p| p.dot(body.axes[0].as_dvec3()));
            let (low, high) = along.fold((f64::MAX, f64::MIN), |(l, h), x| (l.min(x), h.max(x)));
            high - low
        };
        assert!((long(&stretched) / 0.15 - 1.5).abs() < 1e-5);
    }

    #[test]
    fn no_deformation_turns_the_body_inside_out() {
        let body = Body::of_shape(Shape::Blob, 600, 0.15);
        for deformation in Deformation::ALL {
            assert!(
                volume(&body, &deformation.apply(&body)) > 0.0,
                "{deformation:?}"
            );
        }
    }
}
