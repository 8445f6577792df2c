//! The panel beside the scene: choosers, knobs, plots and read-outs.
//!
//! It changes plain data in the session and the panel's own state, and asks the window for what more that
//! needs. It draws nothing of the scene: the picture lies below it.

mod changed;
mod help;
mod knobs;
mod plots;
mod run;
mod section;
#[cfg(test)]
mod tests;

use super::hand::HandKnobs;
use super::history::History;
use super::light_error::ErrorMap;
use super::orbit::Side;
use super::overlay::OverlaysShown;
use super::push::PushCurve;
use super::section::Section;
use super::{Session, changes};
use crate::scene::Scene;
use egui::{Align2, Ui};

/// What the panel shows and what was switched in it.
pub struct PanelState {
    /// Scene that runs.
    pub scene_name: String,
    /// The scene as it was opened: what turned knobs go back to.
    pub home: Scene,
    /// A scene or body that is to be opened, as it is typed.
    pub path: String,
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
    /// Whether the list of turned values is shown.
    pub changes_open: bool,
    /// Whether the error of the light path is laid over the picture.
    pub light_error_shown: bool,
    /// What else is.
    pub overlays: OverlaysShown,
    /// A file hangs over the window, not yet let go.
    pub drop_hovers: bool,
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
    /// Open a scene, or a body in place of the running one's.
    Open(String),
    /// Read the body anew: it was changed in a way that the running one can't take over.
    Reload,
    /// Build the passes anew: another surface or light path.
    Rebuild,
    /// Send changed knobs of the surface to the GPU.
    SurfaceKnobs,
    /// Take over lights that were turned or dimmed.
    Lights,
    /// Take over changed knobs of the solver, gravity or damping.
    Solver,
    /// Take over a changed heartbeat.
    Beat,
    /// Take over the scene's camera.
    Camera,
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
    /// Look at the body from a side.
    Look(Side),
}

impl PanelState {
    /// The state of a window that was just opened.
    pub fn new(scene_name: &str, session: &Session) -> Self {
        Self {
            scene_name: scene_name.to_owned(),
            home: session.scene.clone(),
            path: String::new(),
            hand: HandKnobs::for_size(session.rest.longest_m()),
            paused: false,
            step_once: false,
            records: false,
            screenshot: false,
            panel_open: true,
            help_open: false,
            changes_open: false,
            light_error_shown: false,
            overlays: OverlaysShown::default(),
            drop_hovers: false,
            wants_frame: true,
            asleep: false,
            frozen_particles: 0,
            error: None,
            message: session.notes.join("\n"),
        }
    }

    /// Another session has begun: one with the name of what was opened, or the running scene with another body.
    pub fn begin(&mut self, name: Option<&str>, session: &Session) {
        if let Some(name) = name {
            self.scene_name = name.to_owned();
            self.home = session.scene.clone();
        }
        self.hand = HandKnobs::for_size(session.rest.longest_m());
        self.records = false;
        self.asleep = false;
        self.frozen_particles = 0;
        self.message = session.notes.join("\n");
        self.wants_frame = true;
    }
}

/// What the panel draws and the window holds.
#[derive(Clone, Copy)]
pub struct Shown<'a> {
    /// The error of the light path, as a picture, where it is known.
    pub error: Option<(egui::TextureId, &'a ErrorMap)>,
    /// What is being opened.
    pub opening: Option<&'a str>,
    /// The layers below the cursor.
    pub section: Option<&'a Section>,
    /// The last frames.
    pub history: &'a History,
    /// The push that goes on, or the last one.
    pub push: &'a PushCurve,
}

/// Draws the panel, and over the picture what belongs there; returns where the picture is, in points.
pub fn show(
    ui: &mut Ui,
    state: &mut PanelState,
    session: &mut Session,
    shown: Shown<'_>,
    asks: &mut Vec<PanelAsk>,
) -> egui::Rect {
    let before = session.scene.clone();
    if state.panel_open {
        egui::Panel::right("panel")
            .resizable(false)
            .exact_size(330.0)
            .show(ui, |ui| {
                egui::ScrollArea::vertical().show(ui, |ui| {
                    run::section(ui, state, session, shown.opening, asks);
                    said(ui, state);
                    plots::section(ui, state, session, &shown);
                    knobs::overlays(ui, state);
                    knobs::surface(ui, session);
                    knobs::light_path(ui, state, session, shown.error);
                    knobs::lights(ui, session);
                    knobs::solver(ui, session);
                    knobs::body(ui, session);
                    knobs::beat(ui, session);
                    knobs::hand(ui, state, session);
                    knobs::camera(ui, session, asks);
                });
            });
    }
    let view = egui::CentralPanel::no_frame()
        .show(ui, |ui| {
            let rect = ui.available_rect_before_wrap();
            if state.light_error_shown {
                super::heat::paint(ui, rect, session, shown.error);
            }
            if state.overlays.section {
                section::paint(ui, rect, session, shown.section);
            }
            rect
        })
        .inner;
    help::hint(ui, state, view, shown.opening);
    help::keys(ui, state);
    changed::list(ui, state, session);
    error(ui, state);
    asks.extend(changes::asks(&before, &session.scene));
    view
}

/// What was done last, and what a body that was opened needed.
fn said(ui: &mut Ui, state: &PanelState) {
    if !state.message.is_empty() {
        ui.label(egui::RichText::new(&state.message).small());
    }
}

fn error(ui: &Ui, state: &mut PanelState) {
    let Some(error) = state.error.clone() else {
        return;
    };
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
