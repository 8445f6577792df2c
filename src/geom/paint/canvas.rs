//! Which place on the surface each texel shows.

use super::{GUTTER_PX, Site};
use crate::geom::SurfaceMesh;
use crate::geom::organ::Features;
use glam::{Vec2, Vec3};

const NONE: u32 = u32::MAX;

/// A texel centre this far outside a triangle still belongs to it, as a share of the triangle:
/// rounding must not open gaps along edges.
const EDGE_SLACK: f32 = 1e-4;

/// Texels and the surface under them.
pub struct Canvas {
    pub size_px: u32,
    /// Triangle of each texel; in the gutter that of the nearest chart.
    triangle_of: Vec<u32>,
    /// Points at the size of the bundled organ [cm].
    pub places: Vec<Vec3>,
    /// Unit normals of the points.
    pub normals: Vec<Vec3>,
    /// Triangles of points.
    pub triangles: Vec<[u32; 3]>,
    /// How hollow the surface is at each point, 0 to 1.
    hollow: Vec<f32>,
    height_cm: f32,
    low: Vec3,
    scale: f32,
}

impl Canvas {
    /// Lays `size_px` texels a side over the mesh, scaled so that it is `extent_cm` long.
    pub fn new(mesh: &SurfaceMesh, size_px: u32, extent_cm: f32) -> Self {
        let (low, high) = mesh.bounds();
        let extent = (high - low).max_element();
        let scale = if extent > 0.0 {
            extent_cm / extent
        } else {
            1.0
        };
        let places: Vec<Vec3> = mesh.points.iter().map(|&p| (p - low) * scale).collect();
        let triangles = mesh.point_triangles();
        let normals = normals(&places, &triangles);
        let hollow = hollow(&places, &normals, &triangles);
        let mut canvas = Self {
            size_px,
            triangle_of: vec![NONE; (size_px * size_px) as usize],
            places,
            normals,
            triangles,
            hollow,
            height_cm: (high.y - low.y) * scale,
            low,
            scale,
        };
        canvas.fill(mesh);
        canvas.dilate();
        canvas
    }

    /// From the mesh's units to the size of the bundled organ.
    pub fn scaled(&self, p: Vec3) -> Vec3 {
        (p - self.low) * self.scale
    }

    /// And back.
    pub fn unscaled(&self, place: Vec3) -> Vec3 {
        place / self.scale + self.low
    }

    /// Triangle under a texel, if any.
    pub fn triangle(&self, texel: u32) -> Option<u32> {
        Some(self.triangle_of[texel as usize]).filter(|&t| t != NONE)
    }

    /// Texel coordinates of the corners of a triangle.
    pub fn corners_px(&self, mesh: &SurfaceMesh, triangle: u32) -> [Vec2; 3] {
        mesh.triangles[triangle as usize].map(|v| mesh.uvs[v as usize] * self.size_px as f32)
    }

    /// The place that a texel shows.
    pub fn site(
        &self,
        mesh: &SurfaceMesh,
        texel: u32,
        features: &impl Fn(Vec3) -> Features,
    ) -> Option<Site> {
        let triangle = self.triangle(texel)?;
        let at = Vec2::new((texel % self.size_px) as f32, (texel / self.size_px) as f32) + 0.5;
        let weights = barycentric(at, self.corners_px(mesh, triangle))
            // In the gutter the surface goes on beyond its edge, but not without end.
            .map(|w| w.map(|w| w.clamp(-3.0, 4.0)))
            .unwrap_or([1.0 / 3.0; 3]);
        let total: f32 = weights.iter().sum();
        let points = mesh.point_triangle(triangle as usize);
        let place = (0..3)
            .map(|k| self.places[points[k] as usize] * (weights[k] / total))
            .sum::<Vec3>();
        let normal: Vec3 = (0..3)
            .map(|k| self.normals[points[k] as usize] * weights[k].clamp(0.0, 1.0))
            .sum();
        let hollow = (0..3)
            .map(|k| self.hollow[points[k] as usize] * weights[k] / total)
            .sum::<f32>();
        Some(Site {
            place,
            normal: normal.normalize_or(Vec3::Y),
            hollow: hollow.clamp(0.0, 1.0),
            height: place.y / self.height_cm.max(1e-6),
            features: features(place),
        })
    }

    /// Gives every texel whose centre lies in a triangle to that triangle.
    fn fill(&mut self, mesh: &SurfaceMesh) {
        let most = self.size_px as f32 - 1.0;
        for triangle in 0..mesh.triangles.len() as u32 {
            let corners = self.corners_px(mesh, triangle);
            if !corners.iter().all(|c| c.is_finite()) {
                continue;
            }
            let low = corners.iter().fold(corners[0], |a, &b| a.min(b)) - 0.5;
            let high = corners.iter().fold(corners[0], |a, &b| a.max(b)) - 0.5;
            if high.min_element() < 0.0 || low.x > most || low.y > most {
                continue;
            }
            let first = low.ceil().max(Vec2::ZERO).as_uvec2();
            let last = high.floor().min(Vec2::splat(most)).as_uvec2();
            for y in first.y..=last.y {
                for x in first.x..=last.x {
                    let at = Vec2::new(x as f32, y as f32) + 0.5;
                    let inside = barycentric(at, corners)
                        .is_some_and(|w| w.iter().all(|&w| w >= -EDGE_SLACK));
                    if inside {
                        self.triangle_of[(y * self.size_px + x) as usize] = triangle;
                    }
                }
            }
        }
    }

    /// Widens every chart by the gutter, one ring of texels at a time.
    fn dilate(&mut self) {
        let size = self.size_px as i32;
        for _ in 0..GUTTER_PX {
            let before = self.triangle_of.clone();
            for y in 0..size {
                for x in 0..size {
                    let at = (y * size + x) as usize;
                    if before[at] != NONE {
                        continue;
                    }
                    let near = [
                        (-1, 0),
                        (1, 0),
                        (0, -1),
                        (0, 1),
                        (-1, -1),
                        (1, -1),
                        (-1, 1),
                        (1, 1),
                    ]
                    .into_iter()
                    .map(|(dx, dy)| (x + dx, y + dy))
                    .filter(|&(x, y)| x >= 0 && y >= 0 && x < size && y < size)
                    .map(|(x, y)| before[(y * size + x) as usize])
                    .find(|&t| t != NONE);
                    if let Some(triangle) = near {
                        self.triangle_of[at] = triangle;
                    }
                }
            }
        }
    }
}

/// Barycentric weights of a place in the plane; `None` in a triangle without area.
pub fn barycentric(at: Vec2, [a, b, c]: [Vec2; 3]) -> Option<[f32; 3]> {
    let whole = (b - a).perp_dot(c - a);
    if whole.abs() < 1e-9 {
        return None;
    }
    let first = (b - at).perp_dot(c - at) / whole;
    let second = (c - at).perp_dot(a - at) / whole;
    Some([first, second, 1.0 - first - second])
}

/// Area-weighted unit normals of the points.
fn normals(places: &[Vec3], triangles: &[[u32; 3]]) -> Vec<Vec3> {
    let mut sums = vec![Vec3::ZERO; places.len()];
    for t in triangles {
        let [a, b, c] = t.map(|p| places[p as usize]);
        let cross = (b - a).cross(c - a);
        for p in t {
            sums[*p as usize] += cross;
        }
    }
    sums.into_iter().map(|n| n.normalize_or(Vec3::Y)).collect()
}

/// How hollow the surface is, from how far the neighbours stand above each point, smoothed.
fn hollow(places: &[Vec3], normals: &[Vec3], triangles: &[[u32; 3]]) -> Vec<f32> {
    let mut sums = vec![(0.0_f32, 0.0_f32); places.len()];
    for t in triangles {
        for k in 0..3 {
            let (p, q) = (t[k] as usize, t[(k + 1) % 3] as usize);
            let edge = places[q] - places[p];
            let squared = edge.length_squared();
            if squared > 0.0 {
                sums[p].0 += 2.0 * edge.dot(normals[p]) / squared;
                sums[p].1 += 1.0;
            }
        }
    }
    // Curvature [1/cm], positive where the surface is hollow.
    let mut bend: Vec<f32> = sums.iter().map(|&(sum, n)| sum / n.max(1.0)).collect();
    for _ in 0..4 {
        let mut sums: Vec<(f32, f32)> = bend.iter().map(|&b| (b, 1.0)).collect();
        for t in triangles {
            for k in 0..3 {
                let (p, q) = (t[k] as usize, t[(k + 1) % 3] as usize);
                sums[p].0 += bend[q];
                sums[p].1 += 1.0;
            }
        }
        bend = sums.iter().map(|&(sum, n)| sum / n).collect();
    }
    // A groove of 7 mm radius counts in full.
    bend.iter().map(|b| (b / 1.4).clamp(0.0, 1.0)).collect()
}
