//! What one view of a scene keeps from frame to frame.

use chiaro_gpu::{Buffer, Gpu, Group, GroupLayout, History, Texture};
use chiaro_techniques::caustics::photon_trace::PhotonRoom;
use chiaro_techniques::direct::LightRoom;
use chiaro_techniques::frame::FrameGroup;
use chiaro_techniques::indirect::SkyView;
use chiaro_techniques::post::AntialiasRoom;
use chiaro_techniques::shadow::ShadowRoom;
use chiaro_techniques::specular::SpecularRoom;
use chiaro_techniques::transparency::LayerRoom;
use chiaro_techniques::view::culling::ListRoom;
use chiaro_techniques::view::{MotionRoom, SurfaceRoom, ViewTable};
use glam::DVec3;

use crate::indirect::IndirectRooms;
use crate::moving::SeenHistory;

/// Textures, buffers and histories of one view: a window, a still, a mirror. A program that renders several views of its
/// scenes, in one frame or in turn, has one of these for each, and one [`Renderer`](crate::Renderer) for all.
#[derive(Debug)]
pub struct ViewState {
    pub(crate) frame_group: FrameGroup,
    pub(crate) rooms: Rooms,
    pub(crate) history: Histories,
    pub(crate) notes: Vec<String>,
    pub(crate) wants_parts: bool,
    pub(crate) wants_pictures: bool,
}

/// What passes write into, made when sizes or passes change.
#[derive(Debug)]
pub(crate) struct Rooms {
    pub views: ViewTable,
    pub lists: Option<ListRoom>,
    pub surface: Option<SurfaceRoom>,
    pub shadow: Option<ShadowRoom>,
    pub light: Option<LightRoom>,
    pub layers: Option<LayerRoom>,
    pub motion: Option<MotionRoom>,
    // Of what is opaque, where see-through surfaces stand before it and indirect light is averaged.
    pub opaque_motion: Option<MotionRoom>,
    pub antialias: Option<AntialiasRoom>,
    pub indirect: IndirectRooms,
    pub photons: Option<PhotonRoom>,
    pub specular: Option<SpecularRoom>,
}

/// What frames leave for the next.
#[derive(Debug, Default)]
pub(crate) struct Histories {
    /// How much of the sky is seen, by scene and by where the eye is.
    pub sky: History<(u64, DVec3), SkyView>,
    /// What the last frame of a moving picture showed.
    pub seen: SeenHistory,
}

impl ViewState {
    pub(crate) fn without_room(gpu: &Gpu, frame_layout: &GroupLayout, albedo_table: &Texture) -> Self {
        Self {
            frame_group: FrameGroup::new(gpu, frame_layout, albedo_table),
            rooms: Rooms {
                views: ViewTable::new(gpu),
                lists: None,
                surface: None,
                shadow: None,
                light: None,
                layers: None,
                motion: None,
                opaque_motion: None,
                antialias: None,
                indirect: IndirectRooms::default(),
                photons: None,
                specular: None,
            },
            history: Histories::default(),
            notes: Vec::new(),
            wants_parts: false,
            wants_pictures: false,
        }
    }

    /// Whether frames prepared from now on leave their light taken apart, too, as
    /// [`FrameOutputs::parts`](crate::FrameOutputs::parts): each is shaded once more for it.
    pub fn take_apart(&mut self, wanted: bool) {
        self.wants_parts = wanted;
    }

    /// Whether frames prepared from now on leave pictures of what is not shaped like one, too: points, virtual lights, their
    /// reflective and their imperfect shadow maps.
    pub fn show_maps(&mut self, wanted: bool) {
        self.wants_pictures = wanted;
    }

    /// Group 0, for passes of one's own.
    pub fn frame_group(&self) -> &Group {
        self.frame_group.group()
    }

    /// Sentences about what the last [`Renderer::prepare`](crate::Renderer::prepare) gave up, for the user.
    pub fn notes(&self) -> &[String] {
        &self.notes
    }

    /// Lights and shadow views as shaders read them; see [`FrameGroup::lighting`].
    pub fn lighting(&self) -> &Buffer {
        &self.frame_group.lighting
    }

    /// Forgets what frames leave for the next: after a cut. Cameras and things that jump, new scenes, sizes and settings are
    /// noticed without it.
    pub fn cut(&mut self) {
        self.history = Histories::default();
    }
}
