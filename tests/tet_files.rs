//! Tetrahedra from Gmsh files: every format, what is mended, what is refused, and the facts of real
//! files.

#[path = "support/tets.rs"]
mod tets;

use glam::{DVec3, Vec3};
use palpate::geom::import::{ImportedTets, describe, read_tets, read_tets_bytes};
use palpate::geom::tet::{self, skin};
use palpate::geom::{TetMesh, export, lattice, volume_m3};
use proptest::prelude::*;
use std::path::{Path, PathBuf};
use tets::{Written, cube};

fn read(text: impl AsRef<[u8]>) -> Result<ImportedTets, String> {
    read_tets_bytes(Path::new("my.msh"), text.as_ref()).map_err(|error| error.to_string())
}

fn sound(text: impl AsRef<[u8]>) -> ImportedTets {
    read(text).expect("the mesh is sound")
}

/// The message of a refusal, which names the file.
fn refusal(text: impl AsRef<[u8]>) -> String {
    let message = read(text).expect_err("the mesh is refused");
    assert!(message.starts_with("my.msh: "), "{message}");
    message
}

fn volumes(mesh: &TetMesh) -> Vec<f64> {
    (0..mesh.tets.len())
        .map(|tet| tet::volume_m3(tet::corners(mesh, tet)))
        .collect()
}

/// Volume inside the triangles of the skin, which are outward if it is that of the tetrahedra.
fn skin_volume_m3(mesh: &TetMesh) -> f64 {
    let skin = skin(mesh);
    let points: Vec<Vec3> = (skin.particles.iter())
        .map(|&particle| mesh.particles[particle as usize])
        .collect();
    volume_m3(&points, &skin.triangles)
}

fn all_notes(imported: &ImportedTets) -> String {
    imported.notes.join("\n")
}

#[test]
fn one_mesh_reads_the_same_from_every_format() {
    for (format, text) in cube().formats() {
        let imported = sound(&text);
        assert_eq!(imported.format, format);
        assert_eq!(imported.notes, Vec::<String>::new(), "{format}");
        assert_eq!(imported.mesh.particles.len(), 8);
        assert_eq!(imported.mesh.particles[6], Vec3::new(0.0, 1.0, 1.0));
        assert_eq!(imported.mesh.tets[1], [1, 3, 0, 5], "{format}");
        assert!((volumes(&imported.mesh).iter().sum::<f64>() - 1.0).abs() < 1e-12);
    }
}

#[test]
fn line_ends_blank_lines_comments_and_unknown_sections_change_nothing() {
    for (format, text) in cube().formats() {
        let plain = sound(&text);
        let foreign = "$Comments\nnot 1 number, and $ signs\n$EndComments\n$PhysicalNames\n1\n\
                       3 1 \"liver\"\n$EndPhysicalNames\n";
        let head = if format == "Gmsh 1" { "$NOD" } else { "$Nodes" };
        let decorated = text
            .replace(head, &format!("{foreign}\na line between sections\n{head}"))
            .replace("\n10 ", "\n\n  # a comment\n// another\n10 ");
        for variant in [
            decorated.clone(),
            decorated.replace('\n', "\r\n"),
            text.replace('\n', "  \r\n\r\n"),
            text.replace(' ', "\t  "),
            format!("\u{feff}{text}"),
            text.trim_end().to_owned(),
        ] {
            assert_eq!(sound(&variant).mesh, plain.mesh, "{format}:\n{variant}");
        }
    }
}

#[test]
fn particles_are_the_nodes_in_the_order_of_the_file_without_the_unused() {
    let mut written = cube();
    written.nodes.reverse();
    written.nodes.insert(2, (7, [9.0, 9.0, 9.0]));
    written.nodes.push((4_000_000_000, [0.5, 0.5, 0.5]));
    // A triangle that is passed over does not make a node used.
    written.elements.push((6, 2, vec![7, 10, 20]));
    for (format, text) in written.formats() {
        let imported = sound(text);
        assert_eq!(imported.ignored, 1, "{format}");
        assert_eq!(imported.mesh.particles.len(), 8);
        assert_eq!(imported.mesh.particles[0], Vec3::ONE, "{format}");
        assert_eq!(imported.mesh.particles[2], Vec3::new(1.0, 0.0, 1.0));
        assert_eq!(imported.mesh.tets[0], [7, 4, 1, 2]);
        assert_eq!(
            imported.notes,
            ["2 nodes of no tetrahedron left out: 7, 4000000000"],
            "{format}"
        );
    }
}

#[test]
fn inverted_tetrahedra_are_mended_and_named_by_number_and_line() {
    let right = sound(cube().format_2());
    let mut written = cube();
    written.elements[2].2.swap(0, 1);
    let imported = sound(written.format_2());
    assert!(volumes(&imported.mesh).iter().all(|&v| v > 0.0));
    assert_eq!(skin_volume_m3(&imported.mesh), skin_volume_m3(&right.mesh));
    let notes = all_notes(&imported);
    assert!(notes.contains("1 inverted"), "{notes}");
    assert!(notes.contains("number 3 (line 19)"), "{notes}");

    for (_, _, nodes) in &mut written.elements {
        nodes.swap(2, 3);
    }
    written.elements[2].2.swap(0, 1);
    let imported = sound(written.format_2());
    assert_eq!(volumes(&imported.mesh), volumes(&right.mesh));
    assert!(all_notes(&imported).contains("all tetrahedra"));
}

/// Two tetrahedra that share the face 0 1 2, with their apexes at heights `first` and `second`.
fn two_on_a_face(first: f64, second: f64) -> Written {
    let places = [
        [0.0, 0.0, 0.0],
        [1.0, 0.0, 0.0],
        [0.0, 1.0, 0.0],
        [0.2, 0.2, first],
        [0.3, 0.2, second],
    ];
    Written::of_tets(&places, &[[0, 1, 2, 3], [0, 2, 1, 4]])
}

#[test]
fn a_tetrahedron_folded_through_its_neighbour_is_refused_by_name() {
    sound(two_on_a_face(1.0, -1.0).format_2());
    // Turning its corners makes the second positive, but it lies where the first is.
    let message = refusal(two_on_a_face(1.0, 0.5).format_2());
    assert!(message.contains("number 1 (line 14)"), "{message}");
    assert!(message.contains("number 2 (line 15)"), "{message}");
    assert!(message.contains("same side"), "{message}");
}

#[test]
fn a_face_of_three_tetrahedra_is_refused_by_name() {
    let mut written = two_on_a_face(1.0, -1.0);
    written.nodes.push((6, [0.2, 0.3, -2.0]));
    written.elements.push((9, 4, vec![1, 3, 2, 6]));
    let message = refusal(written.format_2());
    assert!(message.contains("3 tetrahedra share one face"), "{message}");
    assert!(message.contains("number 9"), "{message}");
}

#[test]
fn flat_tetrahedra_are_left_out_by_number_and_nothing_but_flat_ones_is_refused() {
    let mut written = two_on_a_face(1.0, -1.0);
    written.nodes.push((6, [1.0, 1.0, 0.0]));
    written.elements.push((44, 4, vec![2, 3, 1, 6]));
    let imported = sound(written.format_2());
    assert_eq!(imported.mesh.tets.len(), 2);
    let notes = all_notes(&imported);
    assert!(
        notes.contains("1 flat tetrahedra left out: number 44"),
        "{notes}"
    );
    assert!(notes.contains("1 nodes of no tetrahedron"), "{notes}");

    written.elements.drain(..2);
    assert!(refusal(written.format_2()).contains("flat"));
    assert!(refusal(two_on_a_face(0.0, 0.0).format_4()).contains("flat"));
}

#[test]
fn a_sliver_is_kept_and_reported_with_its_number() {
    let imported = sound(two_on_a_face(1.0, -0.001).format_2());
    assert_eq!(imported.quality.slivers, 1);
    let notes = all_notes(&imported);
    assert!(notes.contains("slivers"), "{notes}");
    assert!(notes.contains("number 2 (line 15)"), "{notes}");
}

#[test]
fn copies_separate_parts_and_coincident_nodes_are_told() {
    // The same element once for each of two physical groups.
    let mut written = cube();
    written.elements.push((77, 4, vec![60, 70, 40, 10]));
    let imported = sound(written.format_2());
    assert_eq!(imported.mesh.tets.len(), 5);
    assert!(all_notes(&imported).contains("1 tetrahedra with the corners of another"));

    let tet = |at: f64| {
        [
            [at, 0.0, 0.0],
            [at + 1.0, 0.0, 0.0],
            [at, 1.0, 0.0],
            [at, 0.0, 1.0],
        ]
    };
    let apart = [tet(0.0), tet(1.0)].concat();
    let imported = sound(Written::of_tets(&apart, &[[0, 1, 2, 3], [4, 5, 6, 7]]).format_1());
    assert_eq!(imported.parts, 2);
    let notes = all_notes(&imported);
    assert!(notes.contains("2 parts"), "{notes}");
    assert!(notes.contains("1 nodes lie exactly where"), "{notes}");
}

/// A grid of hexahedra over (column, row, layer) nodes at `place`; columns close into a ring.
fn ring_of_hexahedra(columns: u64, place: impl Fn(u64, u64, u64) -> [f64; 3]) -> Written {
    let (rows, layers) = (3, 2);
    let number = |i: u64, j: u64, k: u64| 1 + (i % columns) + columns * (j + rows * k);
    let mut written = Written {
        nodes: Vec::new(),
        elements: Vec::new(),
    };
    for k in 0..layers {
        for j in 0..rows {
            for i in 0..columns {
                written.nodes.push((number(i, j, k), place(i, j, k)));
            }
        }
    }
    for j in 0..rows - 1 {
        for i in 0..columns {
            let base = [(i, j), (i, j + 1), (i + 1, j + 1), (i + 1, j)];
            let corners = [0, 1]
                .iter()
                .flat_map(|&k| base.map(|(i, j)| number(i, j, k)))
                .collect();
            let element = written.elements.len() as u64 + 1;
            written.elements.push((element, 5, corners));
        }
    }
    written
}

#[test]
fn hexahedra_are_cut_so_that_their_faces_meet_whatever_way_they_close() {
    // Round a ring of an even number of cells five tetrahedra do, round an odd one six.
    for (columns, each) in [(8, 5), (7, 6)] {
        let written = ring_of_hexahedra(columns, |i, j, k| {
            let angle = std::f64::consts::TAU * i as f64 / columns as f64;
            let radius = 1.0 + j as f64;
            [radius * angle.cos(), radius * angle.sin(), k as f64]
        });
        for (format, text) in written.formats() {
            let imported = sound(text);
            let mesh = &imported.mesh;
            assert_eq!(mesh.tets.len() as u64, each * 2 * columns, "{format}");
            assert_eq!(
                imported.notes,
                [format!(
                    "{} hexahedra cut into {each} tetrahedra each",
                    2 * columns
                )]
            );
            // Faces that did not meet would be boundary, and the Euler number not a torus's 0.
            let skin = skin(mesh);
            assert_eq!(skin.triangles.len() as u64, 2 * columns * (2 + 2 + 1 + 1));
            assert_eq!(skin.euler_number(), 0);
            // Between the prisms over two regular polygons.
            let sector = 0.5 * (std::f64::consts::TAU / columns as f64).sin();
            let expected = columns as f64 * sector * (9.0 - 1.0);
            assert!((skin_volume_m3(mesh) / expected - 1.0).abs() < 1e-6);
        }
    }
}

#[test]
fn a_mesh_far_from_the_origin_keeps_its_shape_and_is_moved_there() {
    let near = sound(two_on_a_face(1.0, -1.0).format_2()).mesh;
    let mut written = two_on_a_face(1.0, -1.0);
    for (_, place) in &mut written.nodes {
        // A round number of f64: what is lost is lost by this program. f32 has sixteenths there.
        *place = [
            0.03125 * place[0] + 1048576.0,
            0.03125 * place[1],
            0.03125 * place[2],
        ];
    }
    let far = sound(written.format_2());
    let edges = |mesh: &TetMesh| -> Vec<Vec3> {
        mesh.particles
            .iter()
            .map(|&x| x - mesh.particles[0])
            .collect()
    };
    for (a, b) in edges(&near).into_iter().zip(edges(&far.mesh)) {
        assert!((0.03125 * a - b).length() < 1e-8, "{a} and {b}");
    }
    assert!(
        all_notes(&far).contains("from the origin"),
        "{}",
        all_notes(&far)
    );
    assert!(far.mesh.particles.iter().all(|x| x.length() < 0.1));
}

#[test]
fn names_of_any_length_leave_a_message_of_one_line() {
    for start in ["", "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n"] {
        for name in ["A", "End", "Nodes"] {
            let message = refusal(format!("{start}${name}{}", "A".repeat(1_000_000)));
            assert!(message.len() < 300, "{}", message.len());
        }
    }
    let message = refusal(
        cube()
            .format_2()
            .replace("2.2 0 8", &format!("{} 0 8", "2".repeat(100_000))),
    );
    assert!(message.len() < 300, "{}", message.len());
    let message = refusal(cube().format_2().replacen(
        "$EndNodes",
        &format!("${}", "E".repeat(100_000)),
        1,
    ));
    assert!(message.len() < 300, "{}", message.len());
}

#[test]
fn what_is_not_read_is_refused_by_name_with_what_to_do() {
    let with_type = |number: u64, nodes: usize| {
        let mut written = cube();
        let corners = (0..nodes).map(|k| 10 * (k as u64 % 8 + 1)).collect();
        written.elements.push((6, number, corners));
        written.format_2()
    };
    for (text, named) in [
        (with_type(11, 10), "second order"),
        (with_type(6, 6), "prisms"),
        (with_type(7, 5), "pyramids"),
        (with_type(17, 20), "hexahedra of second order"),
        (with_type(92, 64), "element type 92"),
        (with_type(5, 8), "hexahedra beside tetrahedra"),
        (
            cube().format_2().replace("2.2 0 8", "2.2 1 8\n\u{1}"),
            "binary",
        ),
        (cube().format_4().replace("4.1 0", "4 0"), "version `4`"),
        (
            cube().format_2().replace("$Nodes", "$ParametricNodes"),
            "$ParametricNodes",
        ),
    ] {
        let message = refusal(&text);
        assert!(message.contains(named), "{named}: {message}");
        assert!(message.contains("not supported; "), "{message}");
    }
}

#[test]
fn what_is_wrong_is_refused_with_its_line_and_the_word() {
    let text = cube().format_2();
    let cases = [
        ("\n30 0 1 0", "\n30 0 nan 0", "line 8", "NaN"),
        ("\n30 0 1 0", "\n30 0 inf 0", "line 8", "inf"),
        ("\n30 0 1 0", "\n30 0 1e300 0", "line 8", "±1e9"),
        ("\n30 0 1 0", "\n30 0 1", "line 8", "z is missing"),
        ("\n30 0 1 0", "\n30 0 one 0", "line 8", "`one`"),
        ("\n30 0 1 0", "\n20 0 1 0", "line 8", "node 20"),
        ("\n30 0 1 0", "\n-3 0 1 0", "line 8", "`-3`"),
        ("\n30 0 1 0", "", "line 13", "$EndNodes"),
        ("$Nodes\n8", "$Nodes\n7", "line 13", "should end"),
        ("$Nodes\n8", "$Nodes\n9", "line 14", "$EndNodes"),
        ("$Nodes\n8", "$Nodes\n4000000000", "line 5", "4000000000"),
        ("$Nodes\n8", "$Nodes\n-1", "line 5", "`-1`"),
        ("1 4 2 1 1 10", "1 4 2 1 1 11", "line 17", "node 11"),
        ("1 4 2 1 1 10", "1 4 2 1 1 40", "line 17", "node 40 twice"),
        ("1 4 2 1 1 10", "1 4 2 1 1", "line 17", "corner 4"),
        ("1 4 2 1 1 10", "1 4 2 1 1 10 20", "line 17", "has 5"),
        ("1 4 2 1 1 10", "1 4 99999999999 10", "line 17", "a tag"),
        ("$Elements", "$Elemente", "line 22", "cut short"),
        ("$EndElements\n", "", "line 21", "cut short"),
        ("$EndNodes", "$EndNodes\n$Nodes", "line 15", "second"),
        (
            "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n",
            "",
            "line 1",
            "$MeshFormat",
        ),
        ("$Elements", "$ELM", "line 15", "mixed"),
        ("$Nodes", "$EndNodes", "line 4", "not open"),
    ];
    for (good, bad, place, word) in cases {
        assert!(text.contains(good), "{good}");
        let message = refusal(text.replacen(good, bad, 1));
        assert!(
            message.contains(place) && message.contains(word),
            "{good} -> {bad}: {message}"
        );
    }
    for empty in [
        "",
        "\n\n",
        "solid cube",
        "$MeshFormat",
        "$NOD\n0\n$ENDNOD\n",
    ] {
        refusal(empty);
    }
    let (nodes_only, _) = text.split_once("$Elements").expect("it has elements");
    assert!(refusal(nodes_only).contains("no section $Elements"));
    let surface_only = cube().format_2().replace(" 4 2 1 1 ", " 2 2 1 1 ");
    assert!(refusal(surface_only).contains("neither tetrahedra nor hexahedra"));
}

#[test]
fn a_description_says_what_the_file_holds_a_line_a_fact() {
    let folder = std::env::temp_dir().join(format!("palpate-describe-{}", std::process::id()));
    std::fs::create_dir_all(&folder).expect("a temporary folder");
    let path = folder.join("cube.msh");
    let mut written = cube();
    written.elements.push((6, 2, vec![10, 20, 30]));
    written.elements[1].2.swap(0, 1);
    std::fs::write(&path, written.format_4()).expect("it can be written");
    let text = describe(&path).expect("it is sound");
    std::fs::remove_dir_all(&folder).expect("it can be removed");
    for fact in [
        "format: Gmsh 4.1",
        "tetrahedra: 5 on 8 nodes, 1 part(s)",
        "extent: 1 x 1 x 1 m, volume 1.000000e0 m³",
        "quality: radius ratio 3r/R 0.732 in the median, 7.321e-1 at worst; 0 slivers",
        "boundary: 8 vertices, 12 triangles, Euler number 2",
        "passed over: 1 points, lines and faces",
        "note: 1 inverted tetrahedra mended by swapping two corners: number 2",
    ] {
        assert!(text.contains(fact), "{fact}:\n{text}");
    }
}

#[test]
fn a_tetrahedral_mesh_reads_back_as_it_was_written() {
    let (_, block) = lattice::block_of_cells(Vec3::new(0.3, 0.1, 0.07), [4, 2, 3]);
    let imported = sound(export::msh_bytes(&block.tets));
    assert_eq!(imported.mesh, block.tets);
    assert_eq!(imported.notes, Vec::<String>::new());
}

/// Every order of four corners.
fn orders() -> Vec<[usize; 4]> {
    (0..256)
        .map(|k| [k & 3, k >> 2 & 3, k >> 4 & 3, k >> 6])
        .filter(|order| (0..4).all(|corner| order.contains(&corner)))
        .collect()
}

proptest! {
    /// Whatever order the corners of each tetrahedron have, and wherever the body lies, the same
    /// tetrahedra come out, positive, with the same skin.
    #[test]
    fn the_order_of_corners_in_the_file_does_not_matter(
        picks in prop::collection::vec(0_usize..24, 60),
        scale in 1e-3_f32..1e2,
        shift in prop::array::uniform3(-3.0_f32..3.0),
    ) {
        let (_, mut block) = lattice::block_of_cells(Vec3::ONE, [3, 2, 2]);
        for x in &mut block.tets.particles {
            *x = scale * (*x + Vec3::from(shift));
        }
        let mut shuffled = block.tets.clone();
        for (tet, pick) in shuffled.tets.iter_mut().zip(&picks) {
            *tet = orders()[*pick].map(|corner| tet[corner]);
        }
        let imported = sound(export::msh_bytes(&shuffled));
        prop_assert!(volumes(&imported.mesh).iter().all(|&v| v > 0.0));
        let sorted = |mesh: &TetMesh| {
            let mut tets = mesh.tets.clone();
            tets.iter_mut().for_each(|tet| tet.sort_unstable());
            tets
        };
        prop_assert_eq!(sorted(&imported.mesh), sorted(&block.tets));
        let whole: f64 = volumes(&block.tets).iter().sum();
        // Triangles far from the origin: f32 places in f64 sums.
        prop_assert!((skin_volume_m3(&imported.mesh) / whole - 1.0).abs() < 1e-9);
    }
}

/// The folder of shared data, or `None` with a line that says so.
fn shared(inside: &str) -> Option<PathBuf> {
    let default = || Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared");
    let root = std::env::var_os("PALPATE_SHARED").map_or_else(default, PathBuf::from);
    let path = root.join(inside);
    if !path.exists() {
        println!(
            "{} is absent; set PALPATE_SHARED to test against it",
            path.display()
        );
        return None;
    }
    Some(path)
}

/// What is known of a file from other programs.
struct Facts {
    file: &'static str,
    nodes: usize,
    tets: usize,
    volume: f64,
    boundary: (usize, usize, i64),
    /// Radius ratio, smallest and median, to two digits.
    quality: (f64, f64),
}

#[test]
fn real_files_hold_what_other_programs_found_in_them() {
    let Some(folder) = shared("data/tets") else {
        return;
    };
    for facts in [
        Facts {
            file: "liver.msh",
            nodes: 181,
            tets: 596,
            volume: 36.5609,
            boundary: (140, 276, 2),
            quality: (0.017, 0.65),
        },
        Facts {
            file: "liver2.msh",
            nodes: 507,
            tets: 1493,
            volume: 1.12509,
            boundary: (432, 860, 2),
            quality: (0.16, 0.67),
        },
        Facts {
            file: "torus_low_res.msh",
            nodes: 264,
            tets: 862,
            volume: 8.21691,
            boundary: (204, 408, 0),
            quality: (0.22, 0.78),
        },
        Facts {
            file: "msh4_cube.msh",
            nodes: 14,
            tets: 24,
            volume: 1.0,
            boundary: (14, 24, 2),
            quality: (0.80, 0.80),
        },
    ] {
        let path = folder.join(facts.file);
        println!("{}\n{}", facts.file, describe(&path).expect("it is sound"));
        let imported = read_tets(&path).expect("it is sound");
        let mesh = &imported.mesh;
        assert_eq!(mesh.particles.len(), facts.nodes, "{}", facts.file);
        assert_eq!(mesh.tets.len(), facts.tets, "{}", facts.file);
        let volume: f64 = volumes(mesh).iter().sum();
        // Six digits are told; places are f32.
        assert!(
            (volume / facts.volume - 1.0).abs() < 3e-6,
            "{}: {volume}",
            facts.file
        );
        assert!((skin_volume_m3(mesh) / volume - 1.0).abs() < 1e-9);
        let skin = skin(mesh);
        let boundary = (
            skin.particles.len(),
            skin.triangles.len(),
            skin.euler_number(),
        );
        assert_eq!(boundary, facts.boundary, "{}", facts.file);
        let (worst, median) = facts.quality;
        assert!((imported.quality.worst - worst).abs() < 0.006);
        assert!((imported.quality.median - median).abs() < 0.006);
    }
}

#[test]
fn the_one_inverted_tetrahedron_of_six_is_mended() {
    let Some(path) = shared("data/tets/6_tetra_bad.msh") else {
        return;
    };
    let imported = read_tets(&path).expect("it can be mended");
    assert_eq!(imported.mesh.tets.len(), 6);
    assert_eq!(imported.mesh.particles.len(), 17);
    let notes = all_notes(&imported);
    println!("{notes}");
    assert!(notes.contains("1 inverted"), "{notes}");
    assert!(volumes(&imported.mesh).iter().all(|&v| v > 0.0));
}

#[test]
fn the_phantom_beam_of_hexahedra_has_the_volume_of_its_scan() {
    let Some(folder) = shared("data/phantom-beam") else {
        return;
    };
    let path = folder.join("beam_rest_hexa.msh");
    println!("{}", describe(&path).expect("it is sound"));
    let imported = read_tets(&path).expect("it is sound");
    assert_eq!(imported.mesh.particles.len(), 5740);
    assert_eq!(imported.mesh.tets.len(), 5 * 4920);
    assert_eq!(skin(&imported.mesh).euler_number(), 2);
    // The scanned surface holds 201 mL; the hexahedra round it off a little.
    let volume: f64 = volumes(&imported.mesh).iter().sum();
    assert!((volume / 201e-6 - 1.0).abs() < 0.02, "{volume}");
    let low = imported.mesh.particles.iter().map(|x| x.as_dvec3());
    let low = low.fold(DVec3::INFINITY, DVec3::min);
    assert!(low.z.abs() < 1e-9);
}

#[test]
fn the_meshes_of_the_comparison_hold_the_tetrahedra_they_were_made_with() {
    let Some(folder) = shared("peers/solver/meshes") else {
        return;
    };
    for (file, nodes, tets, slivers) in [
        ("beam_1k.msh", 396, 1250, false),
        ("beam_10k.msh", 2541, 10_000, false),
        ("beam_1k_sliver.msh", 396, 1250, true),
        ("organ_5k.msh", 1331, 5000, true),
    ] {
        let imported = read_tets(&folder.join(file)).expect("it is sound");
        assert_eq!(imported.mesh.particles.len(), nodes, "{file}");
        assert_eq!(imported.mesh.tets.len(), tets, "{file}");
        println!("{file}: {:?}", imported.quality);
        assert_eq!(imported.quality.slivers > 0, slivers, "{file}");
        assert_eq!(imported.parts, 1);
    }
}
