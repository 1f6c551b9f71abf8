//! Scenes made by code: closed bodies, shared meshes, painted textures; no files.

mod arch;
mod cornell;
mod curve;
mod glass;
mod grid;
mod nave;
mod relief;
mod ring;
mod shape;
mod sky;
mod solid;
mod stage;
mod tabletop;
mod terrain;
#[cfg(test)]
mod tests;
mod texture;

use crate::Scene;

/// Every built-in scene's name and what it shows.
pub const SCENES: &[(&str, &str)] = &[
    ("nave", "Gothic nave, sun through the south clerestory, warm spots; 88,000 triangles"),
    (
        "terrain",
        "Eroded hills of 135×135 points and a sculpture of 1.3 million vertices; 2.7 million triangles",
    ),
    ("ring", "Gold bangle on an open book under a lamp: a caustic by reflection; 60,000 triangles"),
    ("ball", "Glass and steel balls on a chess board: caustics by refraction; 36,000 triangles"),
    ("knot", "Glass trefoil knot before a paper sweep: many interfaces; 50,000 triangles"),
    ("cornell", "Cornell box with thick walls, two blocks and a spot light"),
];

/// The scene that is shown when none is asked for.
pub const DEFAULT: &str = "nave";

/// Builds the scene called `name`; `None` if there is none. The same name always gives the same scene.
pub fn build(name: &str) -> Option<Scene> {
    match name {
        "nave" => Some(nave::build()),
        "terrain" => Some(terrain::build()),
        "ring" => Some(ring::build()),
        "ball" => Some(glass::build_ball()),
        "knot" => Some(glass::build_knot()),
        "cornell" => Some(cornell::build()),
        _ => None,
    }
}
