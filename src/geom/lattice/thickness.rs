//! How thick a body is, so that cells can be chosen for it.

use crate::geom::SurfaceMesh;
use crate::geom::ray::first_hit;
use rayon::prelude::*;

/// Places from which a body is looked through.
const PLACES: usize = 200;
/// The share of the surface that is thinner than what is told: a wall is thin nearly everywhere, an organ with
/// thin vessels is not.
const THIN_SHARE: f64 = 0.25;
/// Where a ray starts below the surface, as a share of the longest extent.
const START_SHARE: f32 = 1e-5;

/// Thickness [m] that a quarter of the surface falls below: how far it is from a place on it straight
/// through to the other side. The longest extent where nothing is met; 0 for an empty surface.
///
/// Places lie at equal steps of area in the order of the triangles, so the same surface gives the same
/// number.
pub(super) fn thin_m(surface: &SurfaceMesh) -> f32 {
    let triangles = surface.point_triangles();
    let (low, high) = surface.bounds();
    let longest_m = (high - low).max_element();
    let mut reached_m2 = 0.0;
    let reached: Vec<f64> = (triangles.iter())
        .map(|corners| {
            let [a, b, c] = corners.map(|point| surface.points[point as usize].as_dvec3());
            reached_m2 += (b - a).cross(c - a).length() / 2.0;
            reached_m2
        })
        .collect();
    let mut ways_m: Vec<f32> = (0..PLACES)
        .into_par_iter()
        .filter_map(|place| {
            let at = (place as f64 + 0.5) / PLACES as f64 * reached_m2;
            let corners = triangles.get(reached.partition_point(|&reached| reached <= at))?;
            let [a, b, c] = corners.map(|point| surface.points[point as usize]);
            let inwards = -(b - a).cross(c - a).try_normalize()?;
            let start = (a + b + c) / 3.0 + START_SHARE * longest_m * inwards;
            let hit = first_hit(start, inwards, &surface.points, &triangles)?;
            Some(hit.distance + START_SHARE * longest_m)
        })
        .collect();
    ways_m.sort_by(f32::total_cmp);
    let rank = (THIN_SHARE * ways_m.len() as f64) as usize;
    ways_m.get(rank).copied().unwrap_or(longest_m)
}
