//! The line below the picture: what runs, how fast, and how far the picture has come.

use egui::{RichText, Ui};

use crate::picture::REST_FRAMES;
use crate::viewer::Viewer;

impl Viewer {
    pub(crate) fn status_ui(&mut self, ui: &mut Ui) {
        ui.horizontal(|ui| {
            if let Some(source) = &self.loading {
                ui.spinner();
                ui.label(format!("loading {source}"));
                ui.separator();
            } else if self.building {
                ui.spinner();
                ui.label("compiling");
                ui.separator();
            }
            if let Some(texture) = self.picture() {
                let options = texture.options();
                ui.label(format!("{} × {}", options.width, options.height));
                ui.separator();
                let frames = self.picture.frames();
                let text = if frames >= REST_FRAMES {
                    format!("{frames} samples")
                } else {
                    format!("{frames} of {REST_FRAMES} samples")
                };
                ui.label(text).on_hover_text(
                    "Frames averaged since the camera, the scene and the settings came to rest",
                );
                ui.separator();
            }
            let ms = self.timings.frame.mean_ms();
            if ms > 0.0 {
                ui.label(format!("{ms:.1} ms a frame"));
                ui.separator();
            }
            ui.label(RichText::new(&self.gpu.info.name).weak());
            ui.with_layout(egui::Layout::right_to_left(egui::Align::Center), |ui| {
                ui.toggle_value(&mut self.panel.help, "Keys").on_hover_text("H");
                ui.toggle_value(&mut self.panel.shown, "Panel").on_hover_text("F2");
            });
        });
    }
}
