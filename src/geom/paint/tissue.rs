//! What each tissue looks like at a place: colour, relief, depth of its layers.
//!
//! Colours are sRGB, chosen by eye after photographs of living organs: dark, brownish, wet; pattern
//! sizes are those of anatomy (liver lobules 1 to 2 mm, fibre bundles below 1 mm). Colours are
//! mixed as they are, in sRGB: powers need not have the same bits everywhere.

mod heart;
mod kidney;
mod liver;
mod spleen;

use super::canvas::Canvas;
use super::vessel::{Samples, Tree};
use super::{Dab, Site, Tissue};
use crate::geom::noise::{cellular, fractal, gradient, lerp, smoothstep};
use glam::Vec3;

/// Places from which vessels are grown.
const SAMPLES: usize = 40_000;

/// A tissue with the vessels of one surface.
pub struct Brush {
    tissue: Tissue,
    /// Large vessels: veins in the depth of the liver, coronary arteries on the heart.
    large: Tree,
    /// Fine vessels in the outer layer.
    fine: Tree,
}

impl Brush {
    /// Grows the vessels of `tissue` over the surface on the canvas, along `guides` if there are
    /// any.
    pub fn new(tissue: Tissue, canvas: &Canvas, guides: &[Vec<Vec3>]) -> Self {
        let samples = Samples::new(&canvas.places, &canvas.normals, &canvas.triangles, SAMPLES);
        let (large, fine) = match tissue {
            Tissue::Liver => (liver::LARGE, liver::FINE),
            Tissue::Heart => (heart::LARGE, heart::FINE),
            Tissue::Kidney => (kidney::LARGE, kidney::FINE),
            Tissue::Spleen => (spleen::LARGE, spleen::FINE),
        };
        let roots;
        let guides = if guides.is_empty() {
            roots = own_roots(tissue, &samples);
            &roots
        } else {
            guides
        };
        let fine_roots = scattered_roots(&samples, 9);
        Self {
            tissue,
            large: Tree::grow(&samples, guides, &large),
            fine: Tree::grow(&samples, &fine_roots, &fine),
        }
    }

    /// What the tissue has at a place.
    pub fn dab(&self, site: &Site) -> Dab {
        let large = self.large.cover(site.place);
        let fine = self.fine.cover(site.place);
        let mut dab = match self.tissue {
            Tissue::Liver => liver::dab(site, large, fine),
            Tissue::Heart => heart::dab(site, large, fine),
            Tissue::Kidney => kidney::dab(site, large, fine),
            Tissue::Spleen => spleen::dab(site, large, fine),
        };
        // Rounding must keep the layers in order.
        for k in 1..4 {
            dab.depths[k] = dab.depths[k].clamp(dab.depths[k - 1], 1.0);
        }
        dab
    }
}

/// Where vessels begin on a surface of unknown shape: at the back for the liver, near the top for
/// the heart.
fn own_roots(tissue: Tissue, samples: &Samples) -> Vec<Vec<Vec3>> {
    let score = |sample: usize| match tissue {
        Tissue::Liver => -samples.normals[sample].y - samples.normals[sample].z,
        Tissue::Heart => samples.places[sample].y + 0.5 * samples.normals[sample].z,
        // Towards the middle of the body, where the hilum is.
        Tissue::Kidney | Tissue::Spleen => -samples.normals[sample].x,
    };
    (0..samples.places.len())
        .max_by(|&a, &b| score(a).total_cmp(&score(b)))
        .map(|sample| vec![samples.places[sample]])
        .into_iter()
        .collect()
}

/// `count` single places all over the surface.
fn scattered_roots(samples: &Samples, count: usize) -> Vec<Vec<Vec3>> {
    let total = samples.places.len();
    (0..count)
        .filter_map(|k| samples.places.get((2 * k + 1) * total / (2 * count)))
        .map(|&place| vec![place])
        .collect()
}

/// Colour from three bytes.
const fn rgb(r: u8, g: u8, b: u8) -> Vec3 {
    Vec3::new(r as f32 / 255.0, g as f32 / 255.0, b as f32 / 255.0)
}

/// Fat: soft lobules of several sizes, hardly parted. Gives colour and relief [cm].
fn fat(place: Vec3) -> (Vec3, f32) {
    let bent = place
        + 0.10
            * Vec3::new(
                gradient(place / 0.33, 31),
                gradient(place / 0.33, 34),
                gradient(place / 0.33, 35),
            );
    let lobules = cellular(bent / 0.26, 32);
    let round = 1.0 - lobules.nearest * lobules.nearest;
    let seam = smoothstep(0.0, 0.3, lobules.second - lobules.nearest);
    let shade = 0.5 + 0.6 * fractal(place / 0.5, 3, 33) + 0.22 * (lobules.shade - 0.5);
    let colour = rgb(168, 112, 70).lerp(rgb(204, 166, 116), shade.clamp(0.0, 1.0));
    let colour = rgb(150, 84, 58).lerp(colour, lerp(0.72, 1.0, seam));
    (colour, 0.022 * round.max(0.0) + 0.008 * seam)
}

/// Walls of large arteries and veins, and where they are cut open.
fn great_vessels(site: &Site, dab: &mut Dab) {
    let p = site.place;
    let features = site.features;
    if features.artery.max(features.vein).max(features.lumen) <= 0.0 {
        return;
    }
    let grain = fractal(p / 0.4, 3, 8);
    let walls = [
        (
            features.artery,
            rgb(166, 112, 96),
            rgb(194, 150, 130),
            rgb(150, 70, 56),
        ),
        (
            features.vein,
            rgb(122, 82, 86),
            rgb(162, 122, 118),
            rgb(96, 40, 48),
        ),
    ];
    for (amount, dark, light, deep) in walls {
        dab.outer = dab.outer.lerp(dark.lerp(light, 0.5 + 0.5 * grain), amount);
        dab.inner = dab.inner.lerp(deep, amount);
        dab.opacity = lerp(dab.opacity, 0.85, amount);
        dab.relief = lerp(dab.relief, 0.003 * grain, amount);
    }
    dab.outer = dab.outer.lerp(rgb(62, 8, 12), features.lumen);
    dab.inner = dab.inner.lerp(rgb(50, 6, 10), features.lumen);
    dab.opacity = lerp(dab.opacity, 0.9, features.lumen);
}

/// Fat in the hilum, the ureter and the vessels of an organ that hangs from them.
fn surroundings(site: &Site, dab: &mut Dab) {
    let p = site.place;
    let features = site.features;
    let amount = if features.fat > 0.1 {
        smoothstep(0.3, 0.75, features.fat + 0.4 * fractal(p / 0.5, 3, 11))
    } else {
        0.0
    };
    if amount > 0.0 {
        let (colour, relief) = fat(p);
        dab.outer = dab.outer.lerp(colour, amount);
        dab.inner = dab.inner.lerp(rgb(150, 92, 48), amount);
        dab.opacity = lerp(dab.opacity, 0.95, amount);
        dab.relief += amount * relief;
    }
    if features.ligament > 0.0 {
        let pale = rgb(158, 116, 98).lerp(rgb(190, 152, 126), 0.5 + 0.5 * fractal(p / 0.3, 3, 12));
        dab.outer = dab.outer.lerp(pale, features.ligament);
        dab.inner = dab.inner.lerp(rgb(140, 84, 66), features.ligament);
        dab.opacity = lerp(dab.opacity, 0.9, features.ligament);
    }
    great_vessels(site, dab);
}
