//! Settings of what mirrors and glass show.

use crate::{choice, settings};

choice! {
    /// What the camera sees in mirrors and smooth glass.
    pub enum SpecularTechnique {
        /// Mirrors show the surroundings alone; through glass the picture is seen, bent once. Free.
        Environment = "environment",
        /// Everything, by rays through any number of faces: they fetch what the picture shows, and light the rest by its lamps.
        Rays = "rays",
    }
}

settings! {
    /// What the camera sees in mirrors and smooth glass.
    pub struct SpecularSettings: "specular" {
        /// What the camera sees in surfaces that mirror exactly or refract without blur. Rays need trees over the scene.
        technique: SpecularTechnique = SpecularTechnique::Environment, "", (), Permutation;
    }
}
