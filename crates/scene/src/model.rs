//! The scene's data model.
//!
//! Invariants that import and built-in scenes guarantee and everything downstream relies on ([`Scene::validate`] checks
//! those that must hold):
//! every index is in range, every float is finite, every primitive has at least one triangle, its streams have
//! equal lengths (or are empty where optional), normals are unit length, and the node graph is a forest. Keyframe
//! times ascend, and every channel has as many values as its interpolation needs.

use glam::{Affine3A, DVec3, Mat4, Quat, Vec2, Vec3, Vec4};

/// Index into one of [`Scene`]'s tables.
pub type Id = usize;

/// Everything that is lit, and by what.
#[derive(Clone, Debug, Default)]
pub struct Scene {
    /// Name for people: the file's stem or the built-in's name.
    pub name: String,
    /// Where the scene's origin is in the file's coordinates, metres: positions there are positions here plus this.
    /// Zero unless the file's were too far from its own origin for 32 bits.
    pub origin_m: DVec3,
    /// Meshes, shared by nodes.
    pub meshes: Vec<Mesh>,
    /// Materials, shared by primitives. Never empty when there is a primitive.
    pub materials: Vec<Material>,
    /// Textures: an image and how it is sampled.
    pub textures: Vec<Texture>,
    /// Decoded pixels.
    pub images: Vec<ImageData>,
    /// Where world space counts from, in the scene's coordinates (the file's less [`Scene::origin_m`]), metres; zero unless
    /// what is seen is far from their origin, see [`Scene::settle`]. Poses, bounds, views and all that is computed from them count from here.
    pub origin: DVec3,
    /// Nodes in topological order: a parent stands before its children.
    pub nodes: Vec<Node>,
    /// Cameras; each is placed by the node that refers to it.
    pub cameras: Vec<Camera>,
    /// Lights; each is placed by the node that refers to it.
    pub lights: Vec<Light>,
    /// Skins; a node that draws a mesh refers to one.
    pub skins: Vec<Skin>,
    /// What moves, and how.
    pub animations: Vec<Animation>,
    /// What surrounds everything.
    pub environment: Option<Environment>,
    /// Names of all scenes in the file, of which this is one; an unnamed one's is empty. Empty where a file holds one
    /// scene by its nature.
    pub scene_names: Vec<String>,
    /// What was read but simplified or left out, in words for the user.
    pub warnings: Vec<String>,
}

/// A place in the hierarchy and what stands there.
#[derive(Clone, Debug, Default)]
pub struct Node {
    /// Name from the file, possibly empty, not necessarily unique.
    pub name: String,
    /// The parent's index, always smaller than this node's own.
    pub parent: Option<Id>,
    /// Pose relative to the parent.
    pub parent_from_node: Transform,
    /// Added to the pose's translation, metres, relative to the parent: what of a far place `f32` cannot hold.
    pub offset: DVec3,
    /// Mesh drawn here. With a skin, the joints place it and this node's own pose counts for nothing.
    pub mesh: Option<Id>,
    /// Skin that bends the mesh; only together with one whose primitives all have [`Primitive::joints`].
    pub skin: Option<Id>,
    /// Weights of the mesh's morph targets at rest; empty = those of the mesh.
    pub morph_weights: Vec<f32>,
    /// Camera placed here, looking along −Z with +Y up.
    pub camera: Option<Id>,
    /// Light placed here, shining along −Z.
    pub light: Option<Id>,
}

/// A pose: decomposed so that it can be animated, or a matrix where the file gave one.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Transform {
    /// Scale, then rotation, then translation (metres).
    Trs {
        /// Metres.
        translation: Vec3,
        /// Unit quaternion.
        rotation: glam::Quat,
        /// Factor per axis; negative mirrors.
        scale: Vec3,
    },
    /// Any affine matrix.
    Matrix(Affine3A),
}

impl Default for Transform {
    fn default() -> Self {
        Self::Trs { translation: Vec3::ZERO, rotation: glam::Quat::IDENTITY, scale: Vec3::ONE }
    }
}

impl Transform {
    /// The pose as an affine map from the node's space to its parent's.
    pub fn affine(&self) -> Affine3A {
        match *self {
            Self::Trs { translation, rotation, scale } => {
                Affine3A::from_scale_rotation_translation(scale, rotation, translation)
            }
            Self::Matrix(matrix) => matrix,
        }
    }
}

/// A named set of primitives.
#[derive(Clone, Debug, Default)]
pub struct Mesh {
    /// Name from the file.
    pub name: String,
    /// One per material. All have the same number of morph targets.
    pub primitives: Vec<Primitive>,
    /// Weights of the morph targets at rest, as many as there are targets.
    pub morph_weights: Vec<f32>,
}

impl Mesh {
    /// How many morph targets every primitive has.
    pub fn morph_targets(&self) -> usize {
        self.primitives.first().map_or(0, |primitive| primitive.morph_targets.len())
    }
}

/// Triangles with one material. Counter-clockwise seen from the front.
#[derive(Clone, Debug, Default)]
pub struct Primitive {
    /// Object space, metres.
    pub positions: Vec<Vec3>,
    /// Unit vectors, object space; as many as positions.
    pub normals: Vec<Vec3>,
    /// The normals are those of the triangles, of which each has vertices of its own, in whatever shape they are bent to
    /// (glTF 2.0, section 3.7.2.2). For what has joints or morph targets but no normals in its file.
    pub flat: bool,
    /// MikkTSpace tangents: xyz unit, w = ±1 the bitangent's sign (`bitangent = w · normal × tangent`).
    /// Empty where the material has no normal map.
    pub tangents: Vec<Vec4>,
    /// Texture coordinates by set, origin at the image's top left. A set is empty or as long as positions.
    pub uvs: [Vec<Vec2>; 2],
    /// Linear RGBA factor on the base colour; empty means white.
    pub colors: Vec<Vec4>,
    /// Indices into [`Skin::joints`], four per vertex; empty without a skin.
    pub joints: Vec<[u16; 4]>,
    /// Share of each of the four joints, ≥ 0 with sum 1; as many as [`Self::joints`].
    pub joint_weights: Vec<Vec4>,
    /// Shapes to mix in.
    pub morph_targets: Vec<MorphTarget>,
    /// Three per triangle, each below `positions.len()`.
    pub indices: Vec<u32>,
    /// Index into [`Scene::materials`].
    pub material: Id,
}

/// Differences from a primitive's own vertices, added in proportion to the target's weight before skinning.
/// Each stream is as long as the positions, or empty for no difference.
#[derive(Clone, Debug, Default)]
pub struct MorphTarget {
    /// Object space, metres.
    pub positions: Vec<Vec3>,
    /// Object space; the sum is normalised.
    pub normals: Vec<Vec3>,
    /// Object space; the sum is normalised, the bitangent's sign stays.
    pub tangents: Vec<Vec3>,
}

/// The bones that bend a mesh.
#[derive(Clone, Debug, Default)]
pub struct Skin {
    /// Name from the file.
    pub name: String,
    /// Nodes that act as joints.
    pub joints: Vec<Id>,
    /// From the mesh's object space to each joint's own space, in the pose that the mesh was modelled in.
    pub joint_from_object: Vec<Affine3A>,
}

/// Keyframes that play together, from time 0 to the last key.
#[derive(Clone, Debug, Default)]
pub struct Animation {
    /// Name from the file.
    pub name: String,
    /// One per animated property of a node.
    pub channels: Vec<Channel>,
}

impl Animation {
    /// Time of the last key, seconds.
    pub fn duration_s(&self) -> f32 {
        self.channels.iter().filter_map(|channel| channel.times_s.last()).fold(0.0, |a, &b| a.max(b))
    }
}

/// One property of one node over time.
#[derive(Clone, Debug)]
pub struct Channel {
    /// Which node moves.
    pub node: Id,
    /// Strictly ascending, ≥ 0, at least one.
    pub times_s: Vec<f32>,
    /// Between the keys.
    pub interpolation: Interpolation,
    /// At the keys.
    pub keys: Keys,
}

/// What is between two keys.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Interpolation {
    /// The earlier key's value.
    Step,
    /// A straight line; for rotations the shorter arc at even speed.
    #[default]
    Linear,
    /// A cubic Hermite spline: every key has an in-tangent, a value and an out-tangent (per second), in that order.
    Cubic,
}

/// Values at the keys: one per key, or three where the interpolation is cubic.
#[derive(Clone, Debug, PartialEq)]
pub enum Keys {
    /// Metres, relative to the parent.
    Translation(Vec<Vec3>),
    /// Unit quaternions (tangents of any length).
    Rotation(Vec<Quat>),
    /// Factor per axis.
    Scale(Vec<Vec3>),
    /// As many in a row per value as the node's mesh has morph targets.
    MorphWeights(Vec<f32>),
}

/// Radiance from infinitely far, by direction: a latitude-longitude picture.
#[derive(Clone, PartialEq)]
pub struct Environment {
    /// Name for messages.
    pub name: String,
    /// Pixels around, ≥ 1.
    pub width: u32,
    /// Pixels from straight up (first row) to straight down, ≥ 1.
    pub height: u32,
    /// Nits, linear Rec. 709, finite and ≥ 0, row by row. A direction d is at u = atan2(d.x, −d.z) / 2π (modulo 1),
    /// v = acos(d.y) / π: the middle column looks along +Z, and u grows as the eye turns right.
    pub radiance: Vec<Vec3>,
}

impl std::fmt::Debug for Environment {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "Environment({} {}×{})", self.name, self.width, self.height)
    }
}

/// How a surface's alpha is used.
#[derive(Clone, Copy, Debug, PartialEq, Default)]
pub enum AlphaMode {
    /// Alpha is ignored.
    #[default]
    Opaque,
    /// Present where alpha ≥ the cut-off.
    Mask {
        /// 0..1.
        cutoff: f32,
    },
    /// Mixed over what lies behind.
    Blend,
}

/// Which reflection model a material was written for.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Reflection {
    /// glTF metallic-roughness: GGX over Lambert.
    MetallicRoughness,
    /// OBJ/MTL: Lambert plus a normalised Phong lobe (n+2)/(2π)·cosⁿ with [`Material::specular_color`] as its weight.
    Phong {
        /// The lobe's exponent n, ≥ 0.
        exponent: f32,
    },
    /// Shows its base colour whatever the light and the exposure: 1 is the display's white (KHR_materials_unlit).
    Unlit,
}

/// How a surface reflects. Names follow glTF 2.0 and its KHR_materials extensions.
#[derive(Clone, Debug, PartialEq)]
pub struct Material {
    /// Name from the file.
    pub name: String,
    /// Reflection model.
    pub reflection: Reflection,
    /// Linear RGBA; multiplies the texture.
    pub base_color: Vec4,
    /// sRGB texture, alpha linear.
    pub base_color_texture: Option<TextureRef>,
    /// 0..1.
    pub metallic: f32,
    /// Perceptual roughness, 0..1 (GGX α = roughness²).
    pub roughness: f32,
    /// G = roughness, B = metallic, linear.
    pub metallic_roughness_texture: Option<TextureRef>,
    /// Dielectric reflectance factor (KHR_materials_specular), 0..1: scales F0 and F90.
    pub specular: f32,
    /// Linear RGB factor of the dielectric F0; of the Phong lobe for [`Reflection::Phong`].
    pub specular_color: Vec3,
    /// Alpha = [`Self::specular`]'s factor, linear.
    pub specular_texture: Option<TextureRef>,
    /// RGB = [`Self::specular_color`]'s factor, sRGB.
    pub specular_color_texture: Option<TextureRef>,
    /// Tangent-space normals, linear.
    pub normal_texture: Option<TextureRef>,
    /// Factor of the normal map's x and y.
    pub normal_scale: f32,
    /// R = share of indirect light that arrives, linear.
    pub occlusion_texture: Option<TextureRef>,
    /// 0 = occlusion ignored, 1 = in full.
    pub occlusion_strength: f32,
    /// Radiance in nits: emissive factor × emissive strength.
    pub emissive: Vec3,
    /// sRGB factor of [`Self::emissive`].
    pub emissive_texture: Option<TextureRef>,
    /// Use of alpha.
    pub alpha: AlphaMode,
    /// Lit and drawn from behind too; the normal turns towards the viewer.
    pub double_sided: bool,
    /// Share of light that passes through the surface (KHR_materials_transmission).
    pub transmission: f32,
    /// R = [`Self::transmission`]'s factor, linear.
    pub transmission_texture: Option<TextureRef>,
    /// Index of refraction (KHR_materials_ior).
    pub ior: f32,
    /// Thickness in metres of a thin object (KHR_materials_volume); 0 = an infinitely thin sheet.
    pub thickness: f32,
    /// G = [`Self::thickness`]'s factor, linear.
    pub thickness_texture: Option<TextureRef>,
    /// Linear RGB that is left of white light after [`Self::attenuation_distance`].
    pub attenuation_color: Vec3,
    /// Metres; infinite = clear.
    pub attenuation_distance: f32,
    /// KHR_materials_dispersion: 20 / Abbe number; 0 = none.
    pub dispersion: f32,
}

impl Default for Material {
    fn default() -> Self {
        Self {
            name: String::new(),
            reflection: Reflection::MetallicRoughness,
            base_color: Vec4::ONE,
            base_color_texture: None,
            metallic: 0.0,
            roughness: 1.0,
            metallic_roughness_texture: None,
            specular: 1.0,
            specular_color: Vec3::ONE,
            specular_texture: None,
            specular_color_texture: None,
            normal_texture: None,
            normal_scale: 1.0,
            occlusion_texture: None,
            occlusion_strength: 1.0,
            emissive: Vec3::ZERO,
            emissive_texture: None,
            alpha: AlphaMode::Opaque,
            double_sided: false,
            transmission: 0.0,
            transmission_texture: None,
            ior: 1.5,
            thickness: 0.0,
            thickness_texture: None,
            attenuation_color: Vec3::ONE,
            attenuation_distance: f32::INFINITY,
            dispersion: 0.0,
        }
    }
}

impl Material {
    /// Every texture that the material uses.
    pub fn texture_refs(&self) -> impl Iterator<Item = &TextureRef> {
        [
            &self.base_color_texture,
            &self.metallic_roughness_texture,
            &self.specular_texture,
            &self.specular_color_texture,
            &self.normal_texture,
            &self.occlusion_texture,
            &self.emissive_texture,
            &self.transmission_texture,
            &self.thickness_texture,
        ]
        .into_iter()
        .flatten()
    }

    pub(crate) fn texture_refs_mut(&mut self) -> impl Iterator<Item = &mut TextureRef> {
        [
            &mut self.base_color_texture,
            &mut self.metallic_roughness_texture,
            &mut self.specular_texture,
            &mut self.specular_color_texture,
            &mut self.normal_texture,
            &mut self.occlusion_texture,
            &mut self.emissive_texture,
            &mut self.transmission_texture,
            &mut self.thickness_texture,
        ]
        .into_iter()
        .flatten()
    }
}

/// A material's use of a texture.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct TextureRef {
    /// Index into [`Scene::textures`].
    pub texture: Id,
    /// Which set of [`Primitive::uvs`].
    pub uv_set: usize,
    /// KHR_texture_transform as a 2×3 matrix: `uv' = matrix · (u, v, 1)`.
    pub uv_transform: glam::Affine2,
}

impl TextureRef {
    /// Texture `texture` by the first set of coordinates, untransformed.
    pub fn new(texture: Id) -> Self {
        Self { texture, uv_set: 0, uv_transform: glam::Affine2::IDENTITY }
    }
}

/// An image and how it is sampled.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Texture {
    /// Index into [`Scene::images`].
    pub image: Id,
    /// Outside 0..1, by axis.
    pub wrap: [Wrap; 2],
    /// Whether magnified texels are blended.
    pub filter: Filter,
}

/// What a texture shows outside 0..1.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Wrap {
    /// It repeats.
    #[default]
    Repeat,
    /// It repeats, every other copy mirrored.
    Mirror,
    /// Its edge continues.
    Clamp,
}

/// Texture magnification.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Default)]
pub enum Filter {
    /// Blended, with mipmaps and anisotropy where minified. Images of up to 65,536 texels, and squares of a power of two,
    /// keep their texels; others may be resampled.
    #[default]
    Linear,
    /// Single texels, as they are in the image.
    Nearest,
}

/// 8-bit RGBA pixels, row by row from the top left. Whether they are sRGB or linear is said by their use.
#[derive(Clone, PartialEq)]
pub struct ImageData {
    /// Name for messages: the file, or the place in the scene file.
    pub name: String,
    /// Pixels, ≥ 1.
    pub width: u32,
    /// Pixels, ≥ 1.
    pub height: u32,
    /// `4 · width · height` bytes.
    pub rgba: Vec<u8>,
}

impl std::fmt::Debug for ImageData {
    fn fmt(&self, f: &mut std::fmt::Formatter<'_>) -> std::fmt::Result {
        write!(f, "ImageData({} {}×{})", self.name, self.width, self.height)
    }
}

/// A camera's lens.
#[derive(Clone, Debug, PartialEq)]
pub struct Camera {
    /// Name from the file or its node.
    pub name: String,
    /// Lens.
    pub projection: Projection,
    /// Near plane, metres, > 0 for perspective.
    pub near_m: f32,
    /// Far plane, metres; `None` = infinite.
    pub far_m: Option<f32>,
}

/// A camera's field of view. The picture's own aspect decides the width.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Projection {
    /// Vertical field of view in radians.
    Perspective {
        /// Whole angle from bottom to top, in (0, π).
        yfov_rad: f32,
    },
    /// Half the picture's height in metres.
    Orthographic {
        /// > 0.
        half_height_m: f32,
    },
}

/// A light source without a visible surface.
#[derive(Clone, Debug, PartialEq)]
pub struct Light {
    /// Name from the file or its node.
    pub name: String,
    /// Shape of the emission.
    pub kind: LightKind,
    /// Linear Rec. 709 colour, unitless factor.
    pub color: Vec3,
    /// Candela (point, spot) or lux on a surface facing it (directional).
    pub intensity: f32,
    /// Distance in metres past which nothing is lit; `None` = unlimited.
    pub range_m: Option<f32>,
}

/// Shape of a light's emission.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum LightKind {
    /// Parallel light along the node's −Z.
    Directional,
    /// Equal in all directions.
    Point,
    /// A cone around the node's −Z; full inside the inner angle, falling to none at the outer.
    Spot {
        /// Half angle in radians, ≤ outer.
        inner_rad: f32,
        /// Half angle in radians, ≤ π/2.
        outer_rad: f32,
    },
}

/// What is smoother mirrors exactly and refracts without blur. Twin of `SMOOTH` in `bsdf.wesl`.
const SMOOTH: f32 = 0.01;

impl Scene {
    /// Whether a material of this scene mirrors exactly or lets light through without blur somewhere; its textures are looked
    /// through.
    pub fn is_specular(&self, material: &Material) -> bool {
        let reflects = material.metallic > 0.0 || material.specular > 0.0 || material.transmission > 0.0;
        if material.reflection != Reflection::MetallicRoughness || !reflects {
            return false;
        }
        // The smoothest texel decides.
        let texture = material.metallic_roughness_texture.as_ref();
        let least = texture.map_or(1.0, |reference| {
            let image = &self.images[self.textures[reference.texture].image];
            f32::from(image.rgba.chunks_exact(4).map(|texel| texel[1]).min().unwrap_or(255)) / 255.0
        });
        material.roughness * least < SMOOTH
    }

    /// World transform of every node at rest, in node order.
    pub fn world_from_node(&self) -> Vec<Affine3A> {
        self.rest().world_from_node
    }

    /// Smallest and largest corner of all drawn geometry in world space at rest, metres; `None` without geometry.
    pub fn bounds(&self) -> Option<(Vec3, Vec3)> {
        self.bounds_at(&self.rest())
    }

    /// Number of triangles drawn, every instance counted.
    pub fn triangle_count(&self) -> usize {
        let of = |mesh: Id| self.meshes[mesh].primitives.iter().map(|p| p.indices.len() / 3).sum::<usize>();
        self.nodes.iter().filter_map(|node| node.mesh).map(of).sum()
    }

    /// World pose at rest of every camera that a node places, as (camera, world_from_camera).
    pub fn placed_cameras(&self) -> Vec<(Id, Mat4)> {
        self.placed_cameras_at(&self.rest())
    }

    /// World pose at rest of every light that a node places, as (light, world_from_light).
    pub fn placed_lights(&self) -> Vec<(Id, Affine3A)> {
        self.placed_lights_at(&self.rest())
    }
}
