//! A reference scene made ready to be drawn: surface, layer maps, lights and camera in metres.

use super::super::{AppError, load};
use super::format::{LayerDepths, LayerFile, LightFile, SceneFile};
use crate::geom::SurfaceMesh;
use crate::geom::import::read_parts;
use crate::geom::paint::TissueMaps;
use crate::geom::plane::LightPathMethod;
use crate::measure::npz;
use crate::optics::{LAYERS_MAX, Layer};
use crate::passes::view::View;
use crate::scene::{LIGHTS_MAX, LayerSection, LightSection, Quadrature, Scene, SceneSource};
use glam::Vec3;
use image::{DynamicImage, Rgba, Rgba32FImage, RgbaImage};
use std::collections::HashMap;
use std::path::{Path, PathBuf};

/// What stands for no boundary: deeper than light goes in any tissue.
const ENDLESS_M: f32 = 1.0;
/// Layers of one map.
const LAYERS_A_MAP: usize = 4;

/// What a reference scene is drawn with unless it is told otherwise: light scattered once and nothing on top.
const BASE: &str = r#"
[body]
shape = "slab"
extent_m = [1.0, 1.0, 1.0]
[surface]
kind = "subsurface"
samples = 8
color_blend = 0.0
multiple_scattering = 0.0
room_light = 0.0
wetness = 0.0
relief = 0.0
[light_path]
method = "depth-map"
"#;

/// A scene, ready to be drawn.
pub struct ReferenceScene {
    /// The name of its file, without the ending.
    pub name: String,
    /// Surface, lights and light path.
    pub scene: Scene,
    /// The surface [m].
    pub mesh: SurfaceMesh,
    /// Blank but for the layers.
    pub maps: TissueMaps,
    /// The camera.
    pub view: View,
    /// Width and height of the picture [px].
    pub size: [u32; 2],
    /// Where the reference picture would be.
    pub reference: PathBuf,
}

impl ReferenceScene {
    /// Reads `file` of the folder `dir`, with overrides of the surface and the light path.
    ///
    /// # Errors
    ///
    /// [`AppError`] naming the file, the key and what to do.
    pub fn read(dir: &Path, file: &Path, sets: &[String]) -> Result<Self, AppError> {
        let wrong = |message: String| AppError::Usage(format!("{}: {message}", file.display()));
        let bytes = std::fs::read(file).map_err(|source| AppError::Read {
            path: file.display().to_string(),
            source,
        })?;
        let told: SceneFile =
            serde_json::from_slice(&bytes).map_err(|error| wrong(error.to_string()))?;
        let unit_m = match told.units.as_str() {
            "mm" => 1e-3,
            "cm" => 1e-2,
            "m" => 1.0,
            other => {
                return Err(wrong(format!("units: `{other}` is not one of mm, cm, m")));
            }
        };
        let name = file.file_stem().unwrap_or_default();
        let name = name.to_string_lossy().into_owned();
        let mesh = surface(&dir.join(&told.mesh), unit_m)?;
        let mut scene = Scene::read(
            &SceneSource {
                name: "validate",
                text: BASE,
                folder: None,
            },
            sets,
        )?;
        let layers = layers(&told.layers, unit_m).map_err(wrong)?;
        let depths = depths(dir, told.layer_depths.as_ref(), layers.len()).map_err(wrong)?;
        scene.surface.layers = layers;
        let is_told = |key: &str| sets.iter().any(|set| set.trim_start().starts_with(key));
        let printed = scene.surface.quadrature == Quadrature::Published;
        let first = Layer::from(scene.surface.layers[0]).extinction_per_m();
        if !is_told("surface.layer_depth_max_m") {
            scene.surface.layer_depth_max_m = if printed {
                // Where a hundredth of the light is left in the clearest colour.
                100_f32.ln() / first.min_element()
            } else {
                ENDLESS_M
            };
        }
        if printed && !is_told("light_path.method") {
            scene.light_path.method = LightPathMethod::Full;
        }
        if !is_told("light_path.radius_m") {
            // A tenth in the densest: smaller than the features of a scene a few millimetres wide.
            scene.light_path.radius_m = Some(10_f32.ln() / first.max_element());
        }
        let maps = maps(&depths, scene.surface.layer_depth_max_m);
        let (low, high) = mesh.bounds();
        let longest_m = (high - low).max_element();
        scene.lights = lights(told.light.all(), unit_m, longest_m).map_err(wrong)?;
        let camera = &told.camera;
        let [eye, target] = [camera.eye, camera.target].map(|p| unit_m * Vec3::from(p));
        let up = Vec3::from(camera.up);
        let is_sound = eye.is_finite() && target.is_finite() && up.is_finite() && eye != target;
        if !is_sound || up.length() < 1e-6 {
            return Err(wrong(
                "camera: eye, target and up must be finite, eye and target apart, up not zero"
                    .to_owned(),
            ));
        }
        if !(1.0..=150.0).contains(&camera.fovy_deg) {
            return Err(wrong(format!(
                "camera.fovy_deg: {} is not within 1 to 150",
                camera.fovy_deg
            )));
        }
        if !(8..=8192).contains(&camera.width) || !(8..=8192).contains(&camera.height) {
            return Err(wrong(format!(
                "camera: {} x {} pixels; each side must be 8 to 8192",
                camera.width, camera.height
            )));
        }
        let reference = told.reference.clone();
        Ok(Self {
            reference: dir.join(reference.unwrap_or_else(|| format!("ref/{name}.npz").into())),
            name,
            scene,
            mesh,
            maps,
            view: View {
                eye,
                target,
                up,
                fov_y: camera.fovy_deg.to_radians(),
            },
            size: [camera.width, camera.height],
        })
    }
}

/// The surface of `file` as it is: open surfaces stay open, texture coordinates stay as they are.
fn surface(file: &Path, unit_m: f32) -> Result<SurfaceMesh, AppError> {
    let parts = read_parts(file)?.parts;
    let mut mesh = SurfaceMesh::default();
    let mut points: HashMap<[u32; 3], u32> = HashMap::new();
    for part in &parts {
        let first = mesh.point_of.len() as u32;
        for (k, &position) in part.positions.iter().enumerate() {
            // Adding zero makes -0 and 0 the same key.
            let position = unit_m * position + Vec3::ZERO;
            let point = *points
                .entry(position.to_array().map(f32::to_bits))
                .or_insert_with(|| {
                    mesh.points.push(position);
                    mesh.points.len() as u32 - 1
                });
            mesh.point_of.push(point);
            let uv = part.uvs.as_ref().map(|uvs| uvs[k]);
            mesh.uvs
                .push(uv.filter(|uv| uv.is_finite()).unwrap_or_default());
        }
        mesh.triangles.extend(
            part.triangles
                .iter()
                .map(|corners| corners.map(|corner| first + corner)),
        );
    }
    if mesh.triangles.is_empty() {
        return Err(AppError::Usage(format!(
            "{}: it holds no triangles",
            file.display()
        )));
    }
    Ok(mesh)
}

fn layers(told: &[LayerFile], unit_m: f32) -> Result<Vec<LayerSection>, String> {
    if !(1..=LAYERS_MAX).contains(&told.len()) {
        return Err(format!(
            "layers: {} of them; the shaders have room for 1 to {LAYERS_MAX}",
            told.len()
        ));
    }
    let layer = |(k, layer): (usize, &LayerFile)| {
        let of_each = |f: &dyn Fn(usize) -> f32| std::array::from_fn(|c| f(c) / unit_m);
        let sound = (0..3).all(|c| {
            let (scattering, extinction) = (layer.sigma_s[c], layer.sigma_t[c]);
            scattering >= 0.0 && extinction >= scattering && extinction > 0.0
        });
        if !sound {
            return Err(format!(
                "layers[{k}]: sigma_t must be above 0 and not below sigma_s"
            ));
        }
        if layer.g_schlick.is_nan() || layer.g_schlick.abs() > 0.98 {
            return Err(format!("layers[{k}].g_schlick: it must be within ±0.98"));
        }
        Ok(LayerSection {
            absorption_per_m: of_each(&|c| layer.sigma_t[c] - layer.sigma_s[c]),
            scattering_per_m: of_each(&|c| layer.sigma_s[c]),
            asymmetry: layer.g_schlick,
        })
    };
    told.iter().enumerate().map(layer).collect()
}

fn lights(told: &[LightFile], unit_m: f32, longest_m: f32) -> Result<Vec<LightSection>, String> {
    if !(1..=LIGHTS_MAX).contains(&told.len()) {
        return Err(format!(
            "light: {} of them; the shaders have room for 1 to {LIGHTS_MAX}",
            told.len()
        ));
    }
    let light = |light: &LightFile| {
        let (toward, at_m, power) = match *light {
            LightFile::Directional {
                to_light,
                irradiance,
            } => (Some(Vec3::from(to_light)), None, irradiance.rgb()),
            LightFile::Point { pos, intensity } => {
                // A scene tells the irradiance at the distance of the body's longest extent.
                let share = (unit_m / longest_m).powi(2);
                let power = intensity.rgb().map(|i| share * i);
                (None, Some(unit_m * Vec3::from(pos)), power)
            }
        };
        let place = toward.or(at_m).expect("one of them is given");
        if !place.is_finite() || toward.is_some_and(|d| d.length() < 1e-6) {
            return Err("light: to_light or pos must be finite, to_light not zero".to_owned());
        }
        if power.iter().any(|p| !p.is_finite() || *p < 0.0) {
            return Err("light: E or I must be finite and not below 0".to_owned());
        }
        Ok(LightSection {
            toward,
            at_m,
            at_share: None,
            irradiance_w_m2: power,
            shadow: false,
        })
    };
    told.iter().map(light).collect()
}

/// Depths of the bottoms of all layers but the last [m], four to a map.
struct Depths {
    size: [u32; 2],
    /// For each map, row by row with v = 0 first.
    maps: Vec<Vec<[f32; 4]>>,
}

fn depths(dir: &Path, told: Option<&LayerDepths>, layer_count: usize) -> Result<Depths, String> {
    let boundaries = layer_count - 1;
    let constant = |depths_m: &[f32]| Depths {
        size: [1, 1],
        maps: (0..layer_count.div_ceil(LAYERS_A_MAP))
            .map(|map| {
                let depth = |c: usize| depths_m.get(LAYERS_A_MAP * map + c).copied();
                vec![std::array::from_fn(|c| depth(c).unwrap_or(ENDLESS_M))]
            })
            .collect(),
    };
    let Some(told) = told else {
        if boundaries == 0 {
            return Ok(constant(&[]));
        }
        return Err(format!(
            "missing key `layer_depths`: {layer_count} layers have {boundaries} boundaries; give \
             constant_mm, or file and depth_max_mm"
        ));
    };
    if let Some(constant_mm) = &told.constant_mm {
        let is_sound = constant_mm.len() >= boundaries
            && constant_mm.iter().all(|d| *d >= 0.0 && d.is_finite())
            && constant_mm.windows(2).all(|pair| pair[0] <= pair[1]);
        if !is_sound {
            return Err(format!(
                "layer_depths.constant_mm: {boundaries} ascending depths are needed for {layer_count} layers"
            ));
        }
        let depths_m: Vec<f32> = constant_mm[..boundaries].iter().map(|d| 1e-3 * d).collect();
        return Ok(constant(&depths_m));
    }
    let files = told.file.as_ref().map(|maps| maps.all()).ok_or(
        "missing key `layer_depths.file`: give it with depth_max_mm, or constant_mm".to_owned(),
    )?;
    let depth_max_m = told
        .depth_max_mm
        .map(|d| 1e-3 * d)
        .filter(|d| *d > 0.0 && d.is_finite())
        .ok_or("missing key `layer_depths.depth_max_mm`: what the value 1 stands for".to_owned())?;
    for (key, value, known) in [
        ("address", &told.address, "clamp"),
        ("filter", &told.filter, "bilinear"),
    ] {
        if value.as_ref().is_some_and(|value| value != known) {
            return Err(format!(
                "layer_depths.{key}: only `{known}` is known; repeat the map in the file instead"
            ));
        }
    }
    let needed = boundaries.div_ceil(LAYERS_A_MAP).max(1);
    if files.len() < needed {
        return Err(format!(
            "layer_depths.file: {layer_count} layers need {needed} maps of four channels"
        ));
    }
    let mut size = None;
    let mut maps = Vec::new();
    for file in files {
        let (read_size, mut texels) = read_map(&dir.join(file))
            .map_err(|problem| format!("layer_depths.file: {}: {problem}", file.display()))?;
        if *size.get_or_insert(read_size) != read_size {
            return Err("layer_depths.file: all maps must be of one size".to_owned());
        }
        let first = LAYERS_A_MAP * maps.len();
        for texel in texels
            .iter_mut()
            .flat_map(|texel| texel.iter_mut().enumerate())
        {
            let (channel, value) = texel;
            if !value.is_finite() || *value < 0.0 {
                return Err(format!(
                    "layer_depths.file: {}: a depth is {value}",
                    file.display()
                ));
            }
            // The last layer fills the rest.
            *value = if first + channel < boundaries {
                *value * depth_max_m
            } else {
                ENDLESS_M
            };
        }
        maps.push(texels);
    }
    Ok(Depths {
        size: size.expect("at least one map was read"),
        maps,
    })
}

/// Width and height of a map, and its texels.
type MapTexels = ([u32; 2], Vec<[f32; 4]>);

fn read_map(file: &Path) -> Result<MapTexels, String> {
    let ending = file.extension().unwrap_or_default().to_string_lossy();
    let array = match ending.as_ref() {
        "npz" => npz::read(&read_bytes(file)?, "depth")?,
        "npy" => npz::array(&read_bytes(file)?)?,
        _ => {
            let picture = load::picture(file).map_err(|error| error.to_string())?;
            let picture = picture.to_rgba32f();
            let texels = picture.pixels().map(|texel| texel.0).collect();
            return Ok((picture.dimensions().into(), texels));
        }
    };
    let [height, width, channels] = array.shape[..] else {
        return Err(format!(
            "its shape is {:?}; height, width and channels are needed",
            array.shape
        ));
    };
    if !(1..=4).contains(&channels) || width == 0 || height == 0 || width.max(height) > 8192 {
        return Err(format!(
            "its shape is {:?}; up to 8192 x 8192 texels of 1 to 4 channels are read",
            array.shape
        ));
    }
    let texels = array
        .values
        .chunks_exact(channels as usize)
        .map(|values| std::array::from_fn(|c| values.get(c).copied().unwrap_or(1.0)))
        .collect();
    Ok(([width as u32, height as u32], texels))
}

fn read_bytes(file: &Path) -> Result<Vec<u8>, String> {
    std::fs::read(file).map_err(|error| error.to_string())
}

/// Maps that are blank but for the layers, whose value 1 stands for `depth_max_m`.
fn maps(depths: &Depths, depth_max_m: f32) -> TissueMaps {
    let blank = || RgbaImage::from_pixel(4, 4, Rgba([128, 128, 255, 255]));
    let [width, height] = depths.size;
    let layers = depths.maps.iter().map(|texels| {
        DynamicImage::ImageRgba32F(Rgba32FImage::from_fn(width, height, |x, y| {
            // The file's rows go up as v does, a picture's go down.
            let at = (height - 1 - y) * width + x;
            Rgba(texels[at as usize].map(|depth| (depth / depth_max_m).min(1.0)))
        }))
    });
    TissueMaps {
        size_px: 4,
        outer: blank(),
        normal: blank(),
        inner: blank(),
        layers: layers.collect(),
    }
}
