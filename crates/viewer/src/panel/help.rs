//! The keys.

use egui::{Grid, RichText, Ui, Window};

/// What each key does; `docs/viewer.md` has the same table, held against this one by a test.
pub const KEYS: &[(&str, &str)] = &[
    ("W A S D", "fly forwards, left, back, right"),
    ("E or Space", "fly up"),
    ("Q or Shift", "fly down"),
    ("drag the mouse", "look around"),
    ("double click", "hold the mouse to look around; Esc lets go"),
    ("wheel", "fly faster or slower"),
    ("K", "play or pause the animation"),
    ("T", "compare with the path-traced truth: split, alone, off"),
    ("P", "buffers: off, in the corner, full"),
    ("1 to 6", "choose a buffer: direct light, albedo, normal, depth, shadow, indirect light"),
    ("7 8 9 0", "reflective and imperfect shadow maps, virtual lights, discontinuities"),
    ("[ and ]", "the buffer before, the next"),
    (", and .", "the layer before, the next"),
    ("U I O", "show indirect light, direct light, both"),
    ("F12", "write a screenshot into the current folder"),
    ("H or F1", "this help"),
    ("F2", "show or hide the panel"),
    ("F11", "fill the screen"),
];

/// Shows the help; `false` once it is closed.
pub fn show(ui: &Ui) -> bool {
    let mut open = true;
    Window::new("Keys").open(&mut open).collapsible(false).auto_sized().show(ui.ctx(), |ui| {
        ui.style_mut().wrap_mode = Some(egui::TextWrapMode::Extend);
        Grid::new("keys").num_columns(2).spacing([24.0, 5.0]).show(ui, |ui| {
            for (key, meaning) in KEYS {
                ui.label(RichText::new(*key).strong());
                ui.label(*meaning);
                ui.end_row();
            }
        });
    });
    open
}

#[cfg(test)]
mod tests {
    use super::KEYS;

    #[test]
    fn the_page_has_the_same_keys() {
        let page = include_str!("../../../../docs/viewer.md");
        for (key, meaning) in KEYS {
            assert!(
                page.contains(&format!("| {key} | {meaning} |")),
                "docs/viewer.md lacks {key}: {meaning}"
            );
        }
    }
}
