use glam::{Vec2, Vec3};

use super::*;
use crate::TextureRef;

/// A disc of `count` triangles around the origin, facing +z.
fn disc(count: u32) -> Primitive {
    let rim = (0..count).map(|i| Vec2::from_angle(i as f32 / count as f32 * std::f32::consts::TAU));
    let points: Vec<Vec2> = std::iter::once(Vec2::ZERO).chain(rim).collect();
    Primitive {
        positions: points.iter().map(|p| p.extend(0.0)).collect(),
        normals: vec![Vec3::Z; points.len()],
        uvs: [points.iter().map(|p| Vec2::new(p.x, -p.y)).collect(), Vec::new()],
        indices: (0..count).flat_map(|i| [0, 1 + i, 1 + (i + 1) % count]).collect(),
        ..Primitive::default()
    }
}

#[test]
fn vertices_without_a_triangle_are_dropped_with_all_their_streams() {
    let mut primitive = disc(8);
    primitive.indices.truncate(3);
    drop_unused_vertices(&mut primitive);
    assert_eq!((primitive.positions.len(), primitive.normals.len(), primitive.uvs[0].len()), (3, 3, 3));
    assert_eq!(primitive.positions[1], Vec3::X);
}

#[test]
fn a_fan_of_any_size_gets_the_same_tangents_in_good_time() {
    // Beyond the valence where MikkTSpace would recurse too deep; both ways must agree.
    for count in [8, 100_000] {
        let mut primitive = disc(count);
        generate_tangents(&mut primitive, &TextureRef::new(0));
        let along_u = |t: &glam::Vec4| t.abs_diff_eq(glam::Vec4::new(1.0, 0.0, 0.0, 1.0), 1e-3);
        assert!(primitive.tangents.iter().all(along_u), "{count} triangles");
    }
}

#[test]
fn a_star_of_any_size_gets_normals_in_good_time() {
    for count in [8, 100_000] {
        let mut primitive = [disc(count)];
        primitive[0].normals.clear();
        crease(&mut primitive, &[(0..=count).collect()], &[], 0.7);
        assert!(primitive[0].normals.iter().all(|n| n.abs_diff_eq(Vec3::Z, 1e-4)), "{count} triangles");
    }
}

#[test]
fn normals_lean_to_the_larger_triangle_not_to_the_larger_number() {
    // A roof: its left slope is one triangle, its right one twenty times smaller and cut in two.
    let (left, right) = (Vec3::new(-2.0, 0.0, -0.4), Vec3::new(0.1, 0.0, -0.02));
    let middle = Vec3::Y.lerp(right, 0.5);
    let positions = vec![Vec3::ZERO, Vec3::Y, left, middle, right];
    let mut primitives =
        [Primitive { positions, indices: vec![0, 1, 2, 0, 3, 1, 0, 4, 3], ..Primitive::default() }];
    crease(&mut primitives, &[(0..5).collect()], &[], 1.0);
    let at_origin = primitives[0].positions.iter().position(|p| *p == Vec3::ZERO).unwrap();
    let slope = (left - Vec3::ZERO).cross(Vec3::NEG_Y).normalize();
    let normal = primitives[0].normals[at_origin];
    assert!(normal.dot(slope).abs() > 0.999, "{normal}, {slope}");
}

#[test]
fn a_normal_without_direction_becomes_the_triangles() {
    let mut primitive = disc(8);
    primitive.normals[0] = Vec3::ZERO;
    primitive.normals[1] = Vec3::new(0.0, 0.0, 7.0);
    assert_eq!(repair(&mut primitive), 1);
    assert!(primitive.normals.iter().all(|n| n.abs_diff_eq(Vec3::Z, 1e-6)));
}
