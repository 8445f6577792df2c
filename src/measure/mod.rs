//! What a run cost and how far off it was: statistics, the frame log, recorded states and the files
//! they end in. Plain data in, files out; nothing here knows of bodies, passes or scenes.

pub mod against;
pub mod caption;
pub mod chart;
pub mod files;
pub mod flip;
pub mod log;
pub mod map;
pub mod npz;
pub mod page;
pub mod pictures;
pub mod preview;
pub mod radiance;
pub mod report;
pub mod scatter;
pub mod states;
pub mod stats;
pub mod summary;
pub mod trace;
pub mod versus;

pub use files::{FileError, create_folder, write_png};
pub use log::FrameRecord;
