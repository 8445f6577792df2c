//! Whether two pictures agree, pixel by pixel.

use super::files::{FileError, read};
use image::RgbaImage;
use std::fmt;
use std::path::Path;

/// How near two pictures must be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct PictureTolerance {
    /// A pixel differs if one of its channels differs by more than this, of 255.
    pub channel: u8,
    /// Share of the pixels that may differ.
    pub share: f64,
}

/// How two pictures compare.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PictureVerdict {
    /// They have other sizes.
    Unlike {
        /// Width and height of the recorded one [pixels].
        recorded: (u32, u32),
        /// Width and height of the one made now [pixels].
        now: (u32, u32),
    },
    /// They were compared pixel by pixel.
    Compared {
        /// Share of the pixels that differ.
        share: f64,
        /// Share that may.
        share_max: f64,
        /// Column, row and channel difference of the worst pixel, the first if there are several.
        worst: (u32, u32, u8),
    },
}

impl PictureVerdict {
    /// Whether the pictures agree.
    pub fn agrees(&self) -> bool {
        matches!(self, Self::Compared { share, share_max, .. } if share <= share_max)
    }
}

impl fmt::Display for PictureVerdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unlike { recorded, now } => write!(
                f,
                "{} x {} pixels were recorded, now there are {} x {}",
                recorded.0, recorded.1, now.0, now.1
            ),
            Self::Compared {
                share,
                share_max,
                worst: (x, y, difference),
            } => write!(
                f,
                "{:.3} % of the pixels differ ({:.3} % may), worst by {difference} of 255 at \
                 ({x}, {y})",
                100.0 * share,
                100.0 * share_max
            ),
        }
    }
}

/// Compares two pictures.
pub fn compare_pictures(
    recorded: &RgbaImage,
    now: &RgbaImage,
    tolerance: PictureTolerance,
) -> PictureVerdict {
    if recorded.dimensions() != now.dimensions() {
        return PictureVerdict::Unlike {
            recorded: recorded.dimensions(),
            now: now.dimensions(),
        };
    }
    let mut beyond = 0_u64;
    let mut worst = (0, 0, 0);
    for ((x, y, before), after) in recorded.enumerate_pixels().zip(now.pixels()) {
        let differences = before.0.iter().zip(&after.0).map(|(a, b)| a.abs_diff(*b));
        let difference = differences.max().unwrap_or(0);
        beyond += u64::from(difference > tolerance.channel);
        if difference > worst.2 {
            worst = (x, y, difference);
        }
    }
    let pixels = u64::from(recorded.width()) * u64::from(recorded.height());
    PictureVerdict::Compared {
        share: beyond as f64 / pixels.max(1) as f64,
        share_max: tolerance.share,
        worst,
    }
}

/// Reads a PNG.
///
/// # Errors
///
/// [`FileError`] if it cannot be read or is no PNG.
pub fn read_png(file: &Path) -> Result<RgbaImage, FileError> {
    image::load_from_memory_with_format(&read(file)?, image::ImageFormat::Png)
        .map(|picture| picture.to_rgba8())
        .map_err(|error| FileError::Content {
            file: file.to_owned(),
            problem: format!("{error}; record the picture again"),
        })
}

#[cfg(test)]
mod tests {
    use super::*;
    use image::Rgba;

    const TOLERANCE: PictureTolerance = PictureTolerance {
        channel: 4,
        share: 0.001,
    };

    /// A shaded ramp of 100 x 100 pixels.
    fn ramp() -> RgbaImage {
        RgbaImage::from_fn(100, 100, |x, y| {
            Rgba([(2 * x) as u8, (2 * y) as u8, 90, 255])
        })
    }

    #[test]
    fn picture_agrees_with_itself_and_with_noise_below_the_tolerance() {
        let mut noisy = ramp();
        for (x, y, pixel) in noisy.enumerate_pixels_mut() {
            pixel.0[1] = pixel.0[1].saturating_add(((x + y) % 4) as u8);
        }
        assert!(compare_pictures(&ramp(), &ramp(), TOLERANCE).agrees());
        assert!(compare_pictures(&ramp(), &noisy, TOLERANCE).agrees());
    }

    #[test]
    fn gamma_applied_twice_is_caught() {
        let mut twice = ramp();
        for pixel in twice.pixels_mut() {
            for channel in &mut pixel.0[..3] {
                *channel = (255.0 * (f32::from(*channel) / 255.0).powf(1.0 / 2.2)).round() as u8;
            }
        }
        let verdict = compare_pictures(&ramp(), &twice, TOLERANCE);
        assert!(!verdict.agrees(), "{verdict}");
    }

    #[test]
    fn small_patch_passes_within_the_share_and_fails_beyond_it() {
        let mut spotted = ramp();
        for k in 0..10 {
            spotted.put_pixel(40 + k, 60, Rgba([255, 255, 255, 255]));
        }
        let verdict = compare_pictures(&ramp(), &spotted, TOLERANCE);
        assert!(verdict.agrees(), "{verdict}");
        assert!(verdict.to_string().contains("(40, 60)"), "{verdict}");
        spotted.put_pixel(0, 99, Rgba([255, 255, 255, 255]));
        assert!(!compare_pictures(&ramp(), &spotted, TOLERANCE).agrees());
    }

    #[test]
    fn picture_of_another_size_is_caught() {
        let verdict = compare_pictures(&ramp(), &RgbaImage::new(100, 99), TOLERANCE);
        assert!(!verdict.agrees());
    }
}
