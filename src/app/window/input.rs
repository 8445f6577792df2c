//! What mouse and keyboard do.

use super::Shown;
use super::shown::Drag;
use crate::app::hand::Hand;
use crate::app::orbit::{Ray, Side};
use crate::sim::ToolAction;
use egui::{Event, Key, Modifiers};
use glam::Vec2;
use winit::event::{ElementState, MouseButton, MouseScrollDelta, WindowEvent};

/// A key that was pressed, by what is printed on it.
#[derive(Clone, Copy, Debug)]
pub struct Pressed {
    key: Key,
    modifiers: Modifiers,
}

/// The keys that were pressed in the events of a frame, in order. Tab, by which the panel would be walked through, is
/// taken from `events` if `takes_tab`.
pub fn keys(events: &mut Vec<Event>, takes_tab: bool) -> Vec<Pressed> {
    let mut pressed = Vec::new();
    events.retain(|event| {
        let &Event::Key {
            key,
            pressed: is_down,
            modifiers,
            ..
        } = event
        else {
            return true;
        };
        if is_down {
            pressed.push(Pressed { key, modifiers });
        }
        !(takes_tab && key == Key::Tab)
    });
    pressed
}

impl Pressed {
    /// Whether it closes the window, whatever has the keyboard.
    pub fn closes(self) -> bool {
        self.key == Key::Q && self.modifiers.command
    }
}

impl Shown {
    /// Takes an event that is neither a size nor the wish to draw or to close. Keys wait for the panel, which may have
    /// a use for them: see [`keys`].
    pub fn input(&mut self, event: &WindowEvent) {
        // Whether the panel takes the event is known once it has run.
        let _ = self.screen.egui.on_window_event(&self.screen.window, event);
        match event {
            WindowEvent::CursorMoved { position, .. } => {
                let was_in_view = self.cursor_in_view();
                let to = Vec2::new(position.x as f32, position.y as f32);
                let by = (to - self.cursor_px) / self.view_px[3] as f32;
                self.cursor_px = to;
                self.moved(by);
                // A cursor that only wanders over the picture changes nothing.
                if self.drag != Drag::Nothing
                    || !(was_in_view && self.cursor_in_view())
                    || self.state.overlays.section
                {
                    self.wake();
                }
                return;
            }
            WindowEvent::MouseInput { state, button, .. } => match state {
                ElementState::Pressed if self.cursor_in_view() => self.pressed(*button),
                ElementState::Pressed => {}
                ElementState::Released => self.let_go(),
            },
            WindowEvent::MouseWheel { delta, .. } if self.cursor_in_view() => {
                let notches = match delta {
                    MouseScrollDelta::LineDelta(_, y) => *y,
                    MouseScrollDelta::PixelDelta(at) => at.y as f32 / 50.0,
                };
                self.scrolled(notches);
            }
            WindowEvent::CursorLeft { .. } if self.drag != Drag::Tool => self.drag = Drag::Nothing,
            // Whoever looks elsewhere has let go, though nobody told.
            WindowEvent::Focused(false) => self.let_go(),
            WindowEvent::DroppedFile(path) => {
                self.state.drop_hovers = false;
                self.open(&path.display().to_string());
            }
            WindowEvent::HoveredFile(_) => self.state.drop_hovers = true,
            WindowEvent::HoveredFileCancelled => self.state.drop_hovers = false,
            _ => {}
        }
        self.wake();
    }

    /// Whether the cursor is over the scene, with nothing of the panel between.
    pub fn cursor_in_view(&self) -> bool {
        let at = self.cursor_px - Vec2::new(self.view_px[0] as f32, self.view_px[1] as f32);
        let size = Vec2::new(self.view_px[2] as f32, self.view_px[3] as f32);
        if !(at.cmpge(Vec2::ZERO).all() && at.cmplt(size).all()) {
            return false;
        }
        let context = self.screen.egui.egui_ctx();
        let point = self.cursor_px / context.pixels_per_point();
        let layer = context.layer_id_at(egui::pos2(point.x, point.y));
        layer.is_none_or(|layer| layer.order == egui::Order::Background)
    }

    /// The ray from the camera through the cursor.
    pub fn cursor_ray(&self) -> Ray {
        let [left, top, width, height] = self.view_px.map(|px| px as f32);
        let at = (self.cursor_px - Vec2::new(left, top)) / Vec2::new(width, height);
        self.orbit.ray(at, width / height)
    }

    fn pressed(&mut self, button: MouseButton) {
        let action = match button {
            MouseButton::Left => ToolAction::Push,
            MouseButton::Right => ToolAction::Grab,
            MouseButton::Middle => {
                self.drag = Drag::Orbit;
                return;
            }
            _ => return,
        };
        let triangles = self.session.mesh.point_triangles();
        self.hand = Hand::press(action, self.cursor_ray(), self.session.points(), &triangles);
        self.drag = match (self.hand, button) {
            (Some(_), _) => Drag::Tool,
            // Beside the organ a drag moves the camera, for mice without a middle button.
            (None, MouseButton::Left) => Drag::Orbit,
            (None, _) => Drag::Pan,
        };
    }

    fn let_go(&mut self) {
        self.drag = Drag::Nothing;
        self.hand = None;
    }

    fn moved(&mut self, by: Vec2) {
        match self.drag {
            Drag::Nothing => {}
            Drag::Orbit => {
                self.orbit.turn(by);
                self.camera_moved = true;
            }
            Drag::Pan => {
                self.orbit.pan(by);
                self.camera_moved = true;
            }
            Drag::Tool => {
                let ray = self.cursor_ray();
                if let Some(hand) = &mut self.hand {
                    hand.drag(ray);
                }
            }
        }
    }

    fn scrolled(&mut self, notches: f32) {
        let longest_m = self.session.rest.longest_m();
        if self.drag == Drag::Tool {
            let knobs = &mut self.state.hand;
            knobs.depth_m =
                (knobs.depth_m + 0.01 * longest_m * notches).clamp(0.0, 0.3 * longest_m);
        } else {
            self.orbit.zoom(notches, longest_m);
            self.camera_moved = true;
        }
    }

    /// Does what a key is for, where the panel had no use for it.
    pub fn key(&mut self, pressed: Pressed) {
        let shown = &mut self.state.overlays;
        if pressed.modifiers.command || pressed.modifiers.alt {
            return;
        }
        match pressed.key {
            Key::Space => self.state.paused = !self.state.paused,
            Key::Period | Key::N => self.state.step_once = true,
            Key::R => self.reset(),
            Key::P => self.play_script(),
            Key::S | Key::F12 => self.state.screenshot = true,
            Key::C => self.reset_camera(),
            Key::Num1 => self.look(Side::Front),
            Key::Num2 => self.look(Side::Right),
            Key::Num3 => self.look(Side::Top),
            Key::Num4 => self.look(Side::Kept),
            Key::O => self.record_or_stop(),
            Key::K => self.save_scene(),
            Key::V => shown.normals = !shown.normals,
            Key::T => shown.tangents = !shown.tangents,
            Key::L => shown.primitives = !shown.primitives,
            Key::B => shown.lattice = !shown.lattice,
            Key::X => shown.section = !shown.section,
            Key::E => self.state.light_error_shown = !self.state.light_error_shown,
            Key::U => self.state.changes_open = !self.state.changes_open,
            Key::Escape => self.close_something(),
            Key::Tab => self.state.panel_open = !self.state.panel_open,
            Key::F1 | Key::H => self.state.help_open = !self.state.help_open,
            _ => {}
        }
    }

    /// Closes what lies on top: a message, a list, and where there is none the window.
    fn close_something(&mut self) {
        let state = &mut self.state;
        if state.error.take().is_some() {
        } else if state.help_open {
            state.help_open = false;
        } else if state.changes_open {
            state.changes_open = false;
        } else {
            self.wants_to_close = true;
        }
    }
}
