//! The lattice against hand-made and real surfaces.

use super::*;
use crate::geom::volume_m3;
use glam::{Vec2, Vec3};
use proptest::prelude::*;
use std::{collections::HashMap, path::PathBuf};

/// A mesh without UV map, which the lattice does not look at.
fn bare(points: Vec<Vec3>, triangles: Vec<[u32; 3]>) -> SurfaceMesh {
    SurfaceMesh {
        point_of: (0..points.len() as u32).collect(),
        uvs: vec![Vec2::ZERO; points.len()],
        points,
        triangles,
    }
}

fn ball(radius_m: f32) -> SurfaceMesh {
    let (points, triangles) = sphere(radius_m);
    bare(points, triangles)
}

/// Largest distance between a surface point and where its embedding puts it [m].
fn embedding_error_m(lattice: &Lattice, surface: &SurfaceMesh) -> f32 {
    let mut points = vec![Vec3::ZERO; surface.points.len()];
    lattice
        .embedding
        .apply(&lattice.tets.particles, &mut points);
    (points.iter().zip(&surface.points))
        .map(|(a, b)| a.distance(*b))
        .fold(0.0, f32::max)
}

/// Every tetrahedron positive, every inner face shared by two that see it from opposite sides.
fn is_conforming(mesh: &TetMesh) -> bool {
    let mut faces: HashMap<[u32; 3], Vec<bool>> = HashMap::new();
    for &[a, b, c, d] in &mesh.tets {
        for face in [[b, c, d], [a, d, c], [a, b, d], [a, c, b]] {
            let mut key = face;
            key.sort_unstable();
            let even = (0..3).any(|k| (0..3).all(|i| face[(i + k) % 3] == key[i]));
            faces.entry(key).or_default().push(even);
        }
    }
    mesh.tets.iter().all(|&tet| tet_volume_m3(mesh, tet) > 0.0)
        && faces
            .values()
            .all(|sides| sides.len() == 1 || (sides.len() == 2 && sides[0] != sides[1]))
}

fn total_kg(lattice: &Lattice) -> f64 {
    lattice.masses_kg.iter().map(|&m| f64::from(m)).sum()
}

#[test]
fn sphere_triangles_face_outwards_and_enclose_nearly_the_sphere() {
    let (points, triangles) = sphere(0.1);
    let volume = volume_m3(&points, &triangles);
    let exact = 4.0 / 3.0 * std::f64::consts::PI * 0.001;
    // A chord of 2 % of the radius leaves out about a thousandth.
    assert!((volume / exact - 1.0).abs() < 2e-3, "{volume} of {exact}");
}

#[test]
fn lattice_round_a_ball_has_its_mass_carries_its_points_and_conforms() {
    let surface = ball(0.05);
    for cell_m in [0.003, 0.0071, 0.02, 0.09] {
        let lattice = Lattice::around(&surface, cell_m, 1060.0).expect("a ball has a lattice");
        assert!(is_conforming(&lattice.tets), "cell {cell_m}");
        assert!(lattice.masses_kg.iter().all(|&mass| mass > 0.0));
        let expected = 1060.0 * surface.volume_m3();
        let error = (total_kg(&lattice) / expected - 1.0).abs();
        assert!(error < 1e-4, "cell {cell_m}: mass off by {error}");
        // 1e-6 of the size: f32 weights on coordinates of the size of the body.
        let error = embedding_error_m(&lattice, &surface);
        assert!(error < 1e-7, "cell {cell_m}: points off by {error} m");
        let outside = (lattice.embedding.weights.iter())
            .flatten()
            .fold(0.0_f32, |worst, &w| worst.min(w));
        assert!(outside > -1e-3, "cell {cell_m}: a weight of {outside}");
    }
}

#[test]
fn conformity_check_rejects_a_cube_cut_the_wrong_way() {
    let (_, lattice) = block_of_cells(Vec3::ONE, [2, 1, 1]);
    assert!(is_conforming(&lattice.tets));
    let mut broken = lattice.tets.clone();
    // The second cube, cut like the first.
    let first: Vec<[u32; 4]> = broken.tets[..5].to_vec();
    let shifted = |tet: [u32; 4]| tet.map(|i| if i % 3 == 2 { i - 1 } else { i + 1 });
    broken.tets.truncate(5);
    broken.tets.extend(
        first
            .into_iter()
            .map(shifted)
            .map(|[a, b, c, d]| [b, a, c, d]),
    );
    assert!(!is_conforming(&broken));
}

#[test]
fn fill_of_a_ball_adds_up_to_its_volume() {
    let surface = ball(0.05);
    let lattice = Lattice::around(&surface, 0.005, 1000.0).expect("a ball has a lattice");
    let filled: f64 = (lattice.tets.tets.iter().zip(&lattice.fill))
        .map(|(&tet, &fill)| tet_volume_m3(&lattice.tets, tet) * f64::from(fill))
        .sum();
    // 64 samples a cube are good for a few thousandths; the floor of 20 % adds the rest.
    let ratio = filled / surface.volume_m3();
    assert!((0.99..1.1).contains(&ratio), "{ratio}");
}

#[test]
fn cells_of_a_thick_body_give_about_five_thousand_tetrahedra() {
    for surface in [
        ball(0.05),
        block_of_cells(Vec3::new(0.2, 0.02, 0.1), [9, 2, 7]).0,
    ] {
        let lattice = Lattice::around(&surface, cells_for(&surface).cell_m, 1000.0)
            .expect("the default cell is in range");
        let tets = lattice.tets.tets.len();
        assert!((3_000..8_000).contains(&tets), "{tets} tetrahedra");
    }
}

#[test]
fn thin_bodies_get_cells_no_thicker_than_they_are_within_the_budget() {
    // A sheet of 3 mm, a rod of 4 mm, a plate of a tenth of a millimetre: side lengths of a box [m].
    for (extent, cell_mm) in [
        (Vec3::new(0.1, 0.1, 0.003), 2.9..3.1),
        (Vec3::new(0.3, 0.004, 0.004), 0.9..1.9),
        (Vec3::new(0.1, 0.1, 0.000_1), 1.0..4.0),
    ] {
        let surface = block_of_cells(extent, [1, 1, 1]).0;
        let cells = cells_for(&surface);
        assert!(
            cell_mm.contains(&(1e3 * cells.cell_m)),
            "{extent}: {cells:?}"
        );
        let lattice = Lattice::around(&surface, cells.cell_m, 1000.0).expect("it is in range");
        let tets = lattice.tets.tets.len();
        assert!(tets < 30_000, "{extent}: {tets} tetrahedra");
        let thinnest = extent.min_element();
        assert!(
            (cells.thin_m / thinnest - 1.0).abs() < 0.01,
            "{extent}: {cells:?}"
        );
    }
    // What is thick everywhere keeps the cells of its volume.
    let surface = ball(0.05);
    let by_volume_m = cell_for_volume_m(surface.volume_m3() as f32);
    assert_eq!(cells_for(&surface).cell_m, by_volume_m);
    assert!((cells_for(&surface).thin_m / 0.1 - 1.0).abs() < 0.02);
}

#[test]
fn real_liver_has_a_lattice_of_its_mass() {
    let shared = std::env::var_os("PALPATE_SHARED").map_or_else(
        || PathBuf::from(env!("CARGO_MANIFEST_DIR")).join("../shared"),
        PathBuf::from,
    );
    let file = shared.join("data/organs/liver-smooth.obj");
    let Ok((models, _)) = tobj::load_obj(&file, &tobj::LoadOptions::default()) else {
        println!("left out: {} is absent", file.display());
        return;
    };
    let mesh = &models[0].mesh;
    let points = (mesh.positions.chunks(3))
        .map(|x| 0.03 * Vec3::new(x[0], x[1], x[2]))
        .collect();
    let triangles = mesh.indices.chunks(3).map(|t| [t[0], t[1], t[2]]).collect();
    let surface = bare(points, triangles);
    for cell_m in [cells_for(&surface).cell_m, 0.006] {
        let lattice = Lattice::around(&surface, cell_m, 1060.0).expect("the liver has a lattice");
        assert!(is_conforming(&lattice.tets));
        let error = (total_kg(&lattice) / (1060.0 * surface.volume_m3()) - 1.0).abs();
        assert!(error < 1e-4, "mass off by {error}");
        let error = embedding_error_m(&lattice, &surface);
        assert!(error < 1e-6 * 0.19, "points off by {error} m");
        println!(
            "cell {cell_m}: {} tetrahedra, {} particles",
            lattice.tets.tets.len(),
            lattice.tets.particles.len()
        );
    }
}

#[test]
fn surface_with_a_hole_is_filled_as_if_it_were_closed() {
    let mut surface = ball(0.05);
    surface.triangles.swap_remove(100);
    let whole = ball(0.05);
    let lattice = Lattice::around(&surface, 0.006, 1000.0).expect("one hole is bridged");
    let expected = Lattice::around(&whole, 0.006, 1000.0).expect("a ball has a lattice");
    // One column in three directions is lost of each sample behind the hole, two still vote.
    assert_eq!(lattice.tets.tets.len(), expected.tets.tets.len());
    let error = (total_kg(&lattice) / total_kg(&expected) - 1.0).abs();
    assert!(error < 0.01, "mass off by {error}");
}

#[test]
fn inside_out_ball_has_the_same_lattice() {
    let mut surface = ball(0.05);
    for triangle in &mut surface.triangles {
        triangle.swap(0, 1);
    }
    let lattice = Lattice::around(&surface, 0.01, 1000.0).expect("the volume is there");
    let expected = Lattice::around(&ball(0.05), 0.01, 1000.0).expect("a ball has a lattice");
    assert_eq!(lattice.tets, expected.tets);
}

#[test]
fn refusals_name_what_is_wrong_and_the_allowed_range() {
    let surface = ball(0.05);
    let refusal = |cell_m: f32| match Lattice::around(&surface, cell_m, 1000.0) {
        Err(LatticeError::CellOutOfRange { min_m, max_m, .. }) => (min_m, max_m),
        other => panic!(
            "{cell_m} m must be refused, got {:?}",
            other.map(|l| l.cell_m)
        ),
    };
    for cell_m in [1e-5, 3e-4, 0.2, 0.0, -1.0, f32::NAN] {
        let (min_m, max_m) = refusal(cell_m);
        assert!(min_m > 3e-4 && max_m < 0.2, "{min_m} to {max_m}");
    }
    let flat = bare(
        vec![Vec3::ZERO, Vec3::X, Vec3::Y],
        vec![[0, 1, 2], [0, 2, 1]],
    );
    let refused = Lattice::around(&flat, 0.1, 1000.0).map(|l| l.cell_m);
    assert_eq!(refused, Err(LatticeError::NoVolume));
    let refused = Lattice::around(&SurfaceMesh::default(), 0.1, 1000.0).map(|l| l.cell_m);
    assert_eq!(refused, Err(LatticeError::NoVolume));
    let refused = Lattice::around(&surface, 0.01, 0.0).map(|l| l.cell_m);
    assert!(matches!(
        refused,
        Err(LatticeError::DensityOutOfRange { .. })
    ));
    let mut broken = ball(0.05);
    broken.points[7].y = f32::NAN;
    let refused = Lattice::around(&broken, 0.01, 1000.0).map(|l| l.cell_m);
    assert_eq!(refused, Err(LatticeError::NotFinite { point: 7 }));
}

#[test]
fn smallest_cell_that_a_refusal_names_is_taken() {
    let size = Vec3::new(0.1, 0.1, 0.001);
    let refused = block(size, 1e-6, 1000.0).expect_err("too fine");
    let LatticeError::CellOutOfRange { min_m, .. } = refused else {
        panic!("another refusal: {refused}");
    };
    assert!(block(size, min_m, 1000.0).is_ok());
}

#[test]
fn block_is_its_own_skin_with_charts_that_do_not_overlap() {
    let size = Vec3::new(0.2, 0.02, 0.1);
    let (surface, lattice) = block(size, 0.01, 1000.0).expect("a slab of 400 cells");
    assert!(is_conforming(&lattice.tets));
    assert_eq!(lattice.tets.tets.len(), 5 * 20 * 2 * 10);
    assert_eq!(embedding_error_m(&lattice, &surface), 0.0);
    let volume = f64::from(size.element_product());
    assert!((surface.volume_m3() / volume - 1.0).abs() < 1e-5);
    assert!((total_kg(&lattice) / (1000.0 * volume) - 1.0).abs() < 1e-5);

    // Charts: one scale, all the same way round, and their areas fit the boxes that hold them.
    let mut area_ratio = Vec::new();
    let mut boxes: HashMap<[i32; 3], (Vec2, Vec2)> = HashMap::new();
    for t in 0..surface.triangles.len() {
        let [a, b, c] = surface
            .point_triangle(t)
            .map(|i| surface.points[i as usize]);
        let uv = surface.triangles[t].map(|i| surface.uvs[i as usize]);
        let normal = (b - a).cross(c - a);
        // v grows downwards, so a triangle seen from outside turns the other way in the image.
        let turn = -(uv[1] - uv[0]).perp_dot(uv[2] - uv[0]);
        area_ratio.push(turn / normal.length());
        let side = normal.normalize().round().to_array().map(|x| x as i32);
        let chart = boxes.entry(side).or_insert((Vec2::ONE, Vec2::ZERO));
        for corner in uv {
            *chart = (chart.0.min(corner), chart.1.max(corner));
        }
    }
    let first = area_ratio[0];
    assert!(
        area_ratio
            .iter()
            .all(|&r| r > 0.0 && (r / first - 1.0).abs() < 1e-3)
    );
    let charts: Vec<_> = boxes.into_values().collect();
    assert_eq!(charts.len(), 6);
    for (i, a) in charts.iter().enumerate() {
        assert!(a.0.min_element() > 0.0 && a.1.max_element() < 1.0);
        for b in &charts[..i] {
            let apart = a.0.cmpgt(b.1).any() || b.0.cmpgt(a.1).any();
            assert!(apart, "{a:?} and {b:?} overlap");
        }
    }
}

#[test]
fn boundary_of_a_block_is_closed_and_faces_outwards() {
    let (_, lattice) = block_of_cells(Vec3::new(3.0, 2.0, 1.0), [3, 2, 1]);
    let triangles = boundary_triangles(&lattice.tets);
    assert_eq!(triangles.len(), 2 * 2 * (3 * 2 + 3 + 2));
    assert!((volume_m3(&lattice.tets.particles, &triangles) - 6.0).abs() < 1e-5);
}

proptest! {
    #[test]
    fn embedding_reproduces_points_in_and_round_a_mesh(
        x in prop::array::uniform3(-1.0_f32..3.0),
    ) {
        let (_, lattice) = block_of_cells(Vec3::new(2.0, 1.0, 1.5), [4, 2, 3]);
        let point = Vec3::from(x);
        let embedding = embed(&lattice.tets, &[point]);
        let mut found = [Vec3::ZERO];
        embedding.apply(&lattice.tets.particles, &mut found);
        prop_assert!(found[0].distance(point) < 3e-6, "{found:?}");
        // The tetrahedron is the nearest one: the point of it nearest to x is as near as the box.
        let outside = point.clamp(Vec3::ZERO, Vec3::new(2.0, 1.0, 1.5)).distance(point);
        let reach = embedding.weights[0].iter().fold(0.0_f32, |m, &w| m.max(-w));
        prop_assert!(outside > 0.0 || reach < 1e-5, "weight {reach} inside");
        // Heights of the tetrahedra are at least a quarter, so a weight is at most 4 a metre out.
        prop_assert!(reach < 8.0 * outside + 1e-5, "weight {reach} at {outside} m");
    }
}
