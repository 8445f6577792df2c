//! What the mouse and the keys do, in words.

use super::PanelState;
use egui::{Align2, Color32, Ui};

/// What each key does, and what the mouse does.
pub const KEYS: [(&str, &str); 30] = [
    ("left drag on the organ", "push the tool into it"),
    ("right drag on the organ", "grab it"),
    ("middle drag, or left beside it", "orbit"),
    ("right drag beside it", "move the view"),
    ("wheel", "zoom; while pushing, the depth"),
    (
        "drop a file",
        "open a scene, or put a body in place of this one",
    ),
    ("Space", "pause or resume"),
    ("N or .", "one time step"),
    ("R", "reset to rest"),
    ("P", "play the scene's script"),
    ("C", "back to the scene's camera"),
    ("1", "from the front"),
    ("2", "from the side"),
    ("3", "from above"),
    ("4", "all of the body in the picture"),
    ("V", "normals"),
    ("T", "tangents"),
    ("L", "light-path primitives"),
    ("B", "tetrahedra of the body"),
    ("X", "layers cut open below the cursor"),
    ("E", "error of the light path against cast rays"),
    ("U", "values that were turned, and the way back"),
    ("S or F12", "save a picture"),
    ("O", "record the mouse from rest; again: stop and save"),
    ("K", "save the scene as it is"),
    ("Tab", "hide or show the panel"),
    ("H or F1", "this list"),
    ("Escape", "close a message, this list, then the window"),
    ("Ctrl+Q", "close the window"),
    (
        "Ctrl+0",
        "size of the panel's letters as it was; Ctrl+ and Ctrl- change it",
    ),
];

/// One line at the bottom of the picture.
pub fn hint(ui: &Ui, state: &PanelState, view: egui::Rect, opening: Option<&str>) {
    let text = match opening {
        _ if state.drop_hovers => "let go to open it".to_owned(),
        Some(name) => format!("opening {name} …"),
        None if state.paused => "paused: Space resumes, N makes one step".to_owned(),
        None => "left drag pushes · right drag grabs · middle drag orbits · wheel: depth or zoom · H: keys"
            .to_owned(),
    };
    ui.painter().text(
        view.left_bottom() + egui::vec2(10.0, -8.0),
        Align2::LEFT_BOTTOM,
        text,
        egui::FontId::proportional(12.0),
        Color32::from_white_alpha(140),
    );
}

/// The list of keys, where it is asked for.
pub fn keys(ui: &Ui, state: &mut PanelState) {
    if !state.help_open {
        return;
    }
    egui::Window::new("Keys and mouse")
        .open(&mut state.help_open)
        .resizable(false)
        .show(ui.ctx(), |ui| {
            egui::ScrollArea::vertical()
                .max_height(680.0)
                .show(ui, |ui| {
                    egui::Grid::new("keys").num_columns(2).show(ui, |ui| {
                        for (what, does) in KEYS {
                            ui.strong(what);
                            ui.label(does);
                            ui.end_row();
                        }
                    });
                });
        });
}
