//! The panel beside the scene: choosers, knobs, plots and read-outs.
//!
//! It changes plain data in the session and the panel's own state, and asks the window for what more that
//! needs. It draws nothing of the scene but the finished picture.

use super::hand::HandKnobs;
use super::history::History;
use super::light_error::ErrorMap;
use super::{Session, assets};
use crate::geom::plane::LightPathMethod;
use crate::scene::SurfaceKind;
use crate::sim::Method;
use egui::{Align2, Color32, ComboBox, RichText, Slider, Ui};
use egui_plot::{Bar, BarChart, Line, Plot, PlotPoints};

/// Of what says that the mouse is recorded.
const RECORDING: Color32 = Color32::from_rgb(232, 84, 72);

/// What the panel shows and what was switched in it.
pub struct PanelState {
    /// Scene that runs.
    pub scene_name: String,
    /// How the hand prods.
    pub hand: HandKnobs,
    /// Whether time stands still.
    pub paused: bool,
    /// One time step is wanted though time stands still.
    pub step_once: bool,
    /// The mouse is recorded.
    pub records: bool,
    /// A picture is to be saved.
    pub screenshot: bool,
    /// Whether the panel is shown.
    pub panel_open: bool,
    /// Whether the list of keys is shown.
    pub help_open: bool,
    /// Whether the error of the light path is laid over the picture.
    pub light_error_shown: bool,
    /// Something changed that is not on the screen yet.
    pub wants_frame: bool,
    /// The body sleeps.
    pub asleep: bool,
    /// Particles that were contained.
    pub frozen_particles: usize,
    /// The last thing that went wrong.
    pub error: Option<String>,
    /// The last thing that was done.
    pub message: String,
}

/// What only the window can do.
#[derive(Clone, Debug, PartialEq)]
pub enum PanelAsk {
    /// Load another scene.
    Scene(String),
    /// Build the passes anew: another surface or light path.
    Rebuild,
    /// Send changed knobs of the surface to the GPU.
    SurfaceKnobs,
    /// Take over changed knobs of the solver.
    Solver,
    /// Take over a changed heartbeat.
    Beat,
    /// Back to rest.
    Reset,
    /// Start a recording of the mouse, or end and save it.
    Record,
    /// Save the scene with its knobs as they are.
    SaveScene,
    /// Play the scene's script from its start.
    PlayScript,
    /// Back to the scene's camera.
    ResetCamera,
}

impl PanelState {
    /// The state of a window that was just opened.
    pub fn new(scene_name: &str, hand: HandKnobs) -> Self {
        Self {
            scene_name: scene_name.to_owned(),
            hand,
            paused: false,
            step_once: false,
            records: false,
            screenshot: false,
            panel_open: true,
            help_open: false,
            light_error_shown: false,
            wants_frame: true,
            asleep: false,
            frozen_particles: 0,
            error: None,
            message: String::new(),
        }
    }
}

/// What the panel draws and the window holds.
#[derive(Clone, Copy)]
pub struct Shown<'a> {
    /// The finished picture of the scene.
    pub picture: egui::TextureId,
    /// The error of its light path, as a picture, where it is known.
    pub error: Option<(egui::TextureId, &'a ErrorMap)>,
}

/// Draws panel and picture; returns where the picture is, in points.
pub fn show(
    ui: &mut Ui,
    state: &mut PanelState,
    session: &mut Session,
    history: &History,
    shown: Shown<'_>,
    asks: &mut Vec<PanelAsk>,
) -> egui::Rect {
    if state.panel_open {
        egui::Panel::right("panel")
            .resizable(false)
            .exact_size(330.0)
            .show(ui, |ui| {
                egui::ScrollArea::vertical().show(ui, |ui| {
                    run_section(ui, state, session, asks);
                    readings(ui, state, session, history);
                    surface_section(ui, session, asks);
                    light_path_section(ui, state, session, shown.error, asks);
                    solver_section(ui, session, asks);
                    beat_section(ui, session, asks);
                    hand_section(ui, state, session);
                });
            });
    }
    let view = egui::CentralPanel::no_frame()
        .show(ui, |ui| {
            let rect = ui.available_rect_before_wrap();
            egui::Image::new((shown.picture, rect.size())).paint_at(ui, rect);
            if state.light_error_shown {
                super::heat::paint(ui, rect, session, shown.error);
            }
            rect
        })
        .inner;
    hint(ui, state, view);
    if state.help_open {
        help(ui, state);
    }
    if let Some(error) = state.error.clone() {
        egui::Window::new("Something is wrong")
            .anchor(Align2::CENTER_TOP, [0.0, 12.0])
            .collapsible(false)
            .resizable(false)
            .show(ui.ctx(), |ui| {
                ui.label(error);
                if ui.button("Dismiss").clicked() {
                    state.error = None;
                }
            });
    }
    view
}

fn run_section(
    ui: &mut Ui,
    state: &mut PanelState,
    session: &mut Session,
    asks: &mut Vec<PanelAsk>,
) {
    ui.add_space(6.0);
    ui.horizontal(|ui| {
        ui.heading("palpate");
        ComboBox::from_id_salt("scene")
            .selected_text(&state.scene_name)
            .show_ui(ui, |ui| {
                for (name, _) in assets::scenes() {
                    let is_this = state.scene_name == *name;
                    if ui.selectable_label(is_this, *name).clicked() && !is_this {
                        asks.push(PanelAsk::Scene((*name).to_owned()));
                    }
                }
            });
    });
    ui.label(RichText::new(&session.scene.title).weak());
    ui.horizontal(|ui| {
        let label = if state.paused { "Resume" } else { "Pause" };
        if ui.button(label).clicked() {
            state.paused = !state.paused;
        }
        if ui.button("Step").clicked() {
            state.paused = true;
            state.step_once = true;
        }
        if ui.button("Reset").clicked() {
            asks.push(PanelAsk::Reset);
        }
        if ui.button("Script").clicked() {
            asks.push(PanelAsk::PlayScript);
        }
        if ui.button("Camera").clicked() {
            asks.push(PanelAsk::ResetCamera);
        }
    });
    ui.horizontal(|ui| {
        let label = if state.records {
            RichText::new("Stop and save").color(RECORDING)
        } else {
            RichText::new("Record")
        };
        let record = ui.button(label);
        let about = "Starts from rest and saves what the mouse does as a scene that replays it";
        if record.on_hover_text(about).clicked() {
            asks.push(PanelAsk::Record);
        }
        if ui.button("Save scene").clicked() {
            asks.push(PanelAsk::SaveScene);
        }
        if ui.button("Picture").clicked() {
            state.screenshot = true;
        }
    });
}

fn readings(ui: &mut Ui, state: &PanelState, session: &Session, history: &History) {
    ui.separator();
    let Some(last) = history.last() else {
        ui.label("waiting for the first time step");
        return;
    };
    egui::Grid::new("readings").num_columns(4).show(ui, |ui| {
        ui.label("force");
        ui.label(RichText::new(format!("{:.2} N", last.force_n)).strong());
        ui.label("volume");
        ui.label(format!("{:+.2} %", 100.0 * last.volume_drift));
        ui.end_row();
        ui.label("time");
        ui.label(format!("{:.2} s", session.time_s()));
        ui.label("depth");
        ui.label(format!("{:.2} mm", 1e3 * last.penetration_m));
        ui.end_row();
    });
    if state.frozen_particles > 0 {
        ui.colored_label(
            Color32::from_rgb(230, 120, 60),
            format!(
                "{} particles went astray and are held: reset to free them",
                state.frozen_particles
            ),
        );
    } else if state.asleep {
        ui.label(RichText::new("asleep: nothing moves").weak());
    }
    stage_plot(ui, history);
    force_plot(ui, history);
}

/// Colours of the stages, in their order; from a scale that colour-blind readers can tell apart.
const STAGE_COLORS: [Color32; 8] = [
    Color32::from_rgb(0x44, 0x77, 0xaa),
    Color32::from_rgb(0xee, 0x66, 0x77),
    Color32::from_rgb(0x22, 0x88, 0x33),
    Color32::from_rgb(0xcc, 0xbb, 0x44),
    Color32::from_rgb(0x66, 0xcc, 0xee),
    Color32::from_rgb(0xaa, 0x33, 0x77),
    Color32::from_rgb(0xee, 0x99, 0x66),
    Color32::from_rgb(0xbb, 0xbb, 0xbb),
];

fn stage_plot(ui: &mut Ui, history: &History) {
    ui.label(RichText::new("frame time by stage [ms], the whole frame in white").weak());
    let stage_ceiling_ms = 2.0 * history.median_wall_ms();
    let mut charts: Vec<BarChart> = Vec::new();
    for (index, stage) in history.stages().into_iter().enumerate() {
        let bars = history
            .iter()
            .enumerate()
            .map(|(frame, sample)| {
                Bar::new(
                    frame as f64,
                    f64::from(sample.stage_ms(stage).min(stage_ceiling_ms)),
                )
            })
            .collect();
        let chart = BarChart::new(stage, bars)
            .width(1.0)
            .color(STAGE_COLORS[index % STAGE_COLORS.len()])
            .stack_on(&charts.iter().collect::<Vec<_>>());
        charts.push(chart);
    }
    // One frame that waited for a shader must not flatten all others.
    let ceiling_ms = 3.0 * history.median_wall_ms();
    let wall: PlotPoints = history
        .iter()
        .enumerate()
        .map(|(frame, sample)| [frame as f64, f64::from(sample.wall_ms.min(ceiling_ms))])
        .collect();
    still_plot("stages").height(120.0).show(ui, |plot| {
        for chart in charts {
            plot.bar_chart(chart);
        }
        plot.line(Line::new("whole frame", wall).color(Color32::WHITE));
    });
    let last = history.last();
    ui.horizontal_wrapped(|ui| {
        for (index, stage) in history.stages().into_iter().enumerate() {
            let ms = last.map_or(0.0, |sample| sample.stage_ms(stage));
            ui.label(
                RichText::new(format!("{stage} {ms:.1}"))
                    .small()
                    .color(STAGE_COLORS[index % STAGE_COLORS.len()]),
            );
        }
    });
}

fn force_plot(ui: &mut Ui, history: &History) {
    ui.label(RichText::new("force on the tool [N]").weak());
    let force: PlotPoints = history
        .iter()
        .enumerate()
        .map(|(frame, sample)| [frame as f64, f64::from(sample.force_n)])
        .collect();
    still_plot("force").height(70.0).show(ui, |plot| {
        plot.line(Line::new("force", force).color(STAGE_COLORS[1]));
    });
}

/// A plot that only shows: the mouse belongs to the scene.
fn still_plot(id: &str) -> Plot<'_> {
    Plot::new(id)
        .allow_drag(false)
        .allow_zoom(false)
        .allow_scroll(false)
        .allow_boxed_zoom(false)
        .include_y(0.0)
        .show_axes([false, true])
}

fn surface_section(ui: &mut Ui, session: &mut Session, asks: &mut Vec<PanelAsk>) {
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
            if ui
                .selectable_value(&mut surface.kind, kind, kind.name())
                .changed()
            {
                asks.push(PanelAsk::Rebuild);
            }
        }
    });
    let change = super::knobs::surface(ui, surface);
    asks.extend(change);
}

fn light_path_section(
    ui: &mut Ui,
    state: &mut PanelState,
    session: &mut Session,
    error: Option<(egui::TextureId, &ErrorMap)>,
    asks: &mut Vec<PanelAsk>,
) {
    if session.scene.surface.kind != SurfaceKind::Subsurface {
        return;
    }
    ui.separator();
    ui.strong("Light path");
    let method = &mut session.scene.light_path.method;
    ComboBox::from_id_salt("light path")
        .selected_text(method.name())
        .show_ui(ui, |ui| {
            for other in LightPathMethod::ALL {
                if ui.selectable_value(method, other, other.name()).changed() {
                    asks.push(PanelAsk::Rebuild);
                }
            }
        });
    if *method == LightPathMethod::Sampled {
        let skip = &mut session.scene.light_path.skip_optical_depth;
        let slider = Slider::new(skip, 0.0..=0.5).text("optical depth passed over");
        // Only when let go: each change builds the passes anew.
        if ui.add(slider).drag_stopped() {
            asks.push(PanelAsk::Rebuild);
        }
    }
    ui.checkbox(&mut state.light_error_shown, "error against cast rays (E)");
    if let Some(error_rel) = error.and_then(|(_, map)| map.error_rel)
        && state.light_error_shown
    {
        ui.label(format!("radiance {:.1} % off", 100.0 * error_rel));
    }
}

fn solver_section(ui: &mut Ui, session: &mut Session, asks: &mut Vec<PanelAsk>) {
    ui.separator();
    ui.strong("Solver");
    let taken = session.solver();
    let solver = &mut session.scene.solver;
    let before = *solver;
    ComboBox::from_id_salt("solver")
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
        let (method, substeps) = (taken.method.name(), taken.substeps);
        ui.label(format!(
            "{method} is taken, in {substeps}: the tissue is stiff"
        ));
    }
    ui.add(Slider::new(&mut solver.iterations, 1..=10).text("iterations"));
    if *solver != before {
        asks.push(PanelAsk::Solver);
    }
}

fn beat_section(ui: &mut Ui, session: &mut Session, asks: &mut Vec<PanelAsk>) {
    let Some(beat) = &mut session.scene.body.beat else {
        return;
    };
    ui.separator();
    ui.strong("Heartbeat");
    let before = beat.clone();
    ui.checkbox(&mut beat.runs, "beats");
    ui.add(Slider::new(&mut beat.rate_per_min, 20.0..=180.0).text("beats a minute"));
    ui.add(Slider::new(&mut beat.strain, 0.0..=0.2).text("shortening"));
    if *beat != before {
        asks.push(PanelAsk::Beat);
    }
}

fn hand_section(ui: &mut Ui, state: &mut PanelState, session: &Session) {
    ui.separator();
    ui.strong("Hand");
    let longest_m = session.rest.longest_m();
    let hand = &mut state.hand;
    ui.add(Slider::new(&mut hand.radius_m, 0.01 * longest_m..=0.2 * longest_m).text("radius [m]"));
    ui.add(Slider::new(&mut hand.depth_m, 0.0..=0.3 * longest_m).text("depth [m]"));
    ui.add(Slider::new(&mut hand.friction, 0.0..=1.0).text("friction"));
    if !state.message.is_empty() {
        ui.separator();
        ui.label(RichText::new(&state.message).weak());
    }
}

fn hint(ui: &Ui, state: &PanelState, view: egui::Rect) {
    let text = if state.paused {
        "paused: Space resumes, N makes one step"
    } else {
        "left drag pushes · right drag grabs · middle drag orbits · wheel: depth or zoom · H: keys"
    };
    ui.painter().text(
        view.left_bottom() + egui::vec2(10.0, -8.0),
        Align2::LEFT_BOTTOM,
        text,
        egui::FontId::proportional(12.0),
        Color32::from_white_alpha(140),
    );
}

fn help(ui: &Ui, state: &mut PanelState) {
    egui::Window::new("Keys and mouse")
        .open(&mut state.help_open)
        .resizable(false)
        .show(ui.ctx(), |ui| {
            egui::Grid::new("keys").num_columns(2).show(ui, |ui| {
                for (what, does) in [
                    ("left drag on the organ", "push the tool into it"),
                    ("right drag on the organ", "grab it"),
                    ("middle drag, or left beside it", "orbit"),
                    ("right drag beside it", "move the view"),
                    ("wheel", "zoom; while pushing, the depth"),
                    ("Space", "pause or resume"),
                    ("N or .", "one time step"),
                    ("R", "reset to rest"),
                    ("P", "play the scene's script"),
                    ("C", "back to the scene's camera"),
                    ("E", "error of the light path against cast rays"),
                    ("S or F12", "save a picture"),
                    ("O", "record the mouse from rest; again: stop and save"),
                    ("K", "save the scene as it is"),
                    ("Tab", "hide or show the panel"),
                    ("H or F1", "this list"),
                    ("Escape or Ctrl+Q", "close the window"),
                ] {
                    ui.strong(what);
                    ui.label(does);
                    ui.end_row();
                }
            });
        });
}
