//! Files that are whole or absent: written beside their place and moved there when complete.

use npyz::WriterBuilder;
use std::fmt;
use std::fs::File;
use std::io::{self, BufWriter, Write};
use std::path::{Path, PathBuf};

/// A file of a run that could not be written, read or understood.
#[derive(Debug)]
pub enum FileError {
    /// The system refused to write it.
    Write {
        /// The file.
        file: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// The system refused to read it.
    Read {
        /// The file.
        file: PathBuf,
        /// What the system says.
        source: io::Error,
    },
    /// A folder is to be where a file is.
    NoFolder {
        /// The file.
        file: PathBuf,
    },
    /// It was read but does not hold what it should.
    Content {
        /// The file.
        file: PathBuf,
        /// What is wrong, and what to do.
        problem: String,
    },
}

impl fmt::Display for FileError {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Write { file, source } => write!(
                f,
                "cannot write {}: {source}; check that the folder may be written and has room",
                file.display()
            ),
            Self::Read { file, source } => {
                write!(
                    f,
                    "cannot read {}: {source}; check the path",
                    file.display()
                )
            }
            Self::NoFolder { file } => write!(
                f,
                "{} is a file, and the results need a folder: name another place",
                file.display()
            ),
            Self::Content { file, problem } => write!(f, "{}: {problem}", file.display()),
        }
    }
}

impl std::error::Error for FileError {
    fn source(&self) -> Option<&(dyn std::error::Error + 'static)> {
        match self {
            Self::Write { source, .. } | Self::Read { source, .. } => Some(source),
            Self::NoFolder { .. } | Self::Content { .. } => None,
        }
    }
}

/// Makes the folder and those above it, and sees that a file can be made in it: a long run should not find
/// out at its end.
///
/// # Errors
///
/// [`FileError::NoFolder`] if it or one above it is a file, else [`FileError::Write`].
pub fn create_folder(folder: &Path) -> Result<(), FileError> {
    if let Some(file) = folder.ancestors().find(|above| above.is_file()) {
        return Err(FileError::NoFolder {
            file: file.to_owned(),
        });
    }
    let trial = folder.join(format!("trial.{}.partial", std::process::id()));
    std::fs::create_dir_all(folder)
        .and_then(|()| File::create(&trial))
        .and_then(|_| std::fs::remove_file(&trial))
        .map_err(|source| FileError::Write {
            file: folder.to_owned(),
            source,
        })
}

/// Reads a whole file.
///
/// # Errors
///
/// [`FileError::Read`].
pub fn read(file: &Path) -> Result<Vec<u8>, FileError> {
    std::fs::read(file).map_err(|source| FileError::Read {
        file: file.to_owned(),
        source,
    })
}

/// Puts `bytes` into `file`, whole or not at all.
///
/// # Errors
///
/// [`FileError::Write`]; what was in `file` before is then still there.
pub fn write(file: &Path, bytes: &[u8]) -> Result<(), FileError> {
    write_with(file, |out| out.write_all(bytes))
}

/// Lets `fill` write the content of `file`, which appears under its name only when complete.
///
/// A link stays and what it points to is written. A pipe or a device (`/dev/null`, `/dev/stdout`)
/// takes the bytes as they come: nothing may be moved into its place.
///
/// # Errors
///
/// [`FileError::Write`] if the system or `fill` fails; what was in `file` before is then still
/// there.
pub fn write_with(
    file: &Path,
    fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> Result<(), FileError> {
    let written = match std::fs::metadata(file) {
        Ok(there) if !there.is_file() && !there.is_dir() => stream_into(file, fill),
        Ok(_) => std::fs::canonicalize(file).and_then(|place| replace(&place, fill)),
        Err(_) => replace(file, fill),
    };
    written.map_err(|source| FileError::Write {
        file: file.to_owned(),
        source,
    })
}

/// Fills a pipe or a device that is there.
fn stream_into(
    file: &Path,
    fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> io::Result<()> {
    let mut out = BufWriter::new(File::options().write(true).open(file)?);
    fill(&mut out)?;
    out.flush()
}

/// Fills a new file beside `file` and moves it there when it is whole.
fn replace(
    file: &Path,
    fill: impl FnOnce(&mut BufWriter<File>) -> io::Result<()>,
) -> io::Result<()> {
    let mut name = file.file_name().unwrap_or_default().to_owned();
    name.push(format!(".{}.partial", std::process::id()));
    let partial = file.with_file_name(name);
    let filled = File::create(&partial).and_then(|created| {
        let mut out = BufWriter::new(created);
        fill(&mut out)?;
        out.into_inner()?.sync_data()?;
        std::fs::rename(&partial, file)
    });
    filled.inspect_err(|_| {
        // If it cannot be removed either, the first error is the one worth telling.
        let _ = std::fs::remove_file(&partial);
    })
}

/// Writes `picture` as PNG.
///
/// # Errors
///
/// [`FileError::Write`].
pub fn write_png(file: &Path, picture: &image::RgbaImage) -> Result<(), FileError> {
    write(file, &encode_png(file, picture)?)
}

/// The bytes of a PNG of an opaque picture; `file` is named if the encoder fails.
///
/// # Errors
///
/// [`FileError::Write`].
pub fn encode_png(file: &Path, picture: &image::RgbaImage) -> Result<Vec<u8>, FileError> {
    let mut bytes = io::Cursor::new(Vec::new());
    // Every pixel is opaque, so the file needs no alpha.
    image::DynamicImage::ImageRgba8(picture.clone())
        .into_rgb8()
        .write_to(&mut bytes, image::ImageFormat::Png)
        .map_err(|error| FileError::Write {
            file: file.to_owned(),
            source: io::Error::other(error),
        })?;
    Ok(bytes.into_inner())
}

/// Writes `values`, last index fastest, as a NumPy array of `shape`.
///
/// # Errors
///
/// [`FileError::Write`].
///
/// # Panics
///
/// If `values` has not as many elements as `shape` says.
pub fn write_npy<T: npyz::AutoSerialize + Copy>(
    file: &Path,
    shape: &[u64],
    values: &[T],
) -> Result<(), FileError> {
    let count: u64 = shape.iter().product();
    assert_eq!(values.len() as u64, count, "an array fills its shape");
    write_with(file, |out| {
        let mut array = npyz::WriteOptions::new()
            .default_dtype()
            .shape(shape)
            .writer(out)
            .begin_nd()?;
        array.extend(values.iter().copied())?;
        array.finish()
    })
}

#[cfg(test)]
pub(super) mod tests {
    use super::*;
    use std::sync::atomic::{AtomicU32, Ordering};

    /// A folder of its own for each test, gone when the test ends well.
    pub struct Folder(pub PathBuf);

    impl Folder {
        pub fn new() -> Self {
            static NEXT: AtomicU32 = AtomicU32::new(0);
            let number = NEXT.fetch_add(1, Ordering::Relaxed);
            let name = format!("palpate-measure-{}-{number}", std::process::id());
            let folder = std::env::temp_dir().join(name);
            create_folder(&folder).expect("the temporary folder can be written");
            Self(folder)
        }

        pub fn names(&self) -> Vec<String> {
            let entries = std::fs::read_dir(&self.0).expect("the folder is there");
            let name = |entry: io::Result<std::fs::DirEntry>| entry.unwrap().file_name();
            let mut names: Vec<String> = entries
                .map(|entry| name(entry).into_string().unwrap())
                .collect();
            names.sort();
            names
        }
    }

    impl Drop for Folder {
        fn drop(&mut self) {
            let _ = std::fs::remove_dir_all(&self.0);
        }
    }

    #[test]
    fn file_whose_writing_fails_halfway_keeps_its_old_content_and_leaves_nothing_beside() {
        let folder = Folder::new();
        let file = folder.0.join("frames.csv");
        write(&file, b"old").unwrap();
        let error = write_with(&file, |out| {
            out.write_all(b"new and half")?;
            Err(io::Error::other("disk full"))
        });
        assert!(error.unwrap_err().to_string().contains("frames.csv"));
        assert_eq!(read(&file).unwrap(), b"old");
        assert_eq!(folder.names(), ["frames.csv"]);
    }

    #[cfg(unix)]
    #[test]
    fn pipe_takes_the_bytes_and_stays_a_pipe() {
        use std::os::unix::fs::FileTypeExt;
        let folder = Folder::new();
        let pipe = folder.0.join("log");
        let made = std::process::Command::new("mkfifo").arg(&pipe).status();
        assert!(made.expect("mkfifo runs").success());
        let reader = std::thread::spawn({
            let pipe = pipe.clone();
            move || read(&pipe).unwrap()
        });
        write(&pipe, b"frame,ms").unwrap();
        assert!(
            std::fs::metadata(&pipe).unwrap().file_type().is_fifo(),
            "a pipe, or /dev/null, was replaced by a file"
        );
        assert_eq!(reader.join().unwrap(), b"frame,ms");
        assert_eq!(folder.names(), ["log"]);
    }

    #[cfg(unix)]
    #[test]
    fn link_stays_a_link_and_what_it_points_to_is_written() {
        let folder = Folder::new();
        let file = folder.0.join("kept.csv");
        write(&file, b"old").unwrap();
        let link = folder.0.join("latest.csv");
        std::os::unix::fs::symlink("kept.csv", &link).unwrap();
        write(&link, b"new").unwrap();
        assert!(std::fs::symlink_metadata(&link).unwrap().is_symlink());
        assert_eq!(read(&file).unwrap(), b"new");
    }

    #[test]
    fn writing_into_a_folder_that_is_absent_names_the_file() {
        let folder = Folder::new();
        let error = write(&folder.0.join("absent/x.csv"), b"").unwrap_err();
        assert!(error.to_string().contains("absent"), "{error}");
    }

    #[test]
    fn npy_reads_back_with_its_shape_and_values() {
        let folder = Folder::new();
        let file = folder.0.join("positions.npy");
        let values = [1.0_f32, 2.0, 3.0, -4.0, 5.5, 6.0];
        write_npy(&file, &[2, 3], &values).unwrap();
        let bytes = read(&file).unwrap();
        let array = npyz::NpyFile::new(&bytes[..]).unwrap();
        assert_eq!(array.shape(), [2, 3]);
        assert_eq!(array.order(), npyz::Order::C);
        assert_eq!(array.into_vec::<f32>().unwrap(), values);
        write_npy(&file, &[1, 3], &[7_u32, 8, 9]).unwrap();
        let bytes = read(&file).unwrap();
        let array = npyz::NpyFile::new(&bytes[..]).unwrap();
        assert_eq!(array.into_vec::<u32>().unwrap(), [7, 8, 9]);
    }
}
