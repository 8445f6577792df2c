//! The layers below a place of the surface, cut open along a line through it: how deep each one ends, in metres.

use super::orbit::Ray;
use crate::geom::SurfaceMesh;
use crate::geom::paint::TissueMaps;
use crate::geom::ray::first_hit;
use crate::scene::{SurfaceKind, SurfaceSection};
use glam::{Vec2, Vec3};
use image::GenericImageView;
use std::collections::HashMap;

/// Half the length of the cut, in depths of the deepest layer.
const HALF_LENGTH: f32 = 2.5;

/// Places that are looked at across a triangle: the map of the layers is finer than the mesh.
const STEPS: usize = 8;

/// A triangle that the plane crosses, and the edges that it comes in and goes out by.
type Crossed = [usize; 3];

/// A cut across the surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Section {
    /// Places along the cut, in order.
    pub places: Vec<Cut>,
    /// How deep the layers end where the cursor is [m], outermost first.
    pub depths_m: Vec<f32>,
    /// Half its length [m].
    pub half_length_m: f32,
}

/// A place of the surface on the cut.
#[derive(Clone, Debug, PartialEq)]
pub struct Cut {
    /// Where it is [m].
    pub place_m: Vec3,
    /// Along the cut, and above the surface under the cursor [m].
    pub at_m: Vec2,
    /// Straight down from there, in the plane of the cut, not longer than 1.
    pub down: Vec2,
    /// How deep each layer ends [m], outermost first.
    pub depths_m: Vec<f32>,
}

/// A surface as it lies, with what its layers follow from.
#[derive(Clone, Copy)]
pub struct Layered<'a> {
    /// Places of the points [m].
    pub points: &'a [Vec3],
    /// Its triangles and texture coordinates, and its places at rest.
    pub mesh: &'a SurfaceMesh,
    /// Where the layers end, as textures.
    pub maps: &'a TissueMaps,
    /// The surface model.
    pub surface: &'a SurfaceSection,
}

impl Section {
    /// Cuts where `ray` meets the surface, along the direction `across` of the picture. `None` beside the body, and for
    /// surfaces without layers.
    pub fn at(layered: &Layered<'_>, ray: &Ray, across: Vec3) -> Option<Self> {
        let deepest_m = layered.deepest_m()?;
        let triangles = layered.mesh.point_triangles();
        let hit = first_hit(ray.origin, ray.direction, layered.points, &triangles)?;
        let origin = ray.origin + hit.distance * ray.direction;
        let up = hit.normal;
        let along = (across - across.dot(up) * up).try_normalize()?;
        let plane = Plane { origin, along, up };
        let half_length_m = HALF_LENGTH * deepest_m;
        let walk = Walk::new(layered, &triangles, &plane);
        let places = walk.both_ways(hit.triangle, half_length_m);
        let middle = places
            .iter()
            .min_by(|a, b| a.at_m.length().total_cmp(&b.at_m.length()))?;
        Some(Self {
            depths_m: middle.depths_m.clone(),
            places,
            half_length_m,
        })
    }

    /// Where the cut runs over the surface [m].
    pub fn places_m(&self) -> Vec<Vec3> {
        self.places.iter().map(|cut| cut.place_m).collect()
    }
}

/// Spanned by the cut and the normal under the cursor.
struct Plane {
    origin: Vec3,
    along: Vec3,
    up: Vec3,
}

impl Plane {
    fn side(&self, x: Vec3) -> f32 {
        (x - self.origin).dot(self.along.cross(self.up))
    }

    fn in_plane(&self, v: Vec3) -> Vec2 {
        Vec2::new(v.dot(self.along), v.dot(self.up))
    }
}

impl Layered<'_> {
    /// Where the deepest layer ends at most [m]; `None` for surfaces without layers.
    fn deepest_m(&self) -> Option<f32> {
        let surface = self.surface;
        match surface.kind {
            SurfaceKind::Subsurface if surface.layers.len() > 1 => Some(surface.layer_depth_max_m),
            SurfaceKind::Gooey => {
                let distances = surface.inner.iter().map(|layer| layer.distance);
                let deepest = surface.layer_distance_m * distances.fold(0.0, f32::max);
                (deepest > 0.0).then_some(deepest)
            }
            _ => None,
        }
    }

    /// How deep each layer ends at rest [m], outermost first.
    fn depths_m(&self, uv: Vec2) -> Vec<f32> {
        let surface = self.surface;
        if surface.kind == SurfaceKind::Gooey {
            let layers = surface.inner.iter();
            return layers
                .map(|layer| layer.distance * surface.layer_distance_m)
                .collect();
        }
        // The last layer goes on below its boundary.
        let ends = surface.layers.len().saturating_sub(1);
        let mut above = 0.0_f32;
        (self.maps.layers.iter().flat_map(|map| texel(map, uv)))
            .take(ends)
            .map(|share| {
                above = above.max(share);
                above * surface.layer_depth_max_m
            })
            .collect()
    }

    /// What layers of the triangle are thinner by, as a share.
    fn thickness(&self, triangle: usize) -> f32 {
        if !self.surface.thickness_follows_volume {
            return 1.0;
        }
        let area = |points: &[Vec3]| {
            let [a, b, c] = self
                .mesh
                .point_triangle(triangle)
                .map(|i| points[i as usize]);
            (b - a).cross(c - a).length()
        };
        (area(&self.mesh.points) / area(self.points).max(1e-20)).clamp(0.25, 4.0)
    }
}

/// The four shares of a map at `uv`, linear between texels.
fn texel(map: &image::DynamicImage, uv: Vec2) -> [f32; 4] {
    let size = Vec2::new(map.width() as f32, map.height() as f32);
    let at = uv * size - 0.5;
    let low = at.floor();
    let share = at - low;
    let pixel = |x: f32, y: f32| {
        let clamped = Vec2::new(x, y).clamp(Vec2::ZERO, size - 1.0);
        let bytes = map.get_pixel(clamped.x as u32, clamped.y as u32).0;
        bytes.map(|byte| f32::from(byte) / 255.0)
    };
    let corners = [
        (pixel(low.x, low.y), (1.0 - share.x) * (1.0 - share.y)),
        (pixel(low.x + 1.0, low.y), share.x * (1.0 - share.y)),
        (pixel(low.x, low.y + 1.0), (1.0 - share.x) * share.y),
        (pixel(low.x + 1.0, low.y + 1.0), share.x * share.y),
    ];
    std::array::from_fn(|c| {
        corners
            .iter()
            .map(|(value, weight)| weight * value[c])
            .sum()
    })
}

/// From triangle to triangle across the edges that the plane meets.
struct Walk<'a> {
    layered: &'a Layered<'a>,
    triangles: &'a [[u32; 3]],
    plane: &'a Plane,
    sides: Vec<f32>,
    /// The triangles of each edge that the plane meets.
    across: HashMap<[u32; 2], Vec<usize>>,
}

impl<'a> Walk<'a> {
    fn new(layered: &'a Layered<'a>, triangles: &'a [[u32; 3]], plane: &'a Plane) -> Self {
        let sides: Vec<f32> = layered.points.iter().map(|&x| plane.side(x)).collect();
        let mut walk = Self {
            layered,
            triangles,
            plane,
            sides,
            across: HashMap::new(),
        };
        for triangle in 0..triangles.len() {
            for edge in walk.met_edges(triangle) {
                let key = walk.key(triangle, edge);
                walk.across.entry(key).or_default().push(triangle);
            }
        }
        walk
    }

    /// Edges of the triangle, by their first corner, whose ends lie on two sides.
    fn met_edges(&self, triangle: usize) -> Vec<usize> {
        let above = self.triangles[triangle].map(|i| self.sides[i as usize] >= 0.0);
        (0..3).filter(|&k| above[k] != above[(k + 1) % 3]).collect()
    }

    fn key(&self, triangle: usize, edge: usize) -> [u32; 2] {
        let corners = self.triangles[triangle];
        let [a, b] = [corners[edge], corners[(edge + 1) % 3]];
        [a.min(b), a.max(b)]
    }

    /// Places of the cut up to half its length either way, in order along it.
    fn both_ways(&self, start: usize, half_length_m: f32) -> Vec<Cut> {
        let [first, second] = self.met_edges(start)[..] else {
            return Vec::new();
        };
        let before = self.one_way(start, first, half_length_m);
        let mut crossed: Vec<Crossed> = (before.into_iter().rev())
            .map(|[triangle, from, to]| [triangle, to, from])
            .collect();
        crossed.push([start, first, second]);
        crossed.extend(self.one_way(start, second, half_length_m));
        let mut cuts: Vec<Cut> = (crossed.into_iter())
            .flat_map(|crossed| self.cuts(crossed))
            .collect();
        let ends = cuts.first().zip(cuts.last());
        if ends.is_some_and(|(first, last)| first.at_m.x > last.at_m.x) {
            cuts.reverse();
        }
        cuts
    }

    /// The triangles that are crossed behind `edge` of `start`.
    fn one_way(&self, start: usize, edge: usize, half_length_m: f32) -> Vec<Crossed> {
        let (mut triangle, mut edge) = (start, edge);
        let mut crossed = Vec::new();
        // Each triangle is left once; a cut round the body ends where it began.
        for _ in 0..self.across.len() {
            let from_start = self.place_m(triangle, edge) - self.plane.origin;
            if self.plane.in_plane(from_start).x.abs() > half_length_m {
                break;
            }
            let key = self.key(triangle, edge);
            let Some(&next) = (self.across[&key].iter()).find(|&&other| other != triangle) else {
                break;
            };
            let [one, other] = self.met_edges(next)[..] else {
                break;
            };
            if next == start {
                break;
            }
            let (from, to) = if self.key(next, one) == key {
                (one, other)
            } else {
                (other, one)
            };
            crossed.push([next, from, to]);
            (triangle, edge) = (next, to);
        }
        crossed
    }

    /// Places across one triangle, both its edges among them.
    fn cuts(&self, [triangle, from, to]: Crossed) -> Vec<Cut> {
        let [from, to] = [from, to].map(|edge| {
            (
                self.place_m(triangle, edge),
                self.uv(triangle, edge),
                self.normal(triangle, edge),
            )
        });
        let thickness = self.layered.thickness(triangle);
        (0..=STEPS)
            .map(|step| {
                let share = step as f32 / STEPS as f32;
                let place_m = from.0.lerp(to.0, share);
                let normal = from.2.lerp(to.2, share).normalize_or(self.plane.up);
                let depths = self.layered.depths_m(from.1.lerp(to.1, share)).into_iter();
                Cut {
                    place_m,
                    at_m: self.plane.in_plane(place_m - self.plane.origin),
                    down: self.plane.in_plane(-normal),
                    depths_m: depths.map(|depth| thickness * depth).collect(),
                }
            })
            .collect()
    }

    /// Corners of an edge, and how far along it the plane meets it.
    fn met_at(&self, triangle: usize, edge: usize) -> (usize, usize, f32) {
        let (k, l) = (edge, (edge + 1) % 3);
        let corners = self.triangles[triangle];
        let [a, b] = [k, l].map(|k| self.sides[corners[k] as usize]);
        (k, l, a / (a - b))
    }

    fn place_m(&self, triangle: usize, edge: usize) -> Vec3 {
        let (k, l, share) = self.met_at(triangle, edge);
        let corner = |k: usize| self.layered.points[self.triangles[triangle][k] as usize];
        corner(k).lerp(corner(l), share)
    }

    fn uv(&self, triangle: usize, edge: usize) -> Vec2 {
        let (k, l, share) = self.met_at(triangle, edge);
        let mesh = self.layered.mesh;
        let corner = |k: usize| mesh.uvs[mesh.triangles[triangle][k] as usize];
        corner(k).lerp(corner(l), share)
    }

    /// Of the triangles at an edge, by their areas.
    fn normal(&self, triangle: usize, edge: usize) -> Vec3 {
        let sharing = &self.across[&self.key(triangle, edge)];
        let area: Vec3 = sharing.iter().map(|&triangle| self.area(triangle)).sum();
        area.normalize_or(self.plane.up)
    }

    fn area(&self, triangle: usize) -> Vec3 {
        let [a, b, c] = self.triangles[triangle].map(|i| self.layered.points[i as usize]);
        (b - a).cross(c - a)
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::{DynamicImage, Rgba, RgbaImage};

    /// A flat sheet of `n` × `n` squares of a centimetre, seen from above (z).
    fn sheet(n: u32) -> SurfaceMesh {
        let side = n + 1;
        let mut mesh = SurfaceMesh::default();
        for y in 0..side {
            for x in 0..side {
                mesh.points.push(0.01 * Vec3::new(x as f32, y as f32, 0.0));
                mesh.uvs.push(Vec2::new(x as f32, y as f32) / n as f32);
                mesh.point_of.push(y * side + x);
            }
        }
        for y in 0..n {
            for x in 0..n {
                let a = y * side + x;
                mesh.triangles.push([a, a + 1, a + side + 1]);
                mesh.triangles.push([a, a + side + 1, a + side]);
            }
        }
        mesh
    }

    fn maps() -> TissueMaps {
        let picture = |pixel| RgbaImage::from_pixel(4, 4, Rgba(pixel));
        TissueMaps {
            size_px: 4,
            outer: picture([255; 4]),
            normal: picture([128, 128, 255, 255]),
            inner: picture([255; 4]),
            layers: vec![DynamicImage::ImageRgba8(picture([51, 102, 153, 255]))],
        }
    }

    fn cut(stretch: f32, follows: bool) -> Section {
        let (mesh, maps) = (sheet(12), maps());
        let points: Vec<Vec3> = (mesh.points.iter())
            .map(|&x| x * Vec3::new(stretch, 1.0, 1.0))
            .collect();
        let surface = SurfaceSection {
            layer_depth_max_m: 0.01,
            thickness_follows_volume: follows,
            ..SurfaceSection::default()
        };
        let layered = Layered {
            points: &points,
            mesh: &mesh,
            maps: &maps,
            surface: &surface,
        };
        let ray = Ray {
            origin: Vec3::new(0.0612 * stretch, 0.0571, 1.0),
            direction: Vec3::NEG_Z,
        };
        Section::at(&layered, &ray, Vec3::X).expect("the sheet is hit")
    }

    #[test]
    fn layers_of_a_flat_sheet_end_where_the_map_says_all_along_the_cut() {
        let section = cut(1.0, false);
        // Of four layers three have an end: 51, 102 and 153 of 255 of a centimetre.
        for (depth, want) in section.depths_m.iter().zip([0.002, 0.004, 0.006]) {
            assert!((depth - want).abs() < 1e-6, "{depth} m, not {want} m");
        }
        assert_eq!(section.depths_m.len(), 3);
        let (first, last) = (&section.places[0], section.places.last().unwrap());
        assert!(first.at_m.x < -0.025 && last.at_m.x > 0.025);
        for place in &section.places {
            assert!(place.at_m.y.abs() < 1e-6 && (place.down - Vec2::NEG_Y).length() < 1e-5);
            assert!((place.place_m.y - 0.0571).abs() < 1e-6, "off the cut");
        }
        let ordered = |pair: &[Cut]| pair[0].at_m.x <= pair[1].at_m.x;
        assert!(section.places.windows(2).all(ordered));
    }

    #[test]
    fn layers_that_keep_their_volume_thin_where_the_sheet_is_stretched() {
        let depth = |stretch, follows| cut(stretch, follows).depths_m[0];
        assert!((depth(2.0, true) - 0.001).abs() < 1e-6);
        assert!((depth(2.0, false) - 0.002).abs() < 1e-6);
    }

    #[test]
    fn there_is_no_cut_beside_the_body_nor_without_layers() {
        let (mesh, maps) = (sheet(3), maps());
        let at = |surface: &SurfaceSection, x: f32| {
            let layered = Layered {
                points: &mesh.points,
                mesh: &mesh,
                maps: &maps,
                surface,
            };
            let ray = Ray {
                origin: Vec3::new(x, 0.011, 1.0),
                direction: Vec3::NEG_Z,
            };
            Section::at(&layered, &ray, Vec3::X)
        };
        let layered = SurfaceSection::default();
        assert!(at(&layered, 0.012).is_some());
        assert!(at(&layered, 5.0).is_none());
        let plain = SurfaceSection {
            kind: SurfaceKind::Plain,
            ..layered
        };
        assert!(at(&plain, 0.012).is_none());
    }
}
