//! The table of wrapped light: over N·L and N·H, colour shift in red, green and blue, a highlight in alpha.
//!
//! Source: Green 2004, 16.2 and listing 16-1. What is changed, and why: `docs/METHODS.md`.

use super::film::FILM_F0;
use glam::{Vec3, Vec4};

/// Entries along each side.
pub const LOOKUP_SIDE: usize = 256;

/// What the table is made from.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct WrapLight {
    /// How far light reaches round the terminator, 0 to 1.
    pub wrap: f32,
    /// Width of the band of another colour, in units of wrapped light.
    pub scatter_width: f32,
    /// What is added in the middle of the band.
    pub scatter_color: Vec3,
    /// Exponent of the highlight.
    pub shininess: f32,
    /// Whether as much light leaves as arrives.
    pub conserves_energy: bool,
}

fn smooth_step(from: f32, to: f32, x: f32) -> f32 {
    let t = ((x - from) / (to - from)).clamp(0.0, 1.0);
    t * t * (3.0 - 2.0 * t)
}

impl WrapLight {
    /// Diffuse light per irradiance for N·L = `cosine`; above 1 where the listing's band adds to full light.
    ///
    /// The listing's light ends in a kink, which shows as a line on a smooth limb; conserving light is its power of
    /// 1 + w, which runs out smoothly (McAuley, "Energy-Conserving Wrapped Diffuse", 2011). The listing's second
    /// smoothstep runs backwards, which WGSL leaves undefined: it is one minus the forward one.
    pub fn diffuse(&self, cosine: f32) -> Vec3 {
        let wrapped = ((cosine + self.wrap) / (1.0 + self.wrap)).max(0.0);
        let width = self.scatter_width;
        let band =
            smooth_step(0.0, width, wrapped) * (1.0 - smooth_step(width, 2.0 * width, wrapped));
        if self.conserves_energy {
            (wrapped.powf(1.0 + self.wrap) + band * self.scatter_color) * self.conserving()
        } else {
            wrapped + band * self.scatter_color
        }
    }

    /// What makes the sum over all directions that of Lambert's law, 1/2: ∫ over N·L of wrapped light to the power of
    /// 1 + w is (1 + w)/(2 + w), of the band (1 + w) times its area, which is its width while it ends below full light.
    fn conserving(&self) -> Vec3 {
        let width = self.scatter_width;
        let band = if 2.0 * width <= 1.0 {
            width
        } else {
            // The part of the band beyond full light is never reached.
            let falling = (1.0 / width - 1.0).clamp(0.0, 1.0);
            let cut = falling - falling.powi(3) + 0.5 * falling.powi(4);
            width * (0.5 + cut)
        };
        let light = 1.0 / (2.0 + self.wrap);
        0.5 / ((1.0 + self.wrap) * (light + band * self.scatter_color))
    }

    /// Highlight for N·L and N·H: as listed a power of N·H, 0 where no wrapped light falls. Conserving, radiance
    /// per irradiance of a Blinn lobe whose sum is that of a wet film, 0 where no light falls.
    pub fn highlight(&self, cosine: f32, half_way: f32) -> f32 {
        let lobe = half_way.max(0.0).powf(self.shininess);
        if self.conserves_energy {
            let scale = (self.shininess + 8.0) / (8.0 * std::f32::consts::PI);
            FILM_F0 * scale * lobe * cosine.max(0.0)
        } else if cosine + self.wrap > 0.0 {
            lobe
        } else {
            0.0
        }
    }

    /// The table, row by row: N·L evenly from −1 to 1 along a row, and N·H = 1 − v² from row to row, v from 0 to 1, so
    /// that a sharp highlight has many rows where an even spacing leaves it one.
    pub fn table(&self) -> Vec<Vec4> {
        let step = 1.0 / (LOOKUP_SIDE - 1) as f32;
        (0..LOOKUP_SIDE * LOOKUP_SIDE)
            .map(|i| {
                let cosine = 2.0 * (i % LOOKUP_SIDE) as f32 * step - 1.0;
                let v = (i / LOOKUP_SIDE) as f32 * step;
                self.diffuse(cosine)
                    .extend(self.highlight(cosine, 1.0 - v * v))
            })
            .collect()
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn light(wrap: f32, scatter_width: f32, conserves_energy: bool) -> WrapLight {
        WrapLight {
            wrap,
            scatter_width,
            scatter_color: Vec3::new(0.15, 0.05, 0.0),
            shininess: 40.0,
            conserves_energy,
        }
    }

    /// Mean over all directions of the sphere, by the midpoint rule; Lambert's law has 1/4.
    fn mean(light: &WrapLight) -> Vec3 {
        const STEPS: usize = 20_000;
        (0..STEPS)
            .map(|i| light.diffuse(-1.0 + 2.0 * (i as f32 + 0.5) / STEPS as f32))
            .sum::<Vec3>()
            / STEPS as f32
    }

    #[test]
    fn conserving_light_sums_to_that_of_lambert_in_every_colour() {
        for wrap in [0.0, 0.2, 0.7, 1.0] {
            for width in [0.05, 0.3, 0.5, 0.8, 1.0] {
                let error = (mean(&light(wrap, width, true)) - 0.25).abs().max_element();
                // Rounding of 20,000 sums in f32.
                assert!(error < 1e-4, "wrap {wrap}, width {width}: {error}");
            }
        }
    }

    #[test]
    fn the_energy_check_sees_the_light_that_the_listing_adds() {
        let listed = mean(&light(0.2, 0.3, false));
        assert!(listed.x > 1.2 * 0.25 && listed.x > listed.z, "{listed}");
    }

    #[test]
    fn the_band_is_red_past_the_terminator_and_gone_in_full_light_and_in_the_dark() {
        let light = light(0.2, 0.3, false);
        // wrapped = 0.3 at N·L = 0.16.
        let middle = light.diffuse(0.16);
        assert!((middle.x - middle.z - 0.15).abs() < 1e-5, "{middle}");
        let full = light.diffuse(1.0);
        assert_eq!(full, Vec3::ONE);
        assert_eq!(light.diffuse(-0.2), Vec3::ZERO);
        assert_eq!(light.diffuse(-0.9), Vec3::ZERO);
    }

    #[test]
    fn highlights_are_numbers_below_the_horizon_and_none_where_no_light_falls() {
        for conserves in [false, true] {
            let light = light(0.2, 0.3, conserves);
            assert_eq!(light.highlight(0.5, -0.7), 0.0);
            assert_eq!(light.highlight(-0.3, 1.0), 0.0);
            assert!(light.highlight(0.5, 1.0) > 0.0);
        }
        // The listing lights highlights past the terminator, where no light falls.
        assert!(light(0.2, 0.3, false).highlight(-0.1, 1.0) > 0.9);
        assert_eq!(light(0.2, 0.3, true).highlight(-0.1, 1.0), 0.0);
    }

    #[test]
    fn a_conserving_highlight_throws_back_what_a_wet_film_does() {
        // ∫ f cos θ dω over the upper half, light at 30 degrees from the normal.
        let to_light = Vec3::new(0.5, 0.0, 0.866_025_4);
        let light = WrapLight {
            shininess: 200.0,
            ..light(0.2, 0.3, true)
        };
        let (rows, columns) = (1200, 1200);
        let mut sum = 0.0_f64;
        for row in 0..rows {
            let z = (row as f32 + 0.5) / rows as f32;
            let sine = (1.0 - z * z).sqrt();
            for column in 0..columns {
                let angle = std::f32::consts::TAU * column as f32 / columns as f32;
                let to_eye = Vec3::new(sine * angle.cos(), sine * angle.sin(), z);
                let half_way = (to_light + to_eye).normalize().z;
                let got = light.highlight(to_light.z, half_way) * z;
                sum += f64::from(got) * std::f64::consts::TAU / f64::from(rows * columns);
            }
        }
        let share = sum / f64::from(to_light.z);
        // The scale is that of a lobe about the mirrored ray; about the half-way vector 30 degrees cost a quarter: 0.76.
        assert!((share / f64::from(FILM_F0) - 1.0).abs() < 0.3, "{share}");
    }

    #[test]
    fn the_table_holds_what_the_formulas_say_between_its_entries() {
        let light = WrapLight {
            shininess: 500.0,
            ..light(0.35, 0.3, true)
        };
        let table = light.table();
        let read = |x: f32, y: f32| {
            let place = |t: f32| {
                let at = t * (LOOKUP_SIDE - 1) as f32;
                let low = (at as usize).min(LOOKUP_SIDE - 2);
                (low, at - low as f32)
            };
            let ((i, s), (j, t)) = (place(x), place(y));
            let row = |j: usize| table[j * LOOKUP_SIDE + i].lerp(table[j * LOOKUP_SIDE + i + 1], s);
            row(j).lerp(row(j + 1), t)
        };
        let top = light.highlight(1.0, 1.0);
        for i in 0..997 {
            let cosine = -1.0 + 2.0 * (i as f32 + 0.3) / 997.0;
            let v = ((i * 37) % 997) as f32 / 997.0;
            let got = read(0.5 * cosine + 0.5, v);
            // A kink of the curve lies between two entries: at most a quarter of a step off.
            assert!((got.truncate() - light.diffuse(cosine)).length() < 4e-3);
            assert!((got.w - light.highlight(cosine, 1.0 - v * v)).abs() < 5e-3 * top);
        }
    }
}
