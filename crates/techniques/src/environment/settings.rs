//! Settings of what surrounds scenes.

use crate::{choice, settings};

choice! {
    /// What surrounds a scene that has suns and no environment map.
    pub enum Sky {
        /// A uniform sky, as bright as such suns make a clear one on average.
        Auto = "auto",
        /// Nothing: black, and no light from it.
        None = "none",
    }
}

settings! {
    /// What surrounds a scene: an environment map, or a sky.
    pub struct EnvironmentSettings: "environment" {
        /// What surrounds a scene that has suns and no environment map, as background and as light, in pictures and in the
        /// reference: auto is a uniform sky of 0.058, 0.080 and 0.115 nits (red, green, blue) per lux of sun, none is
        /// black, as the images of other renderers have it. environment.intensity does not scale it.
        sky: Sky = Sky::Auto, "", (), Uniform;
        /// Factor on the map's radiance, as background and as light: 1 takes a pixel of value 1 for 1 nit.
        intensity: f32 = 1.0, "", 0.0..=1e6, Uniform;
        /// Turns the surroundings about the vertical, counter-clockwise seen from above.
        rotation: f32 = 0.0, "deg", -360.0..=360.0, Uniform;
    }
}
