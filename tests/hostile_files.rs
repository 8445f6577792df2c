//! Surface and tet files that are broken, cyclic, huge by their own claim, empty or random: each ends in a
//! mesh or in an error that names the file, never in a panic, a hang or a blow-up.

#[path = "support/tets.rs"]
mod tets;

use glam::{Vec2, Vec3};
use palpate::geom::export::{GlbMaterial, glb_bytes};
use palpate::geom::import::{
    ImportError, ImportOptions, ImportedSurface, ImportedTets, UvState, describe, read_parts,
    read_surface, read_tets, read_tets_bytes,
};
use palpate::geom::{SurfaceMesh, tet};
use proptest::prelude::*;
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};
use tets::cube as cube_of_tets;

/// A folder of its own for each test, gone when the test ends well.
struct Folder(PathBuf);

impl Folder {
    fn new() -> Self {
        static NEXT: AtomicU32 = AtomicU32::new(0);
        let number = NEXT.fetch_add(1, Ordering::Relaxed);
        let name = format!("palpate-hostile-{}-{number}", std::process::id());
        let folder = std::env::temp_dir().join(name);
        std::fs::create_dir_all(&folder).expect("the temporary folder can be written");
        Self(folder)
    }

    fn write(&self, name: &str, bytes: impl AsRef<[u8]>) -> PathBuf {
        let path = self.0.join(name);
        std::fs::write(&path, bytes).expect("the temporary folder can be written");
        path
    }

    fn read(&self, name: &str, bytes: impl AsRef<[u8]>) -> Result<ImportedSurface, ImportError> {
        read_surface(&self.write(name, bytes), &ImportOptions::default())
    }

    /// The message of the error that reading such a file gives.
    fn refusal(&self, name: &str, bytes: impl AsRef<[u8]>) -> String {
        let error = self.read(name, bytes).expect_err("the file is refused");
        let message = error.to_string();
        assert!(
            message.contains(name),
            "the message names the file: {message}"
        );
        message
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
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

/// A cube of side 1 m with its six faces side by side in the texture, so with seams.
fn cube() -> SurfaceMesh {
    let mut mesh = SurfaceMesh {
        points: (0..8)
            .map(|k| Vec3::new((k & 1) as f32, (k >> 1 & 1) as f32, (k >> 2) as f32))
            .collect(),
        ..SurfaceMesh::default()
    };
    let faces = [
        [0, 2, 3, 1],
        [4, 5, 7, 6],
        [0, 1, 5, 4],
        [2, 6, 7, 3],
        [0, 4, 6, 2],
        [1, 3, 7, 5],
    ];
    for (face, corners) in faces.into_iter().enumerate() {
        let first = mesh.point_of.len() as u32;
        mesh.point_of.extend(corners);
        let at = |x: f32, y: f32| Vec2::new((face as f32 + x) / 6.0, y);
        mesh.uvs
            .extend([at(0.0, 0.0), at(0.9, 0.0), at(0.9, 1.0), at(0.0, 1.0)]);
        mesh.triangles
            .extend([[0, 1, 2], [0, 2, 3]].map(|t| t.map(|k| first + k)));
    }
    mesh
}

fn cube_glb() -> Vec<u8> {
    let mesh = cube();
    let normals: Vec<Vec3> = mesh.points.iter().map(|&p| (p - 0.5).normalize()).collect();
    let material = GlbMaterial {
        name: "cube".to_owned(),
        roughness: 0.4,
        ..GlbMaterial::default()
    };
    glb_bytes(&mesh, &normals, &material)
}

/// `glb` with its JSON changed by `edit`.
fn with_json(glb: &[u8], edit: impl Fn(String) -> String) -> Vec<u8> {
    let length = u32::from_le_bytes(glb[12..16].try_into().unwrap()) as usize;
    let json = String::from_utf8(glb[20..20 + length].to_vec()).unwrap();
    let mut json = edit(json).into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let binary = &glb[20 + length..];
    let total = (20 + json.len() + binary.len()) as u32;
    let json_length = (json.len() as u32).to_le_bytes();
    [
        b"glTF\x02\0\0\0".as_slice(),
        &total.to_le_bytes(),
        &json_length,
        b"JSON",
        &json,
        binary,
    ]
    .concat()
}

/// A glTF of one triangle by data URI, with `patch` merged over its top-level keys.
fn gltf(patch: &str) -> String {
    let mut file: serde_json::Value = serde_json::from_str(
        r#"{
        "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0]}], "nodes": [{"mesh": 0}],
        "meshes": [{"name": "m", "primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}],
        "buffers": [{"byteLength": 36, "uri": "data:;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}]
        }"#,
    )
    .expect("the sample is JSON");
    let patch: serde_json::Map<_, _> = serde_json::from_str(patch).expect("the patch is JSON");
    for (key, value) in patch {
        file[key] = value;
    }
    file.to_string()
}

#[test]
fn written_cube_reads_back_with_its_seams_and_the_same_bytes_twice() {
    let surface = Folder::new()
        .read("cube.glb", cube_glb())
        .expect("the cube closes");
    assert_eq!(surface.uv, UvState::Usable);
    assert_eq!(surface.notes, Vec::<String>::new());
    let mesh = cube();
    assert_eq!(surface.mesh.point_of.len(), mesh.point_of.len());
    assert_eq!(surface.mesh.points.len(), 8);
    assert_eq!(surface.mesh.uvs, mesh.uvs);
    assert_eq!(surface.mesh.triangles, mesh.triangles);
    let place = |mesh: &SurfaceMesh, vertex: usize| mesh.points[mesh.point_of[vertex] as usize];
    for vertex in 0..mesh.point_of.len() {
        assert_eq!(place(&surface.mesh, vertex), place(&mesh, vertex));
    }
    assert_eq!(cube_glb(), cube_glb());
}

#[test]
fn glb_cut_short_anywhere_is_refused() {
    let (folder, glb) = (Folder::new(), cube_glb());
    for length in (0..glb.len()).step_by(7) {
        folder.refusal("cut.glb", &glb[..length]);
        // The same with a header that owns up to the cut: the chunks are then too short.
        if length >= 12 {
            let mut honest = glb[..length].to_vec();
            honest[8..12].copy_from_slice(&(length as u32).to_le_bytes());
            folder.refusal("cut.glb", honest);
        }
    }
}

#[test]
fn claim_of_four_billion_vertices_is_refused_unallocated() {
    let folder = Folder::new();
    for claim in ["4000000000", "18446744073709551615", "768614336404564651"] {
        let huge = with_json(&cube_glb(), |json| {
            json.replace(r#""count":24"#, &format!(r#""count":{claim}"#))
        });
        let message = folder.refusal("huge.glb", huge);
        assert!(
            message.contains("limit") || message.contains("fit"),
            "{message}"
        );
        // Sparse zeros are backed by no bytes at all.
        let sparse = gltf(&format!(
            r#"{{"accessors": [{{"componentType": 5126, "type": "VEC3", "count": {claim},
            "sparse": {{"count": 1, "indices": {{"bufferView": 0, "componentType": 5125}},
            "values": {{"bufferView": 0}}}}}}]}}"#
        ));
        folder.refusal("sparse.gltf", sparse);
    }
}

#[test]
fn mesh_repeated_by_many_nodes_is_refused_before_it_fills_the_memory() {
    // 24 vertices are nothing, but 800 000 nodes may ask for them again and again.
    let nodes = 800_000;
    let list = vec![r#"{"mesh":0}"#; nodes].join(",");
    let children = (0..nodes)
        .map(|k| k.to_string())
        .collect::<Vec<_>>()
        .join(",");
    let many = with_json(&cube_glb(), |json| {
        let json = json.replace(
            r#""nodes":[{"mesh":0,"name":"cube"}]"#,
            &format!(r#""nodes":[{list}]"#),
        );
        json.replace(
            r#""scenes":[{"nodes":[0]}]"#,
            &format!(r#""scenes":[{{"nodes":[{children}]}}]"#),
        )
    });
    assert!(Folder::new().refusal("many.glb", many).contains("limit"));
}

#[test]
fn position_that_is_not_a_number_is_named_with_mesh_primitive_and_vertex() {
    let mut glb = cube_glb();
    let start = glb.windows(4).position(|w| w == b"BIN\0").unwrap() + 4;
    for bad in [f32::NAN, f32::INFINITY] {
        glb[start + 12 * 5..start + 12 * 5 + 4].copy_from_slice(&bad.to_le_bytes());
        let message = Folder::new().refusal("nan.glb", &glb);
        assert!(
            message.contains("mesh `cube`, primitive 0: vertex 5"),
            "{message}"
        );
    }
}

#[test]
fn index_beyond_the_vertices_is_named() {
    let mut glb = cube_glb();
    let end = glb.len();
    glb[end - 4..].copy_from_slice(&24_u32.to_le_bytes());
    let message = Folder::new().refusal("index.glb", glb);
    assert!(
        message.contains("index 35 is 24 where there are 24 vertices"),
        "{message}"
    );
}

#[test]
fn node_graphs_that_are_no_forest_are_refused() {
    let folder = Folder::new();
    let cases = [
        (r#"{"nodes": [{"mesh": 0, "children": [0]}]}"#, "cycle"),
        (
            r#"{"nodes": [{"mesh": 0}, {"children": [2]}, {"children": [1]}]}"#,
            "cycle",
        ),
        (
            r#"{"nodes": [{"children": [2]}, {"children": [2]}, {"mesh": 0}]}"#,
            "two parents",
        ),
        (r#"{"scenes": [{"nodes": [0, 0]}]}"#, "twice"),
        (r#"{"scene": 7}"#, "scenes[7]"),
        (r#"{"nodes": [{"mesh": 3}]}"#, "meshes[3]"),
        (
            r#"{"nodes": [{"mesh": 0, "scale": [1e30, 1e30, 1e30]}]}"#,
            "not a number within",
        ),
    ];
    for (patch, said) in cases {
        let message = folder.refusal("graph.gltf", gltf(patch));
        assert!(message.contains(said), "{patch}: {message}");
    }
}

#[test]
fn chain_of_a_hundred_thousand_nodes_neither_overflows_nor_hangs() {
    let count = 100_000;
    let mut nodes: Vec<String> = (1..count)
        .map(|k| format!(r#"{{"children":[{k}]}}"#))
        .collect();
    nodes.push(r#"{"mesh":0}"#.to_owned());
    let chain = gltf(&format!(r#"{{"nodes": [{}]}}"#, nodes.join(",")));
    // One triangle is open, so a refusal as such is right: the mesh was reached.
    assert!(
        Folder::new()
            .refusal("chain.gltf", chain)
            .contains("3 border edges")
    );
}

#[test]
fn what_is_not_supported_is_refused_by_name() {
    let folder = Folder::new();
    let draco = r#"{"extensionsRequired": ["KHR_draco_mesh_compression"]}"#;
    assert!(
        folder
            .refusal("draco.gltf", gltf(draco))
            .contains("KHR_draco_mesh_compression")
    );
    assert!(
        folder
            .refusal("old.gltf", gltf(r#"{"asset": {"version": "1.0"}}"#))
            .contains("`1.0`")
    );
    assert!(
        folder
            .refusal("surface.stl", "solid")
            .contains(".glb, .gltf or .obj")
    );
}

#[test]
fn buffers_outside_the_folder_by_absolute_path_or_address_are_refused() {
    let folder = Folder::new();
    for uri in [
        "/dev/zero",
        "http://localhost/x.bin",
        "",
        "missing.bin",
        "%zz",
        "data:text/plain,abc",
    ] {
        let buffers = format!(r#"{{"buffers": [{{"byteLength": 36, "uri": "{uri}"}}]}}"#);
        folder.refusal("outside.gltf", gltf(&buffers));
    }
}

#[test]
fn strided_views_that_overlap_or_overrun_are_refused() {
    let folder = Folder::new();
    for view in [
        r#"{"buffer": 0, "byteLength": 36, "byteStride": 8}"#,
        r#"{"buffer": 0, "byteLength": 36, "byteStride": 16}"#,
        r#"{"buffer": 0, "byteLength": 36, "byteStride": 18446744073709551615}"#,
        r#"{"buffer": 0, "byteLength": 36, "byteOffset": 18446744073709551615}"#,
        r#"{"buffer": 1, "byteLength": 36}"#,
    ] {
        folder.refusal(
            "view.gltf",
            gltf(&format!(r#"{{"bufferViews": [{view}]}}"#)),
        );
    }
}

#[test]
fn sparse_values_replace_those_of_the_view() {
    // Three corners from the view; the second is then overridden by the bytes of the third.
    let folder = Folder::new();
    let text = gltf(
        r#"{"accessors": [{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3,
        "sparse": {"count": 1, "indices": {"bufferView": 1, "componentType": 5121},
        "values": {"bufferView": 0, "byteOffset": 24}}}],
        "bufferViews": [{"buffer": 0, "byteLength": 36}, {"buffer": 1, "byteLength": 1}],
        "buffers": [{"byteLength": 36,
        "uri": "data:;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"},
        {"byteLength": 1, "uri": "data:;base64,AQ=="}]}"#,
    );
    let file = read_parts(&folder.write("sparse.gltf", text)).expect("it holds a triangle");
    assert_eq!(file.parts[0].positions, [Vec3::ZERO, Vec3::Y, Vec3::Y]);
}

#[test]
fn mirrored_node_still_faces_outwards_without_a_repair() {
    let mirrored = with_json(&cube_glb(), |json| {
        json.replace(r#"{"mesh":0,"#, r#"{"mesh":0,"scale":[-1,2,1],"#)
    });
    let surface = Folder::new()
        .read("mirrored.glb", mirrored)
        .expect("the cube closes");
    assert!((surface.mesh.volume_m3() - 2.0).abs() < 1e-6);
    assert_eq!(surface.notes, Vec::<String>::new());
}

#[test]
fn obj_faults_are_named_by_line() {
    let folder = Folder::new();
    let cases = [
        ("v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 4\n", "line 4"),
        ("v 0 0 0\nf 1 1 0\n", "line 2"),
        ("v 0 0 0\nf -2 1 1\n", "line 2"),
        ("v 0 0\n", "line 1"),
        ("v 0 0 x\n", "line 1: `x`"),
        (
            "v 0 0 0\nf 1/1 1/1 1/1\n",
            "there are 0 texture coordinates",
        ),
        ("v 0 0 0\nf 1\n", "1 corners"),
        ("f 9223372036854775807 -9223372036854775808 1\n", "line 1"),
        ("v nan 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n", "vertex 0"),
        ("", "no mesh with triangles"),
        ("l 1 2\n", "no mesh with triangles"),
    ];
    for (text, said) in cases {
        let message = folder.refusal("bad.obj", text);
        assert!(message.contains(said), "{text:?}: {message}");
    }
}

#[test]
fn obj_polygons_negative_indices_and_missing_library_still_make_a_cube() {
    let folder = Folder::new();
    let text = "mtllib gone.mtl\nusemtl skin\no box\nv 0 0 0\nv 1 0 0\nv 1 1 0\nv 0 1 0\nv 0 0 1\nv 1 0 1\nv 1 1 1\nv 0 1 1\n\
                f 4 3 2 1\nf 5 6 7 8\nf 1 2 6 5\nf -5 -1 -2 -6\nf 1 5 8 4\nf 2 3 7 6\n";
    let surface = folder.read("box.obj", text).expect("the box closes");
    assert!((surface.mesh.volume_m3() - 1.0).abs() < 1e-6);
    assert_eq!(surface.uv, UvState::Missing);
    assert!(surface.notes.iter().any(|note| note.contains("gone.mtl")));
}

/// A picture of 40 x 30 pixels as PNG.
fn png() -> Vec<u8> {
    let mut bytes = std::io::Cursor::new(Vec::new());
    let color = |x, y| image::Rgb([x as u8, y as u8, 7]);
    let picture = image::RgbImage::from_fn(40, 30, color);
    picture
        .write_to(&mut bytes, image::ImageFormat::Png)
        .expect("memory takes it");
    bytes.into_inner()
}

#[test]
fn pictures_cut_short_or_claiming_billions_of_pixels_are_refused() {
    let folder = Folder::new();
    let check = |bytes: &[u8]| describe(&folder.write("picture.png", bytes));
    assert_eq!(
        check(&png()).unwrap(),
        "picture: 40 x 30 pixels, 3 channels of 8 bits"
    );
    // The last 12 bytes only say that the file ends.
    for length in (0..png().len() - 12).step_by(7) {
        let error = check(&png()[..length]).expect_err("the picture is refused");
        assert!(error.to_string().contains("picture.png"), "{error}");
    }
    let mut huge = png();
    huge[16..24].copy_from_slice(&[0x7f, 0xff, 0xff, 0xff, 0x7f, 0xff, 0xff, 0xff]);
    assert!(check(&huge).is_err());
    assert!(check(b"GIF89a").is_err());
}

#[test]
fn json_of_two_million_empty_nodes_is_refused_before_it_is_parsed() {
    let nodes = vec!["{}"; 2_000_000].join(",");
    let file = gltf("{}").replace(r#""nodes":[{"mesh":0}]"#, &format!(r#""nodes":[{nodes}]"#));
    assert!(
        Folder::new()
            .refusal("nodes.gltf", file)
            .contains("objects")
    );
}

#[test]
fn fin_of_a_thousand_layers_is_refused_and_does_not_hang() {
    // A strip of a thousand triangles that stands on an edge of the box is no small defect.
    let mut text =
        "v 0 0 0\nv 1 0 0\nv 0 1 0\nv 0 0 1\nf 1 3 2\nf 1 2 4\nf 2 3 4\nf 1 4 3\n".to_owned();
    text += "v 1 1 1\nf 1 2 5\n";
    for k in 0..1000 {
        let z = 1.0 + 0.01 * k as f32;
        text += &format!("v {} 1 {z}\nf -3 -2 -1\n", k % 2);
    }
    assert!(
        Folder::new()
            .refusal("fin.obj", text)
            .contains("more than two")
    );
}

proptest! {
    #![proptest_config(ProptestConfig { cases: 200, failure_persistence: None, ..ProptestConfig::default() })]

    #[test]
    fn random_bytes_end_in_an_error(bytes in prop::collection::vec(any::<u8>(), 0..300), kind in 0..3) {
        let folder = Folder::new();
        folder.refusal(["r.glb", "r.gltf", "r.obj"][kind as usize], bytes);
    }

    /// Changed bytes in a sound file may leave it sound; they must not do worse than an error.
    #[test]
    fn glb_with_changed_bytes_ends_in_a_surface_or_an_error(
        changes in prop::collection::vec((0..3000_usize, any::<u8>()), 1..6),
    ) {
        let mut glb = cube_glb();
        let length = glb.len();
        for (place, byte) in changes {
            glb[place % length] = byte;
        }
        let _ = Folder::new().read("changed.glb", glb);
    }
}

#[test]
fn conformance_files_end_as_expected() {
    let Some(folder) = shared("data/gltf-conformance") else {
        return;
    };
    let expected = std::fs::read_to_string(folder.join("expected.tsv")).expect("the list is there");
    let mut seen = 0;
    let mut wrong = Vec::new();
    for row in expected.lines().skip(1) {
        let mut fields = row.split('\t');
        let (file, outcome) = (fields.next().unwrap(), fields.next().unwrap());
        let path = folder.join(file);
        let start = Instant::now();
        let parts = read_parts(&path);
        let surface = read_surface(&path, &ImportOptions::default());
        // Seconds are no measure of speed here: anything near them would be a hang.
        assert!(
            start.elapsed() < Duration::from_secs(2),
            "{file} takes too long"
        );
        // "load" means the meshes; a single triangle is no closed surface and is refused as open.
        let fine = match outcome {
            "load" => parts.is_ok(),
            _ if outcome.starts_with("load with") => parts.is_ok(),
            _ if outcome.starts_with("load") || outcome.ends_with("or load") => true,
            _ => parts.is_err() && surface.is_err(),
        };
        if !fine {
            wrong.push(format!(
                "{file}: {outcome}, but {:?}",
                parts.map(|file| file.parts.len())
            ));
        }
        if let Err(error) = surface {
            println!("{outcome:40} {error}");
        }
        seen += 1;
    }
    assert_eq!(wrong, Vec::<String>::new());
    assert!(seen >= 80, "only {seen} files were listed");
}

#[test]
fn organs_close_with_their_known_volumes() {
    let Some(folder) = shared("data/organs") else {
        return;
    };
    let read = |name: &str| {
        let surface = read_surface(&folder.join(name), &ImportOptions::default());
        let surface = surface.unwrap_or_else(|error| panic!("{error}"));
        println!(
            "{name}: {:?} {:?} {:#?}",
            surface.uv, surface.meshes_used, surface.notes
        );
        let millilitres = surface.mesh.volume_m3() * 1e6;
        println!(
            "{} {} {millilitres}",
            surface.mesh.points.len(),
            surface.mesh.triangles.len()
        );
        (surface, millilitres)
    };
    let size = |s: &ImportedSurface| (s.mesh.points.len(), s.mesh.triangles.len());

    let (liver, volume) = read("VH_F_Liver.glb");
    assert_eq!(size(&liver), (16751, 33498));
    assert_eq!(liver.meshes_used.len(), 10);
    assert!((volume - 2134.8).abs() < 0.1);

    let (heart, volume) = read("VH_F_Heart.glb");
    assert_eq!(heart.meshes_used, ["VH_F_left_ventricle"]);
    assert!((volume - 229.3).abs() < 0.1);

    let (spleen, volume) = read("VH_F_Spleen.glb");
    assert_eq!(size(&spleen), (4274, 8544));
    assert_eq!(spleen.uv, UvState::Usable);
    assert!((volume - 190.7).abs() < 0.1);

    let (gallbladder, _) = read("VH_M_Gallbladder.glb");
    assert_eq!(size(&gallbladder), (997, 1990));
    assert_eq!(gallbladder.uv, UvState::Usable);

    let (smooth, _) = read("liver-smooth.obj");
    assert_eq!(size(&smooth), (2194, 4384));
    assert_eq!(smooth.uv, UvState::Missing);

    let (overlapping, _) = read("liver-smoothUV.obj");
    assert_eq!(size(&overlapping), (2194, 4384));
    assert_eq!(overlapping.mesh.point_of.len(), 5712);
    assert!(matches!(overlapping.uv, UvState::Overlapping { .. }));

    let (head, _) = read("../textured-head/LeePerrySmith_decoded.glb");
    assert_eq!(head.uv, UvState::Usable);
    assert!(head.mesh.triangles.len() > 17_600);
    assert!(head.base_color.is_some());
    println!(
        "{}",
        describe(&folder.join("../textured-head/LeePerrySmith_decoded.glb")).unwrap()
    );
}

#[test]
fn meshes_can_be_chosen_by_name_and_unknown_names_list_the_known() {
    let Some(liver) = shared("data/organs/VH_F_Liver.glb") else {
        return;
    };
    let named = |names: &[&str]| ImportOptions {
        meshes: Some(names.iter().map(|&name| name.to_owned()).collect()),
    };
    let surface = read_surface(&liver, &named(&["segment", "Lobe"])).expect("they close");
    assert_eq!(surface.mesh.triangles.len(), 33498);
    let shell = read_surface(&liver, &named(&["capsule", "bare"])).expect("they close");
    assert_eq!(shell.meshes_used.len(), 2);
    let error = read_surface(&liver, &named(&["pancreas"])).expect_err("there is none");
    assert!(error.to_string().contains("VH_F_caudate_lobe"), "{error}");
}

/// Reads tetrahedra from `bytes`; a refusal names the file and says something.
fn read_tetrahedra(bytes: &[u8]) -> Option<ImportedTets> {
    match read_tets_bytes(Path::new("hostile.msh"), bytes) {
        Ok(imported) => {
            assert_partition(&imported);
            Some(imported)
        }
        Err(error) => {
            let message = error.to_string();
            assert!(message.starts_with("hostile.msh: "), "{message}");
            assert!(message.len() < 1000, "{message}");
            None
        }
    }
}

/// What a simulation relies on: finite places, corners in range, positive volumes, none unused.
fn assert_partition(imported: &ImportedTets) {
    let mesh = &imported.mesh;
    assert!(!mesh.tets.is_empty());
    assert!(mesh.particles.iter().all(|x| x.is_finite()));
    let mut used = vec![false; mesh.particles.len()];
    for (tet, corners) in mesh.tets.iter().enumerate() {
        assert!(tet::volume_m3(tet::corners(mesh, tet)) > 0.0);
        for &corner in corners {
            used[corner as usize] = true;
        }
    }
    assert!(used.iter().all(|&used| used));
}

#[test]
fn tetrahedra_cut_short_anywhere_are_refused() {
    for (format, text) in cube_of_tets().formats() {
        assert!(read_tetrahedra(text.as_bytes()).is_some());
        // Only the end of the last line may be missing.
        for length in 0..text.trim_end().len() {
            let cut = read_tetrahedra(&text.as_bytes()[..length]);
            assert!(cut.is_none(), "{format} after {length} bytes");
        }
    }
}

#[test]
fn claim_of_four_billion_nodes_or_tetrahedra_is_refused_unallocated() {
    let start = Instant::now();
    for claim in ["4000000000", "18446744073709551615", "99999999999999999999"] {
        for (format, text) in cube_of_tets().formats() {
            for section in ["NOD", "Nodes", "ELM", "Elements"] {
                let head = format!("${section}\n");
                let Some(at) = text.find(&head).map(|at| at + head.len()) else {
                    continue;
                };
                let line = text[at..].lines().next().expect("a section has a line");
                // Each number of the line is a count or a bound.
                for k in 0..line.split(' ').count() {
                    let words: Vec<&str> = (line.split(' ').enumerate())
                        .map(|(word, text)| if word == k { claim } else { text })
                        .collect();
                    let huge = format!(
                        "{}{}{}",
                        &text[..at],
                        words.join(" "),
                        &text[at + line.len()..]
                    );
                    let is_count = format != "Gmsh 4.1" || k < 2;
                    assert_eq!(read_tetrahedra(huge.as_bytes()).is_none(), is_count);
                }
            }
        }
    }
    assert!(start.elapsed() < Duration::from_secs(20), "no hang");
}

proptest! {
    #![proptest_config(ProptestConfig::with_cases(400))]

    /// Bytes changed, cut out or doubled anywhere end in a sound mesh or in a refusal.
    #[test]
    fn damaged_tetrahedra_neither_panic_nor_pass_unsound(
        format in 0_usize..3,
        damages in prop::collection::vec((any::<prop::sample::Index>(), any::<u8>(), 0_u8..5), 1..6),
    ) {
        let mut bytes = cube_of_tets().formats()[format].1.clone().into_bytes();
        for (at, byte, kind) in damages {
            let at = at.index(bytes.len());
            match kind {
                0 => bytes[at] = byte,
                1 => { bytes.remove(at); }
                2 => bytes.insert(at, b"0123456789-+.eE$\n "[byte as usize % 18]),
                3 => bytes[at] = b'0' + byte % 10,
                _ => {
                    let end = (at + byte as usize).min(bytes.len());
                    let doubled = bytes[at..end].to_vec();
                    bytes.splice(at..at, doubled);
                }
            }
        }
        read_tetrahedra(&bytes);
    }

    #[test]
    fn random_words_are_no_tetrahedra(words in prop::collection::vec(0_usize..16, 0..80)) {
        const WORDS: [&str; 16] = [
            "$MeshFormat\n2.2 0 8\n$EndMeshFormat\n", "$Nodes\n", "$EndNodes\n", "$Elements\n",
            "$EndElements\n", "1 ", "2 ", "4 ", "5 ", "0 ", "\n", "3 ", "-1 ", "1e39 ",
            "$MeshFormat\n4.1 0 8\n$EndMeshFormat\n", "8 ",
        ];
        let text: String = words.iter().map(|&word| WORDS[word]).collect();
        read_tetrahedra(text.as_bytes());
    }
}

#[test]
fn a_folder_or_an_endless_file_is_no_mesh_of_tetrahedra() {
    let folder = Folder::new();
    assert!(read_tets(&folder.0).is_err());
    assert!(read_tets(Path::new("/dev/zero")).is_err());
    assert!(read_tets(&folder.0.join("missing.msh")).is_err());
}
