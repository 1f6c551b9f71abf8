//! Any model in the place of `builtin:ring`'s bangle.

use glam::Vec3;

use crate::{Id, Node, Scene, Transform};

/// The bangle's name.
const STOOD_FOR: &str = "bangle";

/// `builtin:ring` with a model where the bangle lies, as large as it is and on the same page. The model keeps the materials of what
/// mirrors or refracts without blur; where nothing of it does, all of it is of the bangle's gold. Its lamps and cameras stay away.
/// `None` where the model draws nothing.
pub(crate) fn ring_with(mut model: Scene) -> Option<Scene> {
    let (lo, hi) = centred(&mut model)?;
    let mut scene = super::ring::build();
    let place = scene.nodes.iter().position(|node| node.name == STOOD_FOR)?;
    let gold = scene.meshes[scene.nodes[place].mesh?].primitives[0].material;
    // Nothing else is of gold.
    let (ring_lo, ring_hi) = scene.bounds_of(&scene.pose(0.0), |material| material == gold)?;

    let largest = (hi - lo).max_element();
    let scale = if largest > 0.0 { (ring_hi - ring_lo).max_element() / largest } else { 1.0 };
    let foot = |lo: Vec3, hi: Vec3| lo.midpoint(hi).with_y(lo.y);
    scene.nodes[place].mesh = None;
    scene.nodes[place].name.clone_from(&model.name);
    scene.nodes[place].parent_from_node = Transform::Trs {
        translation: foot(ring_lo, ring_hi) - scale * foot(lo, hi),
        rotation: glam::Quat::IDENTITY,
        scale: Vec3::splat(scale),
    };
    let keeps = model.materials.iter().any(|material| model.is_specular(material));
    adopt(&mut scene, place, model, (!keeps).then_some(gold));
    Some(scene)
}

/// Moves a model to the origin, and tells its bounds there.
fn centred(model: &mut Scene) -> Option<(Vec3, Vec3)> {
    // Far from the origin bounds are coarse: the second time they are exact.
    for _ in 0..2 {
        let (lo, hi) = model.bounds_at(&model.pose(0.0))?;
        let middle = std::mem::take(&mut model.origin) + lo.midpoint(hi).as_dvec3();
        for root in model.nodes.iter_mut().filter(|node| node.parent.is_none()) {
            root.offset -= middle;
        }
    }
    model.bounds_at(&model.pose(0.0))
}

/// Hangs all that a model draws below a node; all of it of one material where one is given.
fn adopt(scene: &mut Scene, below: Id, model: Scene, material: Option<Id>) {
    let images = scene.images.len();
    let textures = scene.textures.len();
    let materials = scene.materials.len();
    let meshes = scene.meshes.len();
    let nodes = scene.nodes.len();
    let skins = scene.skins.len();
    scene.images.extend(model.images);
    scene.textures.extend(model.textures.into_iter().map(|mut texture| {
        texture.image += images;
        texture
    }));
    scene.materials.extend(model.materials.into_iter().map(|mut material| {
        for use_ in material.texture_refs_mut() {
            use_.texture += textures;
        }
        material
    }));
    scene.meshes.extend(model.meshes.into_iter().map(|mut mesh| {
        for primitive in &mut mesh.primitives {
            primitive.material = material.unwrap_or(primitive.material + materials);
        }
        mesh
    }));
    scene.nodes.extend(model.nodes.into_iter().map(|node| Node {
        parent: Some(node.parent.map_or(below, |parent| parent + nodes)),
        mesh: node.mesh.map(|mesh| mesh + meshes),
        skin: node.skin.map(|skin| skin + skins),
        camera: None,
        light: None,
        ..node
    }));
    scene.skins.extend(model.skins.into_iter().map(|mut skin| {
        for joint in &mut skin.joints {
            *joint += nodes;
        }
        skin
    }));
    scene.animations.extend(model.animations.into_iter().map(|mut animation| {
        for channel in &mut animation.channels {
            channel.node += nodes;
        }
        animation
    }));
    scene.warnings.extend(model.warnings);
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::builtin::build;

    #[test]
    fn a_model_lies_where_the_bangle_lay_as_large_and_of_its_gold() {
        let model = build("dancer").unwrap();
        let (nodes, animations) = (model.nodes.len(), model.animations.len());
        let before = build("ring").unwrap();
        let place = before.nodes.iter().position(|node| node.name == STOOD_FOR).unwrap();
        let gold = before.meshes[before.nodes[place].mesh.unwrap()].primitives[0].material;
        let (lo, hi) = before.bounds_of(&before.pose(0.0), |material| material == gold).unwrap();
        let scene = ring_with(model).unwrap();
        scene.validate().unwrap();
        assert_eq!(scene.nodes.len(), before.nodes.len() + nodes);
        assert_eq!(scene.animations.len(), animations);
        assert_eq!((scene.lights.len(), scene.cameras.len()), (before.lights.len(), before.cameras.len()));
        let mut alone = scene.clone();
        for node in &mut alone.nodes[..before.nodes.len()] {
            node.mesh = None;
        }
        let (new_lo, new_hi) = alone.bounds_at(&alone.pose(0.0)).unwrap();
        let large = |lo: Vec3, hi: Vec3| (hi - lo).max_element();
        assert!((large(new_lo, new_hi) / large(lo, hi) - 1.0).abs() < 1e-3);
        let foot = |lo: Vec3, hi: Vec3| lo.midpoint(hi).with_y(lo.y);
        assert!(foot(new_lo, new_hi).distance(foot(lo, hi)) < 1e-3 * large(lo, hi));
        let own = &scene.meshes[before.meshes.len()..];
        assert!(own.iter().flat_map(|mesh| &mesh.primitives).all(|primitive| primitive.material == gold));
    }

    #[test]
    fn a_model_far_from_its_origin_lies_there_too() {
        let mut far = build("knot").unwrap();
        let [near, mut settled] = [far.clone(), far.clone()];
        for root in far.nodes.iter_mut().filter(|node| node.parent.is_none()) {
            root.offset += glam::DVec3::new(4e6, 0.0, -3e6);
        }
        // As files are read.
        settled.nodes.clone_from(&far.nodes);
        assert!(settled.settle(None));
        let [near, far, settled] = [near, far, settled].map(|model| {
            let scene = ring_with(model).unwrap();
            scene.bounds_at(&scene.pose(0.0)).unwrap()
        });
        for (lo, hi) in [far, settled] {
            assert!(near.0.distance(lo) < 1e-5 && near.1.distance(hi) < 1e-5, "{near:?} {lo} {hi}");
        }
    }

    #[test]
    fn glass_stays_glass_and_what_draws_nothing_is_none() {
        let model = build("knot").unwrap();
        let glass = model.materials.iter().position(|material| material.transmission > 0.0).unwrap();
        let name = model.materials[glass].name.clone();
        let scene = ring_with(model).unwrap();
        scene.validate().unwrap();
        let used = |primitive: &crate::Primitive| scene.materials[primitive.material].name == name;
        assert!(scene.meshes.iter().flat_map(|mesh| &mesh.primitives).any(used));
        assert!(ring_with(Scene::default()).is_none());
    }
}
