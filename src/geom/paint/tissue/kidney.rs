//! Kidney: a smooth, firm capsule, reddish brown, with fine star-shaped veins under it.

use super::{Dab, Site, rgb, surroundings};
use crate::geom::noise::{cellular, fractal, smoothstep};
use crate::geom::paint::vessel::{Cover, Habit};

pub const LARGE: Habit = Habit {
    spacing: 0.8,
    step: 0.13,
    reach: 4.0,
    enough: 0.4,
    tip_radius: 0.022,
    radius_max: 0.09,
    wander: 0.55,
    core: 1.4,
    halo: 3.4,
    seed: 301,
};
pub const FINE: Habit = Habit {
    spacing: 0.3,
    step: 0.07,
    reach: 0.9,
    enough: 0.17,
    tip_radius: 0.009,
    radius_max: 0.026,
    wander: 0.9,
    core: 1.6,
    halo: 1.6,
    seed: 302,
};

pub fn dab(site: &Site, large: Cover, fine: Cover) -> Dab {
    let p = site.place;
    let drift = fractal(p / 2.4, 3, 1);
    let blotch = fractal(p / 0.55, 3, 2);
    let grain = fractal(p / 0.12, 2, 3);
    // Glomeruli: points half a millimetre apart, just to be guessed.
    let speck = 1.0 - smoothstep(0.1, 0.5, cellular(p / 0.085, 4).nearest);
    let tone = (0.5 + 0.4 * drift + 0.25 * blotch + 0.10 * grain).clamp(0.0, 1.0);
    let mut outer = rgb(92, 34, 28).lerp(rgb(142, 66, 52), tone);
    outer = outer.lerp(rgb(104, 28, 26), 0.14 * speck);
    outer = outer.lerp(rgb(86, 22, 28), 0.24 * large.halo + 0.30 * large.core);
    outer = outer.lerp(rgb(98, 20, 24), 0.5 * fine.core);
    let veil = smoothstep(0.0, 0.8, fractal(p / 1.4, 3, 5));
    outer = outer.lerp(rgb(164, 130, 124), 0.06 + 0.14 * veil);

    let mut inner = rgb(84, 20, 18).lerp(rgb(132, 48, 36), tone);
    inner = inner.lerp(rgb(150, 66, 48), 0.25 * speck);
    inner = inner.lerp(rgb(54, 10, 20), 0.6 * large.halo.max(0.6 * fine.core));
    let thickness = 0.5 + 0.5 * fractal(p / 0.9, 2, 6);
    let vessel = large.core.max(0.5 * fine.core);
    let mut dab = Dab {
        outer,
        opacity: 0.76 + 0.08 * blotch - 0.12 * large.halo,
        relief: 0.0010 * grain + 0.007 * fractal(p / 0.8, 2, 7) + 0.002 * vessel,
        inner,
        depths: [
            0.09 + 0.05 * thickness,
            0.36 + 0.10 * thickness - 0.18 * vessel,
            0.42 + 0.10 * thickness + 0.20 * vessel,
            0.88 + 0.12 * thickness,
        ],
    };
    surroundings(site, &mut dab);
    dab
}
