//! What the panel remembers.

use crate::buffers::Shown;
use crate::truth::Compare;

/// What the panel remembers.
#[derive(Debug)]
pub struct PanelState {
    pub(crate) shown: bool,
    pub(crate) help: bool,
    pub(crate) vsync: bool,
    pub(crate) fullscreen: bool,
    /// Frames go on while nothing changes, so that timings do.
    pub(crate) continuous: bool,
    pub(crate) grabs_mouse: bool,
    /// Picture pixels per window pixel.
    pub(crate) scale: f32,
    pub(crate) search: String,
    pub(crate) settings_error: Option<String>,
    pub(crate) shader_error: Option<String>,
    pub(crate) shown_buffer: Shown,
    pub(crate) compare: Compare,
    /// Where the truth begins, 0..1 of the picture's width.
    pub(crate) divider: f32,
    pub(crate) exr: bool,
    /// What the renderer gave up.
    pub(crate) notes: Vec<String>,
    /// Size of the picture that fits the window.
    pub(crate) picture_px: Option<[u32; 2]>,
    /// The moment shown was set by hand.
    pub(crate) scrubbed: bool,
    pub(super) dragged: egui::Vec2,
    pub(super) scrolled: f32,
    pub(super) flies: bool,
}

impl Default for PanelState {
    fn default() -> Self {
        Self {
            shown: true,
            help: false,
            vsync: true,
            fullscreen: false,
            continuous: false,
            grabs_mouse: false,
            scale: 1.0,
            search: String::new(),
            settings_error: None,
            shader_error: None,
            shown_buffer: Shown::default(),
            compare: Compare::Off,
            divider: 0.5,
            exr: false,
            notes: Vec::new(),
            picture_px: None,
            scrubbed: false,
            dragged: egui::Vec2::ZERO,
            scrolled: 0.0,
            flies: false,
        }
    }
}
