//! Heart: fibres that wind round the ventricles, coronary arteries in fat, fine veins.

use super::{Dab, Site, fat, great_vessels, rgb};
use crate::geom::noise::{fractal, gradient, lerp, smoothstep};
use crate::geom::paint::vessel::{Cover, Habit};
use glam::Vec3;

pub const LARGE: Habit = Habit {
    spacing: 0.62,
    step: 0.12,
    reach: 3.0,
    enough: 0.36,
    tip_radius: 0.03,
    radius_max: 0.17,
    wander: 0.5,
    core: 1.15,
    halo: 3.6,
    seed: 201,
};
pub const FINE: Habit = Habit {
    spacing: 0.34,
    step: 0.08,
    reach: 1.5,
    enough: 0.2,
    tip_radius: 0.010,
    radius_max: 0.03,
    wander: 0.8,
    core: 1.6,
    halo: 1.6,
    seed: 202,
};

/// Direction of the outer fibres: they run down to the left at 60 degrees to the equator.
fn fibre(normal: Vec3) -> Vec3 {
    let axis = Vec3::new(0.5, -0.8, 0.33);
    let round = axis.cross(normal).normalize_or(Vec3::X);
    let down = normal.cross(round);
    (0.5 * round + 0.87 * down).normalize_or(Vec3::X)
}

/// Noise drawn out along the fibres, in about `[-1, 1]`.
fn streaks(p: Vec3, along: Vec3, size: f32, seed: u32) -> f32 {
    let sum: f32 = (-3..=3)
        .map(|k| gradient((p + along * (size * 1.1 * k as f32)) / size, seed))
        .sum();
    sum / 2.7
}

pub fn dab(site: &Site, large: Cover, fine: Cover) -> Dab {
    let p = site.place;
    let features = site.features;
    let along = fibre(site.normal);
    let fibres = streaks(p, along, 0.07, 1);
    let bundles = streaks(p, along, 0.22, 2);
    let drift = fractal(p / 2.2, 3, 3);
    let blotch = fractal(p / 0.5, 3, 4);

    let artery = large.core;
    let thread = fine.core;

    let tone =
        (0.5 + 0.35 * drift + 0.15 * blotch + 0.24 * fibres + 0.16 * bundles).clamp(0.0, 1.0);
    let mut outer = rgb(92, 24, 22).lerp(rgb(152, 62, 50), tone);
    outer = outer.lerp(rgb(104, 46, 52), 0.5 * features.atrium);
    outer = outer.lerp(rgb(88, 18, 26), 0.5 * thread);
    let veil = smoothstep(0.1, 0.8, fractal(p / 1.3, 3, 5));
    outer = outer.lerp(rgb(168, 132, 126), 0.05 + 0.12 * veil);

    let mut inner = rgb(98, 18, 16).lerp(rgb(146, 50, 38), tone);
    inner = inner.lerp(rgb(60, 10, 20), 0.6 * thread);

    let thickness = 0.5 + 0.5 * fractal(p / 0.8, 2, 6);
    let mut dab = Dab {
        outer,
        opacity: 0.76 + 0.08 * blotch,
        relief: 0.0014 * fibres + 0.004 * bundles + 0.008 * drift + 0.002 * thread,
        inner,
        depths: [
            0.06 + 0.05 * thickness,
            0.34 + 0.10 * thickness - 0.16 * thread,
            0.42 + 0.10 * thickness + 0.16 * thread,
            0.88 + 0.12 * thickness,
        ],
    };

    // Fat lies in the grooves and along the large arteries.
    let lumps = 0.5 * fractal(p / 0.6, 4, 7);
    let groove = (features.fat).max(0.75 * site.hollow * smoothstep(0.3, 0.7, site.height));
    let amount = smoothstep(0.36, 0.9, groove + 0.5 * large.stem + lumps)
        * (1.0 - features.artery.max(features.vein));
    let (colour, relief) = if amount > 0.0 {
        fat(p)
    } else {
        Default::default()
    };
    dab.outer = dab.outer.lerp(colour, 0.92 * amount);
    dab.inner = dab.inner.lerp(rgb(156, 98, 50), amount);
    dab.opacity = lerp(dab.opacity, 0.93, amount);
    dab.relief += amount * (0.012 + relief);
    dab.depths[1] = lerp(dab.depths[1], 0.6, amount);
    dab.depths[2] = lerp(dab.depths[2], 0.66, amount);

    // Arteries shine through: red in muscle, half sunk where fat covers them.
    let shown = artery * (1.0 - 0.35 * amount) * (1.0 - features.artery.max(features.vein));
    dab.outer = dab.outer.lerp(rgb(138, 34, 30), 0.85 * shown);
    dab.inner = dab.inner.lerp(rgb(120, 12, 14), 0.8 * artery);
    dab.relief += 0.013 * artery * (1.0 - 0.3 * amount);
    dab.depths[2] = lerp(dab.depths[2], 0.8, artery);
    great_vessels(site, &mut dab);
    dab
}
