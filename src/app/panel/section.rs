//! The layers below the cursor, drawn as a cut in true thickness.

use crate::app::Session;
use crate::app::section::{Cut, Section};
use crate::measure::chart::number;
use egui::epaint::Vertex;
use egui::{Align2, Color32, FontId, Mesh, Painter, Pos2, Rect, Shape, Stroke, Ui, pos2, vec2};
use glam::Vec2;

/// Size of the inset and how far it is off the corner, in points.
const SIZE: egui::Vec2 = vec2(330.0, 170.0);
const MARGIN: egui::Vec2 = vec2(12.0, -30.0);
/// Where the surface under the cursor is, as a share of the height.
const SURFACE_SHARE: f32 = 0.27;

/// Colours of layers from outside in, and of what lies below all of them.
const LAYERS: [Color32; 8] = [
    Color32::from_rgb(0xf2, 0xd7, 0xcb),
    Color32::from_rgb(0xd9, 0x8c, 0x7e),
    Color32::from_rgb(0xb0, 0x3a, 0x3a),
    Color32::from_rgb(0x8a, 0x4a, 0x3a),
    Color32::from_rgb(0xc9, 0x6f, 0x6a),
    Color32::from_rgb(0x9c, 0x2f, 0x44),
    Color32::from_rgb(0x7a, 0x3b, 0x4f),
    Color32::from_rgb(0x55, 0x28, 0x2c),
];

/// Draws the cut, or says why there is none, at the lower left corner of the picture in `rect`.
pub fn paint(ui: &Ui, rect: Rect, session: &Session, section: Option<&Section>) {
    let inset = Rect::from_min_size(
        rect.left_bottom() + MARGIN - vec2(0.0, SIZE.y),
        SIZE.min(rect.size()),
    );
    let painter = ui.painter().with_clip_rect(inset);
    painter.rect_filled(inset, 4.0, Color32::from_black_alpha(215));
    let say = |at: Pos2, align: Align2, text: String| {
        let color = Color32::from_white_alpha(230);
        painter.text(at, align, text, FontId::proportional(12.0), color);
    };
    let Some(section) = section else {
        let text = if session.scene.surface.kind.looks_below() {
            "point at the body to cut its layers open"
        } else {
            "this surface has no layers"
        };
        return say(inset.center(), Align2::CENTER_CENTER, text.to_owned());
    };
    let scale = inset.width() / (2.0 * section.half_length_m);
    let origin = pos2(
        inset.center().x,
        inset.top() + SURFACE_SHARE * inset.height(),
    );
    let place = |at: Vec2| origin + scale * vec2(at.x, -at.y);
    layers(&painter, section, &place, 2.0 * inset.height() / scale);
    let outline: Vec<Pos2> = section.places.iter().map(|cut| place(cut.at_m)).collect();
    painter.add(Shape::line(outline, Stroke::new(1.5, Color32::WHITE)));
    // The place under the cursor, and how deep the layers end there.
    let mark = Stroke::new(1.0, Color32::from_white_alpha(120));
    painter.vline(origin.x, inset.top()..=inset.bottom(), mark);
    let depths: Vec<String> = (section.depths_m.iter())
        .map(|depth_m| format!("{:.2}", 1e3 * depth_m))
        .collect();
    let text = format!("layers end at {} mm", depths.join(", "));
    say(inset.left_top() + vec2(8.0, 6.0), Align2::LEFT_TOP, text);
    let ruler_m = ruler_m(0.3 * 2.0 * section.half_length_m);
    let end = inset.right_bottom() + vec2(-10.0, -10.0);
    let start = end - vec2(scale * ruler_m, 0.0);
    painter.line_segment([start, end], Stroke::new(2.0, Color32::WHITE));
    let text = format!("{} mm", number(f64::from(1e3 * ruler_m)));
    say(
        start.lerp(end, 0.5) - vec2(0.0, 3.0),
        Align2::CENTER_BOTTOM,
        text,
    );
}

/// Fills what lies between the ends of two layers; the last goes on to `bottom_m` below the surface.
fn layers(painter: &Painter, section: &Section, place: &impl Fn(Vec2) -> Pos2, bottom_m: f32) {
    let end = |cut: &Cut, layer: usize| {
        let depth = match layer {
            0 => 0.0,
            layer => cut.depths_m.get(layer - 1).copied().unwrap_or(bottom_m),
        };
        place(cut.at_m + depth * cut.down)
    };
    // From inside out: what lies farther out is seen where bent layers cross.
    for layer in (0..=section.depths_m.len()).rev() {
        let color = LAYERS[layer.min(LAYERS.len() - 1)];
        let mut mesh = Mesh::default();
        for pair in section.places.windows(2) {
            let first = mesh.vertices.len() as u32;
            for pos in [
                end(&pair[0], layer),
                end(&pair[1], layer),
                end(&pair[1], layer + 1),
                end(&pair[0], layer + 1),
            ] {
                let uv = egui::epaint::WHITE_UV;
                mesh.vertices.push(Vertex { pos, uv, color });
            }
            mesh.add_triangle(first, first + 1, first + 2);
            mesh.add_triangle(first, first + 2, first + 3);
        }
        painter.add(Shape::mesh(mesh));
    }
}

/// The largest of 1, 2 and 5 times a power of ten that is not longer than `most_m`.
fn ruler_m(most_m: f32) -> f32 {
    let power = 10_f32.powf(most_m.max(1e-9).log10().floor());
    let steps = [5.0, 2.0, 1.0].map(|step| step * power);
    steps
        .into_iter()
        .find(|&step| step <= most_m)
        .unwrap_or(power)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_ruler_is_a_round_length_that_fits() {
        for (most, ruler) in [
            (0.009, 0.005),
            (0.0049, 0.002),
            (0.0199, 0.01),
            (0.02, 0.02),
        ] {
            let got = ruler_m(most);
            assert!((got / ruler - 1.0).abs() < 1e-4, "{most}: {got}");
        }
    }
}
