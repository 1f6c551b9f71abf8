//! The truth beside the picture, and the divider between them.

use egui::{Align2, Color32, CursorIcon, FontId, Rect, Sense, Stroke, Ui, pos2, vec2};

use super::style::ERROR;
use crate::buffers::Place;
use crate::truth::{Compare, Progress};
use crate::viewer::Viewer;

/// How near to the divider the mouse takes hold of it, points.
const REACH: f32 = 6.0;
/// How near to the picture's edge it comes, points: beyond it could not be taken hold of again.
const MARGIN: f32 = 3.0;

impl Viewer {
    pub(crate) fn truth_ui(&mut self, ui: &mut Ui) {
        ui.horizontal(|ui| {
            ui.label("Compare with truth").on_hover_text(
                "The same scene path traced: every path of light, sample after sample while the camera rests",
            );
            for (compare, name) in Compare::ALL {
                ui.selectable_value(&mut self.panel.compare, compare, name).on_hover_text("T");
            }
        });
        if self.panel.compare == Compare::Off {
            return;
        }
        if let Progress::Failed(problem) = self.truth.progress() {
            ui.add(egui::Label::new(egui::RichText::new(problem).color(ERROR)).wrap());
        } else {
            ui.weak(self.truth_text());
        }
    }

    /// How far the truth is, in words.
    pub(crate) fn truth_text(&self) -> String {
        match self.truth.progress() {
            Progress::Building => "path traced \u{b7} building\u{2026}".into(),
            Progress::Failed(_) => "path traced \u{b7} failed, see the panel".into(),
            Progress::First(share) => {
                format!("path traced \u{b7} first sample {:.0} %", 100.0 * share)
            }
            Progress::Samples(1, _) => "path traced \u{b7} 1 sample".into(),
            Progress::Samples(samples, None) => format!("path traced \u{b7} {samples} samples"),
            Progress::Samples(samples, Some(noise)) => {
                format!("path traced \u{b7} {samples} samples \u{b7} noise {:.2} %", 100.0 * noise)
            }
        }
    }

    /// Labels over the picture, and the divider, which the mouse drags.
    pub(crate) fn truth_area(&mut self, ui: &mut Ui, rect: Rect) {
        let compare = self.panel.compare;
        if compare == Compare::Off || self.panel.shown_buffer.place == Place::Full {
            return;
        }
        let text = self.truth_text();
        if compare == Compare::Truth {
            label(ui, rect, rect.right_top() + vec2(-8.0, 8.0), Align2::RIGHT_TOP, text);
            return;
        }
        // On a pixel of the picture, so that line and seam fall together.
        let width_px = self.picture.size_px().map_or(1, |[width, _]| width);
        let place = |divider: f32| {
            let column = compare.first_column(divider, width_px).unwrap_or(0);
            rect.left() + rect.width() * column as f32 / width_px as f32
        };
        let reach = Rect::from_x_y_ranges(
            place(self.panel.divider) - REACH..=place(self.panel.divider) + REACH,
            rect.y_range(),
        );
        let handle = ui.interact(reach.intersect(rect), ui.scope_id().with("divider"), Sense::drag());
        let handle = handle.on_hover_and_drag_cursor(CursorIcon::ResizeHorizontal);
        if let Some(pointer) = handle.interact_pointer_pos().filter(|_| handle.dragged()) {
            let margin = (MARGIN / rect.width().max(1.0)).min(0.5);
            let at = (pointer.x - rect.left()) / rect.width().max(1.0);
            self.panel.divider = at.clamp(margin, 1.0 - margin);
        }
        let x = place(self.panel.divider);
        let is_held = handle.hovered() || handle.dragged();
        let (wide, bright) = if is_held { (5.0, Color32::WHITE) } else { (3.0, Color32::from_gray(220)) };
        let painter = ui.painter().with_clip_rect(rect);
        painter.vline(x, rect.y_range(), Stroke::new(wide, Color32::from_black_alpha(120)));
        painter.vline(x, rect.y_range(), Stroke::new(if is_held { 2.0 } else { 1.0 }, bright));
        let left = Rect::from_min_max(rect.min, pos2(x - 4.0, rect.max.y));
        let right = Rect::from_min_max(pos2(x + 4.0, rect.min.y), rect.max);
        label(ui, left, left.right_top() + vec2(-6.0, 8.0), Align2::RIGHT_TOP, "real time".into());
        label(ui, right, right.left_top() + vec2(6.0, 8.0), Align2::LEFT_TOP, text);
    }
}

/// Text on a dark ground, cut off where its part of the picture ends.
fn label(ui: &Ui, part: Rect, at: egui::Pos2, anchor: Align2, text: String) {
    let painter = ui.painter().with_clip_rect(part);
    let galley = painter.layout_no_wrap(text, FontId::proportional(13.0), Color32::WHITE);
    let place = anchor.anchor_size(at, galley.size());
    painter.rect_filled(place.expand(3.0), 3.0, Color32::from_black_alpha(170));
    painter.galley(place.min, galley, Color32::WHITE);
}
