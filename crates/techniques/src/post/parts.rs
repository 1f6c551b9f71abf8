//! A frame's light, taken apart.

use chiaro_gpu::{Frame, Texture};

use super::{Accumulator, Aov, Sum};

/// What a frame that is asked for its parts leaves: pictures of the same surfaces under part of the light.
///
/// Every light belongs to exactly one of `direct`, `indirect` and `caustics` (`docs/glossary.md`, parts of light), and the
/// three add up to the picture. A technique adds its light in `direct/lighting.wesl`, with the weight of the part that it is
/// of; what has no weight of its own here is indirect light.
#[derive(Clone, Debug)]
pub struct Parts {
    /// Rgba16Float, nits · radiance scale: all light of this frame alone, before any averaging over time.
    pub picture: Texture,
    /// The same of direct light, without unlit colours.
    pub direct: Texture,
    /// The same of caustics, where a technique makes any.
    pub caustics: Option<Texture>,
    /// What unlit materials add, as in a frame's outputs.
    pub unlit: Option<Texture>,
}

impl Parts {
    /// Adds a part of this frame to a sum; a stored unit is `nits`. Unlit colours are direct light, white 1 nit. What is
    /// left of the picture without the other two is indirect light: exactly nothing where there is none.
    ///
    /// # Panics
    /// When the quantity is no part of light.
    pub fn add(
        &self,
        frame: &mut Frame<'_>,
        accumulator: &Accumulator,
        (part, nits): (Aov, f32),
        sum: &mut Sum,
    ) {
        let caustics = self.caustics.as_ref();
        let terms = match part {
            Aov::Direct => [Some((&self.direct, nits)), self.unlit.as_ref().map(|color| (color, 1.0)), None],
            Aov::Indirect => [
                Some((&self.picture, nits)),
                Some((&self.direct, -nits)),
                caustics.map(|caustics| (caustics, -nits)),
            ],
            // Without a technique black, of whatever texture.
            Aov::Caustics => {
                [Some(caustics.map_or((&self.picture, 0.0), |caustics| (caustics, nits))), None, None]
            }
            _ => panic!("post: {} is no part of light", part.name()),
        };
        for (texture, nits) in terms.into_iter().flatten() {
            accumulator.record(frame, texture, nits, sum);
        }
    }
}
