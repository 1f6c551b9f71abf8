//! What can be looked at: quantities of surface and light, and every texture and buffer that a frame leaves behind.

use std::fmt;

use chiaro::techniques::post::Sum;
use chiaro::{Aov, Frame, FrameOutputs, Handle, ResourceName, Scale, Texture, ViewHint, ViewState};

use crate::engine::Engine;
use crate::stage::Stage;

/// Something to look at.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Source {
    /// A quantity computed from the surface buffer and lights.
    Quantity(Aov),
    /// What passes touched.
    Resource(ResourceName),
}

impl fmt::Display for Source {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Quantity(aov) => f.write_str(aov.name()),
            Self::Resource(name) => name.fmt(f),
        }
    }
}

/// What indirect light is made from: the digits 7, 8, 9 and 0 choose it, whatever else there is; and when there is any.
const OF_INDIRECT: [(&str, &str); 4] = [
    ("rsm_picture", "indirect.technique=auto|rsm|ism|traced"),
    ("ism_after", "indirect.technique=auto|ism"),
    ("vpl_picture", "indirect.technique=auto|rsm|ism|traced"),
    ("discontinuities", "indirect.technique=auto|rsm|ism|traced and indirect.filter=discontinuity"),
];
/// Digits before them, which choose the first quantities.
const QUANTITIES: usize = 6;

/// All that a frame has, in the order of the keys.
#[derive(Debug, Default)]
pub struct Offer(Vec<(Source, ViewHint)>);

impl Offer {
    /// Looks at what was recorded so far.
    pub fn update(&mut self, frame: &Frame<'_>) {
        self.0.clear();
        self.0.extend(Aov::ALL.map(|(aov, _)| (Source::Quantity(aov), aov.hint())));
        self.0.extend(frame.resources().map(|found| (Source::Resource(found.name), found.hint())));
    }

    /// Everything, with how to look at it.
    pub fn iter(&self) -> impl Iterator<Item = &(Source, ViewHint)> {
        self.0.iter()
    }

    /// The one that stands so many places after another; over the ends it starts anew.
    pub fn after(&self, source: Source, places: usize) -> Source {
        let at = self.0.iter().position(|(other, _)| *other == source).unwrap_or(0);
        self.number((at + places) % self.0.len().max(1)).unwrap_or(source)
    }

    /// The one before.
    pub fn before(&self, source: Source) -> Source {
        self.after(source, self.0.len().saturating_sub(1))
    }

    /// What the digit key of that place chooses: 1 to 9, then 0.
    pub fn by_key(&self, index: usize) -> Option<Source> {
        match index.checked_sub(QUANTITIES) {
            None => self.number(index),
            Some(index) => OF_INDIRECT
                .get(index)
                .map(|(name, _)| Source::Resource(ResourceName { technique: "indirect", name, number: 1 })),
        }
    }

    /// By its place.
    fn number(&self, index: usize) -> Option<Source> {
        self.0.get(index).map(|(source, _)| *source)
    }
}

/// Where a buffer is shown.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Place {
    /// Nowhere.
    #[default]
    Off,
    /// In a corner of the picture.
    Corner,
    /// Instead of the picture.
    Full,
}

impl Place {
    /// What follows when one key steps through them.
    pub fn next(self) -> Self {
        match self {
            Self::Off => Self::Corner,
            Self::Corner => Self::Full,
            Self::Full => Self::Off,
        }
    }
}

/// Which buffer is shown, and where.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Shown {
    /// Where.
    pub place: Place,
    /// What.
    pub source: Source,
    /// Layer of an array.
    pub layer: u32,
}

impl Default for Shown {
    fn default() -> Self {
        Self { place: Place::Off, source: Source::Quantity(Aov::ALL[0].0), layer: 0 }
    }
}

impl Shown {
    /// Another buffer; one that is off comes into the corner.
    pub fn choose(&mut self, source: Source) {
        self.source = source;
        self.layer = 0;
        if self.place == Place::Off {
            self.place = Place::Corner;
        }
    }
}

/// What a drawn buffer turned out to be.
#[derive(Clone, Debug, PartialEq)]
pub struct Drawn {
    /// Layers there are.
    pub layers: u32,
    /// Width over height.
    pub aspect: f32,
    /// Whether the frame has this buffer.
    pub exists: bool,
    /// What its values and colours mean, with its size and format.
    pub about: String,
}

impl Source {
    /// With which settings frames have it, of what digits choose.
    pub fn only(self) -> Option<&'static str> {
        let Self::Resource(ResourceName { technique: "indirect", name, .. }) = self else { return None };
        OF_INDIRECT.into_iter().find(|(other, _)| *other == name).map(|(_, only)| only)
    }

    /// Whether it is made of the frame's light taken apart.
    pub fn is_part(self) -> bool {
        matches!(self, Self::Quantity(aov) if aov.is_part())
    }
}

/// Draws a buffer of the frame that was just recorded. `sum` is scratch of the picture's size.
pub fn draw(
    frame: &mut Frame<'_>,
    (engine, state): (&Engine, &ViewState),
    stage: &Stage,
    outputs: &FrameOutputs,
    shown: Shown,
    (sum, picture): (&mut Sum, &Texture),
) -> Drawn {
    let passes = &engine.passes;
    let found = match shown.source {
        Source::Quantity(aov) => quantity(frame, (engine, state), stage, outputs, (aov, &mut *sum))
            .map(|()| (Handle::Texture(sum.texture().clone()), aov.hint(), aov.hint().about.to_owned())),
        Source::Resource(name) => frame.resources().find(|resource| resource.name == name).map(|resource| {
            let hint = resource.hint();
            let about = format!("{} ({resource})", hint.about);
            (resource.handle, hint, about)
        }),
    };
    let Some((handle, hint, about)) = found else {
        return Drawn { layers: 1, aspect: 1.0, exists: false, about: String::new() };
    };
    let scale = match hint.scale {
        Scale::By(factor) => factor,
        Scale::OfScene(factor) => factor / stage.size_m(),
        Scale::Nits => 1.0 / stage.loaded.radiance_scale,
    };
    passes.debug.record(
        frame,
        state.frame_group(),
        (&handle, shown.layer),
        (hint.mapping, scale),
        &passes.display,
        picture,
    );
    let (layers, options) = match &handle {
        Handle::Texture(texture) => (texture.options().layers.unwrap_or(1), texture.options()),
        Handle::Buffer(_) => (1, picture.options()),
    };
    Drawn { layers, aspect: options.width as f32 / options.height as f32, exists: true, about }
}

/// Fills `sum` with a quantity of the frame; `None` where the frame has none of it.
fn quantity(
    frame: &mut Frame<'_>,
    (engine, state): (&Engine, &ViewState),
    stage: &Stage,
    outputs: &FrameOutputs,
    (aov, sum): (Aov, &mut Sum),
) -> Option<()> {
    let passes = &engine.passes;
    sum.restart();
    if aov.is_part() {
        let nits = 1.0 / stage.loaded.radiance_scale;
        outputs.parts.as_ref()?.add(frame, &passes.accumulator, (aov, nits), sum);
        return Some(());
    }
    let surface = outputs.surface.as_ref()?;
    match &outputs.motion {
        Some(found) if aov == Aov::Motion => passes.aov.record_motion(frame, &found.motion, 1, sum),
        // Of a picture that rests the shader leaves grey.
        _ => {
            let inputs = (surface, &outputs.shadows, &outputs.light_grid);
            passes.aov.record(frame, (state.frame_group(), &stage.loaded.gpu), inputs, (0, aov), sum);
        }
    }
    Some(())
}
