//! Single techniques for programs that keep their own geometry, pipelines and shaders: WGSL text to add to a shader, and
//! the bind group that it reads.

mod group;
mod traced;

use chiaro_gpu::shader::Alone;
use chiaro_gpu::{Buffer, Gpu, wgpu};
use chiaro_scene::Light;
use chiaro_techniques::frame::FIRST_LIGHT_BYTES;
use chiaro_techniques::scene::SceneFacts;
use chiaro_techniques::shaders::ShadowSource;
use chiaro_techniques::shadow::{
    CameraView, Fit, FitInputs, Layout, Lookup, PointLayout, Representation, ShadowOutputs, ShadowSettings,
    ShadowView, fit,
};
use chiaro_techniques::{light, shaders};
use glam::{Affine3A, Mat4, Vec2, Vec3};

use crate::{Error, View};

pub use traced::TracedShadows;

/// Shadow maps of any number of lights, drawn by the program and looked up by its shaders.
///
/// Each frame: [`Shadows::fit`], then one depth-only render pass for each of [`Shadows::maps`] with the program's own
/// geometry, then shading with [`Shadows::wgsl`] in the shader and [`Shadows::bind_group`] in its group.
#[derive(Debug)]
pub struct Shadows {
    gpu: Gpu,
    settings: ShadowSettings,
    text: Alone,
    layout: wgpu::BindGroupLayout,
    frame: Buffer,
    lighting: Buffer,
    outputs: ShadowOutputs,
    bind_group: wgpu::BindGroup,
    views: Vec<ShadowView>,
    notes: Vec<String>,
}

/// A shadow map to be drawn: all that casts shadows, in depth alone. Depth is reversed, so it is cleared to 0 and compared
/// with [`wgpu::CompareFunction::Greater`].
#[derive(Clone, Copy, Debug)]
pub struct ShadowMap<'a> {
    /// From world space to the map's clip space.
    pub clip_from_world: Mat4,
    /// Of [`Shadows::FORMAT`].
    pub depth: &'a wgpu::TextureView,
}

impl Shadows {
    /// Format of the maps.
    pub const FORMAT: wgpu::TextureFormat = wgpu::TextureFormat::Depth32Float;

    /// Links what shaders look shadows up with.
    ///
    /// # Errors
    /// When the settings do not go together, or want what the renderer alone can make: moments, tints, paraboloids, cascades that
    /// are fitted to the picture's depth. Rays are [`TracedShadows`].
    pub fn new(gpu: &Gpu, settings: ShadowSettings) -> Result<Self, Error> {
        let beyond = [
            ("representation = depth", settings.representation == Representation::Depth),
            ("transmission_tint = false", !settings.transmission_tint),
            ("point_layout = cube", settings.point_layout == PointLayout::Cube),
            ("fit = frustum", settings.fit == Fit::Frustum),
            ("layout = cascaded, single or none", settings.layout != Layout::Traced),
        ];
        if let Some((taken, _)) = beyond.into_iter().find(|(_, serves)| !serves) {
            return Err(Error::Combination(format!(
                "shadows drawn by a program of its own take shadow.{taken} only"
            )));
        }
        if let Some(reason) = settings.refused() {
            return Err(Error::Combination(reason));
        }
        let constants = Lookup::new(&settings).constants(gpu, SceneFacts::default());
        let text = shaders::library().alone(&shaders::shadow_alone(ShadowSource::DepthMaps), &constants)?;
        let layout = group::layout(gpu, &text);
        let (frame, lighting) = (group::frame(gpu), group::lighting(gpu, 1));
        let outputs = ShadowOutputs::new(gpu, 1, 1);
        let bind_group = bound(gpu, &layout, &text, (&frame, &lighting), &outputs);
        let gpu = gpu.clone();
        let (views, notes) = Default::default();
        Ok(Self { gpu, settings, text, layout, frame, lighting, outputs, bind_group, views, notes })
    }

    /// Fits maps to lights, with their poses in the world, and to a camera and the size of its picture. `bounds_ws` are
    /// corners of a box, in metres, that all that casts or receives shadows is in. Written to buffers by the queue: before
    /// what is submitted next.
    pub fn fit(
        &mut self,
        lights: &[(Light, Affine3A)],
        (view, size_px): (&View, [u32; 2]),
        bounds_ws: (Vec3, Vec3),
    ) {
        let clip_from_ws = view.clip_from_ws(size_px, Vec2::ZERO);
        let mut lights: Vec<_> = lights.iter().map(|(light, pose)| light::placed(light, pose)).collect();
        let camera = CameraView {
            eye_ws: view.eye_ws(),
            forward_ws: view.forward_ws(),
            ws_from_clip: clip_from_ws.inverse(),
        };
        let settings = &self.settings;
        let inputs =
            FitInputs { bounds_ws, casters: None, camera, settings, clamps_depth: false, see_through: false };
        let fitted = fit(&mut lights, &inputs);
        (self.views, self.notes) = (fitted.views, fitted.notes);

        let gpu = &self.gpu;
        let side = self.views.first().map_or(1, |view| view.resolution);
        let layers = (self.views.len() as u32).max(1);
        let has = self.outputs.maps.options();
        let fits = (has.width, has.layers) == (side, Some(layers));
        let bytes = FIRST_LIGHT_BYTES + size_of_val(lights.as_slice()) as u64;
        let holds = self.lighting.raw().size() >= bytes;
        if !holds {
            self.lighting = group::lighting(gpu, lights.len());
        }
        if !fits {
            self.outputs = ShadowOutputs::new(gpu, side, layers);
        }
        if !holds || !fits {
            self.bind_group =
                bound(gpu, &self.layout, &self.text, (&self.frame, &self.lighting), &self.outputs);
        }
        let data = group::frame_data(view, size_px, settings);
        let views: Vec<_> = self.views.iter().map(|view| view.data).collect();
        gpu.queue.write_buffer(self.frame.raw(), 0, bytemuck::bytes_of(&data));
        gpu.queue.write_buffer(self.lighting.raw(), 0, bytemuck::cast_slice(&views));
        gpu.queue.write_buffer(self.lighting.raw(), FIRST_LIGHT_BYTES, bytemuck::cast_slice(&lights));
    }

    /// The maps to be drawn for what was fitted last.
    pub fn maps(&self) -> impl Iterator<Item = ShadowMap<'_>> {
        let maps = &self.outputs.maps;
        (0..).zip(&self.views).map(|(layer, view)| ShadowMap {
            clip_from_world: view.clip_from_ws,
            depth: maps.layer_view(layer),
        })
    }

    /// WGSL for a fragment or compute shader whose group of this number is [`Shadows::bind_group`]. It has
    /// `chiaro_light_visibility(light: u32, position_ws: vec3f, normal_ws: vec3f, pixel: vec2f) -> vec3f`: how much of a
    /// light, by its number in what was fitted, arrives at a point whose triangle has this unit normal, by colour; `pixel` is
    /// the fragment's position.
    pub fn wgsl(&self, group: u32) -> String {
        self.text.wgsl(group)
    }

    /// For the program's pipeline layouts.
    pub fn layout(&self) -> &wgpu::BindGroupLayout {
        &self.layout
    }

    /// What the text binds; another one may follow from [`Shadows::fit`].
    pub fn bind_group(&self) -> &wgpu::BindGroup {
        &self.bind_group
    }

    /// Sentences about what was given up in the last fit, for the user.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }
}

fn bound(
    gpu: &Gpu,
    layout: &wgpu::BindGroupLayout,
    text: &Alone,
    (frame, lighting): (&Buffer, &Buffer),
    outputs: &ShadowOutputs,
) -> wgpu::BindGroup {
    let mut all = outputs.binds();
    all.extend([("frame", frame.into()), ("lighting", lighting.into())]);
    group::bound(gpu, layout, text, |name| all.iter().find(|(known, _)| *known == name).map(|(_, b)| *b))
}
