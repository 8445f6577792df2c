//! Knobs of the scene, section by section; those of a surface's own kind are in [`crate::app::knobs`].

use super::{PanelAsk, PanelState};
use crate::app::Session;
use crate::app::hand::HandKnobs;
use crate::app::light_error::ErrorMap;
use crate::app::orbit::Side;
use crate::app::session::substeps;
use crate::app::slider::{Slider, three};
use crate::geom::plane::LightPathMethod;
use crate::passes::frame::{patch_radius_m, tolerance_m};
use crate::scene::{LightSection, SurfaceKind};
use crate::sim::{HandOver, Method};
use egui::{ComboBox, Ui};
use glam::Vec3;

/// What is drawn over the picture.
pub fn overlays(ui: &mut Ui, state: &mut PanelState) {
    ui.separator();
    ui.strong("Over the picture");
    let shown = &mut state.overlays;
    ui.horizontal_wrapped(|ui| {
        ui.checkbox(&mut shown.normals, "normals (V)");
        ui.checkbox(&mut shown.tangents, "tangents (T)");
        ui.checkbox(&mut shown.primitives, "light-path primitives (L)");
        ui.checkbox(&mut shown.lattice, "tetrahedra (B)");
        ui.checkbox(&mut shown.section, "layers cut open (X)");
        ui.checkbox(&mut state.light_error_shown, "error against cast rays (E)");
    });
}

/// The surface model and its own knobs.
pub fn surface(ui: &mut Ui, session: &mut Session) {
    ui.separator();
    ui.strong("Surface");
    let surface = &mut session.scene.surface;
    ui.horizontal_wrapped(|ui| {
        for kind in [
            SurfaceKind::Plain,
            SurfaceKind::Gooey,
            SurfaceKind::Subsurface,
            SurfaceKind::Wrap,
            SurfaceKind::Absorption,
            SurfaceKind::Diffusion,
        ] {
            ui.selectable_value(&mut surface.kind, kind, kind.name());
        }
    });
    crate::app::knobs::surface(ui, surface);
}

/// How the way of light is found.
pub fn light_path(
    ui: &mut Ui,
    state: &PanelState,
    session: &mut Session,
    error: Option<(egui::TextureId, &ErrorMap)>,
) {
    if session.scene.surface.kind != SurfaceKind::Subsurface {
        return;
    }
    ui.separator();
    ui.strong("Light path");
    let (mut radius_m, mut step_m) = (patch_radius_m(&session.scene), tolerance_m(&session.scene));
    let path = &mut session.scene.light_path;
    let method = &mut path.method;
    ComboBox::from_label("primitive")
        .selected_text(method.name())
        .show_ui(ui, |ui| {
            for other in LightPathMethod::ALL {
                ui.selectable_value(method, other, other.name());
            }
        });
    let radius = Slider::new(&mut radius_m, 1e-4..=0.1).logarithmic(true);
    if ui.add(radius.text("radius of a patch [m]")).changed() {
        path.radius_m = Some(radius_m);
    }
    let tolerance = Slider::new(&mut step_m, 0.0..=1e-3)
        .logarithmic(true)
        .smallest_positive(1e-8);
    if ui.add(tolerance.text("moves unnoticed [m]")).changed() {
        path.tolerance_m = Some(step_m);
    }
    if path.method == LightPathMethod::Sampled {
        let skip = &mut path.skip_optical_depth;
        ui.add(Slider::new(skip, 0.0..=0.5).text("optical depth passed over"));
    }
    if let Some(error_rel) = error.and_then(|(_, map)| map.error_rel)
        && state.light_error_shown
    {
        ui.label(format!("radiance {:.1} % off", 100.0 * error_rel));
    }
}

/// Every light: where it comes from, and how strong it is.
pub fn lights(ui: &mut Ui, session: &mut Session) {
    ui.separator();
    ui.strong("Lights");
    // One light casts shadows; the others are not asked.
    let caster = session.scene.lights.iter().position(|light| light.shadow);
    for (index, light) in session.scene.lights.iter_mut().enumerate() {
        let name = format!("light {}", index + 1);
        ui.collapsing(name, |ui| {
            one_light(ui, light, caster.is_none_or(|it| it == index))
        });
    }
}

fn one_light(ui: &mut Ui, light: &mut LightSection, may_cast: bool) {
    if let Some(toward) = &mut light.toward {
        direction(ui, toward);
    }
    for (place, label) in [
        (&mut light.at_m, "place [m]"),
        (&mut light.at_share, "place [shares]"),
    ] {
        if let Some(place) = place {
            three(ui, place.as_mut(), -100.0..=100.0, 0.01, label);
        }
    }
    let color = &mut light.irradiance_w_m2;
    let strongest = color.iter().copied().fold(0.0, f32::max);
    let mut strength = strongest;
    let slider = Slider::new(&mut strength, 0.01..=100.0).logarithmic(true);
    if ui.add(slider.text("strength [W/m²]")).changed() {
        let scale = strength / strongest.max(1e-6);
        *color = color.map(|part| {
            if strongest > 0.0 {
                scale * part
            } else {
                strength
            }
        });
    }
    three(ui, color, 0.0..=1000.0, 0.02, "red, green, blue");
    if light.toward.is_some() && may_cast {
        ui.checkbox(&mut light.shadow, "casts shadows");
    }
}

/// A direction as height above the horizon and turn about the vertical.
fn direction(ui: &mut Ui, toward: &mut Vec3) {
    let unit = toward.normalize_or(Vec3::Y);
    let mut height = unit.y.clamp(-1.0, 1.0).asin().to_degrees();
    let mut turn = unit.x.atan2(unit.z).to_degrees();
    let raised = ui.add(Slider::new(&mut height, -89.0..=89.0).text("height [°]"));
    let turned = ui.add(Slider::new(&mut turn, -180.0..=180.0).text("turn [°]"));
    if raised.changed() || turned.changed() {
        let (sin, cos) = height.to_radians().sin_cos();
        let (across, ahead) = turn.to_radians().sin_cos();
        *toward = toward.length().max(1e-3) * Vec3::new(cos * across, sin, cos * ahead);
    }
}

/// How the body moves.
pub fn solver(ui: &mut Ui, session: &mut Session) {
    ui.separator();
    ui.strong("Solver");
    let (taken, cause) = (session.solver(), session.handed_over_for());
    let solver = &mut session.scene.solver;
    ComboBox::from_label("method")
        .selected_text(solver.method.name())
        .show_ui(ui, |ui| {
            for method in Method::ALL {
                ui.selectable_value(&mut solver.method, method, method.name());
            }
        });
    ui.add(
        Slider::new(&mut solver.youngs_modulus_pa, 500.0..=100_000.0)
            .logarithmic(true)
            .text("Young's modulus [Pa]"),
    );
    ui.add(Slider::new(&mut solver.poisson_ratio, 0.0..=0.49).text("Poisson ratio"));
    ui.add(Slider::new(&mut solver.substeps, 1..=60).text("substeps"));
    if taken.method != solver.method {
        let (method, substeps) = (taken.method.name(), substeps(taken.substeps));
        let why = match cause {
            Some(HandOver::WavesGrew) => "waves grew in the tissue",
            Some(HandOver::Trembled) => "the tissue trembled",
            Some(HandOver::Folded) => "the tissue stayed folded",
            Some(HandOver::TooStiff) | None => "the tissue is stiff",
        };
        ui.label(format!("{method} is taken, in {substeps}: {why}"));
    }
    ui.add(Slider::new(&mut solver.iterations, 1..=10).text("iterations"));
    let step = Slider::new(&mut solver.timestep_s, 1e-3..=0.05).logarithmic(true);
    ui.add(step.text("time step [s]"));
}

/// What is moved.
pub fn body(ui: &mut Ui, session: &mut Session) {
    ui.separator();
    ui.strong("Body");
    let longest_m = session.rest.longest_m();
    let body = &mut session.scene.body;
    three(
        ui,
        body.gravity_m_s2.as_mut(),
        -100.0..=100.0,
        0.1,
        "gravity [m/s²]",
    );
    ui.add(Slider::new(&mut body.damping_per_s, 0.0..=50.0).text("damping [1/s]"));
    ui.add(Slider::new(&mut body.density_kg_m3, 100.0..=5000.0).text("density [kg/m³]"));
    // Left out, it is as long as its file or shape says.
    let mut size_m = body.size_m.unwrap_or(longest_m);
    let size = Slider::new(&mut size_m, 0.005..=1.0).logarithmic(true);
    if ui.add(size.text("size [m]")).changed() {
        body.size_m = Some(size_m);
    }
    if let Some(in_use_m) = session.cell_m {
        // Left out, it is chosen by the shape and a budget.
        let mut cell_m = body.cell_m.unwrap_or(in_use_m);
        let cell = Slider::new(&mut cell_m, 5e-4..=0.05).logarithmic(true);
        if ui.add(cell.text("cell [m]")).changed() {
            body.cell_m = Some(cell_m);
        }
    }
}

/// How the muscle shortens, in a body that beats.
pub fn beat(ui: &mut Ui, session: &mut Session) {
    let Some(beat) = &mut session.scene.body.beat else {
        return;
    };
    ui.separator();
    ui.strong("Heartbeat");
    ui.checkbox(&mut beat.runs, "beats");
    ui.add(Slider::new(&mut beat.rate_per_min, 20.0..=180.0).text("beats a minute"));
    ui.add(Slider::new(&mut beat.strain, 0.0..=0.2).text("shortening"));
}

/// How the hand prods.
pub fn hand(ui: &mut Ui, state: &mut PanelState, session: &Session) {
    ui.separator();
    let longest_m = session.rest.longest_m();
    let home = HandKnobs::for_size(longest_m);
    ui.horizontal(|ui| {
        ui.strong("Hand");
        if state.hand != home && ui.small_button("as it was").clicked() {
            state.hand = home;
        }
    });
    let hand = &mut state.hand;
    ui.add(Slider::new(&mut hand.radius_m, 0.01 * longest_m..=0.2 * longest_m).text("radius [m]"));
    ui.add(Slider::new(&mut hand.depth_m, 0.0..=0.3 * longest_m).text("depth [m]"));
    ui.add(
        Slider::new(&mut hand.speed_m_s, 0.02 * longest_m..=5.0 * longest_m).text("speed [m/s]"),
    );
    ui.add(Slider::new(&mut hand.friction, 0.0..=1.0).text("friction"));
}

/// Where it is seen from.
pub fn camera(ui: &mut Ui, session: &mut Session, asks: &mut Vec<PanelAsk>) {
    ui.separator();
    ui.horizontal(|ui| {
        ui.strong("Camera");
        for (name, side) in [
            ("front", Side::Front),
            ("side", Side::Right),
            ("top", Side::Top),
            ("fit", Side::Kept),
        ] {
            if ui.small_button(name).clicked() {
                asks.push(PanelAsk::Look(side));
            }
        }
    });
    let angle = &mut session.scene.camera.fov_y_deg;
    ui.add(Slider::new(angle, 5.0..=90.0).text("view angle [°]"));
}
