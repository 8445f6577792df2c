//! The way of light to a point below the surface, by the paraboloid that stands for the surface.
//!
//! Twin of `shaders/light_quadric.wgsl`, whose head has the formulas; `docs/METHODS.md` derives them.

use glam::{Vec2, Vec3};

/// A paraboloid `z = ½ (a u² + 2 b u v + c v²)` and a view ray, in the frame of tangent, bitangent and normal.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Bend {
    /// a, b, c [1/m].
    pub bends: Vec3,
    /// Unit direction to the eye.
    pub to_eye: Vec3,
}

/// A light in the same frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aim {
    /// Unit direction to the light.
    pub to_light: Vec3,
}

impl Bend {
    fn applied(&self, x: Vec2) -> Vec2 {
        let [a, b, c] = self.bends.to_array();
        Vec2::new(a * x.x + b * x.y, b * x.x + c * x.y)
    }

    /// Where the view ray leaves the body again [m]: there its depth is back at zero.
    pub fn exit_m(&self) -> f32 {
        let across = self.to_eye.truncate();
        let eye_eye = self.applied(across).dot(across);
        (2.0 * self.to_eye.z.max(1e-3) / (-eye_eye).max(1e-6)).max(1e-6)
    }
}

/// Length [m] of the light's way to the point `t` [m] along the view ray, and its cosine with the surface's normal
/// where it enters. `None` where it never meets the paraboloid: no light comes straight.
pub fn way_to_light(bend: &Bend, aim: &Aim, t: f32) -> Option<(f32, f32)> {
    let (eye, light) = (bend.to_eye.truncate(), aim.to_light.truncate());
    let (of_eye, of_light) = (bend.applied(eye), bend.applied(light));
    let light_light = of_light.dot(light);
    let depth = (t * bend.to_eye.z + 0.5 * t * t * of_eye.dot(eye)).max(0.0);
    let rise = aim.to_light.z + t * of_eye.dot(light);
    let squared = rise * rise - 2.0 * depth * light_light;
    let root = squared.max(0.0).sqrt();
    let s = if rise >= 0.0 {
        2.0 * depth / (rise + root).max(2e-3)
    } else {
        (root - rise) / (-light_light).max(1e-3)
    };
    let slope = s * of_light - t * of_eye;
    let cosine = root / (1.0 + slope.dot(slope)).sqrt();
    let is_lit = squared >= 0.0 && cosine > 1e-3 && (rise >= 0.0 || light_light < -1e-3);
    is_lit.then_some((s, cosine))
}

#[cfg(test)]
mod tests {
    use super::super::light_plane::{self, PlanePair};
    use super::*;
    use proptest::prelude::*;

    fn unit(x: f32, y: f32, z: f32) -> Vec3 {
        Vec3::new(x, y, z).normalize()
    }

    fn bent(bends: [f32; 3], to_eye: Vec3) -> Bend {
        Bend {
            bends: Vec3::from(bends),
            to_eye,
        }
    }

    /// The way of light to `inside` a sphere of `radius` that touches the origin from below.
    fn on_sphere(radius: f32, inside: Vec3, to_light: Vec3) -> (f32, f32) {
        let [m, w] = [inside + radius * Vec3::Z, to_light].map(|v| v.as_dvec3());
        let r = f64::from(radius);
        let s = -m.dot(w) + (m.dot(w).powi(2) - m.length_squared() + r * r).sqrt();
        (s as f32, ((m + s * w).dot(w) / r) as f32)
    }

    #[test]
    fn a_flat_quadric_is_the_tangent_plane() {
        let eye = unit(0.3, -0.5, 0.7);
        for to_light in [
            unit(-0.4, 0.2, 0.6),
            unit(0.9, 0.1, 0.05),
            unit(0.1, 0.2, -0.5),
        ] {
            let bend = bent([0.0; 3], eye);
            let pair = PlanePair::tangent(eye.z);
            let flat = light_plane::way_to_light(&pair, 0.003, 0.0, to_light.z, to_light.z);
            let got = way_to_light(&bend, &Aim { to_light }, 0.003);
            assert_eq!(got.is_some(), flat.is_some());
            if let (Some(got), Some(flat)) = (got, flat) {
                assert!((got.0 / flat.0 - 1.0).abs() < 1e-5, "{got:?} and {flat:?}");
                assert!((got.1 - flat.1).abs() < 1e-6);
            }
        }
    }

    #[test]
    fn the_way_below_a_sphere_errs_by_its_fourth_order_where_the_tangent_plane_errs_by_its_second()
    {
        let radius = 0.05;
        let k = -1.0 / radius;
        let (eye, to_light) = (unit(0.2, 0.3, 0.9), unit(-0.6, 0.3, 0.7));
        let pair = PlanePair::tangent(eye.z);
        for (t, room) in [(0.001, 0.002), (0.003, 0.006), (0.006, 0.02)] {
            let exact = on_sphere(radius, -t * eye, to_light);
            let (s, cosine) = way_to_light(&bent([k, 0.0, k], eye), &Aim { to_light }, t).unwrap();
            let (flat, _) =
                light_plane::way_to_light(&pair, t, 0.0, to_light.z, to_light.z).unwrap();
            let error = (s / exact.0 - 1.0).abs();
            assert!(error < room, "{s} for {}", exact.0);
            assert!(
                (cosine - exact.1).abs() < 2.0 * room,
                "{cosine} for {}",
                exact.1
            );
            assert!((flat / exact.0 - 1.0).abs() > 5.0 * error);
        }
    }

    #[test]
    fn light_behind_a_bulge_comes_through_it() {
        let radius = 0.01;
        let k = -1.0 / radius;
        let (eye, to_light) = (unit(0.1, 0.0, 0.99), unit(0.9, 0.0, -0.05));
        let exact = on_sphere(radius, -0.0005 * eye, to_light);
        let got = way_to_light(&bent([k, 0.0, k], eye), &Aim { to_light }, 0.0005).unwrap();
        assert!(
            (got.0 / exact.0 - 1.0).abs() < 0.05,
            "{got:?} for {exact:?}"
        );
        let flat = way_to_light(&bent([0.0; 3], eye), &Aim { to_light }, 0.0005);
        assert_eq!(flat, None, "behind a plane nothing is lit");
        // Round a hollow the surface rises before the light: it never comes out.
        let hollow = way_to_light(&bent([-k, 0.0, -k], eye), &Aim { to_light }, 0.0005);
        assert_eq!(hollow, None);
    }

    #[test]
    fn along_a_cylinder_it_is_flat_and_across_it_is_bent() {
        let bend = bent([-20.0, 0.0, 0.0], Vec3::Z);
        let way = |to_light| way_to_light(&bend, &Aim { to_light }, 0.004).unwrap().0;
        let along = way(unit(0.0, 0.8, 0.6));
        assert!((along - 0.004 / 0.6).abs() < 1e-7, "{along}");
        assert!(way(unit(0.8, 0.0, 0.6)) < 0.95 * along);
    }

    #[test]
    fn the_view_ray_leaves_a_sphere_where_its_chord_ends() {
        let bend = |eye| bent([-20.0, 0.0, -20.0], eye);
        let eye = unit(0.99, 0.0, 0.08);
        // The chord of a sphere of 50 mm, to the second order in the slope.
        let chord = 2.0 * 0.05 * eye.z;
        assert!((bend(eye).exit_m() / chord - 1.0).abs() < 0.02);
        assert!(bend(Vec3::Z).exit_m() > 1.0);
        assert!(bent([30.0, 0.0, 30.0], eye).exit_m() > 1.0);
    }

    proptest! {
        #[test]
        fn the_way_ends_on_the_paraboloid_from_inside(
            bends in prop::array::uniform3(-60.0_f32..60.0),
            eye in prop::array::uniform3(-1.0_f32..1.0),
            light in prop::array::uniform3(-1.0_f32..1.0),
            t in 0.0_f32..0.006,
        ) {
            let [eye, to_light] = [eye, light].map(Vec3::from);
            prop_assume!(eye.z > 0.1 && eye.length() > 0.2 && to_light.length() > 0.2);
            let [eye, to_light] = [eye, to_light].map(Vec3::normalize);
            let bend = bent(bends, eye);
            prop_assume!(t < bend.exit_m());
            if let Some((s, cosine)) = way_to_light(&bend, &Aim { to_light }, t) {
                prop_assert!(s.is_finite() && s >= 0.0);
                prop_assert!((1e-3..=1.0001).contains(&cosine));
                let k = (-t * eye + s * to_light).as_dvec3();
                let [a, b, c] = bend.bends.as_dvec3().to_array();
                let sag = 0.5 * (a * k.x * k.x + 2.0 * b * k.x * k.y + c * k.y * k.y);
                // Rounding of lengths s, and of a light so low that 2 C / (B + D) is cut.
                if cosine > 0.02 {
                    let room = 1e-7 + 1e-5 * f64::from(s + s * s * bends.map(f32::abs).iter().sum::<f32>());
                    prop_assert!((k.z - sag).abs() < room, "{} {}", k.z, sag);
                }
            }
        }
    }
}
