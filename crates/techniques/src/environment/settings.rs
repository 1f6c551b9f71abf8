//! Settings of environment maps.

use crate::settings;

settings! {
    /// Environment maps.
    pub struct EnvironmentSettings: "environment" {
        /// Factor on the map's radiance, as background and as light: 1 takes a pixel of value 1 for 1 nit.
        intensity: f32 = 1.0, "", 0.0..=1e6, Uniform;
        /// Turns the surroundings about the vertical, counter-clockwise seen from above.
        rotation: f32 = 0.0, "deg", -360.0..=360.0, Uniform;
    }
}
