//! Small defects mended: fins and crowded edges cut out, small holes fanned shut; and, where nothing less
//! makes a body, lids over a few openings.

use super::topology::{Defects, EdgeUse, defects, edge_uses, fans, flips, same_edge};
use super::weld::{Face, Union, Vertex};
use crate::geom::bounds;
use glam::{Vec2, Vec3};
use std::collections::HashMap;

/// Rounds of cutting and filling before a surface is given up: filling may crowd an edge again.
const ROUNDS_MAX: usize = 4;
/// A repair may remove this share of the triangles, or [`REMOVED_MIN`] in a small mesh.
const REMOVED_SHARE: usize = 100;
const REMOVED_MIN: usize = 8;
/// Layers that are peeled off a fin before it is taken for more than a defect.
const PEELS_MAX: usize = 16;
/// Holes with a longer rim are openings, not defects.
const HOLE_EDGES_MAX: usize = 64;
/// As [`HOLE_EDGES_MAX`], as a share of the diagonal of the surface.
const HOLE_RIM_SHARE: f32 = 0.5;
/// More openings than this, or one with more edges, are no body that was cut off.
const OPENINGS_MAX: usize = 8;
const OPENING_EDGES_MAX: usize = 4096;
/// Lids over openings may have this share of the area of the rest: over half a ball it is 0.5, over a sheet 1.
const LID_SHARE_MAX: f64 = 0.6;

/// What a repair did.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub(super) struct Repair {
    pub removed: usize,
    pub holes: usize,
    pub openings: usize,
}

/// Which holes are closed.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(super) enum Close {
    /// Those that are small enough to be defects.
    Holes,
    /// Openings too, if they are few and the lids over them small beside the rest.
    Openings,
}

/// Mends `union` in place until every edge has two triangles.
///
/// # Errors
///
/// The defects that are left if it cannot be mended within the limits; `union` is then half mended.
pub(super) fn repair(union: &mut Union, what: Close) -> Result<Repair, Defects> {
    let mut done = Repair::default();
    let removed_max = REMOVED_MIN.max(union.faces.len() / REMOVED_SHARE);
    for _ in 0..ROUNDS_MAX {
        let found = defects(&union.point_triangles());
        if found.none() && !union.faces.is_empty() {
            return Ok(done);
        }
        done.removed += cut_crowded(union);
        if done.removed > removed_max {
            return Err(found);
        }
        let (holes, openings) = fill_holes(union, what);
        done.holes += holes;
        done.openings += openings;
        if done.openings > OPENINGS_MAX {
            return Err(found);
        }
    }
    let left = defects(&union.point_triangles());
    if left.none() { Ok(done) } else { Err(left) }
}

/// Removes triangles at edges with more than two: first the fins, which end in a border, and only
/// if there are none all of them. Returns how many went; crowded edges may be left.
fn cut_crowded(union: &mut Union) -> usize {
    let before = union.faces.len();
    for _ in 0..PEELS_MAX {
        let triangles = union.point_triangles();
        let uses = edge_uses(&triangles);
        let mut on_border = vec![false; triangles.len()];
        let mut on_crowd = vec![false; triangles.len()];
        for uses in uses.chunk_by(same_edge) {
            for edge in uses {
                on_border[edge.triangle as usize] |= uses.len() == 1;
                on_crowd[edge.triangle as usize] |= uses.len() > 2;
            }
        }
        if !on_crowd.contains(&true) {
            break;
        }
        let fins = (0..triangles.len()).any(|k| on_border[k] && on_crowd[k]);
        let mut k = 0..triangles.len();
        union.faces.retain(|_| {
            let k = k.next().expect("one number a face");
            !(on_crowd[k] && (on_border[k] || !fins))
        });
    }
    before - union.faces.len()
}

/// Closes every hole within the limits by a fan about its middle; returns how many holes and openings there were.
fn fill_holes(union: &mut Union, what: Close) -> (usize, usize) {
    let triangles = union.point_triangles();
    let Some(flip) = flips(&triangles) else {
        return (0, 0);
    };
    let (low, high) = bounds(&union.points);
    let rim_max_m = low.distance(high) * HOLE_RIM_SHARE;
    let (holes, openings): (Vec<Rim>, Vec<Rim>) = rims(union, &flip)
        .into_iter()
        .filter(|rim| rim.len() >= 3)
        .partition(|rim| rim.len() <= HOLE_EDGES_MAX && rim_length_m(union, rim) <= rim_max_m);
    for rim in &holes {
        close(union, rim);
    }
    let bearable = what == Close::Openings
        && openings.len() <= OPENINGS_MAX
        && openings.iter().all(|rim| rim.len() <= OPENING_EDGES_MAX);
    if !bearable {
        return (holes.len(), 0);
    }
    let rest = union.faces.len();
    for rim in &openings {
        close(union, rim);
    }
    let area_m2 = |faces: &[Face]| faces.iter().map(|face| area_m2(union, face)).sum::<f64>();
    if area_m2(&union.faces[rest..]) > LID_SHARE_MAX * area_m2(&union.faces[..rest]) {
        union.faces.truncate(rest);
        return (holes.len(), 0);
    }
    (holes.len(), openings.len())
}

fn area_m2(union: &Union, face: &Face) -> f64 {
    let corners = union.face_points(face);
    let [a, b, c] = corners.map(|point| union.points[point as usize].as_dvec3());
    (b - a).cross(c - a).length() / 2.0
}

/// The border edges round one hole as pairs of vertices, in the order in which triangles that close
/// it run along them.
type Rim = Vec<[u32; 2]>;

/// Every closed chain of border edges that meets no point twice.
fn rims(union: &Union, flip: &[bool]) -> Vec<Rim> {
    let triangles = union.point_triangles();
    let uses = edge_uses(&triangles);
    let border = uses.chunk_by(same_edge).filter(|uses| uses.len() == 1);
    // The hole lies on the other side of each edge, so its triangles run the other way.
    let outgoing = |edge: &EdgeUse| {
        let corners = union.faces[edge.triangle as usize].corners;
        let k = edge.corner as usize;
        let (from, to) = (corners[k], corners[(k + 1) % 3]);
        if flip[edge.triangle as usize] {
            [from, to]
        } else {
            [to, from]
        }
    };
    let point = |vertex: u32| union.vertices[vertex as usize].point;
    let edges: Vec<[u32; 2]> = border.map(|uses| outgoing(&uses[0])).collect();
    let mut from_point: HashMap<u32, Vec<usize>> = HashMap::new();
    for (k, edge) in edges.iter().enumerate().rev() {
        from_point.entry(point(edge[0])).or_default().push(k);
    }
    let mut rims = Vec::new();
    let mut chain: Rim = Vec::new();
    let mut place_in_chain: HashMap<u32, usize> = HashMap::new();
    for start in 0..edges.len() {
        let mut next = take(&mut from_point, point(edges[start][0]));
        while let Some(k) = next {
            place_in_chain.insert(point(edges[k][0]), chain.len());
            chain.push(edges[k]);
            let end = point(edges[k][1]);
            // A point met again closes the chain since then, which is a rim of its own.
            if let Some(&first) = place_in_chain.get(&end) {
                let rim = chain.split_off(first);
                for edge in &rim {
                    place_in_chain.remove(&point(edge[0]));
                }
                rims.push(rim);
            }
            next = take(&mut from_point, end);
        }
        chain.clear();
        place_in_chain.clear();
    }
    rims
}

fn take(from_point: &mut HashMap<u32, Vec<usize>>, point: u32) -> Option<usize> {
    from_point.get_mut(&point).and_then(Vec::pop)
}

fn rim_length_m(union: &Union, rim: &Rim) -> f32 {
    let position = |vertex: u32| union.points[union.vertices[vertex as usize].point as usize];
    rim.iter()
        .map(|&[a, b]| position(a).distance(position(b)))
        .sum()
}

/// Closes a rim of three edges by a triangle, a longer one by a fan about its mean point.
fn close(union: &mut Union, rim: &Rim) {
    let part = union.faces[0].part;
    if rim.len() == 3 {
        let corners = [rim[0][0], rim[1][0], rim[2][0]];
        union.faces.push(Face { corners, part });
        return;
    }
    let share = 1.0 / rim.len() as f32;
    let (mut middle, mut uv) = (Vec3::ZERO, Vec2::ZERO);
    for edge in rim {
        let vertex = union.vertices[edge[0] as usize];
        middle += share * union.points[vertex.point as usize];
        uv += share * vertex.uv;
    }
    let point = union.points.len() as u32;
    let hub = union.vertices.len() as u32;
    union.points.push(middle);
    union.vertices.push(Vertex { point, uv });
    union.faces.extend(rim.iter().map(|&[a, b]| Face {
        corners: [a, b, hub],
        part,
    }));
}

/// Gives each fan of triangles its own point where two touch in one; returns how many points were
/// added. The positions stay the same.
pub(super) fn split_touching_points(union: &mut Union) -> usize {
    let fan_of_corner = fans(&union.point_triangles());
    let points_before = union.points.len();
    // The first fan of a point keeps it.
    let mut keeper: Vec<Option<u32>> = vec![None; points_before];
    let mut moved: HashMap<u32, u32> = HashMap::new();
    let mut vertex_in_fan: HashMap<(u32, u32), u32> = HashMap::new();
    for face in 0..union.faces.len() {
        for corner in 0..3 {
            let vertex = union.faces[face].corners[corner];
            let Vertex { point, uv } = union.vertices[vertex as usize];
            let fan = fan_of_corner[3 * face + corner];
            if *keeper[point as usize].get_or_insert(fan) == fan {
                continue;
            }
            let position = union.points[point as usize];
            let point = *moved.entry(fan).or_insert_with(|| {
                union.points.push(position);
                union.points.len() as u32 - 1
            });
            let vertices = &mut union.vertices;
            let copy = *vertex_in_fan.entry((fan, vertex)).or_insert_with(|| {
                vertices.push(Vertex { point, uv });
                vertices.len() as u32 - 1
            });
            union.faces[face].corners[corner] = copy;
        }
    }
    union.points.len() - points_before
}
