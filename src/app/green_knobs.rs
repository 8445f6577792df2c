//! The live knobs of the surfaces after Green (2004).

use super::slider::{Slider, three};
use crate::scene::{DISC_SAMPLES_MAX, DiffusionCore, Falloff, SurfaceSection};
use egui::Ui;

/// Wrapped light and its table.
pub fn lookup(ui: &mut Ui, surface: &mut SurfaceSection) {
    ui.add(Slider::new(&mut surface.wrap, 0.0..=1.0).text("wrap"));
    let lookup = &mut surface.lookup;
    ui.add(Slider::new(&mut lookup.scatter_width, 0.01..=1.0).text("scatter width"));
    let color = &mut lookup.scatter_color;
    three(ui, color, 0.0..=2.0, 0.01, "scatter colour");
    ui.add(
        Slider::new(&mut lookup.shininess, 1.0..=2000.0)
            .logarithmic(true)
            .text("shininess"),
    );
    ui.checkbox(&mut lookup.conserves_energy, "conserves energy");
}

/// Light that comes through the body.
pub fn absorption(ui: &mut Ui, surface: &mut SurfaceSection) {
    let absorption = &mut surface.absorption;
    ui.horizontal(|ui| {
        ui.selectable_value(&mut absorption.falloff, Falloff::Exp, "exp");
        ui.selectable_value(&mut absorption.falloff, Falloff::Ramp, "ramp");
        ui.label("falloff");
    });
    ui.add(Slider::new(&mut absorption.glow, 0.0..=1.0).text("glow"));
    ui.add(Slider::new(&mut absorption.way_share, 0.0..=2.0).text("share of the way"));
    ui.add(
        Slider::new(&mut absorption.ramp_length_m, 1e-3..=0.2)
            .logarithmic(true)
            .text("ramp [m]"),
    );
    ui.add(Slider::new(&mut absorption.samples, 1..=DISC_SAMPLES_MAX).text("looks"));
    ui.add(Slider::new(&mut absorption.disc_radius_m, 0.0..=0.02).text("disc [m]"));
    ui.add(Slider::new(&mut absorption.depth_layers, 1..=2).text("depth layers"));
    ui.add(Slider::new(&mut absorption.grow_m, 0.0..=0.005).text("grow [m]"));
}

/// Light that wanders.
pub fn diffusion(ui: &mut Ui, surface: &mut SurfaceSection) {
    let diffusion = &mut surface.diffusion;
    ui.add(Slider::new(&mut diffusion.layer, 1..=4).text("layer that light wanders in"));
    ui.add(Slider::new(&mut diffusion.radius_scale, 0.0..=4.0).text("width"));
    ui.horizontal(|ui| {
        ui.selectable_value(&mut diffusion.core, DiffusionCore::Pixel, "pixel");
        ui.selectable_value(&mut diffusion.core, DiffusionCore::Map, "map");
        ui.label("narrowest Gaussian in");
    });
    ui.add(Slider::new(&mut diffusion.color_in_map, 0.0..=1.0).text("colour in the map"));
    ui.add(Slider::new(&mut diffusion.translucency, 0.0..=3.0).text("translucency"));
    if diffusion.translucency > 0.0 {
        absorption(ui, surface);
    }
}

/// What of the knobs is built into the passes.
pub fn rebuilt(surface: &SurfaceSection) -> impl PartialEq + use<> {
    let (absorption, diffusion) = (&surface.absorption, &surface.diffusion);
    (
        (
            absorption.falloff,
            absorption.samples,
            absorption.depth_layers,
        ),
        (
            diffusion.core,
            diffusion.color_in_map > 0.0,
            surface.is_translucent(),
        ),
    )
}
