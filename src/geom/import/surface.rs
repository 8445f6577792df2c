//! From the parts of a file to one closed surface that faces outwards.

use super::closure::closing_selections;
use super::error::{ImportError, ImportFault};
use super::part::{FileParts, Part, TextureSource, parts_of, read_parts};
use super::repair::{Close, Repair, repair, split_touching_points};
use super::topology::{defects, flips, pieces};
use super::uv::{UvState, triangles_without_uv_area, uv_state};
use super::weld::{Union, weld, weld_near_borders};
use crate::geom::{SurfaceMesh, bounds, volume_m3};
use glam::Vec2;
use std::path::Path;

/// Closed selections of parts that are built to compare their volumes; the rest are smaller.
const SELECTIONS_TRIED_MAX: usize = 32;
/// Parts that are tried for repair, largest first.
const REPAIRS_TRIED_MAX: usize = 8;
/// A closed part shorter than this share of the file's diagonal is thought to be an ornament: a
/// repair of the rest is tried too.
const ORNAMENT_SHARE: f32 = 0.25;
/// Volumes that differ by less are the same shape in other cuts; then the finer cut is used.
const SAME_VOLUME: f64 = 0.01;
/// A surface that encloses less than this share of its box's diagonal cubed is a sheet.
const FLAT_SHARE: f64 = 1e-9;

/// What of a file is wanted.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ImportOptions {
    /// Only meshes with one of these in their name, without regard to case. `None`: whatever closes.
    pub meshes: Option<Vec<String>>,
}

/// A closed surface that faces outwards, and what was done to get it.
#[derive(Clone, Debug)]
pub struct ImportedSurface {
    /// The surface: every edge has two triangles, every point one fan, the volume is positive.
    pub mesh: SurfaceMesh,
    /// Whether [`SurfaceMesh::uvs`] can be used; they are zeros where [`UvState::Missing`].
    pub uv: UvState,
    /// What was left out, joined or mended; a sentence each.
    pub notes: Vec<String>,
    /// The picture of colour of the material that covers most of the surface.
    pub base_color: Option<TextureSource>,
    /// The picture of normals of the same material.
    pub normal: Option<TextureSource>,
    /// Names of the meshes that the surface is made of.
    pub meshes_used: Vec<String>,
}

/// Reads the closed surface in a `.glb`, `.gltf` or `.obj` file.
///
/// If the meshes do not close together, the selection that does and encloses most is used; small
/// defects are mended. Every such step leaves a note.
///
/// # Errors
///
/// [`ImportError`] if the file cannot be read, names an unknown mesh or holds nothing that closes.
pub fn read_surface(path: &Path, options: &ImportOptions) -> Result<ImportedSurface, ImportError> {
    let file = read_parts(path)?;
    closed_surface(file, options).map_err(|fault| fault.of(path))
}

/// As [`read_surface`] for the `bytes` of a file that is inside the binary; `path` is its name.
///
/// # Errors
///
/// As [`read_surface`].
pub fn read_surface_bytes(
    path: &Path,
    bytes: &[u8],
    options: &ImportOptions,
) -> Result<ImportedSurface, ImportError> {
    parts_of(path, bytes)
        .and_then(|file| closed_surface(file, options))
        .map_err(|fault| fault.of(path))
}

fn closed_surface(
    file: FileParts,
    options: &ImportOptions,
) -> Result<ImportedSurface, ImportFault> {
    let parts = select(file.parts, options)?;
    close_parts(&parts, file.notes)
}

/// The parts whose name is asked for.
fn select(parts: Vec<Part>, options: &ImportOptions) -> Result<Vec<Part>, ImportFault> {
    let Some(wanted) = &options.meshes else {
        return Ok(parts);
    };
    let matches =
        |part: &Part, wanted: &String| part.name.to_lowercase().contains(&wanted.to_lowercase());
    if let Some(unknown) = wanted.iter().find(|w| !parts.iter().any(|p| matches(p, w))) {
        return Err(ImportFault::NoSuchMesh {
            wanted: unknown.clone(),
            known: parts.into_iter().map(|part| part.name).collect(),
        });
    }
    let is_wanted = |part: &Part| wanted.iter().any(|wanted| matches(part, wanted));
    Ok(parts.into_iter().filter(is_wanted).collect())
}

/// The closed surface in `parts`; `notes` are extended.
pub(super) fn close_parts(
    parts: &[Part],
    mut notes: Vec<String>,
) -> Result<ImportedSurface, ImportFault> {
    let mut union = weld(parts);
    let joined = weld_near_borders(&mut union);
    if joined > 0 {
        notes.push(format!(
            "{joined} border points joined with another within a millionth of the extent"
        ));
    }
    let degenerate = union.drop_degenerate();
    if degenerate > 0 {
        notes.push(format!("{degenerate} degenerate triangles dropped"));
    }
    let closed = choose(&union, parts.len())?;
    closed.describe(parts, &mut notes);
    Ok(closed.into_surface(parts, notes))
}

/// A closed, outward piece of a union.
struct Closed {
    union: Union,
    volume_m3: f64,
    duplicates: usize,
    repair: Repair,
    split: usize,
    flipped: usize,
    pieces_left_out: usize,
}

/// The closed surface to use: all parts if they close, else the selection that encloses most, else
/// what a repair makes of them.
fn choose(union: &Union, part_count: usize) -> Result<Closed, ImportFault> {
    let whole = match close(union, Mend::No) {
        Ok(closed) => return Ok(closed),
        Err(fault) => fault,
    };
    let mut found: Vec<Closed> = Vec::new();
    let mut selections = closing_selections(union, part_count);
    selections.extend(closed_alone(union, part_count));
    let volumes = part_volumes_m3(union, part_count);
    selections.sort_by_cached_key(|selection| {
        let sum: f64 = selection.iter().map(|&part| volumes[part as usize]).sum();
        // Positive numbers are ordered as their bits are.
        (std::cmp::Reverse(sum.abs().to_bits()), selection.clone())
    });
    for selection in selections.iter().take(SELECTIONS_TRIED_MAX) {
        let chosen = union.of_parts(|part| selection.binary_search(&part).is_ok());
        found.extend(close(&chosen, Mend::No));
    }
    let mut mended = Vec::new();
    if let Some(best) = largest(found) {
        if best.diagonal_m() >= ORNAMENT_SHARE * diagonal_m(union) {
            return Ok(best);
        }
        mended.push(best);
    }
    mended.extend(close(union, Mend::Yes));
    if part_count > 1 {
        let mut counts = vec![0_usize; part_count];
        for face in &union.faces {
            counts[face.part as usize] += 1;
        }
        let mut order: Vec<u32> = (0..part_count as u32).collect();
        order.sort_by_key(|&part| (std::cmp::Reverse(counts[part as usize]), part));
        for &part in order.iter().take(REPAIRS_TRIED_MAX) {
            mended.extend(close(&union.of_parts(|other| other == part), Mend::Yes));
        }
    }
    if mended.is_empty() {
        mended.extend(close(union, Mend::Openings));
    }
    largest(mended).ok_or(match whole {
        ImportFault::Open {
            border_edges,
            crowded_edges,
            ..
        } => ImportFault::Open {
            border_edges,
            crowded_edges,
            meshes: part_count,
        },
        other => other,
    })
}

/// The largest by volume; among those of the same volume the one of most parts.
fn largest(found: Vec<Closed>) -> Option<Closed> {
    let most = found.iter().map(|c| c.volume_m3).fold(0.0, f64::max);
    found
        .into_iter()
        .filter(|closed| closed.volume_m3 >= (1.0 - SAME_VOLUME) * most)
        .max_by_key(|closed| (closed.parts_used().len(), closed.volume_m3.to_bits()))
}

/// Parts without a border of their own, each as a selection.
fn closed_alone(union: &Union, part_count: usize) -> Vec<Vec<u32>> {
    if part_count < 2 {
        return Vec::new();
    }
    let mut triangles: Vec<Vec<[u32; 3]>> = vec![Vec::new(); part_count];
    for face in &union.faces {
        triangles[face.part as usize].push(union.face_points(face));
    }
    let closed = |part: &usize| !triangles[*part].is_empty() && defects(&triangles[*part]).none();
    (0..part_count)
        .filter(closed)
        .map(|part| vec![part as u32])
        .collect()
}

/// Signed volume under each part, seen from the origin; a sum over parts that close is theirs if
/// they already face the same way. For the order of trying only.
fn part_volumes_m3(union: &Union, part_count: usize) -> Vec<f64> {
    let mut volumes = vec![0.0; part_count];
    for face in &union.faces {
        volumes[face.part as usize] += volume_m3(&union.points, &[union.face_points(face)]);
    }
    volumes
}

fn diagonal_m(union: &Union) -> f32 {
    let corners = union.faces.iter().flat_map(|face| union.face_points(face));
    let used: Vec<_> = corners.map(|point| union.points[point as usize]).collect();
    let (low, high) = bounds(&used);
    low.distance(high)
}

#[derive(Clone, Copy, PartialEq)]
enum Mend {
    No,
    Yes,
    Openings,
}

/// Makes `union` closed, consistent and outward, and keeps its largest piece.
fn close(union: &Union, mend: Mend) -> Result<Closed, ImportFault> {
    let mut union = union.clone();
    let duplicates = union.drop_duplicates();
    let mut done = Repair::default();
    let mut left = defects(&union.point_triangles());
    let what = match mend {
        Mend::No => None,
        Mend::Yes => Some(Close::Holes),
        Mend::Openings => Some(Close::Openings),
    };
    if let Some(what) = what {
        match repair(&mut union, what) {
            Ok(repair) => (done, left) = (repair, Default::default()),
            Err(defects) => left = defects,
        }
    }
    if union.faces.is_empty() {
        return Err(ImportFault::Flat);
    }
    if !left.none() {
        return Err(ImportFault::Open {
            border_edges: left.border,
            crowded_edges: left.crowded,
            meshes: 1,
        });
    }
    let split = split_touching_points(&mut union);
    let mut flip = flips(&union.point_triangles()).ok_or(ImportFault::OneSided)?;
    for (face, &flip) in union.faces.iter_mut().zip(&flip) {
        if flip {
            face.corners.swap(1, 2);
        }
    }
    let (piece, volume_m3, pieces) = largest_piece(&union);
    if volume_m3 < 0.0 {
        for (face, flip) in union.faces.iter_mut().zip(&mut flip) {
            face.corners.swap(1, 2);
            *flip = !*flip;
        }
    }
    let mut kept = piece.iter().zip(&flip).map(|(&kept, &flip)| kept && flip);
    let flipped = kept.by_ref().filter(|&flip| flip).count();
    let mut piece = piece.iter();
    union
        .faces
        .retain(|_| *piece.next().expect("one flag a face"));
    let volume_m3 = volume_m3.abs();
    if volume_m3 <= FLAT_SHARE * f64::from(diagonal_m(&union)).powi(3) {
        return Err(ImportFault::Flat);
    }
    Ok(Closed {
        union,
        volume_m3,
        duplicates,
        repair: done,
        split,
        flipped,
        pieces_left_out: pieces - 1,
    })
}

/// Which faces are of the piece that encloses most, its signed volume, and how many pieces there are.
fn largest_piece(union: &Union) -> (Vec<bool>, f64, usize) {
    let triangles = union.point_triangles();
    let piece_of = pieces(&triangles);
    let count = piece_of.iter().max().map_or(0, |&last| last as usize + 1);
    let mut members: Vec<Vec<[u32; 3]>> = vec![Vec::new(); count];
    for (&piece, &triangle) in piece_of.iter().zip(&triangles) {
        members[piece as usize].push(triangle);
    }
    let volumes: Vec<f64> = members
        .iter()
        .map(|t| volume_m3(&union.points, t))
        .collect();
    let largest = (0..count)
        .max_by(|&a, &b| volumes[a].abs().total_cmp(&volumes[b].abs()))
        .expect("there is a face");
    let kept = piece_of.iter().map(|&piece| piece as usize == largest);
    (kept.collect(), volumes[largest], count)
}

impl Closed {
    fn diagonal_m(&self) -> f32 {
        diagonal_m(&self.union)
    }

    /// The parts with a face in the surface, in order.
    fn parts_used(&self) -> Vec<u32> {
        let mut parts: Vec<u32> = self.union.faces.iter().map(|face| face.part).collect();
        parts.sort_unstable();
        parts.dedup();
        parts
    }

    /// Adds a note for everything that was done.
    fn describe(&self, parts: &[Part], notes: &mut Vec<String>) {
        let used = self.parts_used();
        if used.len() < parts.len() {
            let names = |wanted: bool| {
                let parts = parts.iter().enumerate();
                let chosen = parts.filter(|(k, _)| used.contains(&(*k as u32)) == wanted);
                chosen
                    .map(|(_, part)| part.name.as_str())
                    .collect::<Vec<_>>()
                    .join(", ")
            };
            notes.push(format!(
                "{} of {} meshes close to the largest volume and are used: {}; left out: {}",
                used.len(),
                parts.len(),
                names(true),
                names(false)
            ));
        }
        let mut note = |count: usize, text: &str| {
            if count > 0 {
                notes.push(format!("{count} {text}"));
            }
        };
        note(self.duplicates, "triangles dropped that repeat another");
        note(
            self.repair.removed,
            "triangles cut out where more than two met at an edge",
        );
        note(self.repair.holes, "small holes closed");
        note(
            self.repair.openings,
            "openings closed by lids: the body is filled as if it were solid; give a vessel or a cup its \
             wall in a modelling program",
        );
        note(
            self.split,
            "points doubled where two sheets touch in one point",
        );
        note(
            self.flipped,
            "triangles turned to face outwards like the rest",
        );
        note(self.pieces_left_out, "smaller closed pieces left out");
    }

    fn into_surface(self, parts: &[Part], mut notes: Vec<String>) -> ImportedSurface {
        let used = self.parts_used();
        let with_uv = used.iter().all(|&part| parts[part as usize].uvs.is_some());
        let mesh = surface_mesh(&self.union, with_uv);
        let uv = if with_uv {
            uv_state(&mesh)
        } else {
            UvState::Missing
        };
        if uv == UvState::Usable {
            let flat = triangles_without_uv_area(&mesh);
            if flat > 0 {
                notes.push(format!("{flat} triangles have no area in the texture"));
            }
        } else {
            notes.push(format!("texture coordinates are {uv}"));
        }
        let mut faces = vec![0_usize; parts.len()];
        for face in &self.union.faces {
            faces[face.part as usize] += 1;
        }
        let pictured = used
            .iter()
            .filter(|&&part| parts[part as usize].base_color.is_some());
        let pictured = pictured.max_by_key(|&&part| faces[part as usize]);
        let pictured = pictured.map(|&part| &parts[part as usize]);
        let name = |&part: &u32| parts[part as usize].name.clone();
        ImportedSurface {
            mesh,
            uv,
            notes,
            base_color: pictured.and_then(|part| part.base_color.clone()),
            normal: pictured.and_then(|part| part.normal.clone()),
            meshes_used: used.iter().map(name).collect(),
        }
    }
}

/// The faces of `union` with the points and vertices they use, in their order. Without texture
/// coordinates a point has one vertex, with zeros.
fn surface_mesh(union: &Union, with_uv: bool) -> SurfaceMesh {
    let vertex_of = |vertex: u32| {
        let point = union.vertices[vertex as usize].point;
        if with_uv { vertex } else { point }
    };
    let count = if with_uv {
        union.vertices.len()
    } else {
        union.points.len()
    };
    let mut used = vec![false; count];
    let mut point_used = vec![false; union.points.len()];
    for &corner in union.faces.iter().flat_map(|face| &face.corners) {
        used[vertex_of(corner) as usize] = true;
        point_used[union.vertices[corner as usize].point as usize] = true;
    }
    let (new_point, point_count) = renumber(&point_used);
    let (new_vertex, _) = renumber(&used);
    let mut mesh = SurfaceMesh {
        points: Vec::with_capacity(point_count),
        ..SurfaceMesh::default()
    };
    let points = union.points.iter().zip(&point_used);
    mesh.points
        .extend(points.filter(|(_, used)| **used).map(|(&p, _)| p));
    for vertex in (0..count).filter(|&vertex| used[vertex]) {
        let (point, uv) = if with_uv {
            (union.vertices[vertex].point, union.vertices[vertex].uv)
        } else {
            (vertex as u32, Vec2::ZERO)
        };
        mesh.point_of.push(new_point[point as usize]);
        mesh.uvs.push(uv);
    }
    let corner = |corner: u32| new_vertex[vertex_of(corner) as usize];
    mesh.triangles = union
        .faces
        .iter()
        .map(|face| face.corners.map(corner))
        .collect();
    mesh
}

/// The place of each marked item among the marked ones, and how many there are.
fn renumber(marked: &[bool]) -> (Vec<u32>, usize) {
    let mut count = 0;
    let places = marked.iter().map(|&marked| {
        let place = count;
        count += u32::from(marked);
        place
    });
    let places = places.collect();
    (places, count as usize)
}
