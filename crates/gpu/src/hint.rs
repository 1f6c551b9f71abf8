//! How a texture or buffer is looked at.

/// How values become colours.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Mapping {
    /// Nits, exposed like the picture.
    Exposed,
    /// Linear colours, 0..1.
    Color,
    /// −1..1 around grey, such as normals.
    Signed,
    /// A distance: white is near, half as bright at 1.
    Distance,
    /// Reversed depth of a camera: white is near.
    Depth,
    /// A colour for each whole number, black for 0.
    Number,
    /// Depth of shadow views, one a layer: white is near the light.
    ShadowDepth,
    /// 0..1 from black over blue, red and yellow to white.
    Heat,
    /// Any number around grey: x / (1 + |x|).
    Range,
}

/// What values are multiplied by before they are mapped.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Scale {
    /// This.
    By(f32),
    /// This over the scene's size in metres.
    OfScene(f32),
    /// What makes nits of stored radiance.
    Nits,
}

/// How to look at a resource, declared beside where it is made.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct ViewHint {
    /// What its values and colours mean.
    pub about: &'static str,
    /// How values become colours.
    pub mapping: Mapping,
    /// What they are multiplied by before.
    pub scale: Scale,
}

impl ViewHint {
    /// Values as they are.
    pub const fn new(about: &'static str, mapping: Mapping) -> Self {
        Self::scaled(about, mapping, Scale::By(1.0))
    }

    /// The same with a scale.
    pub const fn scaled(about: &'static str, mapping: Mapping, scale: Scale) -> Self {
        Self { about, mapping, scale }
    }
}
