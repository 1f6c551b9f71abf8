//! Scenes made by code: closed bodies, shared meshes, painted textures; no files.

mod arch;
mod caster;
mod cornell;
mod courtyard;
mod curve;
mod dancer;
mod door;
mod flight;
mod flora;
mod glass;
mod grid;
mod grove;
mod height_field;
mod land;
mod nave;
mod pool;
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
mod wall;

pub(crate) use caster::ring_with;
pub(crate) use height_field::{HeightField, height_field};

use crate::Scene;

/// Every built-in scene's name and what it shows.
pub const SCENES: &[(&str, &str)] = &[
    ("nave", "Gothic nave, sun through the south clerestory, warm spots; 88,000 triangles"),
    ("courtyard", "Arcades round a sunlit court with a fountain and lemon trees; 151,000 triangles"),
    (
        "terrain",
        "Eroded hills of 135×135 points and a sculpture of 1.3 million vertices; 2.8 million triangles",
    ),
    ("ring", "Gold bangle on an open book under a lamp: a caustic by reflection; 44,000 triangles"),
    ("ball", "Glass and steel balls on a chess board: caustics by refraction; 36,000 triangles"),
    ("knot", "Glass trefoil knot before a paper sweep: many interfaces; 50,000 triangles"),
    ("pool", "Tiled pool in the sun: caustics through waves; 200,000 triangles"),
    ("grove", "Path along a fence under trees: leaves and grass cut out by alpha; 491,000 triangles"),
    ("dancer", "Cobra dancing out of its basket: skin and morph targets; 73,000 triangles"),
    ("flight", "The nave at dusk: a camera flies through it, a spot light searches; 88,000 triangles"),
    ("door", "Two rooms: a door opens, and the lamp behind it lights the next room; 144 triangles"),
    ("cornell", "Cornell box with thick walls, two blocks and a spot light; 84 triangles"),
];

/// The scene that is shown when none is asked for.
pub const DEFAULT: &str = "nave";

/// Builds the scene called `name`; `None` if there is none. The same name always gives the same scene.
pub fn build(name: &str) -> Option<Scene> {
    match name {
        "nave" => Some(nave::build()),
        "courtyard" => Some(courtyard::build()),
        "terrain" => Some(terrain::build()),
        "ring" => Some(ring::build()),
        "ball" => Some(glass::build_ball()),
        "knot" => Some(glass::build_knot()),
        "pool" => Some(pool::build()),
        "grove" => Some(grove::build()),
        "dancer" => Some(dancer::build()),
        "flight" => Some(flight::build()),
        "door" => Some(door::build()),
        "cornell" => Some(cornell::build()),
        _ => None,
    }
}
