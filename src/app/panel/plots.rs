//! Read-outs and plots of the last frames.

use super::{PanelState, Shown};
use crate::app::Session;
use crate::app::history::History;
use crate::app::push::PushCurve;
use egui::{Color32, RichText, Ui};
use egui_plot::{Bar, BarChart, Line, Plot, PlotPoints, Points};

/// What the body answers with, and what that took.
pub fn section(ui: &mut Ui, state: &PanelState, session: &Session, shown: &Shown<'_>) {
    let history = shown.history;
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
        ui.label("inside tool");
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
    push_plot(ui, shown.push);
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
    ui.label(RichText::new("frame time by stage [ms], the whole frame in white; peaks beyond three medians are cut").weak());
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

/// Force against depth: the way in and the way out enclose what the tissue kept.
fn push_plot(ui: &mut Ui, push: &PushCurve) {
    ui.label(RichText::new("force [N] against depth of the push [mm]").weak());
    let points = push.points();
    let last = points.last().copied();
    still_plot("push")
        .include_x(0.0)
        .show_axes(true)
        .height(110.0)
        .show(ui, |plot| {
            plot.line(Line::new("push", PlotPoints::from(points.to_vec())).color(STAGE_COLORS[1]));
            if let Some(last) = last {
                plot.points(
                    Points::new("now", vec![last])
                        .radius(3.0)
                        .color(Color32::WHITE),
                );
            }
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
