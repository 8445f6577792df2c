//! The values that were turned, each with a way back.

use super::PanelState;
use crate::app::Session;
use crate::app::changes::{changes, told, undone};
use egui::{Align2, RichText, Ui};

/// Lists what differs from the scene as it was opened; takes back what is asked for.
pub fn list(ui: &Ui, state: &mut PanelState, session: &mut Session) {
    if !state.changes_open {
        return;
    }
    let mut open = true;
    egui::Window::new("Turned values")
        .open(&mut open)
        .anchor(Align2::LEFT_TOP, [12.0, 12.0])
        .collapsible(false)
        .resizable(false)
        .show(ui.ctx(), |ui| {
            let changes = changes(&state.home, &session.scene);
            if changes.is_empty() {
                ui.label("All is as the scene says.");
                return;
            }
            egui::ScrollArea::vertical()
                .max_height(360.0)
                .show(ui, |ui| {
                    egui::Grid::new("changes").num_columns(4).show(ui, |ui| {
                        for change in &changes {
                            ui.label(&change.path);
                            ui.label(RichText::new(told(change.home.as_ref())).weak());
                            ui.label(RichText::new(told(change.now.as_ref())).strong());
                            let back = ui
                                .small_button("back")
                                .on_hover_text(format!("back: {}", change.path));
                            if back.clicked()
                                && let Some(scene) = undone(&session.scene, change)
                            {
                                session.scene = scene;
                            }
                            ui.end_row();
                        }
                    });
                });
            if ui.button("All back").clicked() {
                session.scene = state.home.clone();
            }
        });
    state.changes_open = open;
}
