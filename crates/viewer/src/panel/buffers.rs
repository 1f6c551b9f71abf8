//! Buffers in a corner or instead of the picture.

use egui::{Align2, CollapsingHeader, Color32, ComboBox, FontId, Rect, Slider, Stroke, StrokeKind, Ui, vec2};

use crate::buffers::Place;
use crate::viewer::Viewer;

/// Share of the picture's width and height that a buffer in the corner takes at most.
const CORNER: f32 = 0.4;

impl Viewer {
    pub(crate) fn buffers_ui(&mut self, ui: &mut Ui) {
        let black = self.black_buffer();
        CollapsingHeader::new("Buffers").default_open(false).show(ui, |ui| {
            let shown = &mut self.panel.shown_buffer;
            ui.horizontal(|ui| {
                for (place, name) in [(Place::Off, "off"), (Place::Corner, "corner"), (Place::Full, "full")] {
                    ui.selectable_value(&mut shown.place, place, name).on_hover_text("P");
                }
                let name = shown.source.to_string();
                ComboBox::from_id_salt("buffer").selected_text(name).width(150.0).show_ui(ui, |ui| {
                    for (source, hint) in self.picture.offer().iter() {
                        let label = ui.selectable_label(shown.source == *source, source.to_string());
                        if label.on_hover_text(hint.about).clicked() {
                            shown.choose(*source);
                        }
                    }
                });
            });
            let Some(drawn) = self.picture.drawn() else { return };
            match shown.source.only().filter(|_| !drawn.exists) {
                _ if drawn.exists => ui.weak(&drawn.about),
                Some(only) => ui.weak(format!("There is one with {only}.")),
                None => ui.weak("This scene, or the pipeline in use, has none."),
            };
            if let Some(why) = black {
                ui.add(egui::Label::new(egui::RichText::new(why).color(super::style::ERROR)).wrap());
            }
            if drawn.layers > 1 {
                let layers = Slider::new(&mut shown.layer, 0..=drawn.layers - 1).text("layer");
                ui.add(layers).on_hover_text(", and .");
            }
        });
    }

    /// Draws the chosen buffer over the picture.
    pub(crate) fn show_buffer(&self, ui: &Ui, rect: Rect) {
        let shown = self.panel.shown_buffer;
        let (Some(id), Some(drawn)) = (self.buffer_id, self.picture.drawn()) else { return };
        let frame = match shown.place {
            Place::Off => return,
            Place::Corner => {
                Rect::from_min_max(rect.max - rect.size() * CORNER, rect.max).translate(vec2(-12.0, -12.0))
            }
            Place::Full => rect,
        };
        let painter = ui.painter();
        let place = if shown.place == Place::Full {
            painter.rect_filled(frame, 0.0, Color32::BLACK);
            let size = vec2(
                frame.width().min(frame.height() * drawn.aspect),
                frame.height().min(frame.width() / drawn.aspect),
            );
            Rect::from_center_size(frame.center(), size)
        } else {
            let size = vec2(
                frame.width().min(frame.height() * drawn.aspect),
                frame.height().min(frame.width() / drawn.aspect),
            );
            Rect::from_min_max(frame.max - size, frame.max)
        };
        if drawn.exists {
            let all = Rect::from_min_max(egui::Pos2::ZERO, egui::pos2(1.0, 1.0));
            painter.image(id, place, all, Color32::WHITE);
        } else {
            painter.rect_filled(place, 0.0, Color32::from_gray(16));
        }
        if shown.place == Place::Corner {
            painter.rect_stroke(place, 0.0, Stroke::new(1.0, Color32::from_gray(90)), StrokeKind::Outside);
        }
        let name = shown.source;
        let text = match (drawn.exists, drawn.layers) {
            (false, _) => format!("{name}: none here"),
            (true, 1) => name.to_string(),
            (true, layers) => format!("{name}, layer {} of {layers}", shown.layer.min(layers - 1) + 1),
        };
        let at = place.left_top() + vec2(8.0, 6.0);
        let galley = painter.layout_no_wrap(text, FontId::proportional(13.0), Color32::WHITE);
        let back = Align2::LEFT_TOP.anchor_size(at, galley.size()).expand(3.0);
        painter.rect_filled(back, 3.0, Color32::from_black_alpha(170));
        painter.galley(at, galley, Color32::WHITE);
    }
}
