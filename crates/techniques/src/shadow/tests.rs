//! Tests of how views are fitted.

use glam::{Mat4, Vec2, Vec3};

use super::*;
use crate::frame::LightData;
use crate::view::Raster;
use crate::view::project::{corners, reversed_perspective};

fn light(kind: u32, direction: Vec3) -> LightData {
    LightData {
        position_ws: [0.0, 5.0, 0.0],
        kind,
        direction_ws: direction.normalize().to_array(),
        inverse_range_squared: 0.0,
        intensity: [1.0; 3],
        first_view: 0,
        cone_scale: 1.0,
        cone_offset: 0.0,
        view_count: 0,
        cone_rad: 0.5,
    }
}

fn camera() -> CameraView {
    let view = Mat4::from_translation(Vec3::new(0.0, -1.0, -10.0));
    let projection = reversed_perspective(Vec2::splat(0.6), 0.1, 1000.0);
    CameraView {
        eye_ws: Vec3::new(0.0, 1.0, 10.0),
        forward_ws: Vec3::NEG_Z,
        ws_from_clip: (projection * view).inverse(),
    }
}

const BOUNDS: (Vec3, Vec3) = (Vec3::new(-3.0, 0.0, -3.0), Vec3::new(3.0, 4.0, 3.0));

fn fitted(
    lights: &mut [LightData],
    bounds_ws: (Vec3, Vec3),
    camera: CameraView,
    settings: &ShadowSettings,
) -> ShadowViews {
    fit(
        lights,
        &FitInputs { bounds_ws, casters: None, camera, settings, clamps_depth: true, see_through: false },
    )
}

fn single() -> ShadowSettings {
    ShadowSettings { layout: Layout::Single, ..ShadowSettings::default() }
}

#[test]
fn a_suns_map_holds_every_visible_corner_with_reversed_depth() {
    let mut lights = [light(LightData::DIRECTIONAL, Vec3::new(0.3, -1.0, 0.2))];
    let ShadowViews { views, notes, .. } = fitted(&mut lights, BOUNDS, camera(), &single());
    assert!(notes.is_empty());
    assert_eq!(lights[0].first_view, 0);
    for corner in corners(BOUNDS) {
        let p = views[0].clip_from_ws.project_point3(corner);
        assert!(p.x.abs() <= 1.0 && p.y.abs() <= 1.0 && (0.0..=1.0).contains(&p.z), "{corner} at {p}");
    }
    let toward_sun = views[0].clip_from_ws.project_point3(Vec3::new(0.0, 4.0, 0.0)).z;
    assert!(toward_sun > views[0].clip_from_ws.project_point3(Vec3::ZERO).z);
}

#[test]
fn a_suns_map_is_no_larger_than_what_the_camera_sees_of_the_scene() {
    // From 20 m above, 0.2 rad to each side, a floor of 200 m shows 8 m; the map may round that up by a quarter octave.
    let floor = (Vec3::new(-100.0, -0.1, -100.0), Vec3::new(100.0, 0.0, 100.0));
    let projection = reversed_perspective(Vec2::splat(0.2), 0.1, 1000.0);
    let eye = Vec3::new(0.0, 20.0, 0.0);
    let down = Mat4::from_rotation_x(std::f32::consts::FRAC_PI_2) * Mat4::from_translation(-eye);
    let camera =
        CameraView { eye_ws: eye, forward_ws: Vec3::NEG_Y, ws_from_clip: (projection * down).inverse() };
    let sun = light(LightData::DIRECTIONAL, Vec3::new(0.8, -0.6, 0.0));
    let settings = single();
    let views = fitted(&mut [sun], floor, camera, &settings).views;
    let side_m = views[0].data.texel_m * settings.resolution as f32;
    assert!((8.0..10.0).contains(&side_m), "{side_m}");
}

#[test]
fn a_spots_map_covers_its_cone_and_no_more_than_a_margin() {
    let mut lights = [light(LightData::SPOT, Vec3::NEG_Y)];
    let views = fitted(&mut lights, BOUNDS, camera(), &ShadowSettings::default()).views;
    let rim = Vec3::new(5.0 * 0.5f32.tan(), 0.0, 0.0);
    let p = views[0].clip_from_ws.project_point3(rim);
    let radius = p.truncate().length();
    assert!(radius < 1.0 && radius > 0.99, "{radius}");
}

#[test]
fn a_sun_fitted_to_a_moving_camera_moves_by_whole_texels() {
    let sun = light(LightData::DIRECTIONAL, Vec3::new(0.3, -1.0, 0.2));
    let settings = single();
    let wide = (Vec3::new(-500.0, 0.0, -500.0), Vec3::new(500.0, 10.0, 500.0));
    let texel_of = |shift: f32| {
        let projection = reversed_perspective(Vec2::splat(0.6), 0.1, 1000.0);
        let view = Mat4::from_translation(Vec3::new(-shift, -1.0, -10.0));
        let camera = CameraView {
            eye_ws: Vec3::new(shift, 1.0, 10.0),
            forward_ws: Vec3::NEG_Z,
            ws_from_clip: (projection * view).inverse(),
        };
        let views = fitted(&mut [sun], wide, camera, &settings).views;
        let p = views[0].clip_from_ws.project_point3(Vec3::new(1.0, 0.0, -7.0)).truncate();
        (views[0].data.texel_m, p * 0.5 * settings.resolution as f32)
    };
    let (size, at) = texel_of(0.0);
    for shift in [0.013, 0.21, 0.4] {
        let (same, moved) = texel_of(shift);
        assert_eq!(size, same);
        let off = (moved - at - (moved - at).round()).abs().max_element();
        assert!(off < 0.02, "moved by {} texels", moved - at);
    }
}

#[test]
fn too_many_maps_are_made_smaller_and_said() {
    let mut lights = [light(LightData::SPOT, Vec3::NEG_Y); 40];
    let settings = ShadowSettings { memory_budget: 512, ..ShadowSettings::default() };
    let ShadowViews { views, notes, .. } = fitted(&mut lights, BOUNDS, camera(), &settings);
    assert_eq!(views[39].resolution, 1024);
    assert_eq!(notes.len(), 1);
}

#[test]
fn tints_and_the_rasterisers_lists_count_towards_the_budget() {
    let side = |settings: ShadowSettings| {
        let mut lights = [light(LightData::SPOT, Vec3::NEG_Y); 4];
        fitted(&mut lights, BOUNDS, camera(), &settings).views[0].resolution
    };
    // 64 MiB of depth alone.
    let plain = ShadowSettings { memory_budget: 64, ..ShadowSettings::default() };
    assert_eq!(side(plain.clone()), 2048);
    assert_eq!(side(ShadowSettings { transmission_tint: true, ..plain.clone() }), 1024);
    // As much again in bits, and 80 MiB of tiles.
    let computed = ShadowSettings { raster: Raster::Compute, ..plain };
    assert_eq!(side(computed.clone()), 1024);
    assert_eq!(side(ShadowSettings { memory_budget: 208, ..computed.clone() }), 1024);
    assert_eq!(side(ShadowSettings { memory_budget: 209, ..computed }), 2048);
}

/// A camera at `eye` that looks along −Z turned by `yaw` about the vertical.
fn turned(eye: Vec3, yaw: f32) -> CameraView {
    let turn = Mat4::from_rotation_y(yaw);
    let view = (Mat4::from_translation(eye) * turn).inverse();
    let projection = reversed_perspective(Vec2::new(0.8, 0.5), 0.1, 1000.0);
    CameraView {
        eye_ws: eye,
        forward_ws: turn.transform_vector3(Vec3::NEG_Z),
        ws_from_clip: (projection * view).inverse(),
    }
}

#[test]
fn cascades_keep_their_size_and_grid_however_the_camera_moves_in_the_scene() {
    let mut sun = [light(LightData::DIRECTIONAL, Vec3::new(0.3, -1.0, 0.2))];
    let settings = ShadowSettings::default();
    let wide = (Vec3::new(-50.0, 0.0, -50.0), Vec3::new(50.0, 10.0, 50.0));
    let first = fitted(&mut sun, wide, turned(Vec3::Y, 0.0), &settings).views;
    assert_eq!(sun[0].view_count, 4);
    for (i, yaw) in (1..40).map(|i| (i as f32, i as f32 * 0.37)) {
        let eye = Vec3::new(i * 0.531, 1.0 + i * 0.1, -i * 0.77);
        let views = fitted(&mut sun, wide, turned(eye, yaw), &settings).views;
        for (a, b) in first.iter().zip(&views) {
            assert_eq!(a.data.texel_m, b.data.texel_m, "yaw {yaw}");
            let texels =
                |view: &ShadowView| view.clip_from_ws.project_point3(Vec3::ZERO).truncate() * 0.5 * 2048.0;
            let off = texels(a) - texels(b);
            let off = (off - off.round()).abs().max_element();
            assert!(off < 0.02, "moved by a part {off} of a texel");
        }
    }
}

#[test]
fn every_visible_point_lies_in_a_cascade_and_near_ones_in_fine_ones() {
    let mut sun = [light(LightData::DIRECTIONAL, Vec3::new(0.3, -1.0, 0.2))];
    let settings = ShadowSettings::default();
    let wide = (Vec3::new(-50.0, -1.0, -50.0), Vec3::new(50.0, 10.0, 50.0));
    for yaw in [0.0, 0.7, 2.0] {
        for eye in [Vec3::Y, Vec3::new(30.0, 5.0, 20.0), Vec3::new(0.0, 20.0, 120.0)] {
            let camera = turned(eye, yaw);
            let views = fitted(&mut sun, wide, camera, &settings).views;
            let mut texels = views.iter().map(|view| view.data.texel_m);
            let mut last = 0.0;
            assert!(texels.all(|texel| std::mem::replace(&mut last, texel) <= texel));
            for i in 0..200 {
                let ndc = Vec3::new((i % 7) as f32 / 3.0 - 1.0, (i % 5) as f32 / 2.0 - 1.0, 0.5);
                let ray = camera.ws_from_clip.project_point3(ndc) - eye;
                let depth = 0.2 * 1.05f32.powi(i);
                let point = eye + ray * (depth / camera.forward_ws.dot(ray));
                if point.clamp(wide.0, wide.1) != point {
                    continue;
                }
                let slice = views.iter().position(|view| depth < view.data.end_m).unwrap();
                let view = &views[slice];
                let p = view.clip_from_ws.project_point3(point);
                let share = 1.0 - 2.0 * view.data.border / 2048.0;
                assert!(
                    p.truncate().abs().max_element() <= share + 1e-3 && (0.0..=1.0).contains(&p.z),
                    "eye {eye}, yaw {yaw}: {point} at {depth} m is at {p} of cascade {slice}"
                );
            }
        }
    }
}

#[test]
fn splits_by_hand_are_where_cascades_part() {
    let mut sun = [light(LightData::DIRECTIONAL, Vec3::new(0.3, -1.0, 0.2))];
    let wide = (Vec3::new(-50.0, -1.0, -50.0), Vec3::new(50.0, 10.0, 50.0));
    let mut slices = |splits: &[f32], eye| {
        let settings = ShadowSettings { splits: Splits(splits.to_vec()), ..ShadowSettings::default() };
        assert_eq!(settings.refused(), None);
        let views = fitted(&mut sun, wide, turned(eye, 0.0), &settings).views;
        views.iter().map(|view| (view.data.begin_m, view.data.end_m)).collect::<Vec<_>>()
    };
    let inside = slices(&[5.0, 20.0, 60.0], Vec3::Y);
    let ends: Vec<f32> = inside.iter().map(|slice| slice.1).collect();
    assert_eq!(ends[..3], [5.0, 20.0, 60.0]);
    assert!(ends[3] > 100.0, "the last one reaches as far as the scene: {ends:?}");
    assert!(inside.windows(2).all(|pair| pair[0].1 == pair[1].0));
    assert_eq!(slices(&[5.0, 20.0, 60.0, 80.0], Vec3::Y)[3], (60.0, 80.0));
    // From far outside, what is seen begins beyond the splits: no slice is empty or inside out.
    for splits in [&[5.0, 20.0, 60.0][..], &[5.0, 20.0, 60.0, 80.0], &[1e6, 2e6, 3e6]] {
        for (begin, end) in slices(splits, Vec3::new(0.0, 20.0, 900.0)) {
            assert!(begin < end && end.is_finite(), "{begin} to {end}");
        }
    }
}

#[test]
fn splits_that_part_another_number_of_cascades_are_refused() {
    use crate::settings::{SettingsGroup, Value};
    for (splits, cascades, right) in [
        ("5,20,60", 4, true),
        ("5,20,60,80", 4, true),
        ("5", 1, true),
        ("5,20", 4, false),
        ("1,2,3,4,5", 4, false),
    ] {
        let mut settings = ShadowSettings { cascades, ..ShadowSettings::default() };
        settings.set("splits", splits).unwrap().unwrap();
        assert_eq!(settings.splits.show(), splits);
        assert_eq!(settings.refused().is_none(), right, "{splits}, {cascades}");
        settings.layout = Layout::Single;
        assert_eq!(settings.refused(), None);
    }
    let by_picture =
        ShadowSettings { splits: Splits(vec![1.0; 3]), fit: Fit::Depth, ..ShadowSettings::default() };
    assert!(by_picture.refused().is_some_and(|reason| reason.contains("shadow.fit")));
    for wrong in ["", "5,", "20,5", "5,5", "-1,2", "0,1", "inf", "1,2,3,4,5,6,7,8,9", "binomial"] {
        assert!(ShadowSettings::default().set("splits", wrong).unwrap().is_err(), "{wrong} was taken");
    }
}

#[test]
fn the_thesis_darkens_by_representation() {
    let with = |representation| ShadowSettings {
        representation,
        darkens: Darkens::Thesis,
        floor: 0.3,
        ..ShadowSettings::default()
    };
    let of = |representation| {
        let settings = with(representation);
        let told = settings.parameters();
        (settings.darkened(), told.floor, told.clamps, told.bleed_reduction)
    };
    assert_eq!(of(Representation::Depth), (Darkens::Direct, 0.0, 0, 0.2));
    assert_eq!(of(Representation::Variance), (Darkens::Color, 0.3, 0, 0.2));
    assert_eq!(of(Representation::Exponential), (Darkens::ColorClamped, 0.3, 1, 0.0));
}

#[test]
fn point_lights_have_a_cube_or_two_hemispheres_and_wide_spots_too() {
    let mut lights = [light(LightData::POINT, Vec3::Y), light(LightData::SPOT, Vec3::NEG_Y)];
    lights[1].cone_rad = 1.5;
    let cubes = fitted(&mut lights, BOUNDS, camera(), &ShadowSettings::default());
    assert_eq!(cubes.views.len(), 12);
    assert_eq!((lights[1].first_view, lights[1].view_count), (6, 6));
    let settings = ShadowSettings { point_layout: PointLayout::Paraboloid, ..ShadowSettings::default() };
    let views = fitted(&mut lights, BOUNDS, camera(), &settings).views;
    assert_eq!(views.len(), 4);
    // Each axis is the middle of its hemisphere.
    for (view, axis) in views.iter().zip([Vec3::NEG_Y, Vec3::Y]) {
        let local = view.clip_from_ws.transform_point3(Vec3::new(0.0, 5.0, 0.0) + axis);
        assert!(local.distance(Vec3::Z) < 1e-5, "{local}");
    }
}

#[test]
fn more_lights_than_layers_are_said() {
    let mut lights = vec![light(LightData::POINT, Vec3::Y); 50];
    let views = fitted(&mut lights, BOUNDS, camera(), &ShadowSettings::default());
    assert_eq!(views.views.len(), 252);
    assert!(views.notes.iter().any(|note| note.contains("only the first 42 cast")), "{:?}", views.notes);
    assert_eq!(lights[42].first_view, LightData::NO_VIEW);
}

#[test]
fn every_pair_of_representation_and_filter_is_taken_or_refused_with_a_reason() {
    use crate::settings::{Kind, SettingsGroup, Value};
    let Kind::Choice(representations) = Representation::kind(&()) else { panic!() };
    let Kind::Choice(filters) = Filter::kind(&()) else { panic!() };
    let mut taken = 0;
    for (representation, _) in representations {
        for (filter, _) in filters {
            let mut settings = ShadowSettings::default();
            settings.set("representation", representation).unwrap().unwrap();
            settings.set("filter", filter).unwrap().unwrap();
            match settings.refused() {
                None => taken += 1,
                Some(reason) => {
                    let names = reason.contains(representation) && reason.contains(filter);
                    assert!(names && reason.contains(": "), "{reason}");
                }
            }
        }
    }
    assert_eq!(taken, 3 + 5 * 4);
}

/// Quads of half sides in the plane y = `height`, each around its middle, and a box of 1 m on the origin.
fn grounds(quads: &[(Vec3, f32)]) -> chiaro_scene::Scene {
    use chiaro_scene::{Mesh, Node, Primitive, Scene};
    let flat = |(at, half): (Vec3, f32)| Primitive {
        positions: [(-1.0, -1.0), (-1.0, 1.0), (1.0, 1.0), (1.0, -1.0)]
            .map(|(x, z)| at + half * Vec3::new(x, 0.0, z))
            .to_vec(),
        indices: vec![0, 1, 2, 0, 2, 3],
        ..Primitive::default()
    };
    let solid = Primitive {
        positions: corners((Vec3::new(-0.5, 0.0, -0.5), Vec3::new(0.5, 1.0, 0.5))).to_vec(),
        indices: vec![
            0, 1, 3, 0, 3, 2, 4, 6, 7, 4, 7, 5, 0, 4, 5, 0, 5, 1, 2, 3, 7, 2, 7, 6, 0, 2, 6, 0, 6, 4, 1, 5,
            7, 1, 7, 3,
        ],
        ..Primitive::default()
    };
    let primitives: Vec<_> = quads.iter().copied().map(flat).chain([solid]).collect();
    let count = primitives.len();
    let mesh = |primitive| Mesh { primitives: vec![primitive], ..Mesh::default() };
    Scene {
        meshes: primitives.into_iter().map(mesh).collect(),
        materials: vec![chiaro_scene::Material::default()],
        nodes: (0..count).map(|mesh| Node { mesh: Some(mesh), ..Node::default() }).collect(),
        ..Scene::default()
    }
}

/// The finest texel of a sun's cascades, metres, for a camera 5 m above the ground.
fn finest(quads: &[(Vec3, f32)], yaw: f32) -> f32 {
    finest_of(&grounds(quads), yaw)
}

fn finest_of(scene: &chiaro_scene::Scene, yaw: f32) -> f32 {
    let (bounds_ws, casters) = (scene.bounds().unwrap(), Casters::new(scene, &scene.rest(), &[]));
    let settings = ShadowSettings::default();
    let camera = turned(Vec3::new(3.0, 5.0, 4.0), yaw);
    let inputs = FitInputs {
        bounds_ws,
        casters: Some(&casters),
        camera,
        settings: &settings,
        clamps_depth: true,
        see_through: false,
    };
    fit(&mut [light(LightData::DIRECTIONAL, Vec3::new(0.5, -1.0, 0.2))], &inputs).views[0].data.texel_m
}

#[test]
fn ground_that_casts_on_nothing_makes_no_map_coarser_whatever_its_size_and_tiles() {
    for half in [150.0, 1.5e3, 5e4] {
        let tiles = [(-half, -half), (half, -half), (-half, half), (half, half)];
        let tiles = tiles.map(|(x, z)| (Vec3::new(x, 0.0, z), half));
        for yaw in [0.0, 1.0, 3.0] {
            assert!(finest(&[(Vec3::ZERO, half)], yaw) < 0.01, "{half} m");
            assert!(finest(&tiles, yaw) < 0.01, "tiles of {half} m");
        }
    }
}

#[test]
fn a_roof_over_everything_and_ground_below_other_ground_are_casters() {
    let (ground, roof) = ((Vec3::ZERO, 1500.0), (Vec3::Y * 20.0, 1500.0));
    assert!(finest(&[ground, roof], 0.0) > 0.05, "the roof casts on the ground");
}

#[test]
fn what_lies_far_away_by_itself_makes_no_map_coarser() {
    // A box on ground, and the same box again so many metres away.
    let with = |away_m: Option<f32>| {
        let mut scene = grounds(&[(Vec3::ZERO, 5.0)]);
        let mesh = Some(scene.meshes.len() - 1);
        scene.nodes.extend(away_m.map(|away_m| {
            let there = glam::Affine3A::from_translation(Vec3::new(away_m, 3.0, -away_m));
            let parent_from_node = chiaro_scene::Transform::Matrix(there);
            chiaro_scene::Node { mesh, parent_from_node, ..Default::default() }
        }));
        finest_of(&scene, 0.0)
    };
    let own = with(None);
    assert!(with(Some(500.0)) > 2.0 * own, "that is within reach");
    for far_m in [2e4, 1e9, 1e20] {
        assert_eq!(with(Some(far_m)), own, "{far_m} m");
    }
}

#[test]
fn what_was_moved_far_away_and_back_leaves_nothing() {
    let scene = grounds(&[(Vec3::ZERO, 5.0), (Vec3::Y * 3.0, 0.5)]);
    let mut casters = Casters::new(&scene, &scene.rest(), &[1]);
    let around = |at: Vec3| (at - 0.5, at + 0.5);
    let [near, next] = [Vec3::Y * 3.0, Vec3::new(1.0, 3.0, 0.0)].map(around);
    let at = |casters: &Casters| {
        let all = (Vec3::splat(-5.0), Vec3::splat(5.0));
        casters.shadowed(Vec3::NEG_Y, Vec3::ZERO, all).map_or(all, |shadowed| shadowed.casting)
    };
    casters.hold(&[near]);
    assert_eq!(casters.around(Vec3::ZERO), None, "there is one part");
    casters.hold(&[next]);
    let wandered = at(&casters);
    casters.hold(&[near]);
    assert_eq!(at(&casters), wandered, "maps would move whenever it does");
    casters.hold(&[around(Vec3::splat(1e12))]);
    let (lo, hi) = casters.around(Vec3::ZERO).unwrap();
    assert!(lo.min_element() >= -5.0 && hi.max_element() <= 5.0, "{lo} {hi}");
    casters.hold(&[near]);
    assert_eq!(casters.around(Vec3::ZERO), None);
}
