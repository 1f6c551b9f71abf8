//! Shadows by rays, looked up by the program's shaders.

use std::ops::Deref;

use chiaro_gpu::{Binding, Gpu};
use chiaro_scene::{Light, Pose, Scene};
use chiaro_techniques::scene::SceneGpu;
use chiaro_techniques::shaders;
use chiaro_techniques::shaders::ShadowSource;
use chiaro_techniques::shadow::{Layout, Lookup, ShadowSettings};
use glam::Affine3A;

use super::group::{self, Snippet};
use crate::{Error, Trees, View};

/// Shadows of any number of lights by rays through triangles that the program hands over once; no maps are drawn.
///
/// Each frame: [`TracedShadows::set`], then shading with [`Snippet::wgsl`] in the shader and [`Snippet::bind_group`]
/// in its group, on any depth and normals that the program has.
#[derive(Debug)]
pub struct TracedShadows {
    snippet: Snippet,
    scene: SceneGpu,
    trees: Trees,
}

impl Deref for TracedShadows {
    type Target = Snippet;

    fn deref(&self) -> &Snippet {
        &self.snippet
    }
}

impl TracedShadows {
    /// Uploads what casts shadows, builds its trees (about 4 µs a triangle) and links what shaders shoot rays with. Of the
    /// scene its meshes, nodes and the masks and transmission of its materials count. Of the settings `rays`, `light_size`,
    /// `transmission_tint`, `floor` and `darkens` do.
    ///
    /// # Errors
    /// When the scene is unsound, does not fit the adapter, or the text does not link.
    pub fn new(gpu: &Gpu, settings: ShadowSettings, scene: &Scene) -> Result<Self, Error> {
        scene.validate()?;
        let settings = ShadowSettings { layout: Layout::Traced, ..settings };
        let pose = scene.pose(0.0);
        let uploaded = SceneGpu::upload(gpu, &SceneGpu::layout(gpu), scene)?;
        let trees = Trees::build(gpu, scene, &pose, &[])?;
        let constants = Lookup::new(&settings).constants(gpu, trees.facts(uploaded.facts));
        let text = shaders::library().alone(&shaders::shadow_alone(ShadowSource::Rays), &constants)?;
        let snippet = Snippet::new(gpu, settings, text, named(&uploaded, &trees));
        Ok(Self { snippet, scene: uploaded, trees })
    }

    /// Takes lights, with their poses in the world, and a camera and the size of its picture. Written to buffers by the queue:
    /// before what is submitted next.
    ///
    /// # Errors
    /// When the picture has no pixels, or the view or a light's pose are not finite. What was set last then stays.
    pub fn set(
        &mut self,
        lights: &[(Light, Affine3A)],
        (view, size_px): (&View, [u32; 2]),
    ) -> Result<(), Error> {
        let lights = group::placed(&self.gpu, lights, (view, size_px))?;
        if !self.snippet.write(&lights, &[], (view, size_px)) {
            self.rebind();
        }
        Ok(())
    }

    /// Moves nodes of the scene that this was made from. What no animation moves makes the trees be built anew, at once; what
    /// bends keeps its shape.
    ///
    /// # Errors
    /// When the scene is another, [`Scene::validate_pose`] refuses the pose, or trees had to be built anew and do not fit the
    /// adapter.
    pub fn set_pose(&mut self, scene: &Scene, pose: &Pose) -> Result<(), Error> {
        self.trees.check(scene)?;
        scene.validate_pose(pose)?;
        self.trees.update(scene, pose)?;
        self.rebind();
        Ok(())
    }

    fn rebind(&mut self) {
        self.snippet.rebind(named(&self.scene, &self.trees));
    }
}

/// What the text reads of a scene and its trees.
fn named<'a>(scene: &'a SceneGpu, trees: &'a Trees) -> impl Fn(&str) -> Option<Binding<'a>> {
    move |name| match name {
        "tracer" => Some((&trees.traced.words).into()),
        _ => scene.binding(name),
    }
}
