//! Shadows by rays, looked up by the program's shaders.

use chiaro_gpu::shader::Alone;
use chiaro_gpu::{Buffer, Gpu, wgpu};
use chiaro_scene::{Light, Pose, Scene};
use chiaro_techniques::frame::FIRST_LIGHT_BYTES;
use chiaro_techniques::scene::SceneGpu;
use chiaro_techniques::shaders::ShadowSource;
use chiaro_techniques::shadow::{Layout, Lookup, ShadowSettings};
use chiaro_techniques::{light, shaders};
use glam::Affine3A;

use super::group;
use crate::{Error, Trees, View};

/// Shadows of any number of lights by rays through triangles that the program hands over once; no maps are drawn.
///
/// Each frame: [`TracedShadows::set`], then shading with [`TracedShadows::wgsl`] in the shader and
/// [`TracedShadows::bind_group`] in its group, on any depth and normals that the program has.
#[derive(Debug)]
pub struct TracedShadows {
    gpu: Gpu,
    settings: ShadowSettings,
    text: Alone,
    layout: wgpu::BindGroupLayout,
    frame: Buffer,
    lighting: Buffer,
    scene: SceneGpu,
    trees: Trees,
    bind_group: wgpu::BindGroup,
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
        let layout = group::layout(gpu, &text);
        let (frame, lighting) = (group::frame(gpu), group::lighting(gpu, 1));
        let bind_group = bound(gpu, &layout, &text, (&frame, &lighting), (&uploaded, &trees));
        let (gpu, scene) = (gpu.clone(), uploaded);
        Ok(Self { gpu, settings, text, layout, frame, lighting, scene, trees, bind_group })
    }

    /// Takes lights, with their poses in the world, and a camera and the size of its picture. Written to buffers by the queue:
    /// before what is submitted next.
    pub fn set(&mut self, lights: &[(Light, Affine3A)], (view, size_px): (&View, [u32; 2])) {
        let lights: Vec<_> = lights.iter().map(|(light, pose)| light::placed(light, pose)).collect();
        let gpu = &self.gpu;
        let bytes = FIRST_LIGHT_BYTES + size_of_val(lights.as_slice()) as u64;
        if self.lighting.raw().size() < bytes {
            self.lighting = group::lighting(gpu, lights.len());
            self.rebind();
        }
        let data = group::frame_data(view, size_px, &self.settings);
        let gpu = &self.gpu;
        gpu.queue.write_buffer(self.frame.raw(), 0, bytemuck::bytes_of(&data));
        gpu.queue.write_buffer(self.lighting.raw(), FIRST_LIGHT_BYTES, bytemuck::cast_slice(&lights));
    }

    /// Moves nodes of the scene that this was made from. What no animation moves makes the trees be built anew, at once; what
    /// bends keeps its shape.
    ///
    /// # Errors
    /// When trees had to be built anew and do not fit the adapter.
    pub fn set_pose(&mut self, scene: &Scene, pose: &Pose) -> Result<(), Error> {
        self.trees.update(scene, pose)?;
        self.rebind();
        Ok(())
    }

    /// WGSL for a fragment or compute shader whose group of this number is [`TracedShadows::bind_group`]. It has
    /// `chiaro_light_visibility` as [`super::Shadows::wgsl`] says.
    pub fn wgsl(&self, group: u32) -> String {
        self.text.wgsl(group)
    }

    /// For the program's pipeline layouts.
    pub fn layout(&self) -> &wgpu::BindGroupLayout {
        &self.layout
    }

    /// What the text binds; another one may follow from [`TracedShadows::set`] and [`TracedShadows::set_pose`].
    pub fn bind_group(&self) -> &wgpu::BindGroup {
        &self.bind_group
    }

    fn rebind(&mut self) {
        let buffers = (&self.frame, &self.lighting);
        self.bind_group = bound(&self.gpu, &self.layout, &self.text, buffers, (&self.scene, &self.trees));
    }
}

fn bound(
    gpu: &Gpu,
    layout: &wgpu::BindGroupLayout,
    text: &Alone,
    (frame, lighting): (&Buffer, &Buffer),
    (scene, trees): (&SceneGpu, &Trees),
) -> wgpu::BindGroup {
    group::bound(gpu, layout, text, |name| match name {
        "frame" => Some(frame.into()),
        "lighting" => Some(lighting.into()),
        "tracer" => Some((&trees.traced.words).into()),
        _ => scene.binding(name),
    })
}
