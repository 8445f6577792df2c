//! Sliders and number fields that leave a value outside their range alone until somebody moves it: a panel that only
//! looks at a scene must not change it.

use egui::emath::Numeric;
use egui::{SliderClamping, Ui};
use std::ops::RangeInclusive;

/// As [`egui::Slider`], but for that.
pub struct Slider;

impl Slider {
    /// A slider over `range`.
    #[expect(
        clippy::new_ret_no_self,
        reason = "it stands for egui's own, under its name"
    )]
    pub fn new<N: Numeric>(value: &mut N, range: RangeInclusive<N>) -> egui::Slider<'_> {
        egui::Slider::new(value, range).clamping(SliderClamping::Edits)
    }
}

/// As [`egui::DragValue`], but for that.
pub struct DragValue;

impl DragValue {
    /// A field for any number.
    #[expect(
        clippy::new_ret_no_self,
        reason = "it stands for egui's own, under its name"
    )]
    pub fn new<N: Numeric>(value: &mut N) -> egui::DragValue<'_> {
        egui::DragValue::new(value).clamp_existing_to_range(false)
    }
}

/// Three numbers in a row under one name: a colour, a place or a direction.
pub fn three(
    ui: &mut Ui,
    values: &mut [f32; 3],
    range: RangeInclusive<f32>,
    speed: f64,
    label: &str,
) {
    ui.horizontal(|ui| {
        let fields = values.each_mut().map(|value| {
            let field = DragValue::new(value);
            ui.add(field.range(range.clone()).speed(speed))
        });
        let label = ui.label(label);
        for field in fields {
            field.labelled_by(label.id);
        }
    });
}
