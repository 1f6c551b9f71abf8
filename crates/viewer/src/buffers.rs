//! Every buffer of a frame, by name, and how it is made visible.

use chiaro::techniques::post::{Aov, DebugView, Mapping, Sum};
use chiaro::{Frame, FrameOutputs, Texture, ViewState};

use crate::engine::Engine;
use crate::stage::Stage;

/// What a view shows.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
enum Source {
    /// A quantity computed from the surface buffer and lights.
    Aov(Aov),
    Radiance,
    Depth,
    Visibility,
    Emissive,
    ShadowMaps,
    ShadowMoments,
    LightGrid,
}

/// A buffer that can be looked at.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct BufferView {
    /// For the panel.
    pub name: &'static str,
    /// What its colours mean.
    pub about: &'static str,
    source: Source,
    mapping: Mapping,
}

const fn view(name: &'static str, about: &'static str, source: Source, mapping: Mapping) -> BufferView {
    BufferView { name, about, source, mapping }
}

/// All of them; the digits 1 to 9 and 0 choose the first ten.
pub const BUFFERS: [BufferView; 19] = [
    view("radiance", "The frame before averaging and tone mapping", Source::Radiance, Mapping::Exposed),
    view(
        "direct light",
        "Light that comes from lights without a bounce",
        Source::Aov(Aov::Direct),
        Mapping::Exposed,
    ),
    view(
        "indirect light",
        "Light that bounced, or what stands in for it",
        Source::Aov(Aov::Indirect),
        Mapping::Exposed,
    ),
    view("albedo", "Base colour", Source::Aov(Aov::Albedo), Mapping::Color),
    view(
        "normal",
        "Shading normal in the world: x red, y green, z blue, grey is 0",
        Source::Aov(Aov::Normal),
        Mapping::Signed,
    ),
    view(
        "roughness",
        "Roughness red, metalness green, specular blue",
        Source::Aov(Aov::Roughness),
        Mapping::Color,
    ),
    view(
        "distance",
        "White is near; half as bright a tenth of the scene's size away",
        Source::Aov(Aov::Depth),
        Mapping::Distance,
    ),
    view(
        "shadow",
        "Share of all direct light that arrives: black is shadow",
        Source::Aov(Aov::Shadow),
        Mapping::Color,
    ),
    view(
        "shadow maps",
        "Depth from each light, a layer each: white is near the light",
        Source::ShadowMaps,
        Mapping::Depth,
    ),
    view(
        "shadow moments",
        "What was made of the depth, a layer each: the first three numbers, grey is 0",
        Source::ShadowMoments,
        Mapping::Signed,
    ),
    view(
        "cascades",
        "Which shadow map a pixel is looked up in: a colour each, mixed where two are",
        Source::Aov(Aov::ShadowCascade),
        Mapping::Color,
    ),
    view(
        "shadow texels",
        "The shadow map's texels on the surface",
        Source::Aov(Aov::ShadowTexels),
        Mapping::Color,
    ),
    view(
        "penumbra",
        "How far the shadow's filter reaches: white is a hundredth of the scene's size",
        Source::Aov(Aov::ShadowPenumbra),
        Mapping::Color,
    ),
    view(
        "shadow bias",
        "How far receivers are moved against acne: white is a thousandth of the scene's size",
        Source::Aov(Aov::ShadowBias),
        Mapping::Color,
    ),
    view("visibility", "Which triangle each pixel shows: a colour each", Source::Visibility, Mapping::Number),
    view(
        "light grid",
        "Lights that may reach the pixel: black none, blue, red, yellow, white from 16 on",
        Source::LightGrid,
        Mapping::Number,
    ),
    view(
        "triangle normal",
        "Normal of the triangle, as the normal",
        Source::Aov(Aov::GeometricNormal),
        Mapping::Signed,
    ),
    view("depth", "The depth buffer, reversed: white is near", Source::Depth, Mapping::Depth),
    view("emissive", "What glows by itself", Source::Emissive, Mapping::Exposed),
];

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
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub struct Shown {
    /// Where.
    pub place: Place,
    /// Number in [`BUFFERS`].
    pub buffer: usize,
    /// Layer of an array.
    pub layer: u32,
}

impl Shown {
    /// Another buffer; one that is off comes into the corner.
    pub fn choose(&mut self, buffer: usize) {
        self.buffer = buffer.min(BUFFERS.len() - 1);
        self.layer = 0;
        if self.place == Place::Off {
            self.place = Place::Corner;
        }
    }

    /// The buffer.
    pub fn view(&self) -> &'static BufferView {
        &BUFFERS[self.buffer.min(BUFFERS.len() - 1)]
    }
}

/// What a drawn buffer turned out to be.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Drawn {
    /// Layers there are.
    pub layers: u32,
    /// Width over height.
    pub aspect: f32,
    /// Whether the frame has this buffer.
    pub exists: bool,
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
    let BufferView { source, mapping, .. } = *shown.view();
    let (debug, group) = (&passes.debug, state.frame_group());
    let show = |frame: &mut Frame<'_>, debug: &DebugView, texture: &Texture, scale: f32| {
        debug.record(frame, group, (texture, shown.layer), (mapping, scale), &passes.display, picture);
        let options = texture.options();
        let aspect = options.width as f32 / options.height as f32;
        Drawn { layers: options.layers.unwrap_or(1), aspect, exists: true }
    };
    let nits = 1.0 / stage.loaded.radiance_scale;
    let surface = outputs.surface.as_ref();
    let drawn = match source {
        Source::Radiance => Some(show(frame, debug, &outputs.radiance, nits)),
        Source::ShadowMaps => Some(show(frame, debug, &outputs.shadows.maps, 1.0)),
        Source::ShadowMoments => {
            let moments = &outputs.shadows.moments.moments;
            (moments.options().width > 1).then(|| show(frame, debug, moments, 1.0))
        }
        Source::Depth => surface.map(|surface| show(frame, debug, &surface.depth, 1.0)),
        Source::Visibility => surface.map(|surface| show(frame, debug, &surface.visibility, 1.0)),
        Source::Emissive => {
            let emissive = surface.and_then(|surface| surface.emissive.as_ref());
            emissive.map(|emissive| show(frame, debug, emissive, nits))
        }
        Source::LightGrid => surface.map(|surface| {
            let grid = (&surface.depth, &outputs.light_grid);
            debug.record_grid(frame, group, grid, picture);
            let options = picture.options();
            Drawn { layers: 1, aspect: options.width as f32 / options.height as f32, exists: true }
        }),
        Source::Aov(aov) => surface.map(|surface| {
            sum.restart();
            let inputs = (surface, &outputs.shadows, &outputs.light_grid);
            passes.aov.record(frame, group, inputs, (0, aov), sum);
            let scale = match aov {
                Aov::Depth => 10.0 / stage.size_m(),
                Aov::ShadowPenumbra => 100.0 / stage.size_m(),
                Aov::ShadowBias => 1000.0 / stage.size_m(),
                _ => 1.0,
            };
            show(frame, debug, sum.texture(), scale)
        }),
    };
    drawn.unwrap_or(Drawn { layers: 1, aspect: 1.0, exists: false })
}
