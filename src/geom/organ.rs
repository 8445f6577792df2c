//! The bundled organs, from formulas.
//!
//! Each organ is a field over space, negative inside ([`field`], one file an organ), whose zero
//! surface is meshed with even triangles ([`surface`]) and unwrapped. Only arithmetic that has the
//! same bits everywhere is used: no trigonometry, no exponentials, no threads.
//!
//! Axes are those of a patient who faces you: x to the patient's left, y up, z to the front.

mod bundle;
mod dual;
mod field;
mod heart;
mod kidney;
mod liver;
mod spleen;
mod surface;

pub use bundle::{BundledFile, bundled_files};

use super::SurfaceMesh;
use super::unwrap::unwrap;
use field::Shape;
use glam::Vec3;

/// An organ that comes with the program.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Organ {
    Liver,
    Heart,
    Kidney,
    Spleen,
}

/// What lies at a place of a bundled organ beside its tissue, each from 0 (absent) to 1.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct Features {
    /// Fat under the outer layer.
    pub fat: f32,
    /// The gallbladder, greenish under the liver.
    pub gallbladder: f32,
    /// Walls of arteries, pale and smooth.
    pub artery: f32,
    /// Walls of great veins and of the pulmonary trunk, bluish.
    pub vein: f32,
    /// The inside of a vessel cut open.
    pub lumen: f32,
    /// Thin-walled and darker: the atria.
    pub atrium: f32,
    /// Ligament and other tough, whitish tissue.
    pub ligament: f32,
}

impl Organ {
    /// Every organ.
    pub const ALL: [Self; 4] = [Self::Liver, Self::Heart, Self::Kidney, Self::Spleen];

    /// Name in file names.
    pub fn name(self) -> &'static str {
        match self {
            Self::Liver => "liver",
            Self::Heart => "heart",
            Self::Kidney => "kidney",
            Self::Spleen => "spleen",
        }
    }

    /// Side of the bundled maps [px]: a texel is about a third of a millimetre on each organ but
    /// the heart, whose fibres want finer ones.
    pub fn map_size_px(self) -> u32 {
        match self {
            Self::Liver | Self::Heart => 1024,
            Self::Kidney | Self::Spleen => 512,
        }
    }

    /// The surface [m]: closed, without handles, 8,000 to 11,000 triangles, unwrapped.
    pub fn mesh(self) -> SurfaceMesh {
        let (points, triangles) = self.surface();
        unwrap(&points, &triangles)
    }

    /// Points [m] and triangles, before unwrapping.
    pub fn surface(self) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        surface::surface(&self.shape())
    }

    /// The same surface of about so many points, more than a few hundred.
    pub fn surface_of_about(self, points: usize) -> (Vec<Vec3>, Vec<[u32; 3]>) {
        let own = self.shape();
        let rough = Shape {
            cell: 2.0 * own.cell,
            ..own
        };
        let share = dual::dual_mesh(&rough).0.len() as f32 / points as f32;
        surface::surface(&Shape {
            cell: rough.cell * share.sqrt(),
            ..own
        })
    }

    fn shape(self) -> Shape {
        match self {
            Self::Liver => liver::SHAPE,
            Self::Heart => heart::SHAPE,
            Self::Kidney => kidney::SHAPE,
            Self::Spleen => spleen::SHAPE,
        }
    }

    /// What lies at `place_m` beside the tissue that the organ is made of.
    pub fn features(self, place_m: Vec3) -> Features {
        let p = place_m / field::METRES_PER_UNIT;
        match self {
            Self::Liver => liver::features(p),
            Self::Heart => heart::features(p),
            Self::Kidney => kidney::features(p),
            Self::Spleen => spleen::features(p),
        }
    }

    /// Paths along which the organ's large surface vessels run [m]; each from its root on.
    pub fn vessel_paths(self) -> Vec<Vec<Vec3>> {
        let paths = match self {
            Self::Liver => liver::VESSELS,
            Self::Heart => heart::VESSELS,
            Self::Kidney => kidney::VESSELS,
            Self::Spleen => spleen::VESSELS,
        };
        paths
            .iter()
            .map(|path| {
                path.iter()
                    .map(|&p| Vec3::from(p) * field::METRES_PER_UNIT)
                    .collect()
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::geom::volume_m3;

    /// V − E + F, or `None` if an edge does not have one triangle on each side, or if triangles
    /// round a point do not form one fan.
    fn euler(points: usize, triangles: &[[u32; 3]]) -> Option<i64> {
        let mut sides: Vec<(u32, u32)> = triangles
            .iter()
            .flat_map(|t| [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])])
            .collect();
        sides.sort_unstable();
        let doubled = sides.windows(2).any(|pair| pair[0] == pair[1]);
        let open = sides
            .iter()
            .any(|&(a, b)| sides.binary_search(&(b, a)).is_err());
        if doubled || open {
            return None;
        }
        for point in 0..points as u32 {
            // In each triangle of a point, the corner after it leads to the corner before it.
            let mut next: Vec<(u32, u32)> = triangles
                .iter()
                .filter_map(|t| {
                    let k = t.iter().position(|&p| p == point)?;
                    Some((t[(k + 1) % 3], t[(k + 2) % 3]))
                })
                .collect();
            next.sort_unstable();
            let start = next.first()?.0;
            let (mut at, mut steps) = (start, 0);
            loop {
                at = next[next.binary_search_by_key(&at, |n| n.0).ok()?].1;
                steps += 1;
                if at == start {
                    break;
                }
            }
            if steps != next.len() {
                return None;
            }
        }
        Some(points as i64 - sides.len() as i64 / 2 + triangles.len() as i64)
    }

    #[test]
    fn organs_are_closed_surfaces_without_handles() {
        for organ in Organ::ALL {
            let (points, triangles) = organ.surface();
            assert_eq!(euler(points.len(), &triangles), Some(2), "{}", organ.name());
            let count = triangles.len();
            assert!(
                (8_000..=11_000).contains(&count),
                "{} {count}",
                organ.name()
            );
        }
    }

    #[test]
    fn surface_check_rejects_a_hole_and_a_pinch() {
        let (points, mut triangles) = Organ::Liver.surface();
        let mut pinched = triangles.clone();
        for p in pinched.iter_mut().flatten() {
            if *p == 0 {
                *p = 2000;
            }
        }
        assert_eq!(euler(points.len(), &pinched), None);
        triangles.pop();
        assert_eq!(euler(points.len(), &triangles), None);
    }

    #[test]
    fn organs_have_the_size_of_organs() {
        for organ in Organ::ALL {
            let (points, triangles) = organ.surface();
            let (low, high) = crate::geom::bounds(&points);
            let extent = (high - low).max_element();
            let litres = volume_m3(&points, &triangles) * 1e3;
            // Adult organs, generously: liver 0.9 to 1.8 L, heart with its vessels 0.2 to 0.4 L,
            // kidney 0.1 to 0.2 L, spleen 0.1 to 0.25 L.
            let (extents, volumes) = match organ {
                Organ::Liver => (0.20..0.24, 0.9..1.8),
                Organ::Heart => (0.11..0.14, 0.2..0.4),
                Organ::Kidney => (0.10..0.13, 0.1..0.2),
                Organ::Spleen => (0.10..0.13, 0.1..0.25),
            };
            assert!(extents.contains(&extent), "{} {extent} m", organ.name());
            assert!(volumes.contains(&litres), "{} {litres} L", organ.name());
        }
    }

    #[test]
    fn triangles_of_organs_are_even() {
        for organ in Organ::ALL {
            let (points, triangles) = organ.surface();
            let mut angles: Vec<f32> = triangles
                .iter()
                .flat_map(|t| {
                    let p = t.map(|p| points[p as usize]);
                    (0..3)
                        .map(move |k| (p[(k + 1) % 3] - p[k]).angle_between(p[(k + 2) % 3] - p[k]))
                })
                .map(f32::to_degrees)
                .collect();
            angles.sort_by(f32::total_cmp);
            // Measured: at least 27 degrees, 37 for all but 1 %.
            assert!(angles[0] > 15.0, "{} {}", organ.name(), angles[0]);
            assert!(angles[angles.len() / 100] > 30.0, "{}", organ.name());
        }
    }

    #[test]
    fn features_lie_where_they_belong() {
        let (points, _) = Organ::Heart.surface();
        let highest = |value: fn(&Features) -> f32| {
            points
                .iter()
                .copied()
                .max_by(|&a, &b| {
                    let [a, b] = [a, b].map(|p| value(&Organ::Heart.features(p)));
                    a.total_cmp(&b)
                })
                .expect("the heart has points")
        };
        assert!(highest(|f| f.artery).y > 0.02, "the aorta leaves above");
        let apex = points.iter().copied().min_by(|a, b| a.y.total_cmp(&b.y));
        let apex = Organ::Heart.features(apex.expect("the heart has points"));
        assert_eq!((apex.artery, apex.lumen), (0.0, 0.0));
        assert!(apex.atrium < 0.1);
    }
}
