//! The nearest places of a tool's axis and a triangle.
//!
//! Source: Ericson, "Real-Time Collision Detection" (2005), sections 5.1.5 (point and triangle) and
//! 5.1.9 (two segments).

use glam::Vec3;

/// A piece of a tool's axis, from one end to the other [m]; both are the same for a sphere.
pub type Axis = [Vec3; 2];

/// The nearest pair of places on an axis and on a triangle.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Nearest {
    /// The place on the axis [m].
    pub foot: Vec3,
    /// Where that is on the axis: 0 at its first end, 1 at its other.
    pub share: f32,
    /// Barycentric weights of the place on the triangle; sum 1, none negative.
    pub weights: Vec3,
    /// From the foot to the place on the triangle [m].
    pub offset: Vec3,
}

impl Nearest {
    /// How far apart they are [m].
    pub fn distance_m(&self) -> f32 {
        self.offset.length()
    }

    /// The direction from the axis to the triangle; where the axis crosses the triangle, the
    /// direction through it from its outside.
    pub fn normal(&self, triangle: [Vec3; 3]) -> Vec3 {
        let [a, b, c] = triangle;
        self.offset
            .try_normalize()
            .or_else(|| (c - a).cross(b - a).try_normalize())
            .unwrap_or(Vec3::NEG_Y)
    }
}

/// The nearest places of `axis` and `triangle`.
pub fn nearest(axis: Axis, triangle: [Vec3; 3]) -> Nearest {
    let at_first = to_end(axis, 0.0, triangle);
    if axis[0] == axis[1] {
        return at_first;
    }
    if let Some(crossing) = crossing(axis, triangle) {
        return crossing;
    }
    let at_other = to_end(axis, 1.0, triangle);
    let edges = [0, 1, 2].map(|k| to_edge(axis, k, triangle));
    let mut best = at_first;
    for candidate in [at_other, edges[0], edges[1], edges[2]] {
        if candidate.offset.length_squared() < best.offset.length_squared() {
            best = candidate;
        }
    }
    best
}

/// The nearest place to the end at `share`, 0 or 1, of the axis.
fn to_end(axis: Axis, share: f32, triangle: [Vec3; 3]) -> Nearest {
    let foot = if share == 0.0 { axis[0] } else { axis[1] };
    let weights = weights_nearest(foot, triangle);
    Nearest {
        foot,
        share,
        weights,
        offset: blend(weights, triangle) - foot,
    }
}

/// The place with these barycentric weights.
pub fn blend(weights: Vec3, corners: [Vec3; 3]) -> Vec3 {
    weights.x * corners[0] + weights.y * corners[1] + weights.z * corners[2]
}

/// Barycentric weights of the place in `triangle` that is nearest to `x`.
fn weights_nearest(x: Vec3, [a, b, c]: [Vec3; 3]) -> Vec3 {
    let (ab, ac) = (b - a, c - a);
    let ax = x - a;
    let (d1, d2) = (ab.dot(ax), ac.dot(ax));
    if d1 <= 0.0 && d2 <= 0.0 {
        return Vec3::X;
    }
    let bx = x - b;
    let (d3, d4) = (ab.dot(bx), ac.dot(bx));
    if d3 >= 0.0 && d4 <= d3 {
        return Vec3::Y;
    }
    let vc = d1 * d4 - d3 * d2;
    if vc <= 0.0 && d1 >= 0.0 && d3 <= 0.0 {
        let v = share_of(d1, d1 - d3);
        return Vec3::new(1.0 - v, v, 0.0);
    }
    let cx = x - c;
    let (d5, d6) = (ab.dot(cx), ac.dot(cx));
    if d6 >= 0.0 && d5 <= d6 {
        return Vec3::Z;
    }
    let vb = d5 * d2 - d1 * d6;
    if vb <= 0.0 && d2 >= 0.0 && d6 <= 0.0 {
        let w = share_of(d2, d2 - d6);
        return Vec3::new(1.0 - w, 0.0, w);
    }
    let va = d3 * d6 - d5 * d4;
    if va <= 0.0 && d4 >= d3 && d5 >= d6 {
        let w = share_of(d4 - d3, (d4 - d3) + (d5 - d6));
        return Vec3::new(0.0, 1.0 - w, w);
    }
    let sum = va + vb + vc;
    if sum.is_nan() || sum <= 0.0 {
        return Vec3::X; // A triangle without area: its sides have been looked at.
    }
    let (v, w) = (vb / sum, vc / sum);
    Vec3::new(1.0 - v - w, v, w)
}

/// `part / whole` within 0 and 1; 0 if there is no whole.
fn share_of(part: f32, whole: f32) -> f32 {
    if whole > 0.0 {
        (part / whole).clamp(0.0, 1.0)
    } else {
        0.0
    }
}

/// Where the axis goes through the triangle.
fn crossing(axis: Axis, triangle: [Vec3; 3]) -> Option<Nearest> {
    let [a, b, c] = triangle;
    let way = axis[1] - axis[0];
    let normal = (b - a).cross(c - a);
    let speed = normal.dot(way);
    if speed == 0.0 {
        return None;
    }
    let share = normal.dot(a - axis[0]) / speed;
    if !(0.0..=1.0).contains(&share) {
        return None;
    }
    let foot = axis[0] + share * way;
    let area = normal.length_squared();
    let u = normal.dot((b - foot).cross(c - foot)) / area;
    let v = normal.dot((c - foot).cross(a - foot)) / area;
    let w = 1.0 - u - v;
    (u >= 0.0 && v >= 0.0 && w >= 0.0).then_some(Nearest {
        foot,
        share,
        weights: Vec3::new(u, v, w),
        offset: Vec3::ZERO,
    })
}

/// The nearest places of the axis and the edge from corner `k` to the next.
fn to_edge(axis: Axis, k: usize, triangle: [Vec3; 3]) -> Nearest {
    let (from, to) = (triangle[k], triangle[(k + 1) % 3]);
    let (along, edge) = (axis[1] - axis[0], to - from);
    let between = axis[0] - from;
    let (aa, ee) = (along.length_squared(), edge.length_squared());
    let (ae, ab, eb) = (along.dot(edge), along.dot(between), edge.dot(between));
    let denominator = aa * ee - ae * ae;
    let mut share = if denominator > 1e-6 * aa * ee {
        ((ae * eb - ab * ee) / denominator).clamp(0.0, 1.0)
    } else {
        0.0
    };
    let mut on_edge = share_of(ae * share + eb, ee);
    // The edge's end may have cut it short: the axis answers once more.
    share = share_of(ae * on_edge - ab, aa);
    on_edge = share_of(ae * share + eb, ee);
    let mut weights = [0.0; 3];
    weights[k] = 1.0 - on_edge;
    weights[(k + 1) % 3] = on_edge;
    let foot = axis[0] + share * along;
    Nearest {
        foot,
        share,
        weights: weights.into(),
        offset: from + on_edge * edge - foot,
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const TRIANGLE: [Vec3; 3] = [Vec3::ZERO, Vec3::X, Vec3::Y];

    #[test]
    fn face_edge_and_corner_are_each_nearest_to_what_lies_over_them() {
        let weights = |x: Vec3| nearest([x, x], TRIANGLE).weights;
        assert_eq!(
            weights(Vec3::new(0.25, 0.25, 1.0)),
            Vec3::new(0.5, 0.25, 0.25)
        );
        assert_eq!(weights(Vec3::new(0.5, -1.0, 1.0)), Vec3::new(0.5, 0.5, 0.0));
        assert_eq!(weights(Vec3::new(-1.0, -1.0, 1.0)), Vec3::X);
        assert_eq!(weights(Vec3::new(2.0, -0.5, 0.0)), Vec3::Y);
        assert_eq!(weights(Vec3::new(1.0, 1.0, 0.0)), Vec3::new(0.0, 0.5, 0.5));
    }

    #[test]
    fn axis_through_a_triangle_touches_it_and_its_normal_is_the_inward_one() {
        let found = nearest(
            [Vec3::new(0.2, 0.2, 1.0), Vec3::new(0.2, 0.2, -1.0)],
            TRIANGLE,
        );
        assert_eq!(found.distance_m(), 0.0);
        assert_eq!(found.normal(TRIANGLE), Vec3::NEG_Z);
    }

    #[test]
    fn triangles_without_area_have_finite_nearest_places() {
        for triangle in [[Vec3::ZERO; 3], [Vec3::ZERO, Vec3::X, 2.0 * Vec3::X]] {
            for axis in [[Vec3::Y; 2], [Vec3::Y, Vec3::Y + Vec3::X], [Vec3::ZERO; 2]] {
                let found = nearest(axis, triangle);
                assert!(found.weights.is_finite() && found.offset.is_finite());
                assert!(found.normal(triangle).is_normalized());
            }
        }
    }

    /// Smallest distance over a grid of places on both [m], in f64.
    fn sampled_distance(axis: Axis, triangle: [Vec3; 3]) -> f64 {
        const CUTS: u32 = 60;
        let share = |k: u32| f64::from(k) / f64::from(CUTS);
        let [a, b, c] = triangle.map(|x| x.as_dvec3());
        let mut best = f64::INFINITY;
        for i in 0..=CUTS {
            for j in 0..=CUTS - i {
                let x = a + share(i) * (b - a) + share(j) * (c - a);
                for k in 0..=CUTS {
                    let foot = axis[0].as_dvec3().lerp(axis[1].as_dvec3(), share(k));
                    best = best.min(foot.distance(x));
                }
            }
        }
        best
    }

    proptest! {
        #![proptest_config(ProptestConfig::with_cases(64))]
        #[test]
        fn no_sampled_pair_is_nearer_and_one_is_about_as_near(
            corners in prop::array::uniform9(-1.0_f32..1.0),
            ends in prop::array::uniform6(-1.0_f32..1.0),
        ) {
            let v = |s: &[f32]| Vec3::from_slice(s);
            let triangle = [v(&corners[0..]), v(&corners[3..]), v(&corners[6..])];
            let axis = [v(&ends[0..]), v(&ends[3..])];
            let found = f64::from(nearest(axis, triangle).distance_m());
            let sampled = sampled_distance(axis, triangle);
            // Samples are up to 1/60 of sides of up to 3.5 apart, on both.
            prop_assert!(found <= sampled + 1e-5, "{found} but {sampled} was sampled");
            prop_assert!(sampled <= found + 0.08, "{found} but only {sampled} was sampled");
        }
    }
}
