//! Deformable tissue that can be prodded, and the numbers for it.
//!
//! * [`geom`]: shapes and their differential geometry. No time, no GPU.
//! * [`sim`]: the body in time. No GPU.
//! * [`reference`]: the same body solved to rounding in f64, for tests and studies to be held to.
//! * [`optics`]: light in layers, as pure functions.
//! * [`gpu`]: adapter, device, buffers, timestamps. No physics, no scene.
//! * [`scene`]: what a scene file says, as checked plain data.
//! * [`passes`]: one GPU pass a file, and the order of a frame.
//! * [`measure`]: percentiles, the frame log, charts and the report.
//! * [`app`]: a session, the replay and the window.
//! * [`study`]: sweeps that chart speed against accuracy.
//!
//! `docs/ARCHITECTURE.md` draws the map; `tests/architecture.rs` keeps it true.

pub mod app;
pub mod geom;
pub mod gpu;
pub mod measure;
pub mod optics;
pub mod passes;
pub mod reference;
pub mod scene;
pub mod sim;
pub mod study;
