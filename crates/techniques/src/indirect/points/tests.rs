//! Points against the areas that they stand for.

use chiaro_scene as cs;
use glam::{Affine3A, DVec3, Vec2, Vec3, Vec4};

use super::sequence::{Sequence, hash, unit};
use super::{PointData, PointOptions, Thinning};

/// Parallelograms `at + [0, 1] u + [0, 1] v`, each a mesh of its own.
fn boards(boards: &[(Vec3, Vec3, Vec3, usize)], materials: Vec<cs::Material>) -> cs::Scene {
    let mut scene = cs::Scene { materials, ..cs::Scene::default() };
    for (index, &(at, u, v, material)) in boards.iter().enumerate() {
        let primitive = cs::Primitive {
            positions: vec![at, at + u, at + u + v, at + v],
            normals: vec![u.cross(v).normalize_or(Vec3::Y); 4],
            uvs: [vec![Vec2::ZERO, Vec2::X, Vec2::ONE, Vec2::Y], Vec::new()],
            indices: vec![0, 1, 2, 0, 2, 3],
            material,
            ..cs::Primitive::default()
        };
        scene.meshes.push(cs::Mesh { primitives: vec![primitive], ..cs::Mesh::default() });
        scene.nodes.push(cs::Node { mesh: Some(index), ..cs::Node::default() });
    }
    scene
}

fn opaque() -> Vec<cs::Material> {
    vec![cs::Material::default()]
}

fn options(points: u32) -> PointOptions {
    PointOptions { points, seed: 7 }
}

fn build(scene: &cs::Scene, points: u32) -> PointData {
    PointData::build(scene, &scene.pose(0.0), options(points))
}

/// How many points each of `count` instances has.
fn by_instance(sources: &[super::build::Source], count: usize) -> Vec<u32> {
    let mut counts = vec![0; count];
    for source in sources {
        counts[(source[1] & 0xff_ffff) as usize] += 1;
    }
    counts
}

/// Boards of areas that differ up to a hundredfold.
fn uneven() -> cs::Scene {
    let side = |i: u32| Vec3::X * (0.1 + unit(hash(i)) as f32 * 10.0);
    let all: Vec<_> = (0..40).map(|i| (Vec3::Y * i as f32, side(i), Vec3::Z, 0)).collect();
    boards(&all, opaque())
}

#[test]
fn every_run_of_points_is_even_over_the_whole_area() {
    let row: Vec<_> = (0..16).map(|i| (Vec3::X * i as f32, Vec3::X, Vec3::Z, 0)).collect();
    let scene = boards(&row, opaque());
    let data = build(&scene, 4096);
    for length in [16, 64, 1024] {
        for start in [0, 1, 17, 333, 2000, 3071] {
            let run = &data.sources[start..start + length];
            assert_eq!(by_instance(run, 16), [length as u32 / 16; 16], "{length} from {start}");
        }
    }
    // Random points of the same number differ by far more than one.
    let scene = uneven();
    let areas: Vec<_> =
        scene.meshes.iter().map(|mesh| f64::from(mesh.primitives[0].positions[1].x)).collect();
    let all: f64 = areas.iter().sum();
    let data = build(&scene, 10_000);
    let off = |counts: &[u32], length: usize| {
        let each = counts.iter().zip(&areas).map(|(&n, area)| f64::from(n) - area / all * length as f64);
        each.map(f64::abs).fold(0.0, f64::max)
    };
    for start in [0, 100, 2049, 8000] {
        let counts = by_instance(&data.sources[start..start + 1024], 40);
        assert!(off(&counts, 1024) < 2.0, "from {start}: {counts:?}");
    }
    let mut random = vec![0; 40];
    for i in 0..1024 {
        let mut at = unit(hash(i)) * all;
        let board = areas.iter().position(|area| {
            at -= area;
            at < 0.0
        });
        random[board.unwrap_or(39)] += 1;
    }
    assert!(off(&random, 1024) > 4.0, "{random:?}");
}

#[test]
fn triangles_have_points_by_their_area_and_evenly() {
    const CELLS: u32 = 8;
    let scene = cs::load("builtin:cornell").unwrap();
    let data = build(&scene, 1 << 16);
    assert_eq!((data.len(), data.is_empty()), (1 << 16, false));
    let mut counted = std::collections::BTreeMap::new();
    for source in data.sources.iter() {
        counted.entry([source[0], source[1]]).or_insert_with(Vec::new).push(source[2]);
    }
    let pose = scene.pose(0.0);
    let cut = crate::scene::Cut::new(&scene, &pose);
    let mut area_m2 = 0.0;
    for drawn in &cut.drawn {
        for triangle in crate::rays::placed_triangles(&scene, &cut, drawn) {
            let [a, b, c] = triangle.corners.map(Vec3::as_dvec3);
            let area = 0.5 * (b - a).cross(c - a).length();
            area_m2 += area;
            let places = counted.remove(&[triangle.word[0], drawn.instance]).unwrap_or_default();
            let expected = area / data.point_m2;
            let off = (places.len() as f64 - expected).abs();
            assert!(off < 2.0, "{} instead of {expected} points", places.len());
            if expected < 1000.0 {
                continue;
            }
            // Equal parts of the triangle, of both orientations.
            let mut cells = [0.0; (CELLS * CELLS) as usize];
            for place in places {
                let [b, c] = [place & 0xffff, place >> 16];
                let a = 65_535 - b - c;
                let [a, b, c] = [a, b, c].map(|share| (share * CELLS / 65_536).min(CELLS - 1));
                let inverted = (CELLS - 1 - a - b - c).min(1);
                let row = c * (2 * CELLS - c);
                cells[(row + 2 * b + inverted) as usize] += 1.0;
            }
            let mean = expected / cells.len() as f64;
            let chi: f64 = cells.iter().map(|count| (count - mean) * (count - mean) / mean).sum();
            // Random ones come to as many as there are cells, give or take a dozen.
            assert!(chi < 0.6 * cells.len() as f64, "{chi}: {cells:?}");
        }
    }
    assert!(counted.is_empty(), "points of what is not drawn: {counted:?}");
    assert!((data.area_m2 / area_m2 - 1.0).abs() < 1e-6);
}

/// A board of 2 m², of whose texture a quarter has the alpha 255, the rest `rest`.
fn cut_out(alpha: cs::AlphaMode, rest: u8) -> cs::Scene {
    let map = Some(cs::TextureRef::new(0));
    let material = cs::Material { alpha, base_color_texture: map, ..cs::Material::default() };
    let mut scene = boards(&[(Vec3::ZERO, 2.0 * Vec3::X, Vec3::Z, 0)], vec![material]);
    let texel = |i: u32| [255, 255, 255, if i % 16 < 8 && i < 128 { 255 } else { rest }];
    let rgba = (0..256).flat_map(texel).collect();
    scene.images.push(cs::ImageData { name: String::new(), width: 16, height: 16, rgba });
    let wrap = [cs::Wrap::Clamp; 2];
    scene.textures.push(cs::Texture { image: 0, wrap, filter: cs::Filter::Nearest });
    scene
}

/// Share of the points in the texture's opaque quarter.
fn share_inside(scene: &cs::Scene, data: &PointData) -> f64 {
    let places = data.places(scene, &scene.pose(0.0));
    let inside = places.iter().filter(|(at, _)| at.x < 1.001 && at.z < 0.501).count();
    inside as f64 / places.len() as f64
}

#[test]
fn holes_carry_no_points_and_their_area_does_not_count() {
    let scene = cut_out(cs::AlphaMode::Mask { cutoff: 0.5 }, 100);
    let data = build(&scene, 4096);
    assert_eq!((data.len(), share_inside(&scene, &data)), (4096, 1.0));
    assert!((data.area_m2 - 0.5).abs() < 0.05, "{}", data.area_m2);
    // Nothing is cut where the cut-off is lower.
    let scene = cut_out(cs::AlphaMode::Mask { cutoff: 0.3 }, 100);
    let data = build(&scene, 4096);
    assert!((share_inside(&scene, &data) - 0.25).abs() < 0.01);
    assert!((data.area_m2 - 2.0).abs() < 1e-6);
    // All of it is.
    let data = build(&cut_out(cs::AlphaMode::Mask { cutoff: 1.1 }, 100), 4096);
    assert_eq!((data.len(), data.area_m2), (0, 0.0));
}

#[test]
fn what_is_blended_has_points_as_its_alpha_says() {
    let scene = cut_out(cs::AlphaMode::Blend, 51);
    let data = build(&scene, 4096);
    // A quarter at 1, three at 0.2.
    assert!((data.area_m2 / 2.0 - 0.4).abs() < 0.03, "{}", data.area_m2);
    assert!((share_inside(&scene, &data) - 0.25 / 0.4).abs() < 0.03);
}

#[test]
fn what_is_seen_through_carries_no_points() {
    let glass = cs::Material { transmission: 0.9, ..cs::Material::default() };
    let all = [(Vec3::ZERO, Vec3::X, Vec3::Z, 0), (Vec3::Y, Vec3::X, Vec3::Z, 1)];
    let scene = boards(&all, vec![glass, cs::Material::default()]);
    let data = build(&scene, 256);
    assert_eq!(by_instance(&data.sources, 2), [0, 256]);
    assert!((data.area_m2 - 1.0).abs() < 1e-6);
}

#[test]
fn what_has_no_area_is_left_out() {
    let mut scene = boards(
        &[
            (Vec3::ZERO, Vec3::X, Vec3::ZERO, 0),
            (Vec3::ZERO, Vec3::X, Vec3::X, 0),
            (Vec3::splat(f32::NAN), Vec3::X, Vec3::Z, 0),
        ],
        opaque(),
    );
    for data in [build(&cs::Scene::default(), 64), build(&scene, 64), build(&uneven(), 0)] {
        assert_eq!((data.len(), data.area_m2, data.point_m2), (0, 0.0, 0.0));
    }
    let whole = boards(&[(Vec3::ZERO, Vec3::X, Vec3::Z, 0)], opaque());
    scene.meshes.extend(whole.meshes);
    scene.nodes.push(cs::Node { mesh: Some(3), ..cs::Node::default() });
    for points in [1, 2, 3, 100] {
        let data = build(&scene, points);
        assert_eq!(by_instance(&data.sources, 4), [0, 0, 0, points]);
    }
}

#[test]
fn scenes_of_any_size_have_the_same_points() {
    let scaled = |scale: f32| {
        let mut scene = cs::load("builtin:cornell").unwrap();
        for node in scene.nodes.iter_mut().filter(|node| node.parent.is_none()) {
            let own = node.parent_from_node.affine();
            node.parent_from_node = cs::Transform::Matrix(Affine3A::from_scale(Vec3::splat(scale)) * own);
        }
        (build(&scene, 2048), scene)
    };
    let (plain, _) = scaled(1.0);
    // About 1 mm, and 10,000 km.
    for scale in [2f32.powi(-11), 2f32.powi(22)] {
        let (data, scene) = scaled(scale);
        assert!(data.sources == plain.sources, "{scale}");
        let ratio = data.area_m2 / plain.area_m2 / f64::from(scale).powi(2);
        assert!((ratio - 1.0).abs() < 1e-9, "{scale}: {ratio}");
        let (lo, hi) = scene.bounds_at(&scene.pose(0.0)).unwrap();
        let slack = Vec3::splat(1e-5 * (hi - lo).max_element());
        for (at, normal) in data.places(&scene, &scene.pose(0.0)) {
            assert!(at.cmpge(lo - slack).all() && at.cmple(hi + slack).all(), "{at} at {scale}");
            assert!(normal.is_normalized());
        }
    }
}

#[test]
fn the_points_are_the_same_on_any_number_of_threads() {
    let masked = cut_out(cs::AlphaMode::Mask { cutoff: 0.5 }, 100);
    for scene in [cs::load("builtin:cornell").unwrap(), masked] {
        let on = |threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(threads).build().unwrap();
            pool.install(|| build(&scene, 20_000))
        };
        let (one, four) = (on(1), on(4));
        assert!(one.sources == four.sources);
        assert_eq!(one.area_m2.to_bits(), four.area_m2.to_bits());
        let other = PointData::build(&scene, &scene.pose(0.0), PointOptions { seed: 8, ..options(20_000) });
        assert!(one.sources != other.sources);
    }
}

/// Area that the points of each instance stand for, m².
fn carried(data: &PointData, count: usize) -> Vec<f64> {
    let mut carried = vec![0.0; count];
    for source in data.sources.iter() {
        let each = data.point_m2 * 4f64.powi((source[1] >> 24) as i32);
        carried[(source[1] & 0xff_ffff) as usize] += each;
    }
    carried
}

#[test]
fn far_points_are_fewer_and_stand_for_more() {
    let near = (Vec3::ZERO, Vec3::X, Vec3::Z, 0);
    let all: Vec<_> = [0.0, 16.0, 64.0, 1e6].iter().map(|&x| (x * Vec3::X, near.1, near.2, 0)).collect();
    let scene = boards(&all, opaque());
    let thinning = Thinning { eye_m: DVec3::ZERO, from_m: 3.7 };
    let data = PointData::build_thinned(&scene, &scene.pose(0.0), options(8192), thinning);
    assert!((data.area_m2 - 4.0).abs() < 0.1, "{}", data.area_m2);
    let counts = by_instance(&data.sources, 4);
    // 16 m are 4.3 times the distance: cubed, and cut down to a power of four, 64. 64 m: 4096.
    assert!((f64::from(counts[0]) / f64::from(counts[1]) / 64.0 - 1.0).abs() < 0.02, "{counts:?}");
    assert!((1..4).contains(&counts[2]) && counts[3] == 0, "{counts:?}");
    let carried = carried(&data, 4);
    assert!(carried[..2].iter().all(|area| (area - 1.0).abs() < 0.04), "{carried:?}");
}

/// A room of 2 m on ground of so many metres.
fn room_on(side_m: f32) -> cs::Scene {
    let side = 2.0;
    let [x, y, z] = [Vec3::X * side, Vec3::Y * side, Vec3::Z * side];
    let mut all: Vec<_> = [(x, y), (y, z), (z, x)].iter().map(|&(u, v)| (Vec3::ZERO, u, v, 0)).collect();
    all.extend([(z, x, y), (x, y, z), (y, z, x)].map(|(at, u, v)| (at, u, v, 0)));
    let corner = Vec3::new(-0.4, 0.0, -0.4) * side_m - 0.01 * Vec3::Y;
    all.push((corner, Vec3::Z * side_m, Vec3::X * side_m, 0));
    boards(&all, opaque())
}

#[test]
fn a_ground_however_wide_leaves_what_is_near_its_points_and_areas_add_up() {
    let eye = DVec3::ONE;
    for side_m in [1e3, 1e4, 1e5] {
        let scene = room_on(side_m);
        let data = PointData::build_for(&scene, &scene.pose(0.0), options(1 << 16), eye, None);
        let counts = by_instance(&data.sources, 7);
        let room: u32 = counts[..6].iter().sum();
        assert!(room > 1 << 13, "{side_m} m: {room} of 65536 points are in the room");
        let carried = carried(&data, 7);
        // One of the farthest points stands for much of the ground.
        let ground = carried[6] / f64::from(side_m).powi(2);
        assert!((ground - 1.0).abs() < 0.1, "{side_m} m: {ground} of the ground");
        assert!(carried[..6].iter().all(|area| (area / 4.0 - 1.0).abs() < 0.01), "{carried:?}");
        assert!((data.area_m2 / (24.0 + f64::from(side_m).powi(2)) - 1.0).abs() < 1e-6);
        assert!((data.counted_m2() / data.point_m2 - 65_536.0).abs() < 1e-3);
        // They lie on the ground, by their density.
        let places = data.places(&scene, &scene.pose(0.0));
        let reach = data.thinning().unwrap().from_m;
        let (mut near, mut area) = (0, 0.0);
        for ((at, _), source) in places.iter().zip(data.sources.iter()) {
            if source[1] & 0xff_ffff == 6 {
                assert!(
                    (at.y + 0.01).abs() < 1e-4 * side_m && at.abs().max_element() < 0.61 * side_m,
                    "{at}"
                );
                let is_near = at.as_dvec3().distance(eye) < 20.0 * f64::from(reach);
                near += u32::from(is_near);
                area += f64::from(u8::from(is_near)) * data.point_m2 * 4f64.powi((source[1] >> 24) as i32);
            }
        }
        let disc = std::f64::consts::PI * (20.0 * f64::from(reach)).powi(2);
        assert!(near > 1000 && (area / disc - 1.0).abs() < 0.1, "{side_m} m: {area} m² instead of {disc}");
    }
}

#[test]
fn points_are_thinned_only_where_that_leaves_more_near_the_view_and_others_are_due_when_it_moves() {
    let even = |scene: &cs::Scene, eye: DVec3| {
        let data = PointData::build_for(scene, &scene.pose(0.0), options(4096), eye, None);
        assert!(data.serves_from(eye) && !data.serves_from(eye + 1e6 * DVec3::X));
        (data.thinning().is_none() && data.sources == build(scene, 4096).sources, data)
    };
    let cornell = cs::load("builtin:cornell").unwrap();
    assert!(even(&cornell, DVec3::new(0.0, 1.0, 1.0)).0);
    let wide = room_on(1e4);
    // In the room, and from so far up that the room is a speck.
    assert!(!even(&wide, DVec3::ONE).0);
    let (is_even, above) = even(&wide, DVec3::new(0.0, 6e3, 0.0));
    assert!(is_even && above.serves_from(DVec3::new(0.0, 5e3, 0.0)) && !above.serves_from(DVec3::ONE));
    // What would not change stays.
    let pose = wide.pose(0.0);
    let again = PointData::build_for(&wide, &pose, options(4096), DVec3::Y * 1.2e4, Some(&above));
    assert!(again.id == above.id && again.serves_from(DVec3::Y * 1.2e4));
    let down = PointData::build_for(&wide, &pose, options(4096), DVec3::ONE, Some(&above));
    assert!(down.id != above.id && down.thinning().is_some());
    // A board seen from its edge, and a speck from afar, serve until the view moves on.
    let board = boards(&[(Vec3::ZERO, Vec3::X, Vec3::Z, 0)], opaque());
    for eye in [DVec3::new(-1.0, 0.0, 0.5), DVec3::new(1e9, 1e9, 0.0)] {
        let data = PointData::build_for(&board, &board.pose(0.0), options(64), eye, None);
        assert!(data.serves_from(eye) && !data.serves_from(DVec3::splat(-1e5)), "{eye}");
    }
    // World space may count from anywhere.
    let mut moved = room_on(1e4);
    moved.origin = DVec3::new(1e6, 0.0, -3e5);
    let there = PointData::build_for(&moved, &pose, options(4096), DVec3::ONE + moved.origin, None);
    assert_eq!(there.sources, down.sources);
}

#[test]
fn points_keep_their_triangles_as_these_move() {
    let mut scene = boards(&[(Vec3::ZERO, Vec3::X, Vec3::NEG_Z, 0)], opaque());
    let data = build(&scene, 64);
    let before = data.places(&scene, &scene.pose(0.0));
    assert!(before.iter().all(|(_, normal)| normal.abs_diff_eq(Vec3::Y, 1e-6)));
    // Mirrored: what was the front still is.
    let mirror = Affine3A::from_scale(Vec3::new(-2.0, 1.0, 1.0));
    scene.nodes[0].parent_from_node = cs::Transform::Matrix(mirror);
    for ((from, _), (to, normal)) in before.iter().zip(data.places(&scene, &scene.pose(0.0))) {
        assert!(to.abs_diff_eq(mirror.transform_point3(*from), 1e-6));
        assert!(normal.abs_diff_eq(Vec3::Y, 1e-6), "{normal}");
    }
}

#[test]
fn vertex_colours_cut_out_too() {
    let mask = cs::AlphaMode::Mask { cutoff: 0.5 };
    let material = cs::Material { alpha: mask, ..cs::Material::default() };
    let mut scene = boards(&[(Vec3::ZERO, Vec3::X, Vec3::Z, 0)], vec![material]);
    let clear = Vec4::new(1.0, 1.0, 1.0, 0.0);
    scene.meshes[0].primitives[0].colors = vec![Vec4::ONE, clear, clear, Vec4::ONE];
    let data = build(&scene, 512);
    assert!(data.places(&scene, &scene.pose(0.0)).iter().all(|(at, _)| at.x < 0.51));
    assert!((data.area_m2 - 0.5).abs() < 0.15, "{}", data.area_m2);
}

#[test]
fn both_dimensions_together_are_even() {
    let sequence = Sequence::new(3);
    // A (0, 2) net: one point in each of 256 boxes of any shape.
    for bits in 0..=8u32 {
        let mut boxes = [0u32; 256];
        for index in 512..768 {
            let [x, y] = sequence.point(index);
            let at = |v: f64, bits: u32| (v * f64::from(1u32 << bits)) as usize;
            boxes[at(x, bits) << (8 - bits) | at(y, 8 - bits)] += 1;
        }
        assert_eq!(boxes, [1; 256], "{bits}");
    }
}
