//! What moves and bends on the GPU against the CPU's twin (`chiaro_scene::Scene::posed_vertices`).

use std::f32::consts::TAU;

use chiaro::scene::{
    Animation, Channel, Interpolation, Keys, Mesh, MorphTarget, Node, Primitive, Scene, Skin, Transform,
};
use chiaro::techniques::scene::InstanceData;
use chiaro::techniques::scene::clusters::ClusterData;
use chiaro::{Aov, LoadedScene, Recorder, View};
use chiaro_gpu::{Buffer, BufferReadback};
use chiaro_testkit::{Stage, Studio, device, direct, nmae};
use glam::{Affine3A, Quat, Vec2, Vec3, Vec4};

const SIZE: [u32; 2] = [160, 120];
const JOINTS: usize = 3;

/// A tube along Y of three joints, one metre each, with a bulge as its only morph target.
fn tube(material: usize) -> Primitive {
    const RINGS: usize = 48;
    const SIDES: usize = 40;
    let mut tube = Primitive { material, ..Primitive::default() };
    let mut bulge = MorphTarget::default();
    for ring in 0..=RINGS {
        let height = 3.0 * ring as f32 / RINGS as f32;
        for side in 0..SIDES {
            let around = Vec2::from_angle(TAU * side as f32 / SIDES as f32);
            let out = Vec3::new(around.x, 0.0, around.y);
            tube.positions.push(0.3 * out + height * Vec3::Y);
            tube.normals.push(out);
            let shape = (1.0 - (height - 1.5).abs()).max(0.0);
            bulge.positions.push(0.4 * shape * out);
            bulge.normals.push(0.5 * (height - 1.5) * shape * Vec3::Y);
            let along = height - 0.5;
            let joint = (along.floor().max(0.0) as u16).min(JOINTS as u16 - 2);
            let share = (along - f32::from(joint)).clamp(0.0, 1.0);
            tube.joints.push([joint, joint + 1, 0, 0]);
            tube.joint_weights.push(Vec4::new(1.0 - share, share, 0.0, 0.0));
        }
    }
    for ring in 0..RINGS as u32 {
        for side in 0..SIDES as u32 {
            let next = (side + 1) % SIDES as u32;
            let [a, b] = [ring * SIDES as u32 + side, ring * SIDES as u32 + next];
            let [c, d] = [a + SIDES as u32, b + SIDES as u32];
            tube.indices.extend([a, c, b, b, c, d]);
        }
    }
    tube.morph_targets = vec![bulge];
    tube
}

/// What stands still around the tube.
fn surroundings() -> Stage {
    let mut stage = Stage::new();
    let grey = stage.lambert(0.6);
    stage.quad(Vec3::ZERO, Vec3::X * 5.0, Vec3::NEG_Z * 5.0, grey);
    stage.sun(3.0, Vec3::new(1.0, -1.2, -0.5));
    stage
}

fn channel(node: usize, keys: Keys) -> Channel {
    Channel { node, times_s: vec![0.0, 1.0], interpolation: Interpolation::Linear, keys }
}

/// The tube, bent and swollen more and more within a second, and a board that flies past it.
pub fn moving() -> Scene {
    let mut stage = surroundings();
    let material = stage.lambert(0.8);
    stage.quad(Vec3::new(0.0, 2.0, 0.0), Vec3::X * 0.4, Vec3::Y * 0.3, material);
    let board = stage.scene.nodes.len() - 1;
    let scene = &mut stage.scene;
    let first = scene.nodes.len();
    for joint in 0..JOINTS {
        let translation = if joint == 0 { Vec3::ZERO } else { Vec3::Y };
        let parent_from_node = Transform::Trs { translation, rotation: Quat::IDENTITY, scale: Vec3::ONE };
        let parent = (joint > 0).then(|| first + joint - 1);
        scene.nodes.push(Node { parent, parent_from_node, ..Node::default() });
    }
    let joint_from_object = (0..JOINTS).map(|j| Affine3A::from_translation(-(j as f32) * Vec3::Y)).collect();
    scene.skins.push(Skin {
        joints: (first..first + JOINTS).collect(),
        joint_from_object,
        ..Skin::default()
    });
    let mesh = Mesh { primitives: vec![tube(material)], morph_weights: vec![0.0], ..Mesh::default() };
    scene.meshes.push(mesh);
    let model = scene.nodes.len();
    scene.nodes.push(Node { mesh: Some(scene.meshes.len() - 1), skin: Some(0), ..Node::default() });
    let turn = |angle: f32| Keys::Rotation(vec![Quat::IDENTITY, Quat::from_rotation_z(angle)]);
    let channels = vec![
        channel(first + 1, turn(-0.9)),
        channel(first + 2, turn(-0.7)),
        // Not uniform: normals must not be carried along like positions.
        channel(first + 2, Keys::Scale(vec![Vec3::ONE, Vec3::new(1.6, 0.8, 1.0)])),
        channel(model, Keys::MorphWeights(vec![0.0, 1.0])),
        channel(board, Keys::Translation(vec![Vec3::new(-1.5, 0.0, 1.0), Vec3::new(1.5, 0.5, 1.0)])),
    ];
    scene.animations.push(Animation { name: String::new(), channels });
    stage.scene
}

/// The same at one moment, bent by the CPU, with nothing that could move.
pub fn frozen(scene: &Scene, time_s: f64) -> Scene {
    let pose = scene.pose(time_s);
    let mut frozen = Scene { animations: Vec::new(), skins: Vec::new(), ..scene.clone() };
    for (index, node) in frozen.nodes.iter_mut().enumerate() {
        node.parent = None;
        node.parent_from_node = Transform::Matrix(pose.world_from_node[index]);
        let Some(mesh) = node.mesh.filter(|_| scene.deforms(&scene.nodes[index])) else { continue };
        node.skin = None;
        node.parent_from_node = Transform::default();
        for (bent, at_rest) in frozen.meshes[mesh].primitives.iter_mut().zip(&scene.meshes[mesh].primitives) {
            let (positions, normals) = scene.posed_vertices(&pose, index, at_rest).unzip();
            *bent = Primitive {
                positions,
                normals,
                indices: at_rest.indices.clone(),
                material: at_rest.material,
                ..Primitive::default()
            };
        }
        frozen.meshes[mesh].morph_weights.clear();
    }
    frozen
}

/// The scene without animations, at rest as they have it at a moment.
pub fn resting(scene: &Scene, time_s: f64) -> Scene {
    let pose = scene.pose(time_s);
    let mut resting = Scene { animations: Vec::new(), ..scene.clone() };
    for (index, node) in resting.nodes.iter_mut().enumerate() {
        let world = |node: usize| pose.world_from_node[node];
        let parent = node.parent.map_or(Affine3A::IDENTITY, world);
        node.parent_from_node = Transform::Matrix(parent.inverse() * world(index));
        node.morph_weights.clone_from(&pose.morph_weights[index]);
    }
    resting
}

/// The tube as a file without normals has it.
pub fn facetted(mut scene: Scene) -> Scene {
    let Some(tube) = scene.meshes.last_mut().and_then(|mesh| mesh.primitives.first_mut()) else {
        return scene;
    };
    let corners = std::mem::take(&mut tube.indices);
    let all = |of: &[Vec3]| corners.iter().map(|&vertex| of[vertex as usize]).collect();
    tube.positions = all(&tube.positions);
    tube.normals = vec![Vec3::Y; corners.len()];
    tube.joints = corners.iter().map(|&vertex| tube.joints[vertex as usize]).collect();
    tube.joint_weights = corners.iter().map(|&vertex| tube.joint_weights[vertex as usize]).collect();
    tube.morph_targets[0].positions = all(&tube.morph_targets[0].positions);
    tube.morph_targets[0].normals.clear();
    tube.indices = (0..corners.len() as u32).collect();
    tube.flat = true;
    scene
}

pub fn view() -> View {
    View::look_at(Vec3::new(1.0, 3.0, 7.0), Vec3::new(0.5, 1.2, 0.0), 0.8, 0.1)
}

/// Share of the pixels that differ by more than `tolerance` in any channel.
fn share_off(a: &chiaro_image::Image, b: &chiaro_image::Image, tolerance: f32) -> f64 {
    let pairs = a.pixels().iter().zip(b.pixels());
    let off = pairs.filter(|(a, b)| a.iter().zip(*b).any(|(a, b)| (a - b).abs() > tolerance)).count();
    off as f64 / a.pixels().len() as f64
}

#[test]
fn normals_bounds_and_shadows_of_what_bends_follow() {
    let gpu = device();
    let source = moving();
    let mut studio = Studio::new(&gpu, direct(&[("shadow.resolution", "512")]));
    let mut loaded = studio.load(&source);
    let at_rest = studio.aov(&loaded, &view(), SIZE, 1, Aov::Normal);
    // Forward in time, a jump, and back.
    for time_s in [0.25, 1.0, 0.5] {
        loaded.set_pose(&source, &source.pose(time_s)).unwrap();
        let twin = studio.load(&frozen(&source, time_s));
        // The light is the same, not the maps' fit: bounds over all time are wider.
        for (aov, tolerance, share) in
            [(Aov::Normal, 0.01, 0.002), (Aov::Depth, 0.01, 0.002), (Aov::Shadow, 0.1, 0.02)]
        {
            let found = studio.aov(&loaded, &view(), SIZE, 1, aov);
            let expected = studio.aov(&twin, &view(), SIZE, 1, aov);
            let off = share_off(&found, &expected, tolerance);
            assert!(off <= share, "{aov:?} at {time_s} s: {:.2} % of the pixels differ", 100.0 * off);
        }
        let moved = share_off(&studio.aov(&loaded, &view(), SIZE, 1, Aov::Normal), &at_rest, 0.01);
        assert!(moved > 0.01, "nothing moved: {moved}");
    }
}

#[test]
fn a_bending_mesh_without_normals_shows_those_of_its_triangles() {
    let gpu = device();
    let (smooth, source) = (moving(), facetted(moving()));
    let mut studio = Studio::new(&gpu, direct(&[]));
    let mut loaded = studio.load(&source);
    for time_s in [1.0, 0.4] {
        loaded.set_pose(&source, &source.pose(time_s)).unwrap();
        let resting = studio.load(&resting(&source, time_s));
        let [twin, round] = [&source, &smooth].map(|scene| studio.load(&frozen(scene, time_s)));
        let [found, resting, expected, round] =
            [&loaded, &resting, &twin, &round].map(|scene| studio.aov(scene, &view(), SIZE, 1, Aov::Normal));
        for (kind, found) in [("moved", &found), ("resting", &resting)] {
            let off = share_off(found, &expected, 0.01);
            assert!(off <= 0.002, "{kind}, at {time_s} s: {:.2} % of the pixels differ", 100.0 * off);
        }
        let off = share_off(&round, &expected, 0.01);
        assert!(off > 0.01, "facets are no other than what is smooth: {off}");
    }
}

#[test]
fn the_map_of_a_resting_light_shows_casters_that_move() {
    let gpu = device();
    let source = moving();
    let mut studio = Studio::new(&gpu, direct(&[("shadow.resolution", "512")]));
    let mut loaded = studio.load(&source);
    let first = studio.aov(&loaded, &view(), SIZE, 1, Aov::Shadow);
    loaded.set_pose(&source, &source.pose(0.6)).unwrap();
    let kept = studio.aov(&loaded, &view(), SIZE, 1, Aov::Shadow);
    studio.set(direct(&[("shadow.resolution", "512"), ("shadow.cache", "false")]));
    let fresh = studio.aov(&loaded, &view(), SIZE, 1, Aov::Shadow);
    assert_eq!(share_off(&kept, &fresh, 0.0), 0.0);
    assert!(nmae(&first, &kept) > 0.01);
}

fn read<T: bytemuck::Pod>(gpu: &chiaro::Gpu, buffer: &Buffer) -> Vec<T> {
    bytemuck::pod_collect_to_vec(&BufferReadback::start(gpu, buffer).wait(gpu).unwrap())
}

/// Current and previous positions of all bending vertices, and the instances' transforms likewise. Every cluster must
/// lie within its sphere.
pub fn now_and_before(gpu: &chiaro::Gpu, scene: &LoadedScene) -> [Vec<u32>; 2] {
    let [geometry, clusters, instances] = scene.gpu.buffers();
    let words: Vec<u32> = read(gpu, geometry);
    let bending = |c: &&ClusterData| c.flags & 2 != 0;
    let (mut now, mut before) = (Vec::new(), Vec::new());
    for cluster in read::<ClusterData>(gpu, clusters).iter().filter(bending) {
        let (first, count) = (cluster.positions as usize, 3 * cluster.vertex_count as usize);
        now.extend(&words[first..first + count]);
        before.extend(&words[first + count..first + 2 * count]);
        let [x, y, z, radius] = cluster.sphere;
        for position in words[first..first + count].as_chunks::<3>().0 {
            let distance = Vec3::from(position.map(f32::from_bits)).distance(Vec3::new(x, y, z));
            assert!(distance <= radius, "a vertex is {distance} m from the middle of a sphere of {radius} m");
        }
    }
    for instance in read::<InstanceData>(gpu, instances) {
        now.extend(instance.world_from_object.as_flattened().iter().map(|f| f.to_bits()));
        before.extend(instance.previous_world_from_object.as_flattened().iter().map(|f| f.to_bits()));
    }
    [now, before]
}

#[test]
fn where_everything_was_in_the_frame_before_is_kept() {
    let gpu = device();
    let source = moving();
    let mut studio = Studio::new(&gpu, direct(&[]));
    let mut loaded = studio.load(&source);
    let mut state = chiaro::ViewState::new(studio.renderer());
    let mut recorder = Recorder::new(&gpu, false);
    let mut last = None;
    for (time_s, moves) in [(0.0, false), (0.3, true), (0.8, true), (0.8, false), (0.8, false)] {
        loaded.set_pose(&source, &source.pose(time_s)).unwrap();
        let prepared =
            studio.renderer().prepare(&mut state, &loaded, &view(), SIZE, (Vec2::ZERO, 1.0)).unwrap();
        let mut frame = recorder.begin();
        let _ = prepared.record(&mut frame, false);
        frame.submit();
        let [now, before] = now_and_before(&gpu, &loaded);
        assert!(now.len() > 5_000 && now.iter().all(|&bits| f32::from_bits(bits).is_finite()));
        if let Some(last) = last.replace(now.clone()) {
            assert!(before == last, "the previous positions at {time_s} s are not those of the frame before");
        }
        assert_eq!(now != before, moves, "at {time_s} s");
    }
    // The last two frames were the same: nothing was left to do.
    assert!(recorder.log().iter().all(|pass| !pass.name.starts_with("motion/")));
}

#[test]
fn a_mirrored_bending_mesh_shows_its_outside() {
    let gpu = device();
    let mut studio = Studio::new(&gpu, direct(&[]));
    let mut source = moving();
    let model = source.nodes.len() - 1;
    source.nodes[model].skin = None;
    source.nodes[model].parent_from_node = Transform::Trs {
        translation: Vec3::ZERO,
        rotation: Quat::IDENTITY,
        scale: Vec3::new(-1.0, 1.0, 1.0),
    };
    let tube = source.meshes.len() - 1;
    source.materials.push(chiaro::scene::Material { double_sided: false, ..source.materials[0].clone() });
    source.meshes[tube].primitives[0].material = source.materials.len() - 1;
    source.animations.clear();
    let expected = frozen(&source, 0.0);
    let (loaded, twin) = (studio.load(&source), studio.load(&expected));
    let found = studio.aov(&loaded, &view(), SIZE, 1, Aov::Depth);
    // A tube is symmetric: with its triangles' winding as it was, the twin must show the mirrored tube's inside.
    let mirrored = studio.aov(&twin, &view(), SIZE, 1, Aov::Depth);
    assert!(share_off(&found, &mirrored, 0.05) > 0.005, "the twin's winding is wrong on purpose");
    let mut right = expected;
    for triangle in right.meshes[tube].primitives[0].indices.chunks_exact_mut(3) {
        triangle.swap(1, 2);
    }
    let twin = studio.load(&right);
    assert!(share_off(&found, &studio.aov(&twin, &view(), SIZE, 1, Aov::Depth), 0.01) < 0.002);
}

/// A scene as it stands in a pose, with nothing that moves.
pub fn standing(scene: &Scene, pose: &chiaro::scene::Pose) -> Scene {
    let mut standing = scene.clone();
    for (node, at) in standing.nodes.iter_mut().zip(&pose.world_from_node) {
        (node.parent, node.parent_from_node) = (None, Transform::Matrix(*at));
    }
    standing
}

/// A board over a floor under a sun, with nothing that moves, and what somebody makes of it step by step: the board
/// elsewhere, then the sun turned.
pub fn moved_by_hand() -> (Scene, [chiaro::scene::Pose; 2]) {
    let mut stage = surroundings();
    let sun = stage.scene.nodes.len() - 1;
    let material = stage.lambert(0.8);
    stage.quad(Vec3::new(0.0, 1.0, 0.0), Vec3::X * 0.6, Vec3::NEG_Z * 0.6, material);
    let board = stage.scene.nodes.len() - 1;
    let mut first = stage.scene.pose(0.0);
    first.world_from_node[board] = Affine3A::from_translation(Vec3::new(1.2, 0.4, 0.5));
    let mut second = first.clone();
    second.world_from_node[sun] = Affine3A::from_quat(Quat::from_rotation_x(-1.2));
    (stage.scene, [first, second])
}

#[test]
fn a_pose_made_by_hand_moves_what_no_animation_does() {
    let gpu = device();
    let mut studio = Studio::new(&gpu, direct(&[]));
    let (scene, poses) = moved_by_hand();
    let mut loaded = studio.load(&scene);
    // Maps of what rests are kept.
    let at_rest = studio.radiance(&loaded, &view(), SIZE, 1);
    let mut found = Vec::new();
    for pose in [&poses[0], &poses[1]] {
        loaded.set_pose(&scene, pose).unwrap();
        found.push(studio.radiance(&loaded, &view(), SIZE, 1));
    }
    // Several poses between two frames.
    let rest = scene.pose(0.0);
    for pose in [&rest, &poses[0], &poses[1], &poses[1]] {
        loaded.set_pose(&scene, pose).unwrap();
    }
    found.push(studio.radiance(&loaded, &view(), SIZE, 1));
    loaded.set_pose(&scene, &rest).unwrap();
    found.push(studio.radiance(&loaded, &view(), SIZE, 1));
    for (found, pose) in found.iter().zip([&poses[0], &poses[1], &poses[1], &rest]) {
        let standing = studio.load(&standing(&scene, pose));
        let expected = studio.radiance(&standing, &view(), SIZE, 1);
        assert!(nmae(found, &expected) < 0.003, "{}", nmae(found, &expected));
    }
    assert!(nmae(&found[0], &at_rest) > 0.02, "nothing moved");
}
