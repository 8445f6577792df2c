//! The live knobs of a surface, those of Norberg's figure 15 among them.

use super::green_knobs as green;
use super::panel::PanelAsk;
use crate::scene::{Quadrature, SurfaceKind, SurfaceSection, UvMetric};
use egui::{ComboBox, Slider, Ui};

/// Shows the knobs of the surface's own kind; returns what a change needs.
pub fn surface(ui: &mut Ui, surface: &mut SurfaceSection) -> Option<PanelAsk> {
    let before = surface.clone();
    match surface.kind {
        SurfaceKind::Plain => {}
        SurfaceKind::Subsurface => subsurface(ui, surface),
        SurfaceKind::Gooey => gooey(ui, surface),
        SurfaceKind::Wrap => green::lookup(ui, surface),
        SurfaceKind::Absorption => {
            green::lookup(ui, surface);
            green::absorption(ui, surface);
        }
        SurfaceKind::Diffusion => green::diffusion(ui, surface),
    }
    if surface.kind.looks_below() || surface.kind == SurfaceKind::Diffusion {
        ui.horizontal(|ui| {
            for metric in [UvMetric::Deformed, UvMetric::Unit] {
                ui.selectable_value(&mut surface.uv_metric, metric, metric.name());
            }
            ui.label("texture metric");
        });
    }
    if surface.kind.looks_below() {
        ui.checkbox(
            &mut surface.thickness_follows_volume,
            "layers keep their volume",
        );
    }
    ui.add(Slider::new(&mut surface.relief, 0.0..=2.0).text("relief"));
    ui.add(Slider::new(&mut surface.roughness, 0.05..=0.8).text("roughness"));
    ui.add(Slider::new(&mut surface.wetness, 0.0..=2.0).text("wetness"));
    ui.add(Slider::new(&mut surface.exposure, 0.1..=4.0).text("exposure"));
    let rebuilt = |s: &SurfaceSection| {
        (
            (s.samples, s.quadrature, s.blur_passes, s.light_map_size_px),
            (s.uv_metric, s.thickness_follows_volume),
            green::rebuilt(s),
        )
    };
    if rebuilt(surface) != rebuilt(&before) {
        Some(PanelAsk::Rebuild)
    } else if *surface != before {
        Some(PanelAsk::SurfaceKnobs)
    } else {
        None
    }
}

fn subsurface(ui: &mut Ui, surface: &mut SurfaceSection) {
    ui.add(Slider::new(&mut surface.samples, 1..=50).text("samples"));
    let name = |quadrature| match quadrature {
        Quadrature::Published => "as published",
        Quadrature::ClosedForm => "closed form",
        Quadrature::ByLayer => "by layer",
    };
    ComboBox::from_label("quadrature")
        .selected_text(name(surface.quadrature))
        .show_ui(ui, |ui| {
            for quadrature in [
                Quadrature::Published,
                Quadrature::ClosedForm,
                Quadrature::ByLayer,
            ] {
                ui.selectable_value(&mut surface.quadrature, quadrature, name(quadrature));
            }
        });
    ui.add(
        Slider::new(&mut surface.layer_depth_max_m, 5e-4..=0.03)
            .logarithmic(true)
            .text("deepest layer [m]"),
    );
    ui.add(Slider::new(&mut surface.color_blend, 0.0..=1.0).text("colour of the maps"));
    ui.add(Slider::new(&mut surface.multiple_scattering, 0.0..=3.0).text("multiple scattering"));
    ui.add(Slider::new(&mut surface.wrap, 0.0..=1.0).text("wrap"));
    ui.collapsing("layers", |ui| {
        for (index, layer) in surface.layers.iter_mut().enumerate() {
            ui.label(format!("layer {}", index + 1));
            for (name, coefficients) in [
                ("absorption [1/m]", &mut layer.absorption_per_m),
                ("scattering [1/m]", &mut layer.scattering_per_m),
            ] {
                ui.horizontal(|ui| {
                    for value in coefficients {
                        ui.add(egui::DragValue::new(value).range(0.1..=20_000.0).speed(5.0));
                    }
                    ui.label(name);
                });
            }
            ui.add(Slider::new(&mut layer.asymmetry, -0.9..=0.9).text("asymmetry"));
        }
    });
}

fn gooey(ui: &mut Ui, surface: &mut SurfaceSection) {
    ui.add(
        Slider::new(&mut surface.layer_distance_m, 1e-4..=0.02)
            .logarithmic(true)
            .text("layer distance [m]"),
    );
    ui.add(
        Slider::new(&mut surface.blur_radius_m, 1e-4..=0.05)
            .logarithmic(true)
            .text("blur radius [m]"),
    );
    ui.add(Slider::new(&mut surface.blur_passes, 0..=6).text("blur passes"));
    ui.add(Slider::new(&mut surface.outer_opacity, 0.0..=2.0).text("outer opacity"));
}
