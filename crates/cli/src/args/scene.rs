//! The flags that say what is seen, from where and when.

use std::path::PathBuf;

use chiaro::scene::HeightMap;
use clap::Args;

use crate::values::{
    FrameRange, GroundSize, Setting, Size, View, frames_per_second, seconds, terrain_metres,
    terrain_vertices, values_of,
};

/// What is seen, and from where.
#[derive(Clone, Debug, Args)]
pub struct SceneArgs {
    /// A .glb, .gltf or .obj file, or builtin:NAME (see `chiaro scenes`)
    #[arg(value_name = "SCENE")]
    pub scene: Option<String>,
    /// Which scene of a file that holds several, by its number from 0 or by its name [default: the file's own choice]
    #[arg(long = "scene", value_name = "INDEX|NAME")]
    pub scene_in_file: Option<String>,
    /// Instead of a scene: builtin:ring with this model (.glb, .gltf, .obj or builtin:NAME) in the place of its ring, as large as it
    #[arg(long, value_name = "FILE", conflicts_with_all = ["scene", "scene_in_file", "height_map"])]
    pub caster: Option<PathBuf>,
    /// Terrain in the scene's place
    #[command(flatten)]
    pub terrain: TerrainArgs,
    /// The camera
    #[command(flatten)]
    pub look: LookArgs,
}

/// From where, how large, and in which surroundings.
#[derive(Clone, Debug, Args)]
pub struct LookArgs {
    /// The image's width and height in pixels [default: 1280x720; `bench --suite shadows|indirect`: 800x600]
    #[arg(long, value_name = "WxH")]
    pub size: Option<Size>,
    /// A camera of the scene, by its number from 0 or by its name [default: the first]; its near plane counts, and the far
    /// plane of an orthographic one: perspective cameras see to infinity
    #[arg(long, value_name = "INDEX|NAME", conflicts_with = "view")]
    pub camera: Option<String>,
    /// A camera of your own: its position and target in metres, and its vertical field of view in degrees; its near
    /// plane follows from the size of what is looked at
    #[arg(long, value_name = "x,y,z,tx,ty,tz,yfov_deg", allow_hyphen_values = true)]
    pub view: Option<View>,
    /// A Radiance HDR or EXR picture of the surroundings (latitude-longitude), which lights the scene
    #[arg(long, value_name = "FILE")]
    pub environment: Option<PathBuf>,
    /// Refuse a scene file whose textures or material libraries are missing or broken, instead of warning and going on
    /// without them
    #[arg(long)]
    pub strict: bool,
}

/// Terrain from a picture of its heights, under a sun and a clear sky.
#[derive(Clone, Debug, Args)]
pub struct TerrainArgs {
    /// Instead of a scene: terrain from a grey picture of 8 or 16 bits, black at height 0, its top away from the viewer
    #[arg(long, value_name = "FILE", conflicts_with_all = ["scene", "scene_in_file"])]
    pub height_map: Option<PathBuf>,
    /// The terrain's extent along X and Z in metres [default: as the picture is shaped, the longer side 100]
    #[arg(long, value_name = "X,Z", requires = "height_map", allow_hyphen_values = true)]
    pub size_m: Option<GroundSize>,
    /// The height of white in metres [default: a tenth of the longer side]
    #[arg(long, value_name = "H", requires = "height_map", allow_negative_numbers = true, value_parser = terrain_metres)]
    pub height_m: Option<f32>,
    /// Vertices along each side of the terrain
    #[arg(long, value_name = "N", requires = "height_map", default_value_t = HeightMap::DEFAULT_VERTICES, allow_negative_numbers = true, value_parser = terrain_vertices)]
    pub vertices: usize,
}

/// Which moments of an animation are shown.
#[derive(Clone, Debug, Args)]
pub struct TimeArgs {
    /// The frames A, A+1, … B-1 of the animation, to numbered images
    #[arg(long, value_name = "A..B", conflicts_with = "time")]
    pub frames: Option<FrameRange>,
    /// Frames per second of the animation
    #[arg(long, value_name = "F", default_value_t = 30.0, allow_negative_numbers = true, value_parser = frames_per_second, requires = "frames", conflicts_with = "time")]
    pub fps: f64,
    /// The animation's moment at this many seconds
    #[arg(long, value_name = "SECONDS", default_value_t = 0.0, allow_negative_numbers = true, value_parser = seconds)]
    pub time: f64,
}

/// How it is rendered.
#[derive(Debug, Args)]
pub struct SettingsArgs {
    /// A preset to start from: its name, or a .ron file
    #[arg(long, value_name = "NAME|FILE")]
    pub preset: Option<String>,
    /// Change one setting (see `chiaro settings`); may be given many times, the last one counts
    #[arg(long = "set", value_name = "KEY=VALUE")]
    pub set: Vec<Setting>,
    /// What all random choices start from, those of virtual lights among them
    #[arg(long, value_name = "N", default_value_t = 0)]
    pub seed: u32,
    /// How surfaces meet light: the setting `pipeline` [default: what --set or the preset says]
    #[arg(long, value_parser = values_of("pipeline"))]
    pub pipeline: Option<String>,
}
