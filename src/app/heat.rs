//! The error of the light path drawn over the picture, with its scale.

use super::Session;
use super::light_error::ErrorMap;
use crate::passes::frame::effective_method;
use crate::study::planes::heat;
use egui::{Align2, Color32, ColorImage, FontId, Rect, TextureId, Ui, pos2, vec2};

/// The error at which the scale ends, as a share of the truth.
const ERROR_MAX: f64 = 0.5;
/// Opacity of the map over the picture.
const OPACITY: u8 = 225;
/// Width and height of the scale, and how far it is off the corner, in points.
const SCALE: egui::Vec2 = vec2(190.0, 10.0);
const MARGIN: f32 = 14.0;

/// The map as a picture: clear beside the body.
pub fn picture(map: &ErrorMap) -> ColorImage {
    let pixels = map.shares.iter().map(|share| {
        share.map_or(Color32::TRANSPARENT, |share| {
            let [r, g, b, _] = heat(share / ERROR_MAX).0;
            Color32::from_rgba_unmultiplied(r, g, b, OPACITY)
        })
    });
    ColorImage::new(map.size, pixels.collect())
}

/// Lays the map over the picture in `rect` and says what it means; says why where there is none.
pub fn paint(ui: &Ui, rect: Rect, session: &Session, error: Option<(TextureId, &ErrorMap)>) {
    let Some(method) = effective_method(&session.scene) else {
        say(ui, rect, "this surface follows no light below it");
        return;
    };
    let Some((texture, map)) = error else {
        say(ui, rect, "casting rays …");
        return;
    };
    egui::Image::new((texture, rect.size())).paint_at(ui, rect);
    let error = map.error_rel.map_or_else(
        || "no light falls here".to_owned(),
        |error| format!("{:.1} % off in all", 100.0 * error),
    );
    say(
        ui,
        rect,
        &format!(
            "radiance by {} against cast rays at {:.2} s: {error}",
            method.name(),
            map.time_s
        ),
    );
    let painter = ui.painter();
    let corner = rect.left_top() + vec2(MARGIN, MARGIN + 22.0);
    let steps = 48;
    for step in 0..steps {
        let share = f64::from(step) / f64::from(steps - 1);
        let [r, g, b, _] = heat(share).0;
        let left = corner.x + SCALE.x * step as f32 / steps as f32;
        let cell = Rect::from_min_size(
            pos2(left, corner.y),
            vec2(SCALE.x / steps as f32 + 0.5, SCALE.y),
        );
        painter.rect_filled(cell, 0.0, Color32::from_rgb(r, g, b));
    }
    for (share, align) in [
        (0.0, Align2::LEFT_TOP),
        (0.5, Align2::CENTER_TOP),
        (1.0, Align2::RIGHT_TOP),
    ] {
        painter.text(
            corner + vec2(share * SCALE.x, SCALE.y + 2.0),
            align,
            format!("{:.0} %", 100.0 * ERROR_MAX * f64::from(share)),
            FontId::proportional(11.0),
            Color32::from_white_alpha(220),
        );
    }
}

fn say(ui: &Ui, rect: Rect, text: &str) {
    ui.painter().text(
        rect.left_top() + vec2(MARGIN, MARGIN),
        Align2::LEFT_TOP,
        text,
        FontId::proportional(13.0),
        Color32::from_white_alpha(230),
    );
}

#[cfg(test)]
mod tests {
    use super::super::orbit::Orbit;
    use super::*;
    use glam::Vec3;

    #[test]
    fn a_map_is_clear_beside_the_body_and_brighter_where_it_is_farther_off() {
        let map = ErrorMap {
            size: [3, 1],
            shares: vec![None, Some(0.0), Some(0.5)],
            error_rel: Some(0.2),
            orbit: Orbit::new(Vec3::Z, Vec3::ZERO, Vec3::Y, 0.5),
            time_s: 0.0,
        };
        let shown = picture(&map).pixels;
        assert_eq!(shown[0], Color32::TRANSPARENT);
        let brightness = |color: Color32| u32::from(color.r()) + u32::from(color.g());
        assert!(brightness(shown[2]) > 10 * brightness(shown[1]));
    }
}
