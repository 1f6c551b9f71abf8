//! What the rest of chiaro relies on, checked: for scenes that a program builds itself.

use glam::{Vec3, Vec4};

use crate::{
    AlphaMode, Animation, Camera, Channel, Environment, ImageData, Interpolation, Keys, Light, LightKind,
    Material, Mesh, Node, Pose, Primitive, Projection, Reflection, Scene, SceneError, Skin,
};

type Check = Result<(), String>;

/// Fails with a sentence unless something holds.
macro_rules! ensure {
    ($holds:expr, $($problem:tt)*) => {
        let holds: bool = $holds;
        if !holds {
            return Err(format!($($problem)*));
        }
    };
}

/// A part of a scene, for messages.
fn named(kind: &str, index: usize, name: &str) -> String {
    if name.is_empty() { format!("{kind} {index}") } else { format!("{kind} {index} “{name}”") }
}

impl Scene {
    /// Checks that a pose is one of this scene: that it has every node, at a finite place, with all morph weights.
    ///
    /// # Errors
    /// [`SceneError::Unsound`], which names the first node that is wrong.
    pub fn validate_pose(&self, pose: &Pose) -> Result<(), SceneError> {
        let at = |place, problem| SceneError::Unsound { scene: self.name.clone(), place, problem };
        let nodes = self.nodes.len();
        for (what, count) in
            [("transforms", pose.world_from_node.len()), ("sets of morph weights", pose.morph_weights.len())]
        {
            if count != nodes {
                let problem = format!("it has {count} {what} for {nodes} nodes");
                return Err(at("pose".into(), problem));
            }
        }
        let placed = pose.world_from_node.iter().zip(&pose.morph_weights);
        for (i, (node, (world, weights))) in self.nodes.iter().zip(placed).enumerate() {
            let check = || {
                ensure!(world.is_finite(), "its transform in the pose has a number that is not finite");
                let targets = node.mesh.map_or(0, |mesh| self.meshes[mesh].morph_targets());
                self::weights(weights, targets)
            };
            check().map_err(|problem| at(named("node", i, &node.name), problem))?;
        }
        Ok(())
    }

    /// Checks that every index is in range, every stream as long as it has to be, every number finite and within its range,
    /// and that nodes form a forest. Scenes from files and built-in ones always pass, and uploading checks. It takes a few
    /// milliseconds for a million corners.
    ///
    /// # Errors
    /// [`SceneError::Unsound`], which names the first place that is wrong.
    pub fn validate(&self) -> Result<(), SceneError> {
        let at =
            |place: String| move |problem| SceneError::Unsound { scene: self.name.clone(), place, problem };
        for (i, image) in self.images.iter().enumerate() {
            self::image(image).map_err(at(named("image", i, &image.name)))?;
        }
        for (i, texture) in self.textures.iter().enumerate() {
            index("image", texture.image, self.images.len()).map_err(at(named("texture", i, "")))?;
        }
        for (i, material) in self.materials.iter().enumerate() {
            self.material(material).map_err(at(named("material", i, &material.name)))?;
        }
        for (i, mesh) in self.meshes.iter().enumerate() {
            let place = || named("mesh", i, &mesh.name);
            self::mesh(mesh).map_err(at(place()))?;
            for (p, primitive) in mesh.primitives.iter().enumerate() {
                self.primitive(primitive)
                    .map_err(|problem| at(format!("{}, primitive {p}", place()))(problem))?;
            }
        }
        for (i, light) in self.lights.iter().enumerate() {
            self::light(light).map_err(at(named("light", i, &light.name)))?;
        }
        for (i, camera) in self.cameras.iter().enumerate() {
            self::camera(camera).map_err(at(named("camera", i, &camera.name)))?;
        }
        for (i, skin) in self.skins.iter().enumerate() {
            self.skin(skin).map_err(at(named("skin", i, &skin.name)))?;
        }
        for (i, node) in self.nodes.iter().enumerate() {
            self.node(i, node).map_err(at(named("node", i, &node.name)))?;
        }
        for (i, animation) in self.animations.iter().enumerate() {
            self.animation(animation).map_err(at(named("animation", i, &animation.name)))?;
        }
        if let Some(map) = &self.environment {
            environment(map).map_err(at(format!("environment “{}”", map.name)))?;
        }
        // Products of finite matrices may still overflow.
        let reaches: Vec<f32> = self.meshes.iter().map(reach).collect();
        let pose = self.rest();
        for (i, (node, world)) in self.nodes.iter().zip(&pose.world_from_node).enumerate() {
            let reach = node.mesh.map_or(0.0, |mesh| reaches[mesh]);
            let matrix = world.matrix3;
            let far = (matrix.x_axis.abs() + matrix.y_axis.abs() + matrix.z_axis.abs()) * reach
                + world.translation.abs();
            let check = || {
                ensure!(far.is_finite(), "it stands too far away for 32-bit numbers");
                Ok(())
            };
            check().map_err(at(named("node", i, &node.name)))?;
        }
        Ok(())
    }

    fn node(&self, i: usize, node: &Node) -> Check {
        if let Some(parent) = node.parent {
            ensure!(
                parent < i,
                "its parent is node {parent}: parents stand before their children, and no node is its own ancestor"
            );
        }
        optional("mesh", node.mesh, self.meshes.len())?;
        optional("skin", node.skin, self.skins.len())?;
        optional("camera", node.camera, self.cameras.len())?;
        optional("light", node.light, self.lights.len())?;
        let is_finite = node.parent_from_node.affine().is_finite() && node.offset.is_finite();
        ensure!(is_finite, "its transform has a number that is not finite");
        let targets = node.mesh.map_or(0, |mesh| self.meshes[mesh].morph_targets());
        weights(&node.morph_weights, targets)?;
        let Some(skin) = node.skin else { return Ok(()) };
        let Some(mesh) = node.mesh else { return Err("it has a skin, but no mesh".into()) };
        let joints = self.skins[skin].joints.len();
        for (p, primitive) in self.meshes[mesh].primitives.iter().enumerate() {
            length("joints", primitive.joints.len(), primitive.positions.len())
                .map_err(|problem| format!("its skin bends mesh {mesh}, of whose primitive {p} {problem}"))?;
            let used = usize::from(primitive.joints.iter().flatten().copied().max().unwrap_or(0));
            ensure!(
                used < joints,
                "its skin {skin} has {joints} joints, but primitive {p} of its mesh {mesh} is bent by joint {used}"
            );
        }
        Ok(())
    }

    fn material(&self, material: &Material) -> Check {
        let m = material;
        let shares = [
            ("metallic", m.metallic),
            ("roughness", m.roughness),
            ("specular", m.specular),
            ("transmission", m.transmission),
            ("occlusion_strength", m.occlusion_strength),
        ];
        for (name, value) in shares {
            ensure!((0.0..=1.0).contains(&value), "its {name} is {value}, not within 0..1");
        }
        let numbers = [("normal_scale", m.normal_scale), ("dispersion", m.dispersion), ("ior", m.ior)];
        for (name, value) in numbers {
            ensure!(value.is_finite(), "its {name} is {value}");
        }
        let lengths = [("thickness", m.thickness), ("attenuation_distance", m.attenuation_distance)];
        for (name, value) in lengths {
            ensure!(value >= 0.0, "its {name} is {value}, not a length");
        }
        let colors = [
            m.base_color,
            m.specular_color.extend(0.0),
            m.emissive.extend(0.0),
            m.attenuation_color.extend(0.0),
        ];
        ensure!(colors.iter().all(|color| color.is_finite()), "a colour has a number that is not finite");
        if let Reflection::Phong { exponent } = m.reflection {
            ensure!(exponent >= 0.0 && exponent.is_finite(), "its exponent is {exponent}");
        }
        if let AlphaMode::Mask { cutoff } = m.alpha {
            ensure!(cutoff.is_finite(), "its cut-off is {cutoff}");
        }
        for texture in m.texture_refs() {
            index("texture", texture.texture, self.textures.len())?;
            ensure!(
                texture.uv_set < 2,
                "a texture takes uvs of set {}; there are sets 0 and 1",
                texture.uv_set
            );
            ensure!(texture.uv_transform.is_finite(), "a uv transform has a number that is not finite");
        }
        Ok(())
    }

    fn primitive(&self, primitive: &Primitive) -> Check {
        let p = primitive;
        let count = p.positions.len();
        index("material", p.material, self.materials.len())?;
        ensure!(!p.indices.is_empty(), "it has no triangles");
        ensure!(
            p.indices.len().is_multiple_of(3),
            "its {} indices are not three per triangle",
            p.indices.len()
        );
        let last = p.indices.iter().copied().max().unwrap_or(0);
        ensure!((last as usize) < count, "its index {last} is beyond its {count} positions");
        finite("positions", &p.positions, Vec3::is_finite)?;
        length("normals", p.normals.len(), count)?;
        finite("normals", &p.normals, Vec3::is_finite)?;
        let material = &self.materials[p.material];
        if material.normal_texture.is_some() {
            length("tangents", p.tangents.len(), count)?;
        }
        optional_length("tangents", p.tangents.len(), count)?;
        finite("tangents", &p.tangents, Vec4::is_finite)?;
        for (set, uvs) in p.uvs.iter().enumerate() {
            let name = format!("uvs of set {set}");
            optional_length(&name, uvs.len(), count)?;
            finite(&name, uvs, glam::Vec2::is_finite)?;
        }
        for texture in material.texture_refs() {
            let set = texture.uv_set;
            length(
                &format!("uvs of set {set}, which material {} needs,", p.material),
                p.uvs[set].len(),
                count,
            )?;
        }
        optional_length("colors", p.colors.len(), count)?;
        finite("colors", &p.colors, Vec4::is_finite)?;
        optional_length("joints", p.joints.len(), count)?;
        length("joint weights", p.joint_weights.len(), p.joints.len())?;
        finite("joint weights", &p.joint_weights, Vec4::is_finite)?;
        for (t, target) in p.morph_targets.iter().enumerate() {
            for stream in [&target.positions, &target.normals, &target.tangents] {
                let name = format!("differences of morph target {t}");
                optional_length(&name, stream.len(), count)?;
                finite(&name, stream, Vec3::is_finite)?;
            }
        }
        if p.flat {
            let mut triangle_of = vec![u32::MAX; count];
            for (corner, &vertex) in p.indices.iter().enumerate() {
                let (triangle, known) = (corner as u32 / 3, &mut triangle_of[vertex as usize]);
                ensure!(
                    *known == u32::MAX || *known == triangle,
                    "it is flat, but triangles share vertex {vertex}"
                );
                *known = triangle;
            }
        }
        Ok(())
    }

    fn skin(&self, skin: &Skin) -> Check {
        length("matrices", skin.joint_from_object.len(), skin.joints.len())?;
        skin.joints.iter().try_for_each(|&joint| index("node", joint, self.nodes.len()))?;
        finite("matrices", &skin.joint_from_object, |matrix| matrix.is_finite())
    }

    fn animation(&self, animation: &Animation) -> Check {
        for (c, channel) in animation.channels.iter().enumerate() {
            self.channel(channel).map_err(|problem| format!("of its channel {c}, {problem}"))?;
        }
        Ok(())
    }

    fn channel(&self, channel: &Channel) -> Check {
        index("node", channel.node, self.nodes.len())?;
        let times = &channel.times_s;
        ensure!(!times.is_empty(), "there are no keys");
        let ascend =
            times[0] >= 0.0 && times.is_sorted_by(|a, b| a < b) && times[times.len() - 1].is_finite();
        ensure!(ascend, "the times do not ascend from 0");
        let targets = self.nodes[channel.node].mesh.map_or(0, |mesh| self.meshes[mesh].morph_targets());
        let (count, is_finite, each) = match &channel.keys {
            Keys::Translation(keys) | Keys::Scale(keys) => {
                (keys.len(), keys.iter().all(|k| k.is_finite()), 1)
            }
            Keys::Rotation(keys) => (keys.len(), keys.iter().all(|k| k.is_finite()), 1),
            Keys::MorphWeights(keys) => (keys.len(), keys.iter().all(|k| k.is_finite()), targets),
        };
        ensure!(is_finite, "a key has a number that is not finite");
        ensure!(each > 0, "morph weights are animated, but node {} has no morph targets", channel.node);
        let per_key = if channel.interpolation == Interpolation::Cubic { 3 } else { 1 };
        length("values", count, times.len() * per_key * each)
    }
}

fn mesh(mesh: &Mesh) -> Check {
    ensure!(!mesh.primitives.is_empty(), "it has no primitives");
    let targets = mesh.morph_targets();
    for (p, primitive) in mesh.primitives.iter().enumerate() {
        let own = primitive.morph_targets.len();
        ensure!(own == targets, "primitive {p} has {own} morph targets, but primitive 0 has {targets}");
    }
    weights(&mesh.morph_weights, targets)
}

fn weights(weights: &[f32], targets: usize) -> Check {
    optional_length("morph weights", weights.len(), targets)?;
    finite("morph weights", weights, f32::is_finite)
}

fn image(image: &ImageData) -> Check {
    let (width, height) = (image.width as usize, image.height as usize);
    ensure!(width > 0 && height > 0, "it has {width}×{height} pixels");
    length("bytes", image.rgba.len(), 4 * width * height)
}

fn environment(map: &Environment) -> Check {
    let (width, height) = (map.width as usize, map.height as usize);
    ensure!(width > 0 && height > 0, "it has {width}×{height} pixels");
    length("pixels", map.radiance.len(), width * height)?;
    let is_radiance = |nits: Vec3| nits.is_finite() && nits.min_element() >= 0.0;
    finite("pixels", &map.radiance, is_radiance)
}

fn light(light: &Light) -> Check {
    let is_strength = light.color.is_finite() && light.color.min_element() >= 0.0;
    ensure!(is_strength, "its colour is {}", light.color);
    ensure!(light.intensity >= 0.0 && light.intensity.is_finite(), "its intensity is {}", light.intensity);
    if let Some(range) = light.range_m {
        ensure!(range > 0.0, "its range is {range} m");
    }
    if let LightKind::Spot { inner_rad, outer_rad } = light.kind {
        let is_cone =
            (0.0..=outer_rad).contains(&inner_rad) && outer_rad <= std::f32::consts::FRAC_PI_2 + 1e-5;
        ensure!(is_cone, "its cone is {inner_rad}..{outer_rad} rad: 0 ≤ inner ≤ outer ≤ π/2 is wanted");
    }
    Ok(())
}

fn camera(camera: &Camera) -> Check {
    ensure!(camera.near_m.is_finite(), "its near plane is at {} m", camera.near_m);
    match camera.projection {
        Projection::Perspective { yfov_rad } => {
            let opens = yfov_rad > 0.0 && yfov_rad < std::f32::consts::PI;
            ensure!(opens, "its field of view is {yfov_rad} rad, not within 0..π");
        }
        Projection::Orthographic { half_height_m } => {
            ensure!(half_height_m > 0.0 && half_height_m.is_finite(), "half its height is {half_height_m} m");
        }
    }
    ensure!(camera.far_m.is_none_or(|far| far > camera.near_m), "its far plane is not beyond its near plane");
    Ok(())
}

/// The largest coordinate of a mesh, metres.
fn reach(mesh: &Mesh) -> f32 {
    let positions = mesh.primitives.iter().flat_map(|primitive| &primitive.positions);
    positions.fold(Vec3::ZERO, |most, position| most.max(position.abs())).max_element()
}

fn index(what: &str, id: usize, count: usize) -> Check {
    ensure!(id < count, "{what} {id} does not exist; there are {count}");
    Ok(())
}

fn optional(what: &str, id: Option<usize>, count: usize) -> Check {
    id.map_or(Ok(()), |id| index(what, id, count))
}

fn length(what: &str, has: usize, wanted: usize) -> Check {
    ensure!(has == wanted, "{what} are {has} instead of {wanted}");
    Ok(())
}

fn optional_length(what: &str, has: usize, wanted: usize) -> Check {
    if has == 0 { Ok(()) } else { length(what, has, wanted) }
}

fn finite<T: Copy + std::fmt::Debug>(what: &str, values: &[T], is_good: impl Fn(T) -> bool) -> Check {
    let Some(wrong) = values.iter().position(|value| !is_good(*value)) else { return Ok(()) };
    Err(format!("number {wrong} of its {what} is {:?}", values[wrong]))
}

#[cfg(test)]
mod tests {
    use glam::{Affine3A, Vec2};

    use super::*;
    use crate::{Filter, Texture, TextureRef, Transform, Wrap};

    /// A triangle, a lamp and a camera.
    fn scene() -> Scene {
        let primitive = Primitive {
            positions: vec![Vec3::ZERO, Vec3::X, Vec3::Y],
            normals: vec![Vec3::Z; 3],
            indices: vec![0, 1, 2],
            ..Primitive::default()
        };
        let lamp = Light {
            name: "bulb".into(),
            kind: LightKind::Point,
            color: Vec3::ONE,
            intensity: 100.0,
            range_m: None,
        };
        Scene {
            name: "room".into(),
            meshes: vec![Mesh { name: "sail".into(), primitives: vec![primitive], ..Mesh::default() }],
            materials: vec![Material::default()],
            nodes: vec![
                Node { name: "mast".into(), mesh: Some(0), ..Node::default() },
                Node { name: "lamp".into(), parent: Some(0), light: Some(0), ..Node::default() },
            ],
            lights: vec![lamp],
            ..Scene::default()
        }
    }

    #[test]
    fn a_pose_that_is_none_of_the_scene_is_told_with_the_node() {
        let scene = scene();
        scene.validate_pose(&scene.rest()).unwrap();
        let faults: [(fn(&mut Pose), &str); 4] = [
            (
                |pose| pose.world_from_node[1].translation.y = f32::NAN,
                "scene “room”: node 1 “lamp”: its transform in the pose has a number that is not finite",
            ),
            (|pose| pose.world_from_node[0].matrix3.x_axis.x = f32::INFINITY, "node 0 “mast”: its transform"),
            (|pose| pose.morph_weights[0] = vec![1.0], "node 0 “mast”: morph weights are 1 instead of 0"),
            (|pose| pose.world_from_node.truncate(1), "pose: it has 1 transforms for 2 nodes"),
        ];
        for (fault, words) in faults {
            let mut pose = scene.rest();
            fault(&mut pose);
            let error = scene.validate_pose(&pose).unwrap_err().to_string();
            assert!(error.contains(words), "`{words}` is not in: {error}");
        }
    }

    type Fault = fn(&mut Scene);

    #[test]
    fn every_fault_is_named_with_its_place() {
        scene().validate().unwrap();
        Scene::default().validate().unwrap();
        let faults: [(Fault, &str); 25] = [
            (|s| s.nodes[1].mesh = Some(4), "node 1 “lamp”: mesh 4 does not exist; there are 1"),
            (|s| s.nodes[1].light = Some(1), "node 1 “lamp”: light 1 does not exist"),
            (|s| s.nodes[0].camera = Some(0), "node 0 “mast”: camera 0 does not exist; there are 0"),
            (|s| s.nodes[0].skin = Some(0), "node 0 “mast”: skin 0 does not exist"),
            (|s| s.nodes[0].parent = Some(1), "node 0 “mast”: its parent is node 1"),
            (|s| s.nodes[1].parent = Some(1), "node 1 “lamp”: its parent is node 1"),
            (|s| s.nodes[0].morph_weights = vec![1.0], "node 0 “mast”: morph weights are 1 instead of 0"),
            (
                |s| s.nodes[1].parent_from_node = Transform::Matrix(Affine3A::from_scale(Vec3::NAN)),
                "node 1 “lamp”: its transform has a number that is not finite",
            ),
            (
                |s| s.meshes[0].primitives[0].indices[1] = 3,
                "mesh 0 “sail”, primitive 0: its index 3 is beyond its 3",
            ),
            (
                |s| s.meshes[0].primitives[0].indices.clear(),
                "mesh 0 “sail”, primitive 0: it has no triangles",
            ),
            (
                |s| s.meshes[0].primitives[0].indices.truncate(2),
                "primitive 0: its 2 indices are not three per triangle",
            ),
            (
                |s| s.meshes[0].primitives[0].positions[1].y = f32::NAN,
                "primitive 0: number 1 of its positions is Vec3(1.0, NaN",
            ),
            (|s| s.meshes[0].primitives[0].normals.truncate(1), "primitive 0: normals are 1 instead of 3"),
            (
                |s| s.meshes[0].primitives[0].material = 1,
                "primitive 0: material 1 does not exist; there are 1",
            ),
            (
                |s| s.meshes[0].primitives[0].uvs[1] = vec![Vec2::ZERO],
                "primitive 0: uvs of set 1 are 1 instead of 3",
            ),
            (
                |s| s.meshes[0].primitives[0].colors = vec![Vec4::ONE; 4],
                "primitive 0: colors are 4 instead of 3",
            ),
            (|s| s.meshes[0].primitives.clear(), "mesh 0 “sail”: it has no primitives"),
            (|s| s.materials.clear(), "mesh 0 “sail”, primitive 0: material 0 does not exist; there are 0"),
            (|s| s.materials[0].roughness = f32::NAN, "material 0: its roughness is NaN"),
            (
                |s| s.materials[0].base_color_texture = Some(TextureRef::new(2)),
                "material 0: texture 2 does not exist; there are 0",
            ),
            (
                |s| {
                    let (wrap, filter) = ([Wrap::Repeat; 2], Filter::Linear);
                    s.textures.push(Texture { image: 0, wrap, filter });
                },
                "texture 0: image 0 does not exist",
            ),
            (
                |s| s.images.push(ImageData { name: "wood".into(), width: 2, height: 1, rgba: vec![0; 4] }),
                "image 0 “wood”: bytes are 4 instead of 8",
            ),
            (|s| s.lights[0].intensity = f32::INFINITY, "light 0 “bulb”: its intensity is inf"),
            (
                |s| {
                    s.skins.push(Skin {
                        joints: vec![9],
                        joint_from_object: vec![Affine3A::IDENTITY],
                        ..Skin::default()
                    });
                },
                "skin 0: node 9 does not exist",
            ),
            (
                |s| {
                    let keys = Keys::Scale(vec![Vec3::ONE]);
                    let channel = Channel {
                        node: 0,
                        times_s: vec![0.0, 1.0],
                        interpolation: Interpolation::Linear,
                        keys,
                    };
                    s.animations.push(Animation { name: "wave".into(), channels: vec![channel] });
                },
                "animation 0 “wave”: of its channel 0, values are 1 instead of 2",
            ),
        ];
        for (fault, expected) in faults {
            let mut scene = scene();
            fault(&mut scene);
            let message = scene.validate().map_or_else(|error| error.to_string(), |()| "nothing".into());
            assert!(message.contains(expected), "“{message}” does not tell “{expected}”");
        }
    }

    #[test]
    fn what_stands_beyond_all_numbers_is_refused() {
        let mut scene = scene();
        scene.nodes[0].parent_from_node = Transform::Matrix(Affine3A::from_scale(Vec3::splat(1e30)));
        scene.meshes[0].primitives[0].positions[0] = Vec3::splat(1e10);
        let message = scene.validate().unwrap_err().to_string();
        assert!(message.contains("node 0 “mast”: it stands too far away"), "{message}");
    }
}
