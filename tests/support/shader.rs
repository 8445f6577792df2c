//! What every test of a shader begins with: an adapter, and a way to break the shader on purpose.

#![allow(dead_code)] // Each test binary asks for a part of it.

use palpate::gpu::Gpu;

/// The adapter that tests run on. A missing one is a failure, not a skip.
pub fn gpu() -> Gpu {
    Gpu::headless().expect("a GPU adapter; a software one (mesa-vulkan-drivers) will do")
}

/// `source` with `to` in place of `from`.
///
/// # Panics
///
/// If nothing was replaced.
pub fn sabotaged(source: &str, from: &str, to: &str) -> String {
    let changed = source.replace(from, to);
    assert_ne!(changed, source, "the sabotage must change the shader");
    changed
}
