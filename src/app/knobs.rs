//! The live knobs of a surface, those of Norberg's figure 15 among them.

use super::green_knobs as green;
use super::panel::PanelAsk;
use super::slider::{Slider, three};
use crate::optics::OpticalTissue;
use crate::passes::lightmap::SIZES_PX;
use crate::scene::{
    InnerLight, InnerTaps, Multiple, Noise, Quadrature, SurfaceKind, SurfaceSection, UvMetric,
};
use egui::{ComboBox, Ui};

/// Shows the knobs of the surface's own kind.
pub fn surface(ui: &mut Ui, surface: &mut SurfaceSection) {
    tissue(ui, surface);
    let named = surface.clone();
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
    if surface.layers != named.layers {
        surface.tissue = None;
    }
}

/// What a change of the knobs asks for.
pub fn ask(before: &SurfaceSection, after: &SurfaceSection) -> PanelAsk {
    let rebuilt = |s: &SurfaceSection| {
        (
            (s.kind, s.layers.len()),
            (s.samples, s.quadrature, s.blur_passes, s.light_map_size_px),
            (s.uv_metric, s.thickness_follows_volume),
            (s.inner.len(), s.inner_taps, s.inner_light),
            (s.layer_shadow > 0.0, s.noise),
            (s.tissue, s.multiple),
            green::rebuilt(s),
        )
    };
    if rebuilt(after) == rebuilt(before) {
        PanelAsk::SurfaceKnobs
    } else {
        PanelAsk::Rebuild
    }
}

/// A list that one of `choices` is picked from.
fn choice<T: Copy + PartialEq, const N: usize>(
    ui: &mut Ui,
    label: &str,
    value: &mut T,
    choices: [T; N],
    name: impl Fn(T) -> &'static str,
) {
    ComboBox::from_label(label)
        .selected_text(name(*value))
        .show_ui(ui, |ui| {
            for choice in choices {
                ui.selectable_value(value, choice, name(choice));
            }
        });
}

/// The tissue whose measured coefficients fill the layers.
fn tissue(ui: &mut Ui, surface: &mut SurfaceSection) {
    let reads_layers = matches!(
        surface.kind,
        SurfaceKind::Subsurface | SurfaceKind::Absorption | SurfaceKind::Diffusion
    );
    if !reads_layers {
        return;
    }
    let before = surface.tissue;
    let name = |tissue: Option<OpticalTissue>| tissue.map_or("layers as set", OpticalTissue::name);
    ComboBox::from_label("tissue")
        .selected_text(name(before))
        .show_ui(ui, |ui| {
            for choice in std::iter::once(None).chain(OpticalTissue::ALL.map(Some)) {
                ui.selectable_value(&mut surface.tissue, choice, name(choice));
            }
        });
    if surface.tissue != before {
        surface.take_tissue();
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
    let multiple = |multiple| match multiple {
        Multiple::Wrapped => "of the maps' colour, wrapped",
        Multiple::Calibrated => "of the layers",
    };
    choice(
        ui,
        "scattered often",
        &mut surface.multiple,
        [Multiple::Wrapped, Multiple::Calibrated],
        multiple,
    );
    ui.add(Slider::new(&mut surface.multiple_scattering, 0.0..=3.0).text("multiple scattering"));
    ui.add(Slider::new(&mut surface.wrap, 0.0..=1.0).text("wrap"));
    let noise = |noise| match noise {
        Noise::None => "none",
        Noise::Clouds => "clouds",
        Noise::Gradient => "gradient",
    };
    choice(
        ui,
        "noise",
        &mut surface.noise,
        [Noise::None, Noise::Clouds, Noise::Gradient],
        noise,
    );
    ui.add(
        Slider::new(&mut surface.noise_m, 1e-5..=0.01)
            .logarithmic(true)
            .text("noise [m]"),
    );
    ui.add(Slider::new(&mut surface.noise_lookups, 1..=8).text("noise look-ups"));
    ui.collapsing("layers", |ui| {
        for (index, layer) in surface.layers.iter_mut().enumerate() {
            ui.label(format!("layer {}", index + 1));
            for (name, coefficients) in [
                ("absorption [1/m]", &mut layer.absorption_per_m),
                ("scattering [1/m]", &mut layer.scattering_per_m),
            ] {
                three(ui, coefficients, 0.1..=20_000.0, 5.0, name);
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
    let mut by_blur = surface.light_map_size_px.is_none();
    if ui
        .checkbox(&mut by_blur, "light map as fine as the blur asks")
        .changed()
    {
        surface.light_map_size_px = (!by_blur).then_some(SIZES_PX[1]);
    }
    if let Some(size_px) = &mut surface.light_map_size_px {
        ui.add(
            Slider::new(size_px, 64..=1024)
                .logarithmic(true)
                .text("light map [px]"),
        );
    }
    ui.add(Slider::new(&mut surface.outer_opacity, 0.0..=2.0).text("outer opacity"));
    ui.add(Slider::new(&mut surface.layer_shadow, 0.0..=1.0).text("shadow between layers"));
    let light = |light| match light {
        InnerLight::Map => "light map",
        InnerLight::NormalMap => "normal map",
        InnerLight::SmoothNormal => "smooth normal",
    };
    choice(
        ui,
        "light of inner layers",
        &mut surface.inner_light,
        [
            InnerLight::Map,
            InnerLight::NormalMap,
            InnerLight::SmoothNormal,
        ],
        light,
    );
    let taps = |taps| match taps {
        InnerTaps::One => "not",
        InnerTaps::Three => "by three taps",
        InnerTaps::Disc => "by the disc",
    };
    choice(
        ui,
        "inner layers blurred",
        &mut surface.inner_taps,
        [InnerTaps::One, InnerTaps::Three, InnerTaps::Disc],
        taps,
    );
    ui.add(Slider::new(&mut surface.inner_blur, 0.0..=2.0).text("inner blur [of the way]"));
    ui.collapsing("inner layers", |ui| {
        for (index, layer) in surface.inner.iter_mut().enumerate() {
            ui.label(format!("inner layer {}", index + 1));
            ui.add(Slider::new(&mut layer.distance, 0.0..=8.0).text("distance [layer distances]"));
            ui.add(Slider::new(&mut layer.opacity, 0.0..=1.0).text("opacity"));
            three(ui, &mut layer.color, 0.0..=4.0, 0.01, "colour");
        }
    });
}
