//! Recorded states: surface positions at sampled frames, and whether two recordings agree.
//!
//! `states.bin` holds little-endian f32, `[frame][point][x, y, z]` in metres; `states.json` says
//! which frames and how many points.

use super::files::{FileError, read, write, write_with};
use serde::{Deserialize, Serialize};
use std::fmt;
use std::io::Write;
use std::path::Path;

const BINARY: &str = "states.bin";
const DESCRIPTION: &str = "states.json";

/// Positions of the same points at several frames.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct States {
    /// Points in each frame.
    pub points: usize,
    /// The sampled frames, ascending.
    pub frames: Vec<u32>,
    /// Positions [m], `[frames.len() * points]`.
    pub positions: Vec<[f32; 3]>,
}

/// `states.json`.
#[derive(Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
struct Description {
    points: usize,
    frames: Vec<u32>,
    endianness: String,
    element: String,
    unit: String,
}

impl States {
    /// Adds the positions [m] of one more frame.
    ///
    /// # Panics
    ///
    /// If the number of points changes or the frames do not ascend.
    pub fn push(&mut self, frame: u32, positions: impl IntoIterator<Item = [f32; 3]>) {
        let before = self.positions.len();
        self.positions.extend(positions);
        let added = self.positions.len() - before;
        if self.frames.is_empty() {
            self.points = added;
        }
        assert_eq!(added, self.points, "every frame has the same points");
        assert!(
            self.frames.last().is_none_or(|&last| last < frame),
            "sampled frames ascend"
        );
        self.frames.push(frame);
    }

    /// Positions at the sampled frame `index`.
    fn sample(&self, index: usize) -> &[[f32; 3]] {
        &self.positions[index * self.points..(index + 1) * self.points]
    }

    /// Writes the two files into `folder`.
    ///
    /// # Errors
    ///
    /// [`FileError::Write`].
    pub fn write(&self, folder: &Path) -> Result<(), FileError> {
        write_with(&folder.join(BINARY), |out| {
            for number in self.positions.as_flattened() {
                out.write_all(&number.to_le_bytes())?;
            }
            Ok(())
        })?;
        let description = Description {
            points: self.points,
            frames: self.frames.clone(),
            endianness: "little".to_owned(),
            element: "f32 [frame][point][x, y, z]".to_owned(),
            unit: "m".to_owned(),
        };
        let text = serde_json::to_string(&description).expect("a description has string keys");
        write(&folder.join(DESCRIPTION), text.as_bytes())
    }

    /// Reads the two files in `folder`.
    ///
    /// # Errors
    ///
    /// [`FileError`] if one cannot be read or they do not fit together.
    pub fn read(folder: &Path) -> Result<Self, FileError> {
        let file = folder.join(DESCRIPTION);
        let content = |problem: String| FileError::Content {
            file: file.clone(),
            problem: format!("{problem}; record the states again"),
        };
        let description: Description =
            serde_json::from_slice(&read(&file)?).map_err(|error| content(error.to_string()))?;
        if description.endianness != "little" {
            return Err(content(format!("endianness `{}`", description.endianness)));
        }
        if !description.frames.is_sorted_by(|a, b| a < b) {
            return Err(content("the frames do not ascend".to_owned()));
        }
        let bytes = read(&folder.join(BINARY))?;
        let samples = description.points.checked_mul(description.frames.len());
        if samples.and_then(|samples| samples.checked_mul(12)) != Some(bytes.len()) {
            return Err(content(format!(
                "{} frames of {} points do not make the {} bytes of {BINARY}",
                description.frames.len(),
                description.points,
                bytes.len()
            )));
        }
        let number = |bytes: &[u8]| f32::from_le_bytes(bytes.try_into().expect("four bytes"));
        let position = |bytes: &[u8]| std::array::from_fn(|k| number(&bytes[4 * k..4 * k + 4]));
        Ok(Self {
            points: description.points,
            frames: description.frames,
            positions: bytes.chunks_exact(12).map(position).collect(),
        })
    }
}

/// How near positions must be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Nearness {
    /// The same bits.
    Exact,
    /// At most this distance apart [m].
    Within(f32),
}

/// One point at one frame.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Offender {
    /// Frame number.
    pub frame: u32,
    /// Point of the surface.
    pub point: usize,
    /// Distance between the two recordings [m]; infinite if one is not finite.
    pub distance_m: f32,
}

/// How two recordings compare.
#[derive(Clone, Debug, PartialEq)]
pub enum StatesVerdict {
    /// They cannot be compared: other points or other frames.
    Unlike {
        /// What differs.
        why: String,
    },
    /// They were compared point by point.
    Compared {
        /// Frames compared.
        frames: usize,
        /// Positions that are too far apart.
        beyond: usize,
        /// The first point of the largest distance; `None` if there are no points.
        worst: Option<Offender>,
    },
}

impl StatesVerdict {
    /// Whether the recordings agree.
    pub fn agrees(&self) -> bool {
        matches!(self, Self::Compared { beyond: 0, .. })
    }
}

impl fmt::Display for StatesVerdict {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Unlike { why } => write!(f, "states cannot be compared: {why}"),
            Self::Compared {
                frames,
                beyond,
                worst,
            } => {
                write!(f, "states of {frames} frames: {beyond} positions differ")?;
                match worst {
                    Some(worst) => write!(
                        f,
                        ", worst {:.3e} m at frame {}, vertex {}",
                        worst.distance_m, worst.frame, worst.point
                    ),
                    None => Ok(()),
                }
            }
        }
    }
}

/// Compares what was recorded with what came out now. Every recorded frame must be there again; a recording
/// may be of some of them.
pub fn compare_states(recorded: &States, now: &States, nearness: Nearness) -> StatesVerdict {
    let place = |frame: &u32| now.frames.binary_search(frame).ok();
    let places: Option<Vec<usize>> = recorded.frames.iter().map(place).collect();
    let places = places.filter(|places| !places.is_empty() && recorded.points == now.points);
    let Some(places) = places else {
        return StatesVerdict::Unlike {
            why: format!(
                "recorded {} points at frames {:?}, now {} points at frames {:?}",
                recorded.points, recorded.frames, now.points, now.frames
            ),
        };
    };
    let mut beyond = 0;
    let mut worst: Option<Offender> = None;
    for (index, &frame) in recorded.frames.iter().enumerate() {
        let pairs = recorded.sample(index).iter().zip(now.sample(places[index]));
        for (point, (before, after)) in pairs.enumerate() {
            let same_bits = before.map(f32::to_bits) == after.map(f32::to_bits);
            let distance_m = if same_bits {
                0.0
            } else {
                distance(before, after)
            };
            let near = match nearness {
                Nearness::Exact => same_bits,
                Nearness::Within(limit_m) => distance_m <= limit_m,
            };
            beyond += usize::from(!near);
            if worst.is_none_or(|worst| distance_m > worst.distance_m) {
                worst = Some(Offender {
                    frame,
                    point,
                    distance_m,
                });
            }
        }
    }
    StatesVerdict::Compared {
        frames: recorded.frames.len(),
        beyond,
        worst,
    }
}

fn distance(a: &[f32; 3], b: &[f32; 3]) -> f32 {
    let square: f32 = (0..3).map(|k| (a[k] - b[k]).powi(2)).sum();
    if square.is_nan() {
        f32::INFINITY
    } else {
        square.sqrt()
    }
}

#[cfg(test)]
mod tests {
    use super::super::files::tests::Folder;
    use super::*;

    const EPSILON_M: f32 = 1e-5;

    /// 20 points on a travelling wave, at every tenth frame.
    fn wave(late: u32) -> States {
        let mut states = States::default();
        for frame in (0..100).step_by(10) {
            let phase = (frame + late) as f32 * 0.1;
            states.push(
                frame,
                (0..20).map(|k| [k as f32 * 0.01, 0.01 * (phase + k as f32).sin(), 0.0]),
            );
        }
        states
    }

    #[test]
    fn recording_reads_back_bit_for_bit_and_agrees_with_itself() {
        let folder = Folder::new();
        wave(0).write(&folder.0).unwrap();
        let read = States::read(&folder.0).unwrap();
        assert_eq!(read, wave(0));
        assert!(compare_states(&wave(0), &read, Nearness::Exact).agrees());
    }

    #[test]
    fn one_vertex_moved_by_ten_epsilon_is_caught_and_named() {
        let mut moved = wave(0);
        moved.positions[3 * 20 + 7][2] += 10.0 * EPSILON_M;
        let verdict = compare_states(&wave(0), &moved, Nearness::Within(EPSILON_M));
        assert!(!verdict.agrees());
        let StatesVerdict::Compared {
            beyond: 1,
            worst: Some(worst),
            ..
        } = verdict
        else {
            panic!("{verdict}");
        };
        assert_eq!((worst.frame, worst.point), (30, 7));
        assert!(verdict.to_string().contains("frame 30, vertex 7"));
    }

    #[test]
    fn vertex_moved_by_a_tenth_of_epsilon_passes_unless_bits_must_agree() {
        let mut moved = wave(0);
        moved.positions[5][0] += 0.1 * EPSILON_M;
        assert!(compare_states(&wave(0), &moved, Nearness::Within(EPSILON_M)).agrees());
        assert!(!compare_states(&wave(0), &moved, Nearness::Exact).agrees());
    }

    #[test]
    fn recording_one_frame_late_is_caught() {
        assert!(!compare_states(&wave(0), &wave(1), Nearness::Within(EPSILON_M)).agrees());
    }

    #[test]
    fn sample_missing_at_the_end_is_caught() {
        let mut short = wave(0);
        short.frames.pop();
        short.positions.truncate(9 * 20);
        assert!(!compare_states(&wave(0), &short, Nearness::Within(1.0)).agrees());
    }

    #[test]
    fn position_that_is_not_a_number_is_infinitely_far() {
        let mut broken = wave(0);
        broken.positions[0] = [f32::NAN; 3];
        let verdict = compare_states(&wave(0), &broken, Nearness::Within(1e9));
        assert!(!verdict.agrees(), "{verdict}");
    }

    #[test]
    fn files_that_do_not_fit_together_are_refused_by_name() {
        let folder = Folder::new();
        wave(0).write(&folder.0).unwrap();
        let bytes = read(&folder.0.join(BINARY)).unwrap();
        write(&folder.0.join(BINARY), &bytes[..bytes.len() - 4]).unwrap();
        let error = States::read(&folder.0).unwrap_err().to_string();
        assert!(
            error.contains(DESCRIPTION) && error.contains(BINARY),
            "{error}"
        );
        let huge = r#"{"points":18446744073709551615,"frames":[0,1],"endianness":"little","element":"","unit":"m"}"#;
        write(&folder.0.join(DESCRIPTION), huge.as_bytes()).unwrap();
        assert!(States::read(&folder.0).is_err());
    }
}
