//! Every setting as a widget, made from its declaration.

use chiaro::{Condition, Effect, Field, Kind, Settings};
use egui::{CollapsingHeader, ComboBox, Grid, RichText, Slider, TextEdit, Ui};

use super::style::ERROR;
use crate::viewer::Viewer;

/// From this ratio of its ends on a slider is logarithmic.
const WIDE_RANGE: f64 = 200.0;
/// Of what does nothing beside the other settings.
const IDLE_OPACITY: f32 = 0.4;
/// Points that names take.
const NAME_WIDTH: f32 = 130.0;

impl Viewer {
    pub(crate) fn settings_ui(&mut self, ui: &mut Ui) {
        CollapsingHeader::new("Settings").default_open(true).show(ui, |ui| {
            if let Some(error) = &self.panel.settings_error {
                let dismissed = ui
                    .horizontal(|ui| {
                        let dismissed = ui.small_button("×").on_hover_text("Dismiss").clicked();
                        ui.add(egui::Label::new(RichText::new(error).color(ERROR)).wrap());
                        dismissed
                    })
                    .inner;
                if dismissed {
                    self.panel.settings_error = None;
                }
            }
            for note in &self.panel.notes {
                ui.add(egui::Label::new(RichText::new(note).weak()).wrap());
            }
            let mut wanted = self.wanted.clone();
            ui.horizontal(|ui| {
                preset_ui(ui, &mut wanted, &mut self.panel.settings_error);
                ui.add(
                    TextEdit::singleline(&mut self.panel.search)
                        .hint_text("search")
                        .desired_width(f32::INFINITY),
                );
            });
            fields_ui(ui, &mut wanted, &self.panel.search.to_lowercase());
            if wanted != self.wanted {
                self.panel.settings_error = None;
                self.wanted = wanted;
            }
        });
    }
}

fn preset_ui(ui: &mut Ui, wanted: &mut Settings, error: &mut Option<String>) {
    ComboBox::from_id_salt("preset").selected_text("Preset…").show_ui(ui, |ui| {
        for (name, about) in Settings::presets() {
            if ui.selectable_label(false, name).on_hover_text(about).clicked() {
                let mut preset =
                    Settings { pipeline: wanted.pipeline, seed: wanted.seed, ..Settings::default() };
                match preset.apply_preset(name, None) {
                    Ok(()) => *wanted = preset,
                    Err(problem) => *error = Some(problem.to_string()),
                }
            }
        }
    });
}

fn fields_ui(ui: &mut Ui, wanted: &mut Settings, search: &str) {
    let fields = Settings::fields();
    let found = |field: &&Field| {
        search
            .split_whitespace()
            .all(|word| field.key.contains(word) || field.meaning.to_lowercase().contains(word))
    };
    for group in fields.chunk_by(|a, b| group_of(a) == group_of(b)) {
        let rows: Vec<_> = group.iter().filter(found).collect();
        if rows.is_empty() {
            continue;
        }
        let changed = group.iter().any(|field| wanted.get(&field.key).as_ref() != Some(&field.default));
        let title = RichText::new(group_of(&group[0]));
        let title = if changed { title.strong() } else { title };
        // A search opens what it finds.
        let open = (!search.is_empty()).then_some(true);
        CollapsingHeader::new(title).id_salt(group_of(&group[0])).default_open(true).open(open).show(
            ui,
            |ui| {
                let grid = Grid::new(group_of(&group[0])).num_columns(3).spacing([8.0, 4.0]);
                grid.show(ui, |ui| rows.into_iter().for_each(|field| field_ui(ui, wanted, field)));
            },
        );
    }
}

fn group_of(field: &Field) -> &str {
    field.key.split_once('.').map_or("general", |(group, _)| group)
}

/// `bias.normal_offset` of `shadow.bias.normal_offset`, in words.
fn name_of(field: &Field) -> String {
    let name = field.key.split_once('.').map_or(field.key.as_str(), |(_, name)| name);
    name.replace('_', " ").replace('.', ": ")
}

fn field_ui(ui: &mut Ui, wanted: &mut Settings, field: &Field) {
    let Some(value) = wanted.get(&field.key) else { return };
    let idle = wanted.idle(&field.key);
    // The same width in all groups, so that widgets stand in one column.
    let size = egui::vec2(NAME_WIDTH, ui.spacing().interact_size.y);
    let left = egui::Layout::left_to_right(egui::Align::Center);
    ui.allocate_ui_with_layout(size, left, |ui| {
        ui.set_min_width(NAME_WIDTH);
        let name = RichText::new(name_of(field));
        let name = if idle.is_some() { name.weak() } else { name };
        ui.label(name).on_hover_ui(|ui| about(ui, field, idle));
    });
    // It can still be set, for when it matters, but looks as if not.
    let new = ui
        .scope(|ui| {
            if idle.is_some() {
                ui.multiply_opacity(IDLE_OPACITY);
            }
            widget(ui, field, &value)
        })
        .inner;
    let reset = if value == field.default {
        ui.label("");
        false
    } else {
        ui.small_button("⟲").on_hover_text(format!("Back to {}", field.default)).clicked()
    };
    ui.end_row();
    if let Some(new) = if reset { Some(field.default.clone()) } else { new } {
        // A widget gives only what its declaration allows.
        let _ = wanted.set(&field.key, &new);
    }
}

/// Meaning, unit, price and when it matters, for the tooltip.
fn about(ui: &mut Ui, field: &Field, idle: Option<Condition>) {
    ui.set_max_width(320.0);
    ui.label(RichText::new(&field.key).strong());
    ui.label(&field.meaning);
    if let Kind::Choice(names) = &field.kind {
        for (name, meaning) in *names {
            ui.label(format!("{name}: {}", meaning.trim()));
        }
    }
    let unit = if field.unit.is_empty() { String::new() } else { format!(" {}", field.unit) };
    ui.weak(format!("{}{unit}; by default {}", field.kind, field.default));
    ui.weak(match field.effect {
        Effect::Uniform => "Free to change",
        Effect::Resources => "A change allocates textures or buffers",
        Effect::Permutation => "A change compiles pipelines, while the picture goes on",
    });
    if let Some(only) = field.only {
        ui.weak(format!("Matters {only}"));
    }
    if let Some(lacks) = idle {
        ui.label(RichText::new(format!("Does nothing here, {lacks}")).strong());
    }
}

/// The widget of a field; the new value as text when the user changed it.
fn widget(ui: &mut Ui, field: &Field, value: &str) -> Option<String> {
    let suffix = match field.unit {
        "" => String::new(),
        unit if unit.len() <= 7 => format!(" {unit}"),
        _ => String::new(),
    };
    match field.kind {
        Kind::Switch => {
            let mut on = value == "true";
            ui.checkbox(&mut on, "").changed().then(|| on.to_string())
        }
        Kind::Choice(names) => {
            let mut chosen = None;
            ComboBox::from_id_salt(&field.key).selected_text(value).width(130.0).show_ui(ui, |ui| {
                for (name, meaning) in names {
                    let label = ui.selectable_label(*name == value, *name).on_hover_text(meaning.trim());
                    if label.clicked() && *name != value {
                        chosen = Some((*name).to_owned());
                    }
                }
            });
            chosen
        }
        Kind::Whole(low, high) => {
            let mut number: u32 = value.parse().ok()?;
            let wide = f64::from(high) / f64::from(low.max(1)) >= WIDE_RANGE;
            let slider = Slider::new(&mut number, low..=high).logarithmic(wide).suffix(suffix);
            ui.add(slider).changed().then(|| number.to_string())
        }
        Kind::Number(low, high) => {
            let number = value.parse().ok()?;
            number_ui(ui, number, low, high, suffix)
        }
        Kind::WordOrNumber(word, low, high) => {
            ui.horizontal(|ui| {
                let mut is_word = value == word;
                let toggled = ui.checkbox(&mut is_word, word).changed();
                if toggled {
                    let middle = if low <= 0.0 && high >= 0.0 { 0.0 } else { low };
                    return Some(if is_word { word.to_owned() } else { middle.to_string() });
                }
                if is_word { None } else { number_ui(ui, value.parse().ok()?, low, high, suffix) }
            })
            .inner
        }
        Kind::WordOrList(..) => text_ui(ui, &field.key, value),
    }
}

/// A line of text, taken over when it is left: half of a list is none.
fn text_ui(ui: &mut Ui, key: &str, value: &str) -> Option<String> {
    let id = ui.scope_id().with(key);
    let mut text = ui.data(|data| data.get_temp::<String>(id)).unwrap_or_else(|| value.to_owned());
    let edit = ui.add(TextEdit::singleline(&mut text).desired_width(130.0));
    if edit.lost_focus() {
        ui.data_mut(|data| data.remove::<String>(id));
        return (text != value).then(|| text.trim().to_owned());
    }
    if edit.has_focus() {
        ui.data_mut(|data| data.insert_temp(id, text));
    }
    None
}

fn number_ui(ui: &mut Ui, mut number: f32, low: f32, high: f32, suffix: String) -> Option<String> {
    let wide = low >= 0.0 && f64::from(high) / f64::from(low.max(1e-3)) >= 1e3 * WIDE_RANGE
        || low > 0.0 && f64::from(high) / f64::from(low) >= WIDE_RANGE;
    let slider =
        Slider::new(&mut number, low..=high).logarithmic(wide).smallest_positive(1e-3).suffix(suffix);
    ui.add(slider).changed().then(|| number.to_string())
}
