//! Small scenes of flat pieces, for tests whose answer is known.

use chiaro::View;
use chiaro::scene::{
    Filter, Id, ImageData, Light, LightKind, Material, Mesh, Node, Primitive, Projection, Scene, Texture,
    TextureRef, Transform, Wrap,
};
use glam::{Affine3A, Mat3, Mat4, Quat, Vec2, Vec3};

/// A scene under construction.
#[derive(Clone, Debug, Default)]
pub struct Stage {
    /// What stands so far.
    pub scene: Scene,
}

impl Stage {
    /// An empty scene.
    pub fn new() -> Self {
        Self::default()
    }

    /// A Lambertian floor of 8 × 8 m around the origin.
    pub fn floor(albedo: f32) -> Self {
        let mut stage = Self::new();
        let material = stage.lambert(albedo);
        stage.quad(Vec3::ZERO, Vec3::X * 4.0, Vec3::NEG_Z * 4.0, material);
        stage
    }

    /// Adds a material.
    pub fn material(&mut self, material: Material) -> Id {
        self.scene.materials.push(material);
        self.scene.materials.len() - 1
    }

    /// Adds a Lambertian material of one grey.
    pub fn lambert(&mut self, albedo: f32) -> Id {
        let base_color = Vec3::splat(albedo).extend(1.0);
        self.material(Material { base_color, specular: 0.0, double_sided: true, ..Material::default() })
    }

    /// Adds a texture of `side`² pixels.
    pub fn texture(&mut self, side: u32, wrap: [Wrap; 2], filter: Filter, rgba: Vec<u8>) -> TextureRef {
        let name = format!("image {}", self.scene.images.len());
        self.scene.images.push(ImageData { name, width: side, height: side, rgba });
        self.scene.textures.push(Texture { image: self.scene.images.len() - 1, wrap, filter });
        TextureRef::new(self.scene.textures.len() - 1)
    }

    /// Adds a parallelogram `center ± u ± v` with its front towards `u × v`, texture coordinates 0..1 along u and
    /// against v (the image stands upright).
    pub fn quad(&mut self, center: Vec3, u: Vec3, v: Vec3, material: Id) {
        let mesh = Mesh { primitives: vec![quad(center, u, v, material)], ..Mesh::default() };
        self.place(mesh, Affine3A::IDENTITY);
    }

    /// Adds a box by its middle and half its sides.
    pub fn cuboid(&mut self, center: Vec3, half: Vec3, material: Id) {
        let [x, y, z] = [Vec3::X * half.x, Vec3::Y * half.y, Vec3::Z * half.z];
        for (out, u, v) in [(x, y, z), (-x, z, y), (y, z, x), (-y, x, z), (z, x, y), (-z, y, x)] {
            self.quad(center + out, u, v, material);
        }
    }

    /// Adds a mesh at a pose.
    pub fn place(&mut self, mesh: Mesh, pose: Affine3A) {
        self.scene.meshes.push(mesh);
        let mesh = Some(self.scene.meshes.len() - 1);
        self.node(Node { mesh, ..node(pose) });
    }

    /// Adds a sun that shines along `direction`, lux.
    pub fn sun(&mut self, illuminance: f32, direction: Vec3) {
        self.light(LightKind::Directional, illuminance, None, Vec3::ZERO, direction);
    }

    /// Adds a light at a place, cd (sun: lux).
    pub fn light(
        &mut self,
        kind: LightKind,
        intensity: f32,
        range_m: Option<f32>,
        position: Vec3,
        direction: Vec3,
    ) {
        self.scene.lights.push(Light { name: String::new(), kind, color: Vec3::ONE, intensity, range_m });
        let light = Some(self.scene.lights.len() - 1);
        let turn = Quat::from_rotation_arc(Vec3::NEG_Z, direction.normalize());
        self.node(Node { light, ..node(Affine3A::from_rotation_translation(turn, position)) });
    }

    fn node(&mut self, node: Node) {
        self.scene.nodes.push(node);
    }
}

fn node(pose: Affine3A) -> Node {
    Node { parent_from_node: Transform::Matrix(pose), ..Node::default() }
}

/// See [`Stage::quad`].
fn quad(center: Vec3, u: Vec3, v: Vec3, material: Id) -> Primitive {
    Primitive {
        positions: vec![center - u - v, center + u - v, center + u + v, center - u + v],
        normals: vec![u.cross(v).normalize(); 4],
        uvs: [vec![Vec2::Y, Vec2::ONE, Vec2::X, Vec2::ZERO], Vec::new()],
        indices: vec![0, 1, 2, 0, 2, 3],
        material,
        ..Primitive::default()
    }
}

/// An orthographic camera 10 m above the origin that looks straight down: the picture's right is +X, its top −Z.
pub fn camera_above(half_height_m: f32) -> View {
    let axes = Mat3::from_cols(Vec3::X, Vec3::NEG_Z, Vec3::Y);
    View {
        world_from_camera: Mat4::from_translation(Vec3::new(0.0, 10.0, 0.0)) * Mat4::from_mat3(axes),
        projection: Projection::Orthographic { half_height_m },
        near_m: 0.1,
        far_m: 30.0,
        aspect: None,
        axis_ndc: Vec2::ZERO,
    }
}

/// Where on the floor the middle of a pixel lies that [`camera_above`] takes, in a picture of `side`².
pub fn place_below([x, y]: [u32; 2], side: u32, half_height_m: f32) -> Vec3 {
    let at = |i: u32| ((i as f32 + 0.5) / side as f32 * 2.0 - 1.0) * half_height_m;
    Vec3::new(at(x), 0.0, at(y))
}
