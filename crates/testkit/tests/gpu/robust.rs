//! Strange input must not become NaN or infinity in the picture.

use chiaro::scene::{LightKind, Material, Mesh, Primitive, Reflection};
use chiaro::{Pipeline, Settings, View};
use chiaro_testkit::{Stage, Studio, ambient, device};
use glam::{Affine3A, Vec2, Vec3, Vec4};

/// Two triangles of ordinary shape and one without an area, with the given normals.
fn mesh(normal: Vec3, tangent: Vec4, material: usize) -> Mesh {
    let positions = vec![
        Vec3::new(-0.5, -0.5, 0.0),
        Vec3::new(0.5, -0.5, 0.0),
        Vec3::new(0.5, 0.5, 0.0),
        Vec3::new(-0.5, 0.5, 0.0),
        Vec3::ZERO,
        Vec3::ZERO,
    ];
    let count = positions.len();
    let primitive = Primitive {
        positions,
        normals: vec![normal; count],
        tangents: vec![tangent; count],
        uvs: [vec![Vec2::ZERO; count], Vec::new()],
        // Two corners in one place, all corners in one place, all on a line.
        indices: vec![0, 1, 2, 0, 2, 3, 0, 2, 2, 4, 5, 4, 0, 4, 2],
        material,
        ..Primitive::default()
    };
    Mesh { primitives: vec![primitive], ..Mesh::default() }
}

fn strange() -> Stage {
    let mut stage = Stage::new();
    let flat = stage.texture(
        1,
        [chiaro::scene::Wrap::Repeat; 2],
        chiaro::scene::Filter::Linear,
        vec![128, 128, 0, 0],
    );
    let materials = [
        Material { roughness: 0.0, metallic: 1.0, ..Material::default() },
        Material { roughness: 0.0, specular: 1.0, ..Material::default() },
        Material { reflection: Reflection::Phong { exponent: 1e9 }, ..Material::default() },
        Material { reflection: Reflection::Phong { exponent: 0.0 }, ..Material::default() },
        Material { base_color: Vec4::ZERO, specular: 0.0, ..Material::default() },
        // A normal map without length.
        Material { normal_texture: Some(flat), normal_scale: 0.0, ..Material::default() },
        Material { emissive: Vec3::splat(1e4), ..Material::default() },
        Material { reflection: Reflection::Unlit, ..Material::default() },
    ];
    let normals = [Vec3::Z, Vec3::NEG_Z, Vec3::ZERO, Vec3::X];
    for (row, material) in materials.into_iter().enumerate() {
        let material = stage.material(Material { double_sided: true, ..material });
        for (column, normal) in normals.into_iter().enumerate() {
            let tangent =
                if column == 1 { Vec4::new(0.0, 0.0, 0.0, 1.0) } else { Vec4::new(1.0, 0.0, 0.0, -1.0) };
            let at = Vec3::new(column as f32 * 1.1 - 1.65, row as f32 * 1.1 - 3.85, 0.0);
            // The last column is squeezed flat: its matrix has no inverse.
            let scale = if column == 3 { Vec3::new(1.0, 1.0, 0.0) } else { Vec3::ONE };
            let pose = Affine3A::from_translation(at) * Affine3A::from_scale(scale);
            stage.place(mesh(normal, tangent, material), pose);
        }
    }
    // Neither sun is mirrored into an eye: highlights of smooth metal may be as bright as the target holds.
    stage.sun(1000.0, Vec3::new(0.2, -0.5, -1.0));
    stage.sun(1000.0, Vec3::NEG_Z);
    // In the plane of a quad, and in its very middle.
    stage.light(LightKind::Point, 10.0, None, Vec3::new(-1.65, -3.85, 0.0), Vec3::Z);
    stage.light(
        LightKind::Spot { inner_rad: 0.0, outer_rad: 0.0 },
        10.0,
        None,
        Vec3::new(0.0, 0.0, 1.0),
        Vec3::NEG_Z,
    );
    stage.light(LightKind::Point, 10.0, Some(1e-6), Vec3::new(0.0, 0.0, 1.0), Vec3::Z);
    stage
}

#[test]
fn strange_materials_and_triangles_stay_finite() {
    let gpu = device();
    let stage = strange();
    for pipeline in [Pipeline::Deferred, Pipeline::Forward] {
        let mut settings = Settings { pipeline, ..ambient() };
        settings.set("surface.msaa", "1").unwrap();
        let mut studio = Studio::new(&gpu, settings.clone());
        let scene = studio.load(&stage.scene);
        for lighting in ["pbr", "phong", "lambert"] {
            settings.set("surface.lighting", lighting).unwrap();
            studio.set(settings.clone());
            // From the front, from behind, and from within the plane, where next to nothing is to be seen.
            let eyes = [Vec3::new(0.0, 0.0, 10.0), Vec3::new(0.5, 0.2, -10.0), Vec3::new(9.0, 0.0, 0.0)];
            for (number, eye) in eyes.into_iter().enumerate() {
                let view = View::look_at(eye, Vec3::ZERO, 1.0, 0.05);
                let image = studio.radiance(&scene, &view, [96, 96], 2);
                // The least of a NaN and the target's largest value is the latter: NaN shows as white.
                let white = 60_000.0 / scene.radiance_scale;
                let strange = |v: &f32| !v.is_finite() || *v < 0.0 || *v > white;
                let wrong = image.pixels().iter().filter(|pixel| pixel.iter().any(strange)).count();
                assert_eq!(wrong, 0, "{pipeline:?} {lighting} from {eye}");
                let lit = image.pixels().iter().flatten().any(|v| *v > 0.0);
                assert!(lit || number == 2, "{pipeline:?} {lighting} from {eye}: nothing is seen");
            }
        }
    }
}
