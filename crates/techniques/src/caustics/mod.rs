//! Caustics: light through and off specular objects. None so far; the setting exists so that scripts can ask for none.

use crate::{choice, settings};

choice! {
    /// How caustics are made.
    pub enum Technique {
        /// None.
        None = "none",
    }
}

settings! {
    /// Caustics.
    pub struct CausticsSettings: "caustics" {
        /// How caustics are made.
        technique: Technique = Technique::None, "", (), Uniform;
    }
}
