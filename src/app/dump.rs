//! `dump-NNNN/`: everything the shaders read and made in one frame, as arrays.

use super::renderer::Renderer;
use super::{AppError, Session};
use crate::geom::plane::LightPathMethod;
use crate::measure::files::{create_folder, write, write_npy};
use crate::passes::frame::{effective_method, patch_radius_m};
use crate::passes::view::{View, placed_lights};
use serde_json::json;
use std::path::Path;

/// Writes the frame that `renderer` drew last.
///
/// # Errors
///
/// [`AppError`] if something can't be read back or written.
pub fn write_dump(folder: &Path, session: &Session, renderer: &Renderer) -> Result<(), AppError> {
    create_folder(folder)?;
    let mesh = &session.mesh;
    let drawn = renderer.geometry()?;
    let vertices = mesh.point_of.len() as u64;
    // Arrays are a row a vertex; what belongs to a point is repeated for each of its vertices.
    let by_vertex = |per_point: &dyn Fn(usize) -> Vec<f32>| -> Vec<f32> {
        mesh.point_of
            .iter()
            .flat_map(|&point| per_point(point as usize))
            .collect()
    };
    let floats = |name: &str, columns: u64, values: &[f32]| {
        write_npy(&folder.join(name), &[vertices, columns], values)
    };
    let points = session.points();
    floats(
        "positions.npy",
        3,
        &by_vertex(&|p| points[p].to_array().to_vec()),
    )?;
    floats(
        "rest_positions.npy",
        3,
        &by_vertex(&|p| mesh.points[p].to_array().to_vec()),
    )?;
    floats(
        "normals.npy",
        3,
        &by_vertex(&|p| drawn.normals[p][..3].to_vec()),
    )?;
    floats("tangents.npy", 4, drawn.tangents.as_flattened())?;
    let primitives = drawn.primitives.as_ref();
    let columns = primitives.map_or(4, |(columns, _)| *columns);
    floats(
        "primitives.npy",
        columns as u64,
        &by_vertex(&|p| match primitives {
            Some((_, vectors)) => vectors.as_flattened()[columns * p..columns * (p + 1)].to_vec(),
            None => {
                let [x, y, z, _] = drawn.normals[p];
                vec![x, y, z, 0.0]
            }
        }),
    )?;
    let uvs: Vec<f32> = mesh.uvs.iter().flat_map(|uv| uv.to_array()).collect();
    floats("uv.npy", 2, &uvs)?;
    write_npy(&folder.join("point_of.npy"), &[vertices], &mesh.point_of)?;
    write_npy(
        &folder.join("triangles.npy"),
        &[mesh.triangles.len() as u64, 3],
        mesh.triangles.as_flattened(),
    )?;
    let [width, height] = renderer.size().map(u64::from);
    write_npy(
        &folder.join("radiance.npy"),
        &[height, width, 3],
        &renderer.radiance()?,
    )?;
    write_npy(
        &folder.join("depth.npy"),
        &[height, width],
        &renderer.depth()?,
    )?;
    let text = serde_json::to_string_pretty(&description(session, renderer, primitives.is_some()))
        .expect("a description has string keys");
    Ok(write(&folder.join("dump.json"), text.as_bytes())?)
}

const FITTED: &str = "plane { x : normal . (x - position) = offset_m }: least squares over the patch, \
                      oriented with the normal";
const STALE: &str = "plane { x : normal . (x - position) = offset_m }: least squares over the patch at rest, left where it \
                     was in space";
const CARRIED: &str = "plane { x : normal . (x - position) = offset_m }: least squares over the patch at rest, moved with the \
                       point and turned with its tangent frame";
const TANGENT: &str = "plane { x : normal . (x - position) = 0 }: the tangent plane; the shaders of this \
                       scene read no fitted one";

const QUADRIC: &str = "paraboloid { x : normal . d = d . Q d / 2, d = x - position }, Q symmetric [1/m] in world \
                       axes: least squares over 16 samples of the patch, weighted to the middle";
const PLANE_COLUMNS: [&str; 4] = ["normal_x", "normal_y", "normal_z", "offset_m"];
const QUADRIC_COLUMNS: [&str; 8] = [
    "q_xx", "q_yy", "q_zz", "zero", "q_xy", "q_xz", "q_yz", "zero",
];

fn description(session: &Session, renderer: &Renderer, fitted: bool) -> serde_json::Value {
    let scene = &session.scene;
    let orbit = renderer.scene_orbit(session);
    let view = View {
        eye: orbit.eye(),
        target: orbit.target,
        up: orbit.up,
        fov_y: orbit.fov_y,
    };
    let method = effective_method(scene);
    let (columns, meaning) = match method {
        Some(LightPathMethod::Quadric) => (&QUADRIC_COLUMNS[..], QUADRIC),
        Some(LightPathMethod::Stale) => (&PLANE_COLUMNS[..], STALE),
        Some(LightPathMethod::Carried) => (&PLANE_COLUMNS[..], CARRIED),
        _ if fitted => (&PLANE_COLUMNS[..], FITTED),
        _ => (&PLANE_COLUMNS[..], TANGENT),
    };
    let [width, height] = renderer.size();
    let aspect = width as f32 / height as f32;
    let lights: Vec<_> = placed_lights(scene, &session.rest)
        .iter()
        .map(|light| {
            let place = if light.is_point { "at_m" } else { "toward" };
            let power = if light.is_point {
                "intensity_w_sr"
            } else {
                "irradiance_w_m2"
            };
            json!({
                place: light.place.to_array(),
                power: light.power.to_array(),
                "shadow": light.shadow,
            })
        })
        .collect();
    json!({
        "frame": session.frame(),
        "time_s": session.time_s(),
        "matrices": "columns first; view space is right-handed, x right, y up, the camera looks along -z; clip depth 0 near to 1 far",
        "camera": {
            "eye_m": view.eye.to_array(),
            "target_m": view.target.to_array(),
            "fov_y_rad": view.fov_y,
            "view_from_world": view.view_from_world().to_cols_array(),
            "clip_from_view": view.clip_from_view(aspect).to_cols_array(),
            "clip_from_world": view.clip_from_world(aspect).to_cols_array(),
        },
        "size": [width, height],
        "lights": lights,
        "surface": scene.surface,
        "layers": scene.surface.layers,
        "light_path": {
            "method": method.map_or("none", LightPathMethod::name),
            "radius_m": fitted.then(|| patch_radius_m(scene)),
        },
        "primitives": {
            "columns": columns,
            "meaning": meaning,
            "patch": "the points within radius_m of the point in rest_positions whose rest normals are not opposed (dot > 0), at least the 16 nearest; membership is symmetric; each point counts once though it may have several vertices (point_of)",
        },
        "arrays": {
            "positions": "(vertices, 3) f32 m", "rest_positions": "(vertices, 3) f32 m",
            "normals": "(vertices, 3) f32", "tangents": "(vertices, 4) f32, handedness last",
            "uv": "(vertices, 2) f32, v downwards", "point_of": "(vertices,) u32",
            "triangles": "(triangles, 3) u32", "primitives": "(vertices, columns) f32",
            "radiance": "(height, width, 3) f32 linear, W/(m2 sr), rounded to half floats by the target",
            "depth": "(height, width) f32, 0 near to 1 far",
        },
    })
}
