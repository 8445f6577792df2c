//! The import against surfaces by formula: what is joined, turned, chosen, mended and refused.

use super::part::Part;
use super::surface::close_parts;
use super::{ImportFault, UvState, uv_state};
use crate::geom::SurfaceMesh;
use glam::{Vec2, Vec3};
use proptest::prelude::*;

/// A sphere of radius 1 m cut into `rings` by `sectors`, faces outwards, as one part without UVs.
fn sphere(rings: u32, sectors: u32) -> Part {
    use std::f32::consts::{PI, TAU};
    let mut part = Part {
        name: "sphere".to_owned(),
        ..Part::default()
    };
    part.positions.push(Vec3::Z);
    for ring in 1..rings {
        let theta = PI * ring as f32 / rings as f32;
        part.positions.extend((0..sectors).map(|sector| {
            let phi = TAU * sector as f32 / sectors as f32;
            let (sin, cos) = theta.sin_cos();
            Vec3::new(sin * phi.cos(), sin * phi.sin(), cos)
        }));
    }
    let last = part.positions.len() as u32;
    part.positions.push(-Vec3::Z);
    let at = |ring: u32, sector: u32| 1 + (ring - 1) * sectors + sector % sectors;
    for sector in 0..sectors {
        part.triangles.push([0, at(1, sector), at(1, sector + 1)]);
        let bottom = rings - 1;
        part.triangles
            .push([last, at(bottom, sector + 1), at(bottom, sector)]);
        for ring in 1..bottom {
            let [a, b] = [at(ring, sector), at(ring, sector + 1)];
            let [c, d] = [at(ring + 1, sector), at(ring + 1, sector + 1)];
            part.triangles.extend([[a, c, d], [a, d, b]]);
        }
    }
    part
}

/// The triangles of `part` for which `keep` holds, as a part of its own with its own vertices.
fn piece(part: &Part, name: &str, keep: impl Fn(Vec3) -> bool) -> Part {
    let centre = |t: &[u32; 3]| t.iter().map(|&v| part.positions[v as usize]).sum::<Vec3>() / 3.0;
    Part {
        name: name.to_owned(),
        positions: part.positions.clone(),
        triangles: part
            .triangles
            .iter()
            .copied()
            .filter(|t| keep(centre(t)))
            .collect(),
        ..Part::default()
    }
}

fn moved(mut part: Part, name: &str, scale: f32, by: Vec3) -> Part {
    part.name = name.to_owned();
    for position in &mut part.positions {
        *position = scale * *position + by;
    }
    part
}

fn close(parts: &[Part]) -> super::ImportedSurface {
    close_parts(parts, Vec::new()).expect("the surface closes")
}

fn has_note(surface: &super::ImportedSurface, text: &str) -> bool {
    surface.notes.iter().any(|note| note.contains(text))
}

#[test]
fn inside_out_sphere_is_turned_outwards() {
    let mut part = sphere(8, 12);
    for triangle in &mut part.triangles {
        triangle.swap(0, 1);
    }
    let surface = close(&[part]);
    assert!(surface.mesh.volume_m3() > 3.0);
    assert!(has_note(&surface, "turned to face outwards"));
}

#[test]
fn single_flipped_triangles_are_turned_like_the_rest() {
    let whole = close(&[sphere(8, 12)]).mesh.volume_m3();
    let mut part = sphere(8, 12);
    for triangle in part.triangles.iter_mut().step_by(7) {
        triangle.swap(1, 2);
    }
    let turned = part.triangles.len().div_ceil(7);
    let surface = close(&[part]);
    // The same triangles in the same order; only corners are swapped back.
    assert!((surface.mesh.volume_m3() - whole).abs() < 1e-6);
    assert!(has_note(&surface, &format!("{turned} triangles turned")));
}

#[test]
fn duplicate_degenerate_and_unused_elements_are_dropped() {
    let mut part = sphere(6, 8);
    let (triangles, points) = (part.triangles.len(), part.positions.len());
    part.triangles.extend_from_within(..3);
    part.triangles.push([4, 4, 5]);
    part.positions.push(Vec3::splat(0.1));
    let surface = close(&[part]);
    assert_eq!(surface.mesh.triangles.len(), triangles);
    assert_eq!(surface.mesh.points.len(), points);
    assert!(has_note(&surface, "3 triangles dropped that repeat"));
    assert!(has_note(&surface, "1 degenerate"));
}

#[test]
fn shells_cut_into_patches_close_whatever_else_lies_on_them() {
    let whole = sphere(12, 16);
    // A loose sheet that stands on the surface: it shares edges with it and closes nothing.
    let mut ligament = piece(&whole, "ligament", |p| p.x > 0.3 && p.z.abs() < 0.3);
    let tip = ligament.positions.len() as u32;
    ligament.positions.push(Vec3::X * 2.0);
    for triangle in &mut ligament.triangles {
        triangle[2] = tip;
    }
    let mut parts = vec![
        piece(&whole, "north", |p| p.z > 0.4),
        piece(&whole, "belt", |p| p.z.abs() <= 0.4),
        ligament,
        moved(sphere(4, 5), "bead", 0.4, Vec3::X * 2.0),
        piece(&whole, "south", |p| p.z < -0.4),
    ];
    let surface = close(&parts);
    assert_eq!(surface.meshes_used, ["north", "belt", "south"]);
    assert_eq!(surface.mesh.triangles.len(), whole.triangles.len());
    assert_eq!(surface.mesh.points.len(), whole.positions.len());
    assert!(has_note(&surface, "left out: ligament, bead"));
    // Without its belt only the bead is closed, and it is too large to be an ornament.
    parts.remove(1);
    assert_eq!(close(&parts).meshes_used, ["bead"]);
}

#[test]
fn larger_of_two_closed_parts_is_used() {
    let surface = close(&[
        sphere(6, 8),
        moved(sphere(6, 8), "large", 1.5, Vec3::X * 4.0),
    ]);
    assert_eq!(surface.meshes_used, ["large"]);
    assert!(has_note(&surface, "left out: sphere"));
}

#[test]
fn seam_that_exporters_rounded_differently_is_joined_with_a_note() {
    let whole = sphere(12, 16);
    let north = piece(&whole, "north", |p| p.z > 0.1);
    let mut south = piece(&whole, "south", |p| p.z <= 0.1);
    for position in &mut south.positions {
        *position *= 1.0 + 1.2e-7;
    }
    let surface = close(&[north, south]);
    assert!(has_note(&surface, "border points joined"));
    assert_eq!(surface.mesh.triangles.len(), whole.triangles.len());
}

#[test]
fn small_holes_and_fins_are_mended() {
    let mut part = sphere(40, 60);
    let whole = close(&[part.clone()]).mesh.volume_m3();
    part.triangles.remove(700);
    part.triangles.drain(300..304);
    let tip = part.positions.len() as u32;
    part.positions.push(Vec3::splat(1.5));
    let [a, b, _] = part.triangles[1000];
    part.triangles.push([a, b, tip]);
    let surface = close(&[part]);
    // Each hole was a few cells of a sphere of 2400: the volume can hardly change.
    assert!((surface.mesh.volume_m3() / whole - 1.0).abs() < 1e-3);
    assert!(has_note(&surface, "1 triangles cut out"));
    assert!(has_note(&surface, "2 small holes closed"));
}

#[test]
fn shallow_bowl_is_refused_with_its_border_edges() {
    // Deeper than half a ball, and a lid would make it a body.
    let bowl = piece(&sphere(40, 80), "bowl", |p| p.z < -0.7);
    match close_parts(&[bowl], Vec::new()) {
        Err(ImportFault::Open { border_edges, .. }) => assert_eq!(border_edges, 80),
        other => panic!("an open bowl was not refused: {other:?}"),
    }
}

#[test]
fn sheet_of_two_sides_is_refused_as_flat() {
    let part = Part {
        positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::ONE.with_z(0.0)],
        // Two different cuts of one square, back to back.
        triangles: vec![[0, 1, 3], [0, 3, 2], [0, 2, 1], [1, 2, 3]],
        ..Part::default()
    };
    let result = close_parts(&[part], Vec::new());
    assert!(matches!(result, Err(ImportFault::Flat)), "{result:?}");
}

#[test]
fn two_tetrahedra_that_touch_in_a_point_come_apart() {
    let tetrahedron = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [2, 0, 3]];
    let corners = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
    let part = Part {
        positions: corners
            .into_iter()
            .chain(corners.map(|p| -2.0 * p))
            .collect(),
        triangles: tetrahedron
            .into_iter()
            .chain(tetrahedron.map(|t| t.map(|v| v + 4)))
            .collect(),
        ..Part::default()
    };
    let surface = close(&[part]);
    assert_eq!(surface.mesh.points.len(), 4);
    assert!((surface.mesh.volume_m3() - 8.0 / 6.0).abs() < 1e-6);
}

/// A unit square of `cells` x `cells` quads whose texture coordinates are `uv` of the position.
fn square(cells: u32, uv: impl Fn(Vec2) -> Vec2) -> SurfaceMesh {
    let mut mesh = SurfaceMesh::default();
    let row = cells + 1;
    for k in 0..row * row {
        let at = Vec2::new((k % row) as f32, (k / row) as f32) / cells as f32;
        mesh.points.push(at.extend(0.0));
        mesh.point_of.push(k);
        mesh.uvs.push(uv(at));
    }
    for k in (0..row * cells).filter(|k| k % row < cells) {
        mesh.triangles
            .extend([[k, k + 1, k + row + 1], [k, k + row + 1, k + row]]);
    }
    mesh
}

#[test]
fn uv_state_tells_usable_from_overlapping_outside_flat_and_broken() {
    assert_eq!(uv_state(&square(7, |p| p)), UvState::Usable);
    // A turned square shares no texel either: edges at any angle are counted once.
    let turned = square(9, |p| {
        Vec2::new(0.6 * p.x - 0.3 * p.y + 0.35, 0.3 * p.x + 0.6 * p.y)
    });
    assert_eq!(uv_state(&turned), UvState::Usable);
    let folded = uv_state(&square(8, |p| Vec2::new((p.x - 0.5).abs(), p.y)));
    assert!(
        matches!(folded, UvState::Overlapping { share } if share > 0.99),
        "{folded:?}"
    );
    assert_eq!(uv_state(&square(3, |p| 2.0 * p)), UvState::Outside);
    assert_eq!(uv_state(&square(3, |_| Vec2::ZERO)), UvState::NoArea);
    assert_eq!(uv_state(&square(3, |p| Vec2::splat(p.x))), UvState::NoArea);
    assert_eq!(uv_state(&square(3, |p| p / 0.0)), UvState::NonFinite);
}

#[test]
fn uv_overlap_share_is_the_overlapped_area() {
    // Of 20 columns the last is folded back onto the one before: 1 of 19 covered columns.
    let fold = |p: Vec2| Vec2::new(if p.x > 0.975 { 0.9 } else { p.x }, p.y);
    let UvState::Overlapping { share } = uv_state(&square(20, fold)) else {
        panic!("the fold went unnoticed");
    };
    // The grid has 1024 columns, so the share is known to about 2 of them in 54.
    assert!((share - 1.0 / 19.0).abs() < 0.002, "share {share}");
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 64, failure_persistence: None, ..ProptestConfig::default() })]

    /// Any soup either fails or becomes a closed outward surface.
    #[test]
    fn triangle_soup_never_panics_and_what_is_returned_is_closed(
        triangles in prop::collection::vec(prop::array::uniform3(0_u32..9), 1..60),
        places in prop::collection::vec(prop::array::uniform3(-3_i8..3), 9),
    ) {
        let part = Part {
            positions: places.iter().map(|p| Vec3::from(p.map(f32::from))).collect(),
            triangles,
            ..Part::default()
        };
        if let Ok(surface) = close_parts(&[part], Vec::new()) {
            let triangles = surface.mesh.point_triangles();
            prop_assert!(super::topology::defects(&triangles).none());
            prop_assert!(surface.mesh.volume_m3() > 0.0);
            surface.mesh.first_vertex_of_point();
        }
    }

    /// Cutting a sphere into patches at random never changes the surface that comes out.
    #[test]
    fn patches_of_a_sphere_weld_to_the_sphere(cut in prop::collection::vec(0_usize..4, 1..40)) {
        let whole = sphere(7, 9);
        let parts: Vec<Part> = (0..4)
            .map(|number| {
                let mut part = whole.clone();
                let mut k = 0;
                part.triangles.retain(|_| {
                    k += 1;
                    cut[k % cut.len()] == number
                });
                part
            })
            .filter(|part| !part.triangles.is_empty())
            .collect();
        let surface = close(&parts);
        prop_assert_eq!(surface.mesh.points.len(), whole.positions.len());
        prop_assert_eq!(surface.mesh.triangles.len(), whole.triangles.len());
    }
}
