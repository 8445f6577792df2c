//! A dumped frame read back, and the picture that it ought to be, drawn in f64.

#![allow(dead_code)] // Each test binary asks for a part of it.

use super::oracle::Surface;
use glam::{DMat4, DVec2, DVec3};
use std::path::{Path, PathBuf};

/// `dump-NNNN/`.
pub struct Dump {
    folder: PathBuf,
    /// `dump.json`.
    pub description: serde_json::Value,
    /// Where the surface lies.
    pub now: Surface,
    /// The same at rest.
    pub rest: Surface,
    /// Width and height [px].
    pub size: [usize; 2],
    clip_from_world: DMat4,
}

/// What lies at one pixel.
#[derive(Clone, Copy, Debug)]
pub struct Seen {
    /// Where [m].
    pub world: DVec3,
    /// Unit normal of the triangle.
    pub normal: DVec3,
    /// 0 near to 1 far.
    pub depth: f64,
}

impl Dump {
    /// Reads the dump of `frame` in the folder of a replay.
    ///
    /// # Panics
    ///
    /// If an array is missing or has another shape or type than `dump.json` and the specification say.
    pub fn read(out: &Path, frame: u32) -> Self {
        let folder = out.join(format!("dump-{frame:04}"));
        let text = std::fs::read_to_string(folder.join("dump.json")).expect("dump.json");
        let description: serde_json::Value = serde_json::from_str(&text).expect("sound JSON");
        let size = [0, 1].map(|k| description["size"][k].as_u64().expect("a size") as usize);
        let matrix = description["camera"]["clip_from_world"].as_array();
        let matrix = matrix.expect("a matrix").iter();
        let matrix: Vec<f64> = matrix.map(|x| x.as_f64().expect("a number")).collect();
        let mut dump = Self {
            folder,
            size,
            clip_from_world: DMat4::from_cols_slice(&matrix),
            now: Surface {
                points: Vec::new(),
                point_of: Vec::new(),
                uvs: Vec::new(),
                triangles: Vec::new(),
            },
            rest: Surface {
                points: Vec::new(),
                point_of: Vec::new(),
                uvs: Vec::new(),
                triangles: Vec::new(),
            },
            description,
        };
        let (shape, point_of) = dump.array::<u32>("point_of");
        let vertices = shape[0];
        assert_eq!(shape, [vertices]);
        let uvs = dump.columns::<2>("uv");
        assert_eq!(uvs.len(), vertices, "a texture coordinate a vertex");
        let (shape, triangles) = dump.array::<u32>("triangles");
        assert_eq!(shape[1..], [3], "three corners a triangle");
        let triangles: Vec<[u32; 3]> = triangles
            .chunks_exact(3)
            .map(|t| [t[0], t[1], t[2]])
            .collect();
        let surface = |positions: &str| Surface {
            points: dump.by_point(
                &point_of,
                &dump.columns::<3>(positions).map_to(DVec3::from_array),
            ),
            point_of: point_of.clone(),
            uvs: uvs.map_to(DVec2::from_array),
            triangles: triangles.clone(),
        };
        (dump.now, dump.rest) = (surface("positions"), surface("rest_positions"));
        dump
    }

    /// Shape and values of an array, last index fastest.
    ///
    /// # Panics
    ///
    /// If it is missing, holds another type or is in column order.
    pub fn array<T: npyz::Deserialize>(&self, name: &str) -> (Vec<usize>, Vec<T>) {
        let bytes = std::fs::read(self.folder.join(format!("{name}.npy")));
        let bytes = bytes.unwrap_or_else(|e| panic!("{name}: {e}"));
        let array = npyz::NpyFile::new(&bytes[..]).unwrap_or_else(|e| panic!("{name}: {e}"));
        assert_eq!(array.order(), npyz::Order::C, "{name}");
        let shape = array.shape().iter().map(|&n| n as usize).collect();
        let values = array.into_vec::<T>();
        (shape, values.unwrap_or_else(|e| panic!("{name}: {e}")))
    }

    /// The rows of an f32 array of `N` columns.
    pub fn columns<const N: usize>(&self, name: &str) -> Vec<[f64; N]> {
        let (shape, values) = self.array::<f32>(name);
        assert_eq!(shape, [values.len() / N, N], "{name}");
        values
            .chunks_exact(N)
            .map(|row| std::array::from_fn(|k| f64::from(row[k])))
            .collect()
    }

    /// Values of a picture-sized f32 array with `channels` a pixel, row by row from the top.
    pub fn pixels(&self, name: &str, channels: usize) -> Vec<f64> {
        let (shape, values) = self.array::<f32>(name);
        let [width, height] = self.size;
        let mut expected = vec![height, width];
        if channels > 1 {
            expected.push(channels);
        }
        assert_eq!(shape, expected, "{name}");
        values.into_iter().map(f64::from).collect()
    }

    /// Mean of the colours of each pixel's radiance.
    pub fn brightness(&self) -> Vec<f64> {
        let radiance = self.pixels("radiance", 3);
        radiance
            .chunks_exact(3)
            .map(|rgb| rgb.iter().sum::<f64>() / 3.0)
            .collect()
    }

    /// One of the values of each point's vertices.
    ///
    /// # Panics
    ///
    /// If two vertices of a point have different values.
    pub fn by_point<T: Copy + PartialEq + std::fmt::Debug>(
        &self,
        point_of: &[u32],
        by_vertex: &[T],
    ) -> Vec<T> {
        assert_eq!(point_of.len(), by_vertex.len(), "a row a vertex");
        let points = point_of.iter().max().map_or(0, |&last| last as usize + 1);
        let mut values: Vec<Option<T>> = vec![None; points];
        for (&point, &value) in point_of.iter().zip(by_vertex) {
            let known = values[point as usize].get_or_insert(value);
            assert_eq!(*known, value, "vertices of point {point}");
        }
        values
            .into_iter()
            .map(|value| value.expect("every point has a vertex"))
            .collect()
    }

    /// Unit normal of each point, as drawn.
    pub fn normals(&self) -> Vec<DVec3> {
        let rows = self.columns::<3>("normals").map_to(DVec3::from_array);
        self.by_point(&self.now.point_of, &rows)
    }

    /// Normal and offset [m] of each point's primitive.
    pub fn primitives(&self) -> Vec<(DVec3, f64)> {
        let rows = self.columns::<4>("primitives");
        let rows = rows.map_to(|[x, y, z, h]| (DVec3::new(x, y, z), h));
        self.by_point(&self.now.point_of, &rows)
    }

    /// Reach of a patch [m].
    pub fn radius_m(&self) -> f64 {
        let radius = &self.description["light_path"]["radius_m"];
        radius.as_f64().expect("a radius")
    }

    /// Where the middle of pixel (x, y) lies at `depth` [m].
    pub fn world(&self, x: usize, y: usize, depth: f64) -> DVec3 {
        let [width, height] = self.size.map(|side| side as f64);
        let ndc = DVec3::new(
            2.0 * (x as f64 + 0.5) / width - 1.0,
            1.0 - 2.0 * (y as f64 + 0.5) / height,
            depth,
        );
        self.clip_from_world.inverse().project_point3(ndc)
    }

    /// Place in the picture [px], and depth.
    pub fn project(&self, world: DVec3) -> DVec3 {
        let [width, height] = self.size.map(|side| side as f64);
        let ndc = self.clip_from_world.project_point3(world);
        DVec3::new(
            0.5 * (ndc.x + 1.0) * width,
            0.5 * (1.0 - ndc.y) * height,
            ndc.z,
        )
    }

    /// The surface drawn in f64: what each pixel's middle sees, row by row from the top.
    pub fn drawn(&self) -> Vec<Option<Seen>> {
        let [width, height] = self.size;
        let mut seen: Vec<Option<Seen>> = vec![None; width * height];
        for triangle in &self.now.triangles {
            let world = triangle.map(|v| self.now.points[self.now.point_of[v as usize] as usize]);
            let [a, b, c] = world.map(|x| self.project(x));
            let (ab, ac) = (b - a, c - a);
            let area = ab.x * ac.y - ab.y * ac.x;
            if area == 0.0 {
                continue;
            }
            let low = a.min(b).min(c).truncate().max(DVec2::ZERO);
            let high = a.max(b).max(c).truncate();
            let normal = (world[1] - world[0])
                .cross(world[2] - world[0])
                .normalize_or_zero();
            for y in low.y as usize..height.min(high.y.max(0.0) as usize + 1) {
                for x in low.x as usize..width.min(high.x.max(0.0) as usize + 1) {
                    let p = DVec2::new(x as f64 + 0.5, y as f64 + 0.5) - a.truncate();
                    let v = (p.x * ac.y - p.y * ac.x) / area;
                    let w = (ab.x * p.y - ab.y * p.x) / area;
                    let depth = a.z + v * ab.z + w * ac.z;
                    let pixel = &mut seen[y * width + x];
                    let is_inside = v >= 0.0 && w >= 0.0 && v + w <= 1.0;
                    if is_inside && pixel.is_none_or(|known| depth < known.depth) {
                        *pixel = Some(Seen {
                            world: self.world(x, y, depth),
                            normal,
                            depth,
                        });
                    }
                }
            }
        }
        seen
    }
}

/// Each element turned into another.
pub trait MapTo<T> {
    /// The images of all elements.
    fn map_to<U>(&self, f: impl Fn(T) -> U) -> Vec<U>;
}

impl<T: Copy> MapTo<T> for Vec<T> {
    fn map_to<U>(&self, f: impl Fn(T) -> U) -> Vec<U> {
        self.iter().copied().map(f).collect()
    }
}
