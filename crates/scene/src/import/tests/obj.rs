//! OBJ and MTL documents, right and wrong.

use std::path::{Path, PathBuf};

use glam::{Vec2, Vec3, Vec4};

use super::obj_bytes as from_bytes;
use crate::invariants::assert_sound;
use crate::{AlphaMode, Reflection, Scene, SceneError};

fn parse(text: &str) -> Result<Scene, SceneError> {
    from_bytes(Path::new("nowhere/test.obj"), text.as_bytes())
}

fn load(text: &str) -> Scene {
    let scene = parse(text).unwrap();
    assert_sound(&scene);
    scene
}

const SQUARE: &str = "v -1 -1 0\nv 1 -1 0\nv 1 1 0\nv -1 1 0\n";

/// A folder of this test's own, removed at the end.
struct Folder(PathBuf);

impl Folder {
    fn new(test: &str) -> Self {
        let path = std::env::temp_dir().join(format!("chiaro-obj-{test}-{}", std::process::id()));
        std::fs::create_dir_all(&path).unwrap();
        Self(path)
    }

    fn write(&self, name: &str, content: &[u8]) {
        let path = self.0.join(name);
        std::fs::create_dir_all(path.parent().unwrap()).unwrap();
        std::fs::write(path, content).unwrap();
    }

    fn image(&self, name: &str, pixel: impl Fn(u32, u32) -> [u8; 4]) {
        image::RgbaImage::from_fn(8, 8, |x, y| image::Rgba(pixel(x, y))).save(self.0.join(name)).unwrap();
    }

    /// Loads a textured square with the material `m` of the library text `mtl`.
    fn load(&self, mtl: &str) -> Scene {
        self.write("test.mtl", mtl.as_bytes());
        let obj =
            format!("mtllib test.mtl\n{SQUARE}vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nusemtl m\nf 1/1 2/2 3/3 4/4\n");
        let scene = from_bytes(&self.0.join("test.obj"), obj.as_bytes()).unwrap();
        assert_sound(&scene);
        scene
    }
}

impl Drop for Folder {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

#[test]
fn negative_indices_count_back_and_v_is_flipped() {
    let scene = load(&format!("{SQUARE}vt 0.25 0.25\nf -4/-1 -3/-1 -2/-1 -1/-1\n"));
    assert_eq!(scene.triangle_count(), 2);
    let primitive = &scene.meshes[0].primitives[0];
    assert!(primitive.uvs[0].iter().all(|&uv| uv == Vec2::new(0.25, 0.75)));
    assert!(primitive.normals.iter().all(|n| n.abs_diff_eq(Vec3::Z, 1e-6)));
    assert!(scene.materials[0].double_sided && scene.warnings.is_empty());
}

#[test]
fn faces_may_mix_indices_and_leave_some_out() {
    let scene = load(&format!("{SQUARE}vt 1 1\nvn 0 0 1\nf 1/1/1 2//1 3/1\nf 1 3//1 4/1/1\n"));
    let primitive = &scene.meshes[0].primitives[0];
    assert_eq!(primitive.indices.len(), 6);
    let uvs_at = |corner: usize| primitive.uvs[0].get(primitive.indices[corner] as usize).copied();
    assert_eq!(uvs_at(0), Some(Vec2::new(1.0, 0.0)));
    assert_eq!(uvs_at(1), Some(Vec2::ZERO));
    assert!(primitive.normals.iter().all(|n| n.abs_diff_eq(Vec3::Z, 1e-6)));
}

#[test]
fn indices_may_point_ahead_and_lines_may_be_continued() {
    let scene = load(&format!("f 1 2 \\\n 3 4\n{SQUARE}"));
    assert_eq!(scene.triangle_count(), 2);
}

#[test]
fn concave_faces_are_covered_once() {
    let scene = load("v 2 3 0\nv 0 0 0\nv 4 3 0\nv 0 6 0\nf 2 3 4 1\n");
    assert!(scene.meshes[0].primitives[0].normals.iter().all(|n| n.z > 0.99));
}

#[test]
fn each_group_is_a_node_and_each_material_in_it_a_primitive() {
    let text =
        format!("{SQUARE}g a\nusemtl x\nf 1 2 3\nusemtl y\nf 1 2 3\nusemtl x\nf 1 3 4\no b c\nf 1 2 3\n");
    let folder = Folder::new("groups");
    folder.write("l.mtl", b"newmtl x\nKd 1 0 0\nnewmtl y\n");
    let scene = from_bytes(&folder.0.join("t.obj"), format!("mtllib l.mtl\n{text}").as_bytes()).unwrap();
    assert_sound(&scene);
    let names: Vec<_> = scene.nodes.iter().map(|node| node.name.as_str()).collect();
    assert_eq!(names, ["a", "b c"]);
    let triangles =
        |mesh: usize| scene.meshes[mesh].primitives.iter().map(|p| p.indices.len() / 3).collect::<Vec<_>>();
    assert_eq!((triangles(0), triangles(1)), (vec![2, 1], vec![1]));
    assert_eq!(scene.materials.len(), 2);
}

#[test]
fn missing_normals_are_smooth_across_small_angles_and_sharp_across_large_ones() {
    // Two squares that share the edge x = 0: folded by 30° and by 90°.
    for (fold, is_smooth) in [(30.0_f32, true), (90.0, false)] {
        let (s, c) = fold.to_radians().sin_cos();
        let scene = load(&format!(
            "v -1 -1 0\nv 0 -1 0\nv 0 1 0\nv -1 1 0\nv {c} -1 {s}\nv {c} 1 {s}\nf 1 2 3 4\nf 2 5 6 3\n"
        ));
        let primitive = &scene.meshes[0].primitives[0];
        let edge: Vec<Vec3> = primitive
            .positions
            .iter()
            .zip(&primitive.normals)
            .filter(|(p, _)| p.x == 0.0)
            .map(|(_, n)| *n)
            .collect();
        assert_eq!(edge.len(), if is_smooth { 2 } else { 4 }, "folded by {fold}°");
        if is_smooth {
            let half = (fold / 2.0).to_radians();
            let expected = Vec3::new(-half.sin(), 0.0, half.cos());
            assert!(edge.iter().all(|n| n.abs_diff_eq(expected, 1e-5)), "{edge:?}");
        }
    }
}

#[test]
fn smoothing_groups_count_instead_of_the_angle_where_the_file_has_them() {
    // Two squares that share the edge x = 0, folded by 10° or 90°; how many normals the edge has.
    let normals_at_edge = |fold: f32, first: &str, second: &str| {
        let (s, c) = fold.to_radians().sin_cos();
        let scene = load(&format!(
            "v -1 -1 0\nv 0 -1 0\nv 0 1 0\nv -1 1 0\nv {c} -1 {s}\nv {c} 1 {s}\n{first}f 1 2 3 4\n{second}f 2 5 6 3\n"
        ));
        scene.meshes[0].primitives[0].positions.iter().filter(|p| p.x == 0.0).count() / 2
    };
    assert_eq!(normals_at_edge(90.0, "s 1\n", ""), 1);
    assert_eq!(normals_at_edge(10.0, "s 1\n", "s 2\n"), 2);
    assert_eq!(normals_at_edge(10.0, "s off\n", ""), 2);
    assert_eq!(normals_at_edge(10.0, "", ""), 1);
}

#[test]
fn a_dark_or_dissolving_body_that_asks_for_glass_transmits() {
    let folder = Folder::new("glass");
    let material = |mtl: &str| {
        let scene = folder.load(&format!("newmtl m\n{mtl}"));
        (scene.materials[0].clone(), scene.warnings.len())
    };
    let (solid, _) =
        material("Kd 0.01 0.01 0.01\nKs 0.3 0.3 0.3\nTf 0.1 0.2 0.3\nNs 200\nNi 1.33\nillum 7\n");
    assert_eq!((solid.transmission, solid.ior, solid.alpha), (1.0, 1.33, AlphaMode::Opaque));
    assert_eq!(
        (solid.base_color, solid.reflection),
        (Vec4::new(0.1, 0.2, 0.3, 1.0), Reflection::MetallicRoughness)
    );
    assert!(solid.thickness > 0.0 && (solid.roughness - 0.3154).abs() < 1e-3, "{solid:?}");
    let (pane, _) = material("Kd 0.8 0.9 0.8\nd 0.25\nNi 1.5\nillum 4\n");
    assert_eq!((pane.transmission, pane.thickness), (0.75, 0.0));
    assert_eq!(pane.base_color, Vec4::new(0.8, 0.9, 0.8, 1.0));
    let (opaque, warnings) = material("Kd 0.8 0.8 0.8\nillum 7\n");
    assert_eq!((opaque.transmission, warnings), (0.0, 1));
    assert_eq!(material("Kd 0 0 0\nTf 1 1 1\nillum 2\n").0.transmission, 0.0);
}

#[test]
fn vertex_colours_arrive_and_a_fourth_number_is_no_colour() {
    let scene = load("v 0 0 0 1 0 1\nv 1 0 0\nv 0 1 0 0 1 0\nf 1 2 3\n");
    let colors = &scene.meshes[0].primitives[0].colors;
    assert_eq!(colors[..2], [Vec4::new(1.0, 0.0, 1.0, 1.0), Vec4::ONE]);
    let weighted = load("v 0 0 0 0.5\nv 1 0 0 0.5\nv 0 1 0 0.5\nf 1 2 3\n");
    assert!(weighted.meshes[0].primitives[0].colors.is_empty());
    assert_eq!(weighted.bounds(), Some((Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0))));
}

#[test]
fn malformed_lines_are_named_by_their_number() {
    for (text, place) in [
        ("v 1 2\n", "line 1"),
        ("v 0 0 0\nv nan 0 0\n", "line 2"),
        ("v 1e30 0 0\n", "line 1"),
        ("v 0 0 0\nf 1 1 2\n", "line 2"),
        ("v 0 0 0\nf 1 1 0\n", "line 2"),
        ("v 0 0 0\nf 1 1 -2\n", "line 2"),
        ("v 0 0 0\nvt 0 0\nf 1/-9223372036854775808 1/1 1/1\n", "line 3"),
        ("v 0 0 0\nvt 0 0\nf 1/9223372036854775807 1/1 1/1\n", "line 3"),
        ("v 0 0 0\nvt 0 0\nvn 0 0 1\nf 1/1/1/1 1 1\n", "line 4"),
        ("v 0 0 0\nf 1 x 1\n", "line 2"),
        ("v 0 0 0\nf /1 1 1\n", "line 2"),
    ] {
        let error = parse(text).unwrap_err().to_string();
        assert!(error.contains(&format!("{place}:")), "{text:?}: {error}");
    }
}

#[test]
fn a_missing_library_is_a_warning_and_a_light_grey() {
    let scene = load(&format!("mtllib absent.mtl\n{SQUARE}usemtl m\nf 1 2 3\n"));
    assert_eq!(scene.warnings.len(), 2, "{:?}", scene.warnings);
    let material = &scene.materials[0];
    assert_eq!((material.base_color, material.specular), (Vec4::new(0.8, 0.8, 0.8, 1.0), 0.0));
}

#[test]
fn highlights_are_phong_and_never_reflect_more_than_arrives() {
    let folder = Folder::new("phong");
    let lambert = folder.load("newmtl m\nKd 0.5 0.5 0.5\nNs 50\nKs 0 0 0\n");
    let material = &lambert.materials[0];
    assert_eq!(
        (material.reflection, material.roughness, material.specular),
        (Reflection::MetallicRoughness, 1.0, 0.0)
    );
    let phong = folder.load("newmtl m\nKd 0.5 0.6 0.5\nNs 50\nKs 0.8 0.8 0.4\n");
    let material = &phong.materials[0];
    assert_eq!(material.reflection, Reflection::Phong { exponent: 50.0 });
    assert!(
        material.specular_color.abs_diff_eq(Vec3::new(0.4, 0.4, 0.2), 1e-6),
        "{}",
        material.specular_color
    );
}

#[test]
fn lines_that_cannot_be_read_do_not_lose_the_library() {
    let folder = Folder::new("lines");
    let scene = folder
        .load("Kd 1 1\nnewmtl m\nKd spectral file.rfl\nKs\nNs x\nkD 0.25\nillum 999\nmap_Kd\nKe 1 2 3\n");
    let material = &scene.materials[0];
    assert_eq!(material.base_color, Vec4::new(0.25, 0.25, 0.25, 1.0));
    assert_eq!(material.emissive, Vec3::new(1.0, 2.0, 3.0));
    assert_eq!(scene.warnings.len(), 5, "{:?}", scene.warnings);
}

#[test]
fn textures_are_found_in_any_case_with_backslashes_and_through_foreign_paths() {
    let folder = Folder::new("lookup");
    folder.write("Maps/keep", b"");
    folder.image("Maps/Stone Wall.PNG", |_, _| [9, 9, 9, 255]);
    for name in ["Maps/Stone Wall.PNG", r"maps\stone wall.png", r"MAPS/STONE WALL.png"] {
        let scene = folder.load(&format!("newmtl m\nKd 0 0 0\nmap_Kd -s 2 2 {name}\n"));
        assert!(scene.warnings.is_empty(), "{name}: {:?}", scene.warnings);
        let material = &scene.materials[0];
        assert_eq!(material.base_color, Vec4::ONE, "a black Kd beside a texture is white");
        assert_eq!(material.alpha, AlphaMode::Opaque);
    }
    folder.image("b.png", |_, _| [9, 9, 9, 255]);
    assert!(folder.load("newmtl m\nmap_Kd C:\\Users\\me\\B.PNG\n").warnings.is_empty());
    let absent = folder.load("newmtl m\nmap_Kd absent.png\n");
    assert!(absent.warnings[0].contains("absent.png") && absent.images.is_empty());
}

#[test]
fn a_dissolve_map_becomes_the_alpha_of_the_base_colour() {
    let folder = Folder::new("dissolve");
    folder.image("color.png", |_, _| [10, 20, 30, 255]);
    folder.image("mask.png", |x, _| if x < 4 { [0, 0, 0, 255] } else { [255; 4] });
    let scene = folder.load("newmtl m\nmap_Kd color.png\nmap_d mask.png\n");
    assert_eq!(scene.materials[0].alpha, AlphaMode::Mask { cutoff: 0.5 });
    let texture = scene.materials[0].base_color_texture.unwrap().texture;
    let image = &scene.images[scene.textures[texture].image];
    assert_eq!((&image.rgba[..4], &image.rgba[28..32]), (&[10, 20, 30, 0][..], &[10, 20, 30, 255][..]));
    let alone = folder.load("newmtl m\nKd 0.5 0.5 0.5\nmap_d mask.png\n");
    assert_eq!(alone.images[0].rgba[..4], [255, 255, 255, 0]);
    assert_eq!(alone.materials[0].base_color, Vec4::new(0.5, 0.5, 0.5, 1.0));
    let glass = folder.load("newmtl m\nTr 0.75\n");
    assert_eq!((glass.materials[0].alpha, glass.materials[0].base_color.w), (AlphaMode::Blend, 0.25));
}

#[test]
fn heights_become_normals_and_normals_stay() {
    let folder = Folder::new("bump");
    folder.image("height.png", |x, _| {
        [x as u8 * 30; 3].into_iter().chain([255]).collect::<Vec<_>>().try_into().unwrap()
    });
    folder.image("normal.png", |_, _| [140, 118, 250, 255]);
    let normals = |mtl: &str| {
        let scene = folder.load(mtl);
        let texture = scene.materials[0].normal_texture.unwrap().texture;
        (scene.images[scene.textures[texture].image].clone(), scene.materials[0].normal_scale)
    };
    let (heights, _) = normals("newmtl m\nbump -bm 5 height.png\n");
    assert!(
        heights.rgba[16] < 120 && heights.rgba[18] > 200,
        "leans away from the rise: {:?}",
        &heights.rgba[16..20]
    );
    let (stronger, _) = normals("newmtl m\nmap_Bump -bm 20 height.png\n");
    assert!(stronger.rgba[16] < heights.rgba[16]);
    for keyword in ["bump", "map_bump", "norm"] {
        assert_eq!(normals(&format!("newmtl m\n{keyword} normal.png\n")).0.rgba[..4], [140, 118, 250, 255]);
    }
    assert_eq!(normals("newmtl m\nnorm -bm 0.5 normal.png\n").1, 0.5);
}

#[test]
fn arbitrary_bytes_never_panic() {
    let text = format!(
        "mtllib a.mtl\n{SQUARE}vt 0 0\nvn 0 0 1\ng x\nusemtl y\nf 1/1/1 2/1/1 -2/-1/-1 4//1\nf 1 2 3\n"
    );
    for at in 0..text.len() {
        for replacement in [b'-', b'9', b'/', b'\n', b' ', b'\\', 0xff, 0] {
            let mut bytes = text.clone().into_bytes();
            bytes[at] = replacement;
            if let Ok(scene) = from_bytes(Path::new("nowhere/test.obj"), &bytes) {
                assert_sound(&scene);
            }
        }
    }
}
