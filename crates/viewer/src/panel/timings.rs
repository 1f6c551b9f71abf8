//! What each pass costs, as a table and over time.

use egui::{CollapsingHeader, Grid, RichText, Ui};
use egui_plot::{Legend, Line, Plot, PlotPoints};

use crate::timings::{HISTORY, Row, TimingHistory};
use crate::viewer::Viewer;

impl Viewer {
    pub(crate) fn timings_ui(&mut self, ui: &mut Ui) {
        CollapsingHeader::new("Timings").default_open(false).show(ui, |ui| {
            ui.checkbox(&mut self.panel.continuous, "Render on while nothing changes")
                .on_hover_text("A resting picture is not rendered again, and then there is nothing to time");
            if !self.gpu.optional.timestamps {
                ui.label(
                    RichText::new("This device has no timestamps: only the time between frames is known.")
                        .weak(),
                );
            }
            plot(ui, &self.timings);
            Grid::new("passes").num_columns(3).min_col_width(20.0).striped(true).spacing([10.0, 2.0]).show(
                ui,
                |ui| {
                    let sum_ms = self.timings.sum_ms();
                    row(ui, &mut self.timings.frame, "Wall time from one frame to the next");
                    if self.gpu.optional.timestamps {
                        row(
                            ui,
                            &mut self.timings.span,
                            "GPU time from the first pass' begin to the last one's end",
                        );
                        for pass in &mut self.timings.passes {
                            row(ui, pass, "");
                        }
                        ui.label("");
                        ui.label(RichText::new("sum of passes").strong())
                            .on_hover_text("Passes may overlap, so the GPU's time can be less than this");
                        number(ui, sum_ms, true);
                        ui.end_row();
                    }
                },
            );
        });
    }
}

fn row(ui: &mut Ui, row: &mut Row, about: &str) {
    ui.checkbox(&mut row.plotted, "").on_hover_text("Plot");
    let label = ui.label(&row.name);
    if !about.is_empty() {
        label.on_hover_text(about);
    }
    number(ui, row.mean_ms(), false);
    ui.end_row();
}

fn number(ui: &mut Ui, ms: f64, strong: bool) {
    let text = RichText::new(format!("{ms:8.3} ms")).monospace();
    ui.label(if strong { text.strong() } else { text });
}

fn plot(ui: &mut Ui, timings: &TimingHistory) {
    let plot = Plot::new("history")
        .height(140.0)
        .include_y(0.0)
        .include_x(0.0)
        .include_x(HISTORY as f64)
        .show_axes([false, true])
        .y_axis_label("ms")
        .allow_drag(false)
        .allow_zoom(false)
        .allow_scroll(false)
        .legend(Legend::default());
    plot.show(ui, |plot| {
        let rows = [&timings.frame, &timings.span].into_iter().chain(&timings.passes);
        for row in rows.filter(|row| row.plotted) {
            let first = HISTORY - row.history_ms().count();
            let points: PlotPoints<'_> =
                row.history_ms().enumerate().map(|(i, ms)| [(first + i) as f64, ms]).collect();
            plot.line(Line::new(row.name.clone(), points));
        }
    });
}
