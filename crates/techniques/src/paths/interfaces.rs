//! What of a scene mirrors, or lets light through.

use chiaro_scene as cs;
use glam::Vec3;

/// Which materials of a scene mirror exactly or refract without blur; found once, for their textures are looked through.
#[derive(Clone, Debug)]
pub struct Specular(Vec<bool>);

impl Specular {
    /// Looks at a scene's materials.
    pub fn of(scene: &cs::Scene) -> Self {
        Self(scene.materials.iter().map(|material| scene.is_specular(material)).collect())
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
