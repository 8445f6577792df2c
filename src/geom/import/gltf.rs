//! glTF 2.0: one [`Part`] for each place where a node puts a mesh.
//!
//! The crate `gltf` reads the JSON; everything it refers to is looked up and checked here.

use super::accessor::Document;
use super::container::{self, Resource};
use super::error::ImportFault;
use super::part::{FileParts, Part, Room, TextureSource};
use ::gltf::json::mesh::{Mode, Primitive, Semantic};
use ::gltf::json::validation::Checked;
use ::gltf::json::{Index, Material, Mesh, Node, Root, Texture};
use glam::{DMat4, DQuat, DVec3, Vec2, Vec3};
use std::path::Path;

/// Required extensions that change the look but not the shape.
const HARMLESS_EXTENSIONS: [&str; 2] = ["KHR_materials_", "KHR_lights_punctual"];

/// JSON beyond this is refused unread, and so is JSON with more objects: an object of two bytes
/// takes hundreds in memory. Buffers in data URIs count as bytes only.
const JSON_BYTES_MAX: usize = 1 << 26;
const JSON_OBJECTS_MAX: usize = 1 << 20;

/// Reads the meshes of the glTF file `path` whose content is `bytes`.
pub(super) fn read(bytes: &[u8], path: &Path) -> Result<FileParts, ImportFault> {
    let chunks = container::split(bytes, path)?;
    check_json_size(chunks.json)?;
    let root = Root::from_slice(chunks.json)
        .map_err(|error| ImportFault::malformed("JSON", error.to_string()))?;
    check_version(&root)?;
    check_extensions(&root)?;
    let document = Document {
        root: &root,
        buffers: buffers(&root, chunks.binary, path)?,
    };
    for view in 0..root.buffer_views.len() {
        document.view(Index::new(view as u32))?;
    }
    let mut reader = Reader {
        document,
        path,
        room: Room::default(),
        file: FileParts::default(),
    };
    for (mesh, world_from_mesh) in placements(&root)? {
        reader.place(mesh, world_from_mesh)?;
    }
    Ok(reader.file)
}

fn check_json_size(json: &[u8]) -> Result<(), ImportFault> {
    let objects = json.iter().filter(|&&byte| byte == b'{').count();
    if json.len() <= JSON_BYTES_MAX && objects <= JSON_OBJECTS_MAX {
        return Ok(());
    }
    Err(ImportFault::TooLarge {
        what: format!(
            "{} bytes of JSON with {objects} objects are over the limit of {JSON_BYTES_MAX} and \
             {JSON_OBJECTS_MAX}",
            json.len()
        ),
    })
}

fn check_version(root: &Root) -> Result<(), ImportFault> {
    let version = &root.asset.version;
    if version.split('.').next() == Some("2") {
        return Ok(());
    }
    Err(ImportFault::Unsupported {
        feature: format!("glTF version `{version}`"),
        remedy: "export the file as glTF 2.0",
    })
}

fn check_extensions(root: &Root) -> Result<(), ImportFault> {
    let harmless = |name: &str| HARMLESS_EXTENSIONS.iter().any(|h| name.starts_with(h));
    match root.extensions_required.iter().find(|name| !harmless(name)) {
        None => Ok(()),
        Some(name) => Err(ImportFault::Unsupported {
            feature: format!("the glTF extension {name}"),
            remedy: "export the file without compression, quantisation or other extensions",
        }),
    }
}

/// The bytes of every buffer, none shorter than it claims.
fn buffers(root: &Root, binary: Option<&[u8]>, path: &Path) -> Result<Vec<Vec<u8>>, ImportFault> {
    let read = |(index, buffer): (usize, &::gltf::json::Buffer)| {
        let place = format!("buffers[{index}]");
        let bytes = match (&buffer.uri, binary) {
            (Some(uri), _) => container::fetch(uri, path, &place)?,
            (None, Some(chunk)) if index == 0 => chunk.to_vec(),
            (None, _) => {
                let problem = "it has no uri and there is no BIN chunk for it";
                return Err(ImportFault::malformed(place, problem));
            }
        };
        if (bytes.len() as u64) < buffer.byte_length.0 {
            let problem = format!(
                "it claims {} bytes and has {}",
                buffer.byte_length.0,
                bytes.len()
            );
            return Err(ImportFault::malformed(place, problem));
        }
        Ok(bytes)
    };
    root.buffers.iter().enumerate().map(read).collect()
}

/// Every mesh with the transforms under which the scene shows it.
///
/// The whole node graph is checked, shown or not: each node has at most one parent, and none is
/// its own ancestor. A file without nodes is taken as a library of meshes.
fn placements(root: &Root) -> Result<Vec<(Index<Mesh>, DMat4)>, ImportFault> {
    let bad =
        |node: usize, problem: String| ImportFault::malformed(format!("nodes[{node}]"), problem);
    let mut has_parent = vec![false; root.nodes.len()];
    for (index, node) in root.nodes.iter().enumerate() {
        for child in node.children.iter().flatten() {
            match has_parent.get_mut(child.value()) {
                None => return Err(bad(index, format!("there is no child {}", child.value()))),
                Some(true) => return Err(bad(child.value(), "it has two parents".to_owned())),
                Some(seen) => *seen = true,
            }
        }
        if let Some(mesh) = node.mesh
            && mesh.value() >= root.meshes.len()
        {
            return Err(bad(index, format!("there is no meshes[{}]", mesh.value())));
        }
    }
    let tops = || (0..root.nodes.len()).filter(|&node| !has_parent[node]);
    let below_tops = walk(root, tops(), |_, _| ())?;
    if below_tops < root.nodes.len() {
        let problem = "its ancestors form a cycle".to_owned();
        let visited = reached(root, tops());
        let node = visited.iter().position(|&seen| !seen);
        return Err(bad(node.expect("a node was not reached"), problem));
    }
    let mut shown = Vec::new();
    let mut show = |node: &Node, world: DMat4| shown.extend(node.mesh.map(|mesh| (mesh, world)));
    let scene = root.scene.map_or(0, |scene| scene.value());
    match root.scenes.get(scene) {
        Some(scene) => {
            let nodes: Vec<usize> = scene.nodes.iter().map(|node| node.value()).collect();
            if let Some(node) = nodes.iter().find(|&&node| node >= root.nodes.len()) {
                let problem = format!("there is no nodes[{node}]");
                return Err(ImportFault::malformed("scene", problem));
            }
            walk(root, nodes.into_iter(), &mut show)?;
        }
        None if root.scene.is_some() => {
            let problem = format!("there is no scenes[{scene}]");
            return Err(ImportFault::malformed("scene", problem));
        }
        None if root.nodes.is_empty() => shown
            .extend((0..root.meshes.len()).map(|mesh| (Index::new(mesh as u32), DMat4::IDENTITY))),
        None => {
            walk(root, tops(), &mut show)?;
        }
    }
    Ok(shown)
}

/// Visits what hangs below `tops`, each node once, parents first; returns how many there were.
fn walk(
    root: &Root,
    tops: impl DoubleEndedIterator<Item = usize>,
    mut visit: impl FnMut(&Node, DMat4),
) -> Result<usize, ImportFault> {
    let mut visited = vec![false; root.nodes.len()];
    let mut count = 0;
    let mut waiting: Vec<_> = tops.rev().map(|node| (node, DMat4::IDENTITY)).collect();
    while let Some((index, parent)) = waiting.pop() {
        let place = || format!("nodes[{index}]");
        if std::mem::replace(&mut visited[index], true) {
            return Err(ImportFault::malformed(
                place(),
                "the scene reaches it twice",
            ));
        }
        count += 1;
        let node = &root.nodes[index];
        let world = parent * local_transform(node);
        if !world.is_finite() {
            return Err(ImportFault::malformed(
                place(),
                "its transform is not finite",
            ));
        }
        visit(node, world);
        let children = node.children.iter().flatten().rev();
        waiting.extend(children.map(|child| (child.value(), world)));
    }
    Ok(count)
}

/// Which nodes hang below `tops`.
fn reached(root: &Root, tops: impl Iterator<Item = usize>) -> Vec<bool> {
    let mut visited = vec![false; root.nodes.len()];
    let mut waiting: Vec<usize> = tops.collect();
    while let Some(node) = waiting.pop() {
        if !std::mem::replace(&mut visited[node], true) {
            waiting.extend(
                root.nodes[node]
                    .children
                    .iter()
                    .flatten()
                    .map(|c| c.value()),
            );
        }
    }
    visited
}

fn local_transform(node: &Node) -> DMat4 {
    if let Some(matrix) = node.matrix {
        return DMat4::from_cols_array(&matrix.map(f64::from));
    }
    let scale = node.scale.map_or(DVec3::ONE, |s| Vec3::from(s).as_dvec3());
    let rotation = node.rotation.map_or(DQuat::IDENTITY, |quaternion| {
        let quaternion = DQuat::from_array(quaternion.0.map(f64::from));
        // A quaternion of length zero has no direction; it is then taken as no rotation.
        if quaternion.length_squared() > 0.0 {
            quaternion.normalize()
        } else {
            DQuat::IDENTITY
        }
    });
    let translation = node
        .translation
        .map_or(DVec3::ZERO, |t| Vec3::from(t).as_dvec3());
    DMat4::from_scale_rotation_translation(scale, rotation, translation)
}

struct Reader<'a> {
    document: Document<'a>,
    path: &'a Path,
    room: Room,
    file: FileParts,
}

impl Reader<'_> {
    /// Adds mesh `index` as one part, under the transform of its node.
    fn place(&mut self, index: Index<Mesh>, world_from_mesh: DMat4) -> Result<(), ImportFault> {
        let root = self.document.root;
        let mesh = &root.meshes[index.value()];
        let name = mesh.name.clone();
        let mut part = Part {
            name: name.unwrap_or_else(|| format!("mesh {}", index.value())),
            uvs: Some(Vec::new()),
            ..Part::default()
        };
        let mut most_triangles = 0;
        for (number, primitive) in mesh.primitives.iter().enumerate() {
            let place = format!("mesh `{}`, primitive {number}", part.name);
            let before = part.triangles.len();
            self.append(&mut part, primitive, &place)?;
            let added = part.triangles.len() - before;
            if added > most_triangles {
                most_triangles = added;
                (part.base_color, part.normal) = self.pictures(primitive.material, &place)?;
            }
        }
        // A transform that mirrors turns the surface inside out; swapping two corners undoes it.
        if world_from_mesh.determinant() < 0.0 {
            for triangle in &mut part.triangles {
                triangle.swap(1, 2);
            }
        }
        for position in &mut part.positions {
            *position = world_from_mesh
                .project_point3(position.as_dvec3())
                .as_vec3();
        }
        self.file.parts.push(part);
        Ok(())
    }

    /// Appends the triangles of one primitive to `part`.
    fn append(
        &mut self,
        part: &mut Part,
        primitive: &Primitive,
        place: &str,
    ) -> Result<(), ImportFault> {
        let bad = |problem: String| ImportFault::malformed(place, problem);
        let Some(&positions) = attribute(primitive, Semantic::Positions) else {
            return Err(bad("it has no POSITION".to_owned()));
        };
        self.check_counts(primitive, positions, place)?;
        let Checked::Valid(mode) = primitive.mode else {
            return Err(bad("its mode is none that glTF knows".to_owned()));
        };
        let vertices = self.document.count(positions)?;
        let corners = match primitive.indices {
            Some(indices) => self.document.count(indices)?,
            None => vertices,
        };
        let corners_each = if mode == Mode::Triangles { 3 } else { 1 };
        self.room
            .take(vertices as usize, (corners / corners_each) as usize)?;

        let positions = self.document.positions(positions)?;
        let count = positions.len();
        if let Some(vertex) = positions.iter().position(|p| !Vec3::from(*p).is_finite()) {
            return Err(bad(format!(
                "vertex {vertex}: position {:?}",
                positions[vertex]
            )));
        }
        let corners = match primitive.indices {
            Some(indices) => self.document.indices(indices)?,
            None => (0..count as u32).collect(),
        };
        if let Some(corner) = corners.iter().position(|&vertex| vertex as usize >= count) {
            return Err(bad(format!(
                "index {corner} is {} where there are {count} vertices",
                corners[corner]
            )));
        }
        let Some(triangles) = triangulate(&corners, mode) else {
            let note = format!("{place}: left out, its {mode:?} are no surface");
            self.file.notes.push(note);
            return Ok(());
        };
        if primitive.targets.is_some() {
            let note = format!("{place}: morph targets are left out");
            self.file.notes.push(note);
        }
        let uvs = match attribute(primitive, Semantic::TexCoords(0)) {
            Some(&uvs) => Some(self.document.uvs(uvs)?),
            None => None,
        };
        part.uvs = match (part.uvs.take(), uvs) {
            (Some(mut all), Some(uvs)) => {
                all.extend(uvs.into_iter().map(Vec2::from));
                Some(all)
            }
            _ => None,
        };
        let base = part.positions.len() as u32;
        part.positions.extend(positions.into_iter().map(Vec3::from));
        part.triangles
            .extend(triangles.iter().map(|t| t.map(|vertex| base + vertex)));
        Ok(())
    }

    /// Every attribute and morph target has one element a position.
    fn check_counts(
        &self,
        primitive: &Primitive,
        positions: Index<::gltf::json::Accessor>,
        place: &str,
    ) -> Result<(), ImportFault> {
        let count = self.document.count(positions)?;
        let targets = primitive.targets.iter().flatten();
        let moved = targets
            .flat_map(|t| [t.positions, t.normals, t.tangents])
            .flatten();
        for accessor in primitive.attributes.values().copied().chain(moved) {
            let other = self.document.count(accessor)?;
            if other != count {
                let problem = format!(
                    "accessors[{}] has {other} elements where POSITION has {count}",
                    accessor.value()
                );
                return Err(ImportFault::malformed(place, problem));
            }
        }
        Ok(())
    }

    /// Where the pictures of base colour and normals of `material` are.
    fn pictures(
        &mut self,
        material: Option<Index<Material>>,
        place: &str,
    ) -> Result<(Option<TextureSource>, Option<TextureSource>), ImportFault> {
        let Some(index) = material else {
            return Ok((None, None));
        };
        let material = self.document.root.materials.get(index.value());
        let problem = "its material does not exist";
        let material = material.ok_or_else(|| ImportFault::malformed(place, problem))?;
        let color = material.pbr_metallic_roughness.base_color_texture.as_ref();
        let normal = material.normal_texture.as_ref();
        Ok((
            self.picture(color.map(|t| (t.index, t.tex_coord)), "base colour", place)?,
            self.picture(normal.map(|t| (t.index, t.tex_coord)), "normal", place)?,
        ))
    }

    /// Where a texture's picture is, given its set of texture coordinates. A picture that cannot be
    /// found is a note: the shape is still good.
    fn picture(
        &mut self,
        texture: Option<(Index<Texture>, u32)>,
        what: &str,
        place: &str,
    ) -> Result<Option<TextureSource>, ImportFault> {
        let root = self.document.root;
        let Some((texture, set)) = texture else {
            return Ok(None);
        };
        let bad = |problem: &str| ImportFault::malformed(place, format!("its {what} {problem}"));
        let texture = root.textures.get(texture.value());
        let texture = texture.ok_or_else(|| bad("texture does not exist"))?;
        if texture.source.value() == u32::MAX as usize {
            let note = format!("{place}: the {what} texture has no PNG or JPEG and is left out");
            self.file.notes.push(note);
            return Ok(None);
        }
        let image = root.images.get(texture.source.value());
        let image = image.ok_or_else(|| bad("image does not exist"))?;
        if set != 0 {
            let note = format!("{place}: the {what} picture is for TEXCOORD_{set} and is left out");
            self.file.notes.push(note);
            return Ok(None);
        }
        if let Some(view) = image.buffer_view {
            return Ok(Some(TextureSource::Embedded(
                self.document.view(view)?.to_vec(),
            )));
        }
        let Some(uri) = &image.uri else {
            return Err(bad("image has neither a bufferView nor a uri"));
        };
        Ok(match container::resolve(uri, self.path, place)? {
            Resource::Bytes(bytes) => Some(TextureSource::Embedded(bytes)),
            Resource::File(file) if file.is_file() => Some(TextureSource::File(file)),
            Resource::File(file) => {
                let note = format!("{place}: picture {} is not there", file.display());
                self.file.notes.push(note);
                None
            }
        })
    }
}

fn attribute(primitive: &Primitive, semantic: Semantic) -> Option<&Index<::gltf::json::Accessor>> {
    primitive.attributes.get(&Checked::Valid(semantic))
}

/// Triangles of `corners`, counter-clockwise as glTF orders them; `None` for points and lines.
fn triangulate(corners: &[u32], mode: Mode) -> Option<Vec<[u32; 3]>> {
    let windows = corners.windows(3);
    match mode {
        Mode::Triangles => Some(
            corners
                .chunks_exact(3)
                .map(|c| [c[0], c[1], c[2]])
                .collect(),
        ),
        // Every second triangle of a strip runs the other way round.
        Mode::TriangleStrip => Some(
            windows
                .enumerate()
                .map(|(k, w)| [w[0], w[1 + k % 2], w[2 - k % 2]])
                .collect(),
        ),
        Mode::TriangleFan => {
            let (&hub, rim) = corners.split_first()?;
            Some(rim.windows(2).map(|w| [hub, w[0], w[1]]).collect())
        }
        Mode::Points | Mode::Lines | Mode::LineLoop | Mode::LineStrip => None,
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn strips_and_fans_keep_the_side_they_face() {
        let strip = triangulate(&[0, 1, 2, 3, 4], Mode::TriangleStrip);
        assert_eq!(strip, Some(vec![[0, 1, 2], [1, 3, 2], [2, 3, 4]]));
        let fan = triangulate(&[7, 1, 2, 3], Mode::TriangleFan);
        assert_eq!(fan, Some(vec![[7, 1, 2], [7, 2, 3]]));
        assert_eq!(triangulate(&[0, 1, 2], Mode::LineStrip), None);
        assert_eq!(triangulate(&[0, 1], Mode::Triangles), Some(Vec::new()));
    }
}
