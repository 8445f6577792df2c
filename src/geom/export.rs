//! Surfaces as GLB files: the bytes depend on the surface and the material alone. Tetrahedra as Gmsh files.

mod gmsh;

pub use gmsh::msh_bytes;

use super::{SurfaceMesh, bounds};
use glam::Vec3;
use serde_json::{Value, json};

const FLOAT: u32 = 5126;
const UNSIGNED_INT: u32 = 5125;
const ARRAY_BUFFER: u32 = 34962;
const ELEMENT_ARRAY_BUFFER: u32 = 34963;

/// The one material of a written surface. Pictures are named, not stored.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct GlbMaterial {
    /// Name of the material and of the mesh.
    pub name: String,
    /// URI of the base colour picture, relative to the GLB.
    pub base_color: Option<String>,
    /// URI of the tangent-space normal map, relative to the GLB.
    pub normal_map: Option<String>,
    /// Perceptual roughness of the surface, 0 to 1.
    pub roughness: f32,
}

/// `mesh` as a binary glTF 2.0 file: positions [m], normals, texture coordinates and indices, one
/// vertex a [`SurfaceMesh`] vertex.
///
/// `normals` has one unit vector a point.
///
/// # Panics
///
/// If `mesh` is empty, if `normals` has another length than its points, or if the file would pass
/// 4 GiB.
pub fn glb_bytes(mesh: &SurfaceMesh, normals: &[Vec3], material: &GlbMaterial) -> Vec<u8> {
    assert_eq!(normals.len(), mesh.points.len(), "one normal a point");
    assert!(
        !mesh.triangles.is_empty(),
        "a surface to write has triangles"
    );
    let at_vertex = |of_point: &[Vec3]| -> Vec<Vec3> {
        let points = mesh.point_of.iter();
        points.map(|&point| of_point[point as usize]).collect()
    };
    let (positions, normals) = (at_vertex(&mesh.points), at_vertex(normals));
    let sections: [&[u8]; 4] = [
        bytemuck::cast_slice(&positions),
        bytemuck::cast_slice(&normals),
        bytemuck::cast_slice(&mesh.uvs),
        bytemuck::cast_slice(&mesh.triangles),
    ];
    let json = description(mesh, material, sections.map(<[u8]>::len));
    join(&json, &sections.concat())
}

/// The JSON of the file whose buffer has four sections of these lengths.
fn description(mesh: &SurfaceMesh, material: &GlbMaterial, lengths: [usize; 4]) -> Value {
    let (low, high) = bounds(&mesh.points);
    let mut offset = 0;
    let views: Vec<Value> = lengths
        .iter()
        .enumerate()
        .map(|(section, &length)| {
            let target = if section == 3 {
                ELEMENT_ARRAY_BUFFER
            } else {
                ARRAY_BUFFER
            };
            let view = json!({
                "buffer": 0, "byteOffset": offset, "byteLength": length, "target": target,
            });
            offset += length;
            view
        })
        .collect();
    let vertices = mesh.point_of.len();
    let accessor = |view: u32, component: u32, kind: &str, count: usize| {
        json!({
            "bufferView": view, "componentType": component, "type": kind, "count": count,
        })
    };
    let mut positions = accessor(0, FLOAT, "VEC3", vertices);
    positions["min"] = json!(low.to_array());
    positions["max"] = json!(high.to_array());

    let mut look = json!({
        "name": material.name,
        "pbrMetallicRoughness": { "metallicFactor": 0.0, "roughnessFactor": material.roughness },
    });
    let mut pictures: Vec<&String> = Vec::new();
    if let Some(uri) = &material.base_color {
        look["pbrMetallicRoughness"]["baseColorTexture"] = json!({ "index": pictures.len() });
        pictures.push(uri);
    }
    if let Some(uri) = &material.normal_map {
        look["normalTexture"] = json!({ "index": pictures.len() });
        pictures.push(uri);
    }
    let mut file = json!({
        "asset": { "version": "2.0", "generator": "palpate" },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "mesh": 0, "name": material.name }],
        "meshes": [{
            "name": material.name,
            "primitives": [{
                "attributes": { "POSITION": 0, "NORMAL": 1, "TEXCOORD_0": 2 },
                "indices": 3,
                "material": 0,
            }],
        }],
        "materials": [look],
        "accessors": [
            positions,
            accessor(1, FLOAT, "VEC3", vertices),
            accessor(2, FLOAT, "VEC2", vertices),
            accessor(3, UNSIGNED_INT, "SCALAR", 3 * mesh.triangles.len()),
        ],
        "bufferViews": views,
        "buffers": [{ "byteLength": offset }],
    });
    if !pictures.is_empty() {
        let textures = 0..pictures.len();
        file["textures"] = textures.map(|k| json!({ "source": k })).collect();
        file["images"] = pictures.iter().map(|uri| json!({ "uri": uri })).collect();
    }
    file
}

/// A GLB of the two chunks; every section of `binary` is a multiple of four bytes long.
fn join(json: &Value, binary: &[u8]) -> Vec<u8> {
    // Keys in one order, whether or not some dependency has serde_json keep that of insertion.
    let mut json = json.clone();
    json.sort_all_objects();
    let mut json = json.to_string().into_bytes();
    json.resize(json.len().next_multiple_of(4), b' ');
    let word = |length: usize| {
        let length = u32::try_from(length).expect("a GLB is smaller than 4 GiB");
        length.to_le_bytes()
    };
    [
        b"glTF".as_slice(),
        &2_u32.to_le_bytes(),
        &word(12 + 8 + json.len() + 8 + binary.len()),
        &word(json.len()),
        b"JSON",
        &json,
        &word(binary.len()),
        b"BIN\0",
        binary,
    ]
    .concat()
}
