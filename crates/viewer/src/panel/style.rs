//! How the panel looks.

use egui::{Color32, vec2};

/// Colour of what went wrong.
pub(crate) const ERROR: Color32 = Color32::from_rgb(255, 120, 100);

/// Dark, dense, and quiet, so that the picture is what one looks at.
pub fn style(ctx: &egui::Context) {
    let mut visuals = egui::Visuals::dark();
    visuals.panel_fill = Color32::from_gray(24);
    visuals.window_fill = Color32::from_gray(28);
    ctx.set_visuals(visuals);
    ctx.all_styles_mut(|style| {
        style.spacing.item_spacing = vec2(6.0, 4.0);
        style.spacing.slider_width = 110.0;
        style.interaction.tooltip_delay = 0.3;
    });
    // Ctrl+plus and Ctrl+minus would be surprising where keys fly.
    ctx.options_mut(|options| options.zoom_with_keyboard = false);
}
