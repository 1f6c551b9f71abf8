use std::collections::{HashMap, HashSet};

use glam::Vec3;

use super::{solid::position_key, *};
use crate::{AlphaMode, Mesh, Primitive, invariants::assert_sound};

fn scenes() -> impl Iterator<Item = Scene> {
    SCENES.iter().map(|(name, _)| build(name).expect("listed"))
}

fn triangles(p: &Primitive) -> impl Iterator<Item = [usize; 3]> {
    p.indices.chunks_exact(3).map(|t| [t[0] as usize, t[1] as usize, t[2] as usize])
}

#[test]
fn the_default_scene_is_listed_and_unknown_names_are_refused() {
    assert!(SCENES.iter().any(|(name, _)| *name == DEFAULT));
    assert!(build("no such scene").is_none());
}

#[test]
fn names_are_unique_and_each_scene_bears_its_own() {
    let names: HashSet<_> = SCENES.iter().map(|(name, _)| *name).collect();
    assert_eq!(names.len(), SCENES.len());
    for (scene, (name, _)) in scenes().zip(SCENES) {
        assert_eq!(scene.name, *name);
        let cameras: HashSet<_> = scene.cameras.iter().map(|camera| &camera.name).collect();
        assert_eq!(cameras.len(), scene.cameras.len(), "{name}: two cameras of one name");
    }
}

#[test]
fn descriptions_say_how_many_triangles_there_are() {
    for (scene, (name, about)) in scenes().zip(SCENES) {
        let count = scene.triangle_count() as f32;
        let said = about.rsplit("; ").next().and_then(|part| part.strip_suffix(" triangles")).expect("a count");
        let said = match said.strip_suffix(" million") {
            Some(millions) => millions.parse::<f32>().expect("a number") * 1e6,
            None => said.replace(',', "").parse().expect("a number"),
        };
        assert!((said / count - 1.0).abs() < 0.06, "{name}: {count} triangles, not {said}");
    }
}

#[test]
fn scenes_keep_the_data_models_promises() {
    for scene in scenes() {
        assert_sound(&scene);
        assert!(!scene.placed_cameras().is_empty() && !scene.placed_lights().is_empty(), "{}", scene.name);
        for (mesh, p) in scene.meshes.iter().flat_map(|m| m.primitives.iter().map(move |p| (m, p))) {
            assert_eq!(p.uvs[0].len(), p.positions.len(), "{}", mesh.name);
            for (t, normal) in p.tangents.iter().zip(&p.normals) {
                assert!(t.truncate().dot(*normal).abs() < 1e-3, "{}", mesh.name);
            }
        }
    }
}

#[test]
fn vertex_normals_lie_on_the_side_that_winding_calls_the_front() {
    for s in scenes() {
        for (mesh, p) in s.meshes.iter().flat_map(|m| m.primitives.iter().map(move |p| (m, p))) {
            for t in triangles(p) {
                let [a, b, c] = t.map(|i| p.positions[i]);
                let face = (b - a).cross(c - a);
                assert!(face.length() > 0.0, "{} has a triangle without area at {a}", mesh.name);
                // Smoothing stops at 50° between faces, so no vertex normal leans further from its face.
                assert!(t.iter().all(|i| p.normals[*i].dot(face.normalize()) > 0.6), "{} at {a}", mesh.name);
            }
        }
    }
}

/// Parts of a mesh that bound a body: leaves cut out by alpha do not, nor does water, which is one interface.
fn bounding<'a>(s: &'a Scene, mesh: &'a Mesh) -> Vec<&'a Primitive> {
    let bounds = |p: &&Primitive| {
        let material = &s.materials[p.material];
        material.alpha == AlphaMode::Opaque && material.name != "water"
    };
    mesh.primitives.iter().filter(bounds).collect()
}

/// Edges, by position, that are not used equally often in both directions.
fn open_edges(primitives: &[&Primitive]) -> Vec<([i32; 3], [i32; 3])> {
    let mut balance: HashMap<([i32; 3], [i32; 3]), i32> = HashMap::new();
    for p in primitives {
        for t in triangles(p) {
            let key = t.map(|i| position_key(p.positions[i]));
            for (a, b) in [(key[0], key[1]), (key[1], key[2]), (key[2], key[0])] {
                *balance.entry((a.min(b), a.max(b))).or_default() += if a < b { 1 } else { -1 };
            }
        }
    }
    balance.into_iter().filter(|(_, n)| *n != 0).map(|(edge, _)| edge).collect()
}

#[test]
fn every_mesh_is_closed_and_looks_outwards() {
    for s in scenes() {
        for mesh in &s.meshes {
            let primitives = bounding(&s, mesh);
            let open = open_edges(&primitives);
            assert!(
                open.is_empty(),
                "{}: {} open edges such as {:?} / 16 mm",
                mesh.name,
                open.len(),
                open[0]
            );
            let volume = |p: &&Primitive| -> f32 {
                let of = |t: [usize; 3]| {
                    let [a, b, c] = t.map(|i| p.positions[i]);
                    a.dot(b.cross(c)) / 6.0
                };
                triangles(p).map(of).sum()
            };
            let inside = primitives.iter().map(volume).sum::<f32>();
            assert!(inside > 0.0 || primitives.is_empty(), "{} is inside out", mesh.name);
        }
    }
}

#[test]
fn building_twice_gives_the_same_scene() {
    for (name, _) in SCENES {
        let [mut a, mut b] = [(); 2].map(|()| build(name).expect("listed"));
        // Meshes bit by bit: as text they would fill gigabytes.
        let [of_a, of_b] = [&mut a, &mut b].map(|scene| std::mem::take(&mut scene.meshes));
        assert_eq!(format!("{a:?}"), format!("{b:?}"));
        assert!(a.images == b.images && a.environment == b.environment, "{name}");
        assert_eq!(of_a.len(), of_b.len(), "{name}");
        let parts = |meshes: &'_ [Mesh]| meshes.iter().flat_map(|m| m.primitives.clone()).collect::<Vec<_>>();
        for (p, q) in parts(&of_a).iter().zip(&parts(&of_b)) {
            assert!(p.positions == q.positions && p.normals == q.normals && p.tangents == q.tangents, "{name}");
            assert!(p.indices == q.indices && p.uvs == q.uvs && p.material == q.material, "{name}");
        }
    }
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
fn what_moves_stays_near_and_comes_back() {
    for scene in scenes() {
        let Some(duration_s) = scene.duration_s() else { continue };
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
fn outdoor_scenes_have_a_sky_that_fits_their_sun() {
    for name in ["courtyard", "pool", "terrain", "grove"] {
        let scene = build(name).expect("listed");
        let sky = sky::horizontal_lux(scene.environment.as_ref().expect("a sky"));
        let sun = scene.lights.iter().find(|light| light.name == "sun").expect("a sun").intensity;
        assert!((0.08..0.35).contains(&(sky / sun)), "{name}: {sky} lx of sky, {sun} lx of sun");
    }
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

#[test]
fn cameras_stand_in_free_air() {
    for s in scenes() {
        let world = s.world_from_node();
        for (camera, pose) in s.placed_cameras() {
            let eye: Vec3 = pose.w_axis.truncate();
            for (node, m) in s.nodes.iter().zip(&world) {
                for p in node.mesh.iter().flat_map(|mesh| &s.meshes[*mesh].primitives) {
                    let nearest = p.positions.iter().map(|v| m.transform_point3(*v).distance(eye));
                    let nearest = nearest.fold(f32::INFINITY, f32::min);
                    assert!(nearest > 0.3, "camera {} of {} touches {}", camera, s.name, node.name);
                }
            }
        }
    }
}
