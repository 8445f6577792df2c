//! Spleen: soft, dark, bluish purple pulp under a thin capsule, which is whitish in places.

use super::{Dab, Site, rgb, surroundings};
use crate::geom::noise::{fractal, smoothstep};
use crate::geom::paint::vessel::{Cover, Habit};

pub const LARGE: Habit = Habit {
    spacing: 0.9,
    step: 0.14,
    reach: 4.0,
    enough: 0.45,
    tip_radius: 0.025,
    radius_max: 0.11,
    wander: 0.5,
    core: 1.3,
    halo: 3.2,
    seed: 401,
};
pub const FINE: Habit = Habit {
    spacing: 0.4,
    step: 0.09,
    reach: 1.4,
    enough: 0.22,
    tip_radius: 0.010,
    radius_max: 0.028,
    wander: 0.8,
    core: 1.6,
    halo: 1.6,
    seed: 402,
};

pub fn dab(site: &Site, large: Cover, fine: Cover) -> Dab {
    let p = site.place;
    let drift = fractal(p / 2.2, 3, 1);
    let blotch = fractal(p / 0.5, 4, 2);
    let grain = fractal(p / 0.1, 2, 3);
    let tone = (0.5 + 0.4 * drift + 0.3 * blotch + 0.12 * grain).clamp(0.0, 1.0);
    let mut outer = rgb(66, 22, 32).lerp(rgb(112, 48, 54), tone);
    outer = outer.lerp(rgb(58, 14, 30), 0.30 * large.halo + 0.15 * large.core);
    outer = outer.lerp(rgb(84, 14, 24), 0.4 * fine.core);
    // Where the capsule is thick it is bluish white.
    let veil = smoothstep(-0.1, 0.8, fractal(p / 1.3, 4, 5));
    outer = outer.lerp(rgb(142, 116, 128), 0.06 + 0.24 * veil);

    let mut inner = rgb(62, 10, 18).lerp(rgb(100, 26, 32), tone);
    // White pulp: pale points in the red.
    inner = inner.lerp(
        rgb(134, 92, 90),
        0.35 * smoothstep(0.45, 0.8, fractal(p / 0.09, 2, 8)),
    );
    inner = inner.lerp(rgb(42, 6, 20), 0.7 * large.halo);
    let thickness = 0.5 + 0.5 * fractal(p / 0.9, 2, 6);
    let vessel = large.core;
    let mut dab = Dab {
        outer,
        opacity: 0.72 + 0.08 * blotch + 0.14 * veil - 0.14 * large.halo,
        relief: 0.0010 * grain + 0.012 * fractal(p / 0.7, 3, 7) + 0.002 * fine.core,
        inner,
        depths: [
            0.07 + 0.07 * thickness,
            0.36 + 0.10 * thickness - 0.20 * vessel,
            0.42 + 0.10 * thickness + 0.24 * vessel,
            0.88 + 0.12 * thickness,
        ],
    };
    surroundings(site, &mut dab);
    dab
}
