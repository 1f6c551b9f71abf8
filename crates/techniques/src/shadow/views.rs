//! Shadow views: what a light's maps look at, and what they are fitted to.

use bytemuck::{Pod, Zeroable};
use glam::{Mat4, Vec3, Vec4};

use super::{Casters, ShadowSettings};
use crate::frame::ShadowViewData;
use crate::view::Hole;

/// What the camera sees, for fitting suns' maps to it.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct CameraView {
    /// World position.
    pub eye_ws: Vec3,
    /// Unit, where it looks.
    pub forward_ws: Vec3,
    /// From unjittered reversed clip space to world space.
    pub ws_from_clip: Mat4,
}

/// A shadow view on the CPU.
#[derive(Clone, Debug, PartialEq)]
pub struct ShadowView {
    /// Reversed depth; of a paraboloid, to the light's axes.
    pub clip_from_ws: Mat4,
    /// The light's position with w = 1, or its direction with w = 0.
    pub eye_ws: Vec4,
    /// Texels a side.
    pub resolution: u32,
    /// What shaders read.
    pub data: ShadowViewData,
    /// What a finer cascade draws in its place.
    pub hole: Option<Hole>,
}

/// All views of a frame.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct ShadowViews {
    /// In the order of their layers.
    pub views: Vec<ShadowView>,
    /// Suns whose cascades are fitted on the GPU, and what to.
    pub fitted: Vec<SunFit>,
    /// Sentences about what was given up.
    pub notes: Vec<String>,
}

/// What views are fitted to.
#[derive(Clone, Copy, Debug)]
pub struct FitInputs<'a> {
    /// The scene, casters and receivers.
    pub bounds_ws: (Vec3, Vec3),
    /// What of it casts shadows, so that suns' maps reach no farther; `None`: anything may.
    pub casters: Option<&'a Casters>,
    /// Who looks.
    pub camera: CameraView,
    /// How.
    pub settings: &'a ShadowSettings,
    /// Whether casters before a map's near plane are drawn onto it.
    pub clamps_depth: bool,
    /// Whether something see-through may stand before what the depth buffer shows.
    pub see_through: bool,
}

/// A sun whose cascades are fitted on the GPU; see `fit.cs.wesl`.
#[repr(C)]
#[derive(Clone, Copy, Debug, PartialEq, Pod, Zeroable)]
#[allow(missing_docs)]
pub struct SunFit {
    pub light_from_ws: [[f32; 4]; 3],
    pub origins_ws: [[f32; 4]; 4],
    pub steps_ws: [[f32; 4]; 4],
    pub scene_ls: [f32; 4],
    pub begin_m: f32,
    pub end_m: f32,
    pub lambda: f32,
    pub least_near_m: f32,
    pub first_view: u32,
    pub count: u32,
    pub near_m: f32,
    pub far_m: f32,
    pub own_range: u32,
    pub holes: u32,
    pub blend: f32,
    pub reserved: u32,
}

impl SunFit {
    /// Whether a layer is one of this sun's.
    pub fn holds(&self, layer: u32) -> bool {
        (self.first_view..self.first_view + self.count).contains(&layer)
    }
}
