use std::collections::{HashMap, HashSet};

use glam::Vec3;

use super::{solid::position_key, *};
use crate::{AlphaMode, LightKind, Mesh, Primitive, invariants::assert_sound};

/// A test for each scene, so that they run side by side and each is built no more often than it must be.
macro_rules! promises {
    ($($name:ident)*) => {
        const TESTED: &[&str] = &[$(stringify!($name)),*];
        mod keeps_its_promises {
            $(#[test]
            fn $name() {
                super::assert_promises(stringify!($name));
            })*
        }
    };
}

promises!(nave courtyard terrain ring ball knot pool grove dancer flight door cornell);

#[test]
fn every_scene_is_listed_once_and_tested() {
    let names: Vec<&str> = SCENES.iter().map(|(name, _)| *name).collect();
    let distinct: HashSet<_> = names.iter().collect();
    assert_eq!(distinct.len(), names.len());
    assert_eq!(distinct, TESTED.iter().collect());
}

fn assert_promises(name: &str) {
    let scene = build(name).expect("listed");
    assert_eq!(scene.name, name);
    assert_sound(&scene);
    assert_the_triangle_count_is_as_said(&scene);
    assert_views_and_lights(&scene);
    for mesh in &scene.meshes {
        assert_streams(mesh);
        assert_closed(&scene, mesh);
    }
    assert_motion(&scene);
    assert_same(scene, build(name).expect("listed"));
}

#[test]
fn a_height_field_is_a_closed_block_whatever_its_shape() {
    let deep = |x: usize, z: usize| if x == 3 && z == 2 { 0.0 } else { 9.0 + (x * z % 5) as f32 };
    let flat = |_: usize, _: usize| 0.0;
    let heights: [(&(dyn Fn(usize, usize) -> f32 + Sync), usize); 3] = [(&deep, 7), (&flat, 4), (&deep, 2)];
    for (height, side) in heights {
        let scene = height_field(&HeightField { name: "field", side, size_m: [30.0, 90.0], height });
        assert_sound(&scene);
        assert_closed(&scene, &scene.meshes[0]);
        assert_views_and_lights(&scene);
    }
}

fn assert_the_triangle_count_is_as_said(scene: &Scene) {
    let (name, about) = SCENES.iter().find(|(name, _)| *name == scene.name).expect("listed");
    let count = scene.triangle_count() as f32;
    let said = about.rsplit("; ").next().and_then(|part| part.strip_suffix(" triangles")).expect("a count");
    let said = match said.strip_suffix(" million") {
        Some(millions) => millions.parse::<f32>().expect("a number") * 1e6,
        None => said.replace(',', "").parse().expect("a number"),
    };
    assert!((said / count - 1.0).abs() < 0.06, "{name}: {count} triangles, not {said}");
}

fn assert_views_and_lights(scene: &Scene) {
    let name = &scene.name;
    assert!(!scene.placed_cameras().is_empty() && !scene.placed_lights().is_empty(), "{name}");
    let cameras: HashSet<_> = scene.cameras.iter().map(|camera| &camera.name).collect();
    assert_eq!(cameras.len(), scene.cameras.len(), "{name}: two cameras of one name");
    let world = scene.world_from_node();
    let nearest = |eye: Vec3| {
        let mut nearest = (f32::INFINITY, "");
        for (node, m) in scene.nodes.iter().zip(&world) {
            for p in node.mesh.iter().flat_map(|mesh| &scene.meshes[*mesh].primitives) {
                let squares = p.positions.iter().map(|v| m.transform_point3(*v).distance_squared(eye));
                let square = squares.fold(f32::INFINITY, f32::min);
                if square.sqrt() < nearest.0 {
                    nearest = (square.sqrt(), &node.name);
                }
            }
        }
        nearest
    };
    for (camera, pose) in scene.placed_cameras() {
        let (camera, (distance, what)) = (&scene.cameras[camera], nearest(pose.w_axis.truncate()));
        assert!(distance > 3.0 * camera.near_m, "{name}: camera {} touches {what}", camera.name);
    }
    for (light, pose) in scene.placed_lights() {
        let light = &scene.lights[light];
        if light.kind == LightKind::Directional {
            // The dusk of flight has no proportion to keep.
            let Some(sky) = scene.environment.as_ref().filter(|sky| sky.name != "dusk") else { continue };
            let sky = sky::horizontal_lux(sky);
            assert!(
                (0.1..0.25).contains(&(sky / light.intensity)),
                "{name}: {sky} lx of sky, {} lx of sun",
                light.intensity
            );
        } else {
            let (distance, what) = nearest(pose.translation.into());
            assert!(distance > 0.01, "{name}: light {} is in {what}", light.name);
        }
    }
}

fn assert_streams(mesh: &Mesh) {
    for p in &mesh.primitives {
        assert_eq!(p.uvs[0].len(), p.positions.len(), "{}", mesh.name);
        for (t, normal) in p.tangents.iter().zip(&p.normals) {
            assert!(t.truncate().dot(*normal).abs() < 1e-3, "{}", mesh.name);
        }
        for t in triangles(p) {
            let [a, b, c] = t.map(|i| p.positions[i]);
            let face = (b - a).cross(c - a);
            assert!(face.length() > 0.0, "{} has a triangle without area at {a}", mesh.name);
            // Smoothing stops at 50° between faces, so a vertex normal leans no further from its face. Height fields
            // are smooth everywhere, but not much rougher.
            let leans = t.map(|i| p.normals[i].dot(face.normalize()));
            assert!(leans.iter().all(|cos| *cos > 0.4), "{} at {a}: {leans:?}", mesh.name);
        }
    }
}

fn triangles(p: &Primitive) -> impl Iterator<Item = [usize; 3]> {
    p.indices.chunks_exact(3).map(|t| [t[0] as usize, t[1] as usize, t[2] as usize])
}

/// Parts of a mesh that bound a body: leaves cut out by alpha do not, nor does water, which is one interface.
fn bounding<'a>(scene: &'a Scene, mesh: &'a Mesh) -> Vec<&'a Primitive> {
    let bounds = |p: &&Primitive| {
        let material = &scene.materials[p.material];
        material.alpha == AlphaMode::Opaque && material.name != "water"
    };
    mesh.primitives.iter().filter(bounds).collect()
}

/// Panics where an edge, known by its ends' positions, is not used equally often in both directions, or where the body
/// is inside out.
fn assert_closed(scene: &Scene, mesh: &Mesh) {
    let primitives = bounding(scene, mesh);
    let mut points: HashMap<[i32; 3], u32> = HashMap::new();
    let mut edges: Vec<(u32, u32, bool)> = Vec::new();
    let mut volume = 0.0;
    for p in &primitives {
        let point = |v: &Vec3| {
            let next = points.len() as u32;
            *points.entry(position_key(*v)).or_insert(next)
        };
        let ids: Vec<u32> = p.positions.iter().map(point).collect();
        for t in triangles(p) {
            for (a, b) in [(t[0], t[1]), (t[1], t[2]), (t[2], t[0])] {
                let (a, b) = (ids[a], ids[b]);
                edges.push((a.min(b), a.max(b), a < b));
            }
            let [a, b, c] = t.map(|i| p.positions[i]);
            volume += a.dot(b.cross(c)) / 6.0;
        }
    }
    edges.sort_unstable();
    for uses in edges.chunk_by(|a, b| (a.0, a.1) == (b.0, b.1)) {
        let there = uses.iter().filter(|edge| edge.2).count();
        if 2 * there != uses.len() {
            let at = |id: u32| points.iter().find(|(_, i)| **i == id).map(|(key, _)| key);
            let (a, b) = (at(uses[0].0), at(uses[0].1));
            panic!("{}: {} is open from {a:?} to {b:?} / 16 mm", scene.name, mesh.name);
        }
    }
    assert!(volume > 0.0 || primitives.is_empty(), "{}: {} is inside out", scene.name, mesh.name);
}

/// What moves stays near and comes back.
fn assert_motion(scene: &Scene) {
    let Some(duration_s) = scene.duration_s() else { return };
    let (lo, hi) = scene.bounds().expect("geometry");
    let size = (hi - lo).max_element();
    for k in 0..=24 {
        let pose = scene.pose(f64::from(duration_s) * f64::from(k) / 24.0);
        let (lo_now, hi_now) = scene.bounds_at(&pose).expect("geometry");
        assert!(lo_now.is_finite() && hi_now.is_finite(), "{}", scene.name);
        let moved = (lo_now - lo).abs().max_element().max((hi_now - hi).abs().max_element());
        assert!(moved < 0.2 * size, "{}: {moved} m at {k}/24", scene.name);
    }
    let [start, end] = [0.0, f64::from(duration_s)].map(|t| scene.pose(t));
    for (a, b) in start.world_from_node.iter().zip(&end.world_from_node) {
        assert!(a.abs_diff_eq(*b, 1e-3), "{} jumps when it starts again", scene.name);
    }
}

fn assert_same(mut a: Scene, mut b: Scene) {
    // Meshes bit by bit: as text they would fill gigabytes.
    let [of_a, of_b] = [&mut a, &mut b].map(|scene| std::mem::take(&mut scene.meshes));
    assert_eq!(format!("{a:?}"), format!("{b:?}"));
    assert!(a.images == b.images && a.environment == b.environment, "{}", a.name);
    assert_eq!(of_a.len(), of_b.len(), "{}", a.name);
    let parts = |meshes: &[Mesh]| meshes.iter().map(|m| m.primitives.len()).collect::<Vec<_>>();
    assert_eq!(parts(&of_a), parts(&of_b), "{}", a.name);
    let [of_a, of_b] = [&of_a, &of_b].map(|meshes| meshes.iter().flat_map(|m| &m.primitives));
    for (p, q) in of_a.zip(of_b) {
        assert!(p.positions == q.positions && p.normals == q.normals && p.tangents == q.tangents);
        assert!(p.indices == q.indices && p.uvs == q.uvs && p.material == q.material);
    }
}

#[test]
fn the_default_scene_is_listed_and_unknown_names_are_refused() {
    assert!(SCENES.iter().any(|(name, _)| *name == DEFAULT));
    assert!(build("no such scene").is_none());
}

#[test]
fn the_terrain_and_its_sculpture_are_as_large_as_the_benchmark_says() {
    let scene = build("terrain").expect("listed");
    let vertices = |name: &str| {
        let mesh = scene.meshes.iter().find(|mesh| mesh.name == name).expect("modelled");
        mesh.primitives[0].positions.len()
    };
    assert_eq!(vertices("terrain"), 135 * 135);
    assert!((1_250_000..=1_350_000).contains(&vertices("sculpture")));
}

#[test]
fn the_dancer_is_skinned_and_morphs_and_something_flies_in_flight() {
    let dancer = build("dancer").expect("listed");
    let body = dancer.nodes.iter().find(|node| node.skin.is_some()).expect("skinned");
    assert_eq!(dancer.meshes[body.mesh.expect("a mesh")].morph_targets(), 2);
    let flight = build("flight").expect("listed");
    let (before, after) = (flight.pose(0.0), flight.pose(5.0));
    let eye = |pose| flight.placed_cameras_at(pose)[0].1.w_axis.truncate();
    assert!(eye(&before).distance(eye(&after)) > 3.0);
    let lights = [before, after].map(|pose| flight.placed_lights_at(&pose));
    let turned = lights[0].iter().zip(&lights[1]).filter(|(a, b)| !a.1.abs_diff_eq(b.1, 1e-3));
    assert_eq!(turned.count(), 1);
}

#[test]
fn the_nave_has_between_60_and_90_thousand_triangles() {
    let count = build("nave").expect("listed").triangle_count();
    assert!((60_000..=90_000).contains(&count), "{count}");
}

#[test]
fn texture_borders_continue_on_the_other_side() {
    // A seam would show as a step between opposite borders that is larger than steps inside.
    let s = build("nave").expect("listed");
    for name in [
        "limestone blocks colour",
        "vault blocks colour",
        "flags colour",
        "dressed stone colour",
        "oak colour",
    ] {
        let image = s.images.iter().find(|i| i.name == name).expect("painted");
        let n = image.width as usize;
        let step = |x0: usize, x1: usize| -> f32 {
            let at = |x: usize, y: usize| f32::from(image.rgba[(y * n + x) * 4 + 1]);
            (0..n).map(|y| (at(x0, y) - at(x1, y)).abs()).sum::<f32>() / n as f32
        };
        let inside = (1..n).map(|x| step(x - 1, x)).fold(0.0, f32::max);
        assert!(step(n - 1, 0) <= inside, "{name}: {} across the border, {inside} inside", step(n - 1, 0));
    }
}

#[test]
fn instances_share_their_meshes() {
    let s = build("nave").expect("listed");
    let placed: Vec<_> = s.nodes.iter().filter_map(|n| n.mesh).collect();
    let distinct: HashSet<_> = placed.iter().collect();
    assert_eq!(distinct.len(), s.meshes.len());
    assert!(placed.len() > 5 * distinct.len());
}
