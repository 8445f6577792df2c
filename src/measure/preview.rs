//! `preview.apng`: the pictures of a replay as one that moves and begins again, an animated PNG.

use super::files::{FileError, write};
use image::RgbaImage;
use image::imageops::{FilterType, resize};
use std::io;
use std::path::Path;

/// Longest side of the preview [px].
const SIDE_MAX_PX: u32 = 400;
/// Frames it has at most: beyond, every second, third … picture is taken.
const FRAMES_MAX: usize = 90;
/// Hundredths of a second that the last picture stays before the first one comes again.
const PAUSE_CS: u32 = 60;

/// The pictures that become a preview, made small as they come.
#[derive(Clone, Debug, Default)]
pub struct Preview {
    frames: Vec<RgbaImage>,
    /// Pictures that came for each that is kept.
    stride: usize,
    seen: usize,
}

impl Preview {
    /// Adds a picture; all are of one size.
    pub fn add(&mut self, picture: &RgbaImage) {
        let stride = self.stride.max(1);
        if self.seen.is_multiple_of(stride) {
            self.frames.push(small(picture));
        }
        self.seen += 1;
        if self.frames.len() > FRAMES_MAX {
            let mut index = 0;
            self.frames.retain(|_| {
                index += 1;
                index % 2 == 1
            });
            self.stride = 2 * stride;
        }
    }

    /// Writes what moves, if there are two pictures or more, each `picture_s` after the one before.
    ///
    /// # Errors
    ///
    /// [`FileError::Write`].
    pub fn write(&self, file: &Path, picture_s: f64) -> Result<(), FileError> {
        if self.frames.len() < 2 {
            return Ok(());
        }
        let delay_cs = 100.0 * picture_s * self.stride.max(1) as f64;
        let bytes = encoded(&self.frames, delay_cs).map_err(|error| FileError::Write {
            file: file.to_owned(),
            source: io::Error::other(error),
        })?;
        write(file, &bytes)
    }
}

fn small(picture: &RgbaImage) -> RgbaImage {
    let (width, height) = picture.dimensions();
    let share = f64::from(SIDE_MAX_PX) / f64::from(width.max(height));
    if share >= 1.0 {
        return picture.clone();
    }
    let side = |px: u32| (f64::from(px) * share).round().max(1.0) as u32;
    resize(picture, side(width), side(height), FilterType::Triangle)
}

fn encoded(frames: &[RgbaImage], delay_cs: f64) -> Result<Vec<u8>, png::EncodingError> {
    let (width, height) = frames[0].dimensions();
    let mut bytes = Vec::new();
    let mut encoder = png::Encoder::new(&mut bytes, width, height);
    encoder.set_color(png::ColorType::Rgb);
    encoder.set_depth(png::BitDepth::Eight);
    encoder.set_animated(frames.len() as u32, 0)?;
    let mut writer = encoder.write_header()?;
    let mut shown_cs = 0.0;
    for (index, frame) in frames.iter().enumerate() {
        // Whole hundredths, without drifting away from the time they stand for.
        let end_cs = delay_cs * (index + 1) as f64;
        let mut delay = (end_cs.round() - shown_cs).clamp(1.0, 6000.0) as u32;
        shown_cs = end_cs.round();
        if index + 1 == frames.len() {
            delay += PAUSE_CS;
        }
        writer.set_frame_delay(delay as u16, 100)?;
        let opaque: Vec<u8> = (frame.pixels())
            .flat_map(|pixel| [pixel[0], pixel[1], pixel[2]])
            .collect();
        writer.write_image_data(&opaque)?;
    }
    writer.finish()?;
    Ok(bytes)
}

#[cfg(test)]
mod tests {
    use super::super::files::{read, tests::Folder};
    use super::*;

    /// How many pictures a preview of `count` pictures has, how large they are, and how long it takes [s].
    fn shown(count: u32, picture_s: f64) -> (u32, [u32; 2], f64) {
        let folder = Folder::new();
        let file = folder.0.join("preview.apng");
        let mut preview = Preview::default();
        for shade in 0..count {
            preview.add(&RgbaImage::from_pixel(
                800,
                600,
                image::Rgba([shade as u8, 9, 9, 255]),
            ));
        }
        preview.write(&file, picture_s).unwrap();
        let bytes = read(&file).unwrap();
        let mut reader = png::Decoder::new(io::Cursor::new(&bytes))
            .read_info()
            .unwrap();
        let info = reader.info();
        let frames = info.animation_control().unwrap().num_frames;
        let size = [info.width, info.height];
        let mut buffer = vec![0; reader.output_buffer_size().unwrap()];
        let mut seconds = 0.0;
        for _ in 0..frames {
            reader.next_frame(&mut buffer).unwrap();
            let control = reader.info().frame_control().unwrap();
            seconds += f64::from(control.delay_num) / f64::from(control.delay_den);
        }
        (frames, size, seconds)
    }

    #[test]
    fn preview_is_small_and_as_long_as_the_run() {
        let (frames, size, seconds) = shown(40, 1.0 / 60.0);
        assert_eq!((frames, size), (40, [400, 300]));
        assert!((seconds - (40.0 / 60.0 + 0.6)).abs() < 0.011, "{seconds} s");
    }

    #[test]
    fn long_run_keeps_its_length_with_fewer_pictures() {
        let (frames, _, seconds) = shown(400, 0.1);
        assert!((45..=90).contains(&frames), "{frames}");
        assert!((seconds - 40.6).abs() < 1.0, "{seconds} s");
    }

    #[test]
    fn one_picture_does_not_move_and_makes_no_file() {
        let folder = Folder::new();
        let file = folder.0.join("preview.apng");
        let mut preview = Preview::default();
        preview.add(&RgbaImage::new(8, 8));
        preview.write(&file, 0.1).unwrap();
        assert!(!file.exists());
    }
}
