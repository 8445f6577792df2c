//! The top of the panel: the scene, time, and what is saved.

use super::{PanelAsk, PanelState};
use crate::app::{Session, assets, changes};
use egui::{Color32, ComboBox, RichText, TextEdit, Ui};

/// Of what says that the mouse is recorded.
const RECORDING: Color32 = Color32::from_rgb(232, 84, 72);

/// What runs, and what can be done with it.
pub fn section(
    ui: &mut Ui,
    state: &mut PanelState,
    session: &Session,
    opening: Option<&str>,
    asks: &mut Vec<PanelAsk>,
) {
    ui.add_space(6.0);
    ui.horizontal(|ui| {
        ui.heading("palpate");
        ComboBox::from_label("scene")
            .truncate()
            .selected_text(&state.scene_name)
            .show_ui(ui, |ui| {
                for (name, _) in assets::scenes() {
                    let is_this = state.scene_name == *name;
                    if ui.selectable_label(is_this, *name).clicked() && !is_this {
                        asks.push(PanelAsk::Open((*name).to_owned()));
                    }
                }
            });
    });
    ui.label(RichText::new(&session.scene.title).weak());
    open(ui, state, opening, asks);
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
    let changes = changes::changes(&state.home, &session.scene).len();
    let label = match changes {
        0 => "nothing was turned".to_owned(),
        1 => "1 value was turned".to_owned(),
        more => format!("{more} values were turned"),
    };
    let about = "Lists them beside the scene's own values, each with a way back (U)";
    if ui
        .selectable_label(state.changes_open, label)
        .on_hover_text(about)
        .clicked()
    {
        state.changes_open = !state.changes_open;
    }
}

/// Where the path of a scene or a body is typed.
fn open(ui: &mut Ui, state: &mut PanelState, opening: Option<&str>, asks: &mut Vec<PanelAsk>) {
    ui.horizontal(|ui| {
        let field = TextEdit::singleline(&mut state.path)
            .hint_text("path of a .toml, .glb, .obj or .msh, or drop one")
            .desired_width(245.0);
        let field = ui.add(field);
        let entered = field.lost_focus() && ui.input(|input| input.key_pressed(egui::Key::Enter));
        let path = state.path.trim();
        if (ui.button("Open").clicked() || entered) && !path.is_empty() {
            asks.push(PanelAsk::Open(path.to_owned()));
        }
    });
    if let Some(name) = opening {
        ui.label(RichText::new(format!("opening {name} …")).strong());
    }
}
