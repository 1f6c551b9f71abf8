//! Scene, camera, time and picture.

use egui::{CollapsingHeader, ComboBox, Slider, Ui};

use crate::viewer::{Eye, Viewer};

impl Viewer {
    pub(crate) fn scene_ui(&mut self, ui: &mut Ui) {
        CollapsingHeader::new("Scene").default_open(true).show(ui, |ui| {
            let mut open = None;
            let name = self.stage.as_ref().map_or("none", |stage| stage.name.as_str());
            ComboBox::from_id_salt("scene").selected_text(name).width(220.0).show_ui(ui, |ui| {
                for (name, about) in chiaro::scene::builtin::SCENES {
                    let source = format!("builtin:{name}");
                    let shown =
                        self.stage.as_ref().is_some_and(|stage| stage.source == source.as_str().into());
                    if ui.selectable_label(shown, *name).on_hover_text(*about).clicked() {
                        open = Some(source);
                    }
                }
            });
            if let Some(source) = open {
                self.open(&source);
            }
            ui.weak("or drop a .glb, .gltf or .obj file onto the window");
            self.camera_ui(ui);
            self.playback_ui(ui);
            if let Some(stage) = &self.stage {
                let megabytes = stage.loaded.gpu.bytes as f64 / 1e6;
                ui.weak(format!(
                    "{} triangles, {} lights, {megabytes:.1} MB, {:.1} m across",
                    stage.loaded.gpu.triangle_count,
                    stage.loaded.lights().len(),
                    stage.size_m()
                ));
            }
        });
    }

    fn camera_ui(&mut self, ui: &mut Ui) {
        let Some(stage) = &self.stage else { return };
        let selected = match self.eye {
            Eye::Free(_) => "free",
            Eye::Placed(number) => stage.cameras.get(number).map_or("free", String::as_str),
        };
        ui.horizontal(|ui| {
            ui.label("Camera");
            let mut chosen = None;
            ComboBox::from_id_salt("camera").selected_text(selected).show_ui(ui, |ui| {
                for (number, name) in stage.cameras.iter().enumerate() {
                    if ui.selectable_label(self.eye == Eye::Placed(number), name).clicked() {
                        chosen = Some(number);
                    }
                }
            });
            if let Some(number) = chosen {
                self.eye = Eye::Placed(number);
            }
        });
        ui.add(
            Slider::new(&mut self.speed, stage.speeds())
                .logarithmic(true)
                .suffix(" m/s")
                .text("flying speed"),
        );
    }

    fn playback_ui(&mut self, ui: &mut Ui) {
        let Some(duration_s) = self.stage.as_ref().and_then(|stage| stage.duration_s) else { return };
        ui.horizontal(|ui| {
            let label = if self.playback.playing { "Pause" } else { "Play" };
            if ui.button(label).on_hover_text("K").clicked() {
                self.playback.playing = !self.playback.playing;
            }
            let slider =
                Slider::new(&mut self.playback.time_s, 0.0..=duration_s).suffix(" s").fixed_decimals(2);
            if ui.add(slider).changed() {
                self.playback.playing = false;
                self.panel.scrubbed = true;
            }
        });
        ui.add(Slider::new(&mut self.playback.speed, 0.05..=4.0).logarithmic(true).text("× real time"));
    }

    pub(crate) fn picture_ui(&mut self, ui: &mut Ui) {
        CollapsingHeader::new("Picture").default_open(true).show(ui, |ui| {
            ui.add(Slider::new(&mut self.panel.scale, 0.25..=1.0).text("pixels per window pixel"))
                .on_hover_text("Less is faster and blurred");
            ui.horizontal(|ui| {
                if ui
                    .button("Screenshot")
                    .on_hover_text("F12; into the folder that chiaro was started in")
                    .clicked()
                {
                    self.screenshot(self.panel.exr);
                }
                ui.checkbox(&mut self.panel.exr, "radiance too (EXR)");
            });
            ui.checkbox(&mut self.panel.vsync, "Wait for the screen (vsync)");
            self.truth_ui(ui);
        });
    }
}
