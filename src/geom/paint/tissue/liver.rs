//! Liver: lobules under a thin, glossy capsule; hepatic and portal veins in the depth.

use super::{Dab, Site, fat, rgb};
use crate::geom::noise::{cellular, fractal, gradient, lerp, smoothstep};
use crate::geom::organ::Features;
use crate::geom::paint::vessel::{Cover, Habit};
use glam::Vec3;

pub const LARGE: Habit = Habit {
    spacing: 0.75,
    step: 0.16,
    reach: 4.0,
    enough: 0.42,
    tip_radius: 0.045,
    radius_max: 0.24,
    wander: 0.45,
    core: 1.25,
    halo: 3.0,
    seed: 101,
};
pub const FINE: Habit = Habit {
    spacing: 0.5,
    step: 0.12,
    reach: 2.0,
    enough: 0.3,
    tip_radius: 0.014,
    radius_max: 0.035,
    wander: 0.7,
    core: 1.6,
    halo: 1.6,
    seed: 102,
};

pub fn dab(site: &Site, large: Cover, fine: Cover) -> Dab {
    let p = site.place;
    // Lobules: cells 1.3 mm wide, a pale rim round a dark centre, edges frayed.
    let bent = p + 0.03
        * Vec3::new(
            gradient(p / 0.11, 1),
            gradient(p / 0.11, 2),
            gradient(p / 0.11, 3),
        );
    let lobule = cellular(bent / 0.15, 4);
    let rim = 1.0 - smoothstep(0.0, 0.35, lobule.second - lobule.nearest);
    // Slow drifts of colour over centimetres: blood stands here more, there less.
    let drift = fractal(p / 3.2, 3, 5);
    let blotch = fractal(p / 0.7, 3, 6);

    let vein = large.core;
    let halo = large.halo;
    let thread = fine.core;

    let tone = (0.5 + 0.45 * drift + 0.28 * blotch + 0.16 * (lobule.shade - 0.5)).clamp(0.0, 1.0);
    let mut outer = rgb(80, 27, 23).lerp(rgb(130, 57, 43), tone);
    outer = outer.lerp(rgb(150, 86, 66), 0.18 * rim);
    outer = outer.lerp(rgb(72, 24, 30), 0.22 * halo + 0.12 * vein);
    outer = outer.lerp(rgb(92, 14, 16), 0.45 * thread);
    // The capsule's veil: a bluish, greyish bloom in some places.
    let veil = smoothstep(0.05, 0.8, fractal(p / 1.9, 3, 7));
    outer = outer.lerp(rgb(150, 118, 122), 0.05 + 0.13 * veil);

    let mut inner = rgb(78, 15, 13).lerp(rgb(124, 38, 28), tone);
    inner = inner.lerp(rgb(150, 70, 48), 0.35 * rim);
    inner = inner.lerp(rgb(52, 10, 20), 0.55 * halo);
    inner = inner.lerp(rgb(38, 8, 22), 0.85 * vein);

    let thickness = 0.5 + 0.5 * fractal(p / 1.2, 2, 8);
    let mut dab = Dab {
        outer,
        opacity: 0.72 + 0.10 * blotch - 0.16 * halo + 0.1 * veil,
        relief: 0.0016 * (1.0 - rim) + 0.012 * fractal(p / 0.9, 2, 9) + 0.003 * thread
            - 0.0015 * vein,
        inner,
        depths: [
            0.07 + 0.05 * thickness,
            0.36 + 0.10 * thickness - 0.20 * vein - 0.06 * halo,
            0.42 + 0.10 * thickness + 0.26 * vein + 0.06 * halo,
            0.88 + 0.12 * thickness,
        ],
    };
    neighbours(site, &mut dab, thread);
    dab
}

/// The ligament, the gallbladder, vessels and fat at the porta.
fn neighbours(site: &Site, dab: &mut Dab, thread: f32) {
    let p = site.place;
    let features = site.features;
    if features == Features::default() {
        return;
    }
    let grain = fractal(p / 0.35, 3, 10);

    let ligament = features.ligament * (0.75 + 0.25 * grain);
    dab.outer = dab.outer.lerp(rgb(176, 128, 112), 0.55 * ligament);
    dab.opacity = lerp(dab.opacity, 0.95, ligament);
    dab.relief += 0.012 * ligament;

    if features.fat > 0.0 {
        let amount = smoothstep(0.25, 0.7, features.fat + 0.35 * fractal(p / 0.6, 2, 11));
        let (colour, relief) = fat(p);
        dab.outer = dab.outer.lerp(colour, amount);
        dab.inner = dab.inner.lerp(rgb(150, 92, 48), amount);
        dab.opacity = lerp(dab.opacity, 0.95, amount);
        dab.relief += amount * relief;
    }
    if features.gallbladder > 0.0 {
        let bile = rgb(52, 56, 36).lerp(rgb(92, 92, 62), 0.5 + 0.5 * grain);
        let wall = bile.lerp(rgb(112, 48, 36), 0.5 * thread);
        dab.outer = dab.outer.lerp(wall, features.gallbladder);
        dab.inner = dab.inner.lerp(rgb(46, 52, 16), features.gallbladder);
        dab.opacity = lerp(dab.opacity, 0.7, features.gallbladder);
        dab.relief = lerp(dab.relief, 0.003 * grain, features.gallbladder);
    }
    if features.vein > 0.0 {
        let wall = rgb(92, 62, 76).lerp(rgb(128, 96, 102), 0.5 + 0.5 * grain);
        dab.outer = dab.outer.lerp(wall, features.vein);
        dab.inner = dab.inner.lerp(rgb(52, 14, 30), features.vein);
        dab.relief = lerp(dab.relief, 0.002 * grain, features.vein);
    }
    dab.outer = dab.outer.lerp(rgb(48, 6, 10), features.lumen);
    dab.inner = dab.inner.lerp(rgb(40, 4, 8), features.lumen);
}
