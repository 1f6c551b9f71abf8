//! Scenes made by code: closed bodies, shared meshes, painted textures; no files.

mod arch;
mod cornell;
mod nave;
mod shape;
mod solid;
mod stage;
#[cfg(test)]
mod tests;
mod texture;

use crate::Scene;

/// Every built-in scene's name and what it shows.
pub const SCENES: &[(&str, &str)] = &[
    ("nave", "Gothic nave, sun through the south clerestory, warm spots; 88,000 triangles"),
    ("cornell", "Cornell box with thick walls, two blocks and a spot light"),
];

/// The scene that is shown when none is asked for.
pub const DEFAULT: &str = "nave";

/// Builds the scene called `name`; `None` if there is none. The same name always gives the same scene.
pub fn build(name: &str) -> Option<Scene> {
    match name {
        "nave" => Some(nave::build()),
        "cornell" => Some(cornell::build()),
        _ => None,
    }
}
