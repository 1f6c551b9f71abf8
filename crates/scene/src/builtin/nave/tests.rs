use glam::{Vec2, Vec3, Vec3Swizzles, vec2, vec3};

use super::{
    super::arch::Opening,
    plan::{AISLE_AXIS, AISLE_WALL, END_WALL, NAVE_WALL},
    *,
};

/// Whether (u, y) lies in an opening about u = 0, with 0.1 m to spare.
fn within(opening: Opening, p: Vec2) -> bool {
    let top = opening.springing + opening.arch.rise();
    p.x.abs() < opening.arch.half_span + 0.1 && p.y > opening.sill - 0.1 && p.y < top + 0.1
}

/// Whether a ray from inside passes through a window's place in an outer face.
fn leaves_by_a_window(origin: Vec3, direction: Vec3) -> bool {
    let at_x = |x: f32| origin + direction * ((x - origin.x) / direction.x);
    let at_z = |z: f32| origin + direction * ((z - origin.z) / direction.z);
    let in_bay = |p: Vec3| vec2((p.z + HALF_LENGTH).rem_euclid(BAY) - BAY / 2.0, p.y);
    let side = direction.x.signum();
    let end = direction.z.signum() * (HALF_LENGTH + END_WALL);
    let through_end = at_z(end);
    within(walls::CLERESTORY_WINDOW, in_bay(at_x(side * NAVE_WALL[1])))
        || within(walls::AISLE_WINDOW, in_bay(at_x(side * AISLE_WALL[1])))
        || within(shell::AISLE_END_WINDOW, vec2(through_end.x.abs() - AISLE_AXIS, through_end.y))
        || (end > 0.0 && within(shell::WEST_WINDOW, through_end.xy()))
}

fn meets(t: &[Vec3; 3], origin: Vec3, direction: Vec3) -> bool {
    let (e1, e2) = (t[1] - t[0], t[2] - t[0]);
    let h = direction.cross(e2);
    let det = e1.dot(h);
    let s = origin - t[0];
    let q = s.cross(e1);
    let (u, v, d) = (s.dot(h) / det, direction.dot(q) / det, e2.dot(q) / det);
    u >= 0.0 && v >= 0.0 && u + v <= 1.0 && d > 0.0
}

#[test]
fn light_enters_only_through_windows() {
    let scene = build();
    let mut triangles = Vec::new();
    for (node, world) in scene.nodes.iter().zip(scene.world_from_node()) {
        for p in node.mesh.iter().flat_map(|m| &scene.meshes[*m].primitives) {
            let corner = |i: &u32| world.transform_point3(p.positions[*i as usize]);
            triangles
                .extend(p.indices.chunks_exact(3).map(|t| [corner(&t[0]), corner(&t[1]), corner(&t[2])]));
        }
    }
    let unit = |i: i32, k: i32| super::super::texture::hash(i, k, 99);
    let mut escaped = 0;
    for i in 0..600 {
        // Anywhere over the whole floor, in any direction above the horizon.
        let at = vec3(unit(i, 0) - 0.5, 0.0, unit(i, 1) - 0.5) * vec3(17.0, 0.0, 36.0) + vec3(0.0, 1.3, 0.0);
        let angle = unit(i, 2) * std::f32::consts::TAU;
        let up = 0.05 + 0.9 * unit(i, 3);
        let direction = (Vec2::from_angle(angle) * (1.0 - up * up).sqrt()).extend(up).xzy();
        if !triangles.iter().any(|t| meets(t, at, direction)) {
            escaped += 1;
            assert!(leaves_by_a_window(at, direction), "a ray from {at} along {direction} finds a gap");
        }
    }
    // Else the test would not have tested anything.
    assert!(escaped > 5, "{escaped}");
}

#[test]
fn the_sun_reaches_the_floor_of_the_nave() {
    let scene = build();
    let light = scene.placed_lights().into_iter().find(|(l, _)| scene.lights[*l].name == "sun").expect("lit");
    let to_sun: Vec3 = Vec3::from(light.1.matrix3.z_axis).normalize();
    let reaches = |x: f32| {
        let height = to_sun.y / to_sun.x * (NAVE_WALL[1] - x);
        let window = walls::CLERESTORY_WINDOW;
        height > window.sill + 0.5 && height < window.springing + window.arch.rise()
    };
    assert!((-37..0).any(|x| reaches(x as f32 * 0.1)));
}
