//! A scene ready to be rendered.

use chiaro_scene::{Pose, Scene};
use chiaro_techniques::direct::{illuminance_scale, light_data};
use chiaro_techniques::indirect::Openness;
use chiaro_techniques::shared::frame::LightData;
use chiaro_techniques::surface::SceneGpu;

/// A scene on the GPU with its lights.
#[derive(Debug)]
pub struct LoadedScene {
    /// Geometry, materials, textures.
    pub gpu: SceneGpu,
    /// Directional lights first.
    pub lights: Vec<LightData>,
    /// How many of them are directional.
    pub directional: usize,
    /// Stored radiance per nit, a power of two.
    pub radiance_scale: f32,
    /// How much of the sky a place sees.
    pub openness: Openness,
}

/// Stored radiance of a white surface under the brightest light. Half floats reach 65,504 above and 2⁻²⁴ below: eight
/// octaves for highlights and glowing things, over thirty for the dark.
const WHITE_STORED: f32 = 256.0;

impl LoadedScene {
    pub(crate) fn new(gpu: SceneGpu, scene: &Scene) -> Self {
        let (lights, directional) = light_data(scene, &scene.pose(0.0));
        let radiance = illuminance_scale(&lights, gpu.bounds_ws) / std::f32::consts::PI;
        let glow = scene.materials.iter().map(|m| m.emissive.max_element()).fold(0.0, f32::max);
        // Without any light 1 nit is as good as anything.
        let brightest = if radiance.max(glow) > 0.0 { radiance.max(glow) } else { WHITE_STORED };
        let octave = (WHITE_STORED / brightest).log2().round().clamp(-60.0, 60.0);
        Self { gpu, lights, directional, radiance_scale: octave.exp2(), openness: Openness::new(scene) }
    }

    /// Moves everything to a pose of the scene that this was loaded from, usually [`Scene::pose`] at a time. The next
    /// frame shows it, and knows where everything was before. A loaded scene starts with the pose at time 0.
    pub fn set_pose(&mut self, scene: &Scene, pose: &Pose) {
        self.gpu.set_pose(scene, pose);
        (self.lights, self.directional) = light_data(scene, pose);
    }
}
