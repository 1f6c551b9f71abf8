//! What of a scene mirrors, or lets light through.

use chiaro_scene as cs;
use glam::Vec3;

/// Twin of `SMOOTH` in `bsdf.wesl`.
const SMOOTH: f32 = 0.01;

/// Which materials of a scene mirror exactly or refract without blur; found once, for their textures are looked through.
#[derive(Clone, Debug)]
pub struct Specular(Vec<bool>);

impl Specular {
    /// Looks at a scene's materials.
    pub fn of(scene: &cs::Scene) -> Self {
        Self(scene.materials.iter().map(|material| is_specular(scene, material)).collect())
    }

    /// Whether a material, told by its index, does.
    pub fn is(&self, material: usize) -> bool {
        self.0[material]
    }

    /// Whether any does.
    pub fn any(&self) -> bool {
        self.0.contains(&true)
    }

    /// World-space bounds of what is made of them, m.
    pub fn bounds_ws(&self, scene: &cs::Scene, pose: &cs::Pose) -> Option<(Vec3, Vec3)> {
        scene.bounds_of(pose, |material| self.0[material])
    }
}

/// Whether a material mirrors exactly or lets light through without blur somewhere.
fn is_specular(scene: &cs::Scene, material: &cs::Material) -> bool {
    let reflects = material.metallic > 0.0 || material.specular > 0.0 || material.transmission > 0.0;
    if material.reflection != cs::Reflection::MetallicRoughness || !reflects {
        return false;
    }
    // The smoothest texel decides.
    let texture = material.metallic_roughness_texture.as_ref();
    let least = texture.map_or(1.0, |reference| {
        let image = &scene.images[scene.textures[reference.texture].image];
        f32::from(image.rgba.chunks_exact(4).map(|texel| texel[1]).min().unwrap_or(255)) / 255.0
    });
    material.roughness * least < SMOOTH
}

/// Whether any surface of a scene mirrors or lets light through, so that shaders are compiled without what does.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub struct Interfaces(bool);

impl Interfaces {
    /// Looks at a scene's materials.
    pub fn of(scene: &cs::Scene, specular: &Specular) -> Self {
        Self(specular.any() || scene.materials.iter().any(|m| m.transmission > 0.0))
    }

    pub(crate) fn constant(self) -> (&'static str, f64) {
        ("INTERFACES", f64::from(u8::from(self.0)))
    }
}
