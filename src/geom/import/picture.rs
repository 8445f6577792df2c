//! Pictures from files or from inside a glTF: PNG and JPEG, of bounded size.

use super::error::{ImportError, ImportFault};
use super::part::{TextureSource, read_bytes};
use image::{DynamicImage, ImageReader, Limits};
use std::io::Cursor;
use std::path::Path;

/// Pictures with a longer side are refused [pixels].
const SIDE_MAX: u32 = 16_384;
/// And so are those that take more when they are unpacked [bytes]: 8192 x 8192 pixels of four bytes.
const UNPACKED_BYTES_MAX: u64 = 1 << 28;

/// The PNG or JPEG at `source`.
///
/// # Errors
///
/// [`ImportError`] if it cannot be read, is another format, is broken or too large.
pub fn read_picture(source: &TextureSource) -> Result<DynamicImage, ImportError> {
    match source {
        TextureSource::File(file) => {
            let bytes = read_bytes(file).map_err(|fault| fault.of(file))?;
            read_picture_bytes(file, &bytes)
        }
        TextureSource::Embedded(bytes) => read_picture_bytes(Path::new("embedded"), bytes),
    }
}

/// As [`read_picture`] for the `bytes` of a file that is inside the binary; `file` is its name. The
/// format is told by the first bytes.
///
/// # Errors
///
/// As [`read_picture`].
pub fn read_picture_bytes(file: &Path, bytes: &[u8]) -> Result<DynamicImage, ImportError> {
    let bad = |problem: String| ImportFault::malformed("picture", problem).of(file);
    let format = image::guess_format(bytes)
        .map_err(|_| bad("neither PNG nor JPEG by its first bytes".to_owned()))?;
    let mut reader = ImageReader::with_format(Cursor::new(bytes), format);
    let mut limits = Limits::default();
    limits.max_image_width = Some(SIDE_MAX);
    limits.max_image_height = Some(SIDE_MAX);
    limits.max_alloc = Some(UNPACKED_BYTES_MAX);
    reader.limits(limits);
    reader.decode().map_err(|error| match error {
        image::ImageError::Limits(_) => bad(format!(
            "it has more than {SIDE_MAX} pixels a side or takes more than {} MiB unpacked",
            UNPACKED_BYTES_MAX >> 20
        )),
        // Some decoders end their message with a new line.
        other => bad(other.to_string().trim_end().to_owned()),
    })
}
