//! Messages.

use egui::{Align2, Ui};

use super::style::ERROR;

/// Messages over the picture until they are clicked away.
#[derive(Debug, Default)]
pub struct Notices(Vec<Notice>);

#[derive(Debug)]
struct Notice {
    text: String,
    is_error: bool,
}

/// More than this would hide the picture.
const MAX_NOTICES: usize = 4;

impl Notices {
    /// Something worth knowing.
    pub fn tell(&mut self, text: impl Into<String>) {
        self.push(text.into(), false);
    }

    /// Something that failed.
    pub fn fail(&mut self, text: impl Into<String>) {
        self.push(text.into(), true);
    }

    /// All of them, oldest first.
    pub fn texts(&self) -> impl Iterator<Item = &str> {
        self.0.iter().map(|notice| notice.text.as_str())
    }

    fn push(&mut self, text: String, is_error: bool) {
        if self.0.iter().any(|notice| notice.text == text) {
            return;
        }
        if self.0.len() == MAX_NOTICES {
            self.0.remove(0);
        }
        self.0.push(Notice { text, is_error });
    }

    pub(super) fn show(&mut self, ui: &Ui, corner: egui::Pos2, width: f32) {
        if self.0.is_empty() {
            return;
        }
        let area = egui::Area::new(egui::Id::unique("notices")).pivot(Align2::LEFT_TOP).fixed_pos(corner);
        area.show(ui.ctx(), |ui| {
            ui.set_max_width(width);
            self.0.retain(|notice| {
                let mut keep = true;
                egui::Frame::popup(ui.style()).show(ui, |ui| {
                    ui.horizontal(|ui| {
                        keep = !ui.small_button("×").on_hover_text("Dismiss").clicked();
                        let color = if notice.is_error { ERROR } else { ui.visuals().text_color() };
                        let text = egui::RichText::new(&notice.text).color(color);
                        let text = if notice.text.contains('\n') { text.monospace() } else { text };
                        ui.add(egui::Label::new(text).wrap());
                    });
                });
                keep
            });
        });
    }
}
