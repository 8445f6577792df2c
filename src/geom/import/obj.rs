//! OBJ: positions, texture coordinates, polygons and groups, with the line of every fault.
//!
//! Read here rather than by a crate: those at hand give no line numbers, panic on some broken
//! materials and invent texture coordinates where a face has none.

use super::error::ImportFault;
use super::part::{FileParts, Part, Room, TextureSource, read_bytes};
use glam::{Vec2, Vec3};
use std::collections::HashMap;
use std::path::Path;
use std::str::SplitWhitespace;

/// Reads the groups of the OBJ file `path` whose content is `bytes`.
pub(super) fn read(bytes: &[u8], path: &Path) -> Result<FileParts, ImportFault> {
    let text = String::from_utf8_lossy(bytes);
    let mut reader = Reader::default();
    let mut lines = text.trim_start_matches('\u{feff}').lines().enumerate();
    while let Some((number, line)) = lines.next() {
        let mut line = std::borrow::Cow::Borrowed(line);
        // A backslash at its end joins a line with the next one.
        while let Some(begun) = line.strip_suffix('\\') {
            let next = lines.next().map_or("", |(_, next)| next);
            line = format!("{begun} {next}").into();
        }
        reader
            .line(&line)
            .map_err(|problem| ImportFault::malformed(format!("line {}", number + 1), problem))?;
    }
    reader.finish(path)
}

#[derive(Default)]
struct Reader {
    positions: Vec<Vec3>,
    uvs: Vec<Vec2>,
    file: FileParts,
    /// The part being filled, and its vertex for each (position, texture coordinate) met.
    part: Part,
    part_uvs: Vec<Option<Vec2>>,
    vertices: HashMap<(usize, Option<usize>), u32>,
    library: Option<String>,
    material: Option<String>,
    lines_and_points: usize,
}

impl Reader {
    fn line(&mut self, line: &str) -> Result<(), String> {
        let line = line.split('#').next().unwrap_or("");
        let mut words = line.split_whitespace();
        match words.next() {
            Some("v") => self.positions.push(Vec3::from(numbers(words)?)),
            Some("vt") => {
                let [u, v] = numbers(words)?;
                // OBJ counts v upwards, glTF and this program downwards.
                self.uvs.push(Vec2::new(u, 1.0 - v));
            }
            Some("f") => self.face(words)?,
            Some("l" | "p") => self.lines_and_points += 1,
            Some("o" | "g") => {
                self.close_part();
                self.part.name = words.collect::<Vec<_>>().join(" ");
            }
            Some("mtllib") => self.library = Some(words.collect::<Vec<_>>().join(" ")),
            Some("usemtl") if self.material.is_none() => {
                self.material = Some(words.collect::<Vec<_>>().join(" "));
            }
            // Normals are computed anew; smoothing groups and other materials say nothing of shape.
            _ => {}
        }
        Ok(())
    }

    /// Adds one polygon as a fan.
    fn face(&mut self, words: SplitWhitespace) -> Result<(), String> {
        let corners = words
            .map(|word| self.corner(word))
            .collect::<Result<Vec<u32>, String>>()?;
        let Some((&hub, rim)) = corners.split_first().filter(|(_, rim)| rim.len() >= 2) else {
            return Err(format!("a face of {} corners", corners.len()));
        };
        self.part
            .triangles
            .extend(rim.windows(2).map(|pair| [hub, pair[0], pair[1]]));
        Ok(())
    }

    /// The part's vertex for `v`, `v/vt`, `v//vn` or `v/vt/vn`.
    fn corner(&mut self, word: &str) -> Result<u32, String> {
        let mut fields = word.split('/');
        let position = fields.next().unwrap_or("");
        let position = index(position, self.positions.len())
            .ok_or_else(|| format!("`{word}`: there are {} positions", self.positions.len()))?;
        let uv = match fields.next() {
            None | Some("") => None,
            Some(field) => Some(index(field, self.uvs.len()).ok_or_else(|| {
                format!("`{word}`: there are {} texture coordinates", self.uvs.len())
            })?),
        };
        let next = self.part.positions.len() as u32;
        let vertex = *self.vertices.entry((position, uv)).or_insert(next);
        if vertex == next {
            self.part.positions.push(self.positions[position]);
            self.part_uvs.push(uv.map(|uv| self.uvs[uv]));
        }
        Ok(vertex)
    }

    fn close_part(&mut self) {
        let mut part = std::mem::take(&mut self.part);
        part.uvs = self.part_uvs.drain(..).collect();
        self.vertices.clear();
        if !part.triangles.is_empty() {
            if part.name.is_empty() {
                part.name = format!("group {}", self.file.parts.len());
            }
            self.file.parts.push(part);
        }
    }

    fn finish(mut self, path: &Path) -> Result<FileParts, ImportFault> {
        self.close_part();
        let mut room = Room::default();
        for part in &self.file.parts {
            room.take(part.positions.len(), part.triangles.len())?;
        }
        if self.lines_and_points > 0 {
            let note = format!(
                "{} lines and points left out: they are no surface",
                self.lines_and_points
            );
            self.file.notes.push(note);
        }
        if let (Some(library), Some(material)) = (&self.library, &self.material) {
            let library = path.parent().unwrap_or(Path::new("")).join(library);
            match read_bytes(&library) {
                Ok(bytes) => {
                    let text = String::from_utf8_lossy(&bytes).into_owned();
                    let picture = picture_of(&text, material);
                    let file = picture.map(|name| library.with_file_name(name));
                    if let Some(gone) = file.as_ref().filter(|file| !file.is_file()) {
                        let note = format!("picture {} is not there", gone.display());
                        self.file.notes.push(note);
                    }
                    let source = file.filter(|file| file.is_file()).map(TextureSource::File);
                    for part in &mut self.file.parts {
                        part.base_color = source.clone();
                    }
                }
                Err(_) => self.file.notes.push(format!(
                    "material library {} cannot be read; the surface has no picture",
                    library.display()
                )),
            }
        }
        Ok(self.file)
    }
}

/// `map_Kd` of `material` in an MTL file, as a path below the library's folder.
fn picture_of(library: &str, material: &str) -> Option<String> {
    let mut inside = false;
    for line in library.lines().map(str::trim) {
        if let Some(name) = line.strip_prefix("newmtl ") {
            inside = name.trim() == material;
        } else if let Some(picture) = line.strip_prefix("map_Kd ").filter(|_| inside) {
            // Options stand before the name, each with its numbers.
            let is_option = |word: &&str| word.starts_with('-') || word.parse::<f32>().is_ok();
            let words: Vec<&str> = match picture.trim().starts_with('-') {
                true => picture.split_whitespace().skip_while(is_option).collect(),
                false => vec![picture.trim()],
            };
            let name = words.join(" ").replace('\\', "/");
            // A root would lead out of the library's folder.
            return Some(name.trim_start_matches('/').to_owned());
        }
    }
    None
}

/// Exactly the first `N` numbers; more may follow (a weight, a colour) and are left out.
fn numbers<const N: usize>(mut words: SplitWhitespace) -> Result<[f32; N], String> {
    let mut numbers = [0.0; N];
    for number in &mut numbers {
        let word = words.next().ok_or(format!("{N} numbers are needed"))?;
        *number = word.parse().map_err(|_| format!("`{word}` is no number"))?;
    }
    Ok(numbers)
}

/// OBJ's index, from 1 or backwards from -1, as one from 0; `None` if it is out of range.
fn index(word: &str, count: usize) -> Option<usize> {
    let number: i64 = word.parse().ok()?;
    let index = if number < 0 {
        number.checked_add_unsigned(count as u64)?
    } else {
        number - 1
    };
    usize::try_from(index).ok().filter(|&index| index < count)
}
