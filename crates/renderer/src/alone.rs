//! Single techniques for programs that keep their own geometry, pipelines and shaders. Shadows are WGSL text to add to a shader,
//! and the bind group that it reads; indirect light is a texture, made of depth, normals and albedo.

mod group;
mod indirect;
mod traced;

use std::ops::Deref;

use chiaro_gpu::{Binding, Gpu, wgpu};
use chiaro_scene::Light;
use chiaro_techniques::scene::SceneFacts;
use chiaro_techniques::shaders;
use chiaro_techniques::shaders::ShadowSource;
use chiaro_techniques::shadow::{
    CameraView, Fit, FitInputs, Layout, Lookup, PointLayout, Representation, ShadowOutputs, ShadowSettings,
    ShadowView, fit,
};
use glam::{Affine3A, Mat4, Vec2, Vec3};

use crate::{Error, View};

pub use group::Snippet;
pub use indirect::{DrawnSurfaces, IndirectLight};
pub use traced::TracedShadows;

/// Shadow maps of any number of lights, drawn by the program and looked up by its shaders.
///
/// Each frame: [`Shadows::fit`], then one depth-only render pass for each of [`Shadows::maps`] with the program's own
/// geometry, then shading with [`Snippet::wgsl`] in the shader and [`Snippet::bind_group`] in its group.
#[derive(Debug)]
pub struct Shadows {
    snippet: Snippet,
    outputs: ShadowOutputs,
    views: Vec<ShadowView>,
    notes: Vec<String>,
}

impl Deref for Shadows {
    type Target = Snippet;

    fn deref(&self) -> &Snippet {
        &self.snippet
    }
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
        let outputs = ShadowOutputs::new(gpu, 1, 1);
        let snippet = Snippet::new(gpu, settings, text, named(&outputs));
        Ok(Self { snippet, outputs, views: Vec::new(), notes: Vec::new() })
    }

    /// Fits maps to lights, with their poses in the world, and to a camera and the size of its picture. `bounds_ws` are
    /// corners of a box, in metres, that all that casts or receives shadows is in. Written to buffers by the queue: before
    /// what is submitted next.
    ///
    /// # Errors
    /// When the picture has no pixels, or the view, a light's pose or the bounds are not finite. What was fitted last then
    /// stays.
    pub fn fit(
        &mut self,
        lights: &[(Light, Affine3A)],
        (view, size_px): (&View, [u32; 2]),
        bounds_ws: (Vec3, Vec3),
    ) -> Result<(), Error> {
        let mut lights = group::placed(&self.gpu, lights, (view, size_px))?;
        if !(bounds_ws.0.is_finite() && bounds_ws.1.is_finite() && bounds_ws.0.cmple(bounds_ws.1).all()) {
            let problem = "are not the smallest and the largest corner of a box";
            return Err(Error::Unfit { what: "the bounds".into(), problem });
        }
        let clip_from_ws = view.clip_from_ws(size_px, Vec2::ZERO);
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

        let side = self.views.first().map_or(1, |view| view.resolution);
        let layers = (self.views.len() as u32).max(1);
        let has = self.outputs.maps.options();
        let fits = (has.width, has.layers) == (side, Some(layers));
        if !fits {
            self.outputs = ShadowOutputs::new(&self.gpu, side, layers);
        }
        let views: Vec<_> = self.views.iter().map(|view| view.data).collect();
        let holds = self.snippet.write(&lights, &views, (view, size_px));
        if !holds || !fits {
            self.snippet.rebind(named(&self.outputs));
        }
        Ok(())
    }

    /// The maps to be drawn for what was fitted last.
    pub fn maps(&self) -> impl Iterator<Item = ShadowMap<'_>> {
        let maps = &self.outputs.maps;
        (0..).zip(&self.views).map(|(layer, view)| ShadowMap {
            clip_from_world: view.clip_from_ws,
            depth: maps.layer_view(layer),
        })
    }

    /// Sentences about what was given up in the last fit, for the user.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }
}

/// What the text reads of maps.
fn named<'a>(outputs: &'a ShadowOutputs) -> impl Fn(&str) -> Option<Binding<'a>> {
    let all = outputs.binds();
    move |name| all.iter().find(|(known, _)| *known == name).map(|(_, binding)| *binding)
}
