//! Pictures from files or from inside a glTF: PNG and JPEG, of bounded size.

use super::error::{ImportError, ImportFault};
use super::part::{TextureSource, read_bytes};
use image::{DynamicImage, ImageReader, Limits};
use std::borrow::Cow;
use std::io::Cursor;
use std::path::Path;

/// Pictures with a longer side are refused [pixels]; the decoder bounds the memory besides.
const SIDE_MAX: u32 = 16_384;

/// Decodes a PNG or JPEG, told apart by its first bytes.
///
/// # Errors
///
/// [`ImportError`] if it cannot be read, is another format, is broken or too large.
pub fn read_picture(source: &TextureSource) -> Result<DynamicImage, ImportError> {
    let (bytes, file) = match source {
        TextureSource::File(file) => {
            let bytes = read_bytes(file).map_err(|fault| fault.of(file))?;
            (Cow::Owned(bytes), file.as_path())
        }
        TextureSource::Embedded(bytes) => (Cow::Borrowed(bytes.as_slice()), Path::new("embedded")),
    };
    let bad = |problem: String| ImportFault::malformed("picture", problem).of(file);
    let format = image::guess_format(&bytes)
        .map_err(|_| bad("neither PNG nor JPEG by its first bytes".to_owned()))?;
    let mut reader = ImageReader::with_format(Cursor::new(&bytes), format);
    let mut limits = Limits::default();
    limits.max_image_width = Some(SIDE_MAX);
    limits.max_image_height = Some(SIDE_MAX);
    reader.limits(limits);
    reader.decode().map_err(|error| bad(error.to_string()))
}
