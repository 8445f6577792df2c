//! Sliders and number fields that leave a value outside their range alone until somebody moves it: a panel that only
//! looks at a scene must not change it.

use egui::SliderClamping;
use egui::emath::Numeric;
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
