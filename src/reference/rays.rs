//! Rays cast at a surface in f64: where light leaves a body, and what stands in its way.
//!
//! A tree of boxes finds the triangles near a ray; each is met exactly. The answer that light paths below a
//! deformed surface are held to. Source of the test: Möller and Trumbore, "Fast, Minimum Storage Ray/Triangle
//! Intersection", 1997.

use bvh::aabb::{Aabb, Bounded};
use bvh::bounding_hierarchy::BHShape;
use bvh::bvh::Bvh;
use glam::DVec3;
use nalgebra::{Point3, Vector3};

/// A half line: where it starts [m] and its unit direction.
pub type HalfLine = (DVec3, DVec3);

/// A surface to cast rays at. Immutable once made.
pub struct Rays {
    tree: Bvh<f64, 3>,
    triangles: Vec<Triangle>,
}

struct Triangle {
    corner: DVec3,
    edges: [DVec3; 2],
    index: usize,
    node: usize,
}

impl Bounded<f64, 3> for Triangle {
    fn aabb(&self) -> Aabb<f64, 3> {
        let corners = [DVec3::ZERO, self.edges[0], self.edges[1]].map(|edge| self.corner + edge);
        let low = corners.into_iter().fold(corners[0], DVec3::min);
        let high = corners.into_iter().fold(corners[0], DVec3::max);
        Aabb::with_bounds(Point3::from(low.to_array()), Point3::from(high.to_array()))
    }
}

impl BHShape<f64, 3> for Triangle {
    fn set_bh_node_index(&mut self, index: usize) {
        self.node = index;
    }

    fn bh_node_index(&self) -> usize {
        self.node
    }
}

impl Triangle {
    /// Distance along the ray [m] and whether it goes outwards there.
    fn met_by(&self, (from, toward): HalfLine) -> Option<(f64, bool)> {
        let [e1, e2] = self.edges;
        let p = toward.cross(e2);
        let determinant = e1.dot(p);
        if determinant == 0.0 {
            return None;
        }
        let s = (from - self.corner) / determinant;
        let q = s.cross(e1);
        let (u, v) = (s.dot(p), toward.dot(q));
        let distance = e2.dot(q);
        let is_met = u >= 0.0 && v >= 0.0 && u + v <= 1.0 && distance > 0.0;
        // The determinant is -toward · (e1 × e2).
        is_met.then_some((distance, determinant < 0.0))
    }
}

impl Rays {
    /// The surface whose `triangles` have their corners in `points` [m], counter-clockwise seen from outside.
    ///
    /// # Panics
    ///
    /// If a corner is not a point.
    pub fn new(points: &[DVec3], triangles: &[[u32; 3]]) -> Self {
        let mut triangles: Vec<Triangle> = triangles
            .iter()
            .enumerate()
            .map(|(index, corners)| {
                let [a, b, c] = corners.map(|corner| points[corner as usize]);
                Triangle {
                    corner: a,
                    edges: [b - a, c - a],
                    index,
                    node: 0,
                }
            })
            .collect();
        Self {
            tree: Bvh::build(&mut triangles),
            triangles,
        }
    }

    fn met(&self, line: HalfLine) -> impl Iterator<Item = (f64, bool, usize)> {
        let (from, toward) = line;
        let ray = bvh::ray::Ray::new(
            Point3::from(from.to_array()),
            Vector3::from(toward.to_array()),
        );
        let near = self.tree.traverse(&ray, &self.triangles);
        near.into_iter().filter_map(move |triangle| {
            let (distance, outwards) = triangle.met_by(line)?;
            Some((distance, outwards, triangle.index))
        })
    }

    /// Distance [m] to where `line` first leaves the body; `None` if it never does, so it started outside.
    ///
    /// What it enters before that is not asked: where sheets of a surface cross, this is the nearest way out.
    pub fn exit_m(&self, line: HalfLine) -> Option<f64> {
        let exits = self.met(line).filter(|(_, outwards, _)| *outwards);
        exits.map(|(distance, ..)| distance).reduce(f64::min)
    }

    /// Whether `line` meets the surface beyond `beyond_m`, from either side.
    pub fn is_blocked(&self, line: HalfLine, beyond_m: f64) -> bool {
        self.met(line).any(|(distance, ..)| distance > beyond_m)
    }

    /// Distance [m] to where `line` first meets the surface from either side, and the triangle; `None` if it
    /// meets none.
    pub fn first(&self, line: HalfLine) -> Option<(f64, usize)> {
        let met = self.met(line).map(|(distance, _, index)| (distance, index));
        met.min_by(|a, b| a.0.total_cmp(&b.0))
    }
}

/// `answer` to each of `questions` in order, by so many `threads`.
///
/// # Panics
///
/// If `threads` is 0.
pub fn all_by<Q: Sync, A: Send>(
    threads: usize,
    questions: &[Q],
    answer: impl Fn(&Q) -> A + Sync,
) -> Vec<A> {
    assert!(threads > 0, "at least one thread answers");
    let share = questions.len().div_ceil(threads).max(1);
    std::thread::scope(|scope| {
        let parts: Vec<_> = questions
            .chunks(share)
            .map(|part| scope.spawn(|| part.iter().map(&answer).collect::<Vec<A>>()))
            .collect();
        let parts = parts.into_iter();
        parts
            .flat_map(|part| part.join().expect("an answer does not panic"))
            .collect()
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    /// A box from the origin, outward.
    fn slab(size: DVec3) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let points = (0..8)
            .map(|corner| {
                let bit = |axis: u32| f64::from(corner >> axis & 1);
                size * DVec3::new(bit(0), bit(1), bit(2))
            })
            .collect();
        let quads = [
            [0, 4, 6, 2],
            [1, 3, 7, 5],
            [0, 1, 5, 4],
            [2, 6, 7, 3],
            [0, 2, 3, 1],
            [4, 5, 7, 6],
        ];
        let triangles = quads
            .into_iter()
            .flat_map(|[a, b, c, d]| [[a, b, c], [a, c, d]])
            .collect();
        (points, triangles)
    }

    /// A ball about the origin: an octahedron, its edges halved so many times.
    fn ball(radius: f64, halvings: usize) -> (Vec<DVec3>, Vec<[u32; 3]>) {
        let axes = [DVec3::X, DVec3::Y, DVec3::Z];
        let mut faces: Vec<[DVec3; 3]> = (0..8)
            .map(|octant| {
                let sides = [0, 1, 2].map(|a| if octant >> a & 1 == 1 { -1.0 } else { 1.0 });
                let [x, y, z] = [0, 1, 2].map(|a| sides[a] * axes[a]);
                if sides[0] * sides[1] * sides[2] > 0.0 {
                    [x, y, z]
                } else {
                    [x, z, y]
                }
            })
            .collect();
        for _ in 0..halvings {
            faces = faces
                .into_iter()
                .flat_map(|[a, b, c]| {
                    let [ab, bc, ca] = [a + b, b + c, c + a].map(DVec3::normalize);
                    [[a, ab, ca], [ab, b, bc], [ca, bc, c], [ab, bc, ca]]
                })
                .collect();
        }
        let points: Vec<DVec3> = faces.concat().into_iter().map(|p| radius * p).collect();
        let triangles = (0..faces.len() as u32)
            .map(|face| [3 * face, 3 * face + 1, 3 * face + 2])
            .collect();
        (points, triangles)
    }

    /// Exit of a ball of `radius` about the origin.
    fn exit_of_ball(radius: f64, (from, toward): HalfLine) -> f64 {
        let along = from.dot(toward);
        -along + (along * along - from.length_squared() + radius * radius).sqrt()
    }

    fn some_lines(inside: f64) -> impl Iterator<Item = HalfLine> {
        (0..200).map(move |i| {
            let angle = |k: f64| (k * f64::from(i) + 0.3).sin();
            let from = inside * DVec3::new(angle(1.0), angle(2.3), angle(3.7)) / 3.0_f64.sqrt();
            (
                from,
                DVec3::new(angle(5.1), angle(6.7), angle(7.9)).normalize(),
            )
        })
    }

    #[test]
    fn light_leaves_a_slab_where_its_faces_are() {
        let (points, triangles) = slab(DVec3::new(2.0, 0.01, 3.0));
        let rays = Rays::new(&points, &triangles);
        for (depth, tilt) in [(0.002, 0.0), (0.002, 0.8), (0.009, -1.2)] {
            let toward = DVec3::new(f64::sin(tilt), f64::cos(tilt), 0.0);
            let line = (DVec3::new(1.0, 0.01 - depth, 1.3), toward);
            let exit = rays.exit_m(line).expect("it starts inside");
            // Coordinates of 2 m leave rounding of 1e-15.
            assert!((exit - depth / toward.y).abs() < 1e-14, "{exit}");
        }
        let outside = (DVec3::new(1.0, 0.02, 1.3), DVec3::Y);
        assert_eq!(rays.exit_m(outside), None);
        assert!(!rays.is_blocked(outside, 0.0));
        assert!(rays.is_blocked((outside.0, -DVec3::Y), 0.0));
        assert!(!rays.is_blocked((outside.0, -DVec3::Y), 0.021));
        let (distance, triangle) = rays
            .first((outside.0, -DVec3::Y))
            .expect("it falls on the slab");
        assert!((distance - 0.01).abs() < 1e-14);
        assert!([6, 7].contains(&triangle), "the upper face, not {triangle}");
    }

    #[test]
    fn light_leaves_a_ball_at_the_end_of_its_chord_the_nearer_the_finer_the_mesh() {
        let worst = |halvings: usize| -> f64 {
            let (points, triangles) = ball(0.05, halvings);
            let rays = Rays::new(&points, &triangles);
            let wrong =
                |line| (rays.exit_m(line).expect("inside") - exit_of_ball(0.05, line)).abs();
            some_lines(0.03).map(wrong).fold(0.0, f64::max)
        };
        let (coarse, fine) = (worst(4), worst(6));
        // Facets lie below the ball by an eighth of the square of their edges, here 0.05 · 1.7 / 2^6.
        assert!(fine < 3e-5, "{fine}");
        assert!((8.0..32.0).contains(&(coarse / fine)), "{coarse} to {fine}");
    }

    #[test]
    fn every_ray_of_the_tree_is_that_of_all_triangles_one_by_one() {
        let (points, triangles) = ball(0.05, 3);
        let rays = Rays::new(&points, &triangles);
        for line in some_lines(0.04) {
            let met = rays.triangles.iter().filter_map(|t| t.met_by(line));
            let exits = met.filter(|(_, outwards)| *outwards).map(|(d, _)| d);
            assert_eq!(rays.exit_m(line), exits.reduce(f64::min));
        }
    }

    #[test]
    fn exit_check_fails_for_a_ball_turned_inside_out() {
        let (points, mut triangles) = ball(0.05, 2);
        for triangle in &mut triangles {
            triangle.swap(1, 2);
        }
        let rays = Rays::new(&points, &triangles);
        assert!(some_lines(0.03).all(|line| rays.exit_m(line).is_none()));
    }

    #[test]
    fn answers_come_in_order_from_any_number_of_threads() {
        let questions: Vec<usize> = (0..101).collect();
        let squares: Vec<usize> = questions.iter().map(|q| q * q).collect();
        for threads in [1, 2, 7, 200] {
            assert_eq!(all_by(threads, &questions, |q| q * q), squares);
        }
        assert!(all_by(2, &[] as &[usize], |q| *q).is_empty());
    }
}
