//! Puts a scene together: tables grow, indices stay right.

use glam::{Affine2, Mat3, Quat, Vec2, Vec3};

use super::{solid::Solid, texture::Surface};
use crate::{
    Camera, Id, ImageData, Light, LightKind, Material, Mesh, Node, Primitive, Projection, Scene, Texture,
    TextureRef, Transform, Wrap,
};

/// A scene under construction.
#[derive(Default)]
pub struct Stage {
    /// What stands so far.
    pub scene: Scene,
}

impl Stage {
    /// An empty scene.
    pub fn new(name: &str) -> Self {
        Self { scene: Scene { name: name.to_owned(), ..Scene::default() } }
    }

    /// Adds an image that repeats, used with texture coordinates in metres: `side_m` metres per repeat.
    pub fn image(&mut self, image: ImageData, side_m: f32) -> TextureRef {
        self.scene.images.push(image);
        self.scene.textures.push(Texture {
            image: self.scene.images.len() - 1,
            wrap: [Wrap::Repeat; 2],
            filter: crate::Filter::Linear,
        });
        let uv_transform = Affine2::from_scale(Vec2::splat(1.0 / side_m));
        TextureRef { uv_transform, ..TextureRef::new(self.scene.textures.len() - 1) }
    }

    /// Adds a painted surface's colour and normals.
    pub fn surface(&mut self, name: &str, surface: &Surface, side_m: f32) -> [Option<TextureRef>; 2] {
        let color = self.image(surface.base_color(&format!("{name} colour")), side_m);
        let normal = self.image(surface.normal(&format!("{name} normals"), side_m), side_m);
        [Some(color), Some(normal)]
    }

    /// Adds a material.
    pub fn material(&mut self, material: Material) -> Id {
        self.scene.materials.push(material);
        self.scene.materials.len() - 1
    }

    /// Adds a mesh, with tangents for the materials that have a normal map.
    pub fn mesh(&mut self, name: &str, solid: Solid) -> Id {
        let materials = &self.scene.materials;
        let mesh: Mesh = solid.into_mesh(name, |m| materials[m].normal_texture.is_some());
        self.scene.meshes.push(mesh);
        self.scene.meshes.len() - 1
    }

    /// Puts a mesh somewhere, turned about the vertical.
    pub fn place(&mut self, mesh: Id, translation: Vec3, half_turn: bool) {
        // A half turn as an exact quaternion, so that copies on both sides of an axis meet to the last bit.
        let rotation = if half_turn { Quat::from_xyzw(0.0, 1.0, 0.0, 0.0) } else { Quat::IDENTITY };
        let name = self.scene.meshes[mesh].name.clone();
        self.scene.nodes.push(Node {
            name,
            parent_from_node: Transform::Trs { translation, rotation, scale: Vec3::ONE },
            mesh: Some(mesh),
            ..Node::default()
        });
    }

    /// Adds a mesh that is finished.
    pub fn add(&mut self, name: &str, primitives: Vec<Primitive>) -> Id {
        self.scene.meshes.push(Mesh { name: name.to_owned(), primitives, ..Mesh::default() });
        self.scene.meshes.len() - 1
    }

    /// Puts a mesh somewhere, turned about the vertical and scaled. Returns the node.
    pub fn place_turned(&mut self, mesh: Id, translation: Vec3, turn_deg: f32, scale: f32) -> Id {
        self.place(mesh, translation, false);
        let node = self.scene.nodes.len() - 1;
        let rotation = Quat::from_rotation_y(turn_deg.to_radians());
        self.scene.nodes[node].parent_from_node =
            Transform::Trs { translation, rotation, scale: Vec3::splat(scale) };
        node
    }

    /// Adds a body that stands once, given in world coordinates.
    pub fn body(&mut self, name: &str, solid: Solid) {
        let mesh = self.mesh(name, solid);
        self.place(mesh, Vec3::ZERO, false);
    }

    /// Adds a camera at `eye` that looks at `target`.
    pub fn camera(&mut self, name: &str, eye: Vec3, target: Vec3, yfov_deg: f32) {
        let projection = Projection::Perspective { yfov_rad: yfov_deg.to_radians() };
        self.scene.cameras.push(Camera { name: name.to_owned(), projection, near_m: 0.05, far_m: None });
        let camera = Some(self.scene.cameras.len() - 1);
        self.scene.nodes.push(Node { camera, ..aimed(name, eye, target) });
    }

    /// Adds a sun of `lux` on a surface that faces it, in the direction `towards`.
    pub fn sun(&mut self, towards: Vec3, color: Vec3, lux: f32) {
        self.light("sun", LightKind::Directional, color, lux, towards.normalize() * 50.0, Vec3::ZERO);
    }

    /// Adds a light at `from` that shines at `target`.
    pub fn light(
        &mut self,
        name: &str,
        kind: LightKind,
        color: Vec3,
        intensity: f32,
        from: Vec3,
        target: Vec3,
    ) {
        self.scene.lights.push(Light { name: name.to_owned(), kind, color, intensity, range_m: None });
        let light = Some(self.scene.lights.len() - 1);
        self.scene.nodes.push(Node { light, ..aimed(name, from, target) });
    }
}

/// A dielectric of one colour.
pub fn plain(name: &str, color: Vec3, roughness: f32) -> Material {
    Material { name: name.to_owned(), base_color: color.extend(1.0), roughness, ..Material::default() }
}

/// A bare metal; `color` is its reflectance at normal incidence.
pub fn metal(name: &str, color: Vec3, roughness: f32) -> Material {
    Material { metallic: 1.0, ..plain(name, color, roughness) }
}

/// Clear glass of this thickness, of which light passes `tint` after `tint_m` metres.
pub fn glass(name: &str, thickness: f32, tint: Vec3, tint_m: f32) -> Material {
    Material {
        transmission: 1.0,
        ior: 1.5,
        thickness,
        attenuation_color: tint,
        attenuation_distance: tint_m,
        ..plain(name, Vec3::ONE, 0.0)
    }
}

/// A spot whose half angles are given in degrees.
pub fn spot(inner_deg: f32, outer_deg: f32) -> LightKind {
    LightKind::Spot { inner_rad: inner_deg.to_radians(), outer_rad: outer_deg.to_radians() }
}

/// An empty node whose −Z points from `from` to `target`.
fn aimed(name: &str, from: Vec3, target: Vec3) -> Node {
    let back = (from - target).normalize();
    // Straight up or down leaves the roll open; any side will do.
    let right = Vec3::Y.cross(back).normalize_or(Vec3::X);
    let rotation = Quat::from_mat3(&Mat3::from_cols(right, back.cross(right), back));
    Node {
        name: name.to_owned(),
        parent_from_node: Transform::Trs { translation: from, rotation, scale: Vec3::ONE },
        ..Node::default()
    }
}
