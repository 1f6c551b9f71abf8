//! What surrounds the picture: the panel on the right, the line below, messages, help; and what keys do.

mod buffers;
mod help;
pub(crate) mod notices;
mod scene;
mod settings;
pub(crate) mod state;
mod status;
pub(crate) mod style;
mod timings;
mod truth;

use chiaro::techniques::post::Show;
use egui::{Align2, Color32, Key, Sense, Ui, vec2};
use glam::{Vec2, Vec3};

use crate::camera::{FlyCamera, Steering};
use crate::viewer::{Eye, Viewer};
use style::ERROR;

impl Viewer {
    /// Lays everything out.
    pub(crate) fn ui(&mut self, ui: &mut Ui) {
        egui::Panel::bottom("status").show(ui, |ui| self.status_ui(ui));
        if self.panel.shown {
            // Whatever the panel holds, the picture keeps its part of a small window.
            let most = 0.6 * ui.available_width();
            let panel = egui::Panel::right("panel").default_size(370.0).min_size(300.0).max_size(most);
            panel.show(ui, |ui| {
                egui::ScrollArea::vertical().auto_shrink(false).show(ui, |ui| {
                    self.scene_ui(ui);
                    self.picture_ui(ui);
                    self.buffers_ui(ui);
                    self.settings_ui(ui);
                    self.timings_ui(ui);
                });
            });
        }
        egui::CentralPanel::no_frame().show(ui, |ui| self.picture_area(ui));
        if self.panel.help {
            self.panel.help = help::show(ui);
        }
    }

    fn picture_area(&mut self, ui: &mut Ui) {
        let rect = ui.available_rect_before_wrap();
        let pixels = rect.size() * ui.pixels_per_point() * self.panel.scale;
        let side = |points: f32| (points.round() as u32).clamp(1, self.gpu.limits.max_texture_dimension_2d);
        let is_visible = pixels.x >= 1.0 && pixels.y >= 1.0 && pixels.is_finite();
        self.panel.picture_px = is_visible.then(|| [side(pixels.x), side(pixels.y)]);
        let response = ui.allocate_rect(rect, Sense::click_and_drag());
        if let (Some(id), Some(_)) = (self.picture_id, &self.stage) {
            let all = egui::Rect::from_min_max(egui::Pos2::ZERO, egui::pos2(1.0, 1.0));
            ui.painter().image(id, rect, all, Color32::WHITE);
            self.truth_area(ui, rect);
            self.show_buffer(ui, rect);
        }
        if response.clicked() || response.drag_started() {
            // Keys are the camera's again.
            ui.memory_mut(egui::Memory::stop_text_input);
        }
        if response.double_clicked() && self.stage.is_some() {
            self.panel.grabs_mouse = !self.panel.grabs_mouse;
        }
        let turns = self.panel.grabs_mouse
            || response.dragged_by(egui::PointerButton::Primary)
            || response.dragged_by(egui::PointerButton::Secondary);
        let motion = ui.input(|i| i.pointer.motion().unwrap_or_else(|| i.pointer.delta()));
        self.panel.dragged = if turns { motion } else { egui::Vec2::ZERO };
        let hovered = response.contains_pointer() || self.panel.grabs_mouse;
        self.panel.scrolled = if hovered { ui.input(|i| i.smooth_scroll_delta().y) } else { 0.0 };
        self.panel.flies = !ui.ctx().egui_wants_keyboard_input();
        if self.stage.is_none() {
            let text =
                if self.loading.is_some() { "Loading…" } else { "Drop a .glb, .gltf or .obj file here" };
            let font = egui::FontId::proportional(20.0);
            ui.painter().text(rect.center(), Align2::CENTER_CENTER, text, font, Color32::GRAY);
        }
        if let Some(error) = &self.panel.shader_error {
            show_shader_error(ui, rect, error);
        }
        self.notices.show(ui, rect.min + vec2(12.0, 12.0), (rect.width() - 24.0).min(640.0));
    }

    /// Does what keys and the mouse ask for, after the panel had its say.
    pub(crate) fn act(&mut self, ctx: &egui::Context) {
        let (dt_s, lost_focus) = ctx.input(|i| (i.unstable_dt.clamp(0.0, 0.1), !i.focused));
        if self.panel.flies {
            ctx.input(|i| self.pressed(i));
        }
        if lost_focus {
            self.panel.grabs_mouse = false;
        }
        if let Some(stage) = self.stage.as_ref().filter(|_| self.panel.scrolled != 0.0) {
            let speeds = stage.speeds();
            let wanted = self.speed * (self.panel.scrolled * 0.004).exp();
            self.speed = wanted.clamp(*speeds.start(), *speeds.end());
        }
        let steering = Steering {
            push: if self.panel.flies { ctx.input(push) } else { Vec3::ZERO },
            turn: Vec2::new(self.panel.dragged.x, self.panel.dragged.y),
        };
        self.fly(steering, dt_s);
        self.play(f64::from(dt_s));
    }

    fn choose_buffer(&mut self, input: &egui::InputState) {
        let (shown, offer) = (&mut self.panel.shown_buffer, self.picture.offer());
        if input.key_pressed(Key::P) {
            shown.place = shown.place.next();
        }
        for (number, key) in DIGITS.into_iter().enumerate() {
            if let Some(source) = offer.by_key(number).filter(|_| input.key_pressed(key)) {
                shown.choose(source);
            }
        }
        let layers = self.picture.drawn().map_or(1, |drawn| drawn.layers);
        if input.key_pressed(Key::Period) {
            shown.layer = (shown.layer + 1).min(layers - 1);
        }
        if input.key_pressed(Key::Comma) {
            shown.layer = shown.layer.saturating_sub(1).min(layers - 1);
        }
        if input.key_pressed(Key::OpenBracket) {
            shown.choose(offer.before(shown.source));
        }
        if input.key_pressed(Key::CloseBracket) {
            shown.choose(offer.after(shown.source, 1));
        }
    }

    fn fly(&mut self, steering: Steering, dt_s: f32) {
        if steering != Steering::default()
            && let (Eye::Placed(_), Some(view)) = (self.eye, self.view())
        {
            self.eye = Eye::Free(FlyCamera::new(view));
        }
        if let Eye::Free(camera) = &mut self.eye
            && (steering != Steering::default() || camera.is_moving())
        {
            camera.steer(steering, self.speed, dt_s);
            self.ctx.request_repaint();
        }
    }

    fn play(&mut self, dt_s: f64) {
        let Some(stage) = &mut self.stage else { return };
        let Some(duration_s) = stage.duration_s else { return };
        let before = self.playback.time_s;
        self.playback.advance(dt_s, duration_s);
        if self.playback.time_s != before || self.panel.scrubbed {
            self.panel.scrubbed = false;
            if let Err(error) = stage.set_time(self.playback.time_s) {
                self.notices.fail(error.to_string());
            }
        }
        if self.playback.playing {
            self.ctx.request_repaint();
        }
    }

    fn pressed(&mut self, input: &egui::InputState) {
        if input.modifiers.command || input.modifiers.alt {
            return;
        }
        if input.key_pressed(Key::F1) || input.key_pressed(Key::H) {
            self.panel.help = !self.panel.help;
        }
        if input.key_pressed(Key::F2) {
            self.panel.shown = !self.panel.shown;
        }
        if input.key_pressed(Key::F11) {
            self.panel.fullscreen = !self.panel.fullscreen;
        }
        if input.key_pressed(Key::Escape) {
            self.panel.grabs_mouse = false;
            self.panel.help = false;
        }
        if input.key_pressed(Key::K) {
            self.playback.playing = !self.playback.playing;
        }
        if input.key_pressed(Key::T) {
            self.panel.compare = self.panel.compare.next();
        }
        if input.key_pressed(Key::F12) {
            self.screenshot(self.panel.exr);
        }
        for (key, show) in [(Key::U, Show::Indirect), (Key::I, Show::Direct), (Key::O, Show::Both)] {
            if input.key_pressed(key) {
                self.wanted.camera.show = show;
            }
        }
        self.choose_buffer(input);
    }
}

const DIGITS: [Key; 10] = [
    Key::Num1,
    Key::Num2,
    Key::Num3,
    Key::Num4,
    Key::Num5,
    Key::Num6,
    Key::Num7,
    Key::Num8,
    Key::Num9,
    Key::Num0,
];

/// A shader's error, over the picture that the last good shader makes.
fn show_shader_error(ui: &Ui, rect: egui::Rect, error: &str) {
    let area = egui::Area::new(egui::Id::unique("shader_error"));
    let area = area.pivot(Align2::LEFT_BOTTOM).fixed_pos(rect.left_bottom() + vec2(12.0, -12.0));
    area.show(ui.ctx(), |ui| {
        egui::Frame::popup(ui.style()).show(ui, |ui| {
            ui.set_max_width((rect.width() - 48.0).clamp(100.0, 900.0));
            ui.strong("A shader does not compile; the last good one stays");
            egui::ScrollArea::vertical().max_height(rect.height() * 0.5).show(ui, |ui| {
                let text = egui::RichText::new(error).monospace().color(ERROR);
                ui.add(egui::Label::new(text).wrap());
            });
        });
    });
}

/// Where keys push the camera: right, up, back.
fn push(input: &egui::InputState) -> Vec3 {
    if input.modifiers.command || input.modifiers.alt {
        return Vec3::ZERO;
    }
    let axis = |more: bool, less: bool| f32::from(i8::from(more) - i8::from(less));
    let down = |key| input.key_down(key);
    Vec3::new(
        axis(down(Key::D), down(Key::A)),
        axis(down(Key::E) || down(Key::Space), down(Key::Q) || input.modifiers.shift),
        axis(down(Key::S), down(Key::W)),
    )
}
