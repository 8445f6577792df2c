//! What is worked out once for a user's file and kept for the next start: texture coordinates made anew,
//! painted tissue.
//!
//! A file of the cache is named by a hash of all that its content follows from, this program's own geometry
//! among it, and ends in a hash of what it holds. One that is cut short, changed or foreign is passed over and
//! made anew; a folder that can't be written is left alone. What is read is, bit for bit, what would be made.

use crate::geom::SurfaceMesh;
use crate::geom::import::read_file;
use crate::geom::paint::{Tissue, TissueMaps, paint};
use crate::geom::unwrap::unwrap;
use crate::measure::files::{create_folder, write};
use glam::{Vec2, Vec3};
use image::codecs::png::{CompressionType, FilterType, PngEncoder};
use image::{DynamicImage, ExtendedColorType, ImageEncoder, ImageFormat, RgbaImage};
use sha2::{Digest, Sha256};
use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

/// What takes less is not kept.
const WORTH: Duration = Duration::from_millis(300);
/// Beyond this the oldest files are removed [bytes].
const BYTES_MAX: u64 = 1 << 28;
const HASH_BYTES: usize = 32;
/// Ending of the files here.
const ENDING: &str = "kept";

/// A folder of results.
pub struct Cache {
    folder: Option<PathBuf>,
    worth: Duration,
}

impl Cache {
    /// `$XDG_CACHE_HOME/palpate`, or `.cache/palpate` in the user's home; without either nothing is kept.
    pub fn of_user() -> Self {
        let named = std::env::var_os("XDG_CACHE_HOME").map(PathBuf::from);
        let folder = named
            .filter(|folder| folder.is_absolute())
            .or_else(|| std::env::home_dir().map(|home| home.join(".cache")));
        Self {
            folder: folder.map(|folder| folder.join("palpate")),
            worth: WORTH,
        }
    }

    /// [`unwrap`], or what it gave before.
    pub fn unwrapped(&self, points: &[Vec3], triangles: &[[u32; 3]]) -> SurfaceMesh {
        let mut key = Key::new("texture coordinates");
        key.add(bytemuck::cast_slice(points));
        key.add(bytemuck::cast_slice(triangles));
        self.kept(
            &key.name(),
            |bytes| mesh_of(bytes, points, triangles),
            mesh_bytes,
            || unwrap(points, triangles),
        )
    }

    /// [`paint`], or what it gave before.
    pub fn painted(&self, mesh: &SurfaceMesh, tissue: Tissue, size_px: u32) -> TissueMaps {
        let mut key = Key::new("tissue");
        key.add(tissue.name().as_bytes());
        key.add(&size_px.to_le_bytes());
        key.add(bytemuck::cast_slice(&mesh.points));
        key.add(bytemuck::cast_slice(&mesh.point_of));
        key.add(bytemuck::cast_slice(&mesh.uvs));
        key.add(bytemuck::cast_slice(&mesh.triangles));
        self.kept(
            &key.name(),
            |bytes| maps_of(bytes, size_px),
            |maps| maps_bytes(maps).unwrap_or_default(),
            || paint(mesh, tissue, size_px),
        )
    }

    /// What is kept as `name`, if `read` understands it, else what `make` gives; that is kept if it took long.
    fn kept<T>(
        &self,
        name: &str,
        read: impl Fn(&[u8]) -> Option<T>,
        bytes: impl Fn(&T) -> Vec<u8>,
        make: impl FnOnce() -> T,
    ) -> T {
        let file = self.folder.as_ref().map(|folder| folder.join(name));
        if let Some(kept) = file
            .as_deref()
            .and_then(sound_content)
            .as_deref()
            .and_then(&read)
        {
            return kept;
        }
        let start = Instant::now();
        let made = make();
        if let (Some(folder), Some(file)) = (&self.folder, &file)
            && start.elapsed() >= self.worth
        {
            let mut content = bytes(&made);
            content.extend(Sha256::digest(&content));
            // A folder that takes nothing costs the next start some time, and no more.
            if create_folder(folder).is_ok() && write(file, &content).is_ok() {
                remove_oldest(folder);
            }
        }
        made
    }
}

/// The name of a result: a hash of what it follows from.
struct Key(Sha256);

impl Key {
    fn new(kind: &str) -> Self {
        let mut key = Self(Sha256::new());
        key.add(env!("PALPATE_GEOM_REVISION").as_bytes());
        key.add(kind.as_bytes());
        key
    }

    /// Adds bytes with their number, so that no two lists run together.
    fn add(&mut self, bytes: &[u8]) {
        self.0.update((bytes.len() as u64).to_le_bytes());
        self.0.update(bytes);
    }

    fn name(self) -> String {
        let digits: String = (self.0.finalize().iter())
            .map(|byte| format!("{byte:02x}"))
            .collect();
        format!("{digits}.{ENDING}")
    }
}

/// The content of `file` without its hash, if the hash is right.
fn sound_content(file: &Path) -> Option<Vec<u8>> {
    let mut bytes = read_file(file).ok()?;
    let hash = bytes.split_off(bytes.len().checked_sub(HASH_BYTES)?);
    (Sha256::digest(&bytes)[..] == hash[..]).then_some(bytes)
}

/// Removes the oldest results of `folder` until the rest is small enough; other files stay.
fn remove_oldest(folder: &Path) {
    let Ok(entries) = std::fs::read_dir(folder) else {
        return;
    };
    let mut files: Vec<_> = entries
        .flatten()
        .filter(|entry| entry.path().extension().is_some_and(|e| e == ENDING))
        .filter_map(|entry| {
            let about = entry.metadata().ok()?;
            Some((about.modified().ok()?, about.len(), entry.path()))
        })
        .collect();
    files.sort();
    let mut total: u64 = files.iter().map(|(_, bytes, _)| bytes).sum();
    for (_, bytes, path) in files {
        if total <= BYTES_MAX {
            return;
        }
        if std::fs::remove_file(path).is_ok() {
            total -= bytes;
        }
    }
}

/// Number of vertices, their points and texture coordinates, the triangles.
fn mesh_bytes(mesh: &SurfaceMesh) -> Vec<u8> {
    let parts: [&[u8]; 4] = [
        &(mesh.point_of.len() as u32).to_le_bytes(),
        bytemuck::cast_slice(&mesh.point_of),
        bytemuck::cast_slice(&mesh.uvs),
        bytemuck::cast_slice(&mesh.triangles),
    ];
    parts.concat()
}

/// The mesh of [`mesh_bytes`], if it is one of these points and triangles.
fn mesh_of(bytes: &[u8], points: &[Vec3], triangles: &[[u32; 3]]) -> Option<SurfaceMesh> {
    let (count, rest) = bytes.split_first_chunk::<4>()?;
    let count = u32::from_le_bytes(*count) as usize;
    let (point_of, rest) = rest.split_at_checked(count.checked_mul(4)?)?;
    let (uvs, corners) = rest.split_at_checked(count.checked_mul(8)?)?;
    if corners.len() != 12 * triangles.len() {
        return None;
    }
    let mesh = SurfaceMesh {
        points: points.to_vec(),
        point_of: words(point_of).collect(),
        uvs: (uvs.chunks_exact(8))
            .map(|uv| {
                let mut sides = words(uv).map(f32::from_bits);
                Vec2::from_array(std::array::from_fn(|_| sides.next().unwrap_or_default()))
            })
            .collect(),
        triangles: (corners.chunks_exact(12))
            .map(|triangle| {
                let mut corners = words(triangle);
                std::array::from_fn(|_| corners.next().unwrap_or_default())
            })
            .collect(),
    };
    let in_square = |uv: &Vec2| uv.min_element() >= 0.0 && uv.max_element() <= 1.0;
    let fits = mesh.uvs.iter().all(in_square)
        && (mesh.point_of.iter()).all(|&point| (point as usize) < points.len())
        && (mesh.triangles.iter().flatten()).all(|&vertex| (vertex as usize) < count);
    (fits && mesh.point_triangles() == triangles).then_some(mesh)
}

fn words(bytes: &[u8]) -> impl Iterator<Item = u32> {
    let words = bytes.chunks_exact(4);
    words.map(|word| u32::from_le_bytes(word.try_into().expect("four bytes")))
}

/// Each map as a PNG with its length before it: outer, normal, inner, then the layers.
fn maps_bytes(maps: &TissueMaps) -> image::ImageResult<Vec<u8>> {
    let layers: Vec<RgbaImage> = maps.layers.iter().map(DynamicImage::to_rgba8).collect();
    let pictures = [&maps.outer, &maps.normal, &maps.inner];
    let mut bytes = Vec::new();
    for picture in pictures.into_iter().chain(&layers) {
        let mut png = Vec::new();
        PngEncoder::new_with_quality(&mut png, CompressionType::Fast, FilterType::Adaptive)
            .write_image(
                picture,
                picture.width(),
                picture.height(),
                ExtendedColorType::Rgba8,
            )?;
        bytes.extend((png.len() as u32).to_le_bytes());
        bytes.extend(png);
    }
    Ok(bytes)
}

/// The maps of [`maps_bytes`], if they have this side.
fn maps_of(bytes: &[u8], size_px: u32) -> Option<TissueMaps> {
    let mut rest = bytes;
    let mut next = || {
        let (length, after) = rest.split_first_chunk::<4>()?;
        let (png, after) = after.split_at_checked(u32::from_le_bytes(*length) as usize)?;
        rest = after;
        let picture = image::load_from_memory_with_format(png, ImageFormat::Png).ok()?;
        ((picture.width(), picture.height()) == (size_px, size_px)).then(|| picture.into_rgba8())
    };
    Some(TissueMaps {
        size_px,
        outer: next()?,
        normal: next()?,
        inner: next()?,
        layers: vec![DynamicImage::ImageRgba8(next()?)],
    })
}

#[cfg(test)]
mod tests {
    use super::*;
    use std::sync::atomic::{AtomicU32, Ordering};

    /// A cache of its own for each test, which keeps everything; its folder is gone when the test ends well.
    struct Fresh(Cache);

    impl Fresh {
        fn new() -> Self {
            static NEXT: AtomicU32 = AtomicU32::new(0);
            let number = NEXT.fetch_add(1, Ordering::Relaxed);
            let name = format!("palpate-cache-{}-{number}", std::process::id());
            Self(Cache {
                folder: Some(std::env::temp_dir().join(name)),
                worth: Duration::ZERO,
            })
        }

        fn folder(&self) -> &Path {
            self.0.folder.as_ref().expect("it has one")
        }

        /// The files in it, sorted.
        fn files(&self) -> Vec<PathBuf> {
            let entries = std::fs::read_dir(self.folder()).into_iter().flatten();
            let mut files: Vec<PathBuf> = entries.map(|entry| entry.unwrap().path()).collect();
            files.sort();
            files
        }
    }

    impl Drop for Fresh {
        fn drop(&mut self) {
            let _ = std::fs::remove_dir_all(self.folder());
        }
    }

    const POINTS: [Vec3; 4] = [Vec3::ZERO, Vec3::X, Vec3::Y, Vec3::Z];
    const TRIANGLES: [[u32; 3]; 4] = [[0, 2, 1], [0, 1, 3], [1, 2, 3], [0, 3, 2]];

    #[test]
    fn what_is_kept_is_what_would_be_made_and_is_read_the_second_time() {
        let fresh = Fresh::new();
        let made = fresh.0.unwrapped(&POINTS, &TRIANGLES);
        assert_eq!(made, unwrap(&POINTS, &TRIANGLES));
        assert_eq!(fresh.files().len(), 1);
        let read = sound_content(&fresh.files()[0]).expect("its hash is right");
        assert_eq!(mesh_of(&read, &POINTS, &TRIANGLES), Some(made.clone()));
        let maps = fresh.0.painted(&made, Tissue::Spleen, 32);
        assert_eq!(fresh.files().len(), 2);
        assert_eq!(fresh.0.painted(&made, Tissue::Spleen, 32), maps);
        assert_eq!(maps, paint(&made, Tissue::Spleen, 32));
        // Another tissue, size or shape is another result.
        fresh.0.painted(&made, Tissue::Liver, 32);
        fresh.0.painted(&made, Tissue::Spleen, 16);
        fresh.0.unwrapped(&POINTS.map(|p| 2.0 * p), &TRIANGLES);
        assert_eq!(fresh.files().len(), 5);
    }

    #[test]
    fn kept_files_that_are_cut_short_changed_or_foreign_are_made_anew() {
        let fresh = Fresh::new();
        let made = fresh.0.unwrapped(&POINTS, &TRIANGLES);
        let file = fresh.files().remove(0);
        let sound = std::fs::read(&file).unwrap();
        let mut changed = sound.clone();
        changed[9] ^= 1;
        // A content that says something else, with its own right hash.
        let mut foreign = mesh_bytes(&unwrap(&POINTS, &TRIANGLES[..3]));
        foreign.extend(Sha256::digest(&foreign));
        let mut huge = u32::MAX.to_le_bytes().to_vec();
        huge.extend(Sha256::digest(&huge));
        for bad in [&sound[..40], &changed, b"", b"short", &foreign, &huge] {
            std::fs::write(&file, bad).unwrap();
            assert_eq!(fresh.0.unwrapped(&POINTS, &TRIANGLES), made);
            assert_eq!(std::fs::read(&file).unwrap(), sound, "it is mended");
        }
        std::fs::remove_file(&file).unwrap();
        std::fs::create_dir(&file).unwrap();
        assert_eq!(fresh.0.unwrapped(&POINTS, &TRIANGLES), made);
    }

    #[test]
    fn without_a_folder_or_with_a_file_in_its_place_nothing_is_kept() {
        let fresh = Fresh::new();
        std::fs::write(fresh.folder(), b"mine").unwrap();
        let made = fresh.0.unwrapped(&POINTS, &TRIANGLES);
        assert_eq!(made, unwrap(&POINTS, &TRIANGLES));
        assert_eq!(std::fs::read(fresh.folder()).unwrap(), b"mine");
        std::fs::remove_file(fresh.folder()).unwrap();
        let none = Cache {
            folder: None,
            worth: Duration::ZERO,
        };
        assert_eq!(none.unwrapped(&POINTS, &TRIANGLES), made);
    }

    #[test]
    fn what_takes_no_time_is_not_kept() {
        let mut fresh = Fresh::new();
        fresh.0.worth = WORTH;
        fresh.0.unwrapped(&POINTS, &TRIANGLES);
        assert_eq!(fresh.files(), Vec::<PathBuf>::new());
    }

    #[test]
    fn oldest_results_go_when_there_is_too_much_and_other_files_stay() {
        let fresh = Fresh::new();
        create_folder(fresh.folder()).unwrap();
        for (number, name) in ["a.kept", "b.kept", "c.kept", "d.txt"]
            .into_iter()
            .enumerate()
        {
            // Files of zeros that take no room on the disk.
            let file = std::fs::File::create(fresh.folder().join(name)).unwrap();
            file.set_len(BYTES_MAX / 2).unwrap();
            let age = Duration::from_secs(1000 - 100 * number as u64);
            file.set_modified(std::time::SystemTime::now() - age)
                .unwrap();
        }
        remove_oldest(fresh.folder());
        let left: Vec<_> = fresh
            .files()
            .iter()
            .map(|f| f.file_name().unwrap().to_owned())
            .collect();
        assert_eq!(left, ["b.kept", "c.kept", "d.txt"]);
    }
}
