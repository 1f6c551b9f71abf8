use std::collections::{HashMap, HashSet};

use glam::Vec3;

use super::{solid::position_key, *};
use crate::{Material, Mesh, Primitive, TextureRef};

fn scenes() -> impl Iterator<Item = Scene> {
    SCENES.iter().map(|(name, _)| build(name).expect("listed"))
}

fn texture_refs(m: &Material) -> impl Iterator<Item = TextureRef> {
    [
        m.base_color_texture,
        m.metallic_roughness_texture,
        m.specular_texture,
        m.specular_color_texture,
        m.normal_texture,
        m.occlusion_texture,
        m.emissive_texture,
    ]
    .into_iter()
    .flatten()
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
fn every_index_is_in_range_and_nodes_follow_their_parents() {
    for s in scenes() {
        for (i, node) in s.nodes.iter().enumerate() {
            assert!(node.parent.is_none_or(|p| p < i));
            assert!(node.mesh.is_none_or(|m| m < s.meshes.len()));
            assert!(node.camera.is_none_or(|c| c < s.cameras.len()));
            assert!(node.light.is_none_or(|l| l < s.lights.len()));
            assert!(node.parent_from_node.affine().is_finite());
        }
        assert!(s.textures.iter().all(|t| t.image < s.images.len()));
        for r in s.materials.iter().flat_map(texture_refs) {
            assert!(r.texture < s.textures.len() && r.uv_set < 2);
        }
        assert!(s.images.iter().all(|i| i.rgba.len() == (4 * i.width * i.height) as usize));
        assert!(!s.placed_cameras().is_empty() && !s.placed_lights().is_empty());
    }
}

#[test]
fn streams_are_finite_equally_long_and_unit_where_they_must_be() {
    for s in scenes() {
        for (mesh, p) in s.meshes.iter().flat_map(|m| m.primitives.iter().map(move |p| (m, p))) {
            let n = p.positions.len();
            assert!(n >= 3 && p.indices.len() >= 3 && p.indices.len().is_multiple_of(3), "{}", mesh.name);
            assert!(p.indices.iter().all(|i| (*i as usize) < n), "{}", mesh.name);
            assert!(p.normals.len() == n && p.uvs[0].len() == n && p.material < s.materials.len());
            assert!(p.positions.iter().all(|v| v.is_finite()) && p.uvs[0].iter().all(|v| v.is_finite()));
            assert!(p.normals.iter().all(|v| (v.length() - 1.0).abs() < 1e-4), "{}", mesh.name);
            let mapped = s.materials[p.material].normal_texture.is_some();
            assert_eq!(p.tangents.len(), if mapped { n } else { 0 }, "{}", mesh.name);
            for (t, normal) in p.tangents.iter().zip(&p.normals) {
                let xyz = t.truncate();
                assert!(
                    (xyz.length() - 1.0).abs() < 1e-4 && xyz.dot(*normal).abs() < 1e-3 && t.w.abs() == 1.0
                );
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

/// Edges, by position, that are not used equally often in both directions.
fn open_edges(mesh: &Mesh) -> Vec<([i32; 3], [i32; 3])> {
    let mut balance: HashMap<([i32; 3], [i32; 3]), i32> = HashMap::new();
    for p in &mesh.primitives {
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
            let open = open_edges(mesh);
            assert!(
                open.is_empty(),
                "{}: {} open edges such as {:?} / 16 mm",
                mesh.name,
                open.len(),
                open[0]
            );
            let volume = |p: &Primitive| -> f32 {
                let of = |t: [usize; 3]| {
                    let [a, b, c] = t.map(|i| p.positions[i]);
                    a.dot(b.cross(c)) / 6.0
                };
                triangles(p).map(of).sum()
            };
            assert!(mesh.primitives.iter().map(volume).sum::<f32>() > 0.0, "{} is inside out", mesh.name);
        }
    }
}

#[test]
fn building_twice_gives_the_same_scene() {
    for (name, _) in SCENES {
        let (a, b) = (build(name).expect("listed"), build(name).expect("listed"));
        assert_eq!(format!("{a:?}"), format!("{b:?}"));
        assert!(a.images == b.images);
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
