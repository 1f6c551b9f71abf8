//! The Cornell box: red, green, white, two blocks and a light in the ceiling.

use glam::{Vec3, vec3};

use super::{
    shape::{block, cuboid},
    stage::{Stage, spot},
};
use crate::{Material, Scene};

/// Inside width, height and depth, metres.
const ROOM: Vec3 = vec3(2.4, 2.4, 2.4);
/// Thick enough that no shadow bias leaks through.
const WALL: f32 = 0.15;

/// Builds it: floor at y = 0, open towards +Z, red on the left.
pub fn build() -> Scene {
    let mut stage = Stage::new("cornell");
    let mut lambert = |name: &str, color: Vec3| {
        let base_color = color.extend(1.0);
        stage.material(Material { name: name.to_owned(), base_color, specular: 0.0, ..Material::default() })
    };
    let white = lambert("white", vec3(0.73, 0.73, 0.71));
    let red = lambert("red", vec3(0.60, 0.06, 0.05));
    let green = lambert("green", vec3(0.12, 0.44, 0.10));

    let (x, y, z) = (ROOM.x / 2.0, ROOM.y, ROOM.z / 2.0);
    // Floor, ceiling and back reach over the side walls' ends, so that corners are closed from outside too.
    stage.body("floor", cuboid(vec3(-x - WALL, -WALL, -z - WALL), vec3(x + WALL, 0.0, z), white));
    stage.body("back", cuboid(vec3(-x - WALL, 0.0, -z - WALL), vec3(x + WALL, y, -z), white));
    stage.body("left", cuboid(vec3(-x - WALL, 0.0, -z), vec3(-x, y, z), red));
    stage.body("right", cuboid(vec3(x, 0.0, -z), vec3(x + WALL, y, z), green));
    stage.body("ceiling", cuboid(vec3(-x - WALL, y, -z - WALL), vec3(x + WALL, y + WALL, z), white));
    stage.body("tall block", block(vec3(0.70, 1.42, 0.70), 18.0, vec3(-0.42, 0.0, -0.42), white));
    stage.body("low block", block(vec3(0.70, 0.70, 0.70), -17.0, vec3(0.44, 0.0, 0.38), white));

    // 60 cd over a wide cone from just under the ceiling, whose own shadow it must not catch.
    let lamp = vec3(0.0, y - 0.02, 0.0);
    stage.light("lamp", spot(50.0, 80.0), vec3(1.0, 0.88, 0.70), 60.0, lamp, lamp - Vec3::Y);
    stage.camera("front", vec3(0.0, y / 2.0, 5.2), vec3(0.0, y / 2.0, 0.0), 34.5);
    stage.camera("corner", vec3(0.75, 1.75, 1.7), vec3(-0.4, 0.6, -0.6), 50.0);
    stage.scene
}
